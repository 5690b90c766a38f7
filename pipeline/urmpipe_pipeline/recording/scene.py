"""What the 3D view shows: the arm, the paths and where the points are on them, thinned out for drawing.

The exact data stand in the scalars. A viewer is slow with a strip a sample, so the arm moves at
50 Hz or less, in 20,000 poses at most, and a path has as many vertices at most.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.chain import Chain
from urmpipe_models.kinematics import points_over_log
from urmpipe_pipeline.comparison import Comparison, Deviation, Trajectory
from urmpipe_pipeline.joint_log import FloatArray, IntArray
from urmpipe_pipeline.palette import REFERENCE_COLOUR, joint_colour, run_colour
from urmpipe_pipeline.recording.entities import Place, entity_path, places_of
from urmpipe_pipeline.results import Run

POSE_PERIOD = 0.02
"""Time between two poses drawn in [s], at least."""

DASHES = 120
"""Dashes of a line that was asked for."""

MOST = 20_000
"""Poses of the arm, and vertices of a path, at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """The moving arm.

    Attributes:
        t_ns: Time of each pose in integer [ns], shape (m,).
        sample: Its grid sample, shape (m,).
        skeleton: Base, p1..pn of each pose in [m], shape (m, n + 1, 3).
        colours: One a point: a joint's own, or the reference's where nothing moves.
    """

    t_ns: IntArray
    sample: IntArray
    skeleton: FloatArray
    colours: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A moving point.

    Attributes:
        t_ns: Time of each position in integer [ns], shape (m,).
        sample: Its sample, shape (m,).
        position: In [m], shape (m, 3).
    """

    t_ns: IntArray
    sample: IntArray
    position: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """Where a point goes: as lines, and as the point that moves on them.

    Attributes:
        path: Entity of the lines.
        point: Entity of the moving point.
        colour: As #rrggbb.
        wanted: True for what was asked for: drawn broad and dashed, so that what was done shows in the gaps.
        strips: Lines, each in [m], shape (any, 3).
        track: The moving point.
    """

    path: str
    point: str
    colour: str
    wanted: bool
    strips: tuple[FloatArray, ...]
    track: Track


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Everything in the 3D view.

    Attributes:
        arm: The arm of the first run, or None without a robot.
        ways: The paths.
    """

    arm: Arm | None
    ways: tuple[Way, ...]

    @property
    def empty(self) -> bool:
        """True if there is nothing to see."""
        return self.arm is None and not self.ways

    def ball(self) -> tuple[FloatArray, float]:
        """Return centre, shape (3,), and radius of a ball around everything, in [m]; 1 m around one point."""
        points = [part for way in self.ways for part in (*way.strips, way.track.position) if len(part)]
        if self.arm is not None:
            points.append(self.arm.skeleton.reshape(-1, 3))
        every = np.concatenate(points) if points else np.zeros((1, 3))
        low, high = every.min(axis=0), every.max(axis=0)
        radius = float(np.linalg.norm(high - low)) / 2
        return (low + high) / 2, radius or 1.0


def scene_of(result: Run | Comparison) -> Scene:
    """Return what the 3D view shows of a run or a comparison."""
    standing = places_of(result)
    if isinstance(result, Run):
        return Scene(_arm(result, None), tuple(_run_ways(result, standing[0])))
    first = result.runs[0]
    ways = [
        _done(one, place, run_colour(i))
        for i, (place, one) in enumerate(zip(standing, result.runs, strict=True))
    ]
    return Scene(_arm(first.run, int(first.t_ns[first.worst])), (_asked(result.reference, first), *ways))


def _run_ways(run: Run, place: Place) -> Iterator[Way]:
    """Yield where the run recorded itself, and where it was by its joints."""
    wanted = run.tcp is not None
    if run.tcp_recorded is not None:
        entities = entity_path("path", "recorded"), entity_path("point", "recorded")
        colour = REFERENCE_COLOUR if wanted else run_colour(0)
        strips = _strips(run.tcp_recorded)
        track = _track(run.t_ns, run.tcp_recorded)
        yield Way(*entities, colour, wanted, _dashes(strips) if wanted else strips, track)
    if run.tcp is not None:
        entities = place.named("path"), place.named("point")
        track = _track(run.t_ns, run.tcp.position)
        yield Way(*entities, run_colour(0), False, _strips(run.tcp.position), track)


def _asked(reference: Trajectory, first: Deviation) -> Way:
    """Return the reference: its lines whole, its point where it is at the first run's samples."""
    entities = entity_path("path", "reference"), entity_path("point", "reference")
    strips = _dashes(_strips(reference.position))
    track = _track(first.t_ns, first.reference, first.sample, first.worst)
    return Way(*entities, REFERENCE_COLOUR, True, strips, track)


def _done(one: Deviation, place: Place, colour: str) -> Way:
    """Return where a compared run was."""
    track = _track(one.t_ns, one.actual, one.sample, one.worst)
    return Way(
        place.named("path"), place.named("point"), colour, False, _strips(one.actual, one.sample), track
    )


def _track(
    t_ns: IntArray, position: FloatArray, sample: IntArray | None = None, worst: int | None = None
) -> Track:
    rows = _thinned(t_ns, position, worst)
    return Track(t_ns[rows], rows if sample is None else sample[rows], position[rows])


def _arm(run: Run, worst_ns: int | None) -> Arm | None:
    """Return the moving arm of a run, or None without kinematics or without a whole sample."""
    if run.robot is None or run.tcp is None:
        return None
    worst = None if worst_ns is None else min(int(np.searchsorted(run.t_ns, worst_ns)), len(run.t_ns) - 1)
    rows = _thinned(run.t_ns, run.q, worst)
    if not len(rows):
        return None
    return Arm(run.t_ns[rows], rows, points_over_log(run.robot, run.q[rows]), _point_colours(run.robot))


def _point_colours(robot: Chain) -> tuple[str, ...]:
    """Return a colour a point: each joint's at its frame, the reference's at what does not move."""
    moving = {name: joint_colour(i) for i, name in enumerate(robot.coordinates)}
    joints = [
        moving.get(joint.mimic.joint if joint.mimic else joint.name, REFERENCE_COLOUR)
        for joint in robot.joints
    ]
    return (*joints, run_colour(0))


def _thinned(t_ns: IntArray, values: FloatArray, worst: int | None) -> IntArray:
    """Return the rows to draw: at 50 Hz or less, the last and the worst among them, none without a value."""
    count = len(t_ns)
    if not count:
        return np.empty(0, dtype=np.int64)
    seconds = float(t_ns[-1] - t_ns[0]) / 1e9
    most = min(MOST, math.floor(seconds / POSE_PERIOD + 1e-6) + 1)
    step = max(1, math.ceil(count / most))
    rows = np.union1d(np.arange(0, count, step), [count - 1, worst if worst is not None else 0])
    drawn: IntArray = rows[np.isfinite(values[rows]).all(axis=1)]
    return drawn


def _strips(position: FloatArray, sample: IntArray | None = None) -> tuple[FloatArray, ...]:
    """Return the lines through the positions, broken where a sample is missing or has no value."""
    missing: NDArray[np.bool_] = np.asarray(~np.isfinite(position).all(axis=1))
    broken = missing[1:] | missing[:-1]
    if sample is not None:
        broken |= np.diff(sample) > 1
    cuts = np.flatnonzero(broken) + 1
    starts, ends = np.r_[0, cuts], np.r_[cuts, len(position)]
    lines = np.flatnonzero(ends - starts > 1)
    step = max(1, math.ceil(len(position) / MOST))
    return tuple(
        position[np.union1d(np.arange(start, end, step), [end - 1])]
        for start, end in zip(starts[lines].tolist(), ends[lines].tolist(), strict=True)
    )


def _dashes(strips: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """Return every second piece of the lines, all pieces of a line equally long."""
    lengths = [np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(strip, axis=0), axis=1))] for strip in strips]
    dash = sum(float(length[-1]) for length in lengths) / (2 * DASHES)
    return tuple(
        _piece(strip, length, start, start + dash)
        for strip, length in zip(strips, lengths, strict=True)
        for start in (np.arange(0.0, length[-1], 2 * dash) if dash > 0.0 else ())
    )


def _piece(strip: FloatArray, length: FloatArray, start: float, end: float) -> FloatArray:
    """Return a line from one arc length to another."""
    inner = strip[(length > start) & (length < end)]
    first, last = (np.array([np.interp(at, length, column) for column in strip.T]) for at in (start, end))
    return np.vstack((first, inner, last))
