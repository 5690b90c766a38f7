"""The side that is modelled, at any time: its joints as an explanation has them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IntArray
from urmpipe_models.elementwise import Element
from urmpipe_pipeline.diagnosis.hypotheses import Group, State


@dataclass(frozen=True, eq=False)
class Clock:
    """The times of the compared rows on the clock of the modelled side, and how an offset moves them.

    t_reference = t_log + offset + drift t: where the log is modelled, the same time of the reference meets an
    earlier one of the log.

    Attributes:
        t: Times of the rows on the modelled side's clock in [s], shape (n,); of still poses their rows.
        direction: -1 if the log is modelled, 1 if the reference is.
        since: Times of the rows from the first sample of the log in [s], shape (n,).
    """

    t: FloatArray
    direction: float
    since: FloatArray

    def at(self, state: State, groups: Sequence[Group], rows: IntArray) -> FloatArray:
        """Return where rows are looked up, in [s], shape of rows."""
        lag, drift = (
            sum(float(state.of(g)[0]) for g in groups if g.kind == kind)
            for kind in ("time_lag", "clock_drift")
        )
        return np.asarray(self.t[rows] + self.direction * (lag + drift * self.since[rows]))

    def flow(self, group: Group, rows: IntArray) -> Element:
        """Return how a lag or a drift moves the times of rows, shape (n,), in [s] per unit of it."""
        return self.direction * (1.0 if group.kind == "time_lag" else self.since[rows])


class Joints(NamedTuple):
    """Joints of some rows as an explanation has them.

    Attributes:
        q: In [rad] or [m], shape (joints, n).
        rate: q' in [rad/s] or [m/s], shape (joints, n).
        own: q before its numbers are added in [rad] or [m], shape (joints, n).
        second: q'' of that in [rad/s2] or [m/s2], shape (joints, n).
        inside: Which rows lie within the time of their side, shape (n,).
    """

    q: FloatArray
    rate: FloatArray
    own: FloatArray
    second: FloatArray
    inside: BoolArray

    def factors(self, group: Group, clock: Clock, rows: IntArray) -> Iterator[tuple[int, Element]]:
        """Yield the joints that a number of a group moves at rows, shape (n,), and by how much per unit."""
        if group.kind == "joint_offset":
            yield group.joint or 0, 1.0
        elif group.kind == "joint_scale":
            yield group.joint or 0, self.own[group.joint or 0]
        elif group.kind == "compliance":
            yield group.joint or 0, self.second[group.joint or 0]
        else:
            by = clock.flow(group, rows)
            yield from ((j, rate * by) for j, rate in enumerate(self.rate))


@dataclass(frozen=True, eq=False)
class Motion:
    """Values over time, with their derivatives.

    Attributes:
        t: Times in [s], ascending, shape (m,).
        value: In any unit, shape (k, m).
        rate: First derivative, in that unit a second [s], shape (k, m).
        second: Second derivative, in that unit a second squared [s2], shape (k, m).
    """

    t: FloatArray
    value: FloatArray
    rate: FloatArray
    second: FloatArray

    def at(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
        """Return value, rate and second derivative at some times, and which lie within its own.

        x(t) = x_i + x'_i dt + x''_i dt^2 / 2 from the nearest sample: what noise a sample has it keeps, which
        a line between two would halve.

        Args:
            t: Times in [s], shape (n,).

        Returns:
            The first three in their units, shape (k, n), and which times lie within [s], shape (n,).
        """
        nearest = self.nearest(t)
        dt = t - self.t[nearest]
        value, rate, second = (part[:, nearest] for part in (self.value, self.rate, self.second))
        edge = 0.5 * (self.t[-1] - self.t[0]) / max(len(self.t) - 1, 1)
        inside = (t >= self.t[0] - edge) & (t <= self.t[-1] + edge)
        if dt.any():
            value = value + dt * (rate + 0.5 * dt * second)
            rate = rate + dt * second
        return value, rate, second, np.asarray(inside)

    def nearest(self, t: FloatArray) -> IntArray:
        """Return the sample nearest to each of some times in [s], shape (n,)."""
        after = np.clip(np.searchsorted(self.t, t), min(1, len(self.t) - 1), len(self.t) - 1)
        before = np.maximum(after - 1, 0)
        return np.asarray(np.where(t - self.t[before] <= self.t[after] - t, before, after))

    def joints(
        self, state: State, groups: Sequence[Group], clock: Clock, sample: IntArray, rows: IntArray
    ) -> Joints:
        """Return the joints of some rows as an explanation has them.

        Args:
            state: The explanation.
            groups: What it has numbers of.
            clock: The times of all rows.
            sample: Rows of the log, shape (n,).
            rows: Indices of those that are asked for, shape (k,).
        """
        q, rate, second, inside = self.at(clock.at(state, groups, rows))
        for edit in state.edits:
            q, rate, second = edit.of_joints(sample[rows], q, rate, second)
        own, q, rate = q, q.copy(), rate.copy()
        for group in groups:
            value = float(state.values[group.columns[0]])
            if group.joint is None or not value:
                continue
            j = group.joint
            if group.kind == "joint_offset":
                q[j] += value
            elif group.kind == "joint_scale":
                q[j] += value * own[j]
                rate[j] *= 1.0 + value
            else:
                q[j] += value * second[j]
        return Joints(q, rate, own, second, inside)


QUIET = 0.05
"""Share of a derivative that the noise of the samples may make, root mean square."""

WIDEST = 20
"""A derivative is told from a part of a log of at most one in so many."""


def motion_of(t: FloatArray | None, values: FloatArray) -> Motion:
    """Return samples as a motion, with derivatives from so many of them that noise is little of these.

    Noise of q'' is otherwise the noise of q once more: it would pass for a joint that gives way.

    Args:
        t: Times in [s], shape (m,); None without times, and then without derivatives.
        values: In any unit, shape (k, m); NaN where a sample is missing.
    """
    count = values.shape[1]
    none = np.zeros_like(values)
    if t is None or count < 3:
        return Motion(np.arange(count, dtype=float) if t is None else t, values, none, none)
    rate, second = none, none.copy()
    for row, first, other in zip(values, rate, second, strict=True):
        known = np.isfinite(row)
        if known.sum() > 3:
            whole = np.interp(t, t[known], row[known])
            first[:], other[:] = (_derivative(t, whole, order) for order in (1, 2))
    return Motion(t, values, rate, second)


def _derivative(t: FloatArray, values: FloatArray, order: int) -> FloatArray:
    """Return the first or second derivative, by means of as few samples as its noise allows.

    The noise of a sample is told by third differences, which take the motion away: their variance is 20
    times that of a sample.
    """
    noise = float(np.sqrt(np.mean(np.diff(values, 3) ** 2) / 20.0))
    reach = 1
    while True:
        mean = _mean(values, reach)
        found = np.gradient(mean, t) if reach == 1 and order == 1 else _difference(t, mean, reach, order)
        step = reach * float(np.median(np.diff(t)))
        left = noise / np.sqrt(reach) * (np.sqrt(0.5) / step if order == 1 else np.sqrt(6.0) / step**2)
        if left <= QUIET * float(np.sqrt(np.mean(found**2))) or 2 * reach * WIDEST > len(t):
            return found
        reach *= 2


def _mean(values: FloatArray, width: int) -> FloatArray:
    """Return the mean of so many samples around each, fewer at the ends."""
    if width < 2:
        return values
    index = np.arange(len(values))
    low, high = np.maximum(index - width // 2, 0), np.minimum(index + (width + 1) // 2, len(values))
    total = np.concatenate(([0.0], np.cumsum(values)))
    return np.asarray((total[high] - total[low]) / (high - low))


def _difference(t: FloatArray, values: FloatArray, reach: int, order: int) -> FloatArray:
    """Return a derivative by the values so many samples away on both sides, at the ends the nearest."""
    middle = np.arange(reach, len(t) - reach)
    before, after = middle - reach, middle + reach
    back, ahead = t[middle] - t[before], t[after] - t[middle]
    slopes = (values[middle] - values[before]) / back, (values[after] - values[middle]) / ahead
    inner = (
        (slopes[0] * ahead + slopes[1] * back) / (back + ahead)
        if order == 1
        else 2.0 * (slopes[1] - slopes[0]) / (back + ahead)
    )
    return np.pad(inner, reach, mode="edge")
