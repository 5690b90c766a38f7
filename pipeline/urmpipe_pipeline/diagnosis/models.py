"""An arm whose joints are known, held against where its tool centre point should be."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

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
from urmpipe_pipeline.diagnosis.hypotheses import Group, State, cause_groups, zero
from urmpipe_pipeline.diagnosis.motion import Clock, Joints, Motion
from urmpipe_pipeline.runs.reading_errors import IDENTITY, Edits, Matrix

FITTED = 100
"""Rows, spread evenly, on which unknown frames are put where they fit best; fits on all rows come after."""


class Positions:
    """What models have in common whose tool centre point is judged.

    Attributes:
        sample: Rows of the log, shape (n,).
        position: Where the tool centre point should be in [m], shape (3, n).
        rotation: Its orientation as matrices [-], shape (3, 3, n); None without any.
        judged: Where it should be as a comparison has it in [m], shape (3, n); None if that is `position`.
    """

    sample: IntArray
    position: FloatArray
    rotation: FloatArray | None
    judged: FloatArray | None

    @property
    def unit(self) -> Literal["m", "rad"]:
        """Of what is judged."""
        return "m"

    @property
    def of_joints(self) -> bool:
        """Whether the joints themselves are judged, not positions."""
        return False

    @property
    def rows(self) -> int:
        """How many rows are compared."""
        return len(self.sample)

    @property
    def blocks(self) -> IntArray:
        """Which components share a noise: positions 0, orientations 1, shape (c,)."""
        return np.repeat([0, 1], 3)[: 3 if self.rotation is None else 6]

    def wanted(self, rows: IntArray) -> FloatArray:
        """Return where the tool centre point should be as it is judged in [m], shape (3, n)."""
        return (self.position if self.judged is None else self.judged)[:, rows]


@dataclass(frozen=True, eq=False)
class ArmModel(Positions):
    """A side with joints and an arm, beside a side that tells where the tool centre point was.

    Residuals are in the unit that the data were read in: a factor of the path divides the model, so that it
    does not make the noise of the data smaller. A frame beyond the bounds of an arm raises a RobotError.

    Attributes:
        chain: The arm.
        groups: What may differ by some amount.
        motion: Its joints.
        clock: Its times.
        sample: Rows of the log, shape (n,).
        position: Where the tool centre point should be in [m], shape (3, n).
        rotation: Its orientation as matrices [-], shape (3, 3, n); None without any.
        frames_open: Whether base and tool are unknown: they are then put where they fit best.
        judged: Where it should be as a comparison has it in [m], shape (3, n); None if that is `position`.
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
    _placed: dict[Edits, Chain] = field(default_factory=dict)
    _twists: dict[str, list[tuple[Twist, int]]] = field(default_factory=dict, init=False)

    def arm(self, state: State, wanted: Collection[int] = ()) -> tuple[Chain, list[tuple[Twist, int]]]:
        """Return the arm as an explanation has it, and its twists there with the places of their numbers.

        Args:
            state: The explanation.
            wanted: Places of numbers whose twists are returned though they are 0.
        """
        chain, values = self._robot(state.edits), state.values.tolist()
        twists = [one for one in self._twists_of(chain, state.edits) if values[one[1]] or one[1] in wanted]
        there, located = apply_twists(chain, [(twist, values[c]) for twist, c in twists])
        return there, [(twist, c) for twist, (_, c) in zip(located, twists, strict=True)]

    def _twists_of(self, chain: Chain, edits: Edits) -> list[tuple[Twist, int]]:
        """Return the twists of all groups, those of the same name of a robot that some edits speak of."""
        name = next((edit.name for edit in edits if edit.robot is not None), "")
        if name not in self._twists:
            groups: Iterable[Group] = self.groups
            if name:
                joints = [group.name for group in self.groups if group.kind == "joint_offset"]
                every = cause_groups(chain, joints, turned=self.rotation is not None, timed=False)
                twists = {_key(group): group.twists for group in every}
                groups = (replace(group, twists=twists.get(_key(group), ())) for group in self.groups)
            self._twists[name] = ordered_twists(groups)
        return self._twists[name]

    def _robot(self, edits: Edits) -> Chain:
        """Return the arm that some edits speak of, on a turned base or where it fits best if that is open."""
        other = next((edit.robot for edit in edits if edit.robot is not None), None)
        chain = self.chain if other is None else other.placed(self.chain.base, self.chain.tool)
        if self.frames_open:
            if edits not in self._placed:
                self._placed[edits] = self._where_it_fits(chain, edits)
            return self._placed[edits]
        matrix = axes_of(edits, "base_rotation")
        if matrix is None:
            return chain
        base = Transform(matrix) @ Transform(chain.base.rotation)
        return chain.placed(Transform(base.rotation, chain.base.translation))

    def _where_it_fits(self, chain: Chain, edits: Edits) -> Chain:
        """Return an arm on the base and with the tool of the least misses."""
        rows = spread_rows(self.rows, FITTED)
        state = replace(zero(self.groups), edits=edits)
        q = self._joints(state, rows).q
        position, rotation = poses_over_log(chain, q.T)
        mirror = np.array(axes_of(edits, "base_mirrored") or IDENTITY)
        measured = None
        if self.rotation is not None:
            measured = mirror.T @ self.rotation[:, :, rows].transpose(2, 0, 1) @ mirror
        found = solve_hand_eye(position, rotation, self.position[:, rows].T @ mirror, measured)
        base = _frame(found.base_rotation, found.base_position)
        return chain.placed(base @ chain.base, chain.tool @ _frame(found.tool_rotation, found.tool_position))

    def residual(self, state: State, rows: IntArray) -> FloatArray:
        """Return data - model of an explanation in [m] as the data were read and [rad], shape (c, n).

        Outside the time of its side a row is NaN.

        Args:
            state: The explanation.
            rows: Rows, by index, shape (n,).
        """
        joints = self._joints(state, rows)
        return self._left(tip_pose(self.arm(state)[0], list(joints.q)), state.edits, rows, joints.inside)

    def residuals(self, every: Sequence[Edits], rows: IntArray) -> FloatArray:
        """Return the residual of explanations without numbers in [m] and [rad], shape (len(every), c, n).

        Each is that of `residual`; what edits make of the joints goes through the arm in one go.

        Args:
            every: The edits of each explanation.
            rows: Rows, by index, shape (n,).
        """
        nothing, count = zero(self.groups), len(rows)
        if self.frames_open:  # the frames depend on the edits
            lefts = [self.residual(replace(nothing, edits=edits), rows) for edits in every]
            return np.array(lefts).reshape(-1, len(self.blocks), count)
        joints = self._joints(nothing, rows)
        result = np.empty((len(every), len(self.blocks), count))
        of_robots: dict[Edits, dict[Edits, list[int]]] = {}
        for i, edits in enumerate(every):
            robot = tuple(edit for edit in edits if edit.robot is not None)
            of_joints = tuple(edit for edit in edits if edit.joints)
            of_robots.setdefault(robot, {}).setdefault(of_joints, []).append(i)
        for robot, cases in of_robots.items():
            q = np.concatenate([edited(each, self.sample[rows], joints.q) for each in cases], axis=1)
            pose = tip_pose(self._robot(robot), list(q))
            many = np.tile(rows, len(cases)), np.tile(joints.inside, len(cases))
            plain = self._left(pose, (), *many).reshape(len(self.blocks), -1, count)
            for k, places in enumerate(cases.values()):
                part = slice(k * count, (k + 1) * count)
                for i in places:
                    placing = tuple(edit for edit in every[i] if not edit.joints and edit.robot is None)
                    result[i] = plain[:, k]
                    if placing:
                        turned = self._turned(_rows_of(pose, part), placing)
                        result[i] = self._left(turned, placing, rows, joints.inside)
        return result

    def _turned(self, pose: Transform, edits: Edits) -> Transform:
        """Return poses on a base that edits turn about its own place."""
        matrix = axes_of(edits, "base_rotation")
        if matrix is None:
            return pose
        at = self.chain.base.translation
        turn = Transform(translation=at) @ Transform(matrix) @ Transform(translation=scale(-1.0, at))
        return turn @ pose

    def _joints(self, state: State, rows: IntArray) -> Joints:
        return self.motion.joints(state, self.groups, self.clock, self.sample, rows, self.chain)

    def deviation(self, state: State, rows: IntArray) -> FloatArray:
        """Return what an explanation leaves of what is judged: positions in true [m], shape (3, n)."""
        left = self.residual(state, rows)[:3]
        if self.judged is not None:
            left = left + (self.judged - self.position)[:, rows]
        return unit_of(state.edits) * left

    def _left(self, pose: Transform, edits: Edits, rows: IntArray, inside: BoolArray) -> FloatArray:
        rotation = None if self.rotation is None else self.rotation[:, :, rows]
        return pose_residual(pose, edits, self.position[:, rows], rotation, inside)

    @cached_property
    def reach(self) -> float:
        """The sum of the arm's lengths in [m]."""
        return sum(float(np.linalg.norm(frame.translation)) for frame in self.chain.frames[1:])

    def motions(
        self, state: State, rows: IntArray, groups: Sequence[Group]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what positions leave, and how each number of some groups moves and turns the tool.

        Args:
            state: The explanation.
            rows: Rows, by index, shape (n,).
            groups: Whose numbers.

        Returns:
            The residual in [m], shape (3, n); velocities in [m] and turns in [rad] per unit, (p, 3, n) each.
        """
        left, columns = self._linear(state, rows, groups, 6)
        return left[:3], columns[:, :3], columns[:, 3:]

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
            number, in the order of the groups, shape (p, c, n).
        """
        return self._linear(state, rows, self.groups if groups is None else groups, len(self.blocks))

    def _linear(
        self, state: State, rows: IntArray, taken: Sequence[Group], components: int
    ) -> tuple[FloatArray, FloatArray]:
        joints = self._joints(state, rows)
        wanted = {c for g in taken for c in g.columns}
        chain, located = self.arm(state, wanted)
        q = list(joints.q)
        left = self._left(tip_pose(chain, q), state.edits, rows, joints.inside)
        twists = [(twist, c) for twist, c in located if c in wanted]
        distinct = {id(twist): twist for twist, _ in twists}  # one axis of a frame alone, and of all three
        velocities = dict(zip(distinct, sensitivities(chain, q, [*distinct.values()]), strict=True))
        moved = {c: velocities[id(twist)] for twist, c in twists}
        by_joint = jacobian(chain, q) if any(not group.twists for group in taken) else ()
        columns = np.zeros((len(wanted), components, len(rows)))
        add_columns(
            columns, taken, moved,
            lambda group: [(by_joint[j], by) for j, by in joints.factors(group, self.clock, rows)],
        )  # fmt: skip
        return left, as_read(columns, state.edits)


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


def axes_of(edits: Edits, kind: str) -> Matrix | None:
    """Return how edits of a kind turn or mirror the base [-]; None if none does."""
    return next((edit.matrix for edit in edits if edit.kind == kind), None)


def unit_of(edits: Edits, side: str = "") -> float:
    """Return what positions of a side, as read, are to be multiplied by to be in [m]."""
    factors = (edit.value for edit in edits if edit.kind == "path_unit" and edit.name.startswith(side))
    return next(factors, 1.0)


def edited(edits: Edits, log_rows: IntArray, q: FloatArray) -> FloatArray:
    """Return joints in [rad] or [m], shape (joints, n), with what edits make of them."""
    for edit in edits:
        (q,) = edit.of_joints(log_rows, q)
    return q


def pose_residual(
    pose: Transform,
    edits: Edits,
    position: FloatArray,
    rotation: FloatArray | None,
    inside: BoolArray,
    side: str = "",
) -> FloatArray:
    """Return data - model in [m] as the data were read and [rad], shape (3, n) or (6, n); NaN outside.

    Args:
        pose: The model's, on a base that is not mirrored.
        edits: The edits of the explanation; a mirrored base and the unit of the data count here.
        position: Of the data in [m] as they were read, shape (3, n).
        rotation: Matrices [-], shape (3, 3, n); None without any.
        inside: Which rows lie within the time of the model, shape (n,).
        side: Which side the data are, in names of units; any by default.
    """
    if (mirror := axes_of(edits, "base_mirrored")) is not None:
        axes = Transform(mirror)
        there = axes @ pose
        pose = Transform((there @ Transform(axes.columns)).rotation, there.translation)
    left = np.empty((3 if rotation is None else 6, position.shape[1]))
    factor = unit_of(edits, side)
    for k, value in enumerate(pose.translation):
        left[k] = position[k] - value / factor
    if rotation is not None:
        left[3:] = turn_between(pose, rotation)
    left[:, ~inside] = np.nan
    return left


def as_read(columns: FloatArray, edits: Edits, side: str = "") -> FloatArray:
    """Return a Jacobian in [m] and [rad], shape (p, c, n), in the axes and the unit that data were read in.

    Args:
        columns: Velocities and turns per unit of each number, of a base that is not mirrored; changed.
        edits: The edits of the explanation.
        side: Which side the data are, in names of units; any by default.
    """
    if (mirror := axes_of(edits, "base_mirrored")) is not None:
        moved, turned = columns[:, :3].copy(), columns[:, 3:].copy()
        columns[:, :3] = np.einsum("ij,pjn->pin", mirror, moved)
        if turned.size:
            columns[:, 3:] = -np.einsum("ij,pjn->pin", mirror, turned)  # turns count the other way
    if (factor := unit_of(edits, side)) != 1.0:
        columns[:, :3] /= factor
    return columns


def _key(group: Group) -> tuple[object, ...]:
    return group.kind, group.name, group.axis if group.name in ("base", "tool") else None


def _rows_of(pose: Transform, part: slice) -> Transform:
    """Return some of the rows of poses."""
    elements = (*pose.translation, *(element for row in pose.rotation for element in row))
    x, y, z, *r = (element[part] if isinstance(element, np.ndarray) else element for element in elements)
    return Transform(((r[0], r[1], r[2]), (r[3], r[4], r[5]), (r[6], r[7], r[8])), (x, y, z))


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
