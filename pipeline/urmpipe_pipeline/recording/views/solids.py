"""Solids and moving lines in the 3D view: meshes, lines and labels, an entity each.

A solid that moves is sent once; its frame moves by one transform per row, at 50 Hz or less. Lines whose
points move are sent at each of these rows. The label of a moving solid has an entity of
its own, so that it does not turn with the solid.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.presentation.palette import rgb
from urmpipe_pipeline.presentation.scene import Motion, MovingLines, PlaneView, Scene, Solid
from urmpipe_pipeline.recording.layout import keys, shown_path, times_at
from urmpipe_pipeline.recording.views.camera import eye_axes
from urmpipe_pipeline.recording.views.tracks import drawn_rows, whole_rows
from urmpipe_pipeline.text import drop_surrogates

if TYPE_CHECKING:
    from rerun import Points3D, RecordingStream

Labelled: TypeAlias = Solid | MovingLines

LABEL_COLOUR = "#ffffff"
"""Labels: readable on surfaces of any colour."""

LETTER, LINE = 0.024, 0.08
"""Width of a letter and height of a label, as shares of the radius of the scene."""


def draw_solids(stream: RecordingStream, scene: Scene, size: float, thread: float) -> list[str]:
    """Draw the solids and the moving lines of a scene, and return the entities of those that are hidden.

    Args:
        stream: The recording.
        scene: The scene.
        size: Radius of the scene in [m].
        thread: Radius of thin lines in [m].
    """
    every: tuple[Labelled, ...] = (*scene.solids, *scene.moving_lines)
    hidden = []
    for item, key, lift in zip(every, _keys(every), _label_lifts(every, size, scene.plane), strict=True):
        entity = shown_path("scene", *key)
        if isinstance(item, MovingLines):
            _draw_moving_lines(stream, item, entity, thread)
            places = item.lines[0].mean(axis=1) + lift
            _draw_moving_label(stream, f"{entity}/label", item.label, places, item.t_ns)
            continue
        _draw(stream, item, entity, thread)
        hidden += [entity] if item.hidden else []
        if item.motion is not None:
            _move(stream, entity, item.motion)
            places = item.motion.points(np.array([item.at]))[:, 0] + lift
            words = shown_path("scene", "labels", *key)
            _draw_moving_label(stream, words, item.label, places, item.motion.t_ns)
        elif item.label:
            stream.log(f"{entity}/label", _label(item.label, [np.add(item.at, lift)]), static=True)
    return hidden


def _label_lifts(labelled: Sequence[Labelled], size: float, plane: PlaneView | None) -> FloatArray:
    """Return how far labels are moved up or down in the view at first, so that they do not cover each other.

    Args:
        labelled: Solids and lines; hidden ones are skipped.
        size: Radius of the scene in [m].
        plane: From where it is seen.

    Returns:
        In [m], shape (n, 3).
    """
    axes, lifts = eye_axes(plane), np.zeros(len(labelled))
    line = LINE * size
    taken: list[tuple[FloatArray, float]] = []  # middle to the right and up, half of the width
    for k, item in enumerate(labelled):
        if not item.label or (isinstance(item, Solid) and item.hidden):
            continue
        place, half = _first_place(item) @ axes[:, :2], 0.5 * LETTER * size * (len(item.label) + 1)
        near = [at for at, other in taken if abs(place[0] - at[0]) < half + other]
        lifts[k] = next(
            lift
            for lift in line
            * np.array([0, *(sign * n for n in range(1, len(taken) + 2) for sign in (1, -1))])
            if all(abs(place[1] + lift - at[1]) > 0.999 * line for at in near)
        )
        taken.append((place + np.array([0.0, lifts[k]]), half))
    return np.asarray(np.outer(lifts, axes[:, 1]))


def _first_place(item: Labelled) -> FloatArray:
    """Return where the label of something is first in [m], shape (3,)."""
    if isinstance(item, MovingLines):
        return np.asarray(item.lines[0][0].mean(axis=0))
    return np.array(item.at) if item.motion is None else item.motion.points(np.array([item.at]))[0, 0]


def _keys(labelled: Sequence[Labelled]) -> list[tuple[str, str]]:
    """Return the group and the name of each as parts of an entity path, all different."""
    parted = (key.partition("/") for key in keys([f"{item.group}/{item.name}" for item in labelled]))
    return [(group, name) for group, _, name in parted]


def _rows(values: FloatArray, t_ns: IntArray) -> IntArray:
    """Return the rows that are drawn of values in any unit, shape (n, k), at times in [ns], shape (n,)."""
    return drawn_rows(t_ns, whole_rows(values))


def _draw(stream: RecordingStream, solid: Solid, entity: str, thread: float) -> None:
    """Draw a solid: its surface and its lines are entities below its own."""
    import rerun as rr

    colour = rgb(solid.colour)
    if len(solid.triangles):
        mesh = rr.Mesh3D(
            vertex_positions=solid.triangles.reshape(-1, 3).astype(np.float32),
            vertex_normals=np.repeat(normals(solid.triangles), 3, axis=0).astype(np.float32),
            albedo_factor=(*colour, round(255 * solid.opacity)),
        )
        stream.log(f"{entity}/surface", mesh, static=True)
    if solid.lines:
        strips = [line.astype(np.float32) for line in solid.lines]
        stream.log(f"{entity}/lines", rr.LineStrips3D(strips, colors=[colour], radii=[thread]), static=True)


def _draw_moving_lines(stream: RecordingStream, moving: MovingLines, entity: str, thread: float) -> None:
    """Send lines at each of the rows that are drawn."""
    import rerun as rr

    style = rr.LineStrips3D.from_fields(colors=[rgb(moving.colour)], radii=[moving.radius or thread])
    stream.log(entity, style, static=True)
    rows = _rows(np.concatenate(moving.lines, axis=1).reshape(len(moving.t_ns), -1), moving.t_ns)
    strips = [line[row].astype(np.float32) for row in rows for line in moving.lines]
    columns = rr.LineStrips3D.columns(strips=strips).partition(np.full(len(rows), len(moving.lines)))
    stream.send_columns(entity, times_at(moving.t_ns, rows), columns)


def _move(stream: RecordingStream, entity: str, motion: Motion) -> None:
    """Send the poses of a frame. Rerun takes a row as the whole transform, so each has both parts."""
    import rerun as rr

    rows = _rows(np.column_stack((motion.position, motion.quat_xyzw)), motion.t_ns)
    columns = rr.Transform3D.columns(
        translation=motion.position[rows].astype(np.float32),
        quaternion=motion.quat_xyzw[rows].astype(np.float32),
    )
    stream.send_columns(entity, times_at(motion.t_ns, rows), columns)


def _label(words: str, places: Sequence[FloatArray] | None = None) -> Points3D:
    """Return a label at places in [m], shape (3,) each; None if these are sent by themselves."""
    import rerun as rr

    return rr.Points3D.from_fields(
        positions=places,
        colors=[rgb(LABEL_COLOUR)],
        radii=[0.0],
        labels=[drop_surrogates(words)],
        show_labels=True,
    )


def _draw_moving_label(
    stream: RecordingStream, entity: str, words: str, places: FloatArray, t_ns: IntArray
) -> None:
    """Draw a label, if there is any, at places in [m], shape (n, 3), at times in [ns], shape (n,)."""
    import rerun as rr

    if not words:
        return
    stream.log(entity, _label(words), static=True)
    rows = _rows(places, t_ns)
    columns = rr.Points3D.columns(positions=places[rows].astype(np.float32))
    stream.send_columns(entity, times_at(t_ns, rows), columns)


def normals(triangles: FloatArray) -> FloatArray:
    """Return the unit normals of triangles in [m], shape (n, 3, 3), [-], shape (n, 3); of none upwards."""
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(cross, axis=1, keepdims=True)
    return np.where(size > 0.0, cross / np.where(size > 0.0, size, 1.0), (0.0, 0.0, 1.0))
