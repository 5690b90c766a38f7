"""The first three joints of an arm, as two equations between the first and the third one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.kinematics.screws import Screws


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Where an outer joint (1 or 3) of the three moves the wrist: X = X0 + U u.

    Of a revolute joint u lies on a circle, (rho cos, rho sin), of a prismatic one on a parabola, (s, s^2).

    Attributes:
        axis: Its unit vector k [-], shape (3,).
        revolute: Its kind.
        directions: U [-], shape (3, 2); the second column of a prismatic joint is 0.
        coefficients: A of the two equations A1 u1 + b1 = A3 u3 + b3, in the unit of b over
            that of u, shape (2, 2).
    """

    axis: FloatArray
    revolute: bool
    directions: FloatArray
    coefficients: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A wrist centre w as joint 1 sees it, one column a target; lengths are in units of the arm's size.

    Attributes:
        start: X0, relative to o2, in that unit, shape (3, n).
        constant: b1, in that unit or its square, shape (2, n).
        radius: Distance from axis 1 in that unit; 0 if joint 1 is prismatic, shape (n,).
        zero: What q1 is at the angle or the way 0 of u1: q1 = zero - angle, or zero + s, in [rad] or
            that unit, shape (n,).
        height: Way along axis 1 from the point nearest to axis 2, in that unit, shape (n,).
    """

    start: FloatArray
    constant: FloatArray
    radius: FloatArray
    zero: FloatArray
    height: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class LoopEquations:
    """What joints 1 and 3 must fulfil so that some joint 2 closes the loop to the wrist centre w.

    exp(xi1 q1) exp(xi2 q2) exp(xi3 q3) p0 = w, taken apart at joint 2: x = exp(-xi1 q1) w must come out of
    y = exp(xi3 q3) p0 by joint 2 alone. A revolute joint 2 keeps k2 . (y - o2) and |y - o2|^2 (the
    invariants of Pieper), a prismatic one both coordinates across it. Either way these are two equations
    A1 u1 + b1(w) = A3 u3 + b3 in points u1, u3 of a circle or a parabola, with constant matrices.

    Lengths are in units of the arm's size.

    Attributes:
        axis: Of joint 2 [-], shape (3,).
        revolute: Kind of joint 2.
        across: Two unit vectors across joint 2, shape (2, 3).
        origin: o2, a point of axis 2, in that unit, shape (3,); the nearest one to axis 1 where these are not
            parallel.
        base: A point of axis 1, in that unit, shape (3,).
        first: Joint 1.
        third: Joint 3.
        start: Y0 of joint 3, relative to o2, in that unit, shape (3,).
        constant: b3, in that unit or its square, shape (2,).
        radius: Of the circle of the wrist about axis 3; 0 of a prismatic joint.
        shift: What is added to s of a prismatic joint 3 to make it q3.

    Source: [Pieper1968]_.
    """

    axis: FloatArray
    revolute: bool
    across: FloatArray
    origin: FloatArray
    base: FloatArray
    first: Track
    third: Track
    start: FloatArray
    constant: FloatArray
    radius: float
    shift: float

    def invariants(self, start: FloatArray, radius: FloatArray | float) -> FloatArray:
        """Return b, in units of the arm's size or in its square, shape (2, n).

        Args:
            start: X0, in units of the arm's size, shape (3, n).
            radius: Of the circle about it, in the same unit, shape (n,) or one for all.
        """
        if self.revolute:
            return np.stack((self.axis @ start, (start * start).sum(axis=0) + np.square(radius)))
        return np.asarray(self.across @ start)

    def seen(self, wrist: FloatArray) -> Seen:
        """Return wrist centres w, shape (3, n), in units of the arm's size, as joint 1 sees them."""
        away = wrist - self.base[:, None]
        height = self.first.axis @ away
        if self.first.revolute:
            x, y = self.first.directions.T @ away
            radius, zero = np.hypot(x, y), np.arctan2(y, x)
            start = (self.base - self.origin)[:, None] + self.first.axis[:, None] * height
        else:
            radius, zero = np.zeros_like(height), height
            start = away - self.first.axis[:, None] * height
        return Seen(start, self.invariants(start, radius), radius, zero, height)


def loop_equations(screws: Screws, wrist: FloatArray) -> LoopEquations:
    """Return the equations of the first three screws and the wrist centre at q = 0.

    Args:
        screws: Of the arm, lengths in units of its size.
        wrist: The wrist centre, shape (3,), in the same unit.
    """
    (k1, k2, k3), (o1, o2, o3) = screws.direction[:3], screws.point[:3]
    r1, r2, r3 = (bool(one) for one in screws.revolute[:3])
    origin = nearest_point(o2, k2, o1, k1) if r1 and r2 else _foot(wrist, o2, k2)
    across = np.stack(_across(k2, k1, k3))
    if r3:
        centre = _foot(wrist, o3, k3)
        radial = wrist - centre
        radius = float(np.linalg.norm(radial))
        outward = radial / (radius or 1.0)
        directions3 = np.stack((outward, np.cross(k3, outward)), axis=1)
        start, shift = centre - origin, 0.0
    else:
        shift = -float(k3 @ (wrist - origin))
        start, radius = wrist - origin + shift * k3, 0.0
        directions3 = np.stack((k3, np.zeros(3)), axis=1)
    directions1 = np.stack(perpendicular(k1) if r1 else (-k1, np.zeros(3)), axis=1)
    base = _foot(origin, o1, k1) if r1 else origin
    first = Track(k1, r1, directions1, _coefficients(directions1, base - origin, r1, k2, r2, across))
    third = Track(k3, r3, directions3, _coefficients(directions3, start, r3, k2, r2, across))
    bare = LoopEquations(k2, r2, across, origin, base, first, third, start, np.zeros(2), radius, shift)
    constant = bare.invariants(start[:, None], radius)[:, 0]
    return LoopEquations(k2, r2, across, origin, base, first, third, start, constant, radius, shift)


def perpendicular(axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors [-], shape (3,) each, of the right-handed frame whose third one is `axis`."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)


def _across(axis: FloatArray, first: FloatArray, third: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors across axis 2 that turn with the arm: seen from axis 1 or else axis 3."""
    for other in (first, third):
        normal = np.cross(other, axis)
        length = float(np.linalg.norm(normal))
        if length > 1e-6:
            return normal / length, np.cross(axis, normal / length)
    return perpendicular(axis)


def _coefficients(
    directions: FloatArray,
    start: FloatArray,
    turns: bool,
    axis: FloatArray,
    revolute: bool,
    across: FloatArray,
) -> FloatArray:
    """Return A of an outer joint with U and X0 before joint 2."""
    if not revolute:
        return np.asarray(across @ directions)
    squares = 2.0 * start @ directions if turns else np.array([0.0, 1.0])
    return np.stack((axis @ directions, squares))


def _foot(point: FloatArray, origin: FloatArray, axis: FloatArray) -> FloatArray:
    """Return the point of a line that is nearest to a point."""
    return np.asarray(origin + axis * (axis @ (point - origin)))


def nearest_point(origin: FloatArray, axis: FloatArray, other: FloatArray, along: FloatArray) -> FloatArray:
    """Return the point of a line that is nearest to another line, in their unit, shape (3,).

    Where they are parallel it is the one nearest to the other's point.

    Args:
        origin: A point of the line, in any unit, shape (3,).
        axis: The line's unit vector [-], shape (3,).
        other: A point of the other line, in the same unit, shape (3,).
        along: The other line's unit vector [-], shape (3,).
    """
    normal = np.cross(axis, along)
    square = float(normal @ normal)
    if square < 1e-12:
        return _foot(other, origin, axis)
    return np.asarray(origin + axis * (np.cross(other - origin, along) @ normal / square))
