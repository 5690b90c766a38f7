"""The direct geometric model of a chain as its paper writes it: matrices and vectors, link by link."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from operator import matmul
from typing import TypeAlias

from urmpipe_models.arm.denavit_hartenberg import AXES, GeometricModelRow
from urmpipe_models.elementwise import ZERO, Element, Vector, add, scale
from urmpipe_models.math3d import Transform, euler_zxz, rotation_about

Rows: TypeAlias = tuple[Vector, Vector, Vector]
"""The rows of a rotation matrix [-]."""


@dataclass(frozen=True, slots=True)
class GeometricModel:
    """The direct geometric model at joint values q: what the equations call by name, elementwise.

    Attributes:
        turns: [R]_k^{k-1} for k = 1..n, eq. 1.
        rotations: [R]_k^0 for k = 1..n, eq. 8.
        steps: p_{k,k-1} in [m] for k = 1..n+1, eq. 10: from O_{k-1} to O_k, seen from the base.
        positions: p_k in [m] for k = 1..n+1, eq. 11-13; the last is the gripper's characteristic point P.

    Source: [Geometric6R]_ eq. 1-14.
    """

    turns: tuple[Rows, ...]
    rotations: tuple[Rows, ...]
    steps: tuple[Vector, ...]
    positions: tuple[Vector, ...]

    def seen(self, vector: Vector) -> tuple[Vector, ...]:
        """Return a vector of the last system as every system sees it: p^0, p^1, ..., p^n, eq. 5-7.

        p^{k-1} = [R]_k^{k-1} p^k, so that p^0 = [R]_1^0 [R]_2^1 ... [R]_n^{n-1} p^n = [R]_n^0 p^n.

        Args:
            vector: p^n, a vector from O_n, in system T_n [m].
        """
        outwards = [vector]
        for turn in reversed(self.turns):
            outwards.append(Transform(turn).rotate(outwards[-1]))
        return tuple(reversed(outwards))

    @property
    def equations(self) -> tuple[Element, ...]:
        """The twelve direct geometric model equations: p in [m], then x_n, y_n, z_n [-], in T_0, eq. 14."""
        x, y, z = Transform(self.rotations[-1]).columns
        return (*self.positions[-1], *x, *y, *z)

    @property
    def operational(self) -> tuple[Element, ...]:
        """X^0 = [p_x p_y p_z alpha_z beta_x gamma_z] in [m] and [rad], eq. 17, with the angles of eq. 16.

        The angles are z1, x, z2 of `euler_zxz`; where they are singular its convention holds.
        """
        alpha, beta, gamma, _ = euler_zxz(self.rotations[-1])
        return (*self.positions[-1], alpha, beta, gamma)


def geometric_model(
    rows: Sequence[GeometricModelRow], q: Sequence[Element], tip: Vector = ZERO
) -> GeometricModel:
    """Return the direct geometric model of a chain of R and T joints.

    [R]_k^0 = prod_j [R]_j^{j-1} with [R]_j^{j-1} = R(axis, q_j) of a rotation and I_3 of a translation;
    p_{k,k-1} = [R]_{k-1}^0 r_k^{k-1}, where a translation's r_k^{k-1}(q_k) = r_k + q_k axis;
    p_k = sum_{j <= k} p_{j,j-1}.

    Args:
        rows: One a joint, from the base outwards.
        q: One element a joint, in [rad] or [m].
        tip: r_{n+1}^n, the characteristic point of the gripper in the last system [m].

    Source: [Geometric6R]_ eq. 1, 2, 8, 10-13.
    """
    links = [_link(row, value) for row, value in zip(rows, q, strict=True)]
    systems = list(accumulate((Transform(link.rotation) for link in links), matmul))
    vectors = (*(link.translation for link in links), tip)
    steps = [system.rotate(r) for system, r in zip((Transform(), *systems), vectors, strict=True)]
    return GeometricModel(
        tuple(link.rotation for link in links),
        tuple(system.rotation for system in systems),
        tuple(steps),
        tuple(accumulate(steps, add)),
    )


def _link(row: GeometricModelRow, value: Element) -> Transform:
    """Return system T_k in T_{k-1}: [R]_k^{k-1} and r_k^{k-1}(q_k), eq. 1 and 2."""
    axis = AXES[row.axis]
    if row.kind == "T":
        return Transform(translation=add(row.r, scale(value, axis)))
    return Transform(rotation_about(axis, value).rotation, row.r)
