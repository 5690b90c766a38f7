"""The joints of a plan: values, rates and accelerations at its samples, and what they use of their limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray
from urmpipe_models.kinematics.singularity import SingularityLog, singularity_over_log
from urmpipe_pipeline.runs.torques import compute_torques

FOLLOWED = 1.0 + 1e-9
"""So much of a limit may be used: rounding."""


class MostUsed(NamedTuple):
    """The limit of which most is used.

    Attributes:
        joint: Name of the joint.
        limit: "largest rate" or "largest acceleration".
        share: How much of it is used [-].
        sample: At which sample, from 0.
    """

    joint: str
    limit: str
    share: float
    sample: int


@dataclass(frozen=True, eq=False)
class PlannedJoints:
    """The joints along a plan, a row a sample.

    Attributes:
        chain: The arm, with base and tool.
        q: Joint values in [rad] or [m], shape (n, joints); NaN where there is no solution.
        qd: Rates in [rad/s] or [m/s], shape (n, joints); exact, not by differences.
        qdd: Second derivatives in [rad/s2] or [m/s2], shape (n, joints); likewise.
        oriented: Whether the path gives the tool's orientation; else any orientation is accepted.
    """

    chain: Chain
    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    oriented: bool

    @property
    def reached(self) -> BoolArray:
        """True where there is a solution, shape (n,)."""
        return np.asarray(np.isfinite(self.q).all(axis=1))

    @cached_property
    def velocity_share(self) -> FloatArray:
        """How much of its largest rate each joint uses, |q'| / limit [-], shape (n, joints); 0 without."""
        return np.asarray(np.abs(self.qd) / [joint.velocity for joint in self.chain.moving])

    @cached_property
    def acceleration_share(self) -> FloatArray:
        """How much of its largest acceleration each joint uses [-], shape (n, joints); 0 without one."""
        return np.asarray(np.abs(self.qdd) / [joint.acceleration for joint in self.chain.moving])

    @property
    def speed_share(self) -> float:
        """What speeds have to be divided by for every limit to hold at the samples [-]."""
        return max(float(self.velocity_share.max()), math.sqrt(self.acceleration_share.max()))

    @property
    def limited(self) -> bool:
        """Whether a limit of any rate or acceleration is known."""
        return any(np.isfinite([one.velocity, one.acceleration]).any() for one in self.chain.moving)

    @property
    def most_used(self) -> MostUsed:
        """The most used limit; at least one sample has to be reached."""
        shares = np.stack((self.velocity_share, self.acceleration_share))
        kind, sample, joint = np.unravel_index(int(np.nanargmax(shares)), shares.shape)
        limit = ("largest rate", "largest acceleration")[int(kind)]
        return MostUsed(self.chain.coordinates[joint], limit, float(shares[kind, sample, joint]), int(sample))

    @cached_property
    def singularity(self) -> SingularityLog:
        """How far the arm is from a singular pose at each sample."""
        return singularity_over_log(self.chain, self.q, orientation=self.oriented)

    @cached_property
    def tau(self) -> FloatArray | None:
        """Torques of the joints in [N.m] or [N], shape (n, joints); None of an arm without masses."""
        return compute_torques(self.chain, self.q, self.qd, self.qdd)

    @property
    def nearest_singularity(self) -> int | None:
        """The sample nearest to a singular pose, from 0; None where none is reached."""
        return int(np.nanargmin(self.singularity.smallest)) if self.reached.any() else None
