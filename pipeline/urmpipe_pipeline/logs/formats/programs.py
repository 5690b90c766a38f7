"""Programs of robots and PLCs as tables: the positions that they declare or move to, the arrays they hold.

    KRL    DECL E6AXIS XP1={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0,E1 0}        A1 to A6 in deg
           PTP {X 500,Y 0,Z 800,A 0,B 90,C 0}                           mm; deg about z, y, x
    RAPID  CONST jointtarget p10 := [[0,-30,20,0,90,0],[9E9,...]];        deg
           CONST robtarget p20 := [[600,0,800],[0,0,1,0],[0,0,0,0],[9E9,...]];    mm; quaternion w, x, y, z
           MoveAbsJ [[0,0,0,0,30,0],[9E9,...]], v100, fine, tool0;

1. `read_program`: the language of a text by its head.
2. `_read_krl`, `_read_rapid`: positions (of the joints, or of the tool) and moves; `program_text` has
   structured text.
3. `_build_table`: an array of positions is a path, and what is declared next to it is not. Without an array
   the rows are the positions in the order of the moves, if every move names one or holds its numbers; else
   in the order of the text.

Sources: KUKA System Software, Operating and Programming Instructions for System Integrators; ABB, Technical
reference manual: RAPID Instructions, Functions and Data types.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pyarrow as pa

from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.memory import MemoryTable, arrow_column
from urmpipe_pipeline.logs.formats.program_text import Program, read_arrays, shortened
from urmpipe_pipeline.logs.formats.text import Segment
from urmpipe_pipeline.logs.log_map import LogMap

MIN_ABSENT = 8.99e9  # RAPID writes 9E9 for an axis that is not there
MAX_DEPTH = 8  # lists within lists: a position in an array has three


class _Kind(NamedTuple):
    """A kind of positions: what the language calls it, and the source that takes it."""

    name: str
    source: str


class _Target(NamedTuple):
    """A position.

    Attributes:
        kind: What it is.
        values: By the name of their column; NaN of an axis that is not there.
        name: What it is called; empty in a move.
        offset: Where it stands.
        in_array: Whether it is an element of an array of this name.
    """

    kind: _Kind
    values: Mapping[str, float]
    name: str
    offset: int
    in_array: bool = False


_Move: TypeAlias = _Target | str | None  # the position of a move or its name; None if it is computed

# KRL

AXES, FRAMES = _Kind("E6AXIS position", "table"), _Kind("E6POS position", "path")
_KRL_COLUMNS = {
    AXES: {f"A{k}": f"A{k} [deg]" for k in range(1, 7)},
    FRAMES: {**{axis: f"{axis} [mm]" for axis in "XYZ"}, **{angle: f"{angle} [deg]" for angle in "ABC"}},
}
_KRL_EXTERNAL = [f"E{k}" for k in range(1, 7)]
_AGGREGATE = re.compile(
    r"(?:(?P<move>\bS?(?:PTP|LIN|CIRC)(?:_REL)?)\s+|(?<![$\w])(?P<name>[$\w]++)(?P<index>\[[\d\s,]*+\])?\s*+=\s*+)"
    r"(?:\{\s*+(?:\w++\s*+:)?+(?P<fields>[^{}]*+)\}|(?P<point>[A-Z_]\w*)[ \t]*(?=[\n,]|C_|$))",
    re.IGNORECASE,
)
_FIELD = re.compile(r"\b([A-Z]\d?)\s+([-+]?(?:\d+\.?\d*|\.\d+)(?:E[-+]?\d+)?)\s*(?=,|$)", re.IGNORECASE)
_NO_POINTS = re.compile(r"\$|.*(?:TOOL|BASE)", re.IGNORECASE)


def _read_krl(program: Program) -> MemoryTable:
    """Return the positions of a program in KRL as a table; external axes that are 0 throughout are left out.

    Raises:
        LogError: If a move has a part of a position, and as `_build_table`.
    """
    aggregates = [
        (match, {name.upper(): float(value) for name, value in _FIELD.findall(match["fields"] or "")})
        for match in _AGGREGATE.finditer(program.text)
    ]
    moving = [axis for axis in _KRL_EXTERNAL if any(fields.get(axis) for _, fields in aggregates)]
    targets, moves = list[_Target](), list[_Move]()
    for match, fields in aggregates:
        name, target = match["name"] or "", None
        kind = next((kind for kind, columns in _KRL_COLUMNS.items() if columns.keys() <= fields.keys()), None)
        if kind is not None and not _NO_POINTS.match(name):
            values = {column: fields[field] for field, column in _KRL_COLUMNS[kind].items()}
            values |= {axis: fields[axis] for axis in moving if axis in fields}
            target = _Target(kind, values, name, match.start(), bool(match["index"]))
            targets.append(target)
        if not match["move"]:
            continue
        if match["fields"] is not None and (target is None or match["move"].upper().endswith("_REL")):
            allowed = "all of A1 to A6, or X, Y, Z, A, B, C"
            raise program.error(repr(shortened(match[0])), allowed, match.start())
        moves.append(target or match["point"])
    return _build_table(program, targets, moves, (AXES, FRAMES))


# RAPID

JOINT_TARGETS, ROBOT_TARGETS = _Kind("jointtarget", "table"), _Kind("robtarget", "path")
_RAPID_EXTERNAL = [f"eax_{letter}" for letter in "abcdef"]
_RAPID_COLUMNS = {  # by the lengths of the lists; the configuration of the axes is no column
    (6, 6): (JOINT_TARGETS, [*(f"rax_{k} [deg]" for k in range(1, 7)), *_RAPID_EXTERNAL]),
    (3, 4, 4, 6): (
        ROBOT_TARGETS,
        [*(f"{k} [mm]" for k in "xyz"), *(f"quat_{k}" for k in "wxyz"), *[""] * 4, *_RAPID_EXTERNAL],
    ),
}
_ASSIGNED = re.compile(r"(?<!\w)(\w++)\s*+(\{[^{}]*+\}\s*+)?:=\s*+(\[.*)", re.DOTALL)
_TYPED = re.compile(r"\b(?:joint|rob)target\s++\w++\s*+(\{[^{}]*+\}\s*+)?:=", re.IGNORECASE)
_MOVE = re.compile(r"\bMove(?:AbsJ|J|L|C)(?:DO|Sync|AO|GO)?\b(.*)", re.DOTALL | re.IGNORECASE)
_SWITCHES = re.compile(r"(?:\s*+\\\w++(?:\s*+:=\s*+[\w.]++)?\s*+,?)*+\s*+")
_NAME = re.compile(r"(\w+)\s*(?=[,\\]|$)")
_TOKENS = re.compile(r"[^\[\],\s]+|[\[\],]")
_Lists: TypeAlias = Any  # a number, or a list of such, nested


def _read_rapid(program: Program) -> MemoryTable:
    """Return the positions of a program in RAPID as a table.

    Raises:
        LogError: If a position holds anything but numbers, and as `_build_table`.
    """
    targets, moves = list[_Target](), list[_Move]()
    for start, statement in program.statements():
        move = _MOVE.search(statement)
        match = move or _ASSIGNED.search(statement)
        if match is None:
            continue
        if move:
            switches = _SWITCHES.match(move[1])
            name, index, values = "", None, move[1][switches.end() if switches else 0 :]
            if not values.startswith("["):
                named = _NAME.match(values)
                moves.append(named[1] if named else None)
                continue
        else:
            name, index, values = match.groups()
        offset = start + match.start()
        positions = list(_iter_targets(_parse_lists(values), name, offset, in_array=bool(index)))
        if not positions and (move or _TYPED.search(statement)):
            allowed = "numbers, such as [[0,0,0,0,30,0],[9E9,...]]"
            raise program.error(repr(shortened(values)), allowed, offset)
        positions = positions[:1] if move else positions
        moves += positions if move else ()
        targets += positions
    return _build_table(program, targets, moves, (JOINT_TARGETS, ROBOT_TARGETS))


def _parse_lists(text: str) -> _Lists:
    """Return the list that a text begins with; None if it holds anything but numbers, or does not end."""
    open_lists: list[list[_Lists]] = [[]]
    for token in _TOKENS.findall(text):
        if token == "[" and len(open_lists) <= MAX_DEPTH:
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


def _iter_targets(lists: _Lists, name: str, offset: int, *, in_array: bool) -> Iterator[_Target]:
    """Yield the positions in nested lists."""
    if not isinstance(lists, Sequence) or not all(isinstance(inner, list) for inner in lists):
        return
    kind, columns = _RAPID_COLUMNS.get(tuple(map(len, lists)), (None, []))
    if kind is None:
        for inner in lists:
            yield from _iter_targets(inner, name, offset, in_array=in_array)
        return
    values = (value for inner in lists for value in inner)
    present = (math.nan if isinstance(value, list) or abs(value) > MIN_ABSENT else value for value in values)
    yield _Target(kind, {c: v for c, v in zip(columns, present, strict=True) if c}, name, offset, in_array)


# Rows of positions


class _Rows(NamedTuple):
    """Positions of a kind that make rows, by name if they are several arrays, and why."""

    kind: _Kind
    paths: Mapping[str, Sequence[_Target]]
    why: str

    @property
    def targets(self) -> list[_Target]:
        return [target for path in self.paths.values() for target in path]

    @property
    def length(self) -> int:
        return len(next(iter(self.paths.values())))

    def __str__(self) -> str:
        return format_count(self.length, self.kind.name)


def _build_table(
    program: Program, targets: Sequence[_Target], moves: Sequence[_Move], kinds: Sequence[_Kind]
) -> MemoryTable:
    """Return the table of a program's positions.

    Args:
        program: The program.
        targets: What it declares, in the order of the text, and the positions in its moves.
        moves: The position of each move.
        kinds: Of the joints, and of the tool.

    Raises:
        LogError: If there are none, if there are paths of different lengths, or if positions of joints and
            of the tool are no rows of one table.
    """
    named = {target.name.lower(): target for target in targets if target.name and not target.in_array}
    reached = [named.get(move.lower()) if isinstance(move, str) else move for move in moves]
    followed = [target for target in reached if target is not None]
    ordered = followed if followed and len(followed) == len(reached) else None
    parts = [rows for kind in kinds if (rows := _select_rows(program, kind, targets, ordered)) is not None]
    if not parts:
        names = " or ".join(kind.name for kind in kinds)
        raise program.error(f"{program.language} without positions", f"a {names} with its numbers")
    if len(parts) == 2 and not _are_pairs(*parts):
        source = program.options.source
        if source is None:
            hints = (Hint("source", rows.kind.source, f"takes the {rows}") for rows in parts)
            message = f"{' and '.join(map(str, parts))}, which are not rows of one table"
            raise program.error(message, "one of the two", parts[0].targets[0].offset, *hints)
        parts = [next((rows for rows in parts if rows.kind.source == source), parts[0])]
    columns = dict[str, list[float]]()
    for rows in parts:
        for path, positions in rows.paths.items():
            for name in positions[0].values:
                values = [target.values.get(name, math.nan) for target in positions]
                if not all(map(math.isnan, values)):  # an axis that is not there
                    columns[name if len(rows.paths) == 1 else f"{path}_{name}"] = values
    used = {id(target) for rows in parts for target in rows.targets}
    unused = dict.fromkeys(target.name for target in targets if id(target) not in used and target.name)
    why = ", ".join(dict.fromkeys(rows.why for rows in parts))
    why += f"; not among them: {shortened(', '.join(unused), 60)}" if unused else ""
    table = pa.table({name: arrow_column(np.array(values)) for name, values in columns.items()})
    inference = Inference("program", " and ".join(map(str, parts)), why)
    return MemoryTable(program.path.stem, table, path=program.path, inferences=(inference,))


def _select_rows(
    program: Program, kind: _Kind, targets: Sequence[_Target], ordered: Sequence[_Target] | None
) -> _Rows | None:
    """Return the positions of a kind that are rows; None without any."""
    of_kind = [target for target in targets if target.kind is kind]
    in_arrays = (target for target in of_kind if target.in_array)
    arrays = {name: list(group) for name, group in groupby(in_arrays, lambda target: target.name)}
    if arrays:
        if len(set(map(len, arrays.values()))) > 1:
            lengths = (f"{name} of {format_count(len(a), kind.name)}" for name, a in arrays.items())
            delete = Hint("", effect="delete the others")
            fault = shortened(", ".join(lengths), 200)
            raise program.error(fault, "one array, or several of one length", None, delete)
        return _Rows(kind, arrays, f"of {', '.join(arrays)}")
    rows = of_kind if ordered is None else [target for target in ordered if target.kind is kind]
    order = "text" if ordered is None else "moves"
    return _Rows(kind, {"": rows}, f"in the order of the {order}") if rows else None


def _are_pairs(joints: _Rows, poses: _Rows) -> bool:
    """Return whether every row has both: arrays of one length, or positions whose names pair by number."""
    if joints.length != poses.length:
        return False
    pairs = list(zip(joints.targets, poses.targets, strict=False))
    if all(joint.in_array and pose.in_array for joint, pose in pairs):
        return len(joints.paths) == len(poses.paths) == 1
    numbers = [[re.sub(r"\D", "", target.name) for target in pair] for pair in pairs]
    return all(joint == pose != "" for joint, pose in numbers)


# Languages


class _Language(NamedTuple):
    """A language of programs.

    Attributes:
        name: What its users call it.
        known: A line of its head gives it away.
        comments: Its comments.
        read: Returns what a program of it holds; None if it is not read.
        block: The words that begin and end a block of declarations: one that does not end was cut.
    """

    name: str
    known: re.Pattern[str]
    comments: re.Pattern[str] = re.compile(r"(?!)")
    read: Callable[[Program], MemoryTable] | None = None
    block: tuple[str, str] = ("", "")


def _line(*patterns: str) -> re.Pattern[str]:
    """Return a pattern of a line that begins as one of some do."""
    return re.compile(rf"^[ \t]*(?:{'|'.join(patterns)})", re.IGNORECASE | re.MULTILINE)


_LANGUAGES = (
    _Language("a Fanuc program (/PROG)", re.compile(r"\A\s*/PROG\b")),
    _Language("a Yaskawa job (/JOB)", re.compile(r"\A\s*/JOB\b")),
    _Language("a program in URScript", _line(r"(?:movej|movel|movep|servoj)\s*\(")),
    _Language(
        "a RAPID program",
        _line(
            r"MODULE\s+\w+\s*(?:\([\w,\s]*\))?\s*$(?=[\s\S]{0,2000}?\b(?:ENDMODULE|PROC\s|(?:CONST|PERS|VAR)\s+\w+\s+\w))",
            r"(?:(?:LOCAL|TASK)\s+)?(?:CONST|PERS|VAR)\s+(?:joint|rob)target\s",
            r"Move(?:AbsJ|J|L|C)\s+\\?\w*\s*\[",
        ),
        re.compile(r"![^\n]*"),
        _read_rapid,
        ("MODULE", "ENDMODULE"),
    ),
    _Language(
        "a KRL program",
        _line(
            r"&ACCESS\b",
            r"(?:GLOBAL\s+)?(?:DEFDAT\s+\w+|DEF\s+\w+\s*\([^)\n]*\)\s*$)",
            r"(?:GLOBAL\s+)?DECL\s+(?:GLOBAL\s+)?(?:E6AXIS|AXIS|E6POS|POS|FRAME)\s",
            r"(?:E6AXIS|AXIS|E6POS|POS|FRAME)\s+\w+(?:\[\d*\])?\s*=\s*\{",
            r"S?(?:PTP|LIN|CIRC)\s+\{",
        ),
        re.compile(r";[^\n]*"),
        _read_krl,
        ("DEFDAT", "ENDDAT"),
    ),
    _Language(
        "a program in structured text",
        _line(
            r"VAR(?:_[A-Z_]+)?(?:\s++(?:CONSTANT|RETAIN|PERSISTENT))*+\s++"
            r"(?>(?:\(\*(?:[^*\n]|\*(?!\)))*\*\)\s*|(?:\(\*|//).*\n\s*)*)\w[\w, ]*:(?!=)",
            r"\w+(?:\s+AT\s*%\S+)?\s*:\s*(?:ARRAY\s*\[.*\bOF\b|(?:L?REAL|U?[SDL]?INT|L?TIME)\s*:=)",
        ),
        re.compile(r"\(\*.*?(?:\*\)|\Z)|//[^\n]*", re.DOTALL),
        read_arrays,
        (r"VAR(?:_[A-Z_]+)?", "END_VAR"),
    ),
)


def read_program(segment: Segment, options: LogMap) -> MemoryTable | None:
    """Return the table that the text of a program holds; None of any other text, by its head.

    Raises:
        LogError: If it holds no position and no array of numbers, or several tables; or is in a language
            that is not read.
    """
    if not re.search(r":=|\{|^\s*/|\(", segment.head):  # no table has all that a program is made of
        return None
    language = next((language for language in _LANGUAGES if language.known.search(segment.head)), None)
    if language is None:
        return None
    if language.read is None:
        columns = "J1 [deg],J2 [deg],... one row per position"
        hint = Hint("", effect=f"write its positions as a table, such as {columns}")
        fault = f"found {language.name}, allowed: a text table"
        raise LogError(Finding(fault, str(segment.path), hints=(hint,)))
    program = Program(segment.path, segment.text(), language.comments, language.name, options)
    starts, ends = (list(_line(rf"{word}\b").finditer(program.text)) for word in language.block)
    if len(starts) > len(ends):
        fault = f"{starts[-1][0].strip()} without {language.block[1]}"
        raise program.error(fault, "a program as a whole", starts[-1].start())
    return language.read(program)
