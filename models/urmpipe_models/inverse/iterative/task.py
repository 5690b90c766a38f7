"""What an iterative inverse brings to zero: the tool's distance from its target, and the Jacobian of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IndexArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.iterative.small_systems import dot_product, outer_sum, rows_of
from urmpipe_models.inverse.iterative.tool_motion import Arm, arm_of, tool_motion
from urmpipe_models.inverse.targets import Targets
from urmpipe_models.kinematics.forward import jacobian_over_log
from urmpipe_models.kinematics.singularity import characteristic_length

HALF_TURN_SINE = 1e-6
"""Below this sine an angle near pi takes its axis from the symmetric part of the rotation matrix."""


def turn_length(chain: Chain) -> float:
    """Return the length l in [m] that a radian of orientation counts as: a quarter of the arm's.

    A turn of the tool by a radian is then weighed as a way that the arm makes with ease; the arm's length is
    its `characteristic_length`, which does not depend on where a description puts its frames.
    """
    return characteristic_length(chain) / 4.0


def redundancy(chain: Chain, targets: Targets) -> int:
    """Return how many freedoms a target leaves: joints less the rank of the Jacobian off singular poses."""
    return len(chain.coordinates) - _rank(chain, 3 if targets.rotation is None else 6)


@lru_cache(maxsize=32)
def _rank(chain: Chain, rows: int) -> int:
    """Return the rank of the Jacobian's first rows off singular poses."""
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (8, len(chain.coordinates)))
    return int(np.linalg.matrix_rank(jacobian_over_log(chain, q)[:, :rows], rtol=1e-9).max())


@dataclass(frozen=True, slots=True, eq=False)
class Miss:
    """How far the tool is from its target at joint values q, and how that changes with them.

    The gradient of |e|^2 / 2 is -J^T e at any target. e itself changes by -A J dq: A is 1 for the position,
    and for the rotation vector, of length a, the Jacobian of the logarithm,
    1 + E/2 + (1/a^2 - (1 + cos a) / (2 a sin a)) E^2 with E = [e]x / l, which goes to 1 with a. It is left
    out: it leaves e where it is, so that the gradient is the same without it, and near the target steps are.

    Attributes:
        error: e, shape (3, n) or, of poses, (6, n): target minus tool along x, y, z in [m], then the rotation
            vector that turns the tool into its target, in the world, in [rad], times l in [m].
        jacobian: J of the tool's velocity and, times l, of its angular velocity, in [m/rad] or [-],
            shape (3 or 6, joints, n).
        distance2: |target - tool|^2 in [m2], shape (n,).
        turn2: The square of l times the angle in [m2], shape (n,); 0 where any orientation will do.
        length: l in [m].
    """

    error: FloatArray
    jacobian: FloatArray
    distance2: FloatArray
    turn2: FloatArray
    length: float

    @property
    def square(self) -> FloatArray:
        """|e|^2 in [m2], shape (n,)."""
        return np.asarray(self.distance2 + self.turn2)

    def within(self, metres: float, radians: float) -> BoolArray:
        """Return where position and orientation are as near as that, in [m] and [rad], shape (n,)."""
        return np.asarray((self.distance2 <= metres**2) & (self.turn2 <= (self.length * radians) ** 2))

    def kept(self, rows: IndexArray) -> Miss:
        """Return some of the rows, indices of shape (m,)."""
        error, jacobian = rows_of(self.error, rows), rows_of(self.jacobian, rows)
        return Miss(error, jacobian, self.distance2[rows], self.turn2[rows], self.length)

    def restore(self, rows: IndexArray, before: Miss) -> None:
        """Write another's rows, indices of shape (m,), over some of this one's."""
        for mine, other in (
            (self.error, before.error),
            (self.jacobian, before.jacobian),
            (self.distance2, before.distance2),
            (self.turn2, before.turn2),
        ):
            mine[..., rows] = other[..., rows]


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """The targets of a block of rows.

    Attributes:
        arm: The arm.
        length: l in [m]: see `turn_length`.
        position: x, y, z in [m], shape (3, n).
        columns: The axes that the tool shall take [-], shape (3, 3, n), first index: which; None if any
            orientation will do.
    """

    arm: Arm
    length: float
    position: FloatArray
    columns: FloatArray | None

    def kept(self, rows: IndexArray) -> Task:
        """Return some of the rows, indices of shape (m,)."""
        columns = None if self.columns is None else rows_of(self.columns, rows)
        return replace(self, position=rows_of(self.position, rows), columns=columns)

    def miss(self, q: FloatArray) -> Miss:
        """Return what is missed at joint values q in [rad] or [m], shape (joints, n)."""
        tool = tool_motion(self.arm, q)
        size = 3 if self.columns is None else 6
        error, J = np.empty((size, q.shape[1])), tool.jacobian[:size]
        np.subtract(self.position, tool.position, out=error[:3])
        if self.columns is not None:
            np.multiply(turn_between(tool.columns, self.columns), self.length, out=error[3:])
            J[3:] *= self.length
        turn2 = np.zeros(q.shape[1]) if size == 3 else dot_product(error[3:], error[3:])
        return Miss(error, J, dot_product(error[:3], error[:3]), turn2, self.length)


def task_of(chain: Chain, targets: Targets) -> Task:
    """Return the targets as one array a coordinate."""
    position, columns = np.ascontiguousarray(targets.position.T), None
    if targets.rotation is not None:
        columns = np.ascontiguousarray(targets.rotation.transpose(2, 1, 0))
    return Task(arm_of(chain), turn_length(chain), position, columns)


def turn_between(columns: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the rotation vector u a, 0 <= a <= pi, in [rad], in the world, of R_wanted R^T: shape (3, n).

    With the columns c_k of R and w_k of R_wanted: u sin(a) = sum_k c_k x w_k / 2 and
    1 + 2 cos(a) = sum_k c_k . w_k. Near half a turn the sine leaves no digits for u; there it is the largest
    column of S - cos(a) I with S the symmetric part, which is (1 - cos(a)) u u^T.

    Args:
        columns: Of R [-], shape (3, 3, n), first index: which.
        wanted: Of R_wanted [-], shape (3, 3, n), likewise.
    """
    turn = outer_sum(wanted, columns)
    cosine = 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0)
    vector = 0.5 * np.stack([turn[k, j] - turn[j, k] for j, k in ((1, 2), (2, 0), (0, 1))])
    size = np.sqrt(dot_product(vector, vector))
    angle = np.arctan2(size, cosine)
    vector *= np.divide(angle, size, out=np.ones_like(size), where=size > 0.0)
    half = np.flatnonzero((size < HALF_TURN_SINE) & (cosine < 0.0))
    if len(half):
        vector[:, half] = _half_turns(rows_of(turn, half)) * angle[half]
    return vector


def _half_turns(turn: FloatArray) -> FloatArray:
    """Return the axes u of turns by nearly pi, shape (3, 3, n), for which `turn_between` says how: (3, n)."""
    turn = turn.transpose(2, 0, 1)
    sine = np.stack([turn[:, i - 1, i - 2] - turn[:, i - 2, i - 1] for i in range(3)], axis=1)
    cosine = 0.5 * (np.trace(turn, axis1=1, axis2=2) - 1.0)
    square = 0.5 * (turn + turn.transpose(0, 2, 1)) - cosine[:, None, None] * np.eye(3)
    largest = np.argmax(np.einsum("nii->ni", square), axis=1)
    axis = square[np.arange(len(turn)), largest]
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    axis[(axis * sine).sum(axis=1) < 0.0] *= -1.0
    return np.asarray(axis.T)
