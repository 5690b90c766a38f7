"""Joints 1 and 3 of an arm none of whose first three axes meet or are parallel: the quartic of Pieper."""

from __future__ import annotations

import numpy as np

from urmpipe_models.inverse.loop_equations import LoopEquations, Seen
from urmpipe_models.inverse.solutions import FloatArray
from urmpipe_models.inverse.trigonometric import quadric_roots

FAR = 1e-3
"""A prismatic joint beyond 1 / FAR arm's sizes is a root at infinity, moved by rounding: none."""


def quartic_roots(equations: LoopEquations, seen: Seen) -> tuple[FloatArray, FloatArray]:
    """Return u1 and u3 of A1 u1 + b1 = A3 u3 + b3, both on their tracks.

    u1 = G u3 + g, put into |u1|^2 = rho^2 (or u1[1] = u1[0]^2 of a prismatic joint 1), leaves a quadric in
    cos q3 and sin q3, or a quartic in the way of a prismatic joint 3.

    Returns:
        u1 and u3, shape (2, 4, n), by rising q3 from where the second equation is largest on; NaN where
        there is none.
    """
    inverse = np.linalg.inv(equations.first.coefficients)
    g = inverse @ (equations.constant[:, None] - seen.constant)
    if equations.third.revolute:
        largest = np.arctan2(*equations.third.coefficients[1, ::-1])
        turn = np.array([[np.cos(largest), -np.sin(largest)], [np.sin(largest), np.cos(largest)]])
        matrix = equations.radius * inverse @ equations.third.coefficients @ turn
        x = quadric_roots(_circle(matrix, g, seen.radius, equations.first.revolute))
        unit = np.stack((np.cos(x), np.sin(x)))
        return _u1(matrix, g, unit), equations.radius * np.tensordot(turn, unit, 1)
    matrix = inverse @ equations.third.coefficients
    x = quadric_roots(_in_half_angle(_parabola(matrix, g, seen.radius, equations.first.revolute)))
    t = np.where(np.abs(np.cos(x / 2)) > FAR, np.tan(x / 2), np.nan)
    u3 = np.stack((t, t * t))
    return _u1(matrix, g, u3), u3


def _u1(matrix: FloatArray, g: FloatArray, unit: FloatArray) -> FloatArray:
    """Return G u + g."""
    return np.asarray(np.tensordot(matrix, unit, 1) + g[:, None])


def _circle(m: FloatArray, g: FloatArray, radius: FloatArray, revolute: bool) -> list[FloatArray]:
    """Return the quadric's A to F of |M (c, s) + g|^2 = rho^2, or of (M (c, s) + g)[1] = [0]^2."""
    if revolute:
        (a, b), (_, c) = m.T @ m
        (d, e), f = 2.0 * m.T @ g, (g * g).sum(axis=0) - radius**2
    else:
        a, b, c = -(m[0, 0] ** 2), -m[0, 0] * m[0, 1], -(m[0, 1] ** 2)
        (d, e), f = m[1][:, None] - 2.0 * m[0][:, None] * g[0], g[1] - g[0] ** 2
    return [np.broadcast_to(one, f.shape) for one in (a, 2.0 * b, c, d, e, f)]


def _parabola(m: FloatArray, g: FloatArray, radius: FloatArray, revolute: bool) -> list[FloatArray]:
    """Return the quartic's coefficients, the highest power first, of the same with (t, t^2) for (c, s)."""
    a, b, c, d, e, f = _circle(m, g, radius, revolute)
    return [c, b, a + e, d, f]


def _in_half_angle(p: list[FloatArray]) -> list[FloatArray]:
    """Return the quadric's A to F in the angle x of a quartic in t = tan(x / 2)."""
    p4, p3, p2, p1, p0 = p
    a = (p0 + p4) / 2
    return [a, (p1 - p3) / 4, (p2 + 2.0 * a) / 4, (p0 - p4) / 2, (p1 + p3) / 4, np.zeros_like(a)]
