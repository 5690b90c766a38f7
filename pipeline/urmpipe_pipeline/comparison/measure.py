"""Measure: every deviation of a log from the reference at the same times, with its statistics."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from urmpipe_models.delta import delta
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError
from urmpipe_models.math3d import rotation_angle
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.comparison.coverage import measure_shares
from urmpipe_pipeline.comparison.deviation import AXES, KINDS, Deviation
from urmpipe_pipeline.comparison.nearest_path import distance_from_path
from urmpipe_pipeline.comparison.statistics import Measured, correlation, describe, overall
from urmpipe_pipeline.joint_log import has_gap_after, ns_to_seconds
from urmpipe_pipeline.runs.grid import interpolate
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import ORIENTED, Matched, Trajectory, joint_mismatch, run_finding

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
