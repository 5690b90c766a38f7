"""Where the bodies of an arm are and how they turn, as polynomials."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

from urmpipe_models.chains.chain import Chain
from urmpipe_models.elementwise import ZERO, Vector
from urmpipe_models.lagrange.angles import Step, Turn, steps
from urmpipe_models.lagrange.variables import Polynomial, Variables, scalar_product, total
from urmpipe_models.transform import Transform

Triple: TypeAlias = list[Polynomial]
"""x, y, z."""

Matrix: TypeAlias = list[Triple]
"""The rows of a rotation."""


class Body(NamedTuple):
    """What a joint moves.

    Attributes:
        step: The joint.
        rotation: From the joint's moving frame to the base.
        place: The origin of that frame, in the base [m].
        spin: The angular velocity in the axes of the moving frame, in [rad/s].
    """

    step: Step
    rotation: Matrix
    place: Triple
    spin: Triple


def bodies(chain: Chain, variables: Variables) -> Iterator[Body]:
    """Yield what each joint moves, from the base outwards.

    T_1i = A_1 A_2 ... A_i, and omega_i = B_i^T (omega_(i-1) + (0, 0, theta_i')^T), here about any axis.
    Joints with parallel axes are one A with the sum of their angles.

    Source: [Iso9283]_ eq. 8 and 12.
    """
    begin, origin = matrix(Transform().rotation, variables), column(ZERO, variables)  # where a turn begins
    spin = place = column(ZERO, variables)  # in the axes of that frame
    for step in steps(chain):
        shift = column(step.joint.origin.translation, variables)
        place = shifted(place, _rotation(step.before, variables), shift, variables)
        if step.begins:
            spin = _spin(step.at, spin, variables)
            origin = shifted(origin, begin, place, variables)
            begin, place = _product(begin, _rotation(step.at, variables), variables), column(ZERO, variables)
        rotation = _rotation(step.after, variables)
        if step.joint.kind == "prismatic":
            value = variables.value(step.value, step.offset)
            slide = [variables.constant(x) * value for x in step.joint.axis]
            place = shifted(place, rotation, slide, variables)
        yield Body(
            step,
            _product(begin, rotation, variables),
            shifted(origin, begin, place, variables),
            _spin(step.after, spin, variables),
        )


def column(of: Vector, variables: Variables) -> Triple:
    """Return a constant vector."""
    return [variables.constant(x) for x in of]


def matrix(of: Sequence[Vector], variables: Variables) -> Matrix:
    """Return a constant matrix."""
    return [column(row, variables) for row in of]


def apply(of: Matrix, vector: Sequence[Polynomial], variables: Variables) -> Triple:
    """Return a matrix times a column."""
    return [scalar_product(row, vector, variables) for row in of]


def shifted(place: Triple, rotation: Matrix, shift: Triple, variables: Variables) -> Triple:
    """Return a place and what follows it in turned axes."""
    return [total(one, variables) for one in zip(place, apply(rotation, shift, variables), strict=True)]


def velocity(place: Triple, variables: Variables) -> Triple:
    """Return dr/dt = sum_j (dr/dq_j) q_j', in [m/s]. Source: [Iso9283]_ eq. 9-11, by differentiation."""
    return [
        total(
            (part * rate for j, rate in enumerate(variables.rates) for part in variables.derivative(x, j)),
            variables,
        )
        for x in place
    ]


def _product(a: Matrix, b: Matrix, variables: Variables) -> Matrix:
    """Return the product of two matrices."""
    return [[scalar_product(row, one, variables) for one in zip(*b, strict=True)] for row in a]


def _spin(turn: Turn, before: Triple, variables: Variables) -> Triple:
    """Return the angular velocity behind a turn, in the axes of what it turns."""
    rate = variables.rate(turn.angle)
    added = [
        total((x, variables.constant(a) * rate), variables) for x, a in zip(before, turn.axis, strict=True)
    ]
    return [scalar_product(one, added, variables) for one in zip(*_rotation(turn, variables), strict=True)]


def _rotation(turn: Turn, variables: Variables) -> Matrix:
    """Return Rot(axis, angle) inner: c 1 + s [a]x + (1 - c) a a^T of a unit vector a, times a constant."""
    c, s = variables.cosine_sine(turn.angle)
    x, y, z = turn.axis
    across = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    rows = [
        [
            c * variables.constant(float(i == k) - turn.axis[i] * turn.axis[k])
            + s * variables.constant(across[i][k])
            + variables.constant(turn.axis[i] * turn.axis[k])
            for k in range(3)
        ]
        for i in range(3)
    ]
    return _product(rows, matrix(turn.inner.rotation, variables), variables)
