"""Ingest: a log becomes a run.

- `ingest_log`: read the files, infer the robot where the log identifies it, then `log_to_run`.
- `log_to_run`: repolarize on the rows of the file, resample, differentiate, compute kinematics and torques,
  and collect the warnings.
- `with_robot`: the same run with another robot; the joint motion is unchanged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from pathlib import Path
from typing import get_args

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, LogError, OptionError, check_choice
from urmpipe_models.kinematics.forward import PointLog, point_over_log
from urmpipe_pipeline.joint_log import JointLog, LogWarning, number_rows
from urmpipe_pipeline.logs import LogMap, MemoryTable
from urmpipe_pipeline.logs.clock import unused_for_poses, unused_period
from urmpipe_pipeline.logs.log_map import READING
from urmpipe_pipeline.logs.read import read_numbers
from urmpipe_pipeline.presentation.meshes import VISUAL_MISSING, mesh_warnings
from urmpipe_pipeline.provenance import Provenance, build_provenance
from urmpipe_pipeline.repolarization.audit import AuditResult, audit_log, is_revolute
from urmpipe_pipeline.runs.derivatives import Method, log_derivatives
from urmpipe_pipeline.runs.grid import make_grid
from urmpipe_pipeline.runs.plausibility import JOINT_LIMIT, SPEED_LIMIT, limit_warnings, plausibility_warnings
from urmpipe_pipeline.runs.recorded_tcp import (
    FAR_RECORDED,
    RECORDED_START,
    infer_robot,
    recorded_tcp_warnings,
)
from urmpipe_pipeline.runs.run import RowJoints, Run
from urmpipe_pipeline.runs.torques import (
    EFFORT_LIMIT,
    MASS_LEFT_OUT,
    TORQUE_NOISE,
    compute_torques,
    mass_warnings,
    torque_warnings,
)

MIN_TSP = 1e-9  # s, times of a log are whole nanoseconds
MAX_TSP = 1e9  # s, longer times in [ns] do not fit into 64 bits
EULER_SINGULAR = "euler-singular"
LIMIT_WARNINGS = (JOINT_LIMIT, SPEED_LIMIT)
ROBOT_WARNINGS = (  # kinds that depend on the robot
    EULER_SINGULAR, VISUAL_MISSING, MASS_LEFT_OUT, FAR_RECORDED, RECORDED_START, *LIMIT_WARNINGS,
    EFFORT_LIMIT, TORQUE_NOISE,
)  # fmt: skip


@np.errstate(over="ignore", invalid="ignore")  # huge numbers in a log: their squares and steps are infinite
def ingest_log(
    files: Sequence[Path | MemoryTable],
    *,
    robot: Chain | None = None,
    read: LogMap | None = None,
    tsp: float | None = None,
    derivative: Method | None = None,
    name: str | None = None,
) -> Run:
    """Return the run of one log.

    Args:
        files: The file of the log, its files if the source writes one per plot, or a table in memory.
        robot: The arm, with base and tool; None for the one that the log identifies, if it does.
        read: How to read the file where this cannot be inferred.
        tsp: Period of the grid in [s]; default: that of the log.
        derivative: central or savgol; default: savgol for quantised logs, else central.
        name: Name of the run; default: the stem of the file.

    Raises:
        LogError: With all errors in the files.
        OptionError: If the value of an option is not allowed.
    """
    options = read or LogMap()
    if tsp is not None and not MIN_TSP <= tsp < MAX_TSP:
        allowed = f"a positive time below {MAX_TSP:g} s"
        if 0 < tsp < MIN_TSP:
            allowed = f"{MIN_TSP:g} s or more: times are in ns"
        raise OptionError(Finding(parameter="tsp", found=f"{tsp:g} s", allowed=allowed))  # plain: ok
    if derivative is not None:
        check_choice("derivative", derivative, get_args(Method))
    numbers = read_numbers(files, options, robot)
    match = infer_robot(numbers.recorded) if robot is None else None
    robot, inference = match or (robot, None)
    log = numbers.log(robot)
    if inference:
        log = replace(log, inferences=(*log.inferences, inference))
    if options.shared or options.pair:  # intervals of joints of another log, or of the other side
        names = {"", *compress(log.joints, is_revolute(log, robot))}
        interval = {joint: ends for joint, ends in options.interval.items() if joint in names}
        options = replace(options, interval=interval)
    unread = LogMap()
    read_options = {  # `shared` does not change how this log is read
        key: value
        for key in READING
        if (value := getattr(options, key)) != getattr(unread, key) and key != "shared"
    }
    run_options = {"robot": robot.name if robot else None, "tsp": tsp, "derivative": derivative}
    provenance = build_provenance("ingest", run_options | {"read": read_options or None}, log.files)
    return log_to_run(log, robot, options, tsp=tsp, derivative=derivative, name=name, provenance=provenance)


def log_to_run(
    log: JointLog,
    robot: Chain | None,
    options: LogMap,
    *,
    provenance: Provenance,
    tsp: float | None = None,
    derivative: Method | None = None,
    name: str | None = None,
) -> Run:
    """Return the run of a log that is read.

    Args:
        log: The log, its times strictly increasing, or static poses.
        robot: The arm, with base and tool; None for no kinematics.
        options: How it was read: `interval`, `repair` and `period` are used.
        provenance: How to repeat it.
        tsp: Period of the grid in [s]; default: that of the log.
        derivative: central or savgol; default: savgol for quantised logs, else central.
        name: Name of the run; default: that of the log.

    Raises:
        LogError: If the joints of the log are not those of the robot, or its grid would be too long.
        OptionError: If an interval is not allowed.
    """
    name = name or log.name
    if not log.timed:
        unused = {key: getattr(options, key) for key in ("period", "interval", "repair")}
        warnings = unused_for_poses(unused | {"tsp": tsp, "derivative": derivative})
        return _poses_to_run(replace(log, name=name), robot, provenance, warnings)
    audit = audit_log(log, robot, interval=options.interval, repaired=options.repair)
    log = replace(log, inferences=(*log.inferences, *audit.inferences))
    grid = make_grid(log, tsp)
    q, step_warnings = grid.resample_joints(audit.q, audit.unresolved)
    qd, qdd, source, rate_warnings = log_derivatives(log, grid, q, derivative, grid.find_steps(audit.broken))
    tcp, robot_warnings = tcp_motion(robot, q, qd, qdd)
    has_clock = any(column.role == "time" for column in log.columns)
    warnings = [
        *recorded_tcp_warnings(robot, log),
        *audit.warnings,
        *_plausibility_warnings(log, robot, audit, grid.tsp),
        *grid.warnings,
        *step_warnings,
        *([unused_period("period")] if has_clock and options.period else []),
        *rate_warnings,
        *robot_warnings,
    ]
    run = Run(
        name=name, log=log, robot=robot, tsp=grid.tsp, t_ns=grid.t_ns, q=q, qd=qd, qdd=qdd, tcp=tcp,
        tcp_recorded=None if log.tcp_position is None else grid.resample(log.tcp_position),
        audit=audit.entries, warnings=(*log.warnings, *number_rows(warnings, log.file_row)),
        provenance=provenance,
        rows=None if grid.is_rows else RowJoints(grid.source_ns, audit.q),
        tau=compute_torques(robot, q, qd, qdd), derivative=source,
    )  # fmt: skip
    return replace(run, warnings=(*run.warnings, *number_rows(torque_warnings(run), log.file_row)))


def _poses_to_run(
    log: JointLog, robot: Chain | None, provenance: Provenance, warnings: Sequence[LogWarning]
) -> Run:
    """Return the run of static poses, one per row: there is no motion, so no turns and no rates."""
    missing = np.full_like(log.q, np.nan)
    tcp, robot_warnings = tcp_motion(robot, log.q, missing, missing)
    limits = [] if robot is None or not log.joints else limit_warnings(log, log.q, robot)
    warnings = (*warnings, *recorded_tcp_warnings(robot, log), *limits, *robot_warnings)
    warnings = (*log.warnings, *number_rows(warnings, log.file_row))
    return Run(
        name=log.name, log=log, robot=robot, tsp=0.0, t_ns=log.t_ns, q=log.q, qd=missing, qdd=missing,
        tcp=tcp, tcp_recorded=log.tcp_position, audit=(), provenance=provenance, warnings=warnings,
    )  # fmt: skip


def _plausibility_warnings(
    log: JointLog, robot: Chain | None, audit: AuditResult, tsp: float
) -> list[LogWarning]:
    return plausibility_warnings(
        log, audit.q, robot, is_revolute(log, robot), audit.broken[:, 1:],
        timed=not log.period_assumed, tsp=tsp,
    )  # fmt: skip


def tcp_motion(
    robot: Chain | None, q: FloatArray, qd: FloatArray, qdd: FloatArray
) -> tuple[PointLog | None, list[LogWarning]]:
    """Return the motion of the tool centre point, None without robot or joints, and warnings about the robot.

    Args:
        robot: The arm.
        q: Joint values in [rad] or [m], shape (g, joints).
        qd: Joint velocities in [rad/s] or [m/s], shape (g, joints).
        qdd: Joint accelerations in [rad/s2] or [m/s2], shape (g, joints).

    Raises:
        LogError: If the log has another number of joints than the robot.
    """
    if robot is None or q.shape[1] == 0:
        return None, []
    if q.shape[1] != len(robot.coordinates):
        allowed = f"{len(robot.coordinates)}, as robot {robot.name} has"
        raise LogError(f"found {q.shape[1]} joints, allowed: {allowed}")
    tcp = point_over_log(robot, q, qd, qdd)
    warnings = [*mesh_warnings(robot), *mass_warnings(robot)]
    if tcp.singular.any():
        count, first = int(tcp.singular.sum()), int(np.argmax(tcp.singular))
        message = f"at {count} samples from {first} on ry is +-90 deg: rz and rx are not separately defined"
        warnings.append(LogWarning(EULER_SINGULAR, f"{message}, rx = 0 by convention"))
    return tcp, warnings


def with_robot(run: Run, robot: Chain | None) -> Run:
    """Return a run with the kinematics, torques and warnings of another robot; unchanged without one.

    Joint values, their audit and their derivatives are unchanged.

    Raises:
        LogError: If the joints of the run are not those of the robot.
    """
    if robot is None or robot == run.robot:
        return run
    tcp, robot_warnings = tcp_motion(robot, run.q, run.qd, run.qdd)
    _check_joint_kinds(run, robot)
    warnings = [warning for warning in run.warnings if warning.kind not in ROBOT_WARNINGS]
    own_warnings = (*recorded_tcp_warnings(robot, run.log), *_limit_warnings(run, robot), *robot_warnings)
    warnings += number_rows(own_warnings, run.log.file_row)
    provenance = replace(run.provenance, options={**run.provenance.options, "robot": robot.name})
    tau = compute_torques(robot, run.q, run.qd, run.qdd) if run.timed else None
    run = replace(run, robot=robot, tcp=tcp, tau=tau, warnings=tuple(warnings), provenance=provenance)
    return replace(run, warnings=(*run.warnings, *number_rows(torque_warnings(run), run.log.file_row)))


def _check_joint_kinds(run: Run, robot: Chain) -> None:
    if not run.log.joints:
        return
    before, after = is_revolute(run.log, run.robot), is_revolute(run.log, robot)
    errors = [
        f"{run.name}, joint {run.log.joints[j]}: found {'rad' if before[j] else 'm'},"
        f" allowed: {'rad' if after[j] else 'm'}, as robot {robot.name} has"
        for j in np.flatnonzero(before != after).tolist()
    ]
    if errors:
        raise LogError(*errors)


def _limit_warnings(run: Run, robot: Chain) -> list[LogWarning]:
    """Return warnings about the position and speed limits of another robot."""
    if not run.log.joints:
        return []
    if not run.timed:
        return limit_warnings(run.log, run.q, robot)
    read = run.provenance.options.get("read") or {}
    repaired = bool(read.get("repair"))
    audit = audit_log(run.log, robot, interval=read.get("interval"), repaired=repaired)
    warnings = _plausibility_warnings(run.log, robot, audit, run.tsp)
    return [warning for warning in warnings if warning.kind in LIMIT_WARNINGS]
