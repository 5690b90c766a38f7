"""A path from stop to stop: pieces, each with the largest speed along it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from urmpipe_models.planning.line_arc import LineArcPath

Arcs = Literal["tangential", "total"]
ARCS: tuple[Arcs, ...] = ("tangential", "total")
"""What a largest acceleration holds on an arc: s'' alone, or sqrt(s''^2 + (s'^2 / r)^2)."""

SAME = 1e-9
"""Places along a path within this, in [m], are one: no segment is as short."""


class Piece(NamedTuple):
    """A piece of a stretch.

    Attributes:
        length: In [m].
        radius: Of an arc along which s'^2 / r counts, in [m]; infinity where it does not.
        fastest: The largest speed along it in [m/s].
    """

    length: float
    radius: float
    fastest: float


def stretches(path: LineArcPath, velocity: float, acceleration: float, arcs: Arcs) -> Iterator[list[Piece]]:
    """Yield the pieces from each stop to the next.

    Where s'' alone is held all of a stretch is one piece; else each segment is one, an arc with the largest
    speed min(v, sqrt(a r)).

    Args:
        path: The path.
        velocity: v in [m/s].
        acceleration: a in [m/s2].
        arcs: What it holds on an arc.
    """
    bounds = np.searchsorted(path.bounds, path.stops - SAME).tolist()
    for first, last in pairwise(bounds):
        if arcs == "tangential":
            yield [Piece(float(path.bounds[last] - path.bounds[first]), math.inf, velocity)]
        else:
            own = zip(path.length[first:last].tolist(), path.radius[first:last].tolist(), strict=True)
            yield [Piece(length, r, min(velocity, math.sqrt(acceleration * r))) for length, r in own]
