"""Measure: every criterion of some cycles against a command."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.iso9283.command_path import Bend, CommandPath, Crossings, Stations, Stop, crossings
from urmpipe_pipeline.iso9283.corners import CornerPath, LegSpeed, corner_path, leg_speed, mean_path
from urmpipe_pipeline.iso9283.criteria import (
    UNITS,
    Criterion,
    accuracy,
    angles,
    judged,
    repeatability,
    turned,
)
from urmpipe_pipeline.iso9283.cycles import ALIKE, jumps
from urmpipe_pipeline.iso9283.motion import Motion, Rest
from urmpipe_pipeline.iso9283.poses import (
    Found,
    Poses,
    angle_criteria,
    attained,
    pose_criteria,
    poses_of,
    settling,
)
from urmpipe_pipeline.iso9283.result import AttainedPoses, CutPath

DRAWN = 1000
"""Places along the path at which speeds are drawn."""

LEAST = 1e-9
"""Places along the path that are no further apart than this in [m] are one."""


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """What was asked for in each cycle.

    Attributes:
        motion: The motion.
        targets: Poses to judge instead of those in which it rests.
        bends: Where it is known to turn.
        stops: Where it is known to stop, if for a moment only.
        planes: How many planes cut its path.
    """

    motion: Motion
    targets: Poses | None = None
    bends: tuple[Bend, ...] = ()
    stops: tuple[Stop, ...] = ()
    planes: int = 50


@dataclass(frozen=True, slots=True, eq=False)
class Marks:
    """The places that cycles are held against: poses, and planes of all kinds in their order.

    Attributes:
        poses: The commanded poses.
        reach: How far from a pose a rest may be that is told to be in it, in [m].
        path: The command path; None where nothing moves.
        stations: Planes in order: those of AT, those about corners and at the ends of legs.
        planes: Which of them cut the path for AT, shape (m,).
        corners: Which of them belong to each corner.
        legs: Which two of them belong to each leg.
    """

    poses: Poses
    reach: float
    path: CommandPath | None = None
    stations: Stations | None = None
    planes: tuple[int, ...] = ()
    corners: tuple[tuple[int, ...], ...] = ()
    legs: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """A cycle that followed the command.

    Attributes:
        motion: The cycle.
        rests: Its rows in each pose.
        crossed: Where it crosses the planes; None without any.
        offset: t_reference - t_cycle in [s].
    """

    motion: Motion
    rests: tuple[Rest, ...]
    crossed: Crossings | None
    offset: float


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """The criteria of some cycles, and what is drawn of them."""

    criteria: tuple[Criterion, ...]
    poses: AttainedPoses | None
    path: CutPath | None


def marks_of(command: Command) -> Marks:
    """Return the poses of a command, and the planes that cut its path."""
    motion = command.motion
    poses = command.targets or poses_of(motion, command.stops)
    places = np.vstack((motion.position, poses.position))
    reach = ALIKE * float(np.ptp(places, axis=0).max(initial=0.0))
    if not motion.timed or bool(motion.slow.all()):
        return Marks(poses, reach if len(poses) > 1 else np.inf)
    path = CommandPath(motion, command.bends)
    planes = path.planes(command.planes)
    about = [one.anchors for one in path.corners]
    s = np.concatenate([planes.s, *about, *([one.begins, one.ends] for one in path.legs)])
    found = path.stations(s)
    firsts = len(planes.s) + np.cumsum([0, *map(len, about)])
    for one, first in zip(path.corners, firsts.tolist(), strict=False):
        if len(one.anchors) == 3:  # the plane in the middle bisects the corner
            both = one.before + one.behind
            found.normal[first + 1], found.point[first + 1] = both / np.linalg.norm(both), one.point
    order = np.argsort(s, kind="stable")
    new = np.diff(s[order], prepend=-1.0) > LEAST  # planes that are one are crossed at one time
    place = np.empty(len(s), np.int64)
    place[order] = np.cumsum(new) - 1
    at, every = order[new], place.tolist()
    return Marks(
        poses, reach, path, Stations(found.s[at], found.t[at], found.point[at], found.normal[at]),
        tuple(every[: len(planes.s)]),
        tuple(tuple(every[a:b]) for a, b in pairwise(firsts.tolist())),
        tuple((every[k], every[k + 1]) for k in range(firsts[-1], len(s), 2)),
    )  # fmt: skip


def follow(marks: Marks, cycle: Motion) -> Followed | str:
    """Return a cycle beside the command, or why it does not follow that to its end."""
    if marks.path is not None:
        steps = np.linalg.norm(np.diff(cycle.position, axis=0), axis=1)[jumps(cycle)]
        if steps.max(initial=0.0) > ALIKE * marks.path.motion.extent:
            return f"it jumps {steps.max() * 1e3:.0f} mm from one row to the next"
    rests = attained(cycle, marks.poses, marks.reach)
    if isinstance(rests, int):
        return f"it does not rest at pose {rests + 1}"
    if marks.stations is None:
        return Followed(cycle, rests, None, 0.0)
    crossed = crossings(cycle, marks.stations)
    if isinstance(crossed, int):
        return f"it does not cross the command {marks.stations.s[crossed] * 1e3:.0f} mm from its start"
    return Followed(cycle, rests, crossed, float(np.median(marks.stations.t - crossed.t)))


def measure(
    marks: Marks, cycles: Sequence[Followed], band: float, tolerance: Mapping[str, float]
) -> Measured:
    """Return every criterion of some cycles that followed a command.

    Args:
        marks: The poses and planes of the command.
        cycles: At least one.
        band: Half of the width of the band round a final pose in [m].
        tolerance: Largest absolute values allowed, by criterion.
    """
    found: list[Found] = []
    poses = path = None
    if len(marks.poses):
        poses = _attained(marks, cycles)
        found += pose_criteria(poses.attained, poses.attained_quat, marks.poses)
        found += _settling(cycles, marks, band)
    if marks.path is not None:
        path, turns = _path(marks, cycles)
        found += _path_criteria(path)
        found += turns
    return Measured(tuple(_every(found, len(cycles), tolerance)), poses, path)


def _every(found: Sequence[Found], cycles: int, tolerance: Mapping[str, float]) -> Iterator[Criterion]:
    """Yield each criterion over all, then where it is."""
    for name in UNITS:
        own = [(at, _finite(value)) for other, at, value in found if other == name]
        known = [value for _, value in own if value is not None]
        if own:
            yield judged(name, None, max(known, key=abs, default=None), cycles, tolerance)
            yield from (judged(name, at, value, cycles, tolerance) for at, value in own)


def _finite(value: float | None) -> float | None:
    """Return a value; None for one that is none: a still pose without a command."""
    return value if value is not None and np.isfinite(value) else None


def _attained(marks: Marks, cycles: Sequence[Followed]) -> AttainedPoses:
    """Return where the cycles attained each pose, and how."""
    both = [[one.motion.pose(rest) for rest in one.rests] for one in cycles]
    places = np.array([[place for place, _ in one] for one in both])
    wanted, quats = marks.poses.quat_xyzw, None
    if wanted is not None and all(one.motion.quat_xyzw is not None for one in cycles):
        quats = np.array([[turn for _, turn in one] for one in both], np.float64)
    return AttainedPoses(marks.poses.position, places, None if quats is None else wanted, quats)


def _settling(cycles: Sequence[Followed], marks: Marks, band: float) -> Iterator[Found]:
    """Yield the mean stabilisation time and the largest overshoot of each pose that is rested in."""
    for k in range(len(marks.poses)):
        own = []
        for one in cycles:
            rest = one.rests[k]
            since = one.rests[k - 1].last if k else 0
            settled = settling(one.motion, since, rest, band) if rest.last > rest.first else None
            if settled is not None:
                own.append(settled)
        times, beyond = zip(*own, strict=True) if own else ((), ())
        yield "PSt", f"pose {k + 1}", float(np.mean(times)) if times else None
        yield "OV", f"pose {k + 1}", max(beyond, default=None)


def _path(marks: Marks, cycles: Sequence[Followed]) -> tuple[CutPath, list[Found]]:
    """Return the path with what the cycles made of it, and what their orientations tell at the planes."""
    path, stations, planes = marks.path, marks.stations, np.array(marks.planes)
    assert path is not None and stations is not None
    crossed = [one.crossed for one in cycles if one.crossed is not None]
    times = np.array([one.t for one in crossed])
    points = np.array([one.point[planes] for one in crossed])
    s = np.linspace(0.0, path.total, DRAWN)
    motions = [one.motion for one in cycles]
    legs = tuple(
        leg_speed(f"leg {k + 1}", leg, motions, times[:, ends])
        for k, (leg, ends) in enumerate(zip(path.legs, map(list, marks.legs), strict=True))
    )
    cut = CutPath(
        s=stations.s[planes],
        command=stations.point[planes],
        normal=stations.normal[planes],
        crossed=points,
        accuracy=accuracy(points, stations.point[planes]),
        repeatability=repeatability(points),
        path=path.position,
        speed_s=s,
        speed=np.array([_speed_over(one, t, stations.s, s) for one, t in zip(motions, times, strict=True)]),
        commanded_speed=path.speed(s),
        legs=legs,
        corners=tuple(_corners(marks, path, motions, times)),
        total=path.total,
    )
    return cut, list(_turns(marks, path.motion, motions, times[:, planes]))


def _corners(
    marks: Marks, path: CommandPath, motions: Sequence[Motion], times: FloatArray
) -> Iterator[CornerPath]:
    """Yield how the cycles take each corner."""
    for k, (corner, about) in enumerate(zip(path.corners, map(list, marks.corners), strict=True)):
        inside = path.position[(path.s > corner.middles[0]) & (path.s < corner.middles[1])]
        first, last = path.stations(np.array(corner.middles)).point
        command = np.vstack((first, inside, last))
        yield corner_path(f"corner {k + 1}", corner, command, mean_path(motions, times[:, about]))


def _speed_over(cycle: Motion, t: FloatArray, s: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the speed of a cycle over arc lengths of the command in [m], shape (q,), in [m/s]; NaN beyond.

    Args:
        cycle: The cycle.
        t: When it crosses the planes in [s], shape (k,).
        s: Arc lengths of the planes in [m], shape (k,).
        wanted: Arc lengths in [m], shape (q,).
    """
    when = np.interp(wanted, s, t, left=np.nan, right=np.nan)
    middle = (cycle.t[1:] + cycle.t[:-1]) / 2.0
    return np.interp(when, middle, cycle.speed)


def _turns(marks: Marks, command: Motion, motions: Sequence[Motion], times: FloatArray) -> Iterator[Found]:
    """Yield the criteria of the angles at the planes; nothing where a side has no orientation."""
    planes = np.array(marks.planes)
    wanted = None if marks.stations is None else command.turned(marks.stations.t[planes])
    found = [one.turned(t) for one, t in zip(motions, times, strict=True)]
    quats = [one for one in found if one is not None]
    if wanted is None or len(quats) < len(motions):
        return
    off = turned(np.array([angles(one) for one in quats]), angles(wanted))
    yield from angle_criteria("T", [f"plane {k + 1}" for k in range(len(planes))], off)


def _path_criteria(path: CutPath) -> Iterator[Found]:
    """Yield accuracy and repeatability at the planes, then what is told of corners and legs."""
    for k, value in enumerate(path.accuracy):
        yield "AT", f"plane {k + 1}", float(value)
        yield "RT", f"plane {k + 1}", None if path.repeatability is None else float(path.repeatability[k])
    for corner in path.corners:
        yield "CR", corner.name, corner.rounding
        yield "CO", corner.name, corner.overshoot
    for leg in path.legs:
        yield from _leg(leg)


def _leg(leg: LegSpeed) -> Iterator[Found]:
    """Yield what is told of the speed on a leg."""
    yield "AV", leg.name, leg.accuracy
    yield "RV", leg.name, leg.repeatability
    yield "FV", leg.name, leg.fluctuation
