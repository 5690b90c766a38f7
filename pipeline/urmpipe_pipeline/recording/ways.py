"""Paths of the 3D view: lines and moving points, thinned out for drawing.

The exact data stand in the scalars. A viewer is slow with a strip a sample, so what moves does so at 50 Hz
or less, in 20,000 poses at most, and a path has as many vertices at most.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray, IntArray

POSE_PERIOD = 0.02
"""Time between two poses drawn in [s], at least."""

DASHES = 120
"""Dashes of a line that was asked for, at most."""

LEAST_DASH = 0.04
"""Least length of a dash, as a share of half the lines' extent: shorter ones run together where drawn."""

MOST = 20_000
"""Poses of the arm, and vertices of a path, at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A moving point.

    Attributes:
        t_ns: Time of each position in integer [ns], shape (m,).
        sample: Its sample, shape (m,).
        position: In [m], shape (m, 3).
    """

    t_ns: IntArray
    sample: IntArray
    position: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Gone:
    """When something that moves is no longer there: until it has a place again, nothing is drawn of it.

    Attributes:
        t_ns: Times in integer [ns], shape (g,).
        sample: The grid sample at each, shape (g,).
    """

    t_ns: IntArray
    sample: IntArray


NEVER = Gone(np.empty(0, np.int64), np.empty(0, np.int64))
"""Of what is there from its first place on."""


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """Where a point goes: as lines, and as the point that moves on them.

    Attributes:
        path: Entity of the lines.
        point: Entity of the moving point.
        colour: As #rrggbb.
        wanted: True for what was asked for: drawn broad and dashed, so that what was done shows in the gaps.
        strips: Lines, each in [m], shape (any, 3).
        track: The moving point.
        label: What the moving point is called in the view; empty for no label.
        gone: When there is no moving point.
        factor: How many times as far from the reference it is drawn as it was.
    """

    path: str
    point: str
    colour: str
    wanted: bool
    strips: tuple[FloatArray, ...]
    track: Track
    label: str = ""
    gone: Gone = NEVER
    factor: int = 1


def track_of(
    t_ns: IntArray, position: FloatArray, sample: IntArray | None = None, worst: int | None = None
) -> Track:
    """Return a moving point, thinned out for drawing.

    Args:
        t_ns: Its times in integer [ns], shape (n,).
        position: In [m], shape (n, 3).
        sample: Its grid samples, shape (n,); default: from 0.
        worst: Row that is drawn in any case.
    """
    rows = thinned(t_ns, position, worst)
    return Track(t_ns[rows], rows if sample is None else sample[rows], position[rows])


def thinned(t_ns: IntArray, values: FloatArray, worst: int | None) -> IntArray:
    """Return the rows to draw: at 50 Hz or less, the last and the worst among them, none without a value.

    Args:
        t_ns: Times in integer [ns], shape (n,).
        values: In any unit, shape (n, k); NaN where there is none.
        worst: Row that is drawn in any case.

    Returns:
        Row indices, shape (drawn,).
    """
    count = len(t_ns)
    if not count:
        return np.empty(0, dtype=np.int64)
    seconds = float(t_ns[-1] - t_ns[0]) / 1e9
    most = min(MOST, math.floor(seconds / POSE_PERIOD + 1e-6) + 1)
    step = max(1, math.ceil(count / most))
    rows = np.union1d(np.arange(0, count, step), [count - 1, worst if worst is not None else 0])
    drawn: IntArray = rows[np.isfinite(values[rows]).all(axis=1)]
    return drawn


def lines_of(
    position: FloatArray, sample: IntArray | None = None, worst: int | None = None
) -> tuple[FloatArray, ...]:
    """Return the lines through the positions, broken where a sample is missing or has no value.

    Args:
        position: In [m], shape (n, 3).
        sample: Their grid samples, shape (n,); default: one after the other.
        worst: Row that is a vertex in any case.

    Returns:
        Each in [m], shape (vertices, 3).
    """
    missing: NDArray[np.bool_] = np.asarray(~np.isfinite(position).all(axis=1))
    broken = missing[1:] | missing[:-1]
    if sample is not None:
        broken |= np.diff(sample) > 1
    cuts = np.flatnonzero(broken) + 1
    starts, ends = np.r_[0, cuts], np.r_[cuts, len(position)]
    lines = np.flatnonzero(ends - starts > 1)
    step = max(1, math.ceil(len(position) / MOST))
    return tuple(
        position[np.union1d(np.arange(start, end, step), [end - 1, *_within(worst, start, end)])]
        for start, end in zip(starts[lines].tolist(), ends[lines].tolist(), strict=True)
    )


def _within(row: int | None, start: int, end: int) -> list[int]:
    """Return the row as the only one of a list if it lies from start to end, else none."""
    return [row] if row is not None and start <= row < end else []


def dashed(strips: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """Return every second piece of the lines, all pieces equally long.

    Args:
        strips: In [m], shape (any, 3) each.

    Returns:
        In [m], shape (any, 3) each.
    """
    if not strips:
        return ()
    lengths = [np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(strip, axis=0), axis=1))] for strip in strips]
    extent = np.linalg.norm(np.ptp(np.concatenate(strips), axis=0)) / 2
    dash = max(sum(float(length[-1]) for length in lengths) / (2 * DASHES), LEAST_DASH * float(extent))
    return tuple(
        _piece(strip, length, start, start + dash)
        for strip, length in zip(strips, lengths, strict=True)
        for start in (np.arange(0.0, length[-1], 2 * dash) if dash > 0.0 else ())
    )


def _piece(strip: FloatArray, length: FloatArray, start: float, end: float) -> FloatArray:
    """Return a line from one arc length to another."""
    inner = strip[(length > start) & (length < end)]
    first, last = (np.array([np.interp(at, length, column) for column in strip.T]) for at in (start, end))
    return np.vstack((first, inner, last))
