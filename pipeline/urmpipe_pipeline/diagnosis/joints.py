"""Joints of both sides, held against each other one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_pipeline.diagnosis.arm import edited
from urmpipe_pipeline.diagnosis.hypotheses import Group, State, zero
from urmpipe_pipeline.diagnosis.motion import Clock, Joints, Motion
from urmpipe_pipeline.runs.reading_errors import Edits


@dataclass(frozen=True, eq=False)
class JointsModel:
    """The joints of a log beside those of the reference.

    Attributes:
        groups: What may differ by some amount.
        motion: The log's joints.
        clock: The log's times.
        sample: Rows of the log, shape (n,).
        q: The reference's joints in [rad] or [m], shape (joints, n).
        sliding: Which joints are in [m], shape (joints,).
        chain: The arm; None for the joints alone.
        judged: Where the reference is as a comparison has it: positions in [m], shape (3, n), without an arm
            joints, shape (joints, n); None if that is where `q` leads.
    """

    groups: tuple[Group, ...]
    motion: Motion
    clock: Clock
    sample: IntArray
    q: FloatArray
    sliding: tuple[bool, ...]
    chain: Chain | None = None
    judged: FloatArray | None = None

    @property
    def unit(self) -> Literal["m", "rad"]:
        """Of what is judged: of joints that turn and slide all are taken as rad."""
        return "rad" if self.of_joints and not all(self.sliding) else "m"

    @property
    def of_joints(self) -> bool:
        """Whether the joints themselves are judged, not positions."""
        return self.chain is None

    @property
    def rows(self) -> int:
        """How many rows are held against each other."""
        return len(self.sample)

    @property
    def blocks(self) -> IntArray:
        """Which components share a noise: those that turn 0, those that slide 1, shape (joints,)."""
        return np.array(self.sliding, dtype=np.int64)

    def residual(self, state: State, rows: IntArray) -> FloatArray:
        """Return what an explanation leaves: reference - log in [rad] or [m], shape (joints, n)."""
        joints = self._joints(state, rows)
        return np.asarray(np.where(joints.inside, self.q[:, rows] - joints.q, np.nan))

    def residuals(self, every: Sequence[Edits], rows: IntArray) -> FloatArray:
        """Return residuals of explanations without numbers in [rad] or [m], shape (len(every), joints, n)."""
        joints = self._joints(zero(self.groups), rows)
        left = [self.q[:, rows] - edited(edits, self.sample[rows], joints.q) for edits in every]
        return np.where(joints.inside, np.array(left).reshape(-1, *joints.q.shape), np.nan)

    def _joints(self, state: State, rows: IntArray) -> Joints:
        return self.motion.joints(state, self.groups, self.clock, self.sample, rows, self.chain)

    def linear(
        self, state: State, rows: IntArray, groups: Sequence[Group] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return what an explanation leaves, and how each number of some groups changes the joints.

        Args:
            state: The explanation.
            rows: Rows, by index, shape (n,).
            groups: Whose numbers; all by default.

        Returns:
            The residual in [m] and [rad], shape (c, n), and the Jacobian per unit of each number, in order
            of the groups, shape (p, c, n).
        """
        taken = self.groups if groups is None else groups
        joints = self._joints(state, rows)
        columns = np.zeros((len(taken), *joints.q.shape))
        for column, group in zip(columns, taken, strict=True):
            for j, factor in joints.factors(group, self.clock, rows):
                column[j] = factor
        return np.where(joints.inside, self.q[:, rows] - joints.q, np.nan), columns

    def deviation(self, state: State, rows: IntArray) -> FloatArray:
        """Return what an explanation leaves of the tool centre point in [m], shape (3, n).

        Without an arm it is what it leaves of the joints in [rad] or [m], shape (joints, n).

        Args:
            state: The explanation.
            rows: Rows, by index, shape (n,).
        """
        joints = self._joints(state, rows)
        is_at = joints.q if self.chain is None else positions_over_log(self.chain, joints.q.T).T
        left = self.wanted(rows) - is_at
        return np.asarray(np.where(joints.inside, left, np.nan))

    def wanted(self, rows: IntArray) -> FloatArray:
        """Return where the reference is: positions in [m], shape (3, n); without an arm its joints."""
        if self.judged is not None:
            return self.judged[:, rows]
        q = self.q[:, rows]
        return q if self.chain is None else positions_over_log(self.chain, q.T).T
