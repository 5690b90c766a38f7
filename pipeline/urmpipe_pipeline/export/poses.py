"""Trajectories of poses: by forward kinematics, as recorded, and those of a comparison."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.continuity import continuous_quaternions
from urmpipe_models.errors import Finding, RecordingError
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.messages import Hint
from urmpipe_pipeline.comparison.compare import Tcp
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.export.options import ExportOptions, Rows
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.simulation import Result, Simulation


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """A trajectory of poses without missing samples.

    Attributes:
        name: What it is, for a file's name; empty if there is no other.
        clock_ns: The file's own clock in integer [ns], shape (n,).
        position: In [m], shape (n, 3).
        quat_xyzw: Unit quaternions x, y, z, w [-], neighbours in one hemisphere, shape (n, 4).
        left_out: Rows without a pose.
    """

    name: str
    clock_ns: IntArray
    position: FloatArray
    quat_xyzw: FloatArray
    left_out: int = 0


def poses_of(result: Result, options: ExportOptions) -> tuple[list[Poses], list[LogWarning]]:
    """Return the trajectories of a result and what is to be said of them.

    Raises:
        RecordingError: If a run has neither a robot nor, if that is asked for, a recorded pose, or a
            simulation no arm.
    """
    if isinstance(result, Run):
        poses = _run_poses(result, options.tcp or "fk", options.chosen_rows)
        return [poses], list(_left_out([poses]))
    if isinstance(result, Simulation):
        arms = _arm_poses(result)
        return arms, list(_left_out(arms))
    said = "a comparison holds positions: every orientation is written as 0 0 0 1, compare translations only"
    found = [one for run in result.runs for one in _deviation_poses(run, alone=len(result.runs) == 1)]
    return found, [LogWarning("no-orientation", said)]


def _left_out(found: Sequence[Poses]) -> Iterator[LogWarning]:
    """Yield a warning for each trajectory that lacks rows."""
    for poses in found:
        if poses.left_out:
            said = f"{poses.left_out} of {poses.left_out + len(poses.clock_ns)} rows have no pose: left out"
            one = LogWarning("left-out", said)
            yield one.of(poses.name) if poses.name else one


def _arm_poses(simulation: Simulation) -> list[Poses]:
    """Return the trajectory of the tip of each arm of a simulation."""
    where = _where(simulation)
    if not simulation.arms:
        hints = tuple(Hint("to", one, "needs none") for one in ("csv", "parquet", "mat"))
        raise RecordingError(Finding("found no block of kinematics, so no pose", where, hints=hints))
    return [
        _by_kinematics(
            arm.block if len(simulation.arms) > 1 else "", arm.chain, simulation.t_ns, arm.q, where
        )
        for arm in simulation.arms
    ]


def _by_kinematics(name: str, robot: Chain, clock_ns: IntArray, q: FloatArray, where: str) -> Poses:
    """Return the trajectory of an arm's tip by forward kinematics, without the rows that lack a joint."""
    there = np.flatnonzero(np.isfinite(q).all(axis=1))
    if not len(there):
        raise RecordingError(Finding("found no row with a pose, allowed: at least one", where))
    from scipy.spatial.transform import Rotation

    position, rotation = poses_over_log(robot, q[there])
    quat = np.asarray(Rotation.from_matrix(rotation).as_quat(), dtype=np.float64)
    return Poses(name, clock_ns[there], position, continuous_quaternions(quat), len(q) - len(there))


def _run_poses(run: Run, tcp: Tcp, rows: Rows) -> Poses:
    if tcp == "recorded":
        return _recorded_poses(run)
    if run.robot is None or not run.log.joints:
        lacks = "robot" if run.log.joints else "joints"
        hints = (
            Hint("robot", None, "makes a recording with poses", call="ingest"),
            Hint("tcp", "recorded", "takes those of a log that recorded its pose"),
        )
        raise _lacking(run, f"found no {lacks}, so no pose", *hints)
    t_ns, q = (run.t_ns, run.q) if rows == "grid" else (run.log.t_ns, run.log.q)
    return _by_kinematics("", run.robot, run.log.clock_start_ns + t_ns, q, _where(run))


def _recorded_poses(run: Run) -> Poses:
    position, quat = run.log.tcp_position, run.log.tcp_quat_xyzw
    if position is None or quat is None:
        lacks = "position" if position is None else "orientation"
        hint = Hint("tcp", "fk", "takes those of a robot")
        said = f"found no recorded {lacks}, so no recorded pose"
        raise _lacking(run, f"{said}, allowed: a log that recorded position and orientation", hint)
    there = np.flatnonzero(np.isfinite(position).all(axis=1) & np.isfinite(quat).all(axis=1))
    _refuse_none(run, there)
    clock = run.log.clock_start_ns + run.log.t_ns[there]
    return Poses("", clock, position[there], quat[there], len(position) - len(there))


def _deviation_poses(one: Deviation, *, alone: bool) -> list[Poses]:
    """Return the reference and the log at the compared samples, both on the log's clock."""
    clock = one.run.log.clock_start_ns + one.t_ns
    upright = np.tile([0.0, 0.0, 0.0, 1.0], (len(clock), 1))
    prefix = "" if alone else f"{one.name}-"
    return [
        Poses(f"{prefix}reference", clock, one.reference, upright),
        Poses(f"{prefix}actual", clock, one.actual, upright),
    ]


def _refuse_none(run: Run, there: IntArray) -> None:
    if not len(there):
        raise _lacking(run, "found no row with a pose, allowed: at least one")


def _lacking(run: Run, message: str, *hints: Hint) -> RecordingError:
    return RecordingError(Finding(message, _where(run), hints=hints))


def _where(result: Run | Simulation) -> str:
    """Return what an error names: the recording, or the result where it has none."""
    return str(result.recording) if result.recording else result.name
