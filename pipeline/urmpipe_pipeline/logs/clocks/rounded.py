"""Stamps that are rounded, and stamps that rows share: the times of the rows behind them.

1. A regular clock of period p, cut or rounded to a resolution r, has stamps within a strip of width r along a
   straight line of slope p. Stamps in such a strip, with no other steps than a clock of this kind can make,
   are taken as those of a regular clock (`behind_rounded`, `behind_repeated`).
2. Other rows that share a stamp are spread evenly up to the next stamp; where their numbers vary with the
   time since the stamp before, as those of received chunks do, back to that one (`spread_repeated`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.joint_log import GAP

LEAST_SHARE = 0.1
"""Steps of the rarer kind are at least this share of all where a single lost or doubled sample could make
them: fewer are damage, not rounding."""

LEAST_CHANGES = 3
"""A clock with repeated stamps shows its period from this many changes of the stamp on."""

EVEN = 0.1
"""Ticks of a coarse clock, and the counts of rows in them, differ by less than this share. Counts may also
differ by a row at either end of a tick; of ticks with one or two rows, by one."""

LEAST_STAMPS = 4
"""Fewer different stamps tell nothing about the time of a row."""

FEW, FEW_SHARE = 5, 0.1
"""More rows than these few, and than this share of all, are no single faults."""

UNLIKE = 5.0
"""Spread rows are apart by the usual time, within this factor, ..."""

LEAST_LIKE = 0.9
"""... in this share of the rows; else the clock stood still, or the rate of the rows is not known."""

EVIDENT = 0.5
"""The times between rows vary on one side of their stamps by less than this share of the other side."""


@dataclass(frozen=True, slots=True, eq=False)
class Regular:
    """A regular clock behind quantised stamps.

    Attributes:
        period: Time between rows in [ns].
        resolution: Step of the stamps in [ns].
        t_ns: Its times in integer [ns], none further from its stamp than the resolution, shape (n,).
    """

    period: float
    resolution: int
    t_ns: IntArray


def behind_rounded(stamps: IntArray) -> Regular | None:
    """Return the regular clock behind stamps that differ, such as 3, 7, 10, 13, 17 ms; None if there is none.

    Stamps are in integer [ns], strictly increasing, shape (n,).
    """
    steps = np.diff(stamps)
    if len(steps) < LEAST_CHANGES:
        return None
    shortest, longest = int(steps.min()), int(steps.max())
    if longest > 2 * shortest:
        return None
    resolution = int(np.gcd.reduce(steps))
    if longest - shortest > resolution:
        return None
    rarer = min(float(np.mean(steps == shortest)), float(np.mean(steps == longest)))
    if 2 * resolution > shortest and rarer < LEAST_SHARE:
        return None
    return _along_a_line(stamps, np.arange(len(stamps)), resolution)


def behind_repeated(stamps: IntArray) -> Regular | None:
    """Return the regular clock behind stamps that repeat about equally often; None if there is none.

    Stamps are in integer [ns], never running backwards, shape (n,).
    """
    steps = np.diff(stamps)
    changes = np.flatnonzero(steps) + 1
    if len(changes) < LEAST_CHANGES or not are_many(int(np.count_nonzero(steps == 0)), len(stamps)):
        return None
    ticks, counts = steps[changes - 1], np.diff(changes)
    resolution = int(ticks.max())
    if resolution - int(ticks.min()) > EVEN * resolution:
        return None
    mean = float(counts.mean())
    if np.ptp(counts) > max(1 if mean < 2 else 2, EVEN * mean):
        return None
    return _along_a_line(stamps, changes, resolution)


def _along_a_line(stamps: IntArray, rows: IntArray, resolution: int) -> Regular | None:
    """Return the times along the line of least squares through some rows, if all are in a strip about it.

    The strip may be wider than the resolution by the shorter of half of it and one period: the line is not
    known better than that.
    """
    origin = int(stamps[0])
    x, y = rows - rows.mean(), (stamps[rows] - origin).astype(np.float64)
    period = float(x @ y / (x @ x))
    away = (stamps - origin) - period * np.arange(len(stamps))
    lowest, highest = float(away.min()), float(away.max())
    if highest - lowest > resolution + min(period, resolution / 2.0):
        return None
    line = (lowest + highest) / 2.0 + period * np.arange(len(stamps))
    return Regular(period, resolution, np.rint(line).astype(np.int64) + origin)


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Times of rows that shared stamps.

    Attributes:
        t_ns: Times of the rows in integer [ns], strictly increasing, shape (n,).
        first: The first row that repeats the stamp before it, from 0.
        repeats: How many rows do.
        period: Usual time between rows in [ns].
        many: Whether those are no single faults.
        before: Whether they are spread back to the stamp before; else up to the next.
        assumed: Whether they are many, and their numbers do not show on which side they belong.
    """

    t_ns: IntArray
    first: int
    repeats: int
    period: float
    many: bool
    before: bool
    assumed: bool


def spread_repeated(stamps: IntArray) -> Spread | None:
    """Return the times of rows of which some share stamps; None if these tell no times.

    Stamps are in integer [ns], never running backwards, shape (n,). Over a pause the rows stay together.
    """
    begins = np.flatnonzero(np.diff(stamps, prepend=stamps[0] - 1))
    counts, own = np.diff(begins, append=len(stamps)), stamps[begins]
    if len(own) < LEAST_STAMPS:
        return None
    repeats, passed = len(stamps) - len(own), np.diff(own).astype(np.float64)
    behind, before = passed / counts[:-1], passed / counts[1:]
    even = [float(np.log(rows).std()) for rows in (behind, before)]
    many = are_many(repeats, len(stamps))
    back = many and even[1] < EVIDENT * even[0]
    apart, weights = (before, counts[1:]) if back else (behind, counts[:-1])
    period = _usual(apart, weights)
    like = (apart < UNLIKE * period) & (apart > period / UNLIKE)
    if weights[like].sum() < LEAST_LIKE * weights.sum():
        return None
    apart = np.where(apart < GAP * period, apart, period)
    apart = np.append(period, apart) if back else np.append(apart, period)
    within = np.arange(len(stamps)) - np.repeat(begins, counts)
    away = within - np.repeat(counts - 1, counts) if back else within
    times = stamps + np.rint(away * np.repeat(apart, counts)).astype(np.int64)
    if (np.diff(times) <= 0).any():
        return None
    first = int(np.argmax(np.diff(stamps) == 0)) + 1
    assumed = many and not back and even[0] >= EVIDENT * even[1]
    return Spread(times, first, repeats, period, many, back, assumed)


def are_many(count: int, rows: int) -> bool:
    """Return whether so many rows repeat a time, or run backwards, that they are no single faults."""
    return count > max(FEW, FEW_SHARE * rows)


def _usual(apart: FloatArray, weights: IntArray) -> float:
    """Return the median of times between rows, each counted by its rows."""
    order = np.argsort(apart)
    half = np.searchsorted(np.cumsum(weights[order]), weights.sum() / 2.0)
    return float(apart[order][half])
