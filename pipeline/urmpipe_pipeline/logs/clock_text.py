"""The columns that were chosen as the time of a table, and how they make one clock.

The times of a text clock: what its cells may mean, and what the whole column decides.

All cells of one shape are read at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import IntArray
from urmpipe_models.errors import Hint, LogError, format_value
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.columns import Column
from urmpipe_pipeline.logs.formats.cells import Bytes, TextCells, is_missing, is_number
from urmpipe_pipeline.logs.formats.clock_forms import (
    DAY_NS,
    FORMS,
    IN_DIGITS,
    TIME_OF_DAY,
    Form,
    Parts,
    in_digits,
)
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.numbers import NO_TIME, REPORTED, UNREADABLE, ClockColumn, Numbers

EXPONENTS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Powers of ten from a unit to [ns]."""

OTHER_TIME = (
    Hint("time", None, "names the time column"),
    Hint("time", "none", "leaves the time column out"),
)
"""What to give where a column is not the time, or a wrong one."""

EVEN = (*OTHER_TIME, Hint("period", None, "sets the time between rows then"))
"""What to give where a time column is of no use."""


class Chosen(NamedTuple):
    """The columns of a clock.

    Attributes:
        columns: One column, or two that are added; none if there is no time.
        why: What tells that they are the time.
        rest: Of whole seconds and what goes on from them: the power of ten from the latter to [ns].
        forms: The form of each column where they are dates and times of day in digits alone.
        lasts: Whether each row has a duration, and the times are their sum.
        passed_over: Times of the side that is not read.
    """

    columns: tuple[Column, ...]
    why: str
    rest: int | None = None
    forms: tuple[Form, ...] = ()
    lasts: bool = False
    passed_over: tuple[Column, ...] = ()


MIDNIGHT_NS = DAY_NS - 3600 * 10**9
"""A time of day that falls back by this much or more has gone on over midnight."""

Combination = tuple[Form, ...]


ZONED = "form of the time with a zone"
"""The kind of the inference about dates that say their time zone."""


def timed(layout: LogTable, parts: Sequence[ClockColumn], numbers: Numbers) -> Numbers:
    """Return the numbers of a table with the times that the texts of its clock mean; others as they are.

    Raises:
        LogError: If the cells may be read in two ways and nothing in the file decides.
    """
    if not numbers.texts:
        return numbers
    texts = [_in_digits(cells, part) for cells, part in zip(numbers.texts, parts, strict=True)]
    readings, evidence = read_columns(texts, [part.forms for part in parts])
    if len(readings) > 1:
        raise _question(layout, parts, readings)
    reading = readings[0]
    if numbers.clock is not None:
        reading.times[numbers.clock == REPORTED] = REPORTED
    return replace(numbers, clock=reading.times, inferences=_said(reading, numbers.texts, evidence))


def _in_digits(cells: TextCells, part: ClockColumn) -> TextCells:
    """Return the cells of a column of dates in digits without the exponents of numbers."""
    if part.forms[0] not in IN_DIGITS or not np.isin(cells.data, list(b"eE")).any():
        return cells
    texts = [cells.text(row).strip() for row in range(len(cells))]
    numbers = [is_number(text, ".") or is_number(text, ",") for text in texts]
    return TextCells.of(in_digits(text) if n else text for text, n in zip(texts, numbers, strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """A column of text clocks, or two side by side, read in one combination of forms.

    Attributes:
        forms: The form of each column.
        times: Their sum in [ns], or NO_TIME, or UNREADABLE, shape (n,).
        nights: How often a time of day fell back over midnight.
    """

    forms: Combination
    times: IntArray
    nights: int

    @property
    def unreadable(self) -> int:
        """How many rows are no times."""
        return int(np.count_nonzero(self.times == UNREADABLE))

    @property
    def steps(self) -> IntArray:
        """Steps between the rows that have a time in [ns], shape (timed - 1,)."""
        return np.diff(self.times[self.times > UNREADABLE])

    @property
    def backwards(self) -> int:
        """How often the clock runs backwards."""
        return int(np.count_nonzero(self.steps < 0))

    @property
    def name(self) -> str:
        """What the forms are called."""
        return " and ".join(form.name for form in self.forms)


def read_columns(
    columns: Sequence[TextCells], forms: Sequence[Combination]
) -> tuple[list[Reading], list[str]]:
    """Return the readings of a clock that fit it best, and why: several if they differ and nothing decides.

    Those with the fewest cells that are no times; of these, those that run backwards in the fewest places;
    of these, one for all whose steps are the same.

    Args:
        columns: The columns, whose times are added.
        forms: The forms that each may have.
    """
    usual = [tuple(form for form in known if not form.last) for known in forms]
    readings = [_read(columns, combination) for combination in product(*usual)]
    if not any(reading.backwards == reading.unreadable == 0 for reading in readings):
        readings += [_read(columns, one) for one in product(*forms) if any(form.last for form in one)]
    fewest = min(reading.unreadable for reading in readings)
    readable = [reading for reading in readings if reading.unreadable == fewest]
    least = min(reading.backwards for reading in readable)
    forwards = [reading for reading in readable if reading.backwards == least]
    different: list[Reading] = []
    for reading in forwards:
        if not any(np.array_equal(reading.steps, other.steps) for other in different):
            different.append(reading)
    evidence = []
    if len(readable) < len(readings):
        evidence.append(_no_time(columns, readings, fewest))
    if len(forwards) < len(readable):
        evidence.append("in another form they run backwards")
    if len(different) < len(forwards):
        evidence.append(f"as {forwards[-1].name} the steps are the same")
    return different, evidence


def _no_time(columns: Sequence[TextCells], readings: Sequence[Reading], fewest: int) -> str:
    """Return the first row that is no time in the next best form: it rules that form out."""
    other = min((one for one in readings if one.unreadable > fewest), key=lambda one: one.unreadable)
    row = int(np.argmax(other.times == UNREADABLE))
    text = " ".join(cells.text(row).strip() for cells in columns)
    return f"as {other.name} {format_value(text)} in row {row + 1} is no time"


def _read(columns: Sequence[TextCells], forms: Combination) -> Reading:
    total = np.zeros(len(columns[0]), dtype=np.int64)
    parts = [read_cells(cells, form) for cells, form in zip(columns, forms, strict=True)]
    for part in parts:
        total += np.where(part > UNREADABLE, part, 0)
    for part in parts:
        total[part <= UNREADABLE] = part[part <= UNREADABLE]
    nights = 0
    if all(form.unit == TIME_OF_DAY for form in forms):
        nights = add_nights(total)
    return Reading(forms, total, nights)


def add_nights(times: IntArray) -> int:
    """Put times of day that fall back by nearly 24 h on the next day, in place; return how often.

    One that jumps ahead by as much, behind a midnight, is a row of the evening among those of the morning: it
    stays on its day, where it runs backwards.

    Args:
        times: In [ns], those from `UNREADABLE` down are none, shape (n,).
    """
    rows = np.flatnonzero(times > UNREADABLE)
    valid = times[rows]
    if not len(valid) or valid.min() < 0 or valid.max() >= DAY_NS:
        return 0
    steps = np.diff(valid, prepend=valid[0])
    days = np.cumsum((steps <= -MIDNIGHT_NS).astype(np.int64) - (steps >= MIDNIGHT_NS))
    days -= np.minimum(np.minimum.accumulate(days), 0)
    times[rows] += days * DAY_NS
    return int(days.max())


def _said(reading: Reading, columns: Sequence[TextCells], evidence: Sequence[str]) -> tuple[Inference, ...]:
    """Return what was found out about a text clock."""
    text = " ".join(cells.text(0).strip() for cells in columns)
    reasons = [f"its cells, such as {format_value(text)}", *evidence]
    dated, zoned = any(form.dated for form in reading.forms), reading.forms[-1].has_zone(columns[-1].text(0))
    if dated and not zoned:
        reasons.append("without a time zone: taken as UTC")
    kind = ZONED if dated and zoned else ""
    said = [Inference("form of the time", reading.name, "; ".join(reasons), kind, hints=(Hint("unit"),))]
    if reading.nights:
        why = "there the time of day falls back by nearly 24 h: the next day begins"
        said.append(Inference("nights passed", str(reading.nights), why))
    return tuple(said)


def _question(layout: LogTable, parts: Sequence[ClockColumn], readings: Sequence[Reading]) -> LogError:
    """Ask which of several readings is meant, for the first column in which they differ."""
    choices = list(zip(*(reading.forms for reading in readings), strict=True))
    place = next(k for k, forms in enumerate(choices) if len(set(forms)) > 1)
    names = " or ".join(dict.fromkeys(form.name for form in choices[place]))
    shared = set.intersection(*(set(form.keys) for form in choices[place]))
    keys = dict.fromkeys(key for form in choices[place] for key in form.keys if key not in shared)
    column = layout.names[parts[place].column]
    cell = layout.cells(parts[place].column)[0]
    hints = (Hint("unit", {column: key}, "specifies it") for key in keys)
    return layout.error(f"found {format_value(cell)}, which may be {names}", column, *hints, *OTHER_TIME)


def read_cells(cells: TextCells, form: Form) -> IntArray:
    """Return the times of cells in [ns], shape (n,): NO_TIME for an empty one, UNREADABLE for no time."""
    times = np.where(np.diff(cells.starts) == 0, NO_TIME, UNREADABLE)
    for rows, block in cells.blocks():
        for same in _shapes(block):
            times[rows[same]] = _read_shape(block[same], form)
    return times


def known_forms(texts: Sequence[str]) -> tuple[Form, ...]:
    """Return the forms in which at least half of the cells with content are times, the usual ones first."""
    cells = TextCells.of([text for text in texts if not is_missing(text)])
    if not len(cells):
        return ()
    alike = [block[same] for _, block in cells.blocks() for same in _shapes(block)]

    def count(form: Form) -> int:
        """Return how many cells are times of a form."""
        return sum(int(np.count_nonzero(_read_shape(some, form) != UNREADABLE)) for some in alike)

    return tuple(form for form in FORMS if 2 * count(form) >= len(cells))


def _shapes(block: Bytes) -> Iterator[IntArray | slice]:
    """Yield where cells of one length have the same signs but for their digits."""
    shapes = np.where(block - np.uint8(ord("0")) < 10, np.uint8(ord("0")), block)
    keys = shapes.view(f"S{block.shape[1]}").ravel()
    others = np.flatnonzero(keys != keys[0])
    if not len(others):
        yield slice(None)
        return
    yield np.flatnonzero(keys == keys[0])
    others = others[np.argsort(keys[others], kind="stable")]
    ordered = keys[others]
    yield from np.split(others, np.flatnonzero(ordered[1:] != ordered[:-1]) + 1)


def _read_shape(cells: Bytes, form: Form) -> IntArray | int:
    """Return the times of cells of one shape."""
    text = cells[0].tobytes().decode("latin-1")
    match = form.match(text)
    if match is None:
        return NO_TIME if is_missing(text.strip()) else UNREADABLE
    times, valid = form.nanoseconds(Parts(match, cells))
    return np.where(valid, times, UNREADABLE)
