"""The repolarizer over a log, and its audit: what was undone, repaired, left, or is ambiguous.

`audit_log` takes these steps:

1. unwrap the revolute joints by their periods P (`interval`); again with 4 pi where a joint steps by 4 pi;
2. find the samples that a linear resampling left on wraps (in-between), and repair them if requested;
3. find the gaps in which a joint can have turned by more than P / 2 (ambiguous);
4. return the values with an `AuditEntry` for each finding, one warning per kind, and the inferred intervals.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Hint
from urmpipe_models.wraps import (
    FULL_TURN,
    Repolarized,
    find_interpolated_samples,
    line_residuals,
    reinterpolate,
    repolarize,
)
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import MISSED_SAMPLE, Inference, JointLog, LogWarning, ns_to_seconds
from urmpipe_pipeline.logs.log_map import GivenInterval
from urmpipe_pipeline.repolarization.interval import (
    find_double_turn_joints,
    interval_inferences,
    wrap_periods,
)

AuditKind = Literal["wrap", "in-between", "repaired", "unexplained", "ambiguous"]

MAX_ENTRIES = 10_000  # of a kind other than wraps: a log with more is not one of joints; a warning counts all
DOUBLE_TURN_RATIO = 3.0  # |step - 4 pi| / motion of the joint at its largest speed
_LIST_ALL = (Hint("audit", None, "lists all", call="ingest"),)


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """A change by the repolarizer, or a step or gap that it could not explain.

    The kinds:
        wrap: a jump of a period that was undone.
        in-between: a sample that a linear resampling left on a wrap; it is kept.
        repaired: such a sample, moved to the line through its neighbours.
        unexplained: a step above a quarter period that is no wrap; it is kept.
        ambiguous: a gap in which the joint can have turned by more than half a period; the nearest turn is
            used.

    Attributes:
        joint: Name of the joint.
        row: Data row of the file, from 1: the first row after the step, or the sample itself.
        t: Time in [s]: of a step the middle between its two samples; of a sample its time.
        time_uncertainty: t is known to +- this, in [s].
        step: The step as in the file in [rad]; of a sample the distance from the line through its repolarized
            neighbours.
        turns_before: Turns k added before it.
        turns_after: Turns k added from it on.
        kind: The kind.
    """

    joint: str
    row: int
    t: float
    time_uncertainty: float
    step: float
    turns_before: int
    turns_after: int
    kind: AuditKind = "wrap"

    @property
    def sample(self) -> int:
        """Index of the row, from 0."""
        return self.row - 1

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object of the audit."""
        return {
            "kind": self.kind, "joint": self.joint, "row": self.row, "sample": self.sample,
            "t": self.t, "time_uncertainty": self.time_uncertainty, "step": self.step,
            "turns_before": self.turns_before, "turns_after": self.turns_after,
        }  # fmt: skip


class AuditResult(NamedTuple):
    """The repolarized joints of a log, and their audit.

    Attributes:
        q: Repolarized values in [rad] or [m] on the rows of the file, repaired if requested, shape (n,
            joints).
        entries: The audit, by row.
        warnings: One warning per kind of entry, and those about intervals.
        inferences: The intervals to which the joints are limited.
        unresolved: Row before, row after and joint index of each unexplained or ambiguous step, shape (u, 3);
            do not interpolate across them.
        broken: The same of each step that is no motion, shape (b, 3): the unresolved steps, and those to and
            from in-between samples.
    """

    q: FloatArray
    entries: tuple[AuditEntry, ...]
    warnings: tuple[LogWarning, ...]
    inferences: tuple[Inference, ...]
    unresolved: IntArray
    broken: IntArray


class _Steps(NamedTuple):
    """Steps to rows of joints, the row of the value before each, and their sizes."""

    rows: IntArray
    joints: IntArray
    before: IntArray
    sizes: FloatArray

    @property
    def table(self) -> IntArray:
        """Row before, row after and joint index, shape (m, 3)."""
        return np.column_stack((self.before, self.rows, self.joints))

    @property
    def largest(self) -> int:
        """Index of the largest step."""
        return int(np.argmax(np.abs(self.sizes)))

    def joint_names(self, log: JointLog) -> str:
        return text.join_list([log.joints[j] for j in np.unique(self.joints).tolist()])


class _Unwrapped(NamedTuple):
    """The repolarized joints; period P in [rad] and speed limit in [rad/s] of each joint, shape (joints,)."""

    joints: Repolarized
    periods: FloatArray
    limits: FloatArray


def audit_log(
    log: JointLog,
    robot: Chain | None = None,
    *,
    interval: Mapping[str, GivenInterval] | None = None,
    repaired: bool = False,
) -> AuditResult:
    """Repolarize the revolute joints of a log on the rows of the file.

    Args:
        log: The log, its times strictly increasing.
        robot: The arm, which determines the revolute joints and their speed limits.
        interval: Interval of a joint by name, of all revolute joints by "", in the unit of the file.
        repaired: Whether in-between samples are moved to the line through their neighbours.

    Raises:
        OptionError: If an interval is not allowed.
        LogError: If values are outside of a given interval, or an interval cannot be inferred.
    """
    intervals = interval or {}
    unwrapped, periods, limits = _unwrap(log, robot, intervals)
    inferences, interval_warnings = interval_inferences(log, unwrapped, periods, intervals)
    unexplained = _steps_to(log, *unwrapped.unexplained.T)
    in_between = _find_in_between(log, unwrapped, periods)
    ambiguous, speeds = _find_ambiguous(log, unwrapped, periods, limits, in_between)
    steps: dict[AuditKind, _Steps] = {
        "wrap": _steps_to(log, unwrapped.rows, unwrapped.joints),
        "repaired" if repaired else "in-between": in_between,
        "unexplained": unexplained,
        "ambiguous": ambiguous,
    }
    warnings = [
        *interval_warnings,
        *_unexplained_warning(log, unexplained, periods),
        *_ambiguous_warning(log, ambiguous, speeds),
        *([] if repaired else _in_between_warning(log, in_between)),
    ]
    q, unresolved = unwrapped.q, np.concatenate((unexplained.table, ambiguous.table))
    broken = unresolved
    if not repaired:
        broken = np.concatenate((unresolved, in_between.table, _steps_from(log, in_between)))
    elif len(in_between.rows):
        q = reinterpolate(q, log.t, np.column_stack((in_between.rows, in_between.joints)))
    entries = _build_entries(log, unwrapped, periods, steps)
    return AuditResult(q, tuple(entries), tuple(warnings), tuple(inferences), unresolved, broken)


def is_revolute(log: JointLog, robot: Chain | None) -> BoolArray:
    """Return which joints are revolute, by the robot or else the unit of their columns, shape (joints,)."""
    if robot is not None and log.joints:
        return np.array([joint.kind == "revolute" for joint in robot.moving])
    return np.array([unit == "rad" for unit in log.joint_units], dtype=np.bool_)


def _unwrap(log: JointLog, robot: Chain | None, intervals: Mapping[str, GivenInterval]) -> _Unwrapped:
    revolute = is_revolute(log, robot)
    periods = wrap_periods(log, revolute.tolist(), intervals)
    limits = np.array([np.inf if robot is None else robot.moving[j].velocity for j in range(len(revolute))])
    dt = ns_to_seconds(np.diff(log.t_ns, prepend=log.t_ns[:1]))
    unwrapped = repolarize(log.q, dt, period=periods, max_speed=limits)
    if "" in intervals or not len(unwrapped.unexplained):
        return _Unwrapped(unwrapped, periods, limits)
    doubled = [j for j in _find_double_turns(log, unwrapped) if log.joints[j] not in intervals]
    if doubled:
        periods[doubled] = 2.0 * FULL_TURN
        unwrapped = repolarize(log.q, dt, period=periods, max_speed=limits)
    return _Unwrapped(unwrapped, periods, limits)


def _steps_to(log: JointLog, rows: IntArray, joints: IntArray) -> _Steps:
    """Return the steps to some values, as in the file, from the last value that is not missing."""
    before = rows - 1
    for j in np.unique(joints[np.isnan(log.q[before, joints])]):
        of_joint = joints == j
        present = np.flatnonzero(~np.isnan(log.q[:, j]))
        before[of_joint] = present[np.searchsorted(present, rows[of_joint]) - 1]
    return _Steps(rows, joints, before, log.q[rows, joints] - log.q[before, joints])


def _steps_from(log: JointLog, steps: _Steps) -> IntArray:
    """Return the steps from the rows of other steps to the next value: row before, row after, joint index."""
    after = steps.rows + 1
    for k in np.flatnonzero(np.isnan(log.q[after, steps.joints])):
        rest = log.q[after[k] :, steps.joints[k]]
        after[k] += int(np.argmax(~np.isnan(rest)))
    return np.column_stack((steps.rows, after, steps.joints))


def _find_double_turns(log: JointLog, unwrapped: Repolarized) -> list[int]:
    """Return the joints that are limited to +-2 pi, by their unexplained steps."""
    steps = _steps_to(log, *unwrapped.unexplained.T)
    speeds = np.zeros(len(log.joints))
    for j in np.unique(steps.joints):
        speeds[j] = _sustained_speed(log, unwrapped.q, int(j), steps.rows[steps.joints == j])
    elapsed = ns_to_seconds(log.t_ns[steps.rows] - log.t_ns[steps.before])
    slack = DOUBLE_TURN_RATIO * speeds[steps.joints] * elapsed + FULL_TURN / 100.0
    slack = np.minimum(slack, FULL_TURN / 2.0)
    return find_double_turn_joints(log, unwrapped, steps.joints, steps.sizes, slack)


def _find_in_between(log: JointLog, unwrapped: Repolarized, periods: FloatArray) -> _Steps:
    """Return the in-between samples, with their distances from the line through their neighbours as sizes."""
    samples, distances = [np.empty((0, 2), dtype=np.int64)], [np.empty(0)]
    all_rows, times, sparse = np.arange(log.rows), log.t, _has_missing(log)
    for j in np.unique(unwrapped.joints).tolist():
        present, q, x, t = all_rows, log.q[:, j], unwrapped.q[:, j], times
        if sparse[j]:
            present = np.flatnonzero(~np.isnan(q))
            q, x, t = q[present], x[present], t[present]
        wraps = np.searchsorted(present, unwrapped.rows[unwrapped.joints == j])
        hidden = np.searchsorted(present, unwrapped.in_between[unwrapped.in_between[:, 1] == j, 0])
        at = np.union1d(hidden, find_interpolated_samples(q, x, t, wraps, float(periods[j])))
        samples.append(np.column_stack((present[at], np.full(len(at), j))))
        distances.append(line_residuals(x, t, at))
    rows, joints = np.concatenate(samples).T
    order = np.lexsort((joints, rows))
    steps = _steps_to(log, rows[order], joints[order])
    return steps._replace(sizes=np.concatenate(distances)[order])


def _find_ambiguous(
    log: JointLog, unwrapped: Repolarized, periods: FloatArray, limits: FloatArray, in_between: _Steps
) -> tuple[_Steps, FloatArray]:
    """Return the gaps in which a joint can have turned by more than half a period, and its largest speed.

    That is the limit of the robot, else the largest sustained speed.
    """
    steps = np.diff(log.t_ns)
    rows, joints = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    speeds = np.zeros(len(periods))
    uneven = len(steps) and steps.max() > MISSED_SAMPLE * steps.min()
    usual = float(np.median(steps)) if uneven else steps.max(initial=0)
    wide = np.flatnonzero(steps > MISSED_SAMPLE * usual)
    sparse = _has_missing(log)
    for j in np.flatnonzero(np.isfinite(periods)).tolist():
        before, after = wide, wide + 1
        if sparse[j]:
            present = np.flatnonzero(~np.isnan(log.q[:, j]))
            at = np.flatnonzero(np.diff(log.t_ns[present]) > MISSED_SAMPLE * usual)
            before, after = present[at], present[at + 1]
        if not len(after):
            continue
        unexplained = unwrapped.unexplained[unwrapped.unexplained[:, 1] == j, 0]
        skipped = np.concatenate((unexplained, in_between.rows[in_between.joints == j], after))
        is_limited = np.isfinite(limits[j])
        speeds[j] = limits[j] if is_limited else _sustained_speed(log, unwrapped.q, j, skipped)
        reach = speeds[j] * ns_to_seconds(log.t_ns[after] - log.t_ns[before])
        rows.append(after[reach > periods[j] / 2.0])
        joints.append(np.full(len(rows[-1]), j))
    at, on = np.concatenate(rows), np.concatenate(joints)
    order = np.lexsort((on, at))
    return _steps_to(log, at[order], on[order]), speeds[on[order]]


def _has_missing(log: JointLog) -> BoolArray:
    """Return which joints miss samples; one pass over all decides whether to look column by column."""
    if not np.isnan(log.q.sum()):
        return np.zeros(len(log.joints), dtype=np.bool_)
    return np.asarray(np.isnan(log.q.sum(axis=0)))


def _sustained_speed(log: JointLog, x: FloatArray, joint: int, skipped: IntArray) -> float:
    """Return the largest speed of a repolarized joint over two successive steps, in [rad/s].

    Outliers have no effect, nor have the steps to and from skipped rows.
    """
    present = np.flatnonzero(~np.isnan(x[:, joint]))
    speed = np.abs(np.diff(x[present, joint])) / ns_to_seconds(np.diff(log.t_ns[present]))
    at = np.searchsorted(present, skipped)
    for steps in (at - 1, at):
        speed[steps[(steps >= 0) & (steps < len(speed))]] = 0.0
    return float(np.minimum(speed[1:], speed[:-1]).max(initial=0.0))


def _build_entries(
    log: JointLog, unwrapped: Repolarized, periods: FloatArray, steps: Mapping[AuditKind, _Steps]
) -> list[AuditEntry]:
    """Return the audit by row; of each kind other than wraps the first `MAX_ENTRIES`."""
    entries: list[AuditEntry] = []
    for kind, of_kind in steps.items():
        count = None if kind == "wrap" else MAX_ENTRIES
        rows, joints, before = of_kind.rows[:count], of_kind.joints[:count], of_kind.before[:count]
        start, end = log.t_ns[rows if kind in ("in-between", "repaired") else before], log.t_ns[rows]
        turns = (
            np.rint((unwrapped.q[at, joints] - log.q[at, joints]) / periods[joints]).astype(np.int64)
            for at in (before, rows)
        )
        columns = (rows, joints, (start + end) / 2e9, (end - start) / 2e9, of_kind.sizes[:count], *turns)
        for row, j, t, half, size, k_before, k_after in zip(*(c.tolist() for c in columns), strict=True):
            entries.append(AuditEntry(log.joints[j], row + 1, t, half, size, k_before, k_after, kind))
    return sorted(entries, key=lambda entry: entry.row)


def _unexplained_warning(log: JointLog, steps: _Steps, periods: FloatArray) -> Iterator[LogWarning]:
    if not len(steps.rows):
        return
    names, row = steps.joint_names(log), int(steps.rows[0])
    quarter = f"{np.degrees(periods[steps.joints].min() / 4.0):.0f} deg"
    if len(steps.rows) == 1:
        value = log.q[row, steps.joints[0]]
        message = (
            f"{names} steps by more than {quarter} from the value before, to {value:.6g} rad: not a wrap,"
        )
        yield LogWarning("large-step", f"{message} the value is kept", row + 1)
        return
    worst = steps.largest
    message = f"{len(steps.rows)} steps of {names} by more than {quarter} are not wraps and are kept"
    message += f"; the largest, of {log.joints[steps.joints[worst]]} by"
    to_row = log.file_row(int(steps.rows[worst]) + 1)
    message += f" {np.degrees(abs(steps.sizes[worst])):.4g} deg, is to row {to_row}"
    yield LogWarning("large-step", message, row + 1, hints=_LIST_ALL)


def _in_between_warning(log: JointLog, steps: _Steps) -> Iterator[LogWarning]:
    if not len(steps.rows):
        return
    names, worst, row = steps.joint_names(log), steps.largest, int(steps.rows[0]) + 1
    distance = f"{abs(steps.sizes[worst]):.4g} rad"
    if len(steps.rows) == 1:
        message = f"{names} lies inside a wrap, as after linear resampling: {distance} off the line between"
        hints: tuple[Hint, ...] = (Hint("repair", True, "moves it onto this line"),)
        yield LogWarning("in-between", f"{message} its neighbours", row, hints=hints)
        return
    message = f"{len(steps.rows)} samples of {names} lie inside wraps, as after linear resampling: up to"
    message += f" {distance} off the line between their neighbours"
    message += f" ({log.joints[steps.joints[worst]]} in row {log.file_row(int(steps.rows[worst]) + 1)})"
    hints = (Hint("repair", True, "moves them onto this line"), *_LIST_ALL)
    yield LogWarning("in-between", message, row, hints=hints)


def _ambiguous_warning(log: JointLog, steps: _Steps, speeds: FloatArray) -> Iterator[LogWarning]:
    if not len(steps.rows):
        return
    gaps = np.unique(np.column_stack((steps.rows, steps.before)), axis=0)
    durations = ns_to_seconds(log.t_ns[gaps[:, 0]] - log.t_ns[gaps[:, 1]])
    longest, row = int(np.argmax(durations)), int(gaps[0, 0]) + 1
    fastest = {log.joints[j]: speeds[steps.joints == j].max() for j in np.unique(steps.joints).tolist()}
    joints = ", ".join(f"{name} (moving at {speed:.3g} rad/s)" for name, speed in fastest.items())
    turned = f"{joints} may have turned by more than half a period"
    if len(gaps) == 1:
        message = f"no value for {durations[0]:.6g} s before this row: {turned}; the nearest turn is assumed"
        yield LogWarning("ambiguous-turn", message, row)
        return
    message = f"in {len(gaps)} gaps without values {turned}; the longest gap, {durations[longest]:.6g} s,"
    message += f" ends at row {log.file_row(int(gaps[longest, 0]) + 1)}; the nearest turns are assumed"
    yield LogWarning("ambiguous-turn", message, row, hints=_LIST_ALL)
