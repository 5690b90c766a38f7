"""The geometric model of a chain of rotations and translations: matrices and vectors, link by link."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from urmpipe_models.chain import Chain, Joint
from urmpipe_models.elementwise import ZERO, Element, Vector, add, scale
from urmpipe_models.transform import Transform, euler_zxz, translation

Rows: TypeAlias = tuple[Vector, Vector, Vector]
"""The rows of a rotation matrix [-]."""

_AXES: dict[str, tuple[float, float, float]] = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
}


@dataclass(frozen=True, slots=True)
class GeometricRow:
    """One joint of the model.

    Attributes:
        kind: R turns system T_k about an axis of its own by q_k in [rad]; T shifts it along one by q_k in
            [m], and leaves it parallel to T_{k-1}.
        axis: x, y or z.
        r: r_k^{k-1}, the origin O_k in system T_{k-1} at q_k = 0, in [m], any elements.
        name: The joint's name; q1, q2, ... where it is empty.
    """

    kind: Literal["R", "T"]
    axis: Literal["x", "y", "z"]
    r: Vector = ZERO
    name: str = ""


@dataclass(frozen=True, slots=True)
class GeometricModel:
    """The direct geometric model at joint values q: what the equations call by name, elementwise.

    Attributes:
        rotations: [R]_k^0 for k = 1..n, eq. 8.
        steps: p_{k,k-1} in [m] for k = 1..n+1, eq. 10: from O_{k-1} to O_k, seen from the base.
        positions: p_k in [m] for k = 1..n+1, eq. 11-13; the last is the gripper's characteristic point P.

    Source: [Geometric6R]_ eq. 1-14.
    """

    rotations: tuple[Rows, ...]
    steps: tuple[Vector, ...]
    positions: tuple[Vector, ...]

    @property
    def equations(self) -> tuple[Element, ...]:
        """The twelve direct geometric model equations: p, then x_n, y_n, z_n, eq. 14."""
        x, y, z = Transform(self.rotations[-1]).columns
        return (*self.positions[-1], *x, *y, *z)

    @property
    def operational(self) -> tuple[Element, ...]:
        """X^0 = [p_x p_y p_z alpha_z beta_x gamma_z] in [m] and [rad], eq. 17, with the angles of eq. 16.

        The angles are z1, x, z2 of `euler_zxz`; where they are singular its convention holds.
        """
        alpha, beta, gamma, _ = euler_zxz(self.rotations[-1])
        return (*self.positions[-1], alpha, beta, gamma)


def geometric_chain(
    name: str,
    rows: Sequence[GeometricRow],
    *,
    tip: Vector = ZERO,
    start: Sequence[float] = (),
    description: str = "",
    source: str = "",
) -> Chain:
    """Return the arm of a geometric model: joint k stands at r_k^{k-1} and is parallel to the one before.

    Args:
        name: The robot's name.
        rows: One a joint, from the base outwards.
        tip: r_{n+1}^n, the characteristic point of the gripper in the last system [m], any elements.
        start: Calibration pose q(0) in [rad] or [m].
        description: One line for people.
        source: Where the numbers come from.

    Raises:
        RobotError: If there is no row, names repeat, or start has another length.

    Source: [Geometric6R]_ eq. 1, 2.
    """
    return Chain(
        name,
        tuple(
            Joint(
                row.name or f"q{k}",
                "revolute" if row.kind == "R" else "prismatic",
                translation(*row.r),
                _AXES[row.axis],
            )
            for k, row in enumerate(rows, start=1)
        ),
        tip=translation(*tip),
        start=tuple(float(value) for value in start),
        description=description,
        source=source,
    )


def geometric_model(rows: Sequence[GeometricRow], q: Sequence[Element], tip: Vector = ZERO) -> GeometricModel:
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
    turned, rotations, steps = Transform(), [], []
    for row, value in zip(rows, q, strict=True):
        axis = _AXES[row.axis]
        slides = row.kind == "T"
        steps.append(turned.rotate(add(row.r, scale(value, axis)) if slides else row.r))
        turned = turned if slides else turned.turned(axis, value)
        rotations.append(turned.rotation)
    steps.append(turned.rotate(tip))
    positions = [steps[0]]
    for step in steps[1:]:
        positions.append(add(positions[-1], step))
    return GeometricModel(tuple(rotations), tuple(steps), tuple(positions))


def moved_from(transformed: Sequence[Rows], point: Vector) -> Vector:
    """Return a vector given in the last system [m] as the base sees it, system by system.

    p^{k-1} = [R]_k^{k-1} p^k for k = n..1, so that p^0 = [R]_1^0 [R]_2^1 ... [R]_n^{n-1} p^n.

    Source: [Geometric6R]_ eq. 4-7.
    """
    for rotation in reversed(transformed):
        point = Transform(rotation).rotate(point)
    return point
