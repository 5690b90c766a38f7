"""Corners and legs of a path: CR, CO, and the criteria of speed.

1. `mean_path`: the mean of several cycles between common planes.
2. `corner_path`: CR = least distance from the corner to the mean path; CO = largest distance of the mean path
   from the line of the second leg, on the outer side.
3. `leg_speed`, over the middle half of a leg with the commanded speed v_c: AV = (mean v - v_c) / v_c,
   RV = 3 S of the cycles' mean speeds / v_c, FV = largest v_max - v_min of a cycle.

Source: after ISO 9283, from common knowledge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.iso9283.command_path import CommandCorner, CommandLeg
from urmpipe_pipeline.iso9283.motion import Motion

ROUNDING = 1e-12  # m


@dataclass(frozen=True, slots=True, eq=False)
class CornerPath:
    """A corner, and the mean path of the cycles around it.

    Attributes:
        name: Its name, such as "corner 1".
        point: The corner in [m], shape (3,).
        command: The command from the middle of the leg before to the middle of the leg after it, in [m],
            shape (c, 3).
        mean: The mean path there in [m], shape (k, 3).
        nearest: The point of the mean path that is nearest to the corner, in [m], shape (3,).
        rounding: CR: distance of that point from the corner, in [m].
        overshoot_point: The point of the mean path that is furthest beyond the leg after the corner, in [m],
            shape (3,); None if it goes nowhere beyond it, or the leg is not straight.
        nearest_on_leg: The point of that leg that is nearest to it, in [m], shape (3,); None without one.
        overshoot: CO: distance of `beyond` from the leg, in [m]; None if the leg is not straight.
    """

    name: str
    point: FloatArray
    command: FloatArray
    mean: FloatArray
    nearest: FloatArray
    rounding: float
    overshoot_point: FloatArray | None
    nearest_on_leg: FloatArray | None
    overshoot: float | None


@dataclass(frozen=True, slots=True)
class LegSpeed:
    """The speed of all cycles on the middle half of a leg.

    Attributes:
        name: Its name, such as "leg 1".
        begins: Arc length at which its middle half begins in [m].
        ends: Arc length at which its middle half ends in [m].
        commanded: v_c in [m/s].
        mean: Mean speed of all cycles in [m/s].
        accuracy: AV = (mean - v_c) / v_c [-].
        repeatability: RV = 3 S of the cycles' mean speeds / v_c [-]; None for one cycle.
        fluctuation: FV: largest v_max - v_min of a cycle in [m/s]; None if no cycle has two rows there.
    """

    name: str
    begins: float
    ends: float
    commanded: float
    mean: float
    accuracy: float
    repeatability: float | None
    fluctuation: float | None


def mean_path(cycles: Sequence[Motion], times: FloatArray) -> FloatArray:
    """Return the mean path of several cycles between common planes, shape (k, 3), in [m].

    Between two planes, cycles are averaged at equal shares of their times there, at the rows of all of them:
    the mean of straight lines is straight between these.

    Args:
        cycles: The cycles.
        times: When each passes the planes in [s], shape (n, planes).
    """
    parts = []
    for starts, ends in zip(times.T[:-1], times.T[1:], strict=True):
        stretches = list(zip(cycles, starts, ends - starts, strict=True))
        shares = [(cycle.t - start) / duration for cycle, start, duration in stretches]
        inside = [share[(share > 0.0) & (share < 1.0)] for share in shares]
        share = np.unique(np.concatenate([[0.0, 1.0], *inside]))
        positions = [cycle.positions_at(start + share * duration) for cycle, start, duration in stretches]
        parts.append(np.mean(positions, axis=0))
    return np.concatenate(parts)


def corner_path(name: str, corner: CommandCorner, command: FloatArray, mean: FloatArray) -> CornerPath:
    """Return CR and CO of a mean path at a corner.

    CR = the least distance from the corner to the mean path. CO = the largest distance of the mean path from
    the line of the second leg, where it is on the outer side: n . (p - corner) > 0, with n the part of the
    direction of the first leg that is normal to the second.

    Args:
        name: The name of the corner.
        corner: The corner.
        command: The command around it in [m], shape (c, 3).
        mean: The mean path around it in [m], shape (k, 3).

    Source: after ISO 9283, from common knowledge.
    """
    nearest = _nearest_point(mean, corner.point)
    rounding = float(np.linalg.norm(nearest - corner.point))
    beyond = foot = overshoot = None
    if corner.is_straight:
        outward = corner.before - (corner.before @ corner.after) * corner.after
        offset = mean - corner.point
        along = np.outer(offset @ corner.after, corner.after)
        distance = np.linalg.norm(offset - along, axis=1)
        distance[offset @ outward <= ROUNDING] = 0.0
        row = int(np.argmax(distance))
        overshoot = 0.0
        if distance[row] >= ROUNDING:
            beyond, foot, overshoot = mean[row], corner.point + along[row], float(distance[row])
    return CornerPath(name, corner.point, command, mean, nearest, rounding, beyond, foot, overshoot)


def _nearest_point(path: FloatArray, point: FloatArray) -> FloatArray:
    """Return the point of a path of straight pieces, shape (n, 3), that is nearest to a point, in [m]."""
    step = np.diff(path, axis=0)
    squared = np.einsum("ni,ni->n", step, step)
    along = np.einsum("ni,ni->n", point - path[:-1], step) / np.where(squared > 0.0, squared, 1.0)
    points = path[:-1] + np.clip(along, 0.0, 1.0)[:, np.newaxis] * step
    return np.asarray(points[int(np.argmin(np.linalg.norm(points - point, axis=1)))])


def leg_speed(name: str, leg: CommandLeg, cycles: Sequence[Motion], times: FloatArray) -> LegSpeed:
    """Return AV, RV and FV of cycles over the middle half of a leg.

    The mean speed of a cycle is the length of the middle half over the time between the planes at its ends;
    v_max and v_min are of the speed along the leg from row to row between them.

    Args:
        name: The name of the leg.
        leg: The leg.
        cycles: The cycles.
        times: When each passes the two planes in [s], shape (n, 2).

    Source: after ISO 9283, from common knowledge.
    """
    means = leg.length / (times[:, 1] - times[:, 0])
    spread = 3.0 * float(means.std(ddof=1)) / leg.speed if len(means) > 1 else None
    spans = []
    for cycle, (start, end) in zip(cycles, times, strict=True):
        rows = np.flatnonzero((cycle.t >= start) & (cycle.t <= end))
        if len(rows) >= 2:
            speed = (np.diff(cycle.position[rows], axis=0) @ leg.direction) / np.diff(cycle.t[rows])
            spans.append(float(np.ptp(speed)))
    mean = float(means.mean())
    accuracy = (mean - leg.speed) / leg.speed
    return LegSpeed(name, leg.start, leg.end, leg.speed, mean, accuracy, spread, max(spans, default=None))
