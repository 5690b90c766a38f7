/* SPDX-License-Identifier: MIT */
/* The table of a model: what is in its file, and its rows about an instant.

   The file, all of it little-endian:
       8 bytes   "URMTABLE"
       uint64    1, the version of this layout
       uint64    rows
       uint64    columns
       int64     times in ns, one a row, rising
       double    values, a row after the other */
#include "table.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "resources.h"

#define MAGIC "URMTABLE"
#define HEADER 32
#define MOST_ROWS 2147483647u

/* ---- the file's content ---- */

static uint64_t number(const unsigned char *bytes) {
    uint64_t found = 0;
    for (int k = 7; k >= 0; k--) found = found << 8 | bytes[k];
    return found;
}

static double value(const unsigned char *bytes) {
    uint64_t bits = number(bytes);
    double found;
    memcpy(&found, &bits, sizeof found);
    return found;
}

/* Read the header: how many rows there are. Returns what is wrong, or NULL; so do the functions below. */
static const char *read_header(FILE *file, size_t columns, size_t *rows) {
    unsigned char header[HEADER];
    if (fread(header, 1, HEADER, file) != HEADER || memcmp(header, MAGIC, 8) != 0 || number(header + 8) != 1)
        return "found another kind of file, allowed: a table of urmpipe, version 1";
    if (number(header + 24) != columns) return "found another number of columns, allowed: that of the model's table";
    if (number(header + 16) < 1 || number(header + 16) > MOST_ROWS)
        return "found no rows or too many, allowed: 1 to 2147483647";
    *rows = (size_t)number(header + 16);
    return NULL;
}

/* Read the numbers into one array, times first, and turn them into doubles in their place. */
static const char *read_numbers(FILE *file, double *numbers, size_t rows, size_t columns) {
    size_t count = rows * (columns + 1);
    if (fread(numbers, 8, count, file) != count) return "found its end too early, allowed: all rows that it names";
    if (fgetc(file) != EOF) return "found more after its last row, allowed: the rows that it names";
    for (size_t k = 0; k < count; k++) {
        unsigned char bytes[8];
        memcpy(bytes, numbers + k, 8);
        numbers[k] = k < rows ? (double)(int64_t)number(bytes) : value(bytes);
        if (!isfinite(numbers[k])) return "found a value that is not finite, allowed: finite ones";
        if (k > 0 && k < rows && numbers[k] < numbers[k - 1]) return "found times that fall, allowed: rising ones";
    }
    return NULL;
}

static const char *read_file(FILE *file, Table *table, size_t columns, void *(*allocate)(size_t, size_t)) {
    const char *fault = read_header(file, columns, &table->rows);
    if (fault) return fault;
    double *numbers = allocate(table->rows * (columns + 1), sizeof *numbers);
    if (!numbers) return "found no memory for its rows";
    table->block = numbers;
    table->columns = columns;
    table->t_ns = numbers;
    table->values = numbers + table->rows;
    return read_numbers(file, numbers, table->rows, columns);
}

const char *read_table(Table *table, const char *resources, size_t columns, void *(*allocate)(size_t, size_t)) {
    FILE *file = open_resource(resources, "table.bin");
    if (!file) return "cannot be opened, allowed: the file that the FMU was built with";
    const char *fault = read_file(file, table, columns, allocate);
    fclose(file);
    return fault;
}

/* ---- the rows about an instant ---- */

/* The last row at or before an instant; the first, if that is after it. */
static size_t row_before(const Table *table, double instant) {
    size_t low = 0, high = table->rows; /* rows below `low` are at or before it, from `high` on they are after it */
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (table->t_ns[middle] <= instant)
            low = middle + 1;
        else
            high = middle;
    }
    return low ? low - 1 : 0;
}

Rows rows_at(const Table *table, double time) {
    double instant = round(time * 1e9);
    size_t before = row_before(table, instant);
    size_t after = before + 1 < table->rows ? before + 1 : before;
    Rows rows = {table->values + before * table->columns, table->values + after * table->columns, 0.0};
    if (after > before && instant > table->t_ns[before])
        rows.fraction = (instant - table->t_ns[before]) / (table->t_ns[after] - table->t_ns[before]);
    return rows;
}
