"""An arm whose joints are known, held against where its tool centre point should be."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IntArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.elementwise import Element, Vector
from urmpipe_models.hand_eye import hand_eye
from urmpipe_models.kinematics.forward import jacobian, poses_over_log, tip_pose
from urmpipe_models.kinematics.identification import Twist, changed, sensitivities
from urmpipe_models.transform import Transform
from urmpipe_pipeline.diagnosis.arm_groups import arm_groups
from urmpipe_pipeline.diagnosis.hypotheses import Group, State, zero
from urmpipe_pipeline.diagnosis.motion import Clock, Motion
from urmpipe_pipeline.log_edits import Edits

FITTED = 100
"""Rows, spread evenly, on which unknown frames are put where they fit best; fits on all rows come after."""


@dataclass(frozen=True, eq=False)
class ArmModel:
    """A side with joints and an arm, beside a side that tells where the tool centre point was.

    Attributes:
        chain: The arm.
        groups: What may differ by some amount.
        motion: Its joints.
        clock: Its times.
        sample: Rows of the log, shape (n,).
        position: Where the tool centre point should be in [m], shape (3, n).
        rotation: Its orientation as matrices [-], shape (3, 3, n); None without any.
        frames_open: Whether base and tool are unknown: they are then put where they fit best.
    """

    chain: Chain
    groups: tuple[Group, ...]
    motion: Motion
    clock: Clock
    sample: IntArray
    position: FloatArray
    rotation: FloatArray | None
    frames_open: bool = False
    _placed: dict[Edits, Chain] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """How many rows are held against each other."""
        return len(self.sample)

    @property
    def blocks(self) -> IntArray:
        """Which components share a noise: positions 0, orientations 1, shape (c,)."""
        return np.repeat([0, 1], 3)[: 3 if self.rotation is None else 6]

    def arm(self, state: State) -> tuple[Chain, list[tuple[Twist, int]]]:
        """Return the arm as an explanation has it, and its twists there with the places of their numbers."""
        chain, groups = self._robot(state.edits), self.groups
        if chain is not self.chain:  # its own twists, with the places that those of the same name have here
            names = [group.name for group in groups if group.kind == "joint_offset"]
            own = {
                (one.kind, one.name): one
                for one in arm_groups(chain, names, turned=self.rotation is not None)
            }
            groups = tuple(
                replace(
                    group,
                    twists=own[group.kind, group.name].twists if (group.kind, group.name) in own else (),
                )
                for group in groups
            )
        twists = ordered_twists(groups)
        there, located = changed(chain, [(twist, float(state.values[c])) for twist, c in twists])
        return there, [(twist, c) for twist, (_, c) in zip(located, twists, strict=True)]

    def _robot(self, edits: Edits) -> Chain:
        """Return the arm that some edits speak of, where it fits best if that is open."""
        other = next((edit.robot for edit in edits if edit.robot is not None), None)
        chain = self.chain if other is None else other.placed(self.chain.base, self.chain.tool)
        if not self.frames_open:
            return chain
        if edits not in self._placed:
            self._placed[edits] = self._where_it_fits(chain, edits)
        return self._placed[edits]

    def _where_it_fits(self, chain: Chain, edits: Edits) -> Chain:
        """Return an arm on the base and with the tool of the least misses."""
        rows = np.unique(np.linspace(0, self.rows - 1, min(self.rows, FITTED)).round().astype(np.int64))
        state = replace(zero(self.groups), edits=edits)
        q = self.motion.joints(state, self.groups, self.clock, self.sample, rows).q
        position, rotation = poses_over_log(chain, q.T)
        measured = None if self.rotation is None else self.rotation[:, :, rows].transpose(2, 0, 1)
        found = hand_eye(position, rotation, self.position[:, rows].T, measured)
        base = _frame(found.base_rotation, found.base_position)
        return chain.placed(base @ chain.base, chain.tool @ _frame(found.tool_rotation, found.tool_position))

    def residual(self, state: State, rows: IntArray) -> FloatArray:
        """Return what an explanation leaves: data - model in [m] and [rad], shape (c, n).

        Outside the time of its side a row is NaN.

        Args:
            state: The explanation.
            rows: Rows, by index, shape (n,).
        """
        joints = self.motion.joints(state, self.groups, self.clock, self.sample, rows)
        return self._left(tip_pose(self.arm(state)[0], list(joints.q)), state, rows, joints.inside)

    def deviation(self, state: State, rows: IntArray) -> FloatArray:
        """Return what an explanation leaves of positions in [m], shape (3, n)."""
        return self.residual(state, rows)[:3]

    def wanted(self, rows: IntArray) -> FloatArray:
        """Return where the tool centre point should be in [m], shape (3, n)."""
        return self.position[:, rows]

    def _left(self, pose: Transform, state: State, rows: IntArray, inside: BoolArray) -> FloatArray:
        factor = next((edit.value for edit in state.edits if edit.kind == "path_unit"), 1.0)
        left = np.empty((len(self.blocks), len(rows)))
        for k, value in enumerate(pose.translation):
            left[k] = factor * self.position[k, rows] - value
        if self.rotation is not None:
            left[3:] = turn_between(pose, self.rotation[:, :, rows])
        left[:, ~inside] = np.nan
        return left

    def linear(
        self, state: State, rows: IntArray, groups: Sequence[Group] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return what an explanation leaves, and how each number of some groups changes the model.

        Args:
            state: The explanation.
            rows: Rows, by index, shape (n,).
            groups: Whose numbers; all by default.

        Returns:
            The residual in [m] and [rad], shape (c, n), and the Jacobian per unit of each number, in the
            order of the groups, shape (p, c, n).
        """
        taken = self.groups if groups is None else groups
        joints = self.motion.joints(state, self.groups, self.clock, self.sample, rows)
        chain, located = self.arm(state)
        q = list(joints.q)
        left = self._left(tip_pose(chain, q), state, rows, joints.inside)
        wanted = {c for g in taken for c in g.columns}
        twists = [(twist, c) for twist, c in located if c in wanted]
        velocities = sensitivities(chain, q, [t for t, _ in twists])
        moved = {c: velocity for (_, c), velocity in zip(twists, velocities, strict=True)}
        by_joint = jacobian(chain, q) if any(not group.twists for group in taken) else ()
        columns = np.zeros((len(wanted), len(self.blocks), len(rows)))
        add_columns(
            columns, taken, moved,
            lambda group: [(by_joint[j], by) for j, by in joints.factors(group, self.clock, rows)],
        )  # fmt: skip
        return left, columns


def ordered_twists(groups: Iterable[Group]) -> list[tuple[Twist, int]]:
    """Return the twists of groups with the places of their numbers; turns about z before y before x.

    Three angles of a frame are then rx, ry, rz of Rz Ry Rx, as a base and a tool are given.
    """
    found: list[tuple[Twist, int]] = []
    for group in groups:
        of_group = list(zip(group.twists, group.columns, strict=False))
        found += reversed(of_group) if group.unit == "rad" else of_group
    return found


def add_columns(
    columns: FloatArray,
    groups: Sequence[Group],
    moved: Mapping[int, tuple[Vector, Vector]],
    others: Callable[[Group], Iterable[tuple[Sequence[Element], Element]]],
) -> None:
    """Fill the columns of groups: of twists with the velocity and turn they make, of others with sums.

    Args:
        columns: Zeros, shape (p, c, n), in [m] and [rad] per unit of a number; in the order of the groups.
        groups: Whose numbers.
        moved: Velocity and turn by the place of a number.
        others: Returns what moves without a twist: velocities and turns, each with a factor.
    """
    ordered = iter(columns)
    for group in groups:
        for c in group.columns:
            column = next(ordered)
            if c in moved:
                velocity, turn = moved[c]
                _add(column, (*velocity, *turn), 1.0)
            elif not group.twists:
                for values, factor in others(group):
                    _add(column, values, factor)


def _frame(rotation: FloatArray, position: FloatArray) -> Transform:
    """Return a frame of arrays as one of plain numbers."""
    x, y, z = (tuple(float(one) for one in row) for row in rotation)
    a, b, c = (float(one) for one in position)
    return Transform((x, y, z), (a, b, c))  # type: ignore[arg-type]


def _add(column: FloatArray, values: Sequence[Element], factor: Element) -> None:
    """Add as many of some values as a column has components, by a factor."""
    for k, value in zip(range(len(column)), values, strict=False):
        if not isinstance(value, float) or value:
            column[k] += value * factor


def turn_between(pose: Transform, rotation: FloatArray) -> FloatArray:
    """Return the turn from a model to given orientations: 2 sin(angle / 2) u in the world, shape (3, n).

    Small ones are rotation vectors in [rad]. It is sin(angle) u / cos(angle / 2), with sin(angle) u half the
    sum of the cross products of the axes, and 4 cos(angle / 2)^2 = 1 + trace.

    Args:
        pose: The model's, elements of shape (n,).
        rotation: Matrices [-], shape (3, 3, n).
    """
    crossed, trace = np.zeros((3, rotation.shape[2])), np.zeros(rotation.shape[2])
    for k in range(3):
        x, y, z = (pose.rotation[row][k] for row in range(3))
        u, v, w = rotation[:, k]
        crossed += np.array(np.broadcast_arrays(y * w - z * v, z * u - x * w, x * v - y * u))
        trace += x * u + y * v + z * w
    return np.asarray(crossed / np.sqrt(np.maximum(1.0 + trace, 1e-12)))
