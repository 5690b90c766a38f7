"""The clock of a table: its columns, its unit, and the times of a log without one.

1. Columns: those that the user gives, that a header names, or whose numbers run like a clock
   (`clock_columns`); or a file of times next to the log (`find_time_file`).
2. Unit of a clock of numbers (`find_unit`): the option; the name of the column; the program that wrote the
   log; the year, since a Unix time of 2000 to 2100 is one in a single unit; else the step, since a log has
   usually periods of 0.5 ms to 1 s. Steps of 1 to 500 may be s or ms: the speed of the joints decides
   (`settle_unit_by_speed`). If several units remain, or none as of days and ticks, the user is asked.
3. Without a clock (`even_clock`): rows at the period that the user gives, else at 5 ms, with a warning.
"""

from __future__ import annotations

import math
import os.path
from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import ASSUMED_PERIOD, PASSED_OVER, Basis, Inference, LogWarning
from urmpipe_pipeline.logs.clock_columns import (
    GIVEN,
    MAX_PERIOD,
    MIN_PERIOD,
    OTHER_CLOCK,
    OTHER_TIME,
    TimeColumns,
    complete_time,
    find_time_columns,
    find_unix_unit,
    has_form,
    is_named_time,
    runs_evenly,
    start_and_step,
)
from urmpipe_pipeline.logs.columns import Column, find_column, unit_hints
from urmpipe_pipeline.logs.formats.cells import MAX_NS, TextCells
from urmpipe_pipeline.logs.formats.clock_forms import (
    DATE,
    DENSE_DATE,
    EXPONENTS,
    SECOND_NS,
    TIME_OF_DAY,
    UNPADDED_NS,
    ClockForm,
    find_forms,
    read_cells,
)
from urmpipe_pipeline.logs.formats.log_table import ClockColumn, LogTable
from urmpipe_pipeline.logs.formats.opening import Tables, open_tables
from urmpipe_pipeline.logs.formats.sniff import across
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.proofs import peak
from urmpipe_pipeline.logs.vocabulary import KnownSource, Unit, key, vocabulary

DEFAULT_PERIOD = 0.005  # s, Tsp of the paper ([UrmArm2021]_ eq. 22), if nothing gives the time
TIME_FILE = "time file"  # kind of the inference about a clock in a separate file

MIN_PERIOD_OF_S = 0.0002  # s; numbers without a unit with shorter steps are days or hours
MAX_AGE = 1e8  # s, three years; no clock without a unit goes further from 0, except Unix time
S_OR_MS = (1.0, 500.0)  # steps that may be in s or in ms
MIN_STEP_MS = 5.0  # a log in ms rarely has shorter steps: 200 Hz
MAX_SPEED = 30.0  # rad/s, which no joint exceeds
USUAL_SPEED = 5.0  # rad/s, which joints rarely exceed
MIN_MOTION = 0.01  # share of the largest step below which the joints rest

_ALLOWED = ", ".join(EXPONENTS)
_EXAMPLES = "2021-04-11 22:27:21.573, 22:27:21.573, 0.005 sec"
_ALLOWED_FORMS = f"numbers in s, ms, us or ns, or times such as {_EXAMPLES}"


class Clock(NamedTuple):
    """The clock of one table.

    Attributes:
        columns: One column, or the two of a split time; none if the table has no time.
        parts: The same for the reader; none if the times are not read, as of static poses.
        stated_by: What states its unit: "option", "name", "source" (the program that wrote the log), or "".
        are_durations: Whether each row has a duration, and the times are their sum.
        inferences: How columns and unit were found.
        warnings: About the columns and the unit.
    """

    columns: tuple[Column, ...] = ()
    parts: tuple[ClockColumn, ...] = ()
    stated_by: str = ""
    are_durations: bool = False
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()

    @property
    def as_label(self) -> Clock:
        """The same columns, whose times are not read."""
        return Clock(self.columns, inferences=self.inferences[:1])

    @property
    def unit(self) -> str:
        """Its unit: s, ms, us, ns, or of text "date" or "time of day"."""
        return self.parts[0].unit if self.parts else "s"

    def format(self, nanoseconds: int) -> str:
        """Return a time as the file writes it."""
        sign, (seconds, rest) = "-" * (nanoseconds < 0), divmod(abs(nanoseconds), SECOND_NS)
        if self.unit == DATE:
            seconds, rest = divmod(nanoseconds, SECOND_NS)
            text = np.datetime64(seconds, "s").item().isoformat(" ")
        elif self.unit == TIME_OF_DAY:
            text = f"{sign}{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
        else:
            return f"{Decimal(nanoseconds).scaleb(-EXPONENTS[self.unit]).normalize():f} {self.unit}"
        return f"{text}.{rest:09d}".rstrip("0").rstrip(".")


def find_clocks(
    tables: Tables,
    columns: Sequence[Column],
    options: LogMap,
    units: Mapping[int, Unit],
    joints: int | None = None,
) -> tuple[Clock, ...]:
    """Return the clock of each table.

    Raises:
        LogError: If a time is text of an unknown form, or if its column or unit is ambiguous.
        OptionError: If the unit given for it is not a unit of time.
    """
    clocks = []
    for k, table in enumerate(tables.tables):
        in_table = [column for column in columns if column.table == k]
        time = find_time_columns(in_table, table, options, joints)
        clock = make_clock(time, table, tables.known, units, is_label=bool(options.poses))
        if time.passed_over:
            names = ", ".join(column.name for column in time.passed_over)
            hints = tuple(Hint("time", column.called, "takes it") for column in time.passed_over)
            message = f"{names} passed over for {time.columns[0].name}"
            warning = LogWarning(PASSED_OVER, message, hints=hints)
            clock = clock._replace(warnings=(*clock.warnings, warning))
        clocks.append(clock)
    return tuple(clocks)


def make_clock(
    time: TimeColumns,
    table: LogTable,
    source: KnownSource | None,
    units: Mapping[int, Unit],
    *,
    is_label: bool = False,
) -> Clock:
    """Return the clock of some columns; as a label it has no times.

    Raises:
        LogError: If the time is text of an unknown form, or if its unit is ambiguous.
        OptionError: If the unit given for it is not a unit of time.
    """
    columns = time.columns
    if not columns:
        inference = Inference("time column", "none", time.evidence, hints=OTHER_TIME, basis="assumed")
        return Clock(inferences=(inference,))
    names, first = tuple(column.name for column in columns), columns[0]
    is_labelled = any(each.kind == "labels" for each in table.inferences)
    basis: Basis = (
        "named" if is_labelled or any(is_named_time(column.key) for column in columns) else "proved"
    )
    inference = Inference("time column", " and ".join(names), time.evidence, "", names, OTHER_TIME, basis)
    if is_label:
        return Clock(columns, inferences=(inference,))
    if forms := _find_form_of_numbers(first, table, source, units):
        parts: tuple[ClockColumn, ...] = (ClockColumn(first.index, forms[0].unit, forms),)
    elif first.text:
        of_columns = [(column, _find_text_forms(column, table, units)) for column in columns]
        parts = tuple(ClockColumn(column.index, forms[0].unit, forms) for column, forms in of_columns)
    elif time.rest_unit:
        parts = (ClockColumn(first.index, "s"), ClockColumn(columns[1].index, time.rest_unit))
    else:
        choice = find_unit(first, table, source, units, are_durations=time.are_durations)
        clock = Clock(columns, are_durations=time.are_durations, inferences=(inference,))
        return _with_unit(clock, choice)
    return Clock(columns, parts, inferences=(inference,))


def _find_form_of_numbers(
    column: Column, table: LogTable, source: KnownSource | None, units: Mapping[int, Unit]
) -> tuple[ClockForm, ...]:
    """Return the form of numbers without a unit that are dates, or seconds with unpadded nanoseconds.

    20210411222721.5 is a date. 7.5000000 is 7 s and 5 ms if only so the numbers do not run backwards.
    """
    is_stated = column.number in units or column.unit_text or (source is not None and "time" in source.units)
    if is_stated or column.text:
        return ()
    if has_form(column, DENSE_DATE, table):
        return (DENSE_DATE,)
    is_backwards = (np.diff(table.numbers(column.index)) < 0).any()
    if table.arrow is not None or not is_backwards or not has_form(column, UNPADDED_NS, table):
        return ()
    times = read_cells(TextCells.of(table.cells(column.index)), UNPADDED_NS)
    return (UNPADDED_NS,) if (np.diff(times) > 0).all() else ()


def _find_text_forms(column: Column, table: LogTable, units: Mapping[int, Unit]) -> tuple[ClockForm, ...]:
    cells, given_unit = table.cells(column.index), units.get(column.number)
    forms = find_forms(cells)
    if not forms:
        message = f"found {format_value(cells[0])}, allowed: {_ALLOWED_FORMS}"
        raise table.error(message, column.header, *OTHER_TIME)
    unit = given_unit or column.unit
    selected = tuple(form for form in forms if unit is not None and unit.name in form.keys)
    if given_unit is not None and not selected:
        keys = ", ".join(dict.fromkeys(key for form in forms for key in form.keys)) or "none"
        raise _wrong_unit(column, given_unit, keys)
    return selected or forms


def _wrong_unit(column: Column, unit: Unit, allowed: str) -> OptionError:
    message = f"{unit.name} for the time {format_value(column.name)}"
    return OptionError(Finding(parameter="unit", found=message, allowed=allowed, hints=OTHER_TIME))


class UnitChoice(NamedTuple):
    """A unit of time, why, what states it (as of `Clock`), and warnings about it."""

    unit: str
    evidence: str
    stated_by: str = ""
    warnings: tuple[LogWarning, ...] = ()


def _with_unit(clock: Clock, choice: UnitChoice) -> Clock:
    (time,), unit = clock.columns, choice.unit
    other = (Hint("unit", {time.called: "s" if unit != "s" else "ms"}),)
    is_assumed = any(warning.assumption for warning in choice.warnings)
    is_named = time.unit is not None or choice.stated_by
    basis: Basis = "assumed" if is_assumed else "named" if is_named else "proved"
    inference = Inference("unit of the time", unit, choice.evidence, "", (time.name,), other, basis)
    return clock._replace(
        parts=(ClockColumn(time.index, unit),),
        stated_by=choice.stated_by,
        inferences=(clock.inferences[0], inference),
        warnings=choice.warnings,
    )


def find_unit(
    time: Column,
    table: LogTable,
    source: KnownSource | None,
    units: Mapping[int, Unit],
    *,
    are_durations: bool = False,
) -> UnitChoice:
    """Return the unit of a column of numbers that are times or durations.

    Args:
        time: The column.
        table: How its table is written.
        source: The program that wrote the log, if it is known.
        units: Units that the user gives, by the column's number.
        are_durations: Whether they are durations.

    Raises:
        LogError: If the unit is one that is not read, or if it is ambiguous.
        OptionError: If the given unit is not a unit of time.
    """
    numbers = table.numbers(time.index)
    first = abs(numbers[0]) if numbers else 0.0
    choice = _find_stated_unit(time, table, source, units)
    if choice is not None and first * 10.0 ** EXPONENTS[choice.unit] >= MAX_NS:
        hint = Hint("unit", {time.called: find_unix_unit(first) or "ns"}, "applies this")
        message = f"found {first:g} {choice.unit}, allowed: times within 146 years of 0"
        raise table.error(message, time.header, hint, *OTHER_TIME)
    if choice is not None:
        return choice
    start, step = start_and_step(numbers, are_durations=are_durations)
    usual = [u for u, e in EXPONENTS.items() if MIN_PERIOD < step * 10.0 ** (e - 9) <= MAX_PERIOD]
    since_1970 = find_unix_unit(start, step)
    if since_1970 is not None:
        if usual and step * 10.0 ** (EXPONENTS[since_1970] - 9) > MAX_PERIOD:
            raise _ask_unit(time, table, f"times of our years in steps of {step:g}", [since_1970, *usual])
        return UnitChoice(since_1970, "it counts from 1970, so as Unix time it is of our years")
    if 0 < step < MIN_PERIOD_OF_S:
        message = f"found steps of {step:.3g}, as of days or hours"
        hints = (*unit_hints([time], "s", "keeps them unchanged"), *OTHER_CLOCK)
        raise table.error(f"{message}, allowed: times in {_ALLOWED}; convert them", time.header, *hints)
    if step <= MIN_PERIOD:
        choice = UnitChoice("s", "the usual unit")
    elif ("s" in usual and len(usual) > 1) or (usual == ["ms"] and any(number % 1 for number in numbers)):
        choice = UnitChoice("s", f"its steps of {step:g}", warnings=_assumed(time, step, "s"))
    elif len(usual) == 1:
        choice = UnitChoice(usual[0], f"its steps of {step:g}")
    else:
        raise _ask_unit(time, table, f"steps of {step:g}", usual or list(EXPONENTS))
    unit = "ms" if S_OR_MS[0] <= step <= S_OR_MS[1] else choice.unit
    if start * 10.0 ** (EXPONENTS[unit] - 9) > MAX_AGE:
        message = f"found {start:g} in steps of {step:g}, as of dates or ticks since another year"
        message += f", allowed: times in {_ALLOWED} within 3 years of 0, or Unix times; convert them"
        hints = unit_hints([time], unit, "keeps them unchanged")
        raise table.error(message, time.header, *hints, *OTHER_CLOCK)
    return choice


def _find_stated_unit(
    time: Column, table: LogTable, source: KnownSource | None, units: Mapping[int, Unit]
) -> UnitChoice | None:
    given_unit = units.get(time.number)
    if given_unit is not None:
        if given_unit.name not in EXPONENTS:
            raise _wrong_unit(time, given_unit, _ALLOWED)
        return UnitChoice(given_unit.name, GIVEN, "option")
    named = time.unit or vocabulary().unit(time.key)  # "seconds" has no other name
    if named is not None and named.name in EXPONENTS:
        return UnitChoice(named.name, "its name", "name")
    long = time.unit_text or time.key.rpartition("_")[2]
    if long.lower() in vocabulary().long_times:
        message = f"found the unit {format_value(long)}, allowed: {_ALLOWED}; convert the times"
        raise table.error(message, time.header, *OTHER_CLOCK)
    if source is not None and "time" in source.units:
        unit = source.units["time"].name
        return UnitChoice(unit, f"{source.name} writes {unit}", "source")
    return None


def _assumed(time: Column, step: float, unit: str, why: str = "") -> tuple[LogWarning]:
    message = f"the time {format_value(time.name)} steps by {step:.6g}: taken as {unit}{why}"
    hints, assumption = (*unit_hints([time], unit, "confirms it"), *OTHER_TIME), f"the times are in {unit}"
    return (LogWarning("assumed-unit", message, hints=hints, assumption=assumption, role="time"),)


def _ask_unit(time: Column, table: LogTable, what: str, units: Sequence[str]) -> LogError:
    hints = (*(Hint("unit", {time.called: unit}, "specifies it") for unit in units), *OTHER_TIME)
    return table.error(f"found {what}, which may be {' or '.join(units)}", time.header, *hints)


def settle_unit_by_speed(
    clock: Clock, tables: Tables, joints: Sequence[Column], units: Mapping[int, Unit]
) -> Clock:
    """Return a clock in s or ms by the speed of the joints, if only its steps show the unit.

    Raises:
        LogError: If it may be s or ms.
    """
    if len(clock.parts) != 1 or clock.parts[0].forms or clock.stated_by:
        return clock
    (time,) = clock.columns
    table = tables.tables[time.table]
    numbers = table.numbers(time.index)
    start, step = start_and_step(numbers, are_durations=clock.are_durations)
    if not S_OR_MS[0] <= step <= S_OR_MS[1] or find_unix_unit(start, step):
        return clock
    are_integers = not any(number % 1 for number in numbers)
    speed = _speed_in_s(clock, tables, joints, units)
    if speed is None:
        why, unit = "no joint moves", "ms" if are_integers and step >= MIN_STEP_MS else "s"
    else:
        why = f"the joints turn at up to {1e3 * speed:.2g} rad/s as ms, at {speed:.2g} rad/s as s"
        is_usual = 1e3 * speed <= USUAL_SPEED
        if 1e3 * speed > MAX_SPEED or not (are_integers or is_usual):
            unit = "s"
        else:
            unit = "ms" if are_integers and is_usual and step >= MIN_STEP_MS else ""
    if not unit:
        raise _ask_unit(time, table, f"{'whole ' * are_integers}steps of {step:g} ({why})", ["s", "ms"])
    passed_over = tuple(warning for warning in clock.warnings if warning.kind == PASSED_OVER)
    warnings = (*passed_over, *_assumed(time, step, unit, f", since {why}"))
    return _with_unit(clock, UnitChoice(unit, f"its steps of {step:g}, and {why}", warnings=warnings))


@np.errstate(over="ignore", invalid="ignore")  # huge numbers
def _speed_in_s(
    clock: Clock, tables: Tables, joints: Sequence[Column], units: Mapping[int, Unit]
) -> float | None:
    """Return the speed in [rad/s] that nine of ten rows in motion stay below, as if the clock were in s.

    None if no joint moves.
    """
    main = [joint for joint in joints if joint.table == joints[0].table]
    times = tables.tables[clock.columns[0].table].values([clock.columns[0].index])[:, 0]
    q = tables.tables[main[0].table].values([joint.index for joint in main]) if main else times[:0]
    if len(q) != len(times) or len(q) < 2:
        return None
    steps = joint_steps(q, main, units, tables.known)
    durations = times[1:] if clock.are_durations else np.diff(times)
    size = np.fmax.reduce(np.abs(steps), axis=1, initial=0.0)
    moves = (size > MIN_MOTION * np.fmax.reduce(size, initial=0.0)) & (durations > 0)
    speeds = np.sort(size[moves] / durations[moves])
    return float(speeds[int(0.9 * (len(speeds) - 1))]) if len(speeds) else None


def joint_steps(
    values: FloatArray, joints: Sequence[Column], units: Mapping[int, Unit], source: KnownSource | None
) -> FloatArray:
    """Return the steps of joints between rows, without whole turns, in [rad] or [m], shape (n - 1, joints).

    Args:
        values: Joint values in the file's own units, shape (n, joints).
        joints: Their columns. Without a unit, values beyond a turn in rad are taken as deg.
        units: Units that the user gives, by the column's number; by 0 that of every angle.
        source: The program that wrote the log, if it is known.
    """
    angle = source.units.get("angle") if source else None
    usual = angle or vocabulary().units["deg" if peak(values) > FULL_TURN else "rad"]
    column_units = [units.get(joint.number) or units.get(0) or joint.unit or usual for joint in joints]
    is_turning = np.array([unit.quantity != "length" for unit in column_units])
    steps = np.diff(values * [unit.factor for unit in column_units], axis=0)
    return np.asarray(steps - np.rint(steps / FULL_TURN) * np.where(is_turning, FULL_TURN, 0.0))


def even_clock(
    rows: int, period: float | None, given_by: str = "period", like: str = ""
) -> tuple[IntArray, tuple[Inference, ...], list[LogWarning]]:
    """Return the times of a log without a clock in [ns], shape (rows,), the evidence, and a warning.

    Args:
        rows: Number of rows.
        period: Time between rows in [s], if the user gives it.
        given_by: The keyword that gives it, for errors.
        like: A column that may be the time, for the warning.

    Raises:
        OptionError: If the period is not a positive time of 1 ns or more.
    """
    if period is not None and not (math.isfinite(period) and period >= 1e-9):
        allowed = "a positive time of 1e-9 s or more"
        raise OptionError(Finding(parameter=given_by, found=f"{period:g} s", allowed=allowed))
    step = DEFAULT_PERIOD if period is None else period
    if rows * step * 1e9 >= MAX_NS:
        allowed = f"less than {MAX_NS / 1e9 / rows:g} s for {rows} rows"
        raise OptionError(Finding(parameter=given_by, found=f"{step:g} s", allowed=allowed))
    times = np.rint(np.arange(rows) * (step * 1e9)).astype(np.int64)
    basis: Basis = "assumed" if period is None else "given"
    evidence = "no column is a time, and no rates show it" if period is None else "given as an option"
    inferences = (Inference("period", f"{step:g} s", evidence, hints=(Hint("period"),), basis=basis),)
    if period is not None:
        return times, inferences, []
    rising = Hint("time", like, "takes this column as the time: it always increases")
    message, assumption = "no time column: the rows are taken as 5 ms apart", "the rows are 5 ms apart"
    hints = (Hint("period", None, "sets another time between rows"), rising if like else OTHER_TIME[0])
    warning = LogWarning(ASSUMED_PERIOD, message, hints=hints, assumption=assumption, role="time")
    return times, inferences, [warning]


def unused_period(keyword: str) -> LogWarning:
    """Return the warning that a period has no effect, since the file has a clock; by its keyword."""
    hints = (Hint("time", "none", "leaves the clock out"),)
    return LogWarning("period-not-used", "no effect: the log has a clock", parameter=keyword, hints=hints)


def unused_for_poses(options: Mapping[str, object]) -> list[LogWarning]:
    """Return a warning for each option with a value, all about motions, since the rows are static poses."""
    message = "no effect: the rows are static poses, which have no time"
    return [LogWarning("not-for-poses", message, parameter=name) for name, value in options.items() if value]


# Times in a separate file


def split_file_column(time: str | None) -> tuple[Path, str] | None:
    """Return file and column of FILE:COLUMN; None for the name of a column.

    The file ends at the last colon before which the name of a file is.
    """
    parts = (time or "").split(":")
    for k in range(len(parts) - 1, 0, -1):
        file, column = ":".join(parts[:k]), ":".join(parts[k:])
        if column and os.path.isfile(file):  # noqa: PTH113 (for a name that is too long Path raises)
            return Path(file), column
    return None


def append_time_file(tables: Tables, options: LogMap) -> tuple[Tables, int | None]:
    """Return the tables of a log with that of the file of times that the user gives, and its index or None.

    Raises:
        LogError: If the file is not a table.
        OptionError: If the log has several tables.
    """
    file_column = split_file_column(options.time)
    if file_column is None:
        return tables, None
    if len(tables.tables) > 1:
        fault = f"{format_value(options.time or '')} for {len(tables.tables)} tables"
        raise OptionError(Finding(parameter="time", found=fault, allowed="FILE:COLUMN for one table"))
    times = open_tables([file_column[0]], LogMap())  # it may be written in another way than the log
    table, rows = across(times.tables[0]), tables.tables[0].rows
    if rows is not None and rows[-1] < table.count_rows():
        table = table.take(rows)
    titles = (*tables.titles, times.titles[0])
    return replace(tables, tables=(*tables.tables, table), titles=titles), 1


def find_time_file(tables: Tables, columns: Sequence[Column]) -> int | None:
    """Return which of two tables has only the times of the other; None if neither does.

    It is a single column or row that is named like a time, or whose file is; or the only one of the two,
    without a header, that runs in even steps.
    """
    if len(tables.tables) != 2 or len(set(tables.paths)) != 2:
        return None
    in_tables = [[column for column in columns if column.table == k] for k in (0, 1)]
    single = [k for k in (0, 1) if len(in_tables[k]) == 1]
    named = [k for k in single if is_named_time(in_tables[k][0].key) or is_named_time(key(tables.titles[k]))]
    if len(named) == 1:
        return named[0]
    unnamed = [(k, tables.tables[k]) for k in single if tables.tables[k].header is None]
    even = [k for k, table in unnamed if runs_evenly(table.numbers(0))]
    return even[0] if len(single) == len(even) == 1 else None


def find_clocks_with_file(
    tables: Tables, columns: Sequence[Column], index: int, options: LogMap, units: Mapping[int, Unit]
) -> tuple[Clock, ...]:
    """Return the clocks of two tables, of which one has the times of the other.

    A clock of the other table is not read, but its columns are no joints.

    Raises:
        LogError: If both tables have a time and the user gives none, or if its unit is ambiguous.
    """
    in_file = tuple(column for column in columns if column.table == index)
    in_log = [column for column in columns if column.table != index]
    table, log_table = tables.tables[index], tables.tables[1 - index]
    unused, file_column = Clock(), split_file_column(options.time)
    if file_column is None:
        title, source = table.path.name, tables.known
        for column in in_log:
            if is_named_time(column.key):
                hints = (Hint("time", None, "selects the column"), Hint("time", "none", "leaves both out"))
                message, line = f"found a time here and in {title}, allowed: one clock", log_table.header_line
                raise LogError(Finding(message, log_table.file, line, column=column.header, hints=hints))
        form = "one row" if table.across else "one column"
        time, value = TimeColumns(in_file, f"{title} holds nothing but {form} of times"), ""
    else:
        numbered = [replace(column, number=column.index + 1) for column in in_file]
        column = in_file[find_column(numbered, file_column[1], parameter="time").index]
        time, source = complete_time(column, in_file, table), None
        value = f"{file_column[0].name}:{file_column[1]}"
        try:
            without = replace(options, time=None)
            unused = Clock(find_time_columns(in_log, log_table, without, None).columns)
        except LogError:  # it may have a time or not: the given one is used
            pass
    clock = make_clock(time, table, source, units, is_label=bool(options.poses))
    first, *further = clock.inferences
    first = replace(first, value=value or first.value, kind=TIME_FILE)
    clock = clock._replace(inferences=(first, *further))
    return tuple(clock if table == index else unused for table in (0, 1))
