"""How smoothly numbers go on in the ways in which a file may hold them: samples or joints as rows, or flat.

A motion is sampled many times in its shortest period: from sample to sample a joint goes on nearly straight,
while two joints have nothing in common. With the k-th differences of numbers x at a lag L,

    d1_L[i] = x[i + L] - x[i],    d2_L[i] = x[i + 2 L] - 2 x[i + L] + x[i],

a joint with n samples in a period of amplitude A has d1_1 up to 2 A sin(pi / n) and d2_1 up to
4 A sin(pi / n)^2; noise of deviation s has sqrt(2) s and sqrt(6) s at any lag, so that it never asks.

Rows that hold no sample: the zeros of an array that was allocated in advance, a row that marks the end.

In them every column is the same number, and no step of the motion leads there: with samples x of a column,

    |x[last] - mark| > JUMP max |x[i + 1] - x[i]|

in a column that moves; turns by which angles wrap are no steps. An arm that really comes to zero gets there
by steps of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.formats.numbers import Numbers

ROUGH = 0.1
"""What goes on as a motion has at most this share of the squared differences of what does not: swings with 14
samples in a period have 2 sin(pi / 14)^2 = 0.1 of those of noise, d1_1^2 / (2 variance)."""

SMOOTH = 0.05
"""Numbers with at most this share are one joint: it has so much with 20 samples in a period, more than there
are joints. Of two joints or more in turn it is 0.1 or more, also of angles that wrap."""

JUMP = 2.0
"""Where one joint ends and the next begins, d2_1 is so many times the largest within the joints (rms). Of
noise the largest of many numbers is above the rms of a few."""

MOST_JOINTS = 16
"""Joints, with times, rates or torques beside them, that rows or a flat array may stand for."""

LEAST_SAMPLES = 20
"""Fewer columns may be those of an ordinary table."""

LEAST_ROWS = 10
"""Fewer samples of a flat array tell nothing."""

NEARLY = 2.0
"""Roughness within this factor is the same: of two numbers of joints the smaller one is taken."""

CORNER = 2.0
"""Where one joint ends and the next begins, d1_1 is so many times that beside it (rms)."""

SLACK = 1.01
"""Angles between -1 and 1 turn pass these by no more than this."""


def goes_along_rows(values: FloatArray) -> bool:
    """Return whether numbers go on along the rows and not down the columns, so that rows may be joints.

    mean d1^2 along the rows <= ROUGH * mean d1^2 down the columns; of a single row its variance, twice.

    Args:
        values: In any unit, shape (rows, columns), NaN where one is missing.
    """
    rows, columns = values.shape
    if not 1 <= rows <= MOST_JOINTS or columns < max(LEAST_SAMPLES, rows + 1):
        return False
    along = _mean_square(np.array([steps(row) for row in values]))
    down = 2 * _variance(values[0]) if rows == 1 else _mean_square(np.diff(values, axis=0))
    return 0.0 < along <= ROUGH * down or (along == 0.0 < down and rows > 1)


def flat_ways(numbers: FloatArray) -> list[tuple[str, int]]:
    """Return how many joints numbers in a row may hold, and in which order: "flat" or "flat-by-joint".

    Args:
        numbers: In the order of the file and in any unit, shape (n,).

    Returns:
        The smoothest first; nothing where the numbers are one joint, or cannot be told from one.
    """
    if not np.isfinite(numbers).any():
        return []
    counts = [n for n in range(2, MOST_JOINTS + 1) if not len(numbers) % n and len(numbers) >= n * LEAST_ROWS]
    return [("flat", n) for n in _by_sample(numbers, counts)] or [
        ("flat-by-joint", n) for n in _by_joint(numbers, counts)
    ]


def _by_sample(x: FloatArray, counts: list[int]) -> list[int]:
    """Return each number of joints N with mean d2_N^2 <= ROUGH * mean d2_1^2, where x is not smooth."""
    if _mean_square(steps(x)) <= SMOOTH * 2 * _variance(x):
        return []
    rough = {n: _mean_square(_second(x, n)) for n in counts}
    found = [n for n in counts if rough[n] <= ROUGH * _mean_square(_second(x, 1))]
    return _smoothest({n: rough[n] for n in found})


def _by_joint(x: FloatArray, counts: list[int]) -> list[int]:
    """Return the numbers of joints with jumps between them alone: rms d2_1 >= JUMP * the largest elsewhere.

    A joint that is given steps stands still between them.
    """
    second, found = np.abs(_second(x, 1)), {}
    for n in counts:
        ends = np.arange(1, n) * (len(x) // n)
        if not _part_joints(steps(x), ends - 1):
            continue
        beside = np.zeros(len(second), dtype=bool)
        beside[[*(ends - 2), *(ends - 1)]] = True
        largest, jumps = np.nanmax(second[~beside]), np.sqrt(_mean_square(second[beside]))
        if 0.0 < JUMP * largest <= jumps:
            found[n] = float(largest)
    return _smoothest(found)


def _part_joints(between: FloatArray, ends: IntArray) -> bool:
    """Return whether steps at the ends are jumps from joint to joint, and no corners of a path.

    A path of straight pieces has no larger steps at its corners than beside them.
    """
    size = np.abs(between)
    beside = np.fmax(size[ends - 1], size[ends + 1])
    return _mean_square(size[ends]) >= CORNER**2 * _mean_square(beside)


def _smoothest(rough: Mapping[int, float]) -> list[int]:
    """Return numbers of joints, the smoothest first; of nearly equal ones the smallest.

    Twice as many joints are as smooth as the right number, and half as many are not.
    """
    best = next((n for n in sorted(rough) if rough[n] <= NEARLY * min(rough.values())), None)
    return sorted(rough, key=lambda n: (n != best, rough[n]))


def steps(x: FloatArray, lag: int = 1) -> FloatArray:
    """Return d1 at a lag, shape (n - lag,), of values in any unit: without the turns by which angles wrap."""
    known = np.abs(x[np.isfinite(x)])
    peak = float(known.max()) if len(known) else 0.0
    turn = next((turn for turn in (FULL_TURN, 360.0) if peak <= SLACK * turn), np.inf)
    step = x[lag:] - x[:-lag]
    return step if np.isinf(turn) else step - turn * np.rint(step / turn)


def _second(x: FloatArray, lag: int) -> FloatArray:
    """Return d2 at a lag, shape (n - 2 lag,)."""
    step = steps(x, lag)
    return np.asarray(step[lag:] - step[:-lag])


def _mean_square(values: FloatArray) -> float:
    """Return the mean square of values that are not missing; 0 of none."""
    known = values[np.isfinite(values)]
    return float(np.mean(known**2)) if len(known) else 0.0


def _variance(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.var(known)) if len(known) else 0.0


MARKS = (0.0, -1.0, 9999.0, -9999.0)
"""What stands in every column of such a row."""

FEWEST_MARKS = 2
"""A mark in one column alone may be a sample."""

JUMP_PADDING = 3.0
"""Padding is away from the last sample by more than so many of the largest steps: a motion that goes on makes
one of them, and one that is resumed behind two lost samples three."""

LEAST_ROWS_PADDING = 3
"""Fewer samples have no usual step."""

END = "end-rows"
START = "start-rows"


def end_rows(values: FloatArray) -> int:
    """Return how many rows at the end hold no sample.

    Columns that rise or fall through the whole table, such as a clock or a count, are ignored.

    Args:
        values: All columns of numbers in the file's own units, shape (n, columns).
    """
    if len(values) <= LEAST_ROWS_PADDING:
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
    if len(unmarked) < LEAST_ROWS_PADDING:
        return 0
    samples = values[: unmarked[-1] + 1]
    largest = np.array([np.fmax.reduce(np.abs(steps(column))) for column in samples.T])
    moves = largest > 0.0 if (largest > 0.0).any() else np.ones(len(largest), dtype=bool)
    far = np.abs(samples[-1] - values[-1]) > JUMP_PADDING * largest
    return len(values) - len(samples) if (far & moves).any() else 0


def start_rows(values: FloatArray) -> int:
    """Return how many rows at the start hold no sample.

    Args:
        values: All columns of numbers in the file's own units, shape (n, columns).
    """
    return end_rows(values[::-1])


def without_padding(numbers: Numbers, whole: Callable[[], Numbers]) -> tuple[Numbers, list[LogWarning]]:
    """Return numbers without the rows at the end that hold no sample, and the warnings.

    Such rows at the start are a warning, and stay.

    Args:
        numbers: The rows of the columns that are used.
        whole: Gives all columns of numbers of the table; called where those that are used may be padded.
    """
    used = numbers.values
    if len(used) <= LEAST_ROWS_PADDING or not used.shape[1] or not (_alike(used[-1]) or _alike(used[0])):
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
