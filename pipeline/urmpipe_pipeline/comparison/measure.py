"""Measure: every deviation of a log from the reference at the same times, with its statistics."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.delta import delta
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import LogError
from urmpipe_models.math3d import rotation_angle, slerp
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.comparison.deviation import (
    AXES,
    KINDS,
    Deviation,
    Kind,
    Share,
    ShareKind,
    Statistics,
    Stretch,
    Verdict,
)
from urmpipe_pipeline.comparison.path_distance import distance_from_path
from urmpipe_pipeline.comparison.verdict import LEAST_SHARES, allowed_for
from urmpipe_pipeline.iso9283.criteria import combine_verdicts
from urmpipe_pipeline.joint_log import has_gap_after, ns_to_seconds
from urmpipe_pipeline.runs.grid import interpolate
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import (
    ORIENTED,
    Matched,
    Trajectory,
    joint_mismatch,
    joint_order,
    run_finding,
)

START_SAMPLES = 11
"""Samples by which the turns of the start are counted: as few as outvote a wild one."""


def measure(
    run: Run, reference: Trajectory, log: Trajectory, matched: Matched, tolerance: Mapping[str, float]
) -> Deviation:
    """Return the deviation of a log: delta, distance from the path, angle, joints, shares, and the verdict.

    Args:
        run: The log, its name unique in the comparison.
        reference: What was asked for, its rows that have a value.
        log: What was done, whole.
        matched: Both sides at the same times, the log aligned.
        tolerance: In [m] or [rad], by kind or by coordinate; least shares 0..1.

    Raises:
        LogError: If there is a tolerance for what a side does not have.

    Source: [UrmArm2021]_ eq. 19-23.
    """
    values = np.column_stack(delta(_columns(matched.reference), _columns(matched.actual)))
    placed, path, angle = bool(np.isfinite(values).any()), values[:, 3], _angle(matched)
    if placed:
        joined = ~has_gap_after(reference.t_ns) & run.timed  # nothing joins still poses
        joined[[] if reference.broken is None else reference.broken] = False
        path = distance_from_path(matched.actual, reference.position, joined)
        path = np.minimum(path, values[:, 3])  # the reference of that time is on its path, but for rounding
    joint_delta, turns = _joint_delta(run, matched)
    _refuse_unheld(run, reference, tolerance, angle, joint_delta)
    in_space, of_joints = _in_space(values, path, angle) if placed else [], _of_joints(run, joint_delta)
    t, sample = ns_to_seconds(matched.t_ns), matched.sample
    if not run.timed:
        t = np.full_like(t, np.nan)
    statistics, joint_statistics = (
        {one.quantity: describe(one, t, sample, tolerance) for one in measured}
        for measured in (in_space, of_joints)
    )
    shares = measure_shares(reference, log, matched, tolerance, timed=run.timed)
    speed = _speed(run, matched)
    x, y, z, norm = (float(value) for value in values[0])
    return Deviation(
        name=run.name,
        run=run,
        sample=sample,
        t_ns=matched.t_ns,
        reference=matched.reference,
        actual=matched.actual,
        delta=values,
        path=path,
        speed=speed,
        angle=angle,
        joint_delta=joint_delta,
        joint_turns=turns,
        outside=np.any([one.outside(tolerance) for one in (*in_space, *of_joints)], axis=0),
        sync=matched.sync,
        alignment=matched.alignment,
        left_out=matched.left_out,
        reference_left_out=matched.reference_left_out,
        statistics=statistics,
        joint_statistics=joint_statistics,
        start=(x, y, z, norm),
        speed_correlation=correlation(values[:, 3], speed),
        verdict=overall([*statistics.values(), *joint_statistics.values(), *shares.values()]),
        shares=shares,
    )


def _in_space(values: FloatArray, path: FloatArray, angle: FloatArray | None) -> list[Measured]:
    """Return what is measured of the pose: x, y, z, norm, path, and the angle where there is one."""
    found = [Measured(axis, KINDS[axis], "m", values[:, i]) for i, axis in enumerate(AXES)]
    found.append(Measured("path", "path", "m", path))
    return found if angle is None else [*found, Measured("angle", "angle", "rad", angle)]


def _angle(matched: Matched) -> FloatArray | None:
    """Return the angle between the orientations in [rad], shape (m,); None if a side has none anywhere."""
    if matched.reference_quat is None or matched.actual_quat is None:
        return None
    angle = rotation_angle(matched.reference_quat, matched.actual_quat)
    return angle if np.isfinite(angle).any() else None


def _joint_delta(run: Run, matched: Matched) -> tuple[FloatArray | None, tuple[int, ...]]:
    """Return reference - log of each joint, and the whole turns that are taken out of a motion's.

    None if a joint has no value on a side: it could not be judged.
    """
    if matched.reference_q is None or matched.actual_q is None:
        return None, ()
    difference = matched.reference_q - matched.actual_q
    if not np.isfinite(difference).any(axis=0).all():
        return None, ()
    turning = np.array(run.joint_units) == "rad"
    if not run.timed:  # each pose names its turns for itself
        whole = FULL_TURN * np.rint(difference / FULL_TURN)
        return difference - np.where(turning, whole, 0.0), (0,) * len(turning)
    turns = [_turns_at_start(values) if one else 0 for values, one in zip(difference.T, turning, strict=True)]
    return difference - FULL_TURN * np.array(turns), tuple(turns)


def _turns_at_start(difference: FloatArray) -> int:
    """Return the whole turns that two joints in [rad] count apart for the pose they start in.

    Logs of one motion may name it by other turns, such as pi and -pi: that is no deviation, a turn more on
    the way is. The median of the first few samples: a wild first one would put all the others a turn out,
    and what happens later stands where it happens.
    """
    first = difference[np.isfinite(difference)][:START_SAMPLES]
    return int(np.rint(np.sort(first)[(len(first) - 1) // 2] / FULL_TURN))


def _of_joints(run: Run, joint_delta: FloatArray | None) -> list[Measured]:
    """Return each joint as a quantity."""
    if joint_delta is None:
        return []
    columns = zip(run.log.joints, run.joint_units, joint_delta.T, strict=True)
    return [Measured(name, "joint", unit, values) for name, unit, values in columns]


def unheld(reference: Trajectory, run: Run) -> str:
    """Return why no joint of a log is compared."""
    apart = joint_mismatch(reference, run.log.joints, tuple(run.joint_units))
    return apart or "a joint has no value at any compared sample"


def _refuse_unheld(
    run: Run,
    reference: Trajectory,
    tolerance: Mapping[str, float],
    angle: FloatArray | None,
    joint_delta: FloatArray | None,
) -> None:
    """Raise a `LogError` if there is a tolerance for what a side does not have: nothing would be judged."""
    faults = []
    if "angle" in tolerance and angle is None:
        faults.append(f"angle: found a side without an orientation, allowed: {ORIENTED}")
    if "joint" in tolerance and joint_delta is None:
        faults.append(f"joint: found that {unheld(reference, run)}, allowed: the same joints on both sides")
    if faults:
        raise LogError(*(run_finding(run, said, parameter="tolerance") for said in faults))


def _speed(run: Run, matched: Matched) -> FloatArray:
    """Return the speed of the log's tool centre point in [m/s]: by kinematics, else by its positions."""
    if not run.timed:
        return np.full(len(matched.sample), np.nan)
    if run.tcp is not None:
        speed = np.linalg.norm(run.tcp.velocity, axis=1, keepdims=True)
        return interpolate(matched.t_ns, run.t_ns, speed)[:, 0]
    return _speed_by_positions(matched)


def _speed_by_positions(matched: Matched) -> FloatArray:
    """Return the speed by the differences to both neighbours: to one beside a gap or a sample left out.

    NaN without a neighbour. Between two the slopes are weighted so that a parabola's is exact.
    """
    step = np.diff(ns_to_seconds(matched.t_ns))[:, np.newaxis]
    joined = (np.diff(matched.sample) == 1) & ~has_gap_after(matched.t_ns)
    slope = np.where(joined[:, np.newaxis], np.diff(matched.actual, axis=0) / step, 0.0)
    weight = np.where(joined[:, np.newaxis], 1.0 / step, 0.0)  # of the nearer neighbour the more
    none = np.zeros((1, 1))
    before, after = np.vstack((none, weight)), np.vstack((weight, none))
    along = before * np.vstack((np.zeros((1, 3)), slope)) + after * np.vstack((slope, np.zeros((1, 3))))
    with np.errstate(invalid="ignore"):
        return np.asarray(np.linalg.norm(along / (before + after), axis=1))


def _columns(position: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    x, y, z = position.T
    return x, y, z


UNCHANGING = 1e-9
"""A quantity with a smaller standard deviation, in [m] or [m/s], does not change: logs print nothing finer
than a nanometre, and what rounding leaves (1e-15 m) correlates with anything by chance."""


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """One quantity of a deviation.

    Attributes:
        quantity: x, y, z, norm, path, angle, or a joint's name.
        kind: What it is measured of.
        unit: m or rad.
        values: In [m] or [rad], as the unit says, shape (m,); NaN where a side has no value.
    """

    quantity: str
    kind: Kind
    unit: str
    values: FloatArray

    def outside(self, tolerance: Mapping[str, float]) -> NDArray[np.bool_]:
        """Return where it is out of tolerance, shape (m,): nowhere without one.

        What has no value cannot be shown to be within its tolerance: it is out of it.
        """
        allowed = allowed_for(self.quantity, self.kind, tolerance)
        if allowed is None:
            return np.zeros(len(self.values), bool)
        return ~np.asarray(np.abs(self.values) <= allowed)


def describe(
    measured: Measured, t: FloatArray, sample: IntArray, tolerance: Mapping[str, float]
) -> Statistics:
    """Return the statistics of one quantity over the samples that have a value, and the verdict on all.

    The quantity has a value at least at one of the log's rows, shape (m,), whose times are in [s], shape
    (m,). The tolerance is in [m] or [rad], by kind or by coordinate.
    """
    known = np.flatnonzero(np.isfinite(measured.values))
    values = measured.values[known]
    size = np.abs(values)
    worst = int(np.argmax(size))
    largest = float(size[worst])
    allowed = allowed_for(measured.quantity, measured.kind, tolerance)
    out = None if allowed is None else int(np.count_nonzero(measured.outside(tolerance)))
    return Statistics(
        quantity=measured.quantity,
        kind=measured.kind,
        unit=measured.unit,
        max=largest,
        rms=float(np.sqrt(np.mean(values * values))),
        mean=float(np.mean(values)),
        std=float(np.std(values)),
        p95=float(np.percentile(size, 95)),
        t_max=float(t[known[worst]]),
        sample_max=int(sample[known[worst]]),
        tolerance=allowed,
        out_of_tolerance=out,
        share_out=None if out is None else out / len(measured.values),
        verdict=None if out is None else "fail" if out else "pass",
        samples=len(known),
        missing=len(measured.values) - len(known),
    )


def overall(statistics: Iterable[Statistics | Share]) -> Verdict | None:
    """Return fail if any quantity fails; None if none has a tolerance."""
    return combine_verdicts(one.verdict for one in statistics)


def correlation(first: FloatArray, second: FloatArray) -> float | None:
    """Return Pearson's r of two quantities where both have a value; None where one does not change.

    Both are in [m] or [m/s], shape (m,); NaN where there is no value.
    """
    both = np.isfinite(first) & np.isfinite(second)
    if not both.any():
        return None
    a, b = (values[both] - values[both].mean() for values in (first, second))
    spread = float(np.sqrt(np.mean(a * a))), float(np.sqrt(np.mean(b * b)))
    if min(spread) < UNCHANGING:
        return None
    return float(np.clip(np.mean(a * b) / (spread[0] * spread[1]), -1.0, 1.0))


NEAR = 0.9  # of the log's period: rows that each shift by a third of it are up to 1.67 periods apart


class _Limits(NamedTuple):
    """What is allowed: of x, y, z in [m], shape (3,), of their norm in [m], of angles and joints in [rad]."""

    axes: FloatArray
    norm: float
    angle: float
    joint: float


class _Values(NamedTuple):
    """Positions [m], orientations x, y, z, w [-] and joints [rad] or [m] of samples, a row each."""

    position: FloatArray
    quat: FloatArray | None
    q: FloatArray | None

    def at(self, rows: IntArray) -> _Values:
        quat, q = (None if part is None else part[rows] for part in (self.quat, self.q))
        return _Values(self.position[rows], quat, q)


def measure_shares(
    reference: Trajectory, log: Trajectory, matched: Matched, tolerance: Mapping[str, float], *, timed: bool
) -> dict[str, Share]:
    """Return `coverage` and `judged` of a compared log, with the verdict on each.

    Args:
        reference: The reference as it was matched; rows of it without a value do not count.
        log: The log, whole, on its own clock.
        matched: Both sides at the compared samples.
        tolerance: By kind: deviations in [m] and [rad], least shares 0..1.
        timed: Whether the log is a motion; still poses are compared row by row, and none of them rests.
    """
    reference = reference.rows_with_value()
    limits, shift = _limits(tolerance), round(matched.sync.offset * 1e9)
    valued = np.flatnonzero(log.has_value)
    judged = np.isin(valued, matched.sample, assume_unique=True)
    order = joint_order(reference.joints, log.joints)
    q = None if reference.q is None or order is None else reference.q[:, order]
    values = _Values(reference.position, reference.quat_xyzw, None if matched.reference_q is None else q)
    times = reference.t_ns - shift
    covered = _near_judged(times, values, matched, usual_period(log.t_ns[valued]), limits)
    if timed:
        covered |= _resting(times, values, matched, limits)
    rows = np.arange(len(covered))
    motion_share = _judged_motion(log, valued, judged, limits)
    coverage = _share(
        "coverage", float(np.mean(covered)), covered, rows, reference.t_ns, tolerance, timed=timed
    )
    judged_share = _share("judged", motion_share, judged, valued, log.t_ns[valued], tolerance, timed=timed)
    return {share.quantity: share for share in (coverage, judged_share)}


def _share(
    quantity: ShareKind, value: float, seen: BoolArray, rows: IntArray, t_ns: IntArray,
    tolerance: Mapping[str, float], *, timed: bool,
) -> Share:  # fmt: skip
    """Return a share with its verdict, and the longest stretch that was not seen."""
    edges = np.flatnonzero(np.diff(np.concatenate(([True], seen, [True])))).reshape(-1, 2)
    unseen = None
    if len(edges):
        first, end = edges[np.argmax(edges[:, 1] - edges[:, 0])].tolist()
        lasts = float(t_ns[end - 1] - t_ns[first]) / 1e9
        times = (float(t_ns[first]) / 1e9, lasts) if timed else (None, None)
        unseen = Stretch(end - first, int(rows[first]), *times)
    least = tolerance.get(quantity)
    verdict: Verdict | None = None if least is None else "pass" if value >= least else "fail"
    return Share(quantity, value, int(np.count_nonzero(seen)), len(seen), least, verdict, unseen)


def _limits(tolerance: Mapping[str, float]) -> _Limits:
    """Return what is allowed of each quantity, inf without a tolerance; the default without any."""
    if not set(tolerance) - set(LEAST_SHARES):
        tolerance = {"axis": DEFAULT_TOLERANCE}
    axes = [allowed_for(axis, "axis", tolerance) for axis in "xyz"]
    return _Limits(
        np.array([math.inf if limit is None else limit for limit in axes]),
        min(tolerance.get("norm", math.inf), tolerance.get("path", math.inf)),
        tolerance.get("angle", math.inf),
        tolerance.get("joint", math.inf),
    )


def _near_judged(
    t_ns: IntArray, values: _Values, matched: Matched, log_period: float, limits: _Limits
) -> BoolArray:
    """Return which samples of the reference, at times on the log's clock [ns], are near a judged one."""
    judged_ns = matched.t_ns
    after = np.searchsorted(judged_ns, t_ns, side="right")
    left, right = np.maximum(after - 1, 0), np.minimum(after, len(judged_ns) - 1)
    nearest = np.minimum(np.abs(t_ns - judged_ns[left]), np.abs(judged_ns[right] - t_ns))
    between = np.flatnonzero((left < right) & (nearest > 0))
    left, right = left[between], right[between]
    share = (t_ns[between] - judged_ns[left]) / (judged_ns[right] - judged_ns[left])
    matched_values = _Values(matched.reference, matched.reference_quat, matched.reference_q)
    departs = _departs(
        values.at(between), _straight(matched_values.at(left), matched_values.at(right), share), limits
    )
    curved = np.bincount(left[departs], minlength=len(judged_ns)) > 0  # by the judged sample before
    straight = np.zeros(len(t_ns), np.bool_)
    straight[between] = ~curved[left]
    return np.asarray((nearest <= usual_period(t_ns) / 2) | (straight & (nearest <= NEAR * log_period)))


def _resting(t_ns: IntArray, values: _Values, matched: Matched, limits: _Limits) -> BoolArray:
    """Return which samples lie in a rest before the first judged sample or after the last, shape (n,)."""
    matched_values = _Values(matched.reference, matched.reference_quat, matched.reference_q)
    resting, every = np.zeros(len(t_ns), np.bool_), np.zeros(len(t_ns), np.int64)
    for end, beyond in ((0, t_ns < matched.t_ns[0]), (-1, t_ns > matched.t_ns[-1])):
        if beyond.any():
            moves = _departs(values, matched_values.at(every + end), limits)
            resting |= beyond & (moves.any() and not (moves & beyond).any())
    return resting


def usual_period(t_ns: IntArray) -> float:
    """Return the median of the positive steps between times in [ns], shape (n,); 0 without any."""
    steps = np.diff(t_ns)
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else 0.0


def _straight(left: _Values, right: _Values, share: FloatArray) -> _Values:
    """Return the values at shares 0..1, shape (k,), of the way from some values to others."""
    part = share[:, np.newaxis]
    return _Values(
        left.position + part * (right.position - left.position),
        None if left.quat is None or right.quat is None else slerp(left.quat, right.quat, share),
        None if left.q is None or right.q is None else left.q + part * (right.q - left.q),
    )


def _departs(first: _Values, second: _Values, limits: _Limits) -> BoolArray:
    """Return where two sets of values differ by more than what is allowed; a missing value differs."""
    difference = first.position - second.position
    within = [np.abs(difference[:, k]) <= limit for k, limit in enumerate(limits.axes) if limit < math.inf]
    if limits.norm < math.inf:
        within.append(np.linalg.norm(difference, axis=1) <= limits.norm)
    if limits.angle < math.inf and first.quat is not None and second.quat is not None:
        within.append(rotation_angle(first.quat, second.quat) <= limits.angle)
    if limits.joint < math.inf and first.q is not None and second.q is not None:
        within.append((np.abs(first.q - second.q) <= limits.joint).all(axis=1))
    return np.asarray(~np.all(within, axis=0))


def _judged_motion(log: Trajectory, valued: IntArray, judged: BoolArray, limits: _Limits) -> float:
    """Return the share of a log's motion, or of its samples if it rests, that lies in judged samples."""
    if judged.all():
        return 1.0
    points, least = log.position, min(limits.axes.min(), limits.norm)
    if least == math.inf and log.q is not None and limits.joint < math.inf:
        points, least = log.q, limits.joint
    elif least == math.inf and log.quat_xyzw is not None:  # |2 q1 - 2 q2| = 4 sin(angle / 4)
        points, least = 2.0 * log.quat_xyzw, limits.angle
    total = counted = 0.0
    rows = points[valued].tolist()
    start = rows[0]
    for row, is_judged in zip(rows, judged.tolist(), strict=True):
        if (length := math.dist(start, row)) >= least:
            start = row
            total += length
            counted += length * is_judged
    return counted / total if total else float(np.mean(judged))
