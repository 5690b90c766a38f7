"""Which columns of a table hold the time: by their names, or by what stands in them."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise

from urmpipe_models.errors import Finding, LogError, shown
from urmpipe_models.messages import Hint
from urmpipe_models.orientation import width
from urmpipe_pipeline.sources.cells.cell import count_up, is_missing, to_float
from urmpipe_pipeline.sources.cells.text_clock import DATE, TIME_OF_DAY
from urmpipe_pipeline.sources.clocks.text_times import known_forms
from urmpipe_pipeline.sources.columns.columns import Column, find_column
from urmpipe_pipeline.sources.options import ReadOptions
from urmpipe_pipeline.sources.tables.opening import PATH
from urmpipe_pipeline.sources.tables.row_reader import lines_of_rows
from urmpipe_pipeline.sources.tables.sniff import Layout
from urmpipe_pipeline.sources.tables.whole import Whole
from urmpipe_pipeline.sources.vocabulary import vocabulary

_EVEN = 0.01  # steps of a clock in a file without header differ by less than this share
_FEW = 0.02  # share of its steps that a damaged clock may have otherwise


def time_columns(
    columns: Sequence[Column],
    layout: Layout,
    options: ReadOptions,
    joints: int | None,
    whole: Whole,
) -> tuple[tuple[Column, ...], str]:
    """Return the columns that hold the time, and why; none if there is no time.

    Raises:
        LogError: If the column that the user names is not there, or the first one of a table without a
            header may be the time or not.
    """
    if options.time is not None:
        if options.time.lower() == "none":
            return (), "given as an option"
        column = find_column(columns, options.time, parameter="time")
        return _with_other_half(column, columns, layout), "given as an option"
    if layout.header is None:
        if options.source == PATH and (first := _before_pose(columns, layout, options)) is not None:
            return first
        found = _without_header(columns, layout, joints) or _texts(columns, layout)
        if not (found or options.joints or len(columns) in (1, joints)):
            _refuse_unclear(columns, layout, joints, path=options.source == PATH)
        return found or ((), "there is no header")
    return (
        _by_name(columns, layout)
        or _by_content(columns, layout)
        or _texts(columns, layout)
        or ((), "no column is named like a time")
    )


def _by_name(columns: Sequence[Column], layout: Layout) -> tuple[tuple[Column, ...], str] | None:
    """Return a column of numbers that is named like a time, or seconds and nanoseconds apart."""
    halves = dict(_halves(columns, layout))
    whole = {half: pair for pair in halves.items() for half in pair}
    numeric = [column for column in columns if not column.text]
    named = (c for pattern in vocabulary().time for c in numeric if pattern.search(c.key))
    found = next(named, None)
    if found is not None and found not in whole:
        return (found,), "its name"
    if not whole:
        return None
    pair = whole[found] if found is not None else next(iter(halves.items()))
    return pair, "their names: seconds and nanoseconds apart"


def _halves(columns: Sequence[Column], layout: Layout) -> Iterator[tuple[Column, Column]]:
    """Yield columns of whole seconds, each with that of the nanoseconds that go on from them."""
    for seconds, nanoseconds in vocabulary().time_pairs:
        for first in (column for column in columns if seconds.search(column.key)):
            stem = seconds.sub("", first.key)
            for second in columns:
                same = nanoseconds.search(second.key) and nanoseconds.sub("", second.key) == stem
                whole = all(cell.isdigit() for cell in layout.cells(first.index) if not is_missing(cell))
                if same and whole and max(layout.numbers(second.index), default=0) < 1e9:
                    yield first, second


def _texts(columns: Sequence[Column], layout: Layout) -> tuple[tuple[Column, ...], str] | None:
    """Return a clock of text: by its name, or as the only column of its kind; a date with its time of day."""
    texts = [column for column in columns if column.text]
    words = (*vocabulary().time, *vocabulary().dates)
    named = [column for pattern in words for column in texts if pattern.search(column.key)]
    clocks = [column for column in texts if known_forms(layout.cells(column.index))]
    named_clocks = [column for column in named if column in clocks]
    if named_clocks:
        found = _with_other_half(named_clocks[0], columns, layout)
        return found, "its name" if len(found) == 1 else "a date and a time of day"
    if clocks and (len(clocks) == 1 or len(_with_other_half(clocks[0], columns, layout)) == len(clocks)):
        return _with_other_half(clocks[0], columns, layout), "its cells are dates or times"
    return ((named[0],), "its name") if named else None


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


def _by_content(columns: Sequence[Column], layout: Layout) -> tuple[tuple[Column, ...], str] | None:
    """Return a column with a unit of time, or an unnamed first one that runs like a clock."""
    timed = [c for c in columns if not c.text and c.unit and (c.unit.quantity, c.unit.order) == ("time", 0)]
    if len(timed) == 1:
        return (timed[0],), f"its unit, {timed[0].unit_text}"
    first = columns[0]
    if first.key == "" and not first.text and _runs_like_a_clock(first, layout):
        return (first,), "the first column has no name and always increases"
    return None


def _without_header(
    columns: Sequence[Column], layout: Layout, joints: int | None
) -> tuple[tuple[Column, ...], str] | None:
    """Return the first column if it alone runs in even steps, unless the robot's joints take all columns."""
    even = [one for one in columns if not one.text and runs_evenly(layout.numbers(one.index))]
    counts = count_up(layout.cells(0))
    if even == [columns[0]] and not counts and len(columns) > 1 and len(columns) != joints:
        return (columns[0],), "the first column alone increases in even steps"
    return None


def _before_pose(
    columns: Sequence[Column], layout: Layout, options: ReadOptions
) -> tuple[tuple[Column, ...], str] | None:
    """Return what stands before x, y, z and the orientation told, if the number of columns says so."""
    pose = 3 + (width(options.rotation) if options.rotation else 0)
    if len(columns) == pose:
        return (), f"the {pose} columns are a pose" if options.rotation else "three columns are x, y, z"
    one_more = options.rotation and len(columns) == pose + 1 and not columns[0].text
    if one_more and _increases(layout.numbers(0)):
        return (columns[0],), f"the {pose} columns behind it are a pose, and it increases"
    return None


def _refuse_unclear(columns: Sequence[Column], layout: Layout, joints: int | None, *, path: bool) -> None:
    """Raise if the first column of a table without a header may be a time, a counter or a joint.

    It may if it increases from row to row, and there is one column more than the robot has joints, or it
    begins at 0, as clocks and counters do and joints seldom, and keeps near a straight line; or if it alone
    runs in even steps but for a few rows, the first of which is named.
    """
    times = layout.numbers(columns[0].index)
    one_more = joints is not None and len(columns) == joints + 1
    what = "the time or a counter" if path else "the time, a counter or a joint"
    hints = [Hint("time", "1", "says which"), Hint("time", "none", "says which")]
    hints += [] if path else [Hint("joints", None, "names the joint columns")]
    odd = [_odd_row(column, layout) for column in columns]
    if odd[0] is not None and odd.count(None) == len(odd) - 1:
        line = lines_of_rows(layout, [odd[0] + 1]).get(odd[0] + 1)
        found = shown(layout.cells(0)[odd[0]])
        message = f"found {found} in a first column of otherwise even steps, which may be {what}"
        raise LogError(Finding(message, layout.file, line, odd[0] + 1, hints=tuple(hints)))
    if columns[0].text or not _increases(times):
        return
    if not one_more and (len(times) < 3 or times[0] != 0.0 or not _keeps_near_a_line(times)):
        return
    message = f"found a first column that increases from row to row, which may be {what}"
    raise layout.error(message, None, *hints)


def _odd_row(column: Column, layout: Layout) -> int | None:
    """Return the first of the few rows, from 0, that keep a column from running in even steps as a clock.

    Two steps at the most, or 2 % of them, are otherwise: those to and from a wrong value, or over lost rows.
    None if none are, or more.
    """
    if column.text:
        return None
    cells = (to_float(cell, layout.decimal) for cell in layout.cells(column.index))
    steps = steps_of([math.nan if value is None else value for value in cells])
    known = sorted(step for step in steps if math.isfinite(step))
    usual = known[len(known) // 2] if known else 0.0
    odd = [k for k, step in enumerate(steps) if not abs(step - usual) <= _EVEN * usual]
    if usual <= 0.0 or not 0 < len(odd) <= max(2, _FEW * len(steps)) or len(odd) * 4 > len(steps):
        return None
    return 0 if odd[0] == 0 and odd[1:2] != [1] else odd[0] + 1


def like_a_time(columns: Sequence[Column], layout: Layout, used: Collection[Column]) -> Column | None:
    """Return the first column without a role that runs like a clock, whatever its name; None without one.

    It is told, not taken: a way or a counter of pulses increases from row to row as well. One with another
    unit than that of a time is none.
    """
    free = (one for one in columns if one not in used and not one.text)
    may_be = (one for one in free if not one.unit_text or (one.unit and one.unit.quantity == "time"))
    return next((one for one in may_be if _runs_like_a_clock(one, layout)), None)


def _runs_like_a_clock(column: Column, layout: Layout) -> bool:
    return not count_up(layout.cells(column.index)) and _increases(layout.numbers(column.index))


def steps_of(times: Sequence[float]) -> list[float]:
    """Return the steps between times."""
    return [after - before for before, after in pairwise(times)]


def _keeps_near_a_line(times: Sequence[float]) -> bool:
    """Return whether times that increase stay within a mean step of the line from the first to the last."""
    step = (times[-1] - times[0]) / (len(times) - 1)
    return all(abs(time - times[0] - k * step) <= step for k, time in enumerate(times))


def _increases(times: Sequence[float]) -> bool:
    steps = steps_of(times)
    return bool(steps) and min(steps) > 0


def runs_evenly(times: Sequence[float]) -> bool:
    """Return whether numbers increase in steps that differ by less than 1 %."""
    steps = steps_of(times)
    return len(steps) >= 2 and min(steps) > 0 and max(steps) - min(steps) <= _EVEN * max(steps)
