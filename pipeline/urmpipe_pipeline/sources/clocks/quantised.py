"""Clocks that are coarser than the samples are regular: stamps cut or rounded to a resolution.

A regular clock of period p, cut or rounded to a resolution r, has stamps within a strip of width r along a
straight line of slope p. The same holds the other way round well enough: stamps in such a strip, with no
other steps than a clock of this kind can make, are taken as those of a regular clock.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import IntArray

LEAST_SHARE = 0.1
"""Steps of the rarer kind are at least this share of all where a single lost or doubled sample could make
them: fewer are damage, not rounding."""

LEAST_CHANGES = 3
"""A clock with repeated stamps shows its period from this many changes of the stamp on."""

EVEN = 0.1
"""Ticks of a coarse clock, and the counts of rows in them, differ by less than this share. Counts may also
differ by a row at either end of a tick; of ticks with one or two rows, by one."""


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
    if len(changes) < LEAST_CHANGES or np.count_nonzero(steps == 0) < LEAST_SHARE * len(steps):
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
