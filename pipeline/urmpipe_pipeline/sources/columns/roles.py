"""What each column is: joints and their order, recorded rates, recorded tool centre point."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from urmpipe_models.chains.chain import Chain
from urmpipe_models.errors import Finding, LogError
from urmpipe_models.messages import Hint
from urmpipe_models.orientation import RotationForm
from urmpipe_pipeline.joint_log import Inference, LogWarning
from urmpipe_pipeline.sources.cells.cell import grouped_number
from urmpipe_pipeline.sources.columns.blocks import MOST_JOINTS
from urmpipe_pipeline.sources.columns.columns import Column, find_column, listed
from urmpipe_pipeline.sources.columns.families import families, measured
from urmpipe_pipeline.sources.columns.pose import Pose, chosen_pose, find_pose, with_form
from urmpipe_pipeline.sources.columns.questions import NAME_JOINTS, by_side, which_joints
from urmpipe_pipeline.sources.columns.tcp_like import about_odd_rows, about_tcp
from urmpipe_pipeline.sources.options import ReadOptions
from urmpipe_pipeline.sources.tables.sniff import Layout
from urmpipe_pipeline.sources.vocabulary import key, vocabulary

RECORD = Hint("", does="record the missing one")
OTHER_ROBOT = Hint("robot", None, "gives another arm")


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
    layouts: Sequence[Layout],
    options: ReadOptions,
    robot: Chain | None,
    *,
    path: bool = False,
    written: tuple[Column, ...] = (),
) -> Roles:
    """Return the roles of the columns of a table with a header.

    The joints are, in this order: the columns that the user names; those named like the robot's
    joints; those with a word for a joint and its number; those with a unit of angle; as many
    columns as the robot has joints, if no more are left. Without any, x, y, z make a path.

    Args:
        columns: The columns, without the clock.
        layouts: The tables.
        options: What the user says: joint columns, position, orientation.
        robot: The arm, or None.
        path: It is a path, as the user says: joints are not looked for.
        written: The joints of a log that urmpipe wrote.

    Raises:
        LogError: If the joints cannot be told, or are too few or too many for the robot.
    """
    file = layouts[0].file
    numeric = [column for column in columns if (path or not column.text) and not column.counts_rows]
    if options.joints or written:
        joints = written or tuple(find_column(columns, text, parameter="joints") for text in options.joints)
        evidence = "urmpipe wrote them" if written else "given as an option"
        found = _Joints(joints, evidence, *_family_of(joints))
        pose = chosen_pose(columns, options) or find_pose([c for c in numeric if c not in joints], layouts)
    else:
        own = () if path else _called_as_joints(numeric, robot)
        pose = chosen_pose(columns, options) or find_pose(
            [c for c in numeric if c not in own], layouts, form=options.rotation if path else None, some=path
        )
        free = [column for column in numeric if column not in (*pose.position, *pose.rotation)]
        half = bool(pose.position and not pose.rotation)
        found = _Joints(()) if path else _find_joints(free, file, robot, half_pose=half)
    pose = with_form(pose, options.rotation)
    if not found.columns:
        return _path(columns, numeric, pose, layouts, robot, path=path)
    check_count(found.columns, file, robot)
    rates = _derivative("rate", numeric, found)
    accelerations = _derivative("acceleration", numeric, found)
    roles = Roles(
        found.columns, rates, accelerations, pose.position, pose.rotation, pose.forms, measured=pose.measured
    )
    said = [joint_inference(found.columns, found.evidence)]
    for what, group in (("rates", rates), ("accelerations", accelerations)):
        if group:
            said.append(Inference(what, ", ".join(column.name for column in group), "their names"))
    return _with_rest(roles, [*said, *about_pose(pose)], numeric, layouts)


@dataclass(frozen=True, slots=True)
class _Joints:
    """Joint columns, why they are, and the names and numbers that their rates share."""

    columns: tuple[Column, ...]
    evidence: str = ""
    numbers: tuple[int, ...] = ()
    names: tuple[str, ...] = ()


def _family_of(joints: Sequence[Column]) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Return the numbers, or else the names, that chosen joints share with their rates, in their order."""
    for family in families(joints, vocabulary().joint["position"], order=0):
        if len(family.columns) == len(joints):
            number_of = {column: n for n, column in family.columns.items()}
            return tuple(number_of[column] for column in joints), ()
    for names in vocabulary().orders:
        of_joint = [[name for name in names if _role_beside(c, name) == "position"] for c in joints]
        if all(len(matching) == 1 for matching in of_joint):
            return (), tuple(matching[0] for matching in of_joint)
    return (), ()


def _called_as_joints(numeric: Sequence[Column], robot: Chain | None) -> tuple[Column, ...]:
    """Return the columns named exactly as the robot's joints: x, y, z of a gantry are no position."""
    if robot is None:
        return ()
    found = named_after(numeric, robot.coordinates, "position")
    names = [key(name) for name in robot.coordinates]
    return found if [column.key for column in found] == names else ()


def _find_joints(free: Sequence[Column], file: str, robot: Chain | None, *, half_pose: bool) -> _Joints:
    """Return the joints among some columns; beside half a pose, three angles may be its other half."""
    count = len(robot.coordinates) if robot else None
    orders = [*((robot.coordinates,) if robot else ()), *vocabulary().orders]
    for names in orders:
        by_name = named_after(free, names, "position")
        if by_name and count in (None, len(by_name)):
            whose = "the robot's" if robot and names == robot.coordinates else "known"
            return _Joints(by_name, f"{whose} joint names", names=tuple(names))
    return _numbered(free, file, count) or _without_number(free, file, count, half_pose=half_pose)


def _without_number(free: Sequence[Column], file: str, count: int | None, *, half_pose: bool) -> _Joints:
    """Return joints without numbers: by a word that they share, by their units, or as all that is left."""
    words = vocabulary()
    about_else = words.other | words.joint_words["rate"] | words.joint_words["acceleration"]
    still = measured([c for c in free if not c.words & about_else and not (c.unit and c.unit.order)])
    family = _sharing_a_mark(still)
    if family and count in (None, len(family)):
        _refuse_half(family, still, file, count)
        names = tuple("_".join(w for w in c.key.split("_") if w not in words.marks) for c in family)
        evidence = "the word position or angle in their names; the order is the file's"
        return _Joints(family, evidence, names=names)
    sized = tuple(c for c in still if c.unit and c.unit.quantity in ("angle", "length"))
    turning = any(c.unit and c.unit.quantity == "angle" for c in sized)
    if turning and count in (None, len(sized)) and not (half_pose and count is None and len(sized) == 3):
        return _Joints(sized, "their units; the order is the file's")
    if count is not None and len(still) == count:
        return _Joints(tuple(still), f"the only {count} columns left; the order is the file's")
    return _Joints(())


def _sharing_a_mark(still: Sequence[Column]) -> tuple[Column, ...]:
    """Return the most columns whose names have a word for positions at the same place, from front or back.

    In wrist_angle_pos and elbow_pos that is the last one.
    """
    alike: dict[tuple[str, int], list[Column]] = {}
    for column in still:
        words = column.key.split("_")
        for place, word in enumerate(words):
            if word in vocabulary().marks:
                for key_of in ((word, place), (word, place - len(words))):
                    alike.setdefault(key_of, []).append(column)
    return tuple(max(alike.values(), key=len, default=()))


def _refuse_half(family: Sequence[Column], still: Sequence[Column], file: str, count: int | None) -> None:
    """Raise a `LogError` where other columns may belong to a family of joints: a family is taken whole.

    Their names have a mark as well, a word that the family's have, or one of a limb.
    """
    words = vocabulary()
    limbs = frozenset(word for order in words.orders for name in order for word in name.split("_"))
    own = frozenset(word for column in family for word in column.words) | limbs
    others = [column for column in still if column not in family and column.words & own]
    if not others or len(family) == count:
        return
    whole = [column for column in still if column in family or column in others]
    found = f"{listed(family)}, whose names say that they are positions, beside {listed(others)}"
    raise which_joints(file, found, [whole, family])


def named_after(columns: Sequence[Column], names: Sequence[str], role: str) -> tuple[Column, ...]:
    """Return the columns that carry the names of joints, one each in their order, or nothing.

    Args:
        columns: Candidates.
        names: Names of the joints.
        role: position, rate or acceleration: decided by the words beside the joint's name.
    """
    result = []
    for name in names:
        matches = [column for column in columns if _role_beside(column, name) == role]
        matches, own = measured(matches), frozenset(key(name).split("_"))
        exact = [c for c in matches if c.words - own <= vocabulary().joint_words["position"]]
        matches = exact if len(exact) == 1 else matches
        if len(matches) != 1:
            return ()
        result.append(matches[0])
    return tuple(result) if len(set(result)) == len(result) else ()


def _role_beside(column: Column, name: str) -> str | None:
    """Return what a column says about a joint: by the words beside the joint's name in its own."""
    padded, inner = f"_{column.key}_", f"_{key(name)}_"
    if inner not in padded:
        return None
    beside = frozenset(padded.replace(inner, "_", 1).strip("_").split("_")) - {""}
    words = vocabulary().joint_words
    if beside & vocabulary().other:
        return None
    order = column.unit.order if column.unit else 0
    for role, its_order in (("acceleration", 2), ("rate", 1)):
        if beside & words[role] or order == its_order:
            return role
    return "position"


def _numbered(free: Sequence[Column], file: str, count: int | None) -> _Joints | None:
    """Return the joints by a word and a number: q1, J1_Angle, actual_q_0, ..."""
    words = vocabulary()
    moving = words.joint_words["rate"] | words.joint_words["acceleration"]
    still = [column for column in free if not column.words & moving]
    found = families(still, words.joint["position"], order=0)
    if not found:
        return None
    fitting = [family for family in found if len(family.columns) == count] or found
    best = [family for family in fitting if family.rank == min(f.rank for f in fitting)]
    if len(best) > 1 and not all(len(family.columns) == 1 for family in best):
        groups = [family.ordered() for family in best]
        found_all = f"several groups of joint columns: {'; '.join(map(listed, groups))}"
        raise which_joints(file, found_all, groups, "one")
    if len(best) > 1:  # one plot a joint, each with a number of its own
        columns = tuple(column for family in best for column in family.ordered())
        return _Joints(columns, "their names; the order is the file's")
    family = best[0]
    lowest = min(family.columns)
    first = lowest if len(family.columns) == 1 else min(lowest, 1)
    gaps = [n for n in range(first, first + len(family.columns)) if n not in family.columns]
    if gaps and not family.twins:  # a number that is there twice is told as such
        missing = ", ".join(map(str, gaps))
        said = f"found joint columns {listed(family.ordered())} and none with number {missing}"
        allowed = "numbers without a gap" if count is None else f"the {count} joints of the robot"
        spare = [c for c in still if c not in family.columns.values() and not c.words & words.other]
        hints = _cure(len(gaps), spare, count)
        raise LogError(Finding(f"{said}, allowed: {allowed}", file=file, hints=hints))
    evidence = "their names, in the order of their numbers"
    return _Joints(family.ordered(), evidence, tuple(sorted(family.columns)))


def _cure(missing: int, spare: Sequence[Column], count: int | None) -> tuple[Hint, Hint]:
    """Return what helps where joints are missing: naming them only where columns are left for a robot's."""
    return RECORD, OTHER_ROBOT if count is not None and len(spare) < missing else NAME_JOINTS


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
    numbers = () if all(column.header.isdigit() for column in joints) else _family_of(joints)[0]
    first = min((1, *numbers))
    missing = [n for n in range(first, first + len(robot.coordinates)) if n not in numbers]
    none = f" and none with number {', '.join(map(str, missing))}" if numbers and not more else ""
    message = f"found {len(joints)} joint columns ({listed(joints)}){none}, {need}"
    hints = (NAME_JOINTS,) if more else (Hint("", does="record every joint"), OTHER_ROBOT)
    raise LogError(Finding(message, file=file, hints=hints))


def _derivative(role: str, numeric: Sequence[Column], joints: _Joints) -> tuple[Column, ...]:
    """Return the recorded rates or accelerations of exactly these joints, or nothing."""
    if joints.names:
        return named_after(numeric, joints.names, role)
    order = ("position", "rate", "acceleration").index(role)
    asked = any(column.words & vocabulary().commanded for column in joints.columns)
    matching = [
        family
        for family in families(numeric, vocabulary().joint[role], order=order)
        if set(family.columns) == set(joints.numbers) and family.commanded == asked
    ]
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
        hints = (Hint("log_map", None, f"with tcp.{where} in it"),)
        if names:
            said.append(Inference(f"{whose} {what}", ", ".join(names), pose.evidence, "", names, hints))
    return said


def _path(
    columns: Sequence[Column],
    numeric: Sequence[Column],
    pose: Pose,
    layouts: Sequence[Layout],
    robot: Chain | None,
    *,
    path: bool,
) -> Roles:
    """Return the roles of a path; raise if it is none either."""
    file = layouts[0].file
    pose = pose if pose.position else find_pose(numeric, layouts, file)
    if pose.position:
        names = ", ".join(column.name for column in pose.position)
        said = [path_inference(names, "x, y, z and no joint columns"), *about_pose(pose)[1:]]
        roles = Roles((), (), (), pose.position, pose.rotation, pose.forms, measured=pose.measured)
        return _with_rest(roles, said, numeric, layouts)
    _refuse_thousands(layouts, file)
    if path:
        hints = (
            Hint("", does="name them so in the header"),
            Hint("log_map", None, 'says which they are: [tcp] position = ["A", "B", "C"]'),
        )
        message = f"found no position in {listed(columns)}, allowed: x, y, z"
        raise LogError(Finding(message, file=file, hints=hints))
    need = (
        f"{len(robot.coordinates)} for robot {robot.name}" if robot else "such as q1, q2, ... or J1, J2, ..."
    )
    found, missing = _some_named(numeric, robot)
    if found:
        spare = [column for column in numeric if column not in found]
        hints = _cure(len(missing), spare, len(robot.coordinates) if robot else None)
        lacking = f"found joint columns {listed(found)} and none for {', '.join(missing)}, allowed: {need}"
        raise LogError(Finding(lacking, file=file, hints=hints))
    raise which_joints(file, f"no joint columns in {listed(columns)}", _may_be(numeric, robot), need)


def _may_be(numeric: Sequence[Column], robot: Chain | None) -> list[Sequence[Column]]:
    """Return the columns that may be joints whatever their names, if they are as many as an arm has."""
    about_else = vocabulary().other | vocabulary().outside
    others = [column for column in numeric if not column.words & about_else]
    fits = {len(robot.coordinates)} if robot else range(1, MOST_JOINTS + 1)
    return [group for group in by_side(others) if len(group) in fits]


def _some_named(numeric: Sequence[Column], robot: Chain | None) -> tuple[tuple[Column, ...], list[str]]:
    """Return the columns of most joints with known names, and the names that have none; nothing of fewer."""
    for names in [*((robot.coordinates,) if robot else ()), *vocabulary().orders]:
        own = {name: named_after(numeric, [name], "position") for name in names}
        found = tuple(dict.fromkeys(column for columns in own.values() for column in columns))
        missing = [name for name, columns in own.items() if not columns]
        if len(names) / 2 < len(found) == len(names) - len(missing) < len(names):
            return found, missing
    return (), []


def _refuse_thousands(layouts: Sequence[Layout], file: str) -> None:
    """Raise a `LogError` where numbers have signs between their thousands: their columns count as text."""
    cells = (cell for layout in layouts for row in layout.sample for cell in _as_written(row, layout))
    found = next((one for cell in cells if (one := grouped_number(cell))), None)
    if found:
        between = min(",.", key=found.index)
        allowed = f"{found.replace(between, '')}; export the table without signs between thousands"
        raise LogError(Finding(f"found {found!r}, allowed: {allowed}", file=file))


def _as_written(row: Sequence[str], layout: Layout) -> Iterator[str]:
    """Yield the cells of a row, and those of its line if it was parted at the commas within its numbers."""
    yield from row
    line = layout.delimiter.join(row)
    yield from (cell for sign in ";\t|" if sign in line for cell in line.split(sign))


def _with_rest(
    roles: Roles, said: list[Inference], numeric: Sequence[Column], layouts: Sequence[Layout]
) -> Roles:
    rest = [column for column in numeric if column not in roles.columns]
    said += not_used(rest, "no role is known for them")
    warnings = about_odd_rows(rest, layouts) or ([] if roles.position else about_tcp(rest))
    return replace(roles, inferences=tuple(said), warnings=tuple(warnings))


def not_used(rest: Sequence[Column], why: str) -> list[Inference]:
    """Say which columns are not used, if any."""
    return [Inference("columns not used", listed(rest, most=8), why)] if rest else []
