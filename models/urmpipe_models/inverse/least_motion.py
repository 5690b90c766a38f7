"""The null-space rule: of all joint values that meet a target, those of least motion from home.

Where an arm has more freedoms than a target takes, q is determined by

    minimise |q - home|^2 / 2    with x(q) = target and lower <= q <= upper,

a radian counted as a metre. With J the Jacobian without the columns of joints that are held at a limit, a
solution is a point of least motion where the gradient has no part in the null space of J,

    t = (I - J^+ J) (home - q) = 0,

that is where home - q is J^T lambda, and where no held joint would come off its limit:
home - q - J^T lambda points out there. From a solution the arm moves along t, by the step of Barzilai and
Borwein, back onto the target by Levenberg-Marquardt, and keeps what has brought it nearer to home: what is
found is a minimum, not only stationary, but one near by.

Sources: [NakamuraHanafusa1986]_ (redundancy resolved in the null space); [BarzilaiBorwein1988]_.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.inverse.descent import Progress, Settings, descend
from urmpipe_models.inverse.small_systems import (
    dot_product,
    factor,
    gram,
    product,
    transposed_product,
)
from urmpipe_models.inverse.task import BoolArray, FloatArray, Task

LEAST_MOTION = 1e-6
"""A tangent t of at most this in every joint, in [rad] or [m], counts as none."""

RANK_DAMPING = 1e-13
"""Of J J^T, relative to its trace: singular values below 3e-7 of the norm count as the null space's."""

EXACT = 1e-13
"""What moves come back to in [m] and [rad]: 1e-10 off the target would feign more than a last move gains."""

CORRECTIONS = 8
"""Steps to come back onto the target; a move from which more are needed was too long."""

MOST_MOVES = 200
"""Moves along the null space, those too that were not kept."""

LENGTHS = (1e-6, 16.0)
"""Shortest and longest step, in multiples of t."""


@dataclass(frozen=True, slots=True)
class Tangent:
    """The way home that leaves the tool where it is.

    Attributes:
        t: In [rad] or [m], shape (joints, n).
        size: The largest entry, shape (n,).
    """

    t: FloatArray
    size: FloatArray


def tangent(task: Task, q: FloatArray, home: FloatArray, settings: Settings) -> Tangent:
    """Return the way home in the null space of the joints that are free to go it.

    Of the joints that stand at a limit the one that would most come off it is released.

    Args:
        task: The targets.
        q: Joint values that meet them, in [rad] or [m], shape (joints, n).
        home: Where least motion counts from, shape (joints, n).
        settings: The limits.
    """
    J = task.miss(q).jacobian
    low, high = q <= settings.lower[:, None], q >= settings.upper[:, None]
    left = _left(J, home - q, ~(low | high))
    inward = np.where(low, np.maximum(left, 0.0), np.where(high, np.maximum(-left, 0.0), 0.0))
    released = (inward == inward.max(axis=0)) & (inward > LEAST_MOTION)
    free = ~(low | high) | released
    if released.any():
        left = _left(J, home - q, free)
    t = np.where(free, left, 0.0)
    return Tangent(t, np.abs(t).max(axis=0))


def _left(J: FloatArray, wish: FloatArray, free: BoolArray) -> FloatArray:
    """Return wish - J^T lambda of all joints with lambda = (J_f J_f^T)^-1 J_f wish_f of the free ones."""
    moving = np.where(free, J, 0.0)
    squares = gram(moving)
    trace = np.maximum(sum(squares[k, k] for k in range(len(squares))), np.finfo(float).tiny)
    multipliers = factor(squares, RANK_DAMPING * trace).solve(product(moving, wish))
    return wish - transposed_product(J, multipliers)


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
    length = np.ones(q.shape[1])
    size = now.size.copy()
    rows = np.flatnonzero(size > LEAST_MOTION)
    t, length, part = now.t[:, rows], length[rows], task.kept(rows)
    for _ in range(MOST_MOVES):
        if not len(rows):
            break
        before, to = q[:, rows], home[:, rows]
        after, kept = _moved(part, before, to, t, length, settings)
        new = tangent(part, after, to, settings)
        longer = _spectral(after - before, t - new.t)
        length = np.clip(np.where(kept, longer, 0.25 * length), *LENGTHS)
        t = np.where(kept, new.t, t)
        q[:, rows] = np.where(kept, after, before)
        size[rows] = np.where(kept, new.size, size[rows])
        going = (size[rows] > LEAST_MOTION) & (length > LENGTHS[0])
        if not going.all():
            rows, t, length, part = rows[going], t[:, going], length[going], part.kept(np.flatnonzero(going))
    return q, size


def _moved(
    task: Task, q: FloatArray, home: FloatArray, t: FloatArray, length: FloatArray, settings: Settings
) -> tuple[FloatArray, BoolArray]:
    """Return joint values a step along t, back on the target, and where they are nearer to home."""
    progress = Progress.at(settings.within(q + length * t).T)
    exact = replace(settings, metres=EXACT, radians=EXACT)
    descend(progress, task, np.arange(len(length)), exact, CORRECTIONS)
    met = (progress.distance <= settings.metres) & (progress.angle <= settings.radians)
    gain = dot_product(q - home, q - home) - dot_product(progress.q - home, progress.q - home)
    return progress.q, met & (gain > 0.0)


def _spectral(moved: FloatArray, turned: FloatArray) -> FloatArray:
    """Return |dq|^2 / (dq . -dt), the longest step where |q - home|^2 is not convex."""
    bend = dot_product(moved, turned)
    return np.where(bend > 0.0, dot_product(moved, moved) / np.where(bend > 0.0, bend, 1.0), LENGTHS[1])
