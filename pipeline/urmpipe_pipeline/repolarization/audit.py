"""The repolarizer over a log, and its audit: what was undone, repaired, left, or is ambiguous.

- `AuditEntry`: one finding.
- `audit_log`: unwrap the joints that turn, and return the values with entries, warnings and inferences.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
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
from urmpipe_pipeline.repolarization.interval import (
    find_double_turn_joints,
    interval_inferences,
    wrap_periods,
)
from urmpipe_pipeline.sources.options import GivenInterval

AuditKind = Literal["wrap", "in-between", "repaired", "unexplained", "ambiguous"]


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """One thing that the repolarizer did to a joint, or could not decide.

    kind says which:
        wrap: a jump of a period that was undone.
        in-between: a sample that a linear resampling left on a wrap; it stands as it is.
        repaired: such a sample, put on the line through its neighbours.
        unexplained: a step above a quarter period that is no wrap; it stays.
        ambiguous: a gap in which the joint can have turned more than half a period; the nearest is taken.

    Attributes:
        joint: Name of the joint.
        row: Data row of the file, from 1: the first row after the step, or the sample itself.
        t: Instant in [s]: of a step t_r, half way between its two samples; of a sample its time.
        half_period: t is known to +- this, in [s].
        step: The step as it stands in the file, in [rad]; of a sample how far it lies from the line
            through its repolarized neighbours.
        before: Turns k added before it.
        after: Turns k added from it on.
        kind: What it is.
    """

    joint: str
    row: int
    t: float
    half_period: float
    step: float
    before: int
    after: int
    kind: AuditKind = "wrap"

    @property
    def sample(self) -> int:
        """Index of the row, from 0."""
        return self.row - 1

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object of the audit."""
        return {
            "kind": self.kind, "joint": self.joint, "row": self.row, "sample": self.sample,
            "t": self.t, "half_period": self.half_period, "step": self.step,
            "from": self.before, "to": self.after,
        }  # fmt: skip


ALL = (Hint("audit", None, "lists all", call="ingest"),)
"""Where those are of which a warning gives the number."""

MOST = 10_000
"""Entries of a kind that are no wraps: a log with more of them is none of joints; a warning counts all."""

NEAR = 3.0
"""A step misses 4 pi by no more than this times what the joint moves at its largest speed."""


@dataclass(frozen=True, slots=True, eq=False)
class AuditResult:
    """A log's joints, repolarized, and what there is to say about it.

    Attributes:
        q: Repolarized values in [rad] or [m] on the file's own rows, repaired if that was asked for, shape
            (n, joints).
        entries: The audit, by row.
        warnings: What a person should know.
        inferences: The intervals that the joints are limited to.
        unresolved: Row before, row after and joint index of each step that is unexplained or ambiguous,
            shape (u, 3): nothing is to be interpolated across it.
        broken: The same of each step that is no motion, shape (b, 3): the unresolved ones, and those to and
            from an in-between sample.
    """

    q: FloatArray
    entries: tuple[AuditEntry, ...]
    warnings: tuple[LogWarning, ...]
    inferences: tuple[Inference, ...]
    unresolved: IntArray
    broken: IntArray


class _Places(NamedTuple):
    """Where something is: rows and joints, the rows of the values before, and how large it is."""

    rows: IntArray
    joints: IntArray
    before: IntArray
    figures: FloatArray

    @property
    def steps(self) -> IntArray:
        """Row before, row after and joint index, shape (m, 3)."""
        return np.column_stack((self.before, self.rows, self.joints))

    @property
    def worst(self) -> int:
        """Index of the largest."""
        return int(np.argmax(np.abs(self.figures)))


def audit_log(
    log: JointLog,
    robot: Chain | None = None,
    *,
    interval: Mapping[str, GivenInterval] | None = None,
    repaired: bool = False,
) -> AuditResult:
    """Repolarize the joints that turn, on the file's own rows, and tell all about it.

    Args:
        log: The log, its times strictly increasing.
        robot: The arm: it tells which joints turn and how fast they can.
        interval: The interval of a joint by its name, by "" of all that turn, in the file's own unit.
        repaired: Whether in-between samples are put on the line through their neighbours.

    Raises:
        OptionError: If an interval makes no sense.
        LogError: If values lie outside of an interval that was given, or it cannot be told without.
    """
    given = interval or {}
    fixed, periods, limits = _repolarized(log, robot, given)
    inferences, noticed = interval_inferences(log, fixed, periods, given)
    odd = _steps_to(log, *fixed.unexplained.T)
    between = _in_between(log, fixed, periods)
    unsure, speeds = _ambiguous(log, fixed, periods, limits, between)
    kinds: dict[AuditKind, _Places] = {
        "wrap": _steps_to(log, fixed.rows, fixed.joints),
        "repaired" if repaired else "in-between": between,
        "unexplained": odd,
        "ambiguous": unsure,
    }
    warnings = [
        *noticed,
        *_warn_unexplained(log, odd, periods),
        *_warn_ambiguous(log, unsure, speeds),
        *([] if repaired else _warn_in_between(log, between)),
    ]
    unresolved = np.concatenate((odd.steps, unsure.steps))
    mended = np.column_stack((between.rows, between.joints))
    return AuditResult(
        q=reinterpolate(fixed.q, log.t, mended) if repaired and len(mended) else fixed.q,
        entries=tuple(_entries(log, fixed, periods, kinds)),
        warnings=tuple(warnings),
        inferences=tuple(inferences),
        unresolved=unresolved,
        broken=unresolved if repaired else np.concatenate((unresolved, *_beside(log, between))),
    )


def _repolarized(
    log: JointLog, robot: Chain | None, given: Mapping[str, GivenInterval]
) -> tuple[Repolarized, FloatArray, FloatArray]:
    """Repolarize the joints; return P of each and the largest speed of each too."""
    turns = is_revolute(log, robot)
    periods = wrap_periods(log, turns.tolist(), given)
    limits = np.array([np.inf if robot is None else robot.moving[j].velocity for j in range(len(turns))])
    dt = ns_to_seconds(np.diff(log.t_ns, prepend=log.t_ns[:1]))
    fixed = repolarize(log.q, dt, period=periods, max_speed=limits)
    asked = [] if "" in given or not len(fixed.unexplained) else _doubled(log, fixed)
    doubled = [j for j in asked if log.joints[j] not in given]
    if doubled:
        periods[doubled] = 2.0 * FULL_TURN
        fixed = repolarize(log.q, dt, period=periods, max_speed=limits)
    return fixed, periods, limits


def is_revolute(log: JointLog, robot: Chain | None) -> NDArray[np.bool_]:
    """Tell which joints turn, by the robot or else the unit of their columns, shape (joints,)."""
    if robot is not None and log.joints:
        return np.array([joint.kind == "revolute" for joint in robot.moving])
    return np.array([unit == "rad" for unit in log.joint_units], dtype=np.bool_)


def _steps_to(log: JointLog, rows: IntArray, joints: IntArray) -> _Places:
    """Return the steps to some values, with their size as it stands in the file."""
    before = rows - 1
    for j in np.unique(joints[np.isnan(log.q[before, joints])]):
        mine = joints == j
        present = np.flatnonzero(~np.isnan(log.q[:, j]))
        before[mine] = present[np.searchsorted(present, rows[mine]) - 1]
    return _Places(rows, joints, before, log.q[rows, joints] - log.q[before, joints])


def _doubled(log: JointLog, fixed: Repolarized) -> list[int]:
    """Return the joints that are seen to be limited to +-2 pi."""
    odd = _steps_to(log, *fixed.unexplained.T)
    speeds = np.zeros(len(log.joints))
    for j in np.unique(odd.joints):
        speeds[j] = _held_speed(log, fixed.q, int(j), odd.rows[odd.joints == j])
    elapsed = ns_to_seconds(log.t_ns[odd.rows] - log.t_ns[odd.before])
    rest = NEAR * speeds[odd.joints] * elapsed + FULL_TURN / 100.0
    return find_double_turn_joints(log, fixed, odd.joints, odd.figures, np.minimum(rest, FULL_TURN / 2.0))


def _in_between(log: JointLog, fixed: Repolarized, periods: FloatArray) -> _Places:
    """Return the in-between samples, with how far they lie from the line through their neighbours."""
    found = [np.empty((0, 2), dtype=np.int64)]
    off = [np.empty(0)]
    every, times, sparse = np.arange(log.rows), log.t, _sparse(log)
    for j in np.unique(fixed.joints).tolist():
        present, q, x, t = every, log.q[:, j], fixed.q[:, j], times
        if sparse[j]:
            present = np.flatnonzero(~np.isnan(q))
            q, x, t = q[present], x[present], t[present]
        wraps = np.searchsorted(present, fixed.rows[fixed.joints == j])
        hidden = np.searchsorted(present, fixed.in_between[fixed.in_between[:, 1] == j, 0])
        at = np.union1d(hidden, find_interpolated_samples(q, x, t, wraps, float(periods[j])))
        found.append(np.column_stack((present[at], np.full(len(at), j))))
        off.append(line_residuals(x, t, at))
    rows, joints = np.concatenate(found).T
    order = np.lexsort((joints, rows))
    places = _steps_to(log, rows[order], joints[order])
    return places._replace(figures=np.concatenate(off)[order])


def _beside(log: JointLog, between: _Places) -> list[IntArray]:
    """Return the steps to and from the in-between samples."""
    following = between.rows + 1
    for k in np.flatnonzero(np.isnan(log.q[following, between.joints])):
        rest = log.q[following[k] :, between.joints[k]]
        following[k] += int(np.argmax(~np.isnan(rest)))
    return [between.steps, np.column_stack((between.rows, following, between.joints))]


def _ambiguous(
    log: JointLog, fixed: Repolarized, periods: FloatArray, limits: FloatArray, between: _Places
) -> tuple[_Places, FloatArray]:
    """Return the gaps in which a joint can have turned more than half a period, and how fast it can be.

    That is the robot's limit; without one the largest speed that was seen.
    """
    steps = np.diff(log.t_ns)
    rows, joints = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    speeds = np.zeros(len(periods))
    uneven = len(steps) and steps.max() > MISSED_SAMPLE * steps.min()
    usual = float(np.median(steps)) if uneven else steps.max(initial=0)
    wide = np.flatnonzero(steps > MISSED_SAMPLE * usual)
    sparse = _sparse(log)
    for j in np.flatnonzero(np.isfinite(periods)).tolist():
        after, before = _wide_steps(log, j, MISSED_SAMPLE * usual) if sparse[j] else (wide + 1, wide)
        if not len(after):
            continue
        odd = fixed.unexplained[fixed.unexplained[:, 1] == j, 0]
        skipped = np.concatenate((odd, between.rows[between.joints == j], after))
        speeds[j] = limits[j] if np.isfinite(limits[j]) else _held_speed(log, fixed.q, j, skipped)
        reached = speeds[j] * ns_to_seconds(log.t_ns[after] - log.t_ns[before])
        rows.append(after[reached > periods[j] / 2.0])
        joints.append(np.full(len(rows[-1]), j))
    at, on = np.concatenate(rows), np.concatenate(joints)
    order = np.lexsort((on, at))
    return _steps_to(log, at[order], on[order]), speeds[on[order]]


def _sparse(log: JointLog) -> NDArray[np.bool_]:
    """Tell which joints miss samples; one pass over all says whether to look column by column."""
    if not np.isnan(log.q.sum()):
        return np.zeros(len(log.joints), dtype=np.bool_)
    return np.asarray(np.isnan(log.q.sum(axis=0)))


def _wide_steps(log: JointLog, joint: int, longest: float) -> tuple[IntArray, IntArray]:
    """Return the rows after and before the steps of a joint that take longer than so many [ns]."""
    present = np.flatnonzero(~np.isnan(log.q[:, joint]))
    at = np.flatnonzero(np.diff(log.t_ns[present]) > longest)
    return present[at + 1], present[at]


def _held_speed(log: JointLog, x: FloatArray, joint: int, skipped: IntArray) -> float:
    """Return the largest speed of a repolarized joint that was held over two steps in [rad/s].

    Outliers do not count, nor do the steps to and from rows at which it does not move as a joint does.
    """
    present = np.flatnonzero(~np.isnan(x[:, joint]))
    speed = np.abs(np.diff(x[present, joint])) / ns_to_seconds(np.diff(log.t_ns[present]))
    at = np.searchsorted(present, skipped)
    for steps in (at - 1, at):
        speed[steps[(steps >= 0) & (steps < len(speed))]] = 0.0
    return float(np.minimum(speed[1:], speed[:-1]).max(initial=0.0))


def _entries(
    log: JointLog, fixed: Repolarized, periods: FloatArray, kinds: Mapping[AuditKind, _Places]
) -> list[AuditEntry]:
    """Return the audit by row: of each kind its entries, of those that are no wraps the first `MOST`."""
    entries: list[AuditEntry] = []
    for kind, places in kinds.items():
        most = None if kind == "wrap" else MOST
        rows, joints, before = places.rows[:most], places.joints[:most], places.before[:most]
        begin, end = log.t_ns[rows if kind in ("in-between", "repaired") else before], log.t_ns[rows]
        turns = (_turns_at(log, fixed, periods, at, joints) for at in (before, rows))
        times = ((begin + end) / 2e9, (end - begin) / 2e9)
        columns = (rows, joints, *times, places.figures[:most], *turns)
        for row, j, t, half, figure, k_before, k_after in zip(*(c.tolist() for c in columns), strict=True):
            entries.append(AuditEntry(log.joints[j], row + 1, t, half, figure, k_before, k_after, kind))
    return sorted(entries, key=lambda entry: entry.row)


def _turns_at(
    log: JointLog, fixed: Repolarized, periods: FloatArray, rows: IntArray, joints: IntArray
) -> IntArray:
    """Return k at some values."""
    added = fixed.q[rows, joints] - log.q[rows, joints]
    return np.rint(added / periods[joints]).astype(np.int64)


def _warn_unexplained(log: JointLog, odd: _Places, periods: FloatArray) -> Iterator[LogWarning]:
    """Warn once of the steps above a quarter period that are no repolarization."""
    if not len(odd.rows):
        return
    joints, worst = _joints(log, odd), odd.worst
    quarter = f"{np.degrees(periods[odd.joints].min() / 4.0):.0f} deg"
    if len(odd.rows) == 1:
        to = log.q[odd.rows[0], odd.joints[0]]
        said = f"{joints} steps by more than {quarter} from the value before, to {to:.6g} rad: not a wrap,"
        yield LogWarning("large-step", f"{said} the value is kept", int(odd.rows[0]) + 1)
        return
    said = f"{len(odd.rows)} steps of {joints} by more than {quarter} are not wraps and are kept"
    by = f"of {log.joints[odd.joints[worst]]} by {np.degrees(abs(odd.figures[worst])):.4g} deg"
    said = f"{said}; the largest, {by}, is to row {odd.rows[worst] + 1}"
    yield LogWarning("large-step", said, int(odd.rows[0]) + 1, hints=ALL)


def _warn_in_between(log: JointLog, between: _Places) -> Iterator[LogWarning]:
    """Warn once of the samples that a linear resampling left on wraps."""
    if not len(between.rows):
        return
    joints, worst = _joints(log, between), between.worst
    off, row = f"{abs(between.figures[worst]):.4g} rad", int(between.rows[0]) + 1
    if len(between.rows) == 1:
        said = f"{joints} lies between the ends of a wrap, {off} off the line of its neighbours, where a"
        hints: tuple[Hint, ...] = (Hint("repair", True, "puts it there"),)
        yield LogWarning("in-between", f"{said} linear resampling left it", row, hints=hints)
        return
    said = f"{len(between.rows)} samples of {joints} lie between the ends of wraps, where a linear resampling"
    by = f"of {log.joints[between.joints[worst]]} in row {between.rows[worst] + 1} by {off}"
    said = f"{said} left them, off the line of their neighbours, at most that {by}"
    yield LogWarning("in-between", said, row, hints=(Hint("repair", True, "puts them there"), *ALL))


def _warn_ambiguous(log: JointLog, unsure: _Places, speeds: FloatArray) -> Iterator[LogWarning]:
    """Warn once of the gaps in which joints can have turned."""
    if not len(unsure.rows):
        return
    gaps = np.unique(np.column_stack((unsure.rows, unsure.before)), axis=0)
    passed = ns_to_seconds(log.t_ns[gaps[:, 0]] - log.t_ns[gaps[:, 1]])
    longest, row = int(np.argmax(passed)), int(gaps[0, 0]) + 1
    fastest = {log.joints[j]: speeds[unsure.joints == j].max() for j in np.unique(unsure.joints).tolist()}
    joints = ", ".join(f"{name} (at {speed:.3g} rad/s)" for name, speed in fastest.items())
    turned = f"{joints} can have turned by more than half a period"
    if len(gaps) == 1:
        said = f"no value for {passed[0]:.6g} s before this row: {turned}; the nearest turn is taken"
        yield LogWarning("ambiguous-turn", said, row)
        return
    ends = f"the longest, {passed[longest]:.6g} s, ends at row {gaps[longest, 0] + 1}"
    said = f"in {len(gaps)} gaps without values {turned}; {ends}; the nearest turns are taken"
    yield LogWarning("ambiguous-turn", said, row, hints=ALL)


def _joints(log: JointLog, places: _Places) -> str:
    """Return the joints that some places are of, each once."""
    return text.enumerated([log.joints[j] for j in np.unique(places.joints).tolist()])
