"""The rows of a planned path: points, radii, and where the tool shall be turned."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray

PROPER = 2
"""The variant of an arc that turns towards the next row; 1 turns away from it, and round."""


@dataclass(frozen=True, slots=True, eq=False)
class PathRows:
    """The rows that a path is planned from.

    Attributes:
        position: Points in [m], shape (n, 3).
        radius: Of the arc at each point in [m], shape (n,); 0 where the path stops.
        corner: What a point with a radius is: True for the corner that the arc rounds, False for the arc's
            first point, where the line before it touches it (as in the paper).
        variant: Of each arc [-], shape (n,): 2 turns towards the next row, 1 away from it; one for all.
        rotation: How the tool is turned at each row, as matrices [-], shape (n, 3, 3); None if that is left
            open.

    Source: [Iso9283]_ section 2.
    """

    position: FloatArray
    radius: FloatArray
    corner: bool = False
    variant: IntArray = field(default_factory=lambda: np.array(PROPER))
    rotation: FloatArray | None = None

    def __post_init__(self) -> None:
        if getattr(self.variant, "ndim", 1) == 0:
            object.__setattr__(self, "variant", np.full(len(self), self.variant))

    def __len__(self) -> int:
        return len(self.position)


def path_rows(
    position: FloatArray,
    radius: FloatArray | float = 0.0,
    *,
    corner: bool = False,
    variant: IntArray | int = PROPER,
    rotation: FloatArray | None = None,
) -> PathRows:
    """Return rows from arrays; one radius, variant or rotation is that of all rows.

    Args:
        position: In [m], shape (n, 3).
        radius: In [m], shape (n,) or one for all but the first and the last row.
        corner: Whether a row with a radius is the corner (else the first tangent point).
        variant: 1 or 2 [-], shape (n,) or one for all.
        rotation: Matrices [-], shape (n, 3, 3), or (3, 3) for all rows.
    """
    count = len(position)
    radii = np.asarray(radius, dtype=float)
    if radii.ndim == 0:
        radii = np.full(count, float(radii))
        radii[[0, -1]] = 0.0
    turned = None if rotation is None else np.array(np.broadcast_to(rotation, (count, 3, 3)))
    return PathRows(
        np.asarray(position, dtype=float), radii, corner, np.asarray(variant, dtype=np.int64), turned
    )
