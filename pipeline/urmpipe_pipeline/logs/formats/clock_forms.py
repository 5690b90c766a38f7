"""Times written as text: the known forms, and what the cells of a column mean in each.

1. A form (`ClockForm`) is a regular expression whose groups name the parts of a cell: a date, a time of day,
   a duration, or digits alone (YYYYMMDDhhmmss).
2. `find_forms` returns the forms that fit at least half of a column's cells.
3. `read_cells` reads a column in one form. Cells of one shape (equal except for their digits) have the same
   parts in the same places, so a single match suffices for all of them; the numbers are read by NumPy.

Times are integers in [ns]. Dates count from 1970 in UTC, times of day from midnight.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import BoolArray, IntArray
from urmpipe_pipeline.logs.formats.cells import (
    DECIMALS,
    MAX_CELL_LENGTH,
    MAX_NS,
    Bytes,
    TextCells,
    is_missing,
    is_number,
)
from urmpipe_pipeline.logs.vocabulary import vocabulary

EXPONENTS = {"s": 9, "ms": 6, "us": 3, "ns": 0}  # powers of ten from a unit of time to [ns]
DATE, TIME_OF_DAY, DURATION = "date", "time of day", "s"  # the units of a column of text

SECOND_NS = 10**9
DAY_NS = 86_400 * SECOND_NS

NO_TIME = np.iinfo(np.int64).min  # in place of the time of a row without one
REPORTED = NO_TIME + 1  # ... without one because of a finding that is already reported
UNREADABLE = NO_TIME + 2  # ... whose text is no time

_COUNTS = {"s": "decimals", "us": "microseconds", "ms": "milliseconds"}  # the digits after a third colon
_COUNT_NS = {"us": 1000, "ms": 10**6}
_WORDS_NS = {"sec": SECOND_NS, "s": SECOND_NS, "ms": 10**6, "us": 1000, "ns": 1}
_WORDS_NS |= {"min": 60 * SECOND_NS, "hr": 3600 * SECOND_NS, "h": 3600 * SECOND_NS}
_WORDS_NS |= dict.fromkeys(("day", "days"), DAY_NS)


class ClockForm(NamedTuple):
    """A way to write a time.

    Attributes:
        name: Its name in messages.
        unit: The unit of its column: DATE, TIME_OF_DAY or DURATION.
        pattern: A regular expression of a cell without the spaces around it.
        has_time: Whether a cell has a time, not only a date.
        keys: The units that select it where the cells may have another form as well.
        tail: The unit of the digits after a third colon: s (decimals), ms or us; ns after whole seconds.
        is_fallback: Whether it is tried only if the clock runs backwards in every other form.
    """

    name: str
    unit: str
    pattern: str
    has_time: bool = True
    keys: tuple[str, ...] = ()
    tail: str = "s"
    is_fallback: bool = False

    def match(self, cell: str) -> re.Match[str] | None:
        """Return the match of a complete cell."""
        return _compiled(self.pattern).match(cell)

    @property
    def is_partial(self) -> bool:
        """Whether a time of day in another column completes its date, or a date its time of day."""
        return self.unit == TIME_OF_DAY or not self.has_time

    def has_zone(self, cell: str) -> bool:
        """Return whether a cell has a time zone."""
        match = self.match(cell)
        return match is not None and bool(match.groupdict().get("zone"))


class _Parts:
    """The parts of cells of one shape, of which the match of one is known; cells have shape (n, length)."""

    def __init__(self, match: re.Match[str], cells: Bytes) -> None:
        self.cells = cells
        self._texts = match.groupdict()
        self._spans = {name: match.span(name) for name, text in self._texts.items() if text}

    def text(self, name: str) -> str:
        return (self._texts.get(name) or "").lower()

    def sign(self, name: str) -> int:
        return -1 if self.text(name) == "-" else 1

    def number(self, name: str) -> IntArray:
        """Return the integers of a part, 0 without it, shape (n,)."""
        numbers = np.zeros(len(self.cells), dtype=np.int64)
        for place in range(*self._spans.get(name, (0, 0))):
            numbers *= 10
            numbers += self.cells[:, place]
            numbers -= ord("0")
        return numbers

    def decimals(self, name: str) -> IntArray:
        """Return the decimals of a part, nine at most, as multiples of 1e-9, shape (n,)."""
        numbers = self.number(name)
        numbers *= 10 ** (9 - len(self.text(name)))
        return numbers


def read_cells(cells: TextCells, form: ClockForm) -> IntArray:
    """Return the times of cells in [ns], shape (n,): NO_TIME for an empty cell, UNREADABLE for no time."""
    times = np.where(np.diff(cells.starts) == 0, NO_TIME, UNREADABLE)
    for rows, block in cells.blocks():
        for places in _iter_shapes(block):
            times[rows[places]] = _read_shape(block[places], form)
    return times


def find_forms(texts: Sequence[str]) -> tuple[ClockForm, ...]:
    """Return the forms in which at least half of the cells with content are times, the usual ones first."""
    cells = TextCells.of([text for text in texts if not is_missing(text)])
    shapes = [block[places] for _, block in cells.blocks() for places in _iter_shapes(block)]
    counts = (
        sum(int(np.count_nonzero(_read_shape(shape, form) != UNREADABLE)) for shape in shapes)
        for form in FORMS
    )
    return tuple(form for form, count in zip(FORMS, counts, strict=True) if 2 * count >= len(cells) > 0)


def _iter_shapes(block: Bytes) -> Iterator[IntArray | slice]:
    """Yield the places of cells that are equal except for their digits."""
    shapes = np.where(block - np.uint8(ord("0")) < 10, np.uint8(ord("0")), block)
    keys = shapes.view(f"S{block.shape[1]}").ravel()
    rest = np.flatnonzero(keys != keys[0])
    if not len(rest):
        yield slice(None)
        return
    yield np.flatnonzero(keys == keys[0])
    rest = rest[np.argsort(keys[rest], kind="stable")]
    ordered = keys[rest]
    yield from np.split(rest, np.flatnonzero(ordered[1:] != ordered[:-1]) + 1)


def _read_shape(cells: Bytes, form: ClockForm) -> IntArray | int:
    text = cells[0].tobytes().decode("latin-1")
    match = form.match(text)
    if match is None:
        return NO_TIME if is_missing(text.strip()) else UNREADABLE
    parts = _Parts(match, cells)
    if parts.text("word"):
        times, is_valid = _read_duration(parts)
    elif form.tail == "ns":
        times, is_valid = (
            parts.number("integer") * SECOND_NS + parts.number("count"),
            np.ones(len(cells), bool),
        )
    else:
        times, is_valid = _read_time_of_day(parts, form.tail)
        if form.unit == DATE:
            days, is_date = _read_date(parts)
            minutes = parts.number("zone_hour") * 60 + parts.number("zone_minute")
            is_valid &= is_date & (times < DAY_NS)
            times += days * DAY_NS - parts.sign("ahead") * minutes * (60 * SECOND_NS)
        else:
            days = parts.number("days")
            is_valid &= days < MAX_NS // DAY_NS
            times = parts.sign("days_sign") * days * DAY_NS + parts.sign("sign") * times
    return np.where(is_valid, times, UNREADABLE)


def _read_date(parts: _Parts) -> tuple[IntArray, BoolArray]:
    """Return days since 1970, and whether they are days of the calendar within 146 years of it."""
    name = parts.text("month_name")
    month = parts.number("month") + (vocabulary().months.get(name, 0) if name else 0)
    year, day = parts.number("year"), parts.number("day")
    first = ((year - 1970) * 12 + month - 1).astype("datetime64[M]")
    dates = first.astype("datetime64[D]") + (day - 1)
    is_date = (month >= 1) & (month <= 12) & (dates.astype("datetime64[M]") == first)
    days = dates.astype(np.int64)
    return days, is_date & (np.abs(days) < MAX_NS // DAY_NS)


def _read_time_of_day(parts: _Parts, unit: str) -> tuple[IntArray, BoolArray]:
    """Return hours, minutes and seconds in [ns], and whether they are a time."""
    hour, minute, second = (parts.number(name) for name in ("hour", "minute", "second"))
    is_valid = (minute < 60) & (second < 60)
    half = parts.text("half")
    if half:
        is_valid &= (hour >= 1) & (hour <= 12)
        hour = hour % 12 + (12 if half == "p" else 0)
    total = ((hour * 60 + minute) * 60 + second) * SECOND_NS + parts.decimals("decimals")
    if unit == "s":
        return total + parts.decimals("count"), is_valid
    count, digits = parts.number("count"), len(parts.text("count"))
    is_padded = (digits > 1) & (count < 10 ** (digits - 1))  # 05 are decimals: a count is not written so
    return total + count * _COUNT_NS[unit], is_valid & ~is_padded & (count * _COUNT_NS[unit] < SECOND_NS)


def _read_duration(parts: _Parts) -> tuple[IntArray, BoolArray]:
    """Return a number with a unit in [ns], rounded once, half to even, and whether 64 bits can store it."""
    unit, integer = _WORDS_NS[parts.text("word")], parts.number("integer")
    decimals, divisor = parts.decimals("decimals") * max(unit // SECOND_NS, 1), max(SECOND_NS // unit, 1)
    low, rest = decimals // divisor, decimals % divisor
    low += (2 * rest > divisor) | ((2 * rest == divisor) & (low % 2 == 1))
    is_valid = integer < MAX_NS // unit
    return parts.sign("sign") * (np.where(is_valid, integer, 0) * unit + low), is_valid


_DECIMALS = r"(?:[.,](?P<decimals>\d{1,9}))?"
_MINUTES = r"(?P<minute>\d\d)"
_SECONDS = rf"(?P<hour>\d{{1,5}}):{_MINUTES}:(?P<second>\d\d)"
_CLOCK = rf"(?P<hour>\d{{1,5}}):{_MINUTES}(?::(?P<second>\d\d){_DECIMALS})?"
_COUNTED = rf"{_SECONDS}:(?P<count>\d{{1,9}})"
_UNPADDED = rf"{_SECONDS}[.,](?P<count>\d{{1,6}})"
_UNPADDED_NAME = "microseconds not zero-padded"
_HALF_DAY = r"(?: ?(?P<half>[ap])\.?m\.?)?"
_ZONE = r"(?P<zone> ?(?:z|utc|gmt|(?P<ahead>[+-])(?P<zone_hour>\d\d):?(?P<zone_minute>\d\d)?))?"
_YEAR, _MONTH, _DAY = r"(?P<year>\d{4})", r"(?P<month>\d{1,2})", r"(?P<day>\d{1,2})"
_GAP, _SAME_GAP = r"(?P<gap>[-/.])", r"(?P=gap)"
_DENSE_DATE = r"(?P<year>\d{4})(?P<month>\d\d)(?P<day>\d\d)"
_DATES = {
    "year first": (f"{_YEAR}{_GAP}{_MONTH}{_SAME_GAP}{_DAY}", ("ymd",)),
    "day first": (f"{_DAY}{_GAP}{_MONTH}{_SAME_GAP}{_YEAR}", ("dmy",)),
    "month first": (f"{_MONTH}{_GAP}{_DAY}{_SAME_GAP}{_YEAR}", ("mdy",)),
    "month by name": (rf"{_DAY}[-/. ]{{1,2}}(?P<month_name>[a-z]+)[-/. ]{{1,2}}{_YEAR}", ()),
    "without signs": (_DENSE_DATE, ("ymd",)),
}


def _iter_forms() -> Iterator[ClockForm]:
    between = r"(?:t|_|,? +)"
    for style, (date, keys) in _DATES.items():
        name = f"date and time, {style}"
        yield ClockForm(f"date, {style}", DATE, date, has_time=False, keys=keys)
        yield ClockForm(name, DATE, f"{date}{between}(?:{_CLOCK}){_HALF_DAY}{_ZONE}", keys=keys)
        unpadded = f"{name}, {_UNPADDED_NAME}"
        yield ClockForm(unpadded, DATE, date + between + _UNPADDED, True, keys, "us", is_fallback=True)
        for unit, what in _COUNTS.items():
            counted = f"{name}, {what} after the last colon"
            yield ClockForm(counted, DATE, date + between + _COUNTED, True, (*keys, unit), unit)
    dense = rf"(?P<hour>\d\d){_MINUTES}(?P<second>\d\d){_DECIMALS}"
    yield ClockForm("date and time, without signs", DATE, _DENSE_DATE + between + dense + _ZONE)
    yield ClockForm("time of day", TIME_OF_DAY, rf"(?P<sign>[+-]?){_CLOCK}{_HALF_DAY}")
    unpadded = f"time of day, {_UNPADDED_NAME}"
    yield ClockForm(unpadded, TIME_OF_DAY, _UNPADDED, tail="us", is_fallback=True)
    for unit, what in _COUNTS.items():
        yield ClockForm(
            f"time of day, {what} after the last colon", TIME_OF_DAY, _COUNTED, True, (unit,), unit
        )
    days = rf"(?P<days_sign>[+-]?)(?P<days>\d{{1,6}}) days?(?: \+?{_CLOCK})?"
    yield ClockForm("days, hours, minutes and seconds", DURATION, days)
    short = rf"{_MINUTES}:(?P<second>\d\d)[.,](?P<decimals>\d{{1,9}})"
    yield ClockForm("minutes and seconds", DURATION, short)
    number = rf"(?P<sign>[+-]?)(?P<integer>\d{{1,15}}){_DECIMALS} ?(?P<word>{'|'.join(_WORDS_NS)})"
    yield ClockForm("a number with its unit", DURATION, number)


@cache  # not at import: thirty patterns take 50 ms, and few logs have a clock of text
def _compiled(pattern: str) -> re.Pattern[str]:
    return re.compile(rf" *{pattern} *\Z", re.IGNORECASE | re.ASCII)


FORMS: Sequence[ClockForm] = tuple(_iter_forms())  # the usual ones first
_PATTERNS = tuple(dict.fromkeys(form.pattern for form in FORMS))  # forms may differ only in their meaning

# Forms of numbers. They are tried only if all cells of a column have them.
_THIS_CENTURY = r"(?P<year>(?:19[7-9]|20\d)\d)(?P<month>\d\d)(?P<day>\d\d)"
_DENSE_END = r"(?:[.,](?P<decimals>\d{1,9})|(?P<count>\d{3}|\d{6}))?"
DENSE_DATE = ClockForm(  # may be written with an exponent
    "date and time, digits alone",
    DATE,
    rf"{_THIS_CENTURY}(?P<hour>\d\d){_MINUTES}(?P<second>\d\d){_DENSE_END}",
)
UNPADDED_NS = ClockForm(  # 7.5000000 is 7 s and 5 ms
    "seconds, and nanoseconds not zero-padded after the point",
    DURATION,
    r"(?P<integer>\d{1,10})[.,](?P<count>0|[1-9]\d{0,8})",
    tail="ns",
)


def expand_exponent(cell: str) -> str:
    """Return a number without an exponent: 2.0200714163904e+13 as 20200714163904."""
    if "e" not in cell.lower():
        return cell
    return np.format_float_positional(float(cell.replace(",", ".")), trim="-")


def is_clock_text(cell: str) -> bool:
    """Return whether the text of a cell may be a time; a number without a unit is not."""
    if len(cell) >= MAX_CELL_LENGTH or cell[:1] not in "+-0123456789":
        return False
    if any(is_number(cell, decimal) for decimal in DECIMALS):
        return False
    return any(_compiled(pattern).match(cell) for pattern in _PATTERNS)
