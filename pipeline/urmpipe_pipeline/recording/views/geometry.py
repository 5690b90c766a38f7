"""What the 3D view draws of a scene: poses thinned out, lines cut, sizes by the ball around everything."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Box, Chain, Mesh
from urmpipe_models.dynamics.equations import centres_of_mass_over_log
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.kinematics.forward import frames_over_log, points_over_log
from urmpipe_models.math3d import to_matrices
from urmpipe_pipeline.presentation.palette import REFERENCE_COLOUR, joint_colour, rgb
from urmpipe_pipeline.presentation.scene import (
    Arm,
    ArmMark,
    Arrows,
    Balls,
    MovingLines,
    Path,
    Scene,
    Solid,
    Targets,
)
from urmpipe_pipeline.recording.views.label_places import name_places, placed_names
from urmpipe_pipeline.recording.views.shapes import Body, bodies_over_log, opaque, own_shapes
from urmpipe_pipeline.recording.views.tracks import (
    MOST,
    beginnings,
    coloured_lines,
    dashed,
    drawn_rows,
    endings,
    lines_of,
    whole_rows,
)

POSES = 2_000
"""Poses of a ghost that are drawn, at most, and as many at which it begins anew."""

STUB = 0.1
"""Length of the piece of each joint's axis that is drawn of a ghost, as a share of the arm's own reach."""

FRAMES = 100
"""Targets with an orientation that are drawn as frames, at most: more would hide each other."""

NEAR = 3.0
"""Targets that are missed are in view if they are not further from the middle than so many radii: at that
place one leaves the arm half of the view, and one that is out of reach by less must be seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """When something is drawn.

    Attributes:
        t_ns: Times of all rows in [ns], shape (n,); None without times.
        rows: The rows at which it is drawn, shape (m,).
        gone: The rows from which on it is not there, shape (g,).
    """

    t_ns: IntArray | None
    rows: IntArray
    gone: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class DrawnArm:
    """The moving arm.

    Attributes:
        moving: When.
        skeleton: Base, p1..pn of each pose in [m], shape (m, n + 1, 3).
        colours: One a point: a joint's own, or the reference's where nothing moves.
        bodies: Its links as they look.
        shows_joints: True if all of them are solids made from its geometry, which have the joints' colours.
        marks: Words at its points.
        masses: The centres of its masses in each pose in [m], shape (m, inertials, 3); none where they are
            not drawn.
    """

    chain: Chain
    moving: Moving
    skeleton: FloatArray
    colours: tuple[str, ...]
    bodies: tuple[Body, ...]
    shows_joints: bool
    marks: tuple[ArmMark, ...] = ()
    masses: FloatArray = field(default_factory=lambda: np.empty((0, 0, 3)))

    def place(self, mark: ArmMark) -> FloatArray:
        """Return where a mark is in each pose in [m], shape (m, 3)."""
        end = self.skeleton[:, mark.point]
        return (end + self.skeleton[:, mark.point - 1]) / 2.0 if mark.segment else end

    def thickness(self, mark: ArmMark) -> float:
        """Return the largest radius of the round shapes on the link that ends at a mark in [m], 0 of none."""
        carrier = (None, *(joint.name for joint in self.chain.joints))[mark.point]
        return _largest_radius(body for body in self.bodies if body.joint == carrier)

    @property
    def tip_radius(self) -> float:
        """The largest radius of the round shapes on the outermost link that has some in [m], 0 of none."""
        outwards = (joint.name for joint in reversed(self.chain.joints))
        radii = (_largest_radius(body for body in self.bodies if body.joint == name) for name in outwards)
        return next(filter(None, radii), 0.0)

    @property
    def radius(self) -> float:
        """The largest radius of the round shapes on moving links in [m], 0 of none."""
        return _largest_radius(body for body in self.bodies if body.joint is not None)


@dataclass(frozen=True, slots=True, eq=False)
class DrawnGhost:
    """Another solution as an arm.

    Attributes:
        moving: When.
        start: Where each bone starts in [m], shape (m, bones, 3): the links, then the axes of the joints.
        end: Where it ends, likewise.
        links: How many of the bones are links.
        colour: As #rrggbb.
        thin: True of every second one: two that differ in the turn of the wrist alone have all their links in
            common; then one is seen inside the other.
    """

    moving: Moving
    start: FloatArray
    end: FloatArray
    links: int
    colour: str
    thin: bool


@dataclass(frozen=True, slots=True, eq=False)
class DrawnLabel:
    """A word that moves with an arm: when, where in [m], shape (m, 3), and what it says each time."""

    moving: Moving
    position: FloatArray
    texts: tuple[str, ...]
    colour: str | None


@dataclass(frozen=True, slots=True, eq=False)
class DrawnPath:
    """A path in [m]: its lines, shape (any, 3) each, or single places, and the point that moves, (m, 3).

    Its colours are one a line, shape (lines, 3), or one for all, shape (1, 3).
    """

    path: Path
    places: FloatArray
    strips: tuple[FloatArray, ...]
    colours: NDArray[np.uint8]
    moving: Moving
    position: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class DrawnTargets:
    """What is drawn of targets, in [m].

    Attributes:
        origin: Where targets with an orientation are, shape (m, 3).
        axes: Their x, y and z axes [-], shape (m, 3, 3), an axis a column.
        points: Targets reached that are drawn as points, shape (k, 3).
        strips: The way through targets with times, dashed, shape (any, 3) each.
        reached: Every target that is reached, shape (r, 3).
        missed: Targets that are not, shape (u, 3).
        reasons: Why they are not, one each.
    """

    origin: FloatArray
    axes: FloatArray
    points: FloatArray
    strips: tuple[FloatArray, ...]
    reached: FloatArray
    missed: FloatArray
    reasons: tuple[str, ...]


def drawn_arm(arm: Arm) -> DrawnArm | None:
    """Return the moving arm, thinned out; None without a whole pose."""
    q = np.asarray(arm.q)
    there = whole_rows(q)
    moving = _moving(arm.t_ns, there, arm.kept, vanishes=arm.vanishes)
    if not len(moving.rows):
        return None
    poses = q[moving.rows]
    colours = _point_colours(arm.chain, arm.colour)
    skeleton = points_over_log(arm.chain, poses)
    masses = centres_of_mass_over_log(arm.chain, poses) if arm.masses else np.empty((len(poses), 0, 3))
    names = (joint.name for joint in arm.chain.joints)
    bodies = bodies_over_log(arm.chain, poses, dict(zip(names, map(opaque, colours), strict=False)))
    solid = not own_shapes(arm.chain)
    return DrawnArm(arm.chain, moving, skeleton, colours, bodies, solid, arm.marks, masses)


def drawn_ghosts(arms: Sequence[Arm]) -> tuple[DrawnGhost, ...]:
    """Return the other solutions among some arms, in their order."""
    found = []
    for number, arm in enumerate(one for one in arms if one.ghost):
        q = np.asarray(arm.q)
        there = whole_rows(q)
        moving = _moving(arm.t_ns, there, arm.kept, vanishes=True, most=POSES)
        start, end = bones_of(arm.chain, q[moving.rows])
        links = len(arm.chain.joints)
        found.append(DrawnGhost(moving, start, end, links, arm.colour, thin=bool(number % 2)))
    return tuple(found)


def drawn_labels(arms: Sequence[Arm], view: float, opens_row: int) -> tuple[DrawnLabel, ...]:
    """Return the words at arms, where they can be read and told from each other.

    In a motion a word keeps the place that is good in the view that opens; between single poses it may leap.

    Args:
        arms: Those with a label, all with the same rows.
        view: The diagonal of all else that is in view in [m].
        opens_row: The row at which the view opens.
    """
    if not arms:
        return ()
    timed, count = arms[0].t_ns is not None, len(arms[0].q)
    rows = np.array([opens_row]) if timed else np.arange(min(count, POSES))
    bones = [bones_of(arm.chain, np.asarray(arm.q)[rows]) for arm in arms]
    chosen = placed_names(np.array([name_places(*one) for one in bones]), view)
    return tuple(_label(arm, chosen[i]) for i, arm in enumerate(arms))


def _label(arm: Arm, places: IntArray) -> DrawnLabel:
    q = np.asarray(arm.q)
    there = whole_rows(q)
    words = np.array((arm.label,) * len(q) if isinstance(arm.label, str) else arm.label, dtype=object)
    changes = np.flatnonzero(words[1:] != words[:-1]) + 1
    moving = _moving(arm.t_ns, there, changes[:POSES], vanishes=True, most=POSES)
    every = name_places(*bones_of(arm.chain, q[moving.rows]))
    at = places[np.minimum(moving.rows, len(places) - 1)]
    position = every[np.arange(len(moving.rows)), at]
    return DrawnLabel(moving, position, tuple(words[moving.rows]), arm.colour if arm.ghost else None)


def drawn_path(path: Path) -> DrawnPath:
    """Return a path as lines, and the point that moves on it, thinned out."""
    position = np.asarray(path.position)
    there = whole_rows(position)
    colours = np.array([rgb(path.colour)], dtype=np.uint8)
    strips = lines_of(position, path.sample, path.kept) if path.line else ()
    if path.line and path.values is not None:
        strips, colours = coloured_lines(position, path.values, path.kept)
    none = np.empty(0, dtype=np.int64)
    moving, places = Moving(None, none, none), np.empty((0, 3))
    if path.t_ns is None and not path.line:
        known = np.flatnonzero(there)
        places = position[known[:: math.ceil(len(known) / MOST) or 1]]
    if path.t_ns is not None:
        moving = _moving(path.t_ns, there, path.kept, vanishes=path.vanishes)
    strips = dashed(strips) if path.asked else strips
    return DrawnPath(path, places, strips, colours, moving, position[moving.rows])


def drawn_targets(targets: Targets) -> DrawnTargets:
    """Return what is drawn of targets: few as frames, many as points, those with times as a dashed line."""
    there = whole_rows(targets.position)
    few, timed = int(there.sum()) <= FRAMES, targets.t_ns is not None
    framed = few and targets.quat_xyzw is not None
    turned = targets.quat_xyzw[there] if framed and targets.quat_xyzw is not None else np.empty((0, 4))
    position, none = targets.position[there], np.empty((0, 3))
    reached = targets.position[there & targets.reached]
    missed = np.flatnonzero(there & ~targets.reached)[:MOST]
    return DrawnTargets(
        origin=position if framed else none,
        axes=to_matrices(turned),
        points=none if framed or (timed and not few) else reached[:MOST],
        strips=dashed(lines_of(targets.position)) if timed else (),
        reached=reached,
        missed=targets.position[missed],
        reasons=tuple(targets.reasons[row] if targets.reasons else "" for row in missed.tolist()),
    )


def extent(
    arm: DrawnArm | None,
    ghosts: Sequence[DrawnGhost],
    paths: Sequence[DrawnPath],
    targets: DrawnTargets | None,
    arrows: Arrows | None = None,
    balls: Balls | None = None,
    solids: Sequence[Solid] = (),
    moving_lines: Sequence[MovingLines] = (),
) -> FloatArray:
    """Return every point that is to be in view in [m], shape (n, 3); the origin if there is none.

    Targets that are missed by far are not: they would make the arm small.
    """
    points = [part for one in paths for part in (*one.strips, one.places, one.position) if len(part)]
    if arm is not None:
        skeleton, radius = arm.skeleton.reshape(-1, 3), arm.radius
        points += [skeleton - radius, skeleton + radius] if radius else [skeleton]
    points += [] if arrows is None else [arrows.start, arrows.end]
    if balls is not None:
        reach = balls.radius[:, np.newaxis]
        points += [balls.centre - reach, balls.centre + reach]
    points += [one.points for one in solids if not one.hidden]
    points += [line.reshape(-1, 3) for lines in moving_lines for line in lines.lines]
    points += [ends.reshape(-1, 3) for ghost in ghosts for ends in (ghost.start, ghost.end)]
    if targets is not None:
        points.append(targets.reached)
        points.append(_near(np.concatenate(points), targets.missed))
    every = np.concatenate(points) if points else np.empty((0, 3))
    every = every[whole_rows(every)]
    return every if len(every) else np.zeros((1, 3))


def ball(points: FloatArray) -> tuple[FloatArray, float]:
    """Return centre, shape (3,), and radius of a ball around points in [m]; 1 m around one point."""
    low, high = points.min(axis=0), points.max(axis=0)
    radius = float(np.linalg.norm(high - low)) / 2
    return (low + high) / 2, radius or 1.0


def bones_of(robot: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what is drawn of a ghost as lines: its links, and a piece of the axis of each joint that turns.

    Two solutions can differ in the turn of a wrist alone: then all their points are the same, and only the
    axes of the joints in between point otherwise.

    Args:
        robot: The arm.
        q: Joint values in [rad] or [m], shape (m, joints); NaN where there is no pose.

    Returns:
        Where each line starts and where it ends in [m], shape (m, lines, 3) each; NaN where there is no pose.
    """
    points = points_over_log(robot, q)
    position, rotation = frames_over_log(robot, q)
    turning = [k for k, joint in enumerate(robot.joints) if joint.kind == "revolute"]
    axes = np.array([robot.joints[k].axis for k in turning]).reshape(-1, 3)
    moved = np.array(turning, dtype=np.intp) + 1  # frame 0 is the base's
    direction = np.einsum("mkij,kj->mki", rotation[:, moved], axes)
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    reach = float(np.fmax.reduce(lengths, initial=0.0))
    stubs = position[:, moved] + STUB * reach * direction
    return (
        np.concatenate((points[:, :-1], position[:, moved]), axis=1),
        np.concatenate((points[:, 1:], stubs), axis=1),
    )


def opens_row(scene: Scene, opens_at_ns: int) -> int:
    """Return the row of the arms at which a view opens: where most of them are, without times the first."""
    there = sum(whole_rows(np.asarray(arm.q)).astype(np.int64) for arm in scene.arms)
    t_ns = scene.arms[0].t_ns if scene.arms else None
    if t_ns is None:
        return int(np.argmax(there)) if scene.arms else 0
    return min(int(np.searchsorted(t_ns, opens_at_ns)), len(t_ns) - 1)


def _moving(
    t_ns: IntArray | None,
    there: np.ndarray,
    kept: Sequence[int] | IntArray,
    *,
    vanishes: bool,
    most: int = MOST,
) -> Moving:
    """Return when something is drawn that is there at some rows."""
    rows = drawn_rows(t_ns, there, kept, most)
    if not vanishes:
        return Moving(t_ns, rows, np.empty(0, dtype=np.int64))
    begins, ends = beginnings(there), endings(there)
    begins = begins[:: math.ceil(len(begins) / POSES) or 1]
    if t_ns is None and len(rows):  # of many single poses the first are drawn, and nothing stays behind them
        ends = np.union1d(ends[ends <= rows[-1]], [rows[-1] + 1])
        ends = ends[ends < len(there)]
    return Moving(t_ns, np.union1d(rows, begins) if t_ns is not None else rows, ends)


def _largest_radius(bodies: Iterable[Body]) -> float:
    """Return the largest radius of the round shapes of some links in [m], 0 of none."""
    shapes = [visual.shape for body in bodies for visual in body.visuals]
    return max((one.radius for one in shapes if not isinstance(one, (Box, Mesh))), default=0.0)


def _near(points: FloatArray, missed: FloatArray) -> FloatArray:
    """Return the targets missed that are not far from the other points; all if there are no others."""
    if not len(points):
        return missed
    centre, radius = ball(points[whole_rows(points)])
    return np.asarray(missed[np.linalg.norm(missed - centre, axis=1) <= NEAR * radius])


def _point_colours(robot: Chain, tip: str) -> tuple[str, ...]:
    """Return a colour a point: each joint's at its frame, the reference's where none moves, the tip's."""
    moving = {name: joint_colour(i) for i, name in enumerate(robot.coordinates)}
    joints = [
        moving.get(joint.mimic.joint if joint.mimic else joint.name, REFERENCE_COLOUR)
        for joint in robot.joints
    ]
    return (*joints, tip)
