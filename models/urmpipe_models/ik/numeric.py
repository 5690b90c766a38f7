"""Iterative inverse kinematics of any chain, many targets at once, each from its start.

With e the error of the tool and J its Jacobian (`task`), a step is

    Levenberg-Marquardt      dq = J^T (J J^T + mu I)^-1 e, mu = g |e|^2, g by the gain ratio of each row
    damped least squares     the same with mu constant
    pseudoinverse            dq = J^+ e                                   (Moore-Penrose)

The first converges quadratically where the target can be met off singular poses, and to the nearest
point, in the sense of least |e|, where it cannot. The other two are CoppeliaSim's, by which the paper's joint
values were computed. Joints at a limit that would leave it have no column in J.

1. `refine`, the entry: from the starts to the targets, in blocks of rows.
2. `_descend`: steps of one block until each row has arrived or comes no nearer.
3. `minimise_motion`: where an arm has more freedoms than a target takes, the null-space rule determines q by

       minimise |q - home|^2 / 2    with x(q) = target and lower <= q <= upper,

   a radian counted as a metre. With J the Jacobian without the columns of joints at a limit, a
   solution is a point of least motion where the gradient has no part in the null space of J,

       t = (I - J^+ J) (home - q) = 0,

   that is where home - q is J^T lambda, and where no joint at a limit would leave it:
   home - q - J^T lambda points out there. From a solution the arm moves along t, by the step of Barzilai and
   Borwein, back onto the target by Newton's method, and keeps what has brought it nearer to home: the result
   is a minimum, not only stationary, but a local one.

Sources: [UrmArm2021]_ section 1; [Wampler1986]_; [NakamuraHanafusa1986]_ (damping; redundancy resolved in the
null space); [FanYuan2005]_ (mu = g |e|^2); [KanzowYamashitaFukushima2004]_ (projected steps);
[BarzilaiBorwein1988]_ (length of the null-space step).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import THREADS, BoolArray, FloatArray, IndexArray, map_blocks, row_blocks
from urmpipe_models.errors import Finding, OptionError, format_value
from urmpipe_models.ik.limits import joint_limits, joint_periods
from urmpipe_models.ik.solutions import Targets
from urmpipe_models.ik.task import (
    Task,
    TaskError,
    build_task,
    column_squares,
    dot_product,
    factor,
    gram,
    orientation_length,
    product,
    redundancy,
    take_rows,
    transposed_product,
)

Method = Literal["lm", "dls", "pinv"]
METHODS: tuple[Method, ...] = ("lm", "dls", "pinv")

BATCH_SIZE = 4096  # rows of a block: its hundred or so arrays stay in a core's cache
ROUND = 6  # steps after which the rows of all blocks that have not ended are gathered into new blocks

FIRST_GAIN = 0.1  # Levenberg-Marquardt starts with mu = 0.1 |e|^2
GAINS = (1e-8, 1e8)  # range of mu / |e|^2; a row at the upper end finds no better point near it
STATIONARY = 1e-7  # cosine between e and its change by any free joint; below, e cannot be made smaller
MIN_GAIN_RATIO = 1e-4  # a step that gains less of the predicted decrease is rejected
MAX_STEP = 0.5  # [rad] or [m] of any joint, in damped least squares and the pseudoinverse
RANK_CUTOFF = 1e-6  # of the largest singular value; smaller ones count as 0 in the pseudoinverse

MOTION_TOLERANCE = 1e-6  # [rad] or [m]; a null-space step t of at most this in every joint counts as 0
RANK_DAMPING = 1e-13  # of the trace of J J^T: singular values below 3e-7 of the norm belong to the null space
EXACT = 1e-13  # [m] and [rad]; error after moves; with 1e-10 it looks larger than a last move gains
CORRECTIONS = 6  # Newton steps back onto the target; a move that needs more was too long
MAX_MOVES = 200  # along the null space, with those that were rejected
LENGTHS = (0.05, 16.0)  # shortest and longest step to try, in multiples of t
MIN_LENGTH = 1e-6  # in multiples of t; a rejected step shorter than this is the last
AT_LIMIT_TOLERANCE = 1e-9  # [rad] or [m]; a joint this near to its limit is at it


@dataclass(frozen=True, slots=True, eq=False)
class RefinementResult:
    """Joint values at the end of the rows of a batch, and the remaining errors.

    Attributes:
        q: Joint values in [rad] or [m], within their limits, shape (n, joints).
        converged: True where the tool meets its target, shape (n,).
        iterations: Steps taken, shape (n,).
        distance: |target - tool| in [m], shape (n,).
        angle: Between tool and target in [rad], 0 where any orientation is allowed, shape (n,).
        residual: |e| = sqrt(distance^2 + (l angle)^2) in [m], shape (n,); NaN of a target that is not finite.
        slack: Of an arm with more freedoms than the target takes: the largest entry of the null-space step t
            in [rad] or [m], shape (n,).
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
    """Return joint values that bring the tool to its targets, or as near as possible from the starts.

    Args:
        chain: The arm.
        targets: n of them.
        q: Starts in [rad] or [m], shape (joints,) or (n, joints); clipped to the limits.
        home: Origin of least motion in [rad] or [m], shaped as q; q by default.
        method: lm (Levenberg-Marquardt), dls (damped least squares) or pinv (pseudoinverse).
        metres: The distance from the target that counts as none in [m].
        radians: The angle from the target that counts as none in [rad].
        iterations: The most steps a row takes.
        damping: Of damped least squares: mu = (damping l)^2.
        stationary: A row ends where the cosine between e and its change by any free joint is less:
            the smaller, the nearer to the nearest point.
        threads: Blocks solved in parallel.

    Raises:
        OptionError: If the method or the shape of q is not one of the above.
    """
    lower, upper = joint_limits(chain)
    begin = np.clip(_checked_starts(chain, targets, q, method), lower, upper)
    options = DescentOptions(lower, upper, method, metres, radians, damping, stationary)
    state = _State.at(begin)
    _run(state, chain, targets, options, iterations, threads)
    slack = np.zeros(len(targets))
    if redundancy(chain, targets):
        goal = begin if home is None else np.clip(_checked_starts(chain, targets, home, method), lower, upper)
        slack = _minimise_motion(state, chain, targets, goal, options, threads)
    residual = np.hypot(state.distance, orientation_length(chain) * state.angle)
    return RefinementResult(
        state.q.T, state.arrived, state.steps, state.distance, state.angle, residual, slack
    )


def _checked_starts(chain: Chain, targets: Targets, q: FloatArray, method: str) -> FloatArray:
    """Return one start per target."""
    shape = (len(targets), len(chain.coordinates))
    faults = []
    if method not in METHODS:
        faults.append(Finding(parameter="method", found=format_value(method), allowed=", ".join(METHODS)))
    if np.shape(q) not in {shape, shape[1:]}:
        shape_text, allowed = f"an array of shape {np.shape(q)}", f"{shape[1:]} or {shape}"
        faults.append(Finding(parameter="starts", found=shape_text, allowed=allowed))
    if faults:
        raise OptionError(*faults)
    return np.broadcast_to(np.asarray(q, dtype=float), shape)


def _run(
    state: _State,
    chain: Chain,
    targets: Targets,
    options: DescentOptions,
    iterations: int,
    threads: int,
) -> None:
    finite = np.isfinite(targets.position).all(axis=1)
    if targets.rotation is not None:
        finite &= np.isfinite(targets.rotation).all(axis=(1, 2))
    pending = np.flatnonzero(finite & np.isfinite(state.q).all(axis=0))
    task = build_task(chain, targets)

    def work(index: IndexArray) -> None:
        _descend(state, task.rows(index), index, options, steps)

    for done in range(0, iterations, ROUND):
        steps = min(ROUND, iterations - done)
        map_blocks(work, [pending[rows] for rows in row_blocks(len(pending), BATCH_SIZE)], threads)
        pending = pending[~state.ended[pending]]
        if not len(pending):
            return


def _minimise_motion(
    state: _State,
    chain: Chain,
    targets: Targets,
    home: FloatArray,
    options: DescentOptions,
    threads: int,
) -> FloatArray:
    """Bring the rows that have arrived to points of least motion; return the largest entries of t."""
    slack = np.zeros(len(targets))
    arrived = np.flatnonzero(state.arrived)
    period = joint_periods(chain)[:, None]
    endless = np.isfinite(period)
    period = np.where(endless, period, 1.0)
    turns = np.round((state.q[:, arrived] - home.T[:, arrived]) / period)
    state.q[:, arrived] -= np.where(endless, period * turns, 0.0)  # whole turns from home

    def work(index: IndexArray) -> None:
        task = build_task(chain, targets.rows(index))
        q, to = take_rows(state.q, index), np.ascontiguousarray(home[index].T)
        state.q[:, index], slack[index] = minimise_motion(task, q, to, options)

    map_blocks(work, [arrived[rows] for rows in row_blocks(len(arrived), BATCH_SIZE)], threads)
    return slack


@dataclass(frozen=True, eq=False)
class DescentOptions:
    """Options of the steps and of their end; see `refine`.

    Attributes:
        lower: Lower limits of the joints in [rad] or [m], shape (joints,); -inf where there is none.
        upper: Upper limits in [rad] or [m], shape (joints,); inf where there is none.
        method: Of the steps.
        metres: The distance from the target that counts as none in [m].
        radians: The angle from the target that counts as none in [rad].
        damping: Of damped least squares [-]: mu = (damping l)^2.
        stationary: The cosine between e and its change by any joint that counts as none [-].
    """

    lower: FloatArray
    upper: FloatArray
    method: Method = "lm"
    metres: float = 1e-10
    radians: float = 1e-10
    damping: float = 0.05
    stationary: float = STATIONARY

    @cached_property
    def limited(self) -> bool:
        """Whether any joint has a limit."""
        return bool(np.isfinite(self.lower).any() or np.isfinite(self.upper).any())

    def clip(self, q: FloatArray) -> FloatArray:
        """Return joint values q clipped to their limits, both in [rad] or [m], shape (joints, n)."""
        return np.clip(q, self.lower[:, None], self.upper[:, None]) if self.limited else q


@dataclass(frozen=True, slots=True)
class _State:
    """The state of every row of a batch."""

    q: FloatArray  # joint values in [rad] or [m], shape (joints, n)
    gain: FloatArray  # mu / |e|^2 of Levenberg-Marquardt, in the unit of J squared over [m2], shape (n,)
    steps: IndexArray  # taken so far, shape (n,)
    distance: FloatArray  # |target - tool| in [m], shape (n,)
    angle: FloatArray  # between tool and target in [rad], shape (n,)
    arrived: BoolArray  # true where both are within their tolerances, shape (n,)
    ended: BoolArray  # true where no further step is taken, shape (n,)

    @classmethod
    def at(cls, q: FloatArray) -> _State:
        n = len(q)
        return cls(
            np.array(q.T, order="C"),
            np.full(n, FIRST_GAIN),
            np.zeros(n, np.intp),
            np.full(n, np.nan),
            np.full(n, np.nan),
            np.zeros(n, np.bool_),
            np.zeros(n, np.bool_),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _ActiveRows:
    """The rows of a block that have not ended."""

    index: IndexArray  # their indices in the batch, shape (n,)
    task: Task  # their targets
    q: FloatArray  # joint values in [rad] or [m], shape (joints, n)
    gain: FloatArray  # mu / |e|^2 of Levenberg-Marquardt [-], shape (n,)
    error: TaskError  # at q

    def rows(self, rows: IndexArray) -> _ActiveRows:
        task, q, error = self.task.rows(rows), take_rows(self.q, rows), self.error.rows(rows)
        return _ActiveRows(self.index[rows], task, q, self.gain[rows], error)


def _descend(state: _State, task: Task, index: IndexArray, options: DescentOptions, steps: int) -> None:
    """Take the rows of a batch at `index` up to `steps` steps further; those that have ended leave early."""
    q = take_rows(state.q, index)
    rows = _ActiveRows(index, task, q, state.gain[index], task.error(q))
    rows = _drop_rows(state, rows, _has_ended(rows, options), options)
    for _ in range(steps):
        if not len(rows.index):
            return
        state.steps[rows.index] += 1
        rows = _step(rows, options)
        rows = _drop_rows(state, rows, ~_is_under_way(rows.error, options), options)
    _store(state, rows, np.arange(len(rows.index)), options)


def _is_under_way(error: TaskError, options: DescentOptions) -> BoolArray:
    """Return where the target is a number and not yet met."""
    return np.asarray((error.square < np.inf) & ~error.within(options.metres, options.radians))


def _has_ended(rows: _ActiveRows, options: DescentOptions) -> BoolArray:
    """Return where the target is met or not a number, or where e cannot be made smaller.

    The gradient of |e|^2 / 2 is -J^T e; joints at a limit that would leave it do not count.
    """
    J = _free_jacobian(rows, options)
    slope = transposed_product(J, rows.error.vector)
    moves = slope * slope > options.stationary**2 * rows.error.square * column_squares(J)
    going = _is_under_way(rows.error, options) & np.asarray(moves.any(axis=0))
    return np.asarray(~going | (rows.gain >= GAINS[1]))


def _drop_rows(state: _State, rows: _ActiveRows, leaving: BoolArray, options: DescentOptions) -> _ActiveRows:
    """Store the rows that leave, and return the remaining ones."""
    if not leaving.any():
        return rows
    ended = np.flatnonzero(leaving)
    _store(state, rows, ended, options)
    state.ended[rows.index[ended]] = True
    return rows.rows(np.flatnonzero(~leaving))


def _store(state: _State, rows: _ActiveRows, which: IndexArray, options: DescentOptions) -> None:
    at, error = rows.index[which], rows.error
    state.q[:, at] = rows.q[:, which]
    state.gain[at] = rows.gain[which]
    state.distance[at] = np.sqrt(error.distance2[which])
    state.angle[at] = np.sqrt(error.angle2[which]) / error.length
    state.arrived[at] = error.within(options.metres, options.radians)[which]


def _free_jacobian(rows: _ActiveRows, options: DescentOptions) -> FloatArray:
    """Return J without the joints at a limit that would leave it downhill: J^T e points out."""
    J = rows.error.jacobian
    if not options.limited:
        return J
    slope = transposed_product(J, rows.error.vector)
    blocked = (rows.q <= options.lower[:, None]) & (slope < 0.0)
    blocked |= (rows.q >= options.upper[:, None]) & (slope > 0.0)
    return np.where(blocked, 0.0, J)


def _step(rows: _ActiveRows, options: DescentOptions) -> _ActiveRows:
    J = _free_jacobian(rows, options)
    if options.method == "lm":
        return _marquardt(rows, J, options)
    if options.method == "dls":
        step = damped_step(J, rows.error.vector, (options.damping * rows.error.length) ** 2)
    else:
        step = _pseudoinverse_step(J, rows.error.vector)
    step *= np.minimum(1.0, MAX_STEP / np.maximum(np.abs(step).max(axis=0), MAX_STEP))
    q = options.clip(rows.q + step)
    return replace(rows, q=q, error=rows.task.error(q))


def _marquardt(rows: _ActiveRows, J: FloatArray, options: DescentOptions) -> _ActiveRows:
    """Return the rows after a Levenberg-Marquardt step, taken where it gains enough of the prediction.

    Predicted is |e|^2 - |e - J dq|^2; the gain ratio is the actual decrease over it.
    """
    now, square = rows.error, rows.error.square
    q = options.clip(rows.q + damped_step(J, now.vector, rows.gain * square))
    remaining = now.vector - product(J, q - rows.q)
    predicted = square - dot_product(remaining, remaining)
    new = rows.task.error(q)
    gained = square - new.square
    taken = (gained > MIN_GAIN_RATIO * predicted) & (predicted > 0.0)  # limits can make it negative
    good, poor = taken & (gained > 0.75 * predicted), ~taken | (gained < 0.25 * predicted)
    factors = np.where(good, 0.125, np.where(poor, 4.0, 1.0))
    refused = np.flatnonzero(~taken)
    if len(refused):
        q[:, refused] = rows.q[:, refused]
        new.restore(refused, now)
    return replace(rows, q=q, gain=np.clip(rows.gain * factors, *GAINS), error=new)


def damped_step(J: FloatArray, error: FloatArray, damping: FloatArray | float) -> FloatArray:
    """Return dq = (J^T J + mu I)^-1 J^T e = J^T (J J^T + mu I)^-1 e, by the smaller of the two systems.

    Args:
        J: In metres per unit of each joint, [m/rad] or [-], shape (m, joints, n).
        error: e in [m], shape (m, n).
        damping: mu, in the unit of J squared, shape (n,) or one for all.

    Returns:
        dq in [rad] or [m], shape (joints, n).
    """
    if J.shape[0] <= J.shape[1]:
        return transposed_product(J, factor(gram(J), damping).solve(error))
    return factor(gram(J.transpose(1, 0, 2)), damping).solve(transposed_product(J, error))


def _pseudoinverse_step(J: FloatArray, error: FloatArray) -> FloatArray:
    """Return dq = J^+ e in [rad] or [m], shape (joints, n), J^+ by singular values."""
    inverse = np.linalg.pinv(J.transpose(2, 0, 1), rcond=RANK_CUTOFF).transpose(1, 2, 0)
    return product(np.asarray(inverse, dtype=np.float64), error)


def minimise_motion(
    task: Task, q: FloatArray, home: FloatArray, options: DescentOptions
) -> tuple[FloatArray, FloatArray]:
    """Return the joint values of least motion near solutions q, and the remaining t.

    Args:
        task: The targets of n rows.
        q: Joint values that meet them, in [rad] or [m], shape (joints, n).
        home: Origin of least motion, in [rad] or [m], within limits, shape (joints, n).
        options: The limits, and when a target is met.

    Returns:
        q, shape (joints, n), and the largest entry of t in [rad] or [m], shape (n,): no more than
        `MOTION_TOLERANCE` except where the null space has no digits, next to a singular pose.
    """
    q = q.copy()
    now = _null_space_step(task, q, home, options)
    size = now.size
    rows = np.flatnonzero(size > MOTION_TOLERANCE)
    now, task, length = now.rows(rows), task.rows(rows), np.ones(len(rows))
    for _ in range(MAX_MOVES):
        if not len(rows):
            break
        before, to = take_rows(q, rows), take_rows(home, rows)
        after, accepted = _move(task, before, to, now, length, options)
        new = _null_space_step(task, after, to, options)
        length = np.where(accepted, _length(after - before, now, new), 0.25 * length)
        now = new.where(accepted, now)
        q[:, rows] = np.where(accepted, after, before)
        size[rows] = now.size
        active = np.flatnonzero((size[rows] > MOTION_TOLERANCE) & (length > MIN_LENGTH))
        rows, now, task, length = rows[active], now.rows(active), task.rows(active), length[active]
    return q, size


@dataclass(frozen=True, slots=True, eq=False)
class _NullSpaceStep:
    """The step towards home that leaves the tool where it is."""

    t: FloatArray  # [rad] or [m], shape (joints, n)
    free: BoolArray  # false of the joints that are kept at a limit, shape (joints, n)

    @property
    def size(self) -> FloatArray:
        return np.asarray(np.abs(self.t).max(axis=0))

    def rows(self, rows: IndexArray) -> _NullSpaceStep:
        """Return some of the rows, indices of shape (m,)."""
        return _NullSpaceStep(take_rows(self.t, rows), self.free[:, rows])

    def where(self, selected: BoolArray, other: _NullSpaceStep) -> _NullSpaceStep:
        return _NullSpaceStep(np.where(selected, self.t, other.t), np.where(selected, self.free, other.free))


def _null_space_step(task: Task, q: FloatArray, home: FloatArray, options: DescentOptions) -> _NullSpaceStep:
    """Return the step towards home in the null space of the joints that are free to move, shape (joints, n).

    Of the joints at a limit the one that would move inwards most is released.
    """
    J = task.error(q).jacobian
    low, high = (
        q <= options.lower[:, None] + AT_LIMIT_TOLERANCE,
        q >= options.upper[:, None] - AT_LIMIT_TOLERANCE,
    )
    free = ~(low | high)
    remainder = _remainder(J, home - q, free)
    inward = np.where(low, np.maximum(remainder, 0.0), np.where(high, np.maximum(-remainder, 0.0), 0.0))
    released = (inward == inward.max(axis=0)) & (inward > MOTION_TOLERANCE)
    if released.any():
        free |= released
        remainder = _remainder(J, home - q, free)
    return _NullSpaceStep(np.where(free, remainder, 0.0), free)


def _remainder(J: FloatArray, wish: FloatArray, free: BoolArray) -> FloatArray:
    """Return wish - J^T lambda of all joints with lambda = (J_f J_f^T)^-1 J_f wish_f of the free ones."""
    moving = np.where(free, J, 0.0)
    squares = gram(moving)
    multipliers = factor(squares, RANK_DAMPING * _trace(J)).solve(product(moving, wish))
    return wish - transposed_product(J, multipliers)


def _trace(J: FloatArray) -> FloatArray:
    """Return the trace of J J^T, shape (n,)."""
    entries = J.reshape(-1, J.shape[2])
    return dot_product(entries, entries)


def _move(
    task: Task,
    q: FloatArray,
    home: FloatArray,
    step: _NullSpaceStep,
    length: FloatArray,
    options: DescentOptions,
) -> tuple[FloatArray, BoolArray]:
    """Return joint values a step along t, back on the target, and where they are nearer to home."""
    limit = np.where(step.t > 0.0, options.upper[:, None], options.lower[:, None])
    room = np.divide(limit - q, step.t, out=np.full(q.shape, np.inf), where=step.t != 0.0)
    length = np.minimum(length, np.asarray(room.min(axis=0)))  # until the first joint is at a limit
    after, met = _return_to_target(task, q + length * step.t, step.free, options)
    gain = dot_product(q - home, q - home) - dot_product(after - home, after - home)
    return after, met & (gain > 0.0)


def _return_to_target(
    task: Task, q: FloatArray, free: BoolArray, options: DescentOptions
) -> tuple[FloatArray, BoolArray]:
    """Return q back on the target by steps of its free joints, and where it is met."""
    for _ in range(CORRECTIONS):
        error = task.error(q)
        exact = error.within(EXACT, EXACT)
        J = np.where(free, error.jacobian, 0.0)
        step = damped_step(J, error.vector, RANK_DAMPING * _trace(error.jacobian))
        q = options.clip(q + np.where(exact, 0.0, step))
        if exact.all():
            break
    return q, task.error(q).within(options.metres, options.radians)


def _length(displacement: FloatArray, before: _NullSpaceStep, after: _NullSpaceStep) -> FloatArray:
    """Return the next step in multiples of t: |dq|^2 / (dq . -dt), the inverse of the curvature.

    It is the longest where |q - home|^2 is not convex, and 1 where other joints are at limits than before.
    """
    bend = dot_product(displacement, before.t - after.t)
    length = np.divide(
        dot_product(displacement, displacement), bend, out=np.full(bend.shape, LENGTHS[1]), where=bend > 0.0
    )
    return np.where((before.free == after.free).all(axis=0), np.clip(length, *LENGTHS), 1.0)
