"""Clocks written as text: dates, times of day, lengths of time. Which forms there are, and what a cell means.

A form is a regular expression whose groups name the parts of a cell. Cells of one shape (the same signs but
for their digits) have the same parts at the same places: one match tells how to read all of them at once.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import IntArray
from urmpipe_pipeline.logs.formats.cells import DECIMALS, LONGEST_CELL, LONGEST_NS, is_number
from urmpipe_pipeline.logs.vocabulary import vocabulary

Flags = NDArray[np.bool_]

DATE, TIME_OF_DAY, LENGTH = "date", "time of day", "s"
"""Units of a clock's column that is text."""

SECOND_NS = 10**9
DAY_NS = 86_400 * SECOND_NS

_TAILS = {"s": "decimals", "us": "microseconds", "ms": "milliseconds"}  # the digits behind a third colon
_TAIL_NS = {"us": 1000, "ms": 10**6}
_WORDS_NS = {"sec": SECOND_NS, "s": SECOND_NS, "ms": 10**6, "us": 1000, "ns": 1}
_WORDS_NS |= {"min": 60 * SECOND_NS, "hr": 3600 * SECOND_NS, "h": 3600 * SECOND_NS}
_WORDS_NS |= dict.fromkeys(("day", "days"), DAY_NS)


class Parts:
    """The parts of cells of one shape.

    Args:
        match: The match of a form with one of the cells.
        cells: Their bytes, shape (n, length).
    """

    def __init__(self, match: re.Match[str], cells: NDArray[np.uint8]) -> None:
        self.cells = cells
        self._texts = match.groupdict()
        self._places = {name: match.span(name) for name, text in self._texts.items() if text}

    def text(self, name: str) -> str:
        """Return a part that is no number, the same in all cells: lower case, empty if it is not there."""
        return (self._texts.get(name) or "").lower()

    def sign(self, name: str) -> int:
        """Return -1 if a part is a minus, else 1."""
        return -1 if self.text(name) == "-" else 1

    def number(self, name: str) -> IntArray:
        """Return the whole numbers of a part, 0 where it is not there, shape (n,)."""
        start, end = self._places.get(name, (0, 0))
        numbers = np.zeros(len(self.cells), dtype=np.int64)
        for place in range(start, end):
            numbers *= 10
            numbers += self.cells[:, place]
            numbers -= ord("0")
        return numbers

    def billionths(self, name: str) -> IntArray:
        """Return a part of decimals, nine at the most, as a count of 1e-9, shape (n,)."""
        numbers = self.number(name)
        numbers *= 10 ** (9 - len(self._texts.get(name) or ""))
        return numbers


_UNPADDED = "microseconds not zero-padded"


@dataclass(frozen=True, slots=True)
class Form:
    """One way to write a clock.

    Attributes:
        name: What it is called.
        unit: The unit of its column: DATE, TIME_OF_DAY or LENGTH.
        pattern: What a whole cell looks like, without blanks around it.
        timed: Whether a cell holds a time, not the date alone.
        keys: The units that ask for it where its cells may be of another form as well.
        tail: What the digits behind a third colon count: s (decimals), ms or us; ns behind whole seconds.
        last: Whether it is tried only if the clock runs backwards in every other form.
    """

    name: str
    unit: str
    pattern: str
    timed: bool = True
    keys: tuple[str, ...] = ()
    tail: str = "s"
    last: bool = False

    def match(self, cell: str) -> re.Match[str] | None:
        """Return the match of a whole cell."""
        return _compiled(self.pattern).match(cell)

    @property
    def dated(self) -> bool:
        """Whether a cell holds a date."""
        return self.unit == DATE

    @property
    def half(self) -> str | None:
        """What it is half a clock of, date or time of day; None if it says all."""
        return self.unit if self.unit == TIME_OF_DAY or not self.timed else None

    def has_zone(self, cell: str) -> bool:
        """Return whether a cell says how far its clock is ahead of UTC."""
        match = self.match(cell)
        return match is not None and bool(match.groupdict().get("zone"))

    def nanoseconds(self, parts: Parts) -> tuple[IntArray, Flags]:
        """Return what cells mean in [ns], and which of them mean something, a value a cell: shape (n,).

        A date counts from 1970 in UTC (without a time zone it is taken as UTC), a time of day from midnight.
        """
        if parts.text("word"):
            return _length(parts)
        if self.tail == "ns":
            return parts.number("whole") * SECOND_NS + parts.number("count"), np.ones(len(parts.cells), bool)
        time, valid = _time(parts, self.tail)
        if not self.dated:
            days = parts.number("days")
            total = parts.sign("days_sign") * days * DAY_NS + parts.sign("sign") * time
            return total, valid & (days < LONGEST_NS // DAY_NS)
        date, real = _date(parts)
        return date * DAY_NS + time - _zone(parts), real & valid & (time < DAY_NS)


def _date(parts: Parts) -> tuple[IntArray, Flags]:
    """Return days since 1970, and which are days of the calendar within 146 years of it."""
    name = parts.text("month_name")
    month = parts.number("month") + (vocabulary().months.get(name, 0) if name else 0)
    written = (parts.number("year") * 100 + month) * 100 + parts.number("day")
    if len(written) and (written == written[0]).all():
        written = written[:1]
    few = np.sort(written)  # np.unique would import numpy.ma
    few = few[np.append(True, few[1:] != few[:-1])]
    places = np.searchsorted(few, written)
    day, real = _days_since_1970(few // 10_000, few // 100 % 100, few % 100)
    shape = (len(parts.cells),)
    return np.broadcast_to(day[places], shape), np.broadcast_to(real[places], shape)


def _days_since_1970(year: IntArray, month: IntArray, day: IntArray) -> tuple[IntArray, Flags]:
    first = ((year - 1970) * 12 + month - 1).astype("datetime64[M]")
    dates = first.astype("datetime64[D]") + (day - 1)
    days = dates.astype(np.int64)
    real = (month >= 1) & (month <= 12) & (dates.astype("datetime64[M]") == first)
    return days, real & (np.abs(days) < LONGEST_NS // DAY_NS)


def _time(parts: Parts, tail: str) -> tuple[IntArray, Flags]:
    """Return hours, minutes and seconds in [ns], and which are a time."""
    hour, minute, second = (parts.number(name) for name in ("hour", "minute", "second"))
    valid = (minute < 60) & (second < 60)
    half = parts.text("half")
    if half:
        valid &= (hour >= 1) & (hour <= 12)
        hour = hour % 12 + (12 if half == "p" else 0)
    total = ((hour * 60 + minute) * 60 + second) * SECOND_NS + parts.billionths("decimals")
    if tail == "s":
        return total + parts.billionths("count"), valid
    count, digits = parts.number("count"), len(parts.text("count"))
    padded = (digits > 1) & (count < 10 ** (digits - 1))  # 05 are decimals: a count is not written so
    return total + count * _TAIL_NS[tail], valid & ~padded & (count * _TAIL_NS[tail] < SECOND_NS)


def _zone(parts: Parts) -> IntArray:
    """Return how far the clock is ahead of UTC in [ns]."""
    minutes = parts.number("zone_hour") * 60 + parts.number("zone_minute")
    return parts.sign("ahead") * minutes * (60 * SECOND_NS)


def _length(parts: Parts) -> tuple[IntArray, Flags]:
    """Return a number with a unit behind it in [ns], rounded once, half to even, and which 64 bits hold."""
    unit, whole = _WORDS_NS[parts.text("word")], parts.number("whole")
    decimals, divisor = parts.billionths("decimals"), max(SECOND_NS // unit, 1)
    decimals *= max(unit // SECOND_NS, 1)
    low, rest = decimals // divisor, decimals % divisor
    low += (2 * rest > divisor) | ((2 * rest == divisor) & (low % 2 == 1))
    valid = whole < LONGEST_NS // unit
    return parts.sign("sign") * (np.where(valid, whole, 0) * unit + low), valid


_DECIMALS = r"(?:[.,](?P<decimals>\d{1,9}))?"
_MINUTES = r"(?P<minute>\d\d)"
_CLOCK = rf"(?P<hour>\d{{1,5}}):{_MINUTES}(?::(?P<second>\d\d){_DECIMALS})?"
_COUNTED = rf"(?P<hour>\d{{1,5}}):{_MINUTES}:(?P<second>\d\d):(?P<count>\d{{1,9}})"
_WITHOUT_ZEROS = rf"(?P<hour>\d{{1,5}}):{_MINUTES}:(?P<second>\d\d)[.,](?P<count>\d{{1,6}})"
_HALF_DAY = r"(?: ?(?P<half>[ap])\.?m\.?)?"


def _dates() -> Iterator[Form]:
    """Yield the forms of dates, alone and with a time of day."""
    dense = rf"(?P<hour>\d\d){_MINUTES}(?P<second>\d\d){_DECIMALS}"
    zone = r"(?P<zone> ?(?:z|utc|gmt|(?P<ahead>[+-])(?P<zone_hour>\d\d):?(?P<zone_minute>\d\d)?))?"
    dates = {
        "year first": (r"(?P<year>\d{4})(?P<gap>[-/.])(?P<month>\d{1,2})(?P=gap)(?P<day>\d{1,2})", "ymd"),
        "day first": (r"(?P<day>\d{1,2})(?P<gap>[-/.])(?P<month>\d{1,2})(?P=gap)(?P<year>\d{4})", "dmy"),
        "month first": (r"(?P<month>\d{1,2})(?P<gap>[-/.])(?P<day>\d{1,2})(?P=gap)(?P<year>\d{4})", "mdy"),
        "month by name": (r"(?P<day>\d{1,2})[-/. ]{1,2}(?P<month_name>[a-z]+)[-/. ]{1,2}(?P<year>\d{4})", ""),
        "without signs": (r"(?P<year>\d{4})(?P<month>\d\d)(?P<day>\d\d)", "ymd"),
    }
    between = r"(?:t|_|,? +)"
    for style, (date, key) in dates.items():
        keys = (key,) if key else ()
        yield Form(f"date, {style}", DATE, date, timed=False, keys=keys)
        whole = f"{date}{between}(?:{_CLOCK}){_HALF_DAY}{zone}"
        yield Form(f"date and time, {style}", DATE, whole, keys=keys)
        name, loose = f"date and time, {style}, {_UNPADDED}", date + between + _WITHOUT_ZEROS
        yield Form(name, DATE, loose, True, keys, "us", last=True)
        for tail, what in _TAILS.items():
            name = f"date and time, {style}, {what} behind the last colon"
            yield Form(name, DATE, date + between + _COUNTED, True, (*keys, tail), tail)
    iso = f"{dates['without signs'][0]}{between}{dense}{zone}"
    yield Form("date and time, without signs", DATE, iso)


def _times() -> Iterator[Form]:
    """Yield the forms of times of day and of lengths of time."""
    yield Form("time of day", TIME_OF_DAY, rf"(?P<sign>[+-]?){_CLOCK}{_HALF_DAY}")
    yield Form(f"time of day, {_UNPADDED}", TIME_OF_DAY, _WITHOUT_ZEROS, tail="us", last=True)
    for tail, what in _TAILS.items():
        name = f"time of day, {what} behind the last colon"
        yield Form(name, TIME_OF_DAY, _COUNTED, True, (tail,), tail)
    days = rf"(?P<days_sign>[+-]?)(?P<days>\d{{1,6}}) days?(?: \+?{_CLOCK})?"
    yield Form("days, hours, minutes and seconds", LENGTH, days)
    short = rf"{_MINUTES}:(?P<second>\d\d)[.,](?P<decimals>\d{{1,9}})"
    yield Form("minutes and seconds", LENGTH, short)
    words = "|".join(_WORDS_NS)
    number = rf"(?P<sign>[+-]?)(?P<whole>\d{{1,15}}){_DECIMALS} ?(?P<word>{words})"
    yield Form("a number with its unit", LENGTH, number)


@cache  # not at import: thirty patterns take 50 ms, and few logs have a clock of text
def _compiled(pattern: str) -> re.Pattern[str]:
    return re.compile(rf" *{pattern} *\Z", re.IGNORECASE | re.ASCII)


FORMS: Sequence[Form] = (*_dates(), *_times())
"""All forms, the usual ones first."""

_PATTERNS = tuple(dict.fromkeys(form.pattern for form in FORMS))  # some forms differ in what they mean alone


_DENSE_TAIL = r"(?:[.,](?P<decimals>\d{1,9})|(?P<count>\d{3}|\d{6}))?"

DENSE_DATE = Form(
    "date and time, digits alone",
    DATE,
    r"(?P<year>(?:19[7-9]|20\d)\d)(?P<month>\d\d)(?P<day>\d\d)"
    rf"(?P<hour>\d\d){_MINUTES}(?P<second>\d\d){_DENSE_TAIL}",
)
"""The form of a number that is a date, YYYYMMDDhhmmss: taken where a whole column holds nothing else."""

DENSE_DAY = Form(
    "date, digits alone",
    DATE,
    r"(?P<year>(?:19[7-9]|20\d)\d)(?P<month>\d\d)(?P<day>\d\d)(?:\.0*)?",
    timed=False,
)
"""The form of a number that is a day, YYYYMMDD, beside a time of day."""

DENSE_TIME = Form(
    "time of day, digits alone",
    TIME_OF_DAY,
    r"(?P<hour>\d{0,2}?)(?P<minute>\d{0,2}?)(?P<second>\d{1,2})"
    r"(?:[.,](?P<decimals>\d{1,9})|(?<=\d{6})(?P<count>\d{3}|\d{6}))?",
)
"""The form of a number that is a time of day, hhmmss, beside a day; zeros before it may be missing."""

UNPADDED_NS = Form(
    "seconds, and nanoseconds not zero-padded behind the point",
    LENGTH,
    r"(?P<whole>\d{1,10})[.,](?P<count>0|[1-9]\d{0,8})",
    tail="ns",
)
"""The form of a number that is seconds and nanoseconds: 7.5000000 is 7 s and 5 ms."""


IN_DIGITS = (DENSE_DATE, DENSE_DAY, DENSE_TIME)
"""Forms of numbers, which may be written with an exponent."""


def in_digits(cell: str) -> str:
    """Return a number with an exponent without one: 2.0200714163904e+13 as 20200714163904."""
    if "e" not in cell.lower():
        return cell
    return np.format_float_positional(float(cell.replace(",", ".")), trim="-")


def looks_like_a_clock(cell: str) -> bool:
    """Return whether the text of a cell may be a time; a number without a unit is none."""
    if len(cell) >= LONGEST_CELL or cell[:1] not in "+-0123456789":
        return False
    if any(is_number(cell, decimal) for decimal in DECIMALS):
        return False
    return any(_compiled(pattern).match(cell) for pattern in _PATTERNS)
