"""`urmpipe.ik`: from targets to the joint values that bring an arm's tool to them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from urmpipe.guards import PathLike, Robot, place_robot, refuse_warnings
from urmpipe.inverse_blocks import solve_in_blocks
from urmpipe.inverse_output import Written, output_kind, run_of_solutions, write_joints
from urmpipe.inverse_result import IndexArray, InverseResult, missed_by
from urmpipe.inverse_targets import GivenTargets, TargetsLike, given_targets
from urmpipe.inverse_wording import far_warnings, shortfall_warnings, singular_warnings
from urmpipe_models.catalogue import robot_names
from urmpipe_models.chain import Chain
from urmpipe_models.errors import OptionError, for_each
from urmpipe_models.inverse.closed_form import ClosedForm, closed_form, exact_form
from urmpipe_models.inverse.joint_path import JointPath
from urmpipe_models.inverse.limits import periods
from urmpipe_models.inverse.path import follow
from urmpipe_models.inverse.solutions import BoolArray, FloatArray, Singular, Solutions, TextArray
from urmpipe_models.inverse.solve import Method, solve
from urmpipe_models.inverse.targets import Targets
from urmpipe_models.transform import Transform
from urmpipe_pipeline.joint_log import IntArray, LogWarning
from urmpipe_pipeline.outputs import refuse_output
from urmpipe_pipeline.recording import write_recording
from urmpipe_pipeline.sources import ReadOptions

KEPT = "a direction of motion is lost there", "a joint that is free stays where it was"
"""What is infinite at a singular pose along a path, and what is chosen there."""

SOLVING = 0.7
"""Share of the work that solving is where something is written, too."""

RESTARTS = 20
"""Random starts of the iterative solver for a target that it does not reach from the start."""


def ik(
    targets: TargetsLike,
    robot: Robot | None = None,
    *,
    base: Transform | None = None,
    tool: Transform | None = None,
    t: ArrayLike | None = None,
    tsp: float | None = None,
    read: ReadOptions | None = None,
    start: Sequence[float] | None = None,
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
    """Find the joint values that bring the tool centre point of an arm to targets, limits of the joints kept.

    Targets without times stand for themselves: of each the solution nearest to the start is chosen. Targets
    with times are a path: the solutions follow each other without a jump where the arm can.

    An arm with a spherical wrist or with three parallel axes has a closed form, by which the result holds
    all solutions of a pose; any other arm, and positions with any orientation, are solved iteratively.

    Args:
        targets: A file (x, y, z, and an orientation in any form that a log may have; with a time a path);
            positions in [m], shape (n, 3); poses as matrices, shape (n, 4, 4); or `Targets`.
        robot: Name, file (TOML, URDF) or chain of the arm.
        base: Where the arm stands in the world.
        tool: The tool centre point in the frame of the arm's tip.
        t: Times of arrays in [s], shape (n,): they are a path then.
        tsp: Time from target to target in [s] where none is told: they are a path then.
        read: How to read the file where it cannot tell by itself.
        start: Joint values in [rad] or [m] that solutions are to be near to; default: the robot's own.
        every: Collect all solutions of an arm without closed form by restarts, too; show all of them, and
            record every branch as a ghost arm.
        tolerance: A target out of reach takes the nearest point within this on each axis, in [m].
        within_pi: Write the joints of a path within -pi to pi, with jumps, as CoppeliaSim does.
        method: closed or iterative to allow only one; default: closed where there is one.
        restarts: Random starts of the iterative solver for a target that it does not reach from the start.
        seed: Of the random starts: the same seed, the same solutions.
        strict: Whether a warning is an error.
        output: A joint log (.csv) or a recording (.rrd) to write.
        inputs: Files besides the targets that are never replaced.
        progress: Told the share that is done, 0..1.

    Returns:
        The solutions: `q`, `branch`, `reasons`, `to_frame()`, `to_dict()`.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output. A target that is none, or
            out of reach, is no error: it has a reason in the result.

    Source: [Serial6dof2019]_ section 4, [UrmArm2021]_ section 5.
    """
    path = None if output is None else Path(output)
    parts: tuple[Callable[[], Any], ...] = (
        lambda: _arm(robot, base, tool),
        lambda: output_kind(path),
        lambda: given_targets(targets, t, tsp, read),
    )
    arm, kind, given = for_each(lambda make: make(), parts)
    solving, writing = _parts(progress, path is not None)
    asked = _Asked(
        arm, given, _start(arm, start), every, tolerance, within_pi, method, restarts, seed, solving
    )
    _refuse_what_no_path_has(asked, kind)

    kept = [Path(one) for one in (*([targets] if isinstance(targets, (str, Path)) else []), *inputs)]
    if path is not None and kind is not None:
        refuse_output(path, kept, kind)
    result = _of_targets(asked) if given.t_ns is None else _of_path(asked, given.t_ns)
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


@dataclass(frozen=True, slots=True, eq=False)
class _Asked:
    """What is to be solved, and how."""

    arm: Chain
    given: GivenTargets
    start: FloatArray | None
    every: bool
    tolerance: float | None
    within_pi: bool
    method: Method
    restarts: int
    seed: int
    progress: Callable[[float], None] | None

    @property
    def form(self) -> ClosedForm | None:
        """The closed form by which the targets are solved, if they are."""
        if self.given.targets.rotation is None or self.method == "iterative":
            return None
        return closed_form(self.arm) if self.given.t_ns is None else exact_form(self.arm)

    @property
    def begin(self) -> FloatArray:
        """Joint values that solutions are to be near to, shape (joints,)."""
        return np.array(self.arm.start, dtype=float) if self.start is None else self.start

    @property
    def options(self) -> dict[str, Any]:
        """The options as a recording keeps them."""
        names = ("every", "tolerance", "within_pi", "method", "restarts", "seed")
        options = {name: getattr(self, name) for name in names}
        return options | ({} if self.start is None else {"start": self.start.tolist()})

    def solutions(self, *, every: bool) -> Solutions:
        """Return the solutions of the targets, each for itself."""

        def found(targets: Targets) -> Solutions:
            """Return the solutions of some of them."""
            return solve(
                self.arm, targets, start=self.start, every=every, tolerance=self.tolerance,
                restarts=self.restarts, seed=self.seed, method=self.method,
            )  # fmt: skip

        return solve_in_blocks(found, self.given.targets, self.progress)


def _of_targets(asked: _Asked) -> InverseResult:
    """Return the solutions of targets that stand for themselves: all that a closed form has."""
    period = periods(asked.arm)
    solutions = asked.solutions(every=asked.every or asked.form is not None)
    chosen = solutions.nearest_column(asked.begin, period)
    if asked.within_pi:
        solutions = replace(solutions, q=_within_pi(solutions.q, period))
    listed = solutions.reached.copy()
    if not asked.every:
        listed &= np.arange(listed.shape[1]) == chosen[:, None]
    return _result(asked, solutions, chosen, listed, None)


def _of_path(asked: _Asked, t_ns: IntArray) -> InverseResult:
    """Return the solutions of a path, which follow each other."""
    path = follow(
        asked.arm, asked.given.targets, t_ns, start=asked.start, within_pi=asked.within_pi,
        tolerance=asked.tolerance, restarts=asked.restarts, seed=asked.seed,
    )  # fmt: skip
    solutions = Solutions(
        path.q[:, None], ("path",), path.reasons[:, None], tuple(_families(path)), path.shortfall[:, None],
        path.branch[:, None],
    )  # fmt: skip
    chosen = np.zeros(len(asked.given.row), dtype=np.intp)
    return _result(asked, solutions, chosen, solutions.reached, path)


def _families(path: JointPath) -> Iterator[Singular]:
    """Yield the families of singular poses along a path, with all stretches of one together."""
    for family in dict.fromkeys(one.family for one in path.singular):
        where = np.zeros((len(path), 1), dtype=bool)
        for one in path.singular:
            where[one.first : one.last + 1] |= one.family == family
        yield Singular(family, where, KEPT[0], KEPT[1])


def _result(
    asked: _Asked, solutions: Solutions, chosen: IndexArray, listed: BoolArray, path: JointPath | None
) -> InverseResult:
    """Return solutions with what they miss their targets by, and with what a person should know.

    Args:
        asked: What was solved.
        solutions: What was found.
        chosen: The column nearest to the start, shape (n,).
        listed: True of the solutions that a person is shown, shape (n, k).
        path: How they follow each other.
    """
    given, form = asked.given, asked.form
    solutions = replace(solutions, reasons=_with_faults(solutions.reasons, given.faults))
    miss, angle = missed_by(asked.arm, solutions, given.targets)
    reached = np.asarray(solutions.reached.any(axis=1))
    warnings = (
        *given.warnings,
        *singular_warnings(solutions, given.row, listed),
        *shortfall_warnings(solutions, given.row),
        *_far(asked, reached),
    )
    return InverseResult(
        name=given.name, robot=asked.arm, method="iterative" if form is None else form.name, row=given.row,
        t_ns=given.t_ns, targets=given.targets, solutions=solutions, chosen=chosen, miss=miss, angle=angle,
        path=path, warnings=warnings,
    )  # fmt: skip


def _far(asked: _Asked, reached: BoolArray) -> Iterator[LogWarning]:
    """Yield a warning of targets that may be in mm, unless their file has one already."""
    given = asked.given
    if not any(warning.kind == "assumed-unit" for warning in given.warnings):
        yield from far_warnings(asked.arm, given.targets, given.row, reached)


def _with_faults(reasons: TextArray, faults: Sequence[str]) -> TextArray:
    """Return the reasons of targets, those of rows that hold none by what is wrong with the row."""
    fault = np.array(faults, dtype=np.object_)[:, None]
    return np.asarray(np.where(fault != "", fault, reasons))


def _within_pi(q: FloatArray, period: FloatArray) -> FloatArray:
    """Return joint values with those that turn without end in -pi to pi."""
    turns = np.isfinite(period)
    values = q.copy()
    values[..., turns] -= period[turns] * np.round(values[..., turns] / period[turns])
    return values


def _branches(asked: _Asked, result: InverseResult) -> Solutions | None:
    """Return the solutions that a recording shows as ghosts; None if not all are asked for."""
    if not asked.every:
        return None
    return result.solutions if result.path is None else asked.solutions(every=True)


def _refuse_what_no_path_has(asked: _Asked, kind: Written | None) -> None:
    """Raise an `OptionError` with all that is asked of a path and is not there."""
    if asked.given.t_ns is None:
        return
    faults = []
    lacks = "positions only" if asked.given.targets.rotation is None else "no closed form"
    if asked.method == "iterative":
        faults.append(
            "--method: found iterative with a path, allowed: auto; a path takes the closed form of the arm"
            " if it has one"
        )
    if asked.method == "closed" and asked.form is None:
        faults.append(
            f"--method: found closed with a path of {asked.arm.name} that has {lacks}, allowed: auto"
        )
    if asked.every and asked.form is None:
        faults.append(
            f"--all: found with a path of {asked.arm.name} that has {lacks}, allowed: with poses and an arm"
            " that has a closed form, whose branches run along the path; or with targets without times"
        )
    elif asked.every and kind != "recording":
        faults.append(
            "--all: found with a path and no recording, allowed: with -o RUN.rrd, where every branch is a"
            " ghost arm; or with targets without times"
        )
    if faults:
        raise OptionError(*faults)


def _start(arm: Chain, start: Sequence[float] | None) -> FloatArray | None:
    """Return the start as an array.

    Raises:
        OptionError: If it has not one value for each joint.
    """
    if start is None:
        return None
    values = np.asarray(start, dtype=float)
    if values.shape != (len(arm.coordinates),):
        allowed = f"{len(arm.coordinates)}, one for each of {', '.join(arm.coordinates)}"
        raise OptionError(f"--start: found {values.size} values, allowed: {allowed}")
    return values


def _arm(robot: Robot | None, base: Transform | None, tool: Transform | None) -> Chain:
    """Return the arm on its base and with its tool.

    Raises:
        OptionError: If there is none.
    """
    arm = place_robot(robot, base, tool)
    if arm is None:
        names = ", ".join(robot_names())
        raise OptionError(f"found no robot; allowed: --robot NAME|FILE, a TOML, a URDF or one of {names}")
    return arm
