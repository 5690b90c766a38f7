"""Convex bodies and lines in space: what the parts of a mechanism are drawn with."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from urmpipe_models.elementwise import FloatArray

SIDES = 20
"""Sides of what is round."""

FLAT = 1e-6
"""Points are on a line, or in a plane, if they are off it by less than this share of their extent."""


def across(n: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors that are at right angles to a unit vector [-] and to each other, shape (3,)."""
    least = np.eye(3)[int(np.argmin(np.abs(n)))]
    first = np.cross(n, least)
    first /= np.linalg.norm(first)
    return first, np.asarray(np.cross(n, first))


def circle(centre: FloatArray, n: FloatArray, radius: float, sides: int = SIDES) -> FloatArray:
    """Return the corners of a polygon in [m] about a centre across a unit vector, shape (sides, 3)."""
    first, second = across(n)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    turned = np.cos(angle)[:, np.newaxis] * first + np.sin(angle)[:, np.newaxis] * second
    return np.asarray(centre + radius * turned)


def prism(corners: FloatArray, along: FloatArray) -> FloatArray:
    """Return the triangles of the prism between a convex polygon and the same one further along.

    Args:
        corners: Of the polygon, one after the other around it, in [m], shape (k, 3).
        along: From it to the other one in [m], shape (3,).

    Returns:
        Three corners in [m] of each of the 4 k - 4 triangles, shape (n, 3, 3).
    """
    other, k = corners + along, len(corners)
    following = np.roll(np.arange(k), -1)
    fan = np.stack((np.zeros(k - 2, np.intp), np.arange(1, k - 1), np.arange(2, k)), axis=1)
    sides = np.concatenate(
        (
            np.stack((corners, corners[following], other[following]), axis=1),
            np.stack((corners, other[following], other), axis=1),
        )
    )
    return np.concatenate((corners[fan[:, ::-1]], other[fan], sides))


def bar(start: FloatArray, end: FloatArray, radius: float, sides: int = SIDES) -> FloatArray:
    """Return the triangles of a round bar in [m] between two points, shape (n, 3, 3); none of one point."""
    along = end - start
    length = float(np.linalg.norm(along))
    if length == 0.0:
        return np.empty((0, 3, 3))
    return prism(circle(start, along / length, radius, sides), along)


def rod(centre: FloatArray, n: FloatArray, radius: float, length: float, sides: int = SIDES) -> FloatArray:
    """Return the triangles of a round bar in [m] about a centre along a unit vector, shape (n, 3, 3)."""
    return bar(centre - 0.5 * length * n, centre + 0.5 * length * n, radius, sides)


def box(centre: FloatArray, axes: FloatArray, size: tuple[float, float, float]) -> FloatArray:
    """Return the triangles of a box in [m], shape (12, 3, 3).

    Args:
        centre: Its middle in [m], shape (3,).
        axes: Its axes as columns, unit vectors [-], shape (3, 3).
        size: Its extent along each in [m].
    """
    x, y, z = axes.T * np.array(size)[:, np.newaxis]
    corner = centre - 0.5 * (x + y + z)
    return prism(np.array([corner, corner + x, corner + x + y, corner + y]), z)


def ball(centre: FloatArray, radius: float, sides: int = SIDES) -> FloatArray:
    """Return the triangles of a ball in [m] about a centre, shape (n, 3, 3)."""
    return np.asarray(centre + radius * _unit_ball(sides))


@cache
def _unit_ball(sides: int) -> FloatArray:
    """Return the triangles of a ball of radius 1 about 0, 0, 0 [-], shape (n, 3, 3)."""
    height = np.linspace(-0.5 * np.pi, 0.5 * np.pi, sides // 2 + 1)
    layers = [circle(np.sin(one) * _UP, _UP, float(np.cos(one)), sides) for one in height]
    parts = []
    for lower, upper in pairwise(layers):
        ahead, above = np.roll(lower, -1, axis=0), np.roll(upper, -1, axis=0)
        parts += [np.stack((lower, ahead, above), axis=1), np.stack((lower, above, upper), axis=1)]
    return np.concatenate(parts)


_UP = np.array([0.0, 0.0, 1.0])


def sheet(centre: FloatArray, n: FloatArray, size: float) -> FloatArray:
    """Return the triangles of a square in [m] about a centre across a unit vector, shape (2, 3, 3)."""
    corners = square(centre, n, size)
    return np.array([corners[[0, 1, 2]], corners[[0, 2, 3]]])


def square(centre: FloatArray, n: FloatArray, size: float) -> FloatArray:
    """Return the corners of a square in [m] about a centre across a unit vector, shape (4, 3)."""
    first, second = (0.5 * size * one for one in across(n))
    return np.array(
        [centre - first - second, centre + first - second, centre + first + second, centre - first + second]
    )


def helix(centre: FloatArray, n: FloatArray, radius: float, length: float, turns: int) -> FloatArray:
    """Return a line in [m] that winds about a unit vector, shape (k, 3)."""
    first, second = across(n)
    share = np.linspace(0.0, 1.0, SIDES * turns + 1)
    angle = 2.0 * np.pi * turns * share
    ring = np.cos(angle)[:, np.newaxis] * first + np.sin(angle)[:, np.newaxis] * second
    return np.asarray(centre + radius * ring + length * (share - 0.5)[:, np.newaxis] * n)


def hull(points: FloatArray, thickness: float) -> tuple[FloatArray, FloatArray]:
    """Return what spans three points or more in [m], shape (n, 3): a plate if they are in a plane.

    Args:
        points: Not all on one line.
        thickness: Of a plate in [m].

    Returns:
        Its triangles in [m], shape (k, 3, 3), and its outline: edges in [m], shape (m, 2, 3).
    """
    from scipy.spatial import ConvexHull

    flat, axes = principal(points)
    middle = points.mean(axis=0)
    if not flat:
        found = ConvexHull(points)
        bent = np.abs(found.equations[found.neighbors, :3] - found.equations[:, np.newaxis, :3]).max(axis=2)
        others = np.array([[1, 2], [2, 0], [0, 1]])  # the edge that faces each corner
        edges = found.simplices[:, others][bent > FLAT]
        return facing(points[found.simplices], found.equations[:, :3]), points[edges]
    plane = (points - middle) @ axes[:, :2]
    corners = points[ConvexHull(plane).vertices]
    corners -= ((corners - middle) @ axes[:, 2:]) * axes[:, 2]  # what is off the plane is rounding
    edges = np.stack((corners, np.roll(corners, -1, axis=0)), axis=1)
    return prism(corners - 0.5 * thickness * axes[:, 2], thickness * axes[:, 2]), edges


def facing(triangles: FloatArray, normals: FloatArray) -> FloatArray:
    """Return triangles, their corners counterclockwise as seen from where their normals point.

    Triangles are in [m], shape (n, 3, 3), normals [-], shape (n, 3).
    """
    ahead, beside = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    away = np.einsum("ni,ni->n", np.cross(ahead, beside), normals) < 0.0
    return np.where(away[:, np.newaxis, np.newaxis], triangles[:, ::-1], triangles)


def principal(points: FloatArray) -> tuple[bool, FloatArray]:
    """Return whether points in [m], shape (n, 3), are in a plane, and their axes as columns."""
    _, extent, rows = np.linalg.svd(points - points.mean(axis=0), full_matrices=True)
    axes = rows.T
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return len(extent) < 3 or bool(extent[2] <= FLAT * extent[0]), axes


def in_line(points: FloatArray) -> bool:
    """Return whether points in [m], shape (n, 3), are on one line."""
    extent = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return len(points) < 3 or bool(extent[1] <= FLAT * max(float(extent[0]), 1e-300))
