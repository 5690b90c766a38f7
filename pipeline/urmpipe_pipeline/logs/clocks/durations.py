"""A duration a row instead of a time: the clock is their sum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.clocks.chosen import OTHER_TIME, Chosen
from urmpipe_pipeline.logs.clocks.steps import increases
from urmpipe_pipeline.logs.columns.columns import Column
from urmpipe_pipeline.logs.tables.numbers import UNREADABLE, Numbers
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.vocabulary import vocabulary

SUMMED = "clock-summed"
"""The kind of the warning about a clock that is the sum of durations."""


def durations(columns: Sequence[Column], layout: Layout) -> Chosen | None:
    """Return the first column that is named like a duration and holds one a row; None without one."""
    for column in columns:
        if not column.text and is_duration(column, layout):
            return Chosen((column,), "its name: one duration per row", lasts=True)
    return None


def is_duration(column: Column, layout: Layout) -> bool:
    """Return whether a column is named like a duration, and its numbers neither increase nor fall below 0."""
    numbers = layout.numbers(column.index)
    named = any(pattern.search(column.key) for pattern in vocabulary().durations)
    return named and bool(numbers) and min(numbers) >= 0 < max(numbers) and not increases(numbers)


def summed(numbers: Numbers, name: str) -> Numbers:
    """Return the numbers with the times that the durations in [ns] in place of their clock add up to.

    Each is taken as the time since the row before, so that the first one is before the first row; if the
    last one is 0 and the first is not, as the time to the row behind.
    """
    durations = numbers.clock
    if durations is None or not len(durations):
        return numbers
    known = durations > UNREADABLE
    ahead = len(durations) > 1 and known[-1] and durations[-1] == 0 < durations[0]
    times = np.cumsum(np.where(known, durations, 0))
    times = np.where(known, times - durations if ahead else times, durations)
    which = "to the row behind" if ahead else "since the row before"
    said = f"{name} is one duration per row: the time is their sum, each taken as the time {which}"
    warning = LogWarning(SUMMED, said, hints=OTHER_TIME)
    return replace(numbers, clock=times, warnings=(*numbers.warnings, warning))
