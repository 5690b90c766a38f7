"""What an iterative inverse brings to zero: the tool's distance from its target, and the Jacobian of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.chain import Chain
from urmpipe_models.elementwise import Element, Vector, add, cross, dot, plus, subtract, times
from urmpipe_models.inverse.targets import Targets
from urmpipe_models.kinematics import jacobian_over_log, pose_and_jacobian
from urmpipe_models.transform import Transform

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.intp]

HALF_TURN_SINE = 1e-6
"""Below this sine an angle near pi takes its axis from the symmetric part of the rotation matrix."""


def characteristic_length(chain: Chain) -> float:
    """Return the length in [m] that a radian of orientation counts as: a quarter of the arm's.

    The arm's length is that of its frames' offsets, one after the other, from the first joint to the tool
    centre point; 1 m of an arm that has none.
    """
    offsets = [joint.origin.translation for joint in chain.joints[1:]]
    offsets += [chain.tip.translation, chain.tool.translation]
    return sum(math.hypot(*offset) for offset in offsets) / 4.0 or 1.0


@dataclass(frozen=True, slots=True)
class Miss:
    """How far the tool is from its target at joint values q, and how that changes with them.

    Attributes:
        error: e, one array a coordinate of the task: target minus tool along x, y, z in [m] and, of a
            pose, the rotation vector that turns the tool into its target, in the world, times the
            characteristic length l in [m/rad] * [rad].
        jacobian: The rows of J with de = -J dq; those of the rotation times l.
        distance2: |target - tool|^2 in [m2].
        turn2: The square of l times the angle in [m2]; 0 where any orientation will do.
        length: l in [m].
    """

    error: list[FloatArray]
    jacobian: list[list[Element]]
    distance2: FloatArray
    turn2: Element
    length: float

    @property
    def square(self) -> FloatArray:
        """|e|^2 in [m2]."""
        return np.asarray(self.distance2 + self.turn2)

    def kept(self, rows: IntArray) -> Miss:
        """Return some of the rows."""
        return Miss(
            picked(self.error, rows),
            [picked(row, rows) for row in self.jacobian],
            self.distance2.take(rows),
            picked([self.turn2], rows)[0],
            self.length,
        )

    def restored(self, rows: IntArray, other: Miss) -> Miss:
        """Return this one with the other's rows at some places: its own arrays, written over there."""
        restore(self.error, other.error, rows)
        for row, before in zip(self.jacobian, other.jacobian, strict=True):
            restore(row, before, rows)
        restore([self.distance2, self.turn2], [other.distance2, other.turn2], rows)
        return self


@dataclass(frozen=True)
class Task:
    """The targets of a block of rows, one array a coordinate.

    Attributes:
        chain: The arm.
        position: x, y, z in [m].
        columns: The axes x, y, z of the frame that the tool shall take; None if any orientation will do.
    """

    chain: Chain
    position: Vector
    columns: tuple[Vector, Vector, Vector] | None

    @cached_property
    def length(self) -> float:
        """The characteristic length in [m]."""
        return characteristic_length(self.chain)

    def kept(self, rows: IntArray) -> Task:
        """Return some of the rows."""
        x, y, z = picked(self.position, rows)
        if self.columns is None:
            return Task(self.chain, (x, y, z), None)
        first, second, third = (tuple(picked(column, rows)) for column in self.columns)
        return Task(self.chain, (x, y, z), (first, second, third))

    def miss(self, q: Sequence[FloatArray]) -> Miss:
        """Return what is missed at joint values q in [rad] or [m], one array a coordinate."""
        pose, columns = pose_and_jacobian(self.chain, q)
        error = list(subtract(self.position, pose.translation))
        rows = [[column[k] for column in columns] for k in range(3)]
        distance2 = dot((error[0], error[1], error[2]), (error[0], error[1], error[2]))
        if self.columns is None:
            return Miss(error, rows, distance2, 0.0, self.length)
        turn = [self.length * value for value in turn_between(pose, self.columns)]
        rows += [[times(self.length, column[k]) for column in columns] for k in range(3, 6)]
        turn2 = dot((turn[0], turn[1], turn[2]), (turn[0], turn[1], turn[2]))
        return Miss(error + turn, rows, distance2, turn2, self.length)


def task_of(chain: Chain, targets: Targets) -> Task:
    """Return the targets as one array a coordinate."""
    x, y, z = np.ascontiguousarray(targets.position.T)
    if targets.rotation is None:
        return Task(chain, (x, y, z), None)
    first, second, third = (tuple(axis) for axis in np.ascontiguousarray(targets.rotation.transpose(2, 1, 0)))
    return Task(chain, (x, y, z), (first, second, third))


def turn_between(pose: Transform, wanted: tuple[Vector, Vector, Vector]) -> list[FloatArray]:
    """Return the rotation vector u a, 0 <= a <= pi, in [rad], in the world, of R_wanted R^T.

    With the columns c_k of R and w_k of R_wanted: u sin(a) = sum_k c_k x w_k / 2 and
    1 + 2 cos(a) = sum_k c_k . w_k. Near half a turn, where the sine leaves no digits for u, it is the
    largest column of (S - cos(a) I) with S the symmetric part.

    Args:
        pose: Of the tool: R.
        wanted: The columns of R_wanted.
    """
    sine: Vector = (0.0, 0.0, 0.0)
    cosine: Element = -1.0
    for column, target in zip(pose.columns, wanted, strict=True):
        sine = add(sine, cross(column, target))
        cosine = plus(cosine, dot(column, target))
    x, y, z = (0.5 * value for value in sine)
    cosine = 0.5 * cosine
    size = np.sqrt(x * x + y * y + z * z)
    factor = np.arctan2(size, cosine) / np.where(size > 0.0, size, 1.0)
    half = (size < HALF_TURN_SINE) & (cosine < 0.0)
    factor = np.where(size > 0.0, factor, 1.0)
    vector = [factor * x, factor * y, factor * z]
    if half.any():
        _fill_half_turns(vector, half, pose, wanted)
    return vector


def redundancy(chain: Chain, targets: Targets) -> int:
    """Return how many freedoms a target leaves: joints less the rank of the Jacobian off singular poses."""
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (8, len(chain.coordinates)))
    J = jacobian_over_log(chain, q)[:, : 3 if targets.rotation is None else 6]
    return len(chain.coordinates) - int(np.linalg.matrix_rank(J, rtol=1e-9).max())


def picked(elements: Sequence[Element], rows: IntArray) -> list[Element]:
    """Return some of the rows of each element; a constant holds for any."""
    return [value.take(rows) if isinstance(value, np.ndarray) else value for value in elements]


def restore(elements: Sequence[Element], before: Sequence[Element], rows: IntArray) -> None:
    """Write what was before over some rows of each element; a constant has not changed."""
    for new, old in zip(elements, before, strict=True):
        if isinstance(new, np.ndarray):
            new[rows] = old[rows]


def _fill_half_turns(
    vector: list[FloatArray], half: BoolArray, pose: Transform, wanted: tuple[Vector, Vector, Vector]
) -> None:
    """Write the rotation vectors of angles near pi, for which `turn_between` says how."""
    count = len(half)
    R = np.array([[np.broadcast_to(v, count)[half] for v in column] for column in pose.columns])
    W = np.array([[v[half] for v in column] for column in wanted])
    turn = np.einsum("kin,kjn->nij", W, R)
    sine = 0.5 * np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], 1
    )
    cosine = 0.5 * (np.trace(turn, axis1=1, axis2=2) - 1.0)
    symmetric = 0.5 * (turn + turn.transpose(0, 2, 1)) - cosine[:, None, None] * np.eye(3)
    largest = np.argmax(np.einsum("nii->ni", symmetric), axis=1)
    axis = symmetric[np.arange(len(turn)), largest]
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    axis *= np.where(np.sum(axis * sine, axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    angle = np.arctan2(np.linalg.norm(sine, axis=1), cosine)
    for k in range(3):
        vector[k][half] = angle * axis[:, k]
