"""Which rows are drawn of what moves, and the lines through them.

The exact data stand in the scalars. A viewer is slow with a strip a sample, so what moves does so at 50 Hz
or less, in 20,000 poses at most, and a path has as many vertices at most.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.presentation.palette import value_colours
from urmpipe_pipeline.presentation.scene import BoolArray

POSE_PERIOD = 0.02
"""Time between two poses drawn in [s], at least: 50 Hz."""

MOST = 20_000
"""Poses of the arm, and vertices of a path, at most."""

LEVELS = (64, 32, 16, 8, 4)
"""Colours of a path that its values colour."""

SEEN = 0.7
"""Share of `VALUE_SCALE` that they use: what is darker is hardly seen on the viewer's dark ground."""

COLOURED = 2_000
"""Lines of such a path up to which it has many colours."""

DASHES = 120
"""Dashes of a line that was asked for, at most."""

LEAST_DASH = 0.04
"""Least length of a dash, as a share of half the lines' extent: shorter ones run together where drawn."""


def drawn_rows(
    t_ns: IntArray | None, there: BoolArray, kept: Iterable[int] = (), most: int = MOST
) -> IntArray:
    """Return the rows to draw: at 50 Hz or less, the last and those kept among them, none without a value.

    Without times the first rows are drawn: between those of every tenth, say, nothing would belong together.

    Args:
        t_ns: Times in integer [ns], shape (n,); None without times.
        there: Which rows have a value, shape (n,).
        kept: Rows that are drawn in any case.
        most: Rows at most, besides those kept.

    Returns:
        Row indices, shape (drawn,).
    """
    count = len(there)
    if not count:
        return np.empty(0, dtype=np.int64)
    if t_ns is None:
        rows = np.arange(min(count, most))
    else:
        seconds = float(t_ns[-1] - t_ns[0]) / 1e9
        poses = min(most, math.floor(seconds / POSE_PERIOD + 1e-6) + 1)
        step = max(1, math.ceil(count / poses))
        rows = np.union1d(np.arange(0, count, step), [0, count - 1])
    rows = np.union1d(rows, np.fromiter(kept, np.int64))
    drawn: IntArray = rows[there[rows]]
    return drawn


def whole_rows(values: FloatArray) -> BoolArray:
    """Return which rows of an array in any unit, shape (n, k), have all their values, shape (n,)."""
    return np.asarray(np.isfinite(values).all(axis=1))


def beginnings(there: BoolArray) -> IntArray:
    """Return the rows at which something is there and was not before, shape (b,)."""
    found: IntArray = np.flatnonzero(there & ~np.append(False, there[:-1]))
    return found


def endings(there: BoolArray) -> IntArray:
    """Return the rows at which something is no longer there, shape (e,)."""
    found: IntArray = np.flatnonzero(there[:-1] & ~there[1:]) + 1
    return found


def lines_of(
    position: FloatArray, sample: IntArray | None = None, kept: Sequence[int] = ()
) -> tuple[FloatArray, ...]:
    """Return the lines through the positions, broken where a sample is missing or has no value.

    Args:
        position: In [m], shape (n, 3).
        sample: Their row numbers, shape (n,); default: one after the other.
        kept: Rows that are vertices in any case.

    Returns:
        Each in [m], shape (vertices, 3).
    """
    missing: BoolArray = ~whole_rows(position)
    broken = missing[1:] | missing[:-1]
    if sample is not None:
        broken |= np.diff(sample) > 1
    cuts = np.flatnonzero(broken) + 1
    starts, ends = np.r_[0, cuts], np.r_[cuts, len(position)]
    lines = np.flatnonzero(ends - starts > 1)
    step = max(1, math.ceil(len(position) / MOST))
    own = np.array(sorted(kept), dtype=np.int64)
    return tuple(
        position[
            np.union1d(np.arange(start, end, step), [end - 1, *own[(own >= start) & (own < end)].tolist()])
        ]
        for start, end in zip(starts[lines].tolist(), ends[lines].tolist(), strict=True)
    )


def coloured_lines(
    position: FloatArray, values: FloatArray, kept: Sequence[int]
) -> tuple[tuple[FloatArray, ...], NDArray[np.uint8]]:
    """Return a path as lines, each in one colour of `VALUE_SCALE`, and their colours, shape (lines, 3).

    A line goes as far as its values are on one level of the scale: there are as many levels as keep the lines
    few enough.

    Args:
        position: In [m], shape (n, 3); the path is broken where it is NaN.
        values: In any unit, shape (n,).
        kept: Rows that are vertices in any case.
    """
    step = max(1, math.ceil(len(position) / MOST))
    rows = np.union1d(np.arange(0, len(position), step), [len(position) - 1, *kept]).astype(np.int64)
    there = whole_rows(position[rows])
    share = np.nan_to_num(values[rows] / (np.nanmax(values, initial=0.0) or 1.0))
    for levels in LEVELS:
        level = np.where(there, np.floor(levels * share), -1.0)
        starts = np.append(0, np.flatnonzero(np.diff(level)) + 1)
        if len(starts) <= COLOURED:
            break
    strips, shown = [], []
    for start, end in zip(starts, [*starts[1:], len(rows)], strict=True):
        last = end + 1 if end < len(rows) and there[end] else end
        if there[start] and last - start > 1:
            strips.append(position[rows[start:last]])
            shown.append(share[start:end].mean())
    return tuple(strips), value_colours(np.append(shown, 1.0 / SEEN))[:-1]


def dashed(strips: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """Return every second piece, equally long, of lines in [m], shape (any, 3); none of an endless line."""
    if not strips:
        return ()
    lengths = [np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(strip, axis=0), axis=1))] for strip in strips]
    extent = np.linalg.norm(np.ptp(np.concatenate(strips), axis=0)) / 2
    dash = max(sum(float(length[-1]) for length in lengths) / (2 * DASHES), LEAST_DASH * float(extent))
    return tuple(
        piece
        for strip, length in zip(strips, lengths, strict=True)
        for piece in (_pieces(strip, length, dash) if 0.0 < dash < np.inf else ())
    )


def _pieces(strip: FloatArray, length: FloatArray, dash: float) -> Iterator[FloatArray]:
    """Yield every second piece of a line with these arc lengths."""
    starts = np.arange(0.0, length[-1], 2 * dash)
    ends = starts + dash
    firsts, lasts = (
        np.column_stack([np.interp(at, length, one) for one in strip.T]) for at in (starts, ends)
    )
    inner = zip(
        length.searchsorted(starts, "right").tolist(), length.searchsorted(ends).tolist(), strict=True
    )
    for first, (begin, end), last in zip(firsts, inner, lasts, strict=True):
        yield np.vstack((first, strip[begin:end], last))
