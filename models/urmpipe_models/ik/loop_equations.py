"""The first three joints of an arm as two equations between joints 1 and 3 [Pieper1968]_.

1. `LoopEquations`: with p0 the wrist centre at q = 0 and w its target,

       exp(xi1 q1) exp(xi2 q2) exp(xi3 q3) p0 = w

   is separated at joint 2: x = exp(-xi1 q1) w must result from y = exp(xi3 q3) p0 by joint 2 alone. A
   revolute joint 2 keeps k2 . (y - o2) and |y - o2|^2 (the invariants of Pieper), a prismatic one both
   coordinates across it. Either way these are two equations A1 u1 + b1(w) = A3 u3 + b3 in points u1, u3 of
   a circle or a parabola, with constant matrices. `shoulder_elbow` solves them.
2. `refine_joints`: Newton's rule on joints 1 to 3, for arms that fulfil them only approximately.
3. `ReachReasons`: why the joints do not reach a wrist centre, as text with figures.

Lengths are in units of the arm's size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import BoolArray, FloatArray, TextArray
from urmpipe_models.kinematics.forward import Screws
from urmpipe_models.math3d import rotation_about

NEWTON_STEPS = 4  # two reach the rounding from an error of 1e-6 of a loop equation; near a fold four do
PURE = 1e-6  # a combination of the equations is one of them alone if the share of the other is smaller
MILLIMETRE = 1e-3  # [m]; an excess above this is written to the millimetre
NOT_FINITE = "the target is not finite, allowed: finite numbers"


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """The path X = X0 + U u on which an outer joint (1 or 3) of the three moves the wrist.

    The point u of a revolute joint is on a circle, (rho cos, rho sin), of a prismatic one on a parabola,
    (s, s^2).

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
class WristView:
    """A wrist centre w seen from joint 1, one column per target; lengths in units of the arm's size.

    Attributes:
        start: X0, relative to o2, in that unit, shape (3, n).
        constant: b1, in that unit or its square, shape (2, n).
        radius: Distance from axis 1 in that unit; 0 if joint 1 is prismatic, shape (n,).
        zero: q1 at angle or length 0 of u1: q1 = zero - angle, or zero + s, in [rad] or that unit,
            shape (n,).
        height: Length along axis 1 from the point nearest to axis 2, in that unit, shape (n,).
    """

    start: FloatArray
    constant: FloatArray
    radius: FloatArray
    zero: FloatArray
    height: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class LoopEquations:
    """The conditions on joints 1 and 3 under which a joint 2 closes the loop to the wrist centre w.

    A1 u1 + b1(w) = A3 u3 + b3, see the head of this module. Lengths are in units of the arm's size.

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
        shift: Is added to s of a prismatic joint 3 to give q3.

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

    def view_from_joint1(self, wrist: FloatArray) -> WristView:
        """Return wrist centres w, shape (3, n), in units of the arm's size, as seen from joint 1."""
        away = wrist - self.base[:, None]
        height = self.first.axis @ away
        if self.first.revolute:
            x, y = self.first.directions.T @ away
            radius, zero = np.hypot(x, y), np.arctan2(y, x)
            start = (self.base - self.origin)[:, None] + self.first.axis[:, None] * height
        else:
            radius, zero = np.zeros_like(height), height
            start = away - self.first.axis[:, None] * height
        return WristView(start, self.invariants(start, radius), radius, zero, height)


def loop_equations(screws: Screws, wrist: FloatArray) -> LoopEquations:
    """Return the equations of the first three screws and the wrist centre at q = 0.

    Args:
        screws: Of the arm, lengths in units of its size.
        wrist: The wrist centre, shape (3,), in the same unit.
    """
    (k1, k2, k3), (o1, o2, o3) = screws.direction[:3], screws.point[:3]
    r1, r2, r3 = (bool(revolute) for revolute in screws.revolute[:3])
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
    directions1 = np.stack(perpendicular_pair(k1) if r1 else (-k1, np.zeros(3)), axis=1)
    base = _foot(origin, o1, k1) if r1 else origin
    first = Track(k1, r1, directions1, _coefficients(directions1, base - origin, r1, k2, r2, across))
    third = Track(k3, r3, directions3, _coefficients(directions3, start, r3, k2, r2, across))
    without_constant = LoopEquations(
        k2, r2, across, origin, base, first, third, start, np.zeros(2), radius, shift
    )
    constant = without_constant.invariants(start[:, None], radius)[:, 0]
    return LoopEquations(k2, r2, across, origin, base, first, third, start, constant, radius, shift)


def _across(axis: FloatArray, first: FloatArray, third: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors across axis 2 that turn with the arm: by its angle to axis 1 or else axis 3."""
    for other in (first, third):
        normal = np.cross(other, axis)
        length = float(np.linalg.norm(normal))
        if length > 1e-6:
            return normal / length, np.cross(axis, normal / length)
    return perpendicular_pair(axis)


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


def perpendicular_pair(axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors [-], shape (3,) each, of the right-handed frame whose third one is `axis`."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)


def nearest_point(origin: FloatArray, axis: FloatArray, other: FloatArray, along: FloatArray) -> FloatArray:
    """Return the point of a line that is nearest to another line, in their unit, shape (3,).

    Of parallel lines it is the one nearest to the other's point.

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


def _foot(point: FloatArray, origin: FloatArray, axis: FloatArray) -> FloatArray:
    """Return the point of a line that is nearest to a point."""
    return np.asarray(origin + axis * (axis @ (point - origin)))


def refine_joints(
    screws: Screws, wrist: FloatArray, q: FloatArray, target: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return joints 1 to 3 nearer to a target of the wrist centre, and the remaining distance.

    Args:
        screws: Of the arm.
        wrist: The wrist centre at q = 0, shape (3,), in the unit of the screws.
        q: Joints 1 to 3 in [rad] or, of a prismatic one, in the unit of the screws, shape (3, ...).
        target: Of the wrist centre, in the unit of the screws, shape (3, ...).

    Returns:
        q, shape (3, ...), and the remaining distance, shape (...), in the unit of the screws.
    """
    error, columns = _error_and_columns(screws, wrist, q, target)
    left = np.sqrt((error * error).sum(axis=0))
    for _ in range(NEWTON_STEPS):
        further = q + _solve_columns(columns, error)
        next_error, next_columns = _error_and_columns(screws, wrist, further, target)
        next_left = np.sqrt((next_error * next_error).sum(axis=0))
        better = next_left < left
        q, left = np.where(better, further, q), np.where(better, next_left, left)
        error, columns = np.where(better, next_error, error), np.where(better, next_columns, columns)
    return q, left


def jacobian_determinant(screws: Screws, wrist: FloatArray, q: FloatArray) -> FloatArray:
    """Return det of d(wrist centre)/d(q1, q2, q3) at q, shape (3, ...), in the unit of the screws."""
    reached = np.broadcast_to(_spread(wrist, q), q.shape)
    for joint in (2, 1, 0):
        reached = _moved(screws, joint, q[joint], reached)
    _, columns = _error_and_columns(screws, wrist, q, reached)
    return np.asarray((columns[0] * np.cross(columns[1], columns[2], axis=0)).sum(axis=0))


def _error_and_columns(
    screws: Screws, wrist: FloatArray, q: FloatArray, target: FloatArray
) -> tuple[FloatArray, NDArray[np.float64]]:
    """Return the difference of target and wrist seen from joint 1, and how the joints change it.

    exp(-xi1 q1) target - exp(xi2 q2) exp(xi3 q3) wrist, shape (3, ...), and columns of shape (3, 3, ...).
    """
    goal = _moved(screws, 0, -q[0], target)
    inner = _moved(screws, 2, q[2], np.broadcast_to(_spread(wrist, q), q.shape))
    reached = _moved(screws, 1, q[1], inner)
    third = _velocity(screws, 2, inner)
    if screws.revolute[1]:
        third = np.stack(rotation_about(screws.direction[1], q[1]).rotate(tuple(third)))
    return goal - reached, np.stack((_velocity(screws, 0, goal), _velocity(screws, 1, reached), third))


def _moved(screws: Screws, joint: int, value: FloatArray, point: FloatArray) -> FloatArray:
    """Return exp(xi q) applied to points, shape (3, ...)."""
    axis, origin = screws.direction[joint], _spread(screws.point[joint], point)
    if not screws.revolute[joint]:
        return np.asarray(point + _spread(axis, point) * value)
    return np.stack(rotation_about(axis, value).rotate(tuple(point - origin))) + origin


def _velocity(screws: Screws, joint: int, point: FloatArray) -> FloatArray:
    """Return the derivatives of points, shape (3, ...), by a joint's value."""
    axis = np.broadcast_to(_spread(screws.direction[joint], point), point.shape)
    if not screws.revolute[joint]:
        return np.asarray(axis)
    return np.cross(axis, point - _spread(screws.point[joint], point), axis=0)


def _solve_columns(columns: NDArray[np.float64], error: FloatArray) -> FloatArray:
    """Return dq with columns dq = error by Cramer's rule; 0 where the columns are dependent."""
    first, second, third = columns
    crossed = np.stack(
        (np.cross(second, third, axis=0), np.cross(third, first, axis=0), np.cross(first, second, axis=0))
    )
    determinant = (first * crossed[0]).sum(axis=0)
    dependent = np.abs(determinant) < 1e-300
    return np.where(dependent, 0.0, (crossed * error).sum(axis=1) / np.where(dependent, 1.0, determinant))


def _spread(vector: FloatArray, like: FloatArray) -> FloatArray:
    """Return a vector, shape (3,), reshaped to (3, 1, ...) to broadcast over arrays."""
    return vector.reshape(3, *(1,) * (like.ndim - 1))


@dataclass(frozen=True, eq=False)
class ReachReasons:
    """Reasons why joints 1 to 3 do not reach a wrist centre; writes them into arrays of texts.

    Attributes:
        equations: In units of the arm's size.
        size: In [m].
    """

    equations: LoopEquations
    size: float

    def write_side(
        self, reasons: TextArray, missed: BoolArray, view: WristView, alpha: FloatArray, needed: FloatArray
    ) -> None:
        """Write why joint 1 has no root of alpha . u1 = needed: the wrist centre is too near to axis 1.

        `reasons` are written where `missed`, both of shape (..., n); alpha, shape (2,), and needed, shape
        (..., n), are in units of the arm's size.
        """
        if not self.equations.first.revolute:
            self.write_position(reasons, missed, view)
            return
        radius = np.broadcast_to(view.radius, missed.shape)[missed] * self.size
        least = np.abs(needed[missed]) / np.hypot(*alpha) * self.size
        reasons[missed] = [
            _outside(distance, limit, math.inf, "from axis 1")
            for distance, limit in zip(radius.tolist(), least.tolist(), strict=True)
        ]

    def write_elbow(
        self, reasons: TextArray, missed: BoolArray, share: FloatArray, value: FloatArray
    ) -> None:
        """Write why joint 3 has no root: the wrist centre is too near or too far.

        `reasons` are written where `missed`, both of shape (..., n); joint 3 is solved from the combination
        `share` of the equations [-], shape (2,), which has to give `value` plus its constant, in units of the
        arm's size, shape (..., n).
        """
        distances, what = self._measured(share, value[missed])
        (least, most), _ = self._measured(share, np.array(self._range(share)))
        figures, index = np.unique(distances, return_inverse=True)  # both elbows share a figure
        reasons[missed] = _outside_range(figures, float(least), float(most), what)[index]

    def write_position(self, reasons: TextArray, missed: BoolArray, view: WristView) -> None:
        """Write where a wrist centre is that no further posture reaches, in cylinder coordinates.

        `reasons` are written where `missed`, both of shape (..., n).
        """
        radius = np.broadcast_to(view.radius, missed.shape)[missed] * self.size
        height = np.broadcast_to(view.height, missed.shape)[missed] * self.size
        reasons[missed] = [
            f"the wrist centre is {r:.3f} m from axis 1 and {h:.3f} m along it,"
            " allowed: where joints 1 to 3 bring it in one posture more"
            if math.isfinite(h)
            else NOT_FINITE
            for r, h in zip(radius.tolist(), height.tolist(), strict=True)
        ]

    def _range(self, share: FloatArray) -> tuple[float, float]:
        """Return the least and the largest value of share . A3 u3."""
        alpha = share @ self.equations.third.coefficients
        if self.equations.third.revolute:
            high = float(np.hypot(*alpha)) * self.equations.radius
            return -high, high
        if alpha[1] == 0.0:
            return -math.inf, math.inf
        vertex = -float(alpha[0] ** 2 / (4.0 * alpha[1]))
        return (vertex, math.inf) if alpha[1] > 0.0 else (-math.inf, vertex)

    def _measured(self, share: FloatArray, value: FloatArray) -> tuple[FloatArray, str]:
        """Return the distance of the wrist centre in a combination of the equations, in [m], and its name."""
        total = float(share @ self.equations.constant) + value
        if not self.equations.revolute or min(np.abs(share)) > PURE:
            return total * self.size, "off in what joint 3 must make good"
        if abs(share[1]) <= PURE:
            return total * self.size, "along axis 2"
        where = "from axis 2" if self._parallel else "from the point where axes 1 and 2 meet"
        height = float(self.equations.constant[0] ** 2) if self._parallel else 0.0
        return np.sqrt(np.maximum(total - height, 0.0)) * self.size, where

    @cached_property
    def _parallel(self) -> bool:
        """Whether axes 2 and 3 are parallel: joint 3 does not move the wrist along axis 2."""
        return bool(np.linalg.norm(np.cross(self.equations.axis, self.equations.third.axis)) <= PURE)


def _outside_range(distances: FloatArray, least: float, most: float, what: str) -> TextArray:
    """Return `_outside` of many distances and one range; their common text is written once."""
    clear = np.isfinite(distances) & (np.maximum(least - distances, distances - most) > MILLIMETRE)
    ending = f" m {what}, {_allowed(least, most, 3)}"
    texts: TextArray = np.empty(len(distances), dtype=np.object_)
    texts[clear] = [f"the wrist centre is {distance:.3f}{ending}" for distance in distances[clear].tolist()]
    texts[~clear] = [_outside(distance, least, most, what) for distance in distances[~clear].tolist()]
    return texts


def _outside(distance: float, least: float, most: float, what: str) -> str:
    """Return a distance and the allowed range, with enough digits to distinguish distance and limit."""
    if not math.isfinite(distance):
        return NOT_FINITE
    excess = max(least - distance, distance - most)
    digits = 3 if excess > MILLIMETRE else min(13, 1 - math.floor(math.log10(max(excess, 1e-12))))
    return f"the wrist centre is {distance:.{digits}f} m {what}, {_allowed(least, most, digits)}"


def _allowed(least: float, most: float, digits: int) -> str:
    if math.isinf(most):
        return f"allowed: {least:.{digits}f} m or more"
    return f"allowed: {least:.{digits}f} to {most:.{digits}f} m"
