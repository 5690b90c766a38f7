"""The law that runs a path in the least time within the limits of the joints, at rest at its stops.

With x = s'^2 and u = s'' the joints accelerate by q'' = (dq/ds) u + (d2q/ds2) x: their limits are linear in
both. On a grid of arc lengths, with u constant from each to the next, one pass back finds the largest x at
each from which the rest of the path can be run, and one pass along takes the largest u that keeps to that.

Source: [Iso9283]_ section 2 (approximately optimum time); [PhamPham2018]_ (both passes).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray
from urmpipe_models.planning.joint_motion import JointSlopes
from urmpipe_models.planning.time_law import Phase, TimeLaw

STILL = 1e-12
"""A joint that moves by less, in [rad/m], does not move: rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """What holds on n intervals of a grid: |u + slope x| <= most, and x <= fastest where they begin.

    Attributes:
        slope: In [m/m2], shape (n, k).
        most: In [m/s2], shape (n, k).
        fastest: In [m2/s2], shape (n + 1,); the last one where the last interval ends.
    """

    slope: FloatArray
    most: FloatArray
    fastest: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class JointLimits:
    """The largest rates and accelerations of joints, and of the tool along its path.

    Attributes:
        velocity: In [rad/s] or [m/s], shape (joints,); infinity without one.
        acceleration: In [rad/s2] or [m/s2], shape (joints,).
        speed: s' in [m/s].
        tangential: s'' in [m/s2].
    """

    velocity: FloatArray
    acceleration: FloatArray
    speed: float = np.inf
    tangential: float = np.inf


def fastest_law(
    s: FloatArray, after: JointSlopes, before: JointSlopes, stop: BoolArray, limits: JointLimits
) -> TimeLaw:
    """Return the law in the least time.

    Args:
        s: Arc lengths of the grid in [m], rising, shape (n + 1,).
        after: Slopes where each interval begins, n rows.
        before: Slopes where each one ends, n rows: where segments meet they are others.
        stop: Where the path stops, shape (n + 1,); the first and the last are stops.
        limits: Of joints and tool.

    Source: [PhamPham2018]_.
    """
    step = np.diff(s)
    bounds = bounds_of(step, after, before, limits)
    x = _run(step, bounds, stop)
    v = np.sqrt(x)
    moves = v[1:] + v[:-1] > 0.0
    with np.errstate(divide="ignore"):
        durations = 2.0 * step / (v[1:] + v[:-1])
    rows = (durations, s[:-1], v[:-1], 0.5 * np.diff(x) / step)
    phases: list[Phase] = []
    for i, row in enumerate(zip(*(part.tolist() for part in rows), strict=True)):
        phases += [Phase(*row)] if moves[i] else _from_rest_to_rest(bounds, i, float(s[i]), float(step[i]))
    return TimeLaw(phases)


def _from_rest_to_rest(bounds: Bounds, i: int, s: float, step: float) -> list[Phase]:
    """Return how an interval from s on in [m] is passed from rest to rest: faster to its middle, then slower.

    With u constant x rises to u step: |u + slope x| <= most holds where u (1 + |slope| step) <= most.
    """
    u = float((bounds.most[i] / (1.0 + np.abs(bounds.slope[i]) * step)).min())
    u = min(u, float(bounds.fastest[i : i + 2].min()) / step)
    half = math.sqrt(step / u)
    return [Phase(half, s, 0.0, u), Phase(half, s + 0.5 * step, u * half, -u)]


def bounds_of(step: FloatArray, after: JointSlopes, before: JointSlopes, limits: JointLimits) -> Bounds:
    """Return the bounds that limits set at both ends of each interval.

    At its end x + 2 step u stands for x: |(dq + 2 step ddq) u + ddq x| <= a.

    Args:
        step: Lengths of the intervals in [m], shape (n,).
        after: Slopes where each interval begins, n rows.
        before: Slopes where each one ends, n rows.
        limits: Of joints and tool.
    """
    along = np.hstack((after.dq, before.dq + 2.0 * step[:, None] * before.ddq))
    across = np.hstack((after.ddq, before.ddq))
    limit = np.tile(limits.acceleration, 2)
    fastest = np.full(len(step) + 1, limits.speed**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        for part, ends in ((after.dq, slice(None, -1)), (before.dq, slice(1, None))):
            rate = np.square(limits.velocity / np.abs(part)).min(axis=1)
            fastest[ends] = np.minimum(fastest[ends], rate)
        moves = np.abs(along) > STILL
        alone = np.where(moves | (across == 0.0), np.inf, limit / np.abs(across)).min(axis=1)
        slope, most = (
            np.where(moves, own, none)
            for own, none in ((across / along, 0.0), (limit / np.abs(along), np.inf))
        )
    fastest[:-1] = np.minimum(fastest[:-1], alone)
    tool = np.zeros((len(step), 1))
    return Bounds(np.hstack((slope, tool)), np.hstack((most, tool + limits.tangential)), fastest)


def _run(step: FloatArray, bounds: Bounds, stop: BoolArray) -> FloatArray:
    """Return x in [m2/s2] on the grid, shape (n + 1,); 0 at stops."""
    half = 0.5 / step
    most = np.where(stop, 0.0, bounds.fastest)
    most[:-1] = np.minimum(most[:-1], _feasible(bounds, half))
    for i in range(len(step) - 1, -1, -1):  # the least u that is allowed has to lead to most[i + 1] or below
        steepness = half[i] - bounds.slope[i]
        reach = (most[i + 1] * half[i] + bounds.most[i])[steepness > 0.0] / steepness[steepness > 0.0]
        most[i] = min(most[i], reach.min(initial=np.inf))
    x = np.zeros(len(step) + 1)
    for i in range(len(step)):
        u = (bounds.most[i] - bounds.slope[i] * x[i]).min()
        x[i + 1] = max(min(x[i] + 2.0 * step[i] * u, most[i + 1]), 0.0)
    return x


def _feasible(bounds: Bounds, half: FloatArray) -> FloatArray:
    """Return the largest x at which any u is allowed that leaves x + 2 step u at 0 or above, shape (n,).

    Each pair of bounds has to leave room: -most_j - slope_j x <= most_k - slope_k x.
    """
    slope = np.hstack((bounds.slope, half[:, None]))
    most = np.hstack((bounds.most, np.zeros((len(half), 1))))
    apart = bounds.slope[:, None, :] - slope[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.where(apart > 0.0, (bounds.most[:, None, :] + most[:, :, None]) / apart, np.inf)
    return np.asarray(room.min(axis=(1, 2)))
