/* SPDX-License-Identifier: MIT */
/* What a model consists of: model.c and model_sizes.h, which urmpipe generates, define it.

   All values are doubles, by value reference, in one array; an Integer is a whole number, a Boolean is 0 or 1. */
#ifndef MODEL_H
#define MODEL_H

#include "model_sizes.h"

typedef enum { REAL, INTEGER, BOOLEAN } Type;

/* PARAMETER: set from outside; INPUT: likewise, at every communication point; OUTPUT: computed;
   STATE: integrated; MEMORY: a discrete state, updated at every communication point. */
typedef enum { FIXED_PARAMETER, TUNABLE_PARAMETER, INPUT, OUTPUT, STATE, MEMORY } Kind;

typedef struct {
    const char *name;
    Type type;
    Kind kind;
    double start, min, max;
} Variable;

/* The rows of a table about an instant: the last at or before it, the one after that, and how far the instant
   is from one to the other, 0 <= fraction < 1. */
typedef struct {
    const double *before, *after;
    double fraction;
} Rows;

extern const Variable model_variables[]; /* MODEL_VARIABLES, by value reference */

/* Value references of the MODEL_OUTPUTS, MODEL_STATES and MODEL_MEMORIES, in the order of the functions' results. */
extern const int model_output_references[];
extern const int model_state_references[];
extern const int model_memory_references[];

/* The functions of the model, of the time in s, all values v by value reference, and the rows of its table. */
void model_outputs(double time, const double *v, const Rows *rows, double *outputs);
void model_derivatives(double time, const double *v, const Rows *rows, double *derivatives);
void model_update(double time, const double *v, const Rows *rows, double *next);

#endif
