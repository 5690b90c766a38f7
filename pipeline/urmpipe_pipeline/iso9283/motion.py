"""A motion as the criteria take it: places over times, where it rests, and how much it trembles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.math3d import slerp

STILL = (1e-3, 1e-3)
"""What is slower than this in [m/s] and [rad/s] rests."""

REST = 0.1
"""The shortest rest in [s]."""

SURE = 5.0
"""A speed counts from so many standard errors on: less is what noise makes of a rest."""

ROUNDING = 1e-9
"""What times in [s] may be off by: logs have them in whole nanoseconds."""

GAUSSIAN = 1.4826
"""Standard deviations a median absolute deviation is of Gaussian noise."""

THIRD = np.sqrt(20.0)
"""Standard deviations of noise that its third difference has: 1 + 9 + 9 + 1 under the root."""


@dataclass(frozen=True, slots=True)
class Rest:
    """Rows of a motion in which it rests.

    Attributes:
        first: The first of them, from 0.
        last: The last of them, from 0.
    """

    first: int
    last: int


@dataclass(frozen=True, eq=False)
class Motion:
    """Where a tool centre point was: a command, or one cycle of a test.

    Attributes:
        name: What it is called.
        t: Times in [s], shape (n,), rising; of still poses the numbers of their rows.
        position: In [m], shape (n, 3), without NaN.
        quat_xyzw: Orientation [-], shape (n, 4), each the nearer of q and -q to the one before; None without.
        timed: Whether its rows are a motion; else they are still poses.
        row: The rows of the log that these are, from 0, shape (n,).
    """

    name: str
    t: FloatArray
    position: FloatArray
    quat_xyzw: FloatArray | None
    timed: bool
    row: IntArray

    def __len__(self) -> int:
        return len(self.t)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of what trembles of a coordinate in [m], by third differences."""
        return _noise(self.position)

    @cached_property
    def extent(self) -> float:
        """The largest span of a coordinate in [m]."""
        return float(np.ptp(self.position, axis=0).max()) if len(self) else 0.0

    @cached_property
    def rests(self) -> tuple[Rest, ...]:
        """Where it rests: slower than 1 mm/s and 1 mrad/s for 0.1 s, or than its noise lets one tell."""
        still = self.slow
        edges = np.flatnonzero(np.diff(np.concatenate(([False], still, [False])).astype(np.int8)))
        spans = ((int(first), int(last)) for first, last in edges.reshape(-1, 2))
        return tuple(Rest(*one) for one in spans if self.t[one[1]] - self.t[one[0]] >= REST - ROUNDING)

    @cached_property
    def slow(self) -> BoolArray:
        """Where it rests from one row to the next, shape (n - 1,)."""
        still = self.speed < max(STILL[0], SURE * self.speed_error)
        if self.quat_xyzw is not None:  # |dq| is half of a small angle
            wide, error = _window(self.t, self.quat_xyzw, STILL[1] / 2.0)
            still &= _speeds(self.t, self.quat_xyzw, wide) < max(STILL[1] / 2.0, SURE * error)
        return still

    @cached_property
    def speed(self) -> FloatArray:
        """Speed from one row to the next in [m/s], over rows enough for its noise, shape (n - 1,)."""
        return _speeds(self.t, self.position, self._window[0])

    @property
    def speed_error(self) -> float:
        """Standard error of `speed` in [m/s]."""
        return self._window[1]

    @cached_property
    def _window(self) -> tuple[int, float]:
        return _window(self.t, self.position, STILL[0])

    def pose(self, rest: Rest) -> tuple[FloatArray, FloatArray | None]:
        """Return where it stands in the second half of a rest: in [m], shape (3,), and how [-], shape (4,).

        The mean of the rows: what still settles when it begins to rest is left out.
        """
        middle = (self.t[rest.first] + self.t[rest.last]) / 2.0
        first = int(np.searchsorted(self.t, middle - ROUNDING))
        rows = slice(min(first, rest.last), rest.last + 1)
        place = self.position[rows].mean(axis=0)
        if self.quat_xyzw is None:
            return place, None
        turned = self.quat_xyzw[rows].mean(axis=0)
        return place, turned / np.linalg.norm(turned)

    def places(self, t: FloatArray) -> FloatArray:
        """Return where it is at times in [s], shape (k,), in [m], shape (k, 3): straight between its rows."""
        return np.column_stack([np.interp(t, self.t, values) for values in self.position.T])

    def turned(self, t: FloatArray) -> FloatArray | None:
        """Return how it is turned at times in [s], shape (k,), [-], shape (k, 4): on great arcs."""
        quat = self.quat_xyzw
        if quat is None or len(self) < 2:
            return None if quat is None else np.repeat(quat, len(t), axis=0)
        after = np.clip(np.searchsorted(self.t, t), 1, len(self) - 1)
        share = (t - self.t[after - 1]) / (self.t[after] - self.t[after - 1])
        return slerp(quat[after - 1], quat[after], np.clip(share, 0.0, 1.0))

    def part(self, first: int, last: int, name: str) -> Motion:
        """Return some of its rows, both ends included, on their own clock."""
        rows = slice(first, last + 1)
        quat = None if self.quat_xyzw is None else self.quat_xyzw[rows]
        return Motion(
            name, self.t[rows] - self.t[first], self.position[rows], quat, self.timed, self.row[rows]
        )


def motion_of(
    name: str, t: FloatArray, position: FloatArray, quat_xyzw: FloatArray | None, *, timed: bool
) -> Motion:
    """Return a motion of the rows that have a place; still poses keep all, since their numbers count.

    Args:
        name: What it is called.
        t: Times in [s], shape (n,).
        position: In [m], shape (n, 3), NaN where a row has none.
        quat_xyzw: Orientations [-], shape (n, 4); taken only if each row with a place has one.
        timed: Whether the rows are a motion.
    """
    known = np.flatnonzero(np.isfinite(position).all(axis=1) | (not timed))
    quat = None if quat_xyzw is None else quat_xyzw[known]
    if quat is not None and not np.isfinite(quat).all():
        quat = None
    return Motion(name, t[known], position[known], quat, timed, known.astype(np.int64))


def apart_rows(place: FloatArray, least: float) -> IntArray:
    """Return rows of places in [m], shape (n, 3), of which each is no nearer than `least` to that before.

    Args:
        place: The places.
        least: In [m]; of 0 the rows at which the place changes.

    Returns:
        Their numbers from 0, shape (k,).
    """
    step = np.linalg.norm(np.diff(place, axis=0), axis=1)
    rows = np.append(0, np.flatnonzero(step > 0.0) + 1)
    if not (step[step > 0.0] < least).any():
        return rows.astype(np.int64)
    kept, (x, y, z) = [0], place[0].tolist()
    for row, (u, v, w) in zip(rows[1:].tolist(), place[rows[1:]].tolist(), strict=True):
        if (u - x) ** 2 + (v - y) ** 2 + (w - z) ** 2 >= least**2:
            kept.append(row)
            x, y, z = u, v, w
    return np.array(kept, np.int64)


def _noise(values: FloatArray) -> float:
    """Return the standard deviation of what trembles of some columns, shape (n, k), in their unit."""
    if len(values) < 4:
        return 0.0
    third = np.abs(np.diff(values, n=3, axis=0))
    return float(GAUSSIAN * np.median(third, axis=0).max() / THIRD)


def _window(t: FloatArray, values: FloatArray, allowed: float) -> tuple[int, float]:
    """Return over how many rows on either side a speed is told, and its standard error.

    The fewest by which noise stays below what is allowed; both sides together are no wider than the shortest
    rest.
    """
    step = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    single = _noise(values) * float(np.sqrt(2.0 * values.shape[1])) / step  # over n rows: n^-1.5 of it
    enough = int(np.ceil((SURE * single / allowed) ** (2.0 / 3.0)))
    wide = int(np.clip(enough, 1, max(int(REST / 2.0 / step), 1)))
    return wide, single / wide**1.5


def _speeds(t: FloatArray, values: FloatArray, wide: int) -> FloatArray:
    """Return how fast columns, shape (n, k), change from row to row, shape (n - 1,).

    |mean of the rows behind - mean of the rows before| over the time between both means.
    """
    count = len(t)
    every = np.column_stack((t, values))
    total = np.concatenate((np.zeros((1, every.shape[1])), np.cumsum(every - every[:1], axis=0)))
    row = np.arange(1, count)
    first, last = np.maximum(row - wide, 0), np.minimum(row + wide, count)
    before = (total[row] - total[first]) / (row - first)[:, np.newaxis]
    behind = (total[last] - total[row]) / (last - row)[:, np.newaxis]
    step = behind - before
    return np.asarray(np.linalg.norm(step[:, 1:], axis=1) / step[:, 0])


Stage: TypeAlias = tuple[FloatArray, FloatArray]
"""Times of the candidates, rising, and what each costs, shape (n,) both."""


def in_order(stages: Sequence[Stage]) -> list[int] | int:
    """Return which candidate of each stage is taken, by dynamic programming.

    Of all choices whose times rise from stage to stage, the one with the least sum of costs. Where there is
    none, the number of the first stage, from 0, that no choice reaches.

    Args:
        stages: The candidates of each.
    """
    before: Stage = (np.array([-np.inf]), np.zeros(1))
    came: list[IntArray] = []
    for number, (t, cost) in enumerate(stages):
        earlier_t, earlier = before
        least = np.minimum.accumulate(earlier)
        new = np.concatenate(([True], earlier[1:] < least[:-1]))
        who = np.maximum.accumulate(np.where(new, np.arange(len(earlier)), 0))
        last = np.searchsorted(earlier_t, t, side="left") - 1  # the last of the earlier ones before it
        total = np.where(last >= 0, least[last] + cost, np.inf)
        if not np.isfinite(total).any():
            return number
        came.append(who[last])
        before = t, total
    if not stages:
        return []
    chosen = [int(np.argmin(before[1]))]
    for back in came[:0:-1]:
        chosen.append(int(back[chosen[-1]]))
    return chosen[::-1]
