"""Least motion from sample to sample: one Newton sweep over a window of samples at once.

Of a path x_1, x_2, ... an arm with more freedoms than the path asks for takes

    q_k = argmin |q - q_{k-1}|^2   subject to   FK(q) = x_k,

each sample after the one before. Solved one after the other every sample would wait for its forward
kinematics and Jacobian, which cost about as much for one row as for hundreds. A sweep does these for all
samples of the window in one pass, each at its own guess p_k, and only then goes through the samples, by the
exact solution of the linearised problem with e_k = x_k - FK(p_k):

    q_k = p_k + N_k s_k + J_k^# e_k,    s_k = q_{k-1} - p_k,    N_k = 1 - J_k^# J_k,
    J^# = J^T (J J^T + lambda^2 1)^-1.

Sweeps repeated are Newton's method in all samples at once: what they converge to solves

    q_k - q_{k-1} = J_k^T y_k,    y_k = (x_k - FK(q_k)) / lambda^2,

the condition for least |q - q_{k-1}|^2 + |x_k - FK(q)|^2 / lambda^2. This is least motion with a miss of
lambda^2 d / sigma for a step of d along a direction of singular value sigma, and defined on singular poses,
where least motion alone is not: there a path written to the nanometre would ask for steps of its rounding
divided by sigma. Metres and radians of q weigh alike.

A joint held on a limit has no column in J; J_h^T y_k then says which way it would move if it were free.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.inverse.iterative.small_systems import Factor, factor, gram, product, transposed_product
from urmpipe_models.inverse.iterative.task import Miss, Task

DAMPING = 1e-8
"""lambda^2 in [m2/rad2]."""

SHARE = 4
"""Sections of a recurrence, in multiples of their length: products of matrices cost more than vectors."""


@dataclass(frozen=True, slots=True, eq=False)
class Swept:
    """What a sweep found for the samples of a window.

    Attributes:
        q: Joint values in [rad] or [m], shape (w, joints).
        miss: |x - FK| at the guess that it was linearised at, in [m], rotations times
            `turn_length`, shape (w,).
        pull: J^T y: where each joint would move if it were free, in [rad] or [m], shape (w, joints); None
            where all are.
    """

    q: FloatArray
    miss: FloatArray
    pull: FloatArray | None


def sweep(task: Task, guess: FloatArray, last: FloatArray, held: FloatArray, damping: FloatArray) -> Swept:
    """Return the next guess at the joint values of a window of samples.

    Args:
        task: Targets of the window.
        guess: Joint values in [rad] or [m], shape (w, joints), of joints that are held where they are held.
        last: Joint values of the sample before the window, in [rad] or [m], shape (joints,).
        held: Where a joint is held in [rad] or [m], NaN of one that is free, shape (joints,).
        damping: lambda^2 of each sample in [m2/rad2], shape (w,).
    """
    miss = task.miss(np.ascontiguousarray(guess.T))
    free = np.isnan(held)
    J = miss.jacobian * free[:, None]
    system = factor(gram(J), damping)
    columns = Factor(system.lower[:, :, None], system.inverse[:, None]).solve(J)
    null = np.eye(len(held)) - _rows(columns.transpose(1, 0, 2)) @ _rows(J)
    before = np.vstack((np.where(free, last, held), guess[:-1])) - guess
    q = guess + _in_turn(null, before, transposed_product(J, system.solve(miss.error)).T)
    pull = None if free.all() else _pull(system, miss, J, np.vstack((before[:1], q[:-1] - guess[1:])))
    return Swept(q, np.sqrt(miss.square), pull)


def _in_turn(null: FloatArray, before: FloatArray, towards: FloatArray) -> FloatArray:
    """Return c_k = N_k c_{k-1} + N_k (p_{k-1} - p_k) + J_k^# e_k, the corrections q_k - p_k.

    Args:
        null: N_k, shape (w, joints, joints).
        before: p_{k-1} - p_k, of the first sample q_0 - p_1, shape (w, joints).
        towards: J_k^# e_k, shape (w, joints).
    """
    return recurrence(null, (null @ before[:, :, None])[:, :, 0] + towards)


def recurrence(matrices: FloatArray, offsets: FloatArray) -> FloatArray:
    """Return c_k = M_k c_{k-1} + a_k with c before the first 0, in any unit, shape (w, m).

    The samples are cut into sections. Side by side each section becomes one map from what it begins with:
    the product of its matrices and what its offsets come to. Only from section to section one waits for the
    other.

    Args:
        matrices: M_k [-], shape (w, m, m), of norms of at most about 1: products of them stay small.
        offsets: a_k in any unit, which is that of c_k, shape (w, m).
    """
    count, size = offsets.shape
    length = max(1, math.isqrt(count // SHARE))
    sections = -(-count // length)
    products, sums = np.zeros((sections * length, size, size)), np.zeros((sections * length, size, 1))
    products[:count], sums[:count, :, 0] = matrices, offsets
    products, sums = products.reshape(sections, length, size, size), sums.reshape(sections, length, size, 1)
    for k in range(1, length):
        sums[:, k] += products[:, k] @ sums[:, k - 1]
        products[:, k] = products[:, k] @ products[:, k - 1]
    begins = np.zeros((sections, 1, size, 1))
    for k in range(1, sections):
        begins[k, 0] = products[k - 1, -1] @ begins[k - 1, 0] + sums[k - 1, -1]
    return np.asarray((products @ begins + sums).reshape(-1, size)[:count])


def _pull(system: Factor, miss: Miss, J: FloatArray, s: FloatArray) -> FloatArray:
    """Return J^T y of every joint, held ones too: y = (J J^T + lambda^2 1)^-1 (e - J s)."""
    y = system.solve(miss.error - product(J, np.ascontiguousarray(s.T)))
    return transposed_product(miss.jacobian, y).T


def _rows(matrices: FloatArray) -> FloatArray:
    """Return matrices of shape (k, p, w) one after the other, shape (w, k, p)."""
    return np.ascontiguousarray(matrices.transpose(2, 0, 1))
