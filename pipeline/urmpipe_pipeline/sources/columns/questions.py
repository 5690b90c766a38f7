"""What is asked where columns do not tell what they are: first of all which are the joints."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_models.errors import Finding, LogError
from urmpipe_models.messages import Hint
from urmpipe_pipeline.sources.columns.columns import Column

RECORD = Hint("", does="record the missing one")
OTHER_ROBOT = Hint("robot", None, "gives another arm")
NAME_JOINTS = Hint("joints", None, "names the joint columns, in the robot's order")

_SIDES = (frozenset(("left", "l")), frozenset(("right", "r")))

UNKNOWN = "columns that are known to be joints"
"""What is allowed where nothing tells which columns they are."""

MOST_ANSWERS = 6
"""Groups of columns that a question offers."""


def take(columns: Sequence[Column], does: str = "takes these") -> Hint:
    """Return the hint that takes columns as the joints: by number where a name has a comma, or repeats."""
    names = [column.called for column in columns]
    alone = all("," not in name and names.count(name) == 1 for name in names)
    return Hint("joints", names if alone else [str(column.number) for column in columns], does)


def by_side(columns: Sequence[Column]) -> Sequence[Sequence[Column]]:
    """Return the columns of a left and a right arm apart; all together if there are no such two."""
    sides = [[column for column in columns if column.words & words] for words in _SIDES]
    names = [
        {"_".join(w for w in one.key.split("_") if w not in words) for one in side}
        for side, words in zip(sides, _SIDES, strict=True)
    ]
    return sides if names[0] and names[0] == names[1] and "" not in names[0] else [columns]


def which_joints(
    file: str,
    found: str,
    groups: Sequence[Sequence[Column]],
    allowed: str = UNKNOWN,
    *hints: Hint,
) -> LogError:
    """Return the question which columns are the joints, with the groups that they may be.

    Args:
        file: The file.
        found: What was found, and why it does not tell.
        groups: Columns that may be all joints; the likeliest first.
        allowed: What is allowed.
        hints: What else helps.
    """
    different = list(dict.fromkeys(tuple(group) for group in groups if group))
    answers = map(take, different[:MOST_ANSWERS])
    return LogError(
        Finding(f"found {found}, allowed: {allowed}", file, hints=(*hints, *answers, NAME_JOINTS))
    )
