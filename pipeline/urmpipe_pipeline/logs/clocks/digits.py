"""Dates in digits alone: 20200714163904, or 20200714 beside 163904.5."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_pipeline.logs.cells.cell import is_missing
from urmpipe_pipeline.logs.cells.text_cells import TextCells
from urmpipe_pipeline.logs.cells.text_clock import (
    DENSE_DATE,
    DENSE_DAY,
    DENSE_TIME,
    IN_DIGITS,
    Form,
    in_digits,
)
from urmpipe_pipeline.logs.clocks.chosen import Chosen
from urmpipe_pipeline.logs.clocks.text_times import read_cells
from urmpipe_pipeline.logs.columns.columns import Column
from urmpipe_pipeline.logs.tables.numbers import UNREADABLE
from urmpipe_pipeline.logs.tables.sniff import Layout

_HOURS = 10_000
"""Times of day without the zeros before them show their hours from here on: 0:59:59 is 5959."""


def dates_in_digits(columns: Sequence[Column], layout: Layout) -> Chosen | None:
    """Return the only column of dates with times, or a day and the only time of day that is beside it."""
    numeric = [column for column in columns if not column.text]
    dates = [column for column in numeric if all_are(DENSE_DATE, column, layout)]
    if len(dates) == 1:
        return Chosen((dates[0],), "its numbers are dates, YYYYMMDDhhmmss", forms=(DENSE_DATE,))
    days = [column for column in numeric if all_are(DENSE_DAY, column, layout)]
    times = [column for column in numeric if _tells_hours(column, layout)] if len(days) == 1 else []
    if len(times) == 1:
        both = (DENSE_DAY, DENSE_TIME)
        return Chosen((days[0], times[0]), "a date and a time of day in digits", forms=both)
    return None


def all_are(form: Form, column: Column, layout: Layout) -> bool:
    """Return whether all sampled cells of a column, and one at least, are times of a form."""
    if form in IN_DIGITS and not column.text:
        written = (in_digits(cell) for cell in layout.number_texts(column.index))
    else:
        written = (cell for cell in layout.cells(column.index) if not is_missing(cell))
    first = next(written, None)
    if first is None or not form.match(first):
        return False
    return bool((read_cells(TextCells.of([first, *written]), form) > UNREADABLE).all())


def _tells_hours(column: Column, layout: Layout) -> bool:
    """Return whether a column holds times of day with their hours, and not only seconds."""
    if not all_are(DENSE_TIME, column, layout):
        return False
    cells, numbers = layout.cells(column.index), layout.numbers(column.index)
    padded = all(len(cell.replace(",", ".").partition(".")[0]) >= 6 for cell in cells if not is_missing(cell))
    return (padded or min(numbers) >= _HOURS) and len(set(numbers)) > 1
