"""A tool centre point that both sides tell, without joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray, Vector, add, cross
from urmpipe_models.kinematics.identification import apply_twists_to_frames, sensitivity_columns
from urmpipe_models.math3d import Transform
from urmpipe_pipeline.diagnosis.arm import (
    add_columns,
    as_read,
    axes_of,
    ordered_twists,
    pose_residual,
    turn_between,
    unit_of,
)
from urmpipe_pipeline.diagnosis.fit import Positions
from urmpipe_pipeline.diagnosis.hypotheses import Group, State, zero
from urmpipe_pipeline.diagnosis.motion import Clock, Motion
from urmpipe_pipeline.runs.reading_errors import IDENTITY, Edits

TOOL = 1
"""The place of the tool; that of the base is 0."""


@dataclass(frozen=True, eq=False)
class PlaceModel(Positions):
    """Where a log recorded its tool centre point, beside where the reference has it: base @ pose @ tool.

    Residuals are in the unit that the reference was read in, whatever the unit of either side is.

    Attributes:
        groups: What may differ by some amount.
        motion: The log's positions in [m].
        turns: Its orientations as matrices [-], shape (3, 3, m), as the motion's samples; None without any.
        clock: The log's times.
        sample: Rows of the log, shape (n,).
        position: Where the tool centre point should be in [m], shape (3, n).
        rotation: Its orientation [-], shape (3, 3, n); None unless both sides have one.
        judged: Where it should be as a comparison has it in [m], shape (3, n); None if that is `position`.
    """

    groups: tuple[Group, ...]
    motion: Motion
    turns: FloatArray | None
    clock: Clock
    sample: IntArray
    position: FloatArray
    rotation: FloatArray | None
    judged: FloatArray | None = None

    @cached_property
    def _spin(self) -> FloatArray:
        """How fast the log turns in the world in [rad/s], shape (3, m); 0 where that is not known."""
        if self.turns is None or self.turns.shape[2] < 3:
            return np.zeros_like(self.motion.value)
        before, after = self.turns[:, :, :-2], self.turns[:, :, 2:]
        turned = turn_between(_transform(before), after) / (self.motion.t[2:] - self.motion.t[:-2])
        return np.nan_to_num(np.pad(turned, ((0, 0), (1, 1)), mode="edge"))

    def residual(self, state: State, rows: IntArray) -> FloatArray:
        """Return data - model of an explanation in [m] as the data were read and [rad], shape (c, n)."""
        return self.linear(state, rows, ())[0]

    def residuals(self, every: Sequence[Edits], rows: IntArray) -> FloatArray:
        """Return the residual of explanations without numbers in [m] and [rad], shape (len(every), c, n)."""
        nothing = zero(self.groups)
        lefts = [self.residual(replace(nothing, edits=edits), rows) for edits in every]
        return np.array(lefts).reshape(-1, len(self.blocks), len(rows))

    def deviation(self, state: State, rows: IntArray) -> FloatArray:
        """Return what an explanation leaves of what is judged: positions in true [m], shape (3, n)."""
        left = self.residual(state, rows)[:3]
        if self.judged is not None:
            left = left + (self.judged - self.position)[:, rows]
        return unit_of(state.edits, "reference") * left

    def linear(
        self, state: State, rows: IntArray, groups: Sequence[Group] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return what an explanation leaves, and how each number of some groups changes the model.

        Args:
            state: The explanation.
            rows: Rows, by index, shape (n,).
            groups: Whose numbers; all by default.

        Returns:
            The residual as `residual` has it, shape (c, n), and the Jacobian of the model per unit of each
            number, in order of the groups, shape (p, c, n).
        """
        taken = self.groups if groups is None else groups
        pose, velocity, spin, inside = self._looked_up(state, rows)
        ordered = ordered_twists(self.groups)
        changes = [(twist, float(state.values[c])) for twist, c in ordered]
        turned = Transform(axes_of(state.edits, "base_rotation") or IDENTITY)
        (base, tool), located = apply_twists_to_frames((turned, Transform()), changes)
        before = base @ pose
        there = before @ tool
        rotation = None if self.rotation is None else self.rotation[:, :, rows]
        left = pose_residual(there, state.edits, self.position[:, rows], rotation, inside, "reference")
        wanted = {c for group in taken for c in group.columns}
        twists = [(twist, c) for twist, (_, c) in zip(located, ordered, strict=True) if c in wanted]
        found = sensitivity_columns((Transform(), before), there.translation, [twist for twist, _ in twists])
        moved = {c: column for (_, c), column in zip(twists, found, strict=True)}
        columns = np.zeros((len(wanted), *left.shape))
        turning = base.rotate(spin)
        moving = add(base.rotate(velocity), cross(turning, before.rotate(tool.translation)))
        flow = (*moving, *turning)
        add_columns(columns, taken, moved, lambda group: [(flow, self.clock.flow(group, rows))])
        return left, as_read(columns, state.edits, "reference")

    def _looked_up(self, state: State, rows: IntArray) -> tuple[Transform, Vector, Vector, BoolArray]:
        """Return the log's poses, velocities and spins at the times of rows, and which lie within its own."""
        at = self.clock.at(state, self.groups, rows)
        position, velocity, _, inside = self.motion.at(at)
        factor = unit_of(state.edits, "log")
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


def _vector(values: FloatArray) -> Vector:
    """Return an array of shape (3, n) as a vector of elements."""
    x, y, z = values
    return x, y, z


def _transform(matrices: FloatArray) -> Transform:
    """Return matrices of shape (3, 3, n) as a transform of elements."""
    x, y, z = ((row[0], row[1], row[2]) for row in matrices)
    return Transform((x, y, z))
