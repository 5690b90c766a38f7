/* SPDX-License-Identifier: MIT */
/* An instance of the model: what it remembers, and what it is given by the tool that runs it. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include "fmi2Functions.h"
#include "model.h"
#include "table.h"

typedef enum { INSTANTIATED = 1, INITIALIZING = 2, STEPPING = 4, TERMINATED = 8 } Phase;

/* All that an instance remembers. It is flat, so that a copy of its bytes is a copy of the state. */
typedef struct {
    double time;                   /* where it stands, s */
    double value[MODEL_VARIABLES]; /* by value reference */
    int phase;                     /* of FMI's life cycle, a Phase */
    int running;                   /* whether fixed parameters are fixed: from the first step on */
} State;

typedef struct {
    State state;
    int stale; /* whether the outputs in state.value are older than what they are computed from */
    double stop; /* where the simulation ends, s; infinite if that is not said */
    Table table;
    const char *name; /* to be told: the tool's text, and then `copy` */
    char *copy;
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    void (*release)(void *); /* frees what `allocate` gave */
    void *(*allocate)(size_t count, size_t size);
} Instance;

/* Make an instance at its start values; NULL, with the reason logged, if it cannot be made. */
Instance *make_instance(const char *name, const char *guid, const char *resources, fmi2Type type,
                        const fmi2CallbackFunctions *callbacks);

/* Free an instance and all that it holds. */
void free_instance(Instance *me);

/* Go back to the start values, as if it had just been made. */
void set_start_values(Instance *me);

/* Report an error to the tool's logger: "unit NAME: " and the message, which is formatted as by printf.
   Returns fmi2Error, so that the caller can `return report(...)`. */
fmi2Status report(const Instance *me, const char *format, ...)
#if defined __GNUC__
    __attribute__((format(printf, 2, 3)))
#endif
    ;

#endif
