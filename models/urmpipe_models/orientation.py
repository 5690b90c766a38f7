"""Orientations as logs record them, as unit quaternions."""

from __future__ import annotations

from typing import Literal

import numpy as np

from urmpipe_models.kinematics import FloatArray

RotationForm = Literal["vector"]
"""vector: x, y, z of the axis times the angle, in [rad]."""


def quaternions(rotation: FloatArray, form: RotationForm) -> FloatArray:
    """Return unit quaternions x, y, z, w of recorded orientations.

    Of a rotation vector v with the angle a = |v|: [v sin(a / 2) / a, cos(a / 2)].

    Args:
        rotation: As recorded, in [rad], shape (n, 3).
        form: What its columns are.

    Returns:
        Shape (n, 4) [-]; NaN where a sample is missing.
    """
    angle = np.linalg.norm(rotation, axis=1)
    imaginary = rotation * (0.5 * np.sinc(angle / (2 * np.pi)))[:, np.newaxis]
    return np.column_stack((imaginary, np.cos(0.5 * angle)))
