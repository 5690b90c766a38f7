"""Programs of robots and PLCs as tables: the positions that they declare or move to, the arrays they hold.

    KRL    DECL E6AXIS XP1={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0,E1 0}        A1 to A6 in deg
           PTP {X 500,Y 0,Z 800,A 0,B 90,C 0}                           mm; deg about z, y, x
    RAPID  CONST jointtarget p10 := [[0,-30,20,0,90,0],[9E9,...]];        deg
           CONST robtarget p20 := [[600,0,800],[0,0,1,0],[0,0,0,0],[9E9,...]];    mm; quaternion w, x, y, z
           MoveAbsJ [[0,0,0,0,30,0],[9E9,...]], v100, fine, tool0;
    LS     P[1]{ GP1: J1 = 0.0 deg, ... };  P[2]{ GP1: X = 936.4 mm, ..., W = 180.0 deg, ... };    Fanuc
    ST     phi_1 : ARRAY[1..4] OF REAL := [0.0, 0.1, 2(0.5)];    structured text (IEC 61131-3): 0.5 twice
           sample_time : LREAL := 0.0008;

1. `read_program`: the language of a text by its head.
2. `_read_krl`, `_read_rapid`, `_read_fanuc`: positions (of the joints, or of the tool) and moves.
3. `_build_table`: an array of positions is a path, and what is declared next to it is not. Without an array
   the rows are the positions in the order of the moves, if every move names one or holds its numbers; else
   in the order of the text.
4. `_read_arrays`: arrays of structured text of one length are columns; of two dimensions each column of the
   array is one. A scalar that is named like the time between samples gives the clock.

Sources: KUKA System Software, Operating and Programming Instructions for System Integrators; ABB, Technical
reference manual: RAPID Instructions, Functions and Data types; Fanuc, ASCII program files of the R-30iA.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pyarrow as pa

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.arrays import find_even_times
from urmpipe_pipeline.logs.formats.memory import MemoryTable, arrow_column
from urmpipe_pipeline.logs.formats.text import Segment
from urmpipe_pipeline.logs.log_map import LogMap

MIN_ABSENT = 8.99e9  # RAPID writes 9E9 for an axis that is not there
MAX_DEPTH = 8  # lists within lists: a position in an array has three
MAX_VALUES = 4_000_000  # of an array: a few letters repeat as many numbers as one likes
MAX_COLUMNS = 32  # of an array of two dimensions that has fewer rows than columns


class Program:
    """The text of a program.

    Attributes:
        path: Its file.
        text: All of it, comments as spaces, so that everything else keeps its place.
        language: What it is written in, as its users call it.
        options: What the user says about the log.
    """

    def __init__(
        self, path: Path, text: str, comments: re.Pattern[str], language: str, options: LogMap
    ) -> None:
        self.path, self.language, self.options = path, language, options
        self.text = comments.sub(lambda comment: re.sub(r"[^\n]", " ", comment[0]), text)

    def statements(self) -> Iterator[tuple[int, str]]:
        """Yield each statement that a semicolon or the file ends, with the offset where it begins."""
        start = 0
        for statement in self.text.split(";"):
            lead = len(statement) - len(statement.lstrip())
            yield start + lead, statement[lead:]
            start += len(statement) + 1

    def line(self, offset: int) -> int:
        """Return the line of the file, from 1, of an offset of its text."""
        return bisect_left(self._ends, offset) + 1

    @cached_property
    def _ends(self) -> list[int]:
        return [match.start() for match in re.finditer("\n", self.text)]

    def error(self, fault: str, allowed: str, offset: int | None = None, *hints: Hint) -> LogError:
        """Return an error about the program, or about a place in it."""
        line = None if offset is None else self.line(offset)
        return LogError(Finding(file=str(self.path), line=line, found=fault, allowed=allowed, hints=hints))


def shortened(text: str, length: int = 40) -> str:
    """Return the beginning of a text in one line, for messages."""
    line = " ".join(text.split())
    return line if len(line) <= length else f"{line[: length - 3]}..."


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


# Fanuc

FANUC_JOINTS, FANUC_POSES = _Kind("joint position", "table"), _Kind("tool position", "path")
_POSITION = re.compile(r"\bP\[\s*(\d+)[^\]]*\]\s*\{\s*GP1\s*:(.*?)(?:\bGP\d|\}\s*;)", re.DOTALL)
_COMPONENT = re.compile(r"\b(J\d|E\d|[XYZWPR])\s*=\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*(deg|mm)\b")
_MOTION = re.compile(r"^\s*\d+:\s*[JLCAS]\s+(PR?)\[\s*(\d+)", re.MULTILINE)


def _read_fanuc(program: Program) -> MemoryTable:
    """Return the positions of the first group of a program of Fanuc; registers are not in the program.

    Raises:
        LogError: As `_build_table`.
    """
    targets = []
    for match in _POSITION.finditer(program.text):
        values = {f"{name} [{unit}]": float(text) for name, text, unit in _COMPONENT.findall(match[2])}
        kind = FANUC_JOINTS if "J1 [deg]" in values else FANUC_POSES
        targets += [_Target(kind, values, f"P[{match[1]}]", match.start())] if values else []
    motions = _MOTION.finditer(program.text)
    moves = [f"P[{match[2]}]" if match[1] == "P" else None for match in motions]
    return _build_table(program, targets, moves, (FANUC_JOINTS, FANUC_POSES))


# Rows of positions


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
        LogError: If there are none, or several arrays; with the question which of the two kinds is read.
    """
    named = {target.name.lower(): target for target in targets if target.name and not target.in_array}
    reached = [named.get(move.lower()) if isinstance(move, str) else move for move in moves]
    followed = [target for target in reached if target is not None]
    is_followed = bool(followed) and len(followed) == len(reached)
    rows = dict[_Kind, list[_Target]]()
    for kind in kinds:
        of_kind = [target for target in targets if target.kind is kind]
        arrays = dict.fromkeys(target.name for target in of_kind if target.in_array)
        if len(arrays) > 1:
            hint = Hint("", effect="delete the others")
            raise program.error(
                f"arrays {shortened(', '.join(arrays), 200)}", f"one array of {kind.name}s", None, hint
            )
        if arrays:
            rows[kind] = [target for target in of_kind if target.in_array]
        elif in_order := [target for target in (followed if is_followed else of_kind) if target.kind is kind]:
            rows[kind] = in_order
    if not rows:
        names = " or ".join(kind.name for kind in kinds)
        raise program.error(f"{program.language} without positions", f"a {names} with its numbers")
    counts = {kind: format_count(len(of_kind), kind.name) for kind, of_kind in rows.items()}
    if len(rows) == 2 and program.options.source is None:
        hints = (Hint("source", kind.source, f"takes the {count}") for kind, count in counts.items())
        first = next(iter(rows.values()))[0]
        raise program.error(" and ".join(counts.values()), "one of the two", first.offset, *hints)
    kind = next((kind for kind in rows if kind.source == program.options.source), next(iter(rows)))
    positions, order = rows[kind], "moves" if is_followed else "text"
    why = f"of {positions[0].name}" if positions[0].in_array else f"in the order of the {order}"
    unused = dict.fromkeys(target.name for target in targets if target.name and target not in positions)
    why += f"; not among them: {shortened(', '.join(unused), 60)}" if unused else ""
    columns = dict[str, FloatArray]()
    for name in positions[0].values:
        values = np.array([target.values.get(name, math.nan) for target in positions])
        if not np.isnan(values).all():  # an axis that is not there
            columns[name] = values
    table = pa.table({name: arrow_column(values) for name, values in columns.items()})
    inference = Inference("program", counts[kind], why)
    return MemoryTable(program.path.stem, table, path=program.path, inferences=(inference,))


# Arrays of structured text


_DECLARED = re.compile(
    r"(?<!\w)(?P<name>\w+)\s*(?:AT\s*%[\w.*]+\s*)?:\s*"
    r"(?P<arrays>(?:ARRAY\s*\[[^\[\]]{0,200}\]\s*OF\s+)*)\w++[^:\[\]]*+$",
    re.IGNORECASE,
)
_BOUNDS = re.compile(r"([^\[,]+)\.\.([^\],]+)")
_TOKENS = re.compile(r"[^\[\](),\s]+|[\[\](),]")
_DURATION = re.compile(r"L?T(?:IME)?#(?=\d)((?:\d+(?:\.\d+)?(?:d|h|ms|us|ns|m|s))+)", re.IGNORECASE)
_PARTS = re.compile(r"([\d.]+)(d|h|ms|us|ns|m|s)", re.IGNORECASE)
_SECONDS = {"d": 86400.0, "h": 3600.0, "m": 60.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_NUMBER = re.compile(r"(?!\d+#)(?:\w+#)?([+-]?\d[\d_]*(?:\.[\d_]+)?(?:e[+-]?\d+)?)", re.IGNORECASE)


class _Array(NamedTuple):
    """An array: its name, its values flat, the sizes of its dimensions, the first index of the last one."""

    name: str
    values: FloatArray
    shape: tuple[int, ...]
    first: int


def _read_arrays(program: Program) -> MemoryTable:
    """Return the arrays of a program in structured text as a table.

    Raises:
        LogError: If none has values, if their lengths differ, or the time between samples is unclear.
    """
    scalars, periods = dict[str, float](), dict[str, float]()
    texts = list[tuple[re.Match[str], str, int]]()
    for offset, statement in program.statements():
        head, sign, text = statement.partition(":=")
        declared, text = (_DECLARED.search(head) if sign else None), text.strip()
        if declared and declared["arrays"]:
            texts.append((declared, text, offset + declared.start()))
        elif declared and (value := _number(text)) is not None:
            name = declared["name"]
            scalars[name.lower()] = value
            periods[f"{name} [s]" if _DURATION.fullmatch(text.replace("_", "")) else name] = value
    arrays = [array for item in texts if (array := _read_array(program, *item, scalars)) is not None]
    if not arrays:
        form = "name : ARRAY[1..n] OF REAL := [...]"
        raise program.error(f"{program.language} without an array of numbers", form)
    columns = _columns(program, arrays)
    rows = len(next(iter(columns.values())))
    count = f"{format_count(len(arrays), 'array')} of {rows} values"
    times, reasons = find_even_times(program.path, periods, columns, rows, program.options)
    table = pa.table({name: arrow_column(values) for name, values in (times | columns).items()})
    inference = Inference("program", "structured text", count)
    return MemoryTable(program.path.stem, table, path=program.path, inferences=(inference, *reasons))


def _number(text: str) -> float | None:
    """Return the number of a literal, of a duration such as T#4ms in [s]; None of any other text."""
    if (match := _NUMBER.fullmatch(text)) is not None:
        return float(match[1].replace("_", ""))
    if (match := _DURATION.fullmatch(text.replace("_", ""))) is not None:
        return math.fsum(float(count) * _SECONDS[unit.lower()] for count, unit in _PARTS.findall(match[1]))
    return {"true": 1.0, "false": 0.0}.get(text.lower())


def _read_array(
    program: Program, declared: re.Match[str], text: str, offset: int, scalars: Mapping[str, float]
) -> _Array | None:
    """Return an array if its values are numbers; None also of a single one where more are declared.

    Raises:
        LogError: If its list has no end, or other than as many values as declared.
    """
    name = declared["name"]
    if text.startswith("[") and text.count("[") != text.count("]"):
        raise program.error(f"a list of {name} that does not end", "its values, then ];", offset)
    shape, first = list[int](), 1
    for ends in _BOUNDS.findall(declared["arrays"]):
        low, high = (scalars.get(end.strip().lower(), _number(end.strip())) for end in ends)
        size = math.nan if low is None or high is None else high - low + 1
        shape.append(max(0, int(size)) if math.isfinite(size) else 0)  # 0: not known
        first = int(low) if low is not None and math.isfinite(low) else 1
    shape = shape or [0]
    known = math.prod(size for size in shape if size)
    try:
        values = _values(text, MAX_VALUES if 0 in shape else known)
    except OverflowError:
        raise program.error(f"more than {MAX_VALUES} values in {name}", "as many as that", offset) from None
    except ValueError:
        return None
    if len(values) == 1 < known:
        return None
    if shape.count(0) == 1 and len(values) % known == 0:
        shape[shape.index(0)] = len(values) // known
    if len(values) != math.prod(shape):
        allowed = f"{' x '.join(str(size or '?') for size in shape)}, as it is declared"
        raise program.error(f"{len(values)} values in {name}", allowed, offset)
    return _Array(name, values, tuple(shape), first)


def _values(text: str, most: int) -> FloatArray:
    """Return the numbers of a list, flat: it may have brackets, and n(values) repeats them.

    More than `most` repetitions count as one more than that.

    Raises:
        ValueError: If it holds anything but numbers.
        OverflowError: If they are more than `MAX_VALUES`.
    """
    try:
        inside = text.removeprefix("[").removesuffix("]").replace("_", "")
        return np.array([float(cell) for cell in inside.split(",")])
    except ValueError:
        pass
    numbers: list[list[float]] = [[]]
    counts: list[int] = []
    tokens = _TOKENS.findall(text)
    for token, following in zip(tokens, [*tokens[1:], ""], strict=True):
        if following == "(":
            counts.append(min(int(token), most + 1))
        elif token == "(":
            numbers.append([])
        elif token == ")" and counts:
            repeated, count = numbers.pop(), counts.pop()
            if len(numbers[-1]) + len(repeated) * count > MAX_VALUES:
                raise OverflowError
            numbers[-1] += repeated * count
        elif token not in "[],":
            if (number := _number(token)) is None:
                raise ValueError(token)
            numbers[-1].append(number)
    return np.array(numbers[0])


def _columns(program: Program, arrays: Sequence[_Array]) -> dict[str, FloatArray]:
    """Return the columns of the arrays by name, those of an array of two dimensions numbered as it is.

    Its rows are the first index, unless only the second has as many values as the plain arrays, or the first
    has few and the second more than any arm has joints. The last index runs fastest.

    Raises:
        LogError: If their lengths differ.
    """
    plain = {array.shape[0] for array in arrays if len(array.shape) == 1}
    columns, by_length = dict[str, FloatArray](), dict[int, list[str]]()
    for name, values, shape, first in arrays:
        if len(shape) == 1:
            parts = {name: values}
        else:
            matrix = values.reshape(shape[0], -1)
            high, wide = matrix.shape
            matrix = (
                matrix.T if wide in plain or (high not in plain and high <= MAX_COLUMNS < wide) else matrix
            )
            parts = {f"{name}_{first + k}": column.copy() for k, column in enumerate(matrix.T)}
        columns |= parts
        by_length.setdefault(len(next(iter(parts.values()))), []).append(name)
    if len(by_length) > 1:
        counts = (f"{n} values in {shortened(', '.join(names))}" for n, names in by_length.items())
        delete = Hint("", effect="delete the arrays that are not columns of the log")
        raise program.error("; ".join(counts), "arrays of one length", None, delete)
    return columns


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
    _Language(
        "a Fanuc program (/PROG)",
        re.compile(r"\A\s*/PROG\b"),
        re.compile(r"^\s*\d+:\s*!.*", re.MULTILINE),
        _read_fanuc,
    ),
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
        _read_arrays,
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
