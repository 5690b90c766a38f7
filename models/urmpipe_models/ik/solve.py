"""The one entry: joint values that bring the tool of any arm to its targets.

How far an arm can reach at most, by the lengths of its links alone: what lies beyond needs no search.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray, row_norms
from urmpipe_models.errors import Finding, Hint, OptionError, format_value
from urmpipe_models.ik.closed import ClosedForm, closed_form, exact_closed_form
from urmpipe_models.ik.restarts import choose_free_joints
from urmpipe_models.ik.solutions import (
    DEFAULT_SEARCH,
    NEAREST_POINT,
    NO_BRANCH,
    SearchOptions,
    SingularPoses,
    Solutions,
    Targets,
    empty_solutions,
    joint_periods,
    validate_targets,
)

Method = Literal["auto", "closed", "iterative"]
METHODS: tuple[Method, ...] = ("auto", "closed", "iterative")

NEAREST = "nearest"
"""What the one column of solutions is called that were picked of the branches of a closed form."""


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

    An arm with a closed form is solved by it where poses are asked; every other arm, and positions with any
    orientation, iteratively from `start` and from random restarts. A target that is none (not finite, no
    rotation) or out of reach gets a reason and stops no other.

    Args:
        chain: The arm.
        targets: Poses, or positions with any orientation.
        start: Joint values in [rad] or [m], shape (joints,) or (n, joints), that solutions are to be near to;
            of the chain by default. They may lie outside the limits of the joints; solutions do not. Where a
            singular pose leaves a joint free it is taken from here if `start` is given or one solution asked.
        every: Return all solutions, one column a branch, each joint in the turn nearest to `start` that its
            limits allow: what differs from it by whole turns is not listed. Otherwise the one nearest to
            `start`, whose branch stands in `labels`.
        method: "closed" or "iterative" to allow only one of them.
        search: How far to search for what does not follow from `start`.

    Raises:
        OptionError: With all that is wrong with the options.
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
    begin = _starts(chain, len(targets), start)
    good = np.array([not reason for reason in reasons], dtype=bool)
    nearly = method == "auto" and form is not None and form != exact_closed_form(chain)
    asked = _Asked(chain, every, search, nearly or search.tolerance is not None)
    if form is None:
        found = asked.iteratively(targets.rows(good), begin[good])
    else:
        near = begin[good] if start is not None or not every else None
        found = asked.by_closed_form(form, targets.rows(good), begin[good], near)
    return found if good.all() else _spread(found, good, reasons)


@dataclass(frozen=True, slots=True)
class _Asked:
    """What was asked of the solvers."""

    chain: Chain
    every: bool
    search: SearchOptions
    rest: bool
    """Whether what a closed form does not reach is searched for: the nearest points, or what one that holds
    nearly may have lost."""

    def by_closed_form(
        self, form: ClosedForm, targets: Targets, start: FloatArray, near: FloatArray | None
    ) -> Solutions:
        """Return the branches within limits, or the nearest; what they do not reach is searched for."""
        found = choose_free_joints(self.chain, targets, form.solve(targets, near), start)
        if not self.every:
            found = found.picked(found.nearest_column(start, joint_periods(self.chain)), NEAREST)
        out = np.asarray(~found.reached.any(axis=1))
        if not self.rest or not out.any():
            return found
        return _approached(found, out, replace(self, every=False).iteratively(targets.rows(out), start[out]))

    def iteratively(self, targets: Targets, start: FloatArray) -> Solutions:
        """Return what the iterative solver finds."""
        from urmpipe_models.ik.restarts import solve_iteratively

        if not len(targets):
            return empty_solutions([], ("1",), len(self.chain.coordinates))
        return solve_iteratively(self.chain, targets, start=start, every=self.every, search=self.search)


def _approached(found: Solutions, out: BoolArray, nearest: Solutions) -> Solutions:
    """Return solutions with those of other targets, one each, in the first column where there was none."""
    near = nearest.reached[:, 0]
    met = np.flatnonzero(out)[near]
    q, shortfall = found.q.copy(), found.shortfall.copy()
    reasons, labels = found.reasons.copy(), found.labels.copy()
    q[met, 0], shortfall[met, 0] = nearest.q[near, 0], nearest.shortfall[near, 0]
    reasons[met, 0] = ""
    labels[met, 0] = np.where(shortfall[met, 0] > 0.0, NEAREST_POINT, NO_BRANCH)
    return replace(found, q=q, reasons=reasons, shortfall=shortfall, labels=labels)


def _spread(found: Solutions, good: BoolArray, reasons: list[str]) -> Solutions:
    """Return solutions of all targets from those of the good ones, the others with their reasons."""
    every = empty_solutions(reasons, found.branches, found.q.shape[2])
    count, columns = every.q.shape[:2]
    every.q[good], every.reasons[good] = found.q, found.reasons
    shortfall, labels = np.zeros((count, columns)), every.labels.copy()
    shortfall[good], labels[good] = found.shortfall, found.labels
    return replace(
        every,
        singular=tuple(_spread_family(family, good) for family in found.singular),
        shortfall=shortfall,
        labels=labels,
    )


def _spread_family(family: SingularPoses, good: BoolArray) -> SingularPoses:
    """Return a family of all targets from one of the good ones."""
    where = np.zeros((len(good), family.where.shape[1]), dtype=bool)
    where[good] = family.where
    return replace(family, where=where)


def _starts(chain: Chain, count: int, start: FloatArray | None) -> FloatArray:
    """Return the start of each target, shape (n, joints)."""
    begin = np.atleast_2d(np.array(chain.start if start is None else start, dtype=float))
    return np.broadcast_to(begin, (count, begin.shape[1]))


def _start_faults(chain: Chain, count: int, start: FloatArray | None) -> Iterator[Finding]:
    """Yield what is wrong with a start."""
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
    """Say what a closed form would need."""
    searched = (Hint("method", "iterative", "searches"),)
    if position_only:
        said = "positions with any orientation have no closed form"
        return Finding(said, parameter="method", allowed="closed for poses", hints=searched)
    allowed = (
        "closed for six joints whose last three axes meet in a point or whose axes 2, 3 and 4 are parallel,"
        " exactly or nearly"
    )
    said = f"robot {chain.name} has no closed form"
    return Finding(said, parameter="method", allowed=allowed, hints=searched)


SURE = 1e-3
"""A target is too far if it is by more than this, in [m]: the edge of the reach is left to the search."""


def max_reach(chain: Chain) -> float:
    """Return what the tool centre point can be away from the first joint's frame at most, in [m].

    It is the sum of the offsets from frame to frame, and of what each prismatic joint can add: no posture
    is longer. Limits of revolute joints are not asked, so that few arms get there.
    """
    offsets = [joint.origin.translation for joint in chain.joints[1:]]
    offsets += [chain.tip.translation, chain.tool.translation]
    return sum(math.hypot(*offset) for offset in offsets) + sum(_strokes(chain))


def find_out_of_reach(chain: Chain, targets: Targets, tolerance: float | None) -> list[str]:
    """Return why targets are out of any posture's reach, one text each; empty where they may be in it.

    Args:
        chain: The arm.
        targets: n of them; one that is not finite has no reason here.
        tolerance: In [m] along each axis, of targets that the tool need only come near to.
    """
    most = max_reach(chain)
    first = (chain.base @ chain.joints[0].origin).translation
    away = row_norms(targets.position - np.array(first))
    reasons = [""] * len(targets)
    for row in np.flatnonzero(away > most + SURE + math.sqrt(3.0) * (tolerance or 0.0)).tolist():
        reasons[row] = f"the target is {away[row]:.3f} m from the first joint, allowed: {most:.3f} m at most"
    return reasons


def _strokes(chain: Chain) -> Iterator[float]:
    """Yield what each prismatic joint can add at most, in [m]."""
    coordinates = {joint.name: joint for joint in chain.moving}
    for joint in chain.joints:
        if joint.kind == "prismatic" and joint.mimic is None:
            yield max(abs(joint.lower), abs(joint.upper))
        elif joint.kind == "prismatic" and joint.mimic is not None:
            led = coordinates[joint.mimic.joint]
            ends = (joint.mimic.multiplier * end + joint.mimic.offset for end in (led.lower, led.upper))
            yield max(map(abs, ends))
