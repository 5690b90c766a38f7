"""Ingest: a log becomes a run.

- `ingest_log`: read the files, infer the robot where the log identifies it, then `log_to_run`.
- `log_to_run`: repolarize on the rows of the file, resample, differentiate, compute kinematics and
  torques, and collect the warnings.
- `with_robot`: the same run with another robot; the joint motion is unchanged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import compress
from pathlib import Path
from typing import get_args

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, check_choice
from urmpipe_models.kinematics.forward import PointLog, point_over_log
from urmpipe_pipeline.joint_log import SOLVED, JointLog, LogWarning
from urmpipe_pipeline.presentation.meshes import VISUAL_MISSING, missing_visuals
from urmpipe_pipeline.provenance import Provenance, build_provenance
from urmpipe_pipeline.repolarization.audit import audit_log, is_revolute
from urmpipe_pipeline.runs.derivatives import (
    Method,
    derivatives,
    effective_method,
    find_matching_unit,
    is_same_rate,
)
from urmpipe_pipeline.runs.grid import Grid, make_grid
from urmpipe_pipeline.runs.plausibility import JOINT_LIMIT, SPEED_LIMIT, limit_warnings, plausibility_warnings
from urmpipe_pipeline.runs.recorded_tcp import (
    FAR_RECORDED,
    RECORDED_START,
    infer_robot,
    recorded_tcp_warnings,
)
from urmpipe_pipeline.runs.run import RowJoints, Run
from urmpipe_pipeline.runs.torques import (
    CHECK_LOG,
    EFFORT_LIMIT,
    MASS_LEFT_OUT,
    MOVE_SLOWER,
    SMOOTHED,
    TORQUE_NOISE,
    compute_torques,
    effort_warning,
    mass_warnings,
    noise_warnings,
)
from urmpipe_pipeline.sources import Held, ReadOptions
from urmpipe_pipeline.sources.clocks.clock import unused_for_poses, unused_period
from urmpipe_pipeline.sources.read import read_numbers

QUANTISED_DIGITS = 5
"""Joint values with this many significant digits or fewer are differentiated with smoothing."""

MIN_TSP = 1e-9
"""Times of a log are whole nanoseconds."""

MAX_TSP = 1e9
"""Periods in [s] from this one on are no times that integers of 64 bits hold in [ns]."""

EULER_SINGULAR = "euler-singular"


@np.errstate(over="ignore", invalid="ignore")  # huge numbers in a log: their squares and steps are infinite
def ingest_log(
    files: Sequence[Path | Held],
    *,
    robot: Chain | None = None,
    read: ReadOptions | None = None,
    tsp: float | None = None,
    derivative: Method | None = None,
    name: str | None = None,
) -> Run:
    """Return the run of one log.

    The joints are repolarized on the file's own rows, then put on the grid, differentiated, and
    taken through the robot's kinematics.

    Args:
        files: The log's file, or its files if its source writes one a plot; or a table in memory.
        robot: The arm, with base and tool; None for the one that the log singles out, if it does.
        read: How to read the file where it cannot tell by itself.
        tsp: Period of the grid in [s]; default: the log's own.
        derivative: central or savgol; default: savgol for logs seen to be quantised, else central.
        name: What to call it; default: the file's stem.

    Raises:
        LogError: With everything that is wrong with the files.
        OptionError: If an option's value makes no sense.
    """
    options = read or ReadOptions()
    _refuse_senseless(tsp, derivative)
    numbers = read_numbers(files, options, robot)
    inferred = infer_robot(numbers.recorded) if robot is None else None
    robot, because = inferred or (robot, None)
    log = numbers.log(robot)
    if because:
        log = replace(log, inferences=(*log.inferences, because))
    if options.shared or options.side:  # others are joints of another log, or of the other side
        own = {"", *compress(log.joints, is_revolute(log, robot))}
        options = replace(options, interval={k: one for k, one in options.interval.items() if k in own})
    usual = asdict(ReadOptions())
    usual |= {"shared": options.shared}  # says nothing of this log
    read_by = {name: value for name, value in asdict(options).items() if value != usual[name]}
    given = {"robot": robot.name if robot else None, "tsp": tsp, "derivative": derivative}
    made = build_provenance("ingest", given | {"read": read_by or None}, log.files)
    return log_to_run(log, robot, options, tsp=tsp, derivative=derivative, name=name, made=made)


def log_to_run(
    log: JointLog,
    robot: Chain | None,
    options: ReadOptions,
    *,
    made: Provenance,
    tsp: float | None = None,
    derivative: Method | None = None,
    name: str | None = None,
) -> Run:
    """Return the run of a log that is there: what `ingest_log` does once it has read it.

    Args:
        log: The log, its times strictly increasing, or still poses.
        robot: The arm, with base and tool; None for no kinematics.
        options: How it was read: `interval`, `repair` and `period` matter here.
        made: How to repeat it.
        tsp: Period of the grid in [s]; default: the log's own.
        derivative: central or savgol; default: savgol for logs seen to be quantised, else central.
        name: What to call it; default: the log's name.

    Raises:
        LogError: If the log's joints are not the robot's, or its times need a grid without end.
        OptionError: If an interval makes no sense.
    """
    if not log.timed:
        unused = {name: getattr(options, name) for name in ("period", "interval", "repair")}
        told = unused_for_poses(unused | {"tsp": tsp, "derivative": derivative})
        return _of_poses(replace(log, name=name or log.name), robot, made, told)
    found = audit_log(log, robot, interval=options.interval, repaired=options.repair)
    log = replace(log, inferences=(*log.inferences, *found.inferences))
    clocked = any(column.role == "time" for column in log.columns)
    grid = make_grid(log, tsp)
    turns = is_revolute(log, robot)
    timed = not log.period_assumed
    doubts = plausibility_warnings(log, found.q, robot, turns, found.broken[:, 1:], timed=timed, tsp=grid.tsp)
    q, left_open = grid.resample_joints(found.q, found.unresolved)
    warnings = [*log.warnings, *recorded_tcp_warnings(robot, log), *found.warnings, *doubts]
    warnings += [*grid.warnings, *left_open]
    warnings += [unused_period("period")] if clocked and options.period else []
    qd, qdd, made_by = _rates(log, grid, q, _method(log, derivative), grid.steps(found.broken), warnings)
    tcp, noticed = tcp_motion(robot, q, qd, qdd)
    recorded = None if log.tcp_position is None else grid.resample(log.tcp_position)
    run = Run(
        name=name or log.name, log=log, robot=robot, tsp=grid.tsp, t_ns=grid.t_ns, q=q, qd=qd, qdd=qdd,
        tcp=tcp, tcp_recorded=recorded, audit=found.entries, warnings=(*warnings, *noticed), provenance=made,
        rows=None if grid.own else RowJoints(grid.source_ns, found.q),
        tau=compute_torques(robot, q, qd, qdd), derivative=made_by,
    )  # fmt: skip
    return replace(run, warnings=(*run.warnings, *torque_warnings(run)))


def _of_poses(log: JointLog, robot: Chain | None, made: Provenance, told: Sequence[LogWarning] = ()) -> Run:
    """Return the run of still poses, a row each: no motion joins them, so there are no turns and no rates."""
    none = np.full_like(log.q, np.nan)
    tcp, noticed = tcp_motion(robot, log.q, none, none)
    limits = [] if robot is None or not log.joints else limit_warnings(log, log.q, robot)
    return Run(
        name=log.name, log=log, robot=robot, tsp=0.0, t_ns=log.t_ns, q=log.q, qd=none, qdd=none, tcp=tcp,
        tcp_recorded=log.tcp_position, audit=(), provenance=made,
        warnings=(*log.warnings, *told, *recorded_tcp_warnings(robot, log), *limits, *noticed),
    )  # fmt: skip


def _refuse_senseless(tsp: float | None, derivative: str | None) -> None:
    """Raise an `OptionError` for a period or a method that makes no sense."""
    if tsp is not None and not MIN_TSP <= tsp < MAX_TSP:
        allowed = f"a positive time below {MAX_TSP:g} s"
        if 0 < tsp < MIN_TSP:
            allowed = f"{MIN_TSP:g} s or more: times are in ns"
        raise OptionError(Finding(parameter="tsp", found=f"{tsp:g} s", allowed=allowed))
    if derivative is not None:
        check_choice("derivative", derivative, get_args(Method))


def _method(log: JointLog, derivative: Method | None) -> Method:
    """Return how a log is differentiated: as requested, else smoothed where its values are coarse."""
    return derivative or ("savgol" if log.digits and log.digits <= QUANTISED_DIGITS else "central")


def _rates(
    log: JointLog, grid: Grid, q: FloatArray, method: Method, broken: IntArray, warnings: list[LogWarning]
) -> tuple[FloatArray, FloatArray, str]:
    """Return q' and q'' on the grid, and what made q'': recorded ones where they agree with differences.

    Fewer than three samples have no differences that could contradict what was recorded.
    """
    qd, qdd = derivatives(q, grid.tsp, method, broken)
    result = []
    for order, values, own, word in ((1, qd, log.qd, "rates"), (2, qdd, log.qdd, "accelerations")):
        on_grid = values if own is None else grid.resample(own)
        if own is None or len(q) < 3 or is_same_rate(on_grid, values):
            result.append(on_grid)
            continue
        result.append(values)
        said = f"the recorded {word} do not agree with the differences of the joint values"
        hints = []
        if unit := find_matching_unit(on_grid, values, order):
            said += f", but would {unit.said}"
            clocks = [column.name for column in log.columns if column.role == "time"]
            hints = [Hint("unit", {name: unit.time}, "applies this") for name in clocks[:1] if unit.time]
        said += "; the differences are used"
        warnings.append(LogWarning(f"recorded-{word}", said, hints=tuple(hints)))
    rates, seconds = result
    return rates, seconds, effective_method(len(q), method) if seconds is qdd else "recorded"


def torque_warnings(run: Run) -> list[LogWarning]:
    """Return what there is to say about torques: that they are noise, or more than the joints' efforts."""
    return [*noise_warnings(run), *_effort_warnings(run)]


def _effort_warnings(run: Run) -> list[LogWarning]:
    """Return a warning if the motion of a run takes more than the efforts of its joints."""
    log, summaries = run.log, run.torque_summaries()
    if log.source == SOLVED:
        return effort_warning(summaries, run.t_ns, MOVE_SLOWER, run.rows_ns)
    hints = (SMOOTHED,) if run.derivative == "central" else ()
    return effort_warning(summaries, run.t_ns, CHECK_LOG, run.rows_ns, hints)


def tcp_motion(
    robot: Chain | None, q: FloatArray, qd: FloatArray, qdd: FloatArray
) -> tuple[PointLog | None, list[LogWarning]]:
    """Return the motion of the tool centre point, if there is a robot, and what there is to say about it.

    Joint values are in [rad] or [m], their rates in [rad/s] or [m/s], their second derivatives in [rad/s2] or
    [m/s2], each of shape (g, joints).

    Raises:
        LogError: If the log has another number of joints than the robot.
    """
    if robot is None or q.shape[1] == 0:
        return None, []
    if q.shape[1] != len(robot.coordinates):
        allowed = f"{len(robot.coordinates)}, as robot {robot.name} has"
        raise LogError(f"found {q.shape[1]} joints, allowed: {allowed}")
    tcp = point_over_log(robot, q, qd, qdd)
    notices = [*missing_visuals(robot), *mass_warnings(robot)]
    if not tcp.singular.any():
        return tcp, notices
    count, first = int(tcp.singular.sum()), int(np.argmax(tcp.singular))
    said = "ry is +-90 deg: rz and rx are not separately defined, rx = 0 by convention"
    return tcp, [*notices, LogWarning(EULER_SINGULAR, f"at {count} samples from {first} on {said}")]


LIMIT_WARNINGS = (JOINT_LIMIT, SPEED_LIMIT)
ROBOT_WARNINGS = (  # kinds that depend on the robot
    EULER_SINGULAR, VISUAL_MISSING, MASS_LEFT_OUT, FAR_RECORDED, RECORDED_START, *LIMIT_WARNINGS,
    EFFORT_LIMIT, TORQUE_NOISE,
)  # fmt: skip


def with_robot(run: Run, robot: Chain | None) -> Run:
    """Return a run with the kinematics of an arm; as it is without one.

    Its joint values, their audit and their rates stay.

    Raises:
        LogError: If the joints of the run are not the robot's.
    """
    if robot is None or robot == run.robot:
        return run
    tcp, noticed = tcp_motion(robot, run.q, run.qd, run.qdd)
    _refuse_other_kinds(run, robot)
    others = [warning for warning in run.warnings if warning.kind not in ROBOT_WARNINGS]
    tau = compute_torques(robot, run.q, run.qd, run.qdd) if run.timed else None
    doubts = [*recorded_tcp_warnings(robot, run.log), *_beyond_limits(run, robot), *noticed]
    made = replace(run.provenance, options={**run.provenance.options, "robot": robot.name})
    warnings = (*others, *doubts)
    moved = replace(run, robot=robot, tcp=tcp, tau=tau, warnings=warnings, provenance=made)
    return replace(moved, warnings=(*warnings, *torque_warnings(moved)))


def _refuse_other_kinds(run: Run, robot: Chain) -> None:
    """Raise a `LogError` with every joint that turns in the log and slides in the arm, or the other way."""
    if not run.log.joints:
        return
    before, now = is_revolute(run.log, run.robot), is_revolute(run.log, robot)
    wrong = [
        f"{run.name}, joint {run.log.joints[j]}: found {_unit(before[j])}, allowed: {_unit(now[j])},"
        f" as robot {robot.name} has"
        for j in np.flatnonzero(before != now).tolist()
    ]
    if wrong:
        raise LogError(*wrong)


def _unit(turns: np.bool_) -> str:
    """Return the SI unit of a joint that turns, or slides."""
    return "rad" if turns else "m"


def _beyond_limits(run: Run, robot: Chain) -> list[LogWarning]:
    """Return what the log says against the arm's limits of place and speed."""
    if not run.log.joints:
        return []
    if not run.timed:
        return limit_warnings(run.log, run.q, robot)
    read = run.provenance.options.get("read") or {}
    repaired = bool(read.get("repair"))
    found = audit_log(run.log, robot, interval=read.get("interval"), repaired=repaired)
    timed = not run.log.period_assumed
    turns = is_revolute(run.log, robot)
    doubts = plausibility_warnings(
        run.log, found.q, robot, turns, found.broken[:, 1:], timed=timed, tsp=run.tsp
    )
    return [warning for warning in doubts if warning.kind in LIMIT_WARNINGS]
