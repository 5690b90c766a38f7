"""Fewer points for the eye: min-max decimation, which keeps every peak exactly where it was."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from urmpipe_pipeline.joint_log import FloatArray, IntArray

POINTS = 2000
"""Points a drawn trace has at most: about two a pixel of a wide screen."""


def decimate(values: FloatArray, points: int = POINTS) -> IntArray:
    """Return the samples that a drawing of `values` needs, in order.

    The samples are cut into buckets of equal size. Of each bucket stay the first and the last sample,
    those of the least and the largest value of each column, and, if values are missing (NaN), the
    first and the last missing one, so that a gap stays a gap. A line through what stays covers the
    same pixels as the whole, as long as a bucket is not wider than a pixel.

    Args:
        values: What is drawn, shape (n,) or (n, k), any unit; NaN where there is no value.
        points: How many samples may stay (a column of a bucket counts for two, its ends for two).

    Returns:
        Indices into `values`, sorted and unique, shape (at most `points` + 2 k a bucket with a gap,).

    Source: the M4 aggregation of Jugel, Jerzak, Hackenbroich, Markl, "M4: a visualization-oriented
    time series data aggregation", PVLDB 7 (2014).
    """
    count = len(values)
    if count <= points:
        return np.arange(count, dtype=np.int64)
    columns = values.reshape(count, -1).T
    size = -(-count * (2 + 2 * len(columns)) // points)
    starts = np.arange(0, count, size, dtype=np.int64)
    ends = np.minimum(starts + size, count) - 1
    kept = [starts, ends]
    for column in columns:
        kept += _extremes(column, starts, size)
    return np.unique(np.concatenate(kept))


def _extremes(column: FloatArray, starts: IntArray, size: int) -> list[IntArray]:
    """Return where each bucket has its least and largest value, and its first and last missing ones."""
    padded = np.full(len(starts) * size, np.nan)
    padded[: len(column)] = column
    buckets = padded.reshape(len(starts), size)
    missing = np.isnan(buckets)
    least = np.where(missing, np.inf, buckets).argmin(axis=1)
    largest = np.where(missing, -np.inf, buckets).argmax(axis=1)
    return [starts + least, starts + largest, *_missing(np.isnan(column), size)]


def _missing(missing: NDArray[np.bool_], size: int) -> list[IntArray]:
    """Return the first and the last missing sample of each bucket that has one."""
    where = np.flatnonzero(missing)
    bucket = where // size
    first = where[np.diff(bucket, prepend=-1) > 0]
    last = where[np.diff(bucket, append=len(missing)) > 0]
    return [first, last]
