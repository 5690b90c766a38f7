"""Forward kinematics against the tool centre point that the log recorded: where they do not meet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Hint
from urmpipe_models.kinematics.forward import poses_over_log, positions_over_log
from urmpipe_models.math3d import Transform, from_offset
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import JointLog, LogWarning
from urmpipe_pipeline.log_edits import Edit, robot_edits, sign_edits, swap_edits
from urmpipe_pipeline.runs.recorded_poses import FINEST, FINEST_TURN, Apart, RecordedPoses
from urmpipe_pipeline.runs.recorded_start import outlying_start, start_warning
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.sources.units.evidence import CLEARLY, CLOSE_WITH_TOOL, Fit, extent
from urmpipe_pipeline.sources.vocabulary import split_unit

LACKING_TOOL = "recorded-tcp-tool"
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
    start, _ = outlying_start(run.robot, run.log)
    distance = np.linalg.norm(place - run.log.tcp_position, axis=1)[start:]
    return np.asarray(distance[np.isfinite(distance)])


class _Other(NamedTuple):
    """What else a log may be of, and how it is given."""

    said: str
    hint: Hint
    robot: Chain
    q: FloatArray
    apart: Apart = Apart(np.inf, np.inf)


def far_from_recorded(robot: Chain | None, log: JointLog) -> list[LogWarning]:
    """Return warnings if the kinematics of a robot do not come near the recorded tool centre point.

    A constant tool is allowed for, unless the log hardly moves. The robot is held against what else the log
    may be of: another robot of the catalogue, a joint that counts the other way, two joints exchanged,
    another base. What comes clearly nearer is said, however near the robot is; so is a robot that is far off
    where nothing does. The first rows may be outliers: they are told of, and left out.
    """
    warnings = start_warning(robot, log)
    poses = RecordedPoses.of(robot, log)
    if robot is None or poses is None:
        return warnings
    own, found = poses.apart(robot, tool=True), poses.fit(robot)
    others = _clearly_nearer(robot, log, poses, own)
    turned = own.angle > FINEST_TURN and any(CLEARLY * one.apart.angle <= own.angle for one in others)
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


def lacking_tool(robot: Chain | None, log: JointLog, *, turned: bool = False) -> list[LogWarning]:
    """Return a warning if kinematics and recorded poses lie apart by what a tool or a base explains.

    There is none where something else does: `far_from_recorded` says so.

    Args:
        robot: The arm.
        log: The log.
        turned: Whether orientations are judged, too.
    """
    poses = RecordedPoses.of(robot, log)
    if robot is None or poses is None:
        return []
    own = _judged(poses.apart(robot, tool=False), turned=turned)
    if own.distance <= FINEST and own.angle <= FINEST_TURN:
        return []
    if _clearly_nearer(robot, log, poses, poses.apart(robot, tool=True)):
        return []
    said = _stays(robot, own, turned=turned)
    if not np.isfinite(poses.fit(robot).with_tool):
        said = f"{said}, and the log moves too little to show why: {_asked(robot)}"
        return [LogWarning(LACKING_TOOL, said, hints=tuple(_tool_here(robot, poses)) or _SET)]
    hints = tuple(_placing(robot, poses, own, turned=turned))
    return [LogWarning(LACKING_TOOL, said, hints=hints)] if hints else []


_SET = (Hint("tool", None, "sets it"), Hint("base", None, "sets it"))


def _placing(robot: Chain, poses: RecordedPoses, own: Apart, *, turned: bool) -> Iterator[Hint]:
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


def _judged(apart: Apart, *, turned: bool) -> Apart:
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


def _stays(robot: Chain, apart: Apart, *, turned: bool) -> str:
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


def _clearly_nearer(robot: Chain, log: JointLog, poses: RecordedPoses, own: Apart) -> list[_Other]:
    """Return what explains the poses clearly better than a robot does: the best, and what is like it.

    A base comes last: it explains a part of what anything else does.
    """
    if own.distance <= FINEST and own.angle <= FINEST_TURN:
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
