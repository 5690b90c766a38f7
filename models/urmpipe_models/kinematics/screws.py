"""The joints of a chain as screws: what its geometry is, whatever its frames and names are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.kinematics.forward import tip_pose
from urmpipe_models.kinematics.frames import frames
from urmpipe_models.transform import Transform


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


def chain_of(screws: Screws, names: tuple[str, ...]) -> Chain:
    """Return a chain that has these screws: each joint's frame on a point of its axis, turned as the world.

    Args:
        screws: Of its joints.
        names: Of its joints.
    """
    offsets = np.diff(np.vstack((np.zeros(3), screws.point)), axis=0)
    joints = tuple(
        Joint(
            name,
            "revolute" if revolute else "prismatic",
            Transform(translation=_vector(offset)),
            _vector(direction),
        )
        for name, revolute, offset, direction in zip(
            names, screws.revolute, offsets, screws.direction, strict=True
        )
    )
    x, y, z = (_vector(row) for row in screws.rotation)
    return Chain("screws", joints, Transform((x, y, z), _vector(screws.position - screws.point[-1])))


def _vector(values: FloatArray) -> tuple[float, float, float]:
    """Return three numbers as a tuple."""
    x, y, z = (float(one) for one in values)
    return x, y, z
