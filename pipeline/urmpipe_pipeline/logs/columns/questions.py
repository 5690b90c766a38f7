"""What is asked where columns do not tell what they are: first of all which are the joints."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.columns.columns import Column
from urmpipe_pipeline.logs.columns.sides import side_of

RECORD = Hint("", effect="record the missing one")
OTHER_ROBOT = Hint("robot", None, "gives another arm")
NAME_JOINTS = Hint("joints", None, "names the joint columns, in the robot's order")

TIMES_OF_ANOTHER = Hint("", effect="times of another log: read that one with --time FILE:COLUMN")

_SIDES = (frozenset(("left", "l")), frozenset(("right", "r")))

OTHER_UNIT = {"rad": "deg", "deg": "rad", "m": "mm", "mm": "m", "cm": "m"}
"""The unit that a wrong one would most likely be."""

UNKNOWN = "columns that are known to be joints"
"""What is allowed where nothing tells which columns they are."""

MOST_ANSWERS = 9
"""Groups of columns that a question offers."""


def take(columns: Sequence[Column], does: str = "takes these", *, parameter: str = "joints") -> Hint:
    """Return the hint that takes columns as the joints, or as the position: by number if a name repeats."""
    numbers = [column.number for column in columns]
    if all(column.called == str(column.number) for column in columns) and len(columns) > 1:
        row = numbers == list(range(numbers[0], numbers[-1] + 1))
        return Hint(parameter, [f"{numbers[0]}-{numbers[-1]}"] if row else [*map(str, numbers)], does)
    names = [column.called for column in columns]
    alone = all("," not in name and names.count(name) == 1 for name in names)
    return Hint(parameter, names if alone else [*map(str, numbers)], does)


def by_arm(columns: Sequence[Column]) -> list[list[Column]]:
    """Return the columns of several arms apart, whose names differ by a side or by their first word.

    All together if there are no such two.
    """
    sides = [[column for column in columns if column.words & words] for words in _SIDES]
    first: dict[str, list[Column]] = {}
    for column in columns:
        first.setdefault(column.key.split("_")[0], []).append(column)
    for arms in (sides, list(first.values())):
        names = [frozenset(map(_without_arm, arm)) for arm in arms]
        if len(arms) > 1 and len(set(names)) == 1 and names[0] and "" not in names[0]:
            return arms
    return [list(columns)]


def _without_arm(column: Column) -> str:
    """Return the name of a column without the word that says whose it is: a side, else the first one."""
    words = column.key.split("_")
    sides = frozenset().union(*_SIDES)
    return "_".join([w for w in words if w not in sides] if column.words & sides else words[1:])


def which_joints(
    file: str,
    found: str,
    groups: Sequence[Sequence[Column]],
    allowed: str = UNKNOWN,
    *hints: Hint,
    by_side: bool = False,
) -> LogError:
    """Return the question which columns are the joints, with the groups that they may be.

    Args:
        file: The file.
        found: What was found, and why it does not tell.
        groups: Columns that may be all joints; the likeliest first.
        allowed: What is allowed.
        hints: What else helps.
        by_side: Whether the words of a side select a group, where there are such words.
    """
    different = list(dict.fromkeys(tuple(group) for group in groups if group))
    sides = {group: side_of(group, different) for group in different} if by_side else {}
    answers = [
        Hint("side", side, "takes these") if (side := sides.get(group)) else take(group)
        for group in different[:MOST_ANSWERS]
    ]
    return LogError(
        Finding(f"found {found}, allowed: {allowed}", file, hints=(*hints, *answers, NAME_JOINTS))
    )


def unit_hints(columns: Sequence[Column], unit: str, does: str = "overrides this") -> tuple[Hint, ...]:
    """Return the hint that gives all of some columns a unit."""
    return (Hint("unit", {column.called: unit for column in columns}, does),)


def which_unit(columns: Sequence[Column], unit: str, *, every: bool) -> tuple[Hint, ...]:
    """Return the hints that give some columns the other unit or confirm theirs, as every angle's or each."""
    given = [
        {"": one} if every else {column.called: one for column in columns} for one in (OTHER_UNIT[unit], unit)
    ]
    return tuple(Hint("unit", one, "specifies it") for one in given)


def unit_inference(columns: Sequence[Column], unit: str, evidence: str, *, every: bool) -> Inference:
    """Return what is said of the unit of some columns, and why; with the other unit that it may be.

    What is given for every angle reaches some columns, and others are given one by one, as the first is.
    """
    names, other = tuple(column.name for column in columns), OTHER_UNIT.get(unit)
    every = every and len(columns) > 1 and unit in ("rad", "deg")
    hints = (Hint("unit", {"" if every else columns[0].called: other}),) if other else ()
    return Inference(f"unit of {', '.join(names)}", unit, evidence, "unit", names, hints)
