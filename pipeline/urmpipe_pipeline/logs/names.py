"""Families of columns: those that share a name but for a number or an axis.

Joints by their names: those of the arm, of known arms, with numbers, or in families that share a word.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations
from typing import NoReturn

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
    which_joints,
)
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.rates import period_of
from urmpipe_pipeline.logs.vocabulary import Patterns, key, vocabulary

_AXES = {name: k for names in ("xyzw", "abc", ("roll", "pitch", "yaw")) for k, name in enumerate(names)}

_BESIDE = re.compile(r"_?#_?")
_LETTER = re.compile(r"[^\W\d_]")
"""Without one, what is left of a name is no name: sensor_1 is no joint 1."""

LONGEST = 200
"""Letters of a name that may be one of a family: no recorder writes longer ones."""


@dataclass(slots=True)
class Family:
    """Columns whose names differ only by a number.

    Attributes:
        rank: Index of the pattern that found them: the lower, the surer.
        name: Their name with # in the number's place, without words for measured and commanded.
        kind: What these words say.
        known: Whether a pattern has their whole name, with these words; else only without them.
        columns: The columns by their number.
        twins: Columns that share a number with one of them.
    """

    rank: int
    name: str
    kind: Kind
    known: bool
    columns: dict[int, Column] = field(default_factory=dict)
    twins: list[Column] = field(default_factory=list)

    @property
    def is_measured(self) -> bool:
        """Whether a word for measured is in their names; that of a sensor may be of a force."""
        return all(column.marked.measured - {"sensor"} for column in self.columns.values())

    def shares_name(self, other: Family) -> bool:
        """Return whether the names are the same, with or without a sign beside the number."""
        one, two = (_BESIDE.sub("#", family.name) for family in (self, other))
        return one == two

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
    found: dict[tuple[object, ...], Family] = {}
    for column in columns:
        matched = _match(column, patterns, order)
        if matched is None or column.moves_nothing or (column.unit and column.unit.order != order):
            continue
        number, identity = matched
        shape = tuple(tuple(vocabulary().marked.findall(word)) for word in column.plain.split("_"))
        family = found.setdefault((*identity, shape, None), Family(*identity))
        if number in family.columns:
            family.twins.append(column)
            if column.unit_text == family.columns[number].unit_text:
                continue
            family = found.setdefault((*identity, shape, column.unit_text), Family(*identity))
        family.columns.setdefault(number, column)
    whole = [family for (*_, unit), family in found.items() if unit is None or len(family.columns) > 1]
    return sorted(whole, key=lambda family: family.rank)


def prefer_measured(found: Sequence[Family]) -> list[Family]:
    """Return the families to read: of each quantity those measured, else plain; commands if all are."""
    best = [family for family in found if not any(_stands_for(other, family) for other in found)]
    return [family for family in best if family.kind != Kind.COMMANDED] or best


def _stands_for(other: Family, family: Family) -> bool:
    """Return whether another family is the same quantity, of a kind that is read first.

    One that is known only without its words has to have the same name.
    """
    same = other.shares_name(family) or (other.known and other.kind == Kind.MEASURED)
    return other.kind < family.kind and len(other.columns) == len(family.columns) and same


def drop_unknown(found: Sequence[Family], *, lone: bool) -> list[Family]:
    """Return the families that are known or measured, and the others that share a name with one of them.

    Args:
        found: The families.
        lone: Whether all count if none is known.
    """
    kept = [
        f for f in found if f.known or f.is_measured or any(o is not f and o.shares_name(f) for o in found)
    ]
    return kept or (list(found) if lone else [])


def _match(column: Column, patterns: Patterns, order: int) -> tuple[int, tuple[int, str, Kind, bool]] | None:
    """Return a column's number and its family: rank, name, kind, and whether it is known."""
    plain, bare, kind = column.plain, column.bare, column.kind
    if order and plain.startswith("d_"):  # the d of a derivative, which also stands for desired
        bare = f"d_{bare}"
        kind = kind_of(column.marked.measured, column.marked.commanded - {"d"})
    if len(plain) > LONGEST or ("n" in patterns[0].groupindex and column.words & vocabulary().other):
        return None
    known = _first(plain, patterns)
    found = (_first(bare, patterns) if _LETTER.search(bare) else None) or known
    if found is None:
        return None
    rank, match = found
    number, start, end = _number(match)
    name = f"{match.string[:start]}#{match.string[end:]}"
    return number, (min(rank, known[0]) if known else rank, name, kind, known is not None)


def _first(text: str, patterns: Patterns) -> tuple[int, re.Match[str]] | None:
    for rank, pattern in enumerate(patterns):
        match = pattern.search(text)
        if match:
            return rank, match
    return None


def _number(match: re.Match[str]) -> tuple[int, int, int]:
    """Return the number that a match tells, and where it stands."""
    groups = match.groupdict()
    if "i" in groups:
        return 10 * int(groups["i"]) + int(groups["j"]), match.start("i"), match.end("j")
    group = next(name for name in ("n", "axis", "k", "wpr") if name in groups)
    text = groups[group]
    number = _AXES[text] if group == "axis" else "wpr".index(text) if group == "wpr" else int(text or 0)
    return number, match.start(group), match.end(group)


_LAST_NUMBER = re.compile(r"\d+(?=\D*$)")


@dataclass(frozen=True, slots=True)
class NamedJoints:
    """Joint columns, why they are, the names and numbers that their rates share, and these if proved.

    `alternatives` are groups of columns that would have been the joints without these.
    """

    columns: tuple[Column, ...]
    evidence: str = ""
    numbers: tuple[int, ...] = ()
    names: tuple[str, ...] = ()
    rates: tuple[Column, ...] = ()
    alternatives: tuple[tuple[Column, ...], ...] = ()


def numbered_alike(columns: Sequence[Column]) -> list[tuple[Column, ...]]:
    """Return families of two columns or more of one table whose names differ by their last number."""
    alike: dict[tuple[str, int], list[Column]] = {}
    for column in columns:
        stem = _LAST_NUMBER.sub("#", column.key)
        if stem != column.key:
            alike.setdefault((stem, column.table), []).append(column)
    return [tuple(family) for family in alike.values() if len(family) > 1]


def proved_by_rates(families: Sequence[tuple[Column, ...]], whole: Sequence[LogTable]) -> NamedJoints:
    """Return the family whose rates are another one, by their numbers; nothing unless there is one."""
    pairs = []
    for joints, rates in permutations(families, 2):
        values = [whole[some[0].table].values([column.index for column in some]) for some in (joints, rates)]
        if 2 < len(joints) == len(rates) and len(values[0]) == len(values[1]) and period_of(*values):
            pairs.append((joints, rates))
    first = [pair for pair in pairs if pair[0] not in [rates for _, rates in pairs]]
    if len(first) != 1:
        return NamedJoints(())
    joints, rates = first[0]
    return NamedJoints(joints, f"{listed(rates)} are their rates, by steps and rates", rates=rates)


def family_of(joints: Sequence[Column]) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Return the numbers, or else the names, that chosen joints share with their rates, in their order."""
    for family in find_families(joints, vocabulary().joint["position"], order=0):
        if len(family.columns) == len(joints):
            number_of = {column: n for n, column in family.columns.items()}
            return tuple(number_of[column] for column in joints), ()
    for names in vocabulary().orders:
        of_joint = [[name for name in names if _role_beside(c, name) == "position"] for c in joints]
        if all(len(matching) == 1 for matching in of_joint):
            return (), tuple(matching[0] for matching in of_joint)
    return (), ()


def called_as_joints(numeric: Sequence[Column], robot: Chain | None) -> tuple[Column, ...]:
    """Return the columns named exactly as the robot's joints: x, y, z of a gantry are no position."""
    if robot is None:
        return ()
    found = named_after(numeric, robot.coordinates, "position")
    names = [key(name) for name in robot.coordinates]
    return found if all(name in (c.key, c.bare) for name, c in zip(names, found, strict=False)) else ()


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
    numbered = _find_numbered(free, lone=not path)
    found = _find_joints(free, numbered, file, robot, half_pose=half_pose)
    kinds = {column.kind for column in found.columns}
    same = same_quantities(found.columns, free) if len(kinds) > 1 else ()
    alike = [
        family.ordered()
        for family in numbered
        if len(family.columns) == len(found.columns) and not {*family.ordered()} & {*found.columns}
    ]
    surer = [group for group in alike if kinds and group[0].kind == Kind.MEASURED < min(kinds)]
    if same or surer:
        _refuse_groups([found.columns, *surer, *same], file)
    return replace(found, alternatives=tuple(dict.fromkeys((*found.alternatives, *alike))))


def _find_numbered(free: Sequence[Column], *, lone: bool) -> list[Family]:
    """Return the families of joints by numbers; if no whole name is known, only if they are alone."""
    words = vocabulary()
    moving = words.joint_words["rate"] | words.joint_words["acceleration"]
    found = find_families([c for c in free if not c.words & moving], words.joint["position"], order=0)
    kept = drop_unknown(found, lone=lone)
    sizes = {len(family.columns) for family in kept} - {1}
    return [family for family in found if family in kept or len(family.columns) in sizes]


def _find_joints(
    free: Sequence[Column], numbered: Sequence[Family], file: str, robot: Chain | None, *, half_pose: bool
) -> NamedJoints:
    """Return the joints by the names of an arm's joints, by numbers, or by what else their names share."""
    count = len(robot.coordinates) if robot else None
    orders = [*((robot.coordinates,) if robot else ()), *vocabulary().orders]
    for names in orders:
        by_name = named_after(free, names, "position")
        if by_name and count in (None, len(by_name)):
            whose = "the robot's" if robot and names == robot.coordinates else "known"
            alternatives = tuple(arm for arm in _arms(free, names) if not {*arm} & {*by_name})
            return NamedJoints(by_name, f"{whose} joint names", names=tuple(names), alternatives=alternatives)
        if count in (None, len(names)):
            _refuse_several_arms(free, names, file)
    by_number = _numbered(free, numbered, file, count)
    return by_number or _without_number(free, file, count, half_pose=half_pose)


def _without_number(free: Sequence[Column], file: str, count: int | None, *, half_pose: bool) -> NamedJoints:
    """Return joints without numbers: by a word that they share, by their units, or as all that is left."""
    words = vocabulary()
    about_else = words.other | words.joint_words["rate"] | words.joint_words["acceleration"]
    every = [c for c in free if not c.words & about_else and not (c.unit and c.unit.order)]
    still = of_first_kind(every)
    family = _sharing_a_mark(_not_commanded(still))
    if family and count in (None, len(family)):
        _refuse_half(family, free, _not_commanded(still), file, count)
        names = tuple("_".join(w for w in c.key.split("_") if w not in words.marks) for c in family)
        evidence = "the word position or angle in their names; the order is the file's"
        return NamedJoints(family, evidence, names=names, alternatives=same_quantities(family, every))
    sized = tuple(c for c in still if c.unit and c.unit.quantity in ("angle", "length"))
    turning = any(c.unit and c.unit.quantity == "angle" for c in sized)
    several = [family for family in numbered_alike(sized) if len(family) > 1]
    if turning and count is None and len(several) > 1:  # each number several times: no single arm
        shown = "; ".join(f"{family[0].header} to {family[-1].header}" for family in several)
        raise which_joints(file, f"several groups of numbered columns: {shown}", several, "one")
    if turning and count in (None, len(sized)) and not (half_pose and count is None and len(sized) == 3):
        return NamedJoints(
            sized, "their units; the order is the file's", alternatives=same_quantities(sized, every)
        )
    return NamedJoints(())


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


def _sharing_a_mark(still: Sequence[Column], having: Sequence[Column] = ()) -> tuple[Column, ...]:
    """Return the most columns whose names have a word for positions at the same place, from front or back.

    In wrist_angle_pos and elbow_pos that is the last one. They hold all columns that they are to have.
    """
    alike: dict[tuple[str, int], list[Column]] = {}
    for column in still:
        words = column.key.split("_")
        for place, word in enumerate(words):
            if word in vocabulary().marks:
                for key_of in ((word, place), (word, place - len(words))):
                    alike.setdefault(key_of, []).append(column)
    whole = [some for some in alike.values() if {*having} <= {*some}]
    return tuple(sorted(whole, key=len)[-1]) if whole else ()


def _refuse_half(
    family: Sequence[Column], free: Sequence[Column], still: Sequence[Column], file: str, count: int | None
) -> None:
    """Raise a `LogError` where other columns may belong to a family of joints: a family is taken whole.

    Their names have the family's mark at the same place, as that of a tool may, or a word that the family's
    have, or one of a limb.
    """
    words = vocabulary()
    limbs = frozenset(word for order in words.orders for name in order for word in name.split("_"))
    own = frozenset(word for column in family for word in column.words) | limbs
    moving = words.joint_words["rate"] | words.joint_words["acceleration"] | words.grippers
    columns = _not_commanded(of_first_kind([column for column in free if not column.words & moving]))
    same = _sharing_a_mark(columns, family)
    others = [c for c in free if c not in family and (c in same or (c in still and c.words & own))]
    if not others or len(family) == count:
        return
    whole = [column for column in free if column in family or column in others]
    found = f"{listed(family)}, whose names say that they are positions, beside {listed(others)}"
    raise which_joints(file, found, [whole, family])


def _refuse_several_arms(free: Sequence[Column], names: Sequence[str], file: str) -> None:
    """Raise a `LogError` where columns have the names of all joints more than once, as those of two arms."""
    arms = _arms(free, names)
    first = [arm for arm in arms if arm[0].kind == min(other[0].kind for other in arms)]
    if len(first) > 1:
        _refuse_groups(first, file)


def _arms(columns: Sequence[Column], names: Sequence[str]) -> list[tuple[Column, ...]]:
    """Return the groups of columns that have the names of all joints, and else the same words."""
    arms: dict[frozenset[str] | None, dict[str, Column]] = {}
    for name in names:
        for column in columns:
            if _role_beside(column, name) == "position":
                arms.setdefault(_words_around(column, name), {}).setdefault(name, column)
    return [tuple(arm[name] for name in names) for arm in arms.values() if len(arm) == len(names)]


def _refuse_groups(groups: Sequence[Sequence[Column]], file: str) -> NoReturn:
    """Raise the question which of several groups are the joints."""
    found = f"several groups of joint columns: {'; '.join(map(listed, groups))}"
    raise which_joints(file, found, groups, "one", by_side=True)


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
        matches = [c for c in matches if c.kind == min(other.kind for other in matches)]
        own = frozenset(key(name).split("_"))
        exact = [c for c in matches if c.words - own <= vocabulary().joint_words["position"]]
        matches = exact if len(exact) == 1 else matches
        if len(matches) != 1:
            return ()
        result.append(matches[0])
    return tuple(result) if len(set(result)) == len(result) else ()


def _words_around(column: Column, name: str) -> frozenset[str] | None:
    """Return the other words of a column with the name of a joint, which they may interrupt; else None."""
    for text in (column.marked.key, column.bare):
        before, inner, behind = f"_{text}_".partition(f"_{key(name)}_")
        if inner:
            marks = column.marked.measured | column.marked.commanded
            return frozenset(f"{before}_{behind}".split("_")) - {""} | marks
    return None


def _role_beside(column: Column, name: str) -> str | None:
    """Return what a column says about a joint: by the words beside the joint's name in its own."""
    around, words = _words_around(column, name), vocabulary().joint_words
    if around is None or around & vocabulary().other or column.moves_nothing:
        return None
    order = column.unit.order if column.unit else 0
    for role, its_order in (("acceleration", 2), ("rate", 1)):
        if around & words[role] or order == its_order:
            return role
    return "position"


def _numbered(
    free: Sequence[Column], found: Sequence[Family], file: str, count: int | None
) -> NamedJoints | None:
    """Return the joints by a word and a number: q1, J1_Angle, actual_q_0, ..."""
    if not found:
        return None
    words, preferred = vocabulary(), prefer_measured(found)
    fitting = [family for family in preferred if len(family.columns) == count] or preferred
    size = len(fitting[0].columns)
    best = [f for f in fitting if f.rank == fitting[0].rank or len(f.columns) == size > 1]
    surer = [f for f in found if f.kind == Kind.MEASURED < best[0].kind]
    if len(best) + len(surer) > 1 and not all(len(family.columns) == 1 for family in (*best, *surer)):
        _refuse_groups([family.ordered() for family in (*best, *surer)], file)
    if len(best) > 1:  # one plot a joint, each with a number of its own
        columns = tuple(column for family in best for column in family.ordered())
        return NamedJoints(columns, "their names; the order is the file's")
    family = best[0]
    alternatives = tuple(f.ordered() for f in found if f is not family and f.shares_name(family))
    moving = words.joint_words["rate"] | words.joint_words["acceleration"]
    passed = {column for group in alternatives for column in group}
    still = [column for column in free if not column.words & moving and column not in passed]
    lowest = min(family.columns)
    first = lowest if len(family.columns) == 1 else min(lowest, 1)
    gaps = [n for n in range(first, first + len(family.columns)) if n not in family.columns]
    if gaps and not family.twins:  # a number that is there twice is told as such
        missing = ", ".join(map(str, gaps))
        said = f"found joint columns {listed(family.ordered())} and none with number {missing}"
        allowed = "numbers without a gap" if count is None else f"the {count} joints of the robot"
        spare = [c for c in still if c not in family.columns.values() and not c.words & words.other]
        hints = cure(len(gaps), spare, count)
        raise LogError(Finding(f"{said}, allowed: {allowed}", file=file, hints=hints))
    if larger := _sharing_a_mark(still, family.ordered()):
        _refuse_half(family.ordered(), larger, larger, file, count)
    evidence = "their names, in the order of their numbers"
    return NamedJoints(family.ordered(), evidence, tuple(sorted(family.columns)), alternatives=alternatives)


def cure(missing: int, spare: Sequence[Column], count: int | None) -> tuple[Hint, Hint]:
    """Return what helps where joints are missing: naming them only where columns are left for a robot's."""
    return RECORD, OTHER_ROBOT if count is not None and len(spare) < missing else NAME_JOINTS


def some_named(numeric: Sequence[Column], robot: Chain | None) -> tuple[tuple[Column, ...], list[str]]:
    """Return the columns of most joints with known names, and the names that have none; nothing of fewer."""
    for names in [*((robot.coordinates,) if robot else ()), *vocabulary().orders]:
        own = {name: named_after(numeric, [name], "position") for name in names}
        found = tuple(dict.fromkeys(column for columns in own.values() for column in columns))
        missing = [name for name, columns in own.items() if not columns]
        if len(names) / 2 < len(found) == len(names) - len(missing) < len(names):
            return found, missing
    return (), []
