"""How much of a motion a verdict is based on: two shares, judged like a deviation.

`coverage` is the share of the reference's samples that the log shows, `judged` the share of the log's
motion that lies in judged samples. Samples are the rows of a side that have a value; a judged sample is a row
of the log that was compared, at its time on the reference's clock.

A reference sample is shown

1. if a judged sample is no further from it than half the reference's period; or
2. if a judged sample is no further than 0.9 of the log's period, and between the judged samples before and
   after it the reference departs from the straight line between its values at these two by no more than the
   tolerance (a sparse log of a quick motion shows only its own rows); or
3. if it lies before the first judged sample or after the last, and the reference, which moves elsewhere,
   rests there: it stays within the tolerance of its value at that judged sample.

Periods are medians of the positive steps. Motion is the length of the log's path (of its joints where these
alone are compared), counted in steps of at least the tolerance, so that noise at rest does not count. A step
counts as judged if the row that completes it is. Of a log that rests, samples are counted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.math3d import rotation_angle, slerp
from urmpipe_pipeline.comparison.deviation import Share, ShareKind, Stretch, Verdict
from urmpipe_pipeline.comparison.tolerance import LEAST_SHARES, allowed_for
from urmpipe_pipeline.trajectories import Matched, Trajectory, joint_order

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
