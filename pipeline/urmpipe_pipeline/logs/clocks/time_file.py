"""Times in a file of their own: a column, or a row of n values as MATLAB's writematrix leaves a vector.

Of a file with more columns the user names the one with the times: FILE:COLUMN.
"""

from __future__ import annotations

import os.path
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_pipeline.logs.clocks.chosen import Chosen
from urmpipe_pipeline.logs.clocks.clock import Clock, clock_of
from urmpipe_pipeline.logs.clocks.clock_columns import given_time, time_columns
from urmpipe_pipeline.logs.clocks.steps import runs_evenly
from urmpipe_pipeline.logs.columns.columns import Column, find_column
from urmpipe_pipeline.logs.options import LogMap
from urmpipe_pipeline.logs.tables.opening import Tables, open_tables
from urmpipe_pipeline.logs.tables.rows import count_rows, with_rows
from urmpipe_pipeline.logs.tables.sniff import across
from urmpipe_pipeline.logs.tables.whole import Whole
from urmpipe_pipeline.logs.vocabulary import Unit, key, vocabulary

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
    if rows is not None and rows[-1] < count_rows(layout):
        layout = with_rows(layout, rows)
    layouts, titles = (*tables.layouts, layout), (*tables.titles, apart.titles[0])
    return replace(tables, layouts=layouts, titles=titles, whole=(*tables.whole, Whole(layout))), 1


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
    layout, whole = tables.layouts[index], tables.whole[index]
    numbered = [replace(column, number=column.index + 1) for column in own[index]]
    column = own[index][find_column(numbered, named[1], parameter="time").index]
    chosen = given_time(column, own[index], layout, whole)
    found = clock_of(chosen, layout, None, units, label=options.poses)
    first, *others = found.inferences
    title = f"{named[0].name}:{named[1]}"
    said = replace(first, value=title, kind=TIME_FILE)
    main = 1 - index
    try:
        beside = time_columns(
            own[main], tables.layouts[main], replace(options, time=None), None, tables.whole[main]
        )
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
    layout, title = tables.layouts[index], tables.layouts[index].segment.path.name
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
