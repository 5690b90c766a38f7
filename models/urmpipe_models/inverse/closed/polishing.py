"""Newton's rule on the first three joints of an arm, elementwise over targets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray
from urmpipe_models.kinematics.screws import Screws
from urmpipe_models.transform import rotation_about

STEPS = 4
"""From 1e-6, the worst that a loop equation may be off, two steps reach the rounding; near a fold four."""


def polished(
    screws: Screws, wrist: FloatArray, q: FloatArray, target: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return joints 1 to 3 that are nearer to a target of the wrist centre, and how far they still are.

    Args:
        screws: Of the arm.
        wrist: The wrist centre at q = 0, shape (3,), in the unit of the screws.
        q: Joints 1 to 3 in [rad] or, of a prismatic one, in the unit of the screws, shape (3, ...).
        target: Where the wrist centre shall be, in the unit of the screws, shape (3, ...).

    Returns:
        q, shape (3, ...), and the distance that is left, shape (...), in the unit of the screws.
    """
    miss, columns = _miss(screws, wrist, q, target)
    left = np.sqrt((miss * miss).sum(axis=0))
    for _ in range(STEPS):
        further = q + _solved(columns, miss)
        next_miss, next_columns = _miss(screws, wrist, further, target)
        next_left = np.sqrt((next_miss * next_miss).sum(axis=0))
        better = next_left < left
        q, left = np.where(better, further, q), np.where(better, next_left, left)
        miss, columns = np.where(better, next_miss, miss), np.where(better, next_columns, columns)
    return q, left


def jacobian_determinant(screws: Screws, wrist: FloatArray, q: FloatArray) -> FloatArray:
    """Return det of d(wrist centre)/d(q1, q2, q3) at q, shape (3, ...), in the unit of the screws."""
    reached = np.broadcast_to(_as(wrist, q), q.shape)
    for joint in (2, 1, 0):
        reached = _moved(screws, joint, q[joint], reached)
    _, columns = _miss(screws, wrist, q, reached)
    return np.asarray((columns[0] * np.cross(columns[1], columns[2], axis=0)).sum(axis=0))


def _miss(
    screws: Screws, wrist: FloatArray, q: FloatArray, target: FloatArray
) -> tuple[FloatArray, NDArray[np.float64]]:
    """Return how far the target is from the wrist as joint 1 sees both, and by which columns joints mend it.

    exp(-xi1 q1) target - exp(xi2 q2) exp(xi3 q3) wrist, shape (3, ...), and columns of shape (3, 3, ...).
    """
    seen = _moved(screws, 0, -q[0], target)
    inner = _moved(screws, 2, q[2], np.broadcast_to(_as(wrist, q), q.shape))
    brought = _moved(screws, 1, q[1], inner)
    third = _velocity(screws, 2, inner)
    if screws.revolute[1]:
        third = np.stack(rotation_about(screws.direction[1], q[1]).rotate(tuple(third)))
    return seen - brought, np.stack((_velocity(screws, 0, seen), _velocity(screws, 1, brought), third))


def _moved(screws: Screws, joint: int, value: FloatArray, point: FloatArray) -> FloatArray:
    """Return exp(xi q) applied to points, shape (3, ...)."""
    axis, origin = screws.direction[joint], _as(screws.point[joint], point)
    if not screws.revolute[joint]:
        return np.asarray(point + _as(axis, point) * value)
    return np.stack(rotation_about(axis, value).rotate(tuple(point - origin))) + origin


def _velocity(screws: Screws, joint: int, point: FloatArray) -> FloatArray:
    """Return how points, shape (3, ...), move with a joint."""
    axis = np.broadcast_to(_as(screws.direction[joint], point), point.shape)
    if not screws.revolute[joint]:
        return np.asarray(axis)
    return np.cross(axis, point - _as(screws.point[joint], point), axis=0)


def _solved(columns: NDArray[np.float64], miss: FloatArray) -> FloatArray:
    """Return dq with columns dq = miss by Cramer's rule; 0 where the columns are dependent."""
    first, second, third = columns
    crossed = np.stack(
        (np.cross(second, third, axis=0), np.cross(third, first, axis=0), np.cross(first, second, axis=0))
    )
    determinant = (first * crossed[0]).sum(axis=0)
    flat = np.abs(determinant) < 1e-300
    return np.where(flat, 0.0, (crossed * miss).sum(axis=1) / np.where(flat, 1.0, determinant))


def _as(vector: FloatArray, like: FloatArray) -> FloatArray:
    """Return a vector, shape (3,), as one of shape (3, 1, ...) that spreads over arrays like another."""
    return vector.reshape(3, *(1,) * (like.ndim - 1))
