"""One arc between two lines: from its corner, or from the point where it begins."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.planning.rows import PROPER

STRAIGHT = 1e-9
"""Three points whose lines differ by less, in [rad], span no plane: coordinates have no more digits."""


@dataclass(frozen=True, slots=True, eq=False)
class Arc:
    """An arc from a point, along a direction, round a centre.

    Attributes:
        start: Its first point in [m], shape (3,).
        tangent: Unit vector of the motion there [-], shape (3,).
        normal: Unit vector from there to the centre [-], shape (3,).
        radius: In [m].
        angle: How far it turns in [rad], 0 to 2 pi.
    """

    start: FloatArray
    tangent: FloatArray
    normal: FloatArray
    radius: float
    angle: float

    @property
    def end(self) -> FloatArray:
        """Its last point in [m], shape (3,)."""
        along, across = math.sin(self.angle), 1.0 - math.cos(self.angle)
        return self.start + self.radius * (along * self.tangent + across * self.normal)

    @property
    def end_tangent(self) -> FloatArray:
        """Unit vector of the motion at its end [-], shape (3,)."""
        return math.cos(self.angle) * self.tangent + math.sin(self.angle) * self.normal

    @property
    def leg(self) -> float:
        """From its first point to the corner of its tangents in [m], r tan(angle / 2).

        Negative where the arc begins behind the corner, as one that turns by more than pi does.
        """
        return self.radius * math.tan(0.5 * self.angle)


def unit(vector: FloatArray) -> FloatArray:
    """Return the direction of a vector, shape (3,), with length 1 [-]."""
    return vector / np.linalg.norm(vector)


def towards(tangent: FloatArray, onward: FloatArray) -> FloatArray | None:
    """Return the unit vector across a direction to the side of another [-], shape (3,); None if parallel.

    Args:
        tangent: Unit vector [-], shape (3,).
        onward: Unit vector [-], shape (3,).
    """
    across = onward - (onward @ tangent) * tangent
    return None if np.linalg.norm(across) <= STRAIGHT else unit(across)


def arc_at_corner(
    corner: FloatArray, tangent: FloatArray, onward: FloatArray, radius: float, variant: int
) -> Arc | None:
    """Return the arc that rounds the corner of two lines; None where they are parallel.

    With the angle d between the lines the proper variant turns by d, and begins r tan(d / 2) before the
    corner; the other one turns by 2 pi - d the other way, and begins as far behind it.

    Args:
        corner: In [m], shape (3,).
        tangent: Direction to the corner [-], shape (3,).
        onward: Direction away from it [-], shape (3,).
        radius: In [m].
        variant: 2 to turn towards `onward`, 1 to turn away from it.
    """
    side = towards(tangent, onward)
    if side is None:
        return None
    turn = math.atan2(float(onward @ side), float(onward @ tangent))
    angle, normal = (turn, side) if variant == PROPER else (2.0 * math.pi - turn, -side)
    return Arc(corner - radius * math.tan(0.5 * angle) * tangent, tangent, normal, radius, angle)


def arc_from(
    start: FloatArray, tangent: FloatArray, onward: FloatArray, radius: float, variant: int, within: float
) -> tuple[Arc, float] | None:
    """Return the arc that leaves a line and leads towards a point, and how far it is from its end to it.

    In the plane of both, with x along the line, y to the side of the centre C = (0, r), and the point at
    (a, b): D = |(a, b - r)|, the way on is l = sqrt(D^2 - r^2), and the arc turns by
    atan2(b - r, a) + atan2(r, l). Of the two tangents from the point to the circle this is the one along
    which the motion goes on. Of a point on the circle l = 0, since sqrt(2 r (D - r)) makes a line of what is
    rounding.

    Args:
        start: Where the arc begins in [m], shape (3,).
        tangent: Direction of the motion there [-], shape (3,).
        onward: From there to the point in [m], shape (3,).
        radius: In [m].
        variant: 2 for the centre on the side of the point, 1 for the other side.
        within: How far from its circle a point on it may be in [m]: rounding of coordinates.

    Returns:
        The arc and l in [m]; None where the point lies on the line, or within the circle.

    Source: [Iso9283]_ section 2, section 4 steps 3 to 6.
    """
    side = towards(tangent, unit(onward))
    if side is None:
        return None
    normal = side if variant == PROPER else -side
    a, across = float(onward @ tangent), float(onward @ normal)
    square, rounding = float(onward @ onward) - 2.0 * radius * across, 2.0 * radius * within
    if square < -rounding:
        return None
    way = math.sqrt(square) if square > rounding else 0.0
    angle = (math.atan2(across - radius, a) + math.atan2(radius, way)) % (2.0 * math.pi)
    return Arc(start, tangent, normal, radius, angle), way


def largest_radius(tangent: FloatArray, onward: FloatArray) -> float:
    """Return the largest radius in [m] with which `arc_from` reaches its point, (a^2 + b^2) / (2 b).

    Args:
        tangent: Direction of the motion [-], shape (3,).
        onward: From the arc's first point to the next row in [m], shape (3,).
    """
    across = float(np.linalg.norm(onward - (onward @ tangent) * tangent))
    return float(onward @ onward) / (2.0 * across)
