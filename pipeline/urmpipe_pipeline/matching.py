"""Two trajectories at the same times: what a comparison compares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.continuity import continuous_quaternions
from urmpipe_models.errors import Finding, LogError
from urmpipe_models.orientation import quaternions
from urmpipe_pipeline.comparison import Trajectory
from urmpipe_pipeline.grid import interpolate
from urmpipe_pipeline.joint_log import FloatArray, IntArray
from urmpipe_pipeline.results import Run


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """Both sides at the samples that were compared.

    Attributes:
        sample: Samples of the log, shape (m,).
        t_ns: Their times on the log's clock in integer [ns], shape (m,).
        wanted: Where the reference was, in [m], shape (m, 3).
        done: Where the log was, in [m], shape (m, 3).
        wanted_quat: Orientation of the reference x, y, z, w [-], shape (m, 4); None if a side has none.
        done_quat: The same of the log.
        wanted_q: Joints of the reference, in the log's order, in [rad] or [m], shape (m, joints); None if a
            side has none, or others.
        done_q: The same of the log.
        left_out: Samples of the log that were not compared.
        reference_left_out: Samples of the reference outside the log's time.
    """

    sample: IntArray
    t_ns: IntArray
    wanted: FloatArray
    done: FloatArray
    wanted_quat: FloatArray | None
    done_quat: FloatArray | None
    wanted_q: FloatArray | None
    done_q: FloatArray | None
    left_out: int
    reference_left_out: int


def by_kinematics(run: Run) -> Trajectory:
    """Return where a run's tool centre point was by its joints, on its grid.

    Raises:
        LogError: If it has no kinematics.
    """
    if run.tcp is None:
        raise LogError(lacking(run, "no robot, so no forward kinematics; allowed: --robot NAME|FILE"))
    quat = continuous_quaternions(quaternions(run.tcp.euler_zyx, "zyx"))
    return Trajectory(
        run.name,
        run.t_ns,
        run.tcp.position,
        run.log.files,
        quat,
        run.log.joints,
        tuple(run.joint_units),
        run.q,
    )


def as_recorded(run: Run) -> Trajectory:
    """Return where a run recorded its tool centre point itself, on its grid.

    Raises:
        LogError: If it recorded none.
    """
    if run.tcp_recorded is None:
        raise LogError(lacking(run, "no recorded tool centre point; allowed: --tcp fk with a --robot"))
    joints = run.log.joints
    units = tuple(run.joint_units) if joints else ()
    return Trajectory(
        run.name,
        run.t_ns,
        run.tcp_recorded,
        run.log.files,
        _recorded_quat(run),
        joints,
        units,
        run.q if joints else None,
    )


def match(reference: Trajectory, log: Trajectory, offset: float) -> Matched:
    """Return both sides at the log's samples; the reference is interpolated there.

    Positions and joints are interpolated linearly, orientations on the great arc. Samples outside the time of
    the reference, inside a gap of it, or without a position of their own are left out and counted.

    Args:
        reference: What was asked for.
        log: What was done.
        offset: t_reference = t_log + offset in [s].
    """
    shift = round(offset * 1e9)
    at_ns = log.t_ns + shift
    wanted = interpolate(at_ns, reference.t_ns, reference.position)
    sample = np.flatnonzero(np.isfinite(wanted).all(axis=1) & np.isfinite(log.position).all(axis=1))
    at_ns = at_ns[sample]
    quats: tuple[FloatArray | None, FloatArray | None] = None, None
    if reference.quat_xyzw is not None and log.quat_xyzw is not None:
        quats = _between(at_ns, reference.t_ns, reference.quat_xyzw), log.quat_xyzw[sample]
    order = joint_order(reference.joints, log.joints)
    joints: tuple[FloatArray | None, FloatArray | None] = None, None
    if order is not None and reference.q is not None and log.q is not None:
        joints = interpolate(at_ns, reference.t_ns, reference.q[:, order]), log.q[sample]
    outside = (reference.t_ns < log.t_ns[0] + shift) | (reference.t_ns > log.t_ns[-1] + shift)
    return Matched(
        sample,
        log.t_ns[sample],
        wanted[sample],
        log.position[sample],
        *quats,
        *joints,
        len(log.t_ns) - len(sample),
        int(np.count_nonzero(outside)),
    )


def lacking(run: Run, message: str) -> Finding:
    """Return what a run lacks, with the name of its file."""
    return Finding(message, file=run.log.files[0].name if run.log.files else run.name)


def joint_order(reference: tuple[str, ...], log: tuple[str, ...]) -> list[int] | None:
    """Return where the reference has the log's joints: by name, else by place; None if it has others.

    Args:
        reference: Names of the reference's joints.
        log: Names of the log's.
    """
    if not log or len(reference) != len(log):
        return None
    if set(reference) == set(log):
        return [reference.index(name) for name in log]
    return list(range(len(log)))


def _recorded_quat(run: Run) -> FloatArray | None:
    """Return the orientation that a run recorded, on its grid."""
    form, values = run.log.rotation_form, run.rotation_recorded
    if form is None or values is None:
        return None
    return continuous_quaternions(quaternions(values, "quat_xyzw" if form == "matrix" else form))


def _between(at_ns: IntArray, known_ns: IntArray, quat: FloatArray) -> FloatArray:
    """Return orientations at times within the known ones, on the great arc between two of them."""
    after = np.clip(np.searchsorted(known_ns, at_ns), 1, max(len(known_ns) - 1, 1))
    if len(known_ns) == 1:
        return np.repeat(quat, len(at_ns), axis=0)
    share = (at_ns - known_ns[after - 1]) / (known_ns[after] - known_ns[after - 1])
    return slerp(quat[after - 1], quat[after], np.clip(share, 0.0, 1.0))


def slerp(first: FloatArray, second: FloatArray, share: FloatArray) -> FloatArray:
    """Return orientations on the great arc from one to another, the shorter way.

    Args:
        first: Unit quaternions x, y, z, w [-], shape (n, 4).
        second: The same.
        share: Of the way, 0 to 1, shape (n,).
    """
    cosine = np.einsum("ij,ij->i", first, second)
    near = second * np.where(cosine < 0.0, -1.0, 1.0)[:, np.newaxis]
    half = np.arctan2(np.linalg.norm(near - first, axis=1), np.linalg.norm(near + first, axis=1))
    angle = 2 * half
    # sin(a x) / sin(a), with x where a is 0.
    weights = [part * np.sinc(angle * part / np.pi) / np.sinc(angle / np.pi) for part in (1.0 - share, share)]
    return np.asarray(weights[0][:, np.newaxis] * first + weights[1][:, np.newaxis] * near)
