"""The clock of a table without a header: by what stands in its columns, from the first row to the last."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, Hint, LogError, format_value
from urmpipe_models.math3d import column_count
from urmpipe_pipeline.logs.clocks.chosen import EXPONENTS, Chosen
from urmpipe_pipeline.logs.clocks.digits import dates_in_digits
from urmpipe_pipeline.logs.clocks.halves import EPOCH, PERIODS, halves_beside
from urmpipe_pipeline.logs.clocks.steps import Steps, counts_rows, increases, kind_of_steps, runs_evenly
from urmpipe_pipeline.logs.columns.columns import Column, chosen_columns
from urmpipe_pipeline.logs.columns.pose import have_length_1, trailing_matrix, trailing_quaternion
from urmpipe_pipeline.logs.columns.trajectories import clock_before_pose
from urmpipe_pipeline.logs.options import LogMap
from urmpipe_pipeline.logs.tables.opening import PATH
from urmpipe_pipeline.logs.tables.row_reader import lines_of_rows
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.tables.whole import Whole

FEW_ROWS = 10
"""With fewer rows a joint may increase throughout by chance, and only the first column is looked at."""

DAMAGED = 0.02
"""Share of its steps in which a damaged clock may stand still or run backwards; two at least."""

STAIR = 10
"""A clock that stands still between its steps has so many of them at least, and no longer rest than one such
part of the rows."""

RESTS = 0.1
"""... and rests in this share of the rows at least."""

HARDLY = 20.0
"""A clock's steps are hardly ever so many times smaller than its mean step; a joint's are while it rests."""

SHOWN = 8
"""Columns that are named in a question."""

PAUSE = 20.0
"""The median step of a Unix time, in [s], is at most this long."""


def without_header(
    columns: Sequence[Column], layout: Layout, options: LogMap, joints: int | None, whole: Whole
) -> Chosen | None:
    """Return the clock of a table without a header; None if it has none.

    It is a date in digits, seconds with what goes on from them, a Unix time, or the column that alone
    increases through the whole file. If the robot's joints take all columns, or only one is there, it has
    none.

    Args:
        columns: Its columns.
        layout: How it is written.
        options: What the user says: the columns named as joints are no time.
        joints: How many joints the robot has, if there is one.
        whole: All its numbers.

    Raises:
        LogError: If a column that increases may be the time, a counter or a joint.
    """
    path = options.source == PATH
    columns = [
        column for column in columns if column.header
    ]  # others are an index, or behind a trailing sign
    if path and (first := _before_pose(columns, layout, options)) is not None:
        return first
    if not options.joints and (poses := clock_before_pose(columns, whole)) is not None:
        return Chosen(*poses)
    if len(columns) in (1, joints):
        return None
    named = set(chosen_columns(columns, options.joints, parameter="joints"))
    free = [one for one in columns if one not in named and one.index in whole.columns]
    found = dates_in_digits(free, layout) or _epoch(free, layout, whole)
    if found is not None:
        return found
    pose = _trailing_pose(free, layout)
    free = [one for one in free if one not in pose]
    for column in free:
        if (both := halves_beside(column, free, layout, whole)) is not None:
            return both
    return _increasing(free, layout, joints, whole, path=path, sure=bool(named))


def _before_pose(columns: Sequence[Column], layout: Layout, options: LogMap) -> Chosen | None:
    """Return what stands before x, y, z and the orientation told, if the number of columns says so."""
    pose = 3 + (column_count(options.rotation) if options.rotation else 0)
    if len(columns) == pose:
        why = f"the {pose} columns are a pose" if options.rotation else "three columns are x, y, z"
        return Chosen((), why)
    one_more = options.rotation and len(columns) == pose + 1 and not columns[0].text
    if one_more and increases(layout.numbers(0)):
        return Chosen((columns[0],), f"the {pose} columns behind it are a pose, and it increases")
    return None


def _trailing_pose(columns: Sequence[Column], layout: Layout) -> tuple[Column, ...]:
    """Return the columns at the end that are a transform, or x, y, z and a quaternion, in many rows."""
    layouts = [layout] * (max((column.table for column in columns), default=0) + 1)
    found = trailing_matrix(columns, layouts, some=True)
    if found is None and len(columns) >= 7:
        parts = [layout.numbers(column.index) for column in columns[-4:]]
        rows = np.array(list(zip(*parts, strict=False)))
        if len(rows) and 2 * np.count_nonzero(have_length_1(rows)) > len(rows):
            found = trailing_quaternion(columns, layouts, some=True)
    return (*found.position, *found.rotation) if found else ()


def _epoch(columns: Sequence[Column], layout: Layout, whole: Whole) -> Chosen | None:
    """Return the first column of Unix times of our years, with its nanoseconds if these stand beside it."""
    for column in columns:
        numbers = layout.numbers(column.index)
        if len(numbers) == len(layout.cells(column.index)) and _is_epoch(numbers):
            both = halves_beside(column, columns, layout, whole)
            return both or Chosen((column,), "as Unix times its numbers are of our years")
    return None


def _is_epoch(numbers: Sequence[float]) -> bool:
    """Return whether numbers are Unix times of our years that hardly ever run backwards."""
    if len(numbers) < 2 or min(numbers) == max(numbers):
        return False
    steps = np.diff(numbers)
    for exponent in EXPONENTS.values():
        scale = 10.0 ** (exponent - 9)
        ours = EPOCH[0] <= min(numbers) * scale and max(numbers) * scale <= EPOCH[1]
        usual = float(np.median(steps[steps > 0])) * scale if (steps > 0).any() else 0.0
        if ours and PERIODS[0] < usual <= PAUSE:
            return bool(np.mean(steps < 0) <= DAMAGED)
    return False


@dataclass(frozen=True, slots=True)
class _Increasing:
    """A column that increases through the whole file."""

    column: Column
    values: FloatArray

    @property
    def first(self) -> bool:
        """Whether it is the first one of its table."""
        return self.column.index == 0

    @property
    def counts(self) -> bool:
        """Whether it may count rows or frames."""
        return counts_rows(self.values, any_step=not self.first)

    @property
    def steps(self) -> Steps:
        """How it increases."""
        return kind_of_steps(self.values)

    @property
    def hardly_moves(self) -> bool:
        """Whether a quarter of the steps are much smaller than the mean one, as those of a joint at rest."""
        steps = np.sort(np.diff(self.values))
        return bool(steps[len(steps) // 4] < steps.mean() / HARDLY)

    @property
    def may_be_clock(self) -> bool:
        """Whether a clock may increase so."""
        return self.steps != "smooth" or self.values[0] == 0.0


def _increasing(
    columns: Sequence[Column], layout: Layout, joints: int | None, whole: Whole, *, path: bool, sure: bool
) -> Chosen | None:
    """Return the column that alone increases through the whole file; None if none does.

    Args:
        columns: Those that may be the time.
        layout: How the table is written.
        joints: How many joints the robot has, if there is one.
        whole: All its numbers.
        path: The table is a path, which has no joints.
        sure: The joints are named, so that no other column is taken for one.
    """
    sampled = [layout.numbers(column.index) for column in columns]
    may_be = [column for column, numbers in zip(columns, sampled, strict=True) if increases(numbers)]
    indices = [whole.columns[place] for place in np.flatnonzero(whole.increasing)] if may_be else []
    rising = [_Increasing(column, _values(whole, column)) for column in may_be if column.index in indices]
    one_more = joints is not None and len(layout.names) == joints + 1
    if rising and len(rising[0].values) < FEW_ROWS:
        rising = [one for one in rising if one.first]
        return _of_few_rows(rising, columns, layout, one_more=one_more, path=path, sure=sure)
    clocks = rising if one_more else [one for one in rising if one.may_be_clock]
    if not clocks:
        _refuse_halting(columns, layout, whole, path=path, sure=sure)
        return None
    if (found := _alone(clocks, rising, whole)) is not None:
        return found
    if not sure:
        steps = np.diff(whole.values([column.index for column in columns]), axis=0)
        stairs = [column for column, own in zip(columns, steps.T, strict=True) if _is_stair(own)]
        asked = sorted([*(one.column for one in clocks), *stairs], key=lambda column: column.number)
        raise _question(asked, layout, path=path)
    return None


def _alone(clocks: Sequence[_Increasing], rising: Sequence[_Increasing], whole: Whole) -> Chosen | None:
    """Return the only column that may be a clock by its steps, if it is one; None if that cannot be told.

    It jitters; or it is the first one and runs evenly while others move, and none runs as evenly downwards.
    What runs evenly elsewhere may be a joint.

    Args:
        clocks: Those that may be a clock.
        rising: All that increase.
        whole: All numbers of the table.
    """
    one = clocks[0]
    if len(clocks) > 1:
        return None
    if one.steps == "rough" and not one.hardly_moves:
        alone = "alone increases" if len(rising) == 1 else "alone increases in steps that jitter"
        return Chosen((one.column,), f"it {alone} through the whole file")
    if one.first and one.steps == "even" and not one.counts and _others_move(one, whole):
        return Chosen((one.column,), "the first column alone increases in even steps")
    return None


def _of_few_rows(
    rising: Sequence[_Increasing],
    columns: Sequence[Column],
    layout: Layout,
    *,
    one_more: bool,
    path: bool,
    sure: bool,
) -> Chosen | None:
    """Return the first column of a few rows if it alone runs evenly; ask if it may be the time.

    It may if there is one column more than the robot has joints, or it begins at 0, as clocks and counters do
    and joints seldom, and keeps near a straight line.
    """
    if not rising:
        return None
    (first,) = rising
    even = [column for column in columns if runs_evenly(layout.numbers(column.index))]
    if even == [first.column] and not first.counts:
        return Chosen((first.column,), "the first column alone increases in even steps")
    near = len(first.values) > 2 and first.values[0] == 0.0 and _keeps_near_a_line(first.values)
    if not sure and (one_more or near):
        raise _question([first.column], layout, path=path)
    return None


def _keeps_near_a_line(times: FloatArray) -> bool:
    """Return whether times that increase stay within a mean step of the line from the first to the last."""
    step = (times[-1] - times[0]) / (len(times) - 1)
    return bool((np.abs(times - times[0] - np.arange(len(times)) * step) <= step).all())


def _others_move(first: _Increasing, whole: Whole) -> bool:
    """Return whether another column changes, and none falls evenly.

    A column that changes alone, or while others fall evenly, may be a joint.
    """
    others = [column for column in whole.columns if column != first.column.index]
    values = whole.values(others)
    falling = (np.diff(values, axis=0) < 0).all(axis=0)
    if any(kind_of_steps(-values[:, place]) == "even" for place in np.flatnonzero(falling)):
        return False
    return bool((np.diff(values, axis=0) != 0).any())


def _values(whole: Whole, column: Column) -> FloatArray:
    """Return all numbers of a column, shape (n,)."""
    return whole.values([column.index])[:, 0]


def _question(rising: Sequence[Column], layout: Layout, *, path: bool) -> LogError:
    """Ask which of the columns that increase is the time."""
    what = "the time or a counter" if path else "the time, a counter or a joint"
    if [column.index for column in rising] == [0]:
        found = f"found a first column that increases from row to row, which may be {what}"
    elif len(rising) == 1:
        found = f"found column {rising[0].number}, which increases from row to row and may be {what}"
    else:
        numbers = ", ".join(str(column.number) for column in rising[:SHOWN])
        more = f" and {len(rising) - SHOWN} more" if len(rising) > SHOWN else ""
        found = f"found columns {numbers}{more}, which increase from row to row: each may be {what}"
    return layout.error(found, None, *_which(rising, path=path))


def _which(columns: Sequence[Column], *, path: bool) -> list[Hint]:
    """Return what to give so that one of some columns, or none, is the time."""
    numbers = [str(column.number) for column in columns[:SHOWN]]
    hints = [Hint("time", number, "specifies it") for number in (*numbers, "none")]
    return hints if path else [*hints, Hint("joints", None, "names the joint columns")]


def _refuse_halting(
    columns: Sequence[Column], layout: Layout, whole: Whole, *, path: bool, sure: bool
) -> None:
    """Raise if a column would be a clock but for a few rows, or for the rests between its steps.

    Of the former only the first column is looked at, and the first odd row is named.
    """
    if not columns or sure:
        return
    sampled = [np.diff(layout.numbers(column.index)) for column in columns]
    may_be = [
        column
        for column, steps in zip(columns, sampled, strict=True)
        if np.count_nonzero(steps < 0) <= max(2, DAMAGED * len(steps)) and (steps > 0).any()
    ]
    if not may_be:
        return
    steps = np.diff(whole.values([column.index for column in may_be]), axis=0)
    odd = ~(steps > 0)
    few = np.count_nonzero(odd, axis=0) <= max(2, DAMAGED * len(steps))
    nearly = [column for column, is_near in zip(may_be, few, strict=True) if is_near and len(steps) > 8]
    if [column.index for column in nearly] == [0]:
        raise _odd_row(int(np.argmax(odd[:, 0])), nearly[0], layout, whole, path=path)
    stairs = [column for column, own in zip(may_be, steps.T, strict=True) if _is_stair(own)]
    if len(stairs) == 1:
        raise _question_of_stairs(stairs[0], layout, path=path)


def _odd_row(step: int, column: Column, layout: Layout, whole: Whole, *, path: bool) -> LogError:
    """Name the row that keeps a first column from increasing: it ends the first odd step, or begins it."""
    values = _values(whole, column)
    steps = np.diff(values)
    usual = float(np.nanmedian(steps))
    leaps = step > 0 and steps[step - 1] > 2 * usual
    begins = step == 0 and 0 < steps[1] < 1.5 * usual  # the others go on from the second row
    row = step + (0 if leaps or begins else 1)
    cells = layout.cells(column.index)
    found = format_value(cells[row]) if row < len(cells) else f"{values[row]:.15g}"
    what = "the time or a counter" if path else "the time, a counter or a joint"
    message = f"found {found} in a first column that otherwise increases, which may be {what}"
    at = layout.file_row(row + 1)
    line = lines_of_rows(layout, [at]).get(at)
    return LogError(Finding(message, layout.file, line, at, hints=tuple(_which([column], path=path))))


def _is_stair(steps: FloatArray) -> bool:
    """Return whether numbers with such steps never fall, and rest between many steps: a coarse clock."""
    if not (steps >= 0).all() or np.mean(steps == 0) < RESTS:
        return False
    changes = np.flatnonzero(steps)
    rests = np.diff(changes, prepend=-1, append=len(steps))
    return len(changes) >= STAIR and int(rests.max()) * STAIR <= max(len(steps), 1)


def _question_of_stairs(column: Column, layout: Layout, *, path: bool) -> LogError:
    what = "the time" if path else "the time or a joint"
    found = f"found column {column.number}, which rests and increases and never falls: it may be {what}"
    return layout.error(found, None, *_which([column], path=path))
