"""Corners: how the mean path rounds them, and how far it goes beyond them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.iso9283.command_path import CommandCorner, CommandLeg
from urmpipe_pipeline.iso9283.motion import Motion

OVERSHOOT_TOLERANCE = 1e-12
"""What is less in [m] is what rounding leaves."""


@dataclass(frozen=True, slots=True, eq=False)
class CornerPath:
    """A corner, and the mean path of the cycles about it.

    Attributes:
        name: What it is called, such as "corner 1".
        point: The corner in [m], shape (3,).
        command: The command from the middle of the leg before to the middle of that behind it, in [m],
            shape (c, 3).
        mean: The mean path there in [m], shape (k, 3).
        nearest: The point of the mean path that is nearest to the corner, in [m], shape (3,).
        rounding: CR: how far that is from the corner, in [m].
        beyond: The point of the mean path that is furthest beyond the leg behind the corner in [m],
            shape (3,); None where it goes nowhere beyond it, or the leg is not straight.
        foot: The point of that leg that is nearest to it, in [m], shape (3,); None without one.
        overshoot: CO: how far it is from the leg, in [m]; None where the leg is not straight.
    """

    name: str
    point: FloatArray
    command: FloatArray
    mean: FloatArray
    nearest: FloatArray
    rounding: float
    beyond: FloatArray | None
    foot: FloatArray | None
    overshoot: float | None


def mean_path(cycles: Sequence[Motion], times: FloatArray) -> FloatArray:
    """Return the mean path of several cycles between common planes, shape (k, 3), in [m].

    Between two planes each cycle counts by the share of its own time there, at the rows of all of them: the
    mean of straight lines is straight in between.

    Args:
        cycles: The cycles.
        times: When each passes the planes in [s], shape (n, planes).
    """
    parts = []
    for part in range(times.shape[1] - 1):
        begins, lasts = times[:, part], times[:, part + 1] - times[:, part]
        shares = [_shares(one.t, t, lasting) for one, t, lasting in zip(cycles, begins, lasts, strict=True)]
        share = np.unique(np.concatenate([[0.0, 1.0], *shares]))
        places = [
            one.places(t + share * lasting) for one, t, lasting in zip(cycles, begins, lasts, strict=True)
        ]
        parts.append(np.mean(places, axis=0))
    return np.concatenate(parts)


def _shares(t: FloatArray, begins: float, lasting: float) -> FloatArray:
    """Return which shares of a time are passed at rows at times in [s], shape (n,)."""
    share = (t - begins) / lasting
    return np.asarray(share[(share > 0.0) & (share < 1.0)])


def corner_path(name: str, corner: CommandCorner, command: FloatArray, mean: FloatArray) -> CornerPath:
    """Return how a mean path takes a corner.

    CR = the least distance from the corner to the mean path. CO = the largest distance of the mean path from
    the line of the second leg, where it is on the outer side: n . (p - corner) > 0, with n the part of the
    direction of the first leg that is normal to the second.

    Args:
        name: What the corner is called.
        corner: The corner.
        command: The command about it in [m], shape (c, 3).
        mean: The mean path about it in [m], shape (k, 3).

    Source: after ISO 9283, from common knowledge.
    """
    nearest = _nearest(mean, corner.point)
    rounding = float(np.linalg.norm(nearest - corner.point))
    if not corner.straight:
        return CornerPath(name, corner.point, command, mean, nearest, rounding, None, None, None)
    outward = corner.before - (corner.before @ corner.behind) * corner.behind
    out = mean - corner.point
    foot = np.outer(out @ corner.behind, corner.behind)
    off = np.linalg.norm(out - foot, axis=1)
    off[out @ outward <= OVERSHOOT_TOLERANCE] = 0.0
    most = int(np.argmax(off))
    if off[most] < OVERSHOOT_TOLERANCE:
        return CornerPath(name, corner.point, command, mean, nearest, rounding, None, None, 0.0)
    at = corner.point + foot[most]
    return CornerPath(name, corner.point, command, mean, nearest, rounding, mean[most], at, float(off[most]))


def _nearest(path: FloatArray, point: FloatArray) -> FloatArray:
    """Return the point of a path of straight pieces, shape (n, 3), that is nearest to a point, in [m]."""
    step = np.diff(path, axis=0)
    squared = np.einsum("ni,ni->n", step, step)
    along = np.einsum("ni,ni->n", point - path[:-1], step) / np.where(squared > 0.0, squared, 1.0)
    places = path[:-1] + np.clip(along, 0.0, 1.0)[:, np.newaxis] * step
    return np.asarray(places[int(np.argmin(np.linalg.norm(places - point, axis=1)))])


@dataclass(frozen=True, slots=True)
class LegSpeed:
    """The speed of all cycles on the middle half of a leg.

    Attributes:
        name: What the leg is called, such as "leg 1".
        begins: Arc length at which its middle half begins in [m].
        ends: Arc length at which it ends in [m].
        commanded: v_c in [m/s].
        mean: Mean speed of all cycles in [m/s].
        accuracy: AV = (mean - v_c) / v_c [-].
        repeatability: RV = 3 S of the cycles' mean speeds / v_c [-]; None of one cycle.
        fluctuation: FV: largest v_max - v_min of a cycle in [m/s]; None where none has two rows there.
    """

    name: str
    begins: float
    ends: float
    commanded: float
    mean: float
    accuracy: float
    repeatability: float | None
    fluctuation: float | None


def leg_speed(name: str, leg: CommandLeg, cycles: Sequence[Motion], times: FloatArray) -> LegSpeed:
    """Return how fast cycles run along a leg, over its middle half.

    The mean speed of a cycle is the length of the middle half over the time between the planes at its ends;
    v_max and v_min are of the speed along the leg from row to row between them.

    Args:
        name: What the leg is called.
        leg: The leg.
        cycles: The cycles.
        times: When each passes the two planes in [s], shape (n, 2).

    Source: after ISO 9283, from common knowledge.
    """
    means = leg.length / (times[:, 1] - times[:, 0])
    spread = 3.0 * float(means.std(ddof=1)) / leg.speed if len(means) > 1 else None
    spans = [
        span for one, ends in zip(cycles, times, strict=True) if (span := _span(one, leg, ends)) is not None
    ]
    mean = float(means.mean())
    return LegSpeed(
        name, leg.begins, leg.ends, leg.speed, mean, (mean - leg.speed) / leg.speed, spread,
        max(spans, default=None),
    )  # fmt: skip


def _span(cycle: Motion, leg: CommandLeg, ends: FloatArray) -> float | None:
    """Return v_max - v_min of a cycle between two times in [s], shape (2,), in [m/s]; None of few rows."""
    rows = np.flatnonzero((cycle.t >= ends[0]) & (cycle.t <= ends[1]))
    if len(rows) < 2:
        return None
    speed = (np.diff(cycle.position[rows], axis=0) @ leg.direction) / np.diff(cycle.t[rows])
    return float(np.ptp(speed))
