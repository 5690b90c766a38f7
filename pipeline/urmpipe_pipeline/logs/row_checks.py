"""Stamps that are rounded, and stamps that rows share: the times of the rows behind them.

1. A regular clock of period p, cut or rounded to a resolution r, has stamps within a strip of width r along a
   straight line of slope p. Stamps in such a strip, with no other steps than a clock of this kind can make,
   are taken as those of a regular clock (`behind_rounded`, `behind_repeated`).
2. Other rows that share a stamp are spread evenly up to the next stamp; where their numbers vary with the
   time since the stamp before, as those of received chunks do, back to that one (`spread_repeated`).

What no log may hold, and what a person should know about one: found at once, over whole arrays.

Rows that are static poses: calibration grids, random configurations, points measured one by one.

No motion joins them, so a clock of theirs is a label. They are known by the steps between rows that differ (a
pose may be measured several times): no joint makes them in the time that is assumed, and they continue in no
direction, or in straight lines with jumps from each to the next. A motion is smooth, however coarse.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import GAP, Inference, LogWarning, has_gap_after
from urmpipe_pipeline.logs.clock import PAPER_PERIOD, Clock, in_si
from urmpipe_pipeline.logs.clock_columns import GIVEN
from urmpipe_pipeline.logs.clock_text import EVEN, EXPONENTS, OTHER_TIME
from urmpipe_pipeline.logs.columns import Column, unit_hints
from urmpipe_pipeline.logs.formats.cells import LONGEST_CELL
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.numbers import NO_TIME, SHOWN_FINDINGS, UNREADABLE, Numbers
from urmpipe_pipeline.logs.formats.table import ROWS_READ
from urmpipe_pipeline.logs.plan import Plan
from urmpipe_pipeline.logs.rates import period_of

LEAST_SHARE = 0.1
"""Steps of the rarer kind are at least this share of all where a single lost or doubled sample could make
them: fewer are damage, not rounding."""

LEAST_CHANGES = 3
"""A clock with repeated stamps shows its period from this many changes of the stamp on."""

EVEN_TICKS = 0.1
"""Ticks of a coarse clock, and the counts of rows in them, differ by less than this share. Counts may also
differ by a row at either end of a tick; of ticks with one or two rows, by one."""

LEAST_STAMPS = 4
"""Fewer different stamps tell nothing about the time of a row."""

FEW, FEW_SHARE = 5, 0.1
"""More rows than these few, and than this share of all, are no single faults."""

UNLIKE = 5.0
"""Spread rows are apart by the usual time, within this factor, ..."""

LEAST_LIKE = 0.9
"""... in this share of the rows; else the clock stood still, or the rate of the rows is not known."""

EVIDENT = 0.5
"""The times between rows vary on one side of their stamps by less than this share of the other side."""


@dataclass(frozen=True, slots=True, eq=False)
class Regular:
    """A regular clock behind quantised stamps.

    Attributes:
        period: Time between rows in [ns].
        resolution: Step of the stamps in [ns].
        t_ns: Its times in integer [ns], none further from its stamp than the resolution, shape (n,).
    """

    period: float
    resolution: int
    t_ns: IntArray


def behind_rounded(stamps: IntArray) -> Regular | None:
    """Return the regular clock behind stamps that differ, such as 3, 7, 10, 13, 17 ms; None if there is none.

    Stamps are in integer [ns], strictly increasing, shape (n,).
    """
    steps = np.diff(stamps)
    if len(steps) < LEAST_CHANGES:
        return None
    shortest, longest = int(steps.min()), int(steps.max())
    if longest > 2 * shortest:
        return None
    resolution = int(np.gcd.reduce(steps))
    if longest - shortest > resolution:
        return None
    rarer = min(float(np.mean(steps == shortest)), float(np.mean(steps == longest)))
    if 2 * resolution > shortest and rarer < LEAST_SHARE:
        return None
    return _along_a_line(stamps, np.arange(len(stamps)), resolution)


def behind_repeated(stamps: IntArray) -> Regular | None:
    """Return the regular clock behind stamps that repeat about equally often; None if there is none.

    Stamps are in integer [ns], never running backwards, shape (n,).
    """
    steps = np.diff(stamps)
    changes = np.flatnonzero(steps) + 1
    if len(changes) < LEAST_CHANGES or not are_many(int(np.count_nonzero(steps == 0)), len(stamps)):
        return None
    ticks, counts = steps[changes - 1], np.diff(changes)
    resolution = int(ticks.max())
    if resolution - int(ticks.min()) > EVEN_TICKS * resolution:
        return None
    mean = float(counts.mean())
    if np.ptp(counts) > max(1 if mean < 2 else 2, EVEN_TICKS * mean):
        return None
    return _along_a_line(stamps, changes, resolution)


def _along_a_line(stamps: IntArray, rows: IntArray, resolution: int) -> Regular | None:
    """Return the times along the line of least squares through some rows, if all are in a strip about it.

    The strip may be wider than the resolution by the shorter of half of it and one period: the line is not
    known better than that.
    """
    origin = int(stamps[0])
    x, y = rows - rows.mean(), (stamps[rows] - origin).astype(np.float64)
    period = float(x @ y / (x @ x))
    away = (stamps - origin) - period * np.arange(len(stamps))
    lowest, highest = float(away.min()), float(away.max())
    if highest - lowest > resolution + min(period, resolution / 2.0):
        return None
    line = (lowest + highest) / 2.0 + period * np.arange(len(stamps))
    return Regular(period, resolution, np.rint(line).astype(np.int64) + origin)


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Times of rows that shared stamps.

    Attributes:
        t_ns: Times of the rows in integer [ns], strictly increasing, shape (n,).
        first: The first row that repeats the stamp before it, from 0.
        repeats: How many rows do.
        period: Usual time between rows in [ns].
        many: Whether those are no single faults.
        before: Whether they are spread back to the stamp before; else up to the next.
        assumed: Whether they are many, and their numbers do not show on which side they belong.
    """

    t_ns: IntArray
    first: int
    repeats: int
    period: float
    many: bool
    before: bool
    assumed: bool


def spread_repeated(stamps: IntArray) -> Spread | None:
    """Return the times of rows of which some share stamps; None if these tell no times.

    Stamps are in integer [ns], never running backwards, shape (n,). Over a pause the rows stay together.
    """
    begins = np.flatnonzero(np.diff(stamps, prepend=stamps[0] - 1))
    counts, own = np.diff(begins, append=len(stamps)), stamps[begins]
    if len(own) < LEAST_STAMPS:
        return None
    repeats, passed = len(stamps) - len(own), np.diff(own).astype(np.float64)
    behind, before = passed / counts[:-1], passed / counts[1:]
    even = [float(np.log(rows).std()) for rows in (behind, before)]
    many = are_many(repeats, len(stamps))
    back = many and even[1] < EVIDENT * even[0]
    apart, weights = (before, counts[1:]) if back else (behind, counts[:-1])
    period = _usual(apart, weights)
    like = (apart < UNLIKE * period) & (apart > period / UNLIKE)
    if weights[like].sum() < LEAST_LIKE * weights.sum():
        return None
    apart = np.where(apart < GAP * period, apart, period)
    apart = np.append(period, apart) if back else np.append(apart, period)
    within = np.arange(len(stamps)) - np.repeat(begins, counts)
    away = within - np.repeat(counts - 1, counts) if back else within
    times = stamps + np.rint(away * np.repeat(apart, counts)).astype(np.int64)
    if (np.diff(times) <= 0).any():
        return None
    first = int(np.argmax(np.diff(stamps) == 0)) + 1
    assumed = many and not back and even[0] >= EVIDENT * even[1]
    return Spread(times, first, repeats, period, many, back, assumed)


def are_many(count: int, rows: int) -> bool:
    """Return whether so many rows repeat a time, or run backwards, that they are no single faults."""
    return count > max(FEW, FEW_SHARE * rows)


def _usual(apart: FloatArray, weights: IntArray) -> float:
    """Return the median of times between rows, each counted by its rows."""
    order = np.argsort(apart)
    half = np.searchsorted(np.cumsum(weights[order]), weights.sum() / 2.0)
    return float(apart[order][half])


FAR_BACK = 10.0
"""Median periods: a clock that falls back by more, to about its first time, begins again."""

SKIPPED = "skipped-row"
"""The kind of the warnings about rows that were left out."""

MOST_SKIPPED = 0.01
"""Share of the rows that may be left out because they cannot be read."""

REBUILT = "clock-rebuilt"
SPREAD = "clock-spread"
REPEATED = "repeated-time"
"""The kinds of the warnings about times that several rows share: all of a coarse clock, many, single ones."""

INCREASING = "times that increase from row to row"

SHOWN_GAPS = 10
"""Gaps that are told with their rows; the others are counted."""


def trimmed(numbers: Numbers) -> tuple[Numbers, tuple[Inference, ...]]:
    """Return the numbers without rows at the end that hold neither a time nor a value, and their count."""
    if numbers.clock is None:
        return numbers, ()
    end = rows = len(numbers.clock)
    while end and numbers.clock[end - 1] == NO_TIME and np.isnan(numbers.values[end - 1]).all():
        end -= 1
    if end == rows:
        return numbers, ()
    why = f"{format_count(rows - end, 'row')} at the end left out, without a time and a value"
    return numbers.at(slice(end)), (Inference(ROWS_READ, f"{end} of {rows}", why),)


def without_unread(numbers: Numbers) -> tuple[Numbers, list[LogWarning]]:
    """Return the numbers without the rows that could not be read, and a warning for each of these."""
    if not numbers.unread:
        return numbers, []
    rows = np.delete(np.arange(len(numbers.values)), sorted(numbers.unread))
    lasting = numbers.lasting
    read = replace(numbers.at(rows), findings=lasting, wrong=len(lasting))
    shown = sorted(numbers.unread.items())[:SHOWN_FINDINGS]
    warnings = [
        LogWarning(SKIPPED, f"data row {row} of the file is left out: {'; '.join(map(str, faults))}", row)
        for row, faults in ((numbers.file_row(row + 1), faults) for row, faults in shown)
    ]
    if len(numbers.unread) > len(shown):
        more = len(numbers.unread) - len(shown)
        warnings.append(LogWarning(SKIPPED, f"{more} more rows are left out"))
    return read, warnings


def may_skip(numbers: Numbers) -> bool:
    """Return whether so few rows could not be read that they may be left out."""
    return 0 < len(numbers.unread) <= MOST_SKIPPED * len(numbers.values)


def rebuilt(numbers: Numbers) -> Numbers:
    """Return the numbers with a time of its own for each row where rows of the file share one.

    A regular clock that is coarser than its rows is rebuilt; other rows that share a time are spread.
    """
    times = numbers.clock
    if times is None or times.min(initial=0) <= UNREADABLE or np.diff(times).min(initial=1) != 0:
        return numbers
    if (clock := behind_repeated(times)) is not None:
        period, resolution = f"{clock.period / 1e9:.9g} s", f"{clock.resolution / 1e9:.9g} s"
        seen = f"times in steps of {resolution} cover {clock.resolution / clock.period:.4g} rows each"
        found = Inference("clock", f"rebuilt with a period of {period}", seen, hints=EVEN)
        warning = LogWarning(REBUILT, f"{seen}: a regular clock of {period} is used instead")
        return _with_clock(numbers, clock.t_ns, found, warning)
    spread = spread_repeated(times)
    if spread is None:
        return numbers
    repeat = "repeats" if spread.repeats == 1 else "repeat"
    seen = f"{spread.repeats} of {len(times)} rows {repeat} the time of the row before"
    side = "back to the time before" if spread.before else "up to the next time"
    done = f"rows of one time are spread evenly {side}"
    found = Inference("clock", f"{done}, usually {spread.period / 1e9:.6g} s apart", seen, hints=EVEN)
    taken = "rows that share a time were sampled after it" if spread.assumed else ""
    warning = LogWarning(
        SPREAD if spread.many else REPEATED, f"{seen}: {done}", spread.first + 1,
        hints=EVEN, assumption=taken, role="time",
    )  # fmt: skip
    return _with_clock(numbers, spread.t_ns, found, warning)


def _with_clock(numbers: Numbers, times: IntArray, found: Inference, warning: LogWarning) -> Numbers:
    inferences, warnings = (*numbers.inferences, found), (*numbers.warnings, warning)
    return replace(numbers, clock=times, inferences=inferences, warnings=warnings)


def find_errors(layout: LogTable, numbers: Numbers, names: Sequence[str], clock: Clock) -> list[Finding]:
    """Return everything that is wrong with the rows of a table, in the order of its lines.

    These are the first findings, and one that counts the others.
    """
    wrong = [*_clock_errors(numbers, clock), *_infinities(numbers, names)]
    total = numbers.wrong + len(wrong)
    wrong = sorted(wrong, key=lambda one: (one.row or 0, one.column or "", one.message))[:SHOWN_FINDINGS]
    rows_in_file = [numbers.file_row(one.row or 0) for one in wrong]
    lines = layout.lines_of(rows_in_file)
    file = layout.file
    placed = zip(wrong, rows_in_file, strict=True)
    here = (replace(one, file=file, line=lines.get(row), row=row) for one, row in placed)
    read = (_with_other_time(one, clock) for one in numbers.findings)
    findings = sorted((*read, *here), key=lambda one: one.line or 0)[:SHOWN_FINDINGS]
    if total > len(findings):
        findings.append(Finding(f"{total - len(findings)} more findings", file=file))
    return findings


def _with_other_time(finding: Finding, clock: Clock) -> Finding:
    """Return a finding, of a cell of the clock with what to give for another time."""
    of_clock = finding.column in [column.header for column in clock.columns] and not finding.hints
    return replace(finding, hints=OTHER_TIME) if of_clock else finding


def missing_samples(groups: Iterable[tuple[FloatArray, Sequence[str]]]) -> list[LogWarning]:
    """Return a warning for the columns in which samples are missing, those that lack the same rows together.

    The columns come in groups with their names: values in any unit, shape (n, columns).
    """
    alike: dict[bytes, tuple[BoolArray, list[str]]] = {}
    for values, names in groups:
        for j in _unusual(values):
            missing = np.isnan(values[:, j])
            if missing.any():
                alike.setdefault(missing.tobytes(), (missing, []))[1].append(names[j])
    warnings = []
    for missing, lacking in alike.values():
        verb = "has" if len(lacking) == 1 else "have"
        count = f"{np.count_nonzero(missing)} of {len(missing)} rows"
        said = f"{', '.join(lacking)} {verb} no value in {count}, first in this one"
        warnings.append(LogWarning("missing", said, int(np.argmax(missing)) + 1))
    return warnings


def refuse_empty(values: FloatArray, names: Sequence[str], file: str) -> None:
    """Raise if a column has no value at all.

    Args:
        values: In the file's own units, shape (n, columns).
        names: Of the columns.
        file: The file that they are of.

    Raises:
        LogError: With a finding for each such column.
    """
    findings = [
        Finding(f"found no value in any of {len(values)} rows, allowed: at least one", file, column=names[j])
        for j in _unusual(values)
        if np.isnan(values[:, j]).all()
    ]
    if findings:
        raise LogError(*findings)


def _clock_errors(numbers: Numbers, clock: Clock) -> Iterable[Finding]:
    """Yield row and column where the time is missing, repeated or runs backwards."""
    times = numbers.clock
    if times is None or not len(times) or not clock.columns:
        return
    name = clock.columns[0].header
    yield from _folds(times, clock)
    if times.min() > UNREADABLE and (np.diff(times) > 0).all():
        return
    yield from unknown_times(numbers, clock)
    valid = np.flatnonzero(times > UNREADABLE)
    steps = np.diff(times[valid])
    back, repeated = np.flatnonzero(steps < 0), np.flatnonzero(steps == 0)
    if len(back) and np.array_equal(back, begins := _second_logs(times[valid], steps)):
        yield _several_logs(valid[np.array(begins) + 1], numbers, name)
        return

    def found(k: int, more: str, hints: tuple[Hint, ...]) -> Finding:
        now, before = (clock.shown(int(times[valid[i]])) for i in (k + 1, k))
        said = f"found {now} {'again' if steps[k] == 0 else f'after {before}'}{more}, allowed: {INCREASING}"
        return Finding(said, row=int(valid[k + 1]) + 1, column=name, hints=hints)

    if are_many(len(back), len(times)):
        yield found(int(back[0]), f", as {len(back)} of {len(times)} rows run backwards: no clock", EVEN)
    else:
        yield from (found(k, "", OTHER_TIME) for k in back.tolist())
    if len(repeated) and not len(back) and len(valid) == len(times):  # others are spread
        more = f", as {len(repeated)} of {len(times)} rows repeat a time: too coarse to rebuild a clock"
        yield found(int(repeated[0]), more, EVEN)


def unknown_times(numbers: Numbers, clock: Clock) -> Iterable[Finding]:
    """Yield row and column where a row has no time, or one that cannot be read."""
    if numbers.clock is None or not clock.columns:
        return
    name = clock.columns[0].header
    for index in np.flatnonzero(numbers.clock == NO_TIME).tolist():
        said = "found no time, allowed: a time in every row"
        yield Finding(said, row=index + 1, column=name, hints=OTHER_TIME)
    for index in np.flatnonzero(numbers.clock == UNREADABLE).tolist():
        text = " ".join(cells.text(index).strip() for cells in numbers.texts)
        said = f"found {text[:LONGEST_CELL]!r}, allowed: times as in the other rows"
        yield Finding(said, row=index + 1, column=name, hints=OTHER_TIME)


def _folds(times: IntArray, clock: Clock) -> Iterable[Finding]:
    """Yield where numbers go on as times of day written hhmmss do: 101159 is followed by 101200."""
    if clock.told or clock.lasts or clock.unit not in EXPONENTS:
        return
    if len(times) < 3 or times.min() <= UNREADABLE:
        return
    one = 10 ** EXPONENTS[clock.unit]
    steps = np.diff(times)
    if steps.max() <= 40 * one:
        return
    second, minute = times // one % 100, times // (100 * one) % 100
    late = np.where(steps < 4040 * one, steps - 40 * one, steps - 4040 * one)  # 60 s are 100, 3600 s 10000
    jumps = (late > 0) & (late <= GAP * np.median(steps)) & (second[1:] < second[:-1])
    if not jumps.any() or (second >= 60).any() or (minute >= 60).any():
        return
    row = int(np.flatnonzero(jumps)[0])
    after, before = (f"{times[k] / one:.15g}" for k in (row + 1, row))
    said = f"found {after} after {before}, as a time of day hhmmss goes on, allowed: a clock of one unit"
    hints = (
        Hint("", effect="write it as hh:mm:ss"),
        *unit_hints(clock.columns[:1], clock.unit, "takes it as no time of day"),
        *OTHER_TIME,
    )
    yield Finding(said, row=row + 2, column=clock.columns[0].header, hints=hints)


def _several_logs(starts: IntArray, numbers: Numbers, name: str) -> Finding:
    """Return the finding that a clock begins again at some rows, from 0: episodes or repetitions."""
    rows = [numbers.file_row(int(row) + 1) for row in starts]
    begin = ", ".join(map(str, rows[:SHOWN_GAPS])) + (", ..." if len(rows) > SHOWN_GAPS else "")
    ends = [*(row - 1 for row in rows), numbers.file_row(len(numbers.values))]
    logs = [f"{first}:{last}" for first, last in zip([numbers.file_row(1), *rows], ends, strict=True)]
    hints = (*(Hint("rows", one, "reads one") for one in logs[:SHOWN_GAPS]), *OTHER_TIME)
    said = f"found {len(logs)} logs in one file: the clock begins again in row{'s' * (len(rows) > 1)} {begin}"
    return Finding(f"{said}, allowed: one log", row=int(starts[0]) + 1, column=name, hints=hints)


def _second_logs(times: IntArray, steps: IntArray) -> list[int]:
    """Return the steps back to about the first time, after which the times go on: several logs."""
    if len(steps) < 3:
        return []
    period = np.median(np.abs(steps))
    far, near = steps < -FAR_BACK * period, np.abs(times[1:] - times[0]) <= GAP * period
    goes_on = np.append((steps[1:] > 0) & (steps[1:] <= GAP * period), False)
    return np.flatnonzero(far & near & goes_on).tolist()


def _infinities(numbers: Numbers, names: Sequence[str]) -> Iterable[Finding]:
    for j in _unusual(numbers.values):
        column = numbers.values[:, j]
        for row in np.flatnonzero(np.isinf(column)).tolist():
            said = f"found {column[row]}, allowed: finite numbers"
            yield Finding(said, row=row + 1, column=names[j])


def _unusual(values: FloatArray) -> list[int]:
    """Return the columns that may hold NaN or infinities: their sums are not finite, as is quickly seen."""
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(values.sum()):
            return []
        return np.flatnonzero(~np.isfinite(values.sum(axis=0))).tolist()


def gaps(t_ns: IntArray, file_row: Callable[[int], int]) -> list[LogWarning]:
    """Return a warning with each gap between two rows at times in [ns], shape (n,).

    Args:
        t_ns: The times.
        file_row: The data row of the file of a row, both from 1.
    """
    places = np.flatnonzero(has_gap_after(t_ns)).tolist()
    if not places:
        return []
    steps = np.diff(t_ns)

    def passed(k: int) -> str:
        return f"{steps[k] / 1e9:.6g} s"

    found = [f"{passed(k)} before row {file_row(k + 2)}" for k in places[1:SHOWN_GAPS]]
    if len(places) > SHOWN_GAPS:
        longest = max(places, key=lambda k: steps[k])
        more = f"{len(places) - SHOWN_GAPS} more"
        found.append(f"{more}, the longest of all of {passed(longest)} before row {file_row(longest + 2)}")
    said = ", ".join([f"{passed(places[0])} pass before this row", *found])
    counted, period = f"{len(places)} gaps: " if found else "", float(np.median(steps))
    message = f"{counted}{said}; the median period is {period / 1e9:.6g} s"
    return [LogWarning("gap", message, file_row(places[0] + 2))]


FASTEST = 20.0  # [rad/s] or [m/s], which no joint of an arm exceeds from pose to pose

STEP = (
    FASTEST * PAPER_PERIOD
)  # median step of static poses in [rad] or [m]: none is made in the assumed period
REST = STEP / 10  # rows with smaller steps are of one pose
REST_SHARE = (
    0.1  # ... if these add up to less than this share of the others, which are this share of the rows
)

TURNED = 0.8
"""Static poses change their steps by this share of them at least: of a motion with n samples in its shortest
period it is 2 sin(pi / n), of random configurations 1.4 or more."""

TURNING = 0.75
"""The quantile at which that is told: a grid goes straight on for some poses, a log has single spikes."""

JUMPS = 0.03
"""Share of the steps of a grid, three at least, that are twice as long as those before and after them. In a
motion with n samples in its shortest period these add up to twice the step times cos(2 pi / n)."""

APART = 2e9
"""Rows so many [ns] apart, in the median, are no samples of a motion that steps so."""

IMPOSSIBLE = 0.1
"""Share of the times that repeat or run backwards from which a clock is a label; a damaged one has less."""

LEAST_ROWS = 6
"""Fewer rows tell nothing."""

BLOCKS, BLOCK = 8, 500
"""Blocks of so many rows, spread evenly, decide."""


LIKE_POSES = f"no clock, and half of the steps are of {STEP:g} rad (or m) and more, as between static poses"


def as_poses(plan: Plan, columns: Sequence[Column], numbers: Numbers) -> Numbers:
    """Return numbers as static poses without a clock, if the user says so or they show it; else as they are.

    Args:
        plan: What is read: `poses` says whether they are, or None where the rows are to tell.
        columns: The columns of the numbers.
        numbers: The rows of a table.
    """
    why = "given as an option" if plan.poses else _evidence(plan, columns, numbers)
    if why == LIKE_POSES:
        both = (Hint("poses", True, "reads them as static poses"), Hint("period", None, "confirms a motion"))
        warning = LogWarning("like-poses", f"{why}: read as a motion", hints=both, role="time")
        return replace(numbers, warnings=(*numbers.warnings, warning))
    if not why:
        return numbers
    clock = plan.clock.columns
    moving = Hint("time", clock[0].called) if clock else Hint("period")
    hints = () if plan.poses else (replace(moving, effect="reads them as a motion"),)
    found = Inference("rows", "static poses", why, hints=hints)
    return replace(numbers, clock=None, texts=(), still=True, inferences=(found,), warnings=())


def _evidence(plan: Plan, columns: Sequence[Column], numbers: Numbers) -> str:
    """Return why the rows of a table are static poses, or may be; empty if nothing shows it."""
    if plan.poses is None and _written_untimed(plan):
        return "urmpipe wrote them without times"
    joints = [columns.index(joint) for joint in plan.roles.joints if joint in columns]
    count = len(numbers.values)
    if plan.poses is False or not joints or len(joints) < len(plan.roles.joints) or count < LEAST_ROWS:
        return ""
    rows = np.arange(count)
    if count > BLOCKS * BLOCK:
        rows = np.add.outer(np.linspace(0, count - BLOCK, BLOCKS).astype(np.int64), np.arange(BLOCK)).ravel()
    q, turns = in_si(
        numbers.values[rows[:, np.newaxis], joints], plan.roles.joints, plan.units, plan.tables.known
    )
    rows, q = rows[known := np.isfinite(q).all(axis=1)], q[known]
    steps = np.diff(q, axis=0)
    steps -= np.rint(steps / FULL_TURN) * turns
    size = np.abs(steps).max(axis=1)
    moves = np.flatnonzero(size > REST)
    rests = size.sum() - size[moves].sum()
    if len(moves) < max(LEAST_ROWS - 1, REST_SHARE * len(size)) or rests > REST_SHARE * size[moves].sum():
        return ""
    steps, size = steps[moves], size[moves]
    rates = [columns.index(rate) for rate in plan.roles.rates if rate in columns]
    if _quantile(size, 0.5) <= STEP or (
        rates and period_of(numbers.values[:, joints], numbers.values[:, rates])
    ):
        return ""
    usual, turned = np.linalg.norm(steps, axis=1), np.linalg.norm(np.diff(steps, axis=0), axis=1)
    said = f"the joints step by up to {size.max():.2g} {'rad' if turns.any() else 'm'} from row to row, in"
    aimless = _quantile(turned, TURNING) >= TURNED * _quantile(usual, TURNING)
    if numbers.clock is not None:
        times = numbers.clock[np.stack([rows[moves], rows[moves + 1]])]
        return _label(plan, times, f"{said} no direction") if aimless else ""
    jumps = np.count_nonzero(usual[1:-1] > 2 * np.maximum(usual[:-2], usual[2:]))
    lines = jumps >= max(3, JUMPS * len(usual))
    why = f"no clock, and {said} {'no direction' if aimless else 'lines with jumps between them'}"
    return why if aimless or lines else LIKE_POSES


def _written_untimed(plan: Plan) -> bool:
    """Return whether urmpipe wrote joints without times: it does so of static poses alone."""
    known, clock = plan.tables.known, plan.clock
    named = any(one.evidence == GIVEN for one in clock.inferences)  # left out on request
    return known is not None and known.own and bool(plan.roles.joints) and not (clock.columns or named)


def _label(plan: Plan, times: IntArray, said: str) -> str:
    """Return why a clock is a label; empty if it may be that of a motion.

    Its times before and after some steps of the joints are in integer [ns], shape (2, n).
    """
    timed = (times > UNREADABLE).all(axis=0)
    passed, name = np.diff(times[:, timed], axis=0)[0], plan.clock.columns[0].name
    if not len(passed):
        return ""
    stands = float(np.mean(passed <= 0))
    if stands >= IMPOSSIBLE:
        return f"{said}, and {name} repeats or runs backwards in {stands:.0%} of them"
    apart = _quantile(np.abs(passed), 0.5)
    return f"{said}, and {name} says that {apart / 1e9:.3g} s pass" if apart >= APART else ""


def _quantile(values: FloatArray, share: float) -> float:
    """Return a quantile of some values (np.quantile imports numpy.ma)."""
    at = int(share * (len(values) - 1))
    return float(np.partition(values, at)[at])
