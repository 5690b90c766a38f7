"""`urmpipe.ik`: from targets to the joint values that bring an arm's tool to them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

from numpy.typing import ArrayLike

from urmpipe.arm_placing import Frame, Robot
from urmpipe.keyword_checks import PathLike, paths, public_reading, refuse_recording, refuse_warnings
from urmpipe.output_files import output_kind
from urmpipe.reading import Resolved, TableReading, map_files, resolved
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import Finding, OptionError, map_collecting_errors
from urmpipe_models.ik.solutions import DEFAULT_SEARCH, SearchOptions
from urmpipe_models.ik.solve import Method
from urmpipe_models.robots.catalogue import robot_names
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.outputs import check_output, safe_output
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.solved_targets.given_targets import GivenTargets, TargetsLike, given_targets
from urmpipe_pipeline.solved_targets.request import JointValues, Request, refuse_unsolvable, start_of
from urmpipe_pipeline.solved_targets.result import IkResult
from urmpipe_pipeline.solved_targets.solving import solve_targets
from urmpipe_pipeline.sources import ReadOptions
from urmpipe_pipeline.tables.csv_files import write_joint_log

SOLVING = 0.7
"""Share of the work that solving is where something is written, too."""

RESTARTS = DEFAULT_SEARCH.restarts
"""Random starts of the iterative solver for a target that it does not reach from the start."""


@public_reading(TableReading)
def ik(
    targets: TargetsLike,
    robot: Robot | None = None,
    *,
    base: Frame | None = None,
    tool: Frame | None = None,
    base_link: str | None = None,
    tip_link: str | None = None,
    t: ArrayLike | None = None,
    tsp: float | None = None,
    start: JointValues | None = None,
    every: bool = False,
    tolerance: float | None = None,
    within_pi: bool = False,
    method: Method = "auto",
    restarts: int = RESTARTS,
    seed: int = 0,
    strict: bool = False,
    output: PathLike | None = None,
    inputs: Sequence[PathLike] = (),
    progress: Callable[[float], None] | None = None,
    **reading: Unpack[TableReading],
) -> IkResult:
    """Find the joint values that bring an arm's tool to targets, limits kept. See docs/ik.md.

    Targets without times stand for themselves; with times they are a path, followed without a jump where
    the arm can.

    Args:
        targets: A file; positions in [m], shape (n, 3); poses as matrices, shape (n, 4, 4); or `Targets`.
        robot: The arm.
        base: Where the arm stands in the world, in [m] and [rad]; as a matrix of shape (4, 4).
        tool: The tool centre point in the frame of the arm's tip, likewise.
        base_link: Link of a URDF where the arm begins; default: its root.
        tip_link: Link of a URDF where the arm ends; default: its end.
        t: Times of arrays in [s], shape (n,).
        tsp: Time from target to target in [s] where the targets have no times.
        start: Joint values in [rad] or [m], or texts with units, shape (joints,), to be near to;
            default: the robot's own.
        every: Collect all solutions of any arm, and record every branch as a ghost arm.
        tolerance: A target out of reach takes the nearest point within this on each axis, in [m].
        within_pi: Write the joints of a path within -pi to pi, with jumps.
        method: closed or iterative to allow only one; default: closed where there is one.
        restarts: Random starts of the iterative solver.
        seed: Of the random starts: the same seed, the same solutions.
        strict: Whether a warning is an error.
        output: A joint log (.csv) or a recording (.rrd) to write.
        inputs: Files besides the targets that are never replaced.
        progress: Called with the share that is done, 0..1.
        **reading: How to read the file where it does not show it: unit, time, rotation, log_map and the
            others of `urmpipe.TableReading`.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output. A target that is out of
            reach, or none, is no error: it has a reason in the result.

    Source: [Serial6dof2019]_ section 4, [UrmArm2021]_ section 5.
    """
    path = None if output is None else Path(output)
    said = resolved(reading, robot, base, tool, base_link, tip_link)
    parts: tuple[Callable[[], Any], ...] = (
        lambda: _arm_of(said),
        lambda: output_kind(path, "joints"),
        lambda: _given(targets, t, tsp, said.options),
    )
    arm, kind, given = map_collecting_errors(lambda make: make(), parts)
    solving, writing = _parts(progress, path is not None)
    search = SearchOptions(tolerance, restarts, seed)
    request = Request(arm, given, start_of(arm, start), every, within_pi, method, search)
    refuse_unsolvable(request, recorded=kind == "recording")

    kept = [
        *(paths(targets) if isinstance(targets, (str, Path)) else []),
        *map_files(reading),
        *paths(inputs),
    ]
    if path is not None and kind is not None:
        check_output(path, kept, kind)
    result = solve_targets(request, solving)
    refuse_warnings(strict, result.warnings)
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


def _arm_of(said: Resolved) -> Chain:
    """Return the arm; raise an `OptionError` if there is none."""
    if said.arm is None:
        allowed = f"a TOML, a URDF or one of {', '.join(robot_names())}"
        raise OptionError(Finding(parameter="robot", found="none", allowed=allowed))
    return said.arm


def _given(
    targets: TargetsLike, t: ArrayLike | None, tsp: float | None, read: ReadOptions | None
) -> GivenTargets:
    """Return targets with their rows and times; raise a `LogError` if they are a recording."""
    refuse_recording(targets, "a table (CSV) of targets")
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


def _parts(
    progress: Callable[[float], None] | None, writes: bool
) -> tuple[Callable[[float], None] | None, Callable[[float], None] | None]:
    """Return the progress functions of solving and of writing; None where no progress is reported."""
    if progress is None:
        return None, None
    share = SOLVING if writes else 1.0
    return lambda done: progress(share * done), lambda done: progress(share + (1.0 - share) * done)
