"""Jumps between the solutions of neighbouring samples of a path, which no motion along the path explains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import FloatArray, IndexArray, TextArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.iterative.task import turn_length
from urmpipe_models.inverse.targets import Targets, misses, targets_of

SMALL_STEP = 0.1
"""A step by less, in [rad] or [m] of every joint, is never a jump."""


@dataclass(frozen=True, slots=True)
class JointStep:
    """What one joint moves by in a jump, in [rad] or [m]."""

    joint: str
    step: float
    unit: str

    def __str__(self) -> str:
        return f"{self.joint} by {self.step:.4g} {self.unit}"


@dataclass(frozen=True, slots=True)
class Jump:
    """A step from one sample to the next that leaves the path.

    Attributes:
        sample: Index of the sample that it leads to, from 0.
        last: Index of the sample that it comes from: those between have no solution.
        t: Its time in [s], from the first sample.
        position: Where the tool is then, x, y, z in [m].
        from_branch: What the solution before is called.
        to_branch: What the solution after is called; the same where a joint starts anew by whole turns.
        joints: The joints that move by `SMALL_STEP` or more, the largest step first.
    """

    sample: int
    last: int
    t: float
    position: tuple[float, float, float]
    from_branch: str
    to_branch: str
    joints: tuple[JointStep, ...]

    @property
    def text(self) -> str:
        """The jump in one line."""
        place = ", ".join(f"{value:.4f}" for value in self.position)
        branches = (
            f" from {self.from_branch} to {self.to_branch}" if self.from_branch != self.to_branch else ""
        )
        gap = f" since sample {self.last}" if self.last < self.sample - 1 else ""
        steps = ", ".join(map(str, self.joints))
        return f"sample {self.sample} at {self.t:.3f} s, ({place}) m: a jump{gap}{branches}: {steps}"


def jump_samples(chain: Chain, q: FloatArray, position_only: bool) -> IndexArray:
    """Return the samples that a jump leads to, ascending, shape (jumps,).

    A step of `SMALL_STEP` or more is a jump if half of it leads off the path: the tool at the mean of the
    two joint values is farther from both samples than they are from one another, in
    |p - p'| + l angle(R, R') with l of `turn_length`. Along a path of smooth motion it lies between
    them, however fast a joint turns: near an aligned wrist q4 and q6 may turn far against each other, and
    the tool hardly moves.

    Args:
        chain: The arm.
        q: Joint values of samples that are all reached, in [rad] or [m], shape (m, joints).
        position_only: Whether any orientation will do.
    """
    steps = np.abs(np.diff(q, axis=0))
    at = np.flatnonzero((steps >= SMALL_STEP).any(axis=1))
    before, after, half = q[at], q[at + 1], 0.5 * (q[at] + q[at + 1])
    ends = _apart(chain, before, after, position_only)
    off = np.minimum(_apart(chain, half, before, position_only), _apart(chain, half, after, position_only))
    return np.asarray(at[off > ends] + 1)


def jumps_at(
    chain: Chain,
    samples: IndexArray,
    before: IndexArray,
    q: FloatArray,
    seconds: FloatArray,
    position: FloatArray,
    branch: TextArray,
) -> tuple[Jump, ...]:
    """Return the jumps that lead from samples `before` to `samples`.

    Args:
        chain: The arm.
        samples: Indices that the jumps lead to, shape (m,).
        before: Indices that they come from, shape (m,).
        q: Joint values of all samples in [rad] or [m], shape (n, joints).
        seconds: Times of all samples in [s], shape (n,).
        position: Of the tool in [m], shape (n, 3).
        branch: What the solutions are called, shape (n,).
    """
    units = ["m" if joint.kind == "prismatic" else "rad" for joint in chain.moving]
    found = []
    for sample, last in zip(samples.tolist(), before.tolist(), strict=True):
        steps = q[sample] - q[last]
        large = [int(k) for k in np.argsort(-np.abs(steps), kind="stable") if abs(steps[k]) >= SMALL_STEP]
        joints = tuple(JointStep(chain.coordinates[k], float(steps[k]), units[k]) for k in large)
        x, y, z = position[sample].tolist()
        t = float(seconds[sample])
        found.append(Jump(sample, last, t, (x, y, z), branch[last], branch[sample], joints))
    return tuple(found)


def _apart(chain: Chain, one: FloatArray, other: FloatArray, position_only: bool) -> FloatArray:
    """Return |p - p'| + l angle(R, R') of the tool at joint values, shape (m,), in [m]."""
    there = targets_of(chain, other)
    distance, turn = misses(chain, one, Targets(there.position) if position_only else there)
    length = turn_length(chain)
    return np.asarray(np.linalg.norm(distance, axis=1) + length * np.linalg.norm(turn, axis=1))
