"""Which columns of a table hold the time: by their names, or by what stands in them."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from urmpipe_pipeline.logs.cells.cell import count_up
from urmpipe_pipeline.logs.cells.text_clock import DATE, TIME_OF_DAY
from urmpipe_pipeline.logs.clocks.chosen import Chosen
from urmpipe_pipeline.logs.clocks.digits import dates_in_digits
from urmpipe_pipeline.logs.clocks.durations import durations, is_duration
from urmpipe_pipeline.logs.clocks.halves import halves_beside, named_halves
from urmpipe_pipeline.logs.clocks.no_header import without_header
from urmpipe_pipeline.logs.clocks.steps import increases
from urmpipe_pipeline.logs.clocks.text_times import known_forms
from urmpipe_pipeline.logs.columns.columns import Column, Kind, find_column
from urmpipe_pipeline.logs.options import LogMap
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.tables.whole import Whole
from urmpipe_pipeline.logs.vocabulary import vocabulary

GIVEN = "given as an option"
"""The evidence for a column that the user named."""


def time_columns(
    columns: Sequence[Column],
    layout: Layout,
    options: LogMap,
    joints: int | None,
    whole: Whole,
) -> Chosen:
    """Return the columns that hold the time, and why; none if there is no time.

    Args:
        columns: Those of the table.
        layout: How it is written.
        options: What the user says.
        joints: How many joints the robot has, if there is one.
        whole: All numbers of the table.

    Raises:
        LogError: If the column that the user names is not there, or a column of a table without a header
            may be the time or not.
    """
    if options.time is not None:
        if options.time.lower() == "none":
            return Chosen((), GIVEN)
        return given_time(find_column(columns, options.time, parameter="time"), columns, layout, whole)
    if layout.header is None:
        found = _texts(columns, layout) or without_header(columns, layout, options, joints, whole)
        return found or Chosen((), "there is no header")
    return (
        _day_beside_time(columns, layout)
        or _by_name(columns, layout, whole)
        or _by_content(columns, layout, whole)
        or _texts(columns, layout)
        or dates_in_digits(columns, layout)
        or durations(columns, layout)
        or Chosen((), "no column is named like a time")
    )


def given_time(column: Column, columns: Sequence[Column], layout: Layout, whole: Whole) -> Chosen:
    """Return the clock of a column that the user names, with the other half of it if it is one."""
    numeric = [one for one in columns if one.index in whole.columns]
    pairs = [*named_halves(columns, layout, whole), dates_in_digits(numeric, layout)]
    near = [one for one in numeric if abs(one.index - column.index) <= 1]
    pairs += [halves_beside(one, near, layout, whole) for one in near]
    both = next((one for one in pairs if one and column in one.columns), None)
    if both is not None:
        return both._replace(why=GIVEN)
    return Chosen(_with_other_half(column, columns, layout), GIVEN, lasts=is_duration(column, layout))


def _by_name(columns: Sequence[Column], layout: Layout, whole: Whole) -> Chosen | None:
    """Return a column of numbers that is named like a time, or whole seconds and what goes on from them."""
    halves = list(named_halves(columns, layout, whole))
    numeric = [column for column in columns if not column.text]
    named = ([c for c in numeric if pattern.search(c.key)] for pattern in vocabulary().time)
    sides = ([c for c in numeric if c.kind != Kind.PLAIN and p.search(c.bare)] for p in vocabulary().time)
    times = next((columns for columns in (*named, *sides) if columns), None)
    if times is None:
        return halves[0] if halves else None
    joints = vocabulary().joint["position"]
    kinds = [c.kind for c in numeric if c not in times and any(p.search(c.bare) for p in joints)]
    side = min(kinds, default=Kind.MEASURED)
    time = min(times, key=lambda c: (c.kind != side, c.kind != Kind.PLAIN))
    both = next((pair for pair in halves if time in pair.columns), None)
    both = both or halves_beside(time, numeric, layout, whole) or Chosen((time,), "its name")
    return both._replace(passed_over=tuple(c for c in times if c.kind != time.kind and c not in both.columns))


def _day_beside_time(columns: Sequence[Column], layout: Layout) -> Chosen | None:
    """Return a day and a time of day in digits, of which one is named like a time."""
    found = dates_in_digits(columns, layout)
    words = (*vocabulary().time, *vocabulary().dates)
    named = found and any(pattern.search(column.key) for pattern in words for column in found.columns)
    return found if found and named and len(found.columns) == 2 else None


def _texts(columns: Sequence[Column], layout: Layout) -> Chosen | None:
    """Return a clock of text: by its name, or as the only column of its kind; a date with its time of day."""
    texts = [column for column in columns if column.text]
    words = (*vocabulary().time, *vocabulary().dates)
    named = [column for pattern in words for column in texts if pattern.search(column.key)]
    clocks = [column for column in texts if known_forms(layout.cells(column.index))]
    named_clocks = [column for column in named if column in clocks]
    if named_clocks:
        found = _with_other_half(named_clocks[0], columns, layout)
        return Chosen(found, "its name" if len(found) == 1 else "a date and a time of day")
    if clocks and (len(clocks) == 1 or len(_with_other_half(clocks[0], columns, layout)) == len(clocks)):
        return Chosen(_with_other_half(clocks[0], columns, layout), "its cells are dates or times")
    return Chosen((named[0],), "its name") if named else None


def _with_other_half(column: Column, columns: Sequence[Column], layout: Layout) -> tuple[Column, ...]:
    """Return a column; a date beside the only column of times of day, and the reverse, with this one."""

    def half(column: Column) -> str | None:
        """Return what a column holds, if it is half a clock."""
        forms = known_forms(layout.cells(column.index)) if column.text else ()
        return forms[0].half if forms else None

    other = {DATE: TIME_OF_DAY, TIME_OF_DAY: DATE}.get(half(column) or "")
    others = [candidate for candidate in columns if other is not None and half(candidate) == other]
    if len(others) != 1:
        return (column,)
    return (column, others[0]) if other == TIME_OF_DAY else (others[0], column)


def _by_content(columns: Sequence[Column], layout: Layout, whole: Whole) -> Chosen | None:
    """Return a column with a unit of time, or an unnamed first one that runs like a clock."""
    timed = [c for c in columns if not c.text and c.unit and (c.unit.quantity, c.unit.order) == ("time", 0)]
    if len(timed) == 1:
        lasts = is_duration(timed[0], layout)
        alone = Chosen((timed[0],), f"its unit, {timed[0].unit_text}", lasts=lasts)
        return halves_beside(timed[0], columns, layout, whole) or alone
    first = columns[0]
    if first.key == "" and not first.text and _runs_like_a_clock(first, layout):
        return Chosen((first,), "the first column has no name and always increases")
    return None


def like_a_time(columns: Sequence[Column], layout: Layout, used: Collection[Column]) -> Column | None:
    """Return the first column without a role that runs like a clock, whatever its name; None without one.

    It is told, not taken: a way or a counter of pulses increases from row to row as well. One with another
    unit than that of a time is none.
    """
    free = (one for one in columns if one not in used and not one.text)
    may_be = (one for one in free if not one.unit_text or (one.unit and one.unit.quantity == "time"))
    return next((one for one in may_be if _runs_like_a_clock(one, layout)), None)


def _runs_like_a_clock(column: Column, layout: Layout) -> bool:
    return not count_up(layout.cells(column.index)) and increases(layout.numbers(column.index))
