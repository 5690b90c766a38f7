"""Fewer points for the eye: M4 decimation, which keeps every peak exactly where it was."""

from __future__ import annotations

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray

POINTS = 2000
"""Points a drawn trace has at most: about two a pixel of a wide screen."""

EACH = 4
"""Points that M4 keeps of a column's bucket: the first, the least, the largest and the last."""


UNEVEN = 8.0
"""Longest over shortest time between rows: from there on a bucket of time hides more than a pixel should."""


def points_for(t_ns: IntArray | None) -> int:
    """Return how many points a line may have: twice as many where it leaves its course within a few rows.

    Its rows are at times in [ns], shape (n,); None without times.
    """
    if t_ns is None or len(t_ns) < 3:
        return POINTS
    between = np.diff(t_ns[:])
    return 2 * POINTS if between.max() > UNEVEN * between.min() else POINTS


def decimate(values: FloatArray, points: int = POINTS, t: FloatArray | None = None) -> IntArray:
    """Return the samples that a drawing of `values` needs, in order.

    The samples are cut into buckets of equal size, or of equal duration if their times are given. Of
    each bucket stay the first and the last sample, those of the least and the largest value of each
    column, and, if values are missing (NaN), the first and the last missing one, so that a gap stays a
    gap. A line through what stays covers the same pixels as the whole, as long as a bucket is not wider
    than a pixel.

    Args:
        values: What is drawn, shape (n,) or (n, k), any unit; NaN where there is no value.
        points: How many samples may stay (a column of a bucket counts for two, its ends for two).
        t: Times of samples that are not evenly spaced in [s], increasing, shape (n,).

    Returns:
        Indices into `values`, sorted and unique, shape (at most `points` + 2 k a bucket with a gap,).

    Source: the M4 aggregation of Jugel, Jerzak, Hackenbroich, Markl, "M4: a visualization-oriented
    time series data aggregation", PVLDB 7 (2014).
    """
    count = len(values)
    if count <= points:
        return np.arange(count, dtype=np.int64)
    from tsdownsample import M4Downsampler

    columns = values.reshape(count, -1).T
    buckets = max(points // (2 + 2 * len(columns)), 1)
    m4 = M4Downsampler()
    kept = [np.array([0, count - 1])]
    times = () if t is None else (np.ascontiguousarray(t, np.float64),)
    for column in columns:
        # All columns share the ends of their buckets: the library cuts by the number or the times alone.
        kept.append(
            m4.downsample(*times, np.ascontiguousarray(column), n_out=EACH * buckets).astype(np.int64)
        )
        kept += _missing(column, -(-count // buckets))
    return np.unique(np.concatenate(kept))


def _missing(column: FloatArray, size: int) -> list[IntArray]:
    """Return the first and the last missing sample of each bucket that has one."""
    where = np.flatnonzero(np.isnan(column))
    bucket = where // size
    first = where[np.diff(bucket, prepend=-1) > 0]
    last = where[np.diff(bucket, append=len(column)) > 0]
    return [first, last]
