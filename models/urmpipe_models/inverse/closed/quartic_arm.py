"""Joints 1 and 3 of an arm none of whose first three axes meet or are parallel: the quartic of Pieper."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.inverse.closed.loop_equations import LoopEquations, Seen, Track
from urmpipe_models.inverse.closed.tracks import ON_AXIS
from urmpipe_models.inverse.closed.trigonometric import quadric_roots, wrapped

FAR = 1e-3
"""A prismatic joint beyond 1 / FAR arm's sizes is a root at infinity, moved by rounding: none."""


def quartic_roots(equations: LoopEquations, seen: Seen) -> tuple[FloatArray, FloatArray]:
    """Return u1 and u3 of A1 u1 + b1 = A3 u3 + b3, both on their tracks.

    The equations give one of the two as v = G u + g of the other, which put into |v|^2 = radius^2 (or v[1] =
    v[0]^2 of a prismatic joint) leaves a quadric in the cosine and the sine of the other joint, or a quartic
    in its way. The one that is given is that with the better matrix: an arm two of whose axes almost meet or
    almost are parallel loses no digit then.

    Returns:
        u1 and u3 in units of the arm's size, shape (2, 4, n), by rising q3 from where the second equation is
        largest on; NaN where there is none.
    """
    first, third = equations.first, equations.third
    offset = equations.constant[:, None] - seen.constant
    radius = np.full_like(seen.radius, equations.radius)
    if np.linalg.cond(first.coefficients) <= np.linalg.cond(third.coefficients):
        u1, u3 = _both(first, seen.radius, third, radius, offset)
    else:
        u3, u1 = _both(third, radius, first, seen.radius, -offset)
    order = np.argsort(_from_largest(third, u3), axis=0)[None]  # NaN last
    return np.take_along_axis(u1, order, axis=1), np.take_along_axis(u3, order, axis=1)


def _both(
    given: Track, given_radius: FloatArray, other: Track, radius: FloatArray, offset: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return v and u of A v = B u + offset, v on the track of the given joint, u on that of the other."""
    inverse = np.linalg.inv(given.coefficients)
    matrix, g = inverse @ other.coefficients, inverse @ offset
    a, b, c, d, e, f = _conic(matrix, g, given_radius, given.revolute)
    if other.revolute:
        square = radius * radius
        x = quadric_roots((a * square, b * square, c * square, d * radius, e * radius, f))
        still = (radius <= ON_AXIS) & (np.abs(f) <= ON_AXIS)  # any angle: one is enough
        x = np.where(still, np.array([0.0, np.nan, np.nan, np.nan])[:, None], x)
        u = radius * np.stack((np.cos(x), np.sin(x)))
    else:
        x = quadric_roots(_in_half_angle((c, b, a + e, d, f)))
        t = np.where(np.abs(np.cos(x / 2)) > FAR, np.tan(x / 2), np.nan)
        u = np.stack((t, t * t))
    return np.asarray(np.tensordot(matrix, u, 1) + g[:, None]), u


def _conic(m: FloatArray, g: FloatArray, radius: FloatArray, revolute: bool) -> tuple[FloatArray, ...]:
    """Return A to F of A x^2 + B x y + C y^2 + D x + E y + F = 0: M (x, y) + g is on a circle or parabola."""
    if revolute:
        (a, b), (_, c) = m.T @ m
        (d, e), f = 2.0 * m.T @ g, (g * g).sum(axis=0) - radius**2
    else:
        a, b, c = -(m[0, 0] ** 2), -m[0, 0] * m[0, 1], -(m[0, 1] ** 2)
        (d, e), f = m[1][:, None] - 2.0 * m[0][:, None] * g[0], g[1] - g[0] ** 2
    return tuple(np.broadcast_to(one, f.shape) for one in (a, 2.0 * b, c, d, e, f))


def _in_half_angle(quartic: tuple[FloatArray, ...]) -> tuple[FloatArray, ...]:
    """Return the quadric's A to F in the angle x of a quartic in t = tan(x / 2), the highest power first."""
    p4, p3, p2, p1, p0 = quartic
    a = (p0 + p4) / 2
    return a, (p1 - p3) / 4, (p2 + 2.0 * a) / 4, (p0 - p4) / 2, (p1 + p3) / 4, np.zeros_like(a)


def _from_largest(third: Track, u3: FloatArray) -> FloatArray:
    """Return how far joint 3 is from where the second equation is largest: an angle or a way."""
    if not third.revolute:
        return np.asarray(u3[0])
    largest = float(np.arctan2(third.coefficients[1, 1], third.coefficients[1, 0]))
    return wrapped(np.arctan2(u3[1], u3[0]) - largest)
