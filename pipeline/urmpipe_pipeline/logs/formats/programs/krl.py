"""KRL (KUKA): axes A1 to A6 and E1 to E6, or X, Y, Z in mm with A, B, C about z, y, x in deg.

    DECL E6AXIS XP1={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0,E1 0,E2 0,E3 0,E4 0,E5 0,E6 0}
    PTP {A1 10,A2 -80,A3 90,A4 0,A5 30,A6 0}

Source: KUKA System Software, Operating and Programming Instructions for System Integrators.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

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

JOINTS, POSES = Kind("E6AXIS position", TABLE), Kind("E6POS position", PATH)

_FIELDS = {
    JOINTS: {f"A{k}": f"A{k} [deg]" for k in range(1, 7)},
    POSES: {**{axis: f"{axis} [mm]" for axis in "XYZ"}, **{angle: f"{angle} [deg]" for angle in "ABC"}},
}
_EXTERNAL = [f"E{k}" for k in range(1, 7)]
_ALL = "A1 to A6, or X, Y, Z, A, B, C"

_AGGREGATE = re.compile(
    r"(?:(?P<move>\bS?(?:PTP|LIN|CIRC)(?:_REL)?)\s+|(?<![$\w])(?P<name>[$\w]++)(?P<index>\[[\d\s,]*+\])?\s*+=\s*+)"
    r"(?:\{\s*+(?:\w++\s*+:)?+(?P<fields>[^{}]*+)\}|(?P<point>[A-Z_]\w*)[ \t]*(?=[\n,]|C_|$))",
    re.IGNORECASE,
)
_FIELD = re.compile(r"\b([A-Z]\d?)\s+([-+]?(?:\d+\.?\d*|\.\d+)(?:E[-+]?\d+)?)\s*(?=,|$)", re.IGNORECASE)
_NO_POINTS = re.compile(r"\$|.*(?:TOOL|BASE)", re.IGNORECASE)


def read(program: Program) -> MemoryTable:
    """Return the positions of a program as a table.

    Raises:
        LogError: If there are none, if a move has a part of one, or they are no rows of one table.
    """
    targets, moves = list[Target](), list[Target | str | None]()
    for match in _AGGREGATE.finditer(program.text):
        fields = {name.upper(): float(value) for name, value in _FIELD.findall(match["fields"] or "")}
        target = next(_targets(fields, match), None)
        if match["move"] and match["fields"] is not None:
            if target is None or match["move"].upper().endswith("_REL"):
                raise program.error(repr(shortened(match[0])), f"all of {_ALL}", match.start())
            moves.append(target)
        elif match["move"]:
            moves.append(match["point"])
        targets += [] if target is None else [target]
    used = {axis for target in targets for axis in _EXTERNAL if target.values.get(axis)}
    kept = {id(target): replace(target, values=_without(target.values, used)) for target in targets}
    moves = [kept[id(move)] if isinstance(move, Target) else move for move in moves]
    return table_of(program, list(kept.values()), moves, (JOINTS, POSES))


def _targets(fields: Mapping[str, float], match: re.Match[str]) -> Iterator[Target]:
    """Yield the position that the fields are, if they are one."""
    name = match["name"] or ""
    for kind, columns in _FIELDS.items():
        if columns.keys() <= fields.keys() and not _NO_POINTS.match(name):
            values = {column: fields[field] for field, column in columns.items()}
            values |= {axis: fields[axis] for axis in _EXTERNAL if axis in fields}
            yield Target(kind, values, name, match.start(), bool(match["index"]))


def _without(values: Mapping[str, float], used: set[str]) -> dict[str, float]:
    """Return values without the external axes that are 0 throughout: they are not there."""
    return {name: value for name, value in values.items() if name not in _EXTERNAL or name in used}
