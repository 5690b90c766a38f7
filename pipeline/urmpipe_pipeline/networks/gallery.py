"""The assemblies of a network as SVG: a small picture of each, all of one scale and seen from one side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import escape_html
from urmpipe_models.networks.assembly import Assembly
from urmpipe_models.networks.file import Network
from urmpipe_pipeline.networks.parts_in_space import body_points, find_plane, parts, placed
from urmpipe_pipeline.networks.result import NetworkResult
from urmpipe_pipeline.networks.sketch import mechanism_pieces
from urmpipe_pipeline.presentation.projections import Piece, draw_sorted

SMALL_PX, HEAD_PX, ABREAST = 190.0, 44.0, 5
"""Width and height of a small picture, room for a title, and pictures beside each other."""

AZIMUTHS, ELEVATION = np.radians([-60.0, -40.0, -20.0, 20.0, 40.0, 60.0]), np.radians(28.0)
"""From where a mechanism that is not planar may be seen in the small pictures: from the front, above."""

SIDES = 8
"""Sides of what is round: the pictures are small."""

MOST = 60
"""Assemblies that have a picture; the others are counted."""


def gallery_svg(result: NetworkResult) -> str:
    """Return each assembly as a small picture with its number, all of one scale and seen from one side."""
    network, every = result.network, result.assemblies[:MOST]
    plane = find_plane(placed(network, every[0]))
    look = _look(network, every) if plane is None else plane.axes.T[:2]
    drawn = [list(mechanism_pieces(network, parts(placed(network, one, SIDES)))) for one in every]
    flat = np.concatenate([piece.points @ look.T for pieces in drawn for piece in pieces])
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = (SMALL_PX - 16.0) / float((high - low).max() or 1.0)
    rows = -(-len(every) // ABREAST)
    wide = SMALL_PX * min(ABREAST, len(every)) + 20.0
    high_px = HEAD_PX + rows * (SMALL_PX + 24.0)
    size = f'width="{wide:.0f}" height="{high_px:.0f}" viewBox="0 0 {wide:.0f} {high_px:.0f}"'
    count = len(result.assemblies)
    heading = f"{network.name}: {count} assemblies" + (f", {MOST} of them" if count > MOST else "")
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="12">',
            f"<title>{escape_html(heading)}</title>",
            '<rect width="100%" height="100%" fill="white"/>',
            f'<text x="14" y="26" font-size="17">{escape_html(heading)}</text>',
            *(
                line
                for k, pieces in enumerate(drawn)
                for line in _small(k, pieces, look, (low + high) / 2.0, scale)
            ),
            "</svg>\n",
        )
    )


def _look(network: Network, every: Sequence[Assembly]) -> FloatArray:
    """Return what goes right and up in the small pictures, shape (2, 3), so that most is seen."""
    points = np.concatenate(
        [
            body_points(at, name)
            for at in (placed(network, one) for one in every)
            for name in network.body_names
        ]
    )
    away = points - points.mean(axis=0)
    looks = [_from(azimuth) for azimuth in AZIMUTHS.tolist()]
    return max(looks, key=lambda one: float(np.linalg.svd(away @ one.T, compute_uv=False)[1]))


def _from(azimuth: float) -> FloatArray:
    """Return what goes right and up, seen from an azimuth in [rad] about z, 0 along y, shape (2, 3)."""
    c, s, low, high = np.cos(azimuth), np.sin(azimuth), np.sin(ELEVATION), np.cos(ELEVATION)
    return np.array([[c, s, 0.0], [low * -s, low * c, high]])


def _small(
    k: int, pieces: Sequence[Piece], look: FloatArray, middle: FloatArray, scale: float
) -> Iterator[str]:
    """Yield a small picture of an assembly below its title.

    Args:
        k: Its number, from 0.
        pieces: What is drawn.
        look: What goes to the right and up [-], shape (2, 3).
        middle: What stands in its middle, to the right and up in [m], shape (2,).
        scale: Pixels per [m].
    """
    left, top = 10.0 + SMALL_PX * (k % ABREAST), HEAD_PX + (SMALL_PX + 24.0) * (k // ABREAST)
    centre = np.array([left + SMALL_PX / 2.0, top + 18.0 + SMALL_PX / 2.0])

    def flat(points: FloatArray) -> FloatArray:
        """Return points in [m], shape (n, 3), in pixels, shape (n, 2)."""
        return np.asarray(centre + scale * (points @ look.T - middle) * [1.0, -1.0])

    yield f'<text x="{left + 6:.0f}" y="{top + 12:.0f}">assembly {k + 1}</text>'
    yield '<g stroke-opacity="0.8">'
    yield from draw_sorted(pieces, flat, np.cross(look[0], look[1]))
    yield "</g>"
