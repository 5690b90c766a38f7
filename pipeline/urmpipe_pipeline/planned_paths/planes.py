"""The planes of a path: each arc spans one with the lines before and after it."""

from __future__ import annotations

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.planning.path import LineArcPath

FLAT = 1e-6
"""Points this near to a plane, as a share of their extent, are in it: that is thinner than any line."""

AROUND = 0.06
"""How far a plane is drawn beyond what is in it, as a share of its longer side."""


def outlines(path: LineArcPath) -> FloatArray:
    """Return the planes that a path runs through as rectangles in [m], shape (planes, 4, 3).

    Of arcs after each other in one plane there is one. Its axes are those of its first arc: x_p along the
    line before it, y_p towards its centre.

    Source: [Iso9283]_ section 2, Fig. 1 a.
    """
    found: list[list[FloatArray]] = []
    frames: list[tuple[FloatArray, FloatArray]] = []
    for k in path.arcs.tolist():
        points = _around(path, k)
        if found and _in_plane(np.concatenate([*found[-1], points]), *frames[-1]):
            found[-1].append(points)
        else:
            found.append([points])
            frames.append((path.start[k], np.stack((path.tangent[k], path.normal[k]))))
    pairs = zip(found, frames, strict=True)
    return np.array([_rectangle(np.concatenate(some), *frame) for some, frame in pairs]).reshape(-1, 4, 3)


def _around(path: LineArcPath, k: int) -> FloatArray:
    """Return points of an arc, and the far ends of the lines before and after it, in [m], shape (n, 3)."""
    lines = [j for j in (k - 1, k + 1) if 0 <= j < len(path) and np.isinf(path.radius[j])]
    far = [path.bounds[j] if j < k else path.bounds[j + 1] for j in lines]
    return path.points(np.append(np.linspace(path.bounds[k], path.bounds[k + 1], 9), far)).position


def _in_plane(points: FloatArray, origin: FloatArray, axes: FloatArray) -> bool:
    """Tell whether points in [m], shape (n, 3), are in the plane of two axes [-], shape (2, 3)."""
    off = (points - origin) @ np.cross(*axes)
    return bool(np.abs(off).max() <= FLAT * np.ptp(points, axis=0).max())


def _rectangle(points: FloatArray, origin: FloatArray, axes: FloatArray) -> FloatArray:
    """Return the corners, shape (4, 3), of a rectangle along axes [-] around points in their plane in [m]."""
    flat = (points - origin) @ axes.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    margin = AROUND * (high - low).max()
    (x0, y0), (x1, y1) = low - margin, high + margin
    return np.asarray(origin + np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) @ axes)
