"""The links of an arm as they look: shapes that stand still below frames that move."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from urmpipe_models.arm.chain import Box, Capsule, Chain, Colour, Cylinder, Mesh, Visual
from urmpipe_models.arm.solids import build_placeholder_solids
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import frames_over_log
from urmpipe_models.math3d import to_quaternions
from urmpipe_pipeline.presentation.meshes import MEDIA_TYPES, is_drawable
from urmpipe_pipeline.presentation.palette import NEUTRAL_COLOUR, rgb
from urmpipe_pipeline.recording.layout import keys, shown_path

if TYPE_CHECKING:
    from rerun import AsComponents, RecordingStream, TimeColumn

SEEN_THROUGH = 0.4
"""Opacity of the links where something inside them is drawn."""

WHITE: Colour = (1.0, 1.0, 1.0, 1.0)
"""Leaves a mesh the colours of its file."""

UNSEEN = 1e-9
"""Scale of a shape that is hidden; zero would be none that the viewer can invert."""


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """What moves as one: a frame of the arm and the shapes on it.

    Attributes:
        joint: Name of the joint whose frame it is; None for the base.
        position: Of the frame in the world in [m], shape (m, 3).
        quat_xyzw: Its rotation as unit quaternions [-], shape (m, 4).
        visuals: The shapes that can be drawn, at least one.
    """

    joint: str | None
    position: FloatArray
    quat_xyzw: FloatArray
    visuals: tuple[Visual, ...]


def own_shapes(robot: Chain) -> list[Visual]:
    """Return the shapes of an arm's description that can be drawn."""
    return [visual for visual in robot.visuals if is_drawable(visual)]


def bodies_over_log(
    robot: Chain, q: FloatArray, colours: Mapping[str, Colour] | None = None
) -> tuple[Body, ...]:
    """Return the links of an arm as its description shows them, and solids for moving links that it does not.

    An arm that shows nothing at all is all solids. Frames fixed to a link count as the link.

    Args:
        robot: The arm.
        q: Joint values in [rad] or [m], shape (m, coordinates).
        colours: Of its joints, by name; the solids of joints have them.
    """
    shown, solids = own_shapes(robot), build_placeholder_solids(robot, colours)
    if shown:
        moving = np.cumsum([joint.kind != "fixed" for joint in robot.joints]).tolist()
        link = dict(zip((None, *(joint.name for joint in robot.joints)), (0, *moving), strict=True))
        done = {0, *(link[visual.joint] for visual in shown)}
        solids = tuple(visual for visual in solids if link[visual.joint] not in done)
    position, rotation = frames_over_log(robot, q)
    carriers = [None, *(joint.name for joint in robot.joints)]
    on = {carrier: tuple(one for one in (*shown, *solids) if one.joint == carrier) for carrier in carriers}
    return tuple(
        Body(carrier, position[:, k], to_quaternions(rotation[:, k].reshape(-1, 9), "matrix"), visuals)
        for k, (carrier, visuals) in enumerate(on.items())
        if visuals
    )


def draw_body(
    stream: RecordingStream, body: Body, times: list[TimeColumn], *, seen_through: bool = False
) -> None:
    """Send a link: its frame at the times given, its shapes once, seen through where something is inside.

    Translation and quaternion both stand in every row: Rerun takes a row as the whole transform.
    """
    import rerun as rr

    place = carrier_path(body.joint)
    position, rotation = body.position.astype(np.float32), body.quat_xyzw.astype(np.float32)
    if body.joint is None:  # the base does not move
        still = rr.Transform3D(translation=position[0], quaternion=rotation[0])
        stream.log(shown_path(*place), still, static=True)
    else:
        columns = rr.Transform3D.columns(translation=position, quaternion=rotation)
        stream.send_columns(shown_path(*place), times, columns)
    for number, visual in enumerate(body.visuals, start=1):
        if (shape := _shape(_seen_through(visual) if seen_through else visual)) is not None:
            entity = shown_path(*place, f"visual {number}")
            stream.log(entity, _placed(visual), static=True)
            stream.log(entity, shape, static=True)


def opaque(colour: str) -> Colour:
    """Return #rrggbb as a colour that is not seen through."""
    red, green, blue = (share / 255.0 for share in rgb(colour))
    return red, green, blue, 1.0


def _seen_through(visual: Visual) -> Visual:
    """Return a shape that is translucent, so that the masses inside it show."""
    plain = WHITE if isinstance(visual.shape, Mesh) else opaque(NEUTRAL_COLOUR)
    red, green, blue, opacity = visual.colour or plain
    return replace(visual, colour=(red, green, blue, SEEN_THROUGH * opacity))


def hide_body(stream: RecordingStream, body: Body, times: list[TimeColumn], count: int) -> None:
    """Hide the shapes of a link that moves from some times on, until it has a pose again; none of the base.

    They stand there once for all times, so they are made too small to be seen.
    """
    import rerun as rr

    if body.joint is not None:
        columns = rr.Transform3D.columns(translation=np.zeros((count, 3)), scale=np.full((count, 3), UNSEEN))
        stream.send_columns(shown_path(*carrier_path(body.joint)), times, columns)


def carrier_path(joint: str | None) -> tuple[str, ...]:
    """Return where the frame of a joint stands, or that of the base."""
    return ("scene", "robot", "base") if joint is None else ("scene", "robot", "joint", *keys([joint]))


def _placed(visual: Visual) -> AsComponents:
    """Return where a shape stands in the frame that carries it, and the scale of a mesh."""
    import rerun as rr

    rotation: FloatArray = np.array(visual.origin.rotation, dtype=float).reshape(1, 9)
    return rr.Transform3D(
        translation=visual.origin.translation,
        quaternion=to_quaternions(rotation, "matrix")[0],
        scale=visual.shape.scale if isinstance(visual.shape, Mesh) else None,
    )


def _shape(visual: Visual) -> AsComponents | None:
    """Return what is drawn; nothing for a mesh whose file went away meanwhile."""
    import rerun as rr

    shape = visual.shape
    if isinstance(shape, Mesh):
        return _mesh(Path(shape.file), visual.colour)
    look: dict[str, Any] = {"colors": [_rgba(visual.colour)], "fill_mode": rr.components.FillMode.Solid}
    if isinstance(shape, Box):
        return rr.Boxes3D(sizes=[shape.size], **look)
    if isinstance(shape, Cylinder):
        return rr.Cylinders3D(lengths=[shape.length], radii=[shape.radius], **look)
    if isinstance(shape, Capsule):  # Rerun's begins in the middle of its lower ball
        begin = (0.0, 0.0, -shape.length / 2)
        return rr.Capsules3D(lengths=[shape.length], radii=[shape.radius], translations=[begin], **look)
    return rr.Ellipsoids3D(radii=[shape.radius], **look)


def _mesh(path: Path, colour: Colour | None) -> AsComponents | None:
    """Return a mesh with its file's contents, so that the recording shows it wherever it is opened."""
    import rerun as rr

    try:
        contents = path.read_bytes()
    except OSError:
        return None
    # Collada and glTF bring colours along; a triangle of the others has none.
    coloured = path.suffix.lower() not in (".stl", ".obj")
    factor = None if coloured and colour is None else _rgba(colour)
    return rr.Asset3D(contents=contents, media_type=MEDIA_TYPES[path.suffix.lower()], albedo_factor=factor)


def _rgba(colour: Colour | None) -> tuple[int, int, int, int]:
    """Return a colour as four numbers 0..255."""
    if colour is None:
        return (*rgb(NEUTRAL_COLOUR), 255)
    red, green, blue, opacity = (round(255 * share) for share in colour)
    return red, green, blue, opacity
