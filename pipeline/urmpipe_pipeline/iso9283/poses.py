"""The poses of a test after ISO 9283: where the command rests, where cycles attain it, and their criteria.

1. `command_poses`: the rests of the command, and stops of a moment that are known.
2. `find_attained_poses`: the rest of a cycle in each of them.
3. `settling_and_overshoot`: PSt and OV of one approach.
4. `pose_values`, over n cycles: AP, RP and their angles as in `criteria`; AD = |mean distance of two poses -
   commanded distance|, RD = 3 S of the distance; vAP, the largest distance of the barycentres of a pose that
   is attained from directions at least 30 deg apart; dAP and dRP, the changes of AP and RP from the first
   tenth of the cycles to the last.

Source: after ISO 9283; AP and RP as public evaluations have them, the others from common knowledge.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import rotation_angle
from urmpipe_pipeline.iso9283.command_path import CORNER_ANGLE, Stop
from urmpipe_pipeline.iso9283.criteria import (
    Value,
    accuracy,
    angle_values,
    euler_angles,
    repeatability,
    three_sigma,
    values_at,
)
from urmpipe_pipeline.iso9283.motion import Motion, Rest, assign_in_order

POSE_TOLERANCE = (1e-4, 1e-3)  # [m] and [rad] between poses that are the same
SLOW = 0.1  # of the largest speed: a cycle is slower at a pose in which the command stops for a moment
APPROACH = 50.0  # bands: an approach begins where the cycle comes so near to the pose for the last time
DRIFT_PARTS = 10  # of the cycles: drift is from the first part to the last


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """Poses, in the order in which they are attained.

    Attributes:
        position: In [m], shape (k, 3).
        quat_xyzw: Orientations [-], shape (k, 4); None without them.
        moving: Whether the command stops there for a moment only, one per pose.
        closed: Whether a cycle begins in the last one, which it attains at its end only.
    """

    position: FloatArray
    quat_xyzw: FloatArray | None
    moving: tuple[bool, ...] = ()
    closed: bool = False

    def __len__(self) -> int:
        return len(self.position)

    def is_same(self, first: int, second: int) -> bool:
        """Return whether two of them are the same pose."""
        near = float(np.linalg.norm(self.position[first] - self.position[second])) <= POSE_TOLERANCE[0]
        if self.quat_xyzw is None or not near:
            return near
        angle = rotation_angle(self.quat_xyzw[[first]], self.quat_xyzw[[second]])
        return float(angle[0]) <= POSE_TOLERANCE[1]


class _Approach(NamedTuple):
    """A pose of a command: its rows, its position in [m], and whether the command stops for a moment only."""

    rest: Rest
    position: FloatArray
    is_moment: bool


def command_poses(command: Motion, stops: Sequence[Stop] = ()) -> Poses:
    """Return the poses of a command: where it rests; of static poses each row.

    The rest in which it begins is left out if it ends in the same pose: each cycle attains that at its end.

    Args:
        command: The commanded motion.
        stops: Where it is known to stop, even if only for a moment.
    """
    if not command.timed:
        return Poses(command.position, command.quat_xyzw, (False,) * len(command))
    approaches = [_Approach(rest, command.pose(rest)[0], is_moment=False) for rest in command.rests]
    for stop in stops:
        row = int(np.argmin(np.abs(command.t - stop.t)))
        if not any(rest.first - 1 <= row <= rest.last + 1 for rest in command.rests):
            approaches.append(_Approach(Rest(row, row), np.array(stop.position), is_moment=True))
    approaches.sort(key=lambda approach: approach.rest.first)
    poses = _collect(command, approaches)
    if len(poses) > 1 and _begins_in(command, approaches[0].rest) and poses.is_same(0, len(poses) - 1):
        return replace(_collect(command, approaches[1:]), closed=True)
    return poses


def _collect(command: Motion, approaches: Sequence[_Approach]) -> Poses:
    position = np.array([approach.position for approach in approaches]).reshape(-1, 3)
    quats = [quat for approach in approaches if (quat := command.pose(approach.rest)[1]) is not None]
    moving = tuple(approach.is_moment for approach in approaches)
    return Poses(position, np.array(quats) if quats else None, moving)


def _begins_in(cycle: Motion, rest: Rest) -> bool:
    """Return whether a cycle begins in a rest, without a motion before it."""
    offset = cycle.position[: rest.first + 1] - cycle.pose(rest)[0]
    return bool(np.linalg.norm(offset, axis=1).max() <= POSE_TOLERANCE[0] + 10.0 * cycle.noise)


def find_attained_poses(cycle: Motion, poses: Poses, reach: float) -> tuple[Rest, ...] | int:
    """Return the rest of a cycle in each pose, or the number of the first pose, from 0, that it misses.

    The rests in the order of the poses that are nearest to them in total. Where the command stops for a
    moment only, moments at which the cycle is slowest count, too. Of static poses each row is one.

    Args:
        cycle: The cycle.
        poses: The commanded poses.
        reach: Largest distance of a rest from its pose in [m].
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
        rests = sorted([*rests, *_slowest_moments(cycle, reach / 4.0)], key=lambda rest: rest.first)
    if poses.closed and rests and _begins_in(cycle, rests[0]):
        rests = rests[1:]
    positions = np.array([cycle.pose(rest)[0] for rest in rests]).reshape(-1, 3)
    order = np.arange(len(rests), dtype=np.float64)
    distances = [np.linalg.norm(positions - position, axis=1) for position in poses.position]
    stages = [(order[distance <= reach], distance[distance <= reach]) for distance in distances]
    chosen = assign_in_order(stages)
    if isinstance(chosen, int):
        return chosen
    return tuple(rests[int(stage[0][k])] for stage, k in zip(stages, chosen, strict=True))


def _slowest_moments(cycle: Motion, near: float) -> list[Rest]:
    """Return the rows at which the speed of a cycle is least, and its ends, except around a rest.

    Args:
        cycle: The cycle.
        near: Distance in [m] from the rest before or after within which a row belongs to that rest: a cycle
            that overshoots is slow where it turns back.
    """
    speed = cycle.speed
    at_row = np.minimum(np.append(speed[0], speed), np.append(speed, speed[-1]))
    is_least = np.append(True, at_row[1:] <= at_row[:-1]) & np.append(at_row[:-1] < at_row[1:], True)
    is_least &= at_row <= SLOW * speed.max()
    is_least[[0, -1]] = True
    rows = np.flatnonzero(is_least)
    first_rows = np.array([rest.first for rest in cycle.rests])
    positions = np.array([cycle.pose(rest)[0] for rest in cycle.rests])
    for step in (-1, 0) if len(first_rows) else ():
        rest = np.clip(np.searchsorted(first_rows, rows, side="right") + step, 0, len(first_rows) - 1)
        rows = rows[np.linalg.norm(cycle.position[rows] - positions[rest], axis=1) > near]
    return [Rest(int(row), int(row)) for row in rows]


def settling_and_overshoot(cycle: Motion, since: int, rest: Rest, band: float) -> tuple[float, float] | None:
    """Return the stabilisation time PSt in [s] and the overshoot OV in [m] of a cycle in a pose.

    The final position p_f is the mean over the second half of the rest. PSt: from the first entry into the
    ball of radius `band` around it to the last entry, on straight lines between the rows. OV:
    max((p - p_f) . u, 0) over the rows from the first entry on, with the unit vector u of the approach, from
    where the cycle comes within 50 bands to p_f. None if it does not come from outside the band.

    Args:
        cycle: The cycle.
        since: The row at which it leaves the pose before.
        rest: The rows in which it rests in this one.
        band: Half of the width of the band in [m].

    Source: after ISO 9283, from common knowledge.
    """
    final, _ = cycle.pose(rest)
    rows = slice(since, rest.last + 1)
    offset, t = cycle.position[rows] - final, cycle.t[rows]
    distance = np.linalg.norm(offset, axis=1)
    approach = _entry(offset, distance, APPROACH * band, first=False)
    begin = 0 if approach is None else approach[0]
    entry = _entry(offset[begin:], distance[begin:], band, first=True)
    settled = _entry(offset[begin:], distance[begin:], band, first=False)
    if entry is None or settled is None:
        return None
    times = [_interpolate(t[begin:], *crossing) for crossing in (entry, settled)]
    start = offset[0] if approach is None else _interpolate(offset, *approach)
    direction = -start / np.linalg.norm(start)
    overshoot = offset[begin + entry[0] + 1 :] @ direction
    return float(times[1] - times[0]), float(max(overshoot.max(initial=0.0), 0.0))


def _entry(
    offset: FloatArray, distance: FloatArray, radius: float, *, first: bool
) -> tuple[int, float] | None:
    """Return the row before a cycle first, or last, enters a ball around the origin, and its share.

    Args:
        offset: Positions from the centre in [m], shape (n, 3).
        distance: Their distances from it in [m], shape (n,).
        radius: Of the ball in [m].
        first: Whether to return the first entry, else the last one.
    """
    rows = np.flatnonzero((distance[:-1] > radius) & (distance[1:] <= radius))
    if not len(rows):
        return None
    row = int(rows[0 if first else -1])
    step = offset[row + 1] - offset[row]
    a, b, c = step @ step, offset[row] @ step, distance[row] ** 2 - radius**2  # |p + x step| = radius
    return row, float(c / (-b + np.sqrt(max(b * b - a * c, 0.0))))


def _interpolate(values: FloatArray, row: int, share: float) -> FloatArray:
    return np.asarray(values[row] + share * (values[row + 1] - values[row]))


def pose_values(attained: FloatArray, quats: FloatArray | None, poses: Poses) -> Iterator[Value]:
    """Yield AP, RP, their angles, AD, RD, vAP, dAP and dRP of each pose or pair.

    Args:
        attained: In [m], shape (n, k, 3): cycles, poses, coordinates.
        quats: Orientations [-], shape (n, k, 4); None without them.
        poses: The commanded poses.

    Source: after ISO 9283: AP and RP as public evaluations have them, the others from common knowledge.
    """
    names = [f"pose {k + 1}" for k in range(len(poses))]
    yield from values_at("AP", names, accuracy(attained, poses.position))
    yield from values_at("RP", names, repeatability(attained))
    if quats is not None and poses.quat_xyzw is not None:
        angles = euler_angles(quats.reshape(-1, 4)).reshape(*quats.shape[:2], 3)
        yield from angle_values("P", names, angles, euler_angles(poses.quat_xyzw))
    yield from _distance_values(attained, poses)
    yield from _direction_values(attained, poses)
    yield from _drift_values(attained, poses, names)


def _distance_values(attained: FloatArray, poses: Poses) -> Iterator[Value]:
    pairs = [pair for pair in combinations(range(len(poses)), 2) if not poses.is_same(*pair)]
    if not pairs:
        return
    first, second = np.array(pairs).T
    distance = np.linalg.norm(attained[:, first] - attained[:, second], axis=2)
    commanded = np.linalg.norm(poses.position[first] - poses.position[second], axis=1)
    names = [f"poses {a + 1}-{b + 1}" for a, b in pairs]
    yield from values_at("AD", names, np.abs(distance.mean(axis=0) - commanded))
    yield from values_at("RD", names, three_sigma(distance))


def _direction_values(attained: FloatArray, poses: Poses) -> Iterator[Value]:
    """Yield vAP of each pose that is attained more than once; the direction is from the pose before."""
    centre = attained.mean(axis=0)
    groups: list[list[int]] = []
    for k in range(len(poses)):
        group = next((group for group in groups if poses.is_same(group[0], k)), None)
        if group is None:
            groups.append([k])
        else:
            group.append(k)
    for group in groups:
        steps = {k: poses.position[k] - poses.position[k - 1] for k in group if k > 0}
        pairs = [(a, b) for a, b in combinations(steps, 2) if _is_other_direction(steps[a], steps[b])]
        if pairs:
            largest = max(float(np.linalg.norm(centre[a] - centre[b])) for a, b in pairs)
            yield "vAP", f"poses {', '.join(str(k + 1) for k in group)}", largest


def _is_other_direction(first: FloatArray, second: FloatArray) -> bool:
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return size > 0.0 and float(first @ second) <= size * np.cos(CORNER_ANGLE)


def _drift_values(attained: FloatArray, poses: Poses, names: Sequence[str]) -> Iterator[Value]:
    count = -(-len(attained) // DRIFT_PARTS)
    parts = attained[:count], attained[-count:]
    first, last = (accuracy(part, poses.position) for part in parts)
    yield from values_at("dAP", names, np.abs(last - first) if len(attained) > 1 else None)
    before, after = (repeatability(part) for part in parts)
    yield from values_at("dRP", names, None if before is None or after is None else np.abs(after - before))
