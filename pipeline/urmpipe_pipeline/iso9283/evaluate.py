"""Evaluate cycles against a command after ISO 9283.

1. `command_to_stations`: the poses of a command, and the planes that cut its path: m planes for AT and RT,
   those around corners, and those at the ends of the middle half of each leg.
2. `match_cycle`: where a cycle attains the poses and crosses the planes, or why it does not follow the
   command. Its clock offset is the median of t_command - t_cycle over the planes.
3. `evaluate_cycles`: every criterion, over all cycles that follow the command.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.iso9283.command_path import (
    CommandPath,
    Crossings,
    Planes,
    RoundedCorner,
    Stop,
    find_crossings,
)
from urmpipe_pipeline.iso9283.corners import CornerPath, corner_path, leg_speed, mean_path
from urmpipe_pipeline.iso9283.criteria import (
    Criterion,
    Value,
    accuracy,
    angle_values,
    euler_angles,
    judge_all,
    repeatability,
)
from urmpipe_pipeline.iso9283.cycles import SAME_PATH, find_jumps
from urmpipe_pipeline.iso9283.motion import Motion, Rest
from urmpipe_pipeline.iso9283.poses import (
    Poses,
    command_poses,
    find_attained_poses,
    pose_values,
    settling_and_overshoot,
)
from urmpipe_pipeline.iso9283.result import AttainedPoses, CutPath

DRAWN_SPEEDS = 1000  # points along the path at which speeds are drawn
PLANE_DISTANCE = 1e-9  # m: planes that are nearer to each other are one


class CommandStations(NamedTuple):
    """The poses and planes of a command at which cycles are compared with it.

    Attributes:
        poses: The commanded poses.
        reach: Largest distance of a rest from its pose in [m].
        path: The command path; None if nothing moves.
        planes: All planes in order.
        path_planes: Numbers of those that cut the path for AT and RT, shape (m,).
        corner_planes: Numbers of those of each corner.
        leg_planes: Numbers of the two of each leg.
    """

    poses: Poses
    reach: float
    path: CommandPath | None = None
    planes: Planes | None = None
    path_planes: tuple[int, ...] = ()
    corner_planes: tuple[tuple[int, ...], ...] = ()
    leg_planes: tuple[tuple[int, int], ...] = ()


class MatchedCycle(NamedTuple):
    """A cycle that follows the command.

    Attributes:
        motion: The cycle.
        rests: Its rows in each pose.
        crossings: Where it crosses the planes; None without any.
        offset: t_reference - t_cycle in [s].
    """

    motion: Motion
    rests: tuple[Rest, ...]
    crossings: Crossings | None
    offset: float


class Evaluation(NamedTuple):
    """The criteria of some cycles, and what is drawn of them."""

    criteria: tuple[Criterion, ...]
    poses: AttainedPoses | None
    path: CutPath | None


def command_to_stations(
    command: Motion,
    targets: Poses | None,
    corners: Sequence[RoundedCorner],
    stops: Sequence[Stop],
    planes: int,
) -> CommandStations:
    """Return the poses of a command, and the planes that cut its path.

    Args:
        command: The commanded motion.
        targets: Poses to judge; None: those in which the command rests.
        corners: Corners that it is known to round.
        stops: Where it is known to stop, even if only for a moment.
        planes: Number of planes that cut its path.
    """
    poses = targets or command_poses(command, stops)
    points = np.vstack((command.position, poses.position))
    reach = SAME_PATH * float(np.ptp(points, axis=0).max(initial=0.0))
    if not command.timed or bool(command.is_resting.all()):
        return CommandStations(poses, reach if len(poses) > 1 else np.inf)
    path = CommandPath(command, corners)
    even = path.even_planes(planes)
    anchors = [corner.anchors for corner in path.corners]
    s = np.concatenate([even.s, *anchors, *([leg.start, leg.end] for leg in path.legs)])
    cut = path.planes_at(s)
    firsts = len(even.s) + np.cumsum([0, *map(len, anchors)])
    for corner, first in zip(path.corners, firsts.tolist(), strict=False):
        if len(corner.anchors) == 3:  # the plane in the middle bisects the corner
            bisector = corner.before + corner.after
            cut.normal[first + 1] = bisector / np.linalg.norm(bisector)
            cut.point[first + 1] = corner.point
    order = np.argsort(s, kind="stable")
    is_new = np.diff(s[order], prepend=-1.0) > PLANE_DISTANCE  # planes at one place are crossed at one time
    numbers = np.empty(len(s), np.int64)
    numbers[order] = np.cumsum(is_new) - 1
    kept, at = order[is_new], numbers.tolist()
    return CommandStations(
        poses,
        reach,
        path,
        Planes(*(values[kept] for values in cut)),
        tuple(at[: len(even.s)]),
        tuple(tuple(at[a:b]) for a, b in pairwise(firsts.tolist())),
        tuple((at[k], at[k + 1]) for k in range(firsts[-1], len(s), 2)),
    )


def match_cycle(stations: CommandStations, cycle: Motion) -> MatchedCycle | str:
    """Return where a cycle attains the poses and crosses the planes, or why it does not follow them."""
    if stations.path is not None:
        steps = np.linalg.norm(np.diff(cycle.position, axis=0), axis=1)[find_jumps(cycle)]
        if steps.max(initial=0.0) > SAME_PATH * stations.path.motion.extent:
            return f"it jumps {steps.max() * 1e3:.0f} mm from one row to the next"
    rests = find_attained_poses(cycle, stations.poses, stations.reach)
    if isinstance(rests, int):
        return f"it does not rest at pose {rests + 1}"
    if stations.planes is None:
        return MatchedCycle(cycle, rests, None, 0.0)
    crossings = find_crossings(cycle, stations.planes)
    if isinstance(crossings, int):
        return f"it does not cross the command {stations.planes.s[crossings] * 1e3:.0f} mm from its start"
    return MatchedCycle(cycle, rests, crossings, float(np.median(stations.planes.t - crossings.t)))


def evaluate_cycles(
    stations: CommandStations, cycles: Sequence[MatchedCycle], band: float, tolerance: Mapping[str, float]
) -> Evaluation:
    """Return every criterion of cycles that follow a command.

    Args:
        stations: The poses and planes of the command.
        cycles: At least one.
        band: Half of the width of the band around a final pose in [m].
        tolerance: Largest absolute values allowed, by criterion.
    """
    values: list[Value] = []
    poses = path = None
    if len(stations.poses):
        poses = _attained_poses(stations.poses, cycles)
        values += pose_values(poses.attained, poses.attained_quat, stations.poses)
        values += _settling_values(cycles, len(stations.poses), band)
    if stations.path is not None and stations.planes is not None:
        times = np.array([cycle.crossings.t for cycle in cycles if cycle.crossings is not None])
        path = _cut_path(stations, stations.path, stations.planes, cycles, times)
        values += _path_values(path)
        values += _angle_values(stations, stations.path.motion, cycles, times)
    return Evaluation(tuple(judge_all(values, len(cycles), tolerance)), poses, path)


def _attained_poses(poses: Poses, cycles: Sequence[MatchedCycle]) -> AttainedPoses:
    attained = [[cycle.motion.pose(rest) for rest in cycle.rests] for cycle in cycles]
    positions = np.array([[position for position, _ in of_cycle] for of_cycle in attained])
    if poses.quat_xyzw is None or any(cycle.motion.quat_xyzw is None for cycle in cycles):
        return AttainedPoses(poses.position, positions)
    quats = np.array([[quat for _, quat in of_cycle] for of_cycle in attained], np.float64)
    return AttainedPoses(poses.position, positions, poses.quat_xyzw, quats)


def _settling_values(cycles: Sequence[MatchedCycle], poses: int, band: float) -> Iterator[Value]:
    """Yield the mean PSt and the largest OV of each pose, over the cycles that rest in it."""
    for k in range(poses):
        settled = []
        for cycle in cycles:
            rest, since = cycle.rests[k], cycle.rests[k - 1].last if k else 0
            if rest.last > rest.first and (both := settling_and_overshoot(cycle.motion, since, rest, band)):
                settled.append(both)
        yield "PSt", f"pose {k + 1}", float(np.mean([time for time, _ in settled])) if settled else None
        yield "OV", f"pose {k + 1}", max((overshoot for _, overshoot in settled), default=None)


def _cut_path(
    stations: CommandStations,
    path: CommandPath,
    planes: Planes,
    cycles: Sequence[MatchedCycle],
    times: FloatArray,
) -> CutPath:
    """Return the path with the crossings, corners, legs and speeds of the cycles.

    Args:
        stations: The poses and planes of the command.
        path: The command path.
        planes: All planes.
        cycles: The cycles.
        times: When each crosses each plane in [s], shape (n, planes).
    """
    numbers = np.array(stations.path_planes)
    crossed = np.array([cycle.crossings.point[numbers] for cycle in cycles if cycle.crossings is not None])
    s = np.linspace(0.0, path.total, DRAWN_SPEEDS)
    motions = [cycle.motion for cycle in cycles]
    speeds = []
    for motion, t in zip(motions, times, strict=True):
        at = np.interp(s, planes.s, t, left=np.nan, right=np.nan)
        speeds.append(np.interp(at, (motion.t[1:] + motion.t[:-1]) / 2.0, motion.speed))
    legs = tuple(
        leg_speed(f"leg {k}", leg, motions, times[:, ends])
        for k, (leg, ends) in enumerate(zip(path.legs, map(list, stations.leg_planes), strict=True), 1)
    )
    return CutPath(
        s=planes.s[numbers],
        command=planes.point[numbers],
        normal=planes.normal[numbers],
        crossed=crossed,
        accuracy=accuracy(crossed, planes.point[numbers]),
        repeatability=repeatability(crossed),
        path=path.position,
        speed_s=s,
        speed=np.array(speeds),
        commanded_speed=path.speed_at(s),
        legs=legs,
        corners=tuple(_iter_corners(stations, path, motions, times)),
        total=path.total,
    )


def _iter_corners(
    stations: CommandStations, path: CommandPath, motions: Sequence[Motion], times: FloatArray
) -> Iterator[CornerPath]:
    for k, (corner, numbers) in enumerate(
        zip(path.corners, map(list, stations.corner_planes), strict=True), 1
    ):
        inside = path.position[(path.s > corner.middles[0]) & (path.s < corner.middles[1])]
        first, last = path.planes_at(np.array(corner.middles)).point
        command = np.vstack((first, inside, last))
        yield corner_path(f"corner {k}", corner, command, mean_path(motions, times[:, numbers]))


def _angle_values(
    stations: CommandStations, command: Motion, cycles: Sequence[MatchedCycle], times: FloatArray
) -> Iterator[Value]:
    """Yield the criteria of the angles at the planes; none if a side has no orientation."""
    numbers = np.array(stations.path_planes)
    assert stations.planes is not None
    commanded = command.orientations_at(stations.planes.t[numbers])
    attained = [cycle.motion.orientations_at(t[numbers]) for cycle, t in zip(cycles, times, strict=True)]
    angles = [euler_angles(quats) for quats in attained if quats is not None]
    if commanded is not None and len(angles) == len(cycles):
        names = [f"plane {k + 1}" for k in range(len(numbers))]
        yield from angle_values("T", names, np.array(angles), euler_angles(commanded))


def _path_values(path: CutPath) -> Iterator[Value]:
    for k, value in enumerate(path.accuracy):
        yield "AT", f"plane {k + 1}", float(value)
        yield "RT", f"plane {k + 1}", None if path.repeatability is None else float(path.repeatability[k])
    for corner in path.corners:
        yield "CR", corner.name, corner.rounding
        yield "CO", corner.name, corner.overshoot
    for leg in path.legs:
        yield "AV", leg.name, leg.accuracy
        yield "RV", leg.name, leg.repeatability
        yield "FV", leg.name, leg.fluctuation
