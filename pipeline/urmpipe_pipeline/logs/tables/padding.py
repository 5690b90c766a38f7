"""Rows that hold no sample: the zeros of an array that was allocated in advance, a row that marks the end.

In them every column is the same number, and no step of the motion leads there: with samples x of a column,

    |x[last] - mark| > JUMP max |x[i + 1] - x[i]|

in a column that moves; turns by which angles wrap are no steps. An arm that really comes to zero gets there
by steps of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.cells.cell import to_float
from urmpipe_pipeline.logs.tables.numbers import Numbers
from urmpipe_pipeline.logs.tables.smoothness import steps
from urmpipe_pipeline.logs.tables.sniff import Layout

MARKS = (0.0, -1.0, 9999.0, -9999.0)
"""What stands in every column of such a row."""

FEWEST_MARKS = 2
"""A mark in one column alone may be a sample."""

JUMP = 3.0
"""Padding is away from the last sample by more than so many of the largest steps: a motion that goes on makes
one of them, and one that is resumed behind two lost samples three."""

LEAST_ROWS = 3
"""Fewer samples have no usual step."""

END = "end-rows"
START = "start-rows"


def end_rows(values: FloatArray) -> int:
    """Return how many rows at the end hold no sample.

    Columns that rise or fall through the whole table, such as a clock or a count, are ignored.

    Args:
        values: All columns of numbers in the file's own units, shape (n, columns).
    """
    if len(values) <= LEAST_ROWS:
        return 0
    by_row = np.diff(values, axis=0)
    going_on = (by_row > 0).all(axis=0) | (by_row < 0).all(axis=0)
    ways = [~going_on, *(values[-1] == mark for mark in MARKS)]  # a joint may rise up to the mark
    return max(_marked(values[:, columns]) for columns in ways if (columns | going_on).all())


def _marked(values: FloatArray) -> int:
    """Return how many rows at the end are all one mark, and away from the motion, shape (n, columns)."""
    if values.shape[1] < FEWEST_MARKS or not _alike(values[-1]):
        return 0
    unmarked = np.flatnonzero((values != values[-1]).any(axis=1))
    if len(unmarked) < LEAST_ROWS:
        return 0
    samples = values[: unmarked[-1] + 1]
    largest = np.array([np.fmax.reduce(np.abs(steps(column))) for column in samples.T])
    moves = largest > 0.0 if (largest > 0.0).any() else np.ones(len(largest), dtype=bool)
    far = np.abs(samples[-1] - values[-1]) > JUMP * largest
    return len(values) - len(samples) if (far & moves).any() else 0


def start_rows(values: FloatArray) -> int:
    """Return how many rows at the start hold no sample.

    Args:
        values: All columns of numbers in the file's own units, shape (n, columns).
    """
    return end_rows(values[::-1])


def without_end_rows(layout: Layout) -> Layout:
    """Return a table with a sample of its rows that does not end with such rows: they tell of no column."""
    if len(layout.sample) <= LEAST_ROWS:
        return layout
    width = min(map(len, layout.sample))
    if sum(to_float(cell, layout.decimal) in MARKS for cell in layout.sample[-1][:width]) < FEWEST_MARKS:
        return layout
    cells = [[to_float(cell, layout.decimal) for cell in row[:width]] for row in layout.sample]
    columns = [column for column in zip(*cells, strict=True) if None not in column]
    count = end_rows(np.array(columns, dtype=np.float64).T) if columns else 0
    return replace(layout, sample=layout.sample[:-count]) if count else layout


def without_padding(numbers: Numbers, whole: Callable[[], Numbers]) -> tuple[Numbers, list[LogWarning]]:
    """Return numbers without the rows at the end that hold no sample, and the warnings.

    Such rows at the start are a warning, and stay.

    Args:
        numbers: The rows of the columns that are used.
        whole: Gives all columns of numbers of the table; called where those that are used may be padded.
    """
    used = numbers.values
    if len(used) <= LEAST_ROWS or not used.shape[1] or not (_alike(used[-1]) or _alike(used[0])):
        return numbers, []
    table, warnings = whole(), []
    values = table.values
    ends = end_rows(values)
    samples = values[: len(values) - ends]
    starts = start_rows(samples)
    if ends:
        last = table.file_row(len(values))
        place = f"data row {last}" if ends == 1 else f"data rows {table.file_row(len(samples) + 1)} to {last}"
        message = f"the end of the file, {place}, holds {used[-1, 0]:g} in every column"
        message += ", and no step of the motion leads there: left out as padding or end mark"
        warnings.append(LogWarning(END, message))
        rows = np.arange(1, len(used) + 1) if numbers.rows is None else numbers.rows
        kept = np.searchsorted(rows, table.file_row(len(samples)), side="right")
        numbers = numbers.at(slice(int(kept)))
    if starts > 1:
        message = f"the first {starts} rows hold {used[0, 0]:g} in every column, and then the values jump"
        warnings.append(LogWarning(START, f"{message}: had the controller not started?", numbers.file_row(1)))
    return numbers, warnings


def _alike(row: FloatArray) -> bool:
    """Return whether all numbers of a row, shape (columns,), are the same, and mark no sample."""
    return bool(row[0] in MARKS and (row == row[0]).all())
