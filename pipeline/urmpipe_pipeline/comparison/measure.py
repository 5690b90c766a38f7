"""Measure: every deviation of a log from the reference at the same times, with its statistics and verdict.

1. `measure`: reference - log by x, y, z and norm, distance from the path, angle, joints, and the speed.
2. `compute_statistics`: max, rms, mean, standard deviation, 95th percentile of a quantity, and its verdict.
3. `measure_shares`: how much of both motions the verdict is based on, in two shares judged like a deviation.

Rows are measured in blocks. Their size changes no bit of a result: sums are taken over parts of a fixed size,
and then over the sums of the parts.

`coverage` is the share of the reference's samples that the log shows, `judged` the share of the log's
motion that lies in judged samples. Samples are the rows of a side that have a value; a judged sample is a row
of the log that was compared, at its time on the reference's clock. A reference sample is shown

- if a judged sample is no further from it than half the reference's period; or
- if a judged sample is no further than 0.9 of the log's period, and between the judged samples before and
  after it the reference departs from the straight line between its values at these two by no more than the
  tolerance (a sparse log of a quick motion shows only its own rows); or
- if it lies before the first judged sample or after the last, and the reference, which moves elsewhere, rests
  there: it stays within the tolerance of its value at that judged sample.

Periods are medians of the positive steps. Motion is the length of the log's path (of its joints where these
alone are compared), counted in steps of at least the tolerance, so that noise at rest does not count. A step
counts as judged if the row that completes it is. Of a log that rests, samples are counted.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.delta import delta
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray, row_blocks, row_norms
from urmpipe_models.errors import LogError
from urmpipe_models.math3d import rotation_angle, slerp
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.comparison.deviation import (
    AXES,
    KINDS,
    Deviation,
    Kind,
    SampleInterval,
    Share,
    ShareKind,
    Statistics,
    Verdict,
)
from urmpipe_pipeline.comparison.path_distance import distance_from_path
from urmpipe_pipeline.comparison.verdict import MIN_SHARES, tolerance_for
from urmpipe_pipeline.iso9283.criteria import combine_verdicts
from urmpipe_pipeline.joint_log import has_gap_after, ns_to_seconds
from urmpipe_pipeline.runs.grid import interpolate
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import (
    BLOCK_ROWS,
    ORIENTED,
    Matched,
    Trajectory,
    joint_mismatch,
    joint_order,
    run_finding,
)

START_SAMPLES = 11  # by which the turns of the start are counted: as few as outvote an outlier
SUMMED_ROWS = 1 << 16  # values that are summed at once: fixed, so that no block size changes a sum
# In [m] or [m/s]: below, a quantity does not change. Logs print nothing finer than a nanometre, and what
# rounding leaves (1e-15 m) correlates with anything by chance.
MIN_STD = 1e-9
NEAR = 0.9  # of the log's period: rows that each shift by a third of it are up to 1.67 periods apart


class Quantity(NamedTuple):
    """One quantity of a deviation.

    Attributes:
        name: x, y, z, norm, path, angle, or a joint's name.
        kind: What it is measured of.
        unit: m or rad.
        values: In [m] or [rad], as the unit says, shape (m,); NaN where a side has no value.
    """

    name: str
    kind: Kind
    unit: str
    values: FloatArray

    def out_of_tolerance(self, tolerance: Mapping[str, float]) -> BoolArray:
        """Return where it is out of tolerance, shape (m,): nowhere without one.

        A missing value cannot be shown to be within its tolerance: it is out of it.
        """
        allowed = tolerance_for(self.name, self.kind, tolerance)
        if allowed is None:
            return np.zeros(len(self.values), bool)
        return ~np.asarray(np.abs(self.values) <= allowed)


def measure(
    run: Run,
    reference: Trajectory,
    log: Trajectory,
    matched: Matched,
    tolerance: Mapping[str, float],
    *,
    block_rows: int = BLOCK_ROWS,
) -> Deviation:
    """Return the deviation of a log: delta, distance from the path, angle, joints, shares, and the verdict.

    Args:
        run: The log, its name unique in the comparison.
        reference: The reference, its rows that have a value.
        log: The log, whole.
        matched: Both sides at the same times, the log aligned.
        tolerance: In [m] or [rad], by kind or by coordinate; least shares 0..1.
        block_rows: Rows that are measured at once; no result depends on it.

    Raises:
        LogError: If there is a tolerance for what a side does not have.

    Source: [UrmArm2021]_ eq. 19-23.
    """
    blocks = row_blocks(len(matched.sample), block_rows)
    values = np.empty((len(matched.sample), 4))
    for rows in blocks:
        reference_xyz, log_xyz = (
            (side[rows, 0], side[rows, 1], side[rows, 2]) for side in (matched.reference, matched.actual)
        )
        values[rows] = np.column_stack(delta(reference_xyz, log_xyz))
    angle, speed = _angle(matched, blocks), _speed(run, matched, blocks)
    joint_delta, turns = _joint_delta(run, matched)
    errors = []
    if "angle" in tolerance and angle is None:
        errors.append(f"angle: found a side without an orientation, allowed: {ORIENTED}")
    if "joint" in tolerance and joint_delta is None:
        reason = joints_not_compared(reference, run)
        errors.append(f"joint: found {reason}, allowed: the same joints on both sides")
    if errors:
        raise LogError(*(run_finding(run, message, parameter="tolerance") for message in errors))
    path, in_space = values[:, 3], list[Quantity]()
    if np.isfinite(values).any():
        joined = ~has_gap_after(reference.t_ns) & run.timed  # nothing joins static poses
        joined[[] if reference.discontinuities is None else reference.discontinuities] = False
        path = distance_from_path(matched.actual, reference.position, joined)
        path = np.minimum(path, values[:, 3])  # the reference of that time is on its path, within rounding
        in_space = [Quantity(axis, KINDS[axis], "m", values[:, i]) for i, axis in enumerate(AXES)]
        in_space.append(Quantity("path", "path", "m", path))
        in_space += [] if angle is None else [Quantity("angle", "angle", "rad", angle)]
    joints = list[Quantity]()
    if joint_delta is not None:
        columns = zip(run.log.joints, run.joint_units, joint_delta.T, strict=True)
        joints = [Quantity(name, "joint", unit, column) for name, unit, column in columns]
    t = ns_to_seconds(matched.t_ns) if run.timed else np.full(len(matched.sample), np.nan)
    statistics, joint_statistics = (
        {quantity.name: compute_statistics(quantity, t, matched.sample, tolerance) for quantity in quantities}
        for quantities in (in_space, joints)
    )
    shares = measure_shares(reference, log, matched, tolerance, timed=run.timed)
    judged: list[Statistics | Share] = [*statistics.values(), *joint_statistics.values(), *shares.values()]
    x, y, z, norm = (float(value) for value in values[0])
    return Deviation(
        name=run.name,
        run=run,
        sample=matched.sample,
        t_ns=matched.t_ns,
        reference=matched.reference,
        actual=matched.actual,
        delta=values,
        path=path,
        speed=speed,
        angle=angle,
        joint_delta=joint_delta,
        joint_turns=turns,
        out_of_tolerance=np.any(
            [quantity.out_of_tolerance(tolerance) for quantity in (*in_space, *joints)], axis=0
        ),
        sync=matched.sync,
        alignment=matched.alignment,
        left_out=matched.left_out,
        reference_left_out=matched.reference_left_out,
        statistics=statistics,
        joint_statistics=joint_statistics,
        start=(x, y, z, norm),
        speed_correlation=correlation(values[:, 3], speed),
        verdict=combine_verdicts(quantity.verdict for quantity in judged),
        shares=shares,
    )


def _angle(matched: Matched, blocks: Iterable[slice]) -> FloatArray | None:
    """Return the angle between the orientations in [rad], shape (m,); None if a side has none anywhere."""
    if matched.reference_quat is None or matched.actual_quat is None:
        return None
    angle = np.empty(len(matched.sample))
    for rows in blocks:
        angle[rows] = rotation_angle(matched.reference_quat[rows], matched.actual_quat[rows])
    return angle if np.isfinite(angle).any() else None


def _joint_delta(run: Run, matched: Matched) -> tuple[FloatArray | None, tuple[int, ...]]:
    """Return reference - log of each joint, and the whole turns that are taken out of a motion's.

    None if a joint has no value on a side: it could not be judged.

    Logs of one motion may count other turns for the pose they start in, such as pi and -pi: that is no
    deviation, a turn more on the way is. The turns are those of the median of the first few samples: an
    outlier in the first would put all the others a turn out, and a later change stays where it happens.
    """
    if matched.reference_q is None or matched.actual_q is None:
        return None, ()
    difference = matched.reference_q - matched.actual_q
    if not np.isfinite(difference).any(axis=0).all():
        return None, ()
    turning = np.array(run.joint_units) == "rad"
    if not run.timed:  # each pose counts its turns for itself
        turns = np.where(turning, FULL_TURN * np.rint(difference / FULL_TURN), 0.0)
        return difference - turns, (0,) * len(turning)
    counts = []
    for column, is_turning in zip(difference.T, turning, strict=True):
        first = np.sort(column[np.isfinite(column)][:START_SAMPLES])
        counts.append(int(np.rint(first[(len(first) - 1) // 2] / FULL_TURN)) if is_turning else 0)
    return difference - FULL_TURN * np.array(counts), tuple(counts)


def joints_not_compared(reference: Trajectory, run: Run) -> str:
    """Return why no joint of a log is compared."""
    mismatch = joint_mismatch(reference, run.log.joints, tuple(run.joint_units))
    return mismatch or "a joint without a value at any compared sample"


def _speed(run: Run, matched: Matched, blocks: Iterable[slice]) -> FloatArray:
    """Return the speed of the log's tool centre point in [m/s], shape (m,), by kinematics or by positions.

    By positions it is that of the differences to both neighbours, weighted so that a parabola's is exact: of
    the one to a single neighbour at a gap or at a sample left out, NaN without any.
    """
    speed = np.full(len(matched.sample), np.nan)
    if not run.timed:
        return speed
    if run.tcp is not None:
        velocity = row_norms(run.tcp.velocity)[:, np.newaxis]
        return interpolate(matched.t_ns, run.t_ns, velocity)[:, 0]
    joined = (np.diff(matched.sample) == 1) & ~has_gap_after(matched.t_ns)
    none = np.zeros((1, 1))
    for rows in blocks:
        first = max(rows.start - 1, 0)  # with a neighbour on each side
        position = matched.actual[first : rows.stop + 1]
        step = np.diff(ns_to_seconds(matched.t_ns[first : rows.stop + 1]))[:, np.newaxis]
        both = joined[first : first + len(step), np.newaxis]
        slope = np.where(both, np.diff(position, axis=0) / step, 0.0)
        weight = np.where(both, 1.0 / step, 0.0)  # of the nearer neighbour the more
        before, after = np.vstack((none, weight)), np.vstack((weight, none))
        along = before * np.vstack((np.zeros((1, 3)), slope)) + after * np.vstack((slope, np.zeros((1, 3))))
        with np.errstate(invalid="ignore"):
            near = np.linalg.norm(along / (before + after), axis=1)
        speed[rows] = near[rows.start - first :][: rows.stop - rows.start]
    return speed


def compute_statistics(
    quantity: Quantity, t: FloatArray, sample: IntArray, tolerance: Mapping[str, float]
) -> Statistics:
    """Return the statistics of one quantity over the samples that have a value, and the verdict on all.

    The quantity has a value at least at one of the log's rows, shape (m,), whose times are in [s], shape
    (m,). The tolerance is in [m] or [rad], by kind or by coordinate.
    """
    known = np.flatnonzero(np.isfinite(quantity.values))
    values = quantity.values[known]
    size = np.abs(values)
    worst = int(np.argmax(size))
    allowed = tolerance_for(quantity.name, quantity.kind, tolerance)
    out = None if allowed is None else int(np.count_nonzero(quantity.out_of_tolerance(tolerance)))
    mean = _mean(values)
    return Statistics(
        quantity=quantity.name,
        kind=quantity.kind,
        unit=quantity.unit,
        max=float(size[worst]),
        rms=math.sqrt(_mean(values, 0.0)),
        mean=mean,
        std=math.sqrt(_mean(values, mean)),
        p95=float(np.percentile(size, 95)),
        t_max=float(t[known[worst]]),
        sample_max=int(sample[known[worst]]),
        tolerance=allowed,
        out_of_tolerance=out,
        out_fraction=None if out is None else out / len(quantity.values),
        verdict=None if out is None else "fail" if out else "pass",
        samples=len(known),
        missing=len(quantity.values) - len(known),
    )


def _mean(values: FloatArray, about: float | None = None) -> float:
    """Return the mean of values, shape (m,), or of their squares about a value."""
    parts = (values[rows] for rows in row_blocks(len(values), SUMMED_ROWS))
    if about is not None:
        parts = ((part - about) ** 2 for part in parts)
    return float(np.sum([np.sum(part) for part in parts])) / len(values)


def correlation(first: FloatArray, second: FloatArray) -> float | None:
    """Return Pearson's r of two quantities where both have a value; None where one does not change.

    Both are in [m] or [m/s], shape (m,); NaN where there is no value.
    """
    both = np.isfinite(first) & np.isfinite(second)
    if not both.any():
        return None
    a, b = (values[both] - values[both].mean() for values in (first, second))
    spread = float(np.sqrt(np.mean(a * a))), float(np.sqrt(np.mean(b * b)))
    if min(spread) < MIN_STD:
        return None
    return float(np.clip(np.mean(a * b) / (spread[0] * spread[1]), -1.0, 1.0))


class _Limits(NamedTuple):
    """Tolerances: of x, y, z in [m], shape (3,), of their norm in [m], of angles and joints in [rad]."""

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
        reference: The reference as it was matched; its rows without a value do not count.
        log: The log, whole, on its own clock.
        matched: Both sides at the compared samples.
        tolerance: By kind: deviations in [m] and [rad], least shares 0..1.
        timed: Whether the log is a motion; static poses are compared row by row, and none of them rests.
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
        unseen = SampleInterval(end - first, int(rows[first]), *times)
    least = tolerance.get(quantity)
    verdict: Verdict | None = None if least is None else "pass" if value >= least else "fail"
    return Share(quantity, value, int(np.count_nonzero(seen)), len(seen), least, verdict, unseen)


def _limits(tolerance: Mapping[str, float]) -> _Limits:
    """Return the tolerance of each quantity, inf without one; the default tolerance if nothing has one."""
    if not set(tolerance) - set(MIN_SHARES):
        tolerance = {"axis": DEFAULT_TOLERANCE}
    axes = [tolerance_for(axis, "axis", tolerance) for axis in "xyz"]
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
    """Return where two sets of values differ by more than the tolerance; a missing value differs."""
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
    start = points[valued[0]].tolist()
    for block in row_blocks(len(valued)):
        for row, is_judged in zip(points[valued[block]].tolist(), judged[block].tolist(), strict=True):
            if (length := math.dist(start, row)) >= least:
                start = row
                total += length
                counted += length * is_judged
    return counted / total if total else float(np.mean(judged))
