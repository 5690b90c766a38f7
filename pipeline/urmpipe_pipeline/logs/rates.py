"""Blocks of columns without names: which are joints and which their rates, proved by the numbers.

A column v is the rate of a column q if q goes on as v says. With the rows h apart, by the trapezoidal rule,

    q[k + 1] - q[k] = h (v[k] + v[k + 1]) / 2 + O(h^3),

so that the steps of q and the means of v are proportional, with one h for all joints.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray

CORRELATED = 0.9
"""Steps and rates of one joint correlate so: of measured rates 0.97 was seen, of torques and speeds less."""

UNRELATED = 0.5
"""Columns that correlate less are clearly no joint and its rate."""

ONE_PERIOD = 0.15
"""The periods that the joints of a block tell differ by this share of their median at the most."""

RESTS = 0.05
"""A joint whose steps are smaller than this share of the largest of its block proves nothing: noise."""

ALIKE = 0.02
"""Blocks whose correlations differ by less are not told apart; of the others the better is right."""

MOST_JOINTS = 8
"""Joints that an arm has, where nobody tells how many."""

OUTLYING = 8.0
"""Steps this many times larger than nine in ten are wraps and faults, no motion."""

LEAST_ROWS = 20
"""Fewer rows prove nothing."""

MOST_ROWS = 50_000
"""Pairs of rows, spread evenly, that decide."""

SURE = 0.99
"""Where steps and rates correlate so, the period that they tell is exact to a percent."""

CLEAR = 0.1  # steps times rates that are larger than this share of what one in ten exceeds are clear motion
LEAST_CLEAR = 10  # fewer clear steps of a joint show no period
MOST_VARIED = 0.3  # periods of single steps vary by less, in the median, where rates are those of the joints
SURE_VARIED = 0.1  # ... and where the period is exact to a percent: noise of a seventh of the rates

EXACT = 0.002
"""Share of a period by which it is rounded: of a motion that is well sampled the rule misses by less."""


@dataclass(frozen=True, slots=True)
class Block:
    """Joints beside their rates.

    Attributes:
        joints: Columns of the joints, by index.
        rates: Columns of their rates.
        period: Time between rows in units of value over rate: in [s] if these are rad and rad/s.
        correlation: Median correlation of steps and rates.
        weakest: The smallest of a joint that moves.
    """

    joints: range
    rates: range
    period: float
    correlation: float
    weakest: float

    def fills(self, columns: int) -> bool:
        """Return whether all columns of a table belong to blocks of its size: none is left over."""
        if self.joints.step > 1:
            return len(self.joints) * self.joints.step == columns
        return columns % len(self.joints) == 0 and _tile(self.joints, self.rates)


def proved_blocks(values: FloatArray, count: int | None) -> list[Block]:
    """Return the blocks of joints whose rates stand beside them, by their numbers; the largest.

    Their columns are adjacent, as in [q, qd] and [tau, q, qd], or every second or third, as in q1, qd1, q2,
    qd2. Columns that have rates and are themselves the rates of others are no joints: [q, qd, qdd].

    Args:
        values: The columns in the file's own units, shape (n, columns); NaN where a sample is missing.
        count: How many joints the arm has; None where nobody tells.
    """
    evidence = _Evidence.of(values)
    columns = values.shape[1]
    if evidence is None or columns < 2:
        return []
    sizes = [count] if count else range(min(MOST_JOINTS, columns // 2), 1 if columns == 4 else 2, -1)
    for size in sizes:
        alone = bool(count) and columns % size == 0
        tried = (
            evidence.block(*ranges)
            for ranges in _pairs_of_ranges(columns, size)
            if not alone or _tile(*ranges)
        )
        proved = [block for block in tried if block and (count or evidence.is_whole(block))]
        if proved:
            best = max(block.weakest for block in proved)
            proved = [block for block in proved if block.weakest >= best - ALIKE]
            least = min(map(evidence.rates_among, proved))
            return [block for block in proved if evidence.rates_among(block) == least]
    return []


def _tile(joints: range, rates: range) -> bool:
    """Return whether blocks side by side begin at multiples of their size; those in turns always do."""
    return joints.step > 1 or (joints.start % len(joints) == 0 and rates.start % len(joints) == 0)


def period_of(q: FloatArray, rates: FloatArray) -> tuple[float, float] | None:
    """Return the time between rows with which joints step as their rates say, and how much it varies.

    It is the sum of steps over that of mean rates, of the steps that move clearly and whose ratio is near its
    median: in [s] if the joints are in [rad] or [m] and the rates in [rad/s] or [m/s], both of shape
    (n, joints). It varies by the median of the relative deviations [-]. None where nothing moves, or joints
    and rates do not agree.
    """
    joints = q.shape[1]
    both, means = _steps_and_means(np.hstack([q, rates]))
    steps, means = both[:, :joints], means[:, joints:]
    size = np.abs(steps * means)
    if len(steps) < LEAST_ROWS or not size.any():
        return None
    clear = size > CLEAR * np.sort(size, axis=None)[int(0.9 * (size.size - 1))]
    each = [
        steps[at, j] / means[at, j] for j, at in enumerate(clear.T) if np.count_nonzero(at) >= LEAST_CLEAR
    ]
    if len(each) < min(2, joints):
        return None
    period = float(np.median(np.concatenate(each)))
    varies = float(np.median(np.abs(np.concatenate(each) / period - 1))) if period > 0 else np.inf
    off = np.array([abs(np.median(one) / period - 1) * np.sqrt(len(one)) for one in each])
    near = np.maximum(ONE_PERIOD * np.sqrt([len(one) for one in each]), 4 * varies)  # 2.2 standard errors
    if varies >= MOST_VARIED or (off > near).any():
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        usual = clear & (np.abs(steps / means / period - 1) <= 4 * varies + 1e-9)
    return float(np.abs(steps[usual]).sum() / np.abs(means[usual]).sum()), varies


def rounded_period(period: float) -> float:
    """Return a period with as few digits as are within what rates tell of it, in the same unit."""
    return next(
        one
        for digits in range(1, 17)
        if abs((one := float(f"{period:.{digits}g}")) - period) <= EXACT * period
    )


def _pairs_of_ranges(columns: int, size: int) -> Iterator[tuple[range, range]]:
    """Yield where so many joints and their rates may stand among columns: in two blocks, or in turns."""
    for start in range(columns - size + 1):
        joints = range(start, start + size)
        for other in range(columns - size + 1):
            if abs(other - start) >= size:
                yield joints, range(other, other + size)
    for step in range(2, columns // size + 1):
        for start in range(columns - (size - 1) * step):
            first = range(start, start + (size - 1) * step + 1, step)
            for shift in range(1 - step, step):
                end = start + shift + (size - 1) * step
                if shift and start + shift >= 0 and end < columns:
                    yield first, range(start + shift, end + 1, step)


@dataclass(frozen=True, slots=True, eq=False)
class _Evidence:
    """How columns go on as others say: of each pair, first the column that steps, shape (columns, columns).

    Attributes:
        correlation: Of the steps of the one and the means of the other [-].
        period: Their ratio: steps = period * means, by least squares.
        size: Root mean square of the steps of each column, in the file's own unit, shape (columns,).
    """

    correlation: FloatArray
    period: FloatArray
    size: FloatArray

    @classmethod
    def of(cls, values: FloatArray) -> _Evidence | None:
        """Return what columns of shape (n, columns) tell; None where there are too few rows."""
        steps, means = _steps_and_means(values)
        if len(steps) < LEAST_ROWS:
            return None
        moves = _in_motion(steps).astype(np.float64)
        clean, count = np.where(moves > 0, steps, 0.0), moves.sum(axis=0)[:, np.newaxis]
        cross, squares = clean.T @ means, moves.T @ means**2
        step, mean = clean.sum(axis=0)[:, np.newaxis] / count, moves.T @ means / count
        about = [(clean**2).sum(axis=0)[:, np.newaxis] - count * step**2, squares - count * mean**2]
        with np.errstate(divide="ignore", invalid="ignore"):
            correlation = (cross - count * step * mean) / np.sqrt(np.maximum(about[0] * about[1], 0.0))
            period = cross / squares
        size = np.sqrt((clean**2).sum(axis=0))
        correlation, period = (np.nan_to_num(one, posinf=0.0, neginf=0.0) for one in (correlation, period))
        return cls(correlation, period, size)

    def block(self, joints: range, rates: range) -> Block | None:
        """Return joints and their rates as a block if all that move agree, with one period; else None."""
        q, v = np.array(joints), np.array(rates)
        moved = self.size[q] > RESTS * self.size[q].max()
        agree = self.correlation[q, v][moved]
        if len(agree) < min(2, len(q)) or (agree < CORRELATED).any():
            return None
        periods = self.period[q, v][moved]
        usual = float(np.median(periods))
        if (np.abs(periods - usual) > ONE_PERIOD * usual).any():
            return None
        return Block(joints, rates, usual, float(np.median(agree)), float(agree.min()))

    def is_whole(self, block: Block) -> bool:
        """Return whether a block is no part of a larger one, and others of its size may stand beside it.

        Blocks side by side begin at multiples of their size, as do their rates. A block of three whose rates
        stand six columns away may be half of one of six, unless some of the others are clearly no rates.
        """
        joints, rates, columns = block.joints, block.rates, len(self.size)
        if joints.step > 1:
            return block.fills(columns)
        if not _tile(joints, rates):
            return False
        shift = rates.start - joints.start
        start = joints.start // abs(shift) * abs(shift)
        q = np.arange(start, start + abs(shift))
        if len(q) == len(joints) or min(start, start + shift) < 0 or max(q[-1], q[-1] + shift) >= columns:
            return True
        moved = self.size[q] > RESTS * self.size[q].max()
        return bool((self.correlation[q, q + shift][moved] < UNRELATED).any())

    def rates_among(self, block: Block) -> int:
        """Return how many joints of a block are the rate of another column, as far away as their own is."""
        shift = block.rates.start - block.joints.start
        before = [(joint - shift, joint) for joint in block.joints if 0 <= joint - shift < len(self.size)]
        return sum(
            self.correlation[pair] >= CORRELATED
            and abs(self.period[pair] - block.period) <= ONE_PERIOD * block.period
            for pair in before
        )


def _steps_and_means(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return steps from row to row and the means of both rows, shape (k, columns), where all are known."""
    before = np.linspace(0, len(values) - 2, min(MOST_ROWS, max(len(values) - 1, 0))).astype(np.int64)
    first, second = values[before], values[before + 1] if len(before) else values[:0]
    known = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
    return (second - first)[known], ((first + second) / 2)[known]


def _in_motion(steps: FloatArray) -> BoolArray:
    """Return which steps are no wraps or faults, shape (k, columns)."""
    size = np.abs(steps)
    usual = np.sort(size, axis=0)[int(0.9 * (len(size) - 1))]
    return np.asarray(size <= OUTLYING * np.where(usual > 0.0, usual, np.inf))
