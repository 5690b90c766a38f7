"""The axes of the plots: what they reach over, and in which unit."""

from __future__ import annotations

import math
from collections.abc import Iterable

from urmpipe_pipeline.presentation.figure import Figure, Panel
from urmpipe_pipeline.text import SHOWN

UNITLESS = "-"
"""What stands for the unit of a number that has none."""

MARGIN = 0.04
"""Free space above and below what is plotted, as a share of it."""

TALL, LOW = 8, 4
"""Multiples of a power of ten that the axis of a high and of a low plot has room for."""


def factor_of(panel: Panel) -> float:
    """Return what the values of a panel are multiplied by to be shown."""
    return SHOWN[panel.unit][1] if panel.small and panel.unit in SHOWN else 1.0


def shown_unit(panels: Iterable[Panel]) -> str:
    """Return the unit that panels are shown in; of several, all of them."""
    units = (SHOWN[one.unit][0] if one.small and one.unit in SHOWN else one.unit for one in panels)
    return " or ".join(unit or UNITLESS for unit in dict.fromkeys(units))


def whole_axis(figures: Iterable[Figure]) -> tuple[tuple[int, int] | None, bool]:
    """Return the first and the last time of all panels in [ns], without times their first and last row.

    None where nothing is plotted; and whether they are times.
    """
    times: list[int] = []
    rows = 0
    for panel in (panel for figure in figures for view in figure.views for panel in view.panels):
        for line in panel.lines:
            t_ns = panel.t_ns if line.t_ns is None else line.t_ns
            rows = max(rows, len(line.values))
            times += [] if t_ns is None or not len(t_ns) else [int(t_ns[0]), int(t_ns[-1])]
    if times:
        return (min(times), max(times)), True
    return ((1, rows) if rows else None), False


def span_with_numbers(low: float, high: float, most: int = TALL) -> tuple[float, float] | None:
    """Return a range for an axis on which the viewer writes more than 0; None if it has none to show.

    The viewer writes powers of ten: the multiples of the largest one in the range where they are few, else
    those of the next. So the longer side of a range whose multiples are many is drawn out to that.
    """
    low, high = min(low, 0.0), max(high, 0.0)
    longest = max(-low, high)
    if not longest or not math.isfinite(longest):
        return None
    power = 10.0 ** math.floor(math.log10(longest))
    if (high - low) / power > most:
        low, high = (low, 10.0 * power) if high >= -low else (-10.0 * power, high)
    margin = MARGIN * (high - low)
    return low - margin, high + margin
