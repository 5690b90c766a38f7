"""Targets that are none: not finite, farther than any tool gets, no rotation."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.errors import OptionError
from urmpipe_models.inverse.targets import Targets

ROTATION_TOLERANCE = 1e-6
"""A matrix of a file with 7 digits is a rotation within this, and the nearest one is taken [-]."""

FARTHEST = 1e9
"""A coordinate beyond this, in [m], is no place of a tool: its square leaves no digit of an arm's length."""


def checked(targets: Targets) -> tuple[Targets, list[str]]:
    """Return targets with the nearest rotations, and why each of them is no target; empty where it is one.

    Of R with |R^T R - 1| <= 1e-6 in every entry the nearest rotation is taken: two steps of
    R <- R (3 - R^T R) / 2, whose error falls as its square.

    Raises:
        OptionError: If positions and rotations are not arrays of shape (n, 3) and (n, 3, 3).
    """
    position, rotation = np.asarray(targets.position, dtype=float), targets.rotation
    count = len(position)
    if position.shape != (count, 3):
        raise OptionError(f"targets: found positions of shape {position.shape}, allowed: (n, 3)")
    reasons = _of_positions(position)
    if rotation is None:
        return Targets(position), reasons
    rotation = np.asarray(rotation, dtype=float)
    if rotation.shape != (count, 3, 3):
        raise OptionError(
            f"targets: found rotations of shape {rotation.shape} for {count} positions,"
            f" allowed: ({count}, 3, 3)"
        )
    reasons = [first or second for first, second in zip(reasons, _of_rotations(rotation), strict=True)]
    with np.errstate(all="ignore"):
        for _ in range(2):
            rotation = rotation @ (1.5 * np.eye(3) - 0.5 * rotation.transpose(0, 2, 1) @ rotation)
    return Targets(position, rotation), reasons


def _of_positions(position: FloatArray) -> list[str]:
    """Return why positions in [m], shape (n, 3), are none."""
    reasons = [""] * len(position)
    for row in np.flatnonzero(~(np.abs(position) <= FARTHEST).all(axis=1)):
        found = ", ".join(f"{value:g}" for value in position[row])
        finite = np.isfinite(position[row]).all()
        allowed = f"up to {FARTHEST:g} m along each axis" if finite else "finite numbers"
        reasons[row] = f"the position is {found} m, allowed: {allowed}"
    return reasons


def _of_rotations(rotation: FloatArray) -> list[str]:
    """Return why matrices, shape (n, 3, 3), are no rotations."""
    with np.errstate(all="ignore"):
        error = np.abs(rotation.transpose(0, 2, 1) @ rotation - np.eye(3)).max(axis=(1, 2))
        mirrored = np.linalg.det(rotation) < 0.0
    reasons = [""] * len(rotation)
    for row in np.flatnonzero(~(error <= ROTATION_TOLERANCE) | mirrored):
        if not np.isfinite(rotation[row]).all():
            reasons[row] = "the orientation is not finite, allowed: finite numbers"
        elif not error[row] <= ROTATION_TOLERANCE:
            reasons[row] = (
                f"the orientation is not a rotation: R^T R differs from 1 by {error[row]:.3g},"
                f" allowed: {ROTATION_TOLERANCE:g}"
            )
        else:
            reasons[row] = "the orientation is not a rotation: its determinant is -1, a mirror, allowed: 1"
    return reasons
