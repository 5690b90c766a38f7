"""Error of the tool at its target, which iterative inverses bring to zero, and its Jacobian, for many rows.

1. Linear algebra of small systems. `numpy.linalg.solve` calls LAPACK once per system, which costs more than
   the Jacobian of an arm with six joints. Here a matrix is an array of shape (k, k, n), so that the n
   values of an entry are contiguous and each elimination is a few NumPy operations on all systems. Sums run
   term by term (`_sum`): their rounding must not depend on n, or the result of a row would depend on the
   rows solved with it. Entries may be in any unit.
2. `tool_motion`: pose and Jacobian of the tool. Every joint turns about the z axis of its frame, or slides
   along it,

       T = C_0 Z(q_1) C_1 Z(q_2) ... Z(q_n) C_n,

   with constant transforms C that hold the rest: base, origins, directions of the axes, frames that carry a
   sensor, tip and tool. Products with their 0 and 1 are omitted. x, y and z of a vector are one array of
   shape (3, n), numbers only, which costs a tenth of `kinematics` for a batch of a few rows.
3. `Task.error`: e and J at joint values q, with

       e = (x_target - x, l u a),    u a the rotation vector of R_target R^T (`rotation_error`),

   and l the length that a radian counts as (`orientation_length`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import BoolArray, FloatArray, IndexArray, Vector, add, cross, scale
from urmpipe_models.ik.solutions import Targets
from urmpipe_models.kinematics.forward import jacobian_over_log, joint_values
from urmpipe_models.kinematics.singularity import characteristic_length
from urmpipe_models.math3d import Transform

# Below it an angle near pi takes its axis from the symmetric part of the rotation matrix.
HALF_TURN_SINE = 1e-6

Terms: TypeAlias = tuple[tuple[int, float], ...]  # entries of a constant vector that are not 0: index, value
Columns: TypeAlias = tuple[
    FloatArray, FloatArray, FloatArray
]  # axes of a frame, each (3, n) or, constant, (3, 1)


class LDLFactor(NamedTuple):
    """A = L D L^T, the Cholesky factor without square roots.

    Attributes:
        lower: L below its diagonal of ones [-], shape (k, k, n); other entries are not used.
        inverse: 1 / D_i in one over the unit of A, shape (k, n).
    """

    lower: FloatArray
    inverse: FloatArray

    def solve(self, b: FloatArray) -> FloatArray:
        """Return x of A x = b, both of shape (k, n), b in any unit, x in that over the unit of A."""
        x = np.array(b)
        for j in range(len(x) - 1):
            x[j + 1 :] -= self.lower[j + 1 :, j] * x[j]
        x *= self.inverse
        for j in range(len(x) - 1, 0, -1):
            x[:j] -= self.lower[j, :j] * x[j]
        return x


def factor(A: FloatArray, damping: FloatArray | float = 0.0) -> LDLFactor:
    """Return the factor of A + mu I.

    Where A is positive semidefinite no pivot D_i is less than mu. Pivots are limited to that against
    rounding, so the factor is finite for any such A if mu > 0.

    Args:
        A: Symmetric, in any unit, shape (k, k, n); positive definite where mu is 0.
        damping: mu in the same unit, not negative, shape (n,) or one for all.
    """
    lower, scaled, inverse = np.empty(A.shape), np.empty(A.shape), np.empty(A.shape[1:])
    for j in range(len(A)):
        column = A[j:, j] - product(lower[j:, :j], scaled[j, :j]) if j else A[:, 0]
        np.divide(1.0, np.maximum(column[0] + damping, damping), out=inverse[j])
        scaled[j + 1 :, j] = column[1:]
        np.multiply(column[1:], inverse[j], out=lower[j + 1 :, j])
    return LDLFactor(lower, inverse)


def gram(M: FloatArray) -> FloatArray:
    """Return M M^T, shape (k, k, n), of matrices of shape (k, p, n) in any unit."""
    return _sum("ipn,jpn->ijn", M, M)


def product(M: FloatArray, x: FloatArray) -> FloatArray:
    """Return M x, shape (k, n), of matrices of shape (k, p, n) and vectors of shape (p, n) in any unit."""
    return _sum("kpn,pn->kn", M, x)


def transposed_product(M: FloatArray, x: FloatArray) -> FloatArray:
    """Return M^T x, shape (p, n), of matrices of shape (k, p, n) and vectors of shape (k, n) in any unit."""
    return _sum("kpn,kn->pn", M, x)


def dot_product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return sum_k a_k b_k, shape (n,), of a and b of shape (k, n) in any unit."""
    return _sum("kn,kn->n", a, b)


def column_squares(M: FloatArray) -> FloatArray:
    """Return the squared lengths, shape (p, n), of the columns of M, shape (k, p, n), in any unit."""
    return _sum("kpn,kpn->pn", M, M)


def outer_sum(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return sum_k a_k b_k^T, shape (p, r, n), of a, shape (k, p, n), and b, (k, r, n), in any units."""
    return _sum("kpn,krn->prn", a, b)


def take_rows(a: FloatArray, rows: NDArray[np.intp]) -> FloatArray:
    """Return some of the n values of an array of shape (..., n) in any unit, contiguous.

    a[..., rows] has them a matrix apart, which makes later operations several times as slow.
    """
    return np.take(a, rows, axis=-1)


def _sum(subscripts: str, a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a sum of products whose inner loop runs over the n systems, term after term for each.

    `numpy.einsum` does that for more than one contiguous value; for a single one it sums in another order.
    """
    if a.shape[-1] == 1:
        return np.asarray(np.einsum(subscripts, a.repeat(2, -1), b.repeat(2, -1))[..., :1])
    return np.asarray(np.einsum(subscripts, _contiguous(a), _contiguous(b)))


def _contiguous(a: FloatArray) -> FloatArray:
    return a if a.strides[-1] == a.itemsize else np.ascontiguousarray(a)


class ToolMotion(NamedTuple):
    """Pose of the tool centre point, and its derivatives by the joints, in the world.

    Attributes:
        position: In [m], shape (3, n).
        columns: The axes x, y, z of the tool [-], shape (3, 3, n), first index: the axis.
        jacobian: As `kinematics.forward.jacobian`, in [m/rad] or [-], shape (6, joints, n).
    """

    position: FloatArray
    columns: FloatArray
    jacobian: FloatArray


class _ConstantTransform(NamedTuple):
    """A constant transform C: its columns and its translation."""

    columns: tuple[Terms, Terms, Terms]
    translation: Terms


@dataclass(frozen=True, slots=True, eq=False)
class PreparedChain:
    """A chain prepared for `tool_motion`.

    Attributes:
        chain: The arm.
        joints: Those that are not fixed.
        steps: C_0 ... C_n, one before each joint and one after the last.
    """

    chain: Chain
    joints: tuple[Joint, ...]
    steps: tuple[_ConstantTransform, ...]


@lru_cache(maxsize=32)
def prepare_chain(chain: Chain) -> PreparedChain:
    """Return a chain prepared for `tool_motion`."""
    between, joints, steps = chain.base, [], []
    for joint in chain.joints:
        between = between @ joint.origin
        if joint.kind != "fixed":
            upright = _frame_with_z(joint.axis)
            steps.append(_step(between @ upright))
            joints.append(joint)
            between = upright.inverse()
    steps.append(_step(between @ chain.tip @ chain.tool))
    return PreparedChain(chain, tuple(joints), tuple(steps))


def _frame_with_z(axis: Vector) -> Transform:
    """Return a frame whose z is a unit vector; of a coordinate axis its entries are 0 and +-1."""
    along = max(range(3), key=lambda i: abs(axis[i]))
    other = [0.0, 0.0, 0.0]
    other[(along + 1) % 3] = 1.0
    x = add((other[0], other[1], other[2]), scale(-axis[(along + 1) % 3], axis))
    x = scale(1.0 / math.hypot(*x), x)
    return Transform(Transform((x, cross(axis, x), axis)).columns)


def _step(frame: Transform) -> _ConstantTransform:
    x, y, z = frame.columns
    return _ConstantTransform((_terms(x), _terms(y), _terms(z)), _terms(frame.translation))


def _terms(vector: Vector) -> Terms:
    return tuple((i, float(weight)) for i, weight in enumerate(vector) if weight != 0.0)


def tool_motion(arm: PreparedChain, q: FloatArray) -> ToolMotion:
    """Return pose and Jacobian of the tool centre point.

    Args:
        arm: Of the chain, by `prepare_chain`.
        q: Joint values in [rad] or [m], shape (joints, n).
    """
    n = q.shape[1]
    J, origins = np.empty((6, len(arm.joints), n)), np.empty((3, len(arm.joints), n))
    values = _values(arm, q)
    columns: Columns = (np.eye(3)[:, :1], np.eye(3)[:, 1:2], np.eye(3)[:, 2:])
    point: FloatArray = np.zeros((3, 1))
    for i, (joint, step) in enumerate(zip(arm.joints, arm.steps, strict=False)):
        columns, point = _placed(columns, point, step)
        J[3:, i], origins[:, i] = columns[2], point
        if joint.kind == "prismatic":
            point = point + values[i] * columns[2]
        else:
            c, s = np.cos(values[i]), np.sin(values[i])
            columns = (c * columns[0] + s * columns[1], c * columns[1] - s * columns[0], columns[2])
    columns, point = _placed(columns, point, arm.steps[-1])
    axes, position = np.empty((3, 3, n)), np.empty((3, n))
    axes[0], axes[1], axes[2] = columns
    position[:] = point
    np.subtract(position[:, None], origins, out=origins)
    return ToolMotion(position, axes, _jacobian(arm, J, origins))


def _values(arm: PreparedChain, q: FloatArray) -> list[FloatArray]:
    """Return the values of all joints that are not fixed, mimics included."""
    if len(arm.joints) == len(q):
        return list(q)
    values = zip(arm.chain.joints, joint_values(arm.chain, list(q)), strict=True)
    return [value for joint, value in values if joint.kind != "fixed"]


def _jacobian(arm: PreparedChain, J: FloatArray, levers: FloatArray) -> FloatArray:
    """Return J, whose last rows are the axes, with its first: z x (p - o) of revolute joints, z of others.

    A mimic's column, times its multiplier, is added to that of the joint that it follows.
    """
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        np.multiply(J[3 + j], levers[k], out=J[i])
        J[i] -= J[3 + k] * levers[j]
    for i, joint in enumerate(arm.joints):
        if joint.kind == "prismatic":
            J[:3, i], J[3:, i] = J[3:, i], 0.0
    if J.shape[1] == len(arm.chain.moving):
        return J
    place = {joint.name: i for i, joint in enumerate(arm.joints)}
    for i, joint in enumerate(arm.joints):
        if joint.mimic is not None:
            J[:, place[joint.mimic.joint]] += joint.mimic.multiplier * J[:, i]
    return J[:, [place[name] for name in arm.chain.coordinates]]


def _placed(columns: Columns, point: FloatArray, step: _ConstantTransform) -> tuple[Columns, FloatArray]:
    """Return axes and origin of a constant frame that is given in another's."""
    x, y, z = step.columns
    if step.translation:
        point = point + _combined(columns, step.translation)
    return (_combined(columns, x), _combined(columns, y), _combined(columns, z)), point


def _combined(columns: Columns, terms: Terms) -> FloatArray:
    """Return the sum of columns times their weights; there is at least one."""
    (first, weight), *further = terms
    total = columns[first] if weight == 1.0 else weight * columns[first]
    for which, weight in further:
        total = total + weight * columns[which]
    return total


def orientation_length(chain: Chain) -> float:
    """Return the length l in [m] that a radian of orientation counts as: a quarter of the arm's.

    A rotation of the tool by a radian then weighs as much as a displacement that the arm makes with ease. The
    arm's length is its `characteristic_length`, which does not depend on the frames of a description.
    """
    return characteristic_length(chain) / 4.0


def redundancy(chain: Chain, targets: Targets) -> int:
    """Return the number of joints less the rank of the Jacobian off singular poses."""
    return len(chain.coordinates) - _rank(chain, 3 if targets.rotation is None else 6)


@lru_cache(maxsize=32)
def _rank(chain: Chain, rows: int) -> int:
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (8, len(chain.coordinates)))
    return int(np.linalg.matrix_rank(jacobian_over_log(chain, q)[:, :rows], rtol=1e-9).max())


@dataclass(frozen=True, slots=True, eq=False)
class TaskError:
    """Difference between target and tool at joint values q, and its Jacobian.

    The gradient of |e|^2 / 2 is -J^T e at any target. e itself changes by -A J dq: A is 1 for the position,
    and for the rotation vector, of length a, the Jacobian of the logarithm,
    1 + E/2 + (1/a^2 - (1 + cos a) / (2 a sin a)) E^2 with E = [e]x / l, which goes to 1 with a, omitted:
    A^T e = e, so that the gradient is the same without it, and near the target steps are.

    Attributes:
        vector: e, shape (3, n) or, of poses, (6, n): target minus tool along x, y, z in [m], then the
            rotation vector that turns the tool into its target, in the world, in [rad], times l in [m].
        jacobian: J of the tool's velocity and, times l, of its angular velocity, in [m/rad] or [-],
            shape (3 or 6, joints, n).
        distance2: |target - tool|^2 in [m2], shape (n,).
        angle2: The square of l times the angle in [m2], shape (n,); 0 where any orientation is allowed.
        length: l in [m].
    """

    vector: FloatArray
    jacobian: FloatArray
    distance2: FloatArray
    angle2: FloatArray
    length: float

    @property
    def square(self) -> FloatArray:
        """|e|^2 in [m2], shape (n,)."""
        return np.asarray(self.distance2 + self.angle2)

    def within(self, metres: float, radians: float) -> BoolArray:
        """Return where the errors are within tolerances in [m] and [rad], shape (n,)."""
        return np.asarray((self.distance2 <= metres**2) & (self.angle2 <= (self.length * radians) ** 2))

    def rows(self, rows: IndexArray) -> TaskError:
        """Return some of the rows, indices of shape (m,)."""
        vector, jacobian = take_rows(self.vector, rows), take_rows(self.jacobian, rows)
        return TaskError(vector, jacobian, self.distance2[rows], self.angle2[rows], self.length)

    def restore(self, rows: IndexArray, before: TaskError) -> None:
        """Overwrite some rows, indices of shape (m,), with those of an earlier error."""
        for values, earlier in (
            (self.vector, before.vector),
            (self.jacobian, before.jacobian),
            (self.distance2, before.distance2),
            (self.angle2, before.angle2),
        ):
            values[..., rows] = earlier[..., rows]


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """The targets of a block of rows.

    Attributes:
        arm: The arm.
        length: l in [m]: see `orientation_length`.
        position: x, y, z in [m], shape (3, n).
        columns: The axes that the tool shall take [-], shape (3, 3, n), first index: the axis; None allows
            any orientation.
    """

    arm: PreparedChain
    length: float
    position: FloatArray
    columns: FloatArray | None

    def rows(self, rows: IndexArray) -> Task:
        """Return some of the rows, indices of shape (m,)."""
        columns = None if self.columns is None else take_rows(self.columns, rows)
        return replace(self, position=take_rows(self.position, rows), columns=columns)

    def error(self, q: FloatArray) -> TaskError:
        """Return the error at joint values q in [rad] or [m], shape (joints, n)."""
        tool = tool_motion(self.arm, q)
        size = 3 if self.columns is None else 6
        vector, J = np.empty((size, q.shape[1])), tool.jacobian[:size]
        np.subtract(self.position, tool.position, out=vector[:3])
        if self.columns is not None:
            np.multiply(rotation_error(tool.columns, self.columns), self.length, out=vector[3:])
            J[3:] *= self.length
        angle2 = np.zeros(q.shape[1]) if size == 3 else dot_product(vector[3:], vector[3:])
        return TaskError(vector, J, dot_product(vector[:3], vector[:3]), angle2, self.length)


def build_task(chain: Chain, targets: Targets) -> Task:
    """Return the targets as one array per coordinate."""
    position, columns = np.ascontiguousarray(targets.position.T), None
    if targets.rotation is not None:
        columns = np.ascontiguousarray(targets.rotation.transpose(2, 1, 0))
    return Task(prepare_chain(chain), orientation_length(chain), position, columns)


def rotation_error(columns: FloatArray, target: FloatArray) -> FloatArray:
    """Return the rotation vector u a, 0 <= a <= pi, in [rad], of R_target R^T, in the world, shape (3, n).

    With the columns c_k of R and w_k of R_target: u sin(a) = sum_k c_k x w_k / 2 and
    1 + 2 cos(a) = sum_k c_k . w_k. Near half a turn the sine leaves no digits for u; there it is the largest
    column of S - cos(a) I with S the symmetric part, which is (1 - cos(a)) u u^T.

    Args:
        columns: Of R [-], shape (3, 3, n), first index: the column.
        target: Of R_target [-], shape (3, 3, n), first index: the column.
    """
    turn = outer_sum(target, columns)
    cosine = 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0)
    vector = 0.5 * np.stack([turn[k, j] - turn[j, k] for j, k in ((1, 2), (2, 0), (0, 1))])
    size = np.sqrt(dot_product(vector, vector))
    angle = np.arctan2(size, cosine)
    vector *= np.divide(angle, size, out=np.ones_like(size), where=size > 0.0)
    half = np.flatnonzero((size < HALF_TURN_SINE) & (cosine < 0.0))
    if len(half):
        vector[:, half] = _half_turns(take_rows(turn, half)) * angle[half]
    return vector


def _half_turns(turn: FloatArray) -> FloatArray:
    """Return the axes u of turns by nearly pi, shape (3, 3, n), as `rotation_error` describes: (3, n)."""
    turn = turn.transpose(2, 0, 1)
    sine = np.stack([turn[:, i - 1, i - 2] - turn[:, i - 2, i - 1] for i in range(3)], axis=1)
    cosine = 0.5 * (np.trace(turn, axis1=1, axis2=2) - 1.0)
    square = 0.5 * (turn + turn.transpose(0, 2, 1)) - cosine[:, None, None] * np.eye(3)
    largest = np.argmax(np.einsum("nii->ni", square), axis=1)
    axis = square[np.arange(len(turn)), largest]
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    axis[(axis * sine).sum(axis=1) < 0.0] *= -1.0
    return np.asarray(axis.T)
