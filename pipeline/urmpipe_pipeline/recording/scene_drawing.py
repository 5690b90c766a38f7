"""Send what the 3D view draws: the arm and the paths."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from urmpipe_pipeline.palette import DEVIATION_COLOUR, NEUTRAL_COLOUR, rgb
from urmpipe_pipeline.recording.columns import time_columns
from urmpipe_pipeline.recording.ghost_arms import ArmName
from urmpipe_pipeline.recording.ghost_drawing import draw_ghost, draw_goals, send_gone
from urmpipe_pipeline.recording.scene import Arm, Mark, Scene
from urmpipe_pipeline.recording.shape_drawing import draw_body, hide_body
from urmpipe_pipeline.recording.ways import Way

if TYPE_CHECKING:
    from rerun import Points3D, RecordingStream

Skeleton: TypeAlias = NDArray[np.float32]
"""Base, p1..pn of each pose in [m], shape (m, n + 1, 3)."""

LINK_RADIUS, JOINT_RADIUS, POINT_RADIUS, MARK_RADIUS = 0.012, 0.022, 0.018, 0.024
WANTED_RADIUS, DONE_RADIUS = 0.0065, 0.0035
"""Sizes in the 3D view, as shares of the radius of everything in it."""

STRIPS = 256
"""Poses of the skeleton sent at a time: decoding a chunk of strips takes time by the square of its rows."""

CHOSEN = "/robot/name"
"""The entity of the name of the branch that the arm is in."""

LABEL_COLOUR = "#ffffff"
"""Labels: they stand on lines of any colour."""


def draw_scene(stream: RecordingStream, scene: Scene) -> None:
    """Send the arm, the paths and the worst place; nothing if there is neither arm nor path."""
    import rerun as rr

    if scene.empty:
        return
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    size = scene.ball()[1]
    for way in (*scene.ways, *([scene.enlarged] if scene.enlarged else [])):
        _draw_way(stream, way, size)
    if scene.worst is not None:
        _draw_mark(stream, scene.worst, size)
    if scene.goals is not None:
        draw_goals(stream, scene.goals, size)
    for ghost in scene.ghosts:
        draw_ghost(stream, ghost, size)
    if scene.chosen is not None:
        _draw_chosen(stream, scene.chosen)
    if scene.arm is not None:
        _draw_arm(stream, scene.arm, size)


def _draw_arm(stream: RecordingStream, arm: Arm, size: float) -> None:
    """Draw the links, as they look or as lines, and a ball at each joint in its colour."""
    import rerun as rr

    for body in arm.bodies:
        draw_body(stream, body, time_columns(arm.t_ns, "sample", arm.sample))
        if len(arm.gone.t_ns):
            gone = time_columns(arm.gone.t_ns, "sample", arm.gone.sample)
            hide_body(stream, body, gone, len(arm.gone.t_ns))
    skeleton = arm.skeleton.astype(np.float32)
    if arm.bare:
        _draw_links(stream, arm, skeleton, size)
    joints = rr.Points3D.from_fields(
        colors=[rgb(colour) for colour in arm.colours], radii=[JOINT_RADIUS * size]
    )
    stream.log("/robot/joints", joints, static=True)
    count, points = skeleton.shape[:2]
    columns = rr.Points3D.columns(positions=skeleton.reshape(-1, 3)).partition(np.full(count, points))
    stream.send_columns("/robot/joints", time_columns(arm.t_ns, "sample", arm.sample), columns)
    send_gone(stream, "/robot/joints", arm.gone, rr.Points3D.columns(positions=[]))


def _draw_links(stream: RecordingStream, arm: Arm, skeleton: Skeleton, size: float) -> None:
    """Draw a line through the points of the arm."""
    import rerun as rr

    links = rr.LineStrips3D.from_fields(colors=[rgb(NEUTRAL_COLOUR)], radii=[LINK_RADIUS * size])
    stream.log("/robot/links", links, static=True)
    for start in range(0, len(skeleton), STRIPS):
        rows = slice(start, start + STRIPS)
        times = time_columns(arm.t_ns[rows], "sample", arm.sample[rows])
        stream.send_columns("/robot/links", times, rr.LineStrips3D.columns(strips=skeleton[rows]))
    send_gone(stream, "/robot/links", arm.gone, rr.LineStrips3D.columns(strips=[]))


def _draw_way(stream: RecordingStream, way: Way, size: float) -> None:
    """Draw a path as lines, broad if it is what was asked for, and the point that moves on it."""
    import rerun as rr

    colour = rgb(way.colour)
    radius = (WANTED_RADIUS if way.wanted else DONE_RADIUS) * size
    lines = rr.LineStrips3D(
        [strip.astype(np.float32) for strip in way.strips], colors=[colour], radii=[radius]
    )
    stream.log(way.path, lines, static=True)
    style = rr.Points3D.from_fields(colors=[colour], radii=[POINT_RADIUS * size])
    stream.log(way.point, style, static=True)
    entities = [way.point]
    if way.label:
        entities.append(f"{way.point}/label")
        stream.log(entities[1], _label(way.label), static=True)
    track = way.track
    times = time_columns(track.t_ns, "sample", track.sample)
    for entity in entities:
        columns = rr.Points3D.columns(positions=track.position.astype(np.float32))
        stream.send_columns(entity, times, columns)
        send_gone(stream, entity, way.gone, rr.Points3D.columns(positions=[]))


def _draw_chosen(stream: RecordingStream, chosen: ArmName) -> None:
    """Write the name of the branch chosen at the arm."""
    import rerun as rr

    style = rr.Points3D.from_fields(colors=[rgb(LABEL_COLOUR)], radii=[0.0], show_labels=True)
    stream.log(CHOSEN, style, static=True)
    columns = rr.Points3D.columns(positions=chosen.position.astype(np.float32), labels=chosen.texts)
    stream.send_columns(CHOSEN, time_columns(chosen.t_ns, "sample", chosen.sample), columns)
    send_gone(stream, CHOSEN, chosen.gone, rr.Points3D.columns(positions=[], labels=[]))


def _label(text: str) -> Points3D:
    """Return the label of a point that stands elsewhere: in the point's colour it could hardly be read."""
    import rerun as rr

    return rr.Points3D.from_fields(colors=[rgb(LABEL_COLOUR)], radii=[0.0], labels=[text], show_labels=True)


def _draw_mark(stream: RecordingStream, mark: Mark, size: float) -> None:
    """Draw a place that is there at all times, with its label."""
    import rerun as rr

    point = rr.Points3D([mark.position], colors=[rgb(DEVIATION_COLOUR)], radii=[MARK_RADIUS * size])
    stream.log("/point/worst", point, static=True)
    stream.log("/point/worst/label", rr.Points3D.from_fields(positions=[mark.position]), static=True)
    stream.log("/point/worst/label", _label(mark.text), static=True)
