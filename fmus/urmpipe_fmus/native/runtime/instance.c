/* SPDX-License-Identifier: MIT */
/* Making and freeing an instance, and what it says to the tool that runs it. */
#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "guid.h"

#define LONGEST_MESSAGE 2000

void set_start_values(Instance *me) {
    memset(&me->state, 0, sizeof me->state); /* also the padding: equal states have equal bytes */
    for (int k = 0; k < MODEL_VARIABLES; k++) me->state.value[k] = model_variables[k].start;
    me->stop = INFINITY;
    me->state.phase = INSTANTIATED;
    me->stale = 1;
}

/* Take the last character of a text in UTF-8 away, of which there may be a part only. */
static void drop_last(char text[]) {
    size_t end = strlen(text);
    while (end && (text[end - 1] & 0xC0) == 0x80) end--;
    if (end) text[end - 1] = '\0';
}

/* Say what happened. The message stands where the logger expects a format, with its percent signs doubled and
   without further arguments: loggers that are no C functions cannot read those. */
#if defined __GNUC__
__attribute__((format(printf, 2, 0)))
#endif
static void log_error(const Instance *me, const char *format, va_list arguments) {
    char message[LONGEST_MESSAGE], escaped[2 * LONGEST_MESSAGE];
    if (!me->logger) return;
    int used = snprintf(message, sizeof message, "unit %s: ", MODEL_NAME);
    if (used < 0 || used >= (int)sizeof message) used = 0;
    int room = (int)sizeof message - used;
    if (vsnprintf(message + used, (size_t)room, format, arguments) >= room) drop_last(message);
    char *to = escaped;
    for (const char *from = message; *from; from++) {
        if (*from == '%') *to++ = '%';
        *to++ = *from;
    }
    *to = '\0';
    me->logger(me->environment, me->name ? me->name : "", fmi2Error, "logStatusError", escaped);
}

fmi2Status report(const Instance *me, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    log_error(me, format, arguments);
    va_end(arguments);
    return fmi2Error;
}

/* Whether it is this model, in the form that this FMU has, that is asked for. */
static int is_ours(const Instance *me, const char *guid, fmi2Type type) {
    if (type != fmi2CoSimulation) {
        report(me, "fmuType: found model exchange, allowed: co-simulation");
        return 0;
    }
    if (!guid || strcmp(guid, MODEL_GUID) != 0) {
        report(me, "GUID: found %s, allowed: %s", guid ? guid : "none", MODEL_GUID);
        return 0;
    }
    return 1;
}

static char *copied_name(const Instance *me, const char *name) {
    char *copy = me->allocate(strlen(name) + 1, 1);
    return copy ? strcpy(copy, name) : NULL;
}

/* Read the table of the model, if it has one. */
static int fetch_table(Instance *me, const char *resources) {
    const char *fault = "found no fmuResourceLocation, allowed: the URI of the FMU's resources";
    if (MODEL_TABLE_COLUMNS == 0) return 1;
    if (resources) fault = read_table(&me->table, resources, MODEL_TABLE_COLUMNS, me->allocate);
    if (fault) report(me, "table.bin in %s: %s", resources ? resources : "the resources", fault);
    return !fault;
}

Instance *make_instance(const char *name, const char *guid, const char *resources, fmi2Type type,
                        const fmi2CallbackFunctions *callbacks) {
    Instance blank = {0}; /* what reports an error before there is an instance */
    int has_memory = callbacks && callbacks->allocateMemory && callbacks->freeMemory;
    blank.allocate = has_memory ? callbacks->allocateMemory : calloc;
    blank.release = has_memory ? callbacks->freeMemory : free;
    if (callbacks) {
        blank.logger = callbacks->logger;
        blank.environment = callbacks->componentEnvironment;
    }
    blank.name = name;
    if (!is_ours(&blank, guid, type)) return NULL;
    Instance *me = blank.allocate(1, sizeof *me);
    if (!me) {
        report(&blank, "found no memory for an instance, allowed: %lu bytes", (unsigned long)sizeof *me);
        return NULL;
    }
    *me = blank;
    me->name = me->copy = copied_name(me, name ? name : "");
    set_start_values(me);
    if (!me->copy) report(&blank, "found no memory for the name of an instance");
    if (me->copy && fetch_table(me, resources)) return me;
    free_instance(me);
    return NULL;
}

void free_instance(Instance *me) {
    if (!me) return;
    if (me->table.block) me->release(me->table.block);
    if (me->copy) me->release(me->copy);
    me->release(me);
}
