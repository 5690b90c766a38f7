"""A path from stop to stop: pieces, each with the largest speed along it, and the speeds where they meet."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Literal, NamedTuple, Protocol, TypeVar

import numpy as np

from urmpipe_models.planning.line_arc import LineArcPath

Arcs = Literal["tangential", "total"]
ARCS: tuple[Arcs, ...] = ("tangential", "total")
"""What a largest acceleration holds on an arc: s'' alone, or sqrt(s''^2 + (s'^2 / r)^2)."""


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
    bounds = np.searchsorted(path.bounds, path.stops).tolist()  # a stop is a bound, to the last bit
    for first, last in pairwise(bounds):
        if arcs == "tangential":
            yield [Piece(float(path.bounds[last] - path.bounds[first]), math.inf, velocity)]
        else:
            own = zip(path.length[first:last].tolist(), path.radius[first:last].tolist(), strict=True)
            yield [Piece(length, r, min(velocity, math.sqrt(acceleration * r))) for length, r in own]


class _Limited(Protocol):
    """What has a largest speed in [m/s]."""

    @property
    def fastest(self) -> float:
        """The largest s' in [m/s]."""


AnyPiece = TypeVar("AnyPiece", bound=_Limited)


def speeds(pieces: Sequence[AnyPiece], reached: Callable[[AnyPiece, float], float]) -> list[float]:
    """Return the largest speeds in [m/s] where pieces begin, and where the last one ends, 0 at both ends.

    By one pass along the pieces, and one back.

    Args:
        pieces: From one stop to the next.
        reached: Of a piece and the speed in [m/s] at one of its ends, the largest at the other one.
    """
    found = [0.0, *(min(before.fastest, after.fastest) for before, after in pairwise(pieces)), 0.0]
    for k in range(1, len(pieces)):
        found[k] = min(found[k], reached(pieces[k - 1], found[k - 1]))
    for k in range(len(pieces) - 1, 0, -1):
        found[k] = min(found[k], reached(pieces[k], found[k + 1]))
    return found
