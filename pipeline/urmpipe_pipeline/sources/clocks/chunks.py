"""Stamps of chunks: some rows, received together, share one; how many varies from chunk to chunk.

The rows of a chunk were sampled since the chunk before, if the stamp is the time at which it was received; or
until the chunk behind, if it is that of its first row. Where the number of rows goes with the time on one
side of the stamp, that side is taken; else the stamp is that of the last row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.joint_log import GAP

LEAST_CHUNKS = 6
"""Fewer tell nothing about the time of a row."""

UNLIKE = 5.0
"""Rows of chunks are apart by the usual time, within this factor, ..."""

LEAST_LIKE = 0.9
"""... in this share of the rows; else the clock stood still, or the rate of the rows is not known."""

EVIDENT = 0.5
"""The spread of the rows' times on one side of the stamps is smaller than this share of that on the other."""


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Times spread over chunks.

    Attributes:
        t_ns: Times of the rows in integer [ns], strictly increasing, shape (n,).
        largest: The most rows in a chunk.
        chunks: How many chunks there are.
        period: Usual time between rows in [ns].
        first: Whether a stamp is that of the first row of its chunk; else of the last one.
        evident: Whether the numbers of rows tell that.
    """

    t_ns: IntArray
    largest: int
    chunks: int
    period: float
    first: bool
    evident: bool


def spread_over_chunks(stamps: IntArray) -> Spread | None:
    """Return the times of rows behind the stamps of chunks; None if these are none.

    Stamps are in integer [ns], never running backwards, shape (n,).
    """
    begins = np.flatnonzero(np.diff(stamps, prepend=stamps[0] - 1))
    counts, own = np.diff(begins, append=len(stamps)), stamps[begins]
    if len(own) < LEAST_CHUNKS:
        return None
    passed = np.diff(own).astype(np.float64)
    last_rows, first_rows = passed / counts[1:], passed / counts[:-1]
    spreads = [float(np.log(rows).std()) for rows in (last_rows, first_rows)]
    first = spreads[1] < EVIDENT * spreads[0]
    rows, weights = (first_rows, counts[:-1]) if first else (last_rows, counts[1:])
    period = _usual(rows, weights)
    like = (rows < UNLIKE * period) & (rows > period / UNLIKE)
    if weights[like].sum() < LEAST_LIKE * weights.sum():
        return None
    apart = np.minimum(rows, GAP * period)  # over a pause the rows stay together
    apart = np.append(apart, period) if first else np.append(period, apart)
    apart = np.where(apart < GAP * period, apart, period)
    within = np.arange(len(stamps)) - np.repeat(begins, counts)
    away = within if first else within - np.repeat(counts - 1, counts)
    times = stamps + np.rint(away * np.repeat(apart, counts)).astype(np.int64)
    if (np.diff(times) <= 0).any():
        return None
    evident = first or spreads[0] < EVIDENT * spreads[1]
    return Spread(times, int(counts.max()), len(own), period, first, evident)


def _usual(rows: FloatArray, weights: IntArray) -> float:
    """Return the median time between rows, of all of them: chunks count by their rows."""
    order = np.argsort(rows)
    half = np.searchsorted(np.cumsum(weights[order]), weights.sum() / 2.0)
    return float(rows[order][half])
