"""A motion as the criteria take it: places over times, where it rests, and how much it trembles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.orientation import slerp

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
    def slow(self) -> NDArray[np.bool_]:
        """Where it rests from one row to the next, shape (n - 1,)."""
        still = _below(self.t, self.position, STILL[0])
        if self.quat_xyzw is not None:  # |dq| is half of a small angle
            still &= _below(self.t, self.quat_xyzw, STILL[1] / 2.0)
        return still

    @cached_property
    def speed(self) -> FloatArray:
        """Speed from one row to the next in [m/s], as free of noise as `slow` is, shape (n - 1,)."""
        return _speeds(self.t, self.position, _window(self.t, self.position, STILL[0]))

    @cached_property
    def speed_error(self) -> float:
        """Standard error of `speed` in [m/s]."""
        return _error(self.t, self.position, _window(self.t, self.position, STILL[0]))

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

    def at(self, t: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        """Return where it is at times in [s], shape (k,), in [m], shape (k, 3), and how [-], shape (k, 4).

        Between its rows on straight lines and great arcs.
        """
        place = np.column_stack([np.interp(t, self.t, values) for values in self.position.T])
        if self.quat_xyzw is None or len(self) < 2:
            return place, None if self.quat_xyzw is None else np.repeat(self.quat_xyzw, len(t), axis=0)
        after = np.clip(np.searchsorted(self.t, t), 1, len(self) - 1)
        share = (t - self.t[after - 1]) / (self.t[after] - self.t[after - 1])
        turned = slerp(self.quat_xyzw[after - 1], self.quat_xyzw[after], np.clip(share, 0.0, 1.0))
        return place, turned

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
    """Return a motion of the rows that have a place.

    Args:
        name: What it is called.
        t: Times in [s], shape (n,).
        position: In [m], shape (n, 3), NaN where a row has none.
        quat_xyzw: Orientations [-], shape (n, 4); taken only if each row with a place has one.
        timed: Whether the rows are a motion.
    """
    known = np.flatnonzero(np.isfinite(position).all(axis=1))
    quat = None if quat_xyzw is None else quat_xyzw[known]
    if quat is not None and not np.isfinite(quat).all():
        quat = None
    return Motion(name, t[known], position[known], quat, timed, known.astype(np.int64))


def _noise(values: FloatArray) -> float:
    """Return the standard deviation of what trembles of some columns, shape (n, k), in their unit."""
    if len(values) < 4:
        return 0.0
    third = np.abs(np.diff(values, n=3, axis=0))
    return float(GAUSSIAN * np.median(third, axis=0).max() / THIRD)


def _below(t: FloatArray, values: FloatArray, allowed: float) -> NDArray[np.bool_]:
    """Return where columns, shape (n, k), change more slowly than allowed or than noise lets one tell."""
    wide = _window(t, values, allowed)
    return _speeds(t, values, wide) < max(allowed, SURE * _error(t, values, wide))


def _window(t: FloatArray, values: FloatArray, allowed: float) -> int:
    """Return over how many rows on either side a speed is told, so that noise stays below what is allowed.

    Both sides together are no wider than the shortest rest.
    """
    step = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    widest = max(int(REST / 2.0 / step), 1)
    windows: Iterator[int] = iter(range(1, widest + 1))
    return next((one for one in windows if SURE * _error(t, values, one) <= allowed), widest)


def _error(t: FloatArray, values: FloatArray, wide: int) -> float:
    """Return the standard error of a speed that is told over so many rows on either side."""
    step = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    each = _noise(values) * np.sqrt(2.0 / wide) / (wide * step)
    return float(each * np.sqrt(values.shape[1]))


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
