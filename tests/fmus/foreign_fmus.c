/* An FMU for co-simulation by FMI 2.0, of which the models of the tests are made: `model.h` says what it computes. */
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "fmi2Functions.h"

typedef struct {
    double r[64];
    int i[16];
    int b[16];
    double time;
} Values;

typedef struct {
    Values v;
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    char name[64];
    fmi2Boolean terminated;
    double last;                                          /* last successful time of a discarded step */
} Model;

#define LOG(m, status, ...) (m)->logger((m)->environment, (m)->name, status, "log", __VA_ARGS__)

static int overflow(volatile int n) {                    /* overflows the stack */
    volatile char held[4096];
    held[0] = n;
    return n < 0 ? 0 : overflow(n + 1) + held[0];
}

static void take(size_t bytes) {                         /* takes memory; where it gets none, writes to NULL */
    volatile char *held = malloc(bytes);
    for (size_t i = 0; i < bytes; i += 4096) held[i] = 1;
}

static void compute(Model *m);                           /* outputs of inputs, parameters, states */
static fmi2Status step(Model *m, double t, double h);    /* states after a step */
#include "model.h"

__attribute__((constructor)) static void loaded(void) { LOAD }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean logging) {
    if (strcmp(guid, GUID)) return NULL;
    Model *m = calloc(1, sizeof(Model));
    m->logger = f->logger;
    m->environment = f->componentEnvironment;
    m->last = NAN;
    strncpy(m->name, name, sizeof m->name - 1);
    START
    return m;
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void fmi2FreeInstance(fmi2Component c) { FREE free(c); }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String k[]) { return fmi2OK; }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean d, fmi2Real tol, fmi2Real t, fmi2Boolean e, fmi2Real s) {
    SETUP
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { ENTER return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { EXIT compute(c); return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { TERMINATE return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { return fmi2OK; }

#define GET(kind, type, field) \
    fmi2Status fmi2Get##kind(fmi2Component c, const fmi2ValueReference r[], size_t n, type o[]) { \
        Model *m = c; \
        ON_GET \
        if (FRESH) compute(m); \
        for (size_t k = 0; k < n; k++) o[k] = m->v.field[r[k]]; \
        return fmi2OK; \
    } \
    fmi2Status fmi2Set##kind(fmi2Component c, const fmi2ValueReference r[], size_t n, const type o[]) { \
        Model *m = c; \
        ON_SET \
        for (size_t k = 0; k < n; k++) m->v.field[r[k]] = o[k]; \
        return fmi2OK; \
    }
GET(Real, fmi2Real, r)
GET(Integer, fmi2Integer, i)
GET(Boolean, fmi2Boolean, b)
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String o[]) { return fmi2Error; }
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2String o[]) {
    LOG((Model *)c, fmi2OK, "told %s", o[0]);
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s) {
    if (!*s) *s = malloc(sizeof(Values));
    memcpy(*s, &((Model *)c)->v, sizeof(Values));
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) { memcpy(&((Model *)c)->v, s, sizeof(Values)); return fmi2OK; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s) {
    free(*s);
    *s = NULL;
    return ((Model *)c)->v.i[15] ? fmi2Error : fmi2OK;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t *n) { return fmi2Error; }
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n) { return fmi2Error; }
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s) { return fmi2Error; }
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference u[], size_t nu, const fmi2ValueReference k[],
                                        size_t nk, const fmi2Real dk[], fmi2Real du[]) { return fmi2Error; }
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
                                       const fmi2Real v[]) { return fmi2Error; }
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
                                        fmi2Real v[]) { return fmi2Error; }

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no) {
    Model *m = c;
    if (VARIABLE_STEP ? m->v.time != t : fabs(m->v.time - t) > 1e-9) {
        LOG(m, fmi2Error, "asked to step from %.17g s, but stands at %.17g s", t, m->v.time);
        return fmi2Error;
    }
    fmi2Status status = step(m, t, h);
    if (status <= fmi2Warning) {
        if (!FRESH) compute(m);
        m->v.time = t + h;
    }
    return status;
}
fmi2Status fmi2CancelStep(fmi2Component c) { return fmi2Error; }
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind k, fmi2Status *s) { return fmi2Discard; }
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind k, fmi2Real *s) {
    *s = ((Model *)c)->last;
    return k == fmi2LastSuccessfulTime && !isnan(*s) ? fmi2OK : fmi2Discard;
}
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind k, fmi2Integer *s) { return fmi2Discard; }
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind k, fmi2Boolean *s) {
    *s = ((Model *)c)->terminated;
    return fmi2OK;
}
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind k, fmi2String *s) { return fmi2Discard; }
