"""The numbers of a log's tables: read, checked, and joined on the same time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, map_collecting_errors
from urmpipe_pipeline.joint_log import Inference, LogWarning, number_rows
from urmpipe_pipeline.logs.checks import (
    MOST_SKIPPED,
    find_errors,
    may_skip,
    rebuilt,
    trimmed,
    without_unread,
)
from urmpipe_pipeline.logs.clocks.durations import summed
from urmpipe_pipeline.logs.clocks.nights import over_midnight
from urmpipe_pipeline.logs.clocks.text_times import timed
from urmpipe_pipeline.logs.columns.columns import Column
from urmpipe_pipeline.logs.columns.roles import Roles
from urmpipe_pipeline.logs.plan import Plan
from urmpipe_pipeline.logs.poses import as_poses
from urmpipe_pipeline.logs.tables.numbers import Numbers
from urmpipe_pipeline.logs.tables.padding import without_padding
from urmpipe_pipeline.logs.tables.row_reader import first_left_out, lines_of_rows


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """The numbers of the columns that are used, in the file's own units.

    Attributes:
        columns: The columns that were read, by table.
        numbers: Their numbers, by table.
        clock: Times of the rows in [ns] on the file's clock, shape (n,); None without one.
        rows: How many rows there are.
        still: Whether they are static poses.
        roles: The columns, without those that could not be joined.
        inferences: What was found out while reading the times and joining.
        warnings: What was left out, and what a person should know about the times.
    """

    columns: Mapping[int, tuple[Column, ...]]
    numbers: Mapping[int, Numbers]
    clock: IntArray | None
    rows: int
    still: bool
    roles: Roles
    inferences: tuple[Inference, ...]
    warnings: tuple[LogWarning, ...]

    def values(self, group: Sequence[Column]) -> FloatArray:
        """Return the numbers of some columns in the file's own units, shape (n, columns).

        They are C-contiguous, and no copy if they are all.
        """
        if not group:
            return np.empty((self.rows, 0))
        table = group[0].table
        if tuple(group) == self.columns[table]:
            return self.numbers[table].values
        places = ((column.table, self.columns[column.table].index(column)) for column in group)
        return np.stack([self.numbers[table].values[:, place] for table, place in places], axis=1)


def read_content(plan: Plan, *, skip_bad: bool = False) -> Content:
    """Return the numbers that a plan asks for.

    Raises:
        LogError: With everything that is wrong with rows, cells and times of all tables, or if the files
            of one log differ in their times.
    """
    columns = {t: tuple(c for c in plan.roles.columns if c.table == t) for t in plan.used}
    read = map_collecting_errors(lambda table: _numbers(plan, table, columns[table], skip_bad), plan.used)
    numbers = dict(zip(plan.used, read, strict=True))
    roles, said = _joined(plan, numbers)
    if plan.time_file is not None:
        numbers[plan.main] = _with_times(plan, numbers[plan.main], skip_bad)
    main = numbers[plan.main]
    said = (*main.inferences, *said)
    warnings = tuple(dict.fromkeys(warning for one in numbers.values() for warning in one.warnings))
    return Content(columns, numbers, main.clock, len(main.values), main.still, roles, said, warnings)


def _numbers(plan: Plan, table: int, columns: Sequence[Column], skip_bad: bool) -> Numbers:
    """Return the numbers of one table; raise what is wrong with them."""
    layout, clock = plan.tables.layouts[table], plan.clocks[table]
    places = [column.index for column in columns]
    numbers = plan.tables.whole[table].table(places, clock.parts)
    unread = f"{len(numbers.unread)} of {len(numbers.values)} rows cannot be read"
    too_many, warnings, file = None, [], layout.file
    if numbers.left_out and layout.form is not None:
        line, text = first_left_out(layout)
        verb = "is" if numbers.left_out == 1 else "are"
        said = f"{format_count(numbers.left_out, 'line')} without the labels of the rows {verb} left out"
        warnings.append(LogWarning("other-lines", f"{said}, first line {line}: {text}"))
    if skip_bad and may_skip(numbers):
        numbers, skipped = without_unread(numbers)
        warnings += skipped
    elif skip_bad and numbers.unread:
        too_many = Finding(unread, file, parameter="skip_bad", allowed=f"{MOST_SKIPPED:.0%} of them")
    elif may_skip(numbers):
        too_many = Finding(unread, file, hints=(Hint("skip_bad", True, "leaves them out"),))
    numbers, inferences = trimmed(timed(layout, clock.parts, numbers))
    numbers = over_midnight(numbers, clock)
    numbers, padding = without_padding(numbers, lambda: plan.tables.whole[table].read)
    if clock.lasts:
        numbers = summed(numbers, clock.columns[0].name)
    numbers = rebuilt(as_poses(plan, columns, numbers))
    if not len(numbers.values) and not numbers.findings:
        message = "found no row with a time or a number in the columns that are used, allowed: at least one"
        raise LogError(Finding(message, file))
    findings = find_errors(layout, numbers, [column.header for column in columns], clock)
    if findings:
        raise LogError(*findings, *([too_many] if too_many else []))
    warned = (*warnings, *padding, *number_rows(numbers.warnings, numbers.file_row))
    return replace(numbers, inferences=(*inferences, *numbers.inferences), warnings=warned)


def _with_times(plan: Plan, main: Numbers, skip_bad: bool) -> Numbers:
    """Return the numbers of the main table with the times of the other file, one for each row."""
    assert plan.time_file is not None
    times = _numbers(plan, plan.time_file, (), skip_bad)
    if len(times.values) != len(main.values):
        file, title = plan.tables.layouts[plan.time_file].file, plan.tables.paths[plan.main].name
        message = f"found {len(times.values)} times, allowed: {len(main.values)}, as {title} has rows"
        raise LogError(Finding(message, file))
    warnings = (*main.warnings, *times.warnings)
    return replace(main, clock=times.clock, inferences=times.inferences, warnings=warnings)


def _joined(plan: Plan, numbers: Mapping[int, Numbers]) -> tuple[Roles, tuple[Inference, ...]]:
    """Return the roles, without a recorded TCP from another graph that was sampled at other times."""
    roles = plan.roles
    findings = []
    for table in plan.used[1:]:
        difference = _difference(plan, numbers, table)
        if difference is None:
            continue
        needed = roles.joints or roles.position
        if any(column.table == table for column in needed) or len(set(plan.tables.paths)) > 1:
            findings.append(difference)
            continue
        roles = roles.without([column for column in roles.columns if column.table == table])
    if findings:
        raise LogError(*findings)
    if roles == plan.roles:
        return roles, ()
    return roles, (Inference("other graphs", "left out", "they were sampled at other times than the joints"),)


def _difference(plan: Plan, numbers: Mapping[int, Numbers], table: int) -> Finding | None:
    """Return where the times of a table differ from those of the main one."""
    main, other = numbers[plan.main], numbers[table]
    layout = plan.tables.layouts[table]
    file, title = layout.file, plan.tables.titles[plan.main]
    if (main.clock is None) != (other.clock is None):
        here, there = ("no time column", "with one") if other.clock is None else ("a time column", "without")
        return Finding(f"found {here}, allowed: {there}, as in {title}: one log has one clock", file)
    if main.clock is not None and other.clock is not None:
        count = min(len(main.clock), len(other.clock))
        different = np.flatnonzero(main.clock[:count] != other.clock[:count])
        if len(different):
            row = int(different[0])
            times = f"{other.clock[row] / 1e9:.9g} s, allowed: {main.clock[row] / 1e9:.9g} s"
            message = f"found {times}, as in {title}: the tables of one log share their times"
            at = other.file_row(row + 1)
            line = lines_of_rows(layout, [at]).get(at)
            return Finding(message, file, line, at, plan.clocks[table].columns[0].header)
    if len(main.values) != len(other.values):
        message = f"found {len(other.values)} rows, allowed: {len(main.values)}, as in {title}"
        return Finding(f"{message}: the tables of one log share their times", file)
    return None
