"""Rows that hold no sample: the zeros of an array that was allocated in advance, a row that marks the end.

In them every column is the same number, and no step of the motion leads there: with samples x of a column,

    |x[last] - mark| > MIN_JUMP max |x[i + 1] - x[i]|

in a column that moves; turns by which angles wrap are no steps. An arm that really comes to zero gets there
by its own steps.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.formats.numbers import Numbers

MARKS = (0.0, -1.0, 9999.0, -9999.0)  # the value of every column of such a row
MIN_MARKS = 2  # columns; a mark in a single one may be a sample
MIN_JUMP = 3.0  # largest steps; a continued motion makes one, and three after two lost samples
MIN_SAMPLES = 3  # fewer have no usual step
TURN_TOLERANCE = 1.01  # x a turn; angles between -1 and 1 turn go beyond them by no more

END = "end-rows"
START = "start-rows"


def end_rows(values: FloatArray) -> int:
    """Return how many rows at the end hold no sample.

    Columns that rise or fall through the whole table, such as a clock or a count, are ignored.

    Args:
        values: All columns of numbers in the file's own units, shape (n, columns).
    """
    if len(values) <= MIN_SAMPLES:
        return 0
    row_steps = np.diff(values, axis=0)
    is_clock = (row_steps > 0).all(axis=0) | (row_steps < 0).all(axis=0)
    marked = [~is_clock, *(values[-1] == mark for mark in MARKS)]  # a joint may rise up to the mark
    return max(_count_marked(values[:, columns]) for columns in marked if (columns | is_clock).all())


def _count_marked(values: FloatArray) -> int:
    if values.shape[1] < MIN_MARKS or not _is_mark(values[-1]):
        return 0
    unmarked = np.flatnonzero((values != values[-1]).any(axis=1))
    if len(unmarked) < MIN_SAMPLES:
        return 0
    samples = values[: unmarked[-1] + 1]
    largest = np.array([np.fmax.reduce(np.abs(steps(column))) for column in samples.T])
    moves = largest > 0.0 if (largest > 0.0).any() else np.ones(len(largest), dtype=bool)
    jumps = np.abs(samples[-1] - values[-1]) > MIN_JUMP * largest
    return len(values) - len(samples) if (jumps & moves).any() else 0


def _is_mark(row: FloatArray) -> bool:
    return bool(row[0] in MARKS and (row == row[0]).all())


def without_padding(numbers: Numbers, read_all: Callable[[], Numbers]) -> tuple[Numbers, list[LogWarning]]:
    """Return numbers without the rows at the end that hold no sample, and the warnings.

    Such rows at the start are a warning, and stay.

    Args:
        numbers: The rows of the columns that are used.
        read_all: Gives all columns of numbers of the table; called where those that are used may be padded.
    """
    used = numbers.values
    if len(used) <= MIN_SAMPLES or not used.shape[1] or not (_is_mark(used[-1]) or _is_mark(used[0])):
        return numbers, []
    table, warnings = read_all(), []
    ends = end_rows(table.values)
    samples = table.values[: len(table.values) - ends]
    starts = end_rows(samples[::-1])
    if ends:
        last = table.file_row(len(table.values))
        place = f"data row {last}" if ends == 1 else f"data rows {table.file_row(len(samples) + 1)} to {last}"
        message = f"the end of the file, {place}, holds {used[-1, 0]:g} in every column"
        message += ", and no step of the motion leads there: left out as padding or end mark"
        warnings.append(LogWarning(END, message))
        rows = np.arange(1, len(used) + 1) if numbers.rows is None else numbers.rows
        count = np.searchsorted(rows, table.file_row(len(samples)), side="right")
        numbers = numbers.at(slice(int(count)))
    if starts > 1:
        message = f"the first {starts} rows hold {used[0, 0]:g} in every column, and then the values jump"
        warnings.append(LogWarning(START, f"{message}: had the controller not started?", numbers.file_row(1)))
    return numbers, warnings


def steps(x: FloatArray) -> FloatArray:
    """Return the steps between values in any unit, shape (n - 1, ...), without the turns of wrapped angles.

    Angles are wrapped where all lie within a turn to either side.
    """
    known = np.abs(x[np.isfinite(x)])
    peak = float(known.max()) if len(known) else 0.0
    turn = next((turn for turn in (FULL_TURN, 360.0) if peak <= TURN_TOLERANCE * turn), np.inf)
    step = np.diff(x, axis=0)
    return step if np.isinf(turn) else step - turn * np.rint(step / turn)
