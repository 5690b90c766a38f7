"""The poses of a command, and where each cycle attained them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import rotation_angle
from urmpipe_pipeline.iso9283.command_path import CORNER, Stop
from urmpipe_pipeline.iso9283.criteria import ANGLES, accuracy, angles, repeatability, threefold, turned
from urmpipe_pipeline.iso9283.motion import Motion, Rest, in_order

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


NEAR = 50.0
"""An approach begins where the cycle comes within so many bands of the pose for the last time."""


def settling(cycle: Motion, since: int, rest: Rest, band: float) -> tuple[float, float] | None:
    """Return the stabilisation time in [s] and the overshoot in [m] with which a cycle attains a pose.

    The final pose is where it stands in the second half of its rest. Stabilisation time: from the first
    entry into the ball of radius `band` round it to the last one, on straight lines between the rows.
    Overshoot: max((p - p_final) . u, 0) over the rows from the first entry on, with the unit vector u along
    the approach, from where the cycle comes within 50 bands to the final pose. None where it does not come
    from outside the band.

    Args:
        cycle: The cycle.
        since: The row at which it leaves the pose before.
        rest: The rows in which it rests in this one.
        band: Half of the width of the band in [m].

    Source: after ISO 9283, from common knowledge.
    """
    final, _ = cycle.pose(rest)
    rows = slice(since, rest.last + 1)
    place, t = cycle.position[rows] - final, cycle.t[rows]
    away = np.linalg.norm(place, axis=1)
    start = _entry(place, away, NEAR * band, first=False)
    begin = 0 if start is None else start[0]
    inside = _entry(place[begin:], away[begin:], band, first=True)
    settled = _entry(place[begin:], away[begin:], band, first=False)
    if inside is None or settled is None:
        return None
    times = [_between(t[begin:], *one) for one in (inside, settled)]
    came = place[0] if start is None else _between(place, *start)
    along = -came / np.linalg.norm(came)
    beyond = place[begin + inside[0] + 1 :] @ along
    return float(times[1] - times[0]), float(max(beyond.max(initial=0.0), 0.0))


def _entry(place: FloatArray, away: FloatArray, radius: float, *, first: bool) -> tuple[int, float] | None:
    """Return the row before a cycle enters a ball round the origin, first or last, and the share.

    Args:
        place: In [m] from its centre, shape (n, 3).
        away: The distances from it in [m], shape (n,).
        radius: Of the ball in [m].
        first: Whether the first entry is wanted, else the last one.
    """
    rows = np.flatnonzero((away[:-1] > radius) & (away[1:] <= radius))
    if not len(rows):
        return None
    row = int(rows[0 if first else -1])
    step = place[row + 1] - place[row]
    a, b, c = step @ step, place[row] @ step, away[row] ** 2 - radius**2  # |p + x step| = radius
    return row, float(c / (-b + np.sqrt(max(b * b - a * c, 0.0))))


def _between(values: FloatArray, row: int, share: float) -> FloatArray:
    """Return what lies between a row and the next."""
    return np.asarray(values[row] + share * (values[row + 1] - values[row]))


Found: TypeAlias = tuple[str, str, float | None]
"""A criterion, where it is, and its value."""

TENTH = 10
"""Drift is told between the first and the last of so many parts of the cycles."""


def pose_criteria(attained: FloatArray, quats: FloatArray | None, poses: Poses) -> Iterator[Found]:
    """Yield what the attained points of several cycles tell of each pose.

    Args:
        attained: In [m], shape (n, k, 3): cycles, poses, coordinates.
        quats: Orientations [-], shape (n, k, 4); None without them.
        poses: The commanded poses.

    Source: after ISO 9283: AP and RP as public evaluations have them, the others from common knowledge.
    """
    at = [f"pose {k + 1}" for k in range(len(poses))]
    yield from _each("AP", at, accuracy(attained, poses.position))
    yield from _each("RP", at, repeatability(attained))
    if quats is not None and poses.quat_xyzw is not None:
        flat = angles(quats.reshape(-1, 4)).reshape(*quats.shape[:2], 3)
        off = turned(flat, angles(poses.quat_xyzw))
        yield from angle_criteria("P", at, off)
    yield from _distances(attained, poses)
    yield from _directions(attained, poses)
    yield from _drift(attained, poses, at)


def angle_criteria(kind: str, at: Sequence[str], off: FloatArray) -> Iterator[Found]:
    """Yield accuracy and repeatability of the angles rz, ry and rx.

    A = |mean angle - commanded angle|, R = 3 S of the angle over the cycles.

    Args:
        kind: P of poses, T of paths.
        at: What the places are called.
        off: Attained - commanded angles in [rad], shape (n, k, 3).

    Source: after ISO 9283, from common knowledge.
    """
    spread = threefold(off)
    for axis, angle in enumerate(ANGLES):
        yield from _each(f"A{kind}_{angle}", at, np.abs(off[:, :, axis].mean(axis=0)))
        yield from _each(f"R{kind}_{angle}", at, None if spread is None else spread[:, axis])


def _each(name: str, at: Sequence[str], values: FloatArray | None) -> Iterator[Found]:
    """Yield a criterion at some places; its values are of shape (k,), or none are known."""
    for k, where in enumerate(at):
        yield name, where, None if values is None else float(values[k])


def _distances(attained: FloatArray, poses: Poses) -> Iterator[Found]:
    """Yield of each two poses AD = |mean distance - commanded distance| and RD = 3 S of the distance."""
    pairs = [pair for pair in combinations(range(len(poses)), 2) if not poses.alike(*pair)]
    if not pairs:
        return
    first, second = np.array(pairs).T
    distance = np.linalg.norm(attained[:, first] - attained[:, second], axis=2)
    wanted = np.linalg.norm(poses.position[first] - poses.position[second], axis=1)
    at = [f"poses {a + 1}-{b + 1}" for a, b in pairs]
    yield from _each("AD", at, np.abs(distance.mean(axis=0) - wanted))
    yield from _each("RD", at, threefold(distance))


def _directions(attained: FloatArray, poses: Poses) -> Iterator[Found]:
    """Yield vAP: of a pose that is attained from different directions, how far its barycentres are apart.

    The direction is that from the pose before, of which the command tells; directions that differ by less
    than 30 deg are one.
    """
    centre = attained.mean(axis=0)
    for group in poses.visited_again:
        own = [k for k in group if k > 0]
        ways = [poses.position[k] - poses.position[k - 1] for k in own]
        pairs = [(own[i], own[j]) for i, j in combinations(range(len(own)), 2) if _differ(ways[i], ways[j])]
        if pairs:
            apart = max(float(np.linalg.norm(centre[a] - centre[b])) for a, b in pairs)
            yield "vAP", f"poses {', '.join(str(k + 1) for k in group)}", apart


def _differ(first: FloatArray, second: FloatArray) -> bool:
    """Tell whether two directions, shape (3,) each, are at least 30 deg apart."""
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return size > 0.0 and float(first @ second) <= size * np.cos(CORNER)


def _drift(attained: FloatArray, poses: Poses, at: Sequence[str]) -> Iterator[Found]:
    """Yield dAP and dRP: how much AP and RP change from the first tenth of the cycles to the last."""
    count = -(-len(attained) // TENTH)
    parts = attained[:count], attained[-count:]
    several = len(attained) > 1
    accuracies = [accuracy(one, poses.position) for one in parts]
    yield from _each("dAP", at, np.abs(accuracies[1] - accuracies[0]) if several else None)
    first, last = (repeatability(one) for one in parts)
    yield from _each("dRP", at, None if first is None or last is None else np.abs(last - first))
