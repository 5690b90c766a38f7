"""Equations in the cosine and the sine of one joint angle: the steps of closed-form inverses, elementwise.

1. `linear_roots`: a cos x + b sin x = c, two roots.
2. `circle_roots`, `parabola_roots`: the same equation for a point u of a joint's path, the circle of a
   revolute joint or the parabola (s, s^2) of a prismatic one; they also report where both roots coincide.
3. `quadric_roots`: A c^2 + B c s + C s^2 + D c + E s + F = 0 with c = cos x, s = sin x, up to four roots:
   the quartic in the tangent of the half angle [Pieper1968]_, by eigenvalues and Newton's rule.
4. `angle_about`, `angle_between`: angles of directions, accurate to rounding for any directions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import BoolArray, FloatArray, cross, dot

# A root missed by this, relative to the coefficients, counts as a double one. Rounding leaves the pose of a
# stretched arm some 1e-15 outside its reach; a pose out of reach by 1e-10 of an arm's length stays outside.
BOUNDARY = 1e-12
NEARLY_REAL = 1e-3  # imaginary part of a root that may be a double (up to fourfold) one, split by rounding
POLISHING = 4  # Newton steps after the eigenvalues, which leave 1e-8 of a double root
ON_AXIS = 1e-11  # of the arm's size; a circle of this radius is a point: turning about it moves nothing
# Two roots whose mean is missed by this, relative to the radius, are one: they are at most 4e-6 rad apart.
# Rounding splits the two roots of a stretched arm by some 1e-7 rad, the root of 1e-16.
MEETING = 2e-12


def wrap_angle(angle: FloatArray) -> FloatArray:
    """Return an angle of any shape in (-pi, pi], in [rad]."""
    turns = np.asarray(angle / (2 * np.pi))
    np.round(turns, out=turns)
    turns *= 2 * np.pi
    turned = np.subtract(angle, turns, out=turns)
    turned[turned <= -np.pi] += 2 * np.pi
    return turned


def linear_roots(a: FloatArray, b: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the two roots of a cos x + b sin x = c.

    x = atan2(b, a) +- atan2(sqrt(r^2 - c^2), c), r = hypot(a, b). At the first one the left side falls
    with x, at the second it rises; both are the same where |c| = r, up to `BOUNDARY`.

    Args:
        a: Real numbers in any unit, of the same shape as b and c.
        b: Likewise.
        c: Likewise.

    Returns:
        Angles in (-pi, pi], in [rad], of the same shape; NaN where |c| > r, or where a = b = 0 and every x
        or none is a root.
    """
    r = np.hypot(a, b)
    none = ~(np.abs(c) <= r * (1.0 + BOUNDARY)) | (r == 0.0)
    away = np.arctan2(np.sqrt(np.maximum((r - c) * (r + c), 0.0)), c)
    middle = np.where(none, np.nan, np.arctan2(b, a))
    return wrap_angle(middle + away), wrap_angle(middle - away)


@dataclass(frozen=True, slots=True, eq=False)
class Roots:
    """Points u of a joint's path with alpha . u = beta.

    Attributes:
        u: In units of the arm's size, shape (2, roots, ...); NaN where there is none. Of two the first one
            is where alpha . u falls.
        coincide: True where both are one, shape (...).
    """

    u: FloatArray
    coincide: BoolArray


def circle_roots(alpha: FloatArray, beta: FloatArray, radius: FloatArray | float) -> Roots:
    """Return u = radius (cos, sin) with alpha . u = beta; the centre, twice, of a circle that is a point.

    Args:
        alpha: In any unit, shape (2,), not 0.
        beta: In the unit of alpha . u, shape (...).
        radius: In units of the arm's size, of a shape that broadcasts to that of beta.
    """
    beta, radius = np.broadcast_arrays(beta, radius)
    reach = np.hypot(*alpha) * radius
    angles = np.stack(linear_roots(alpha[0] * radius, alpha[1] * radius, beta))
    u = radius * np.stack((np.cos(angles), np.sin(angles)))
    is_point = (radius <= ON_AXIS) & (np.abs(beta) <= 2.0 * np.hypot(*alpha) * ON_AXIS)
    coincide = np.isfinite(u[0, 0]) & (np.abs(beta) >= reach * (1.0 - MEETING)) & ~is_point
    return Roots(np.where(is_point, 0.0, u), np.asarray(coincide))


def parabola_roots(alpha: FloatArray, beta: FloatArray) -> Roots:
    """Return u = (s, s^2) with alpha . u = beta: one root where alpha[1] = 0, else two.

    Args:
        alpha: In any unit, shape (2,), not 0.
        beta: In the unit of alpha . u, shape (...).
    """
    if is_linear(alpha):
        s = (beta / alpha[0])[None]
        return Roots(np.stack((s, s * s)), np.zeros(beta.shape, dtype=bool))
    square = alpha[0] ** 2 + 4.0 * alpha[1] * beta
    scale = alpha[0] ** 2 + 4.0 * np.abs(alpha[1] * beta)
    root = np.sqrt(np.where(square >= -BOUNDARY * scale, np.maximum(square, 0.0), np.nan))
    s = np.stack((-alpha[0] - root, -alpha[0] + root)) / (2.0 * alpha[1])
    return Roots(np.stack((s, s * s)), np.asarray(square <= MEETING * scale) & np.isfinite(root))


def is_linear(alpha: FloatArray) -> bool:
    """Return whether the equation of a parabola, alpha of shape (2,) in any unit, is linear in s."""
    return bool(abs(alpha[1]) <= 1e-9 * abs(alpha[0]))


def quadric_roots(coefficients: Sequence[FloatArray] | FloatArray) -> FloatArray:
    """Return the up to four roots of A c^2 + B c s + C s^2 + D c + E s + F = 0, c = cos x, s = sin x.

    The tangent t = tan((x - x0) / 2) makes it a quartic, with the value of the left side at x0 + pi as
    leading coefficient: x0 is taken where that is large, so that no root goes to infinity and x = pi is
    like any other. Its roots are eigenvalues, then polished by Newton's rule; near a double root from
    the extremum between both.

    Args:
        coefficients: A, B, C, D, E, F, each of shape (n,), all in the same unit, any.

    Returns:
        Angles in (-pi, pi], in [rad], ascending, shape (4, n); missing roots are NaN and last. All are NaN
        where all coefficients are 0 or one is not finite. A double root is there twice.

    Source: [Pieper1968]_.
    """
    k = np.stack(np.broadcast_arrays(*(np.asarray(coefficient, dtype=float) for coefficient in coefficients)))
    scale = np.abs(k).sum(axis=0)
    valid = np.isfinite(scale) & (scale > 0.0)
    k = np.where(valid, k / np.where(valid, scale, 1.0), np.array([0, 0, 0, 0, 0, 1.0])[:, None])
    angles: FloatArray = np.arange(12.0) * (np.pi / 6) + 0.1
    start = angles[np.argmax(np.abs(_value(k, angles[:, None])), axis=0)] + np.pi
    a, b, g, d, e, f = _shifted(k, start)
    t = _quartic_roots(
        np.stack((a - d + f, 2.0 * (e - b), 4.0 * g - 2.0 * a + 2.0 * f, 2.0 * (b + e), a + d + f))
    )
    x = start + 2.0 * np.arctan(t.real)
    near = np.abs(t.imag) < NEARLY_REAL * (1.0 + np.abs(t) ** 2)
    x = np.where(t.imag == 0.0, x, np.where(near, _refine_double_root(k, x, np.sign(t.imag)), np.nan))
    for _ in range(POLISHING):
        x = _newton_step(k, x)
    x = np.where(np.abs(_value(k, x)) <= BOUNDARY, wrap_angle(x), np.nan)
    return np.sort(x, axis=0)


def _shifted(k: FloatArray, by: FloatArray) -> tuple[FloatArray, ...]:
    """Return the coefficients for the angle x - by."""
    c, s = np.cos(by), np.sin(by)
    a, b, g, d, e, f = k
    return (
        a * c * c + b * c * s + g * s * s,
        2.0 * (g - a) * c * s + b * (c * c - s * s),
        a * s * s - b * c * s + g * c * c,
        d * c + e * s,
        e * c - d * s,
        f,
    )


def _quartic_roots(polynomial: FloatArray) -> NDArray[np.complex128]:
    """Return the roots of quartics of shape (5, n), highest power first, by companion matrices."""
    companion = np.zeros((polynomial.shape[1], 4, 4))
    companion[:, 0, :] = (-polynomial[1:] / polynomial[0]).T
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    return np.asarray(np.linalg.eigvals(companion).T, dtype=complex)


def _refine_double_root(k: FloatArray, x: FloatArray, side: FloatArray) -> FloatArray:
    """Return the root on one side (+-1) of the extremum near x, by the parabola there.

    Where that parabola does not reach 0 it is the extremum; without an extremum, at a root of higher order,
    it is x. The value of the left side there decides whether it counts as a root.
    """
    extremum = x
    for _ in range(POLISHING):
        bend = _curvature(k, extremum)
        extremum = extremum - _slope(k, extremum) / np.where(bend == 0.0, np.inf, bend)
    bend = _curvature(k, extremum)
    square = -2.0 * _value(k, extremum) / np.where(bend == 0.0, np.inf, bend)
    root = extremum + side * np.sqrt(np.maximum(square, 0.0))
    return np.where(np.abs(_value(k, root)) < np.abs(_value(k, x)), root, x)


def _newton_step(k: FloatArray, x: FloatArray) -> FloatArray:
    """Return x after a step of Newton's rule where that brings the left side nearer to 0."""
    slope = _slope(k, x)
    further = x - _value(k, x) / np.where(slope == 0.0, np.inf, slope)
    return np.where(np.abs(_value(k, further)) < np.abs(_value(k, x)), further, x)


def _value(k: FloatArray, x: FloatArray) -> FloatArray:
    c, s = np.cos(x), np.sin(x)
    return np.asarray(c * (k[0] * c + k[1] * s + k[3]) + s * (k[2] * s + k[4]) + k[5])


def _slope(k: FloatArray, x: FloatArray) -> FloatArray:
    c, s = np.cos(x), np.sin(x)
    return np.asarray(2.0 * (k[2] - k[0]) * c * s + k[1] * (c * c - s * s) - k[3] * s + k[4] * c)


def _curvature(k: FloatArray, x: FloatArray) -> FloatArray:
    c, s = np.cos(x), np.sin(x)
    return np.asarray(2.0 * (k[2] - k[0]) * (c * c - s * s) - 4.0 * k[1] * c * s - k[3] * c - k[4] * s)


def angle_about(axis: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the angle by which a vector must turn about an axis to point as another, in (-pi, pi].

    Components along the axis do not count. They are subtracted first, so that vectors almost along the axis
    lose no digit.

    Args:
        axis: Unit vector [-], shape (3,).
        start: In any unit, shape (3, ...), or (3,) for all.
        end: In its unit, shape (3, ...), or (3,) for all.

    Returns:
        In [rad], shape (...).
    """
    x, y, z = (float(component) for component in axis)
    u, v = cross((x, y, z), tuple(start)), cross((x, y, z), tuple(end))
    return wrap_angle(np.arctan2(dot((x, y, z), cross(u, v)), dot(u, v)))


def angle_between(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the angle in [0, pi] between vectors, in [rad], shape (...).

    Args:
        first: In any unit, shape (3,).
        second: In any unit, shape (3, ...).
    """
    u, v = tuple(first.tolist()), tuple(second)
    x, y, z = cross(u, v)
    return np.asarray(np.arctan2(np.sqrt(x * x + y * y + z * z), dot(u, v)))
