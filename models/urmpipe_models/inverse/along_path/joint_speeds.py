"""Joint speeds along a solved path, held against what the joints can do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.along_path.stretches import stretches

ROUNDING = 1e-9
"""A speed above its limit by this share is on it."""


@dataclass(frozen=True, slots=True)
class TooFast:
    """A stretch of a path along which a joint would have to move faster than it can.

    Attributes:
        joint: Its name.
        first: Index of the sample, from 0, that the first step too fast starts from.
        last: Index of the sample that the last one leads to.
        t: Time of the first in [s], from the first sample of the path.
        speed: The largest speed in [rad/s] or [m/s].
        allowed: The joint's limit.
        unit: rad/s or m/s.
    """

    joint: str
    first: int
    last: int
    t: float
    speed: float
    allowed: float
    unit: str

    @property
    def text(self) -> str:
        """The stretch in one line."""
        return (
            f"samples {self.first} to {self.last} from {self.t:.3f} s: joint {self.joint} moves at"
            f" {self.speed:.4g} {self.unit}, allowed: {self.allowed:.4g}"
        )


def too_fast(chain: Chain, q: FloatArray, seconds: FloatArray) -> tuple[TooFast, ...]:
    """Return where joints move faster than they can, |q_k - q_{k-1}| / (t_k - t_{k-1}), by sample and joint.

    Over samples without a solution it is the speed that the joint needs at least to be there in time.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints), NaN where there are none.
        seconds: Times in [s], rising, shape (n,).
    """
    reached = np.flatnonzero(np.isfinite(q).all(axis=1))
    speed = np.abs(np.diff(q[reached], axis=0)) / np.diff(seconds[reached])[:, None]
    found = [
        TooFast(
            joint.name,
            int(reached[first]),
            int(reached[last + 1]),
            float(seconds[reached[first]]),
            float(speed[first : last + 1, k].max()),
            joint.velocity,
            "m/s" if joint.kind == "prismatic" else "rad/s",
        )
        for k, joint in enumerate(chain.moving)
        for first, last in stretches(speed[:, k] > joint.velocity * (1.0 + ROUNDING))
    ]
    return tuple(sorted(found, key=lambda one: one.first))
