"""`urmpipe.accuracy`: how far a driven arm is from a path at which velocity, and how fast it may run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from urmpipe.arm_placing import Frame, Robot
from urmpipe.driven_runs import ArmRuns, ArmUnit, running_speed
from urmpipe.keyword_checks import PathLike, paths, public_reading, refuse_recording, refuse_warnings
from urmpipe.output_files import guarded_outputs
from urmpipe.reading import UntimedReading, map_files, options_of, resolved
from urmpipe.systems.blocks import ON_PYTHON
from urmpipe.systems.units import Backend
from urmpipe_fmus.build.fmu import select_backend
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import DrivenJoint
from urmpipe_models.dynamics.driven_arm import spectral_radius
from urmpipe_models.errors import (
    Finding,
    LogError,
    OptionError,
    PathError,
    RobotError,
    format_value,
    map_collecting_errors,
)
from urmpipe_models.planning.laws import Arcs
from urmpipe_models.planning.path import PathRows
from urmpipe_pipeline.accuracy.driven_motion import DrivenMotion
from urmpipe_pipeline.accuracy.result import DECIDES, FASTEST, AccuracyResult, Decides
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.outputs import HEAD, PATH_ROW
from urmpipe_pipeline.planned_paths.given_path import given_path
from urmpipe_pipeline.planned_paths.path_file import GivenPath
from urmpipe_pipeline.planned_paths.planning import joints_of, plan_path
from urmpipe_pipeline.planned_paths.request import Law, Request, Timing, checked_timing, refuse_unlimited
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.provenance import build_provenance
from urmpipe_pipeline.solved_targets.request import JointValues, start_of

VELOCITIES = tuple(round(0.1 * k, 1) for k in range(1, 11))
"""Ten velocities in [m/s], where none are given: those of the paper's Fig. 7."""

POSES = 10
"""Poses along the path at which the sampled loop is looked at."""

REACHED = 1.0 - 1e-6
"""A velocity of which the plan reaches this share is reached."""

SLOWER = "some hundred"
"""How much longer ten velocities of irb60 take in NumPy (benchmarks/results/accuracy.md)."""

RUNNING = 0.9
"""Share of the work that the runs are."""


@public_reading(UntimedReading)
def accuracy(
    path: PathLike | PathRows,
    robot: Robot | None = None,
    *,
    velocities: Sequence[float] = VELOCITIES,
    acceleration: float | None = None,
    law: Law = "trapezoid",
    jerk: float | None = None,
    arcs: Arcs = "tangential",
    limit: float | None = None,
    error: Decides = "time",
    force: Sequence[float] | None = None,
    base: Frame | None = None,
    tool: Frame | None = None,
    base_link: str | None = None,
    tip_link: str | None = None,
    start: JointValues | None = None,
    backend: Backend | None = None,
    strict: bool = False,
    output: PathLike | None = None,
    inputs: Sequence[PathLike] = (),
    told: Callable[[str], None] | None = None,
    progress: Callable[[float], None] | None = None,
    **reading: Unpack[UntimedReading],
) -> AccuracyResult:
    """Run an arm with drives along a path at some velocities, and measure how far it is from it.

    The path is planned at each velocity, its set points lead the controllers of the unit `driven_arm`, and
    the deviation is measured as `compare` does: from the set point of the same time, and from the nearest
    point of the path. The arm begins at rest, drooping by its own weight: errors count from there. See
    docs/accuracy.md.

    Args:
        path: A file of rows x, y, z, r; a test cube, such as "cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1"; or rows.
        robot: The arm, with masses, and a drive or a spring for every joint; default: that of the map.
        velocities: Largest speeds along the path in [m/s]; default: 0.1, 0.2, ..., 1.0.
        acceleration: The largest acceleration in [m/s2] at all of them; default: 6, with the law limits none.
        law: trapezoid, jerk or limits, as in `plan`.
        jerk: The largest jerk of the law jerk in [m/s3].
        arcs: What the acceleration limits on arcs, as in `plan`.
        limit: The largest error allowed in [m]; with it there is a verdict, and the running speed is found.
        error: Which error is judged: time, from the set point of the same time, or path, from the nearest
            point of the path. Both are told.
        force: What acts on the tool from outside in [N], along the axes of the world, all the time.
        base: Where the arm stands in the world, in [m] and [rad]; as a matrix of shape (4, 4).
        tool: The tool centre point in the frame of the arm's tip, likewise.
        base_link: Link of a URDF where the arm begins; default: its root.
        tip_link: Link of a URDF where the arm ends; default: its end.
        start: Joint values in [rad] or [m], or texts with units, shape (joints,), to be near to at
            the first sample.
        backend: native: as machine code; python: in NumPy; default: native if it can be built here.
        strict: Whether a warning is an error, but for the one that the arm runs in NumPy.
        output: The recording (.rrd) to write.
        inputs: Files besides the path that are never replaced.
        told: Told what takes its time, a line each.
        progress: Called with the share that is done, 0..1.
        **reading: How to read the file where it does not show it, as of `plan`.

    Returns:
        The accuracy: `errors` (of each velocity: `error`, `path_error` in [m], None if it diverged,
        `saturated`), `motions`, `running_speed` in [m/s], `verdict`, `to_frame()`.

    Raises:
        UrmpipeError: With everything that is wrong with the path, the arm or an option, or if the arm cannot
            move along the path.

    Source: [Iso9283]_ sections 5 and 6, eq. 6 and 7.
    """
    tell, done = told or (lambda line: None), progress or (lambda share: None)
    timing = Timing(law, None, acceleration, jerk, arcs)
    parts: tuple[Callable[[], Any], ...] = (
        lambda: _request(resolved(reading, robot, base, tool, base_link, tip_link).arm, start, timing),
        lambda: _given(path, reading),
        lambda: checked_timing(timing),
        lambda: _checked(velocities, limit, error, force),
    )
    request, given, _, pushed = map_collecting_errors(lambda make: make(), parts)
    kept = [*([] if given.file is None else paths(str(path))), *map_files(reading), *paths(inputs)]
    with guarded_outputs({"recording": output}, kept) as written:
        asked = list(dict.fromkeys(map(float, velocities)))
        runs, notes = _runs(
            given, request, pushed, backend, tell, lambda share: done(RUNNING * share), asked[0]
        )
        motions = runs.run(asked)
        speed = None if limit is None else running_speed(_judge(runs, limit, error), asked)
        result = _accuracy(given, request, runs, motions, speed, limit, error, notes)
        refuse_warnings(strict, [one for one in result.warnings if one.kind != ON_PYTHON])
        return written.recorded(result, lambda share: done(RUNNING + (1.0 - RUNNING) * share))


def _request(arm: Chain | None, start: JointValues | None, timing: Timing) -> Request:
    """Return the request; raise an error if the arm cannot be driven, or suits neither start nor law."""
    if arm is None:
        raise OptionError(Finding(parameter="robot", found="none", allowed="an arm with masses and drives"))
    parts: tuple[Callable[[], Any], ...] = (
        lambda: start_of(arm, start),
        lambda: refuse_unlimited(timing, arm),
        lambda: _refuse_undriven(arm),
    )
    begin, _, _ = map_collecting_errors(lambda make: make(), parts)
    return Request(arm, begin, timing)


def _refuse_undriven(arm: Chain) -> None:
    """Raise a `RobotError` with every key that a driven arm lacks."""
    driven = {one.joint for one in arm.drives}
    faults = [] if arm.inertials else [f"robot {arm.name}: key inertials: not found, allowed: its masses"]
    faults += [
        f"robot {arm.name}: key drives.{name}: not found, allowed: the drive of the joint, or {{ k, l }} of a"
        " spring that holds it"
        for name in arm.coordinates
        if name not in driven
    ]
    if not faults and not any(isinstance(one, DrivenJoint) for one in arm.drives):
        faults.append(f"robot {arm.name}: key drives: found no joint with a drive, allowed: at least one")
    if faults:
        raise RobotError(*faults)


def _given(path: PathLike | PathRows, reading: Any) -> GivenPath:
    """Return the rows of a path; raise a `LogError` if it is a recording."""
    refuse_recording(path, "a table (CSV) of rows, or a test cube (cube:...)")
    if isinstance(path, (str, Path)) and Path(path).is_file():
        with Path(path).open("rb") as file:
            header = file.readline(HEAD)
        if PATH_ROW.encode() in header:
            found, allowed = "the log of a plan", "the rows that it was made of"
            raise LogError(Finding(file=str(path), found=found, allowed=allowed))
    return given_path(path, options_of(reading))


def _checked(
    velocities: Sequence[float], limit: float | None, error: str, force: Sequence[float] | None
) -> tuple[float, float, float]:
    """Return the force on the tool; raise an `OptionError` with every option that makes no sense."""
    if faults := [*_faults(velocities, limit, error, force)]:
        raise OptionError(*faults)
    x, y, z = (0.0, 0.0, 0.0) if force is None else map(float, force)
    return x, y, z


def _faults(
    velocities: Sequence[float], limit: float | None, error: str, force: Sequence[float] | None
) -> Iterator[Finding]:
    """Yield what is wrong with options."""
    bad = [one for one in velocities if not (isinstance(one, Real) and 0.0 < float(one) < math.inf)]
    if bad or not len(velocities):
        found = ", ".join(map(format_value, bad)) or "none"
        yield Finding(parameter="velocities", found=found, allowed="finite numbers of m/s above 0")
    if limit is not None and not (isinstance(limit, Real) and 0.0 < float(limit) < math.inf):
        yield Finding(parameter="limit", found=format_value(limit), allowed="a finite number of m above 0")
    if error not in DECIDES:
        yield Finding(parameter="error", found=format_value(error), allowed=", ".join(DECIDES))
    if force is not None and not (len(force) == 3 and np.isfinite(np.asarray(force, dtype=float)).all()):
        yield Finding(parameter="force", found=format_value(list(force)), allowed="three finite numbers of N")


def _runs(
    given: GivenPath,
    request: Request,
    force: tuple[float, float, float],
    backend: Backend | None,
    told: Callable[[str], None],
    progress: Callable[[float], None],
    first: float,
) -> tuple[ArmRuns, list[LogWarning]]:
    """Return the runs of the arm, and what a person should know of how they are made."""
    arm = request.arm
    assert arm is not None
    period = (
        np.gcd.reduce([round(one.period * 1e9) for one in arm.drives if isinstance(one, DrivenJoint)]) / 1e9
    )
    along = joints_of(given, request)

    def plan(velocity: float) -> PlannedPath:
        """Return the path at a velocity; raise a `PathError` if the arm cannot move so."""
        timing = replace(request.timing, velocity=velocity, tsp=float(period))
        found = plan_path(given, replace(request, timing=timing), joints=along)
        if found.infeasibilities:
            one = found.infeasibilities[0]
            raise PathError(given.finding(one.row, one.message, "a path that the arm can follow"))
        return found

    joints = plan(first).joints
    assert joints is not None
    chosen, slow = select_backend(backend)
    notes = []
    if chosen == "python":
        said = f"the arm runs in NumPy, {SLOWER} times slower than machine code{f': {slow}' if slow else ''}"
        told(said)
        notes += [LogWarning(ON_PYTHON, said)] if slow else []
    unit = ArmUnit(replace(arm, start=tuple(joints.q[0].tolist())), force)
    return ArmRuns(unit, plan, chosen == "native", told, progress), notes


def _judge(runs: ArmRuns, limit: float, error: str) -> Callable[[Sequence[float]], list[bool]]:
    """Return what runs velocities, and tells of each whether the arm reaches it within a limit."""

    def within(velocities: Sequence[float]) -> list[bool]:
        """Tell of each velocity whether it is within the limit."""
        found = [one.errors for one in runs.run(velocities)]
        judged = [one.error if error == "time" else one.path_error for one in found]
        reached = [one.reached >= REACHED * one.velocity for one in found]
        return [one is not None and one <= limit and ran for one, ran in zip(judged, reached, strict=True)]

    return within


def _accuracy(
    given: GivenPath,
    request: Request,
    runs: ArmRuns,
    motions: Sequence[DrivenMotion],
    speed: float | None,
    limit: float | None,
    error: Decides,
    notes: Sequence[LogWarning],
) -> AccuracyResult:
    """Return the result of runs."""
    arm, timing = runs.arm.robot, request.timing
    longest = max(motions, key=len)
    poses = np.unique(np.linspace(0, len(longest.set_q) - 1, POSES).astype(int))
    radius = max(spectral_radius(arm, longest.set_q[k]) for k in poses)
    every = {one.velocity: one.errors for one in runs.motions.values()}
    options: dict[str, Any] = {**timing.options, "robot": arm.name, "force": list(runs.arm.force)}
    options |= {"velocities": [one.velocity for one in motions], "limit": limit, "error": error}
    return AccuracyResult(
        name=given.name,
        robot=arm,
        rows=given.rows,
        law=timing.law,
        acceleration=timing.acceleration_limit,
        jerk=timing.jerk,
        period=float(np.diff(longest.t_ns[:2])[0]) / 1e9,
        force=runs.arm.force,
        motions=tuple(motions),
        probed=() if limit is None else tuple(one for _, one in sorted(every.items())),
        running=None if speed is None else runs.motions[speed],
        limit=limit,
        limited_error=error,
        loop_radius=radius,
        compiled=runs.compiled,
        warnings=(*given.warnings, *notes, *_warnings(motions, radius, speed)),
        provenance=build_provenance("accuracy", options, [given.file] if given.file else []),
    )


def _warnings(motions: Sequence[DrivenMotion], radius: float, speed: float | None) -> Iterator[LogWarning]:
    """Yield what a person should know: loops that are not stable, velocities that are not reached."""
    if radius >= 1.0:
        said = f"the sampled controllers are not stable about the path: spectral radius {radius:.6g}"
        yield LogWarning("unstable-loop", f"{said}, allowed: below 1")
    slow = [one.errors for one in motions if one.errors.reached < REACHED * one.velocity]
    if slow:
        told = ", ".join(f"{one.velocity:g} m/s ({one.reached:.4g})" for one in slow)
        yield LogWarning("not-reached", f"the path or the joint limits keep the speed below {told}")
    if speed == FASTEST:
        yield LogWarning("fastest", f"all velocities up to {FASTEST:g} m/s are within the limit")
    for one in motions:
        if one.diverged is not None:
            said = f"at {one.velocity:g} m/s {one.diverged.joint} deviates from its set points by more than"
            yield LogWarning("diverged", f"{said} a turn at t = {one.diverged.t:.4g} s: the run ends there")
