"""Distance from a path: how far points are from its nearest point, whatever the time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.kinematics import THREADS
from urmpipe_pipeline.joint_log import FloatArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

FINER = 20_000
"""A path is cut into about so many more pieces than it has vertices, none longer than the mean of these: the
ends of short pieces alone tell which is the nearest."""

NEAREST = (4, 16, 64)
"""So many vertices nearest to a point are looked at, until it is sure; then all."""

LEAF = 64
"""Vertices in a leaf of the tree: large ones are quicker far from the path, where near ones hardly notice."""

PAIRS = 1 << 19
"""Points times vertices that are worked on at once: some tens of MB."""

MOST_PAIRS = 1 << 28
"""Points times vertices that all are looked at: some ten seconds. Only very many points where the path stands
and trembles need more."""


@dataclass(frozen=True, slots=True, eq=False)
class _Polyline:
    """A path of straight pieces.

    Attributes:
        vertex: In [m], shape (m, 3), without NaN.
        step: From each vertex to the next in [m], shape (m, 3); 0 where none joins them.
        longest: Length of the longest step in [m].
        tree: Of the vertices.
    """

    vertex: FloatArray
    step: FloatArray
    longest: float
    tree: cKDTree


def distance_from_path(points: FloatArray, path: FloatArray, joined: NDArray[np.bool_]) -> FloatArray:
    """Return the distance of points from the nearest point of a path of straight pieces.

    The nearest point of a piece is one of its ends, or the foot of a perpendicular no further than half its
    length l from the nearer end, which is a away: then the distance is at least sqrt(a^2 - l^2 / 4). Once the
    pieces at the nearest vertices come nearer than that for all other vertices, they are the nearest of all.

    Where that would take too long, as of a million points in the cloud in which a path stands and trembles,
    the nearest of the 64 looked at counts: then the distance is too large by less than l / 2.

    Args:
        points: In [m], shape (n, 3), without NaN.
        path: Vertices in [m], shape (m, 3), one of them without NaN; those with a NaN are passed over.
        joined: Where a vertex is joined to the next by a piece of the path, shape (m - 1,).

    Returns:
        In [m], shape (n,).
    """
    line = _polyline(path, joined)
    result = np.full(len(points), np.inf)
    unsure: NDArray[np.intp] = np.arange(len(points))
    for count in NEAREST:
        blocks = _blocks(unsure, count)
        unsure = np.concatenate([_look(line, points, block, count, result) for block in blocks])
    if len(unsure) * len(line.vertex) <= MOST_PAIRS:
        for block in _blocks(unsure, len(line.vertex)):
            result[block] = _distance(points[block, np.newaxis], line.vertex, line.step).min(axis=1)
    return result


def _blocks(unsure: NDArray[np.intp], count: int) -> list[NDArray[np.intp]]:
    """Return points in blocks that are worked on at once with so many vertices each; at least one block."""
    size = max(1, PAIRS // count)
    return [unsure[start : start + size] for start in range(0, max(len(unsure), 1), size)]


def _look(
    line: _Polyline, points: FloatArray, block: NDArray[np.intp], count: int, result: FloatArray
) -> NDArray[np.intp]:
    """Write the distances of a block from the pieces at the nearest vertices; return the unsure points."""
    at = points[block]
    found, near = line.tree.query(at, k=np.arange(1, count + 1), workers=THREADS)
    vertex = np.minimum(near, len(line.vertex) - 1)  # there may be fewer than asked for, infinitely far
    ahead = _distance(at[:, np.newaxis], line.vertex[vertex], line.step[vertex]).min(axis=1)
    before = vertex - 1  # of the first the last, whose step is 0
    behind = _distance(at[:, np.newaxis], line.vertex[before], line.step[before]).min(axis=1)
    nearest = np.minimum(ahead, behind)
    result[block] = nearest
    furthest = np.asarray(found)[:, -1]
    sure = nearest * nearest <= furthest * furthest - line.longest**2 / 4
    return block[np.flatnonzero(~sure)]


def _polyline(path: FloatArray, joined: NDArray[np.bool_]) -> _Polyline:
    """Return a path without unknown and repeated vertices, and its long pieces cut."""
    from scipy.spatial import cKDTree

    vertex, step = _pieces(path, joined)
    length: FloatArray = np.asarray(np.linalg.norm(step, axis=1))
    parts = np.ceil(length / max(length.sum() / (len(vertex) + FINER), np.finfo(float).tiny))
    parts = np.maximum(parts, 1).astype(np.int64)
    piece: NDArray[np.intp] = np.repeat(np.arange(len(vertex)), parts)
    number = np.arange(len(piece)) - np.repeat(np.cumsum(parts) - parts, parts)
    part = step[piece] / parts[piece, np.newaxis]
    fine = vertex[piece] + number[:, np.newaxis] * part
    return _Polyline(fine, part, float((length / parts).max()), cKDTree(fine, leafsize=LEAF))


def _pieces(path: FloatArray, joined: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
    """Return the known vertices, each once where the path stands, and the step from each to the next."""
    known: NDArray[np.bool_] = np.asarray(np.isfinite(path).all(axis=1))
    linked = joined & known[1:] & known[:-1]
    step = np.zeros_like(path)
    step[:-1][linked] = np.diff(path, axis=0)[linked]
    standing = np.append(linked & ~step[:-1].any(axis=1), False)  # the next vertex stands for it
    kept = known & ~standing
    return path[kept], step[kept]


def _distance(points: FloatArray, start: FloatArray, step: FloatArray) -> FloatArray:
    """Return the distance of points from straight pieces, elementwise, shape (..., 3) each."""
    out = points - start
    squared = np.einsum("...i,...i->...", step, step)
    along = np.einsum("...i,...i->...", out, step)
    share = np.clip(along / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
    out -= share[..., np.newaxis] * step
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", out, out)))
