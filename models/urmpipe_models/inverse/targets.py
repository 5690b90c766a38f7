"""Where the tool shall be: poses, or positions with any orientation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.orientation import quaternions, rotation_vectors


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Poses that the tool centre point shall take, in the world.

    Attributes:
        position: In [m], shape (n, 3).
        rotation: Rotation matrices [-], shape (n, 3, 3); None if any orientation will do.
    """

    position: FloatArray
    rotation: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.position)

    def rows(self, chosen: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Targets:
        """Return the chosen targets: a slice, a mask of shape (n,), or indices of shape (m,), as `chosen`."""
        return Targets(self.position[chosen], None if self.rotation is None else self.rotation[chosen])


def targets_of(chain: Chain, q: FloatArray) -> Targets:
    """Return the poses of the tool centre point at joint values q in [rad] or [m], shape (n, joints)."""
    return Targets(*poses_over_log(chain, q))


def misses(chain: Chain, q: FloatArray, targets: Targets) -> tuple[FloatArray, FloatArray]:
    """Return how far the tool at q is from its targets, by forward kinematics.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints); a row of NaN misses by NaN.
        targets: One a row of q.

    Returns:
        Target minus tool, along x, y, z in [m], shape (n, 3), and the rotation vector in [rad], shape
        (n, 3), in the world, that turns the tool into its target; zeros where any orientation will do.
    """
    position, rotation = poses_over_log(chain, q)
    if targets.rotation is None:
        return targets.position - position, np.zeros_like(position)
    between = targets.rotation @ rotation.transpose(0, 2, 1)
    return targets.position - position, rotation_vectors(quaternions(between.reshape(-1, 9), "matrix"))
