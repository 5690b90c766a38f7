"""Distance from a path: how far points are from its nearest point, whatever the time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from urmpipe_pipeline.joint_log import FloatArray

LONGEST = 2.0
"""A piece of the path is cut so that none is longer than this many times the mean one."""

NEAREST = 8
"""Pieces that are looked at first, those with the nearest middles."""


def distance_from_path(points: FloatArray, path: FloatArray, joined: NDArray[np.bool_]) -> FloatArray:
    """Return the distance of points from the nearest point of a path of straight pieces.

    A piece of length l whose middle is d away is at least d - l / 2 away: once the nearest piece found is
    nearer than that for all that were not looked at, it is the nearest of all.

    Args:
        points: In [m], shape (n, 3), without NaN.
        path: Vertices in [m], shape (m, 3), m > 0; those with a NaN are passed over.
        joined: Where a vertex is joined to the next by a piece of the path, shape (m - 1,).

    Returns:
        In [m], shape (n,).
    """
    from scipy.spatial import cKDTree

    start, end = _pieces(path, joined)
    tree = cKDTree((start + end) / 2)
    longest = float(np.sqrt(((end - start) ** 2).sum(axis=1).max(initial=0.0)))
    result = np.empty(len(points))
    open_: NDArray[np.intp] = np.arange(len(points))
    count = min(NEAREST, len(start))
    while len(open_):
        found, piece = tree.query(points[open_], k=np.arange(1, count + 1))
        away = np.asarray(found)
        nearest = _distance(points[open_, np.newaxis], start[piece], end[piece]).min(axis=1)
        result[open_] = nearest
        sure = (nearest <= away[:, -1] - longest / 2) | (count == len(start))
        open_ = open_[~sure]
        count = min(4 * count, len(start))
    return result


def _pieces(path: FloatArray, joined: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
    """Return start and end of the pieces, the long ones cut; a vertex alone is a piece without length."""
    known: NDArray[np.bool_] = np.asarray(np.isfinite(path).all(axis=1))
    length: FloatArray = np.asarray(np.linalg.norm(np.diff(path, axis=0), axis=1))
    real = np.flatnonzero(joined & known[1:] & known[:-1] & (length > 0.0))
    alone = _alone(known, real)
    start, step, size = path[real], path[real + 1] - path[real], length[real]
    parts = np.ceil(size / (LONGEST * size.mean())).astype(np.int64) if len(real) else np.empty(0, np.int64)
    piece: NDArray[np.intp] = np.repeat(np.arange(len(real)), parts)
    number = np.arange(len(piece)) - np.repeat(np.cumsum(parts) - parts, parts)
    share = np.column_stack((number, number + 1)) / parts[piece, np.newaxis]
    first, last = (start[piece] + share[:, [i]] * step[piece] for i in (0, 1))
    return np.vstack((first, path[alone])), np.vstack((last, path[alone]))


def _alone(known: NDArray[np.bool_], real: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the known vertices that are at no end of a piece."""
    used = np.zeros(len(known), dtype=np.bool_)
    used[real], used[real + 1] = True, True
    return np.flatnonzero(known & ~used)


def _distance(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the distance of points from straight pieces, elementwise, shape (..., 3) each."""
    along, out = end - start, points - start
    squared = (along * along).sum(axis=-1)
    share = np.clip((out * along).sum(axis=-1) / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(out - share[..., np.newaxis] * along, axis=-1))
