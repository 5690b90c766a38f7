"""What no log may hold, and what a person should know about one: found at once, over whole arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import GAP, Inference, LogWarning, has_gap_after
from urmpipe_pipeline.logs.clock import Clock
from urmpipe_pipeline.logs.clock_columns import OTHER_CLOCK, OTHER_TIME
from urmpipe_pipeline.logs.columns import unit_hints
from urmpipe_pipeline.logs.formats.cells import LONGEST_CELL
from urmpipe_pipeline.logs.formats.clock_forms import EXPONENTS, NO_TIME, UNREADABLE
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.numbers import SHOWN_FINDINGS, Numbers
from urmpipe_pipeline.logs.formats.table import ROWS_READ
from urmpipe_pipeline.logs.timestamps import are_many

FAR_BACK = 10.0
"""Median periods: a clock that falls back by more, to about its first time, begins again."""

SKIPPED = "skipped-row"
"""The kind of the warnings about rows that were left out."""

MOST_SKIPPED = 0.01
"""Share of the rows that may be left out because they cannot be read."""

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
        now, before = (clock.format(int(times[valid[i]])) for i in (k + 1, k))
        said = f"found {now} {'again' if steps[k] == 0 else f'after {before}'}{more}, allowed: {INCREASING}"
        return Finding(said, row=int(valid[k + 1]) + 1, column=name, hints=hints)

    if are_many(len(back), len(times)):
        yield found(
            int(back[0]), f", as {len(back)} of {len(times)} rows run backwards: no clock", OTHER_CLOCK
        )
    else:
        yield from (found(k, "", OTHER_TIME) for k in back.tolist())
    if len(repeated) and not len(back) and len(valid) == len(times):  # others are spread
        more = f", as {len(repeated)} of {len(times)} rows repeat a time: too coarse to rebuild a clock"
        yield found(int(repeated[0]), more, OTHER_CLOCK)


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
    if clock.is_stated or clock.are_durations or clock.unit not in EXPONENTS:
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
