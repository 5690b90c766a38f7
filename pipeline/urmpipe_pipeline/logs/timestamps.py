"""The time of each row, once it is known which columns are the clock.

1. Text (`read_text_times`): a clock of text is read in every combination of the forms that its columns may
   have. The one with the fewest unreadable cells, and of these with the fewest steps backwards, is taken; if
   several differ, the user is asked.
2. Midnight (`continue_over_midnight`): a time of day that falls back by nearly 24 h is of the next day.
3. Durations (`sum_durations`): t[k] = sum of the durations up to row k.
4. Repeated timestamps (`separate_repeated`). A regular clock of period p, cut or rounded to a resolution r,
   has timestamps within a strip of width r along a line of slope p: it is rebuilt (`fit_repeated`,
   `fit_rounded`). Other rows that share a timestamp are spread evenly up to the next one, or back to the
   previous one if their numbers vary with that step, as those of received blocks do (`spread_repeated`).
5. Static poses (`detect_static_poses`): calibration grids and random configurations have no motion between
   them, so their clock is a label. The steps between different rows show them: no joint makes these in the
   assumed time, and they continue in no direction, or in straight lines with jumps from each to the next. A
   motion is smooth, however coarse.

Times are integers in [ns]; rows without one have `NO_TIME`, `REPORTED` or `UNREADABLE`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Hint, LogError, format_value
from urmpipe_pipeline.joint_log import GAP, Inference, LogWarning
from urmpipe_pipeline.logs.clock import DEFAULT_PERIOD, Clock, joint_steps
from urmpipe_pipeline.logs.clock_columns import GIVEN, OTHER_CLOCK, OTHER_TIME
from urmpipe_pipeline.logs.columns import Column
from urmpipe_pipeline.logs.formats.cells import TextCells, is_number
from urmpipe_pipeline.logs.formats.clock_forms import (
    DATE,
    DAY_NS,
    DENSE_DATE,
    EXPONENTS,
    REPORTED,
    TIME_OF_DAY,
    UNREADABLE,
    ClockForm,
    expand_exponent,
    read_cells,
)
from urmpipe_pipeline.logs.formats.log_table import ClockColumn, LogTable, Numbers
from urmpipe_pipeline.logs.plan import Plan
from urmpipe_pipeline.logs.rates import period_of

ZONED = "form of the time with a zone"  # kind of the inference about dates with a time zone
OVER_MIDNIGHT = "over-midnight"
SUMMED = "clock-summed"
REBUILT = "clock-rebuilt"  # all rows share timestamps: those of a coarse clock
SPREAD = "clock-spread"  # many rows do
REPEATED = "repeated-time"  # single rows do

MIN_FALL_NS = DAY_NS - 3600 * 10**9  # a time of day that falls back by this or more has passed midnight


class Reading(NamedTuple):
    """A clock of text, one column or two, in one combination of forms.

    Attributes:
        forms: The form of each column.
        times: Their sum in [ns], or NO_TIME, or UNREADABLE, shape (n,).
        midnights: Number of midnights in a time of day.
        unreadable: Number of rows that are no times.
        steps: Steps between the m rows that have a time in [ns], shape (m - 1,).
        backwards: Number of these that are negative.
    """

    forms: tuple[ClockForm, ...]
    times: IntArray
    midnights: int
    unreadable: int
    steps: IntArray
    backwards: int

    @property
    def name(self) -> str:
        """The names of its forms."""
        return " and ".join(form.name for form in self.forms)


def read_text_times(table: LogTable, parts: Sequence[ClockColumn], numbers: Numbers) -> Numbers:
    """Return the numbers of a table with the times of its clock of text; without such a clock unchanged.

    Raises:
        LogError: If the cells can be read in two ways and nothing in the file decides.
    """
    if not numbers.texts:
        return numbers
    columns = [
        _expand_exponents(cells) if part.forms[0] is DENSE_DATE else cells
        for cells, part in zip(numbers.texts, parts, strict=True)
    ]
    readings, evidence = _choose_readings(columns, [part.forms for part in parts])
    reading = readings[0]
    if len(readings) > 1:
        raise _ask_form(table, parts, readings)
    if numbers.clock is not None:
        reading.times[numbers.clock == REPORTED] = REPORTED
    text = " ".join(cells.text(0).strip() for cells in numbers.texts)
    reasons = [f"its cells, such as {format_value(text)}", *evidence]
    is_date = any(form.unit == DATE for form in reading.forms)
    has_zone = is_date and reading.forms[-1].has_zone(numbers.texts[-1].text(0))
    if is_date and not has_zone:
        reasons.append("without a time zone: taken as UTC")
    kind = ZONED if has_zone else ""
    form = Inference("form of the time", reading.name, "; ".join(reasons), kind, hints=(Hint("unit"),))
    inferences = [form]
    if reading.midnights:
        why = "there the time of day falls back by nearly 24 h: the next day begins"
        inferences.append(Inference("nights passed", str(reading.midnights), why))
    return replace(numbers, clock=reading.times, inferences=tuple(inferences))


def _expand_exponents(cells: TextCells) -> TextCells:
    if not np.isin(cells.data, list(b"eE")).any():
        return cells
    texts = (cells.text(row).strip() for row in range(len(cells)))
    return TextCells.of(
        expand_exponent(text) if is_number(text, ".") or is_number(text, ",") else text for text in texts
    )


def _choose_readings(
    columns: Sequence[TextCells], forms: Sequence[tuple[ClockForm, ...]]
) -> tuple[list[Reading], list[str]]:
    """Return the readings that fit best, several if their steps differ, and the evidence."""
    usual = [tuple(form for form in known if not form.is_fallback) for known in forms]
    readings = [_read(columns, combination) for combination in product(*usual)]
    if not any(reading.backwards == reading.unreadable == 0 for reading in readings):
        combinations = (c for c in product(*forms) if any(form.is_fallback for form in c))
        readings += [_read(columns, combination) for combination in combinations]
    fewest = min(reading.unreadable for reading in readings)
    readable = [reading for reading in readings if reading.unreadable == fewest]
    least = min(reading.backwards for reading in readable)
    forwards = [reading for reading in readable if reading.backwards == least]
    different: list[Reading] = []
    for reading in forwards:
        if not any(np.array_equal(reading.steps, other.steps) for other in different):
            different.append(reading)
    evidence = []
    if len(readable) < len(readings):
        worse = (reading for reading in readings if reading.unreadable > fewest)
        other = min(worse, key=lambda reading: reading.unreadable)
        row = int(np.argmax(other.times == UNREADABLE))
        text = format_value(" ".join(cells.text(row).strip() for cells in columns))
        evidence.append(f"as {other.name} {text} in row {row + 1} is no time")
    if len(forwards) < len(readable):
        evidence.append("in another form they run backwards")
    if len(different) < len(forwards):
        evidence.append(f"as {forwards[-1].name} the steps are the same")
    return different, evidence


def _read(columns: Sequence[TextCells], forms: tuple[ClockForm, ...]) -> Reading:
    parts = [read_cells(cells, form) for cells, form in zip(columns, forms, strict=True)]
    times = np.zeros(len(columns[0]), dtype=np.int64)
    for part in parts:
        times += np.where(part > UNREADABLE, part, 0)
    for part in parts:
        times[part <= UNREADABLE] = part[part <= UNREADABLE]
    midnights = add_days(times) if all(form.unit == TIME_OF_DAY for form in forms) else 0
    steps = np.diff(times[times > UNREADABLE])
    unreadable = np.count_nonzero(times == UNREADABLE)
    return Reading(forms, times, midnights, int(unreadable), steps, int(np.count_nonzero(steps < 0)))


def _ask_form(table: LogTable, parts: Sequence[ClockColumn], readings: Sequence[Reading]) -> LogError:
    choices = list(zip(*(reading.forms for reading in readings), strict=True))
    place = next(k for k, forms in enumerate(choices) if len(set(forms)) > 1)
    names = " or ".join(dict.fromkeys(form.name for form in choices[place]))
    shared = set.intersection(*(set(form.keys) for form in choices[place]))
    keys = dict.fromkeys(key for form in choices[place] for key in form.keys if key not in shared)
    column = table.names[parts[place].column]
    cell = table.cells(parts[place].column)[0]
    hints = (Hint("unit", {column: key}, "specifies it") for key in keys)
    return table.error(f"found {format_value(cell)}, which may be {names}", column, *hints, *OTHER_TIME)


def add_days(times: IntArray) -> int:
    """Shift times of day in [ns], shape (n,), that fall back by nearly 24 h to the next day, in place.

    A time that jumps ahead by as much, after a midnight, is of an evening row among those of the morning: it
    keeps its day, so that it runs backwards.

    Returns:
        The number of midnights.
    """
    rows = np.flatnonzero(times > UNREADABLE)
    valid = times[rows]
    if not len(valid) or valid.min() < 0 or valid.max() >= DAY_NS:
        return 0
    steps = np.diff(valid, prepend=valid[0])
    days = np.cumsum((steps <= -MIN_FALL_NS).astype(np.int64) - (steps >= MIN_FALL_NS))
    days -= np.minimum(np.minimum.accumulate(days), 0)
    times[rows] += days * DAY_NS
    return int(days.max())


def continue_over_midnight(numbers: Numbers, clock: Clock) -> Numbers:
    """Return the numbers with a clock that continues where seconds of the day start again."""
    times = numbers.clock
    if times is None or clock.are_durations or clock.unit not in EXPONENTS or numbers.texts:
        return numbers
    if len(times) < 3 or times.min() <= UNREADABLE or np.diff(times).min() > -MIN_FALL_NS:
        return numbers
    days = times.copy()
    add_days(days)
    steps, is_midnight = np.diff(days), np.diff(times) <= -MIN_FALL_NS
    if not 0 < steps[is_midnight].min() <= steps[is_midnight].max() <= GAP * np.median(steps):
        return numbers
    message = "the clock falls back by nearly 24 h, as seconds of the day do at midnight: it is continued"
    warning = LogWarning(OVER_MIDNIGHT, message, int(np.argmax(is_midnight)) + 2, hints=OTHER_TIME)
    return replace(numbers, clock=days, warnings=(*numbers.warnings, warning))


def sum_durations(table: LogTable, numbers: Numbers, clock: Clock) -> Numbers:
    """Return the numbers of a table with times in place of the durations of its clock, in [ns].

    A duration is the time since the previous row, so that the first one is before the first row; if the last
    one is 0 and the first is not, the time to the next row. Those of rows that are left out count as well.
    """
    durations = numbers.clock
    if durations is None or not len(durations):
        return numbers
    if table.uncut is not None and table.rows is not None:
        every = table.uncut.read((), clock.parts).clock
        rows = table.rows[: len(durations)] if numbers.rows is None else numbers.rows - 1  # of the file
        if every is not None and rows[-1] < len(every):
            durations = every[: rows[-1] + 1]
    is_known = durations > UNREADABLE
    to_next = len(durations) > 1 and is_known[-1] and durations[-1] == 0 < durations[0]
    times = np.cumsum(np.where(is_known, durations, 0))
    times = np.where(is_known, times - durations if to_next else times, durations)
    times = times if durations is numbers.clock else times[rows]
    which = "to the next row" if to_next else "since the row before"
    message = (
        f"{clock.columns[0].name} is one duration per row: the time is their sum, each taken as the time"
    )
    warning = LogWarning(SUMMED, f"{message} {which}", hints=OTHER_TIME)
    return replace(numbers, clock=times, warnings=(*numbers.warnings, warning))


MIN_SHARE = 0.1  # of the rarer step of a rounded clock, where one lost sample could make it as well
MIN_CHANGES = 3  # of repeated timestamps, for a period
MAX_TICK_DEVIATION = 0.1  # share by which the ticks of a coarse clock, and the rows in them, may differ
MIN_TIMESTAMPS = 4  # different ones, to spread the rows between them
MAX_SINGLE, MAX_SINGLE_SHARE = 5, 0.1  # rows, and share of all rows; more repeated ones are no single faults
MAX_PERIOD_RATIO = 5.0  # between the usual time between rows and that of spread rows ...
MIN_LIKE = 0.9  # ... in this share of the rows; else the clock stood still
MAX_VARIATION_RATIO = 0.5  # times between rows vary less by this on the side on which the rows belong


class Regular(NamedTuple):
    """A regular clock that explains quantised timestamps.

    Attributes:
        period: Time between rows in [ns].
        resolution: Step of the timestamps in [ns].
        t_ns: Its times in [ns], none further from its timestamp than the resolution, shape (n,).
    """

    period: float
    resolution: int
    t_ns: IntArray


def fit_rounded(timestamps: IntArray) -> Regular | None:
    """Return the regular clock of increasing timestamps in [ns], shape (n,), as 3, 7, 10, 13 ms; or None."""
    steps = np.diff(timestamps)
    if len(steps) < MIN_CHANGES:
        return None
    shortest, longest = int(steps.min()), int(steps.max())
    resolution = int(np.gcd.reduce(steps))
    if longest > 2 * shortest or longest - shortest > resolution:
        return None
    rarer = min(float(np.mean(steps == shortest)), float(np.mean(steps == longest)))
    if 2 * resolution > shortest and rarer < MIN_SHARE:
        return None
    return _fit_line(timestamps, np.arange(len(timestamps)), resolution)


def fit_repeated(timestamps: IntArray) -> Regular | None:
    """Return the regular clock of timestamps in [ns], shape (n,), that repeat equally often; or None."""
    steps = np.diff(timestamps)
    changes = np.flatnonzero(steps) + 1
    if len(changes) < MIN_CHANGES or not are_many(int(np.count_nonzero(steps == 0)), len(timestamps)):
        return None
    ticks, counts = steps[changes - 1], np.diff(changes)
    resolution, mean = int(ticks.max()), float(counts.mean())
    max_spread = max(1 if mean < 2 else 2, MAX_TICK_DEVIATION * mean)  # a row at either end of a tick
    if resolution - int(ticks.min()) > MAX_TICK_DEVIATION * resolution or np.ptp(counts) > max_spread:
        return None
    return _fit_line(timestamps, changes, resolution)


def _fit_line(timestamps: IntArray, rows: IntArray, resolution: int) -> Regular | None:
    """Return the times along the line of least squares through some rows, if all are in a strip around it.

    The strip is wider than the resolution by half of it or one period, whichever is less: the line is not
    known better.
    """
    origin, count = int(timestamps[0]), np.arange(len(timestamps))
    x, y = rows - rows.mean(), (timestamps[rows] - origin).astype(np.float64)
    period = float(x @ y / (x @ x))
    distances = (timestamps - origin) - period * count
    lowest, highest = float(distances.min()), float(distances.max())
    if highest - lowest > resolution + min(period, resolution / 2.0):
        return None
    line = (lowest + highest) / 2.0 + period * count
    return Regular(period, resolution, np.rint(line).astype(np.int64) + origin)


def spread_repeated(timestamps: IntArray) -> tuple[IntArray, str, str] | None:
    """Return the times of rows of which some share timestamps in [ns], shape (n,), in order; or None.

    They are strictly increasing, in [ns], shape (n,). Over a gap the rows stay together. Also how they are
    spread, and what is assumed: if they are many, their numbers may not show on which side they belong.
    """
    first_rows = np.flatnonzero(np.diff(timestamps, prepend=timestamps[0] - 1))
    counts, ticks = np.diff(first_rows, append=len(timestamps)), np.diff(timestamps[first_rows])
    if len(counts) < MIN_TIMESTAMPS:
        return None
    many = are_many(len(timestamps) - len(counts), len(timestamps))
    to_next, to_previous = ticks / counts[:-1], ticks / counts[1:]
    variations = [float(np.log(periods).std()) for periods in (to_next, to_previous)]
    is_backwards = many and variations[1] < MAX_VARIATION_RATIO * variations[0]
    periods, weights = (to_previous, counts[1:]) if is_backwards else (to_next, counts[:-1])
    period = float(np.median(np.repeat(periods, weights)))
    is_like = (periods < MAX_PERIOD_RATIO * period) & (periods > period / MAX_PERIOD_RATIO)
    if weights[is_like].sum() < MIN_LIKE * weights.sum():
        return None
    periods = np.where(periods < GAP * period, periods, period)
    periods = np.append(period, periods) if is_backwards else np.append(periods, period)
    places = np.arange(len(timestamps)) - np.repeat(first_rows, counts)
    if is_backwards:
        places -= np.repeat(counts - 1, counts)
    times = timestamps + np.rint(places * np.repeat(periods, counts)).astype(np.int64)
    if (np.diff(times) <= 0).any():
        return None
    is_assumed = many and not is_backwards and variations[0] >= MAX_VARIATION_RATIO * variations[1]
    side = "back to the time before" if is_backwards else "up to the next time"
    how = f"rows of one time are spread evenly {side}, usually {period / 1e9:.6g} s apart"
    return times, how, "rows that share a time were sampled after it" if is_assumed else ""


def are_many(count: int, rows: int) -> bool:
    """Return whether more rows repeat a time, or run backwards, than single faults do."""
    return count > max(MAX_SINGLE, MAX_SINGLE_SHARE * rows)


def separate_repeated(numbers: Numbers) -> Numbers:
    """Return the numbers with a separate time for each row where rows of the file share one."""
    times = numbers.clock
    if times is None or times.min(initial=0) <= UNREADABLE or np.diff(times).min(initial=1) != 0:
        return numbers
    if (clock := fit_repeated(times)) is not None:
        period, resolution = f"{clock.period / 1e9:.9g} s", f"{clock.resolution / 1e9:.9g} s"
        seen = f"times in steps of {resolution} cover {clock.resolution / clock.period:.4g} rows each"
        inference = Inference("clock", f"rebuilt with a period of {period}", seen, hints=OTHER_CLOCK)
        warning = LogWarning(REBUILT, f"{seen}: a regular clock of {period} is used instead")
        separate = clock.t_ns
    elif (spread := spread_repeated(times)) is not None:
        separate, how, assumption = spread
        is_repeated = np.diff(times) == 0
        count = int(np.count_nonzero(is_repeated))
        verb = "repeats" if count == 1 else "repeat"
        seen = f"{count} of {len(times)} rows {verb} the time of the row before"
        inference = Inference("clock", how, seen, hints=OTHER_CLOCK)
        warning = LogWarning(
            SPREAD if are_many(count, len(times)) else REPEATED, f"{seen}: {how}",
            int(np.argmax(is_repeated)) + 2, hints=OTHER_CLOCK, assumption=assumption, role="time",
        )  # fmt: skip
    else:
        return numbers
    inferences, warnings = (*numbers.inferences, inference), (*numbers.warnings, warning)
    return replace(numbers, clock=separate, inferences=inferences, warnings=warnings)


MAX_JOINT_SPEED = 20.0  # rad/s or m/s, which no joint of an arm exceeds from pose to pose
MIN_STEP = MAX_JOINT_SPEED * DEFAULT_PERIOD  # rad or m, median step of static poses
MIN_SPEED = 0.05  # rate in any unit, in half of the rows, that static poses do not have
MIN_POSE_STEP = MIN_STEP / 10  # smaller steps are between measurements of one pose
MAX_REST_SHARE = 0.1  # sum of these steps / sum of the others
MIN_ROWS = 6  # fewer show nothing
MIN_TURN = 0.8  # change of steps / steps: 2 sin(pi / n) of n samples in the shortest period, 1.4 if random
TURN_QUANTILE = 0.75  # of both: a grid continues straight for some poses, a log has single spikes
MIN_JUMPS = 0.03  # share of steps of a grid that are twice their neighbours; three at least
MIN_PAUSE_NS = 2e9  # median time between rows that are no samples of a motion with such steps
MIN_STANDSTILL = 0.1  # share of times that repeat or run backwards; a damaged clock has less
MAX_ROWS = 4000  # rows that decide
_LIKE_POSES = (
    f"no clock, and half of the steps are of {MIN_STEP:g} rad (or m) and more, as between static poses"
)


def detect_static_poses(plan: Plan, columns: Sequence[Column], numbers: Numbers) -> Numbers:
    """Return the numbers as static poses without a clock, if they are given so or show it; else unchanged."""
    evidence, clock = "given as an option" if plan.poses else "", plan.clock.columns
    if plan.poses is None:
        evidence = _find_static_poses(plan, columns, numbers)
    if evidence == _LIKE_POSES:
        both = (Hint("poses", True, "reads them as static poses"), Hint("period", None, "confirms a motion"))
        warning = LogWarning("like-poses", f"{evidence}: read as a motion", hints=both, role="time")
        return replace(numbers, warnings=(*numbers.warnings, warning))
    if not evidence:
        return numbers
    as_motion = Hint("time", clock[0].called) if clock else Hint("period")
    hints = () if plan.poses else (replace(as_motion, effect="reads them as a motion"),)
    inference = Inference("rows", "static poses", evidence, hints=hints)
    return replace(numbers, clock=None, texts=(), still=True, inferences=(inference,), warnings=())


def _find_static_poses(plan: Plan, columns: Sequence[Column], numbers: Numbers) -> str:
    """Return why the rows of a table are static poses, or may be; empty if nothing shows it."""
    known, is_left_out = plan.tables.known, any(i.evidence == GIVEN for i in plan.clock.inferences)
    if known and known.own and plan.roles.joints and not (plan.clock.columns or is_left_out):
        return "urmpipe wrote them without times"
    poses = _find_large_steps(plan, columns, numbers)
    if poses is None:
        return ""
    rows, steps = poses
    rates = numbers.values[:MAX_ROWS, [columns.index(rate) for rate in plan.roles.rates if rate in columns]]
    lengths, turned = np.linalg.norm(steps, axis=1), np.linalg.norm(np.diff(steps, axis=0), axis=1)
    is_aimless = _quantile(turned, TURN_QUANTILE) >= MIN_TURN * _quantile(lengths, TURN_QUANTILE)
    seen = f"the joints step by up to {np.abs(steps).max():.2g} rad (or m) from row to row, in"
    if numbers.clock is None:
        jumps = np.count_nonzero(lengths[1:-1] > 2 * np.maximum(lengths[:-2], lengths[2:]))
        speeds = np.abs(rates[np.isfinite(rates).all(axis=1)]).max(axis=1, initial=0.0)
        is_moving = len(speeds) > 0 and np.ptp(speeds) > 0 and _quantile(speeds, 0.5) >= MIN_SPEED
        if is_moving or (not is_aimless and jumps < max(3, MIN_JUMPS * len(lengths))):
            return _LIKE_POSES
        return f"no clock, and {seen} {'no direction' if is_aimless else 'lines with jumps between them'}"
    times = numbers.clock[rows]
    durations = np.diff(times[:, (times > UNREADABLE).all(axis=0)], axis=0)[0]
    if not is_aimless or not len(durations):
        return ""
    name, standstill = plan.clock.columns[0].name, float(np.mean(durations <= 0))
    pause = _quantile(np.abs(durations), 0.5)
    if standstill >= MIN_STANDSTILL:
        why = f"repeats or runs backwards in {standstill:.0%} of them"
    else:
        why = f"says that {pause / 1e9:.3g} s pass" if pause >= MIN_PAUSE_NS else ""
    return f"{seen} no direction, and {name} {why}" if why else ""


def _find_large_steps(
    plan: Plan, columns: Sequence[Column], numbers: Numbers
) -> tuple[IntArray, FloatArray] | None:
    """Return rows before and after steps between poses, (2, n), and the steps in [rad] or [m], (n, joints).

    None if they are those of a motion at the assumed period, or if recorded rates explain them.
    """
    roles = plan.roles
    joints = [columns.index(joint) for joint in roles.joints if joint in columns]
    values = numbers.values[:MAX_ROWS, joints]
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    if not joints or len(joints) < len(roles.joints) or len(rows) < MIN_ROWS:
        return None
    steps = joint_steps(values[rows], roles.joints, plan.units, plan.tables.known)
    size = np.abs(steps).max(axis=1)
    moves = np.flatnonzero(size > MIN_POSE_STEP)
    are_few = len(moves) < max(MIN_ROWS - 1, MAX_REST_SHARE * len(size))
    if are_few or size.sum() > (1 + MAX_REST_SHARE) * size[moves].sum():
        return None
    rates = [columns.index(rate) for rate in roles.rates if rate in columns]
    if _quantile(size[moves], 0.5) <= MIN_STEP or (
        rates and period_of(values, numbers.values[:MAX_ROWS, rates])
    ):
        return None
    return np.stack([rows[moves], rows[moves + 1]]), steps[moves]


def _quantile(values: FloatArray, share: float) -> float:
    at = int(share * (len(values) - 1))  # np.quantile imports numpy.ma
    return float(np.partition(values, at)[at])
