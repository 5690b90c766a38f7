"""What each column of a table with names is: joints, rates, accelerations, recorded tool centre point.

1. `assign`: the joints are the columns that the user names, that a schema calls joints, that are named like
   the robot's joints or like those of an arm (`names`), or whose rates are next to them.
2. Without joints, x, y, z are a path; else a question whose choices are the columns that may be joints.
3. `written_roles`: the columns of what urmpipe writes itself, by their metadata or all names together.
4. `signal_roles`: the signals of a simulation: its only array of joints, else a question.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_models.math3d import COLUMN_NAMES, FORMS, RotationForm, column_count
from urmpipe_pipeline.joint_log import ROLES, Basis, Inference, LogWarning
from urmpipe_pipeline.logs.columns import (
    NAME_JOINTS,
    OTHER_ROBOT,
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
from urmpipe_pipeline.logs.coverage import (
    compare_sides,
    coverage_warnings,
    orientation_warnings,
    passed_over_warnings,
    path_warnings,
    tcp_warnings,
)
from urmpipe_pipeline.logs.formats.cells import grouped_number
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.long_form import LONG
from urmpipe_pipeline.logs.formats.urmpipe_tables import GIVEN as GIVEN_KEY
from urmpipe_pipeline.logs.formats.urmpipe_tables import (
    RECORDED,
    read_roles,
    read_rotation_form,
    stated_joints,
)
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.names import (
    FIRST_NUMBER,
    NamedJoints,
    cure,
    family_of,
    find_families,
    find_joints,
    group_by_number,
    named_after,
    of_first_kind,
    proved_by_rates,
    same_quantities,
    some_named,
)
from urmpipe_pipeline.logs.pose_columns import (
    Pose,
    chosen_pose,
    find_pose,
    may_be_positions,
    turns_as_quaternion,
    with_form,
)
from urmpipe_pipeline.logs.rates import MAX_JOINTS
from urmpipe_pipeline.logs.vocabulary import key, vocabulary
from urmpipe_pipeline.outputs import MOTION_ROW, PATH_ROW, TARGET_ROW

GIVEN = "given as an option"  # evidence of columns that the user named
MAX_POSITIONS = 6  # choices of x, y, z in a question
_TWIST = re.compile(r"(?:^|[./])twist[./]")  # the rates of a pose in messages; wrist_twist is a joint


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
        inferences: How each is known.
        warnings: What a person should know.
        measured: Whether the tool centre point was measured from outside, in another frame.
        further: What else was requested, by what it is.
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
        """All of them, what else was requested at the end."""
        return (*(column for group in self.groups for column in group), *self.further.values())


def assign(
    columns: Sequence[Column],
    tables: Sequence[LogTable],
    options: LogMap,
    robot: Chain | None,
    *,
    path: bool = False,
    written: tuple[Column, ...] = (),
) -> Roles:
    """Return the roles of the columns of a table with a header.

    Columns are not the joints because no others remain: these are asked about.

    Args:
        columns: The columns, without the clock.
        tables: The tables.
        options: What the user says: joint columns, position, orientation.
        robot: The arm, or None.
        path: It is a path, as the user says: joints are not looked for.
        written: The joints of a log that urmpipe wrote.

    Raises:
        LogError: If it is unknown which columns are the joints, or the robot has another number of them.
    """
    file = tables[0].file
    numeric = [column for column in columns if (path or not column.text) and not column.counts_rows]
    if chosen := bool(options.joints or written):
        joints = written or chosen_columns(columns, options.joints, parameter="joints")
        named = NamedJoints(joints, "urmpipe wrote them" if written else GIVEN, *family_of(joints))
        rest = [column for column in numeric if column not in joints]
        pose = chosen_pose(columns, options) or find_pose(rest, tables)
    else:
        named, pose = _find_joints(columns, numeric, tables, options, robot, path=path)
    if not chosen and any(column.words & vocabulary().goals for column in named.columns):
        message = f"goals alone ({listed(named.columns)}), which are not the motion"
        raise which_joints(file, message, [named.columns], by_side=True)
    pose = with_form(pose, options.rotation)
    if not named.columns:
        return _path(columns, numeric, pose, tables, robot, path=path)
    check_count(named.columns, file, robot)
    rates = named.rates or _derivative("rate", numeric, named)
    accelerations = _derivative("acceleration", numeric, named)
    place = pose.position, pose.rotation, pose.forms
    roles = Roles(named.columns, rates, accelerations, *place, measured=pose.measured)
    inferences = [joint_inference(named.columns, named.evidence)]
    for what, group in (("rates", rates), ("accelerations", accelerations)):
        if group:
            inferences.append(Inference(what, ", ".join(column.name for column in group), "their names"))
    inferences += about_pose(pose)
    return _with_warnings(roles, inferences, numeric, tables, robot, named.alternatives, pose.alternatives)


def _find_joints(
    columns: Sequence[Column],
    numeric: Sequence[Column],
    tables: Sequence[LogTable],
    options: LogMap,
    robot: Chain | None,
    *,
    path: bool,
) -> tuple[NamedJoints, Pose]:
    """Return the joints by a schema, names or rates, and the recorded pose next to them."""
    file = tables[0].file
    stated = tuple(column for column in numeric if column.index in stated_joints(tables[column.table]))
    robots = () if path else stated or _called_as_joints(numeric, robot)
    rest = [column for column in numeric if column not in robots]
    pose = chosen_pose(columns, options) or find_pose(rest, tables, options.rotation, path=path)
    if path:
        return NamedJoints(()), pose
    of_tool = {*pose.position, *pose.rotation, *(column for group in pose.alternatives for column in group)}
    free = [column for column in numeric if column not in of_tool and not column.moves_nothing]
    if options.position:  # the others of their name are not joints: pos_4 after pos_1, pos_2, pos_3
        stems = {column.key.rstrip("0123456789") for column in pose.position} - {""}
        free = [column for column in free if column.key.rstrip("0123456789") not in stems]
    if stated:
        named = _stated(stated, file, robot)
    else:
        half_pose = bool(pose.position and not pose.rotation)
        named = find_joints(free, file, robot, half_pose=half_pose, path=bool(pose.position))
        if not (named.columns or pose.position or some_named(free, robot)[0]):
            named = proved_by_rates(group_by_number(free), tables)
        if len(named.columns) == 4 and turns_as_quaternion(named.columns, tables):
            message = f"{listed(named.columns)} with length 1 in each row, as a quaternion has"
            raise which_joints(file, message, [named.columns])
    kinds = {column.kind for column in named.columns}
    is_commanded = {column.kind for column in pose.position} == {
        Kind.COMMANDED
    } and Kind.COMMANDED not in kinds
    if kinds and is_commanded and not (options.position or options.measured):
        pose = Pose()  # where the tool was to be
    return named, pose


def _called_as_joints(numeric: Sequence[Column], robot: Chain | None) -> tuple[Column, ...]:
    """Return the columns named exactly as the robot's joints: x, y, z of a gantry are no position."""
    if robot is None:
        return ()
    columns = named_after(numeric, robot.coordinates, "position")
    is_exact = all(
        key(name) in (column.key, column.bare)
        for name, column in zip(robot.coordinates, columns, strict=False)
    )
    return columns if is_exact else ()


def _stated(stated: Sequence[Column], file: str, robot: Chain | None) -> NamedJoints:
    """Return the joints among the columns that a schema states: by their names, else all without grippers."""
    first = [column for column in stated if column.kind == min(other.kind for other in stated)]
    arm = tuple(column for column in first if not column.words & vocabulary().grippers) or tuple(first)
    try:
        joints = find_joints(stated, file, robot, half_pose=False, path=False)
    except LogError:
        if robot is not None or len(by_arm(arm)) > 1:
            raise
        joints = NamedJoints(())
    names = tuple(re.split("(?:^|_)positions?_", column.key, maxsplit=1)[-1] for column in arm)
    evidence = "the messages name them; the order is theirs"
    return joints if joints.columns else NamedJoints(arm, evidence, names=names)


def check_count(joints: Sequence[Column], file: str, robot: Chain | None) -> None:
    """Raise unless there are as many joint columns as the robot has joints, each once.

    Raises:
        LogError: With what was found and what the robot needs.
    """
    if len(set(joints)) < len(joints):
        raise LogError(
            Finding(file=file, parameter="joints", found=listed(joints), allowed="each column once")
        )
    if robot is None or len(joints) == len(robot.coordinates):
        return
    is_more = len(joints) > len(robot.coordinates)
    numbers = () if all(column.header.isdigit() for column in joints) else family_of(joints)[0]
    first = min((1, *numbers))
    missing = [n for n in range(first, first + len(robot.coordinates)) if n not in numbers]
    none = f" and none with number {', '.join(map(str, missing))}" if numbers and not is_more else ""
    need = f"allowed: {len(robot.coordinates)}, as robot {robot.name} has"
    message = f"found {len(joints)} joint columns ({listed(joints)}){none}, {need}"
    hints = (NAME_JOINTS,) if is_more else (Hint("", effect="record every joint"), OTHER_ROBOT)
    raise LogError(Finding(message, file=file, hints=hints))


def _derivative(role: str, numeric: Sequence[Column], joints: NamedJoints) -> tuple[Column, ...]:
    """Return the recorded rates or accelerations of exactly these joints, or nothing."""
    if joints.names:
        return named_after(numeric, joints.names, role)
    order = ("position", "rate", "acceleration").index(role)
    kind, alternatives = joints.columns[0].kind, {group[0].kind for group in joints.alternatives}
    families = find_families(numeric, vocabulary().joint[role], order=order)
    families = [family for family in families if set(family.columns) == set(joints.numbers)]
    matching = [family for family in families if family.kind == kind]
    if not matching and kind != Kind.COMMANDED and Kind.PLAIN not in alternatives:
        matching = [family for family in families if family.kind != Kind.COMMANDED]
    best = [family for family in matching if family.rank == min(other.rank for other in matching)]
    return tuple(best[0].columns[n] for n in joints.numbers) if len(best) == 1 else ()


def joint_inference(joints: Sequence[Column], evidence: str, basis: Basis = "named") -> Inference:
    """Return the inference of the joint columns, with its evidence."""
    names = tuple(column.name for column in joints)
    hints = (Hint("joints", None, "in the robot's order"),)
    return Inference("joint columns", ", ".join(names), evidence, "", names, hints, basis)


def path_inference(names: str, evidence: str) -> Inference:
    """Return the inference that a log is a path."""
    return Inference("path", names, evidence, hints=(Hint("joints", None, "for a log of joints"),))


def about_pose(pose: Pose, basis: Basis = "named") -> list[Inference]:
    """Return the inferences of the columns of the recorded tool centre point."""
    whose = "measured" if pose.measured else "recorded"
    groups = {"TCP": ("position", pose.position), "orientation": ("orientation", pose.rotation)}
    inferences = []
    for what, (parameter, group) in groups.items():
        names = tuple(column.name for column in group)
        hints = (Hint("measured" if pose.measured else parameter),)
        if names:
            value = ", ".join(names)
            inferences.append(Inference(f"{whose} {what}", value, pose.evidence, "", names, hints, basis))
    return inferences


def not_used(rest: Sequence[Column], why: str) -> list[Inference]:
    """Return the inference of the columns that are not used, if any."""
    return [Inference("columns not used", listed(rest, most=8), why)] if rest else []


# 2. Paths and questions


def _path(
    columns: Sequence[Column],
    numeric: Sequence[Column],
    pose: Pose,
    tables: Sequence[LogTable],
    robot: Chain | None,
    *,
    path: bool,
) -> Roles:
    """Return the roles of a path; raise if it has no position either."""
    file = tables[0].file
    pose = pose if pose.position else find_pose(numeric, tables, path=True)
    if pose.position:
        same = [group for group in pose.alternatives if group[0].kind == pose.position[0].kind]
        if same:
            groups = [pose.position, *same]
            message = f"found several positions: {'; '.join(map(listed, groups))}; allowed: one x, y, z"
            hints = tuple(take(group, parameter="position") for group in groups)
            raise LogError(Finding(message, file, hints=hints))
        if not path and any(column.words & vocabulary().goals for column in pose.position):
            message = f"found goals alone ({listed(pose.position)}), allowed: the motion itself"
            choices = {"side": min(vocabulary().goals), "source": "path"}
            hints = tuple(Hint(option, value, "takes them") for option, value in choices.items())
            raise LogError(Finding(message, file, hints=hints))
        used = {*pose.position, *pose.rotation, *(column for group in pose.alternatives for column in group)}
        rest = [] if path else _may_move([column for column in numeric if column not in used])
        if robot and len(rest) >= len(robot.coordinates):
            message = f"x, y, z ({listed(pose.position)}) and no columns that are known to be the"
            message += f" {len(robot.coordinates)} joints of {robot.name}"
            as_path = Hint("source", "path", "reads the path without joints")
            raise which_joints(file, message, _may_be(rest, columns, tables, robot), UNKNOWN, as_path)
        names = ", ".join(column.name for column in pose.position)
        inferences = [path_inference(names, "x, y, z and no joint columns"), *about_pose(pose)[1:]]
        roles = Roles((), (), (), pose.position, pose.rotation, pose.forms, measured=pose.measured)
        roles = _with_warnings(roles, inferences, numeric, tables, robot, (), pose.alternatives)
        return replace(roles, warnings=(*roles.warnings, *path_warnings(rest)))
    _check_thousands(tables)
    if path:
        hints = (Hint("", effect="name them so in the header"), Hint("position", None, "names them"))
        message = f"found no position in {listed(columns)}, allowed: x, y, z"
        raise LogError(Finding(message, file=file, hints=hints))
    need = (
        f"{len(robot.coordinates)} for robot {robot.name}" if robot else "such as q1, q2, ... or J1, J2, ..."
    )
    some, missing = some_named(numeric, robot)
    if some:
        spare = [column for column in numeric if column not in some]
        record, other = cure(len(missing), spare, len(robot.coordinates) if robot else None)
        message = f"found joint columns {listed(some)} and none for {', '.join(missing)}, allowed: {need}"
        answers = () if robot else (take(some),)
        raise LogError(Finding(message, file=file, hints=(record, *answers, other)))
    none = f"no joint columns in {listed(columns)}" if columns else "no column of numbers except times"
    further = [] if columns else [TIMES_OF_ANOTHER]
    positions = [] if robot else may_be_positions(numeric)
    further += [take(group, "reads a path", parameter="position") for group in positions[:MAX_POSITIONS]]
    of_tool = {column for group in positions for column in group}
    if len(of_tool) > 2:  # x and y alone may be joints as well
        numeric = [column for column in numeric if column not in of_tool]
    raise which_joints(file, none, _may_be(numeric, columns, tables, robot), need, *further)


def _may_move(columns: Sequence[Column]) -> list[Column]:
    """Return the columns that may be joints by name and unit: no rates, torques and such."""
    words = vocabulary()
    excluded = words.joint_terms["rate"] | words.joint_terms["acceleration"] | words.other | words.outside
    free = [c for c in columns if not c.words & excluded and not _TWIST.search(c.header)]
    return [
        column
        for column in free
        if column.unit is None or (column.unit.quantity in ("angle", "length") and not column.unit.order)
    ]


def _may_be(
    numeric: Sequence[Column], columns: Sequence[Column], tables: Sequence[LogTable], robot: Chain | None
) -> list[Sequence[Column]]:
    """Return the columns that may be joints whatever their names, if they are as many as an arm has.

    A column that counts is excluded, and the only one that rises may be a time, in a table without a clock.
    """
    candidates = _may_move(numeric)
    steps = {column: np.diff(tables[column.table].numbers(column.index)) for column in candidates}
    for column, step in steps.items():
        if len(step) > 2 and step[0] > 0 and step[0] % 1 == 0 and (step == step[0]).all():
            candidates.remove(column)
    clocked = {
        index
        for index, table in enumerate(tables)
        if len(table.names) > sum(c.table == index for c in columns)
    }
    rising = [
        column
        for column in candidates
        if column.table not in clocked and len(steps[column]) > 1 and (steps[column] > 0).all()
    ]
    candidates = [column for column in candidates if len(rising) != 1 or column is not rising[0]]
    counts = {len(robot.coordinates)} if robot else range(1, MAX_JOINTS + 1)
    candidates = of_first_kind(candidates)
    groups = [*by_arm(candidates), *group_by_number(candidates), *group_by_number(candidates, FIRST_NUMBER)]
    groups.sort(key=len, reverse=True)
    return [group for group in groups if len(group) in counts]


def _check_thousands(tables: Sequence[LogTable]) -> None:
    """Raise a `LogError` where numbers have signs between their thousands: their columns count as text."""
    for table in tables:
        for row in table.sample:
            line = table.delimiter.join(row)  # which a comma within a number may have parted
            parts = [part for sign in ";\t|" if sign in line for part in line.split(sign)]
            number = next((number for cell in (*row, *parts) if (number := grouped_number(cell))), None)
            if number:
                plain = number.replace(min(",.", key=number.index), "")
                message = f"found {number!r}, allowed: {plain}; export the table without thousands separators"
                raise LogError(Finding(message, file=tables[0].file))


def _with_warnings(
    roles: Roles,
    inferences: list[Inference],
    numeric: Sequence[Column],
    tables: Sequence[LogTable],
    robot: Chain | None,
    *alternatives: Sequence[tuple[Column, ...]],
) -> Roles:
    """Return the roles with the inferences, and the warnings about the columns that are not used.

    Args:
        roles: The roles.
        inferences: How they are known.
        numeric: All columns of numbers.
        tables: The tables.
        robot: The arm, or None.
        alternatives: Groups of columns that would have been the joints, and the position, without these.
    """
    rest = [column for column in numeric if column not in roles.columns]
    pairs = list(zip((roles.joints, roles.position), alternatives, strict=True))
    pairs += [
        (group, same_quantities(group, rest)) for group in (roles.rates, roles.accelerations, roles.rotation)
    ]
    passed, covered = [], {*roles.columns}
    for group, passed_over in pairs:
        for other in passed_over:
            if new := tuple(column for column in other if column not in covered):
                passed.append((group, new))
                covered |= {*new}
    unused = [column for column in rest if column not in covered]
    is_given = inferences[0].evidence == GIVEN
    warnings = passed_over_warnings(passed, roles.joints, roles.position)
    warnings += [] if roles.position else tcp_warnings(rest)
    warnings += coverage_warnings(roles.joints, unused, robot=robot is not None, is_given=is_given)
    if roles.position and not roles.rotation:
        warnings += orientation_warnings(roles.position, unused)
    sides = compare_sides(*passed[0]) if passed else ()
    inferences += [replace(item, hints=sides) for item in not_used(rest, "unknown role")]
    return replace(roles, inferences=tuple(inferences), warnings=tuple(warnings))


# 3. What urmpipe writes


def own_joints(columns: Sequence[Column]) -> tuple[Column, ...]:
    """Return the joints of a joint log of inverse kinematics, a plan or a network: columns with their units.

    After the joints of a plan or a traced point comes its tool: x, y, z, or tcp_x, ... What comes after the
    rows of targets or path is of another program.
    """
    rows = [column for column in columns if column.header in (TARGET_ROW, PATH_ROW, MOTION_ROW)]
    before = columns[: columns.index(rows[0])] if rows else columns
    sized = tuple(c for c in before if c.unit and c.unit.quantity in ("angle", "length"))
    tool = [column.key.removeprefix("tcp_") for column in sized[-3:]]
    is_planned = any(column.header in (PATH_ROW, MOTION_ROW) for column in rows)
    return sized[:-3] if is_planned and tool == ["x", "y", "z"] else sized


def written_roles(columns: Sequence[Column], table: LogTable, robot: Chain | None) -> Roles | None:
    """Return the roles of the columns of an export, as urmpipe wrote them; None of any other table.

    Args:
        columns: The columns, without the clock.
        table: Their table.
        robot: The arm, or None.

    Raises:
        LogError: If it has another number of joints.
    """
    by_index = {column.index: column for column in columns}
    roles = [(by_index[index], role) for index, role in read_roles(table).items() if index in by_index]
    groups = [tuple(column for column, of_column in roles if of_column == role) for role in ROLES[1:]]
    joints, rates, accelerations, position, rotation = groups
    if not joints and not position:
        return None
    if joints:
        check_count(joints, table.file, robot)
    names = tuple(column.name.removeprefix(RECORDED) for column in rotation)
    forms = (
        [form for form in FORMS if form == read_rotation_form(table)]
        or [form for form, of_form in COLUMN_NAMES.items() if of_form == names]
        or [form for form in FORMS if column_count(form) == len(rotation)]
    )
    is_array = table.arrow is not None and GIVEN_KEY in (table.arrow.schema.metadata or {})
    why = "given as an array" if is_array else "urmpipe wrote them"
    inferences = [joint_inference(joints, why) if joints else path_inference(_names(position), why)]
    recorded = {"rates": rates, "accelerations": accelerations, "recorded TCP": position if joints else ()}
    for what, group in (recorded | {"recorded orientation": rotation}).items():
        inferences += [Inference(what, _names(group), why)] if group else []
    used = [column for group in groups for column in group]
    rest = [column for column in columns if column not in used]
    inferences += not_used(rest, "urmpipe computes them again")
    forms = forms if rotation else []
    return Roles(joints, rates, accelerations, position, rotation, tuple(forms), tuple(inferences))


def _names(columns: Sequence[Column]) -> str:
    return ", ".join(column.name for column in columns)


# 4. Signals of a simulation

_SIGNAL = re.compile(r"(?P<block>[^.\s]+)\.(?P<variable>[^.\s\[]+)(\[(?P<element>\d+)\])?( \[[^\]]*\])?")
_SIGNAL_CLOCKS = ("t [s]", "clock [ns]")
_JOINT_ARRAYS = ("q", "phi", "s")  # names of arrays of joints in the units of urmpipe


def signal_roles(columns: Sequence[Column], table: LogTable, robot: Chain | None) -> Roles | None:
    """Return the roles of the signals BLOCK.VARIABLE of a simulation; None if a table has others.

    The joints are the only array with a name of joints. Scalars such as load1.theta, load2.theta may be those
    of drives, of loads or of set points.

    Args:
        columns: The columns, without the clock.
        table: Their table.
        robot: The arm, or None.

    Raises:
        LogError: With the question which they are, if several may be, or they are not as many as the robot's.
    """
    signals = [(c, _SIGNAL.fullmatch(c.header)) for c in columns if c.header not in _SIGNAL_CLOCKS]
    if table.names[:1] != _SIGNAL_CLOCKS[:1] or any(known.value == LONG for known in table.inferences):
        return None
    if not signals or not all(match for _, match in signals):
        return None
    arrays: dict[tuple[str, str], list[Column]] = {}
    scalars: dict[tuple[str, str], list[Column]] = {}
    for column, match in signals:
        unit = column.unit
        if match is None or unit is None or unit.quantity not in ("angle", "length") or unit.order:
            continue
        block, variable = match["block"], match["variable"]
        if not match["element"]:
            scalars.setdefault((block.rstrip("0123456789"), variable), []).append(column)
        elif variable in _JOINT_ARRAYS:
            arrays.setdefault((block, variable), []).append(column)
    groups = list((arrays or scalars).values())
    if len(arrays) != 1:
        size = max(map(len, groups), default=0)
        groups = [group for group in groups if len(group) == size]
        if len(groups) < 2:
            return None
        raise which_joints(
            table.file, f"{len(groups)} groups of signals that may be joints", groups, "one of them"
        )
    joints = tuple(groups[0])
    check_count(joints, table.file, robot)
    by_name = {column.header.partition(" ")[0]: column for column in columns}
    names = [column.header.partition(" ")[0] for column in joints]
    rates, accelerations = (
        tuple(by_name[name.replace("[", f"{suffix}[")] for name in names)
        if all(name.replace("[", f"{suffix}[") in by_name for name in names)
        else ()
        for suffix in ("d", "dd")
    )
    rest = [column for column in columns if column not in (*joints, *rates, *accelerations)]
    inferences = [joint_inference(joints, "the only array of joints among the signals")]
    inferences += not_used(rest, "signals next to the joints")
    return Roles(joints, rates, accelerations, inferences=tuple(inferences))
