"""What steps say about numbers that increase: those of a clock, or of a joint that turns one way.

A clock runs evenly, but for gaps and for how its times are rounded, or it jitters: its steps are rough. The
steps of a joint change smoothly. Only a solver with variable steps has a clock like that, and it begins at 0.

Dates in digits alone: 20200714163904, or 20200714 beside 163904.5.

A clock in two columns: whole seconds, and what goes on from them in ns, us, ms or decimals of a second.

Their names tell it, or their numbers: the second column falls back where the first one steps, and the time of
both goes on there as it does within a second.

A duration a row instead of a time: the clock is their sum.

The clock of a table without a header: by what stands in its columns, from the first row to the last.

Which columns of a table hold the time: by their names, or by what stands in them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, Hint, LogError, format_value
from urmpipe_models.math3d import column_count
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.clock_text import EXPONENTS, OTHER_TIME, Chosen, known_forms, read_cells
from urmpipe_pipeline.logs.columns import Column, Kind, chosen_columns, find_column
from urmpipe_pipeline.logs.formats.cells import TextCells, count_up, is_missing
from urmpipe_pipeline.logs.formats.clock_forms import (
    DATE,
    DENSE_DATE,
    DENSE_DAY,
    DENSE_TIME,
    IN_DIGITS,
    TIME_OF_DAY,
    Form,
    in_digits,
)
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.numbers import UNREADABLE, Numbers
from urmpipe_pipeline.logs.formats.opening import PATH
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.pose_columns import have_length_1, trailing_matrix, trailing_quaternion
from urmpipe_pipeline.logs.unnamed import clock_before_pose
from urmpipe_pipeline.logs.vocabulary import vocabulary

Steps = Literal["even", "rough", "smooth", "rounded"]
"""How numbers increase: "rounded" have few digits, and may be a joint or a clock."""

EVENLY = 0.01
"""Steps of a clock that runs evenly differ by less than this share."""

GAPS = 0.1
"""Share of its steps that may be longer: gaps."""

ROUNDED = 2.5
"""Steps that change by no more than this many times the last digit are rounded: nothing else shows ..."""

FEW = 0.05
"""... but in this share of them."""

ROUGH = 0.5
"""Steps are rough if they change from one to the next by more than this share of how far they are from the
usual one, in the median: 1.4 for noise, 0.1 or less for what is sampled ten times in its shortest period."""

MULTIPLE = 0.1
"""A multiple is one within this share, as far as FINEST tells."""

FINEST = 1e-6
"""Sizes of steps that differ by less than this share of the usual one are the same."""


def steps_of(times: Sequence[float]) -> list[float]:
    """Return the steps between times."""
    return [after - before for before, after in pairwise(times)]


def increases(times: Sequence[float]) -> bool:
    """Return whether times increase from each to the next."""
    steps = steps_of(times)
    return bool(steps) and min(steps) > 0


def runs_evenly(times: Sequence[float]) -> bool:
    """Return whether numbers increase in steps that differ by less than 1 %."""
    steps = steps_of(times)
    return len(steps) >= 2 and min(steps) > 0 and max(steps) - min(steps) <= EVENLY * max(steps)


def kind_of_steps(values: FloatArray) -> Steps:
    """Return how ten or more numbers of any unit increase, shape (n,)."""
    steps = np.diff(values)
    usual = float(np.median(steps))
    away, change = np.abs(steps - usual), np.abs(np.diff(steps))
    odd = away > FINEST * usual
    if odd.mean() <= GAPS and (steps[odd] > usual).all():
        return "even"
    digit = _last_digit(steps / usual) * usual
    line = np.linspace(values[0], values[-1], len(values))
    if np.ptp(steps) <= ROUNDED * digit and np.abs(values - line).max() <= 2 * digit:
        return "even"
    if np.mean(change > ROUNDED * digit) < FEW:
        return "rounded"
    measure = np.mean if np.median(away) <= EVENLY * usual else np.median  # of which a few are late
    rough = measure(change) > ROUGH * measure(away)
    return ("even" if away.max() <= EVENLY * usual else "rough") if rough else "smooth"


def _last_digit(sizes: FloatArray) -> float:
    """Return what all sizes of steps differ by multiples of, 0 if there is nothing; the usual size is 1."""
    apart = np.rint(np.sort(sizes) / FINEST)
    between = np.diff(apart)
    digit = between[between > 1].min(initial=np.inf)
    if not np.isfinite(digit):
        return 0.0
    multiples = (apart - apart[0]) / digit
    return float(digit * FINEST) if np.abs(multiples - np.rint(multiples)).max() < MULTIPLE else 0.0


def counts_rows(values: FloatArray, *, any_step: bool) -> bool:
    """Return whether numbers in [-], shape (n,), count rows: from 0 or 1 in steps of 1, or of any whole."""
    steps = np.diff(values)
    if (values % 1 != 0).any() or (steps != steps[0]).any():
        return False
    return any_step or (steps[0] == 1 and values[0] in (0, 1))


_HOURS = 10_000
"""Times of day without the zeros before them show their hours from here on: 0:59:59 is 5959."""


def dates_in_digits(columns: Sequence[Column], layout: LogTable) -> Chosen | None:
    """Return the only column of dates with times, or a day and the only time of day that is beside it."""
    numeric = [column for column in columns if not column.text]
    dates = [column for column in numeric if all_are(DENSE_DATE, column, layout)]
    if len(dates) == 1:
        return Chosen((dates[0],), "its numbers are dates, YYYYMMDDhhmmss", forms=(DENSE_DATE,))
    days = [column for column in numeric if all_are(DENSE_DAY, column, layout)]
    times = [column for column in numeric if _tells_hours(column, layout)] if len(days) == 1 else []
    if len(times) == 1:
        both = (DENSE_DAY, DENSE_TIME)
        return Chosen((days[0], times[0]), "a date and a time of day in digits", forms=both)
    return None


def all_are(form: Form, column: Column, layout: LogTable) -> bool:
    """Return whether all sampled cells of a column, and one at least, are times of a form."""
    if form in IN_DIGITS and not column.text:
        written = (in_digits(cell) for cell in layout.number_texts(column.index))
    else:
        written = (cell for cell in layout.cells(column.index) if not is_missing(cell))
    first = next(written, None)
    if first is None or not form.match(first):
        return False
    return bool((read_cells(TextCells.of([first, *written]), form) > UNREADABLE).all())


def _tells_hours(column: Column, layout: LogTable) -> bool:
    """Return whether a column holds times of day with their hours, and not only seconds."""
    if not all_are(DENSE_TIME, column, layout):
        return False
    cells, numbers = layout.cells(column.index), layout.numbers(column.index)
    padded = all(len(cell.replace(",", ".").partition(".")[0]) >= 6 for cell in cells if not is_missing(cell))
    return (padded or min(numbers) >= _HOURS) and len(set(numbers)) > 1


SECOND = 1e9
"""A second in [ns]."""

EPOCH = (946_684_800.0, 4_102_444_800.0)
"""2000 to 2100 as Unix time in [s]."""

PERIODS = (0.0005, 1.0)
"""Usual periods of a log in [s]."""

SEAM = 10.0
"""Where the seconds step, the time goes on by less than this many steps within a second."""


def named_halves(columns: Sequence[Column], layout: LogTable) -> Iterator[Chosen]:
    """Yield columns of whole seconds, each with that of what goes on from them, by their names."""
    words, numeric = vocabulary(), [column for column in columns if not column.text]
    for first in (column for column in numeric if words.time_seconds.search(column.key)):
        stem = words.time_seconds.sub("", first.key)
        for unit, pattern in words.time_rests.items():
            for second in numeric:
                same = pattern.search(second.key) and pattern.sub("", second.key) == stem
                if same and second is not first and _are_halves(first, second, layout, unit):
                    said = "seconds and decimals of them" if unit == "s" else f"seconds and {unit}"
                    yield Chosen((first, second), f"their names: {said} apart", EXPONENTS[unit])


def halves_beside(first: Column, columns: Sequence[Column], layout: LogTable) -> Chosen | None:
    """Return a column of whole seconds with what goes on from them beside it, by their numbers; or None.

    Where a whole log lies within a second only a Unix time is taken for seconds, and only whole numbers for
    what goes on from them; in a table with a header their name has to say so.
    """
    if not _repeats_whole(layout.numbers(first.index)):
        return None
    for second in (column for column in columns if abs(column.index - first.index) == 1 and not column.text):
        numbers = layout.numbers(second.index)
        if not numbers or min(numbers) < 0 or max(numbers) >= SECOND or min(numbers) == max(numbers):
            continue
        named = any(pattern.search(second.key) for pattern in vocabulary().time_rests.values())
        rest = rest_of(layout.values([first.index, second.index]), short=layout.header is None or named)
        if rest is not None:
            return Chosen((first, second), "whole seconds, and what goes on from them beside it", rest)
    return None


def rest_of(values: FloatArray, *, short: bool = True) -> int | None:
    """Return the power of ten from the second column to [ns], if it goes on from the seconds of the first.

    Args:
        values: Both columns, shape (n, 2).
        short: Whether they may lie within one second, which is a Unix time then.
    """
    if len(values) < 3 or not np.isfinite(values).all():
        return None
    seconds, rest = values.T
    turns, steps = np.diff(seconds), np.diff(rest)
    inside = turns == 0
    if (seconds % 1 != 0).any() or (turns < 0).any() or not inside.any() or (steps[inside] < 0).any():
        return None
    decimals = bool((rest % 1 != 0).any())
    fitting = [
        exponent
        for exponent in ((9,) if decimals else (0, 3, 6))
        if rest.min() >= 0
        and rest.max() * 10.0**exponent < SECOND
        and _goes_on(seconds, turns, steps * 10.0**exponent, short=short and not decimals)
    ]
    return fitting[0] if len(fitting) == 1 else None


def _goes_on(seconds: FloatArray, turns: FloatArray, steps: FloatArray, *, short: bool) -> bool:
    """Return whether the time goes on over the turns of a second as within it; steps are in [ns]."""
    inside = steps[turns == 0]
    usual = float(inside.mean())
    if not PERIODS[0] * SECOND < usual <= PERIODS[1] * SECOND:
        return False
    over = (turns * SECOND + steps)[turns == 1]
    if not len(over):
        return short and EPOCH[0] <= seconds[0] <= EPOCH[1]
    longest = SEAM * max(usual, float(inside[inside > 0].mean()))
    return bool((over >= 0).all()) and float(np.mean(over <= longest)) > 0.5


def _are_halves(first: Column, second: Column, layout: LogTable, unit: str) -> bool:
    """Return whether columns with the names of halves hold them: the second stays below a second."""
    seconds, rest = layout.numbers(first.index), layout.numbers(second.index)
    below = SECOND / 10 ** EXPONENTS[unit]
    if any(number % 1 for number in seconds) or not all(0 <= number < below for number in rest):
        return False
    if not seconds or seconds[0] != seconds[-1]:
        return True
    return bool(np.nanmax(layout.values([second.index]), initial=0.0) < below)


def _repeats_whole(numbers: Sequence[float]) -> bool:
    """Return whether numbers are whole, never fall, and some follow their like."""
    steps = np.diff(numbers)
    repeats = bool((steps >= 0).all() and (steps == 0).any())
    return repeats and not np.mod(numbers, 1).any()


SUMMED = "clock-summed"
"""The kind of the warning about a clock that is the sum of durations."""


def durations(columns: Sequence[Column], layout: LogTable) -> Chosen | None:
    """Return the first column that is named like a duration and holds one a row; None without one."""
    for column in columns:
        if not column.text and is_duration(column, layout):
            return Chosen((column,), "its name: one duration per row", lasts=True)
    return None


def is_duration(column: Column, layout: LogTable) -> bool:
    """Return whether a column is named like a duration, and its numbers neither increase nor fall below 0."""
    numbers = layout.numbers(column.index)
    named = any(pattern.search(column.key) for pattern in vocabulary().durations)
    return named and bool(numbers) and min(numbers) >= 0 < max(numbers) and not increases(numbers)


def summed(numbers: Numbers, name: str) -> Numbers:
    """Return the numbers with the times that the durations in [ns] in place of their clock add up to.

    Each is taken as the time since the row before, so that the first one is before the first row; if the
    last one is 0 and the first is not, as the time to the row behind.
    """
    durations = numbers.clock
    if durations is None or not len(durations):
        return numbers
    known = durations > UNREADABLE
    ahead = len(durations) > 1 and known[-1] and durations[-1] == 0 < durations[0]
    times = np.cumsum(np.where(known, durations, 0))
    times = np.where(known, times - durations if ahead else times, durations)
    which = "to the row behind" if ahead else "since the row before"
    said = f"{name} is one duration per row: the time is their sum, each taken as the time {which}"
    warning = LogWarning(SUMMED, said, hints=OTHER_TIME)
    return replace(numbers, clock=times, warnings=(*numbers.warnings, warning))


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
    columns: Sequence[Column], layout: LogTable, options: LogMap, joints: int | None
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

    Raises:
        LogError: If a column that increases may be the time, a counter or a joint.
    """
    path = options.source == PATH
    columns = [
        column for column in columns if column.header
    ]  # others are an index, or behind a trailing sign
    if path and (first := _before_pose(columns, layout, options)) is not None:
        return first
    if not options.joints and (poses := clock_before_pose(columns, layout)) is not None:
        return Chosen(*poses)
    if len(columns) in (1, joints):
        return None
    named = set(chosen_columns(columns, options.joints, parameter="joints"))
    free = [one for one in columns if one not in named and one.index in layout.numeric_columns]
    found = dates_in_digits(free, layout) or _epoch(free, layout)
    if found is not None:
        return found
    pose = _trailing_pose(free, layout)
    free = [one for one in free if one not in pose]
    for column in free:
        if (both := halves_beside(column, free, layout)) is not None:
            return both
    return _increasing(free, layout, joints, path=path, sure=bool(named))


def _before_pose(columns: Sequence[Column], layout: LogTable, options: LogMap) -> Chosen | None:
    """Return what stands before x, y, z and the orientation told, if the number of columns says so."""
    pose = 3 + (column_count(options.rotation) if options.rotation else 0)
    if len(columns) == pose:
        why = f"the {pose} columns are a pose" if options.rotation else "three columns are x, y, z"
        return Chosen((), why)
    one_more = options.rotation and len(columns) == pose + 1 and not columns[0].text
    if one_more and increases(layout.numbers(0)):
        return Chosen((columns[0],), f"the {pose} columns behind it are a pose, and it increases")
    return None


def _trailing_pose(columns: Sequence[Column], layout: LogTable) -> tuple[Column, ...]:
    """Return the columns at the end that are a transform, or x, y, z and a quaternion, in many rows."""
    layouts = [layout] * (max((column.table for column in columns), default=0) + 1)
    found = trailing_matrix(columns, layouts, some=True)
    if found is None and len(columns) >= 7:
        parts = [layout.numbers(column.index) for column in columns[-4:]]
        rows = np.array(list(zip(*parts, strict=False)))
        if len(rows) and 2 * np.count_nonzero(have_length_1(rows)) > len(rows):
            found = trailing_quaternion(columns, layouts, some=True)
    return (*found.position, *found.rotation) if found else ()


def _epoch(columns: Sequence[Column], layout: LogTable) -> Chosen | None:
    """Return the first column of Unix times of our years, with its nanoseconds if these stand beside it."""
    for column in columns:
        numbers = layout.numbers(column.index)
        if len(numbers) == len(layout.cells(column.index)) and _is_epoch(numbers):
            both = halves_beside(column, columns, layout)
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
    columns: Sequence[Column], layout: LogTable, joints: int | None, *, path: bool, sure: bool
) -> Chosen | None:
    """Return the column that alone increases through the whole file; None if none does.

    Args:
        columns: Those that may be the time.
        layout: How the table is written.
        joints: How many joints the robot has, if there is one.
        path: The table is a path, which has no joints.
        sure: The joints are named, so that no other column is taken for one.
    """
    sampled = [layout.numbers(column.index) for column in columns]
    may_be = [column for column, numbers in zip(columns, sampled, strict=True) if increases(numbers)]
    indices = [layout.numeric_columns[place] for place in np.flatnonzero(layout.increasing)] if may_be else []
    rising = [_Increasing(column, _values(layout, column)) for column in may_be if column.index in indices]
    one_more = joints is not None and len(layout.names) == joints + 1
    if rising and len(rising[0].values) < FEW_ROWS:
        rising = [one for one in rising if one.first]
        return _of_few_rows(rising, columns, layout, one_more=one_more, path=path, sure=sure)
    clocks = rising if one_more else [one for one in rising if one.may_be_clock]
    if not clocks:
        _refuse_halting(columns, layout, path=path, sure=sure)
        return None
    if (found := _alone(clocks, rising, layout)) is not None:
        return found
    if not sure:
        steps = np.diff(layout.values([column.index for column in columns]), axis=0)
        stairs = [column for column, own in zip(columns, steps.T, strict=True) if _is_stair(own)]
        asked = sorted([*(one.column for one in clocks), *stairs], key=lambda column: column.number)
        raise _question(asked, layout, path=path)
    return None


def _alone(clocks: Sequence[_Increasing], rising: Sequence[_Increasing], layout: LogTable) -> Chosen | None:
    """Return the only column that may be a clock by its steps, if it is one; None if that cannot be told.

    It jitters; or it is the first one and runs evenly while others move, and none runs as evenly downwards.
    What runs evenly elsewhere may be a joint.

    Args:
        clocks: Those that may be a clock.
        rising: All that increase.
        layout: The table.
    """
    one = clocks[0]
    if len(clocks) > 1:
        return None
    if one.steps == "rough" and not one.hardly_moves:
        alone = "alone increases" if len(rising) == 1 else "alone increases in steps that jitter"
        return Chosen((one.column,), f"it {alone} through the whole file")
    if one.first and one.steps == "even" and not one.counts and _others_move(one, layout):
        return Chosen((one.column,), "the first column alone increases in even steps")
    return None


def _of_few_rows(
    rising: Sequence[_Increasing],
    columns: Sequence[Column],
    layout: LogTable,
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


def _others_move(first: _Increasing, layout: LogTable) -> bool:
    """Return whether another column changes, and none falls evenly.

    A column that changes alone, or while others fall evenly, may be a joint.
    """
    others = [column for column in layout.numeric_columns if column != first.column.index]
    values = layout.values(others)
    falling = (np.diff(values, axis=0) < 0).all(axis=0)
    if any(kind_of_steps(-values[:, place]) == "even" for place in np.flatnonzero(falling)):
        return False
    return bool((np.diff(values, axis=0) != 0).any())


def _values(layout: LogTable, column: Column) -> FloatArray:
    """Return all numbers of a column, shape (n,)."""
    return layout.values([column.index])[:, 0]


def _question(rising: Sequence[Column], layout: LogTable, *, path: bool) -> LogError:
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


def _refuse_halting(columns: Sequence[Column], layout: LogTable, *, path: bool, sure: bool) -> None:
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
    steps = np.diff(layout.values([column.index for column in may_be]), axis=0)
    odd = ~(steps > 0)
    few = np.count_nonzero(odd, axis=0) <= max(2, DAMAGED * len(steps))
    nearly = [column for column, is_near in zip(may_be, few, strict=True) if is_near and len(steps) > 8]
    if [column.index for column in nearly] == [0]:
        raise _odd_row(int(np.argmax(odd[:, 0])), nearly[0], layout, path=path)
    stairs = [column for column, own in zip(may_be, steps.T, strict=True) if _is_stair(own)]
    if len(stairs) == 1:
        raise _question_of_stairs(stairs[0], layout, path=path)


def _odd_row(step: int, column: Column, layout: LogTable, *, path: bool) -> LogError:
    """Name the row that keeps a first column from increasing: it ends the first odd step, or begins it."""
    values = _values(layout, column)
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
    line = layout.lines_of([at]).get(at)
    return LogError(Finding(message, layout.file, line, at, hints=tuple(_which([column], path=path))))


def _is_stair(steps: FloatArray) -> bool:
    """Return whether numbers with such steps never fall, and rest between many steps: a coarse clock."""
    if not (steps >= 0).all() or np.mean(steps == 0) < RESTS:
        return False
    changes = np.flatnonzero(steps)
    rests = np.diff(changes, prepend=-1, append=len(steps))
    return len(changes) >= STAIR and int(rests.max()) * STAIR <= max(len(steps), 1)


def _question_of_stairs(column: Column, layout: LogTable, *, path: bool) -> LogError:
    what = "the time" if path else "the time or a joint"
    found = f"found column {column.number}, which rests and increases and never falls: it may be {what}"
    return layout.error(found, None, *_which([column], path=path))


GIVEN = "given as an option"
"""The evidence for a column that the user named."""


def time_columns(
    columns: Sequence[Column],
    layout: LogTable,
    options: LogMap,
    joints: int | None,
) -> Chosen:
    """Return the columns that hold the time, and why; none if there is no time.

    Args:
        columns: Those of the table.
        layout: How it is written.
        options: What the user says.
        joints: How many joints the robot has, if there is one.

    Raises:
        LogError: If the column that the user names is not there, or a column of a table without a header
            may be the time or not.
    """
    if options.time is not None:
        if options.time.lower() == "none":
            return Chosen((), GIVEN)
        return given_time(find_column(columns, options.time, parameter="time"), columns, layout)
    if layout.header is None:
        found = _texts(columns, layout) or without_header(columns, layout, options, joints)
        return found or Chosen((), "there is no header")
    return (
        _day_beside_time(columns, layout)
        or _by_name(columns, layout)
        or _by_content(columns, layout)
        or _texts(columns, layout)
        or dates_in_digits(columns, layout)
        or durations(columns, layout)
        or Chosen((), "no column is named like a time")
    )


def given_time(column: Column, columns: Sequence[Column], layout: LogTable) -> Chosen:
    """Return the clock of a column that the user names, with the other half of it if it is one."""
    numeric = [one for one in columns if one.index in layout.numeric_columns]
    pairs = [*named_halves(columns, layout), dates_in_digits(numeric, layout)]
    near = [one for one in numeric if abs(one.index - column.index) <= 1]
    pairs += [halves_beside(one, near, layout) for one in near]
    both = next((one for one in pairs if one and column in one.columns), None)
    if both is not None:
        return both._replace(why=GIVEN)
    return Chosen(_with_other_half(column, columns, layout), GIVEN, lasts=is_duration(column, layout))


def _by_name(columns: Sequence[Column], layout: LogTable) -> Chosen | None:
    """Return a column of numbers that is named like a time, or whole seconds and what goes on from them."""
    halves = list(named_halves(columns, layout))
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
    both = both or halves_beside(time, numeric, layout) or Chosen((time,), "its name")
    return both._replace(passed_over=tuple(c for c in times if c.kind != time.kind and c not in both.columns))


def _day_beside_time(columns: Sequence[Column], layout: LogTable) -> Chosen | None:
    """Return a day and a time of day in digits, of which one is named like a time."""
    found = dates_in_digits(columns, layout)
    words = (*vocabulary().time, *vocabulary().dates)
    named = found and any(pattern.search(column.key) for pattern in words for column in found.columns)
    return found if found and named and len(found.columns) == 2 else None


def _texts(columns: Sequence[Column], layout: LogTable) -> Chosen | None:
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


def _with_other_half(column: Column, columns: Sequence[Column], layout: LogTable) -> tuple[Column, ...]:
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


def _by_content(columns: Sequence[Column], layout: LogTable) -> Chosen | None:
    """Return a column with a unit of time, or an unnamed first one that runs like a clock."""
    timed = [c for c in columns if not c.text and c.unit and (c.unit.quantity, c.unit.order) == ("time", 0)]
    if len(timed) == 1:
        lasts = is_duration(timed[0], layout)
        alone = Chosen((timed[0],), f"its unit, {timed[0].unit_text}", lasts=lasts)
        return halves_beside(timed[0], columns, layout) or alone
    first = columns[0]
    if first.key == "" and not first.text and _runs_like_a_clock(first, layout):
        return Chosen((first,), "the first column has no name and always increases")
    return None


def like_a_time(columns: Sequence[Column], layout: LogTable, used: Collection[Column]) -> Column | None:
    """Return the first column without a role that runs like a clock, whatever its name; None without one.

    It is told, not taken: a way or a counter of pulses increases from row to row as well. One with another
    unit than that of a time is none.
    """
    free = (one for one in columns if one not in used and not one.text)
    may_be = (one for one in free if not one.unit_text or (one.unit and one.unit.quantity == "time"))
    return next((one for one in may_be if _runs_like_a_clock(one, layout)), None)


def _runs_like_a_clock(column: Column, layout: LogTable) -> bool:
    return not count_up(layout.cells(column.index)) and increases(layout.numbers(column.index))
