"""Frames of robot files and recordings, and the units of robot files."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any, Literal, cast

from urmpipe_models.elementwise import cross, dot
from urmpipe_models.files.tables import Table
from urmpipe_models.transform import Step, Transform, from_xyz_rpy, made_of

ORTHONORMAL = 1e-9
"""R R^T may differ from the identity by this: rounding, not a matrix that is no rotation."""


@dataclass(frozen=True, slots=True)
class Units:
    """The units of a robot file, made SI where the file is read and nowhere else."""

    millimetres: bool = False
    degrees: bool = False

    def length(self, value: float) -> float:
        """Return a length of the file in [m]; by decimals: 243.215 mm is the very double that 0.243215 is."""
        return float(Decimal(repr(value)).scaleb(-3)) if self.millimetres else value

    def angle(self, value: float) -> float:
        """Return an angle of the file in [rad]."""
        return math.radians(value) if self.degrees else value

    def of_joint(self, kind: str, value: float) -> float:
        """Return a joint's value in [m] if it slides, else in [rad]."""
        return self.length(value) if kind == "prismatic" else self.angle(value)


def read_frame(table: Table, units: Units) -> Transform:
    """Return the frame that a table tells by `translation` and `rpy` or `rotation`, or by `steps`.

    What is wrong is noted as a fault.
    """
    frame = _rigid(table, units)
    if table.has("steps"):
        made = made_of(*(_part(row, units) for row in table.tables("steps")))
        others = [key for key in ("translation", "rpy", "rotation") if table.has(key)]
        if others and not _same(frame, made):
            found = f"found beside {' and '.join(others)} of another frame"
            table.fault("steps", f"{found}; allowed: steps alone")
        frame = made
    table.close()
    return frame


def _rigid(table: Table, units: Units) -> Transform:
    """Return the frame of `translation` and `rpy` or `rotation`."""
    x, y, z = (units.length(value) for value in table.numbers("translation", 3, (0.0, 0.0, 0.0)))
    rx, ry, rz = (units.angle(value) for value in table.numbers("rpy", 3, (0.0, 0.0, 0.0)))
    if not table.has("rotation"):
        return from_xyz_rpy((x, y, z), (rx, ry, rz), "robot file")
    frame = Transform(cast("Any", table.rows("rotation")), (x, y, z))
    if table.has("rpy"):
        table.fault("rotation", "found beside rpy; allowed: one of the two")
    elif not _is_rotation(frame):
        table.fault("rotation", "is not a rotation matrix; allowed: orthonormal rows, right-handed")
    return frame


def _part(table: Table, units: Units) -> Transform | Step:
    """Read an elementary motion, or a constant frame between two."""
    part: Transform | Step
    if table.has("along") or table.has("about"):
        kind: Literal["along", "about"] = "along" if table.has("along") else "about"
        axis = cast("Any", table.choice(kind, ("x", "y", "z")))
        value = (units.length if kind == "along" else units.angle)(table.number("value", 0.0))
        part = Step(kind, axis, value, table.text("name", ""), table.text("source", ""))
    else:
        part = replace(_rigid(table, units), made_of=None)
    table.close()
    return part


def _same(frame: Transform, other: Transform) -> bool:
    """Tell whether two frames are the same but for rounding."""
    pairs = zip((*frame.rotation, frame.translation), (*other.rotation, other.translation), strict=True)
    return all(abs(a - b) <= ORTHONORMAL for rows in pairs for a, b in zip(*rows, strict=True))


def _is_rotation(frame: Transform) -> bool:
    """Tell whether the rows of a frame are a rotation."""
    x, y, z = frame.rotation
    product = (frame @ Transform(frame.columns)).rotation
    orthonormal = all(abs(product[i][j] - float(i == j)) <= ORTHONORMAL for i in range(3) for j in range(3))
    return orthonormal and bool(dot(x, cross(y, z)) > 0.0)


def frame_to_dict(frame: Transform) -> dict[str, Any]:
    """Return a frame as a JSON object, floats bit by bit, with the steps that it is made of."""
    told = {
        "translation": [float(value) for value in frame.translation],
        "rotation": [[float(value) for value in row] for row in frame.rotation],
    }
    return told if frame.made_of is None else {**told, "steps": [_part_to_dict(one) for one in frame.made_of]}


def _part_to_dict(part: Transform | Step) -> dict[str, Any]:
    """Return an elementary motion, or a constant frame, as a JSON object: `_part`'s exact inverse."""
    if isinstance(part, Transform):
        return frame_to_dict(part)
    return {"name": part.name, part.kind: part.axis, "value": float(part.value), "source": part.source}
