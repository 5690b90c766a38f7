"""Columns of numbers that are named as columns in use, and are not used."""

from __future__ import annotations

import os.path
import re
from collections.abc import Collection, Sequence

from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.columns.blocks import MOST_JOINTS
from urmpipe_pipeline.logs.columns.columns import Column, Kind, listed
from urmpipe_pipeline.logs.columns.pose import OF_POSITION
from urmpipe_pipeline.logs.columns.questions import NAME_JOINTS, take
from urmpipe_pipeline.logs.vocabulary import vocabulary

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
        if column.kind == Kind.COMMANDED or column.words & apart or _DERIVATIVE.match(column.bare):
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
