/* SPDX-License-Identifier: MIT */
/* A table over time, read from resources/table.bin when an instance is made. */
#ifndef TABLE_H
#define TABLE_H

#include <stddef.h>

#include "model.h"

typedef struct {
    void *block;          /* what is allocated */
    size_t rows, columns;
    const double *t_ns;   /* times in ns, whole numbers, rising */
    const double *values; /* a row after the other */
} Table;

/* Read table.bin in the folder `resources`, a URI as fmi2Instantiate is given it. Returns what is wrong, or NULL;
   in both cases `block` is what there is to free. */
const char *read_table(Table *table, const char *resources, size_t columns, void *(*allocate)(size_t, size_t));

/* The rows about a time in s. The time is rounded to whole nanoseconds, halves away from zero. */
Rows rows_at(const Table *table, double time);

#endif
