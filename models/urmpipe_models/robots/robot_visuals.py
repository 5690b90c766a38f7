"""What an arm looks like, as robot files and recordings tell it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

from urmpipe_models.chains.visual import Box, Capsule, Colour, Cylinder, Mesh, Shape, Sphere, Visual
from urmpipe_models.files.tables import Table
from urmpipe_models.robots.robot_frames import Units, frame_to_dict, read_frame

SHAPES = ("box", "cylinder", "capsule", "sphere", "mesh")
"""The keys of which a visual has one."""


def read_visual(table: Table, units: Units) -> Visual:
    """Return the visual of a table; faults are noted in the table."""
    visual = Visual(
        table.text("joint", "") if table.has("joint") else None,
        _shape(table, units),
        replace(read_frame(table.table("origin"), units), made_of=None),
        cast("Colour", table.numbers("colour", 4)) if table.has("colour") else None,
    )
    table.close()
    return visual


def visual_to_dict(visual: Visual) -> dict[str, Any]:
    """Return a visual as a JSON object: `read_visual`'s exact inverse."""
    given = {
        "joint": visual.joint,
        "origin": frame_to_dict(visual.origin),
        "colour": None if visual.colour is None else [float(share) for share in visual.colour],
        **_shape_to_dict(visual.shape),
    }
    return {key: value for key, value in given.items() if value is not None}


def _shape(table: Table, units: Units) -> Shape:
    """Return the one shape of the table, in [m]."""
    keys = [key for key in SHAPES if table.has(key)]
    if len(keys) != 1:
        table.fault("box", f"found {' and '.join(keys) or 'no shape'}, allowed: one of {', '.join(SHAPES)}")
        return Sphere(0.0)
    (key,) = keys
    if key == "mesh":
        scale = table.numbers("scale", 3, (1.0, 1.0, 1.0))
        return Mesh(table.text("mesh"), cast("tuple[float, float, float]", scale))
    if key == "sphere":
        return Sphere(units.length(table.number("sphere")))
    sizes = tuple(units.length(size) for size in table.numbers(key, 3 if key == "box" else 2))
    if key == "box":
        return Box(cast("tuple[float, float, float]", sizes))
    return Cylinder(*sizes) if key == "cylinder" else Capsule(*sizes)


def _shape_to_dict(shape: Shape) -> dict[str, Any]:
    """Return a shape as keys of a JSON object."""
    if isinstance(shape, Mesh):
        return {"mesh": shape.file, "scale": [float(factor) for factor in shape.scale]}
    if isinstance(shape, Box):
        return {"box": [float(size) for size in shape.size]}
    if isinstance(shape, Sphere):
        return {"sphere": float(shape.radius)}
    return {type(shape).__name__.lower(): [float(shape.radius), float(shape.length)]}
