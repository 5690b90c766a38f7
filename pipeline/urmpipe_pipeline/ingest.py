"""Ingest: a log becomes a run - repolarized, on a uniform grid, with the arm's kinematics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.chain import Chain
from urmpipe_models.errors import LogError, OptionError
from urmpipe_models.kinematics import THREADS, PointLog, point_over_log
from urmpipe_models.repolarizer import FULL_TURN, Repolarized, repolarize
from urmpipe_pipeline.derivatives import Method, derivatives, recorded_agree
from urmpipe_pipeline.grid import Grid, make_grid
from urmpipe_pipeline.joint_log import FloatArray, JointLog, LogWarning, seconds
from urmpipe_pipeline.plausibility import implausible
from urmpipe_pipeline.provenance import provenance
from urmpipe_pipeline.recorded_tcp import far_from_recorded
from urmpipe_pipeline.results import Repolarization, Run
from urmpipe_pipeline.robot_inference import infer_robot
from urmpipe_pipeline.sources import ReadOptions, read_log

QUANTISED_DIGITS = 5
"""Joint values with this many significant digits or fewer are differentiated with smoothing."""

EULER_SINGULAR = "euler-singular"
"""The kind of the only warning that rests on the robot."""

LISTED_STEPS = 20
"""Unexplained steps named one by one; the others are counted."""


def ingest_log(
    files: Sequence[Path],
    *,
    robot: Chain | None = None,
    read: ReadOptions | None = None,
    tsp: float | None = None,
    derivative: Method | None = None,
    name: str | None = None,
    early: Callable[[JointLog | Run], None] | None = None,
) -> Run:
    """Return the run of one log.

    The joints are repolarized on the file's own rows, then put on the grid, differentiated, and
    taken through the robot's kinematics.

    Args:
        files: The log's file, or its files if its source writes one a plot.
        robot: The arm, with base and tool; None for the one that the log singles out, if it does.
        read: How to read the file where it cannot tell by itself.
        tsp: Period of the grid in [s]; default: the log's own.
        derivative: central or savgol; default: savgol for logs seen to be quantised, else central.
        name: What to call it; default: the file's stem.
        early: Told the log when it is read and the run before its kinematics are computed, so that they
            can be written meanwhile.

    Raises:
        LogError: With everything that is wrong with the files.
        OptionError: If an option's value makes no sense.
    """
    options = read or ReadOptions()
    if tsp is not None and not (np.isfinite(tsp) and tsp > 0):
        raise OptionError(f"--tsp: found {tsp:g} s, allowed: a positive time")
    if derivative is not None and derivative not in get_args(Method):
        raise OptionError(f"--derivative: found {derivative}, allowed: {', '.join(get_args(Method))}")
    log = read_log(files, options, robot)
    inferred = infer_robot(log) if robot is None else None
    if inferred:
        robot, because = inferred
        log = replace(log, inferences=(*log.inferences, because))
    if early:
        early(log)
    warnings = [*log.warnings, *far_from_recorded(robot, log)]
    fixed, audit = _repolarized(log, robot)
    warnings += _unexplained(log, fixed)
    timed = options.period is not None or any(column.role == "time" for column in log.columns)
    turning = _turning(log, robot)
    warnings += implausible(log, fixed.q, robot, turning, fixed.unexplained, timed=timed)
    grid = make_grid(log, tsp)
    warnings += grid.warnings
    q = grid.resample(fixed.q)
    method: Method = derivative or ("savgol" if log.digits and log.digits <= QUANTISED_DIGITS else "central")
    qd, qdd = _rates(log, grid, q, method, warnings)
    given = {
        "robot": robot.name if robot else None,
        "tsp": tsp,
        "derivative": derivative,
        "read": _given(options),
    }
    run = Run(
        name=name or log.name,
        log=log,
        robot=robot,
        tsp=grid.tsp,
        t_ns=grid.t_ns,
        q=q,
        qd=qd,
        qdd=qdd,
        tcp=None,
        tcp_recorded=None if log.tcp_position is None else grid.resample(log.tcp_position),
        repolarizations=tuple(audit),
        warnings=tuple(warnings),
        provenance=provenance("ingest", given, log.files),
    )
    if early:
        early(run)
    # The joints are being written meanwhile: that takes a core of its own.
    tcp, noticed = kinematics(robot, q, qd, qdd, threads=1 if early else THREADS)
    return replace(run, tcp=tcp, warnings=(*warnings, *noticed))


def _given(options: ReadOptions) -> dict[str, Any] | None:
    """Return the reading options that differ from the defaults."""
    default = asdict(ReadOptions())
    return {name: value for name, value in asdict(options).items() if value != default[name]} or None


def _repolarized(log: JointLog, robot: Chain | None) -> tuple[Repolarized, list[Repolarization]]:
    """Repolarize the joints that turn, on the file's own rows; joint indices are those of the log."""
    turning = _turning(log, robot)
    dt = seconds(np.diff(log.t_ns, prepend=log.t_ns[:1]))
    limits = np.inf if robot is None else np.array([joint.velocity for joint in robot.moving])[turning]
    if turning.all():
        fixed = repolarize(log.q, dt, max_speed=limits)
    else:
        which = np.flatnonzero(turning)
        part = repolarize(log.q[:, which], dt, max_speed=limits)
        q, unexplained = log.q.copy(), part.unexplained.copy()
        q[:, which], unexplained[:, 1] = part.q, which[part.unexplained[:, 1]]
        fixed = part._replace(q=q, joints=which[part.joints], unexplained=unexplained)
    return fixed, _audit(log, fixed)


def _turning(log: JointLog, robot: Chain | None) -> NDArray[np.bool_]:
    """Tell which joints turn, shape (joints,)."""
    return np.array([_turns(log, robot, j) for j in range(len(log.joints))], dtype=np.bool_)


def _turns(log: JointLog, robot: Chain | None, joint: int) -> bool:
    """Tell whether a joint turns: the robot says so, or else the column's unit."""
    if robot is not None:
        return robot.moving[joint].kind == "revolute"
    return log.units.get(log.joints[joint]) in ("rad", "deg")


def _audit(log: JointLog, fixed: Repolarized) -> list[Repolarization]:
    """List every repolarization with its place, its instant and its turns."""
    turns = [0] * len(log.joints)
    audit = []
    for row, j, change in zip(fixed.rows.tolist(), fixed.joints.tolist(), fixed.change.tolist(), strict=True):
        previous = row - 1
        while np.isnan(log.q[previous, j]):
            previous -= 1
        start, end = int(log.t_ns[previous]), int(log.t_ns[row])
        audit.append(
            Repolarization(
                joint=log.joints[j],
                row=row + 1,
                t=(start + end) / 2e9,
                half_period=(end - start) / 2e9,
                step=float(log.q[row, j] - log.q[previous, j]),
                before=turns[j],
                after=turns[j] + change,
            )
        )
        turns[j] += change
    return audit


def _unexplained(log: JointLog, fixed: Repolarized) -> list[LogWarning]:
    """Warn of steps above a quarter turn that are no repolarization."""
    places = fixed.unexplained.tolist()
    limit = np.degrees(FULL_TURN / 4)
    warnings = [
        LogWarning(
            "large-step",
            f"{log.joints[j]} steps by more than {limit:.0f} deg from the value before, to"
            f" {log.q[row, j]:.6g} rad, which is no wrap: it stays",
            row + 1,
        )
        for row, j in places[:LISTED_STEPS]
    ]
    if len(places) > LISTED_STEPS:
        warnings.append(
            LogWarning("large-step", f"{len(places) - LISTED_STEPS} more steps that are no wraps")
        )
    return warnings


def _rates(
    log: JointLog, grid: Grid, q: FloatArray, method: Method, warnings: list[LogWarning]
) -> tuple[FloatArray, FloatArray]:
    """Return q' and q'' on the grid: the recorded ones where they agree with the differences.

    Fewer than three samples have no differences that could contradict what was recorded.
    """
    computed = derivatives(q, grid.tsp, method)
    recorded = (log.qd, log.qdd)
    result = []
    for values, own, word in zip(computed, recorded, ("rates", "accelerations"), strict=True):
        on_grid = None if own is None else grid.resample(own)
        if on_grid is None or len(q) < 3 or recorded_agree(on_grid, values):
            result.append(values if on_grid is None else on_grid)
            continue
        result.append(values)
        warnings.append(
            LogWarning(
                f"recorded-{word}",
                f"the recorded {word} do not agree with the differences of the joint values;"
                " the differences are used",
            )
        )
    return result[0], result[1]


def kinematics(
    robot: Chain | None, q: FloatArray, qd: FloatArray, qdd: FloatArray, *, threads: int = THREADS
) -> tuple[PointLog | None, list[LogWarning]]:
    """Return the motion of the tool centre point, if there is a robot, and what there is to say about it.

    Args:
        robot: The arm, or None.
        q: Joint values in [rad] or [m], shape (g, joints).
        qd: Their rates in [rad/s] or [m/s], shape (g, joints).
        qdd: Their second derivatives in [rad/s2] or [m/s2], shape (g, joints).
        threads: Blocks of samples worked on side by side.

    Raises:
        LogError: If the log has another number of joints than the robot.
    """
    if robot is None or q.shape[1] == 0:
        return None, []
    if q.shape[1] != len(robot.coordinates):
        raise LogError(
            f"found {q.shape[1]} joints, allowed: {len(robot.coordinates)}, as robot {robot.name} has"
        )
    tcp = point_over_log(robot, q, qd, qdd, threads=threads)
    if not tcp.singular.any():
        return tcp, []
    count, first = int(tcp.singular.sum()), int(np.argmax(tcp.singular))
    said = "ry is +-90 deg: rz and rx are not separately defined, rx = 0 by convention"
    return tcp, [LogWarning(EULER_SINGULAR, f"at {count} samples from {first} on {said}")]
