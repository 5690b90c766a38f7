"""The tool centre point that a log recorded, compared with forward kinematics.

- `RecordedPoses`: rows with joint values and a recorded pose; how far the kinematics of an arm are from them.
- `count_initial_outliers`: outliers in the first rows, before the controller applies tool and pose.
- `recorded_tcp_warnings`, `missing_tool_warning`: what would explain the distance: another robot of the
  catalogue, a reversed joint, exchanged joints, another base or tool.
- `infer_robot`: the only robot of the catalogue that fits a log.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray, Vector
from urmpipe_models.errors import Hint
from urmpipe_models.kinematics.forward import poses_over_log, positions_over_log
from urmpipe_models.math3d import (
    Transform,
    fit_rotation,
    from_offset,
    matrix_to_rpy,
    to_matrices,
    to_quaternions,
)
from urmpipe_models.robots.catalogue import kinematically_distinct_names, load_robot, robot_names
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import URMPIPE_SOURCE, Inference, JointLog, LogWarning
from urmpipe_pipeline.runs.reading_errors import Edit, robot_edits, sign_edits, swap_edits
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.sources.units.evidence import (
    CLEARLY,
    CLOSE_WITH_TOOL,
    SAMPLES,
    Fit,
    extent,
    has_both,
    mean_turn,
    single_out,
    spread,
    tool_fit,
    turned_apart,
)
from urmpipe_pipeline.sources.units.kinematic_units import Recorded, fits
from urmpipe_pipeline.sources.vocabulary import key, split_unit

MIN_REPORTED_DISTANCE = 1e-4
"""Options are told to a tenth of a millimetre: where kinematics are nearer than this in [m], none helps."""

MIN_REPORTED_ANGLE = 1e-3
"""The same of an angle in [rad], which moves what is a tool's length away by that."""


@dataclass(frozen=True, slots=True)
class PoseDifference:
    """How far an arm stays from recorded poses.

    Attributes:
        distance: Root mean square distance in [m].
        angle: The same of the angle in [rad]; 0 where no orientation was recorded.
    """

    distance: float
    angle: float

    def clearly_nearer(self, other: PoseDifference) -> bool:
        """Tell whether it is clearly less in place or in angle than another, and clearly more in neither."""
        nearer = CLEARLY * self.distance <= other.distance and other.distance > MIN_REPORTED_DISTANCE
        straighter = CLEARLY * self.angle <= other.angle and other.angle > MIN_REPORTED_ANGLE
        no_further = self.distance <= CLEARLY * max(other.distance, MIN_REPORTED_DISTANCE)
        no_more_turned = self.angle <= CLEARLY * max(other.angle, MIN_REPORTED_ANGLE)
        return (nearer and no_more_turned) or (straighter and no_further)

    def said(self, *, turned: bool) -> str:
        """Return it as people read it, with the angle if that matters."""
        angle = f" and {text.quantity(self.angle, 'rad')}" if turned else ""
        return f"{self.distance * 1e3:.2f} mm{angle}"


@dataclass(frozen=True, slots=True, eq=False)
class RecordedPoses:
    """Rows of a log that have joint values and a recorded tool centre point.

    Attributes:
        q: Joint values in [rad] or [m], shape (n, joints).
        position: Recorded positions in [m], shape (n, 3).
        quat: Recorded orientations as unit quaternions x, y, z, w [-], shape (n, 4); NaN where one is
            missing, None without any.
    """

    q: FloatArray
    position: FloatArray
    quat: FloatArray | None

    @classmethod
    def of(cls, robot: Chain | None, log: JointLog) -> RecordedPoses | None:
        """Return some rows that are spread over a log; None if it has none that an arm can be held against.

        Those at its start that are outliers are left out.
        """
        if robot is None or log.tcp_position is None or log.measured or log.q.shape[1] != len(robot.moving):
            return None
        start, _ = count_initial_outliers(robot, log)
        rows = np.arange(start, log.rows)[spread(log.rows - start)]
        q, position = log.q[rows], log.tcp_position[rows]
        known = has_both(q, position)
        quat = None
        if log.tcp_rotation is not None and log.rotation_form is not None:
            quat = to_quaternions(log.tcp_rotation[rows], log.rotation_form)[known]
        told = quat is not None and bool(np.isfinite(quat).all(axis=1).any())
        return cls(q[known], position[known], quat if told else None) if known.any() else None

    def fit(self, robot: Chain, q: FloatArray | None = None) -> Fit:
        """Return how near an arm comes to the points.

        Args:
            robot: The arm.
            q: Other joint values in [rad] or [m], shape (n, joints).
        """
        return self.fits(robot, [self.q if q is None else q])[0]

    def fits(self, robot: Chain, every: Sequence[FloatArray]) -> list[Fit]:
        """Return the fits of several joint values in [rad] or [m], shape (n, joints) each, all at once."""
        position, rotation = poses_over_log(robot, np.concatenate(every))
        parts = zip(np.split(position, len(every)), np.split(rotation, len(every)), strict=True)
        return [tool_fit(*part, self.position) for part in parts]

    def apart(self, robot: Chain, q: FloatArray | None = None, *, tool: bool) -> PoseDifference:
        """Return how far an arm stays from the poses, perhaps but for the constant tool that fits best.

        Where a log hardly moves, any tool would fit: its points are then held as the arm has them.

        Args:
            robot: The arm.
            q: Other joint values in [rad] or [m], shape (n, joints).
            tool: Whether a tool is allowed for.
        """
        found = self.fit(robot, q)
        distance = found.with_tool if tool and np.isfinite(found.with_tool) else found.distance
        return PoseDifference(distance, self._angle(robot, self.q if q is None else q, tool=tool))

    def tool_turn(self, robot: Chain) -> tuple[float, float, float]:
        """Return rx, ry, rz in [rad] of the tool that fits the orientations best; zeros without them."""
        if self.quat is None:
            return 0.0, 0.0, 0.0
        (turn,) = to_matrices(mean_turn(*self._orientations(robot, self.q))[np.newaxis])
        return matrix_to_rpy(_rows_of(turn))

    def base(self, robot: Chain) -> tuple[float, ...]:
        """Return x, y, z in [m] and rx, ry, rz in [rad] of the base with which the points agree best."""
        computed = positions_over_log(replace(robot, base=Transform()), self.q)
        middle, target = computed.mean(axis=0), self.position.mean(axis=0)
        turn, _ = fit_rotation((self.position - target).T @ (computed - middle))
        return (*(target - turn @ middle).tolist(), *matrix_to_rpy(_rows_of(turn)))

    def _angle(self, robot: Chain, q: FloatArray, *, tool: bool) -> float:
        return 0.0 if self.quat is None else turned_apart(*self._orientations(robot, q), tool=tool)

    def _orientations(self, robot: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return computed and recorded orientations where both are, each of shape (n, 4) [-]."""
        assert self.quat is not None  # asked before
        known = np.isfinite(self.quat).all(axis=1)
        _, rotation = poses_over_log(robot, q[known])
        return to_quaternions(rotation.reshape(-1, 9), "matrix"), self.quat[known]


def _rows_of(matrix: FloatArray) -> tuple[Vector, Vector, Vector]:
    """Return the rows of a rotation matrix as a transform has them."""
    x, y, z = (tuple(row) for row in matrix.tolist())
    return x, y, z


RECORDED_START = "recorded-tcp-start"

LEAST_ROWS = 10
"""A log of fewer rows tells too little of what is usual in it."""


def count_initial_outliers(robot: Chain | None, log: JointLog) -> tuple[int, float]:
    """Return how many rows at the start have the tool centre point elsewhere than the others, and how far.

    Elsewhere is in the frame of the tip, where a tool stays: the offset from the kinematics is there
    `CLEARLY` times further from the usual one than in any row that follows, and further than a calibration
    makes. It is told in [m] as the median of these rows; inf of points of three zeros, which are none
    but in a plan.
    """
    if log.tcp_position is None or log.measured or log.rows < LEAST_ROWS:
        return 0, 0.0
    first = log.tcp_position[0]
    zeros = 0 if first.any() or log.source == URMPIPE_SOURCE else int(np.argmax(log.tcp_position.any(axis=1)))
    if robot is None or log.q.shape[1] != len(robot.moving):
        return zeros, np.inf
    rows, apart = _by_tool(robot, log, zeros)
    return (zeros + rows, apart) if rows else (zeros, np.inf)


def initial_outlier_warning(robot: Chain | None, log: JointLog) -> list[LogWarning]:
    """Return a warning if the first rows recorded the tool centre point elsewhere than the others."""
    rows, apart = count_initial_outliers(robot, log)
    if not rows:
        return []
    first = "the first row" if rows == 1 else f"the first {rows} rows"
    where = "as 0, 0, 0" if np.isinf(apart) else f"{text.quantity(apart, 'm')} from where the others have it"
    said = f"{first} of {log.rows} recorded the TCP {where}: no tool or pose known yet?"
    return [LogWarning(RECORDED_START, f"{said} They are kept and judged with the others", row=1)]


def _by_tool(robot: Chain, log: JointLog, start: int) -> tuple[int, float]:
    """Return how many rows from a first one on have another tool than the others, and by how much in [m]."""
    every = np.arange(start, log.rows)
    rows = np.union1d(every[:SAMPLES], every[spread(len(every))])
    offset = _offsets(robot, log, rows)
    known = np.isfinite(offset).all(axis=1)
    rows, offset = rows[known], offset[known]
    even = np.isin(rows, every[spread(len(every))])
    if np.count_nonzero(even) < LEAST_ROWS:
        return 0, 0.0
    usual = np.median(offset[even], axis=0)
    apart = np.linalg.norm(offset - usual, axis=1)
    least, most = np.minimum.accumulate(apart)[:-1], np.maximum.accumulate(apart[::-1])[::-1][1:]
    splits = np.flatnonzero(least > np.maximum(CLEARLY * most, CLOSE_WITH_TOOL))
    if not len(splits):
        return 0, 0.0
    last = int(splits[-1])
    between = np.arange(rows[last], rows[last + 1])  # rows that were not looked at
    beyond = np.linalg.norm(_offsets(robot, log, between) - usual, axis=1) > CLEARLY * most[last]
    return int(between[beyond][-1]) + 1 - start, float(np.median(apart[: last + 1]))


def _offsets(robot: Chain, log: JointLog, rows: IntArray) -> FloatArray:
    """Return the recorded points in the frame that the kinematics give the tool, shape (n, 3), in [m]."""
    assert log.tcp_position is not None  # asked before
    position, rotation = poses_over_log(robot, log.q[rows])
    return np.asarray(np.einsum("nji,nj->ni", rotation, log.tcp_position[rows] - position))


MISSING_TOOL = "recorded-tcp-tool"
"""The kind of a hint beside a verdict of fail: it says nothing against the log."""

FAR_RECORDED = "recorded-tcp-far"

FAR = 0.03
"""Root mean square distance in [m] that no calibration and no rounding explain."""

TURNED = np.radians(2.0)
"""Angle in [rad] between kinematics and recorded orientation that no calibration explains: a tool has it."""

EXPLAINED = 1.0 / 25.0
"""What explains a motion leaves no more of it: a wrong arm and some tool leave a fifth by chance."""


def distances_from_recorded(run: Run, computed: FloatArray | None = None) -> FloatArray:
    """Return how far the kinematics of a log are from its recorded tool centre point in [m], shape (n,).

    Only rows that have both are counted, without outliers at the start. It is empty if the log recorded no
    tool centre point in the frame of its base, or has no robot.

    Args:
        run: The log.
        computed: Its tool centre point by forward kinematics on its own rows in [m], shape (rows, 3), where
            that is known already.
    """
    if run.robot is None or run.tcp is None or run.log.tcp_position is None or run.log.measured:
        return np.empty(0)
    place = positions_over_log(run.robot, run.on_rows.q) if computed is None else computed
    start, _ = count_initial_outliers(run.robot, run.log)
    distance = np.linalg.norm(place - run.log.tcp_position, axis=1)[start:]
    return np.asarray(distance[np.isfinite(distance)])


class _Other(NamedTuple):
    """What else a log may be of, and how it is given."""

    said: str
    hint: Hint
    robot: Chain
    q: FloatArray
    apart: PoseDifference = PoseDifference(np.inf, np.inf)


def recorded_tcp_warnings(robot: Chain | None, log: JointLog) -> list[LogWarning]:
    """Return warnings if the kinematics of a robot do not come near the recorded tool centre point.

    A constant tool is allowed for, unless the log hardly moves. The robot is held against what else the log
    may be of: another robot of the catalogue, a joint that counts the other way, two joints exchanged,
    another base. What comes clearly nearer is said, however near the robot is; so is a robot that is far off
    where nothing does. The first rows may be outliers: they are told of, and left out.
    """
    warnings = initial_outlier_warning(robot, log)
    poses = RecordedPoses.of(robot, log)
    if robot is None or poses is None:
        return warnings
    own, found = poses.apart(robot, tool=True), poses.fit(robot)
    others = _clearly_nearer(robot, log, poses, own)
    turned = own.angle > MIN_REPORTED_ANGLE and any(CLEARLY * one.apart.angle <= own.angle for one in others)
    said = _stays(robot, poses.apart(robot, tool=False), turned=turned)
    if np.isfinite(found.with_tool):
        said += f" ({own.said(turned=turned)} with the tool that fits best)"
    if others:
        said += f": {', or '.join(f'{one.said} within {one.apart.said(turned=turned)}' for one in others)}"
        warnings.append(LogWarning(FAR_RECORDED, said, hints=tuple(one.hint for one in others)))
    elif np.isfinite(found.with_tool) and min(found.distance, found.with_tool) > FAR:
        said += ": robot, base, units, zeros, signs or order of the joints may differ"
        warnings.append(LogWarning(FAR_RECORDED, said))
    return warnings


def missing_tool_warning(robot: Chain | None, log: JointLog, *, turned: bool = False) -> list[LogWarning]:
    """Return a warning if kinematics and recorded poses lie apart by what a tool or a base explains.

    There is none where something else does: `recorded_tcp_warnings` says so.

    Args:
        robot: The arm.
        log: The log.
        turned: Whether orientations are judged, too.
    """
    poses = RecordedPoses.of(robot, log)
    if robot is None or poses is None:
        return []
    own = _judged(poses.apart(robot, tool=False), turned=turned)
    if own.distance <= MIN_REPORTED_DISTANCE and own.angle <= MIN_REPORTED_ANGLE:
        return []
    if _clearly_nearer(robot, log, poses, poses.apart(robot, tool=True)):
        return []
    said = _stays(robot, own, turned=turned)
    if not np.isfinite(poses.fit(robot).with_tool):
        said = f"{said}, and the log moves too little to show why: {_asked(robot)}"
        return [LogWarning(MISSING_TOOL, said, hints=tuple(_tool_here(robot, poses)) or _SET)]
    hints = tuple(_placing(robot, poses, own, turned=turned))
    return [LogWarning(MISSING_TOOL, said, hints=hints)] if hints else []


_SET = (Hint("tool", None, "sets it"), Hint("base", None, "sets it"))


def _placing(robot: Chain, poses: RecordedPoses, own: PoseDifference, *, turned: bool) -> Iterator[Hint]:
    """Yield the tool and the base with which an arm comes near, each if it does."""
    bare = replace(robot, tool=Transform())
    tool = _frame((*poses.fit(bare).tool, *poses.tool_turn(bare)))
    if poses.apart(bare, tool=False).angle <= CLEARLY * poses.apart(bare, tool=True).angle:
        tool = tool[:3]  # its turn is no more than what a calibration leaves
    base = _frame(poses.base(robot))
    placed = (("tool", tool, replace(robot, tool=from_offset(tool))),
              ("base", base, replace(robot, base=from_offset(base))))  # fmt: skip
    for name, frame, arm in placed:
        left = poses.apart(arm, tool=False)
        if _judged(left, turned=turned).clearly_nearer(own) and left.distance <= CLOSE_WITH_TOOL:
            does = f"brings them within {left.said(turned=turned or (len(frame) > 3 and name == 'tool'))}"
            yield Hint(name, frame, does, robot=_in_catalogue(robot, name))


def _tool_here(robot: Chain, poses: RecordedPoses) -> Iterator[Hint]:
    """Yield the tool with which an arm meets poses that are too few to tell one: a hypothesis."""
    bare = replace(robot, tool=Transform())
    position, rotation = poses_over_log(bare, poses.q)
    shift = np.einsum("nji,nj->ni", rotation, poses.position - position).mean(axis=0)
    turned = poses.apart(bare, tool=False).angle > TURNED
    tool = _frame((*shift.tolist(), *(poses.tool_turn(bare) if turned else ())))
    left = poses.apart(replace(robot, tool=from_offset(tool)), tool=False)
    if left.distance <= CLOSE_WITH_TOOL:
        does = f"brings them within {left.said(turned=turned)} here"
        yield Hint("tool", tool, does, robot=_in_catalogue(robot, "tool"))


def _judged(apart: PoseDifference, *, turned: bool) -> PoseDifference:
    """Return how far poses lie apart in what is judged."""
    return apart if turned else replace(apart, angle=0.0)


def _in_catalogue(robot: Chain, placing: str) -> str:
    """Return the name that gives an arm but for its tool or its base; empty if it is from elsewhere.

    Where the log singled it out, or a recording holds it, it has to be named together with them.
    """
    if robot.name not in robot_names():
        return ""
    bare = load_robot(robot.name)
    same = replace(bare, **{placing: getattr(robot, placing)})
    return robot.name if same == robot else ""


def _stays(robot: Chain, apart: PoseDifference, *, turned: bool) -> str:
    """Say how far an arm stays from what was recorded."""
    angle = f" and {text.quantity(apart.angle, 'rad')}" if turned else ""
    far = f"{apart.distance * 1e3:.1f} mm{angle}"
    return f"the kinematics of {robot.name} stay {far} (rms) from the recorded TCP"


def _asked(robot: Chain) -> str:
    """Return what to look at first: a tool or a base that is not there, or the tool that is."""
    length = float(np.linalg.norm(robot.tool.translation))
    if not length:
        return "perhaps a tool or a base is missing"
    return f"perhaps the tool, {length * 1e3:.1f} mm long, is another, or a base is missing"


def _clearly_nearer(robot: Chain, log: JointLog, poses: RecordedPoses, own: PoseDifference) -> list[_Other]:
    """Return what explains the poses clearly better than a robot does: the best, and what is like it.

    A base comes last: it explains a part of what anything else does.
    """
    if own.distance <= MIN_REPORTED_DISTANCE and own.angle <= MIN_REPORTED_ANGLE:
        return []
    moves = np.isfinite(poses.fit(robot).with_tool)
    most = EXPLAINED * extent(poses.position) if moves else CLOSE_WITH_TOOL
    count = len(log.joints)
    others = [_with(edit, robot, log, poses) for (edit,) in robot_edits(robot)]
    if moves and own.distance > FAR:  # less of it a base explains by chance
        others.append(_other_base(robot, poses))
    edits = (*sign_edits(count, most=1), *swap_edits(count))
    edited = [_with(edit, robot, log, poses) for (edit,) in edits]
    fits = [poses.fit(one.robot) for one in others] + poses.fits(robot, [one.q for one in edited])
    near = [one for one, fit in zip(others + edited, fits, strict=True) if _distance(fit) <= most]
    found = [one._replace(apart=poses.apart(one.robot, one.q, tool=True)) for one in near]
    found = sorted((o for o in found if o.apart.clearly_nearer(own)), key=lambda o: o.apart.distance)
    like_best = [one for one in found if not found[0].apart.clearly_nearer(one.apart)]
    return sorted(like_best, key=lambda one: one.hint.parameter == "base")


def _distance(found: Fit) -> float:
    """Return how far an arm stays in [m] with the tool that fits best, or as it is where that is not told."""
    return found.with_tool if np.isfinite(found.with_tool) else found.distance


def _with(edit: Edit, robot: Chain, log: JointLog, poses: RecordedPoses) -> _Other:
    """Return the robot with other joint values, or another robot on the same base and with the same tool."""
    other = robot if edit.robot is None else edit.robot.placed(robot.base, robot.tool)
    (q,) = edit.of_joints(np.arange(len(poses.q)), poses.q.T)
    return _Other(*_given(edit, log), other, q.T)


def _given(edit: Edit, log: JointLog) -> tuple[str, Hint]:
    """Return what agrees, and how it is given."""
    if edit.kind == "other_robot":
        return f"those of {edit.name} agree", Hint("robot", edit.name, "takes it")
    names = " and ".join(log.joints[j] for j in edit.joints)
    if edit.kind == "joint_sign":
        hint = Hint("log_map", None, f"sets sign = -1 for {names}")
        return f"with {names} reversed in sign they agree", hint
    order, (first, second) = _called(log), edit.joints
    order[first], order[second] = order[second], order[first]
    return f"with {names} exchanged they agree", Hint("joints", order, "exchanges them")


def _other_base(robot: Chain, poses: RecordedPoses) -> _Other:
    """Return the robot where it stands best."""
    frame = _frame(poses.base(robot))
    hint = Hint("base", frame, "puts the arm there", robot=_in_catalogue(robot, "base"))
    return _Other("on another base they agree", hint, replace(robot, base=from_offset(frame)), poses.q)


def _called(log: JointLog) -> list[str]:
    """Return what `joints` calls the joints: their columns' names, or numbers where names do not tell."""
    columns = [column for column in log.columns if column.role == "joint"]
    names = [split_unit(column.header)[0] if column.header else "" for column in columns]
    told = [name if name and "," not in name and names.count(name) == 1 else "" for name in names]
    called = [name or str(column.number) for name, column in zip(told, columns, strict=True)]
    return called or list(log.joints)


def _frame(numbers: Sequence[float]) -> list[float]:
    """Return X,Y,Z[,RX,RY,RZ] with tenths of a millimetre or of a milliradian; no turn if it is none."""
    told = [round(float(value), 4) + 0.0 for value in numbers]  # + 0.0: no -0.0
    return told if any(told[3:]) else told[:3]


def infer_robot(recorded: Recorded) -> tuple[Chain, Inference] | None:
    """Return the only robot of the catalogue that fits a log, and why; None if none or several do.

    A robot's name in the name of every joint column singles it out (as in /ur5e/elbow_joint/position); so
    do its kinematics, if they come out at the recorded tool centre point and those of no other robot do, in
    the units that are told or in others.
    """
    words = _shared_words(recorded.names)
    if not recorded.names or (not recorded.lengths and not words & set(kinematically_distinct_names())):
        return None
    robots = [
        robot
        for robot in map(load_robot, kinematically_distinct_names())
        if len(robot.moving) == len(recorded.names)
    ]
    named = [robot for robot in robots if robot.name in words]
    if len(named) == 1:
        why = "its name in the names of the joint columns"
        return named[0], Inference("robot", named[0].name, why, hints=(Hint("robot"),))
    return _by_kinematics(recorded, named or robots)


def _shared_words(names: Sequence[str]) -> frozenset[str]:
    """Return the words that stand in every name."""
    words = [frozenset(key(name).split("_")) for name in names]
    return frozenset.intersection(*words) if words else frozenset()


def _by_kinematics(recorded: Recorded, robots: Sequence[Chain]) -> tuple[Chain, Inference] | None:
    """Return the robot whose forward kinematics come out at the recorded points."""
    judged = [robot for robot in robots if recorded.judges(robot)]
    found = {
        (robot.name, reading): one
        for robot in judged
        for reading, one in fits(robot, recorded, recorded.usual).items()
    }
    told = {(robot.name, reading) for robot in judged for reading in recorded.told}
    best = single_out(found, told) if found else None
    if best is None:
        return None
    (name, reading), needs_tool = best
    nearest = {
        robot.name: min(
            (found[robot.name, one] for one in recorded.usual), key=lambda one: one.of(tool=needs_tool)
        )
        for robot in judged
    }
    said = _said(name, nearest | {name: found[name, reading]}, needs_tool)
    return next(robot for robot in robots if robot.name == name), said


def _said(name: str, near: Mapping[str, Fit], needs_tool: bool) -> Inference:
    """Say by how much a robot beats the next one."""
    distance = {robot: one.of(tool=needs_tool) for robot, one in near.items()}
    others = {robot: value for robot, value in distance.items() if robot != name}
    said = f"its kinematics come within {distance[name] * 1e3:.2f} mm (rms) of the recorded TCP"
    hints = [Hint("robot")]
    if needs_tool:
        x, y, z = tool = [round(value, 4) + 0.0 for value in near[name].tool]  # + 0.0: no -0.0
        said += f" with the tool {x:.4f},{y:.4f},{z:.4f}, which is not applied"
        hints.append(Hint("tool", tool, "applies it", robot=name))
    if others:
        second = min(others, key=others.__getitem__)
        said += f", those of {second} within {others[second] * 1e3:.2f} mm"
    return Inference("robot", name, said, hints=tuple(hints))
