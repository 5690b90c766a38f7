"""A chain drawn from the side and from the front: in characters, and as SVG."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise, zip_longest

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.robots.written import EXPORT_MARK

ROWS = 24
"""Height of a view in lines of text."""

MARGIN = 7
"""Columns left free at both sides of a view for labels."""

BRAILLE = 0x2800
BRAILLE_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bit of each dot of a braille character, by row and column."""

PICTURE = 480
"""Side of a view in the SVG, in pixels."""

HALO = 'stroke="white" stroke-width="4" paint-order="stroke"'
"""Keeps a label readable over a line."""


@dataclass(frozen=True, slots=True)
class View:
    """A look along one axis: which coordinates go to the right and up."""

    title: str
    right: int
    up: int


VIEWS = (View("side: x to the right, z up", 0, 2), View("front: y to the right, z up", 1, 2))


def chain_text(skeleton: NDArray[np.float64], width: int, *, unicode: bool = True) -> str:
    """Return two views of a chain in characters, beside each other where the width allows.

    Args:
        skeleton: The base and the points p1..pn in [m], shape (n + 1, 3).
        width: Columns to draw in.
        unicode: Draw with braille dots; else with ASCII alone.
    """
    beside = width >= 6 * MARGIN
    columns = (width - 3) // 2 if beside else max(width, 3 * MARGIN)
    scale = min(_scale(skeleton, view, columns - 2 * MARGIN, 2 * ROWS) for view in VIEWS)
    drawn = [_draw(skeleton, view, scale, columns, unicode) for view in VIEWS]
    bar = _scale_bar(scale, columns)
    if not beside:
        return "\n\n".join("\n".join(line.rstrip() for line in lines) for lines in drawn) + f"\n\n{bar}"
    rows = (f"{left:<{columns}}   {right}".rstrip() for left, right in zip_longest(*drawn, fillvalue=""))
    return "\n".join((*rows, "", bar))


def chain_svg(skeleton: NDArray[np.float64], title: str) -> str:
    """Return the same two views as an SVG picture.

    Args:
        skeleton: The base and the points p1..pn in [m], shape (n + 1, 3).
        title: What the picture shows.
    """
    scale = min(_scale(skeleton, view, PICTURE - 120, PICTURE - 120) for view in VIEWS)
    views = (_svg_view(skeleton, view, scale, k * PICTURE) for k, view in enumerate(VIEWS))
    size = f'width="{2 * PICTURE}" height="{PICTURE + 40}" viewBox="0 -40 {2 * PICTURE} {PICTURE + 40}"'
    return "\n".join(
        (
            f"<!-- {EXPORT_MARK} -->",
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="14">',
            f"<title>{escape(title)}</title>",
            '<rect y="-40" width="100%" height="100%" fill="white"/>',
            f'<text x="20" y="-14" font-size="18">{escape(title)}</text>',
            *(line for lines in views for line in lines),
            "</svg>\n",
        )
    )


def _scale(skeleton: NDArray[np.float64], view: View, across: float, upwards: float) -> float:
    """Return how many columns a metre may take; a row is as high as two columns are wide."""
    least = 1e-6 * (float(np.ptp(skeleton, axis=0).max()) or 1.0)
    wide, high = np.ptp(skeleton[:, [view.right, view.up]], axis=0)
    return float(min(across / max(wide, least), upwards / max(high, least)))


def _draw(skeleton: NDArray[np.float64], view: View, scale: float, columns: int, unicode: bool) -> list[str]:
    """Return the lines of one view."""
    flat = skeleton[:, [view.right, view.up]]
    low, high = flat.min(axis=0), flat.max(axis=0)
    size = high - low
    across = (columns - size[0] * scale) / 2.0 + (flat[:, 0] - low[0]) * scale
    down = (high[1] - flat[:, 1]) * scale / 2.0
    cells = np.column_stack((across, down)) + 0.125  # a level line stays in one row of dots
    rows = int(cells[:, 1].max())
    grid = _links(cells, columns, rows + 1, unicode)
    _label(grid, cells, "■" if unicode else "#", "●" if unicode else "o")
    lines = ["".join(row) for row in grid]
    return [view.title.center(columns), *lines]


def _links(cells: NDArray[np.float64], columns: int, rows: int, unicode: bool) -> list[list[str]]:
    """Return a grid of characters with a line from each point to the next."""
    dots = np.zeros((rows, columns), dtype=np.int64)
    for a, b in pairwise(cells):
        for x, y in np.linspace(a, b, 2 + int(8.0 * np.abs(b - a).max())):
            row, column = int(y), int(x)
            dots[row, column] |= BRAILLE_DOTS[int(4.0 * (y - row))][int(2.0 * (x - column))]
    return [[_character(int(bits), unicode) for bits in row] for row in dots]


def _character(bits: int, unicode: bool) -> str:
    if not bits:
        return " "
    return chr(BRAILLE + bits) if unicode else "."


def _label(grid: list[list[str]], cells: NDArray[np.float64], base: str, point: str) -> None:
    """Mark the points and write their names beside them; points of one cell share a label.

    Where there is no room for all their names, the label of a run is its first and its last: p4..p8.
    """
    names: dict[tuple[int, int], list[int]] = {}
    for k, (x, y) in enumerate(cells):
        names.setdefault((int(y), int(x)), []).append(k)
    for (row, column), here in names.items():
        grid[row][column] = point if here[0] else base
    taken = set(names)
    for (row, column), here in names.items():
        for label in _labels(here):
            place = _place(row, column, len(label), grid, taken)
            if place is not None:
                r, c = place
                grid[r][c : c + len(label)] = label
                taken.update((r, c + i) for i in range(len(label)))
                break


def _labels(points: list[int]) -> Iterator[str]:
    """Yield what points of one place may be called, the base as 0: the longest first."""
    names = [f"p{k}" if k else "base" for k in points]
    yield ",".join(names)
    if len(points) > 2 and points[-1] - points[0] == len(points) - 1:
        yield f"{names[0]}..{names[-1]}"


def _place(
    row: int, column: int, length: int, grid: list[list[str]], taken: set[tuple[int, int]]
) -> tuple[int, int] | None:
    """Return where a label near a point may begin: over as little of the lines as can be, and near."""
    sides = [(row + dr, column + dc) for dr in (0, -1, 1, -2, 2) for dc in (2, -length - 1, 4, -length - 3)]
    free = [
        (r, c) for r, c in sides if 0 <= r < len(grid) and c >= 0 and c + length <= len(grid[0])
        and taken.isdisjoint((r, c + i) for i in range(length))
    ]  # fmt: skip
    return min(free, key=lambda at: length - grid[at[0]][at[1] : at[1] + length].count(" "), default=None)


def _scale_bar(scale: float, columns: int) -> str:
    """Return a bar of a round length."""
    longest = columns / 2.0 / scale
    power = 10.0 ** math.floor(math.log10(longest))
    length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest)
    return f"|{'-' * max(round(length * scale) - 2, 0)}| {length:g} m"


def _svg_view(skeleton: NDArray[np.float64], view: View, scale: float, shift: float) -> Sequence[str]:
    flat = skeleton[:, [view.right, view.up]]
    middle = (flat.min(axis=0) + flat.max(axis=0)) / 2.0
    points = PICTURE / 2.0 + (flat - middle) * (scale, -scale) + (shift, 0.0)
    way = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    lines = [
        f'<text x="{shift + 20:g}" y="16" fill="#555">{view.title}</text>',
        f'<polyline points="{way}" fill="none" stroke="#4a7ba6" stroke-width="8" stroke-linejoin="round"/>',
    ]
    for k, (x, y) in enumerate(points):
        name, colour = (f"p{k}", "#d55e00") if k else ("base", "#222")
        lines.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="{colour}"/>')
        lines.append(f'<text x="{x + 9:.1f}" y="{y + 5:.1f}" {HALO}>{name}</text>')
    return lines
