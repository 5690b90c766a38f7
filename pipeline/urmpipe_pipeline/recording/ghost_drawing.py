"""Send the further branches of solved joint values as translucent arms, and the targets.

Rerun draws lines and points always opaque: so the bones of a ghost are capsules, which can be looked through.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline.palette import AXIS_COLOURS, DEVIATION_COLOUR, REFERENCE_COLOUR, rgb
from urmpipe_pipeline.recording.columns import time_columns
from urmpipe_pipeline.recording.ghost_arms import GhostArm
from urmpipe_pipeline.recording.goal_marks import GoalMarks
from urmpipe_pipeline.recording.views.label_places import name_places
from urmpipe_pipeline.recording.ways import Gone

if TYPE_CHECKING:
    from rerun import ComponentColumnList, LineStrips3D, Points3D, RecordingStream

LINK_RADIUS, AXIS_RADIUS = 0.012, 0.005
FRAME_LENGTH, FRAME_RADIUS, WAY_RADIUS, GOAL_RADIUS, MISSED_RADIUS = 0.09, 0.004, 0.0065, 0.012, 0.02
"""Sizes in the 3D view, as shares of the radius of everything in it."""

THIN = 0.5
"""Thickness of every second ghost beside the others."""

OPACITY = 90
"""Of the bones of a ghost, of 255: seven of them, one in front of the other, let the arm itself through."""

LABELLED = 8
"""Reasons that are written beside the targets missed; of more each is told where its point is selected."""


def draw_ghost(stream: RecordingStream, ghost: GhostArm, size: float) -> None:
    """Send a branch: its bones and its name, at the times at which it is there."""
    import rerun as rr

    colour, bones = rgb(ghost.colour), ghost.start.shape[1]
    radii = np.where(np.arange(bones) < ghost.links, LINK_RADIUS, AXIS_RADIUS) * size
    radii *= THIN if ghost.thin else 1.0
    look = rr.Capsules3D.from_fields(colors=[(*colour, OPACITY)], fill_mode=rr.components.FillMode.Solid)
    stream.log(ghost.entity, look, static=True)
    lengths, quaternions = capsules(ghost.end - ghost.start)
    columns = rr.Capsules3D.columns(
        lengths=lengths.reshape(-1),
        radii=np.tile(radii, len(ghost.t_ns)),  # where a row has a radius, it gets a length by default
        translations=ghost.start.astype(np.float32).reshape(-1, 3),
        quaternions=quaternions.reshape(-1, 4),
    )
    _send(stream, ghost.entity, ghost, columns, bones)
    nothing = rr.Capsules3D.columns(lengths=[], radii=[], translations=[], quaternions=[])
    send_gone(stream, ghost.entity, ghost.gone, nothing)
    named = rr.Points3D.from_fields(colors=[colour], radii=[0.0], labels=[ghost.name], show_labels=True)
    stream.log(ghost.label, named, static=True)
    places = name_places(ghost.start, ghost.end)[np.arange(len(ghost.named)), ghost.named].astype(np.float32)
    _send(stream, ghost.label, ghost, rr.Points3D.columns(positions=places), 1)
    send_gone(stream, ghost.label, ghost.gone, rr.Points3D.columns(positions=[]))


def _send(
    stream: RecordingStream, entity: str, ghost: GhostArm, columns: ComponentColumnList, each: int
) -> None:
    """Send so many values a pose."""
    rows = columns.partition(np.full(len(ghost.t_ns), each))
    stream.send_columns(entity, time_columns(ghost.t_ns, "sample", ghost.sample), rows)


def send_gone(stream: RecordingStream, entity: str, gone: Gone, columns: ComponentColumnList) -> None:
    """Send rows without any value: from their times on the viewer shows nothing of what stood there."""
    if len(gone.t_ns):
        rows = columns.partition(np.zeros(len(gone.t_ns), dtype=np.int64))
        stream.send_columns(entity, time_columns(gone.t_ns, "sample", gone.sample), rows)


def capsules(bones: FloatArray) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return how long bones are and how they are turned: a capsule without a turn lies along z.

    The least turn that takes z to the unit vector d is the quaternion (z x d, 1 + z.d), normalised; to -z it
    is half a turn about x.

    Args:
        bones: From start to end in [m], shape (..., 3).

    Returns:
        Lengths in [m], shape (...), and quaternions x, y, z, w [-], shape (..., 4).
    """
    length = np.linalg.norm(bones, axis=-1)
    x, y, z = np.moveaxis(bones / np.where(length > 0.0, length, 1.0)[..., None], -1, 0)
    z = np.where(length > 0.0, z, 1.0)
    quat = np.stack((-y, x, np.zeros_like(z), 1.0 + z), axis=-1)
    norm = np.linalg.norm(quat, axis=-1, keepdims=True)
    down = norm < 1e-9
    quat = np.where(down, (1.0, 0.0, 0.0, 0.0), quat / np.where(down, 1.0, norm))
    return length.astype(np.float32), quat.astype(np.float32)


def draw_goals(stream: RecordingStream, goals: GoalMarks, size: float) -> None:
    """Send the targets: they stand at all times."""
    import rerun as rr

    grey = rgb(REFERENCE_COLOUR)
    if goals.strips:
        strips = [strip.astype(np.float32) for strip in goals.strips]
        way = rr.LineStrips3D(strips, colors=[grey], radii=[WAY_RADIUS * size])
        stream.log(f"{goals.root}/path", way, static=True)
    if len(goals.points):
        points = rr.Points3D(goals.points, colors=[grey], radii=[GOAL_RADIUS * size])
        stream.log(f"{goals.root}/points", points, static=True)
    if len(goals.origin):
        stream.log(f"{goals.root}/frames", _frames(goals, size), static=True)
    if len(goals.missed):
        stream.log(f"{goals.root}/missed", _missed(goals, size), static=True)


def _missed(goals: GoalMarks, size: float) -> Points3D:
    """Return the targets that the arm has no pose for: few with their reasons, many as a thin line."""
    import rerun as rr

    few = len(goals.missed) <= LABELLED
    radius = (MISSED_RADIUS if few else WAY_RADIUS) * size
    colours = [rgb(DEVIATION_COLOUR)]
    return rr.Points3D(goals.missed, colors=colours, radii=[radius], labels=goals.reasons, show_labels=few)


def _frames(goals: GoalMarks, size: float) -> LineStrips3D:
    """Return the axes of the targets, in the colours of the coordinates."""
    import rerun as rr

    ends = goals.origin[:, None] + FRAME_LENGTH * size * goals.axes.transpose(0, 2, 1)
    starts = np.broadcast_to(goals.origin[:, None], ends.shape)
    strips = np.stack((starts, ends), axis=2).reshape(-1, 2, 3).astype(np.float32)
    colours = [rgb(AXIS_COLOURS[axis]) for axis in "xyz"] * len(goals.origin)
    return rr.LineStrips3D(strips, colors=colours, radii=[FRAME_RADIUS * size])
