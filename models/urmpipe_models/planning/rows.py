"""The rows of a planned path: points, radii, and where the tool shall be turned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from urmpipe_models.arrays import FloatArray, IntArray

PROPER = 2
"""The variant of an arc that turns towards the next row; 1 turns away from it, and round."""

VARIANTS = (1, PROPER)


@dataclass(frozen=True, slots=True, eq=False, init=False)
class PathRows:
    """The rows that a path is planned from.

    What is no array of numbers becomes a NaN of shape (): `plan` refuses it, with all else that is wrong.

    Attributes:
        position: Points in [m], shape (n, 3).
        radius: Of the arc at each point in [m], shape (n,); 0 where the path stops.
        corner: What a point with a radius is: True for the corner that the arc rounds, False for the arc's
            first point, where the line before it touches it (as in the paper).
        variant: Of each arc [-], shape (n,): 2 turns towards the next row, 1 away from it.
        rotation: How the tool is turned at each row, as matrices [-], shape (n, 3, 3); None if that is left
            open.

    Source: [Iso9283]_ section 2.
    """

    position: FloatArray
    radius: FloatArray
    corner: bool
    variant: IntArray
    rotation: FloatArray | None

    def __init__(
        self,
        position: ArrayLike,
        radius: ArrayLike = 0.0,
        corner: bool = False,
        variant: ArrayLike = PROPER,
        rotation: ArrayLike | None = None,
    ) -> None:
        """Make rows of arrays; one radius, variant or rotation is that of all rows.

        Args:
            position: In [m], shape (n, 3).
            radius: In [m], shape (n,), or one number for all rows but the first and the last.
            corner: Whether a row with a radius is the corner; else it is the arc's first point.
            variant: 1 or 2 [-], shape (n,), or one number for all rows.
            rotation: Matrices [-], shape (n, 3, 3), or one of shape (3, 3) for all rows; None if open.
        """
        points, radii, variants = _array(position), _array(radius), _array(variant)
        count = len(points) if points.ndim else 0
        if radii.ndim == 0 and not np.isnan(radii):
            radii = np.full(count, radii)
            radii[:1] = radii[-1:] = 0.0
        if variants.ndim == 0 and not np.isnan(variants):
            variants = np.full(count, variants)
        turned = None if rotation is None else _array(rotation)
        if turned is not None and turned.shape == (3, 3):
            turned = np.tile(turned, (count, 1, 1))
        whole = np.isin(variants, VARIANTS).all()
        object.__setattr__(self, "position", points)
        object.__setattr__(self, "radius", radii)
        object.__setattr__(self, "corner", corner)
        object.__setattr__(self, "variant", variants.astype(np.int64) if whole else variants)
        object.__setattr__(self, "rotation", turned)

    def __len__(self) -> int:
        return len(self.position)


def _array(values: ArrayLike) -> FloatArray:
    """Return values as an array; a NaN of shape () if they are no array of numbers."""
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        return np.array(np.nan)
