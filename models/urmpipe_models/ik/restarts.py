"""Inverse kinematics of any chain, iteratively: many targets at once, each from a start of its own.

With e the miss (target minus tool; the rotation vector times a length l, `turn_length`) and J its
Jacobian, both in the world, a step is

    Levenberg-Marquardt      dq = J^T (J J^T + mu I)^-1 e, mu = g |e|^2, g by the gain ratio of each row
    damped least squares     the same with mu constant
    pseudoinverse            dq = J^+ e                                   (Moore-Penrose)

The first converges quadratically where the target can be met off singular poses, and to the nearest
point, in the sense of least |e|, where it cannot. The other two are CoppeliaSim's, which the paper's joint
values come from. Where a target leaves freedoms, what is met is brought to the point of least motion (see
`least_motion`).

Sources: [UrmArm2021]_ section 1; [Wampler1986]_; [NakamuraHanafusa1986]_; [FanYuan2005]_ (mu = g |e|^2);
[KanzowYamashitaFukushima2004]_ (projected steps).

Inverse kinematics of any chain from many starts: what one start does not reach, and further solutions.

Joints that a singular pose leaves free: another choice where limits refuse the one that was made.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import THREADS, BoolArray, FloatArray, IndexArray, map_blocks, row_blocks
from urmpipe_models.errors import Finding, OptionError, format_value
from urmpipe_models.ik.numeric import (
    METHODS,
    STATIONARY,
    DescentOptions,
    DescentState,
    Method,
    descend,
    minimise_motion,
)
from urmpipe_models.ik.solutions import (
    DEFAULT_SEARCH,
    NEAREST_POINT,
    TURN,
    SearchOptions,
    SingularPoses,
    Solutions,
    Targets,
    is_periodic,
    joint_limits,
    joint_periods,
    limit_solutions,
    pose_errors,
    shift_towards_limits,
)
from urmpipe_models.ik.task import build_task, orientation_length, redundancy, take_rows
from urmpipe_models.ik.trigonometric import wrap_angle
from urmpipe_models.kinematics.singularity import characteristic_length

BATCH_SIZE = 4096
"""Rows of a block: its hundred or so arrays stay in a core's cache."""

ROUND = 6
"""Steps after which the rows of all blocks that are still on their way are gathered into new blocks."""


@dataclass(frozen=True, slots=True, eq=False)
class RefinementResult:
    """Where the rows of a batch came to.

    Attributes:
        q: Joint values in [rad] or [m], within their limits, shape (n, joints).
        converged: True where the tool meets its target, shape (n,).
        iterations: Steps taken, shape (n,).
        distance: |target - tool| in [m], shape (n,).
        angle: Between tool and target in [rad], 0 where any orientation will do, shape (n,).
        residual: |e| = sqrt(distance^2 + (l angle)^2) in [m], shape (n,); NaN of a target that is no number.
        slack: Of an arm with more freedoms than the target takes: the largest entry of t, the way to a point
            of less motion, in [rad] or [m], shape (n,); see `least_motion`.
    """

    q: FloatArray
    converged: BoolArray
    iterations: IndexArray
    distance: FloatArray
    angle: FloatArray
    residual: FloatArray
    slack: FloatArray


def refine(
    chain: Chain,
    targets: Targets,
    q: FloatArray,
    *,
    home: FloatArray | None = None,
    method: Method = "lm",
    metres: float = 1e-10,
    radians: float = 1e-10,
    iterations: int = 100,
    damping: float = 0.05,
    stationary: float = STATIONARY,
    threads: int = THREADS,
) -> RefinementResult:
    """Return joint values that bring the tool to its targets, or as near as can be come from the starts.

    Args:
        chain: The arm.
        targets: n of them.
        q: Where each starts, in [rad] or [m], shape (joints,) or (n, joints); clipped to the limits.
        home: Where least motion counts from, in [rad] or [m], shaped as q; q by default.
        method: lm (Levenberg-Marquardt), dls (damped least squares) or pinv (pseudoinverse).
        metres: The distance from the target that counts as none in [m].
        radians: The angle from the target that counts as none in [rad].
        iterations: The most steps a row takes.
        damping: Of damped least squares: mu = (damping l)^2.
        stationary: A row ends where the cosine between e and what any free joint can change of it is less:
            the smaller, the nearer to the nearest point.
        threads: Blocks worked on side by side.

    Raises:
        OptionError: If the method or the shape of q is none of the above.
    """
    lower, upper = joint_limits(chain)
    begin = np.clip(_starts(chain, targets, q, method), lower, upper)
    settings = DescentOptions(lower, upper, method, metres, radians, damping, stationary)
    progress = DescentState.at(begin)
    _run(progress, chain, targets, settings, iterations, threads)
    slack = np.zeros(len(targets))
    if redundancy(chain, targets):
        goal = begin if home is None else np.clip(_starts(chain, targets, home, method), lower, upper)
        slack = _settled(progress, chain, targets, goal, settings, threads)
    residual = np.hypot(progress.distance, orientation_length(chain) * progress.angle)
    return RefinementResult(
        progress.q.T, progress.arrived, progress.steps, progress.distance, progress.angle, residual, slack
    )


def _starts(chain: Chain, targets: Targets, q: FloatArray, method: str) -> FloatArray:
    """Return one start a target, or say what is wrong with what was given."""
    shape = (len(targets), len(chain.coordinates))
    faults = []
    if method not in METHODS:
        faults.append(Finding(parameter="method", found=format_value(method), allowed=", ".join(METHODS)))
    if np.shape(q) not in {shape, shape[1:]}:
        found, allowed = f"an array of shape {np.shape(q)}", f"{shape[1:]} or {shape}"
        faults.append(Finding(parameter="starts", found=found, allowed=allowed))
    if faults:
        raise OptionError(*faults)
    return np.broadcast_to(np.asarray(q, dtype=float), shape)


def _run(
    progress: DescentState,
    chain: Chain,
    targets: Targets,
    settings: DescentOptions,
    iterations: int,
    threads: int,
) -> None:
    """Take every row to its end, or as many steps as are allowed."""
    pending = np.flatnonzero(_finite(targets) & np.isfinite(progress.q).all(axis=0))

    task = build_task(chain, targets)

    def work(index: IndexArray) -> None:
        """Take the rows of a block some steps further."""
        descend(progress, task.kept(index), index, settings, steps)

    for done in range(0, iterations, ROUND):
        steps = min(ROUND, iterations - done)
        map_blocks(work, [pending[rows] for rows in row_blocks(len(pending), BATCH_SIZE)], threads)
        pending = pending[~progress.ended[pending]]
        if not len(pending):
            return


def _finite(targets: Targets) -> BoolArray:
    """Return where a target is made of numbers."""
    finite = np.isfinite(targets.position).all(axis=1)
    if targets.rotation is not None:
        finite &= np.isfinite(targets.rotation).all(axis=(1, 2))
    return np.asarray(finite)


def _settled(
    progress: DescentState,
    chain: Chain,
    targets: Targets,
    home: FloatArray,
    settings: DescentOptions,
    threads: int,
) -> FloatArray:
    """Bring the rows that have arrived to the points of least motion; return what is left of t."""
    slack = np.zeros(len(targets))
    arrived = np.flatnonzero(progress.arrived)
    progress.q[:, arrived] -= _turns(chain, progress.q[:, arrived], home.T[:, arrived])

    def work(index: IndexArray) -> None:
        """Settle the rows of a block."""
        task = build_task(chain, targets.rows(index))
        q, to = take_rows(progress.q, index), np.ascontiguousarray(home[index].T)
        progress.q[:, index], slack[index] = minimise_motion(task, q, to, settings)

    map_blocks(work, [arrived[rows] for rows in row_blocks(len(arrived), BATCH_SIZE)], threads)
    return slack


def _turns(chain: Chain, q: FloatArray, home: FloatArray) -> FloatArray:
    """Return the whole turns in [rad] that joints that turn without end are away from home."""
    period = joint_periods(chain)[:, None]
    endless = np.isfinite(period)
    period = np.where(endless, period, 1.0)
    return np.where(endless, period * np.round((q - home) / period), 0.0)


DISTINCT_TOLERANCE = 1e-3
"""Solutions are two if a joint differs by more than this in [rad] or [m], revolute joints by the shorter way.

At a singular pose a miss of 1e-10 leaves 1e-5 rad: less would tell one solution for several.
"""

ATTEMPT_STATIONARY = 1e-2
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
    search: SearchOptions = DEFAULT_SEARCH,
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
        refined = self._refine(rows, q, count, ATTEMPT_STATIONARY, ATTEMPT_STEPS)
        self._keep_nearest(rows, refined, count, CLEARLY)

    def finish(self) -> None:
        """Bring the tool from where it came nearest to what is pending to the target or the nearest point."""
        rows = np.flatnonzero(self.pending & np.isfinite(self.residual))
        if len(rows):
            refined = self._refine(rows, self.q[rows], 1, STATIONARY, LAST_STEPS)
            self._keep_nearest(rows, refined, 1, 1.0)

    def _refine(
        self, rows: IndexArray, q: FloatArray, count: int, stationary: float, steps: int
    ) -> RefinementResult:
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

    def _keep_nearest(self, rows: IndexArray, refined: RefinementResult, count: int, share: float) -> None:
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
    shifted = limit_solutions(chain, _listed(np.stack(attempts.found, axis=1)), begin).q
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
        apart = np.abs(_apart(chain, found[:, :k], found[:, k : k + 1])).max(axis=2) > DISTINCT_TOLERANCE
        new[:, k] &= (apart | ~new[:, :k]).all(axis=1)
    found = np.where(new[..., None], found, np.nan)
    order = np.argsort(~new, axis=1, kind="stable")[:, : max(1, int(new.sum(axis=1).max(initial=1)))]
    return np.take_along_axis(found, order[..., None], axis=1)


def _apart(chain: Chain, a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a - b, joints that a whole turn leaves where they were by the shorter way."""
    apart = np.asarray(a - b)
    turns = is_periodic(chain)
    apart[..., turns] -= TURN * np.round(apart[..., turns] / TURN)
    return apart


def _told(attempts: _Attempts, solutions: Solutions, search: SearchOptions) -> Solutions:
    """Return solutions with the nearest points within the tolerance, and why there are no others."""
    near = _near_enough(attempts, search.tolerance)
    q, reasons, labels = solutions.q.copy(), solutions.reasons.copy(), solutions.labels.copy()
    shortfall = np.zeros(q.shape[:2])
    turned = limit_solutions(attempts.chain, _listed(attempts.q[near][:, None]), attempts.begin[near])
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
    position, turn = pose_errors(attempts.chain, attempts.q[near], attempts.targets.rows(near))
    within = np.abs(position).max(axis=1) <= tolerance
    near[near] = within & (np.linalg.norm(turn, axis=1) <= tolerance / orientation_length(attempts.chain))
    return near


def _reason(attempts: _Attempts, row: int, search: SearchOptions) -> str:
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


ELSEWHERE = ", or what the limits of the joints allow"
"""What is added to the choice that `Singular.chosen` tells."""

SAME = 1e-4
"""What is found within this of another branch, in [rad] or [m] of every joint, is that branch."""


def choose_free_joints(chain: Chain, targets: Targets, solutions: Solutions, near: FloatArray) -> Solutions:
    """Return solutions within limits, see `within_limits`, free joints chosen so that limits allow them.

    Where a pose leaves joints free, a branch is a whole family of solutions, and a closed form returns one
    of it. If limits refuse that one, another is searched for from the limits that it is beyond.

    Args:
        chain: The arm.
        targets: n of them.
        solutions: Of a closed form, limits not asked.
        near: Joint values in [rad] or [m], shape (n, joints).
    """
    found = limit_solutions(chain, solutions, near)
    free = np.any([one.where for one in solutions.singular if one.free], axis=0)
    refused = solutions.reached & ~found.reached & free
    if not refused.any():
        return found
    row, column = np.nonzero(refused)
    refined = refine(chain, targets.rows(row), shift_towards_limits(chain, solutions.q[row, column]))
    new = refined.converged & ~_another(refined.q, found, row)
    row, column = row[new], column[new]
    q = solutions.q.copy()
    q[row, column] = refined.q[new]
    singular = tuple(_free_joints_message(one, row, column) for one in solutions.singular)
    return limit_solutions(chain, replace(solutions, q=q, singular=singular), near)


def _another(q: FloatArray, found: Solutions, row: IndexArray) -> BoolArray:
    """Return which joint values, shape (m, joints), are those of another branch of their targets."""
    away = np.abs(wrap_angle(q[:, None] - found.q[row])).max(axis=2)
    return np.asarray((away < SAME).any(axis=1))


def _free_joints_message(family: SingularPoses, row: IndexArray, column: IndexArray) -> SingularPoses:
    """Return a family whose text says, if some of its solutions were chosen by limits, that they were."""
    if not (family.free and family.where[row, column].any()):
        return family
    return replace(family, chosen=family.chosen + ELSEWHERE)
