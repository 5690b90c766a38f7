"""The unit of a clock of numbers: given, in its name, known of the source, or shown by its values.

Steps of 1 to 500 without a unit may be in s or in ms: how fast the joints would turn decides.

The clock: which column is the time, its unit or the form of its text.

Clocks in numbers that count from midnight, and begin again there.

Times in a file of their own: a column, or a row of n values as MATLAB's writematrix leaves a vector.

Of a file with more columns the user names the one with the times: FILE:COLUMN.
"""

from __future__ import annotations

import math
import os.path
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import ASSUMED_PERIOD, GAP, PASSED_OVER, Inference, LogWarning
from urmpipe_pipeline.logs.clock_columns import (
    EPOCH,
    all_are,
    given_time,
    runs_evenly,
    steps_of,
    time_columns,
)
from urmpipe_pipeline.logs.clock_text import (
    EVEN,
    EXPONENTS,
    MIDNIGHT_NS,
    OTHER_TIME,
    Chosen,
    add_nights,
    known_forms,
    read_cells,
)
from urmpipe_pipeline.logs.columns import Column, find_column, unit_hints
from urmpipe_pipeline.logs.formats.cells import LONGEST_NS, TextCells
from urmpipe_pipeline.logs.formats.clock_forms import (
    DATE,
    DENSE_DATE,
    SECOND_NS,
    TIME_OF_DAY,
    UNPADDED_NS,
    Form,
)
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.numbers import UNREADABLE, ClockColumn, Numbers
from urmpipe_pipeline.logs.formats.opening import Tables, open_tables
from urmpipe_pipeline.logs.formats.sniff import across
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.proofs import peak
from urmpipe_pipeline.logs.vocabulary import KnownSource, Unit, key, vocabulary

SHORTEST, LONGEST = 0.0005, 1.0
"""Usual periods of a log in [s]: they tell the unit of a clock that does not say it."""

_UNUSUAL, _IMPOSSIBLE = 0.0002, 1e-5
"""Periods in [s] below which a log is unusual, and below which no joint is sampled: days or hours look so."""

FAST = 30.0  # no joint turns faster [rad/s]
USUAL = 5.0  # joints of logs seldom do [rad/s]: in s instead of ms they would turn at 0.3 deg/s at most
RESTS = 0.01  # share of the largest step of all joints below which they rest
SHORTEST_MS = 5.0  # a log in ms has seldom shorter steps: 200 Hz
_S_OR_MS = (1.0, 500.0)  # steps of these lengths may be in s or in ms

_DAYS = {
    "Excel's days since 1900": ((36_526.0, 73_051.0), "(t - 25569) * 86400 is Unix time in s"),
    "MATLAB's datenum in days": ((730_486.0, 767_011.0), "(t - 719529) * 86400 is Unix time in s"),
    "Julian days": ((2_451_544.5, 2_488_069.5), "(t - 2440587.5) * 86400 is Unix time in s"),
}
"""2000 to 2100 as some count days, and what makes a Unix time of them."""

_TICKS = {
    ".NET's ticks of 100 ns": ((6.308e17, 6.624e17), "(t - 621355968000000000) / 10 is Unix time in us"),
    "Windows' ticks of 100 ns": ((1.259e17, 1.575e17), "(t - 116444736000000000) / 10 is Unix time in us"),
}
"""The same in ticks."""

_SECONDS_A_DAY = 86_400.0

_UNITS = ", ".join(EXPONENTS)

Found = tuple[str, str, tuple[LogWarning, ...]]
"""A unit, why, and what a person should know."""


def unit_of(
    time: Column,
    layout: LogTable,
    source: KnownSource | None,
    units: Mapping[int, Unit],
    *,
    lasts: bool = False,
) -> Found:
    """Return the unit of a time column, why, and a warning if it is assumed.

    Args:
        time: The column.
        layout: How its table is written.
        source: What is known of the source.
        units: Units given by the user, by the column's number.
        lasts: Whether it holds durations, not times.

    Raises:
        LogError: If it is a unit that is not read, or cannot be told.
        OptionError: If it is given as one that is no time.
    """
    given = units.get(time.number)
    if given is not None:
        if given.name not in EXPONENTS:
            found = f"{given.name} for the time {format_value(time.name)}"
            raise OptionError(Finding(parameter="unit", found=found, allowed=_UNITS, hints=OTHER_TIME))
        return given.name, "given as an option", ()
    named = time.unit or vocabulary().unit(time.key)  # "seconds" has no other name
    if named is not None and named.name in EXPONENTS:
        return named.name, "its name", ()
    long = time.unit_text or time.key.rpartition("_")[2]
    if long.lower() in vocabulary().long_times:
        message = f"found the unit {format_value(long)}, allowed: {_UNITS}; convert the times"
        raise layout.error(message, time.header, *EVEN)
    if source is not None and "time" in source.units:
        return source.units["time"].name, f"{source.name} writes {source.units['time'].name}", ()
    return _by_values(time, layout, lasts=lasts)


def _by_values(time: Column, layout: LogTable, *, lasts: bool) -> Found:
    """Tell the unit by the year that the times give, or else by their steps; durations are steps."""
    times = layout.numbers(time.index)
    start = 0.0 if lasts or not times else times[0]
    steps = sorted(step for step in (times if lasts else steps_of(times)) if step > 0)
    step = steps[len(steps) // 2] if steps else 0.0
    likely = [u for u, e in EXPONENTS.items() if SHORTEST < step * 10.0 ** (e - 9) <= LONGEST]
    epoch = _since_1970(start, step)
    if epoch is not None and not (likely and step * 10.0 ** (EXPONENTS[epoch] - 9) > LONGEST):
        return epoch, "it counts from 1970, so as Unix time it is of our years", ()
    if epoch is not None:
        raise _question(time, layout, f"times of our years in steps of {step:g}", [epoch, *likely])
    _refuse_other_epochs(time, layout, start, step)
    if step <= SHORTEST:
        return _short(time, layout, step)
    evidence = f"its steps of {step:g}"
    if likely == ["ms"] and any(number % 1 for number in times):
        return "s", evidence, (_assumed(time, step),)
    if len(likely) == 1:
        return likely[0], evidence, ()
    if "s" in likely:
        return "s", evidence, (_assumed(time, step),)
    raise _question(time, layout, f"steps of {step:g}", likely or list(EXPONENTS))


def unit_by_speed(
    time: Column, layout: LogTable, speed: Callable[[], float | None], *, lasts: bool
) -> Found | None:
    """Return s or ms by how fast the joints would turn; None if the steps show it.

    Args:
        time: The column; only its steps show its unit.
        layout: How its table is written.
        speed: Returns the joints' speed as if it were in s, in [rad/s]; None if none of them moves.
        lasts: Whether it holds durations, not times.

    Raises:
        LogError: If it may be either.
    """
    times = layout.numbers(time.index)
    steps = sorted(step for step in (times if lasts else steps_of(times)) if step > 0)
    step = steps[len(steps) // 2] if steps else 0.0
    since_1970 = not lasts and bool(times) and _since_1970(times[0], step)
    if since_1970 or not _S_OR_MS[0] <= step <= _S_OR_MS[1]:
        return None
    integers, in_s = not any(number % 1 for number in times), speed()
    if in_s is None:
        turn, unit = "no joint moves", "ms" if integers and step >= SHORTEST_MS else "s"
    else:
        turn = f"the joints turn at up to {1e3 * in_s:.2g} rad/s as ms, at {in_s:.2g} rad/s as s"
        usual = 1e3 * in_s <= USUAL
        unit = "s" if 1e3 * in_s > FAST or not (integers or usual) else "ms" if integers and usual else ""
    if not unit or (unit == "ms" and step < SHORTEST_MS):
        raise _question(time, layout, f"{'whole ' * integers}steps of {step:g} ({turn})", ["s", "ms"])
    return unit, f"its steps of {step:g}, and {turn}", (_assumed(time, step, unit, f", since {turn}"),)


def speed_of(q: FloatArray, passed: FloatArray) -> float | None:
    """Return how fast the joints turn in nine of ten rows in which they move, in [rad/s]; None if none moves.

    Their steps are in [rad], shape (n, joints), and take so many [s], shape (n,).
    """
    size = np.fmax.reduce(np.abs(q), axis=1, initial=0.0)
    moves = (size > RESTS * np.fmax.reduce(size, initial=0.0)) & (passed > 0)
    speeds = np.sort(size[moves] / passed[moves])
    return float(speeds[int(0.9 * (len(speeds) - 1))]) if len(speeds) else None


def in_si(
    values: FloatArray, joints: Sequence[Column], units: Mapping[int, Unit], source: KnownSource | None
) -> tuple[FloatArray, FloatArray]:
    """Return joint values in [rad] or [m], and a turn of each joint, shape (joints,): 0 where it slides.

    By the units of the columns; without one, values beyond a turn in rad are taken as deg. They are in
    the file's own units, shape (..., joints).
    """
    angle = source.units.get("angle") if source else None
    beyond = peak(values.reshape(-1, values.shape[-1])) > FULL_TURN
    usual = angle or vocabulary().units["deg" if beyond else "rad"]
    each = [units.get(joint.number) or units.get(0) or joint.unit or usual for joint in joints]
    slides = np.array([unit.quantity == "length" for unit in each])
    return values * [unit.factor for unit in each], np.where(slides, 0.0, FULL_TURN)


def _refuse_other_epochs(time: Column, layout: LogTable, start: float, step: float) -> None:
    """Raise if times of our years count days, or ticks of 100 ns, from another year than 1970."""
    in_days = 0.0 < step * _SECONDS_A_DAY <= 20 * LONGEST
    in_ticks = SHORTEST < step * 1e-7 <= 20 * LONGEST
    kinds = (_DAYS if in_days else {}) | (_TICKS if in_ticks else {})
    for kind, ((first, last), cure) in kinds.items():
        if first <= start <= last:
            message = f"found {start:.15g} in steps of {step:.3g}, as {kind}, allowed: times in {_UNITS}"
            hints = unit_hints([time], "s" if in_days else "ns", "keeps them unchanged")
            raise layout.error(f"{message}; convert them: {cure}", time.header, *hints, *EVEN)


def _since_1970(start: float, step: float) -> str | None:
    """Return the unit in which a time is a Unix time of our years, if there is one."""
    for unit, exponent in EXPONENTS.items():
        scale = 10.0 ** (exponent - 9)
        if EPOCH[0] <= start * scale <= EPOCH[1] and step * scale <= 20 * LONGEST:
            return unit
    return None


def _short(time: Column, layout: LogTable, step: float) -> Found:
    """Return s for short steps, or for none; raise where they are too short for a log."""
    if 0 < step < _IMPOSSIBLE:
        said = f"found steps of {step:.3g}, as of days or hours, allowed: times in {_UNITS}"
        hints = unit_hints([time], "s", "keeps them unchanged")
        raise layout.error(f"{said}; convert them", time.header, *hints, *EVEN)
    return "s", "the usual unit", (_assumed(time, step),) if 0 < step < _UNUSUAL else ()


def _assumed(time: Column, step: float, unit: str = "s", why: str = "") -> LogWarning:
    said = f"the time {format_value(time.name)} steps by {step:.6g}: taken as {unit}{why}"
    hints, taken = (*unit_hints([time], unit, "confirms it"), *OTHER_TIME), f"the times are in {unit}"
    return LogWarning("assumed-unit", said, hints=hints, assumption=taken, role="time")


def _question(time: Column, layout: LogTable, found: str, units: list[str]) -> LogError:
    """Ask which of some units is meant."""
    hints = (*(Hint("unit", {time.called: unit}, "specifies it") for unit in units), *OTHER_TIME)
    return layout.error(f"found {found}, which may be {' or '.join(units)}", time.header, *hints)


PAPER_PERIOD = 0.005
"""Tsp of the paper in [s]: taken where nothing tells the time. Source: [UrmArm2021]_ eq. 22."""

FORMS_TOLD = "numbers in s, ms, us or ns, or times such as 2021-04-11 22:27:21.573, 22:27:21.573, 0.005 sec"
"""What a clock may look like, for errors."""


_DATES = (19_700_101_000_000, 21_000_101_000_000)
"""Dates written as numbers, YYYYMMDDhhmmss."""


@dataclass(frozen=True, slots=True)
class Clock:
    """The clock of one table.

    Attributes:
        columns: One column, or seconds and nanoseconds apart; none if the table has no time.
        parts: The same for the reader.
        unit: Its unit: s, ms, us, ns, or where it is text "date" or "time of day".
        told: Whether the user or the name of its column tells that unit.
        inferences: What was found out.
        warnings: What a person should know.
        by_source: Whether the source told that unit.
        lasts: Whether each row has a duration, and the times are their sum.
    """

    columns: tuple[Column, ...] = ()
    parts: tuple[ClockColumn, ...] = ()
    unit: str = "s"
    told: bool = False
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()
    by_source: bool = False
    lasts: bool = False

    @property
    def exponent(self) -> int:
        """Power of ten from its unit to [ns]; of text that of s."""
        return EXPONENTS.get(self.unit, 9)

    @property
    def as_label(self) -> Clock:
        """The same as what static poses have for one: columns whose times are not read."""
        return Clock(self.columns, inferences=self.inferences[:1])

    @property
    def units(self) -> dict[str, str]:
        """The unit of each of its columns by name."""
        return {column.name: _unit_of(part) for column, part in zip(self.columns, self.parts, strict=True)}

    def shown(self, nanoseconds: int) -> str:
        """Return a time as the file would write it."""
        if self.unit == DATE:
            seconds, rest = divmod(nanoseconds, SECOND_NS)
            date = np.datetime64(seconds, "s").item().isoformat(" ")
            return f"{date}.{rest:09d}".rstrip("0").rstrip(".")
        if self.unit == TIME_OF_DAY:
            sign, (seconds, rest) = "-" * (nanoseconds < 0), divmod(abs(nanoseconds), SECOND_NS)
            clock = f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
            return f"{sign}{clock}.{rest:09d}".rstrip("0").rstrip(".")
        value = Decimal(nanoseconds).scaleb(-EXPONENTS[self.unit]).normalize()
        return f"{value:f} {self.unit}"


def _unit_of(part: ClockColumn) -> str:
    """Return the unit of a column of the clock."""
    if part.forms:
        return part.forms[0].unit
    return next(unit for unit, exponent in EXPONENTS.items() if exponent == part.exponent)


def find_clocks(
    tables: Tables,
    columns: Sequence[Column],
    options: LogMap,
    units: Mapping[int, Unit],
    joints: int | None = None,
) -> tuple[Clock, ...]:
    """Return the clock of each table.

    Raises:
        LogError: If a time is text of an unknown form, or its unit is unclear.
        OptionError: If its unit is given as one that is no time.
    """
    clocks = []
    for table, layout in enumerate(tables.layouts):
        own = [column for column in columns if column.table == table]
        chosen = time_columns(own, layout, options, joints)
        clock = clock_of(chosen, layout, tables.known, units, label=options.poses)
        if chosen.passed_over:
            names = ", ".join(column.name for column in chosen.passed_over)
            hints = tuple(Hint("time", column.called, "takes it") for column in chosen.passed_over)
            passed = f"{names} passed over for {chosen.columns[0].name}"
            clock = replace(clock, warnings=(*clock.warnings, LogWarning(PASSED_OVER, passed, hints=hints)))
        clocks.append(clock)
    return tuple(clocks)


def clock_of(
    chosen: Chosen,
    layout: LogTable,
    source: KnownSource | None,
    units: Mapping[int, Unit],
    *,
    label: bool = False,
) -> Clock:
    """Return the clock that columns make; as a label it has no times.

    Raises:
        LogError: If the time is text in no form that is known, or its unit cannot be told.
        OptionError: If its unit is given as one that is no time.
    """
    columns = chosen.columns
    if not columns:
        return Clock(inferences=(Inference("time column", "none", chosen.why, hints=OTHER_TIME),))
    names = tuple(column.name for column in columns)
    found = Inference("time column", " and ".join(names), chosen.why, columns=names, hints=OTHER_TIME)
    if label:
        return Clock(columns, inferences=(found,))
    time = columns[0]
    forms = chosen.forms or _forms_of_numbers(time, layout, source, units)
    if forms and not any(column.text for column in columns):
        parts = tuple(ClockColumn(c.index, forms=(form,)) for c, form in zip(columns, forms, strict=True))
        return Clock(columns, parts, _unit_of(parts[0]), inferences=(found,))
    if time.text:
        parts = tuple(_text_part(column, layout, units) for column in columns)
        return Clock(columns, parts, _unit_of(parts[0]), inferences=(found,))
    if chosen.rest is not None:
        parts = (ClockColumn(time.index, EXPONENTS["s"]), ClockColumn(columns[1].index, chosen.rest))
        return Clock(columns, parts, "s", inferences=(found,))
    unit, evidence, warnings = unit_of(time, layout, source, units, lasts=chosen.lasts)
    _refuse_ages(time, layout, unit)
    told = time.number in units or time.unit is not None
    by_source = not told and source is not None and "time" in source.units
    clock = Clock(columns, told=told, inferences=(found,), by_source=by_source, lasts=chosen.lasts)
    return _with_unit(clock, unit, evidence, warnings)


def _with_unit(clock: Clock, unit: str, evidence: str, warnings: tuple[LogWarning, ...]) -> Clock:
    """Return a clock of one column of numbers with its unit."""
    (time,) = clock.columns
    other = (Hint("unit", {time.called: "s" if unit != "s" else "ms"}),)
    why = Inference("unit of the time", unit, evidence, columns=(time.name,), hints=other)
    parts, inferences = (ClockColumn(time.index, EXPONENTS[unit]),), (clock.inferences[0], why)
    return replace(clock, parts=parts, unit=unit, inferences=inferences, warnings=warnings)


def by_joints(clock: Clock, tables: Tables, joints: Sequence[Column], units: Mapping[int, Unit]) -> Clock:
    """Return a clock with the unit in which the joints turn at usual speeds, if only its steps show one.

    Raises:
        LogError: If it may be s or ms.
    """
    if len(clock.parts) != 1 or clock.parts[0].forms or clock.told or clock.by_source:
        return clock
    (time,) = clock.columns
    layout = tables.layouts[time.table]
    if vocabulary().unit(time.key) is not None:  # "seconds" has no other name
        return clock

    @np.errstate(over="ignore", invalid="ignore")  # huge numbers
    def speed() -> float | None:
        if not joints:
            return None
        main = [joint for joint in joints if joint.table == joints[0].table]
        times = tables.layouts[time.table].values([time.index])[:, 0]
        q = tables.layouts[main[0].table].values([joint.index for joint in main])
        if len(q) != len(times) or len(q) < 2:
            return None
        q, turns = in_si(q, main, units, tables.known)
        steps = np.diff(q, axis=0)
        steps -= np.rint(steps / FULL_TURN) * turns
        return speed_of(steps, times[1:] if clock.lasts else np.diff(times))

    unit = unit_by_speed(time, layout, speed, lasts=clock.lasts)
    others = tuple(warning for warning in clock.warnings if warning.kind == PASSED_OVER)
    return clock if unit is None else _with_unit(clock, unit[0], unit[1], (*others, *unit[2]))


def _forms_of_numbers(
    column: Column, layout: LogTable, source: KnownSource | None, units: Mapping[int, Unit]
) -> tuple[Form, ...]:
    """Return the form of numbers whose unit nobody tells and that are dates, or seconds with nanoseconds.

    20210411222721.5 is a date. 7.5000000 is 7 s and 5 ms where the numbers run backwards and so they do not.
    """
    told = column.number in units or column.unit_text or (source is not None and "time" in source.units)
    if told or column.text:
        return ()
    if all_are(DENSE_DATE, column, layout):
        return (DENSE_DATE,)
    backwards = min(steps_of(layout.numbers(column.index)), default=0.0) < 0
    if layout.arrow is not None or not backwards or not all_are(UNPADDED_NS, column, layout):
        return ()
    times = read_cells(TextCells.of(layout.cells(column.index)), UNPADDED_NS)
    return (UNPADDED_NS,) if (np.diff(times) > 0).all() else ()


def _text_part(column: Column, layout: LogTable, units: Mapping[int, Unit]) -> ClockColumn:
    """Return a column of text for the reader: the forms that it may have."""
    cells, given = layout.cells(column.index), units.get(column.number)
    forms = known_forms(cells)
    if not forms:
        raise layout.error(
            f"found {format_value(cells[0])}, allowed: {FORMS_TOLD}", column.header, *OTHER_TIME
        )
    wanted = given or column.unit
    asked = tuple(form for form in forms if wanted is not None and wanted.name in form.keys)
    if given is not None and not asked:
        keys = ", ".join(dict.fromkeys(key for form in forms for key in form.keys)) or "none"
        found = f"{given.name} for the time {format_value(column.name)}"
        raise OptionError(Finding(parameter="unit", found=found, allowed=keys, hints=OTHER_TIME))
    return ClockColumn(column.index, forms=asked or forms)


def _refuse_ages(time: Column, layout: LogTable, unit: str) -> None:
    """Raise if the times are beyond what integers of 64 bits hold in [ns]: they are of another unit."""
    for value in layout.numbers(time.index)[:1]:
        if abs(value) * 10.0 ** EXPONENTS[unit] >= LONGEST_NS:
            since_1970 = [u for u, e in EXPONENTS.items() if EPOCH[0] <= value * 10.0 ** (e - 9) <= EPOCH[1]]
            hint = Hint("unit", {time.called: (*since_1970, "ns")[0]}, "applies this")
            if unit == "s" and _DATES[0] <= value < _DATES[1]:
                hint = Hint("", effect="a date is read if it is written as 2021-04-11 22:27:21.5")
            message = f"found {value:g} {unit}, allowed: times within 146 years of 0"
            raise layout.error(message, time.header, hint, *OTHER_TIME)


def unused_period(keyword: str) -> LogWarning:
    """Return the warning that a period has no effect, since the file has a clock; by its keyword."""
    hints = (Hint("time", "none", "leaves the clock out"),)
    return LogWarning("period-not-used", "no effect: the log has a clock", parameter=keyword, hints=hints)


def unused_for_poses(given: Mapping[str, object]) -> list[LogWarning]:
    """Return a warning for each keyword with a value, all about motions, since the rows are static poses."""
    said = "no effect: the rows are static poses, which have no time"
    return [LogWarning("not-for-poses", said, parameter=name) for name, value in given.items() if value]


def even_clock(
    rows: int, period: float | None, given_by: str = "period", like: str = ""
) -> tuple[IntArray, tuple[Inference, ...], list[LogWarning]]:
    """Return the times in [ns], shape (rows,), of a log without a clock, what they rest on, and a warning.

    The warning tells that the period is assumed, if it is.

    Args:
        rows: Number of rows.
        period: Time between rows in [s], if the user gave it.
        given_by: The keyword that gave it, for errors.
        like: A column that may be the time, for the warning.

    Raises:
        OptionError: If the period is not a positive time of 1 ns or more.
    """
    if period is not None and not (math.isfinite(period) and period >= 1e-9):
        allowed = "a positive time of 1e-9 s or more"
        raise OptionError(Finding(parameter=given_by, found=f"{period:g} s", allowed=allowed))
    step = PAPER_PERIOD if period is None else period
    if rows * step * 1e9 >= LONGEST_NS:
        allowed = f"less than {LONGEST_NS / 1e9 / rows:g} s for {rows} rows"
        raise OptionError(Finding(parameter=given_by, found=f"{step:g} s", allowed=allowed))
    times = np.rint(np.arange(rows) * (step * 1e9)).astype(np.int64)
    if period is not None:
        return times, (Inference("period", f"{step:g} s", "given as an option", hints=(Hint("period"),)),), []
    hints = [Hint("period", None, "sets another time between rows")]
    always = Hint("time", like, "takes this column as the time: it always increases")
    hints.append(always if like else OTHER_TIME[0])
    said = "no time column: the rows are taken as 5 ms apart"
    assumed = "the rows are 5 ms apart"
    warning = LogWarning(ASSUMED_PERIOD, said, hints=tuple(hints), assumption=assumed, role="time")
    return times, (Inference("period", "0.005 s", "assumed", hints=(Hint("period"),)),), [warning]


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


TIME_FILE = "time file"
"""The kind of the inference about a clock that is a file of its own."""


def named_file(time: str | None) -> tuple[Path, str] | None:
    """Return file and column of FILE:COLUMN; None of the name of a column alone.

    The file ends at the last colon before which the name of one stands.
    """
    colons = [place for place, sign in enumerate(time or "") if sign == ":"]
    parts = ((time[:place], time[place + 1 :]) for place in reversed(colons)) if time else ()
    for file, column in parts:
        if column and os.path.isfile(file):  # noqa: PTH113 (of a name that is too long Path raises)
            return Path(file), column
    return None


def with_time_file(tables: Tables, options: LogMap) -> tuple[Tables, int | None]:
    """Return the tables of a log, behind them that of the file whose column the user names as the time.

    Returns:
        The tables, and the index of that of the times; None if the user names no file.

    Raises:
        LogError: If the file is no table.
        OptionError: If the log has more tables than one.
    """
    named = named_file(options.time)
    if named is None:
        return tables, None
    if len(tables.layouts) > 1:
        found = f"{format_value(options.time or '')} for {len(tables.layouts)} tables"
        raise OptionError(Finding(parameter="time", found=found, allowed="FILE:COLUMN for one table"))
    plain = LogMap(delimiter=options.delimiter, decimal=options.decimal)
    try:
        apart = open_tables([named[0]], plain)
    except LogError:
        apart = open_tables([named[0]], LogMap())  # it may be written in another way than the log
    layout, rows = across(apart.layouts[0]), tables.layouts[0].rows
    if rows is not None and rows[-1] < layout.count_rows():
        layout = layout.take(rows)
    layouts, titles = (*tables.layouts, layout), (*tables.titles, apart.titles[0])
    return replace(tables, layouts=layouts, titles=titles), 1


def clocks_apart(
    tables: Tables, columns: Sequence[Column], index: int, options: LogMap, units: Mapping[int, Unit]
) -> tuple[Clock, ...]:
    """Return the clocks of two tables, of which one has the times of the other.

    Of the other a clock that is not used has columns, which are no joints, and no times.

    Raises:
        LogError: If both tables have a time and the user names none, or its unit cannot be told.
    """
    named = named_file(options.time)
    if named is None:
        found = clock_of_file(tables, columns, index, units, label=options.poses)
        return tuple(found if table == index else Clock() for table in (0, 1))
    own = [[column for column in columns if column.table == table] for table in (0, 1)]
    layout = tables.layouts[index]
    numbered = [replace(column, number=column.index + 1) for column in own[index]]
    column = own[index][find_column(numbered, named[1], parameter="time").index]
    chosen = given_time(column, own[index], layout)
    found = clock_of(chosen, layout, None, units, label=options.poses)
    first, *others = found.inferences
    title = f"{named[0].name}:{named[1]}"
    said = replace(first, value=title, kind=TIME_FILE)
    main = 1 - index
    try:
        beside = time_columns(own[main], tables.layouts[main], replace(options, time=None), None)
    except LogError:  # it may have a time or not: the one that is named is used
        beside = Chosen((), "")
    return Clock(beside.columns), replace(found, inferences=(said, *others))


def time_file(tables: Tables, columns: Sequence[Column]) -> int | None:
    """Return which of two tables holds nothing but the times of the other; None if neither does.

    It is a single column, or a single row, that is named like a time (the column or the file), or the only
    one of the two, without a header, that runs in even steps.
    """
    if len(tables.layouts) != 2 or len(set(tables.paths)) != 2:
        return None
    single = [i for i in (0, 1) if sum(column.table == i for column in columns) == 1]
    named = [i for i in single if _is_named(tables, columns, i)]
    if len(named) == 1:
        return named[0]
    layouts = tables.layouts
    even = [i for i in single if layouts[i].header is None and runs_evenly(layouts[i].numbers(0))]
    return even[0] if len(single) == len(even) == 1 else None


def clock_of_file(
    tables: Tables, columns: Sequence[Column], index: int, units: Mapping[int, Unit], *, label: bool = False
) -> Clock:
    """Return the clock that a file of times makes; as a label it has no times.

    Raises:
        LogError: If the other table has a time as well, or the unit of the times cannot be told.
    """
    layout, title = tables.layouts[index], tables.layouts[index].path.name
    for column in columns:
        if column.table != index and _is_time(column.key):
            other = tables.layouts[column.table]
            hints = (Hint("time", None, "selects the column"), Hint("time", "none", "leaves both out"))
            message, file = f"found a time here and in {title}, allowed: one clock", other.file
            raise LogError(Finding(message, file, other.header_line, column=column.header, hints=hints))
    own = tuple(column for column in columns if column.table == index)
    form = "one row" if layout.across else "one column"
    chosen = Chosen(own, f"{title} holds nothing but {form} of times")
    found = clock_of(chosen, layout, tables.known, units, label=label)
    first, *others = found.inferences
    return replace(found, inferences=(replace(first, kind=TIME_FILE), *others))


def _is_named(tables: Tables, columns: Sequence[Column], index: int) -> bool:
    own = next(column for column in columns if column.table == index)
    return _is_time(own.key) or _is_time(key(tables.titles[index]))


def _is_time(name: str) -> bool:
    return any(pattern.search(name) for pattern in (*vocabulary().time, *vocabulary().dates))
