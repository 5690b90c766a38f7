"""Where the bodies of an arm are and how they turn, as polynomials."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

from urmpipe_models.chains.chain import Chain
from urmpipe_models.elementwise import ZERO, Vector
from urmpipe_models.lagrange.angles import Step, Turn, steps
from urmpipe_models.lagrange.variables import Polynomial, Variables, total
from urmpipe_models.transform import Transform

Matrix: TypeAlias = Any
"""A `DomainMatrix` of SymPy over polynomials."""

Triple: TypeAlias = list[Polynomial]
"""x, y, z."""


class Body(NamedTuple):
    """What a joint moves.

    Attributes:
        name: The joint.
        frame: T, the homogeneous transform from the joint's moving frame to the base, shape (4, 4).
        spin: The angular velocity in the axes of the moving frame, in [rad/s].
        base_spin: The same in the axes of the base.
    """

    name: str
    frame: Matrix
    spin: Triple
    base_spin: Triple


def bodies(chain: Chain, variables: Variables) -> Iterator[Body]:
    """Yield what each joint moves, from the base outwards.

    T_1i = A_1 A_2 ... A_i, and omega_i = B_i^T (omega_(i-1) + (0, 0, theta_i')^T), here about any axis.
    Joints with parallel axes are one A with the sum of their angles.

    Source: [Iso9283]_ eq. 8 and 12.
    """
    zero = variables.constant(0.0)
    frame = matrix(Transform(), variables)
    place, spin, base_spin = [zero] * 3, [zero] * 3, [zero] * 3
    for step in steps(chain):
        origin = _column(step.joint.origin.translation, variables)
        place = _sum(place, apply(_rotation(step.before, variables), origin))
        if step.begins:
            spin, base_spin = _spins(step.at, frame, spin, base_spin, variables)
            frame, place = frame * _homogeneous(_rotation(step.at, variables), place, variables), [zero] * 3
        place = _sum(place, _slide(step, variables))
        local = _homogeneous(_rotation(step.after, variables), place, variables)
        own, seen = _spins(step.after, frame, spin, base_spin, variables)
        yield Body(step.joint.name, frame * local, own, seen)


def matrix(frame: Transform, variables: Variables) -> Matrix:
    """Return a constant transform as a homogeneous matrix, shape (4, 4)."""
    rotation = [[variables.constant(x) for x in row] for row in frame.rotation]
    return _homogeneous(_dense(rotation, variables), _column(frame.translation, variables), variables)


def point(frame: Matrix, place: Vector, variables: Variables) -> Triple:
    """Return where a point in [m] of a frame is, in the base [m]."""
    return apply(frame, [*_column(place, variables), variables.constant(1.0)])[:3]


def apply(of: Matrix, vector: Sequence[Polynomial]) -> list[Polynomial]:
    """Return a matrix times a column."""
    return [sum(a * b for a, b in zip(row, vector, strict=True)) for row in of.to_list()]


def velocity(place: Triple, variables: Variables) -> Triple:
    """Return dr/dt = sum_j (dr/dq_j) q_j', in [m/s]. Source: [Iso9283]_ eq. 9-11, by differentiation."""
    return [
        total((variables.derivative(x, j) * rate for j, rate in enumerate(variables.rates)), variables)
        for x in place
    ]


def _spins(
    turn: Turn, frame: Matrix, spin: Triple, base_spin: Triple, variables: Variables
) -> tuple[Triple, Triple]:
    """Return the angular velocity behind a turn, in the axes of what is turned and in those of the base."""
    own = [variables.constant(x) * variables.rate(turn.angle) for x in turn.axis]
    zero = variables.constant(0.0)
    behind = apply(_rotation(turn, variables).transpose(), _sum(spin, own))
    return behind, _sum(base_spin, apply(frame, [*own, zero])[:3])


def _rotation(turn: Turn, variables: Variables) -> Matrix:
    """Return Rot(axis, angle) inner, shape (3, 3): c 1 + s [a]x + (1 - c) a a^T of a unit vector a."""
    c, s = variables.cosine_sine(turn.angle)
    x, y, z = turn.axis
    across = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    rows = [
        [_entry(c, s, i == k, across[i][k], turn.axis[i] * turn.axis[k], variables) for k in range(3)]
        for i in range(3)
    ]
    inner = [[variables.constant(value) for value in row] for row in turn.inner.rotation]
    return _dense(rows, variables) * _dense(inner, variables)


def _entry(
    c: Polynomial, s: Polynomial, diagonal: bool, across: float, square: float, variables: Variables
) -> Polynomial:
    """Return c d + s across + (1 - c) square, an entry of a rotation matrix."""
    return (
        c * variables.constant(float(diagonal) - square)
        + s * variables.constant(across)
        + variables.constant(square)
    )


def _slide(step: Step, variables: Variables) -> Triple:
    """Return how far a joint slides, in the frame where its turn begins [m]."""
    if step.joint.kind != "prismatic":
        return _column(ZERO, variables)
    value = variables.value(step.value, step.offset)
    along = apply(_rotation(step.after, variables), _column(step.joint.axis, variables))
    return [value * x for x in along]


def _homogeneous(rotation: Matrix, place: Sequence[Polynomial], variables: Variables) -> Matrix:
    """Return a rotation and a translation as one matrix, shape (4, 4)."""
    rows = [[*row, x] for row, x in zip(rotation.to_list(), place, strict=True)]
    last = [variables.constant(x) for x in (0.0, 0.0, 0.0, 1.0)]
    return _dense([*rows, last], variables)


def _dense(rows: list[list[Polynomial]], variables: Variables) -> Matrix:
    """Return rows of polynomials as a matrix."""
    from sympy.polys.matrices import DomainMatrix

    return DomainMatrix(rows, (len(rows), len(rows[0])), variables.ring.to_domain())


def _column(of: Vector, variables: Variables) -> Triple:
    """Return a constant vector."""
    return [variables.constant(x) for x in of]


def _sum(a: Triple, b: Triple) -> Triple:
    """Return the sum of two vectors."""
    return [x + y for x, y in zip(a, b, strict=True)]
