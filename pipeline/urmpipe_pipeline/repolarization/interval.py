"""The interval to which an environment limits a joint: a wrap is a jump by its width P.

- `wrap_periods`: P of each joint from the intervals that the user gives, else one turn.
- `find_double_turn_joints`: joints that the log shows to be limited to +-2 pi.
- `interval_inferences`: the interval of each joint with its evidence, and warnings of contradictions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError
from urmpipe_models.measure_units import compatible_units, quantity_to_si
from urmpipe_models.wraps import FULL_TURN, Repolarized
from urmpipe_pipeline.joint_log import Inference, JointLog, LogColumn, LogWarning
from urmpipe_pipeline.logs.log_map import GivenInterval

Interval = tuple[float, float]

PRISMATIC_PERIOD = math.inf  # no step is near it
TURN_ROUNDING = 1e-3  # share of whole turns: an interval is typed as -3.1416:3.1416
MAX_OUTSIDE = 1e-5  # share of P by which values may be outside a given interval: files round, and so do users
INFERRED_SLACK = 0.01  # share of P by which values may pass an inferred interval: noise, overshoot
_FOLDED_ROWS = 64  # rows that NumPy folds at once: it is slow over rows as short as those of a log


def fold_rows(fold: np.ufunc, values: FloatArray) -> FloatArray:
    """Reduce the rows of values in any unit, shape (n, columns), by a function, to shape (columns,)."""
    count, columns = values.shape
    even = count - count % _FOLDED_ROWS
    if even == 0:
        return np.asarray(fold.reduce(values, axis=0))
    wide = fold.reduce(values[:even].reshape(-1, _FOLDED_ROWS * columns), axis=0)
    return np.asarray(fold.reduce(np.vstack((wide.reshape(-1, columns), values[even:])), axis=0))


def check_joint_names(names: Iterable[str], revolute: Iterable[str]) -> None:
    """Raise an `OptionError` with the names in option `interval` that are not those of revolute joints."""
    revolute = list(dict.fromkeys(revolute))
    unknown = [name for name in names if name and name not in revolute]
    if unknown:
        allowed = f"revolute joints: {', '.join(revolute) or 'none'}"
        raise OptionError(Finding(parameter="interval", found=", ".join(unknown), allowed=allowed))


def wrap_periods(
    log: JointLog, revolute: Sequence[bool], intervals: Mapping[str, GivenInterval]
) -> FloatArray:
    """Return P of each joint in [rad], shape (joints,): of its interval, or a full turn; inf if prismatic.

    Args:
        log: The log.
        revolute: Which of its joints are revolute.
        intervals: Interval of a joint by name, of all revolute joints by "", in the unit of the file or with
            units.

    Raises:
        OptionError: If an interval is empty or infinite, or of a joint that is not in the log or prismatic.
        LogError: If values are outside, with a finding per joint.
    """
    for name, ends in intervals.items():
        low, high = _to_file_unit(ends, 1.0)
        if not (math.isfinite(low) and math.isfinite(high) and 0.0 < high - low < math.inf):
            found = f"{name}={low:g}:{high:g}" if name else f"{low:g}:{high:g}"
            allowed = "LOW:HIGH with LOW below HIGH, both finite"
            raise OptionError(Finding(parameter="interval", found=found, allowed=allowed))
    check_joint_names(intervals, (name for name, turns in zip(log.joints, revolute, strict=True) if turns))
    periods, findings = np.full(len(log.joints), PRISMATIC_PERIOD), []
    for j, name in enumerate(log.joints):
        if not revolute[j]:
            continue
        chosen = intervals.get(name, intervals.get(""))
        periods[j] = FULL_TURN
        if chosen is not None:
            column = _joint_column(log, j)
            interval = _to_file_unit(chosen, column.factor)
            low, high = sorted(column.factor * (column.sign * end + column.offset) for end in interval)
            turns = round((high - low) / FULL_TURN) * FULL_TURN
            is_whole = turns and abs(high - low - turns) <= TURN_ROUNDING * turns
            periods[j] = turns if is_whole else high - low
            findings += _find_outside(log, j, column, interval, (low, high))
    if findings:
        raise LogError(*findings)
    return periods


def find_double_turn_joints(
    log: JointLog, unwrapped: Repolarized, joints: IntArray, steps: FloatArray, slack: FloatArray
) -> list[int]:
    """Return the joints that are limited to +-2 pi: they step by 4 pi, never by 2 pi, within +-2 pi.

    Args:
        log: The log.
        unwrapped: Its repolarized joints.
        joints: Joint index of each unexplained step, shape (u,).
        steps: Size of each in [rad], shape (u,).
        slack: Largest distance of each from 4 pi in [rad], shape (u,).

    Raises:
        LogError: If a joint steps by both 2 pi and 4 pi.
    """
    double_steps = joints[np.abs(np.abs(steps) - 2.0 * FULL_TURN) <= slack]
    limit = FULL_TURN * (1.0 + INFERRED_SLACK)
    doubled = [j for j in np.unique(double_steps).tolist() if np.nanmax(np.abs(log.q[:, j])) <= limit]
    findings = [
        Finding(
            f"found {np.count_nonzero(double_steps == j)} steps of about 4 pi and"
            f" {np.count_nonzero(unwrapped.joints == j)} of about 2 pi, allowed: wraps of one interval",
            log.files[0].name if log.files else log.name,
            column=log.joints[j],
            hints=(Hint("interval", {log.joints[j]: None}, "specifies it"),),
        )
        for j in doubled
        if (unwrapped.joints == j).any()
    ]
    if findings:
        raise LogError(*findings)
    return doubled


def interval_inferences(
    log: JointLog, unwrapped: Repolarized, periods: FloatArray, intervals: Mapping[str, GivenInterval]
) -> tuple[list[Inference], list[LogWarning]]:
    """Return the interval of each joint that has a given one or wraps, and warnings about contradictions.

    Args:
        log: The log.
        unwrapped: Its repolarized joints.
        periods: P of each joint in [rad], shape (joints,).
        intervals: As in `wrap_periods`.
    """
    groups: dict[tuple[str, bool], list[int]] = {}  # joints by formatted interval and whether it is given
    broken_turns: dict[tuple[str, float], list[str]] = {}
    too_wide: list[LogWarning] = []
    ranges: dict[int, Interval] = {}
    lowest = highest = np.empty(0)
    if len(unwrapped.rows):
        lowest, highest = fold_rows(np.minimum, log.q), fold_rows(np.maximum, log.q)
    for j in np.flatnonzero(np.isfinite(periods)).tolist():
        column = _joint_column(log, j)
        chosen = intervals.get(log.joints[j], intervals.get(""))
        if chosen is not None:
            shown = _format_interval(_to_file_unit(chosen, column.factor), column)
            groups.setdefault((shown, True), []).append(j)
            if periods[j] != round(periods[j] / FULL_TURN) * FULL_TURN:
                broken_turns.setdefault((shown, float(periods[j])), []).append(column.name)
        elif (unwrapped.joints == j).any():
            if np.isnan(lowest[j]):  # slower, but without the missing values
                lowest[j], highest[j] = np.nanmin(log.q[:, j]), np.nanmax(log.q[:, j])
            low, high = sorted(_to_file_value(column, value) for value in (lowest[j], highest[j]))
            ranges[j] = low, high
            period = float(periods[j]) / abs(column.factor)
            if high - low > (1.0 + INFERRED_SLACK) * period:
                message = f"{column.name} wraps by {period:.6g} {column.unit}, but its values span"
                message += f" {high - low:.6g} {column.unit}, more than a period"
                hints = (Hint("interval", {column.name: None}, "says its limits"),)
                too_wide.append(LogWarning("interval", message, hints=hints))
            else:
                shown = _format_interval(_likely_interval(low, high, period), column)
                groups.setdefault((shown, False), []).append(j)
    inferences = []
    for (value, is_given), joints in groups.items():
        names = tuple(log.joints[j] for j in joints)
        evidence = "given as an option"
        if not is_given:
            evidence = _format_evidence(log, unwrapped, periods, {j: ranges[j] for j in joints})
        hints = (Hint("interval", {names[0]: None}),)
        what = f"interval of {', '.join(names)}"
        inferences.append(Inference(what, value, evidence, "interval", names, hints))
    return inferences, [*_broken_turn_warnings(broken_turns), *too_wide]


def _broken_turn_warnings(joints: Mapping[tuple[str, float], Sequence[str]]) -> list[LogWarning]:
    return [
        LogWarning(
            "interval",
            f"{', '.join(names)}: the interval {interval} is {period / FULL_TURN:.6g} turns wide: angles wrap"
            " by whole turns; check the unit and the interval",
            parameter="interval",
        )
        for (interval, period), names in joints.items()
    ]


def _joint_column(log: JointLog, joint: int) -> LogColumn:
    """Return the column of a joint in the file; without one the values are in rad."""
    columns = (column for column in log.columns if column.role == "joint" and column.index == joint)
    return next(columns, LogColumn(log.joints[joint], log.joints[joint], "joint", joint, "rad"))


def _find_outside(
    log: JointLog, joint: int, column: LogColumn, interval: Interval, si_interval: Interval
) -> list[Finding]:
    """Return a finding if values of a joint are outside its interval, in the unit of the file and in SI."""
    low, high = si_interval
    slack = MAX_OUTSIDE * (high - low)
    rows = np.flatnonzero((log.q[:, joint] < low - slack) | (log.q[:, joint] > high + slack))
    if not len(rows):
        return []
    row = int(rows[0])
    first = f"{_to_file_value(column, log.q[row, joint]):.6g} {column.unit} in row {row + 1}"
    message = (
        f"found {len(rows)} values outside, first {first}, allowed: {_format_interval(interval, column)}"
    )
    file = log.files[0].name if log.files else log.name
    return [Finding(message, file, row=row + 1, column=column.name, parameter="interval")]


def _to_file_unit(interval: GivenInterval, factor: float) -> Interval:
    """Return an interval in the unit of the file, which is `factor` rad."""
    low, high = (
        quantity_to_si(end, compatible_units("rad")) / factor if isinstance(end, str) else end
        for end in interval
    )
    return low, high


def _to_file_value(column: LogColumn, value: float) -> float:
    return column.sign * (float(value) / column.factor - column.offset)


def _format_interval(interval: Interval, column: LogColumn) -> str:
    return f"{interval[0]:.6g}..{interval[1]:.6g} {column.unit}"


def _likely_interval(low: float, high: float, period: float) -> Interval:
    """Return the likely interval of values from low to high: it starts at a multiple of a quarter period."""
    starts = [quarter * period / 4.0 for quarter in (-2, 0, -1, -3, -4)]
    slack = INFERRED_SLACK * period
    fitting = [start for start in starts if low >= start - slack and high <= start + period + slack]
    start = min(fitting or [low], key=lambda start: abs(low - start) + abs(start + period - high))
    return start, start + period


def _format_evidence(
    log: JointLog, unwrapped: Repolarized, periods: FloatArray, ranges: Mapping[int, Interval]
) -> str:
    """Return the evidence for the interval of joints with the same unit, by the ranges of their values."""
    first = next(iter(ranges))
    column = _joint_column(log, first)
    wraps = int(np.isin(unwrapped.joints, list(ranges)).sum())
    period = float(periods[first]) / abs(column.factor)
    low, high = min(low for low, _ in ranges.values()), max(high for _, high in ranges.values())
    return f"{format_count(wraps, 'wrap')} by {period:.6g} {column.unit}, values from {low:.6g} to {high:.6g}"
