"""What following a path returns: joint values, and all that is to be told about them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IntArray, TextArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.along_path.joint_speeds import TooFast
from urmpipe_models.inverse.along_path.jumps import Jump
from urmpipe_models.inverse.solutions import SingularFamily
from urmpipe_models.kinematics.singularity import SingularityLog, singularity_over_log


@dataclass(frozen=True, slots=True)
class SingularStretch:
    """A stretch of a path in a family of singular poses.

    Attributes:
        family: Its name.
        first: Index of its first sample, from 0.
        last: Index of its last sample.
        t_first: Time of the first in [s], from the first sample of the path.
        t_last: Time of the last in [s].
    """

    family: SingularFamily
    first: int
    last: int
    t_first: float
    t_last: float

    @property
    def text(self) -> str:
        """The stretch in one line."""
        if self.first == self.last:
            return f"sample {self.first} at {self.t_first:.3f} s: {self.family}"
        times = f"{self.t_first:.3f} to {self.t_last:.3f} s"
        return f"samples {self.first} to {self.last}, {times}: {self.family}"


@dataclass(frozen=True, eq=False)
class JointPath:
    """Joint values along a path, and all that is to be told about them.

    Attributes:
        chain: The arm.
        position_only: Whether any orientation would do.
        method: "spherical wrist", "three parallel axes" or "least motion": how it was followed.
        t_ns: Time of each sample in [ns], shape (n,).
        q: In [rad] or [m], shape (n, joints); NaN where there is no solution.
        branch: What each solution is called, shape (n,), empty where there is none: of a closed form its
            branch, otherwise "1", and a number more after each jump.
        reasons: Why there is none, one line, shape (n,); empty where there is one.
        shortfall: How far the tool stays from a target that it comes near to, in [m], shape (n,); 0 where
            the target is met.
        jumps: Steps that leave the path; see `jumps.jump_samples`.
        too_fast: Stretches along which a joint would have to move faster than it can.
        singular: Stretches in families of singular poses; told of closed forms only.
    """

    chain: Chain
    position_only: bool
    method: str
    t_ns: IntArray
    q: FloatArray
    branch: TextArray
    reasons: TextArray
    shortfall: FloatArray
    jumps: tuple[Jump, ...]
    too_fast: tuple[TooFast, ...]
    singular: tuple[SingularStretch, ...]

    def __len__(self) -> int:
        return len(self.q)

    @property
    def reached(self) -> BoolArray:
        """True where there is a solution, shape (n,)."""
        return np.asarray(np.isfinite(self.q).all(axis=1))

    @cached_property
    def singularity(self) -> SingularityLog:
        """How far the arm is from a singular pose at each sample: smallest singular value, manipulability."""
        return singularity_over_log(self.chain, self.q, orientation=not self.position_only)

    @property
    def nearest_singularity(self) -> int | None:
        """Index of the sample with the least of the smallest singular values; None where none is reached."""
        return int(np.nanargmin(self.singularity.smallest)) if self.reached.any() else None
