"""Convex solids by their outlines, and lines, as SVG: what is nearer hides what is behind."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A convex solid by its outline, or a line.

    Attributes:
        points: Corners of the solid, or vertices of the line, in [m], shape (n, 3).
        colour: Of the outline or the line, as #rrggbb.
        width: Of the outline or the line in pixels.
        fill: Of the solid, as #rrggbb; empty for a line.
        opacity: Of the fill, 0..1.
        dashed: Whether the line is.
        front: Whether it is drawn before what is not, however near that is.
        faint: Whether it is a further position: it is drawn behind all else, and its line is as transparent
            as its fill.
    """

    points: FloatArray
    colour: str
    width: float = 1.5
    fill: str = ""
    opacity: float = 1.0
    dashed: bool = False
    front: bool = False
    faint: bool = False


def drawn_pieces(
    pieces: Sequence[Piece], placed: Callable[[FloatArray], FloatArray], towards: FloatArray
) -> Iterator[str]:
    """Yield solids and lines, those behind first.

    Args:
        pieces: What is drawn.
        placed: Returns points in [m], shape (n, 3), in pixels, shape (n, 2).
        towards: The way to who looks at them [-], shape (3,).
    """

    def order(one: Piece) -> tuple[int, float]:
        return one.front - one.faint, round(float((one.points @ towards).mean()), 9)

    for one in sorted(pieces, key=order):
        dashed = ' stroke-dasharray="6 4"' if one.dashed else ""
        line = f'stroke="{one.colour}" stroke-width="{one.width:g}" stroke-linejoin="round"{dashed}'
        line += f' stroke-opacity="{one.opacity:g}"' if one.faint else ""
        if one.fill:
            way = " ".join(f"{x:.1f},{y:.1f}" for x, y in outline(placed(one.points)))
            yield f'<polygon points="{way}" fill="{one.fill}" fill-opacity="{one.opacity:g}" {line}/>'
        else:
            yield polyline(placed(one.points), line)


def outline(points: FloatArray) -> list[tuple[float, float]]:
    """Return the corners of the convex hull of points in pixels, shape (n, 2), around it.

    Source: Andrew, 1979, the monotone chain.
    """
    every = sorted({(x, y) for x, y in np.round(points, 1).tolist()})
    halves: list[list[tuple[float, float]]] = []
    for some in (every, every[::-1]):
        half: list[tuple[float, float]] = []
        for x, y in some:
            while len(half) > 1 and _left_turn(half[-2], half[-1], (x, y)) <= 0.0:
                half.pop()
            half.append((x, y))
        halves.append(half[:-1])
    return [*halves[0], *halves[1]] or every


def _left_turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return twice the area of a triangle in square pixels, negative if it is clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def polyline(points: FloatArray, style: str) -> str:
    """Return a line through points in pixels, shape (n, 2)."""
    way = " ".join(f"{x:.1f},{y:.1f}" for x, y in points[np.isfinite(points).all(axis=1)])
    return f'<polyline points="{way}" fill="none" {style}/>'
