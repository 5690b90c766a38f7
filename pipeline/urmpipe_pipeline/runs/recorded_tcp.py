"""The tool centre point that a log recorded, compared with forward kinematics.

- `count_initial_outliers`: first rows recorded before the controller applies tool and pose.
- `RecordedPoses`: rows with joint values and a recorded pose; their distance from the kinematics of an arm.
- `recorded_tcp_warnings`: kinematics that are far from the recorded points, with what explains the distance:
  another robot of the catalogue, a reversed joint, exchanged joints, another base.
- `missing_tool_warning`: a distance that a tool or a base explains.
- `infer_robot`: the only robot of the catalogue that fits a log.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray, Vector
from urmpipe_models.errors import Hint
from urmpipe_models.kinematics.forward import poses_over_log, positions_over_log
from urmpipe_models.math3d import (
    Transform,
    conjugate,
    fit_rotation,
    from_offset,
    matrix_to_rpy,
    quaternion_product,
    rotation_angle,
    to_matrices,
    to_quaternions,
)
from urmpipe_models.robots.catalogue import kinematically_distinct_names, load_robot, robot_names
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import URMPIPE_SOURCE, Inference, JointLog, LogWarning
from urmpipe_pipeline.logs.proofs import (
    MARGIN,
    SAMPLES,
    Fit,
    Recorded,
    find_best_fit,
    fit_readings,
    has_both,
    mean_turn,
    spread,
)
from urmpipe_pipeline.logs.vocabulary import key, split_unit
from urmpipe_pipeline.runs.reading_errors import Edit, robot_edits, sign_edits, swap_edits
from urmpipe_pipeline.runs.run import Run

RECORDED_START = "recorded-tcp-start"
FAR_RECORDED = "recorded-tcp-far"
MISSING_TOOL = "recorded-tcp-tool"  # kind of a hint at a failed verdict: it is not about the log

MIN_REPORTED_DISTANCE = 1e-4  # m, the resolution of hints: no option helps where kinematics are nearer
MIN_REPORTED_ANGLE = 1e-3  # rad, the same: it moves a point at a tool's length by that
MAX_CALIBRATION_DISTANCE = 0.03  # m rms; no calibration and no rounding explains more
MAX_CALIBRATION_ANGLE = np.radians(2.0)  # rad; a larger one is the rotation of a tool
MAX_UNEXPLAINED = 1.0 / 25.0  # share of a motion; a wrong arm and some tool leave a fifth by chance
MAX_TOOL_DISTANCE = 0.006  # m rms, from which points disagree with any tool: three numbers explain much
MIN_EXTENT = 0.02  # m rms of the recorded points; a smaller motion determines no tool
MIN_TOOL_ROWS = 5  # of a fit of three numbers
MIN_ROWS = 10  # of a log whose rows have a usual tool

_SET_FRAME = (Hint("tool", None, "sets it"), Hint("base", None, "sets it"))


class ToolFit(NamedTuple):
    """Distance of the kinematics from recorded points.

    Attributes:
        distance: Root mean square distance in [m], the tool as the robot has it.
        with_tool: The same with the tool offset that fits best; inf where the points do not determine it.
        tool: That offset in the frame of the tip in [m].
    """

    distance: float
    with_tool: float
    tool: tuple[float, float, float]


def extent(points: FloatArray) -> float:
    """Return the root mean square distance of points, shape (n, 3) in any unit, from their mean."""
    return _rms(points - points.mean(axis=0))


def _rms(vectors: FloatArray) -> float:
    return float(np.sqrt((vectors**2).sum(axis=1).mean()))


def fit_tool(position: FloatArray, rotation: FloatArray, recorded: FloatArray) -> ToolFit:
    """Return how near poses come to recorded points, p_recorded = p + R d, and the tool offset d.

    Args:
        position: Computed positions in [m], shape (n, 3).
        rotation: Computed orientations [-], shape (n, 3, 3).
        recorded: Recorded positions in [m], shape (n, 3).
    """
    residual = recorded - position
    distance = _rms(residual)
    if len(recorded) < MIN_TOOL_ROWS or extent(recorded) < MIN_EXTENT:
        return ToolFit(distance, np.inf, (0.0, 0.0, 0.0))
    tool = np.einsum("nji,nj->ni", rotation, residual).mean(axis=0)  # least squares: R^T R = I
    return ToolFit(distance, _rms(residual - rotation @ tool), _to_vector(tool))


def _turned_apart(computed: FloatArray, recorded: FloatArray, *, tool: bool) -> float:
    """Return the rms angle between orientations in [rad], with a tool after its constant turn that fits best.

    Computed and recorded orientations are unit quaternions x, y, z, w [-], shape (n, 4).
    """
    if not tool:
        return float(np.sqrt(np.mean(rotation_angle(computed, recorded) ** 2)))
    relative = quaternion_product(conjugate(computed), recorded)
    mean = np.broadcast_to(mean_turn(computed, recorded), relative.shape)
    return float(np.sqrt(np.mean(rotation_angle(mean, relative) ** 2)))


def count_initial_outliers(robot: Chain | None, log: JointLog) -> tuple[int, float]:
    """Return the number of first rows with another tool than the others, and its distance from it in [m].

    The recorded point is compared in the frame of the tip, where a tool does not move: in the outliers it is
    `MARGIN` times farther from the usual place than in any later row, and farther than a calibration
    explains. The distance is the median over these rows; inf for points 0, 0, 0, which are no poses except
    in a plan.
    """
    if log.tcp_position is None or log.externally_measured or log.rows < MIN_ROWS:
        return 0, 0.0
    is_zero = not log.tcp_position[0].any() and log.source != URMPIPE_SOURCE
    zeros = int(np.argmax(log.tcp_position.any(axis=1))) if is_zero else 0
    if robot is None or log.q.shape[1] != len(robot.moving):
        return zeros, np.inf
    rows, distance = _count_other_tool(robot, log, zeros)
    return (zeros + rows, distance) if rows else (zeros, np.inf)


def _count_other_tool(robot: Chain, log: JointLog, start: int) -> tuple[int, float]:
    """Return the number of rows from a start row with another tool, and its distance in [m]."""
    rows = np.arange(start, log.rows)
    even = rows[spread(len(rows))]
    looked_at = np.union1d(rows[:SAMPLES], even)
    offset = _tip_offsets(robot, log, looked_at)
    known = np.isfinite(offset).all(axis=1)
    looked_at, offset = looked_at[known], offset[known]
    is_even = np.isin(looked_at, even)
    if np.count_nonzero(is_even) < MIN_ROWS:
        return 0, 0.0
    usual = np.median(offset[is_even], axis=0)
    distance = np.linalg.norm(offset - usual, axis=1)
    least = np.minimum.accumulate(distance)[:-1]
    most = np.maximum.accumulate(distance[::-1])[::-1][1:]
    splits = np.flatnonzero(least > np.maximum(MARGIN * most, MAX_TOOL_DISTANCE))
    if not len(splits):
        return 0, 0.0
    last = int(splits[-1])
    between = np.arange(looked_at[last], looked_at[last + 1])
    is_outlier = np.linalg.norm(_tip_offsets(robot, log, between) - usual, axis=1) > MARGIN * most[last]
    return int(between[is_outlier][-1]) + 1 - start, float(np.median(distance[: last + 1]))


def _tip_offsets(robot: Chain, log: JointLog, rows: IntArray) -> FloatArray:
    """Return the recorded points in the frame of the tool by the kinematics in [m], shape (n, 3)."""
    assert log.tcp_position is not None  # the caller has checked
    position, rotation = poses_over_log(robot, log.q[rows])
    return np.asarray(np.einsum("nji,nj->ni", rotation, log.tcp_position[rows] - position))


def _initial_outlier_warning(robot: Chain | None, log: JointLog) -> list[LogWarning]:
    rows, distance = count_initial_outliers(robot, log)
    if not rows:
        return []
    first = "the first row" if rows == 1 else f"the first {rows} rows"
    place = "as 0, 0, 0"
    if not np.isinf(distance):
        place = f"{text.format_quantity(distance, 'm')} from where the others have it"
    message = (
        f"{first} of {log.rows} recorded the TCP {place}: the controller may not have known tool or pose"
    )
    return [LogWarning(RECORDED_START, f"{message} yet. They are kept and judged with the others", row=1)]


class PoseDifference(NamedTuple):
    """Distance of an arm from recorded poses.

    Attributes:
        distance: Root mean square distance in [m].
        angle: Root mean square angle in [rad]; 0 without a recorded orientation.
    """

    distance: float
    angle: float

    def is_clearly_smaller(self, other: PoseDifference) -> bool:
        """Return whether distance or angle is clearly smaller, and neither is clearly larger."""
        is_nearer = MARGIN * self.distance <= other.distance and other.distance > MIN_REPORTED_DISTANCE
        is_turned_less = MARGIN * self.angle <= other.angle and other.angle > MIN_REPORTED_ANGLE
        is_not_farther = self.distance <= MARGIN * max(other.distance, MIN_REPORTED_DISTANCE)
        is_not_turned_more = self.angle <= MARGIN * max(other.angle, MIN_REPORTED_ANGLE)
        return (is_nearer and is_not_turned_more) or (is_turned_less and is_not_farther)

    @property
    def is_reported(self) -> bool:
        """Whether an option with the resolution of hints can make it smaller."""
        return not (self.distance <= MIN_REPORTED_DISTANCE and self.angle <= MIN_REPORTED_ANGLE)

    def format(self, digits: int = 2, *, turned: bool) -> str:
        """Return distance, and angle if orientations matter, as text."""
        angle = f" and {text.format_quantity(self.angle, 'rad')}" if turned else ""
        return f"{self.distance * 1e3:.{digits}f} mm{angle}"


class RecordedPoses(NamedTuple):
    """Rows of a log with joint values and a recorded tool centre point.

    Attributes:
        q: Joint values in [rad] or [m], shape (n, joints).
        position: Recorded positions in [m], shape (n, 3).
        quat: Recorded orientations as unit quaternions x, y, z, w [-], shape (n, 4), NaN where one is
            missing; None without any.
    """

    q: FloatArray
    position: FloatArray
    quat: FloatArray | None

    @classmethod
    def of(cls, robot: Chain | None, log: JointLog) -> RecordedPoses | None:
        """Return rows spread over a log, without initial outliers; None if there are none to compare."""
        if (
            robot is None
            or log.tcp_position is None
            or log.externally_measured
            or log.q.shape[1] != len(robot.moving)
        ):
            return None
        start, _ = count_initial_outliers(robot, log)
        rows = np.arange(start, log.rows)[spread(log.rows - start)]
        q, position = log.q[rows], log.tcp_position[rows]
        known = has_both(q, position)
        if not known.any():
            return None
        quat = None
        if log.tcp_rotation is not None and log.rotation_form is not None:
            quat = to_quaternions(log.tcp_rotation[rows], log.rotation_form)[known]
        has_rotation = quat is not None and np.isfinite(quat).all(axis=1).any()
        return cls(q[known], position[known], quat if has_rotation else None)

    def fit(self, robot: Chain, q: FloatArray | None = None) -> ToolFit:
        """Return the distance of an arm from the points.

        Args:
            robot: The arm.
            q: Other joint values in [rad] or [m], shape (n, joints).
        """
        return self.fit_each(robot, [self.q if q is None else q])[0]

    def fit_each(self, robot: Chain, joint_values: Sequence[FloatArray]) -> list[ToolFit]:
        """Return the distances of several joint values in [rad] or [m], shape (n, joints) each."""
        position, rotation = poses_over_log(robot, np.concatenate(joint_values))
        count = len(joint_values)
        parts = zip(np.split(position, count), np.split(rotation, count), strict=True)
        return [fit_tool(*part, self.position) for part in parts]

    def difference(self, robot: Chain, q: FloatArray | None = None, *, any_tool: bool) -> PoseDifference:
        """Return the distance of an arm from the poses.

        Args:
            robot: The arm.
            q: Other joint values in [rad] or [m], shape (n, joints).
            any_tool: Whether to use the constant tool that fits best; not for a log that moves too little to
                determine one.
        """
        fit = self.fit(robot, q)
        distance = _fit_distance(fit) if any_tool else fit.distance
        angle = 0.0
        if self.quat is not None:
            angle = _turned_apart(*self._orientations(robot, self.q if q is None else q), tool=any_tool)
        return PoseDifference(distance, angle)

    def tool_rotation(self, robot: Chain) -> tuple[float, float, float]:
        """Return rx, ry, rz in [rad] of the tool that fits the orientations best; zeros without them."""
        if self.quat is None:
            return 0.0, 0.0, 0.0
        (rotation,) = to_matrices(mean_turn(*self._orientations(robot, self.q))[np.newaxis])
        return matrix_to_rpy(_to_rows(rotation))

    def base(self, robot: Chain) -> list[float]:
        """Return x, y, z in [m] and rx, ry, rz in [rad] of the base that fits the points best, rounded."""
        computed = positions_over_log(replace(robot, base=Transform()), self.q)
        middle, target = computed.mean(axis=0), self.position.mean(axis=0)
        rotation, _ = fit_rotation((self.position - target).T @ (computed - middle))
        return _round_frame((*(target - rotation @ middle).tolist(), *matrix_to_rpy(_to_rows(rotation))))

    def _orientations(self, robot: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return computed and recorded orientations of the rows with both, each of shape (n, 4) [-]."""
        assert self.quat is not None  # the caller has checked
        known = np.isfinite(self.quat).all(axis=1)
        _, rotation = poses_over_log(robot, q[known])
        return to_quaternions(rotation.reshape(-1, 9), "matrix"), self.quat[known]


def _to_vector(values: FloatArray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def _to_rows(matrix: FloatArray) -> tuple[Vector, Vector, Vector]:
    x, y, z = (tuple(row) for row in matrix.tolist())
    return x, y, z


def _fit_distance(fit: ToolFit) -> float:
    """Return the distance in [m] with the tool that fits best, or without one that is not determined."""
    return fit.with_tool if np.isfinite(fit.with_tool) else fit.distance


def _round_frame(numbers: Sequence[float]) -> list[float]:
    """Return X,Y,Z[,RX,RY,RZ] in tenths of a millimetre or of a milliradian; no rotation if it is zero."""
    rounded = [round(float(value), 4) + 0.0 for value in numbers]  # + 0.0: no -0.0
    return rounded if any(rounded[3:]) else rounded[:3]


def distances_from_recorded(run: Run, computed: FloatArray | None = None) -> FloatArray:
    """Return the distances of the kinematics of a log from its recorded tool centre point in [m], shape (n,).

    Only rows with both are used, without initial outliers. Empty if the log has no robot or no tool centre
    point in the frame of its base.

    Args:
        run: The log.
        computed: Its tool centre point by forward kinematics on the rows of the file in [m], shape (rows, 3),
            if it is known already.
    """
    if run.robot is None or run.tcp is None or run.log.tcp_position is None or run.log.externally_measured:
        return np.empty(0)
    position = positions_over_log(run.robot, run.on_rows.q) if computed is None else computed
    start, _ = count_initial_outliers(run.robot, run.log)
    distance = np.linalg.norm(position - run.log.tcp_position, axis=1)[start:]
    return np.asarray(distance[np.isfinite(distance)])


class _Alternative(NamedTuple):
    """Another reading of a log, or another arm: text, hint, arm, joint values and distance."""

    text: str
    hint: Hint
    robot: Chain
    q: FloatArray
    difference: PoseDifference = PoseDifference(np.inf, np.inf)


def recorded_tcp_warnings(robot: Chain | None, log: JointLog) -> list[LogWarning]:
    """Return warnings about a robot whose kinematics are far from the recorded tool centre point.

    A constant tool is allowed, unless the log moves too little to determine it. The robot is compared with
    other robots of the catalogue, a reversed joint, two exchanged joints and another base. What is clearly
    nearer is reported, however near the robot is; a robot that is far is reported also if nothing is nearer.
    Initial outliers are reported and left out.
    """
    warnings = _initial_outlier_warning(robot, log)
    poses = RecordedPoses.of(robot, log)
    if robot is None or poses is None:
        return warnings
    difference, fit = poses.difference(robot, any_tool=True), poses.fit(robot)
    nearer = _find_clearly_nearer(robot, log, poses, difference)
    turned = difference.angle > MIN_REPORTED_ANGLE and any(
        MARGIN * other.difference.angle <= difference.angle for other in nearer
    )
    message = _format_distance(robot, poses.difference(robot, any_tool=False), turned=turned)
    has_tool = np.isfinite(fit.with_tool)
    if has_tool:
        message += f" ({difference.format(turned=turned)} with the tool that fits best)"
    if nearer:
        texts = [f"{other.text} within {other.difference.format(turned=turned)}" for other in nearer]
        message += f": {', or '.join(texts)}"
        warnings.append(LogWarning(FAR_RECORDED, message, hints=tuple(other.hint for other in nearer)))
    elif has_tool and min(fit.distance, fit.with_tool) > MAX_CALIBRATION_DISTANCE:
        message += ": robot, base, units, zeros, signs or order of the joints may differ"
        warnings.append(LogWarning(FAR_RECORDED, message))
    return warnings


def missing_tool_warning(robot: Chain | None, log: JointLog, *, turned: bool = False) -> list[LogWarning]:
    """Return a warning if a tool or a base explains the distance of kinematics and recorded poses.

    There is none if another cause explains it: see `recorded_tcp_warnings`.

    Args:
        robot: The arm.
        log: The log.
        turned: Whether orientations are compared, too.
    """
    poses = RecordedPoses.of(robot, log)
    if robot is None or poses is None:
        return []
    difference = _compared(poses.difference(robot, any_tool=False), turned=turned)
    if not difference.is_reported:
        return []
    if _find_clearly_nearer(robot, log, poses, poses.difference(robot, any_tool=True)):
        return []
    message = _format_distance(robot, difference, turned=turned)
    if not np.isfinite(poses.fit(robot).with_tool):
        length = float(np.linalg.norm(robot.tool.translation))
        tool = (
            f"the tool, {length * 1e3:.1f} mm long, is another, or a base" if length else "a tool or a base"
        )
        message += f", and the log moves too little to show why: perhaps {tool} is missing"
        return [LogWarning(MISSING_TOOL, message, hints=tuple(_still_tool_hints(robot, poses)) or _SET_FRAME)]
    hints = tuple(_frame_hints(robot, poses, difference, turned=turned))
    return [LogWarning(MISSING_TOOL, message, hints=hints)] if hints else []


def _frame_hints(
    robot: Chain, poses: RecordedPoses, difference: PoseDifference, *, turned: bool
) -> Iterator[Hint]:
    """Yield the tool and the base that fit best, each if it explains the distance."""
    bare = replace(robot, tool=Transform())
    tool = _round_frame((*poses.fit(bare).tool, *poses.tool_rotation(bare)))
    without_tool, with_tool = (poses.difference(bare, any_tool=fitted).angle for fitted in (False, True))
    if without_tool <= MARGIN * with_tool:
        tool = tool[:3]  # its rotation is not more than the residual of a calibration
    base = poses.base(robot)
    for name, frame, arm in (
        ("tool", tool, replace(robot, tool=from_offset(tool))),
        ("base", base, replace(robot, base=from_offset(base))),
    ):
        rest = poses.difference(arm, any_tool=False)
        is_better = _compared(rest, turned=turned).is_clearly_smaller(difference)
        if is_better and rest.distance <= MAX_TOOL_DISTANCE:
            does = f"brings them within {rest.format(turned=turned or (len(frame) > 3 and name == 'tool'))}"
            yield Hint(name, frame, does, robot=_catalogue_name(robot, name))


def _still_tool_hints(robot: Chain, poses: RecordedPoses) -> Iterator[Hint]:
    """Yield the tool of poses that are too few to determine one: a hypothesis."""
    bare = replace(robot, tool=Transform())
    position, rotation = poses_over_log(bare, poses.q)
    shift = np.einsum("nji,nj->ni", rotation, poses.position - position).mean(axis=0)
    turned = poses.difference(bare, any_tool=False).angle > MAX_CALIBRATION_ANGLE
    tool = _round_frame((*shift.tolist(), *(poses.tool_rotation(bare) if turned else ())))
    rest = poses.difference(replace(robot, tool=from_offset(tool)), any_tool=False)
    if rest.distance <= MAX_TOOL_DISTANCE:
        does = f"brings them within {rest.format(turned=turned)} here"
        yield Hint("tool", tool, does, robot=_catalogue_name(robot, "tool"))


def _compared(difference: PoseDifference, *, turned: bool) -> PoseDifference:
    """Return a difference without its angle unless orientations are compared."""
    return difference if turned else difference._replace(angle=0.0)


def _catalogue_name(robot: Chain, frame: str) -> str:
    """Return the name of a robot of the catalogue that equals an arm except for its tool or base, or "".

    A robot from the log or a recording has to be named together with them.
    """
    if robot.name not in robot_names():
        return ""
    same = replace(load_robot(robot.name), **{frame: getattr(robot, frame)})
    return robot.name if same == robot else ""


def _format_distance(robot: Chain, difference: PoseDifference, *, turned: bool) -> str:
    distance = difference.format(1, turned=turned)
    return f"the kinematics of {robot.name} stay {distance} (rms) from the recorded TCP"


def _find_clearly_nearer(
    robot: Chain, log: JointLog, poses: RecordedPoses, difference: PoseDifference
) -> list[_Alternative]:
    """Return the alternatives that are clearly nearer than a robot: the best, and those like it.

    A base is last: it explains a part of what any other alternative does.
    """
    if not difference.is_reported:
        return []
    has_motion = np.isfinite(poses.fit(robot).with_tool)
    max_distance = MAX_UNEXPLAINED * extent(poses.position) if has_motion else MAX_TOOL_DISTANCE
    arms = [_with_error(error, robot, log, poses) for (error,) in robot_edits(robot)]
    if has_motion and difference.distance > MAX_CALIBRATION_DISTANCE:  # a base explains less by chance
        base = poses.base(robot)
        hint = Hint("base", base, "sets it", robot=_catalogue_name(robot, "base"))
        moved = replace(robot, base=from_offset(base))
        arms.append(_Alternative("on another base they agree", hint, moved, poses.q))
    count = len(log.joints)
    errors = (*sign_edits(count, most=1), *swap_edits(count))
    readings = [_with_error(error, robot, log, poses) for (error,) in errors]
    fits = [poses.fit(arm.robot) for arm in arms]
    fits += poses.fit_each(robot, [reading.q for reading in readings])
    near = (
        other._replace(difference=poses.difference(other.robot, other.q, any_tool=True))
        for other, fit in zip(arms + readings, fits, strict=True)
        if _fit_distance(fit) <= max_distance
    )
    nearer = sorted(
        (other for other in near if other.difference.is_clearly_smaller(difference)),
        key=lambda other: other.difference.distance,
    )
    best = [other for other in nearer if not nearer[0].difference.is_clearly_smaller(other.difference)]
    return sorted(best, key=lambda other: other.hint.parameter == "base")


def _with_error(error: Edit, robot: Chain, log: JointLog, poses: RecordedPoses) -> _Alternative:
    """Return the log without a reading error: other joint values, or another robot on the same base."""
    arm = robot if error.robot is None else error.robot.placed(robot.base, robot.tool)
    (q,) = error.of_joints(np.arange(len(poses.q)), poses.q.T)
    if error.kind == "other_robot":
        hint = Hint("robot", error.name, "selects it")
        return _Alternative(f"the kinematics of {error.name} agree", hint, arm, q.T)
    names = " and ".join(log.joints[j] for j in error.joints)
    if error.kind == "joint_sign":
        hint = Hint("signs", None, f"sets -1 for {names}")
        return _Alternative(f"with {names} reversed in sign they agree", hint, arm, q.T)
    order, (first, second) = _joint_option(log), error.joints
    order[first], order[second] = order[second], order[first]
    hint = Hint("joints", order, "exchanges them")
    return _Alternative(f"with {names} exchanged they agree", hint, arm, q.T)


def _joint_option(log: JointLog) -> list[str]:
    """Return the value of option `joints`: names of the columns, or numbers where names are not unique."""
    columns = [column for column in log.columns if column.role == "joint"]
    names = [split_unit(column.header)[0] if column.header else "" for column in columns]
    option = [
        name if name and "," not in name and names.count(name) == 1 else str(column.number)
        for name, column in zip(names, columns, strict=True)
    ]
    return option or list(log.joints)


def infer_robot(recorded: Recorded) -> tuple[Chain, Inference] | None:
    """Return the only robot of the catalogue that fits a log, with the evidence; None if none or several do.

    The evidence is the name of the robot in the name of every joint column (as in
    /ur5e/elbow_joint/position), or kinematics that meet the recorded tool centre point, in the stated or in
    other units, while those of no other robot do.
    """
    names = [frozenset(key(name).split("_")) for name in recorded.names]
    common = frozenset.intersection(*names) if names else frozenset()
    catalogue = kinematically_distinct_names()
    if not names or (not recorded.lengths and not common & set(catalogue)):
        return None
    robots = [robot for robot in map(load_robot, catalogue) if len(robot.moving) == len(names)]
    named = [robot for robot in robots if robot.name in common]
    if len(named) == 1:
        evidence = "its name in the names of the joint columns"
        return named[0], Inference("robot", named[0].name, evidence, hints=(Hint("robot"),), basis="named")
    return _infer_by_kinematics(recorded, named or robots)


def _infer_by_kinematics(recorded: Recorded, robots: Sequence[Chain]) -> tuple[Chain, Inference] | None:
    by_reading = {
        (robot.name, reading): fit
        for robot in robots
        if recorded.judges(robot)
        for reading, fit in fit_readings(robot, recorded, recorded.usual, max_freedom=1).items()
    }
    stated = {key for key in by_reading if key[1] in recorded.stated}
    best = (
        find_best_fit(by_reading, stated, max_freedom=1) if by_reading else None
    )  # a base explains the wrong robot
    if best is None:
        return None
    (name, reading), freedom = best
    points = recorded.rows[1] * [unit.factor for unit in reading[1]]
    if freedom and extent(points) < MIN_EXTENT:
        return None
    nearest: dict[str, Fit] = {}
    for (robot_name, _), fit in by_reading.items():
        if robot_name not in nearest or fit.shares[freedom] < nearest[robot_name].shares[freedom]:
            nearest[robot_name] = fit
    nearest[name] = by_reading[name, reading]
    inference = _robot_inference(name, nearest, freedom)
    return next(robot for robot in robots if robot.name == name), inference


def _robot_inference(name: str, nearest: Mapping[str, Fit], freedom: int) -> Inference:
    """Return the inference of a robot, with its distance and that of the next one."""
    distances = {robot: f"{fit.distances[freedom] * 1e3:.2f} mm" for robot, fit in nearest.items()}
    evidence = f"its kinematics come within {distances.pop(name)} (median) of the recorded TCP"
    hints = [Hint("robot")]
    if freedom:
        x, y, z = tool = [round(value, 4) + 0.0 for value in nearest[name].tool]  # + 0.0: no -0.0
        evidence += f" with the tool {x:.4f},{y:.4f},{z:.4f}, which is not applied"
        hints.append(Hint("tool", tool, "applies it", robot=name))
    if distances:
        second = min(distances, key=lambda robot: float(nearest[robot].shares[freedom]))
        evidence += f", those of {second} within {distances[second]}"
    return Inference("robot", name, evidence, hints=tuple(hints))
