/* SPDX-License-Identifier: MIT */
/* A step through time: the rules are those of urmpipe's Instance in Python, and so is the order of operations. */
#include "stepping.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "variables.h"

#define STEP_SLACK 1e-9         /* a step of n internal steps but for this share of one takes n of them */
#define TIME_SLACK 1e-6         /* a communication point may differ by this share of the step from the own time */
#define ROUNDING (4.0 * DBL_EPSILON) /* and by this share of itself, however short the step: see instance.py */
#define STOP_SLACK 0.1          /* this share of a step past the stop time is what adding up steps may bring */
#define MOST_STEPS 2147483647.0 /* internal steps in a step */

/* Room for as many states; C has no empty arrays. */
typedef double States[MODEL_STATES + 1];

/* Take the sample: the memories' next values from the values at the communication point. */
static fmi2Status sample(Instance *me, double time) {
    double next[MODEL_MEMORIES + 1];
    Rows rows = rows_of(me, time);
    model_update(time, me->state.value, &rows, next);
    return put_values(me, model_memory_references, MODEL_MEMORIES, next, "next value");
}

/* Compute the derivatives at a time and for the states x + h k, the rest as it stands in v. */
static void rates(const Instance *me, double time, double v[], const double x[], double h, const double k[],
                  double result[]) {
    Rows rows = rows_of(me, time);
    for (int i = 0; i < MODEL_STATES; i++) v[model_state_references[i]] = x[i] + h * k[i];
    model_derivatives(time, v, &rows, result);
}

/* One step of the classical Runge-Kutta method (RK4). */
static fmi2Status runge_kutta(Instance *me, double t, double h) {
    double v[MODEL_VARIABLES];
    States x, k1, k2, k3, k4;
    Rows rows = rows_of(me, t);
    memcpy(v, me->state.value, sizeof v);
    for (int i = 0; i < MODEL_STATES; i++) x[i] = v[model_state_references[i]];
    model_derivatives(t, v, &rows, k1);
    rates(me, t + 0.5 * h, v, x, 0.5 * h, k1, k2);
    rates(me, t + 0.5 * h, v, x, 0.5 * h, k2, k3);
    rates(me, t + h, v, x, h, k3, k4);
    for (int i = 0; i < MODEL_STATES; i++) x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
    return put_values(me, model_state_references, MODEL_STATES, x, "state");
}

/* Integrate the states over a step in equal internal steps, none above the parameter internal_step. */
static fmi2Status integrate(Instance *me, double time, double step) {
    if (MODEL_STATES == 0) return fmi2OK;
    double largest = me->state.value[MODEL_INTERNAL_STEP];
    if (step / largest > MOST_STEPS)
        return report(me, "found a step of %g s in internal steps of %g s, allowed: %.0f internal steps", step, largest,
                     MOST_STEPS);
    double count = fmax(1.0, ceil(step / largest - STEP_SLACK));
    double h = step / count;
    for (double k = 0.0; k < count; k++)
        if (runge_kutta(me, time + k * h, h) != fmi2OK) return fmi2Error;
    return fmi2OK;
}

fmi2Status take_step(Instance *me, double time, double step) {
    if (!isfinite(time + step) || step <= 0.0)
        return report(me, "found a step of %g s at %g s, allowed: finite, above 0", step, time);
    if (!(fabs(time - me->state.time) <= fmax(TIME_SLACK * step, ROUNDING * fabs(time))))
        return report(me, "found a step from %.15g s, allowed: from where it stands, %.15g s", time, me->state.time);
    if (time + step - me->stop > STOP_SLACK * step)
        return report(me, "found a step to %g s, allowed: to the stop time, %g s", time + step, me->stop);
    me->state.running = 1;
    State before = me->state;
    if (sample(me, time) != fmi2OK || integrate(me, time, step) != fmi2OK) {
        me->state = before; /* and stale as it was: nothing changed */
        return fmi2Error;
    }
    me->state.time = time + step;
    me->stale = 1;
    return fmi2OK;
}
