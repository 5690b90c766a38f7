"""From what is asked to an `InverseResult`: targets that stand for themselves, or a path of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from urmpipe.inverse.asked import Asked
from urmpipe.inverse.blocks import solve_in_blocks
from urmpipe.inverse.result import InverseResult, missed_by
from urmpipe.inverse.wording import (
    far_warnings,
    near_singular_warnings,
    shortfall_warnings,
    singular_warnings,
    start_warnings,
    within_pi_warnings,
)
from urmpipe_models.arrays import BoolArray, IndexArray, IntArray, TextArray
from urmpipe_models.inverse.along_path.joint_path import JointPath
from urmpipe_models.inverse.along_path.path import follow
from urmpipe_models.inverse.limits import periods, within_pi
from urmpipe_models.inverse.solutions import Singular, Solutions
from urmpipe_models.inverse.solve import solve
from urmpipe_models.inverse.targets import Targets
from urmpipe_pipeline.joint_log import LogWarning

KEPT = "a direction of motion is lost there", "a joint that is free stays where it was"
"""What is infinite at a singular pose along a path, and what is chosen there."""


def solved(asked: Asked) -> InverseResult:
    """Return the solutions of targets, each for itself or along a path, with all that is to be told."""
    t_ns = asked.given.t_ns
    return _of_targets(asked) if t_ns is None else _of_path(asked, t_ns)


def solutions_of(asked: Asked, *, every: bool) -> Solutions:
    """Return the solutions of the targets, each for itself: all that there are, or the one nearest."""

    def found(targets: Targets) -> Solutions:
        """Return the solutions of some of them."""
        return solve(
            asked.arm, targets, start=asked.start, every=every, method=asked.method, search=asked.search
        )

    return solve_in_blocks(found, asked.given.targets, asked.progress)


def _of_targets(asked: Asked) -> InverseResult:
    """Return the solutions of targets that stand for themselves: all that a closed form has."""
    period = periods(asked.arm)
    solutions = solutions_of(asked, every=asked.every or asked.form is not None)
    chosen = solutions.nearest_column(asked.begin, period)
    if asked.within_pi:
        solutions = replace(solutions, q=within_pi(solutions.q, period))
    listed = solutions.reached.copy()
    if not asked.every:
        listed &= np.arange(listed.shape[1]) == chosen[:, None]
    return _result(asked, solutions, chosen, listed, None)


def _of_path(asked: Asked, t_ns: IntArray) -> InverseResult:
    """Return the solutions of a path, which follow each other."""
    path = follow(
        asked.arm, asked.given.targets, t_ns, start=asked.start, within_pi=asked.within_pi,
        search=asked.search, progress=asked.progress,
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
    asked: Asked, solutions: Solutions, chosen: IndexArray, listed: BoolArray, path: JointPath | None
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
        *start_warnings(asked.arm, asked.start),
        *singular_warnings(solutions, given.row, listed),
        *(_nearly_singular(asked, solutions, listed) if path is None else ()),
        *shortfall_warnings(solutions, given.row),
        *(within_pi_warnings(asked.arm, solutions.q) if asked.within_pi else ()),
        *_far(asked, reached),
    )
    return InverseResult(
        name=given.name, robot=asked.arm, method="iterative" if form is None else form.name, row=given.row,
        t_ns=given.t_ns, targets=given.targets, solutions=solutions, chosen=chosen, miss=miss, angle=angle,
        path=path, warnings=warnings,
    )  # fmt: skip


def _nearly_singular(asked: Asked, solutions: Solutions, listed: BoolArray) -> Iterator[LogWarning]:
    """Yield a warning of solutions that are nearly singular; of a path its nearest point is printed."""
    poses = asked.given.targets.rotation is not None
    return near_singular_warnings(asked.arm, solutions, asked.given.row, listed, orientation=poses)


def _far(asked: Asked, reached: BoolArray) -> Iterator[LogWarning]:
    """Yield a warning of targets that may be in mm, unless their file has one already."""
    given = asked.given
    if not any(warning.kind == "assumed-unit" for warning in given.warnings):
        yield from far_warnings(asked.arm, given.targets, given.row, reached)


def _with_faults(reasons: TextArray, faults: Sequence[str]) -> TextArray:
    """Return the reasons of targets, those of rows that hold none by what is wrong with the row."""
    fault = np.array(faults, dtype=np.object_)[:, None]
    return np.asarray(np.where(fault != "", fault, reasons))
