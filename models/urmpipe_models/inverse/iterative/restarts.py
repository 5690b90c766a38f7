"""Inverse kinematics of any chain from many starts: what one start does not reach, and further solutions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IndexArray
from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.inverse.iterative.descent import STATIONARY
from urmpipe_models.inverse.iterative.refine import Refined, refine
from urmpipe_models.inverse.iterative.task import turn_length
from urmpipe_models.inverse.limits import TURN, turning, within_limits
from urmpipe_models.inverse.search import USUAL_SEARCH, Search
from urmpipe_models.inverse.solutions import NEAREST_POINT, Solutions
from urmpipe_models.inverse.targets import Targets, misses
from urmpipe_models.kinematics.singularity import characteristic_length

DISTINCT = 1e-3
"""Solutions are two if a joint differs by more than this in [rad] or [m], revolute joints by the shorter way.

At a singular pose a miss of 1e-10 leaves 1e-5 rad: less would tell one solution for several.
"""

ROUGH = 1e-2
"""An attempt of a search ends where the cosine between miss and motion is less (see `refine`).

It would come no nearer worth the steps. The nearest of all is then brought to the nearest point near it.
"""

CLEARLY = 0.99
"""An attempt from another start must lead to less than this share of the least miss so far.

Of several branches that come as near, chance would choose else: the one from the start stays, and along a
path so does the branch.
"""

ATTEMPT_STEPS = 100
"""The most steps of an attempt."""

LAST_STEPS = 500
"""Of this last attempt: where the target is singular, steps are many and short."""


def solve_iteratively(
    chain: Chain,
    targets: Targets,
    *,
    start: FloatArray | None = None,
    every: bool = False,
    search: Search = USUAL_SEARCH,
) -> Solutions:
    """Return joint values within limits that bring the tool to its targets, found from several starts.

    Each target is solved from `start` first. Those that are not met there are solved from random starts,
    uniform within the limits (see `random_starts`), roughly: an attempt that leads to no target is soon
    given up. What none of them meets is brought, from where the tool came nearest, as near as it can. All
    targets share the starts, so that what is found for one does not depend on which others there are, and
    the same seed finds the same.

    Where a target leaves freedoms, a solution is one of least motion from `start` (see `refine`), wherever
    the search for it began.

    Args:
        chain: The arm.
        targets: n of them; one that is not finite has no solution.
        start: Joint values in [rad] or [m], shape (joints,) or (n, joints); of the chain by default.
        every: Search from all starts and return what differs by more than `DISTINCT`, nearest to `start`
            first, branches "1", "2", ...; otherwise one solution: from `start`, or where that meets no
            target, of the first random starts that do (one, two, four, ... at a time) the nearest to
            `start`. That there is no other, or none nearer, cannot be known. Where a target leaves freedoms
            there is a continuum, and what is returned are its points of least motion from `start`.
        search: How many random starts, and how near to a target that is met from none of them is enough.

    Returns:
        Solutions, each joint in the turn nearest to `start` that its limits allow.
    """
    begin = np.broadcast_to(
        np.asarray(chain.start if start is None else start, dtype=float), (len(targets), len(chain.start))
    )
    attempts = _Attempts(chain, targets, begin)
    attempts.attempt(begin[None], every)
    starts = random_starts(chain, search.restarts, search.seed)[:, None]
    for some in [starts] if every else _growing(starts):
        if len(some) and (every or attempts.pending.any()):
            attempts.attempt(some, every)
    attempts.finish()
    return _told(attempts, _solutions(attempts, every), search)


def random_starts(chain: Chain, count: int, seed: int) -> FloatArray:
    """Return uniformly random joint values in [rad] or [m] within the limits, shape (count, joints).

    A revolute joint that is open at an end is drawn from one turn: from its only limit, or (-pi, pi]; a
    prismatic one from as far as the arm is long: from its only limit, or to both sides. The first draws do
    not depend on how many follow.
    """
    ranges = np.array([_range(joint, characteristic_length(chain)) for joint in chain.moving])
    draws = np.random.default_rng(seed).uniform(size=(count, len(ranges)))
    return np.asarray(ranges[:, 0] + draws * (ranges[:, 1] - ranges[:, 0]))


def _range(joint: Joint, reach: float) -> tuple[float, float]:
    """Return from where to where a joint's starts are drawn."""
    half = math.pi if joint.kind == "revolute" else reach
    if math.isfinite(joint.lower) and math.isfinite(joint.upper):
        return joint.lower, joint.upper
    if math.isfinite(joint.lower):
        return joint.lower, joint.lower + 2.0 * half
    if math.isfinite(joint.upper):
        return joint.upper - 2.0 * half, joint.upper
    return -half, half


def _growing(starts: FloatArray) -> Iterator[FloatArray]:
    """Yield one start, the next two, the next four, ...: few targets are left for the later ones."""
    done = 0
    while done < len(starts):
        yield starts[done : 2 * done + 1]
        done = 2 * done + 1


class _Attempts:
    """What the attempts of a search have found.

    Attributes:
        found: Joint values of each attempt in [rad] or [m], shape (n, joints), NaN where it met no target.
        pending: True of the targets that no attempt has met, shape (n,).
        nearest: Where the tool came nearest to each target.
    """

    def __init__(self, chain: Chain, targets: Targets, begin: FloatArray) -> None:
        self.chain, self.targets, self.begin = chain, targets, begin
        self.found: list[FloatArray] = []
        self.pending = np.ones(len(targets), np.bool_)
        none = np.full(len(targets), np.inf)
        self.q, self.residual, self.distance, self.angle = begin.copy(), none, none.copy(), none.copy()

    def attempt(self, starts: FloatArray, every: bool) -> None:
        """Solve from starts, shape (attempts, 1 or n, joints), what is pending, or every target."""
        rows = np.flatnonzero(self.pending | every)
        count, joints = len(starts), self.begin.shape[1]
        q = np.broadcast_to(starts, (count, *self.begin.shape))[:, rows].reshape(-1, joints)
        refined = self._refine(rows, q, count, ROUGH, ATTEMPT_STEPS)
        self._keep_nearest(rows, refined, count, CLEARLY)

    def finish(self) -> None:
        """Bring the tool from where it came nearest to what is pending to the target or the nearest point."""
        rows = np.flatnonzero(self.pending & np.isfinite(self.residual))
        if len(rows):
            refined = self._refine(rows, self.q[rows], 1, STATIONARY, LAST_STEPS)
            self._keep_nearest(rows, refined, 1, 1.0)

    def _refine(self, rows: IndexArray, q: FloatArray, count: int, stationary: float, steps: int) -> Refined:
        """Solve the targets at `rows` in as many attempts, from q, shape (count * rows, joints)."""
        targets, home = self.targets.rows(np.tile(rows, count)), np.tile(self.begin[rows], (count, 1))
        refined = refine(self.chain, targets, q, home=home, stationary=stationary, iterations=steps)
        found = np.full((count, *self.begin.shape), np.nan)
        found[:, rows] = np.where(refined.converged[:, None], refined.q, np.nan).reshape(
            count, -1, q.shape[1]
        )
        self.found.extend(found)
        self.pending[rows] &= ~refined.converged.reshape(count, -1).any(axis=0)
        return refined

    def _keep_nearest(self, rows: IndexArray, refined: Refined, count: int, share: float) -> None:
        """Keep where the tool came nearer to the targets at `rows` than `share` of the least miss so far."""
        residual = np.where(np.isnan(refined.residual), np.inf, refined.residual).reshape(count, -1)
        best = np.argmin(residual, axis=0)
        nearer = residual.min(axis=0) < share * self.residual[rows]
        of, to = (best * len(rows) + np.arange(len(rows)))[nearer], rows[nearer]
        self.q[to], self.residual[to] = refined.q[of], refined.residual[of]
        self.distance[to], self.angle[to] = refined.distance[of], refined.angle[of]


def _solutions(attempts: _Attempts, every: bool) -> Solutions:
    """Return what was found, each joint in the allowed turn nearest to the start, nearest solution first."""
    chain, begin = attempts.chain, attempts.begin
    shifted = within_limits(chain, _listed(np.stack(attempts.found, axis=1)), begin).q
    found = _nearest_first(shifted, begin, None if every else 1)
    return _listed(_distinct(chain, found) if every else found)


def _listed(found: FloatArray) -> Solutions:
    """Return joint values of shape (n, k, joints) as solutions 1, 2, ..."""
    branches = tuple(str(k + 1) for k in range(found.shape[1]))
    return Solutions(found, branches, np.full(found.shape[:2], "", dtype=np.object_))


def _nearest_first(found: FloatArray, begin: FloatArray, most: int | None) -> FloatArray:
    """Return what was found, shape (n, k, joints), nearest to the start first, NaN last, `most` of each."""
    distance = np.square(found - begin[:, None, :]).sum(axis=2)
    order = np.argsort(np.where(np.isnan(distance), np.inf, distance), axis=1, kind="stable")[:, :most]
    return np.take_along_axis(found, order[..., None], axis=1)


def _distinct(chain: Chain, found: FloatArray) -> FloatArray:
    """Return each solution once, shape (n, k, joints), in the order they have, NaN where fewer."""
    new = np.asarray(np.isfinite(found).all(axis=2))
    for k in range(1, found.shape[1]):
        apart = np.abs(_apart(chain, found[:, :k], found[:, k : k + 1])).max(axis=2) > DISTINCT
        new[:, k] &= (apart | ~new[:, :k]).all(axis=1)
    found = np.where(new[..., None], found, np.nan)
    order = np.argsort(~new, axis=1, kind="stable")[:, : max(1, int(new.sum(axis=1).max(initial=1)))]
    return np.take_along_axis(found, order[..., None], axis=1)


def _apart(chain: Chain, a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a - b, joints that a whole turn leaves where they were by the shorter way."""
    apart = np.asarray(a - b)
    turns = turning(chain)
    apart[..., turns] -= TURN * np.round(apart[..., turns] / TURN)
    return apart


def _told(attempts: _Attempts, solutions: Solutions, search: Search) -> Solutions:
    """Return solutions with the nearest points within the tolerance, and why there are no others."""
    near = _near_enough(attempts, search.tolerance)
    q, reasons, labels = solutions.q.copy(), solutions.reasons.copy(), solutions.labels.copy()
    shortfall = np.zeros(q.shape[:2])
    turned = within_limits(attempts.chain, _listed(attempts.q[near][:, None]), attempts.begin[near])
    q[near, 0], labels[near, 0], shortfall[near, 0] = turned.q[:, 0], NEAREST_POINT, attempts.distance[near]
    lacking = np.asarray(~np.isfinite(q).all(axis=2))
    reasons[lacking] = f"no further solution {_tries(search.restarts)}"
    for row in np.flatnonzero(lacking.all(axis=1)):
        reasons[row] = _reason(attempts, int(row), search)
    return replace(solutions, q=q, reasons=reasons, labels=labels, shortfall=shortfall)


def _near_enough(attempts: _Attempts, tolerance: float | None) -> BoolArray:
    """Return where the nearest point found of a target that is not met is within the tolerance."""
    near = np.asarray(attempts.pending & np.isfinite(attempts.residual))
    if tolerance is None or not near.any():
        return np.zeros(len(near), np.bool_)
    position, turn = misses(attempts.chain, attempts.q[near], attempts.targets.rows(near))
    within = np.abs(position).max(axis=1) <= tolerance
    near[near] = within & (np.linalg.norm(turn, axis=1) <= tolerance / turn_length(attempts.chain))
    return near


def _reason(attempts: _Attempts, row: int, search: Search) -> str:
    """Say that a target has no solution and how near the tool comes."""
    if not np.isfinite(attempts.residual[row]):
        return "the target is not finite, allowed: finite numbers"
    text = f"no solution {_tries(search.restarts)}; nearest: {attempts.distance[row]:.3g} m"
    if attempts.targets.rotation is not None:
        text += f", {attempts.angle[row]:.3g} rad"
    text += " away"
    if search.tolerance is None:
        return text
    return f"{text}, allowed: {search.tolerance:g} m along each axis"


def _tries(restarts: int) -> str:
    """Say from how many starts was searched."""
    if not restarts:
        return "from the start"
    return f"in {restarts} restart{'s' if restarts > 1 else ''}"
