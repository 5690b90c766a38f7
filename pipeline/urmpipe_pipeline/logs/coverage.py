"""Warnings about columns of numbers that are not used and may matter.

1. `coverage_warnings`: columns that are named like the joints, or have their unit where names share no word.
2. `passed_over_warnings`: groups of the same names, passed over for those measured.
3. `path_warnings`, `orientation_warnings`, `tcp_warnings`: what may be joints, an orientation or a
   tool centre point under names that are not known.
"""

from __future__ import annotations

import os.path
import re
from collections.abc import Sequence

from urmpipe_models.errors import Hint
from urmpipe_pipeline.joint_log import PASSED_OVER, LogWarning
from urmpipe_pipeline.logs.columns import NAME_JOINTS, REST, Column, Kind, listed, take
from urmpipe_pipeline.logs.names import SLIDES, family_of, of_first_kind
from urmpipe_pipeline.logs.pose_columns import OF_POSITION
from urmpipe_pipeline.logs.rates import MAX_JOINTS
from urmpipe_pipeline.logs.vocabulary import vocabulary

COLUMNS_NOT_READ = "columns-not-read"
TCP_NOT_READ = "tcp-not-read"
MIN_JOINTS = 3  # fewer columns are a radius, a speed, a flag

_TOOL_VALUES = frozenset(["analog", "digital", "input", "output", "in", "out", "bits", "offset", "payload"])
_NEAR_TOOL = re.compile(r"(tcp|tpc|ctp|tool|tip|eef|endeff|werkzeug)|(?:^|_)ee(?:_|$)")  # also misspelled
_TORQUES = re.compile(r"[tp]_?[xyz]")  # names of a position that forces next to them make torques
_DERIVATIVE = re.compile(r"d{1,2}_?[a-z]|q2d|q?dd?_")  # ddq1, d_q1, q2d_1
_MARKERS = frozenset({"limit", "limits", "index", "min", "max"})  # of other values of a joint


def coverage_warnings(
    joints: Sequence[Column], unused: Sequence[Column], *, robot: bool, is_given: bool = False
) -> list[LogWarning]:
    """Return the warning that columns named like the joints are not used, or nothing.

    A column is named like the joints if it has all words that they share, or "joint" as they do; if they
    share no word, if it has their unit. "d4" is named like a joint that slides after q3. Where the joints
    are given, only the words that all of them share count.

    Args:
        joints: The joint columns.
        unused: The columns of numbers without a use, except those that other warnings state.
        robot: Whether an arm is given, which states how many joints there are.
        is_given: Whether the user gives the joints.
    """
    if not joints or not all(column.header for column in joints):
        return []
    words, numbers = vocabulary(), family_of(joints)[0]
    names = [_split_name(column) for column in joints]
    shared = frozenset.intersection(*map(frozenset, names))
    units = {column.unit for column in joints} - {None}
    excluded = words.other | words.joint_terms["rate"] | words.joint_terms["acceleration"] | _MARKERS

    def is_named_as_joints(column: Column) -> bool:
        name = _split_name(column)
        slides = SLIDES.fullmatch(column.key)
        if slides and numbers and int(slides["n"]) == max(numbers) + 1:
            return True
        if column.kind == Kind.COMMANDED or column.words & excluded or column.moves_nothing:
            return False
        if _DERIVATIVE.match(column.bare) or (column.unit and column.unit.order):
            return False
        if shared and shared <= {*name} and len(name) <= max(map(len, names)) + 1:
            return True
        has_same_use = column.unit in units if not shared else "joint" in shared and "joint" in name
        return has_same_use and not is_given

    named = [column for column in unused if not column.text and column.header and is_named_as_joints(column)]
    if not named:
        return []
    every = sorted({*joints, *named}, key=lambda column: column.number)
    hint = NAME_JOINTS if robot else take(every, "takes all of them")
    message = f"{listed(named, most=8)} named like the joints and not read"
    return [LogWarning(COLUMNS_NOT_READ, message, hints=(hint,))]


def _split_name(column: Column) -> list[str]:
    """Return the words of a name without its numbers: of joint2_pos joint and pos."""
    return [word for word in re.split(r"[_\d]+", column.bare) if word]


def orientation_warnings(position: Sequence[Column], unused: Sequence[Column]) -> list[LogWarning]:
    """Return the warning that three or four columns may be the orientation at a position, or nothing.

    They begin as the names of the position, or are angles if these begin with x, y, z.
    """
    words = vocabulary()
    excluded = words.joint_terms["rate"] | words.joint_terms["acceleration"] | (words.other - words.tool)
    stem = OF_POSITION.sub("", os.path.commonprefix([c.key for c in position]))  # noqa: RUF071 (names)
    free = [c for c in unused if not c.words & excluded and (c.unit is None or c.unit.quantity == "angle")]
    near = [c for c in free if c.key.startswith(stem) if stem or (c.unit and not c.unit.order)]
    if len(near) not in (3, 4):
        return []
    message = f"{listed(near)} may be the orientation at {listed(position)} and are not read"
    hint = take(near, "with --position and --rotation takes them", parameter="orientation")
    return [LogWarning(COLUMNS_NOT_READ, message, hints=(hint,))]


def path_warnings(unused: Sequence[Column]) -> list[LogWarning]:
    """Return the warning that several columns next to a path are not read.

    They are called joints; else angles, if there are any; else all that are not commanded.
    """
    joints = [column for column in unused if "joint" in column.words]
    angles = [c for c in unused if c.unit is not None and c.unit.quantity == "angle"]
    columns = joints or angles or of_first_kind(unused)
    if len(columns) < MIN_JOINTS:
        return []
    message = f"x, y, z are read as a path, and {listed(columns, most=8)} are not read"
    hint = take(columns, "takes them as the joints") if len(columns) <= MAX_JOINTS else NAME_JOINTS
    return [LogWarning(COLUMNS_NOT_READ, message, hints=(hint,))]


def tcp_warnings(rest: Sequence[Column]) -> list[LogWarning]:
    """Return a warning if two columns or more look like a tool centre point."""
    like_tcp = [column for column in rest if _is_like_tcp(column)]
    if len(like_tcp) < 2:
        return []
    message = f"{listed(like_tcp)} look like a recorded TCP and are not read as one"
    of_rotation = [pattern for rotation in vocabulary().tcp_rotations for pattern in rotation.patterns]
    position = [column for column in like_tcp if not any(p.search(column.plain) for p in of_rotation)]
    names = take(position, "takes them", parameter="position")
    names = names if len(position) == 3 else Hint("position", None, "names them")
    hints = (Hint("", effect="name its columns tcp_x, tcp_y, tcp_z"), names)
    return [LogWarning(TCP_NOT_READ, message, hints=hints)]


def _is_like_tcp(column: Column) -> bool:
    """Return whether the name of a column is that of a position, or near to one."""
    words = vocabulary()
    excluded = words.other - words.tool | words.joint_terms["rate"] | words.joint_terms["acceleration"]
    if column.words & (excluded | _TOOL_VALUES) or (column.unit and column.unit.quantity != "length"):
        return False
    if any(pattern.search(column.plain) for pattern in words.tcp_position):
        return not _TORQUES.fullmatch(column.plain)
    return bool(_NEAR_TOOL.search(column.plain) and re.search(r"[xyz\d]$", column.plain))


def passed_over_warnings(
    passed: Sequence[tuple[tuple[Column, ...], tuple[Column, ...]]],
    joints: tuple[Column, ...],
    position: tuple[Column, ...],
) -> list[LogWarning]:
    """Return the warning with all columns that were not read because excluded were, or nothing.

    Args:
        passed: Groups that are read, each with the columns passed over for it.
        joints: The joints.
        position: The recorded position.
    """
    if not passed:
        return []
    message = "; ".join(f"{_ends(other)} passed over for {_ends(group)}" for group, other in passed)
    hints = [take(other) for group, other in passed if group == joints]
    hints += [take(other, parameter="position") for group, other in passed if group == position]
    hints += [Hint("side", None, "takes excluded")]
    return [LogWarning(PASSED_OVER, message, hints=(hints[0],))]


def _ends(group: Sequence[Column]) -> str:
    """Return the names of the first and the last column."""
    return " to ".join(dict.fromkeys(listed([column]) for column in (group[0], group[-1])))


def compare_sides(read: tuple[Column, ...], passed: tuple[Column, ...]) -> tuple[Hint, ...]:
    """Return how to compare columns that are read with those passed over, by the words in their names."""
    measured, commanded = (
        frozenset.intersection(*(column.words for column in group)) for group in (read, passed)
    )
    pair = [
        min(commanded & vocabulary().commanded, default=REST),
        min(measured & vocabulary().measured_markers, default=REST),
    ]
    return () if pair == [REST, REST] else (Hint("sides", pair, "compares them", call="compare"),)
