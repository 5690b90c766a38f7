"""Joints by their names: families of columns that share a name except for a number or an axis.

1. `find_families`: the columns that match patterns of the vocabulary, without words for measured, commanded.
2. `find_joints`: by the names of the robot's joints or of a known arm; by a word and a number; by parts of an
   arm; by a word for positions that all share; by their units. Of several groups those measured are read;
   else it is a question.
3. `named_after`, `family_of`: names and numbers of joints, which their rates share.
4. `proved_by_rates`: families without known words, one of which steps as another one says.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from typing import NamedTuple, NoReturn, TypeAlias

from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.logs.columns import (
    NAME_JOINTS,
    OTHER_ROBOT,
    RECORD,
    Column,
    Kind,
    kind_of,
    listed,
    take,
    which_joints,
)
from urmpipe_pipeline.logs.formats.cells import find_numbers
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.rates import period_of
from urmpipe_pipeline.logs.vocabulary import Patterns, key, vocabulary

MAX_LENGTH = 200  # letters of a name in a family: no recorder writes longer ones

_AXES = {name: k for names in ("xyzw", "abc", ("roll", "pitch", "yaw")) for k, name in enumerate(names)}
_LETTER = re.compile(r"[^\W\d_]")  # without one, the rest of a name is no name: sensor_1 is no joint 1
SLIDES = re.compile(r"[dsl]_?(?P<n>\d+)")  # what a prismatic joint is called next to q1, q2
FIRST_NUMBER, _LAST_NUMBER = re.compile(r"\d+"), re.compile(r"\d+(?=\D*$)")


# 1. Families


@dataclass(slots=True)
class Family:
    """Columns whose names differ only by a number.

    Attributes:
        rank: Index of the pattern that matches them: the lower, the surer.
        name: Their name with # in the number's place, without words for measured and commanded.
        kind: What these words say.
        known: Whether a pattern has their complete name, with these words; else only without them.
        columns: The columns by their number.
        duplicates: Columns that share a number with one of them.
    """

    rank: int
    name: str
    kind: Kind
    known: bool
    columns: dict[int, Column] = field(default_factory=dict)
    duplicates: list[Column] = field(default_factory=list)

    @property
    def is_measured(self) -> bool:
        """Whether a word for measured is in their names; that of a sensor may be of a force."""
        return all(column.marked.measured - {"sensor"} for column in self.columns.values())

    def shares_name(self, other: Family) -> bool:
        """Return whether the names are the same, with or without a sign next to the number."""
        return re.sub("_?#_?", "#", self.name) == re.sub("_?#_?", "#", other.name)

    def ordered(self) -> tuple[Column, ...]:
        """Return the columns in the order of their numbers."""
        return tuple(self.columns[n] for n in sorted(self.columns))


def find_families(columns: Iterable[Column], patterns: Patterns, order: int) -> list[Family]:
    """Return the families of columns that match, the surest first.

    Args:
        columns: Candidates.
        patterns: Patterns with a group n (number), axis (x, y, z, w, roll, ...), k (entry of a vector), or
            i and j (row and column of a matrix).
        order: Derivative in time that their units may not contradict: 0 for positions.
    """
    families: dict[tuple[object, ...], Family] = {}
    for column in columns:
        matched = _match(column, patterns, order)
        if matched is None or column.moves_nothing or (column.unit and column.unit.order != order):
            continue
        number, identity = matched
        shape = tuple(tuple(vocabulary().marked.findall(word)) for word in column.plain.split("_"))
        family = families.setdefault((*identity, shape, None), Family(*identity))
        if number in family.columns:
            family.duplicates.append(column)
            if column.unit_text == family.columns[number].unit_text:
                continue
            family = families.setdefault((*identity, shape, column.unit_text), Family(*identity))
        family.columns.setdefault(number, column)
    valid = [family for (*_, unit), family in families.items() if unit is None or len(family.columns) > 1]
    return sorted(valid, key=lambda family: family.rank)


def _match(column: Column, patterns: Patterns, order: int) -> tuple[int, tuple[int, str, Kind, bool]] | None:
    """Return a column's number and its family: rank, name, kind, and whether it is known."""
    plain, bare, kind = column.plain, column.bare, column.kind
    if order and plain.startswith("d_"):  # the d of a derivative, which also stands for desired
        bare = f"d_{bare}"
        kind = kind_of(column.marked.measured, column.marked.commanded - {"d"})
    if len(plain) > MAX_LENGTH or ("n" in patterns[0].groupindex and column.words & vocabulary().other):
        return None
    known, short = (
        next(
            ((rank, match) for rank, pattern in enumerate(patterns) if (match := pattern.search(text))), None
        )
        for text in (plain, bare)
    )
    best = (short if _LETTER.search(bare) else None) or known
    if best is None:
        return None
    rank, match = best
    groups = match.groupdict()
    if "i" in groups:
        number, start, end = 10 * int(groups["i"]) + int(groups["j"]), match.start("i"), match.end("j")
    else:
        group = next(name for name in ("n", "axis", "k", "wpr") if name in groups)
        text, (start, end) = groups[group], match.span(group)
        number = _AXES[text] if group == "axis" else "wpr".index(text) if group == "wpr" else int(text or 0)
    name = f"{match.string[:start]}#{match.string[end:]}"
    return number, (min(rank, known[0]) if known else rank, name, kind, known is not None)


def prefer_measured(families: Sequence[Family]) -> list[Family]:
    """Return the families to read: of each quantity those measured, else plain; commands if all are.

    A family that is known only without the words for measured needs the same name to stand for another.
    """

    def is_replaced(family: Family) -> bool:
        return any(
            other.kind < family.kind
            and len(other.columns) == len(family.columns)
            and (other.shares_name(family) or (other.known and other.kind == Kind.MEASURED))
            for other in families
        )

    best = [family for family in families if not is_replaced(family)]
    return [family for family in best if family.kind != Kind.COMMANDED] or best


def drop_unknown(families: Sequence[Family], *, lone: bool) -> list[Family]:
    """Return the families that are known or measured, and the others that share a name with one of them.

    Args:
        families: The families.
        lone: Whether all count if none is known.
    """
    known = [
        family
        for family in families
        if family.known
        or family.is_measured
        or any(other is not family and other.shares_name(family) for other in families)
    ]
    return known or (list(families) if lone else [])


def group_by_number(
    columns: Sequence[Column], number: re.Pattern[str] = _LAST_NUMBER
) -> list[tuple[Column, ...]]:
    """Return families of two columns or more of one table whose names differ by a number, their last one."""
    families: dict[tuple[str, int], list[Column]] = {}
    for column in columns:
        stem = number.sub("#", column.key, count=1)
        if stem != column.key:
            families.setdefault((stem, column.table), []).append(column)
    return [tuple(family) for family in families.values() if len(family) > 1]


# 2. Joints


class NamedJoints(NamedTuple):
    """Joint columns, why they are, the numbers or names that their rates share, and these if proved.

    `alternatives` are groups of columns that would have been the joints without these.
    """

    columns: tuple[Column, ...]
    evidence: str = ""
    numbers: tuple[int, ...] = ()
    names: tuple[str, ...] = ()
    rates: tuple[Column, ...] = ()
    alternatives: tuple[tuple[Column, ...], ...] = ()


def find_joints(
    free: Sequence[Column], file: str, robot: Chain | None, *, half_pose: bool, path: bool
) -> NamedJoints:
    """Return the joints among some columns, those that were measured where these are there as well.

    Args:
        free: The columns.
        file: The file, for errors.
        robot: The arm, or None.
        half_pose: Whether the log has a position without an orientation: three angles may be it.
        path: Whether the log has a position, so that it may be one without joints.

    Raises:
        LogError: With the question which they are.
    """
    count = len(robot.coordinates) if robot else None
    families = find_families(
        [c for c in free if not c.words & _moving()], vocabulary().joint["position"], order=0
    )
    known = drop_unknown(families, lone=not path)
    sizes = {len(family.columns) for family in known} - {1}
    families = [family for family in families if family in known or len(family.columns) in sizes]
    joints = (
        _by_order(free, file, robot)
        or _by_number(free, families, file, count)
        or _by_part(free, file, robot)
        or _by_word(free, file, count)
        or _by_unit(free, file, count, half_pose=half_pose)
        or NamedJoints(())
    )
    kinds = {column.kind for column in joints.columns}
    same = same_quantities(joints.columns, free) if len(kinds) > 1 else ()
    further = [
        family.ordered()
        for family in families
        if len(family.columns) == len(joints.columns) and not {*family.ordered()} & {*joints.columns}
    ]
    surer = [group for group in further if kinds and group[0].kind == Kind.MEASURED < min(kinds)]
    if same or surer:
        _ask_groups([joints.columns, *surer, *same], file)
    return joints._replace(alternatives=tuple(dict.fromkeys((*joints.alternatives, *further))))


def _moving() -> frozenset[str]:
    words = vocabulary().joint_terms
    return words["rate"] | words["acceleration"]


def _ask_groups(groups: Sequence[Sequence[Column]], file: str) -> NoReturn:
    fault = f"several groups of joint columns: {'; '.join(map(listed, groups))}"
    raise which_joints(file, fault, groups, "one", by_side=True)


def _by_order(free: Sequence[Column], file: str, robot: Chain | None) -> NamedJoints | None:
    """Return the joints that have the names of the robot's joints, or of an arm that is known."""
    count = len(robot.coordinates) if robot else None
    for names in _orders(robot):
        columns = named_after(free, names, "position")
        arms = _arms(free, names) if columns or count in (None, len(names)) else []
        if columns and robot is None and _lacks_parts(columns, free):
            continue  # a longer arm has these names as well
        if columns and count in (None, len(columns)):
            whose = "the robot's" if robot and names == robot.coordinates else "known"
            further = tuple(arm for arm in arms if not {*arm} & {*columns})
            return NamedJoints(columns, f"{whose} joint names", names=tuple(names), alternatives=further)
        first = [arm for arm in arms if arm[0].kind == min(other[0].kind for other in arms)]
        if count in (None, len(names)) and len(first) > 1:
            _ask_groups(first, file)
    return None


def _orders(robot: Chain | None) -> list[tuple[str, ...]]:
    return [*((tuple(robot.coordinates),) if robot else ()), *vocabulary().orders]


def _arms(columns: Sequence[Column], names: Sequence[str]) -> list[tuple[Column, ...]]:
    """Return the groups of columns that have the names of all joints, and else the same words."""
    arms: dict[frozenset[str] | None, dict[str, Column]] = {}
    for name in names:
        for column in columns:
            if _find_role(column, name) == "position":
                arms.setdefault(_words_around(column, name), {}).setdefault(name, column)
    return [tuple(arm[name] for name in names) for arm in arms.values() if len(arm) == len(names)]


def _by_part(free: Sequence[Column], file: str, robot: Chain | None) -> NamedJoints | None:
    """Return the joints by the parts of an arm in their names, from its base to its wrist."""
    columns = _of_parts(free)
    count = len(robot.coordinates) if robot else None
    if len(columns) < 3 or count not in (None, len(columns)) or some_named(free, robot)[0]:
        return None
    _ask_if_several(columns, file, count)
    parts = [_part(column) for column in columns]
    if parts != sorted(parts) or len({*parts}) < 2:
        return None
    candidates, words = _candidates(free), vocabulary().joint_terms["position"]
    _ask_if_partial(columns, free, of_first_kind(candidates), file, count)
    names = tuple("_".join(w for w in c.bare.split("_") if w not in words) for c in columns)
    same = same_quantities(columns, candidates)
    return NamedJoints(columns, "the parts of an arm in their names", names=names, alternatives=same)


def _of_parts(free: Sequence[Column]) -> tuple[Column, ...]:
    """Return the columns whose names are those of the joints of an arm by its parts: forearm_roll_joint."""
    columns = [column for column in _not_commanded(of_first_kind(_candidates(free))) if _part(column) >= 0]
    are_joints = all("joint" in column.words for column in columns)
    words = vocabulary().joint_terms["position"] | vocabulary().part_motions | {"", "j"}

    def is_joint(column: Column) -> bool:
        remaining = vocabulary().parts[_part(column)].sub("_", column.bare).split("_")
        unknown = {word.strip("0123456789") for word in remaining} - words
        return are_joints or all(map(vocabulary().arms.fullmatch, unknown))

    return tuple(filter(is_joint, columns))


def _lacks_parts(columns: Sequence[Column], free: Sequence[Column]) -> bool:
    """Return whether other columns are named as some, and are of parts of an arm that these lack."""
    further = [c for c in _of_parts(free) if ("joint" in c.words) == ("joint" in columns[0].words)]
    return not {*map(_part, further)} <= {*map(_part, columns)}


def _part(column: Column) -> int:
    """Return the place of the first part of an arm in a name; -1 if there is none."""
    return next((k for k, part in enumerate(vocabulary().parts) if part.search(column.bare)), -1)


def _by_number(
    free: Sequence[Column], families: Sequence[Family], file: str, count: int | None
) -> NamedJoints | None:
    """Return the joints by a word and a number: q1, J1_Angle, actual_q_0, ..."""
    if not families:
        return None
    preferred = prefer_measured(families)
    fitting = [family for family in preferred if len(family.columns) == count] or preferred
    size = len(fitting[0].columns)
    best = [f for f in fitting if f.rank == fitting[0].rank or len(f.columns) == size > 1]
    surer = [family for family in families if family.kind == Kind.MEASURED < best[0].kind]
    if len(best) + len(surer) > 1 and any(len(family.columns) > 1 for family in (*best, *surer)):
        _ask_groups([family.ordered() for family in (*best, *surer)], file)
    if len(best) > 1:  # a plot per joint, each with its number
        columns = tuple(column for family in best for column in family.ordered())
        return NamedJoints(columns, "their names; the order is the file's")
    family = best[0]
    columns = family.ordered()
    alternatives = tuple(f.ordered() for f in families if f is not family and f.shares_name(family))
    passed = {column for group in alternatives for column in group}
    still = [column for column in free if not column.words & _moving() and column not in passed]
    lowest = min(family.columns)
    first = lowest if len(columns) == 1 else min(lowest, 1)
    gaps = [n for n in range(first, first + len(columns)) if n not in family.columns]
    if gaps and not family.duplicates:  # duplicates are another error
        missing = ", ".join(map(str, gaps))
        allowed = "numbers without a gap" if count is None else f"the {count} joints of the robot"
        message = f"found joint columns {listed(columns)} and none with number {missing}, allowed: {allowed}"
        spare = [c for c in still if c not in columns and not c.words & vocabulary().other]
        numbered = {n: [c for c in spare if str(n) in FIRST_NUMBER.findall(c.key)] for n in gaps}
        fillers = {n: group[0] for n, group in numbered.items() if len(group) == 1}
        together = family.columns | fillers
        choices = [take([together[n] for n in sorted(together)])] if len(fillers) == len(gaps) else []
        raise LogError(Finding(message, file=file, hints=(*choices, *cure(len(gaps), spare, count))))
    if larger := _sharing_a_mark(still, columns):
        _ask_if_partial(columns, larger, larger, file, count)
    evidence = "their names, in the order of their numbers"
    return NamedJoints(columns, evidence, tuple(sorted(family.columns)), alternatives=alternatives)


def _by_word(free: Sequence[Column], file: str, count: int | None) -> NamedJoints | None:
    """Return the joints by a word for positions at the same place of their names."""
    candidates = _candidates(free)
    still = _not_commanded(of_first_kind(candidates))
    family = tuple(c for c in _sharing_a_mark(still) if not c.words & {"x", "y", "z"})
    if not family or count not in (None, len(family)):
        return None
    _ask_if_several(family, file, count)
    _ask_if_partial(family, free, still, file, count)
    evidence = "the word position or angle in their names; the order is the file's"
    if numbers := find_numbers([column.key for column in family]):
        family = tuple(column for _, column in sorted(zip(numbers, family, strict=True)))
        evidence = "the word position or angle in their names, in the order of their numbers"
    names = tuple("_".join(w for w in c.key.split("_") if w not in vocabulary().marks) for c in family)
    return NamedJoints(family, evidence, names=names, alternatives=same_quantities(family, candidates))


def _by_unit(free: Sequence[Column], file: str, count: int | None, *, half_pose: bool) -> NamedJoints | None:
    """Return the columns with units of joints, one of which is an angle."""
    candidates = _candidates(free)
    sized = tuple(c for c in of_first_kind(candidates) if c.unit and c.unit.quantity in ("angle", "length"))
    if not any(column.unit and column.unit.quantity == "angle" for column in sized):
        return None
    _ask_if_several(sized, file, count)
    if count not in (None, len(sized)) or (half_pose and count is None and len(sized) == 3):
        return None
    evidence = "their units; the order is the file's"
    return NamedJoints(sized, evidence, alternatives=same_quantities(sized, candidates))


def _candidates(free: Sequence[Column]) -> list[Column]:
    excluded = vocabulary().other | _moving()
    return [
        column for column in free if not column.words & excluded and not (column.unit and column.unit.order)
    ]


def _ask_if_several(columns: Sequence[Column], file: str, count: int | None) -> None:
    """Raise the question which are the joints if each number, or name of one side, is there several times."""
    if count is not None:
        return
    groups = max(group_by_number(columns), group_by_number(columns, FIRST_NUMBER), key=_min_size)
    if len(groups) > 1:
        names = "; ".join(f"{group[0].header} to {group[-1].header}" for group in groups)
        raise which_joints(file, f"several groups of numbered columns: {names}", groups, "one")
    groups = max((_group_by(columns, split) for split in (_side, _first_word, _last_word)), key=_min_size)
    if groups:
        names = "; ".join(f"{group[0].header} to {group[-1].header}" for group in groups)
        raise which_joints(file, f"several groups of the same names: {names}", [*groups, columns], "one")


Split: TypeAlias = Callable[[Column], tuple[Hashable, Hashable]]


def _group_by(columns: Sequence[Column], split: Split) -> list[tuple[Column, ...]]:
    """Return columns by a part of their names, if each part has the same other parts; else nothing."""
    groups: dict[Hashable, dict[Hashable, Column]] = {}
    for column in columns:
        part, rest = split(column)
        groups.setdefault(part, {})[rest] = column
    names = [group.keys() for group in groups.values()]
    if len(names) < 2 or len(names[0]) < 2 or any(rests != names[0] for rests in names):
        return []
    return [tuple(group.values()) for group in groups.values()]


def _side(column: Column) -> tuple[Hashable, Hashable]:
    arms = frozenset(word for word in column.words if vocabulary().arms.fullmatch(word))
    side = arms | column.marked.measured | column.marked.commanded
    return side, column.words - side


def _first_word(column: Column) -> tuple[Hashable, Hashable]:
    word, _, rest = column.plain.partition("_")
    return word, rest


def _last_word(column: Column) -> tuple[Hashable, Hashable]:
    rest, _, word = column.plain.rpartition("_")
    return word, rest


def _min_size(groups: Sequence[Sequence[Column]]) -> int:
    return min(map(len, groups), default=0)


def _ask_if_partial(
    family: Sequence[Column], free: Sequence[Column], still: Sequence[Column], file: str, count: int | None
) -> None:
    """Raise the question which are the joints if other columns may belong to a family.

    Their names have the family's mark at the same place, as that of a tool may, or a word that the family's
    have, or one of a limb.
    """
    limbs = frozenset(word for order in vocabulary().orders for name in order for word in name.split("_"))
    words = frozenset(word for column in family for word in column.words) | limbs
    moving = _moving() | vocabulary().grippers
    columns = _not_commanded(of_first_kind([column for column in free if not column.words & moving]))
    same = _sharing_a_mark(columns, family)
    further = [c for c in free if c not in family and (c in same or (c in still and c.words & words))]
    if further and len(family) != count:
        together = [column for column in free if column in family or column in further]
        fault = f"{listed(family)}, whose names say that they are positions, next to {listed(further)}"
        raise which_joints(file, fault, [together, family])


def of_first_kind(columns: Sequence[Column]) -> list[Column]:
    """Return of columns whose names differ only by words for measured and commanded those to read first."""
    first: dict[str, Kind] = {}
    for column in columns:
        first[column.quantity] = min(column.kind, first.get(column.quantity, column.kind))
    return [column for column in columns if column.kind == first[column.quantity]]


def _not_commanded(columns: Sequence[Column]) -> list[Column]:
    """Return the columns without those that hold commands, unless all do."""
    return [column for column in columns if column.kind != Kind.COMMANDED] or list(columns)


def same_quantities(chosen: Sequence[Column], columns: Sequence[Column]) -> tuple[tuple[Column, ...], ...]:
    """Return the other columns with the names of those that are chosen, by their words."""
    names, groups = {column.quantity for column in chosen}, dict[frozenset[str], list[Column]]()
    for column in columns:
        if column not in chosen and column.quantity in names:
            groups.setdefault(column.marked.measured | column.marked.commanded, []).append(column)
    return tuple(tuple(group) for group in groups.values())


def _sharing_a_mark(columns: Sequence[Column], required: Sequence[Column] = ()) -> tuple[Column, ...]:
    """Return the most columns whose names have a word for positions at the same place, from front or back.

    In wrist_angle_pos and elbow_pos that is the last one. They include all columns that are required.
    """
    by_place: dict[tuple[str, int], list[Column]] = {}
    for column in columns:
        words = column.key.split("_")
        for place, word in enumerate(words):
            if word in vocabulary().marks:
                for at in (place, place - len(words)):
                    by_place.setdefault((word, at), []).append(column)
    complete = [group for group in by_place.values() if {*required} <= {*group}]
    return tuple(sorted(complete, key=len)[-1]) if complete else ()


def cure(missing: int, spare: Sequence[Column], count: int | None) -> tuple[Hint, Hint]:
    """Return what helps where joints are missing: naming them only where columns remain for a robot's."""
    return RECORD, OTHER_ROBOT if count is not None and len(spare) < missing else NAME_JOINTS


# 3. Names and numbers


def named_after(columns: Sequence[Column], names: Sequence[str], role: str) -> tuple[Column, ...]:
    """Return the columns that carry the names of joints, one each in their order, or nothing.

    Args:
        columns: Candidates.
        names: Names of the joints.
        role: position, rate or acceleration: decided by the words next to the joint's name.
    """
    result = []
    for name in names:
        matches = [column for column in columns if _find_role(column, name) == role]
        matches = [c for c in matches if c.kind == min(other.kind for other in matches)]
        words = frozenset(key(name).split("_"))
        exact = [c for c in matches if c.words - words <= vocabulary().joint_terms["position"]]
        matches = exact if len(exact) == 1 else matches
        if len(matches) != 1:
            return ()
        result.append(matches[0])
    return tuple(result) if len(set(result)) == len(result) else ()


def _find_role(column: Column, name: str) -> str | None:
    """Return the role of a column by the words next to the name of a joint in its name; None without it."""
    around, words = _words_around(column, name), vocabulary().joint_terms
    if around is None or around & vocabulary().other or column.moves_nothing:
        return None
    order = column.unit.order if column.unit else 0
    for role, its_order in (("acceleration", 2), ("rate", 1)):
        if around & words[role] or order == its_order:
            return role
    return "position"


def _words_around(column: Column, name: str) -> frozenset[str] | None:
    """Return the other words of a column with the name of a joint, which they may interrupt; else None."""
    for text in (column.marked.key, column.bare):
        before, inner, after = f"_{text}_".partition(f"_{key(name)}_")
        if inner:
            marks = column.marked.measured | column.marked.commanded
            return frozenset(f"{before}_{after}".split("_")) - {""} | marks
    return None


def some_named(numeric: Sequence[Column], robot: Chain | None) -> tuple[tuple[Column, ...], list[str]]:
    """Return the columns of most joints with known names, and the names that have none; nothing of fewer."""
    for names in _orders(robot):
        by_name = {name: named_after(numeric, [name], "position") for name in names}
        columns = tuple(dict.fromkeys(column for group in by_name.values() for column in group))
        missing = [name for name, group in by_name.items() if not group]
        if len(names) / 2 < len(columns) == len(names) - len(missing) < len(names):
            return columns, missing
    return (), []


def family_of(joints: Sequence[Column]) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Return the numbers, or else the names, that chosen joints share with their rates, in their order."""
    for family in find_families(joints, vocabulary().joint["position"], order=0):
        if len(family.columns) == len(joints):
            number_of = {column: n for n, column in family.columns.items()}
            return tuple(number_of[column] for column in joints), ()
    for names in vocabulary().orders:
        of_joint = [[name for name in names if _find_role(c, name) == "position"] for c in joints]
        if all(len(matching) == 1 for matching in of_joint):
            return (), tuple(matching[0] for matching in of_joint)
    return (), ()


# 4. Proof


def proved_by_rates(families: Sequence[tuple[Column, ...]], tables: Sequence[LogTable]) -> NamedJoints:
    """Return the family whose rates are another one, by their numbers; nothing unless there is one."""
    pairs = []
    for joints, rates in permutations(families, 2):
        values = [
            tables[group[0].table].values([column.index for column in group]) for group in (joints, rates)
        ]
        if 2 < len(joints) == len(rates) and len(values[0]) == len(values[1]) and period_of(*values):
            pairs.append((joints, rates))
    first = [pair for pair in pairs if pair[0] not in [rates for _, rates in pairs]]
    if len(first) != 1:
        return NamedJoints(())
    joints, rates = first[0]
    return NamedJoints(joints, f"{listed(rates)} are their rates, by steps and rates", rates=rates)
