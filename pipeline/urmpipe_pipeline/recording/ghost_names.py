"""Where the names of ghost arms stand, so that they can be read in the view that opens."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from urmpipe_pipeline.joint_log import FloatArray
from urmpipe_pipeline.recording.eye import seen

NAME_SIZE = (0.3, 0.035)
"""How wide and how high a name is in the view, as shares of all arms' extent."""

SECOND = 0.2
"""How much it counts that a name stands where its arm differs from the others, beside that it can be read."""


def name_places(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return where the name of an arm may stand: at the end of each bone, or in its middle.

    Args:
        start: Where each bone starts in [m], shape (..., bones, 3).
        end: Where it ends.

    Returns:
        In [m], shape (..., 2 bones, 3).
    """
    return np.concatenate((end, (start + end) / 2), axis=-2)


def placed_names(ghosts: Sequence[FloatArray], chosen: Sequence[FloatArray]) -> list[int]:
    """Return for each ghost the place at which its name can be read, and told from those of the others.

    Names must not lie on each other: that comes first. Then a place is the better the further it is from the
    same place of every other arm.

    Args:
        ghosts: The `name_places` of each ghost in one pose in [m], shape (places, 3).
        chosen: Those of the arms that have no name.
    """
    every = seen(np.array([*ghosts, *chosen]))
    extent = float(np.linalg.norm(np.ptp(every.reshape(-1, 3), axis=0))) or 1.0
    box = np.array(NAME_SIZE) * extent
    found: list[int] = []
    for i, mine in enumerate(every[: len(ghosts)]):
        apart = np.linalg.norm(np.delete(every, i, axis=0) - mine, axis=2).min(axis=0, initial=extent)
        free = np.ones(len(mine))
        for k, place in enumerate(found):
            gap = np.abs(mine[:, :2] - every[k, place, :2]) / box
            free = np.minimum(free, gap.max(axis=1))
        found.append(int(np.argmax(free + SECOND * apart / extent)))
    return found
