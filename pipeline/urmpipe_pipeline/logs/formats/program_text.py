"""The text of a robot's or PLC's program, and the arrays that structured text (IEC 61131-3) declares.

    phi_1 : ARRAY[1..4] OF REAL := [0.0, 0.1, 2(0.5)];    (* 2(0.5) is 0.5, 0.5 *)
    sample_time : LREAL := 0.0008;

1. `Program`: the text with comments as spaces, its statements and line numbers, errors about a place in it.
2. `read_arrays`: arrays of one length are columns; of two dimensions each column of the array is one.
3. A scalar that is named like the time between samples gives the clock, unless an array holds the times.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.arrays import has_clock, is_period, times_of_period
from urmpipe_pipeline.logs.formats.memory import MemoryTable, arrow_column
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.vocabulary import SURELY_SECONDS, split_unit, vocabulary

MAX_VALUES = 4_000_000  # of an array: a few letters repeat as many numbers as one likes
MAX_COLUMNS = 32  # of an array of two dimensions that has fewer rows than columns
MIN_MICROSECONDS = 50.0  # a time between samples of this or more may be a controller's cycle in us

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


class _Array(NamedTuple):
    """An array: its name, its values flat, the sizes of its dimensions, the first index of the last one."""

    name: str
    values: FloatArray
    shape: tuple[int, ...]
    first: int


class _Scalar(NamedTuple):
    """A scalar: its name, its value (of a duration in [s]), its text and the offset of its declaration."""

    name: str
    value: float
    text: str
    offset: int


def read_arrays(program: Program) -> MemoryTable:
    """Return the arrays of a program in structured text as a table.

    Raises:
        LogError: If none has values, if their lengths differ, or the time between samples is unclear.
    """
    scalars, texts = dict[str, _Scalar](), list[tuple[re.Match[str], str, int]]()
    for offset, statement in program.statements():
        head, sign, text = statement.partition(":=")
        declared, text = (_DECLARED.search(head) if sign else None), text.strip()
        if declared and declared["arrays"]:
            texts.append((declared, text, offset + declared.start()))
        elif declared and (value := _number(text)) is not None:
            name = declared["name"]
            scalars[name.lower()] = _Scalar(name, value, text, offset + declared.start())
    arrays = [array for item in texts if (array := _read_array(program, *item, scalars)) is not None]
    if not arrays:
        form = "name : ARRAY[1..n] OF REAL := [...]"
        raise program.error(f"{program.language} without an array of numbers", form)
    columns = _columns(program, arrays)
    rows = len(next(iter(columns.values())))
    count = f"{format_count(len(arrays), 'array')} of {rows} values"
    inferences = [Inference("program", "structured text", count)]
    period = None if has_clock(columns) else _find_period(program, [*scalars.values()])
    if period is not None:
        evidence = f"{period.name} := {period.text} in line {program.line(period.offset)}"
        times, inference = times_of_period(period.value, rows, evidence)
        columns, inferences = times | columns, [*inferences, inference]
    table = pa.table({name: arrow_column(values) for name, values in columns.items()})
    return MemoryTable(program.path.stem, table, path=program.path, inferences=tuple(inferences))


def _number(text: str) -> float | None:
    """Return the number of a literal, of a duration such as T#4ms in [s]; None of any other text."""
    if (match := _NUMBER.fullmatch(text)) is not None:
        return float(match[1].replace("_", ""))
    if (match := _DURATION.fullmatch(text.replace("_", ""))) is not None:
        return math.fsum(float(count) * _SECONDS[unit.lower()] for count, unit in _PARTS.findall(match[1]))
    return {"true": 1.0, "false": 0.0}.get(text.lower())


def _read_array(
    program: Program, declared: re.Match[str], text: str, offset: int, scalars: Mapping[str, _Scalar]
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
        low, high = (
            scalars[end.strip().lower()].value if end.strip().lower() in scalars else _number(end.strip())
            for end in ends
        )
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


def _find_period(program: Program, scalars: Sequence[_Scalar]) -> _Scalar | None:
    """Return the scalar that is the time between samples, its value in [s]; None without one.

    Raises:
        LogError: If several differ, or one may be in s or in ms.
    """
    if program.options.time is not None or program.options.period is not None:
        return None
    periods = [
        scalar._replace(value=_seconds(program, scalar))
        for scalar in scalars
        if scalar.value > 0 and is_period(scalar.name)
    ]
    if any(not math.isclose(periods[0].value, other.value, rel_tol=1e-9) for other in periods):
        hints = (Hint("period", other.value, f"takes {other.name}") for other in periods)
        fault = " and ".join(f"{other.name} := {other.text}" for other in periods)
        raise program.error(fault, "one time between rows", periods[0].offset, *hints)
    return periods[0] if periods else None


def _seconds(program: Program, scalar: _Scalar) -> float:
    """Return a time between samples in [s]: by the unit in its literal or name, or as it is small."""
    unit = vocabulary().unit(split_unit(scalar.name)[1] or "")
    if _DURATION.fullmatch(scalar.text.replace("_", "")):
        return scalar.value
    if unit is not None and unit.quantity == "time":
        return scalar.value * unit.factor
    if scalar.value <= SURELY_SECONDS:
        return scalar.value
    factors = {"s": 1.0, "ms": 1e-3} | ({"us": 1e-6} if scalar.value >= MIN_MICROSECONDS else {})
    hints = (
        Hint("period", float(f"{scalar.value * factor:.12g}"), f"reads it in {name}")
        for name, factor in factors.items()
    )
    fault = f"{scalar.name} := {shortened(scalar.text)} and no unit"
    raise program.error(fault, "a time between rows in s", scalar.offset, *hints)
