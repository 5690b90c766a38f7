"""From joint values towards the target, step by step: three methods on one block of rows.

The null-space rule: of all joint values that meet a target, those of least motion from home.

Where an arm has more freedoms than a target takes, q is determined by

    minimise |q - home|^2 / 2    with x(q) = target and lower <= q <= upper,

a radian counted as a metre. With J the Jacobian without the columns of joints that are held at a limit, a
solution is a point of least motion where the gradient has no part in the null space of J,

    t = (I - J^+ J) (home - q) = 0,

that is where home - q is J^T lambda, and where no held joint would come off its limit:
home - q - J^T lambda points out there. From a solution the arm moves along t, by the step of Barzilai and
Borwein, back onto the target by Newton's method, and keeps what has brought it nearer to home: what is
found is a minimum, not only stationary, but one near by.

Sources: [NakamuraHanafusa1986]_ (redundancy resolved in the null space); [BarzilaiBorwein1988]_.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IndexArray
from urmpipe_models.ik.task import (
    Task,
    TaskError,
    column_squares,
    dot_product,
    factor,
    gram,
    product,
    take_rows,
    transposed_product,
)

Method = Literal["lm", "dls", "pinv"]

METHODS: tuple[Method, ...] = ("lm", "dls", "pinv")

FIRST_GAIN = 0.1
"""Levenberg-Marquardt starts with mu = 0.1 |e|^2."""

GAINS = (1e-8, 1e8)
"""Between these mu / |e|^2 stays; a row that reaches the upper one finds no better point near it."""

STATIONARY = 1e-7
"""Where the cosine between e and what each free joint can change of it is less, e cannot be made less."""

MIN_GAIN_RATIO = 1e-4
"""A step that gains less of what was foreseen is not taken."""

MAX_STEP = 0.5
"""Of damped least squares and the pseudoinverse, in [rad] or [m] of any joint."""

RANK_CUTOFF = 1e-6
"""Singular values below this part of the largest count as 0 in the pseudoinverse."""


@dataclass(frozen=True, eq=False)
class DescentOptions:
    """How a descent steps and when it has arrived; see `iterative.refine`.

    Attributes:
        lower: Lower limits of the joints in [rad] or [m], shape (joints,); -inf where there is none.
        upper: Upper limits, likewise.
        method: How to step.
        metres: The distance from the target that counts as none in [m].
        radians: The angle from the target that counts as none in [rad].
        damping: Of damped least squares [-]: mu = (damping l)^2.
        stationary: The cosine between e and what any joint can change of it that counts as none [-].
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

    def within(self, q: FloatArray) -> FloatArray:
        """Return joint values q clipped to their limits, both in [rad] or [m], shape (joints, n)."""
        return np.clip(q, self.lower[:, None], self.upper[:, None]) if self.limited else q


@dataclass(frozen=True, slots=True)
class DescentState:
    """How far every row of a batch has come.

    Attributes:
        q: Joint values in [rad] or [m], shape (joints, n).
        gain: mu / |e|^2 of Levenberg-Marquardt, in the unit of J squared over [m2], shape (n,).
        steps: Taken so far, shape (n,).
        distance: |target - tool| in [m], shape (n,).
        angle: Between tool and target in [rad], shape (n,).
        arrived: True where both are within what was asked for, shape (n,).
        ended: True where no step more is to be taken, shape (n,).
    """

    q: FloatArray
    gain: FloatArray
    steps: IndexArray
    distance: FloatArray
    angle: FloatArray
    arrived: BoolArray
    ended: BoolArray

    @classmethod
    def at(cls, q: FloatArray) -> DescentState:
        """Return the progress of rows that have not moved from q in [rad] or [m], shape (n, joints)."""
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
class ActiveRows:
    """The rows of a block that are still on their way.

    Attributes:
        index: Where they stand in the batch, shape (n,).
        task: Their targets.
        q: Joint values in [rad] or [m], shape (joints, n).
        gain: mu / |e|^2 of Levenberg-Marquardt [-], shape (n,).
        miss: At q.
    """

    index: IndexArray
    task: Task
    q: FloatArray
    gain: FloatArray
    miss: TaskError

    def kept(self, rows: IndexArray) -> ActiveRows:
        """Return some of the rows, indices of shape (m,)."""
        task, q, miss = self.task.kept(rows), take_rows(self.q, rows), self.miss.kept(rows)
        return ActiveRows(self.index[rows], task, q, self.gain[rows], miss)


def descend(
    progress: DescentState, task: Task, index: IndexArray, settings: DescentOptions, steps: int
) -> None:
    """Take some rows of a batch up to `steps` steps further; those that have arrived leave early.

    Args:
        progress: Of the batch; the rows at `index` are brought up to date.
        task: The targets of the rows at `index`.
        index: Where the rows stand in the batch, shape (n,).
        settings: How to step.
        steps: The most to take.
    """
    q = take_rows(progress.q, index)
    rows = ActiveRows(index, task, q, progress.gain[index], task.miss(q))
    rows = _parted(progress, rows, _ended(rows, settings), settings)
    for _ in range(steps):
        if not len(rows.index):
            return
        progress.steps[rows.index] += 1
        rows = _stepped(rows, settings)
        rows = _parted(progress, rows, ~_under_way(rows.miss, settings), settings)
    _store(progress, rows, np.arange(len(rows.index)), settings)


def _under_way(miss: TaskError, settings: DescentOptions) -> BoolArray:
    """Return where the target is neither met nor not a number."""
    return np.asarray((miss.square < np.inf) & ~miss.within(settings.metres, settings.radians))


def _ended(rows: ActiveRows, settings: DescentOptions) -> BoolArray:
    """Return where the target is met, is no number, or cannot be come nearer to.

    The gradient of |e|^2 / 2 is -J^T e; joints that are held do not count.
    """
    J = _free(rows, settings)
    slope = transposed_product(J, rows.miss.error)
    moves = slope * slope > settings.stationary**2 * rows.miss.square * column_squares(J)
    going = _under_way(rows.miss, settings) & np.asarray(moves.any(axis=0))
    return np.asarray(~going | (rows.gain >= GAINS[1]))


def _parted(
    progress: DescentState, rows: ActiveRows, leaving: BoolArray, settings: DescentOptions
) -> ActiveRows:
    """Store the rows that leave, and return the others."""
    if not leaving.any():
        return rows
    gone = np.flatnonzero(leaving)
    _store(progress, rows, gone, settings)
    progress.ended[rows.index[gone]] = True
    return rows.kept(np.flatnonzero(~leaving))


def _store(progress: DescentState, rows: ActiveRows, which: IndexArray, settings: DescentOptions) -> None:
    """Write how far some of the rows have come."""
    at, miss = rows.index[which], rows.miss
    progress.q[:, at] = rows.q[:, which]
    progress.gain[at] = rows.gain[which]
    progress.distance[at] = np.sqrt(miss.distance2[which])
    progress.angle[at] = np.sqrt(miss.turn2[which]) / miss.length
    progress.arrived[at] = miss.within(settings.metres, settings.radians)[which]


def _free(rows: ActiveRows, settings: DescentOptions) -> FloatArray:
    """Return J without the joints that stand at a limit and would leave it downhill: J^T e points out."""
    J = rows.miss.jacobian
    if not settings.limited:
        return J
    slope = transposed_product(J, rows.miss.error)
    held = (rows.q <= settings.lower[:, None]) & (slope < 0.0)
    held |= (rows.q >= settings.upper[:, None]) & (slope > 0.0)
    return np.where(held, 0.0, J)


def _stepped(rows: ActiveRows, settings: DescentOptions) -> ActiveRows:
    """Return the rows after one step of the method, within limits."""
    J = _free(rows, settings)
    if settings.method == "lm":
        return _marquardt(rows, J, settings)
    if settings.method == "dls":
        step = damped_step(J, rows.miss.error, (settings.damping * rows.miss.length) ** 2)
    else:
        step = pseudoinverse_step(J, rows.miss.error)
    step *= np.minimum(1.0, MAX_STEP / np.maximum(np.abs(step).max(axis=0), MAX_STEP))
    q = settings.within(rows.q + step)
    return replace(rows, q=q, miss=rows.task.miss(q))


def _marquardt(rows: ActiveRows, J: FloatArray, settings: DescentOptions) -> ActiveRows:
    """Return the rows after a Levenberg-Marquardt step, taken where it comes nearer as was foreseen.

    Foreseen is |e|^2 - |e - J dq|^2; the gain ratio is what was gained of it.
    """
    now, square = rows.miss, rows.miss.square
    q = settings.within(rows.q + damped_step(J, now.error, rows.gain * square))
    left = now.error - product(J, q - rows.q)
    foreseen = square - dot_product(left, left)
    new = rows.task.miss(q)
    gained = square - new.square
    taken = (gained > MIN_GAIN_RATIO * foreseen) & (foreseen > 0.0)  # limits can make it less than 0
    good, poor = taken & (gained > 0.75 * foreseen), ~taken | (gained < 0.25 * foreseen)
    factors = np.where(good, 0.125, np.where(poor, 4.0, 1.0))
    refused = np.flatnonzero(~taken)
    if len(refused):
        q[:, refused] = rows.q[:, refused]
        new.restore(refused, now)
    return replace(rows, q=q, gain=np.clip(rows.gain * factors, *GAINS), miss=new)


def damped_step(J: FloatArray, error: FloatArray, damping: FloatArray | float) -> FloatArray:
    """Return dq = (J^T J + mu I)^-1 J^T e = J^T (J J^T + mu I)^-1 e, by the smaller of the two systems.

    Args:
        J: Metres a unit of each joint, [m/rad] or [-], shape (m, joints, n).
        error: e in [m], shape (m, n).
        damping: mu, in the unit of J squared, shape (n,) or one for all.

    Returns:
        dq in [rad] or [m], shape (joints, n).
    """
    if J.shape[0] <= J.shape[1]:
        return transposed_product(J, factor(gram(J), damping).solve(error))
    return factor(gram(J.transpose(1, 0, 2)), damping).solve(transposed_product(J, error))


def pseudoinverse_step(J: FloatArray, error: FloatArray) -> FloatArray:
    """Return dq = J^+ e, J^+ the Moore-Penrose pseudoinverse by singular values.

    Args:
        J: Metres a unit of each joint, [m/rad] or [-], shape (m, joints, n).
        error: e in [m], shape (m, n).

    Returns:
        dq in [rad] or [m], shape (joints, n).
    """
    inverse = np.linalg.pinv(J.transpose(2, 0, 1), rcond=RANK_CUTOFF).transpose(1, 2, 0)
    return product(np.asarray(inverse, dtype=np.float64), error)


MOTION_TOLERANCE = 1e-6
"""A tangent t of at most this in every joint, in [rad] or [m], counts as none."""

RANK_DAMPING = 1e-13
"""Of J J^T, relative to its trace: singular values below 3e-7 of the norm count as the null space's."""

EXACT = 1e-13
"""What moves come back to in [m] and [rad]: 1e-10 off the target would feign more than a last move gains."""

CORRECTIONS = 6
"""Newton steps to come back onto the target; a move from which more are needed was too long."""

MAX_MOVES = 200
"""Moves along the null space, those too that were not kept."""

LENGTHS = (0.05, 16.0)
"""Shortest and longest step to try, in multiples of t."""

SHORTEST = 1e-6
"""A step shorter than this many t that brings nothing is the last."""

AT_LIMIT_TOLERANCE = 1e-9
"""A joint this near to its limit, in [rad] or [m], stands at it."""


@dataclass(frozen=True, slots=True, eq=False)
class NullSpaceStep:
    """The way home that leaves the tool where it is.

    Attributes:
        t: In [rad] or [m], shape (joints, n).
        free: False of the joints that are held at a limit, shape (joints, n).
    """

    t: FloatArray
    free: BoolArray

    @property
    def size(self) -> FloatArray:
        """The largest entry of t in [rad] or [m], shape (n,)."""
        return np.asarray(np.abs(self.t).max(axis=0))

    def kept(self, rows: IndexArray) -> NullSpaceStep:
        """Return some of the rows, indices of shape (m,)."""
        return NullSpaceStep(take_rows(self.t, rows), self.free[:, rows])

    def where(self, chosen: BoolArray, other: NullSpaceStep) -> NullSpaceStep:
        """Return the rows that are chosen, a mask of shape (n,), and the other's elsewhere."""
        return NullSpaceStep(np.where(chosen, self.t, other.t), np.where(chosen, self.free, other.free))


def null_space_step(task: Task, q: FloatArray, home: FloatArray, settings: DescentOptions) -> NullSpaceStep:
    """Return the way home in the null space of the joints that are free to go it.

    Of the joints that stand at a limit the one that would most come off it is released.

    Args:
        task: The targets.
        q: Joint values that meet them, in [rad] or [m], shape (joints, n).
        home: Where least motion counts from, in [rad] or [m], shape (joints, n).
        settings: The limits.
    """
    J = task.miss(q).jacobian
    low, high = (
        q <= settings.lower[:, None] + AT_LIMIT_TOLERANCE,
        q >= settings.upper[:, None] - AT_LIMIT_TOLERANCE,
    )
    free = ~(low | high)
    left = _left(J, home - q, free)
    inward = np.where(low, np.maximum(left, 0.0), np.where(high, np.maximum(-left, 0.0), 0.0))
    released = (inward == inward.max(axis=0)) & (inward > MOTION_TOLERANCE)
    if released.any():
        free |= released
        left = _left(J, home - q, free)
    return NullSpaceStep(np.where(free, left, 0.0), free)


def _left(J: FloatArray, wish: FloatArray, free: BoolArray) -> FloatArray:
    """Return wish - J^T lambda of all joints with lambda = (J_f J_f^T)^-1 J_f wish_f of the free ones."""
    moving = np.where(free, J, 0.0)
    squares = gram(moving)
    multipliers = factor(squares, RANK_DAMPING * _trace(J)).solve(product(moving, wish))
    return wish - transposed_product(J, multipliers)


def _trace(J: FloatArray) -> FloatArray:
    """Return the trace of J J^T, shape (n,)."""
    entries = J.reshape(-1, J.shape[2])
    return dot_product(entries, entries)


def minimise_motion(
    task: Task, q: FloatArray, home: FloatArray, settings: DescentOptions
) -> tuple[FloatArray, FloatArray]:
    """Return the joint values of least motion near solutions q, and what is left of t there.

    Args:
        task: The targets of n rows.
        q: Joint values that meet them, in [rad] or [m], shape (joints, n).
        home: Where least motion counts from, in [rad] or [m], within limits, shape (joints, n).
        settings: The limits, and when a target is met.

    Returns:
        q, shape (joints, n), and the largest entry of t in [rad] or [m], shape (n,): no more than
        `LEAST_MOTION` but where the arm is so near to a singular pose that its null space has no digits.
    """
    q = q.copy()
    now = null_space_step(task, q, home, settings)
    size = now.size
    rows = np.flatnonzero(size > MOTION_TOLERANCE)
    now, task, length = now.kept(rows), task.kept(rows), np.ones(len(rows))
    for _ in range(MAX_MOVES):
        if not len(rows):
            break
        before, to = take_rows(q, rows), take_rows(home, rows)
        after, kept = _moved(task, before, to, now, length, settings)
        new = null_space_step(task, after, to, settings)
        length = np.where(kept, _length(after - before, now, new), 0.25 * length)
        now = new.where(kept, now)
        q[:, rows] = np.where(kept, after, before)
        size[rows] = now.size
        going = np.flatnonzero((size[rows] > MOTION_TOLERANCE) & (length > SHORTEST))
        rows, now, task, length = rows[going], now.kept(going), task.kept(going), length[going]
    return q, size


def _moved(
    task: Task,
    q: FloatArray,
    home: FloatArray,
    way: NullSpaceStep,
    length: FloatArray,
    settings: DescentOptions,
) -> tuple[FloatArray, BoolArray]:
    """Return joint values a step along t, back on the target, and where they are nearer to home."""
    after, met = _back(task, q + np.minimum(length, _room(q, way.t, settings)) * way.t, way.free, settings)
    gain = dot_product(q - home, q - home) - dot_product(after - home, after - home)
    return after, met & (gain > 0.0)


def _room(q: FloatArray, t: FloatArray, settings: DescentOptions) -> FloatArray:
    """Return how many times t may be gone until the first joint is at a limit, shape (n,)."""
    limit = np.where(t > 0.0, settings.upper[:, None], settings.lower[:, None])
    room = np.divide(limit - q, t, out=np.full(q.shape, np.inf), where=t != 0.0)
    return np.asarray(room.min(axis=0))


def _back(
    task: Task, q: FloatArray, free: BoolArray, settings: DescentOptions
) -> tuple[FloatArray, BoolArray]:
    """Return q back on the target by steps of its free joints, and where it is met."""
    for _ in range(CORRECTIONS):
        miss = task.miss(q)
        exact = miss.within(EXACT, EXACT)
        J = np.where(free, miss.jacobian, 0.0)
        step = damped_step(J, miss.error, RANK_DAMPING * _trace(miss.jacobian))
        q = settings.within(q + np.where(exact, 0.0, step))
        if exact.all():
            break
    return q, task.miss(q).within(settings.metres, settings.radians)


def _length(moved: FloatArray, before: NullSpaceStep, after: NullSpaceStep) -> FloatArray:
    """Return the next step in multiples of t: |dq|^2 / (dq . -dt), the inverse of the curvature met.

    It is the longest where |q - home|^2 is not convex, and 1 where other joints are held than before.
    """
    bend = dot_product(moved, before.t - after.t)
    length = np.divide(dot_product(moved, moved), bend, out=np.full(bend.shape, LENGTHS[1]), where=bend > 0.0)
    return np.where((before.free == after.free).all(axis=0), np.clip(length, *LENGTHS), 1.0)
