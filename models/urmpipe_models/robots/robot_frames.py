"""Frames of robot files and recordings, and the units of robot files."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, cast

from urmpipe_models.elementwise import cross, dot
from urmpipe_models.files.tables import Table
from urmpipe_models.transform import Transform, from_rpy

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
    """Return the frame that a table tells by `translation` and `rpy` or `rotation`; it notes the faults."""
    x, y, z = (units.length(value) for value in table.numbers("translation", 3, (0.0, 0.0, 0.0)))
    rx, ry, rz = (units.angle(value) for value in table.numbers("rpy", 3, (0.0, 0.0, 0.0)))
    rotation = from_rpy(rx, ry, rz).rotation
    if table.has("rotation"):
        rotation = cast("Any", table.rows("rotation"))
        if table.has("rpy"):
            table.fault("rotation", "found beside rpy; allowed: one of the two")
        elif not _is_rotation(Transform(rotation)):
            table.fault("rotation", "is no rotation matrix; allowed: orthonormal rows, right-handed")
    table.close()
    return Transform(rotation, (x, y, z))


def _is_rotation(frame: Transform) -> bool:
    """Tell whether the rows of a frame are a rotation."""
    x, y, z = frame.rotation
    product = (frame @ Transform(frame.columns)).rotation
    orthonormal = all(abs(product[i][j] - float(i == j)) <= ORTHONORMAL for i in range(3) for j in range(3))
    return orthonormal and bool(dot(x, cross(y, z)) > 0.0)


def frame_to_dict(frame: Transform) -> dict[str, Any]:
    """Return a frame as a JSON object, floats bit by bit."""
    return {
        "translation": [float(value) for value in frame.translation],
        "rotation": [[float(value) for value in row] for row in frame.rotation],
    }
