"""Whether two motions go along the same path in the same order, however fast."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline.iso9283.motion import Motion, apart_rows

POINTS = 150
"""Points, even in arc length, by which a path is told."""

BLOCKS = 1500
"""A motion is averaged to no more rows than twice this first: that holds its noise down."""

STEP = 0.01
"""A path goes on in steps of this share of the command's extent: what trembles, or rests, is no way."""

SURE = 8.0
"""Steps are no shorter than so many standard deviations of the noise."""

ALIKE = 0.2
"""Paths are alike if no point is further away than this share of the command's extent. Half of a square, its
other way round and the next of its corners are half an extent away or more."""


def outline(motion: Motion, extent: float) -> FloatArray:
    """Return points of a motion's path that are even in its arc length, in [m], shape (150, 3).

    Args:
        motion: The motion.
        extent: That of the command in [m].
    """
    block = max(len(motion) // BLOCKS, 1)
    first = np.arange(0, len(motion), block)
    sizes = np.diff(np.append(first, len(motion)))[:, np.newaxis]
    place = np.add.reduceat(motion.position, first, axis=0) / sizes
    path = place[apart_rows(place, max(STEP * extent, SURE * motion.noise / np.sqrt(block)))]
    along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))))
    at = np.linspace(0.0, along[-1], POINTS)
    return np.column_stack([np.interp(at, along, values) for values in path.T])


def apart(first: FloatArray, second: FloatArray) -> float:
    """Return the discrete Frechet distance of two paths in [m]: the shortest leash of two that go forward.

    d_ij = max(|a_i - b_j|, min(d_i-1,j-1, d_i-1,j, d_i,j-1)), along the diagonals.

    Args:
        first: Points a in [m], shape (n, 3).
        second: Points b in [m], shape (m, 3).

    Source: Eiter and Mannila 1994, Computing discrete Frechet distance.
    """
    n, m = len(first), len(second)
    square = (first**2).sum(axis=1)[:, np.newaxis] + (second**2).sum(axis=1) - 2.0 * first @ second.T
    distance = np.sqrt(np.maximum(square, 0.0))
    backwards = distance[:, ::-1]
    before = np.full(n + 1, np.inf)  # of the diagonal i + j - 2, by i + 1
    last = np.full(n + 1, np.inf)
    last[1] = distance[0, 0]
    for diagonal in range(1, n + m - 1):
        low, end = max(0, diagonal - m + 1), min(n, diagonal + 1)
        reach = np.minimum(np.minimum(before[low:end], last[low:end]), last[low + 1 : end + 1])
        now = np.full(n + 1, np.inf)
        now[low + 1 : end + 1] = np.maximum(backwards.diagonal(m - 1 - diagonal), reach)
        before, last = last, now
    return float(last[n])


def alike(command: Motion, motion: Motion) -> bool:
    """Tell whether a motion goes along the path of a command."""
    extent = command.extent
    return apart(outline(command, extent), outline(motion, extent)) <= ALIKE * extent
