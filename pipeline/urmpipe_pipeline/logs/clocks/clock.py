"""The clock: which column is the time, its unit or the form of its text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal

import numpy as np

from urmpipe_models.elementwise import IntArray
from urmpipe_models.errors import Finding, Hint, OptionError, format_value
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import ASSUMED_PERIOD, PASSED_OVER, Inference, LogWarning
from urmpipe_pipeline.logs.cells.cell import LONGEST_NS
from urmpipe_pipeline.logs.cells.text_cells import TextCells
from urmpipe_pipeline.logs.cells.text_clock import (
    DATE,
    DENSE_DATE,
    SECOND_NS,
    TIME_OF_DAY,
    UNPADDED_NS,
    Form,
)
from urmpipe_pipeline.logs.clocks.chosen import EXPONENTS, OTHER_TIME, Chosen
from urmpipe_pipeline.logs.clocks.clock_columns import time_columns
from urmpipe_pipeline.logs.clocks.clock_units import in_si, speed_of, unit_by_speed, unit_of
from urmpipe_pipeline.logs.clocks.digits import all_are
from urmpipe_pipeline.logs.clocks.halves import EPOCH
from urmpipe_pipeline.logs.clocks.steps import steps_of
from urmpipe_pipeline.logs.clocks.text_times import known_forms, read_cells
from urmpipe_pipeline.logs.columns.columns import Column
from urmpipe_pipeline.logs.options import LogMap
from urmpipe_pipeline.logs.tables.numbers import ClockColumn
from urmpipe_pipeline.logs.tables.opening import Tables
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.vocabulary import KnownSource, Unit, vocabulary

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
        chosen = time_columns(own, layout, options, joints, tables.whole[table])
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
    layout: Layout,
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
        times = tables.whole[time.table].values([time.index])[:, 0]
        q = tables.whole[main[0].table].values([joint.index for joint in main])
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
    column: Column, layout: Layout, source: KnownSource | None, units: Mapping[int, Unit]
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
    if layout.held is not None or not backwards or not all_are(UNPADDED_NS, column, layout):
        return ()
    times = read_cells(TextCells.of(layout.cells(column.index)), UNPADDED_NS)
    return (UNPADDED_NS,) if (np.diff(times) > 0).all() else ()


def _text_part(column: Column, layout: Layout, units: Mapping[int, Unit]) -> ClockColumn:
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


def _refuse_ages(time: Column, layout: Layout, unit: str) -> None:
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
