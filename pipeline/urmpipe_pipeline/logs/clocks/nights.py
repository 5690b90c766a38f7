"""Clocks in numbers that count from midnight, and begin again there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from urmpipe_pipeline.joint_log import GAP, LogWarning
from urmpipe_pipeline.logs.clocks.chosen import EXPONENTS, OTHER_TIME
from urmpipe_pipeline.logs.clocks.clock import Clock
from urmpipe_pipeline.logs.clocks.text_times import MIDNIGHT_NS, add_nights
from urmpipe_pipeline.logs.tables.numbers import UNREADABLE, Numbers


def over_midnight(numbers: Numbers, clock: Clock) -> Numbers:
    """Return the numbers with a clock that goes on where seconds of the day begin again, as it does else."""
    times = numbers.clock
    if times is None or clock.lasts or clock.unit not in EXPONENTS or numbers.texts:
        return numbers
    if len(times) < 3 or times.min() <= UNREADABLE or np.diff(times).min() > -MIDNIGHT_NS:
        return numbers
    days = times.copy()
    add_nights(days)
    steps, back = np.diff(days), np.diff(times) <= -MIDNIGHT_NS
    if not 0 < steps[back].min() <= steps[back].max() <= GAP * np.median(steps):
        return numbers
    said = "the clock falls back by nearly 24 h, as seconds of the day do at midnight: it is taken to go on"
    warning = LogWarning("over-midnight", said, int(np.argmax(back)) + 2, hints=OTHER_TIME)
    return replace(numbers, clock=days, warnings=(*numbers.warnings, warning))
