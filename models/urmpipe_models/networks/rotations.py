"""Rotation vectors: the rotation of one, what a change of one turns, and the way back. Elementwise."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.elementwise import Element, Vector, dot, scale
from urmpipe_models.transform import Transform

SMALL = 1e-8
"""Below this square of an angle in [rad^2] series stand for quotients of which both parts vanish."""


def rotation_of(q: Vector) -> Transform:
    """Return exp([q]x) = cos(a) I + (sin(a) / a) [q]x + ((1 - cos(a)) / a^2) q q^T, a = |q|.

    Args:
        q: Rotation vector in [rad], any elements; at 0 the series are used.

    Source: [KinematicSystems]_ section 3.2.2, the global joint, with u1 u1 in T(1,1) (errata).
    """
    x, y, z = q
    cosine, sinc, versed = _quotients(dot(q, q))[:3]
    return Transform(
        (
            (cosine + versed * x * x, versed * x * y - sinc * z, versed * x * z + sinc * y),
            (versed * x * y + sinc * z, cosine + versed * y * y, versed * y * z - sinc * x),
            (versed * x * z - sinc * y, versed * y * z + sinc * x, cosine + versed * z * z),
        )
    )


def turning_of(q: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the angular velocities in the outer frame with which exp([q]x) turns as q_1, q_2, q_3 change.

    The columns of I + ((1 - cos(a)) / a^2) [q]x + ((a - sin(a)) / a^3) [q]x^2, a = |q|.

    Args:
        q: Rotation vector in [rad], any elements.

    Source: the left Jacobian of SO(3), e.g. Barfoot 2017, State Estimation for Robotics, eq. 7.77.
    """
    x, y, z = q
    square = dot(q, q)
    _, _, v, w = _quotients(square)
    d = 1.0 - w * square
    return (
        (d + w * x * x, v * z + w * x * y, w * x * z - v * y),
        (w * x * y - v * z, d + w * y * y, v * x + w * y * z),
        (v * y + w * x * z, w * y * z - v * x, d + w * z * z),
    )


def _quotients(square: Element) -> tuple[Element, Element, Element, Element]:
    """Return cos(a), sin(a) / a, (1 - cos(a)) / a^2 and (a - sin(a)) / a^3 of a^2 in [rad^2]."""
    small = square < SMALL
    safe = np.where(small, 1.0, square)
    a = np.sqrt(safe)
    c, s = np.cos(a), np.sin(a)
    half = np.sin(0.5 * a)
    return (
        np.where(small, 1.0 - square / 2.0, c),
        np.where(small, 1.0 - square / 6.0, s / a),
        np.where(small, 0.5 - square / 24.0, 2.0 * half * half / safe),
        np.where(small, 1.0 / 6.0 - square / 120.0, (1.0 - s / a) / safe),
    )


def untwisted(vector: FloatArray) -> FloatArray:
    """Return what makes the rate of a rotation vector of an angular velocity in the outer frame.

    I - [v]x / 2 + ((1 - (a / 2) cot(a / 2)) / a^2) [v]x^2, a = |v|: the inverse of `turning_of`.

    Args:
        vector: v in [rad], shape (3, n).

    Returns:
        [-], shape (3, 3, n).
    """
    square = np.einsum("kn,kn->n", vector, vector)
    small = square < SMALL
    a = np.sqrt(np.where(small, 1.0, square))
    factor = np.where(small, 1.0 / 12.0 + square / 720.0, (1.0 - 0.5 * a / np.tan(0.5 * a)) / (a * a))
    skew = _skew(vector)
    twice = np.einsum("ijn,jkn->ikn", skew, skew)
    return np.asarray(np.eye(3)[:, :, np.newaxis] - 0.5 * skew + factor * twice)


def _skew(vector: FloatArray) -> FloatArray:
    """Return [v]x, shape (3, 3, n), of v in any unit, shape (3, n)."""
    x, y, z = vector
    zero = np.zeros_like(x)
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]])


def wrap_rotation_vector(vector: Vector) -> Vector:
    """Return the rotation vector of the same rotation whose angle is pi at most, elementwise.

    Args:
        vector: In [rad], any elements.
    """
    angle = np.sqrt(dot(vector, vector))
    turns = np.round(angle / (2.0 * np.pi))
    return scale(np.where(turns > 0.0, 1.0 - 2.0 * np.pi * turns / np.maximum(angle, 1.0), 1.0), vector)
