"""`urmpipe.accuracy`: how far a driven arm is from a path at which velocity, and how fast it may run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from urmpipe.arm_placing import Robot
from urmpipe.driven_runs import ArmRuns, ArmUnit, running_speed
from urmpipe.output_files import guarded_outputs
from urmpipe.parameters import kinds
from urmpipe.parameters.motions import Accuracy as AccuracyParameters
from urmpipe.public_functions import PathLike, as_paths, public_function, raise_warnings, reject_recording
from urmpipe.reading import map_files, resolve_reading, to_log_map
from urmpipe.systems.blocks import ON_PYTHON
from urmpipe.systems.units import Backend
from urmpipe_fmus.build.fmu import select_backend
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import DrivenJoint
from urmpipe_models.dynamics.driven_arm import spectral_radius
from urmpipe_models.errors import (
    Finding,
    Hint,
    LogError,
    OptionError,
    PathError,
    RobotError,
    format_value,
    map_collecting_errors,
)
from urmpipe_models.planning.path import PathRows
from urmpipe_models.robots.catalogue import robot_names
from urmpipe_pipeline.accuracy.driven_motion import DrivenMotion
from urmpipe_pipeline.accuracy.result import FASTEST, AccuracyResult, Decides
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.outputs import HEAD, PATH_ROW
from urmpipe_pipeline.planned_paths.given_path import given_path
from urmpipe_pipeline.planned_paths.path_file import GivenPath
from urmpipe_pipeline.planned_paths.planning import joints_of, plan_path
from urmpipe_pipeline.planned_paths.request import Request, Timing, checked_timing, require_limits
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.provenance import build_provenance
from urmpipe_pipeline.solved_targets.request import JointValues, start_of

POSES = 10
"""Poses along the path at which the sampled loop is looked at."""

REACHED = 1.0 - 1e-6
"""A velocity of which the plan reaches this share is reached."""

SLOWER = "some hundred"
"""How much longer ten velocities of irb60 take in NumPy (benchmarks/results/accuracy.md)."""

RUNNING_SHARE = 0.9  # of the work


@public_function(AccuracyParameters, path=kinds.PLANNED, robot=kinds.ROBOT)
def accuracy(
    path: PathLike | PathRows, robot: Robot | None = None, **options: Unpack[AccuracyParameters]
) -> AccuracyResult:
    """Run an arm with drives along a path at some velocities, and measure how far it is from it.

    The path is planned at each velocity, its set points lead the controllers of the unit `driven_arm`, and
    the deviation is measured as `compare` does: from the set point of the same time, and from the nearest
    point of the path. The arm begins at rest, drooping by its own weight: errors count from there. See
    docs/accuracy.md.

    Args:
        path: A file of rows x, y, z, r; a test cube, such as "cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1"; or rows.
        robot: The arm, with masses, and a drive or a spring for every joint; default: that of the map.
        **options: Velocities, the law of time, the limit, how the file is read, what is written: the options
            of `urmpipe accuracy`, by their names. With `strict`, all warnings are errors, except that the arm
            runs in NumPy.

    Returns:
        The accuracy: `errors` (of each velocity: `error`, `path_error` in [m], None if it diverged,
        `saturated`), `motions`, `running_speed` in [m/s], `verdict`, `to_frame()`.

    Raises:
        UrmpipeError: With everything that is wrong with the path, the arm or an option, or if the arm cannot
            move along the path.

    Source: [Iso9283]_ sections 5 and 6, eq. 6 and 7.
    """
    values: Mapping[str, Any] = options  # as their kinds read them
    on_message = values["on_message"] or (lambda line: None)
    progress = values["progress"] or (lambda share: None)
    limit, error = values["limit"], values["error"]
    timing = Timing(values["law"], None, values["acceleration"], values["jerk"], values["arcs"])
    parts: tuple[Callable[[], Any], ...] = (
        lambda: _request(resolve_reading(values, robot).arm, values["start"], timing),
        lambda: _read_rows(path, values),
        lambda: checked_timing(timing),
        lambda: _check_velocities(values["velocities"]),
    )
    request, rows, _, velocities = map_collecting_errors(lambda part: part(), parts)
    kept = [*([] if rows.file is None else as_paths(str(path))), *map_files(values), *values["inputs"]]
    with guarded_outputs({"recording": values["output"]}, kept) as written:
        force = values["force"] or (0.0, 0.0, 0.0)
        runs, notes = _runs(
            rows, request, force, values["backend"], on_message,
            lambda share: progress(RUNNING_SHARE * share), velocities[0],
        )  # fmt: skip
        motions = runs.run(velocities)
        speed = None if limit is None else running_speed(_judge(runs, limit, error), velocities)
        result = _accuracy(rows, request, runs, motions, speed, limit, error, notes)
        raise_warnings(
            values["strict"], [warning for warning in result.warnings if warning.kind != ON_PYTHON]
        )
        return written.recorded(result, lambda share: progress(RUNNING_SHARE + (1.0 - RUNNING_SHARE) * share))


def _request(arm: Chain | None, start: JointValues | None, timing: Timing) -> Request:
    """Return the request; raise an error if the arm cannot be driven, or suits neither start nor law."""
    if arm is None:
        allowed, hints = "an arm with masses and drives", (Hint("robot", None, "sets one"),)
        raise OptionError(Finding(parameter="robot", found="none", allowed=allowed, hints=hints))
    parts: tuple[Callable[[], Any], ...] = (
        lambda: start_of(arm, start),
        lambda: require_limits(timing, arm),
        lambda: _check_drives(arm),
    )
    begin, _, _ = map_collecting_errors(lambda make: make(), parts)
    return Request(arm, begin, timing)


def _check_drives(arm: Chain) -> None:
    """Raise a `RobotError` with every key that a driven arm lacks."""
    driven = {drive.joint for drive in arm.drives}
    faults = [] if arm.inertials else [f"robot {arm.name}: key inertials: not found, allowed: its masses"]
    if faults and arm.name in robot_names():
        command = f"urmpipe robot export {arm.name} -o {arm.name}.toml"
        faults[0] += f"; {command} writes a file to which they can be added"
    faults += [
        f"robot {arm.name}: key drives.{name}: not found, allowed: the drive of the joint, or {{ k, l }} of a"
        " spring that holds it"
        for name in arm.coordinates
        if name not in driven
    ]
    if not faults and not any(isinstance(drive, DrivenJoint) for drive in arm.drives):
        faults.append(f"robot {arm.name}: key drives: found no joint with a drive, allowed: at least one")
    if faults:
        raise RobotError(*faults)


def _read_rows(path: PathLike | PathRows, options: Mapping[str, Any]) -> GivenPath:
    """Return the rows of a path; raise a `LogError` if it is a recording."""
    reject_recording(path, "a table (CSV) of rows, or a test cube (cube:...)")
    if isinstance(path, (str, Path)) and Path(path).is_file():
        with Path(path).open("rb") as file:
            header = file.readline(HEAD)
        if PATH_ROW.encode() in header:
            allowed = "the path (CSV of x, y, z, ...) from which it was planned"
            raise LogError(Finding(file=str(path), found="the motion of a plan", allowed=allowed))
    return given_path(path, to_log_map(options))


def _check_velocities(velocities: Sequence[float]) -> list[float]:
    """Return each velocity in [m/s] once; raise an `OptionError` if one is not above 0."""
    if wrong := [format_value(velocity) for velocity in velocities if velocity <= 0.0]:
        allowed = "finite numbers of m/s above 0"
        raise OptionError(Finding(parameter="velocities", found=", ".join(wrong), allowed=allowed))
    return list(dict.fromkeys(velocities))


def _runs(
    rows: GivenPath,
    request: Request,
    force: tuple[float, float, float],
    backend: Backend | None,
    on_message: Callable[[str], None],
    progress: Callable[[float], None],
    first_velocity: float,
) -> tuple[ArmRuns, list[LogWarning]]:
    """Return the runs of the arm, and the warnings about how they are computed."""
    arm = request.arm
    assert arm is not None
    periods = [round(drive.period * 1e9) for drive in arm.drives if isinstance(drive, DrivenJoint)]
    period = float(np.gcd.reduce(periods)) / 1e9
    joint_path = joints_of(rows, request)

    def plan(velocity: float) -> PlannedPath:
        """Return the path at a velocity; raise a `PathError` if the arm cannot move so."""
        timing = replace(request.timing, velocity=velocity, tsp=period)
        planned = plan_path(rows, replace(request, timing=timing), joints=joint_path)
        if planned.infeasibilities:
            first = planned.infeasibilities[0]
            raise PathError(rows.finding(first.row, first.message, "a path that the arm can follow"))
        return planned

    joints = plan(first_velocity).joints
    assert joints is not None
    chosen, reason = select_backend(backend)
    warnings = []
    if chosen == "python":
        message = f"the arm runs in NumPy, {SLOWER} times slower than machine code"
        message += f": {reason}" if reason else ""
        on_message(message)
        warnings += [LogWarning(ON_PYTHON, message)] if reason else []
    unit = ArmUnit(replace(arm, start=tuple(joints.q[0].tolist())), force)
    return ArmRuns(unit, plan, chosen == "native", on_message, progress), warnings


def _judge(runs: ArmRuns, limit: float, error: str) -> Callable[[Sequence[float]], list[bool]]:
    """Return a function that runs velocities, and returns whether the arm reaches each within a limit."""

    def is_within(velocities: Sequence[float]) -> list[bool]:
        """Return for each velocity whether it is within the limit."""
        results = [motion.errors for motion in runs.run(velocities)]
        judged = [result.error if error == "time" else result.path_error for result in results]
        reached = [result.reached >= REACHED * result.velocity for result in results]
        return [
            value is not None and value <= limit and is_reached
            for value, is_reached in zip(judged, reached, strict=True)
        ]

    return is_within


def _accuracy(
    rows: GivenPath,
    request: Request,
    runs: ArmRuns,
    motions: Sequence[DrivenMotion],
    speed: float | None,
    limit: float | None,
    error: Decides,
    warnings: Sequence[LogWarning],
) -> AccuracyResult:
    """Return the result of runs."""
    arm, timing = runs.arm.robot, request.timing
    longest = max(motions, key=len)
    poses = np.unique(np.linspace(0, len(longest.set_q) - 1, POSES).astype(int))
    radius = max(spectral_radius(arm, longest.set_q[k]) for k in poses)
    errors = {motion.velocity: motion.errors for motion in runs.motions.values()}
    options: dict[str, Any] = {**timing.options, "robot": arm.name, "force": list(runs.arm.force)}
    options |= {"velocities": [motion.velocity for motion in motions], "limit": limit, "error": error}
    return AccuracyResult(
        name=rows.name,
        robot=arm,
        rows=rows.rows,
        law=timing.law,
        acceleration=timing.acceleration_limit,
        jerk=timing.jerk,
        period=float(np.diff(longest.t_ns[:2])[0]) / 1e9,
        force=runs.arm.force,
        motions=tuple(motions),
        probed=() if limit is None else tuple(errors[velocity] for velocity in sorted(errors)),
        running=None if speed is None else runs.motions[speed],
        limit=limit,
        limited_error=error,
        loop_radius=radius,
        compiled=runs.compiled,
        warnings=(*rows.warnings, *warnings, *_iter_warnings(motions, radius, speed)),
        provenance=build_provenance("accuracy", options, [rows.file] if rows.file else []),
    )


def _iter_warnings(
    motions: Sequence[DrivenMotion], radius: float, speed: float | None
) -> Iterator[LogWarning]:
    """Yield warnings about unstable loops, velocities that are not reached, and runs that diverged."""
    if radius >= 1.0:
        message = f"the sampled controllers are not stable about the path: spectral radius {radius:.6g}"
        yield LogWarning("unstable-loop", f"{message}, allowed: below 1")
    slow = [motion.errors for motion in motions if motion.errors.reached < REACHED * motion.velocity]
    if slow:
        speeds = ", ".join(f"{errors.velocity:g} m/s ({errors.reached:.4g} m/s reached)" for errors in slow)
        yield LogWarning("not-reached", f"the path or the joint limits do not allow {speeds}")
    if speed == FASTEST:
        yield LogWarning("fastest", f"all velocities up to {FASTEST:g} m/s are within the limit")
    for motion in motions:
        if (end := motion.diverged) is not None:
            message = f"at {motion.velocity:g} m/s {end.joint} deviates from its set points by more"
            " than a turn"
            yield LogWarning("diverged", f"{message} at t = {end.t:.4g} s: the run ends there")
