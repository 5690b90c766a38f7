"""The poses of a command, and where each cycle attained them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import rotation_angle
from urmpipe_pipeline.iso9283.command_path import Stop
from urmpipe_pipeline.iso9283.in_order import in_order
from urmpipe_pipeline.iso9283.motion import Motion, Rest

SAME = (1e-4, 1e-3)
"""Poses that are no further apart than this in [m] and [rad] are one pose."""

SLOW = 0.1
"""Where a command stops for a moment only, a cycle is there where it is slowest: slower than this share of
its largest speed."""


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """Poses, in the order in which they are attained.

    Attributes:
        position: In [m], shape (k, 3).
        quat_xyzw: Orientations [-], shape (k, 4); None without them.
        moving: Whether the command stops there for a moment only, one each.
        closed: Whether a cycle begins in the last one: where it starts it attains nothing.
    """

    position: FloatArray
    quat_xyzw: FloatArray | None
    moving: tuple[bool, ...] = ()
    closed: bool = False

    def __len__(self) -> int:
        return len(self.position)

    def alike(self, first: int, second: int) -> bool:
        """Tell whether two of them are one pose."""
        near = float(np.linalg.norm(self.position[first] - self.position[second])) <= SAME[0]
        if self.quat_xyzw is None or not near:
            return near
        turned = rotation_angle(self.quat_xyzw[[first]], self.quat_xyzw[[second]])
        return float(turned[0]) <= SAME[1]

    @property
    def visited_again(self) -> tuple[tuple[int, ...], ...]:
        """The numbers of those that are one pose, from 0, for each pose that is attained more than once."""
        groups: list[list[int]] = []
        for k in range(len(self)):
            own = next((one for one in groups if self.alike(one[0], k)), None)
            if own is None:
                groups.append([k])
            else:
                own.append(k)
        return tuple(tuple(one) for one in groups if len(one) > 1)


def poses_of(command: Motion, stops: Sequence[Stop] = ()) -> Poses:
    """Return the poses of a command: where it rests; of still poses every row.

    A rest that it begins with is left out if it ends in the same pose: every cycle attains that at its end.

    Args:
        command: The motion that was asked for.
        stops: Where it is known to stop, if for a moment only.
    """
    if not command.timed:
        return Poses(command.position, command.quat_xyzw, (False,) * len(command))
    known = [(one, command.pose(one)[0], False) for one in command.rests]
    moments = [(_row_at(command, one.t), np.array(one.place), True) for one in stops]
    known += [one for one in moments if not any(_touch(one[0], rest) for rest in command.rests)]
    known.sort(key=lambda one: one[0].first)
    found = _gathered(command, known)
    if len(found) > 1 and _starts(command, known[0][0]) and found.alike(0, len(found) - 1):
        return replace(_gathered(command, known[1:]), closed=True)
    return found


def _row_at(command: Motion, t: float) -> Rest:
    """Return the row of a command that is nearest to a time in [s]."""
    row = int(np.argmin(np.abs(command.t - t)))
    return Rest(row, row)


def _touch(one: Rest, other: Rest) -> bool:
    """Tell whether two stretches of rows overlap, or stand beside each other."""
    return one.first <= other.last + 1 and other.first <= one.last + 1


def _gathered(command: Motion, known: Sequence[tuple[Rest, FloatArray, bool]]) -> Poses:
    """Return the poses in which a command rests: the rows, the place, and whether it is a moment of each."""
    position = np.array([place for _, place, _ in known]).reshape(-1, 3)
    quats = [turned for one, _, _ in known if (turned := command.pose(one)[1]) is not None]
    return Poses(position, np.array(quats) if quats else None, tuple(moment for _, _, moment in known))


def attained(cycle: Motion, poses: Poses, reach: float) -> tuple[Rest, ...] | int:
    """Return where a cycle rests in each pose, or the number of the first, from 0, that it does not attain.

    Of its rests those are taken that follow each other in the order of the poses and are nearest to them in
    all; where a command stops for a moment only, moments at which the cycle is slowest count, too. Of still
    poses each row is one.

    Args:
        cycle: The cycle.
        poses: The commanded poses.
        reach: How far a rest may be from its pose in [m].
    """
    if not cycle.timed:
        if len(cycle) != len(poses):
            return min(len(cycle), len(poses) - 1)
        missing = np.flatnonzero(~np.isfinite(cycle.position).all(axis=1))
        if len(missing):
            return int(missing[0])
        return tuple(Rest(row, row) for row in range(len(cycle)))
    rests = list(cycle.rests)
    if any(poses.moving):
        rests = sorted([*rests, *_moments(cycle, reach / 4.0)], key=lambda one: one.first)
    if poses.closed and rests and _starts(cycle, rests[0]):
        rests = rests[1:]
    places = np.array([cycle.pose(one)[0] for one in rests]).reshape(-1, 3)
    order = np.arange(len(rests), dtype=np.float64)
    far = [np.linalg.norm(places - wanted, axis=1) for wanted in poses.position]
    stages = [(order[one <= reach], one[one <= reach]) for one in far]
    chosen = in_order(stages)
    if isinstance(chosen, int):
        return chosen
    return tuple(rests[int(stage[0][k])] for stage, k in zip(stages, chosen, strict=True))


def _moments(cycle: Motion, near: float) -> list[Rest]:
    """Return the rows, one each, at which a cycle is slowest, its ends among them: none about a rest.

    Args:
        cycle: The cycle.
        near: What is no further in [m] from the next rest, or from that before, belongs to it: a cycle that
            overshoots is slow where it turns back.
    """
    speed = cycle.speed
    at_row = np.minimum(np.append(speed[0], speed), np.append(speed, speed[-1]))
    lower = np.append(True, at_row[1:] <= at_row[:-1]) & np.append(at_row[:-1] < at_row[1:], True)
    lower &= at_row <= SLOW * speed.max()
    lower[[0, -1]] = True
    rows = np.flatnonzero(lower)
    begins = np.array([one.first for one in cycle.rests])
    places = np.array([cycle.pose(one)[0] for one in cycle.rests])
    for step in (-1, 0) if len(begins) else ():
        rest = np.clip(np.searchsorted(begins, rows, side="right") + step, 0, len(begins) - 1)
        rows = rows[np.linalg.norm(cycle.position[rows] - places[rest], axis=1) > near]
    return [Rest(int(row), int(row)) for row in rows]


def _starts(cycle: Motion, rest: Rest) -> bool:
    """Tell whether a cycle begins in a rest: nothing leads to it."""
    way = cycle.position[: rest.first + 1] - cycle.pose(rest)[0]
    return bool(np.linalg.norm(way, axis=1).max() <= SAME[0] + 10.0 * cycle.noise)
