/* SPDX-License-Identifier: MIT */
/* Getting and setting the values of variables. */
#ifndef VARIABLES_H
#define VARIABLES_H

#include "instance.h"

/* Get values; outputs are those of the inputs as they stand now. A call for another type is refused. */
fmi2Status get_values(Instance *me, Type type, const fmi2ValueReference references[], size_t count, double values[]);

/* Set values: all of them, or none if one is refused. */
fmi2Status set_values(Instance *me, Type type, const fmi2ValueReference references[], size_t count,
                      const double values[]);

/* Take over new values at the places `references`; none if one is not finite. `what` they are, for the message. */
fmi2Status put_values(Instance *me, const int references[], int count, const double found[], const char *what);

/* The rows of the model's table about a time; of no use to a model without one. */
Rows rows_of(const Instance *me, double time);

#endif
