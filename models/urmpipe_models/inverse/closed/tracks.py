"""Points of a circle or a parabola that satisfy one linear equation: a joint value by its equation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray
from urmpipe_models.inverse.closed.trigonometric import BOUNDARY, linear_roots

ON_AXIS = 1e-11
"""A circle of this radius, in units of the arm's size, is a point: what turns about it moves nothing."""

MEETING = 2e-12
"""Two roots whose mean is missed by this, relative to the radius, are one: they are 4e-6 rad apart at most.

Rounding parts the two roots of an arm that is really stretched by some 1e-7 rad, the root of 1e-16.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Roots:
    """The points u of a track with alpha . u = beta.

    Attributes:
        u: In units of the arm's size, shape (2, roots, ...); NaN where there is none. Of two the first one is
            where alpha . u falls.
        meet: True where both are one, shape (...).
    """

    u: FloatArray
    meet: BoolArray


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
    still = (radius <= ON_AXIS) & (np.abs(beta) <= 2.0 * np.hypot(*alpha) * ON_AXIS)
    meet = np.isfinite(u[0, 0]) & (np.abs(beta) >= reach * (1.0 - MEETING)) & ~still
    return Roots(np.where(still, 0.0, u), np.asarray(meet))


def parabola_roots(alpha: FloatArray, beta: FloatArray) -> Roots:
    """Return u = (s, s^2) with alpha . u = beta: one root where alpha[1] = 0, else two.

    Args:
        alpha: In any unit, shape (2,), not 0.
        beta: In the unit of alpha . u, shape (...).
    """
    if is_straight(alpha):
        s = (beta / alpha[0])[None]
        return Roots(np.stack((s, s * s)), np.zeros(beta.shape, dtype=bool))
    square = alpha[0] ** 2 + 4.0 * alpha[1] * beta
    scale = alpha[0] ** 2 + 4.0 * np.abs(alpha[1] * beta)
    root = np.sqrt(np.where(square >= -BOUNDARY * scale, np.maximum(square, 0.0), np.nan))
    s = np.stack((-alpha[0] - root, -alpha[0] + root)) / (2.0 * alpha[1])
    return Roots(np.stack((s, s * s)), np.asarray(square <= MEETING * scale) & np.isfinite(root))


def is_straight(alpha: FloatArray) -> bool:
    """Return whether the equation of a parabola, alpha of shape (2,) in any unit, is a linear one."""
    return bool(abs(alpha[1]) <= 1e-9 * abs(alpha[0]))
