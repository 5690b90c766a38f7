/* SPDX-License-Identifier: MIT */
/* The functions of FMI 2.0 for co-simulation: the life cycle of an instance, and who does the work.

   All sources of the FMU are compiled by

       cc -shared -fPIC -O2 -ffp-contract=off -fvisibility=hidden -o NAME.so *.c -lm

   What is the model's own is in model.c; what is generated is model.c, model_sizes.h and guid.h. */
#include <math.h>
#include <string.h>

#include "guid.h"
#include "instance.h"
#include "stepping.h"
#include "variables.h"

#define NOT_TERMINATED (INSTANTIATED | INITIALIZING | STEPPING)

/* What fmi2GetFMUstate gives: the state, and whose it is. It is flat, and serialized as it stands. */
typedef struct {
    char guid[sizeof MODEL_GUID];
    State state;
} SavedState;

/* ---- the life cycle ---- */

static const char *phase_name(int phase) {
    switch (phase) {
    case INSTANTIATED: return "before fmi2EnterInitializationMode";
    case INITIALIZING: return "in initialization mode";
    case STEPPING: return "after fmi2ExitInitializationMode and before fmi2Terminate";
    default: return "after fmi2Terminate";
    }
}

/* Whether a function may be called in the phase in which the instance is. */
static int may(const Instance *me, const char *function, int phases) {
    if (!me) return 0;
    if (me->state.phase & phases) return 1;
    report(me, "%s: found a call %s, allowed: %s", function, phase_name(me->state.phase),
           phases == NOT_TERMINATED ? "before fmi2Terminate" : phase_name(phases));
    return 0;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

/* Errors are always told, and there is nothing else to tell. */
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    (void)loggingOn, (void)nCategories, (void)categories;
    return c ? fmi2OK : fmi2Error;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn) {
    (void)visible, (void)loggingOn;
    return make_instance(instanceName, fmuGUID, fmuResourceLocation, fmuType, functions);
}

void fmi2FreeInstance(fmi2Component c) { free_instance(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    Instance *me = c;
    (void)toleranceDefined, (void)tolerance; /* the steps are fixed */
    if (!may(me, "fmi2SetupExperiment", INSTANTIATED)) return fmi2Error;
    if (!isfinite(startTime)) return report(me, "startTime: found %g, allowed: a finite number", startTime);
    if (stopTimeDefined && !(stopTime >= startTime))
        return report(me, "stopTime: found %g, allowed: from the start time %g on", stopTime, startTime);
    me->state.time = startTime;
    me->stop = stopTimeDefined ? stopTime : INFINITY;
    me->stale = 1;
    return fmi2OK;
}

/* Go from one phase to another. */
static fmi2Status go(Instance *me, const char *function, int from, Phase to) {
    if (!may(me, function, from)) return fmi2Error;
    me->state.phase = (int)to;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    return go(c, "fmi2EnterInitializationMode", INSTANTIATED, INITIALIZING);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    return go(c, "fmi2ExitInitializationMode", INITIALIZING, STEPPING);
}

fmi2Status fmi2Terminate(fmi2Component c) { return go(c, "fmi2Terminate", STEPPING, TERMINATED); }

fmi2Status fmi2Reset(fmi2Component c) {
    if (!c) return fmi2Error;
    set_start_values(c);
    return fmi2OK;
}

/* ---- values ---- */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]) {
    return c ? get_values(c, REAL, vr, nvr, value) : fmi2Error;
}

/* A value that the model computed may be no whole number: the nearest is given, of two the even one. */
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[]) {
    if (!c) return fmi2Error;
    for (size_t k = 0; k < nvr; k++) {
        double found;
        if (get_values(c, INTEGER, vr + k, 1, &found) != fmi2OK) return fmi2Error;
        if (!(fabs(found) < 2147483647.5))
            return report(c, "%s: found %.17g, allowed: an integer of 32 bits", model_variables[vr[k]].name, found);
        found = nearbyint(found);
        value[k] = (fmi2Integer)found;
    }
    return fmi2OK;
}

/* A value that the model computed may be any number: all but 0 is true. */
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[]) {
    if (!c) return fmi2Error;
    for (size_t k = 0; k < nvr; k++) {
        double found;
        if (get_values(c, BOOLEAN, vr + k, 1, &found) != fmi2OK) return fmi2Error;
        value[k] = found != 0.0 ? fmi2True : fmi2False;
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
    if (!may(c, "fmi2SetReal", NOT_TERMINATED)) return fmi2Error;
    return set_values(c, REAL, vr, nvr, value);
}

/* Set whole numbers: all of them, or none if one is refused. */
static fmi2Status set_whole(Instance *me, const char *function, Type type, const fmi2ValueReference vr[], size_t nvr,
                            const int value[]) {
    State before;
    if (!may(me, function, NOT_TERMINATED)) return fmi2Error;
    before = me->state;
    int refused = 0;
    for (size_t k = 0; k < nvr; k++) {
        double one = value[k];
        refused |= set_values(me, type, vr + k, 1, &one) != fmi2OK;
    }
    if (!refused) return fmi2OK;
    me->state = before;
    return fmi2Error;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[]) {
    return set_whole(c, "fmi2SetInteger", INTEGER, vr, nvr, value);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[]) {
    return set_whole(c, "fmi2SetBoolean", BOOLEAN, vr, nvr, value);
}

/* No model has a String. */
static fmi2Status no_strings(const Instance *me, size_t nvr) {
    if (me && nvr == 0) return fmi2OK;
    return me ? report(me, "found a String, allowed: Real, Integer and Boolean variables") : fmi2Error;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]) {
    (void)vr, (void)value;
    return no_strings(c, nvr);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[]) {
    (void)vr, (void)value;
    return no_strings(c, nvr);
}

/* ---- the state ---- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    Instance *me = c;
    if (!me || !FMUstate) return fmi2Error;
    if (!*FMUstate) *FMUstate = me->allocate(1, sizeof(SavedState)); /* else the one that is given is used again */
    SavedState *saved = *FMUstate;
    if (!saved) return report(me, "found no memory for a state");
    memset(saved, 0, sizeof *saved);
    memcpy(saved->guid, MODEL_GUID, sizeof saved->guid);
    memcpy(&saved->state, &me->state, sizeof saved->state);
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    Instance *me = c;
    const SavedState *saved = FMUstate;
    if (!me) return fmi2Error;
    if (!saved) return report(me, "FMUstate: found none, allowed: one of fmi2GetFMUstate");
    if (memcmp(saved->guid, MODEL_GUID, sizeof saved->guid) != 0)
        return report(me, "FMUstate: found that of another FMU, allowed: GUID %s", MODEL_GUID);
    memcpy(&me->state, &saved->state, sizeof me->state);
    me->stale = 1;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    Instance *me = c;
    if (!me) return fmi2Error;
    if (!FMUstate || !*FMUstate) return fmi2OK;
    me->release(*FMUstate);
    *FMUstate = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    if (!c || !FMUstate || !size) return fmi2Error;
    *size = sizeof(SavedState);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size) {
    if (!c || !FMUstate || !serializedState) return fmi2Error;
    if (size < sizeof(SavedState))
        return report(c, "serializedState: found room for %lu bytes, allowed: %lu", (unsigned long)size,
                     (unsigned long)sizeof(SavedState));
    memcpy(serializedState, FMUstate, sizeof(SavedState));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
    Instance *me = c;
    if (!me || !serializedState || !FMUstate) return fmi2Error;
    if (size != sizeof(SavedState))
        return report(me, "serializedState: found %lu bytes, allowed: %lu", (unsigned long)size,
                     (unsigned long)sizeof(SavedState));
    if (memcmp(serializedState, MODEL_GUID, sizeof MODEL_GUID) != 0)
        return report(me, "serializedState: found that of another FMU, allowed: GUID %s", MODEL_GUID);
    if (!*FMUstate) *FMUstate = me->allocate(1, sizeof(SavedState));
    if (!*FMUstate) return report(me, "found no memory for a state");
    memcpy(*FMUstate, serializedState, sizeof(SavedState));
    return fmi2OK;
}

/* ---- stepping ---- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!may(c, "fmi2DoStep", STEPPING)) return fmi2Error;
    return take_step(c, currentCommunicationPoint, communicationStepSize);
}

/* A step is done when fmi2DoStep returns: there is never one to cancel. */
fmi2Status fmi2CancelStep(fmi2Component c) {
    return c ? report(c, "fmi2CancelStep: found no step that runs, allowed: while fmi2DoStep is pending") : fmi2Error;
}

/* ---- what the model description says this FMU does not do ---- */

static fmi2Status cannot(const Instance *me, const char *function) {
    return me ? report(me, "%s: found a call, allowed: what the model description says the FMU can do", function)
              : fmi2Error;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
    (void)vUnknown_ref, (void)nUnknown, (void)vKnown_ref, (void)nKnown, (void)dvKnown, (void)dvUnknown;
    return cannot(c, "fmi2GetDirectionalDerivative");
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    (void)vr, (void)nvr, (void)order, (void)value;
    return cannot(c, "fmi2SetRealInputDerivatives");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
    (void)vr, (void)nvr, (void)order, (void)value;
    return cannot(c, "fmi2GetRealOutputDerivatives");
}

/* ---- the status of a step that may still run: none does ---- */

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
    if (!c || !value || s != fmi2DoStepStatus) return cannot(c, "fmi2GetStatus");
    *value = fmi2OK;
    return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    const Instance *me = c;
    if (!me || !value || s != fmi2LastSuccessfulTime) return cannot(c, "fmi2GetRealStatus");
    *value = me->state.time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
    (void)s, (void)value;
    return cannot(c, "fmi2GetIntegerStatus");
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    if (!c || !value || s != fmi2Terminated) return cannot(c, "fmi2GetBooleanStatus");
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
    (void)s, (void)value;
    return cannot(c, "fmi2GetStringStatus");
}
