"""The rows of a log: the numbers of its columns, checked, with a time each, joined over its tables.

1. `read_rows`: the rows of each table, without those that hold no sample, and their times: texts are read, a
   day follows each midnight, durations are summed, repeated times are spread, static poses have none.
2. `find_row_errors`: rows that cannot be read, times that are missing, repeat or run backwards, infinities.
3. Tables of one log share their times; a recorded TCP of another graph that does not is left out.
4. `missing_warnings`, `gap_warnings`: what a user should check.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, map_collecting_errors
from urmpipe_pipeline.joint_log import GAP, Inference, LogWarning, has_gap_after, number_rows
from urmpipe_pipeline.logs.clock import Clock
from urmpipe_pipeline.logs.clock_columns import OTHER_CLOCK, OTHER_TIME
from urmpipe_pipeline.logs.columns import Column, unit_hints
from urmpipe_pipeline.logs.formats.cells import MAX_CELL_LENGTH
from urmpipe_pipeline.logs.formats.clock_forms import EXPONENTS, NO_TIME, UNREADABLE
from urmpipe_pipeline.logs.formats.log_table import MAX_FINDINGS, LogTable, Numbers, without_padding
from urmpipe_pipeline.logs.formats.shape import ROWS_READ
from urmpipe_pipeline.logs.formats.text_table import TextTable
from urmpipe_pipeline.logs.plan import Plan
from urmpipe_pipeline.logs.roles import Roles
from urmpipe_pipeline.logs.timestamps import (
    are_many,
    continue_over_midnight,
    detect_static_poses,
    read_text_times,
    separate_repeated,
    sum_durations,
)

SKIPPED = "skipped-row"  # warnings of rows that were left out
OTHER_LINES = "other-lines"  # ... and of lines without the labels of the rows
MAX_SKIPPED = 0.01  # share of the rows that may be left out because they cannot be read
MIN_RETURN = 10.0  # median periods; a clock that falls back by more, to about its first time, begins again
MAX_LISTED = 10  # gaps and logs that are listed with their rows; the others are counted
_INCREASING = "times that increase from row to row"


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """The numbers of the columns that are used, in the file's own units.

    Attributes:
        columns: The columns that were read, by table.
        numbers: Their numbers, by table.
        clock: Times of the rows in [ns] on the file's clock, shape (n,); None without one.
        are_poses: Whether they are static poses.
        roles: The columns, without those that could not be joined.
        inferences: What was inferred about the times and the tables.
        warnings: What was left out, and what a user should check about the times.
    """

    columns: Mapping[int, tuple[Column, ...]]
    numbers: Mapping[int, Numbers]
    clock: IntArray | None
    are_poses: bool
    roles: Roles
    inferences: tuple[Inference, ...]
    warnings: tuple[LogWarning, ...]

    @property
    def count(self) -> int:
        """The number of rows."""
        return len(next(iter(self.numbers.values())).values)

    def values(self, group: Sequence[Column]) -> FloatArray:
        """Return the numbers of some columns in the file's own units, shape (n, columns).

        They are C-contiguous, and no copy if they are all columns of their table.
        """
        if not group:
            return np.empty((self.count, 0))
        table = group[0].table
        if tuple(group) == self.columns[table]:
            return self.numbers[table].values
        places = ((column.table, self.columns[column.table].index(column)) for column in group)
        return np.stack([self.numbers[table].values[:, place] for table, place in places], axis=1)


def read_rows(plan: Plan, *, skip_bad: bool = False) -> Rows:
    """Return the rows of the columns of a plan.

    Args:
        plan: The columns and clocks.
        skip_bad: Whether rows that cannot be read are left out, up to one in a hundred.

    Raises:
        LogError: With everything that is wrong with rows, cells and times of all tables, or if the files
            of one log differ in their times.
    """
    columns = {table: tuple(c for c in plan.roles.columns if c.table == table) for table in plan.used}
    read = map_collecting_errors(lambda table: _read_table(plan, table, columns[table], skip_bad), plan.used)
    numbers = dict(zip(plan.used, read, strict=True))
    roles, inferences = _join_tables(plan, numbers)
    if plan.time_file is not None:
        times = _read_table(plan, plan.time_file, (), skip_bad)
        numbers[plan.main] = _with_times(plan, numbers[plan.main], times)
    main = numbers[plan.main]
    warnings = tuple(dict.fromkeys(warning for each in numbers.values() for warning in each.warnings))
    inferences = (*main.inferences, *inferences)
    return Rows(columns, numbers, main.clock, main.still, roles, inferences, warnings)


def _read_table(plan: Plan, index: int, columns: Sequence[Column], skip_bad: bool) -> Numbers:
    table, clock = plan.tables.tables[index], plan.clocks[index]
    numbers = table.read([column.index for column in columns], clock.parts)
    numbers, warnings, too_many = _skip_unread(table, numbers, skip_bad)
    numbers, inferences = _drop_empty_end(read_text_times(table, clock.parts, numbers))
    numbers = continue_over_midnight(numbers, clock)
    numbers, padding = without_padding(numbers, lambda: table.all_rows)
    if clock.are_durations:
        numbers = sum_durations(table, numbers, clock)
    numbers = separate_repeated(detect_static_poses(plan, columns, numbers))
    if not len(numbers.values) and not numbers.findings:
        message = "found no row with a time or a number in the columns that are used, allowed: at least one"
        raise LogError(Finding(message, table.file))
    errors = find_row_errors(table, numbers, [column.header for column in columns], clock)
    if errors:
        raise LogError(*errors, *too_many)
    warnings = [*warnings, *padding, *number_rows(numbers.warnings, numbers.file_row)]
    return replace(numbers, inferences=(*inferences, *numbers.inferences), warnings=tuple(warnings))


def _skip_unread(
    table: LogTable, numbers: Numbers, skip_bad: bool
) -> tuple[Numbers, list[LogWarning], list[Finding]]:
    """Return the numbers without rows that cannot be read, warnings, and how errors are left out."""
    warnings = []
    if numbers.left_out and isinstance(table, TextTable):
        line, text = table.first_other_line()
        lines = f"{format_count(numbers.left_out, 'line')} without the labels of the rows"
        verb = "is" if numbers.left_out == 1 else "are"
        message = f"{lines} {verb} left out, first line {line}: {text}"
        warnings.append(LogWarning(OTHER_LINES, message))
    if not numbers.unread:
        return numbers, warnings, []
    unread = f"{len(numbers.unread)} of {len(numbers.values)} rows cannot be read"
    are_few = len(numbers.unread) <= MAX_SKIPPED * len(numbers.values)
    if not skip_bad:
        hint = Hint("skip_bad", True, "leaves them out")
        return numbers, warnings, [Finding(unread, table.file, hints=(hint,))] if are_few else []
    if not are_few:
        allowed = f"{MAX_SKIPPED:.0%} of them"
        return numbers, warnings, [Finding(unread, table.file, parameter="skip_bad", allowed=allowed)]
    faults = sorted((numbers.file_row(row + 1), texts) for row, texts in numbers.unread.items())
    for row, texts in faults[:MAX_FINDINGS]:
        message = f"data row {row} of the file is left out: {'; '.join(map(str, texts))}"
        warnings.append(LogWarning(SKIPPED, message, row))
    if len(faults) > MAX_FINDINGS:
        warnings.append(LogWarning(SKIPPED, f"{len(faults) - MAX_FINDINGS} more rows are left out"))
    rows = np.delete(np.arange(len(numbers.values)), sorted(numbers.unread))
    return replace(numbers.at(rows), findings=numbers.lasting), warnings, []


def _drop_empty_end(numbers: Numbers) -> tuple[Numbers, tuple[Inference, ...]]:
    """Return the numbers without rows at the end that have neither a time nor a value."""
    if numbers.clock is None:
        return numbers, ()
    end = rows = len(numbers.clock)
    while end and numbers.clock[end - 1] == NO_TIME and np.isnan(numbers.values[end - 1]).all():
        end -= 1
    if end == rows:
        return numbers, ()
    why = f"{format_count(rows - end, 'row')} at the end left out, without a time and a value"
    return numbers.at(slice(end)), (Inference(ROWS_READ, f"{end} of {rows}", why),)


def _with_times(plan: Plan, main: Numbers, times: Numbers) -> Numbers:
    """Return the numbers of the main table with the times of another file, one for each row."""
    assert plan.time_file is not None
    if len(times.values) != len(main.values):
        file, title = plan.tables.tables[plan.time_file].file, plan.tables.paths[plan.main].name
        message = f"found {len(times.values)} times, allowed: {len(main.values)}, as {title} has rows"
        raise LogError(Finding(message, file))
    warnings = (*main.warnings, *times.warnings)
    return replace(main, clock=times.clock, inferences=times.inferences, warnings=warnings)


def _join_tables(plan: Plan, numbers: Mapping[int, Numbers]) -> tuple[Roles, tuple[Inference, ...]]:
    """Return the roles, without a recorded TCP of another graph that was sampled at other times."""
    roles, errors = plan.roles, []
    for table in plan.used[1:]:
        difference = _find_difference(plan, numbers, table)
        if difference is None:
            continue
        is_needed = any(column.table == table for column in roles.joints or roles.position)
        if is_needed or len(set(plan.tables.paths)) > 1:
            errors.append(difference)
        else:
            roles = roles.without([column for column in roles.columns if column.table == table])
    if errors:
        raise LogError(*errors)
    why = "they were sampled at other times than the joints"
    return roles, () if roles == plan.roles else (Inference("other graphs", "left out", why),)


def _find_difference(plan: Plan, numbers: Mapping[int, Numbers], index: int) -> Finding | None:
    """Return where the times of a table differ from those of the main one; None if they do not."""
    main, other, table = numbers[plan.main], numbers[index], plan.tables.tables[index]
    title, one_log = plan.tables.titles[plan.main], "the tables of one log share their times"
    if (main.clock is None) != (other.clock is None):
        here, there = ("no time column", "with one") if other.clock is None else ("a time column", "without")
        message = f"found {here}, allowed: {there}, as in {title}: one log has one clock"
        return Finding(message, table.file)
    if main.clock is not None and other.clock is not None:
        count = min(len(main.clock), len(other.clock))
        different = np.flatnonzero(main.clock[:count] != other.clock[:count])
        if len(different):
            k = int(different[0])
            times = f"{other.clock[k] / 1e9:.9g} s, allowed: {main.clock[k] / 1e9:.9g} s"
            row, name = other.file_row(k + 1), plan.clocks[index].columns[0].header
            message = f"found {times}, as in {title}: {one_log}"
            return Finding(message, table.file, table.lines_of([row]).get(row), row, name)
    if len(main.values) != len(other.values):
        message = f"found {len(other.values)} rows, allowed: {len(main.values)}, as in {title}: {one_log}"
        return Finding(message, table.file)
    return None


# What no log may hold


def find_row_errors(table: LogTable, numbers: Numbers, names: Sequence[str], clock: Clock) -> list[Finding]:
    """Return everything that is wrong with the rows of a table, in the order of its lines.

    These are the first findings, and one that counts the others.

    Args:
        table: The table.
        numbers: Its rows.
        names: The names of the columns that were read.
        clock: Its clock.
    """
    errors = [*_iter_clock_errors(numbers, clock), *_iter_infinities(numbers, names)]
    total = len(numbers.findings) + len(errors)
    errors.sort(key=lambda error: (error.row or 0, error.column or "", error.message))
    rows = [numbers.file_row(error.row or 0) for error in errors[:MAX_FINDINGS]]
    lines, file = table.lines_of(rows), table.file
    placed = [
        replace(error, file=file, line=lines.get(row), row=row)
        for error, row in zip(errors, rows, strict=False)
    ]
    times = {column.header for column in clock.columns}
    for error in numbers.findings:
        is_of_clock = error.column in times and not error.hints
        placed.append(replace(error, hints=OTHER_TIME) if is_of_clock else error)
    listed = sorted(placed, key=lambda error: error.line or 0)[:MAX_FINDINGS]
    more = total - len(listed)
    return [*listed, *([Finding(f"{more} more findings", file=file)] if more > 0 else [])]


def _iter_clock_errors(numbers: Numbers, clock: Clock) -> Iterator[Finding]:
    """Yield row and column where the time is missing, repeated or runs backwards."""
    times = numbers.clock
    if times is None or not len(times) or not clock.columns:
        return
    name = clock.columns[0].header
    yield from _iter_times_of_day(times, clock)
    if times.min() > UNREADABLE and (np.diff(times) > 0).all():
        return
    yield from unknown_times(numbers, clock)
    known = np.flatnonzero(times > UNREADABLE)
    steps = np.diff(times[known])
    backwards, repeated = np.flatnonzero(steps < 0), np.flatnonzero(steps == 0)
    if len(backwards) and np.array_equal(backwards, starts := _find_new_starts(times[known], steps)):
        yield _several_logs(known[starts + 1], numbers, name)
        return

    def error(k: int, more: str, hints: tuple[Hint, ...]) -> Finding:
        now, before = (clock.format(int(times[known[i]])) for i in (k + 1, k))
        where = "again" if steps[k] == 0 else f"after {before}"
        message = f"found {now} {where}{more}, allowed: {_INCREASING}"
        return Finding(message, row=int(known[k + 1]) + 1, column=name, hints=hints)

    if are_many(len(backwards), len(times)):
        more = f", as {len(backwards)} of {len(times)} rows run backwards: no clock"
        yield error(int(backwards[0]), more, OTHER_CLOCK)
    else:
        yield from (error(k, "", OTHER_TIME) for k in backwards.tolist())
    if len(repeated) and not len(backwards) and len(known) == len(times):  # others are spread
        more = f", as {len(repeated)} of {len(times)} rows repeat a time: too coarse to rebuild a clock"
        yield error(int(repeated[0]), more, OTHER_CLOCK)


def unknown_times(numbers: Numbers, clock: Clock) -> Iterator[Finding]:
    """Yield row and column where a row has no time, or one that cannot be read."""
    if numbers.clock is None or not clock.columns:
        return
    name, has_none = clock.columns[0].header, numbers.clock == NO_TIME
    known = np.flatnonzero(~has_none)
    is_within = len(known) > 0 and not has_none[known[0] : known[-1]].any()
    rows = (
        (
            Hint(
                "rows",
                f"{numbers.file_row(int(known[0]) + 1)}:{numbers.file_row(int(known[-1]) + 1)}",
                "reads those with a time",
            ),
        )
        if is_within
        else ()
    )
    for k in np.flatnonzero(has_none).tolist():
        message = "found no time, allowed: a time in every row"
        yield Finding(message, row=k + 1, column=name, hints=(*rows, *OTHER_TIME))
    for k in np.flatnonzero(numbers.clock == UNREADABLE).tolist():
        text = " ".join(cells.text(k).strip() for cells in numbers.texts)
        message = f"found {text[:MAX_CELL_LENGTH]!r}, allowed: times as in the other rows"
        yield Finding(message, row=k + 1, column=name, hints=OTHER_TIME)


def _iter_times_of_day(times: IntArray, clock: Clock) -> Iterator[Finding]:
    """Yield where numbers continue as times of day written hhmmss: 101159 is followed by 101200."""
    if clock.stated_by or clock.are_durations or clock.unit not in EXPONENTS:
        return
    unit = 10 ** EXPONENTS[clock.unit]
    if len(times) < 3 or times.min() <= UNREADABLE or (steps := np.diff(times)).max() <= 40 * unit:
        return
    seconds, minutes = times // unit % 100, times // (100 * unit) % 100
    late = np.where(steps < 4040 * unit, steps - 40 * unit, steps - 4040 * unit)  # 60 s are 100, 1 h 10000
    jumps = (late > 0) & (late <= GAP * np.median(steps)) & (seconds[1:] < seconds[:-1])
    if not jumps.any() or (seconds >= 60).any() or (minutes >= 60).any():
        return
    k = int(np.flatnonzero(jumps)[0])
    after, before = (f"{times[i] / unit:.15g}" for i in (k + 1, k))
    message = f"found {after} after {before}, as times of day hhmmss continue, allowed: a clock of one unit"
    in_unit = unit_hints(clock.columns[:1], clock.unit, "takes it as no time of day")
    hints = (Hint("", effect="write it as hh:mm:ss"), *in_unit, *OTHER_TIME)
    yield Finding(message, row=k + 2, column=clock.columns[0].header, hints=hints)


def _find_new_starts(times: IntArray, steps: IntArray) -> IntArray:
    """Return the steps back to about the first time, after which the times continue: several logs."""
    if len(steps) < 3:
        return np.empty(0, dtype=np.int64)
    period = np.median(np.abs(steps))
    is_far_back = steps < -MIN_RETURN * period
    is_near_first = np.abs(times[1:] - times[0]) <= GAP * period
    continues = np.append((steps[1:] > 0) & (steps[1:] <= GAP * period), False)
    return np.flatnonzero(is_far_back & is_near_first & continues)


def _several_logs(starts: IntArray, numbers: Numbers, name: str) -> Finding:
    """Return the finding that a clock begins again at some rows, from 0: episodes or repetitions."""
    rows = [numbers.file_row(int(row) + 1) for row in starts]
    ends = [*(row - 1 for row in rows), numbers.file_row(len(numbers.values))]
    logs = [f"{first}:{last}" for first, last in zip([numbers.file_row(1), *rows], ends, strict=True)]
    hints = (*(Hint("rows", log, "reads one") for log in logs[:MAX_LISTED]), *OTHER_TIME)
    listed = ", ".join(map(str, rows[:MAX_LISTED])) + (", ..." if len(rows) > MAX_LISTED else "")
    again = f"the clock begins again in row{'s' * (len(rows) > 1)} {listed}"
    message = f"found {len(logs)} logs in one file: {again}, allowed: one log"
    return Finding(message, row=int(starts[0]) + 1, column=name, hints=hints)


def _iter_infinities(numbers: Numbers, names: Sequence[str]) -> Iterator[Finding]:
    for j in _find_not_finite(numbers.values):
        column = numbers.values[:, j]
        for k in np.flatnonzero(np.isinf(column)).tolist():
            message = f"found {column[k]}, allowed: finite numbers"
            yield Finding(message, row=k + 1, column=names[j])


def _find_not_finite(values: FloatArray) -> list[int]:
    """Return the columns that may hold NaN or infinities, by their sums, which are quickly made."""
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(values.sum()):
            return []
        return np.flatnonzero(~np.isfinite(values.sum(axis=0))).tolist()


def check_not_empty(values: FloatArray, names: Sequence[str], file: str) -> None:
    """Raise if a column has no value at all.

    Args:
        values: In the file's own units, shape (n, columns).
        names: Of the columns.
        file: The file that they are of.

    Raises:
        LogError: With a finding for each such column.
    """
    empty = [names[j] for j in _find_not_finite(values) if np.isnan(values[:, j]).all()]
    message = f"found no value in any of {len(values)} rows, allowed: at least one"
    if empty:
        raise LogError(*(Finding(message, file, column=name) for name in empty))


# What a user should check


def missing_warnings(groups: Iterable[tuple[FloatArray, Sequence[str]]]) -> list[LogWarning]:
    """Return a warning for the columns in which samples are missing, those that lack the same rows together.

    The columns come in groups with their names: values in any unit, shape (n, columns).
    """
    by_rows: dict[bytes, tuple[BoolArray, list[str]]] = {}
    for values, names in groups:
        for j in _find_not_finite(values):
            is_missing = np.isnan(values[:, j])
            if is_missing.any():
                by_rows.setdefault(is_missing.tobytes(), (is_missing, []))[1].append(names[j])
    warnings = []
    for is_missing, columns in by_rows.values():
        count = f"{np.count_nonzero(is_missing)} of {len(is_missing)} rows"
        verb = "has" if len(columns) == 1 else "have"
        message = f"{', '.join(columns)} {verb} no value in {count}, first in this one"
        warnings.append(LogWarning("missing", message, int(np.argmax(is_missing)) + 1))
    return warnings


def gap_warnings(t_ns: IntArray, file_row: Callable[[int], int]) -> list[LogWarning]:
    """Return a warning with each gap between two rows at times in [ns], shape (n,).

    Args:
        t_ns: The times.
        file_row: The data row of the file of a row, both from 1.
    """
    gaps = np.flatnonzero(has_gap_after(t_ns)).tolist()
    if not gaps:
        return []
    steps = np.diff(t_ns)
    parts = [f"{steps[gaps[0]] / 1e9:.6g} s pass before this row"]
    parts += [f"{steps[k] / 1e9:.6g} s before row {file_row(k + 2)}" for k in gaps[1:MAX_LISTED]]
    if len(gaps) > MAX_LISTED:
        longest = max(gaps, key=lambda k: steps[k])
        where = f"{steps[longest] / 1e9:.6g} s before row {file_row(longest + 2)}"
        parts.append(f"{len(gaps) - MAX_LISTED} more, the longest of all of {where}")
    count = f"{len(gaps)} gaps: " if len(gaps) > 1 else ""
    message = f"{count}{', '.join(parts)}; the median period is {float(np.median(steps)) / 1e9:.6g} s"
    return [LogWarning("gap", message, file_row(gaps[0] + 2))]
