"""A tool centre point that both sides tell, without joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IntArray
from urmpipe_models.elementwise import Vector, add, cross
from urmpipe_models.kinematics.identification import changed_frames, columns_of
from urmpipe_models.transform import Transform
from urmpipe_pipeline.diagnosis.arm import add_columns, ordered_twists, turn_between
from urmpipe_pipeline.diagnosis.hypotheses import Group, State
from urmpipe_pipeline.diagnosis.motion import Clock, Motion

TOOL = 1
"""The place of the tool; that of the base is 0."""


@dataclass(frozen=True, eq=False)
class PlaceModel:
    """Where a log recorded its tool centre point, beside where the reference has it: base @ pose @ tool.

    Attributes:
        groups: What may differ by some amount.
        motion: The log's positions in [m].
        turns: Its orientations as matrices [-], shape (3, 3, m), as the motion's samples; None without any.
        clock: The log's times.
        sample: Rows of the log, shape (n,).
        position: Where the tool centre point should be in [m], shape (3, n).
        rotation: Its orientation [-], shape (3, 3, n); None unless both sides have one.
    """

    groups: tuple[Group, ...]
    motion: Motion
    turns: FloatArray | None
    clock: Clock
    sample: IntArray
    position: FloatArray
    rotation: FloatArray | None

    @property
    def rows(self) -> int:
        """How many rows are held against each other."""
        return len(self.sample)

    @property
    def blocks(self) -> IntArray:
        """Which components share a noise: positions 0, orientations 1, shape (c,)."""
        return np.repeat([0, 1], 3)[: 3 if self.rotation is None else 6]

    @cached_property
    def _spin(self) -> FloatArray:
        """How fast the log turns in the world in [rad/s], shape (3, m); 0 where that is not known."""
        if self.turns is None or self.turns.shape[2] < 3:
            return np.zeros_like(self.motion.value)
        before, after = self.turns[:, :, :-2], self.turns[:, :, 2:]
        turned = turn_between(_transform(before), after) / (self.motion.t[2:] - self.motion.t[:-2])
        return np.nan_to_num(np.pad(turned, ((0, 0), (1, 1)), mode="edge"))

    def residual(self, state: State, rows: IntArray) -> FloatArray:
        """Return what an explanation leaves: data - model in [m] and [rad], shape (c, n)."""
        return self.linear(state, rows, ())[0]

    def deviation(self, state: State, rows: IntArray) -> FloatArray:
        """Return what an explanation leaves of positions in [m], shape (3, n)."""
        return self.residual(state, rows)[:3]

    def wanted(self, rows: IntArray) -> FloatArray:
        """Return where the tool centre point should be in [m], shape (3, n)."""
        return self.position[:, rows]

    def linear(
        self, state: State, rows: IntArray, groups: Sequence[Group] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return what an explanation leaves, and how each number of some groups changes the model.

        Args:
            state: The explanation.
            rows: Rows, by index, shape (n,).
            groups: Whose numbers; all by default.

        Returns:
            The residual in [m] and [rad], shape (c, n), and the Jacobian per unit of each number, in order
            of the groups, shape (p, c, n).
        """
        taken = self.groups if groups is None else groups
        pose, velocity, spin, inside = self._looked_up(state, rows)
        ordered = ordered_twists(self.groups)
        changes = [(twist, float(state.values[c])) for twist, c in ordered]
        (base, tool), located = changed_frames((Transform(), Transform()), changes)
        before = base @ pose
        there = before @ tool
        left = np.empty((len(self.blocks), len(rows)))
        left[:3] = _factor(state, "reference") * self.position[:, rows] - np.array(there.translation)
        if self.rotation is not None:
            left[3:] = turn_between(there, self.rotation[:, :, rows])
        left[:, ~inside] = np.nan
        wanted = {c for group in taken for c in group.columns}
        twists = [(twist, c) for twist, (_, c) in zip(located, ordered, strict=True) if c in wanted]
        found = columns_of((Transform(), before), there.translation, [twist for twist, _ in twists])
        moved = {c: column for (_, c), column in zip(twists, found, strict=True)}
        columns = np.zeros((len(wanted), *left.shape))
        turning = base.rotate(spin)
        moving = add(base.rotate(velocity), cross(turning, before.rotate(tool.translation)))
        flow = (*moving, *turning)
        add_columns(columns, taken, moved, lambda group: [(flow, self.clock.flow(group, rows))])
        return left, columns

    def _looked_up(self, state: State, rows: IntArray) -> tuple[Transform, Vector, Vector, BoolArray]:
        """Return the log's poses, velocities and spins at the times of rows, and which lie within its own."""
        at = self.clock.at(state, self.groups, rows)
        position, velocity, _, inside = self.motion.at(at)
        factor = _factor(state, "log")
        pose = Transform(translation=_vector(factor * position))
        spin = np.zeros_like(velocity)
        if self.turns is not None:
            nearest = self.motion.nearest(at)
            turns, spin = self.turns[:, :, nearest], self._spin[:, nearest]
            on = (at - self.motion.t[nearest]) * spin
            pose = Transform(
                _transform(turns + np.cross(on, turns, axisa=0, axisb=0, axisc=0)).rotation, pose.translation
            )
        return pose, _vector(factor * velocity), _vector(spin), inside


def _factor(state: State, side: str) -> float:
    """Return what the positions of a side are to be multiplied by."""
    return next((edit.value for edit in state.edits if edit.name.startswith(side)), 1.0)


def _vector(values: FloatArray) -> Vector:
    """Return an array of shape (3, n) as a vector of elements."""
    x, y, z = values
    return x, y, z


def _transform(matrices: FloatArray) -> Transform:
    """Return matrices of shape (3, 3, n) as a transform of elements."""
    x, y, z = ((row[0], row[1], row[2]) for row in matrices)
    return Transform((x, y, z))
