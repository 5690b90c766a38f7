"""What the 3D view shows: the arm, the paths, where the points are on them, and the worst deviation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.elementwise import Vector
from urmpipe_models.kinematics.forward import points_over_log, positions_over_log
from urmpipe_models.transform import Transform, translation
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison, by_tolerance
from urmpipe_pipeline.comparison.decided import decided_row
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.trajectory import Trajectory
from urmpipe_pipeline.comparison.wording import amount_words
from urmpipe_pipeline.palette import REFERENCE_COLOUR, joint_colour, run_colour
from urmpipe_pipeline.recording.bodies import Body, bodies_over_log, lacks_shapes
from urmpipe_pipeline.recording.enlarged import enlarged
from urmpipe_pipeline.recording.entities import Place, entity_path, places_of, printable
from urmpipe_pipeline.recording.ghost_arms import ArmName, GhostArm, ghost_arms, gone_after
from urmpipe_pipeline.recording.goal_marks import GoalMarks, goal_marks
from urmpipe_pipeline.recording.signal_entities import arm_keys
from urmpipe_pipeline.recording.ways import NEVER, Gone, Way, dashed, lines_of, thinned, track_of
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Result, Simulation

NEAR = 3.0
"""Targets that are missed are in view if they are not further from the middle than so many radii: at that
place one leaves the arm half of the view, and one that is out of reach by less must be seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """The moving arm.

    Attributes:
        t_ns: Time of each pose in integer [ns], shape (m,).
        sample: Its grid sample, shape (m,).
        skeleton: Base, p1..pn of each pose in [m], shape (m, n + 1, 3).
        colours: One a point: a joint's own, or the reference's where nothing moves.
        bodies: Its links as they look, each with the frame it moves with; none where that is not known.
        bare: True if a moving link has nothing to show: then lines stand for the links.
        gone: From when on there is no pose, where targets have no solution; never of a log, in which a
            sample that is missing was only not written.
    """

    t_ns: IntArray
    sample: IntArray
    skeleton: FloatArray
    colours: tuple[str, ...]
    bodies: tuple[Body, ...]
    bare: bool
    gone: Gone = NEVER


@dataclass(frozen=True, slots=True)
class Mark:
    """A place with a name.

    Attributes:
        position: In [m].
        text: Its label.
    """

    position: tuple[float, float, float]
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Everything in the 3D view.

    Attributes:
        arm: The arm of a run, of several the worst that has kinematics; None without a robot.
        ways: The paths.
        enlarged: The deviation as a path whose distance from the reference is a multiple of the true one.
        worst: Where the verdict on the log was decided whose arm it is.
        whose: Name of the log whose arm it is, where there are several; else empty.
        ghosts: The further branches of solved joint values.
        chosen: The name of the branch that the arm itself is in, where there are others.
        goals: What they were solved for.
    """

    arm: Arm | None
    ways: tuple[Way, ...]
    enlarged: Way | None = None
    worst: Mark | None = None
    whose: str = ""
    ghosts: tuple[GhostArm, ...] = ()
    chosen: ArmName | None = None
    goals: GoalMarks | None = None

    @property
    def empty(self) -> bool:
        """True if there is nothing to see."""
        return self.arm is None and not self.ways and not self.ghosts and self.goals is None

    @property
    def _every_way(self) -> tuple[Way, ...]:
        """The paths, the enlarged one among them."""
        return self.ways if self.enlarged is None else (*self.ways, self.enlarged)

    def points(self) -> FloatArray:
        """Return every point that is to be in view in [m], shape (n, 3); the origin if there is none.

        Targets that are missed by far are not: they would make the arm small.
        """
        points = [part for way in self._every_way for part in (*way.strips, way.track.position) if len(part)]
        if self.arm is not None:
            points.append(self.arm.skeleton.reshape(-1, 3))
        points += [ends.reshape(-1, 3) for ghost in self.ghosts for ends in (ghost.start, ghost.end)]
        if self.goals is not None:
            points.append(self.goals.reached)
            points.append(_near(np.concatenate(points), self.goals.missed))
        return np.concatenate(points) if sum(map(len, points)) else np.zeros((1, 3))

    def ball(self) -> tuple[FloatArray, float]:
        """Return centre, shape (3,), and radius of a ball around everything, in [m]; 1 m around one point."""
        return _ball(self.points())


def _near(points: FloatArray, missed: FloatArray) -> FloatArray:
    """Return the targets missed that are not far from the other points; all if there are no others."""
    if not len(points):
        return missed
    centre, radius = _ball(points)
    return np.asarray(missed[np.linalg.norm(missed - centre, axis=1) <= NEAR * radius])


def _ball(points: FloatArray) -> tuple[FloatArray, float]:
    """Return centre and radius of a ball around points; 1 m around one point."""
    low, high = points.min(axis=0), points.max(axis=0)
    radius = float(np.linalg.norm(high - low)) / 2
    return (low + high) / 2, radius or 1.0


def scene_of(result: Result) -> Scene:
    """Return what the 3D view shows of a result."""
    if isinstance(result, Simulation):
        return _of_simulation(result)
    standing = places_of(result)
    if isinstance(result, Run):
        return _of_run(result, standing[0])
    shown = arm_of(result)
    ways = [
        _done(one, place, run_colour(i))
        for i, (place, one) in enumerate(zip(standing, result.runs, strict=True))
    ]
    colour = run_colour(result.runs.index(shown))
    arm = _arm(_aligned(shown), int(shown.t_ns[decided_row(shown)]), colour)
    whose = printable(shown.name) if arm is not None and len(result.runs) > 1 else ""
    scene = Scene(arm, (_asked(result.reference, shown), *ways), whose=whose)
    larger = enlarged(shown, scene.ball()[1])
    return replace(scene, enlarged=larger, worst=_worst(shown, several=len(result.runs) > 1))


def _of_run(run: Run, place: Place) -> Scene:
    """Return the arm of a run and its ways; of a solved run also the other branches and the targets."""
    arm, ways = _arm(run, None, run_colour(0)), tuple(_run_ways(run, place))
    if run.goals is not None:
        gone = gone_after(run, run.log.t_ns[np.isfinite(run.log.q).all(axis=1)])
        arm = None if arm is None else replace(arm, gone=gone)
        ways = tuple(replace(way, gone=gone) for way in ways)
    alone = Scene(arm, ways, goals=goal_marks(run, place))
    ghosts, chosen = ghost_arms(run, place, 2.0 * alone.ball()[1]) if run.ghosts else ((), None)
    return replace(alone, ghosts=ghosts, chosen=chosen)


def arm_of(result: Comparison) -> Deviation:
    """Return the compared log whose arm is drawn: the worst that has kinematics, else the worst."""
    worst_first = sorted(result.runs, key=by_tolerance)[::-1]
    return next((one for one in worst_first if one.run.tcp is not None), worst_first[0])


def _worst(one: Deviation, *, several: bool) -> Mark:
    """Return where the verdict on a log was decided: by what, how much and when."""
    x, y, z = one.actual[decided_row(one)].tolist()
    whose = f", {printable(one.name)}" if several else ""
    said = f"{printable(amount_words(one.decisive))} at t = {text.seconds(one.decisive.t_max)} s{whose}"
    return Mark((x, y, z), said)


def _run_ways(run: Run, place: Place) -> Iterator[Way]:
    """Yield where the run recorded itself, and where it was by its joints."""
    wanted = run.tcp is not None
    if run.tcp_recorded is not None:
        entities = entity_path("path", "recorded"), entity_path("point", "recorded")
        colour = REFERENCE_COLOUR if wanted else run_colour(0)
        strips = lines_of(run.tcp_recorded)
        track = track_of(run.t_ns, run.tcp_recorded)
        yield Way(*entities, colour, wanted, dashed(strips) if wanted else strips, track)
    if run.tcp is not None:
        entities = place.named("path"), place.named("point")
        strips = () if not run.timed else lines_of(run.tcp.position)
        track = track_of(run.t_ns, run.tcp.position)
        yield Way(*entities, run_colour(0), False, strips, track)


def _asked(reference: Trajectory, shown: Deviation) -> Way:
    """Return the reference: its lines whole, its point where it is at the samples of a run."""
    entities = entity_path("path", "reference"), entity_path("point", "reference")
    strips = () if not shown.run.timed else dashed(lines_of(reference.position))
    track = track_of(shown.t_ns, shown.reference, shown.sample, decided_row(shown))
    return Way(*entities, REFERENCE_COLOUR, True, strips, track)


def _done(one: Deviation, place: Place, colour: str) -> Way:
    """Return where a compared run was."""
    row = decided_row(one)
    track = track_of(one.t_ns, one.actual, one.sample, row)
    return Way(
        place.named("path"),
        place.named("point"),
        colour,
        False,
        () if not one.run.timed else lines_of(one.actual, one.sample, row),
        track,
    )


def _aligned(one: Deviation) -> Run:
    """Return a compared log with its arm where the alignment puts it: there its path is drawn."""
    robot, alignment = one.run.robot, one.alignment
    if robot is None or alignment.mode == "none":
        return one.run
    rotation = cast("tuple[Vector, Vector, Vector]", alignment.rotation)
    base = Transform(rotation, alignment.translation) @ robot.base
    return replace(one.run, robot=robot.placed(base, robot.tool @ translation(*alignment.tool)))


def _arm(run: Run, worst_ns: int | None, tip: str) -> Arm | None:
    """Return the moving arm of a run, or None without kinematics or without a whole sample."""
    if run.robot is None or run.tcp is None:
        return None
    worst = None if worst_ns is None else min(int(np.searchsorted(run.t_ns, worst_ns)), len(run.t_ns) - 1)
    return _moving(run.robot, run.t_ns, run.q, worst, tip)


def _moving(robot: Chain, t_ns: IntArray, every_q: FloatArray, worst: int | None, tip: str) -> Arm | None:
    """Return an arm that moves, thinned out for drawing, or None without a whole sample."""
    rows = thinned(t_ns, every_q, worst)
    if not len(rows):
        return None
    q = every_q[rows]
    bodies = bodies_over_log(robot, q)
    return Arm(
        t_ns=t_ns[rows],
        sample=rows,
        skeleton=points_over_log(robot, q),
        colours=_point_colours(robot, tip),
        bodies=bodies,
        bare=lacks_shapes(robot, bodies),
    )


def _of_simulation(result: Simulation) -> Scene:
    """Return the first arm of a simulation, and the way of the tip of each."""
    if not result.arms or not len(result.t_ns):
        return Scene(None, ())
    several = len(result.arms) > 1
    worst = result.judged_worst.sample if result.judged_worst is not None else None
    ways = []
    for i, (arm, key) in enumerate(zip(result.arms, arm_keys(result), strict=True)):
        position = positions_over_log(arm.chain, arm.q)
        track = track_of(result.t_ns, position, worst=worst)
        entities = entity_path("path", key), entity_path("point", key)
        strips = lines_of(position, worst=worst)
        label = printable(arm.block) if several else ""
        ways.append(Way(*entities, run_colour(i), False, strips, track, label))
    first = result.arms[0]
    arm_drawn = _moving(first.chain, result.t_ns, first.q, worst, run_colour(0))
    return Scene(arm_drawn, tuple(ways), whose=printable(first.block) if several else "")


def _point_colours(robot: Chain, tip: str) -> tuple[str, ...]:
    """Return a colour a point: each joint's at its frame, the reference's where none moves, the tip's."""
    moving = {name: joint_colour(i) for i, name in enumerate(robot.coordinates)}
    joints = [
        moving.get(joint.mimic.joint if joint.mimic else joint.name, REFERENCE_COLOUR)
        for joint in robot.joints
    ]
    return (*joints, tip)
