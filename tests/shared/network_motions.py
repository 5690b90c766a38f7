"""Networks in motion: poses and lengths at control values that follow each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.networks.assembly import body_poses
from urmpipe_models.networks.closure import solve_closure
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mechanism import build_mechanism


class DrivenNetwork(NamedTuple):
    """A network that its controls move.

    Attributes:
        network: The network.
        poses: Of the bodies [-] and [m], shape (n, bodies, 4, 4).
        lengths: Of the elements in [m], shape (n, elements).
        t_ns: Times in [ns], shape (n,).
    """

    network: Network
    poses: FloatArray
    lengths: FloatArray
    t_ns: IntArray

    def trace(self, body: str, point: tuple[float, float, float]) -> FloatArray:
        """Return the path of a point of a body in [m], shape (n, 3)."""
        poses = self.poses[:, self.network.body_names.index(body)]
        return np.asarray(poses[:, :3, :3] @ np.array(point) + poses[:, :3, 3])


def drive(network: Network, values: FloatArray, step_ns: int = 20_000_000) -> DrivenNetwork:
    """Return a network at values of its first control, shape (n,), each assembled from the one before."""
    mechanism = build_mechanism(network)
    x, poses, lengths = mechanism.start[:, np.newaxis], [], []
    for value in values.tolist():
        x = x.copy()
        x[mechanism.controls[0]] = value
        reached = solve_closure(mechanism, x, mechanism.free)
        assert reached.gap.max() < 1e-9
        x = reached.x
        poses.append(body_poses(mechanism, x[:, 0]))
        lengths.append([float(one.value) for one in mechanism.lengths(x[:, 0])])
    every = np.array(lengths).reshape(len(values), -1)
    return DrivenNetwork(network, np.array(poses), every, np.arange(len(values)) * step_ns)
