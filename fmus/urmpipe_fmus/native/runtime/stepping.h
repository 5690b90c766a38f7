/* SPDX-License-Identifier: MIT */
/* A step through time. */
#ifndef STEPPING_H
#define STEPPING_H

#include "instance.h"

/* Take the sample at a communication point `time`, and go to the next, `step` seconds later. If a value is not
   finite on the way, the step is undone. */
fmi2Status take_step(Instance *me, double time, double step);

#endif
