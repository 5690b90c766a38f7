"""Words in a drawing: how much room they take, and where they stand beside others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

WIDE, HIGH = 0.58, 1.2
"""Width of a letter and height of a line, about, for a size of letters of 1."""


class Box(NamedTuple):
    """A rectangle in pixels: its left, top, right and bottom, y down."""

    left: float
    top: float
    right: float
    bottom: float

    def shared(self, other: Box) -> float:
        """Return the area that it shares with another, in square pixels."""
        wide = min(self.right, other.right) - max(self.left, other.left)
        high = min(self.bottom, other.bottom) - max(self.top, other.top)
        return wide * high if wide > 0.0 and high > 0.0 else 0.0

    def grown(self, by: float) -> Box:
        """Return it with so many more pixels at each side."""
        return Box(self.left - by, self.top - by, self.right + by, self.bottom + by)

    def shifted(self, right: float) -> Box:
        """Return it so many pixels further to the right."""
        return Box(self.left + right, self.top, self.right + right, self.bottom)

    @property
    def middle(self) -> tuple[float, float]:
        """Its middle in pixels."""
        return (self.left + self.right) / 2.0, (self.top + self.bottom) / 2.0


def width_of(words: str, size: float) -> float:
    """Return how wide words are in pixels, about, in letters of a size in pixels."""
    return WIDE * size * len(words)


def box_about(x: float, y: float, words: str, size: float) -> Box:
    """Return the room for words about a place in pixels, in letters of a size in pixels."""
    wide, high = width_of(words, size) / 2.0, HIGH * size / 2.0
    return Box(x - wide, y - high, x + wide, y + high)


def freest(candidates: Sequence[Box], taken: Iterable[Box]) -> Box:
    """Return the first of the boxes that share least with what is taken."""
    others = list(taken)
    return min(candidates, key=lambda one: round(sum(one.shared(other) for other in others), 3))
