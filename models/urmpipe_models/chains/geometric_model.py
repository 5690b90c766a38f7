"""Chains by the rows of a geometric model: rotations and translations about and along axes of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.elementwise import ZERO, Vector
from urmpipe_models.transform import Step, Transform, made_of

AXES = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
}
"""Unit vectors by the names of axes."""


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
                _shift(row.r, k),
                AXES[row.axis],
            )
            for k, row in enumerate(rows, start=1)
        ),
        tip=_shift(tip, len(rows) + 1),
        start=tuple(float(value) for value in start),
        description=description,
        source=source,
    )


def _shift(r: Vector, k: int) -> Transform:
    """Return the frame at r_k, parallel to the one before."""
    x, y, z = r
    return made_of(
        Step("along", "x", x, f"r{k}.x", f"geometric row {k}"),
        Step("along", "y", y, f"r{k}.y", f"geometric row {k}"),
        Step("along", "z", z, f"r{k}.z", f"geometric row {k}"),
    )
