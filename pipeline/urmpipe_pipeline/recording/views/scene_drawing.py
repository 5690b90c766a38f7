"""The 3D view: arms, paths, targets and places are sent, and seen from where all of them are in view."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import compose
from urmpipe_pipeline.presentation.palette import (
    AXIS_COLOURS,
    DEVIATION_COLOUR,
    MASS_COLOUR,
    REFERENCE_COLOUR,
    rgb,
    value_colours,
)
from urmpipe_pipeline.presentation.scene import ArmMark, Arrows, Balls, Scene, Spot, ball_sizes
from urmpipe_pipeline.recording.layout import VIEW_ROOT, keys, shown_path, times_at
from urmpipe_pipeline.recording.views.camera import eye_axes, eye_distance, seen
from urmpipe_pipeline.recording.views.geometry import (
    DrawnArm,
    DrawnGhost,
    DrawnLabel,
    DrawnPath,
    DrawnTargets,
    Moving,
    ball,
    drawn_arm,
    drawn_ghosts,
    drawn_labels,
    drawn_path,
    drawn_targets,
    extent,
    opens_row,
)
from urmpipe_pipeline.recording.views.shapes import carrier_path, draw_body, hide_body
from urmpipe_pipeline.recording.views.solids import draw_solids
from urmpipe_pipeline.text import drop_surrogates

if TYPE_CHECKING:
    from rerun import ComponentColumnList, LineStrips3D, Points3D, RecordingStream
    from rerun.blueprint import Spatial3DView

LINK, JOINT, POINT, SPOT, AXIS, MARK, MASS = 0.012, 0.022, 0.018, 0.024, 0.005, 0.034, 0.04
ASKED, DONE, THREAD = 0.0065, 0.0035, 0.002
FRAME_LENGTH, FRAME, TARGET, MISSED = 0.09, 0.004, 0.012, 0.02
"""Sizes in the 3D view, as shares of the radius of everything in it."""

AROUND = 1.2
"""Radius of a marked place in radii of the thickest solid there, at least: a mark inside it is not seen."""

THIN = 0.5
"""Thickness of every second ghost beside the others."""

OPACITY = 90
"""Of balls and the bones of a ghost, of 255: seven, one in front of the other, let the arm itself through."""

LABELLED = 8
"""Reasons that are written beside the targets missed; of more each is told where its point is selected."""

LINE = 0.14
"""Height of a label, as a share of the radius of everything in view: two that are closer cover each other."""

LABEL_COLOUR = "#ffffff"
"""Labels: they stand on lines of any colour."""


@np.errstate(over="ignore", invalid="ignore")  # beyond 3e38, infinite in single precision, nothing is seen
def scene_view(stream: RecordingStream, scene: Scene, opens_at_ns: int) -> Spatial3DView | None:
    """Send a scene that opens at a time in [ns] and return its view; None if there is nothing to see."""
    import rerun as rr

    arm = next((drawn_arm(one) for one in scene.arms if not one.ghost), None)
    ghosts = drawn_ghosts(scene.arms)
    paths = [drawn_path(path) for path in scene.paths]
    targets = None if scene.targets is None else drawn_targets(scene.targets)
    if arm is None and not (paths or ghosts or targets is not None or scene.solids or scene.moving_lines):
        return None
    points = extent(arm, ghosts, paths, targets, scene.arrows, scene.balls, scene.solids, scene.moving_lines)
    size = ball(points)[1]
    stream.log(VIEW_ROOT, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    labelled = [one for one in scene.arms if one.label]
    row = opens_row(scene, opens_at_ns) if labelled else 0
    labels = drawn_labels(labelled, 2.0 * size, row)
    for key, path in zip(keys([one.path.name for one in paths]), paths, strict=True):
        _draw_path(stream, path, key, size)
    spots = [spot for spot in scene.spots if spot.always]
    lifts = _label_lifts(arm, spots, opens_at_ns, LINE * size)
    for number, spot in enumerate(spots):
        # A place on the path of the tool is inside the outermost link when the arm is there.
        radius = max(SPOT * size, AROUND * (arm.tip_radius if arm else 0.0))
        _draw_spot(stream, spot, f"spot {number}", radius, lifts[number])
    if scene.arrows is not None:
        _draw_arrows(stream, scene.arrows, size)
    if scene.balls is not None:
        _draw_balls(stream, scene.balls)
    if targets is not None:
        _draw_targets(stream, targets, size)
    for number, ghost in enumerate(ghosts):
        _draw_ghost(stream, ghost, shown_path("scene", "ghost", str(number)), size)
    for number, label in enumerate(labels):
        _draw_label(stream, label, shown_path("scene", "label", str(number)))
    if arm is not None:
        inside = arm.masses.size > 0 or (arm.shows_joints and len(ghosts) > 0)
        _draw_arm(stream, arm, size, lifts[len(spots) :], seen_through=inside)
    hidden = draw_solids(stream, scene, size, THREAD * size)
    return _view(scene, points, hidden)


def _label_lifts(arm: DrawnArm | None, spots: Sequence[Spot], opens_at_ns: int, line: float) -> FloatArray:
    """Return how far labels of spots, then of an arm's marks, are raised in [m] to be read as a view opens.

    Args:
        arm: The arm with its marks; None without one.
        spots: Places with a label.
        opens_at_ns: The time in [ns] at which the view opens.
        line: Height of a label in [m].
    """
    places = [spot.position for spot in spots]
    if arm is not None and arm.marks:
        t_ns, rows = arm.moving.t_ns, arm.moving.rows
        at = 0 if t_ns is None else int(np.abs(np.asarray(t_ns)[rows] - opens_at_ns).argmin())
        places += [tuple(arm.place(mark)[at].tolist()) for mark in arm.marks]
    raised = float(seen(np.array([0.0, 0.0, 1.0]))[1])  # how far 1 m of height is upwards in the picture
    heights = seen(np.array(places).reshape(-1, 3))[:, 1]
    order, steps = np.argsort(heights, kind="stable"), line * np.arange(len(places))
    lifts = np.zeros(len(places))
    lifts[order] = np.maximum.accumulate(heights[order] - steps) + steps - heights[order]
    return lifts / raised


def _view(scene: Scene, points: FloatArray, hidden: Sequence[str]) -> Spatial3DView:
    """Return the view, its eye so that it sees points in [m], shape (n, 3); some entities are hidden."""
    import rerun.blueprint as rrb

    centre, size = ball(points)
    plane = scene.plane
    distance = max(size, eye_distance(seen(points - centre, plane)))
    position, up = centre + distance * eye_axes(plane)[:, 2], (0.0, 0.0, 1.0) if plane is None else plane.up
    eye = rrb.EyeControls3D(position=position, look_target=centre, eye_up=up)
    return rrb.Spatial3DView(
        origin=VIEW_ROOT,
        contents=shown_path("scene") + "/**",
        name=drop_surrogates(scene.title),
        eye_controls=eye,
        overrides={entity: [rrb.EntityBehavior(visible=False)] for entity in hidden},
    )


def _send(
    stream: RecordingStream, entity: str, moving: Moving, columns: ComponentColumnList, each: int
) -> None:
    """Send so many values a row drawn."""
    if len(moving.rows):
        parts = columns.partition(np.full(len(moving.rows), each))
        stream.send_columns(entity, times_at(moving.t_ns, moving.rows), parts)


def _send_gone(stream: RecordingStream, entity: str, moving: Moving, columns: ComponentColumnList) -> None:
    """Send rows without any value: from their times on the viewer shows nothing of what stood there."""
    if len(moving.gone):
        parts = columns.partition(np.zeros(len(moving.gone), dtype=np.int64))
        stream.send_columns(entity, times_at(moving.t_ns, moving.gone), parts)


def _draw_arm(
    stream: RecordingStream, arm: DrawnArm, size: float, lifts: FloatArray, *, seen_through: bool
) -> None:
    """Draw the links, and a ball at each joint in its colour, or at the tip alone where the joints show.

    The labels of its marks are raised by lifts in [m], shape (marks,).
    """
    import rerun as rr

    moving, entity = arm.moving, shown_path("scene", "robot", "tip" if arm.shows_joints else "joints")
    for body in arm.bodies:
        draw_body(stream, body, times_at(moving.t_ns, moving.rows), seen_through=seen_through)
        if len(moving.gone):
            hide_body(stream, body, times_at(moving.t_ns, moving.gone), len(moving.gone))
    if arm.shows_joints:
        _draw_tool(stream, arm.chain, size)
    balls = slice(-1, None) if arm.shows_joints else slice(None)
    places, colours = arm.skeleton[:, balls].astype(np.float32), [rgb(one) for one in arm.colours[balls]]
    stream.log(entity, rr.Points3D.from_fields(colors=colours, radii=[JOINT * size]), static=True)
    columns = rr.Points3D.columns(positions=places.reshape(-1, 3))
    _send(stream, entity, moving, columns, places.shape[1])
    _send_gone(stream, entity, moving, rr.Points3D.columns(positions=[]))
    if arm.masses.size:
        _draw_masses(stream, arm, size)
    for number, mark in enumerate(arm.marks):
        _draw_mark(stream, arm, mark, shown_path("scene", "robot", "mark", str(number)), size, lifts[number])


def _draw_masses(stream: RecordingStream, arm: DrawnArm, size: float) -> None:
    """Draw the centres of an arm's masses, their names where they are selected."""
    import rerun as rr

    entity, moving = shown_path("scene", "robot", "masses"), arm.moving
    labels = [
        drop_surrogates(f"{one.mass:.4g} kg at {one.joint or 'the base'}") for one in arm.chain.inertials
    ]
    radii = (MASS * size * ball_sizes([one.mass for one in arm.chain.inertials])).tolist()
    style = rr.Points3D.from_fields(colors=[rgb(MASS_COLOUR)], radii=radii, labels=labels, show_labels=False)
    stream.log(entity, style, static=True)
    columns = rr.Points3D.columns(positions=arm.masses.astype(np.float32).reshape(-1, 3))
    _send(stream, entity, moving, columns, arm.masses.shape[1])
    _send_gone(stream, entity, moving, rr.Points3D.columns(positions=[]))


def _draw_mark(
    stream: RecordingStream, arm: DrawnArm, mark: ArmMark, entity: str, size: float, lift: float
) -> None:
    """Draw a ball with a word that moves with a point of an arm."""
    import rerun as rr

    radius = max(MARK * size, AROUND * arm.thickness(mark))
    stream.log(entity, rr.Points3D.from_fields(colors=[rgb(mark.colour)], radii=[radius]), static=True)
    stream.log(f"{entity}/label", _label(mark.words), static=True)
    for one, raised in ((entity, 0.0), (f"{entity}/label", lift)):
        place = np.add(arm.place(mark), (0.0, 0.0, raised))
        columns = rr.Points3D.columns(positions=place.astype(np.float32))
        _send(stream, one, arm.moving, columns, 1)
        _send_gone(stream, one, arm.moving, rr.Points3D.columns(positions=[]))


def _draw_tool(stream: RecordingStream, chain: Chain, size: float) -> None:
    """Draw the axes of the tool centre point, which the last moving joint carries."""
    last = max(k for k, joint in enumerate(chain.joints) if joint.kind != "fixed")
    tool = compose([*(joint.origin for joint in chain.joints[last + 1 :]), chain.tip, chain.tool])
    axes = _frames(np.array([tool.translation], float), np.array([tool.rotation], float), size)
    stream.log(f"{shown_path(*carrier_path(chain.joints[last].name))}/tool", axes, static=True)


def _draw_path(stream: RecordingStream, drawn: DrawnPath, key: str, size: float) -> None:
    """Draw a path as lines, broad if it is what was asked for, and the point that moves on it."""
    import rerun as rr

    path, colour = drawn.path, rgb(drawn.path.colour)
    if drawn.strips:
        strips = [strip.astype(np.float32) for strip in drawn.strips]
        lines = rr.LineStrips3D(strips, colors=drawn.colours, radii=[(ASKED if path.asked else DONE) * size])
        stream.log(shown_path("scene", "path", key), lines, static=True)
    if len(drawn.places):
        points = rr.Points3D(drawn.places.astype(np.float32), colors=[colour], radii=[TARGET * size])
        stream.log(shown_path("scene", "path", key), points, static=True)
    if not len(drawn.moving.rows):
        return
    entities = [shown_path("scene", "point", key)]
    style = rr.Points3D.from_fields(colors=[colour], radii=[POINT * size])
    stream.log(entities[0], style, static=True)
    if path.label:
        entities.append(shown_path("scene", "point", key, "label"))
        stream.log(entities[1], _label(path.label), static=True)
    for entity in entities:
        columns = rr.Points3D.columns(positions=drawn.position.astype(np.float32))
        _send(stream, entity, drawn.moving, columns, 1)
        _send_gone(stream, entity, drawn.moving, rr.Points3D.columns(positions=[]))


def _draw_spot(stream: RecordingStream, spot: Spot, key: str, radius: float, lift: float) -> None:
    """Draw a place that is there at all times, as a ball of a radius in [m], with its label raised by [m]."""
    import rerun as rr

    point = rr.Points3D([spot.position], colors=[rgb(spot.colour)], radii=[radius])
    stream.log(shown_path("scene", key), point, static=True)
    entity = shown_path("scene", key, "label")
    raised = np.add(spot.position, (0.0, 0.0, lift))
    stream.log(entity, rr.Points3D.from_fields(positions=[raised]), static=True)
    stream.log(entity, _label(spot.words), static=True)


def _draw_arrows(stream: RecordingStream, arrows: Arrows, size: float) -> None:
    """Draw arrows and the points that they start from, at all times, in the colours of their values."""
    import rerun as rr

    colours, root = value_colours(arrows.values), shown_path("scene", "arrows")
    start = arrows.start.astype(np.float32)
    vectors = (arrows.end - arrows.start).astype(np.float32)
    drawn = rr.Arrows3D(origins=start, vectors=vectors, colors=colours, radii=[FRAME * size])
    stream.log(root, drawn, static=True)
    stream.log(f"{root}/starts", rr.Points3D(start, colors=colours, radii=[TARGET * size]), static=True)


def _draw_balls(stream: RecordingStream, balls: Balls) -> None:
    """Draw balls at all times, seen through."""
    import rerun as rr

    drawn = rr.Ellipsoids3D(
        centers=balls.centre.astype(np.float32),
        radii=balls.radius.astype(np.float32),
        colors=[(*rgb(balls.colour), OPACITY)],
        fill_mode=rr.components.FillMode.Solid,
    )
    stream.log(shown_path("scene", "balls"), drawn, static=True)


def _label(words: str, colour: str = LABEL_COLOUR) -> Points3D:
    """Return the label of a point that stands elsewhere: in the point's colour it could hardly be read."""
    import rerun as rr

    labels = [drop_surrogates(words)] if words else None
    return rr.Points3D.from_fields(colors=[rgb(colour)], radii=[0.0], labels=labels, show_labels=True)


def _draw_label(stream: RecordingStream, label: DrawnLabel, entity: str) -> None:
    """Write a word that moves with an arm."""
    import rerun as rr

    stream.log(entity, _label("", label.colour or LABEL_COLOUR), static=True)
    texts = list(map(drop_surrogates, label.texts))
    columns = rr.Points3D.columns(positions=label.position.astype(np.float32), labels=texts)
    _send(stream, entity, label.moving, columns, 1)
    _send_gone(stream, entity, label.moving, rr.Points3D.columns(positions=[], labels=[]))


def _draw_ghost(stream: RecordingStream, ghost: DrawnGhost, entity: str, size: float) -> None:
    """Draw another solution. Rerun draws lines always opaque: so its bones are capsules, seen through."""
    import rerun as rr

    bones = ghost.start.shape[1]
    radii = np.where(np.arange(bones) < ghost.links, LINK, AXIS) * size * (THIN if ghost.thin else 1.0)
    colours, solid = [(*rgb(ghost.colour), OPACITY)], rr.components.FillMode.Solid
    stream.log(entity, rr.Capsules3D.from_fields(colors=colours, fill_mode=solid), static=True)
    lengths, quaternions = capsules(ghost.end - ghost.start)
    columns = rr.Capsules3D.columns(
        lengths=lengths.reshape(-1),
        radii=np.tile(radii, len(ghost.moving.rows)),  # where a row has a radius, it gets a length by default
        translations=ghost.start.astype(np.float32).reshape(-1, 3),
        quaternions=quaternions.reshape(-1, 4),
    )
    _send(stream, entity, ghost.moving, columns, bones)
    nothing = rr.Capsules3D.columns(lengths=[], radii=[], translations=[], quaternions=[])
    _send_gone(stream, entity, ghost.moving, nothing)


def capsules(bones: FloatArray) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return how long bones are and how they are turned: a capsule without a turn lies along z.

    The least turn that takes z to the unit vector d is the quaternion (z x d, 1 + z.d), normalised; to -z it
    is half a turn about x. Bones go from start to end in [m], shape (..., 3); lengths are in [m], shape
    (...), and quaternions x, y, z, w [-], shape (..., 4).
    """
    length = np.linalg.norm(bones, axis=-1)
    x, y, z = np.moveaxis(bones / np.where(length > 0.0, length, 1.0)[..., None], -1, 0)
    z = np.where(length > 0.0, z, 1.0)
    quat = np.stack((-y, x, np.zeros_like(z), 1.0 + z), axis=-1)
    norm = np.linalg.norm(quat, axis=-1, keepdims=True)
    down = norm < 1e-9
    quat = np.where(down, (1.0, 0.0, 0.0, 0.0), quat / np.where(down, 1.0, norm))
    return length.astype(np.float32), quat.astype(np.float32)


def _draw_targets(stream: RecordingStream, targets: DrawnTargets, size: float) -> None:
    """Draw targets: they stand at all times."""
    import rerun as rr

    grey, root = rgb(REFERENCE_COLOUR), shown_path("scene", "targets")
    if targets.strips:
        strips = [strip.astype(np.float32) for strip in targets.strips]
        stream.log(f"{root}/path", rr.LineStrips3D(strips, colors=[grey], radii=[ASKED * size]), static=True)
    if len(targets.points):
        points = rr.Points3D(targets.points, colors=[grey], radii=[TARGET * size])
        stream.log(f"{root}/points", points, static=True)
    if len(targets.origin):
        stream.log(f"{root}/frames", _frames(targets.origin, targets.axes, size), static=True)
    if len(targets.missed):
        stream.log(f"{root}/missed", _missed(targets, size), static=True)


def _missed(targets: DrawnTargets, size: float) -> Points3D:
    """Return the targets that are not reached: few with their reasons, many smaller."""
    import rerun as rr

    few = len(targets.missed) <= LABELLED
    labels = list(map(drop_surrogates, targets.reasons))
    radii, colours = [(MISSED if few else TARGET) * size], [rgb(DEVIATION_COLOUR)]
    return rr.Points3D(targets.missed, colors=colours, radii=radii, labels=labels, show_labels=few)


def _frames(origin: FloatArray, rotation: FloatArray, size: float) -> LineStrips3D:
    """Return the axes of frames in [m], shape (n, 3) and (n, 3, 3), in the colours of the coordinates."""
    import rerun as rr

    ends = origin[:, None] + FRAME_LENGTH * size * rotation.transpose(0, 2, 1)
    starts = np.broadcast_to(origin[:, None], ends.shape)
    strips = np.stack((starts, ends), axis=2).reshape(-1, 2, 3).astype(np.float32)
    colours = [rgb(AXIS_COLOURS[axis]) for axis in "xyz"] * len(origin)
    return rr.LineStrips3D(strips, colors=colours, radii=[FRAME * size])
