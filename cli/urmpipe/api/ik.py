"""`urmpipe.ik`: from targets to the joint values that bring an arm's tool to them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from urmpipe.edge import public
from urmpipe.guards import Frame, PathLike, Robot, paths, refuse_warnings
from urmpipe.inverse.asked import Asked, arm_of, refuse_unsolvable, start_of
from urmpipe.inverse.output import output_kind, run_of_solutions, write_joints
from urmpipe.inverse.result import InverseResult
from urmpipe.inverse.solving import solutions_of, solved
from urmpipe.inverse.targets import TargetsLike, given_targets
from urmpipe_models.arrays import FloatArray
from urmpipe_models.errors import for_each
from urmpipe_models.inverse.search import USUAL_SEARCH, Search
from urmpipe_models.inverse.solutions import Solutions
from urmpipe_models.inverse.solve import Method
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.outputs import refuse_output
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.sources import ReadOptions

SOLVING = 0.7
"""Share of the work that solving is where something is written, too."""

RESTARTS = USUAL_SEARCH.restarts
"""Random starts of the iterative solver for a target that it does not reach from the start."""


@public
def ik(
    targets: TargetsLike,
    robot: Robot | None = None,
    *,
    base: Frame | None = None,
    tool: Frame | None = None,
    read: ReadOptions | None = None,
    t: ArrayLike | None = None,
    tsp: float | None = None,
    start: Sequence[float] | FloatArray | None = None,
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
) -> InverseResult:
    """Find the joint values that bring an arm's tool to targets, limits kept. docs/ik.md tells how.

    Targets without times stand for themselves; with times they are a path, followed without a jump where
    the arm can.

    Args:
        targets: A file; positions in [m], shape (n, 3); poses as matrices, shape (n, 4, 4); or `Targets`.
        robot: The arm.
        base: Where the arm stands in the world, in [m] and [rad]; as a matrix of shape (4, 4).
        tool: The tool centre point in the frame of the arm's tip, likewise.
        read: How to read the file where it cannot tell by itself.
        t: Times of arrays in [s], shape (n,).
        tsp: Time from target to target in [s] where none is told.
        start: Joint values in [rad] or [m] to be near to, shape (joints,); default: the robot's own.
        every: Collect all solutions of any arm, and record every branch as a ghost arm.
        tolerance: A target out of reach takes the nearest point within this on each axis, in [m].
        within_pi: Write the joints of a path within -pi to pi, with jumps.
        method: closed or iterative to allow only one; default: closed where there is one.
        restarts: Random starts of the iterative solver.
        seed: Of the random starts: the same seed, the same solutions.
        strict: Whether a warning is an error.
        output: A joint log (.csv) or a recording (.rrd) to write.
        inputs: Files besides the targets that are never replaced.
        progress: Told the share that is done, 0..1.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output. A target that is out of
            reach, or none, is no error: it has a reason in the result.

    Source: [Serial6dof2019]_ section 4, [UrmArm2021]_ section 5.
    """
    path = None if output is None else Path(output)
    parts: tuple[Callable[[], Any], ...] = (
        lambda: arm_of(robot, base, tool),
        lambda: output_kind(path),
        lambda: given_targets(targets, t, tsp, read),
    )
    arm, kind, given = for_each(lambda make: make(), parts)
    solving, writing = _parts(progress, path is not None)
    search = Search(tolerance, restarts, seed)
    asked = Asked(arm, given, start_of(arm, start), every, within_pi, method, search, solving)
    refuse_unsolvable(asked, kind)

    kept = [*(paths(targets) if isinstance(targets, (str, Path)) else []), *paths(inputs)]
    if path is not None and kind is not None:
        refuse_output(path, kept, kind)
    result = solved(asked)
    refuse_warnings(strict, result.warnings)
    if path is None:
        return result
    if not result.reached.any():
        unwritten = LogWarning("not-written", f"{path} is not written: no target was reached")
        return replace(result, warnings=(*result.warnings, unwritten))
    if kind == "joints":
        write_joints(result, path, kept)
    else:
        run = run_of_solutions(result, _branches(asked, result), given.file, asked.options)
        write_recording(run, path, kept, writing)
    return replace(result, output=path)


def _parts(
    progress: Callable[[float], None] | None, writes: bool
) -> tuple[Callable[[float], None] | None, Callable[[float], None] | None]:
    """Return what to tell the progress of solving and of writing; None where nobody is told."""
    if progress is None:
        return None, None
    share = SOLVING if writes else 1.0
    return lambda done: progress(share * done), lambda done: progress(share + (1.0 - share) * done)


def _branches(asked: Asked, result: InverseResult) -> Solutions | None:
    """Return the solutions that a recording shows as ghosts; None if not all are asked for."""
    if not asked.every:
        return None
    return result.solutions if result.path is None else solutions_of(asked, every=True)
