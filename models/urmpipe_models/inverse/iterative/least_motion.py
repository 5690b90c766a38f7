"""The null-space rule: of all joint values that meet a target, those of least motion from home.

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

from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IndexArray
from urmpipe_models.inverse.iterative.descent import Settings, damped_step
from urmpipe_models.inverse.iterative.small_systems import (
    dot_product,
    factor,
    gram,
    product,
    rows_of,
    transposed_product,
)
from urmpipe_models.inverse.iterative.task import Task

LEAST_MOTION = 1e-6
"""A tangent t of at most this in every joint, in [rad] or [m], counts as none."""

RANK_DAMPING = 1e-13
"""Of J J^T, relative to its trace: singular values below 3e-7 of the norm count as the null space's."""

EXACT = 1e-13
"""What moves come back to in [m] and [rad]: 1e-10 off the target would feign more than a last move gains."""

CORRECTIONS = 6
"""Newton steps to come back onto the target; a move from which more are needed was too long."""

MOST_MOVES = 200
"""Moves along the null space, those too that were not kept."""

LENGTHS = (0.05, 16.0)
"""Shortest and longest step to try, in multiples of t."""

SHORTEST = 1e-6
"""A step shorter than this many t that brings nothing is the last."""

AT_LIMIT = 1e-9
"""A joint this near to its limit, in [rad] or [m], stands at it."""


@dataclass(frozen=True, slots=True, eq=False)
class Tangent:
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

    def kept(self, rows: IndexArray) -> Tangent:
        """Return some of the rows, indices of shape (m,)."""
        return Tangent(rows_of(self.t, rows), self.free[:, rows])

    def where(self, chosen: BoolArray, other: Tangent) -> Tangent:
        """Return the rows that are chosen, a mask of shape (n,), and the other's elsewhere."""
        return Tangent(np.where(chosen, self.t, other.t), np.where(chosen, self.free, other.free))


def tangent(task: Task, q: FloatArray, home: FloatArray, settings: Settings) -> Tangent:
    """Return the way home in the null space of the joints that are free to go it.

    Of the joints that stand at a limit the one that would most come off it is released.

    Args:
        task: The targets.
        q: Joint values that meet them, in [rad] or [m], shape (joints, n).
        home: Where least motion counts from, in [rad] or [m], shape (joints, n).
        settings: The limits.
    """
    J = task.miss(q).jacobian
    low, high = q <= settings.lower[:, None] + AT_LIMIT, q >= settings.upper[:, None] - AT_LIMIT
    free = ~(low | high)
    left = _left(J, home - q, free)
    inward = np.where(low, np.maximum(left, 0.0), np.where(high, np.maximum(-left, 0.0), 0.0))
    released = (inward == inward.max(axis=0)) & (inward > LEAST_MOTION)
    if released.any():
        free |= released
        left = _left(J, home - q, free)
    return Tangent(np.where(free, left, 0.0), free)


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


def settle(task: Task, q: FloatArray, home: FloatArray, settings: Settings) -> tuple[FloatArray, FloatArray]:
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
    now = tangent(task, q, home, settings)
    size = now.size
    rows = np.flatnonzero(size > LEAST_MOTION)
    now, task, length = now.kept(rows), task.kept(rows), np.ones(len(rows))
    for _ in range(MOST_MOVES):
        if not len(rows):
            break
        before, to = rows_of(q, rows), rows_of(home, rows)
        after, kept = _moved(task, before, to, now, length, settings)
        new = tangent(task, after, to, settings)
        length = np.where(kept, _length(after - before, now, new), 0.25 * length)
        now = new.where(kept, now)
        q[:, rows] = np.where(kept, after, before)
        size[rows] = now.size
        going = np.flatnonzero((size[rows] > LEAST_MOTION) & (length > SHORTEST))
        rows, now, task, length = rows[going], now.kept(going), task.kept(going), length[going]
    return q, size


def _moved(
    task: Task, q: FloatArray, home: FloatArray, way: Tangent, length: FloatArray, settings: Settings
) -> tuple[FloatArray, BoolArray]:
    """Return joint values a step along t, back on the target, and where they are nearer to home."""
    after, met = _back(task, q + np.minimum(length, _room(q, way.t, settings)) * way.t, way.free, settings)
    gain = dot_product(q - home, q - home) - dot_product(after - home, after - home)
    return after, met & (gain > 0.0)


def _room(q: FloatArray, t: FloatArray, settings: Settings) -> FloatArray:
    """Return how many times t may be gone until the first joint is at a limit, shape (n,)."""
    limit = np.where(t > 0.0, settings.upper[:, None], settings.lower[:, None])
    room = np.divide(limit - q, t, out=np.full(q.shape, np.inf), where=t != 0.0)
    return np.asarray(room.min(axis=0))


def _back(task: Task, q: FloatArray, free: BoolArray, settings: Settings) -> tuple[FloatArray, BoolArray]:
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


def _length(moved: FloatArray, before: Tangent, after: Tangent) -> FloatArray:
    """Return the next step in multiples of t: |dq|^2 / (dq . -dt), the inverse of the curvature met.

    It is the longest where |q - home|^2 is not convex, and 1 where other joints are held than before.
    """
    bend = dot_product(moved, before.t - after.t)
    length = np.divide(dot_product(moved, moved), bend, out=np.full(bend.shape, LENGTHS[1]), where=bend > 0.0)
    return np.where((before.free == after.free).all(axis=0), np.clip(length, *LENGTHS), 1.0)
