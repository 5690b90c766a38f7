"""RAPID (ABB): jointtargets in deg, robtargets in mm with a quaternion w, x, y, z.

    CONST jointtarget p10 := [[0,-30,20,0,90,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST robtarget p20 := [[600,0,800],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]], v100, fine, tool0;

Source: ABB, Technical reference manual: RAPID Instructions, Functions and Data types.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.formats.programs.program import (
    PATH,
    TABLE,
    Kind,
    Program,
    Target,
    shortened,
    table_of,
)

JOINTS, POSES = Kind("jointtarget", TABLE), Kind("robtarget", PATH)

_ABSENT = 8.99e9  # the manual writes 9E9 for an axis that is not there
_EXTERNAL = [f"eax_{letter}" for letter in "abcdef"]
_COLUMNS = {
    (6, 6): (JOINTS, [*(f"rax_{k} [deg]" for k in range(1, 7)), *_EXTERNAL]),
    (3, 4, 4, 6): (
        POSES,
        [
            *(f"{axis} [mm]" for axis in "xyz"),
            *(f"quat_{part}" for part in "wxyz"),
            *["", "", "", ""],
            *_EXTERNAL,
        ],
    ),
}
"""Kind and columns of a position by the lengths of its lists; the configuration of the axes has none."""

_ASSIGNED = re.compile(r"(?<!\w)(\w++)\s*+(\{[^{}]*+\}\s*+)?:=\s*+(\[.*)", re.DOTALL)
_TYPED = re.compile(r"\b(?:joint|rob)target\s++\w++\s*+(\{[^{}]*+\}\s*+)?:=", re.IGNORECASE)
_MOVE = re.compile(r"\bMove(?:AbsJ|J|L|C)(?:DO|Sync|AO|GO)?\b(.*)", re.DOTALL | re.IGNORECASE)
_SWITCHES = re.compile(r"(?:\s*+\\\w++(?:\s*+:=\s*+[\w.]++)?\s*+,?)*+\s*+")
_NAME = re.compile(r"(\w+)\s*(?=[,\\]|$)")
_TOKENS = re.compile(r"[^\[\],\s]+|[\[\],]")

DEEPEST = 8
"""Lists within lists: a position in an array has three."""

Lists: TypeAlias = Any
"""A number, or a list of such, nested."""


def read(program: Program) -> MemoryTable:
    """Return the positions of a program as a table.

    Raises:
        LogError: If there are none, or they are no rows of one table.
    """
    targets, moves = list[Target](), list[Target | str | None]()
    for offset, statement in program.statements():
        if (move := _MOVE.search(statement)) is not None:
            for one in _points(program, move[1], offset + move.start()):
                moves.append(one)
                targets += [one] if isinstance(one, Target) else []
        elif (assigned := _ASSIGNED.search(statement)) is not None:
            at = offset + assigned.start()
            found = list(_targets(_lists(assigned[3]), assigned[1], at, array=bool(assigned[2])))
            if not found and _TYPED.search(statement):
                raise program.error(
                    repr(shortened(assigned[3])), "numbers, such as [[0,0,0,0,30,0],[9E9,...]]", at
                )
            targets += found
    return table_of(program, targets, moves, (JOINTS, POSES))


def _points(program: Program, arguments: str, offset: int) -> Iterator[Target | str | None]:
    """Yield the points of a move: as numbers, by name, or None where they are computed."""
    start = _SWITCHES.match(arguments)
    rest = arguments[start.end() if start else 0 :]
    if not rest.startswith("["):
        name = _NAME.match(rest)
        yield name[1] if name else None
        return
    found = list(_targets(_lists(rest), "", offset))
    if not found:
        raise program.error(repr(shortened(rest)), "numbers, such as [[0,0,0,0,30,0],[9E9,...]]", offset)
    yield found[0]


def _lists(text: str) -> Lists:
    """Return the list that a text begins with; None if it holds anything but numbers, or does not end."""
    open_lists: list[list[Lists]] = [[]]
    for token in _TOKENS.findall(text):
        if token == "[" and len(open_lists) <= DEEPEST:
            open_lists.append([])
        elif token == "]":
            closed = open_lists.pop()
            open_lists[-1].append(closed)
            if len(open_lists) == 1:
                return closed
        elif token != ",":  # a number, or one bracket too many
            try:
                open_lists[-1].append(float(token))
            except ValueError:
                return None
    return None


def _targets(lists: Lists, name: str, offset: int, *, array: bool = False) -> Iterator[Target]:
    """Yield the positions that nested lists are."""
    if not isinstance(lists, Sequence) or not all(isinstance(one, list) for one in lists):
        return
    kind, columns = _COLUMNS.get(tuple(map(len, lists)), (None, []))
    if kind is None:
        for one in lists:
            yield from _targets(one, name, offset, array=array)
        return
    values = (value for one in lists for value in one)
    present = (math.nan if isinstance(value, list) or abs(value) > _ABSENT else value for value in values)
    yield Target(kind, {c: v for c, v in zip(columns, present, strict=True) if c}, name, offset, array)
