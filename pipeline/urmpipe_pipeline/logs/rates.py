"""Rates next to joints, proved by the numbers.

1. `period_of`: the time between rows that joints and their rates show.
2. `proved_blocks`: of columns without names, which are joints and which their rates.

A column v is the rate of a column q if q changes as v says. With rows h apart, by the trapezoidal rule,

    q[k + 1] - q[k] = h (v[k] + v[k + 1]) / 2 + O(h^3),

so that the steps of q and the means of v are proportional, with one h for all joints.
"""

from __future__ import annotations

from itertools import permutations
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray

MAX_PERIOD_DEVIATION = 0.15  # of the periods that single joints show, as a share of their median
MIN_SURE_JOINTS = 4  # fewer may change as others say by chance, where no robot gives their number
MAX_JOINTS = 8  # of an arm, where their number is unknown
MIN_ROWS = 20  # fewer prove nothing
MAX_ROWS = 10_000  # pairs of rows, spread evenly, that decide
CLEAR = 0.1  # squares of steps above this share of what one in ten exceeds are clear motion
MIN_CLEAR_STEPS = 10  # of a joint; fewer show no period
MAX_VARIATION = 0.3  # median, of periods of single steps, where rates are those of the joints
SURE_VARIED = 0.1  # ... and where the period is exact to a percent: noise of a seventh of the rates
EXACT = 0.001  # share of a period by which it is rounded; well sampled, the rule errs by less


@np.errstate(divide="ignore", invalid="ignore")
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
    steps, means = _steps_and_mean_rates(q, rates)
    size = steps**2
    if len(steps) < MIN_ROWS or not size.any():
        return None
    is_clear = size > CLEAR * np.sort(size, axis=None)[int(0.9 * (size.size - 1))]
    is_clear &= np.count_nonzero(is_clear, axis=0) >= MIN_CLEAR_STEPS
    counts = np.count_nonzero(is_clear, axis=0)
    if np.count_nonzero(counts) < min(2, q.shape[1]):
        return None
    ratios = steps / means
    period = float(np.median(ratios[is_clear]))
    if not 0 < period < np.inf:
        return None
    deviations = np.abs(ratios / period - 1)
    variation = float(np.median(deviations[is_clear]))
    errors = [abs(np.median(ratios[rows, j]) / period - 1) for j, rows in enumerate(is_clear.T) if counts[j]]
    deviation = 4 * variation / np.sqrt(counts[counts > 0])  # 2.2 standard errors of a median
    if variation >= MAX_VARIATION or (errors > np.maximum(MAX_PERIOD_DEVIATION, deviation)).any():
        return None
    is_usual = is_clear & (deviations <= 4 * variation + 1e-9)
    period = float(np.abs(steps[is_usual]).sum() / np.abs(means[is_usual]).sum())
    rounded = (float(f"{period:.{digits}g}") for digits in range(1, 17))
    return next(value for value in rounded if abs(value - period) <= EXACT * period), variation


@np.errstate(divide="ignore", invalid="ignore", over="ignore")
def _agree_on(fit: tuple[float, float], q: FloatArray, rates: FloatArray, steps: int) -> bool:
    """Return whether several joints with different steady rates move as they say, over all rows."""
    means = rates.mean(axis=0)
    periods = (q[-1] - q[0]) / (means * steps)
    is_same = np.abs(periods / fit[0] - 1) <= MAX_PERIOD_DEVIATION
    sizes = np.abs(means[is_same])
    is_sure = len(sizes) >= MIN_SURE_JOINTS and fit[1] <= SURE_VARIED
    return is_sure and bool(sizes.std() > MAX_VARIATION * sizes.mean())


def _steps_and_mean_rates(q: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    rows = np.linspace(0, len(q) - 2, min(MAX_ROWS, max(len(q) - 1, 0))).astype(np.int64)
    steps, means = q[rows + 1] - q[rows], (rates[rows] + rates[rows + 1]) / 2
    outer = rates[np.maximum(rows - 1, 0)] + rates[np.minimum(rows + 2, len(q) - 1)]
    has_outer = np.isfinite(outer).all(axis=1) & (rows > 0) & (rows < len(q) - 2)
    means = np.where(has_outer[:, np.newaxis], (26 * means - outer) / 24, means)
    is_known = np.isfinite(steps).all(axis=1) & np.isfinite(means).all(axis=1)
    return steps[is_known], means[is_known]


class Block(NamedTuple):
    """Joints and their rates: the indices of their columns, and how much single steps over rates vary [-]."""

    joints: range
    rates: range
    variation: float


def proved_blocks(values: FloatArray, count: int | None) -> list[Block]:
    """Return the blocks of joints with rates next to them, by their numbers; the largest.

    Blocks of one size fill the table, as [q, qd] and [tau, q, qd], or q1, qd1, q2, qd2. A block that is the
    rates of another one is none of joints: [q, qd, qdd].

    Args:
        values: The columns in the file's own units, shape (n, columns); NaN where a sample is missing.
        count: How many joints the arm has; None if unknown.
    """
    columns = values.shape[1]
    rows = np.arange(0, len(values), 1 + len(values) // MAX_ROWS)
    rows = rows[np.isfinite(values[rows]).all(axis=1)]
    if len(rows) < MIN_ROWS:
        return []
    known = values[rows]
    varies = known.std(axis=0) > MAX_VARIATION * np.abs(known.mean(axis=0))  # else any ramp is a joint of it

    def prove(joints: range, rates: range) -> Block | None:
        q, v = (slice(place.start, place.stop, place.step) for place in (joints, rates))
        is_varied = np.count_nonzero(varies[v]) >= min(2, len(rates))
        if not is_varied and len(rates) < MIN_SURE_JOINTS:
            return None
        fit = period_of(values[:, q], values[:, v])
        if not is_varied and (
            fit is None or not _agree_on(fit, known[:, q], known[:, v], rows[-1] - rows[0])
        ):
            return None
        is_sure = count or len(joints) >= MIN_SURE_JOINTS or (fit and fit[1] <= SURE_VARIED)
        return Block(joints, rates, fit[1]) if fit and is_sure else None

    sizes = [count] if count else range(min(MAX_JOINTS, columns // 2), 1 if columns == 4 else 2, -1)
    for width in sizes:
        turns = columns // width
        if columns % width or turns < 2:
            continue
        pairs = list(permutations(range(turns), 2))
        places = [(range(i * width, (i + 1) * width), range(k * width, (k + 1) * width)) for i, k in pairs]
        places += [(range(i, columns, turns), range(k, columns, turns)) for i, k in pairs]
        blocks = [block for place in places if (block := prove(*place))]
        if first := [block for block in blocks if block.joints not in [other.rates for other in blocks]]:
            return first
    return []
