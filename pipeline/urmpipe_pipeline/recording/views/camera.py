"""From where the 3D view is seen when it opens."""

from __future__ import annotations

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.presentation.scene import PlaneView

EYE = np.array([0.62, -0.66, 0.42]) / np.linalg.norm([0.62, -0.66, 0.42])
"""The way from the middle of the scene to the eye [-]: from the front right, a little above."""


FIELD_OF_VIEW, FILLED, WIDE = np.radians(55.0), 0.85, 1.2
"""What the viewer's eye sees from the bottom to the top of a view in [rad] (re_view_spatial,
Eye::DEFAULT_FOV_Y), the share of it that the scene fills, and how wide a view is at least, in heights."""


TILT = np.radians(20.0)
"""Angle between the eye and the normal of a planar mechanism in [rad]: depth shows, and lengths keep 94 %."""


def eye_axes(plane: PlaneView | None = None) -> FloatArray:
    """Return the directions to the right, upwards and towards the eye as columns [-], shape (3, 3).

    Of a plane, the eye is turned from its normal towards the side from which other scenes are seen.
    """
    if plane is None:
        right = np.cross((0.0, 0.0, 1.0), EYE)
        right /= np.linalg.norm(right)
        return np.column_stack((right, np.cross(EYE, right), EYE))
    right, up, normal = plane.axes.T
    eye = np.cos(TILT) * normal + np.sin(TILT) * np.sign(EYE @ up) * up
    return np.column_stack((right, np.cross(eye, right), eye))


def seen(points: FloatArray, plane: PlaneView | None = None) -> FloatArray:
    """Return how far points in [m], shape (..., 3), lie to the right, upwards and towards the eye in [m]."""
    return np.asarray(points @ eye_axes(plane))


def eye_distance(points: FloatArray) -> float:
    """Return how far the eye is from the middle of a scene, so that all of it is in view, in [m].

    The points are what `seen` returns of them from the middle in [m], shape (..., 3); NaN is no point.
    """
    aside, above, ahead = np.moveaxis(points, -1, 0)
    distance = ahead + np.maximum(np.abs(above), np.abs(aside) / WIDE) / (FILLED * np.tan(FIELD_OF_VIEW / 2))
    return float(np.fmax.reduce(distance, axis=None))


def in_the_picture(points: FloatArray) -> FloatArray:
    """Return where points are in the picture that the eye sees of them: what is nearer is larger.

    Points are in [m], shape (..., 3), NaN where there is none; to the right and upwards of the middle they
    are in [m], shape (..., 2), as long as in the plane through the middle.
    """
    found = seen(points)
    flat = found.reshape(-1, 3)
    found -= (np.fmin.reduce(flat) + np.fmax.reduce(flat)) / 2.0
    distance = eye_distance(found) or 1.0
    return np.asarray(found[..., :2] * (distance / (distance - found[..., 2:])))
