"""A chain drawn from the side and from the front, as SVG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.robots.written import EXPORT_MARK

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


def chain_svg(skeleton: NDArray[np.float64], title: str) -> str:
    """Return two views of a chain beside each other.

    Args:
        skeleton: The base and the points p1..pn in [m], shape (n + 1, 3).
        title: What the picture shows.
    """
    sizes = [np.ptp(skeleton[:, [view.right, view.up]], axis=0).max() for view in VIEWS]
    scale = (PICTURE - 120) / float(max(sizes) or 1.0)
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
