"""Inverse kinematics of targets: joint values that bring the tool of any arm to them, limits kept.

`solve` is the entry. It validates targets and options, takes the closed form of the arm or else the iterative
solver, and restores the order of the targets:

1. Closed form (`closed`): all branches, shifted into limits; where a pose leaves joints free and limits
   exclude the one that was chosen, another one is searched for (`_choose_free_joints`). Of all branches the
   one nearest to `start`, if not `every` one is requested.
2. Iterative (`restarts`): positions, arms without a closed form, and targets that a closed form misses, where
   that is requested (a tolerance) or possible (an arm that has one nearly).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray
from urmpipe_models.errors import Finding, Hint, OptionError, format_value
from urmpipe_models.ik.closed import ClosedForm, closed_form, exact_closed_form
from urmpipe_models.ik.limits import joint_periods, limit_solutions, shift_towards_limits
from urmpipe_models.ik.numeric import refine
from urmpipe_models.ik.restarts import solve_iteratively
from urmpipe_models.ik.solutions import (
    DEFAULT_SEARCH,
    NEAREST_POINT,
    NO_BRANCH,
    SearchOptions,
    Solutions,
    Targets,
    empty_solutions,
    validate_targets,
)
from urmpipe_models.ik.trigonometric import wrap_angle

Method = Literal["auto", "closed", "iterative"]
METHODS: tuple[Method, ...] = ("auto", "closed", "iterative")

# Name of the only column of solutions that were selected from the branches of a closed form.
NEAREST = "nearest"
CHOSEN_BY_LIMITS = ", or what the limits of the joints allow"  # is added to `SingularPoses.chosen`
# [rad] or [m] of every joint; a solution this near to another branch is that branch.
SAME_BRANCH_TOLERANCE = 1e-4


def solve(
    chain: Chain,
    targets: Targets,
    *,
    start: FloatArray | None = None,
    every: bool = False,
    method: Method = "auto",
    search: SearchOptions = DEFAULT_SEARCH,
) -> Solutions:
    """Return joint values, limits kept, that bring the tool centre point to its targets.

    An arm with a closed form is solved by it if targets are poses; every other arm, and positions with any
    orientation, iteratively from `start` and from random restarts. A target that is invalid (not finite, no
    rotation) or out of reach gets a reason and does not affect the others.

    Args:
        chain: The arm.
        targets: Poses, or positions with any orientation.
        start: Joint values in [rad] or [m], shape (joints,) or (n, joints), that solutions shall be near to;
            of the chain by default. They may lie outside the limits of the joints; solutions do not. Where
            a singular pose leaves a joint free it is taken from here if `start` is given or one solution
            requested.
        every: Return all solutions, one column per branch, each joint in the turn nearest to `start` that its
            limits allow; solutions that differ by whole turns only are not listed. Otherwise the one
            nearest to `start`, whose branch is in `labels`.
        method: "closed" or "iterative" to allow only one of them.
        search: Limits of the search for what does not follow from `start`.

    Raises:
        OptionError: With all faults of the options.
    """
    position_only = targets.rotation is None
    targets, reasons = validate_targets(targets)
    form = None if position_only or method == "iterative" else closed_form(chain)
    faults = [*_start_faults(chain, len(targets), start), *search.faults()]
    if method not in METHODS:
        faults.append(Finding(parameter="method", found=format_value(method), allowed=", ".join(METHODS)))
    if method == "closed" and form is None:
        faults.append(_no_closed_form(chain, position_only))
    if faults:
        raise OptionError(*faults)
    begin = np.atleast_2d(np.array(chain.start if start is None else start, dtype=float))
    begin = np.broadcast_to(begin, (len(targets), begin.shape[1]))
    valid = np.array([not reason for reason in reasons], dtype=bool)
    nearly = method == "auto" and form is not None and form != exact_closed_form(chain)
    request = _Request(chain, every, search, nearly or search.tolerance is not None)
    if form is None:
        solutions = request.solve_iteratively(targets.rows(valid), begin[valid])
    else:
        near = begin[valid] if start is not None or not every else None
        solutions = request.solve_closed(form, targets.rows(valid), begin[valid], near)
    return solutions if valid.all() else _insert_invalid(solutions, valid, reasons)


class _Request(NamedTuple):
    chain: Chain
    every: bool
    search: SearchOptions
    search_missed: bool  # whether targets that a closed form does not reach are searched for iteratively

    def solve_closed(
        self, form: ClosedForm, targets: Targets, start: FloatArray, near: FloatArray | None
    ) -> Solutions:
        """Return the branches within limits, or the nearest; those that are not reached are searched for."""
        solutions = _choose_free_joints(self.chain, targets, form.solve(targets, near), start)
        if not self.every:
            column = solutions.nearest_column(start, joint_periods(self.chain))
            solutions = solutions.select(column, NEAREST)
        missed = np.asarray(~solutions.reached.any(axis=1))
        if not self.search_missed or not missed.any():
            return solutions
        nearest = self._replace(every=False).solve_iteratively(targets.rows(missed), start[missed])
        return _insert_nearest(solutions, missed, nearest)

    def solve_iteratively(self, targets: Targets, start: FloatArray) -> Solutions:
        if not len(targets):
            return empty_solutions([], ("1",), len(self.chain.coordinates))
        return solve_iteratively(self.chain, targets, start=start, every=self.every, search=self.search)


def _choose_free_joints(chain: Chain, targets: Targets, solutions: Solutions, near: FloatArray) -> Solutions:
    """Return solutions within limits (`limit_solutions`), with free joints chosen so that limits allow them.

    Where a pose leaves joints free, a branch is a continuum of solutions, and a closed form returns one of
    it. If limits exclude that one, another is searched for from the limits that it is beyond.
    """
    limited = limit_solutions(chain, solutions, near)
    free = np.any([poses.where for poses in solutions.singular if poses.free], axis=0)
    excluded = solutions.reached & ~limited.reached & free
    if not excluded.any():
        return limited
    row, column = np.nonzero(excluded)
    refined = refine(chain, targets.rows(row), shift_towards_limits(chain, solutions.q[row, column]))
    differences = np.abs(wrap_angle(refined.q[:, None] - limited.q[row])).max(axis=2)
    new = refined.converged & ~np.asarray((differences < SAME_BRANCH_TOLERANCE).any(axis=1))
    row, column = row[new], column[new]
    q = solutions.q.copy()
    q[row, column] = refined.q[new]
    singular = tuple(
        replace(poses, chosen=poses.chosen + CHOSEN_BY_LIMITS)
        if poses.free and poses.where[row, column].any()
        else poses
        for poses in solutions.singular
    )
    return limit_solutions(chain, replace(solutions, q=q, singular=singular), near)


def _insert_nearest(solutions: Solutions, missed: BoolArray, nearest: Solutions) -> Solutions:
    """Return solutions with those of missed targets, one each, in the first column."""
    near = nearest.reached[:, 0]
    met = np.flatnonzero(missed)[near]
    q, shortfall = solutions.q.copy(), solutions.position_residual.copy()
    reasons, labels = solutions.reasons.copy(), solutions.labels.copy()
    q[met, 0], shortfall[met, 0] = nearest.q[near, 0], nearest.position_residual[near, 0]
    reasons[met, 0] = ""
    labels[met, 0] = np.where(shortfall[met, 0] > 0.0, NEAREST_POINT, NO_BRANCH)
    return replace(solutions, q=q, reasons=reasons, position_residual=shortfall, labels=labels)


def _insert_invalid(solutions: Solutions, valid: BoolArray, reasons: list[str]) -> Solutions:
    """Return solutions of all targets from those of the valid ones, the others with their reasons."""
    every = empty_solutions(reasons, solutions.branches, solutions.q.shape[2])
    every.q[valid], every.reasons[valid] = solutions.q, solutions.reasons
    shortfall, labels = np.zeros(every.q.shape[:2]), every.labels.copy()
    shortfall[valid], labels[valid] = solutions.position_residual, solutions.labels
    singular = []
    for poses in solutions.singular:
        where = np.zeros((len(valid), poses.where.shape[1]), dtype=bool)
        where[valid] = poses.where
        singular.append(replace(poses, where=where))
    return replace(every, singular=tuple(singular), position_residual=shortfall, labels=labels)


def _start_faults(chain: Chain, count: int, start: FloatArray | None) -> Iterator[Finding]:
    if start is None:
        return
    joints, begin = len(chain.coordinates), np.asarray(start, dtype=float)
    if begin.shape not in {(joints,), (count, joints)}:
        allowed = (
            f"({joints},), one each of {', '.join(chain.coordinates)},"
            f" or ({count}, {joints}), as many for each target"
        )
        yield Finding(parameter="start", found=f"values of shape {begin.shape}", allowed=allowed)
    elif not np.isfinite(begin).all():
        allowed = "finite numbers in rad and m"
        yield Finding(parameter="start", found="a value that is not finite", allowed=allowed)


def _no_closed_form(chain: Chain, position_only: bool) -> Finding:
    hints = (Hint("method", "iterative", "searches"),)
    if position_only:
        return Finding(
            "positions with any orientation have no closed form",
            parameter="method",
            allowed="closed for poses",
            hints=hints,
        )
    allowed = (
        "closed for six joints whose last three axes meet in a point or whose axes 2, 3 and 4 are parallel,"
        " exactly or nearly"
    )
    return Finding(f"robot {chain.name} has no closed form", parameter="method", allowed=allowed, hints=hints)
