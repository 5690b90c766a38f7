"""Angles between directions, elementwise, to the last digits wherever they point."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.elementwise import cross, dot
from urmpipe_models.inverse.closed.trigonometric import wrapped


def angle_about(axis: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the angle by which a vector must turn about an axis to point as another, in (-pi, pi].

    What both have along the axis does not count. It is taken off first, so that vectors that are almost along
    the axis lose no digit.

    Args:
        axis: Unit vector [-], shape (3,).
        start: In any unit, shape (3, ...), or (3,) for all.
        end: In its own unit, shape (3, ...), or (3,) for all.

    Returns:
        In [rad], shape (...).
    """
    x, y, z = (float(one) for one in axis)
    u, v = cross((x, y, z), tuple(start)), cross((x, y, z), tuple(end))
    return wrapped(np.arctan2(dot((x, y, z), cross(u, v)), dot(u, v)))


def angle_between(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the angle in [0, pi] between vectors, in [rad], shape (...).

    Args:
        first: In any unit, shape (3,).
        second: In any unit, shape (3, ...).
    """
    u, v = tuple(first.tolist()), tuple(second)
    x, y, z = cross(u, v)
    return np.asarray(np.arctan2(np.sqrt(x * x + y * y + z * z), dot(u, v)))
