"""Things that do not move in the 3D view: meshes with lines and words, an entity each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline.palette import rgb
from urmpipe_pipeline.presentation.scene import Solid
from urmpipe_pipeline.recording.sending import keys, shown_path
from urmpipe_pipeline.text import encodable

if TYPE_CHECKING:
    from rerun import RecordingStream

LABEL_COLOUR = "#ffffff"
"""Labels: they stand on surfaces of any colour."""


def draw_solids(stream: RecordingStream, solids: Sequence[Solid], thread: float) -> list[str]:
    """Draw solids, their lines with a radius in [m], and return the entities of those that are hidden."""
    entities = []
    for one, key in zip(solids, keys([f"{one.group}/{one.name}" for one in solids]), strict=True):
        group, _, name = key.partition("/")
        entities.append(shown_path("scene", group, name))
        _draw(stream, one, entities[-1], thread)
    return [entity for one, entity in zip(solids, entities, strict=True) if one.hidden]


def _draw(stream: RecordingStream, solid: Solid, entity: str, thread: float) -> None:
    """Draw a solid: its surface, its lines and its label are entities below its own."""
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
    if solid.label:
        words = rr.Points3D(
            [solid.at],
            colors=[rgb(LABEL_COLOUR)],
            radii=[0.0],
            labels=[encodable(solid.label)],
            show_labels=True,
        )
        stream.log(f"{entity}/label", words, static=True)


def normals(triangles: FloatArray) -> FloatArray:
    """Return the unit normals of triangles in [m], shape (n, 3, 3), [-], shape (n, 3); of none upwards."""
    found = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(found, axis=1, keepdims=True)
    return np.where(size > 0.0, found / np.where(size > 0.0, size, 1.0), (0.0, 0.0, 1.0))
