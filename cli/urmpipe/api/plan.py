"""`urmpipe.plan`: from rows of points to a path, the law of its time, and the joints that follow it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from urmpipe.arm_placing import NO_ROBOT, Frame, Robot
from urmpipe.keyword_checks import PathLike, paths, public_reading, refuse_recording, refuse_warnings
from urmpipe.output_files import output_kind
from urmpipe.reading import UntimedReading, map_files, options_of, resolved
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, OptionError, map_collecting_errors
from urmpipe_models.planning.laws import Arcs
from urmpipe_models.planning.path import PathRows
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.outputs import PATH_ROW, check_output, safe_output
from urmpipe_pipeline.planned_paths.given_path import given_path
from urmpipe_pipeline.planned_paths.path_file import GivenPath
from urmpipe_pipeline.planned_paths.planning import plan_path
from urmpipe_pipeline.planned_paths.request import (
    PERIOD,
    Law,
    Request,
    Timing,
    checked_timing,
    refuse_unlimited,
)
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.solved_targets.request import JointValues, start_of
from urmpipe_pipeline.tables.csv_files import write_joint_log

PLANNING = 0.8
"""Share of the work that planning is where something is written, too."""


@public_reading(UntimedReading)
def plan(
    path: PathLike | PathRows,
    robot: Robot | None = None,
    *,
    base: Frame | None = None,
    tool: Frame | None = None,
    base_link: str | None = None,
    tip_link: str | None = None,
    velocity: float | None = None,
    acceleration: float | None = None,
    law: Law = "trapezoid",
    jerk: float | None = None,
    arcs: Arcs = "tangential",
    tsp: float = PERIOD,
    start: JointValues | None = None,
    strict: bool = False,
    output: PathLike | None = None,
    inputs: Sequence[PathLike] = (),
    progress: Callable[[float], None] | None = None,
    **reading: Unpack[UntimedReading],
) -> PlannedPath:
    """Plan a path of lines and arcs, its time, and the joints of an arm along it. See docs/plan.md.

    Args:
        path: A file of rows x, y, z, r; a test cube, such as "cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1"; or rows.
        robot: The arm; default: path and time alone.
        base: Where the arm stands in the world, in [m] and [rad]; as a matrix of shape (4, 4).
        tool: The tool centre point in the frame of the arm's tip, likewise.
        base_link: Link of a URDF where the arm begins; default: its root.
        tip_link: Link of a URDF where the arm ends; default: its end.
        velocity: The largest speed along the path in [m/s]; default: 0.5, with the law limits none.
        acceleration: The largest acceleration in [m/s2]; default: 6, with the law limits none.
        law: trapezoid: within speed and acceleration; jerk: within a jerk, too; limits: in the least time
            within the rates and accelerations of the joints.
        jerk: The largest jerk of the law jerk in [m/s3].
        arcs: What the acceleration limits on arcs; tangential: that along the path; total: v^2 / r, too.
        tsp: Time from sample to sample in [s].
        start: Joint values in [rad] or [m], or texts with units, shape (joints,), to be near to at
            the first sample; default: the robot's own.
        strict: Whether a warning is an error.
        output: A log (.csv) or a recording (.rrd) to write.
        inputs: Files besides the path that are never replaced.
        progress: Called with the share that is done, 0..1.
        **reading: How to read the file where it does not show it: log_map, rotation, delimiter, decimal and
            unit, as of a table of targets. A path has no time.

    Returns:
        The plan, a row a sample: `t` in [s], shape (n,), `motion` (arc length `s` in [m] and its derivatives
        `v`, `a`, `j`, each of shape (n,)), `position` in [m], shape (n, 3), `joints` (`q` in [rad] or
        [m], `qd` in [rad/s] or [m/s], `qdd` in [rad/s2] or [m/s2], each of shape (n, joints); None without a
        robot). Of the whole: `duration` in [s], `scaled` (the share of the speed that is left), `obstacles`
        (what is in the arm's way), `verdict` ("pass", or "fail" with obstacles; None without a robot),
        `warnings`, `to_frame()`.

    Raises:
        UrmpipeError: With everything that is wrong with the path, the arm or an option. A row out of reach is
            an error; what keeps the arm from moving between the rows stands in the result (`obstacles`).

    Source: [Iso9283]_ section 2, section 4 steps 1 to 19.
    """
    written = None if output is None else Path(output)
    timing = Timing(law, velocity, acceleration, jerk, arcs, tsp)
    parts: tuple[Callable[[], Any], ...] = (
        lambda: _request(resolved(reading, robot, base, tool, base_link, tip_link).arm, start, timing),
        lambda: _given(path, reading),
        lambda: checked_timing(timing),
        lambda: output_kind(written, "plan"),
    )
    request, given, _, kind = map_collecting_errors(lambda make: make(), parts)
    kept = [*([] if given.file is None else paths(str(path))), *map_files(reading), *paths(inputs)]
    if written is not None:
        check_output(written, kept, kind)
    share = PLANNING if written else 1.0
    planning = None if progress is None else lambda done: progress(share * done)
    result = plan_path(given, request, planning)
    refuse_warnings(strict, result.warnings)
    if written is None:
        return result
    if kind == "recording":
        writing = None if progress is None else lambda done: progress(share + (1.0 - share) * done)
        write_recording(result, written, kept, writing)
        return replace(result, recording=written)
    if result.infeasibilities:
        said = f"{written} is not written: the arm cannot follow the plan"
        return replace(result, warnings=(*result.warnings, LogWarning("not-written", said)))
    _write_log(result, written, kept)
    return replace(result, log=written)


def _request(arm: Chain | None, start: JointValues | None, timing: Timing) -> Request:
    """Return the request; raise an `OptionError` if the arm suits neither the start nor the law."""
    parts: tuple[Callable[[], Any], ...] = (
        lambda: _start(arm, start),
        lambda: refuse_unlimited(timing, arm),
    )
    begin, _ = map_collecting_errors(lambda make: make(), parts)
    return Request(arm, begin, timing)


def _start(arm: Chain | None, start: JointValues | None) -> FloatArray | None:
    """Return joint values to start at, shape (joints,); raise an `OptionError` if there is no arm."""
    if arm is not None:
        return start_of(arm, start)
    if start is not None:
        raise OptionError(Finding("found without a robot", parameter="start", hints=NO_ROBOT))
    return None


def _given(path: PathLike | PathRows, reading: Mapping[str, Any]) -> GivenPath:
    """Return the rows of a path; raise a `LogError` if it is a recording."""
    refuse_recording(path, "a table (CSV) of rows, or a test cube (cube:...)")
    return given_path(path, options_of(reading))


def _write_log(result: PlannedPath, path: Path, kept: Sequence[Path]) -> None:
    """Write a plan as a log: times, joints, and the path as the recorded tool centre point."""
    joints = result.joints
    with safe_output(path, kept, "plan") as part:
        write_joint_log(
            part, path, joints=result.robot.coordinates if result.robot else (), units=result.joint_units,
            q=np.empty((len(result), 0)) if joints is None else joints.q, row=result.row, t_ns=result.t_ns,
            position=result.position, quat_xyzw=result.quat_xyzw, row_column=PATH_ROW,
        )  # fmt: skip
