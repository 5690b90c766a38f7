"""Two trajectories at the same times: what a comparison compares."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_models.kinematics.forward import point_over_log
from urmpipe_models.math3d import slerp, to_quaternions
from urmpipe_models.wraps import unwrap_quaternions
from urmpipe_pipeline.comparison.trajectory import Alignment, Sync, Trajectory
from urmpipe_pipeline.diagnosis.sides import Side
from urmpipe_pipeline.joint_log import NETWORK
from urmpipe_pipeline.runs.grid import ROUNDING_NS, interpolate
from urmpipe_pipeline.runs.run import Run


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """Both sides at the samples that were compared.

    Attributes:
        sample: Rows of the log, from 0, shape (m,).
        t_ns: Their times on the log's clock in integer [ns], shape (m,).
        reference: Where the reference was, in [m], shape (m, 3).
        actual: Where the log was, aligned, in [m], shape (m, 3).
        reference_quat: Orientation of the reference x, y, z, w [-], shape (m, 4); None without one.
        actual_quat: Orientation of the log x, y, z, w [-], shape (m, 4); None without one.
        reference_q: Joints of the reference, in the log's order, in [rad] or [m], shape (m, joints); None
            where `joints_apart` tells why not.
        actual_q: Joints of the log in [rad] or [m], shape (m, joints); None where the reference's are.
        left_out: Samples of the log that were not compared.
        reference_left_out: Samples of the reference outside the log's time.
        sync: How the clocks were put together.
        alignment: How the log was moved in space.
    """

    sample: IntArray
    t_ns: IntArray
    reference: FloatArray
    actual: FloatArray
    reference_quat: FloatArray | None
    actual_quat: FloatArray | None
    reference_q: FloatArray | None
    actual_q: FloatArray | None
    left_out: int
    reference_left_out: int
    sync: Sync
    alignment: Alignment

    def at(self, kept: NDArray[np.intp]) -> Matched:
        """Return both sides at some of these samples alone, by their indices [-], shape (k,)."""
        values = ((one.name, getattr(self, one.name)) for one in fields(self))
        some: dict[str, Any] = {name: array[kept] for name, array in values if isinstance(array, np.ndarray)}
        return replace(self, **some, left_out=self.left_out + len(self.sample) - len(kept))


ORIENTED = "joints with a robot, or a recorded orientation"
"""What tells an orientation."""

NO_ROBOT = ("no robot, so no forward kinematics", Hint("robot", None, "sets one"))
"""What a run without kinematics lacks, and what to give."""

NO_ROBOT_FITS = (
    "no robot is given, and no single one of the catalogue fits the recorded tool centre point as it is",
    Hint("robot", None, "sets one"),
    Hint("tool", None, "adds its tool"),
)
"""The same of a log by whose recorded poses a robot was looked for."""

AS_RECORDED = Hint("tcp", "recorded", "uses the recorded tool centre point")
JOINTS_ALONE = Hint("tolerance", "joint=0.1deg", "compares the joints only")
"""What else to give where both sides have joints."""


def by_kinematics(run: Run) -> Trajectory:
    """Return where a run's tool centre point was by its joints, on its log's own rows.

    The motion of a network has the traced point by the kinematics of the network.

    Raises:
        LogError: If it has no kinematics.
    """
    if traces_point(run):
        return as_recorded(run)
    if run.tcp is None or run.robot is None:
        raise LogError(without_robot(run))
    tcp = run.tcp
    if run.rows is not None:  # by the arithmetic of the grid, so that no grid changes a bit of a verdict
        still = np.zeros_like(run.rows.q)
        tcp = point_over_log(run.robot, run.rows.q, still, still)
    return _by_joints(run, tcp.position, unwrap_quaternions(to_quaternions(tcp.euler_zyx, "zyx")))


def traces_point(run: Run) -> bool:
    """Return whether a run is the motion of a network with a traced point, which stands for kinematics."""
    return run.robot is None and run.log.source == NETWORK and run.log.tcp_position is not None


def as_recorded(run: Run) -> Trajectory:
    """Return where a run recorded its tool centre point itself, on its log's own rows.

    Raises:
        LogError: If it recorded none.
    """
    if run.log.tcp_position is None:
        hint = Hint("tcp", "fk", "uses the joints of a log with a robot")
        raise LogError(lacking(run, "no recorded tool centre point", hint))
    return _trajectory(run, run.log.tcp_position, run.log.tcp_quat_xyzw)


def by_joints_alone(run: Run) -> Trajectory:
    """Return a run's joints on its log's own rows, without a place in space: its position is NaN."""
    return _by_joints(run, np.full((run.log.rows, 3), np.nan), None)


def _by_joints(run: Run, position: FloatArray, quat: FloatArray | None) -> Trajectory:
    """Return where a run was by its joints: nowhere within their steps that no motion explains."""
    broken = np.unique([one.sample - 1 for one in run.audit if one.kind in ("unexplained", "ambiguous")])
    return replace(_trajectory(run, position, quat), broken=broken.astype(np.int64))


def _trajectory(run: Run, position: FloatArray, quat: FloatArray | None) -> Trajectory:
    """Return where a run was, with the joints that it has."""
    joints, units, rows = run.log.joints, tuple(run.joint_units), run.on_rows
    q = rows.q if joints else None
    return Trajectory(run.name, rows.t_ns, position, run.log.files, quat, joints, units, q)


def wanted_rows(asked: Side, done: Side) -> Trajectory:
    """Return the rows of a reference that are joined by lines: those with a value, on its own clock.

    All rows where nothing is joined: of still poses, and of what a log recorded itself.
    """
    whole = asked.trajectory
    return whole if asked.run is done.run or not asked.run.timed else whole.rows_with_value()


def match(reference: Trajectory, log: Trajectory, sync: Sync) -> Matched:
    """Return both sides at the log's own rows; the reference is interpolated there.

    Positions and joints are interpolated linearly, orientations on the great arc. Samples outside the time of
    the reference, inside a gap or a broken step of it, or without a position of their own are left out and
    counted.
    """
    shift = round(sync.offset * 1e9)
    at_ns = log.t_ns + shift
    wanted = interpolate(at_ns, reference.t_ns, reference.position)
    sides = wanted, log.position
    if not np.isfinite(reference.position).any() and reference.q is not None and log.q is not None:
        sides = interpolate(at_ns, reference.t_ns, reference.q), log.q  # compared by their joints alone
    known = np.all([np.isfinite(side).all(axis=1) for side in sides], axis=0)
    sample = np.flatnonzero(known & ~_inside_broken(at_ns, reference))
    at_ns = at_ns[sample]
    reference_q, actual_q = _joints(reference, log, sample, at_ns)
    first, last = log.t_ns[[0, -1]] + shift
    outside = (reference.t_ns < first - ROUNDING_NS) | (reference.t_ns > last + ROUNDING_NS)
    return Matched(
        sample=sample,
        t_ns=log.t_ns[sample],
        reference=wanted[sample],
        actual=log.position[sample],
        reference_quat=_between(at_ns, reference),
        actual_quat=None if log.quat_xyzw is None else log.quat_xyzw[sample],
        reference_q=reference_q,
        actual_q=actual_q,
        left_out=len(log.t_ns) - len(sample),
        reference_left_out=int(np.count_nonzero(outside)),
        sync=sync,
        alignment=Alignment(),
    )


def _inside_broken(at_ns: IntArray, reference: Trajectory) -> NDArray[np.bool_]:
    """Return which times lie strictly inside a broken step of the reference, shape (m,)."""
    if reference.broken is None or not len(reference.broken):
        return np.zeros(len(at_ns), np.bool_)
    after = np.searchsorted(reference.t_ns, at_ns, side="left")
    at_sample = reference.t_ns[np.minimum(after, len(reference.t_ns) - 1)] == at_ns
    return np.asarray(np.isin(after - 1, reference.broken) & ~at_sample)


def joints_apart(reference: Trajectory, joints: tuple[str, ...], units: tuple[str, ...]) -> str:
    """Return why the joints of a log cannot be held against those of the reference; empty if they can."""
    if not reference.joints or not joints:
        return "a side has no joints"
    order = joint_order(reference.joints, joints)
    if order is None:
        return f"the log has {len(joints)} joints, the reference has {len(reference.joints)}"
    turning = [reference.joint_units[place] for place in order]
    apart = [name for name, *pair in zip(joints, units, turning, strict=True) if pair[0] != pair[1]]
    return f"{', '.join(apart)} turn on one side and slide on the other" if apart else ""


def without_robot(run: Run, *hints: Hint) -> Finding:
    """Return that a run has no kinematics, and what to give: a recorded tool centre point will do as well."""
    recorded = run.log.tcp_position is not None and not run.log.measured
    return lacking(run, *NO_ROBOT, *((AS_RECORDED,) if recorded else ()), *hints)


def lacking(run: Run, message: str, *hints: Hint, parameter: str | None = None) -> Finding:
    """Return what a run lacks, with the name of its file."""
    return Finding(message, file_of(run), parameter=parameter, hints=hints)


def file_of(run: Run) -> str:
    """Return what a run is called in an error: by its file, where it has one."""
    return run.log.files[0].name if run.log.files else run.name


def joint_order(reference: tuple[str, ...], log: tuple[str, ...]) -> list[int] | None:
    """Return where the reference has the log's joints: by name, else by place; None if it has others."""
    if not log or len(reference) != len(log):
        return None
    if set(reference) == set(log):
        return [reference.index(name) for name in log]
    return list(range(len(log)))


def _joints(
    reference: Trajectory, log: Trajectory, sample: IntArray, at_ns: IntArray
) -> tuple[FloatArray | None, FloatArray | None]:
    """Return the joints of both sides at the compared samples; None where they cannot be compared."""
    order = joint_order(reference.joints, log.joints)
    apart = joints_apart(reference, log.joints, log.joint_units)
    if order is None or apart or reference.q is None or log.q is None:
        return None, None
    return interpolate(at_ns, reference.t_ns, reference.q[:, order]), log.q[sample]


def _between(at_ns: IntArray, reference: Trajectory) -> FloatArray | None:
    """Return the reference's orientations at times within its own, on the great arc between two of them."""
    known_ns, quat = reference.t_ns, reference.quat_xyzw
    if quat is None:
        return None
    if len(known_ns) == 1:
        return np.repeat(quat, len(at_ns), axis=0)
    after = np.clip(np.searchsorted(known_ns, at_ns), 1, len(known_ns) - 1)
    share = (at_ns - known_ns[after - 1]) / (known_ns[after] - known_ns[after - 1])
    return slerp(quat[after - 1], quat[after], np.clip(share, 0.0, 1.0))
