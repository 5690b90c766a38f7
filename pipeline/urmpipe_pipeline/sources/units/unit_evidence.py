"""What joint values say about their unit by themselves: their jumps, their speeds, the robot's limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.chains.chain import Chain
from urmpipe_pipeline.text import counted

WRAP_SLACK_DEG = 20.0
"""A step this near to 360 is a wrap in degrees: in radians it would be 57 turns between two rows."""

FASTEST = 20.0
"""Speed in [rad/s] that no joint of an arm keeps up (1146 deg/s)."""

BEYOND = 3.0
"""Values this many times beyond a joint's limit are no overshoot."""


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


@np.errstate(over="ignore", invalid="ignore")  # huge numbers: their steps are infinite
def degrees_evidence(values: FloatArray, t_ns: IntArray | None, bounds: Bounds | None = None) -> str | None:
    """Return why joint values cannot be in rad, or None if they can.

    They cannot if they wrap by about 360, or if it is in degrees only that they are no faster than a joint
    can be for a tenth of the time, or that they keep the robot's limits. Values within one turn in rad are
    never doubted. They are in the file's own units, shape (n, joints), at times in [ns], shape (n,), or None.
    """
    if peak(values) <= math.tau:
        return None
    bounds = bounds or Bounds()
    wraps = sum(int((np.abs(np.abs(np.diff(one)) - 360.0) <= WRAP_SLACK_DEG).sum()) for one in values.T)
    if wraps:
        return f"{counted(wraps, 'step')} of about 360 from one row to the next"
    speed = 0.0 if t_ns is None else max(_usual_speed(np.abs(np.diff(one)), t_ns) for one in values.T)
    if np.radians(speed) <= bounds.speed < speed:
        return f"as rad it would turn at {speed:.3g} rad/s for a tenth of the time"
    largest, reach = np.nanmax(np.abs(values), axis=0), np.asarray(bounds.reach)
    if (np.radians(largest) <= reach).all() and (largest > BEYOND * reach).any():
        return f"values up to {largest.max():.6g} are beyond the robot's limits as rad and within them as deg"
    return None


def radians_evidence(values: FloatArray) -> str | None:
    """Return why joint values cannot be in deg, or None if they can.

    They are in the file's own units, shape (n, joints). They cannot if they stay within a turn in rad and
    wrap by about 2 pi: in deg all these jumps would be of the same six degrees.
    """
    if peak(values) > math.tau:
        return None
    slack = math.radians(WRAP_SLACK_DEG)
    wraps = int((np.abs(np.abs(np.diff(values, axis=0)) - math.tau) <= slack).sum())
    return f"{counted(wraps, 'step')} of about 6.28 from one row to the next" if wraps else None


def peak(values: FloatArray) -> float:
    """Return the largest absolute value in any unit, shape (n, columns), n > 0; NaN if there is none."""
    largest = max(values.max(), -values.min())
    if np.isnan(largest):  # slower, but deaf to NaN
        largest = max(np.fmax.reduce(values, axis=None), -np.fmin.reduce(values, axis=None))
    return float(largest)


def _usual_speed(steps: FloatArray, t_ns: IntArray) -> float:
    """Return the speed that is exceeded in a tenth of the steps, per second."""
    rates = steps / (np.diff(t_ns) * 1e-9)
    rates = rates[np.isfinite(rates)]
    at = int(0.9 * (len(rates) - 1)) if len(rates) else 0
    return float(np.partition(rates, at)[at]) if len(rates) else 0.0  # np.quantile imports numpy.ma
