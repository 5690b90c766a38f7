"""Times in a file of their own: a column, or a row of n values as MATLAB's writematrix leaves a vector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from urmpipe_models.errors import Finding, LogError
from urmpipe_models.messages import Hint
from urmpipe_pipeline.sources.clocks.clock import Clock, clock_of
from urmpipe_pipeline.sources.clocks.clock_columns import runs_evenly
from urmpipe_pipeline.sources.columns.columns import Column
from urmpipe_pipeline.sources.tables.opening import Tables
from urmpipe_pipeline.sources.vocabulary import Unit, key, vocabulary

TIME_FILE = "time file"
"""The kind of the inference about a clock that is a file of its own."""


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
    tables: Tables, columns: Sequence[Column], index: int, units: dict[int, Unit], *, label: bool = False
) -> Clock:
    """Return the clock that a file of times makes; as a label it has no times.

    Raises:
        LogError: If the other table has a time as well, or the unit of the times cannot be told.
    """
    layout, title = tables.layouts[index], tables.layouts[index].segment.path.name
    for column in columns:
        if column.table != index and _is_time(column.key):
            other = tables.layouts[column.table]
            hints = (Hint("time", None, "says which column"),)
            message, file = f"found a time here and in {title}, allowed: one clock", other.file
            raise LogError(Finding(message, file, other.header_line, column=column.header, hints=hints))
    own = tuple(column for column in columns if column.table == index)
    form = "one row" if layout.across else "one column"
    found = clock_of(
        own, f"{title} holds nothing but {form} of times", layout, tables.known, units, label=label
    )
    first, *others = found.inferences
    return replace(found, inferences=(replace(first, kind=TIME_FILE), *others))


def _is_named(tables: Tables, columns: Sequence[Column], index: int) -> bool:
    own = next(column for column in columns if column.table == index)
    return _is_time(own.key) or _is_time(key(tables.titles[index]))


def _is_time(name: str) -> bool:
    return any(pattern.search(name) for pattern in (*vocabulary().time, *vocabulary().dates))
