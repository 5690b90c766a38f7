"""Where the names of ghost arms stand, so that they can be read in the view that opens."""

from __future__ import annotations

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.recording.views.camera import in_the_picture

NAME_SIZE = (0.3, 0.035)
"""How wide and how high a name is in the view, as shares of the diagonal of all that is in view."""


def name_places(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return where the name of an arm may stand: at the end of each bone, or in its middle.

    Bones start and end in [m], shape (..., bones, 3) each; the places are in [m], shape (..., 2 bones, 3).
    """
    return np.concatenate((end, (start + end) / 2), axis=-2)


def placed_names(arms: FloatArray, view: float = 0.0) -> IntArray:
    """Return for each arm the place at which its name can be read, and told from those of the others.

    Names must not lie on each other: that comes first. Then a place is the better the further it is from the
    same place of the other arms, all taken together.

    Args:
        arms: The `name_places` of each arm in some poses in [m], shape (arms, poses, places, 3); NaN where
            one is not there.
        view: The diagonal of all that is in view in [m], if that is more than the arms: then they are small
            beside their names.

    Returns:
        Shape (arms, poses).
    """
    picture, box = in_the_picture(arms), np.array(NAME_SIZE) * max(view, extent_of(arms))
    found = np.zeros(arms.shape[:2], dtype=np.int64)
    at: list[FloatArray] = []
    for i, mine in enumerate(arms):
        apart = np.linalg.norm(np.delete(arms, i, axis=0) - mine, axis=3)
        room = np.nansum(apart, axis=0)
        free = np.ones(mine.shape[:2])
        for name in at:
            free = np.fmin(free, (np.abs(picture[i] - name) / box).max(axis=2))
        found[i] = np.argmax(np.where(free < 1.0, free, 1.0 + room), axis=1)
        at.append(np.take_along_axis(picture[i], found[i][:, None, None], axis=1))
    return found


def extent_of(points: FloatArray) -> float:
    """Return the diagonal of the box around points in [m], shape (..., 3); 1 around one. NaN is no point."""
    flat = points.reshape(-1, 3)
    return float(np.linalg.norm(np.fmax.reduce(flat) - np.fmin.reduce(flat))) or 1.0
