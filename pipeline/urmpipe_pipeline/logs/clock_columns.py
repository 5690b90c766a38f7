"""Which columns of a table are the time.

`find_time_columns` takes the first of these that the table has:

1. the column that the user gives, with the other part of a split time;
2. with a header: a column named like a time; with a unit of time; without a name, if it always increases;
   text that is a date or a time of day (a date and a time of day in two columns are one clock); digits that
   are dates (YYYYMMDDhhmmss); durations, whose sum is the clock;
3. without a header: text and dates as above; Unix times; a split time; the column that alone increases,
   - first or last, in steps that jitter, as those of no joint do, or
   - first, in even steps, while other columns move.
   What increases in another way may be the time, a counter or a joint: the user is asked, unless all columns
   are joints and their rates, or all after the first.

A split time is whole seconds in one column, and the rest of a second in ns, us, ms or decimals in another: by
their names, or because their sum continues where the seconds step as it does within a second.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Literal, NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Hint, LogError
from urmpipe_models.math3d import column_count
from urmpipe_pipeline.logs.columns import Column, Kind, chosen_columns, find_column
from urmpipe_pipeline.logs.formats.cells import TextCells, count_up, is_missing
from urmpipe_pipeline.logs.formats.clock_forms import (
    DATE,
    DENSE_DATE,
    EXPONENTS,
    SECOND_NS,
    TIME_OF_DAY,
    UNREADABLE,
    ClockForm,
    expand_exponent,
    find_forms,
    read_cells,
)
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.opening import PATH
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.pose_columns import trailing_pose
from urmpipe_pipeline.logs.rates import proved_blocks
from urmpipe_pipeline.logs.unnamed import clock_before_pose, columns_before
from urmpipe_pipeline.logs.vocabulary import vocabulary

GIVEN = "given as an option"  # the evidence for a column that the user gives
OTHER_TIME = (
    Hint("time", None, "names the time column"),
    Hint("time", "none", "leaves the time column out"),
)
OTHER_CLOCK = (*OTHER_TIME, Hint("period", None, "sets the time between rows then"))

EPOCH = (946_684_800.0, 4_102_444_800.0)  # 2000 to 2100 as Unix time in [s]
MIN_PERIOD, MAX_PERIOD = 0.0005, 1.0  # s, usual periods of a log
MAX_PAUSE = 20.0  # s, median step of Unix times
MAX_SEAM = 10.0  # steps within a second by which a split time may continue where the seconds step
MIN_ROWS = 10  # with fewer rows a joint may increase by chance: only the first column may be the time
MAX_FAULTS = 0.02  # share of steps in which a damaged clock may stand still or run backwards; two at least
MIN_CHANGES = 10  # of a coarse clock; no rest takes a larger share of the rows than one of these
MAX_LISTED = 8  # columns in a question

Steps = Literal["even", "rough", "smooth", "unclear"]


class TimeColumns(NamedTuple):
    """The columns of a clock.

    Attributes:
        columns: One column, or two that are added; empty without a time.
        evidence: Why they are the time.
        rest_unit: The unit of the rest of a split time; empty without one.
        are_durations: Whether each row has a duration, and the times are their sum.
        passed_over: Times of the side that is not read.
    """

    columns: tuple[Column, ...]
    evidence: str
    rest_unit: str = ""
    are_durations: bool = False
    passed_over: tuple[Column, ...] = ()


def find_time_columns(
    columns: Sequence[Column], table: LogTable, options: LogMap, joints: int | None
) -> TimeColumns:
    """Return the columns of a table that are the time, and why; no columns without a time.

    Args:
        columns: Its columns.
        table: The table.
        options: What the user gives.
        joints: Number of joints of the robot, if there is one.

    Raises:
        LogError: If the given column does not exist, or if a column may be the time or not.
    """
    if options.time is not None:
        if options.time.lower() == "none":
            return TimeColumns((), GIVEN)
        return complete_time(find_column(columns, options.time, parameter="time"), columns, table)
    if table.header is None:
        clock = _find_text(columns, table) or _find_without_header(columns, table, options, joints)
        return clock or TimeColumns((), "there is no header")
    return (
        _find_named(columns, table)
        or _find_by_unit(columns, table)
        or _find_text(columns, table)
        or _find_date_in_digits(columns, table)
        or _find_durations(columns, table)
        or TimeColumns((), "no column is named like a time")
    )


def complete_time(column: Column, columns: Sequence[Column], table: LogTable) -> TimeColumns:
    """Return the clock of a column that the user gives, with the other part of a split time."""
    numeric = [other for other in columns if other.index in table.numeric_columns]
    for pair in (_find_rest(other, numeric, table) for other in numeric):
        if pair and column in pair.columns:
            return pair._replace(evidence=GIVEN)
    return TimeColumns(
        _with_other_part(column, columns, table), GIVEN, are_durations=_is_duration(column, table)
    )


def suggest_time_column(
    columns: Sequence[Column], table: LogTable, used: Collection[Column]
) -> Column | None:
    """Return the first unused column that may be the time though its name does not show it; or None.

    It increases, and has no unit or one of time. A position or a counter of pulses may increase as well.
    """
    for column in columns:
        is_free = column not in used and not column.text
        may_be = not column.unit_text or (column.unit and column.unit.quantity == "time")
        may_be = may_be and not column.words & {"x", "y", "z"}
        if is_free and may_be and _is_rising(column, table):
            return column
    return None


def is_named_time(name: str) -> bool:
    """Return whether a key is a name of a time or a date."""
    return any(pattern.search(name) for pattern in (*vocabulary().time, *vocabulary().dates))


# With a header


def _find_named(columns: Sequence[Column], table: LogTable) -> TimeColumns | None:
    words, numeric = vocabulary(), [column for column in columns if not column.text]
    keys = [column.key for column in numeric]
    if {"s", "l", "u", "r", "b"} <= set(keys) and keys.count("t") == 1:
        numeric = [column for column in numeric if column.key != "t"]  # Motoman's axes S, L, U, R, B, T
    seconds = [c for c in numeric if words.time_seconds.search(c.key)]
    named = ([c for c in numeric if pattern.search(c.key)] for pattern in words.time)
    of_sides = ([c for c in numeric if c.kind != Kind.PLAIN and p.search(c.bare)] for p in words.time)
    times = next((some for some in (*named, *of_sides) if some), None)
    if times is None:
        return next(filter(None, (_find_rest(c, numeric, table) for c in seconds)), None)
    joints = words.joint["position"]
    kinds = [c.kind for c in numeric if c not in times and any(p.search(c.bare) for p in joints)]
    side = min(kinds, default=Kind.MEASURED)
    time = min(times, key=lambda c: (c.kind != side, c.kind != Kind.PLAIN))
    pairs = (_find_rest(c, numeric, table) for c in (*seconds, time))
    clock = next((p for p in pairs if p and time in p.columns), TimeColumns((time,), "its name"))
    passed_over = (c for c in times if c.kind != time.kind and c not in clock.columns)
    return clock._replace(passed_over=tuple(passed_over))


def _find_by_unit(columns: Sequence[Column], table: LogTable) -> TimeColumns | None:
    """Return the only column with a unit of time, or a first one without a name that always increases."""
    timed = [c for c in columns if not c.text and c.unit and (c.unit.quantity, c.unit.order) == ("time", 0)]
    if len(timed) == 1:
        column, unit = timed[0], f"its unit, {timed[0].unit_text}"
        are_durations = _is_duration(column, table)
        single = TimeColumns((column,), unit, are_durations=are_durations)
        return _find_rest(column, columns, table) or single
    first = columns[0]
    if first.key == "" and not first.text and _is_rising(first, table):
        return TimeColumns((first,), "the first column has no name and always increases")
    return None


def _find_durations(columns: Sequence[Column], table: LogTable) -> TimeColumns | None:
    for column in columns:
        if not column.text and _is_duration(column, table):
            return TimeColumns((column,), "its name: one duration per row", are_durations=True)
    return None


def _is_duration(column: Column, table: LogTable) -> bool:
    """Return whether a column is named like a duration, and is neither negative nor always increasing."""
    numbers = table.numbers(column.index)
    is_named = any(pattern.search(column.key) for pattern in vocabulary().durations)
    return is_named and bool(numbers) and min(numbers) >= 0 < max(numbers) and not _increases(numbers)


def _is_rising(column: Column, table: LogTable) -> bool:
    return not count_up(table.cells(column.index)) and _increases(table.numbers(column.index))


def _increases(numbers: Sequence[float]) -> bool:
    return len(numbers) > 1 and bool((np.diff(numbers) > 0).all())


def runs_evenly(numbers: Sequence[float] | FloatArray) -> bool:
    """Return whether three numbers or more, of any unit, shape (n,), increase in steps equal to 1 %."""
    steps = np.diff(numbers)
    return len(steps) >= 2 and bool(steps.min() > 0 and np.ptp(steps) <= EVENLY * steps.max())


def start_and_step(numbers: Sequence[float], *, are_durations: bool = False) -> tuple[float, float]:
    """Return the first time and the median of the steps that are positive, 0 without one, in their unit."""
    steps = np.array(numbers) if are_durations else np.diff(numbers)
    steps = np.sort(steps[steps > 0])
    start = numbers[0] if numbers and not are_durations else 0.0
    return start, float(steps[len(steps) // 2]) if len(steps) else 0.0


def find_unix_unit(start: float, step: float = 0.0) -> str | None:
    """Return the unit in which a clock of this start and step is a Unix time of 2000 to 2100; or None."""
    for unit, exponent in EXPONENTS.items():
        scale = 10.0 ** (exponent - 9)
        if EPOCH[0] <= start * scale <= EPOCH[1] and step * scale <= MAX_PAUSE:
            return unit
    return None


# Text, and dates in digits


def _find_text(columns: Sequence[Column], table: LogTable) -> TimeColumns | None:
    """Return a clock of text: by its name, or as the only column of its kind; a date with its time of day."""
    texts = [column for column in columns if column.text]
    words = (*vocabulary().time, *vocabulary().dates)
    named = [column for pattern in words for column in texts if pattern.search(column.key)]
    clocks = [column for column in texts if find_forms(table.cells(column.index))]
    named_clocks = [column for column in named if column in clocks]
    if named_clocks:
        parts = _with_other_part(named_clocks[0], columns, table)
        return TimeColumns(parts, "its name" if len(parts) == 1 else "a date and a time of day")
    parts = _with_other_part(clocks[0], columns, table) if clocks else ()
    if clocks and len(clocks) in (1, len(parts)):
        return TimeColumns(parts, "its cells are dates or times")
    return TimeColumns((named[0],), "its name") if named else None


def _with_other_part(column: Column, columns: Sequence[Column], table: LogTable) -> tuple[Column, ...]:
    """Return a column; a date with the only time of day next to it, and the reverse."""

    def partial_unit(column: Column) -> str | None:
        forms = find_forms(table.cells(column.index)) if column.text else ()
        return forms[0].unit if forms and forms[0].is_partial else None

    other_unit = {DATE: TIME_OF_DAY, TIME_OF_DAY: DATE}.get(partial_unit(column) or "")
    parts = [other for other in columns if other_unit is not None and partial_unit(other) == other_unit]
    if len(parts) != 1:
        return (column,)
    return (column, parts[0]) if other_unit == TIME_OF_DAY else (parts[0], column)


def _find_date_in_digits(columns: Sequence[Column], table: LogTable) -> TimeColumns | None:
    dates = [column for column in columns if not column.text and has_form(column, DENSE_DATE, table)]
    return TimeColumns((dates[0],), "its numbers are dates, YYYYMMDDhhmmss") if len(dates) == 1 else None


def has_form(column: Column, form: ClockForm, table: LogTable) -> bool:
    """Return whether all sampled cells of a column, and one at least, are times of a form."""
    if form is DENSE_DATE and not column.text:
        cells = (expand_exponent(cell) for cell in table.number_texts(column.index))
    else:
        cells = (cell for cell in table.cells(column.index) if not is_missing(cell))
    first = next(cells, "")
    if not first or not form.match(first):  # the usual case: the others need no look
        return False
    return bool((read_cells(TextCells.of([first, *cells]), form) > UNREADABLE).all())


# Split times


def _find_rest(seconds: Column, columns: Sequence[Column], table: LogTable) -> TimeColumns | None:
    """Return a column of whole seconds with the rest of them: by both names, or next to it by its numbers.

    If the log lies within one second, numbers show it only for a Unix time and integers; in a table with a
    header the rest has to be named like one then.
    """
    words, numbers = vocabulary(), table.numbers(seconds.index)
    if np.mod(numbers, 1).any():
        return None
    stem = words.time_seconds.sub("", seconds.key) if words.time_seconds.search(seconds.key) else None
    may_continue = (np.diff(numbers) == 0).any() and not (np.diff(numbers) < 0).any()
    for column in columns:
        unit = next((unit for unit, name in words.time_rests.items() if name.search(column.key)), None)
        is_named = unit is not None and words.time_rests[unit].sub("", column.key) == stem
        is_next = may_continue and abs(column.index - seconds.index) == 1
        if column.text or column is seconds or not (is_named or is_next):
            continue
        seconds_part, rest = table.values([seconds.index, column.index]).T
        if is_named and unit is not None:
            if not ((seconds_part % 1 > 0) | (rest < 0) | (rest * 10 ** EXPONENTS[unit] >= SECOND_NS)).any():
                name = "decimals of them" if unit == "s" else unit
                evidence = f"their names: seconds and {name} apart"
                return TimeColumns((seconds, column), evidence, unit)
        elif np.isfinite(seconds_part + rest).all():
            fitting = _fit_rest(seconds_part, rest, may_be_short=table.header is None or unit is not None)
            if fitting is not None:
                evidence = "whole seconds, and the rest of them in the next column"
                return TimeColumns((seconds, column), evidence, fitting)
    return None


def _fit_rest(seconds: FloatArray, rest: FloatArray, *, may_be_short: bool) -> str | None:
    """Return the only unit in which the rest continues seconds, both of shape (n,)."""
    ticks, are_decimals, fitting = np.diff(seconds), bool((rest % 1 != 0).any()), []
    if (seconds % 1 != 0).any() or (rest < 0).any():
        return None
    for unit in ("s",) if are_decimals else ("ms", "us", "ns"):
        scale = 10.0 ** EXPONENTS[unit]
        steps = ticks * SECOND_NS + np.diff(rest) * scale
        inside, across = steps[ticks == 0], steps[ticks == 1]
        if rest.max() * scale >= SECOND_NS or (steps < 0).any() or not inside.any():
            continue
        if len(across):
            continues = np.mean(across <= MAX_SEAM * inside[inside > 0].mean()) > 0.5
        else:
            continues = may_be_short and not are_decimals and EPOCH[0] <= seconds[0] <= EPOCH[1]
        if continues and MIN_PERIOD * SECOND_NS < inside.mean() <= MAX_PERIOD * SECOND_NS:
            fitting.append(unit)
    return fitting[0] if len(fitting) == 1 else None


# Without a header


def _find_without_header(
    columns: Sequence[Column], table: LogTable, options: LogMap, joints: int | None
) -> TimeColumns | None:
    is_path = options.source == PATH
    columns = [column for column in columns if column.header]  # others are an index, or after a last sign
    pose_clock = _find_before_pose(columns, table, options)
    if pose_clock is not None or len(columns) in (1, joints):
        return pose_clock
    named = [
        column
        for parameter in ("joints", "position", "orientation", "measured")
        for column in chosen_columns(columns, getattr(options, parameter), parameter=parameter)
    ]
    free = [column for column in columns if column not in named and column.index in table.numeric_columns]
    clock = _find_date_in_digits(free, table) or _find_unix_time(free, table)
    if clock is not None:
        return clock
    pose = trailing_pose(free, table, path=is_path)
    free = [*columns_before(pose, free)] if pose else free
    for column in free:
        if (split := _find_rest(column, free, table)) is not None:
            return split
    return _find_rising(free, table, joints, is_path=is_path, joints_given=bool(named))


def _find_before_pose(columns: Sequence[Column], table: LogTable, options: LogMap) -> TimeColumns | None:
    """Return the clock of a table of poses without names, which may have none; None for another table."""
    if options.source == PATH:
        pose = 3 + (column_count(options.rotation) if options.rotation else 0)
        if len(columns) == pose:
            why = f"the {pose} columns are a pose" if options.rotation else "three columns are x, y, z"
            return TimeColumns((), why)
        if 3 < pose == len(columns) - 1 and not columns[0].text and _increases(table.numbers(0)):
            return TimeColumns((columns[0],), f"the {pose} columns after it are a pose, and it increases")
    pose_clock = None if options.joints else clock_before_pose(columns, table)
    return TimeColumns(*pose_clock) if pose_clock is not None else None


def _find_unix_time(columns: Sequence[Column], table: LogTable) -> TimeColumns | None:
    """Return the first column of Unix times of 2000 to 2100, with the rest of its seconds."""
    for column in columns:
        numbers = table.numbers(column.index)
        start, step = start_and_step(numbers)
        if not step or len(numbers) < len(table.cells(column.index)):
            continue
        if find_unix_unit(start, step) and np.mean(np.diff(numbers) < 0) <= MAX_FAULTS:
            single = TimeColumns((column,), "as Unix times its numbers are of our years")
            return _find_rest(column, columns, table) or single
    return None


def _find_rising(
    columns: Sequence[Column],
    table: LogTable,
    joints: int | None,
    *,
    is_path: bool,
    joints_given: bool,
) -> TimeColumns | None:
    """Return the column that alone increases from the first row to the last; ask if that proves nothing."""
    is_increasing = dict(zip(table.numeric_columns, table.increasing.tolist(), strict=True))
    values = {c: table.values([c.index])[:, 0] for c in columns if is_increasing[c.index]}
    if len(table.samples.values) < MIN_ROWS:
        values = {column: numbers for column, numbers in values.items() if column.index == 0}
    steps = {column: kind_of_steps(numbers) for column, numbers in values.items()}
    is_one_more = joints is not None and len(table.names) == joints + 1
    clocks = [c for c in values if is_one_more or steps[c] != "smooth" or values[c][0] == 0.0]
    if len(clocks) == 1:
        (clock,) = clocks
        is_first, is_last = clock.index == 0, clock.index == len(table.names) - 1
        if steps[clock] == "rough" and (is_first or is_last):
            how = "" if len(values) == 1 else " in steps that jitter"
            return TimeColumns((clock,), f"it alone increases{how} through the whole file")
        is_even = steps[clock] == "even" and not _counts_rows(values[clock])
        if is_first and is_even and _others_move(clock, table):
            return TimeColumns((clock,), "the first column alone increases in even steps")
    if len(clocks) > 1:
        numbers = table.values([column.index for column in columns])
        if proved_blocks(numbers, joints):
            return None
        if clocks[0] == columns[0] and proved_blocks(numbers[:, 1:], joints):
            why = "it increases, and the columns after it are joints and their rates"
            return TimeColumns((clocks[0],), why)
    near = [column for column in columns if column not in clocks and _is_nearly_rising(column, table)]
    near = near if len(near) == 1 or clocks else []
    candidates = [*clocks, *(c for c in near if c.index == 0 or c not in values)]
    if candidates and not joints_given:
        candidates.sort(key=lambda column: column.number)
        raise _ask_time(candidates, table, is_path=is_path)
    return None


def _counts_rows(values: FloatArray) -> bool:
    """Return whether numbers, shape (n,), count rows from 0 or 1."""
    return bool(values[0] in (0, 1) and (np.diff(values) == 1).all())


def _others_move(first: Column, table: LogTable) -> bool:
    """Return whether another column changes, and none evenly all the way, as a joint may."""
    values = table.values([column for column in table.numeric_columns if column != first.index])
    steps = np.diff(values, axis=0)
    ramps = values[:, (steps < 0).all(axis=0) | (steps > 0).all(axis=0)]
    return bool((steps != 0).any()) and not any(kind_of_steps(np.abs(c - c[0])) == "even" for c in ramps.T)


def _is_nearly_rising(column: Column, table: LogTable) -> bool:
    """Return whether a column increases or rests in almost all rows: a damaged clock, or a coarse one."""
    steps = np.diff(table.values([column.index])[:, 0])
    changes = np.flatnonzero(steps > 0)
    rests = np.diff(changes, prepend=-1, append=len(steps))
    is_damaged = np.count_nonzero(steps < 0) > max(2, MAX_FAULTS * len(steps))
    return not is_damaged and len(changes) >= MIN_CHANGES and rests.max() * MIN_CHANGES <= len(steps)


def _ask_time(columns: Sequence[Column], table: LogTable, *, is_path: bool) -> LogError:
    listed = ", ".join(str(column.number) for column in columns[:MAX_LISTED])
    listed += f" and {len(columns) - MAX_LISTED} more" if len(columns) > MAX_LISTED else ""
    which = f"columns {listed}, which increase" if len(columns) > 1 else f"column {listed}, which increases"
    what = "the time or a counter" if is_path else "the time, a counter or a joint"
    message = f"found {which} from row to row and may be {what}"
    choices = [*(str(column.number) for column in columns[:MAX_LISTED]), "none"]
    hints = [Hint("time", choice, "specifies it") for choice in choices]
    hints += [] if is_path else [Hint("joints", None, "names the joint columns")]
    return table.error(message, None, *hints)


EVENLY = 0.01  # share by which the steps of an even clock differ
MAX_GAPS = 0.1  # share of steps that may be longer
MAX_ROUNDING = 2.5  # last digits; steps that change by no more are rounded: nothing else shows ...
MIN_UNROUNDED = 0.05  # ... except in this share of them
MIN_ROUGHNESS = 0.5  # change of steps / their distance from the usual one: 1.4 for noise, 0.1 for a motion
MAX_STEP_RATIO = 20.0  # mean step / lower quartile; a clock stays below, a joint at rest exceeds it
MULTIPLE_TOLERANCE = 0.1  # share of a multiple of the last digit
SIZE_RESOLUTION = 1e-6  # share of the usual step below which sizes are equal


def kind_of_steps(values: FloatArray) -> Steps:
    """Return how increasing numbers of any unit, shape (n,), step; fewer than ten are even or smooth.

    A clock runs evenly, except for gaps and rounding, or it jitters: its steps are rough. The steps of a
    joint change smoothly; of clocks only that of a solver with variable steps does so, and it begins at 0.
    Numbers with few digits, or that rest, are unclear.
    """
    if len(values) < MIN_ROWS:
        return "even" if runs_evenly(values) else "smooth"
    steps = np.diff(values)
    usual = float(np.median(steps))
    distance, change = np.abs(steps - usual), np.abs(np.diff(steps))
    is_odd = distance > SIZE_RESOLUTION * usual
    has_gaps_only = is_odd.mean() <= MAX_GAPS and bool((steps[is_odd] > usual).all())
    digit = _last_digit(steps / usual) * usual
    line = np.linspace(values[0], values[-1], len(values))
    is_rounded = np.ptp(steps) <= MAX_ROUNDING * digit and np.abs(values - line).max() <= 2 * digit
    if has_gaps_only or is_rounded:
        return "even"
    if np.mean(change > MAX_ROUNDING * digit) < MIN_UNROUNDED:
        return "unclear"
    average = np.mean if np.median(distance) <= EVENLY * usual else np.median  # the mean if a few are late
    if average(change) <= MIN_ROUGHNESS * average(distance):
        return "smooth"
    if distance.max() <= EVENLY * usual:
        return "even"
    rests = np.sort(steps)[len(steps) // 4] < steps.mean() / MAX_STEP_RATIO
    return "unclear" if rests else "rough"


def _last_digit(sizes: FloatArray) -> float:
    """Return the number of which all differences of steps are multiples, or 0; the usual step is 1."""
    counts = np.rint(np.sort(sizes) / SIZE_RESOLUTION)
    differences = np.diff(counts)
    digit = differences[differences > 1].min(initial=np.inf)
    if not np.isfinite(digit):
        return 0.0
    multiples = (counts - counts[0]) / digit
    is_multiple = np.abs(multiples - np.rint(multiples)).max() < MULTIPLE_TOLERANCE
    return float(digit * SIZE_RESOLUTION) if is_multiple else 0.0
