"""A clock in two columns: whole seconds, and what goes on from them in ns, us, ms or decimals of a second.

Their names tell it, or their numbers: the second column falls back where the first one steps, and the time of
both goes on there as it does within a second.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.logs.clocks.chosen import EXPONENTS, Chosen
from urmpipe_pipeline.logs.columns.columns import Column
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.tables.whole import Whole
from urmpipe_pipeline.logs.vocabulary import vocabulary

SECOND = 1e9
"""A second in [ns]."""

EPOCH = (946_684_800.0, 4_102_444_800.0)
"""2000 to 2100 as Unix time in [s]."""

PERIODS = (0.0005, 1.0)
"""Usual periods of a log in [s]."""

SEAM = 10.0
"""Where the seconds step, the time goes on by less than this many steps within a second."""


def named_halves(columns: Sequence[Column], layout: Layout, whole: Whole) -> Iterator[Chosen]:
    """Yield columns of whole seconds, each with that of what goes on from them, by their names."""
    words, numeric = vocabulary(), [column for column in columns if not column.text]
    for first in (column for column in numeric if words.time_seconds.search(column.key)):
        stem = words.time_seconds.sub("", first.key)
        for unit, pattern in words.time_rests.items():
            for second in numeric:
                same = pattern.search(second.key) and pattern.sub("", second.key) == stem
                if same and second is not first and _are_halves(first, second, layout, whole, unit):
                    said = "seconds and decimals of them" if unit == "s" else f"seconds and {unit}"
                    yield Chosen((first, second), f"their names: {said} apart", EXPONENTS[unit])


def halves_beside(first: Column, columns: Sequence[Column], layout: Layout, whole: Whole) -> Chosen | None:
    """Return a column of whole seconds with what goes on from them beside it, by their numbers; or None.

    Where a whole log lies within a second only a Unix time is taken for seconds, and only whole numbers for
    what goes on from them; in a table with a header their name has to say so.
    """
    if not _repeats_whole(layout.numbers(first.index)):
        return None
    for second in (column for column in columns if abs(column.index - first.index) == 1 and not column.text):
        numbers = layout.numbers(second.index)
        if not numbers or min(numbers) < 0 or max(numbers) >= SECOND or min(numbers) == max(numbers):
            continue
        named = any(pattern.search(second.key) for pattern in vocabulary().time_rests.values())
        rest = rest_of(whole.values([first.index, second.index]), short=layout.header is None or named)
        if rest is not None:
            return Chosen((first, second), "whole seconds, and what goes on from them beside it", rest)
    return None


def rest_of(values: FloatArray, *, short: bool = True) -> int | None:
    """Return the power of ten from the second column to [ns], if it goes on from the seconds of the first.

    Args:
        values: Both columns, shape (n, 2).
        short: Whether they may lie within one second, which is a Unix time then.
    """
    if len(values) < 3 or not np.isfinite(values).all():
        return None
    seconds, rest = values.T
    turns, steps = np.diff(seconds), np.diff(rest)
    inside = turns == 0
    if (seconds % 1 != 0).any() or (turns < 0).any() or not inside.any() or (steps[inside] < 0).any():
        return None
    decimals = bool((rest % 1 != 0).any())
    fitting = [
        exponent
        for exponent in ((9,) if decimals else (0, 3, 6))
        if rest.min() >= 0
        and rest.max() * 10.0**exponent < SECOND
        and _goes_on(seconds, turns, steps * 10.0**exponent, short=short and not decimals)
    ]
    return fitting[0] if len(fitting) == 1 else None


def _goes_on(seconds: FloatArray, turns: FloatArray, steps: FloatArray, *, short: bool) -> bool:
    """Return whether the time goes on over the turns of a second as within it; steps are in [ns]."""
    inside = steps[turns == 0]
    usual = float(inside.mean())
    if not PERIODS[0] * SECOND < usual <= PERIODS[1] * SECOND:
        return False
    over = (turns * SECOND + steps)[turns == 1]
    if not len(over):
        return short and EPOCH[0] <= seconds[0] <= EPOCH[1]
    longest = SEAM * max(usual, float(inside[inside > 0].mean()))
    return bool((over >= 0).all()) and float(np.mean(over <= longest)) > 0.5


def _are_halves(first: Column, second: Column, layout: Layout, whole: Whole, unit: str) -> bool:
    """Return whether columns with the names of halves hold them: the second stays below a second."""
    seconds, rest = layout.numbers(first.index), layout.numbers(second.index)
    below = SECOND / 10 ** EXPONENTS[unit]
    if any(number % 1 for number in seconds) or not all(0 <= number < below for number in rest):
        return False
    if not seconds or seconds[0] != seconds[-1]:
        return True
    return bool(np.nanmax(whole.values([second.index]), initial=0.0) < below)


def _repeats_whole(numbers: Sequence[float]) -> bool:
    """Return whether numbers are whole, never fall, and some follow their like."""
    steps = np.diff(numbers)
    repeats = bool((steps >= 0).all() and (steps == 0).any())
    return repeats and not np.mod(numbers, 1).any()
