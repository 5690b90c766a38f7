"""Whether two motions go along the same path in the same order, however fast."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_pipeline.gaps import GAP
from urmpipe_pipeline.iso9283.motion import Motion, apart_rows

POINTS = 150
"""Points, even in arc length, by which a path is told."""

BLOCKS = 1500
"""A motion is averaged to no more rows than twice this first: that holds its noise down."""

STEP = 0.01
"""A path goes on in steps of this share of the command's extent: what trembles, or rests, is no way."""

SURE = 8.0
"""Steps are no shorter than so many standard deviations of the noise."""

JUMP = 10.0
"""No arm goes so many times as far from one row to the next as it mostly does while it moves."""

ALIKE = 0.2
"""Paths are alike if no point is further away than this share of the command's extent. Half of a square, its
other way round and the next of its corners are half an extent away or more."""


def outline(motion: Motion, extent: float) -> FloatArray:
    """Return points of a motion's path that are even in its arc length, in [m], shape (150, 3).

    Args:
        motion: The motion.
        extent: That of the command in [m].
    """
    _, path = _vertices(motion, extent, len(motion))
    along = _arc_length(path)
    at = np.linspace(0.0, along[-1], POINTS)
    return np.column_stack([np.interp(at, along, values) for values in path.T])


def path_length(motion: Motion, extent: float, rows: int) -> FloatArray:
    """Return the length of the path up to each row in [m], shape (n,); noise and rests add nothing.

    A jump adds as much as a step of the path, so that it begins and ends a rest as any way does.

    Args:
        motion: The motion, perhaps of many cycles.
        extent: That of the command in [m].
        rows: Rows of one cycle, by which noise is averaged.
    """
    steps = np.diff(motion.position, axis=0)
    longest = np.where(jumps(motion), 2.0 * STEP * extent, np.inf)
    length = np.linalg.norm(steps, axis=1)
    steps *= np.minimum(longest / np.where(length > 0.0, length, 1.0), 1.0)[:, np.newaxis]
    joined = motion.position[0] + np.vstack((np.zeros((1, 3)), steps.cumsum(axis=0)))
    first, path = _vertices(replace(motion, position=joined), extent, rows)
    return _arc_length(path)[np.searchsorted(first, np.arange(len(motion)), side="right") - 1]


def _vertices(motion: Motion, extent: float, rows: int) -> tuple[IntArray, FloatArray]:
    """Return the rows, shape (k,), and the places in [m], shape (k, 3), at which a path has gone one step."""
    block = max(rows // BLOCKS, 1)
    first = np.arange(0, len(motion), block)
    sizes = np.diff(np.append(first, len(motion)))[:, np.newaxis]
    place = np.add.reduceat(motion.position, first, axis=0) / sizes
    kept = apart_rows(place, max(STEP * extent, SURE * motion.noise / np.sqrt(block)))
    return first[kept], place[kept]


def _arc_length(path: FloatArray) -> FloatArray:
    return np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))))


def jumps(motion: Motion) -> BoolArray:
    """Return whether a motion goes as far as no arm does from one row to the next, shape (n - 1,).

    A step over a gap, where rows are missing, is no jump.
    """
    if motion.slow.all():
        return np.zeros(len(motion.slow), np.bool_)
    dt, step = np.diff(motion.t), np.linalg.norm(np.diff(motion.position, axis=0), axis=1)
    return np.asarray((dt <= GAP * np.median(dt)) & (step > JUMP * np.median(step[~motion.slow])))


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
