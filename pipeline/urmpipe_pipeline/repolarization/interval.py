"""The interval to which an environment limits a joint: its width P is what a wrap jumps by.

It is +-pi or any other interval of one turn unless the user says otherwise, or the log shows a joint that
is limited to +-2 pi.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError
from urmpipe_models.measure_units import compatible_units, quantity_to_si
from urmpipe_models.wraps import FULL_TURN, Repolarized
from urmpipe_pipeline.joint_log import Inference, JointLog, LogColumn, LogWarning
from urmpipe_pipeline.sources.options import GivenInterval
from urmpipe_pipeline.text import counted

Interval = tuple[float, float]

_SIDE_BY_SIDE = 64  # rows that NumPy folds at once: it is slow over rows as short as a log's

SLIDING = math.inf
"""The period of a joint that slides: no step is near it."""

ROUNDED = 1e-3
"""An interval is typed as -3.1416:3.1416: within this share of whole turns it means whole turns."""

SLACK = 1e-5
"""A value may lie outside by this share of P: files round, and so do people."""

SHOWN_SLACK = 0.01
"""Values may pass the limits of an inferred interval by this share of P: noise, overshoot."""


def fold_rows(fold: np.ufunc, values: FloatArray) -> FloatArray:
    """Fold the rows into one.

    Values are in any unit, shape (n, columns), the row is of shape (columns,).
    """
    count, joints = values.shape
    whole = count - count % _SIDE_BY_SIDE
    if whole == 0:
        return np.asarray(fold.reduce(values, axis=0))
    wide = fold.reduce(values[:whole].reshape(-1, _SIDE_BY_SIDE * joints), axis=0)
    return np.asarray(fold.reduce(np.vstack((wide.reshape(-1, joints), values[whole:])), axis=0))


def _refuse_empty(name: str, low: float, high: float) -> None:
    """Raise an `OptionError` if an interval has no positive, finite width."""
    if not (math.isfinite(low) and math.isfinite(high) and 0.0 < high - low < math.inf):
        found = f"{name}={low:g}:{high:g}" if name else f"{low:g}:{high:g}"
        allowed = "LOW:HIGH with LOW below HIGH, both finite"
        raise OptionError(Finding(parameter="interval", found=found, allowed=allowed))


def _in_own_unit(interval: GivenInterval, factor: float) -> Interval:
    """Return an interval in the file's own unit, one of which is `factor` rad."""
    low, high = (
        quantity_to_si(end, compatible_units("rad")) / factor if isinstance(end, str) else end
        for end in interval
    )
    return low, high


def check_joint_names(given: Iterable[str], able: Iterable[str]) -> None:
    """Raise an `OptionError` with the joints that are given an interval, and are none of those that turn."""
    able = list(dict.fromkeys(able))
    unknown = [name for name in given if name and name not in able]
    if unknown:
        allowed = f"joints that turn: {', '.join(able) or 'none'}"
        raise OptionError(Finding(parameter="interval", found=", ".join(unknown), allowed=allowed))


def wrap_periods(log: JointLog, turning: Sequence[bool], given: Mapping[str, GivenInterval]) -> FloatArray:
    """Return P of each joint in [rad], shape (joints,): of the interval given, or a full turn.

    It is infinite for joints that slide.

    Args:
        log: The log.
        turning: Which of its joints turn.
        given: Interval of a joint by its name, by "" that of all that turn; in the file's own unit or with
            units.

    Raises:
        OptionError: If an interval makes no sense, or is one of a joint that is not there or slides.
        LogError: If values lie outside, with a finding for each joint.
    """
    for name, ends in given.items():
        _refuse_empty(name, *_in_own_unit(ends, 1.0))
    able = [name for name, turns in zip(log.joints, turning, strict=True) if turns]
    check_joint_names(given, able)
    periods, findings = np.full(len(log.joints), SLIDING), []
    for j, name in enumerate(log.joints):
        if not turning[j]:
            continue
        chosen = given.get(name, given.get(""))
        periods[j] = FULL_TURN
        if chosen is not None:
            column = _column(log, j)
            interval = _in_own_unit(chosen, column.factor)
            low, high = sorted(column.factor * (column.sign * end + column.offset) for end in interval)
            periods[j] = _whole_turns(high - low)
            findings += _outside(log, j, column, interval, (low, high))
    if findings:
        raise LogError(*findings)
    return periods


def find_double_turn_joints(
    log: JointLog, fixed: Repolarized, joints: IntArray, steps: FloatArray, rest: FloatArray
) -> list[int]:
    """Return the joints that are limited to +-2 pi: they step by 4 pi, never by 2 pi, within +-2 pi.

    Each unexplained step has its joint index, its size in [rad] and by how much it may miss 4 pi in [rad],
    all of shape (u,).

    Raises:
        LogError: If a joint steps by both, so that the file cannot tell.
    """
    doubles = joints[np.abs(np.abs(steps) - 2.0 * FULL_TURN) <= rest]
    found = [
        j
        for j in np.unique(doubles).tolist()
        if np.nanmax(np.abs(log.q[:, j])) <= FULL_TURN * (1.0 + SHOWN_SLACK)
    ]
    findings = [
        Finding(
            f"found {np.count_nonzero(doubles == j)} steps of about 4 pi and"
            f" {np.count_nonzero(fixed.joints == j)} of about 2 pi, allowed: wraps of one interval",
            log.files[0].name if log.files else log.name,
            column=log.joints[j],
            hints=(Hint("interval", {log.joints[j]: None}, "specifies it"),),
        )
        for j in found
        if (fixed.joints == j).any()
    ]
    if findings:
        raise LogError(*findings)
    return found


def interval_inferences(
    log: JointLog, fixed: Repolarized, periods: FloatArray, given: Mapping[str, GivenInterval]
) -> tuple[list[Inference], list[LogWarning]]:
    """Return the interval of each joint that was given or seen to wrap, and what contradicts it.

    Periods P are in [rad], shape (joints,); intervals are given as `wrap_periods` takes them.
    """
    groups: dict[tuple[str, bool], list[int]] = {}
    warnings = []
    broken: dict[tuple[str, float], list[str]] = {}
    ends: dict[int, Interval] = {}
    least = most = np.empty(0)
    if len(fixed.rows):
        least, most = fold_rows(np.minimum, log.q), fold_rows(np.maximum, log.q)
    for j in np.flatnonzero(np.isfinite(periods)).tolist():
        column = _column(log, j)
        chosen = given.get(log.joints[j], given.get(""))
        if chosen is not None:
            interval = _in_own_unit(chosen, column.factor)
            groups.setdefault((_shown(interval, column), True), []).append(j)
            if periods[j] != _turns(periods[j]) * FULL_TURN:
                broken.setdefault((_shown(interval, column), float(periods[j])), []).append(column.name)
        elif (fixed.joints == j).any():
            if np.isnan(least[j]):  # slower, but deaf to NaN
                least[j], most[j] = np.nanmin(log.q[:, j]), np.nanmax(log.q[:, j])
            low, high = sorted(_in_file(column, value) for value in (least[j], most[j]))
            ends[j] = low, high
            period = float(periods[j]) / abs(column.factor)
            if high - low > (1.0 + SHOWN_SLACK) * period:
                warnings.append(_too_wide(column, low, high, period))
            else:
                groups.setdefault((_shown(_likely(low, high, period), column), False), []).append(j)
    said = []
    for (value, _), joints in groups.items():
        names, wrapped = tuple(log.joints[j] for j in joints), {j: ends[j] for j in joints if j in ends}
        why = _evidence(log, fixed, periods, wrapped) if wrapped else "given as an option"
        hints = (Hint("interval", {names[0]: None}),)
        said.append(Inference(f"interval of {', '.join(names)}", value, why, "interval", names, hints))
    return said, [*(_no_turns(names, *one) for one, names in broken.items()), *warnings]


def _column(log: JointLog, joint: int) -> LogColumn:
    """Return the file's column of a joint; without one the values are as in the file."""
    named = (column for column in log.columns if column.role == "joint" and column.index == joint)
    return next(named, LogColumn(log.joints[joint], log.joints[joint], "joint", joint, "rad"))


def _turns(width: float) -> int:
    """Return the nearest number of turns."""
    return round(width / FULL_TURN)


def _whole_turns(width: float) -> float:
    """Return a width as exact whole turns where it is meant as such."""
    whole = _turns(width) * FULL_TURN
    return whole if whole and abs(width - whole) <= ROUNDED * whole else width


def _no_turns(names: Sequence[str], interval: str, period: float) -> LogWarning:
    said = f"{', '.join(names)}: the interval {interval} is {period / FULL_TURN:.6g} turns wide"
    said = f"{said}: angles wrap by whole turns; check the unit and the interval"
    return LogWarning("interval", said, parameter="interval")


def _outside(
    log: JointLog, joint: int, column: LogColumn, interval: Interval, ends: Interval
) -> list[Finding]:
    """Return a finding if values of a joint lie outside its interval, given in the file's unit and in SI."""
    slack = SLACK * (ends[1] - ends[0])
    rows = np.flatnonzero((log.q[:, joint] < ends[0] - slack) | (log.q[:, joint] > ends[1] + slack))
    if not len(rows):
        return []
    row = int(rows[0])
    message = (
        f"found {len(rows)} values outside, first {_in_file(column, log.q[row, joint]):.6g} {column.unit} in"
        f" row {row + 1}, allowed: {_shown(interval, column)}"
    )
    file = log.files[0].name if log.files else log.name
    return [Finding(message, file, row=row + 1, column=column.name, parameter="interval")]


def _in_file(column: LogColumn, value: float) -> float:
    """Return a value in the file's own unit."""
    return column.sign * (float(value) / column.factor - column.offset)


def _shown(interval: Interval, column: LogColumn) -> str:
    return f"{interval[0]:.6g}..{interval[1]:.6g} {column.unit}"


def _likely(low: float, high: float, period: float) -> Interval:
    """Return the interval that values from low to high are limited to: it begins at a quarter period."""
    starts = [quarter * period / 4.0 for quarter in (-2, 0, -1, -3, -4)]
    slack = SHOWN_SLACK * period
    fitting = [at for at in starts if low >= at - slack and high <= at + period + slack] or [low]
    start = min(fitting, key=lambda at: abs(low - at) + abs(at + period - high))
    return start, start + period


def _too_wide(column: LogColumn, low: float, high: float, period: float) -> LogWarning:
    said = (
        f"{column.name} wraps by {period:.6g} {column.unit}, but its values span {high - low:.6g}"
        f" {column.unit}, more than a period"
    )
    return LogWarning("interval", said, hints=(Hint("interval", {column.name: None}, "says its limits"),))


def _evidence(log: JointLog, fixed: Repolarized, periods: FloatArray, ends: Mapping[int, Interval]) -> str:
    """Return why some joints of one unit, whose values have these ends, are limited to an interval."""
    first = next(iter(ends))
    column = _column(log, first)
    wraps = int(np.isin(fixed.joints, list(ends)).sum())
    period = float(periods[first]) / abs(column.factor)
    low, high = min(one for one, _ in ends.values()), max(one for _, one in ends.values())
    return f"{counted(wraps, 'wrap')} by {period:.6g} {column.unit}, values from {low:.6g} to {high:.6g}"
