"""Draw the picture of docs/plan.md: what a row with a radius is, and what an arc's variants are.

python docs/plan_figures.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.path import LineArcPath, PathRows

PICTURE = Path(__file__).resolve().parent / "pictures" / "plan.svg"
RADIUS = 0.12
CORNERS = np.array([[0.0, 0.0, 0.0], [0.45, 0.0, 0.0], [0.6, 0.4, 0.0], [0.1, 0.45, 0.0]])
"""A stop, two corners, a stop: in [m]."""

SCALE, WIDTH, HEIGHT = 330.0, 270, 230
TEXT = 'font-family="sans-serif" font-size="13"'


def panels() -> list[tuple[str, str, PathRows]]:
    """Return title, column and rows of each panel: one curve by both meanings, and the other variant."""
    corners = PathRows(CORNERS, RADIUS, corner=True)
    path = rows_to_path(corners)
    first = CORNERS.copy()
    first[path.row[path.arcs]] = path.start[path.arcs]
    away = PathRows(CORNERS, RADIUS / 2.0, corner=True, variant=np.array([2, 2, 1, 2]))
    return [
        ("corner_r: the row is the corner", "corner_r", corners),
        ("r: the row is the arc's first point", "r", PathRows(first, RADIUS)),
        ("variant 1 in row 3", "corner_r", away),
    ]


def place(points: FloatArray, column: int) -> FloatArray:
    """Return points in [m], shape (n, 3), in [px] of a panel, shape (n, 2)."""
    return np.asarray([30.0 + WIDTH * column, HEIGHT - 35.0] + SCALE * points[:, :2] * [1.0, -1.0])


def line(points: FloatArray, column: int, style: str) -> str:
    """Return a line through points in [m], shape (n, 3)."""
    written = " ".join(f"{x:.1f},{y:.1f}" for x, y in place(points, column))
    return f'<polyline points="{written}" fill="none" {style}/>'


def panel(column: int, title: str, name: str, rows: PathRows) -> list[str]:
    """Return a panel: the lines through the rows, the path, its rows with their radii."""
    path: LineArcPath = rows_to_path(rows)
    marks = [f'<text x="{15 + WIDTH * column}" y="20" {TEXT} font-weight="bold">{title}</text>']
    if rows.corner:
        marks.append(line(rows.position, column, 'stroke="#999" stroke-dasharray="5 4"'))
    curve = path.points(np.linspace(0.0, path.total, 400)).position
    marks.append(line(curve, column, 'stroke="#1f77b4" stroke-width="2.5"'))
    for k in path.arcs:
        centre = path.start[k] + path.radius[k] * path.normal[k]
        marks.append(line(np.array([centre, path.start[k]]), column, 'stroke="#999"'))
    for number, (point, radius) in enumerate(zip(rows.position, rows.radius, strict=True), start=1):
        (x, y), stop = place(point[None], column)[0], radius == 0.0
        colour, word = ("#333", "stop") if stop else ("#d62728", f"{name} {radius:g}")
        marks.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{colour}"/>')
        marks.append(
            f'<text x="{x - 12:.1f}" y="{y + 18:.1f}" {TEXT} fill="{colour}">{number}: {word}</text>'
        )
    return marks


def picture() -> str:
    """Return the drawing (SVG)."""
    width = WIDTH * len(panels()) + 40
    drawn = [mark for column, one in enumerate(panels()) for mark in panel(column, *one)]
    size = f'width="{width}" height="{HEIGHT}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {HEIGHT}" {size}>'
    return "\n".join([head, f'<rect {size} fill="#fff"/>', *drawn, "</svg>\n"])


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8")
