"""Where a cycle crosses the planes of the command path: one place a plane, in their order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.iso9283.command_path import Stations
from urmpipe_pipeline.iso9283.in_order import Stage, in_order
from urmpipe_pipeline.iso9283.motion import Motion


@dataclass(frozen=True, slots=True, eq=False)
class Crossings:
    """Where a cycle crosses planes.

    Attributes:
        t: When in [s] on the cycle's own clock, shape (k,).
        point: Where in [m], shape (k, 3).
    """

    t: FloatArray
    point: FloatArray


def crossings(cycle: Motion, planes: Stations) -> Crossings | int:
    """Return where a cycle crosses planes, or the number of the first plane, from 0, that it does not reach.

    A plane is crossed in the direction of its normal, on the straight line between two rows. Of several
    crossings those are taken that follow each other in the order of the planes and are nearest to the command
    in all: a path that crosses itself or comes back keeps its planes.

    Args:
        cycle: The cycle.
        planes: Where the command path is cut.
    """
    stages: list[Stage] = []
    places: list[FloatArray] = []
    for point, normal in zip(planes.point, planes.normal, strict=True):
        height = (cycle.position - point) @ normal
        row = np.flatnonzero((height[:-1] < 0.0) & (height[1:] >= 0.0))
        share = height[row] / (height[row] - height[row + 1])
        place = cycle.position[row] + share[:, np.newaxis] * (cycle.position[row + 1] - cycle.position[row])
        t = cycle.t[row] + share * (cycle.t[row + 1] - cycle.t[row])
        stages.append((t, np.linalg.norm(place - point, axis=1)))
        places.append(place)
    chosen = in_order(stages)
    if isinstance(chosen, int):
        return chosen
    t = np.array([stage[0][k] for stage, k in zip(stages, chosen, strict=True)])
    return Crossings(t, np.array([place[k] for place, k in zip(places, chosen, strict=True)]).reshape(-1, 3))
