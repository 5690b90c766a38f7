"""`urmpipe.plan`: from rows of points to a path, the law of its time, and the joints that follow it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from urmpipe.arm_placing import NO_ROBOT, Robot
from urmpipe.output_files import output_kind
from urmpipe.parameters import kinds
from urmpipe.parameters.motions import Plan
from urmpipe.public_functions import PathLike, as_paths, public_function, raise_warnings, reject_recording
from urmpipe.reading import map_files, resolve_reading, to_log_map
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, OptionError, map_collecting_errors
from urmpipe_models.planning.path import PathRows
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.outputs import PATH_ROW, check_output, safe_output
from urmpipe_pipeline.planned_paths.given_path import given_path
from urmpipe_pipeline.planned_paths.path_file import GivenPath
from urmpipe_pipeline.planned_paths.planning import plan_path
from urmpipe_pipeline.planned_paths.request import (
    Request,
    Timing,
    checked_timing,
    require_limits,
)
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.solved_targets.request import JointValues, start_of
from urmpipe_pipeline.tables.csv_files import write_joint_log

PLANNING_SHARE = 0.8  # of the work, where an output is written, too


@public_function(Plan, path=kinds.PLANNED, robot=kinds.ROBOT)
def plan(path: PathLike | PathRows, robot: Robot | None = None, **options: Unpack[Plan]) -> PlannedPath:
    """Plan a path of lines and arcs, its time, and the joints of an arm along it. See docs/plan.md.

    Args:
        path: A file of rows x, y, z, r; a test cube, such as "cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1"; or rows.
        robot: The arm; default: only path and time are planned.
        **options: The law of time, how the file is read, where the arm is placed, what is written: the
            options of `urmpipe plan`, by their names. Texts have units (`velocity="250mm/s"`), numbers are in
            SI.

    Returns:
        The plan, one row per sample: `t` in [s], shape (n,), `motion` (arc length `s` in [m] and its
        derivatives `v`, `a`, `j`, each of shape (n,)), `position` in [m], shape (n, 3), `joints` (`q` in
        [rad] or [m], `qd` in [rad/s] or [m/s], `qdd` in [rad/s2] or [m/s2], each of shape (n, joints); None
        without a robot). Of the whole: `duration` in [s], `scaled` (the share of the speed that is left),
        `obstacles` (what is in the arm's way), `verdict` ("pass", or "fail" with obstacles; None without a
        robot), `warnings`, `to_frame()`.

    Raises:
        UrmpipeError: With everything that is wrong with the path, the arm or an option. A row out of reach is
            an error; what keeps the arm from moving between the rows is in the result (`obstacles`).

    Source: [Iso9283]_ section 2, section 4 steps 1 to 19.
    """
    values: Mapping[str, Any] = options  # as their kinds read them
    output, progress = values["output"], values["progress"]
    timing = Timing(*(values[name] for name in ("law", "velocity", "acceleration", "jerk", "arcs", "tsp")))
    parts: tuple[Callable[[], Any], ...] = (
        lambda: _request(resolve_reading(values, robot).arm, values["start"], timing),
        lambda: _read_rows(path, values),
        lambda: checked_timing(timing),
        lambda: output_kind(output, "plan"),
    )
    request, rows, _, kind = map_collecting_errors(lambda part: part(), parts)
    kept = [*([] if rows.file is None else as_paths(str(path))), *map_files(values), *values["inputs"]]
    if output is not None:
        check_output(output, kept, kind)
    share = PLANNING_SHARE if output else 1.0
    planning = None if progress is None else lambda done: progress(share * done)
    result = plan_path(rows, request, planning)
    raise_warnings(values["strict"], result.warnings)
    if output is None:
        return result
    if kind == "recording":
        writing = None if progress is None else lambda done: progress(share + (1.0 - share) * done)
        write_recording(result, output, kept, writing)
        return replace(result, recording=output)
    if result.infeasibilities:
        unwritten = LogWarning("not-written", f"{output} is not written: the arm cannot follow the plan")
        return replace(result, warnings=(*result.warnings, unwritten))
    _write_log(result, output, kept)
    return replace(result, log=output)


def _request(arm: Chain | None, start: JointValues | None, timing: Timing) -> Request:
    """Return the request; raise an `OptionError` if the arm suits neither the start nor the law."""
    parts: tuple[Callable[[], Any], ...] = (
        lambda: _start(arm, start),
        lambda: require_limits(timing, arm),
    )
    start_values, _ = map_collecting_errors(lambda part: part(), parts)
    return Request(arm, start_values, timing)


def _start(arm: Chain | None, start: JointValues | None) -> FloatArray | None:
    """Return joint values to start at, shape (joints,); raise an `OptionError` if there is no arm."""
    if arm is not None:
        return start_of(arm, start)
    if start is not None:
        raise OptionError(Finding("found without a robot", parameter="start", hints=NO_ROBOT))
    return None


def _read_rows(path: PathLike | PathRows, options: Mapping[str, Any]) -> GivenPath:
    """Return the rows of a path; raise a `LogError` if it is a recording."""
    reject_recording(path, "a table (CSV) of rows, or a test cube (cube:...)")
    return given_path(path, to_log_map(options))


def _write_log(result: PlannedPath, path: Path, kept: Sequence[Path]) -> None:
    """Write a plan as a log: times, joints, and the path as the recorded tool centre point."""
    joints = result.joints
    with safe_output(path, kept, "plan") as part:
        write_joint_log(
            part, path, joints=result.robot.coordinates if result.robot else (), units=result.joint_units,
            q=np.empty((len(result), 0)) if joints is None else joints.q, row=result.row, t_ns=result.t_ns,
            position=result.position, quat_xyzw=result.quat_xyzw, row_column=PATH_ROW,
        )  # fmt: skip
