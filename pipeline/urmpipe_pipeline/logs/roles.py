"""Columns of numbers that are named as columns in use, and are not used.

Columns that look like a recorded tool centre point and were not read as one.

What each column is: joints and their order, recorded rates, recorded tool centre point.

The columns of what urmpipe writes: joint logs of inverse kinematics, plans, and exports of runs.

Tables with a row a joint, in long form: which names stand in a column beside the values.

The signals of a simulation as urmpipe exports them: which columns are joints, by block and variable.
"""

from __future__ import annotations

import os.path
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, Hint, LogError, python_command
from urmpipe_models.math3d import COLUMN_NAMES, FORMS, RotationForm, column_count
from urmpipe_pipeline.joint_log import PASSED_OVER, ROLES, Inference, LogWarning
from urmpipe_pipeline.logs.columns import (
    NAME_JOINTS,
    OTHER_ROBOT,
    REST,
    TIMES_OF_ANOTHER,
    UNKNOWN,
    Column,
    Kind,
    by_arm,
    chosen_columns,
    listed,
    take,
    which_joints,
)
from urmpipe_pipeline.logs.formats.cells import grouped_number
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.own import GIVEN as GIVEN_KEY
from urmpipe_pipeline.logs.formats.own import RECORDED, form_of, roles_of, stated_joints
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.names import (
    NamedJoints,
    called_as_joints,
    cure,
    family_of,
    find_families,
    find_joints,
    named_after,
    numbered_alike,
    prefer_measured,
    proved_by_rates,
    same_quantities,
    some_named,
)
from urmpipe_pipeline.logs.pose_columns import (
    OF_POSITION,
    Pose,
    chosen_pose,
    find_pose,
    odd_rows,
    turns_as_quaternion,
    with_form,
)
from urmpipe_pipeline.logs.rates import MOST_JOINTS
from urmpipe_pipeline.logs.vocabulary import vocabulary
from urmpipe_pipeline.outputs import MOTION_ROW, PATH_ROW, TARGET_ROW

COLUMNS_NOT_READ = "columns-not-read"
TOOL = frozenset({"tcp", "tool", "pose", "cartesian"})  # words of the tool itself
FEWEST = 3  # columns next to a path that may be joints; fewer are a radius, a speed, a flag

_DERIVATIVE = re.compile(r"d{1,2}_?[a-z]|q2d|q?dd?_")  # ddq1, d_q1, q2d_1
_MARKERS = frozenset({"limit", "limits", "index", "min", "max"})  # of other values of a joint
_SLIDES = re.compile(r"[dsl]_?(?P<n>\d+)")  # what a prismatic joint is called next to q1, q2


def coverage_warnings(
    joints: Sequence[Column], unused: Sequence[Column], numbers: Collection[int], *, robot: bool
) -> list[LogWarning]:
    """Return the warning that columns named like the joints are not used, or nothing.

    A column is named like the joints if it has all words that they share, or "joint" as they do; if they
    share no word, if it has their unit. "d4" is named like a joint that slides after q3.

    Args:
        joints: The joint columns.
        unused: The columns of numbers without a use, except those that other warnings state.
        numbers: The numbers in the names of the joints.
        robot: Whether an arm is given, which states how many joints there are.
    """
    words = vocabulary()
    names = [_words(column) for column in joints]
    if not joints or not all(column.header for column in joints):
        return []
    shared = frozenset.intersection(*map(frozenset, names))
    longest = max(map(len, names)) + 1
    units = {column.unit for column in joints} - {None}
    apart = words.other | words.joint_words["rate"] | words.joint_words["acceleration"] | _MARKERS

    def is_named_as_joints(column: Column) -> bool:
        words_of_name = _words(column)
        slides = _SLIDES.fullmatch(column.key)
        if slides and numbers and int(slides["n"]) == max(numbers) + 1:
            return True
        if column.kind == Kind.COMMANDED or column.words & apart or column.moves_nothing:
            return False
        if _DERIVATIVE.match(column.bare):
            return False
        return bool(
            ("joint" in shared and "joint" in words_of_name)
            or (shared and shared <= {*words_of_name} and len(words_of_name) <= longest)
            or (not shared and column.unit in units)
        )

    named = [column for column in unused if not column.text and column.header and is_named_as_joints(column)]
    if not named:
        return []
    every = sorted({*joints, *named}, key=lambda column: column.number)
    hint = NAME_JOINTS if robot else take(every, "takes all of them")
    message = f"{listed(named, most=8)} named like the joints and not read"
    return [LogWarning(COLUMNS_NOT_READ, message, hints=(hint,))]


def orientation_warnings(position: Sequence[Column], unused: Sequence[Column]) -> list[LogWarning]:
    """Return the warning that columns that may be the orientation at a position are not read, or nothing.

    They are three or four, and begin as the names of the position, or are angles if these begin with x, y, z.

    Args:
        position: The columns of the recorded position.
        unused: The columns of numbers without a use.
    """
    words = vocabulary()
    moving = words.joint_words["rate"] | words.joint_words["acceleration"] | (words.other - TOOL)
    stem = OF_POSITION.sub("", os.path.commonprefix([c.key for c in position]))  # noqa: RUF071 (names)
    free = (c for c in unused if not c.words & moving and (c.unit is None or c.unit.quantity == "angle"))
    near = [c for c in free if c.key.startswith(stem) if stem or (c.unit and not c.unit.order)]
    if len(near) not in (3, 4):
        return []
    message = f"{listed(near)} may be the orientation at {listed(position)} and are not read"
    hint = take(near, "with --position and --rotation takes them", parameter="orientation")
    return [LogWarning(COLUMNS_NOT_READ, message, hints=(hint,))]


def path_warnings(unused: Sequence[Column]) -> list[LogWarning]:
    """Return the warning that several columns of angles next to a path are not read, or nothing."""
    angles = [c for c in unused if c.unit is not None and c.unit.quantity == "angle"] or list(unused)
    if not FEWEST <= len(angles) <= MOST_JOINTS:
        return []
    message = f"x, y, z are read as a path, and {listed(angles, most=8)} are not read"
    return [LogWarning(COLUMNS_NOT_READ, message, hints=(take(angles, "takes them as the joints"),))]


def _words(column: Column) -> list[str]:
    """Return the words of a name without its numbers: of joint2_pos joint and pos."""
    return [word for word in re.split(r"[_\d]+", column.bare) if word]


TCP_NOT_READ = "tcp-not-read"

_NEAR = re.compile(r"(tcp|tpc|ctp|tool|tip|eef|endeff|werkzeug)|(?:^|_)ee(?:_|$)")
"""Words for a tool centre point, misspelled ones among them, anywhere in a name."""

_ENTRY = re.compile(r"[xyz\d]$")
"""How the name of an entry of a point ends."""

_TORQUES = re.compile(r"[tp]_?[xyz]")
"""Names of a position that forces beside them make torques."""

_BESIDE = frozenset({"analog", "digital", "input", "output", "in", "out", "bits", "offset", "payload"})
"""Words of what a tool has besides its place."""


def about_tcp(rest: Sequence[Column]) -> list[LogWarning]:
    """Return a warning if two columns or more look like a tool centre point."""
    alike = [column for column in rest if _is_like(column)]
    if len(alike) < 2:
        return []
    said = f"{listed(alike)} look like a recorded TCP and are not read as one"
    hints = (
        Hint("", effect="name its columns tcp_x, tcp_y, tcp_z"),
        take(alike, "takes them", parameter="position")
        if len(alike) == 3
        else Hint("position", None, "names them"),
    )
    return [LogWarning(TCP_NOT_READ, said, hints=hints)]


def about_odd_rows(rest: Sequence[Column], layouts: Sequence[LogTable]) -> list[LogWarning]:
    """Return a warning for columns that are called as a matrix, and are one but for a few rows."""
    for family in prefer_measured(find_families(rest, vocabulary().tcp_matrix, 0)):
        columns = family.ordered()
        if len(columns) in (9, 12, 16) and (rows := odd_rows(columns, layouts)):
            found = (
                f"{listed(columns, most=4)} hold no orientation in {format_count(len(rows), 'row')}, first in"
            )
            hints = (Hint("", effect="correct the row, or leave these cells empty"),)
            return [LogWarning(TCP_NOT_READ, f"{found} this one: none is read", rows[0], hints=hints)]
    return []


def _is_like(column: Column) -> bool:
    """Return whether the name of a column is that of a position, or near to one."""
    words = vocabulary()
    subject = {"tcp", "tool", "pose", "cartesian"}
    others = words.other - subject | words.joint_words["rate"] | words.joint_words["acceleration"]
    if column.words & (others | _BESIDE) or (column.unit and column.unit.quantity != "length"):
        return False
    named = any(pattern.search(column.key) for pattern in words.tcp_position)
    near = bool(_NEAR.search(column.key) and _ENTRY.search(column.key))
    return (named and not _TORQUES.fullmatch(column.key)) or near


GIVEN = "given as an option"  # evidence of columns that the user named


@dataclass(frozen=True, slots=True)
class Roles:
    """The columns of a log that are used, each group in order.

    Attributes:
        joints: Joint values, in the robot's order; none for a path.
        rates: Recorded rates of the same joints, or none.
        accelerations: Recorded second derivatives of the same joints, or none.
        position: Recorded x, y, z of the tool centre point, or none.
        rotation: Recorded orientation of the tool, or none.
        forms: The forms that the orientation may have; one if it is known.
        inferences: What was found out.
        warnings: What a person should know.
        measured: Whether the tool centre point was measured from outside, in a frame of its own.
        further: What else was asked for, by what it is.
    """

    joints: tuple[Column, ...] = ()
    rates: tuple[Column, ...] = ()
    accelerations: tuple[Column, ...] = ()
    position: tuple[Column, ...] = ()
    rotation: tuple[Column, ...] = ()
    forms: tuple[RotationForm, ...] = ()
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()
    measured: bool = False
    further: Mapping[str, Column] = field(default_factory=dict)

    def without(self, columns: Collection[Column]) -> Roles:
        """Return the roles without the groups that have one of these columns: half a group has no meaning."""
        groups = ("rates", "accelerations", "position", "rotation")
        partly: dict[str, Any] = {g: () for g in groups if not set(columns).isdisjoint(getattr(self, g))}
        return replace(self, **partly)

    @property
    def groups(self) -> tuple[tuple[Column, ...], ...]:
        """The columns of each role: joints, rates, accelerations, position, rotation."""
        return self.joints, self.rates, self.accelerations, self.position, self.rotation

    @property
    def columns(self) -> tuple[Column, ...]:
        """All of them, what else was asked for at the end."""
        return (*(column for group in self.groups for column in group), *self.further.values())


def assign(
    columns: Sequence[Column],
    layouts: Sequence[LogTable],
    options: LogMap,
    robot: Chain | None,
    whole: Sequence[LogTable] = (),
    *,
    path: bool = False,
    written: tuple[Column, ...] = (),
) -> Roles:
    """Return the roles of the columns of a table with a header.

    The joints are, in this order: the columns that the user names; those named like the robot's
    joints; those with a word for a joint and its number; those with a unit of angle; those of a
    family whose rates are another family, by their numbers. Without any, x, y, z make a path. Columns
    are not the joints because no others are left: these are asked about.

    Args:
        columns: The columns, without the clock.
        layouts: The tables.
        options: What the user says: joint columns, position, orientation.
        robot: The arm, or None.
        whole: All numbers of each table.
        path: It is a path, as the user says: joints are not looked for.
        written: The joints of a log that urmpipe wrote.

    Raises:
        LogError: If the joints cannot be told, or are too few or too many for the robot.
    """
    file = layouts[0].file
    numeric = [column for column in columns if (path or not column.text) and not column.counts_rows]
    if options.joints or written:
        joints = written or chosen_columns(columns, options.joints, parameter="joints")
        evidence = "urmpipe wrote them" if written else GIVEN
        found = NamedJoints(joints, evidence, *family_of(joints))
        pose = chosen_pose(columns, options) or find_pose([c for c in numeric if c not in joints], layouts)
    else:
        stated = tuple(c for c in numeric if c.index in stated_joints(layouts[c.table]))
        own = () if path else stated or called_as_joints(numeric, robot)
        pose = chosen_pose(columns, options) or find_pose(
            [c for c in numeric if c not in own],
            layouts,
            form=options.rotation if path else None,
            some=path,
            lone=path,
        )
        about_tool = {
            *pose.position,
            *pose.rotation,
            *(column for group in pose.alternatives for column in group),
        }
        free = [column for column in numeric if column not in about_tool and not column.moves_nothing]
        half, placed = bool(pose.position and not pose.rotation), bool(pose.position)
        by_name = partial(find_joints, free, file, robot, half_pose=half, path=placed)
        found = NamedJoints(()) if path else _stated(stated, file, robot) if stated else by_name()
        if whole and not (path or found.columns or pose.position or some_named(free, robot)[0]):
            found = proved_by_rates(numbered_alike(free), whole)
        if not stated and len(found.columns) == 4 and turns_as_quaternion(found.columns, layouts):
            unit = f"{listed(found.columns)} with length 1 in each row, as a quaternion has"
            raise which_joints(file, unit, [found.columns])
    chosen = bool(options.joints or written)
    if not chosen and any(column.words & vocabulary().goals for column in found.columns):
        goals = f"goals alone ({listed(found.columns)}), which are not the motion"
        raise which_joints(file, goals, [found.columns], by_side=True)
    if (
        found.columns
        and not (chosen or options.position or options.measured)
        and _is_commanded(pose.position, found.columns)
    ):
        pose = Pose()  # where the tool was to be
    pose = with_form(pose, options.rotation)
    if not found.columns:
        return _path(columns, numeric, pose, layouts, robot, path=path)
    check_count(found.columns, file, robot)
    rates = found.rates or _derivative("rate", numeric, found)
    accelerations = _derivative("acceleration", numeric, found)
    roles = Roles(
        found.columns, rates, accelerations, pose.position, pose.rotation, pose.forms, measured=pose.measured
    )
    said = [joint_inference(found.columns, found.evidence)]
    for what, group in (("rates", rates), ("accelerations", accelerations)):
        if group:
            said.append(Inference(what, ", ".join(column.name for column in group), "their names"))
    return _with_rest(
        roles, [*said, *about_pose(pose)], numeric, layouts, robot, found.alternatives, pose.alternatives
    )


def _stated(stated: Sequence[Column], file: str, robot: Chain | None) -> NamedJoints:
    """Return the joints among the columns that a schema states, by their names, else all but a gripper's."""
    first = [c for c in stated if c.kind == min(column.kind for column in stated)]
    arm = tuple(c for c in first if not c.words & vocabulary().grippers) or tuple(first)
    try:
        joints = find_joints(stated, file, robot, half_pose=False, path=False)
    except LogError:
        if robot is not None or len(by_arm(arm)) > 1:
            raise
        joints = NamedJoints(())
    names = tuple(re.split("(?:^|_)positions?_", column.key, maxsplit=1)[-1] for column in arm)
    evidence = "the messages name them; the order is theirs"
    return joints if joints.columns else NamedJoints(arm, evidence, names=names)


def _is_commanded(position: Sequence[Column], joints: Sequence[Column]) -> bool:
    """Return whether a position was commanded, and the joints were not."""
    return {c.kind for c in position} == {Kind.COMMANDED} and Kind.COMMANDED not in {c.kind for c in joints}


def check_count(joints: Sequence[Column], file: str, robot: Chain | None) -> None:
    """Raise unless there are as many joint columns as the robot has joints, each once.

    Raises:
        LogError: With what was found and what the robot needs.
    """
    if len(set(joints)) < len(joints):
        found, allowed = listed(joints), "each column once"
        raise LogError(Finding(file=file, parameter="joints", found=found, allowed=allowed))
    if robot is None or len(joints) == len(robot.coordinates):
        return
    need = f"allowed: {len(robot.coordinates)}, as robot {robot.name} has"
    more = len(joints) > len(robot.coordinates)
    numbers = () if all(column.header.isdigit() for column in joints) else family_of(joints)[0]
    first = min((1, *numbers))
    missing = [n for n in range(first, first + len(robot.coordinates)) if n not in numbers]
    none = f" and none with number {', '.join(map(str, missing))}" if numbers and not more else ""
    message = f"found {len(joints)} joint columns ({listed(joints)}){none}, {need}"
    hints = (NAME_JOINTS,) if more else (Hint("", effect="record every joint"), OTHER_ROBOT)
    raise LogError(Finding(message, file=file, hints=hints))


def _derivative(role: str, numeric: Sequence[Column], joints: NamedJoints) -> tuple[Column, ...]:
    """Return the recorded rates or accelerations of exactly these joints, or nothing."""
    if joints.names:
        return named_after(numeric, joints.names, role)
    order = ("position", "rate", "acceleration").index(role)
    kind, alternatives = joints.columns[0].kind, {group[0].kind for group in joints.alternatives}
    families = [
        family
        for family in find_families(numeric, vocabulary().joint[role], order=order)
        if set(family.columns) == set(joints.numbers)
    ]
    matching = [family for family in families if family.kind == kind]
    if not matching and kind != Kind.COMMANDED and Kind.PLAIN not in alternatives:
        matching = [family for family in families if family.kind != Kind.COMMANDED]
    best = [family for family in matching if family.rank == min(f.rank for f in matching)]
    return tuple(best[0].columns[n] for n in joints.numbers) if len(best) == 1 else ()


def joint_inference(joints: Sequence[Column], evidence: str) -> Inference:
    """Return what is said of the joint columns, and why they are."""
    names = tuple(column.name for column in joints)
    hints = (Hint("joints", None, "in the robot's order"),)
    return Inference("joint columns", ", ".join(names), evidence, columns=names, hints=hints)


def path_inference(names: str, evidence: str) -> Inference:
    """Return what is said of a log that is a path."""
    return Inference("path", names, evidence, hints=(Hint("joints", None, "for a log of joints"),))


def about_pose(pose: Pose) -> list[Inference]:
    """Say which columns hold the recorded tool centre point."""
    said, whose = [], "measured" if pose.measured else "recorded"
    groups = {"TCP": ("position", pose.position), "orientation": ("orientation", pose.rotation)}
    for what, (where, group) in groups.items():
        names = tuple(column.name for column in group)
        hints = (Hint("measured" if pose.measured else where),)
        if names:
            said.append(Inference(f"{whose} {what}", ", ".join(names), pose.evidence, "", names, hints))
    return said


def _path(
    columns: Sequence[Column],
    numeric: Sequence[Column],
    pose: Pose,
    layouts: Sequence[LogTable],
    robot: Chain | None,
    *,
    path: bool,
) -> Roles:
    """Return the roles of a path; raise if it is none either."""
    file = layouts[0].file
    pose = pose if pose.position else find_pose(numeric, layouts, file, lone=True)
    if pose.position:
        same = [group for group in pose.alternatives if group[0].kind == pose.position[0].kind]
        if same:
            groups = "; ".join(map(listed, (pose.position, *same)))
            hints = tuple(take(group, parameter="position") for group in (pose.position, *same))
            raise LogError(
                Finding(f"found several positions: {groups}; allowed: one x, y, z", file, hints=hints)
            )
        if not path and any(column.words & vocabulary().goals for column in pose.position):
            message = f"found goals alone ({listed(pose.position)}), allowed: the motion itself"
            choices = {"side": min(vocabulary().goals), "source": "path"}
            hints = tuple(Hint(option, value, "takes them") for option, value in choices.items())
            raise LogError(Finding(message, file, hints=hints))
        rest = () if path else _may_move(numeric, pose)
        if robot and len(rest) >= len(robot.coordinates):
            message = f"x, y, z ({listed(pose.position)}) and no columns that are known to be the"
            message += f" {len(robot.coordinates)} joints of {robot.name}"
            as_path = Hint("source", "path", "reads the path without joints")
            raise which_joints(file, message, _may_be(rest, columns, layouts, robot), UNKNOWN, as_path)
        names = ", ".join(column.name for column in pose.position)
        said = [path_inference(names, "x, y, z and no joint columns"), *about_pose(pose)[1:]]
        roles = Roles((), (), (), pose.position, pose.rotation, pose.forms, measured=pose.measured)
        roles = _with_rest(roles, said, numeric, layouts, robot, (), pose.alternatives)
        return replace(roles, warnings=(*roles.warnings, *path_warnings(rest)))
    _refuse_thousands(layouts, file)
    if path:
        hints = (Hint("", effect="name them so in the header"), Hint("position", None, "names them"))
        message = f"found no position in {listed(columns)}, allowed: x, y, z"
        raise LogError(Finding(message, file=file, hints=hints))
    need = (
        f"{len(robot.coordinates)} for robot {robot.name}" if robot else "such as q1, q2, ... or J1, J2, ..."
    )
    found, missing = some_named(numeric, robot)
    if found:
        spare = [column for column in numeric if column not in found]
        record, other = cure(len(missing), spare, len(robot.coordinates) if robot else None)
        lacking = f"found joint columns {listed(found)} and none for {', '.join(missing)}, allowed: {need}"
        answers = () if robot else (take(found),)
        raise LogError(Finding(lacking, file=file, hints=(record, *answers, other)))
    none = f"no joint columns in {listed(columns)}" if columns else "no column of numbers except times"
    times = () if columns else (TIMES_OF_ANOTHER,)
    raise which_joints(file, none, _may_be(numeric, columns, layouts, robot), need, *times)


def _may_move(numeric: Sequence[Column], pose: Pose) -> list[Column]:
    """Return the columns next to a position that may be joints: no rates, torques and such."""
    words = vocabulary()
    moving = words.joint_words["rate"] | words.joint_words["acceleration"] | words.other | words.outside
    used = {*pose.position, *pose.rotation, *(c for group in pose.alternatives for c in group)}
    free = (c for c in numeric if c not in used and not c.words & moving)
    return [
        c for c in free if c.unit is None or (c.unit.quantity in ("angle", "length") and not c.unit.order)
    ]


def _may_be(
    numeric: Sequence[Column], columns: Sequence[Column], layouts: Sequence[LogTable], robot: Chain | None
) -> list[Sequence[Column]]:
    """Return the columns that may be joints whatever their names, if they are as many as an arm has.

    The only one that increases from row to row may be a time, in a table without a clock.
    """
    other_words = vocabulary().other | vocabulary().outside
    candidates = [c for c in numeric if not (c.words & other_words or c.moves_nothing)]
    steps = [np.diff(layouts[column.table].numbers(column.index)) for column in candidates]
    clocked = {
        t for t, layout in enumerate(layouts) if len(layout.names) > sum(c.table == t for c in columns)
    }
    rising = [
        column
        for column, step in zip(candidates, steps, strict=True)
        if column.table not in clocked and len(step) > 1 and (step > 0).all()
    ]
    candidates = [column for column in candidates if len(rising) != 1 or column is not rising[0]]
    fits = {len(robot.coordinates)} if robot else range(1, MOST_JOINTS + 1)
    groups = sorted([*by_arm(candidates), *numbered_alike(candidates)], key=len, reverse=True)
    return [group for group in groups if len(group) in fits]


def _refuse_thousands(layouts: Sequence[LogTable], file: str) -> None:
    """Raise a `LogError` where numbers have signs between their thousands: their columns count as text."""
    cells = (cell for layout in layouts for row in layout.sample for cell in _as_written(row, layout))
    found = next((one for cell in cells if (one := grouped_number(cell))), None)
    if found:
        between = min(",.", key=found.index)
        allowed = f"{found.replace(between, '')}; export the table without thousands separators"
        raise LogError(Finding(f"found {found!r}, allowed: {allowed}", file=file))


def _as_written(row: Sequence[str], layout: LogTable) -> Iterator[str]:
    """Yield the cells of a row, and those of its line if it was parted at the commas within its numbers."""
    yield from row
    line = layout.delimiter.join(row)
    yield from (cell for sign in ";\t|" if sign in line for cell in line.split(sign))


def _with_rest(
    roles: Roles,
    inferences: list[Inference],
    numeric: Sequence[Column],
    layouts: Sequence[LogTable],
    robot: Chain | None,
    *alternatives: Sequence[tuple[Column, ...]],
) -> Roles:
    """Return the roles with the inferences and warnings about the columns that are not used.

    Args:
        roles: The roles.
        inferences: What was found out.
        numeric: All columns of numbers.
        layouts: The tables.
        robot: The arm, or None.
        alternatives: Groups of columns that would have been the joints, and the position, without these.
    """
    used = frozenset(roles.columns)
    rest = [column for column in numeric if column not in used]
    pairs = list(zip((roles.joints, roles.position), alternatives, strict=True))
    pairs += [
        (group, same_quantities(group, rest)) for group in (roles.rates, roles.accelerations, roles.rotation)
    ]
    passed = _passed_over(pairs, used)
    hints = _sides_of(passed[0]) if passed else ()
    inferences += [replace(item, hints=hints) for item in not_used(rest, "unknown role")]
    warnings = about_odd_rows(rest, layouts) or ([] if roles.position else about_tcp(rest))
    stated = {column for _, group in passed for column in group}
    unused = [column for column in rest if column not in stated]
    if inferences[0].evidence != GIVEN:  # who names the joints knows the others
        numbers = family_of(roles.joints)[0]
        warnings += coverage_warnings(roles.joints, unused, numbers, robot=robot is not None)
    if roles.position and not roles.rotation:
        warnings += orientation_warnings(roles.position, unused)
    return replace(
        roles, inferences=tuple(inferences), warnings=(*_about_passed_over(passed, roles), *warnings)
    )


def _passed_over(
    pairs: Sequence[tuple[tuple[Column, ...], Sequence[tuple[Column, ...]]]], used: Collection[Column]
) -> list[tuple[tuple[Column, ...], tuple[Column, ...]]]:
    """Return the groups that are read, each with one that was passed over for it; no column twice."""
    named, passed = set(used), []
    for group, alternatives in pairs:
        for other in alternatives:
            if left := tuple(column for column in other if column not in named):
                passed.append((group, left))
                named |= {*left}
    return passed


def _about_passed_over(
    passed: Sequence[tuple[tuple[Column, ...], tuple[Column, ...]]], roles: Roles
) -> Iterator[LogWarning]:
    """Yield one line with all columns that were not read because others were."""
    if passed:
        said = "; ".join(f"{_ends(other)} passed over for {_ends(group)}" for group, other in passed)
        takes = [take(other) for group, other in passed if group == roles.joints]
        takes += [take(other, parameter="position") for group, other in passed if group == roles.position]
        hints = takes[:1] or [Hint("side", None, "takes others")]
        yield LogWarning(PASSED_OVER, said, hints=tuple(hints))


def _ends(group: Sequence[Column]) -> str:
    """Return the names of the first and the last column."""
    return " to ".join(dict.fromkeys(listed([column]) for column in (group[0], group[-1])))


def _sides_of(passed: tuple[tuple[Column, ...], tuple[Column, ...]]) -> tuple[Hint, ...]:
    """Return how to compare columns that are read with those passed over, by the words in their names."""
    done, asked = (frozenset.intersection(*(one.words for one in group)) for group in passed)
    pair = [
        min(asked & vocabulary().commanded, default=REST),
        min(done & vocabulary().measured_markers, default=REST),
    ]
    return () if pair == [REST, REST] else (Hint("sides", pair, "compares them", call="compare"),)


def not_used(rest: Sequence[Column], why: str) -> list[Inference]:
    """Say which columns are not used, if any."""
    return [Inference("columns not used", listed(rest, most=8), why)] if rest else []


TOOL_OWN_LOG = ("x", "y", "z")
"""What a plan has behind its joints; tcp_x, ... where a joint has such a name."""


def own_joints(columns: Sequence[Column]) -> tuple[Column, ...]:
    """Return the joints: the columns with a unit of joints, but for the tool of a plan or a traced point.

    What stands behind the rows of targets or path was added by somebody else.
    """
    rows = [column for column in columns if column.header in (TARGET_ROW, PATH_ROW, MOTION_ROW)]
    before = columns[: columns.index(rows[0])] if rows else columns
    sized = tuple(one for one in before if one.unit and one.unit.quantity in ("angle", "length"))
    tool = tuple(one.key.removeprefix("tcp_") for one in sized[-len(TOOL_OWN_LOG) :])
    planned = any(column.header in (PATH_ROW, MOTION_ROW) for column in rows)
    return sized[: -len(TOOL_OWN_LOG)] if planned and tool == TOOL_OWN_LOG else sized


def written_roles(columns: Sequence[Column], layout: LogTable, robot: Chain | None) -> Roles | None:
    """Return the roles of the columns of an export, as urmpipe wrote them; None of any other table.

    Args:
        columns: The columns, without the clock.
        layout: Their table.
        robot: The arm, or None.

    Raises:
        LogError: If it has another number of joints.
    """
    held = roles_of(layout)
    there = {column.index: column for column in columns}
    groups = [
        tuple(there[index] for index, own in held.items() if own == role and index in there)
        for role in ROLES[1:]
    ]
    joints, rates, accelerations, position, rotation = groups
    if not joints and not position:
        return None
    if joints:
        check_count(joints, layout.file, robot)
    names = tuple(column.name.removeprefix(RECORDED) for column in rotation)
    told = form_of(layout)
    forms = [form for form in FORMS if form == told] or [
        form for form, own in COLUMN_NAMES.items() if own == names
    ]
    forms = forms or [form for form in FORMS if rotation and column_count(form) == len(rotation)]
    arrays = layout.arrow is not None and GIVEN_KEY in (layout.arrow.schema.metadata or {})
    why = "given as an array" if arrays else "urmpipe wrote them"
    said = [joint_inference(joints, why) if joints else path_inference(_listed(position), why)]
    recorded = {"rates": rates, "accelerations": accelerations, "recorded TCP": position if joints else ()}
    for what, group in (recorded | {"recorded orientation": rotation}).items():
        said += [Inference(what, _listed(group), why)] if group else []
    used = tuple(column for group in groups for column in group)
    said += not_used([column for column in columns if column not in used], "urmpipe makes them anew")
    forms = forms if rotation else []
    return Roles(joints, rates, accelerations, position, rotation, tuple(forms), tuple(said))


def _listed(columns: Sequence[Column]) -> str:
    return ", ".join(column.name for column in columns)


MOST_NAMES = 40
"""More names than this that come again and again are hardly those of joints."""


def refuse_long_form(
    joints: Sequence[Column], columns: Sequence[Column], clock: Sequence[Column], layout: LogTable
) -> None:
    """Raise if a table has a row a joint: a column beside its only joint goes round the same names.

    Args:
        joints: The joints that were found.
        columns: The columns beside the clock.
        clock: Those of the clock.
        layout: How the table is written.

    Raises:
        LogError: With the command that makes a row a sample of it.
    """
    if len(joints) != 1 or layout.header is None:
        return
    others = [column for column in columns if column not in joints]
    names = [column for column in others if _goes_round(layout.cells(column.index))]
    if not names:
        return
    found = f"one row per joint: {names[0].header} goes round {len(set(layout.cells(names[0].index)))} names"
    hints = () if len(clock) != 1 else (Hint("", effect=_command(joints[0], names[0], clock[0], layout)),)
    raise LogError(Finding(file=layout.file, found=found, allowed="one row per sample", hints=hints))


def _goes_round(cells: Sequence[str]) -> bool:
    """Return whether cells go through the same few texts again and again, in one order."""
    count = len(set(cells))
    if not 2 <= count <= MOST_NAMES or len(cells) < 3 * count:
        return False
    whole = all(not cell or not cell[0].isdigit() or cell.isdigit() for cell in cells[:count])
    return whole and all(cell == cells[k % count] for k, cell in enumerate(cells))


def _command(joint: Column, name: Column, time: Column, layout: LogTable) -> str:
    """Return the command that writes such a table with a column a joint."""
    kind = "parquet" if layout.arrow is not None else "csv"
    sign = "" if layout.arrow is not None or layout.delimiter == "," else f", sep={layout.delimiter!r}"
    comma = ", decimal=','" if layout.decimal == "," else ""
    turned = f"index={time.header!r}, columns={name.header!r}, values={joint.header!r}"
    read = f"pandas.read_{kind}({layout.path.name!r}{sign}{comma})"
    return python_command(f"import pandas; {read}.pivot({turned}).to_csv('table.csv')")


_SIGNAL = re.compile(r"(?P<block>[^.\s]+)\.(?P<variable>[^.\s\[]+)(\[(?P<element>\d+)\])?( \[[^\]]*\])?")
"""BLOCK.VARIABLE, of an array with the number of the element, and its unit behind."""

_JOINTS = ("q", "phi", "s")
"""What the arrays of joints are called in the units of urmpipe."""

_CLOCK = "t [s]"


def joints_of_blocks(columns: Sequence[Column], layout: LogTable, robot: Chain | None) -> Roles | None:
    """Return the roles of the signals of a simulation; None of any other table.

    The joints are the only array that is called as joints are. Scalars such as load1.theta, load2.theta may
    be those of drives, of loads or of set points.

    Args:
        columns: The columns, without the clock.
        layout: Their table.
        robot: The arm, or None.

    Raises:
        LogError: With the question which they are, if several may be, or they are not as many as the robot's.
    """
    signals = {
        column: _SIGNAL.fullmatch(column.header) for column in columns if column.header != "clock [ns]"
    }
    if layout.names[:1] != (_CLOCK,) or not signals or not all(signals.values()):
        return None
    arrays: dict[tuple[str, str], list[Column]] = {}
    scalars: dict[tuple[str, str], list[Column]] = {}
    for column, match in signals.items():
        if match is None or column.unit is None or column.unit.quantity not in ("angle", "length"):
            continue
        if column.unit.order == 0 and match["element"] and match["variable"] in _JOINTS:
            arrays.setdefault((match["block"], match["variable"]), []).append(column)
        elif column.unit.order == 0 and not match["element"]:
            alike = re.sub(r"\d+$", "", match["block"]), match["variable"]
            scalars.setdefault(alike, []).append(column)
    if len(arrays) == 1:
        return _taken(next(iter(arrays.values())), columns, layout, robot)
    groups = list((arrays or scalars).values())
    most = max(map(len, groups), default=0)
    groups = [one for one in groups if len(one) == most]
    if len(groups) < 2:
        return None
    found = f"{len(groups)} groups of signals that may be joints"
    raise which_joints(layout.file, found, groups, "one of them")


def _taken(
    joints: Sequence[Column], columns: Sequence[Column], layout: LogTable, robot: Chain | None
) -> Roles:
    """Return the joints of an arm with the rates that stand beside them."""
    check_count(joints, layout.file, robot)
    by_name = {column.header.split(" ")[0]: column for column in columns}
    rates, accelerations = (
        tuple(by_name[name] for name in names) if all(name in by_name for name in names) else ()
        for names in ([one.header.split(" ")[0].replace("[", f"{d}[") for one in joints] for d in ("d", "dd"))
    )
    said = [joint_inference(joints, "the only array of joints among the signals")]
    rest = [column for column in columns if column not in (*joints, *rates, *accelerations)]
    said += not_used(rest, "signals beside the joints")
    return Roles(tuple(joints), rates, accelerations, inferences=tuple(said))
