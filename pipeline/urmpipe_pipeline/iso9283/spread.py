"""Barycentres and spreads of what several cycles attained."""

from __future__ import annotations

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import euler_zyx, to_matrices


def accuracy(attained: FloatArray, command: FloatArray) -> FloatArray:
    """Return the accuracy of attained points: AP and AT, |barycentre - command|.

    Args:
        attained: In [m], shape (n, k, 3): cycles, places, coordinates.
        command: In [m], shape (k, 3).

    Returns:
        In [m], shape (k,).

    Source: after ISO 9283, as public evaluations have it.
    """
    return np.asarray(np.linalg.norm(attained.mean(axis=0) - command, axis=1))


def repeatability(attained: FloatArray) -> FloatArray | None:
    """Return the repeatability of attained points: RP and RT, mean l + 3 S.

    l_j = |p_j - barycentre|, S = sqrt(sum (l_j - mean l)^2 / (n - 1)).

    Args:
        attained: In [m], shape (n, k, 3): cycles, places, coordinates.

    Returns:
        In [m], shape (k,); None of one cycle.

    Source: after ISO 9283, as public evaluations have it.
    """
    if len(attained) < 2:
        return None
    distance = np.linalg.norm(attained - attained.mean(axis=0), axis=2)
    return np.asarray(distance.mean(axis=0) + 3.0 * distance.std(axis=0, ddof=1))


def threefold(values: FloatArray) -> FloatArray | None:
    """Return 3 S of values over the cycles: RD, RV, and the repeatability of an angle.

    S = sqrt(sum (x_j - mean x)^2 / (n - 1)).

    Args:
        values: In any unit, shape (n, ...): cycles first.

    Returns:
        In the same unit, shape (...); None of one cycle.

    Source: after ISO 9283, from common knowledge.
    """
    return None if len(values) < 2 else np.asarray(3.0 * values.std(axis=0, ddof=1))


def angles(quat_xyzw: FloatArray) -> FloatArray:
    """Return rz, ry, rx of orientations [-], shape (n, 4), with R = Rz Ry Rx, in [rad], shape (n, 3)."""
    r = to_matrices(quat_xyzw)
    rows = tuple(tuple(r[:, i, j] for j in range(3)) for i in range(3))
    rz, ry, rx, _ = euler_zyx(rows)  # type: ignore[arg-type]
    return np.column_stack((rz, ry, rx))


def turned(attained: FloatArray, command: FloatArray) -> FloatArray:
    """Return by how much attained angles differ from commanded ones, the shorter way round.

    Args:
        attained: rz, ry, rx in [rad], shape (n, k, 3).
        command: Likewise, shape (k, 3).

    Returns:
        In [rad], -pi to pi, shape (n, k, 3).
    """
    return np.asarray(np.remainder(attained - command + np.pi, 2.0 * np.pi) - np.pi)
