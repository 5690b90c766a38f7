"""Test contours of ISO 9283: the sections of a cube, as rows of a path."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeAlias

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.names import not_among
from urmpipe_models.planning.rows import PathRows

Axis: TypeAlias = tuple[int, int, int]

PLANES: Mapping[str, Mapping[str, tuple[Axis, Axis]]] = {
    "wall": {
        "xy": ((1, 0, 0), (0, 1, 0)),
        "xz": ((1, 0, 0), (0, 0, 1)),
        "yz": ((0, 1, 0), (0, 0, 1)),
    },
    "diagonal": {
        "c1": ((1, 0, 1), (0, 1, 0)),
        "c2": ((0, 1, 1), (-1, 0, 0)),
        "c3": ((-1, 0, 1), (0, -1, 0)),
        "c4": ((0, -1, 1), (1, 0, 0)),
    },
}
"""Sections of a cube: from its centre to the middles of two sides, u and v, in halves of its edge.

A wall section is parallel to two opposite walls and halfway between them. A diagonal section holds two
opposite edges: c2, c3 and c4 are c1 turned by 90, 180 and 270 deg about the vertical axis through the centre.
"""

CORNERS = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]], dtype=float)
"""The corners in the order of the contour, in u and v; it starts and ends at v, in the middle of a side."""


def cube_rows(
    kind: str,
    side: float,
    radius: float,
    centre: FloatArray,
    plane: str | None = None,
    rotation: FloatArray | None = None,
) -> PathRows:
    """Return the rows of the contour of a section: a row is the first tangent point of its arc.

    The corner k stands at centre + a/2 (+-u +- v), and its arc begins R before it. With R = 0 the contour
    stops at the corners.

    Args:
        kind: wall, a square a x a, or diagonal, a rectangle a x a sqrt(2).
        side: Edge of the cube, a, in [m].
        radius: Of the arcs at the corners, R, in [m].
        centre: Of the cube in [m], shape (3,).
        plane: Name of the section in `PLANES`; default: the first, xy or c1.
        rotation: How the tool is turned all along, a matrix [-], shape (3, 3); None if that is left open.

    Raises:
        OptionError: With everything that is no such contour.

    Source: [Iso9283]_ section 2, eq. 5, and section 5.
    """
    if wrong := list(cube_faults(kind, plane, side, radius)):
        raise OptionError(*wrong)
    sections = PLANES[kind]
    u, v = np.array(sections[plane or next(iter(sections))], dtype=float)
    start = np.array([0.0, 1.0])
    flat = np.vstack((start, CORNERS, start))
    corners = np.asarray(centre) + 0.5 * side * (flat[:, :1] * u + flat[:, 1:] * v)
    ahead = np.diff(corners, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    corners[1:-1] -= radius * ahead[:-1]
    return PathRows(corners, radius, rotation=rotation)


def cube_faults(kind: str, plane: str | None, side: float, radius: float) -> Iterator[Finding]:
    """Yield what is wrong with a contour.

    Args:
        kind: Of its section, a name in `PLANES`.
        plane: Name of the section; None for the first.
        side: Edge of the cube in [m]; NaN where it is not known.
        radius: Of its arcs in [m]; NaN where it is not known.
    """
    if kind not in PLANES:
        yield Finding(not_among(kind, PLANES))
    elif plane is not None and plane not in PLANES[kind]:
        yield Finding(f"plane of a {kind} section: {not_among(plane, PLANES[kind])}")
    if side <= 0.0:
        yield Finding(found=f"a = {side:g} m", allowed="more than 0")
    if radius < 0.0:
        yield Finding(found=f"r = {radius:g} m", allowed="0 or more")
    elif 0.0 < side <= 2.0 * radius:
        yield Finding(found=f"a = {side:g} m", allowed=f"more than 2 r = {2.0 * radius:g} m")
