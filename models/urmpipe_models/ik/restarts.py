"""Iterative inverse kinematics from several starts: targets missed from one start, and further solutions.

1. Each target is solved from the given start (`numeric.refine`).
2. Those that are not met there are solved from random starts, roughly: an attempt that leads to no target
   soon ends. All targets share the starts, so that the solution of one does not depend on the other
   targets, and the same seed gives the same solutions.
3. A target that no attempt meets is brought, from the nearest point so far, as near as possible.
4. Solutions are shifted into limits, sorted by the distance from the start, and equal ones dropped; a missing
   one has a reason that says how near the tool comes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import BoolArray, FloatArray, IndexArray
from urmpipe_models.ik.limits import TURN, is_periodic, limit_solutions
from urmpipe_models.ik.numeric import STATIONARY, RefinementResult, refine
from urmpipe_models.ik.solutions import (
    DEFAULT_SEARCH,
    NEAREST_POINT,
    SearchOptions,
    Solutions,
    Targets,
    pose_errors,
)
from urmpipe_models.ik.task import orientation_length
from urmpipe_models.kinematics.singularity import characteristic_length

# Solutions are two if a joint differs by more than this in [rad] or [m], revolute joints by the shorter
# way. At a singular pose an error of 1e-10 leaves 1e-5 rad: less would give one solution as several.
DISTINCT_TOLERANCE = 1e-3
# An attempt ends where the cosine between error and motion is less (see `refine`): it would come no nearer
# worth the steps. The nearest of all is then brought to the nearest point near it.
ATTEMPT_STATIONARY = 1e-2
# An attempt from another start must lead to less than this share of the least error so far. Among several
# branches that come as near, chance would choose otherwise: the one from the start stays, and along a path
# so does the branch.
NEARER_SHARE = 0.99
MAX_ATTEMPT_STEPS = 100
MAX_LAST_STEPS = 500  # of the last attempt: where the target is singular, steps are many and short


def solve_iteratively(
    chain: Chain,
    targets: Targets,
    *,
    start: FloatArray | None = None,
    every: bool = False,
    search: SearchOptions = DEFAULT_SEARCH,
) -> Solutions:
    """Return joint values within limits that bring the tool to its targets, from several starts.

    Each target is solved from `start`, then from random starts, uniform within the limits (see
    `random_starts`). Where a target leaves freedoms, a solution is one of least motion from `start` (see
    `refine`), wherever the search for it began.

    Args:
        chain: The arm.
        targets: n of them; one that is not finite has no solution.
        start: Joint values in [rad] or [m], shape (joints,) or (n, joints); of the chain by default.
        every: Search from all starts and return all solutions that differ by more than `DISTINCT_TOLERANCE`,
            nearest to `start` first, branches "1", "2", ...; otherwise one solution: from `start`, or where
            that meets no target, of the first random starts that do (one, two, four, ... at a time) the
            nearest to `start`. There may be others, or nearer ones. Where a target leaves freedoms
            there is a continuum, and its points of least motion from `start` are returned.
        search: Number of random starts, and the sufficient distance from a target that none of them meets.

    Returns:
        Solutions, each joint in the turn nearest to `start` that its limits allow.
    """
    begin = np.broadcast_to(
        np.asarray(chain.start if start is None else start, dtype=float), (len(targets), len(chain.start))
    )
    attempts = _Attempts(chain, targets, begin)
    attempts.attempt(begin[None], every)
    starts = random_starts(chain, search.restarts, search.seed)[:, None]
    for batch in [starts] if every else _growing(starts):
        if len(batch) and (every or attempts.pending.any()):
            attempts.attempt(batch, every)
    attempts.finish()
    return _with_nearest_points(attempts, _solutions(attempts, every), search)


def random_starts(chain: Chain, count: int, seed: int) -> FloatArray:
    """Return uniformly random joint values in [rad] or [m] within the limits, shape (count, joints).

    A revolute joint that is open at an end is drawn from one turn: from its only limit, or (-pi, pi]; a
    prismatic one from the length of the arm: from its only limit, or to both sides. The first draws do
    not depend on `count`.
    """
    ranges = np.array([_range(joint, characteristic_length(chain)) for joint in chain.moving])
    draws = np.random.default_rng(seed).uniform(size=(count, len(ranges)))
    return np.asarray(ranges[:, 0] + draws * (ranges[:, 1] - ranges[:, 0]))


def _range(joint: Joint, reach: float) -> tuple[float, float]:
    """Return the range in which a joint's starts are drawn."""
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
    """Results of the attempts of a search.

    Attributes:
        solutions: Of each attempt in [rad] or [m], shape (n, joints), NaN where it met no target.
        pending: True of the targets that no attempt has met, shape (n,).
        q: Joint values where the tool came nearest, shape (n, joints); residual, distance and angle there.
    """

    def __init__(self, chain: Chain, targets: Targets, begin: FloatArray) -> None:
        self.chain, self.targets, self.begin = chain, targets, begin
        self.solutions: list[FloatArray] = []
        self.pending = np.ones(len(targets), np.bool_)
        none = np.full(len(targets), np.inf)
        self.q, self.residual, self.distance, self.angle = begin.copy(), none, none.copy(), none.copy()

    def attempt(self, starts: FloatArray, every: bool) -> None:
        """Solve pending targets, or all, from starts, shape (attempts, 1 or n, joints)."""
        rows = np.flatnonzero(self.pending | every)
        count, joints = len(starts), self.begin.shape[1]
        q = np.broadcast_to(starts, (count, *self.begin.shape))[:, rows].reshape(-1, joints)
        refined = self._refine(rows, q, count, ATTEMPT_STATIONARY, MAX_ATTEMPT_STEPS)
        self._keep_nearest(rows, refined, count, NEARER_SHARE)

    def finish(self) -> None:
        """Bring the tool from the nearest points of pending targets to the target or the nearest point."""
        rows = np.flatnonzero(self.pending & np.isfinite(self.residual))
        if len(rows):
            refined = self._refine(rows, self.q[rows], 1, STATIONARY, MAX_LAST_STEPS)
            self._keep_nearest(rows, refined, 1, 1.0)

    def _refine(
        self, rows: IndexArray, q: FloatArray, count: int, stationary: float, steps: int
    ) -> RefinementResult:
        """Solve the targets at `rows` in `count` attempts, from q, shape (count * rows, joints)."""
        targets, home = self.targets.rows(np.tile(rows, count)), np.tile(self.begin[rows], (count, 1))
        refined = refine(self.chain, targets, q, home=home, stationary=stationary, iterations=steps)
        solutions = np.full((count, *self.begin.shape), np.nan)
        solutions[:, rows] = np.where(refined.converged[:, None], refined.q, np.nan).reshape(
            count, -1, q.shape[1]
        )
        self.solutions.extend(solutions)
        self.pending[rows] &= ~refined.converged.reshape(count, -1).any(axis=0)
        return refined

    def _keep_nearest(self, rows: IndexArray, refined: RefinementResult, count: int, share: float) -> None:
        """Keep where the error at the targets at `rows` is less than `share` of the least so far."""
        residual = np.where(np.isnan(refined.residual), np.inf, refined.residual).reshape(count, -1)
        best = np.argmin(residual, axis=0)
        nearer = residual.min(axis=0) < share * self.residual[rows]
        of, to = (best * len(rows) + np.arange(len(rows)))[nearer], rows[nearer]
        self.q[to], self.residual[to] = refined.q[of], refined.residual[of]
        self.distance[to], self.angle[to] = refined.distance[of], refined.angle[of]


def _solutions(attempts: _Attempts, every: bool) -> Solutions:
    """Return solutions, each joint in the allowed turn nearest to the start, nearest solution first."""
    chain, begin = attempts.chain, attempts.begin
    shifted = limit_solutions(chain, _numbered(np.stack(attempts.solutions, axis=1)), begin).q
    distance = np.square(shifted - begin[:, None, :]).sum(axis=2)
    order = np.argsort(np.where(np.isnan(distance), np.inf, distance), axis=1, kind="stable")
    q = np.take_along_axis(shifted, order[:, : None if every else 1, None], axis=1)
    return _numbered(_distinct(chain, q) if every else q)


def _numbered(q: FloatArray) -> Solutions:
    """Return joint values of shape (n, k, joints) as solutions 1, 2, ..."""
    branches = tuple(str(k + 1) for k in range(q.shape[1]))
    return Solutions(q, branches, np.full(q.shape[:2], "", dtype=np.object_))


def _distinct(chain: Chain, q: FloatArray) -> FloatArray:
    """Return each solution once, shape (n, k, joints), in their order, NaN where fewer."""
    new = np.asarray(np.isfinite(q).all(axis=2))
    periodic = is_periodic(chain)
    for k in range(1, q.shape[1]):
        difference = np.asarray(q[:, :k] - q[:, k : k + 1])
        difference[..., periodic] -= TURN * np.round(difference[..., periodic] / TURN)
        differs = np.abs(difference).max(axis=2) > DISTINCT_TOLERANCE
        new[:, k] &= (differs | ~new[:, :k]).all(axis=1)
    q = np.where(new[..., None], q, np.nan)
    order = np.argsort(~new, axis=1, kind="stable")[:, : max(1, int(new.sum(axis=1).max(initial=1)))]
    return np.take_along_axis(q, order[..., None], axis=1)


def _with_nearest_points(attempts: _Attempts, solutions: Solutions, search: SearchOptions) -> Solutions:
    """Return solutions with the nearest points within the tolerance, and why there are no others."""
    near = _within_tolerance(attempts, search.tolerance)
    q, reasons, labels = solutions.q.copy(), solutions.reasons.copy(), solutions.labels.copy()
    shortfall = np.zeros(q.shape[:2])
    shifted = limit_solutions(attempts.chain, _numbered(attempts.q[near][:, None]), attempts.begin[near])
    q[near, 0], labels[near, 0], shortfall[near, 0] = shifted.q[:, 0], NEAREST_POINT, attempts.distance[near]
    missing = np.asarray(~np.isfinite(q).all(axis=2))
    restarts = f"in {search.restarts} restart{'s' if search.restarts > 1 else ''}"
    attempted = restarts if search.restarts else "from the start"
    reasons[missing] = f"no further solution {attempted}"
    for row in np.flatnonzero(missing.all(axis=1)):
        reasons[row] = _reason(attempts, int(row), search.tolerance, attempted)
    return replace(solutions, q=q, reasons=reasons, labels=labels, position_residual=shortfall)


def _within_tolerance(attempts: _Attempts, tolerance: float | None) -> BoolArray:
    """Return where the nearest point of a target that is not met is within the tolerance."""
    near = np.asarray(attempts.pending & np.isfinite(attempts.residual))
    if tolerance is None or not near.any():
        return np.zeros(len(near), np.bool_)
    position, rotation = pose_errors(attempts.chain, attempts.q[near], attempts.targets.rows(near))
    within = np.abs(position).max(axis=1) <= tolerance
    near[near] = within & (np.linalg.norm(rotation, axis=1) <= tolerance / orientation_length(attempts.chain))
    return near


def _reason(attempts: _Attempts, row: int, tolerance: float | None, attempted: str) -> str:
    """Return the reason why a target has no solution, and how near the tool comes."""
    if not np.isfinite(attempts.residual[row]):
        return "the target is not finite, allowed: finite numbers"
    text = f"no solution {attempted}; nearest: {attempts.distance[row]:.3g} m"
    if attempts.targets.rotation is not None:
        text += f", {attempts.angle[row]:.3g} rad"
    text += " away"
    if tolerance is None:
        return text
    return f"{text}, allowed: {tolerance:g} m along each axis"
