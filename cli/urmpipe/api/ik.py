"""`urmpipe.ik`: from targets to the joint values that bring an arm's tool to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

from numpy.typing import ArrayLike

from urmpipe.arm_placing import Robot
from urmpipe.output_files import output_kind
from urmpipe.parameters import kinds
from urmpipe.parameters.motions import Ik
from urmpipe.public_functions import as_paths, public_function, raise_warnings, reject_recording
from urmpipe.reading import ResolvedReading, map_files, resolve_reading
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import Finding, OptionError, map_collecting_errors
from urmpipe_models.ik.solutions import SearchOptions
from urmpipe_models.robots.catalogue import robot_names
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.outputs import check_output, safe_output
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.solved_targets.given_targets import GivenTargets, TargetsLike, given_targets
from urmpipe_pipeline.solved_targets.request import Request, check_request, start_of
from urmpipe_pipeline.solved_targets.result import IkResult
from urmpipe_pipeline.solved_targets.solving import solve_targets
from urmpipe_pipeline.tables.csv_files import write_joint_log

SOLVING_SHARE = 0.7  # of the work, where an output is written, too


@public_function(Ik, targets=kinds.TARGETS, robot=kinds.ROBOT)
def ik(
    targets: TargetsLike,
    robot: Robot | None = None,
    *,
    t: ArrayLike | None = None,
    **options: Unpack[Ik],
) -> IkResult:
    """Find the joint values that bring an arm's tool to targets, limits kept. See docs/ik.md.

    Targets without times stand for themselves; with times they are a path, followed without a jump where
    the arm can.

    Args:
        targets: A file; positions in [m], shape (n, 3); poses as matrices, shape (n, 4, 4); or `Targets`.
        robot: The arm.
        t: Times of arrays in [s], shape (n,).
        **options: How solutions are searched for, how the file is read, what is written: the options of
            `urmpipe ik`, by their names.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output. A target that is out of
            reach, or none, is no error: it has a reason in the result.

    Source: [Serial6dof2019]_ section 4, [UrmArm2021]_ section 5.
    """
    values: Mapping[str, Any] = options  # as their kinds read them
    path = values["output"]
    resolved = resolve_reading(values, robot)
    parts: tuple[Callable[[], Any], ...] = (
        lambda: _require_arm(resolved),
        lambda: output_kind(path, "joints"),
        lambda: _read_targets(targets, t, values["tsp"], resolved.options),
    )
    arm, kind, rows = map_collecting_errors(lambda part: part(), parts)
    solving, writing = _split_progress(values["progress"], path is not None)
    search = SearchOptions(*(values[name] for name in ("tolerance", "restarts", "seed")))
    start = start_of(arm, values["start"])
    request = Request(arm, rows, start, values["every"], values["within_pi"], values["method"], search)
    check_request(request, recorded=kind == "recording")

    files = as_paths(targets) if isinstance(targets, (str, Path)) else []
    kept = [*files, *map_files(values), *values["inputs"]]
    if path is not None and kind is not None:
        check_output(path, kept, kind)
    result = solve_targets(request, solving)
    raise_warnings(values["strict"], result.warnings)
    if path is None:
        return result
    if not result.reached.any():
        unwritten = LogWarning("not-written", f"{path} is not written: no target was reached")
        return replace(result, warnings=(*result.warnings, unwritten))
    if kind == "joints":
        _write_joints(result, path, kept)
        return replace(result, joint_log=path)
    result = replace(result, motion=None if result.t_ns is None else result.as_run())
    write_recording(result, path, kept, writing)
    return replace(result, recording=path)


def _require_arm(resolved: ResolvedReading) -> Chain:
    """Return the arm; raise an `OptionError` if there is none."""
    if resolved.arm is None:
        allowed = f"a TOML, a URDF or one of {', '.join(robot_names())}"
        raise OptionError(Finding(parameter="robot", found="none", allowed=allowed))
    return resolved.arm


def _read_targets(
    targets: TargetsLike, t: ArrayLike | None, tsp: float | None, read: LogMap | None
) -> GivenTargets:
    """Return targets with their rows and times; raise a `LogError` if they are a recording."""
    reject_recording(targets, "a table (CSV) of targets")
    return given_targets(targets, t, tsp, read)


def _write_joints(result: IkResult, path: Path, kept: Sequence[Path]) -> None:
    """Write the solutions nearest to the start as a joint log; rows that have none are left out.

    Raises:
        OutputError: If it may not be written there, or did not read back as it was written.
    """
    with safe_output(path, kept, "joints") as part:
        write_joint_log(
            part, path, joints=result.robot.coordinates, units=result.joint_units, q=result.q, row=result.row,
            t_ns=result.clock_ns,
        )  # fmt: skip


def _split_progress(
    progress: Callable[[float], None] | None, writes: bool
) -> tuple[Callable[[float], None] | None, Callable[[float], None] | None]:
    """Return the progress functions of solving and of writing; None where no progress is reported."""
    if progress is None:
        return None, None
    share = SOLVING_SHARE if writes else 1.0
    return lambda done: progress(share * done), lambda done: progress(share + (1.0 - share) * done)
