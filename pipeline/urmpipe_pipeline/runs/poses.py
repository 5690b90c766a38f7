"""Trajectories of poses of a run: by forward kinematics, and as it recorded them."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.continuity import continuous_quaternions
from urmpipe_models.errors import Finding, RecordingError
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.messages import Hint
from urmpipe_pipeline.presentation.exports import Poses
from urmpipe_pipeline.runs.results import Run


def poses_by_kinematics(name: str, robot: Chain, clock_ns: IntArray, q: FloatArray, where: str) -> Poses:
    """Return the trajectory of an arm's tip by forward kinematics, without the rows that lack a joint.

    Joint values are in [rad] or [m], shape (n, joints), at integer times in [ns], shape (n,).

    Raises:
        RecordingError: If no row has a pose, naming where.
    """
    there = np.flatnonzero(np.isfinite(q).all(axis=1))
    if not len(there):
        raise RecordingError(Finding("no row with a pose", where))
    from scipy.spatial.transform import Rotation

    position, rotation = poses_over_log(robot, q[there])
    quat = np.asarray(Rotation.from_matrix(rotation).as_quat(), dtype=np.float64)
    return Poses(name, clock_ns[there], position, continuous_quaternions(quat), len(q) - len(there))


def run_poses(run: Run, rows: str) -> list[Poses]:
    """Return the poses of a run by forward kinematics, at the rows of its grid or of its file.

    Raises:
        RecordingError: If it has no robot, no joints, or no row with a pose.
    """
    if run.robot is None or not run.log.joints:
        lacks = "robot" if run.log.joints else "joints"
        at_ingest = Hint("robot", does="gives it", call="ingest")
        recorded = Hint("tcp", "recorded", "takes what the log recorded")
        raise _lacking(run, f"no {lacks}, so no pose", at_ingest, recorded)
    t_ns, q = (run.t_ns, run.q) if rows == "grid" else (run.log.t_ns, run.log.q)
    return [poses_by_kinematics("", run.robot, run.log.clock_start_ns + t_ns, q, _where(run))]


def recorded_poses(run: Run) -> Poses:
    """Return the poses that a log recorded itself.

    Raises:
        RecordingError: If it recorded none.
    """
    position, quat = run.log.tcp_position, run.log.tcp_quat_xyzw
    if position is None or quat is None:
        lacks = "position" if position is None else "orientation"
        hint = Hint("tcp", "fk", "takes the poses of a robot")
        raise _lacking(run, f"no recorded {lacks}, so no recorded pose", hint)
    there = np.flatnonzero(np.isfinite(position).all(axis=1) & np.isfinite(quat).all(axis=1))
    if not len(there):
        raise _lacking(run, "no row with a pose")
    clock = run.log.clock_start_ns + run.log.t_ns[there]
    return Poses("", clock, position[there], quat[there], len(position) - len(there))


def _lacking(run: Run, message: str, *hints: Hint) -> RecordingError:
    return RecordingError(Finding(message, _where(run), hints=hints))


def _where(run: Run) -> str:
    """Return what an error names: the recording, or the run where it has none."""
    return str(run.recording) if run.recording else run.name
