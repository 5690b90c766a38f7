"""From where the 3D view is seen when it opens."""

from __future__ import annotations

import numpy as np

from urmpipe_pipeline.joint_log import FloatArray

EYE = np.array([0.62, -0.66, 0.42]) / np.linalg.norm([0.62, -0.66, 0.42])
"""The way from the middle of the scene to the eye [-]: from the front right, a little above."""


def seen(points: FloatArray) -> FloatArray:
    """Return how far points lie to the right, upwards and towards the eye.

    Args:
        points: In [m], shape (..., 3).

    Returns:
        In [m], shape (..., 3).
    """
    right = np.cross((0.0, 0.0, 1.0), EYE)
    right /= np.linalg.norm(right)
    return np.asarray(points @ np.column_stack((right, np.cross(EYE, right), EYE)))
