"""The joints of a chain as screws: what its geometry is, whatever its frames and names are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.chain import Chain
from urmpipe_models.frames import frames
from urmpipe_models.kinematics import tip_pose

FloatArray: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Screws:
    """The moving joints of a chain at q = 0, in the world, and the pose of its tip there.

    With the twist xi_i of a joint's axis the tip is at T(q) = exp(xi_1 q_1) ... exp(xi_n q_n) T(0), the
    product of exponentials: two descriptions of one arm have the same screws.

    Attributes:
        direction: Unit vector along each axis [-], shape (n, 3).
        point: A point of each axis in [m], shape (n, 3).
        revolute: True of a revolute, false of a prismatic joint, shape (n,).
        rotation: Of the tool centre point at q = 0 [-], shape (3, 3).
        position: Of the tool centre point at q = 0 in [m], shape (3,).

    Source: [Brockett1984]_.
    """

    direction: FloatArray
    point: FloatArray
    revolute: NDArray[np.bool_]
    rotation: FloatArray
    position: FloatArray

    @property
    def size(self) -> float:
        """A length of the arm in [m], to hold distances against: from axis to axis to the tip."""
        points = np.vstack((self.point, self.position))
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) or 1.0


def screws(chain: Chain) -> Screws | None:
    """Return the screws of a chain, base and tool included; None if a joint follows another (mimic).

    Such a joint turns about a line that moves with the joint it follows, and is no screw of its own.
    """
    if any(joint.mimic is not None for joint in chain.joints):
        return None
    zero = [0.0] * len(chain.coordinates)
    placed = [
        (frame.rotate(joint.axis), frame.translation, joint.kind == "revolute")
        for joint, frame in zip(chain.joints, list(frames(chain, zero))[1:], strict=True)
        if joint.kind != "fixed"
    ]
    direction, point, revolute = zip(*placed, strict=True)
    tip = tip_pose(chain, zero)
    return Screws(
        np.array(direction, dtype=float),
        np.array(point, dtype=float),
        np.array(revolute),
        np.array(tip.rotation, dtype=float),
        np.array(tip.translation, dtype=float),
    )
