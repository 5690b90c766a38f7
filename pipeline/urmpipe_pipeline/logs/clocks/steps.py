"""What steps say about numbers that increase: those of a clock, or of a joint that turns one way.

A clock runs evenly, but for gaps and for how its times are rounded, or it jitters: its steps are rough. The
steps of a joint change smoothly. Only a solver with variable steps has a clock like that, and it begins at 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

import numpy as np

from urmpipe_models.elementwise import FloatArray

Steps = Literal["even", "rough", "smooth", "rounded"]
"""How numbers increase: "rounded" have few digits, and may be a joint or a clock."""

EVENLY = 0.01
"""Steps of a clock that runs evenly differ by less than this share."""

GAPS = 0.1
"""Share of its steps that may be longer: gaps."""

ROUNDED = 2.5
"""Steps that change by no more than this many times the last digit are rounded: nothing else shows ..."""

FEW = 0.05
"""... but in this share of them."""

ROUGH = 0.5
"""Steps are rough if they change from one to the next by more than this share of how far they are from the
usual one, in the median: 1.4 for noise, 0.1 or less for what is sampled ten times in its shortest period."""

MULTIPLE = 0.1
"""A multiple is one within this share, as far as FINEST tells."""

FINEST = 1e-6
"""Sizes of steps that differ by less than this share of the usual one are the same."""


def steps_of(times: Sequence[float]) -> list[float]:
    """Return the steps between times."""
    return [after - before for before, after in pairwise(times)]


def increases(times: Sequence[float]) -> bool:
    """Return whether times increase from each to the next."""
    steps = steps_of(times)
    return bool(steps) and min(steps) > 0


def runs_evenly(times: Sequence[float]) -> bool:
    """Return whether numbers increase in steps that differ by less than 1 %."""
    steps = steps_of(times)
    return len(steps) >= 2 and min(steps) > 0 and max(steps) - min(steps) <= EVENLY * max(steps)


def kind_of_steps(values: FloatArray) -> Steps:
    """Return how ten or more numbers of any unit increase, shape (n,)."""
    steps = np.diff(values)
    usual = float(np.median(steps))
    away, change = np.abs(steps - usual), np.abs(np.diff(steps))
    odd = away > FINEST * usual
    if odd.mean() <= GAPS and (steps[odd] > usual).all():
        return "even"
    digit = _last_digit(steps / usual) * usual
    line = np.linspace(values[0], values[-1], len(values))
    if np.ptp(steps) <= ROUNDED * digit and np.abs(values - line).max() <= 2 * digit:
        return "even"
    if np.mean(change > ROUNDED * digit) < FEW:
        return "rounded"
    measure = np.mean if np.median(away) <= EVENLY * usual else np.median  # of which a few are late
    rough = measure(change) > ROUGH * measure(away)
    return ("even" if away.max() <= EVENLY * usual else "rough") if rough else "smooth"


def _last_digit(sizes: FloatArray) -> float:
    """Return what all sizes of steps differ by multiples of, 0 if there is nothing; the usual size is 1."""
    apart = np.rint(np.sort(sizes) / FINEST)
    between = np.diff(apart)
    digit = between[between > 1].min(initial=np.inf)
    if not np.isfinite(digit):
        return 0.0
    multiples = (apart - apart[0]) / digit
    return float(digit * FINEST) if np.abs(multiples - np.rint(multiples)).max() < MULTIPLE else 0.0


def counts_rows(values: FloatArray, *, any_step: bool) -> bool:
    """Return whether numbers in [-], shape (n,), count rows: from 0 or 1 in steps of 1, or of any whole."""
    steps = np.diff(values)
    if (values % 1 != 0).any() or (steps != steps[0]).any():
        return False
    return any_step or (steps[0] == 1 and values[0] in (0, 1))
