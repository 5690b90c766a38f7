/* SPDX-License-Identifier: MIT */
/* Getting and setting the values of variables: what is refused, and outputs that are always fresh. */
#include "variables.h"

#include <math.h>

#define LARGEST_INTEGER 2147483647.0

static const char *const type_names[] = {"Real", "Integer", "Boolean"};

/* ---- what is refused ---- */

static int is_reference(const Instance *me, fmi2ValueReference reference) {
    if (reference < MODEL_VARIABLES) return 1;
    report(me, "value reference %u: found, allowed: 0 to %d", reference, MODEL_VARIABLES - 1);
    return 0;
}

/* Whether the variable has the type that the function `verb` (Get or Set) was called for. */
static int is_of_type(const Instance *me, const Variable *one, Type type, const char *verb) {
    if (one->type == type) return 1;
    report(me, "%s: found fmi2%s%s, allowed: fmi2%s%s", one->name, verb, type_names[type], verb, type_names[one->type]);
    return 0;
}

/* Whether a variable of this kind can be set now. */
static int is_settable(const Instance *me, const Variable *one) {
    const char *allowed = NULL;
    if (one->kind == OUTPUT) {
        report(me, "%s: set, allowed: an output is computed, not set", one->name);
        return 0;
    }
    if (me->state.running && (one->kind == STATE || one->kind == MEMORY)) allowed = "a state before the first step";
    if (me->state.running && one->kind == FIXED_PARAMETER) allowed = "a fixed parameter before the first step";
    if (allowed) report(me, "%s: set while it runs, allowed: %s", one->name, allowed);
    return !allowed;
}

/* Whether the variable can take the value. */
static int is_allowed(const Instance *me, const Variable *one, double value) {
    if (isnan(value)) /* C may print -nan or worse */
        report(me, "%s: found nan, allowed: a finite number", one->name);
    else if (!isfinite(value))
        report(me, "%s: found %g, allowed: a finite number", one->name, value);
    else if (!(one->min <= value && value <= one->max))
        report(me, "%s: found %.17g, allowed: %.15g to %.15g", one->name, value, one->min, one->max);
    else if (one->type == INTEGER && fabs(value) > LARGEST_INTEGER)
        report(me, "%s: found %.17g, allowed: an integer of 32 bits", one->name, value);
    else if (one->type == BOOLEAN && value != 0.0 && value != 1.0)
        report(me, "%s: found %.17g, allowed: 0 or 1", one->name, value);
    else
        return 1;
    return 0;
}

static int can_be_set(const Instance *me, Type type, fmi2ValueReference reference, double value) {
    if (!is_reference(me, reference)) return 0;
    const Variable *one = &model_variables[reference];
    return is_of_type(me, one, type, "Set") && is_settable(me, one) && is_allowed(me, one, value);
}

/* ---- setting ---- */

fmi2Status set_values(Instance *me, Type type, const fmi2ValueReference references[], size_t count,
                      const double values[]) {
    int refused = 0;
    for (size_t k = 0; k < count; k++) refused |= !can_be_set(me, type, references[k], values[k]);
    if (refused) return fmi2Error;
    for (size_t k = 0; k < count; k++) me->state.value[references[k]] = values[k];
    me->stale = 1;
    return fmi2OK;
}

fmi2Status put_values(Instance *me, const int references[], int count, const double found[], const char *what) {
    int refused = 0;
    for (int k = 0; k < count; k++) {
        if (isfinite(found[k])) continue;
        report(me, "%s %s is not finite at %g s", what, model_variables[references[k]].name, me->state.time);
        refused = 1;
    }
    if (refused) return fmi2Error;
    for (int k = 0; k < count; k++) me->state.value[references[k]] = found[k];
    return fmi2OK;
}

/* ---- getting ---- */

Rows rows_of(const Instance *me, double time) {
    Rows none = {NULL, NULL, 0.0};
    return MODEL_TABLE_COLUMNS > 0 ? rows_at(&me->table, time) : none;
}

/* Compute the outputs of the inputs as they stand now. */
static fmi2Status refresh(Instance *me) {
    double found[MODEL_OUTPUTS + 1]; /* C has no empty arrays */
    Rows rows = rows_of(me, me->state.time);
    model_outputs(me->state.time, me->state.value, &rows, found);
    if (put_values(me, model_output_references, MODEL_OUTPUTS, found, "output") != fmi2OK) return fmi2Error;
    me->stale = 0;
    return fmi2OK;
}

/* Whether a variable can be asked for its value. */
static int can_be_got(const Instance *me, Type type, fmi2ValueReference reference) {
    return is_reference(me, reference) && is_of_type(me, &model_variables[reference], type, "Get");
}

fmi2Status get_values(Instance *me, Type type, const fmi2ValueReference references[], size_t count, double values[]) {
    int refused = 0;
    for (size_t k = 0; k < count; k++) refused |= !can_be_got(me, type, references[k]);
    if (refused) return fmi2Error;
    for (size_t k = 0; k < count; k++) {
        if (me->stale && model_variables[references[k]].kind == OUTPUT && refresh(me) != fmi2OK) return fmi2Error;
        values[k] = me->state.value[references[k]];
    }
    return fmi2OK;
}
