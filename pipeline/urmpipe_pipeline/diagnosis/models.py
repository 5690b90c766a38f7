"""The models of one side with causes, compared with the data of the other (`hypotheses.Model`).

- `ArmModel`: joints and a robot on one side, positions on the other. The pose is base @ arm(q) @ tool, with
  the twists of the parameters in their frames, and q of motion.py.
- `TcpModel`: a tool centre point on both sides, without joints: base @ pose @ tool.
- `JointModel`: joints on both sides, compared one by one, and judged where they lead the arm.

The Jacobian of a twist is the velocity v and the turn w of the tool per unit; those of joints and clock are
the columns of the arm's Jacobian times dq/dx. Residuals are in the unit in which the data were read: a factor
of their unit divides the model, so that it does not scale the noise of the data.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import (
    BoolArray,
    Element,
    FloatArray,
    IntArray,
    Vector,
    add,
    cross,
    scale,
    spread_rows,
)
from urmpipe_models.hand_eye import solve_hand_eye
from urmpipe_models.kinematics.forward import jacobian, poses_over_log, positions_over_log, tip_pose
from urmpipe_models.kinematics.identification import (
    Twist,
    apply_twists,
    apply_twists_to_frames,
    sensitivities,
    sensitivity_columns,
)
from urmpipe_models.math3d import Transform
from urmpipe_pipeline.diagnosis.hypotheses import Group, State, cause_groups, null_state
from urmpipe_pipeline.diagnosis.motion import Clock, Joints, Motion
from urmpipe_pipeline.runs.reading_errors import IDENTITY, Edits, Matrix

FRAME_FIT_ROWS = 100  # evenly spaced, for the first fit of unknown frames; fits on all rows follow
TOOL = 1  # place of the tool of a `TcpModel`; that of its base is 0


class PositionModel:
    """Base of the models whose tool centre point is judged.

    Attributes:
        sample: Rows of the log, shape (n,).
        position: Data: positions of the tool centre point in [m], shape (3, n).
        rotation: Data: orientations as matrices [-], shape (3, 3, n); None without any.
        judged: The positions as the comparison judges them in [m], shape (3, n); None if these are
            `position`.
    """

    data_side: ClassVar[str] = ""  # side of the data, in names of units; any by default
    sample: IntArray
    position: FloatArray
    rotation: FloatArray | None
    judged: FloatArray | None

    @property
    def unit(self) -> Literal["m", "rad"]:
        """Unit of the deviation."""
        return "m"

    @property
    def of_joints(self) -> bool:
        """Whether the deviation is of the joints themselves, not of positions."""
        return False

    @property
    def rows(self) -> int:
        """Number of compared rows."""
        return len(self.sample)

    @property
    def blocks(self) -> IntArray:
        """Noise level of each component: positions 0, orientations 1, shape (c,)."""
        return np.repeat([0, 1], 3)[: 3 if self.rotation is None else 6]

    def target(self, rows: IntArray) -> FloatArray:
        """Return the positions as they are judged in [m], shape (3, n)."""
        return (self.position if self.judged is None else self.judged)[:, rows]

    def deviation(self, state: State, rows: IntArray) -> FloatArray:
        """Return the deviation that is left, as it is judged: positions in true [m], shape (3, n)."""
        left = self.residual(state, rows)[:3]
        if self.judged is not None:
            left = left + (self.judged - self.position)[:, rows]
        return unit_of(state.edits, self.data_side) * left

    def residual(self, state: State, rows: IntArray) -> FloatArray:
        """Return data - model in [m] as the data were read and [rad], shape (c, n)."""
        return self.linear(state, rows, ())[0]

    @abstractmethod
    def linear(
        self, state: State, rows: IntArray, groups: Sequence[Group] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return residual and Jacobian in [m] and [rad], shapes (c, n), (p, c, n), of rows, shape (n,)."""

    def _residual(self, pose: Transform, edits: Edits, rows: IntArray, inside: BoolArray) -> FloatArray:
        """Return data - model of poses on a base that is not mirrored; NaN outside the time of the model."""
        if (mirror := axes_of(edits, "base_mirrored")) is not None:
            axes = Transform(mirror)
            mirrored = axes @ pose
            pose = Transform((mirrored @ Transform(axes.columns)).rotation, mirrored.translation)
        left = np.empty((len(self.blocks), len(rows)))
        factor = unit_of(edits, self.data_side)
        for k, value in enumerate(pose.translation):
            left[k] = self.position[k, rows] - value / factor
        if self.rotation is not None:
            left[3:] = rotation_error(pose, self.rotation[:, :, rows])
        left[:, ~inside] = np.nan
        return left

    def _to_data_axes(self, columns: FloatArray, edits: Edits) -> FloatArray:
        """Return a Jacobian in [m] and [rad], shape (p, c, n), in the axes and the unit of the data as read.

        Args:
            columns: Velocities and turns per unit of each parameter, of a base that is not mirrored; changed.
            edits: The edits of the explanation.
        """
        if (mirror := axes_of(edits, "base_mirrored")) is not None:
            moved, turned = columns[:, :3].copy(), columns[:, 3:].copy()
            columns[:, :3] = np.einsum("ij,pjn->pin", mirror, moved)
            if turned.size:  # a mirror reverses the sense of turns
                columns[:, 3:] = -np.einsum("ij,pjn->pin", mirror, turned)
        if (factor := unit_of(edits, self.data_side)) != 1.0:
            columns[:, :3] /= factor
        return columns


@dataclass(frozen=True, eq=False)
class ArmModel(PositionModel):
    """A side with joints and an arm, and the positions of the other side.

    A frame beyond the bounds of an arm raises a RobotError.

    Attributes:
        chain: The arm.
        groups: The causes of some size.
        motion: Its joints.
        clock: Its times.
        sample: Rows of the log, shape (n,).
        position: Data: positions of the tool centre point in [m], shape (3, n).
        rotation: Data: orientations as matrices [-], shape (3, 3, n); None without any.
        frames_open: Whether base and tool are unknown: they are then placed where they fit best.
        judged: The positions as the comparison judges them in [m], shape (3, n); None if these are
            `position`.
    """

    chain: Chain
    groups: tuple[Group, ...]
    motion: Motion
    clock: Clock
    sample: IntArray
    position: FloatArray
    rotation: FloatArray | None
    frames_open: bool = False
    judged: FloatArray | None = None
    _placed: dict[Edits, Chain] = field(default_factory=dict)  # kept by `replace`: moved joints fit no frames
    _twists: dict[str, list[tuple[Twist, int]]] = field(default_factory=dict, init=False)

    def arm(self, state: State, needed: Collection[int] = ()) -> tuple[Chain, list[tuple[Twist, int]]]:
        """Return the arm with the causes of an explanation, and its twists there with their columns.

        Args:
            state: The explanation.
            needed: Columns whose twists are returned even if their parameters are 0.
        """
        chain, values = self._robot(state.edits), state.values.tolist()
        twists = [(twist, c) for twist, c in self._twists_of(chain, state.edits) if values[c] or c in needed]
        altered, located = apply_twists(chain, [(twist, values[c]) for twist, c in twists])
        return altered, [(twist, c) for twist, (_, c) in zip(located, twists, strict=True)]

    def _twists_of(self, chain: Chain, edits: Edits) -> list[tuple[Twist, int]]:
        """Return the twists of all groups; with another robot those of its groups of the same names."""
        name = next((edit.name for edit in edits if edit.robot is not None), "")
        if name not in self._twists:
            groups: Iterable[Group] = self.groups
            if name:
                joints = [group.name for group in self.groups if group.kind == "joint_offset"]
                of_robot = cause_groups(chain, joints, has_rotation=self.rotation is not None, timed=False)
                twists = {_key(group): group.twists for group in of_robot}
                groups = (group._replace(twists=twists.get(_key(group), ())) for group in self.groups)
            self._twists[name] = ordered_twists(groups)
        return self._twists[name]

    def _robot(self, edits: Edits) -> Chain:
        """Return the robot of some edits, on a turned base, or where it fits best if its frames are open."""
        other = next((edit.robot for edit in edits if edit.robot is not None), None)
        chain = self.chain if other is None else other.placed(self.chain.base, self.chain.tool)
        if self.frames_open:
            if edits not in self._placed:
                self._placed[edits] = self._fit_frames(chain, edits)
            return self._placed[edits]
        matrix = axes_of(edits, "base_rotation")
        if matrix is None:
            return chain
        base = Transform(matrix) @ Transform(chain.base.rotation)
        return chain.placed(Transform(base.rotation, chain.base.translation))

    def _fit_frames(self, chain: Chain, edits: Edits) -> Chain:
        """Return an arm with the base and the tool that fit best."""
        rows = spread_rows(self.rows, FRAME_FIT_ROWS)
        state = null_state(self.groups)._replace(edits=edits)
        q = self._joints(state, rows).q
        position, rotation = poses_over_log(chain, q.T)
        mirror = np.array(axes_of(edits, "base_mirrored") or IDENTITY)
        measured = None
        if self.rotation is not None:
            measured = mirror.T @ self.rotation[:, :, rows].transpose(2, 0, 1) @ mirror
        fit = solve_hand_eye(position, rotation, self.position[:, rows].T @ mirror, measured)
        base = _frame(fit.base_rotation, fit.base_position)
        return chain.placed(base @ chain.base, chain.tool @ _frame(fit.tool_rotation, fit.tool_position))

    def residual(self, state: State, rows: IntArray) -> FloatArray:
        """Return data - model in [m] as the data were read and [rad], shape (c, n)."""
        joints = self._joints(state, rows)
        return self._residual(tip_pose(self.arm(state)[0], list(joints.q)), state.edits, rows, joints.inside)

    def residuals(self, edits: Sequence[Edits], rows: IntArray) -> FloatArray:
        """Return `residual` of explanations without parameters in [m] and [rad], shape (len(edits), c, n).

        The joints of all edits of a robot go through its kinematics at once.
        """
        null, count = null_state(self.groups), len(rows)
        if self.frames_open:  # the frames depend on the edits
            residuals = [self.residual(null._replace(edits=each), rows) for each in edits]
            return np.array(residuals).reshape(-1, len(self.blocks), count)
        joints = self._joints(null, rows)
        result = np.empty((len(edits), len(self.blocks), count))
        by_robot: dict[Edits, dict[Edits, list[int]]] = {}
        for i, each in enumerate(edits):
            robot = tuple(edit for edit in each if edit.robot is not None)
            of_joints = tuple(edit for edit in each if edit.joints)
            by_robot.setdefault(robot, {}).setdefault(of_joints, []).append(i)
        for robot, cases in by_robot.items():
            q = np.concatenate([edit_joints(each, self.sample[rows], joints.q) for each in cases], axis=1)
            pose = tip_pose(self._robot(robot), list(q))
            tiled = np.tile(rows, len(cases)), np.tile(joints.inside, len(cases))
            plain = self._residual(pose, (), *tiled).reshape(len(self.blocks), -1, count)
            for k, places in enumerate(cases.values()):
                part = slice(k * count, (k + 1) * count)
                for i in places:
                    placing = tuple(edit for edit in edits[i] if not edit.joints and edit.robot is None)
                    result[i] = plain[:, k]
                    if placing:
                        turned = self._turn_base(_rows_of(pose, part), placing)
                        result[i] = self._residual(turned, placing, rows, joints.inside)
        return result

    def _turn_base(self, pose: Transform, edits: Edits) -> Transform:
        """Return poses on a base that edits turn about its origin."""
        matrix = axes_of(edits, "base_rotation")
        if matrix is None:
            return pose
        at = self.chain.base.translation
        turn = Transform(translation=at) @ Transform(matrix) @ Transform(translation=scale(-1.0, at))
        return turn @ pose

    def _joints(self, state: State, rows: IntArray) -> Joints:
        return self.motion.joints(state, self.groups, self.clock, self.sample, rows, self.chain)

    @cached_property
    def reach(self) -> float:
        """The sum of the arm's lengths in [m]."""
        return sum(float(np.linalg.norm(frame.translation)) for frame in self.chain.frames[1:])

    def motions(
        self, state: State, rows: IntArray, groups: Sequence[Group]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the residual of positions, and how the parameters of groups move and turn the tool.

        Args:
            state: The explanation.
            rows: Indices of rows, shape (n,).
            groups: Whose parameters.

        Returns:
            The residual in [m], shape (3, n); velocities in [m] and turns in [rad] per unit, (p, 3, n) each.
        """
        left, columns = self._linear(state, rows, groups, 6)
        return left[:3], columns[:, :3], columns[:, 3:]

    def linear(
        self, state: State, rows: IntArray, groups: Sequence[Group] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return residual and Jacobian in [m] and [rad], shapes (c, n), (p, c, n), of rows, shape (n,)."""
        return self._linear(state, rows, self.groups if groups is None else groups, len(self.blocks))

    def _linear(
        self, state: State, rows: IntArray, groups: Sequence[Group], components: int
    ) -> tuple[FloatArray, FloatArray]:
        joints = self._joints(state, rows)
        needed = {c for group in groups for c in group.columns}
        chain, located = self.arm(state, needed)
        q = list(joints.q)
        left = self._residual(tip_pose(chain, q), state.edits, rows, joints.inside)
        twists = [(twist, c) for twist, c in located if c in needed]
        distinct = {id(twist): twist for twist, _ in twists}  # an axis of a frame, and the same of all three
        velocities = dict(zip(distinct, sensitivities(chain, q, [*distinct.values()]), strict=True))
        moved = {c: velocities[id(twist)] for twist, c in twists}
        by_joint = jacobian(chain, q) if any(not group.twists for group in groups) else ()
        columns = np.zeros((len(needed), components, len(rows)))
        fill_columns(
            columns, groups, moved,
            lambda group: [(by_joint[j], by) for j, by in joints.factors(group, self.clock, rows)],
        )  # fmt: skip
        return left, self._to_data_axes(columns, state.edits)


@dataclass(frozen=True, eq=False)
class TcpModel(PositionModel):
    """The recorded tool centre point of a log, and the positions of the reference: base @ pose @ tool.

    Attributes:
        groups: The causes of some size.
        motion: The log's positions in [m].
        turns: Its orientations as matrices [-], shape (3, 3, m), as the motion's samples; None without any.
        clock: The log's times.
        sample: Rows of the log, shape (n,).
        position: Data: positions of the tool centre point in [m], shape (3, n).
        rotation: Data: orientations [-], shape (3, 3, n); None unless both sides have them.
        judged: The positions as the comparison judges them in [m], shape (3, n); None if these are
            `position`.
    """

    data_side = "reference"
    groups: tuple[Group, ...]
    motion: Motion
    turns: FloatArray | None
    clock: Clock
    sample: IntArray
    position: FloatArray
    rotation: FloatArray | None
    judged: FloatArray | None = None

    @cached_property
    def _angular_velocity(self) -> FloatArray:
        """Angular velocity of the log in the world in [rad/s], shape (3, m); 0 where it is unknown."""
        if self.turns is None or self.turns.shape[2] < 3:
            return np.zeros_like(self.motion.value)
        before, after = self.turns[:, :, :-2], self.turns[:, :, 2:]
        turned = rotation_error(_transform(before), after) / (self.motion.t[2:] - self.motion.t[:-2])
        return np.nan_to_num(np.pad(turned, ((0, 0), (1, 1)), mode="edge"))

    def residuals(self, edits: Sequence[Edits], rows: IntArray) -> FloatArray:
        """Return `residual` of explanations without parameters in [m] and [rad], shape (len(edits), c, n)."""
        null = null_state(self.groups)
        residuals = [self.residual(null._replace(edits=each), rows) for each in edits]
        return np.array(residuals).reshape(-1, len(self.blocks), len(rows))

    def linear(
        self, state: State, rows: IntArray, groups: Sequence[Group] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return residual and Jacobian in [m] and [rad], shapes (c, n), (p, c, n), of rows, shape (n,)."""
        groups = self.groups if groups is None else groups
        pose, velocity, angular_velocity, inside = self._look_up(state, rows)
        ordered = ordered_twists(self.groups)
        changes = [(twist, float(state.values[c])) for twist, c in ordered]
        turned = Transform(axes_of(state.edits, "base_rotation") or IDENTITY)
        (base, tool), located = apply_twists_to_frames((turned, Transform()), changes)
        before = base @ pose
        moved_pose = before @ tool
        left = self._residual(moved_pose, state.edits, rows, inside)
        needed = {c for group in groups for c in group.columns}
        twists = [(twist, c) for twist, (_, c) in zip(located, ordered, strict=True) if c in needed]
        sensitivity = sensitivity_columns(
            (Transform(), before), moved_pose.translation, [twist for twist, _ in twists]
        )
        moved = {c: column for (_, c), column in zip(twists, sensitivity, strict=True)}
        columns = np.zeros((len(needed), *left.shape))
        turning = base.rotate(angular_velocity)
        moving = add(base.rotate(velocity), cross(turning, before.rotate(tool.translation)))
        flow = (*moving, *turning)
        fill_columns(columns, groups, moved, lambda group: [(flow, self.clock.flow(group, rows))])
        return left, self._to_data_axes(columns, state.edits)

    def _look_up(self, state: State, rows: IntArray) -> tuple[Transform, Vector, Vector, BoolArray]:
        """Return poses, velocities and angular velocities of the log at the times of rows, and `inside`."""
        at = self.clock.at(state, self.groups, rows)
        position, velocity, _, inside = self.motion.at(at)
        factor = unit_of(state.edits, "log")
        pose = Transform(translation=_vector(factor * position))
        spin = np.zeros_like(velocity)
        if self.turns is not None:
            nearest = self.motion.nearest(at)
            turns, spin = self.turns[:, :, nearest], self._angular_velocity[:, nearest]
            angle = (at - self.motion.t[nearest]) * spin
            pose = Transform(
                _transform(turns + np.cross(angle, turns, axisa=0, axisb=0, axisc=0)).rotation,
                pose.translation,
            )
        return pose, _vector(factor * velocity), _vector(spin), inside


@dataclass(frozen=True, eq=False)
class JointModel:
    """The joints of a log, and those of the reference.

    Attributes:
        groups: The causes of some size.
        motion: The log's joints.
        clock: The log's times.
        sample: Rows of the log, shape (n,).
        q: Data: the reference's joints in [rad] or [m], shape (joints, n).
        sliding: Which joints are in [m], shape (joints,).
        chain: The arm; None for the joints alone.
        judged: The reference as the comparison judges it: positions in [m], shape (3, n), without an arm
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
        """Unit of the deviation; rad for revolute and prismatic joints together."""
        return "rad" if self.of_joints and not all(self.sliding) else "m"

    @property
    def of_joints(self) -> bool:
        """Whether the deviation is of the joints themselves, not of positions."""
        return self.chain is None

    @property
    def rows(self) -> int:
        """Number of compared rows."""
        return len(self.sample)

    @property
    def blocks(self) -> IntArray:
        """Noise level of each component: revolute joints 0, prismatic joints 1, shape (joints,)."""
        return np.array(self.sliding, dtype=np.int64)

    def residual(self, state: State, rows: IntArray) -> FloatArray:
        """Return reference - log in [rad] or [m], shape (joints, n)."""
        joints = self._joints(state, rows)
        return np.asarray(np.where(joints.inside, self.q[:, rows] - joints.q, np.nan))

    def residuals(self, edits: Sequence[Edits], rows: IntArray) -> FloatArray:
        """Return each `residual` without parameters in [rad] or [m], shape (len(edits), joints, n)."""
        joints = self._joints(null_state(self.groups), rows)
        left = [self.q[:, rows] - edit_joints(each, self.sample[rows], joints.q) for each in edits]
        return np.where(joints.inside, np.array(left).reshape(-1, *joints.q.shape), np.nan)

    def _joints(self, state: State, rows: IntArray) -> Joints:
        return self.motion.joints(state, self.groups, self.clock, self.sample, rows, self.chain)

    def linear(
        self, state: State, rows: IntArray, groups: Sequence[Group] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return residual and Jacobian in [m] and [rad], shapes (joints, n), (p, joints, n), rows (n,)."""
        groups = self.groups if groups is None else groups
        joints = self._joints(state, rows)
        columns = np.zeros((len(groups), *joints.q.shape))
        for column, group in zip(columns, groups, strict=True):
            for j, factor in joints.factors(group, self.clock, rows):
                column[j] = factor
        return np.where(joints.inside, self.q[:, rows] - joints.q, np.nan), columns

    def deviation(self, state: State, rows: IntArray) -> FloatArray:
        """Return the deviation of positions in [m], shape (3, n); without an arm of joints, (joints, n)."""
        joints = self._joints(state, rows)
        actual = joints.q if self.chain is None else positions_over_log(self.chain, joints.q.T).T
        return np.asarray(np.where(joints.inside, self.target(rows) - actual, np.nan))

    def target(self, rows: IntArray) -> FloatArray:
        """Return the positions of the reference in [m], shape (3, n); without an arm its joints."""
        if self.judged is not None:
            return self.judged[:, rows]
        q = self.q[:, rows]
        return q if self.chain is None else positions_over_log(self.chain, q.T).T


def ordered_twists(groups: Iterable[Group]) -> list[tuple[Twist, int]]:
    """Return the twists of groups with their columns; turns about z before y before x.

    Three angles of a frame are then rx, ry, rz of Rz Ry Rx, as for a base and a tool.
    """
    twists: list[tuple[Twist, int]] = []
    for group in groups:
        of_group = list(zip(group.twists, group.columns, strict=False))
        twists += reversed(of_group) if group.unit == "rad" else of_group
    return twists


def fill_columns(
    columns: FloatArray,
    groups: Sequence[Group],
    moved: Mapping[int, tuple[Vector, Vector]],
    without_twist: Callable[[Group], Iterable[tuple[Sequence[Element], Element]]],
) -> None:
    """Fill the columns of groups: with the velocity and turn of a twist, else with sums.

    Args:
        columns: Zeros, shape (p, c, n), in [m] and [rad] per unit of a parameter; in the order of the groups.
        groups: Whose parameters.
        moved: Velocity and turn by the column of a parameter.
        without_twist: Returns velocities and turns of a group without twists, each with a factor.
    """
    ordered = iter(columns)
    for group in groups:
        for c in group.columns:
            column = next(ordered)
            if c in moved:
                velocity, turn = moved[c]
                _add(column, (*velocity, *turn), 1.0)
            elif not group.twists:
                for values, factor in without_twist(group):
                    _add(column, values, factor)


def axes_of(edits: Edits, kind: str) -> Matrix | None:
    """Return the matrix [-] by which edits of a kind turn or mirror the base; None without one."""
    return next((edit.matrix for edit in edits if edit.kind == kind), None)


def unit_of(edits: Edits, side: str = "") -> float:
    """Return the factor from positions of a side, as read, to [m]."""
    factors = (edit.value for edit in edits if edit.kind == "path_unit" and edit.name.startswith(side))
    return next(factors, 1.0)


def edit_joints(edits: Edits, log_rows: IntArray, q: FloatArray) -> FloatArray:
    """Return joints in [rad] or [m], shape (joints, n), after edits."""
    for edit in edits:
        (q,) = edit.of_joints(log_rows, q)
    return q


def rotation_error(pose: Transform, rotation: FloatArray) -> FloatArray:
    """Return the rotation from a model to other orientations: 2 sin(angle / 2) u in the world, shape (3, n).

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


def _key(group: Group) -> tuple[object, ...]:
    return group.kind, group.name, group.axis if group.name in ("base", "tool") else None


def _rows_of(pose: Transform, part: slice) -> Transform:
    """Return some of the rows of poses."""
    elements = (*pose.translation, *(element for row in pose.rotation for element in row))
    x, y, z, *r = (element[part] if isinstance(element, np.ndarray) else element for element in elements)
    return Transform(((r[0], r[1], r[2]), (r[3], r[4], r[5]), (r[6], r[7], r[8])), (x, y, z))


def _frame(rotation: FloatArray, position: FloatArray) -> Transform:
    """Return a frame of arrays as one of plain numbers."""
    x, y, z = map(tuple, rotation.tolist())
    a, b, c = position.tolist()
    return Transform((x, y, z), (a, b, c))


def _vector(values: FloatArray) -> Vector:
    """Return an array of shape (3, n) as a vector of elements."""
    x, y, z = values
    return x, y, z


def _transform(matrices: FloatArray) -> Transform:
    """Return matrices of shape (3, 3, n) as a transform of elements."""
    x, y, z = ((row[0], row[1], row[2]) for row in matrices)
    return Transform((x, y, z))


def _add(column: FloatArray, values: Sequence[Element], factor: Element) -> None:
    """Add a factor times the first values to the components of a column."""
    for k, value in zip(range(len(column)), values, strict=False):
        if not isinstance(value, float) or value:
            column[k] += value * factor
