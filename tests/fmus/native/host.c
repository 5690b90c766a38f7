/* Runs an FMU's binary by a script from standard input, and prints the bits of numbers:

       host LIBRARY GUID RESOURCES < SCRIPT

       set REFERENCE NUMBER ...    get REFERENCE ...    step TIME STEP    state    (a line each)
       steps COUNT STEP            instances COUNT      resident

   It is compiled for Linux and for Windows, and with a sanitizer. */
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#if defined _WIN32
#include <windows.h>
static HMODULE library;
static void open_library(const char *path) { library = LoadLibraryA(path); }
static void *symbol(const char *name) { return (void *)GetProcAddress(library, name); }
#else
#include <dlfcn.h>
static void *library;
static void open_library(const char *path) { library = dlopen(path, RTLD_NOW); }
static void *symbol(const char *name) { return dlsym(library, name); }
#endif

#define LONGEST_LINE 100000
#define MOST 1000
#define AT_ONCE 100

static const char *guid, *resources;
static double now; /* where the instance stands, s */

static void told(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                 fmi2String message, ...) {
    char text[4000];
    va_list arguments;
    (void)environment, (void)name, (void)category;
    va_start(arguments, message);
    vsnprintf(text, sizeof text, message, arguments);
    va_end(arguments);
    printf("log %d %s\n", (int)status, text);
}

static void step(fmi2Component me, char *rest) {
    double time = strtod(rest, &rest), size = strtod(rest, &rest);
    int status = (int)((fmi2DoStepTYPE *)symbol("fmi2DoStep"))(me, time, size, fmi2True);
    if (status == fmi2OK) now = time + size;
    printf("step %d\n", status);
}

static void get(fmi2Component me, char *rest) {
    fmi2ValueReference references[MOST];
    double values[MOST] = {0};
    size_t count = 0;
    for (char *word = strtok(rest, " \n"); word; word = strtok(NULL, " \n"))
        references[count++] = (unsigned)strtoul(word, NULL, 10);
    printf("get %d", (int)((fmi2GetRealTYPE *)symbol("fmi2GetReal"))(me, references, count, values));
    for (size_t k = 0; k < count; k++) {
        uint64_t bits;
        memcpy(&bits, values + k, sizeof bits);
        printf(" %016" PRIx64, bits);
    }
    printf("\n");
}

static void set(fmi2Component me, char *rest) {
    fmi2ValueReference references[MOST];
    double values[MOST];
    size_t count = 0;
    for (char *word = strtok(rest, " \n"); word; word = strtok(NULL, " \n"), count++) {
        references[count] = (unsigned)strtoul(word, NULL, 10);
        values[count] = strtod(strtok(NULL, " \n"), NULL);
    }
    printf("set %d\n", (int)((fmi2SetRealTYPE *)symbol("fmi2SetReal"))(me, references, count, values));
}

/* Save the state, spoil it, and go back by its bytes. */
static void save_and_restore(fmi2Component me) {
    fmi2FMUstate state = NULL, again = NULL;
    size_t size = 0;
    int status = 0;
    status |= ((fmi2GetFMUstateTYPE *)symbol("fmi2GetFMUstate"))(me, &state);
    status |= ((fmi2SerializedFMUstateSizeTYPE *)symbol("fmi2SerializedFMUstateSize"))(me, state, &size);
    char *bytes = malloc(size);
    status |= ((fmi2SerializeFMUstateTYPE *)symbol("fmi2SerializeFMUstate"))(me, state, bytes, size);
    status |= ((fmi2DoStepTYPE *)symbol("fmi2DoStep"))(me, now, 0.01, fmi2True);
    status |= ((fmi2DeSerializeFMUstateTYPE *)symbol("fmi2DeSerializeFMUstate"))(me, bytes, size, &again);
    status |= ((fmi2SetFMUstateTYPE *)symbol("fmi2SetFMUstate"))(me, again);
    status |= ((fmi2FreeFMUstateTYPE *)symbol("fmi2FreeFMUstate"))(me, &state);
    status |= ((fmi2FreeFMUstateTYPE *)symbol("fmi2FreeFMUstate"))(me, &again);
    free(bytes);
    printf("state %d %d\n", status, state == NULL && again == NULL);
}

/* Many steps, whose sizes are added up. */
static void steps(fmi2Component me, char *rest) {
    fmi2DoStepTYPE *do_step = (fmi2DoStepTYPE *)symbol("fmi2DoStep");
    long count = strtol(rest, &rest, 10);
    double size = strtod(rest, NULL);
    int status = 0;
    for (long k = 0; k < count; k++, now += size) status |= do_step(me, now, size, fmi2True);
    printf("steps %d\n", status);
}

static fmi2Component made(void) {
    static const fmi2CallbackFunctions callbacks = {told, calloc, free, NULL, NULL};
    fmi2Component me = ((fmi2InstantiateTYPE *)symbol("fmi2Instantiate"))("host", fmi2CoSimulation, guid, resources,
                                                                          &callbacks, fmi2False, fmi2False);
    if (!me) return NULL;
    ((fmi2SetupExperimentTYPE *)symbol("fmi2SetupExperiment"))(me, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    ((fmi2EnterInitializationModeTYPE *)symbol("fmi2EnterInitializationMode"))(me);
    ((fmi2ExitInitializationModeTYPE *)symbol("fmi2ExitInitializationMode"))(me);
    return me;
}

/* Make, step and free instances, a hundred of them at the same time. */
static void instances(char *rest) {
    long count = strtol(rest, NULL, 10);
    fmi2Component all[AT_ONCE];
    int status = 0;
    for (long k = 0; k < count; k += AT_ONCE) {
        for (int i = 0; i < AT_ONCE; i++) {
            all[i] = made();
            status |= !all[i] || ((fmi2DoStepTYPE *)symbol("fmi2DoStep"))(all[i], 0.0, 0.005, fmi2True);
        }
        for (int i = 0; i < AT_ONCE; i++) ((fmi2FreeInstanceTYPE *)symbol("fmi2FreeInstance"))(all[i]);
    }
    printf("instances %d\n", status);
}

/* What the process holds in memory, in kB, where the system tells. */
static void resident(void) {
    char line[200];
    FILE *file = fopen("/proc/self/status", "r");
    while (file && fgets(line, sizeof line, file))
        if (strncmp(line, "VmRSS:", 6) == 0) printf("resident %ld\n", strtol(line + 6, NULL, 10));
    if (file) fclose(file);
}

static void obey(fmi2Component me, char *line) {
    if (strncmp(line, "set ", 4) == 0) set(me, line + 4);
    if (strncmp(line, "get ", 4) == 0) get(me, line + 4);
    if (strncmp(line, "step ", 5) == 0) step(me, line + 5);
    if (strncmp(line, "state", 5) == 0) save_and_restore(me);
    if (strncmp(line, "steps ", 6) == 0) steps(me, line + 6);
    if (strncmp(line, "instances ", 10) == 0) instances(line + 10);
    if (strncmp(line, "resident", 8) == 0) resident();
}

int main(int count, char **words) {
    static char line[LONGEST_LINE];
    if (count != 4) return 2;
    open_library(words[1]);
    if (!library) return printf("no library\n"), 3;
    guid = words[2], resources = words[3];
    fmi2Component me = made();
    if (!me) return printf("no instance\n"), 4;
    while (fgets(line, sizeof line, stdin)) obey(me, line);
    ((fmi2TerminateTYPE *)symbol("fmi2Terminate"))(me);
    ((fmi2FreeInstanceTYPE *)symbol("fmi2FreeInstance"))(me);
    return 0;
}
