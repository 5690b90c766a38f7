"""The motion of a tool centre point, as the criteria of ISO 9283 take it: a command, or one cycle.

1. `Motion`: positions and orientations over time; its noise, its speed and the rests in it. Noise has the
   standard deviation sigma = 1.4826 median(|third difference|) / sqrt(20). The speed at a step is
   |mean of w rows after - mean of w rows before| over the time between both means, with the least w at
   which noise cannot look like a motion.
2. `build_motion` takes the rows that have a position, `thin_by_distance` rows that are a distance apart.
3. `assign_in_order` picks one candidate per stage, in the order of time, at the least total cost: where a
   cycle crosses the planes of a command, and where it rests in its poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.math3d import slerp

REST_SPEED = (1e-3, 1e-3)  # [m/s] and [rad/s]: what is slower rests
MIN_REST = 0.1  # s, the shortest rest
SPEED_MARGIN = 5.0  # standard errors: a lower speed is what noise makes of a rest
TIME_ROUNDING = 1e-9  # s: logs have times in whole nanoseconds
GAUSSIAN = 1.4826  # standard deviation / median absolute deviation of Gaussian noise
THIRD_DIFFERENCE = np.sqrt(20.0)  # of the noise of a third difference: sqrt(1 + 9 + 9 + 1)

Stage: TypeAlias = tuple[FloatArray, FloatArray]
"""Times of the candidates, rising, and the cost of each, shape (n,) both."""


class Rest(NamedTuple):
    """Rows of a motion in which it rests.

    Attributes:
        first: The first of them, from 0.
        last: The last of them, from 0.
    """

    first: int
    last: int


@dataclass(frozen=True, eq=False)
class Motion:
    """Positions and orientations of a tool centre point over time.

    Attributes:
        name: Its name.
        t: Times in [s], shape (n,), rising; of static poses their row numbers.
        position: In [m], shape (n, 3), without NaN.
        quat_xyzw: Orientations [-], shape (n, 4), each the nearer of q and -q to the one before, or None.
        timed: Whether its rows are a motion; else they are static poses.
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
        """Standard deviation of the noise of a coordinate in [m], by third differences."""
        return _noise(self.position)

    @cached_property
    def extent(self) -> float:
        """The largest span of a coordinate in [m]."""
        return float(np.ptp(self.position, axis=0).max()) if len(self) else 0.0

    @cached_property
    def rests(self) -> tuple[Rest, ...]:
        """Where it is slower than 1 mm/s and 1 mrad/s, or than five standard errors, for 0.1 s."""
        edges = np.flatnonzero(np.diff(np.concatenate(([False], self.is_resting, [False])).astype(np.int8)))
        rests = (Rest(int(first), int(last)) for first, last in edges.reshape(-1, 2))
        return tuple(
            rest for rest in rests if self.t[rest.last] - self.t[rest.first] >= MIN_REST - TIME_ROUNDING
        )

    @cached_property
    def is_resting(self) -> BoolArray:
        """Whether it rests from one row to the next, shape (n - 1,)."""
        resting = self.speed < max(REST_SPEED[0], SPEED_MARGIN * self.speed_error)
        if self.quat_xyzw is not None:  # |dq| is half of a small angle
            width, error = _speed_window(self.t, self.quat_xyzw, REST_SPEED[1] / 2.0)
            limit = max(REST_SPEED[1] / 2.0, SPEED_MARGIN * error)
            resting &= _smoothed_speed(self.t, self.quat_xyzw, width) < limit
        return resting

    @cached_property
    def speed(self) -> FloatArray:
        """Speed from one row to the next in [m/s], shape (n - 1,), averaged over the rows its noise needs."""
        return _smoothed_speed(self.t, self.position, self._window[0])

    @property
    def speed_error(self) -> float:
        """Standard error of `speed` in [m/s]."""
        return self._window[1]

    @cached_property
    def _window(self) -> tuple[int, float]:
        return _speed_window(self.t, self.position, REST_SPEED[0])

    def pose(self, rest: Rest) -> tuple[FloatArray, FloatArray | None]:
        """Return the mean position in [m], shape (3,), and orientation [-], shape (4,), of a rest.

        Of the second half of its time: the rows in which the motion still settles do not count.
        """
        middle = (self.t[rest.first] + self.t[rest.last]) / 2.0
        first = int(np.searchsorted(self.t, middle - TIME_ROUNDING))
        rows = slice(min(first, rest.last), rest.last + 1)
        position = self.position[rows].mean(axis=0)
        if self.quat_xyzw is None:
            return position, None
        quat = self.quat_xyzw[rows].mean(axis=0)
        return position, quat / np.linalg.norm(quat)

    def positions_at(self, t: FloatArray) -> FloatArray:
        """Return positions in [m], shape (k, 3), at times in [s], shape (k,): linear between rows."""
        return np.column_stack([np.interp(t, self.t, values) for values in self.position.T])

    def orientations_at(self, t: FloatArray) -> FloatArray | None:
        """Return orientations [-], shape (k, 4), at times in [s], shape (k,): spherically linear; or None."""
        quat = self.quat_xyzw
        if quat is None or len(self) < 2:
            return None if quat is None else np.repeat(quat, len(t), axis=0)
        after = np.clip(np.searchsorted(self.t, t), 1, len(self) - 1)
        share = (t - self.t[after - 1]) / (self.t[after] - self.t[after - 1])
        return slerp(quat[after - 1], quat[after], np.clip(share, 0.0, 1.0))

    def slice(self, first: int, last: int) -> Motion:
        """Return its rows from `first` to `last`, both included, with times from 0."""
        rows = slice(first, last + 1)
        quat = None if self.quat_xyzw is None else self.quat_xyzw[rows]
        t = self.t[rows] - self.t[first]
        return Motion(self.name, t, self.position[rows], quat, self.timed, self.row[rows])


def build_motion(
    name: str, t: FloatArray, position: FloatArray, quat_xyzw: FloatArray | None, *, timed: bool
) -> Motion:
    """Return a motion of the rows that have a position; static poses keep all, since their numbers count.

    Args:
        name: Its name.
        t: Times in [s], shape (n,).
        position: In [m], shape (n, 3), NaN where a row has none.
        quat_xyzw: Orientations [-], shape (n, 4); used only if each row with a position has one.
        timed: Whether the rows are a motion.
    """
    rows = np.flatnonzero(np.isfinite(position).all(axis=1) | (not timed))
    quat = None if quat_xyzw is None else quat_xyzw[rows]
    if quat is not None and not np.isfinite(quat).all():
        quat = None
    return Motion(name, t[rows], position[rows], quat, timed, rows.astype(np.int64))


def thin_by_distance(position: FloatArray, distance: float) -> IntArray:
    """Return rows of which each is at least a distance away from the row before.

    Args:
        position: In [m], shape (n, 3).
        distance: In [m]; with 0 the rows at which the position changes.

    Returns:
        Row numbers from 0, shape (k,).
    """
    step = np.linalg.norm(np.diff(position, axis=0), axis=1)
    rows = np.append(0, np.flatnonzero(step > 0.0) + 1)
    if not (step[step > 0.0] < distance).any():
        return rows.astype(np.int64)
    kept, (x, y, z) = [0], position[0].tolist()
    for row, (u, v, w) in zip(rows[1:].tolist(), position[rows[1:]].tolist(), strict=True):
        if (u - x) ** 2 + (v - y) ** 2 + (w - z) ** 2 >= distance**2:
            kept.append(row)
            x, y, z = u, v, w
    return np.array(kept, np.int64)


def _noise(values: FloatArray) -> float:
    if len(values) < 4:
        return 0.0
    third = np.abs(np.diff(values, n=3, axis=0))
    return float(GAUSSIAN * np.median(third, axis=0).max() / THIRD_DIFFERENCE)


def _speed_window(t: FloatArray, values: FloatArray, limit: float) -> tuple[int, float]:
    """Return the rows on either side over which a speed is averaged, and its standard error.

    The least number at which five standard errors are below a limit; both sides together last no longer
    than the shortest rest.
    """
    step = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    single = _noise(values) * float(np.sqrt(2.0 * values.shape[1])) / step  # over n rows: n^-1.5 of it
    enough = int(np.ceil((SPEED_MARGIN * single / limit) ** (2.0 / 3.0)))
    width = int(np.clip(enough, 1, max(int(MIN_REST / 2.0 / step), 1)))
    return width, single / width**1.5


def _smoothed_speed(t: FloatArray, values: FloatArray, width: int) -> FloatArray:
    count = len(t)
    columns = np.column_stack((t, values))
    total = np.concatenate((np.zeros((1, columns.shape[1])), np.cumsum(columns - columns[:1], axis=0)))
    row = np.arange(1, count)
    first, last = np.maximum(row - width, 0), np.minimum(row + width, count)
    before = (total[row] - total[first]) / (row - first)[:, np.newaxis]
    after = (total[last] - total[row]) / (last - row)[:, np.newaxis]
    step = after - before
    return np.asarray(np.linalg.norm(step[:, 1:], axis=1) / step[:, 0])


def assign_in_order(stages: Sequence[Stage]) -> list[int] | int:
    """Return the candidate of each stage, by dynamic programming.

    Of all choices whose times rise from stage to stage, the one with the least sum of costs. If there is
    none, the number of the first stage, from 0, that no choice reaches.

    Args:
        stages: The candidates of each stage.
    """
    before: Stage = (np.array([-np.inf]), np.zeros(1))
    predecessors: list[IntArray] = []
    for number, (t, cost) in enumerate(stages):
        t_before, cost_before = before
        least = np.minimum.accumulate(cost_before)
        is_less = np.concatenate(([True], cost_before[1:] < least[:-1]))
        cheapest = np.maximum.accumulate(np.where(is_less, np.arange(len(cost_before)), 0))
        last = (
            np.searchsorted(t_before, t, side="left") - 1
        )  # the last candidate of the stage before that is earlier
        total = np.where(last >= 0, least[last] + cost, np.inf)
        if not np.isfinite(total).any():
            return number
        predecessors.append(cheapest[last])
        before = t, total
    if not stages:
        return []
    chosen = [int(np.argmin(before[1]))]
    for previous in predecessors[:0:-1]:
        chosen.append(int(previous[chosen[-1]]))
    return chosen[::-1]
