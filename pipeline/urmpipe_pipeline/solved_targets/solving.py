"""From a request to `SolvedTargets`: targets that stand for themselves, or a path of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.elementwise import BoolArray, IndexArray, IntArray, TextArray
from urmpipe_models.ik.limits import joint_periods, wrap_continuous_joints
from urmpipe_models.ik.path import JointPath, solve_path
from urmpipe_models.ik.solutions import SingularPoses, Solutions, Targets, concatenate_solutions
from urmpipe_models.ik.solve import solve
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.provenance import build_provenance
from urmpipe_pipeline.solved_targets.request import Request
from urmpipe_pipeline.solved_targets.result import IkResult, missed_by
from urmpipe_pipeline.solved_targets.solution_warnings import (
    far_warnings,
    near_singular_warnings,
    shortfall_warnings,
    singular_warnings,
    start_warnings,
    within_pi_warnings,
)

KEPT = "a direction of motion is lost there", "a joint that is free stays where it was"
"""What is infinite at a singular pose along a path, and what is chosen there."""

BLOCK = 512
"""Targets of a block: enough to be solved together fast, few enough to report progress."""

Progress = Callable[[float], None] | None
"""Called with the share that is done, 0..1."""


def solve_targets(request: Request, progress: Progress = None) -> IkResult:
    """Return the solutions of targets, each for itself or along a path, with all that a person should know.

    Args:
        request: What is to be solved; `check_request` has checked it.
        progress: Called with the share of solving that is done, 0..1.
    """
    t_ns = request.given.t_ns
    return _of_targets(request, progress) if t_ns is None else _of_path(request, t_ns, progress)


def _solutions(request: Request, *, every: bool, progress: Progress) -> Solutions:
    """Return the solutions of the targets, each for itself: all that there are, or the one nearest.

    What is found for a target does not depend on the others: in blocks it is the same.
    """

    def found(targets: Targets) -> Solutions:
        """Return the solutions of some of them."""
        return solve(
            request.arm, targets, start=request.start, every=every, method=request.method,
            search=request.search,
        )  # fmt: skip

    targets = request.given.targets
    if progress is None or len(targets) <= BLOCK:
        return found(targets)
    blocks = []
    for first in range(0, len(targets), BLOCK):
        blocks.append(found(targets.rows(slice(first, first + BLOCK))))
        progress(min(1.0, (first + BLOCK) / len(targets)))
    return concatenate_solutions(blocks)


def _of_targets(request: Request, progress: Progress) -> IkResult:
    """Return the solutions of targets that stand for themselves: all that a closed form has."""
    period = joint_periods(request.arm)
    every = request.every or request.form is not None
    solutions = _solutions(request, every=every, progress=progress)
    chosen = solutions.nearest_column(request.begin, period)
    if request.within_pi:
        solutions = replace(solutions, q=wrap_continuous_joints(solutions.q, period))
    listed = solutions.reached.copy()
    if not request.every:
        listed &= np.arange(listed.shape[1]) == chosen[:, None]
    return _result(request, solutions, chosen, listed)


def _of_path(request: Request, t_ns: IntArray, progress: Progress) -> IkResult:
    """Return the solutions of a path, which follow each other, and beside them its branches if requested."""
    path = solve_path(
        request.arm, request.given.targets, t_ns, start=request.start, within_pi=request.within_pi,
        search=request.search, progress=progress,
    )  # fmt: skip
    solutions = Solutions(
        path.q[:, None], ("path",), path.reasons[:, None], tuple(_families(path)),
        path.position_residual[:, None], path.branch[:, None],
    )  # fmt: skip
    chosen = np.zeros(len(request.given.row), dtype=np.intp)
    branches = _solutions(request, every=True, progress=progress) if request.every else None
    return _result(request, solutions, chosen, solutions.reached, path, branches)


def _families(path: JointPath) -> Iterator[SingularPoses]:
    """Yield the families of singular poses along a path, with all stretches of one together."""
    for family in dict.fromkeys(one.family for one in path.singular):
        where = np.zeros((len(path), 1), dtype=bool)
        for one in path.singular:
            where[one.first : one.last + 1] |= one.family == family
        yield SingularPoses(family, where, KEPT[0], KEPT[1])


def _result(
    request: Request,
    solutions: Solutions,
    chosen: IndexArray,
    listed: BoolArray,
    path: JointPath | None = None,
    branches: Solutions | None = None,
) -> IkResult:
    """Return solutions with how far they miss their targets, and with what a person should know.

    Args:
        request: What was solved.
        solutions: What was found.
        chosen: The column nearest to the start, shape (n,).
        listed: True of the solutions that a person is shown, shape (n, k).
        path: How they follow each other.
        branches: All solutions of the targets of a path.
    """
    given, form = request.given, request.form
    solutions = replace(solutions, reasons=_with_faults(solutions.reasons, given.faults))
    miss, angle = missed_by(request.arm, solutions, given.targets)
    reached = np.asarray(solutions.reached.any(axis=1))
    near: Iterator[LogWarning] = iter(())
    if path is None:  # of a path its nearest point is printed
        poses = given.targets.rotation is not None
        near = near_singular_warnings(request.arm, solutions, given.row, listed, orientation=poses)
    warnings = (
        *given.warnings,
        *start_warnings(request.arm, request.start),
        *singular_warnings(solutions, given.row, listed),
        *near,
        *shortfall_warnings(solutions, given.row),
        *(within_pi_warnings(request.arm, solutions.q) if request.within_pi else ()),
        *_far(request, reached),
    )
    options = request.options | {"robot": request.arm.name}
    return IkResult(
        name=given.name, robot=request.arm, method="iterative" if form is None else form.name, row=given.row,
        t_ns=given.t_ns, clock_start_ns=given.clock_start_ns, targets=given.targets, solutions=solutions,
        chosen=chosen, position_error=miss, angle=angle, all_solutions=request.every,
        branches=branches, path=path, warnings=warnings,
        provenance=build_provenance("ik", options, [given.file] if given.file else []),
    )  # fmt: skip


def _far(request: Request, reached: BoolArray) -> Iterator[LogWarning]:
    """Yield a warning of targets that may be in mm, unless their file has one already."""
    given = request.given
    if not any(warning.kind == "assumed-unit" for warning in given.warnings):
        of_file = given.file is not None
        yield from far_warnings(request.arm, given.targets, given.row, reached, of_file=of_file)


def _with_faults(reasons: TextArray, faults: Sequence[str]) -> TextArray:
    """Return the reasons of targets, those of rows that hold none by what is wrong with the row."""
    fault = np.array(faults, dtype=np.object_)[:, None]
    return np.asarray(np.where(fault != "", fault, reasons))
