"""What values say about their unit by themselves: their wraps, their speeds, the robot's limits, their size.

Wraps and limits prove a unit. Speeds rest on a clock, which may lie too: they contradict a unit, and where
none is told they are a reason to assume the other one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray

TURN = {"rad": math.tau, "deg": 360.0}
"""A turn in each unit."""

WRAP_SLACK = 20.0 / 360.0
"""A step this near to a turn, as a share of it, may be a wrap."""

FASTEST = 20.0
"""Speed in [rad/s] that no joint of an arm keeps up (1146 deg/s)."""

ROUNDED = 1.01
"""Robot files round their limits, and controllers pass them, by no more than this."""

BEYOND = 3.0
"""Values this many times beyond a joint's limit are no overshoot."""

ONE_TURN = math.tau * 1.01
"""Values in [rad] of joints that turn once either way, as UR's do: +-363 deg."""

TWO_TURNS = 2 * math.tau
"""No joint of an arm goes further than two turns either way in [rad]: larger values are hardly in rad."""

_SAMPLES = 10_000
"""Rows that tell how large values usually are."""

_WINDOW = 20
"""Rows over which a clock may hurry: those that a recorder got late and at once."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """What joints can do.

    Attributes:
        speed: No joint is faster for long, in [rad/s].
        reach: Largest absolute value that each joint's limits allow, in [rad]; inf without limits.
    """

    speed: float = FASTEST
    reach: tuple[float, ...] | float = math.inf

    @classmethod
    def of(cls, robot: Chain | None, turns: Sequence[int]) -> Bounds:
        """Return the bounds of some joints of a robot, by their index among those that move."""
        if robot is None:
            return cls()
        joints = [robot.moving[j] for j in turns]
        speed = min(FASTEST, 2 * max(joint.velocity for joint in joints))
        return cls(speed, tuple(max(abs(joint.lower), abs(joint.upper)) for joint in joints))

    def keeps(self, values: FloatArray) -> bool:
        """Return whether every joint has limits and usually keeps them: in [rad], shape (n, joints)."""
        limited = bool(np.isfinite(self.reach).all())
        return limited and bool((_usual_size(values) <= ROUNDED * np.asarray(self.reach)).all())

    def excludes(self, values: FloatArray) -> bool:
        """Return whether a joint usually is at twice its limits or more: in [rad], shape (n, joints)."""
        return bool((_usual_size(values) >= 2 * np.asarray(self.reach)).any())


@np.errstate(over="ignore", invalid="ignore")  # huge numbers: their steps are infinite
def degrees_proof(values: FloatArray, bounds: Bounds | None = None) -> str | None:
    """Return why values can only be in deg, or None if they may be in rad.

    They wrap by 360, or are beyond the robot's limits, and any arm's, in rad only, for more than a tenth of
    the rows. Values within one turn in rad are never doubted. They are in the file's own units, shape (n,
    columns).
    """
    if peak(values) <= math.tau:
        return None
    if count := int(wraps(values, "deg").sum()):
        return f"{format_count(count, 'step')} of about 360 from one row to the next"
    reach = np.asarray((bounds or Bounds()).reach)
    beyond = _usual_size(values) > np.maximum(BEYOND * reach, TWO_TURNS)
    if beyond.any() and (np.radians(_largest(values)) <= reach).all():
        return f"values up to {peak(values):.6g} are beyond the robot's limits as rad and within them as deg"
    return None


@np.errstate(over="ignore", invalid="ignore")
def too_fast(values: FloatArray, t_ns: IntArray | None, bounds: Bounds | None = None) -> str | None:
    """Return why values are hardly in rad: only in deg are they as slow as a joint; None if they may be.

    They are in the file's own units, shape (n, columns), at times in [ns], shape (n,), or None.
    """
    if t_ns is None or peak(values) <= math.tau:
        return None
    most = (bounds or Bounds()).speed
    speed = max(_usual_speed(one, t_ns) for one in values.T)
    if np.radians(speed) <= most < speed:
        return f"as rad it would turn at {speed:.3g} rad/s for a tenth of the time"
    return None


def radians_proof(values: FloatArray) -> str | None:
    """Return why values can only be in rad, or None if they may be in deg.

    A column stays within a turn in rad and wraps by 2 pi: in deg all these jumps would be of the same six
    degrees. They are in the file's own units, shape (n, columns).
    """
    if peak(values) > ONE_TURN:
        values = values[:, [j for j, one in enumerate(values.T) if peak(one) <= ONE_TURN]]
    count = int(wraps(values, "rad").sum())
    return f"{format_count(count, 'step')} of about 6.28 from one row to the next" if count else None


@np.errstate(over="ignore", invalid="ignore")
def wraps(values: FloatArray, unit: str) -> IntArray:
    """Return how often each column steps by a turn or two and goes on from there, shape (columns,).

    A spike is none: it steps back at once. Nor is a step of values that jump about: those of other rows are
    usually small, and a wrap is no further off whole turns than twice the largest of them.

    Args:
        values: In the file's own units, shape (n, columns).
        unit: Whose turns: rad or deg.
    """
    return np.array([_wraps(_known(one), TURN[unit]) for one in values.T], dtype=np.int64)


def _known(column: FloatArray) -> FloatArray:
    """Return the values of a column that are there; the sum says quickly that all are."""
    return column[~np.isnan(column)] if np.isnan(column.sum()) else column


def _wraps(values: FloatArray, turn: float) -> int:
    steps, slack = np.abs(np.diff(values)), WRAP_SLACK * turn
    rows = np.flatnonzero(steps >= turn - slack)  # few: what is done with all steps costs most
    off = np.abs(steps[rows] - turn * np.clip(np.rint(steps[rows] / turn), 1, 2))
    rows, off = rows[off <= slack], off[off <= slack]
    steps[rows] = 0.0
    others = len(steps) - len(rows)
    small = np.count_nonzero(steps <= slack) - len(rows)
    if not len(rows) or not others or small <= int(0.9 * (others - 1)):
        return 0
    rows = rows[off <= 2 * steps.max()]
    alone, joined = np.ones(len(rows), dtype=np.bool_), np.diff(rows) == 1
    alone[1:] &= ~joined
    alone[:-1] &= ~joined
    return int(np.count_nonzero(alone))


def peak(values: FloatArray) -> float:
    """Return the largest absolute value in any unit, of any shape but empty; NaN if there is none."""
    largest = max(values.max(), -values.min())
    if np.isnan(largest):  # slower, but deaf to NaN
        largest = max(np.fmax.reduce(values, axis=None), -np.fmin.reduce(values, axis=None))
    return float(largest)


def usual_peak(values: FloatArray) -> float:
    """Return the absolute value that a column exceeds in one row of a hundred, the largest of all columns.

    A spike is not among them. In any unit, shape (n, columns).
    """
    return float(_usual_size(values, 0.99).max(initial=0.0))


def _largest(values: FloatArray) -> FloatArray:
    return np.asarray(np.fmax.reduce(np.abs(values), axis=0))


def _usual_size(values: FloatArray, share: float = 0.9) -> FloatArray:
    """Return the absolute value below which each column is in a share of its rows; 0 without one."""
    some = values[:: max(1, len(values) // _SAMPLES)]
    return np.array([_quantile(np.abs(one[~np.isnan(one)]), share) for one in some.T])


def _quantile(values: FloatArray, share: float = 0.9) -> float:
    """Return the value below which a share of some values is; 0 without values."""
    at = int(share * (len(values) - 1)) if len(values) else 0
    return float(np.partition(values, at)[at]) if len(values) else 0.0  # np.quantile imports numpy.ma


def _usual_speed(column: FloatArray, t_ns: IntArray) -> float:
    """Return the speed that is exceeded in a tenth of the steps, per second.

    Rows that are closer in time than the rows around them are taken to be as far apart as these.
    """
    dt = np.diff(t_ns) * 1e-9
    if not len(dt):
        return 0.0
    starts = np.arange(0, len(dt), _WINDOW)
    counts = np.diff(np.append(starts, len(dt)))
    around = np.repeat(np.add.reduceat(dt, starts) / counts, counts)
    rates = np.abs(np.diff(column)) / np.maximum(dt, around)
    return _quantile(rates[np.isfinite(rates)])
