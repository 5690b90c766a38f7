"""Rates next to joints, proved by the numbers.

1. `proved_blocks`: of columns without names, which are joints and which their rates.
2. `period_of`: the time between rows that joints and their rates show.

A column v is the rate of a column q if q changes as v says. With rows h apart, by the trapezoidal rule,

    q[k + 1] - q[k] = h (v[k] + v[k + 1]) / 2 + O(h^3),

so that the steps of q and the means of v are proportional, with one h for all joints.
"""

from __future__ import annotations

from itertools import permutations
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray

MIN_CORRELATION = 0.9  # of steps and rates of one joint: 0.97 was seen of measured rates, less of torques
MAX_PERIOD_DEVIATION = 0.15  # of the periods that the joints of a block show, as a share of their median
MIN_MOTION = 0.05  # steps below this share of the largest of a block are noise
MAX_JOINTS = 8  # of an arm, where their number is unknown
MAX_USUAL_STEP = 8.0  # times nine in ten; larger ones are wraps and faults
MIN_ROWS = 20  # fewer prove nothing
MAX_ROWS = 50_000  # pairs of rows, spread evenly, that decide
SURE = 0.99  # where steps and rates correlate so, the period that they show is exact to a percent
CLEAR = 0.1  # squares of steps above this share of what one in ten exceeds are clear motion
MIN_CLEAR_STEPS = 10  # of a joint; fewer show no period
MAX_VARIATION = 0.3  # median, of periods of single steps, where rates are those of the joints
SURE_VARIED = 0.1  # ... and where the period is exact to a percent: noise of a seventh of the rates
EXACT = 0.001  # share of a period by which it is rounded; well sampled, the rule errs by less


class Block(NamedTuple):
    """Joints and their rates: the indices of their columns.

    Steps and rates correlate by `correlation` in the median, by `weakest` of the joint that fits worst.
    """

    joints: range
    rates: range
    correlation: float
    weakest: float


def proved_blocks(values: FloatArray, count: int | None) -> list[Block]:
    """Return the blocks of joints whose rates stand beside them, by their numbers; the largest.

    Blocks of one size fill the table, as [q, qd] and [tau, q, qd], or q1, qd1, q2, qd2. A block that is the
    rates of another one is none of joints: [q, qd, qdd].

    Args:
        values: The columns in the file's own units, shape (n, columns); NaN where a sample is missing.
        count: How many joints the arm has; None if unknown: then rates stand right behind or before joints.
    """
    columns = values.shape[1]
    steps, means = _steps_and_means(values)
    if len(steps) < MIN_ROWS or columns < 2:
        return []
    correlation, period, size = _correlate(steps, means)

    def prove(joints: range, rates: range) -> Block | None:
        q, v = np.array(joints), np.array(rates)
        moves = size[q] > MIN_MOTION * size[q].max()
        agree, periods = correlation[q, v][moves], period[q, v][moves]
        if len(agree) < min(2, len(q)) or (agree < MIN_CORRELATION).any():
            return None
        usual = np.median(periods)
        if (np.abs(periods - usual) > MAX_PERIOD_DEVIATION * usual).any():
            return None
        return Block(joints, rates, float(np.median(agree)), float(agree.min()))

    sizes = [count] if count else range(min(MAX_JOINTS, columns // 2), 1 if columns == 4 else 2, -1)
    for width in sizes:
        turns = columns // width
        if columns % width or turns < 2:
            continue
        pairs = list(permutations(range(turns), 2))
        places = [
            (range(i * width, (i + 1) * width), range(k * width, (k + 1) * width))
            for i, k in pairs
            if count or abs(i - k) == 1
        ]
        places += [(range(i, columns, turns), range(k, columns, turns)) for i, k in pairs]
        blocks = [block for place in places if (block := prove(*place))]
        if first := [block for block in blocks if block.joints not in [other.rates for other in blocks]]:
            return first
    return []


def period_of(q: FloatArray, rates: FloatArray) -> tuple[float, float] | None:
    """Return the time between rows with which joints step as their rates say, and how much it varies.

    It is the sum of steps over that of mean rates, of the steps that move clearly and whose ratio is near the
    median: in [s] if the joints are in [rad] or [m] and the rates in [rad/s] or [m/s], both of shape
    (n, joints), with as few digits as change it by 0.1 % at most. It varies by the median of the relative
    deviations [-]. None if nothing moves, or if joints and rates do not agree. With the rows h apart, the
    mean rate between rows k and k + 1 is

        (13 (v[k] + v[k + 1]) - v[k - 1] - v[k + 2]) / 24 + O(h^4),

    and (v[k] + v[k + 1]) / 2 + O(h^2) next to rows without a value.
    """
    joints = q.shape[1]
    steps, means = _steps_and_mean_rates(q, rates)
    size = steps**2
    if len(steps) < MIN_ROWS or not size.any():
        return None
    is_clear = size > CLEAR * np.sort(size, axis=None)[int(0.9 * (size.size - 1))]
    columns = [(steps[rows, j], means[rows, j]) for j, rows in enumerate(is_clear.T)]
    with np.errstate(divide="ignore"):
        ratios = [step / mean for step, mean in columns if len(step) >= MIN_CLEAR_STEPS]
    if len(ratios) < min(2, joints):
        return None
    period = float(np.median(np.concatenate(ratios)))
    variation = float(np.median(np.abs(np.concatenate(ratios) / period - 1))) if period > 0 else np.inf
    counts = np.array([len(ratio) for ratio in ratios])
    errors = np.array([abs(np.median(ratio) / period - 1) for ratio in ratios])
    if (
        variation >= MAX_VARIATION
        or (errors > np.maximum(MAX_PERIOD_DEVIATION, 4 * variation / np.sqrt(counts))).any()
    ):
        return None  # 2.2 standard errors of a median
    with np.errstate(divide="ignore", invalid="ignore"):
        is_usual = is_clear & (np.abs(means * period / steps - 1) <= 4 * variation + 1e-9)
    period = float(np.abs(steps[is_usual]).sum() / np.abs(means[is_usual]).sum())
    rounded = (float(f"{period:.{digits}g}") for digits in range(1, 17))
    return next(value for value in rounded if abs(value - period) <= EXACT * period), variation


def _steps_and_mean_rates(q: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    rows = np.linspace(0, len(q) - 2, min(MAX_ROWS, max(len(q) - 1, 0))).astype(np.int64)
    steps, means = q[rows + 1] - q[rows], (rates[rows] + rates[rows + 1]) / 2
    outer = rates[np.maximum(rows - 1, 0)] + rates[np.minimum(rows + 2, len(q) - 1)]
    has_outer = np.isfinite(outer).all(axis=1) & (rows > 0) & (rows < len(q) - 2)
    means = np.where(has_outer[:, np.newaxis], (26 * means - outer) / 24, means)
    is_known = np.isfinite(steps).all(axis=1) & np.isfinite(means).all(axis=1)
    return steps[is_known], means[is_known]


def _correlate(steps: FloatArray, means: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return how columns step as others say: correlation [-] and period, shape (columns, columns); and size.

    The first index is of the column that steps, the second of the rate: steps = period * means by least
    squares. The size is the root of the sum of squared steps of each column, in its own unit.
    """
    distance = np.abs(steps)
    usual = np.sort(distance, axis=0)[int(0.9 * (len(distance) - 1))]
    moves = distance <= MAX_USUAL_STEP * np.where(usual > 0.0, usual, np.inf)  # no wraps and faults
    clean, count = np.where(moves, steps, 0.0), moves.sum(axis=0)[:, np.newaxis]
    cross, squares = clean.T @ means, moves.T @ means**2
    step, mean = clean.sum(axis=0)[:, np.newaxis] / count, moves.T @ means / count
    about = [(clean**2).sum(axis=0)[:, np.newaxis] - count * step**2, squares - count * mean**2]
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = (cross - count * step * mean) / np.sqrt(np.maximum(about[0] * about[1], 0.0))
        period = cross / squares
    correlation, period = (np.nan_to_num(matrix, posinf=0.0, neginf=0.0) for matrix in (correlation, period))
    return correlation, period, np.sqrt((clean**2).sum(axis=0))


def _steps_and_means(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return steps from row to row and the means of both rows, shape (k, columns), where all are known."""
    before = np.linspace(0, len(values) - 2, min(MAX_ROWS, max(len(values) - 1, 0))).astype(np.int64)
    first, second = values[before], values[before + 1] if len(before) else values[:0]
    known = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
    return (second - first)[known], ((first + second) / 2)[known]
