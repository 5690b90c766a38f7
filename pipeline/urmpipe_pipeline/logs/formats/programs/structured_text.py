"""Structured text of PLCs (IEC 61131-3): declarations of arrays with their values.

    phi_1 : ARRAY[1..4] OF REAL := [0.0, 0.1, 2(0.5)];    (* 2(0.5) is 0.5, 0.5 *)
    sample_time : LREAL := 0.0008;

Arrays of one length are the columns of a table; of two dimensions each column of theirs is one. A scalar
that is named like the time between samples is the clock's period, unless an array holds the times.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Hint
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.formats.numbers import arrow_column
from urmpipe_pipeline.logs.formats.programs.program import Program, shortened
from urmpipe_pipeline.logs.vocabulary import SURELY_SECONDS, key, split_unit, vocabulary

_DECLARED = re.compile(
    r"(?<!\w)(?P<name>\w+)\s*(?:AT\s*%[\w.*]+\s*)?:\s*"
    r"(?P<arrays>(?:ARRAY\s*\[[^\[\]]{0,200}\]\s*OF\s+)*)\w++[^:\[\]]*+$",
    re.IGNORECASE,
)
_BOUNDS = re.compile(r"([^\[,]+)\.\.([^\],]+)")
_TOKENS = re.compile(r"[^\[\](),\s]+|[\[\](),]")
_LENGTH = re.compile(r"L?T(?:IME)?#(?=\d)((?:\d+(?:\.\d+)?(?:d|h|ms|us|ns|m|s))+)", re.IGNORECASE)
_PARTS = re.compile(r"([\d.]+)(d|h|ms|us|ns|m|s)", re.IGNORECASE)
_SECONDS = {"d": 86400.0, "h": 3600.0, "m": 60.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_NUMBER = re.compile(r"(?:\w+#)?([+-]?\d[\d_]*(?:\.[\d_]+)?(?:e[+-]?\d+)?)", re.IGNORECASE)

_MOST = 4_000_000
"""Values of an array: repetitions would make more of a few letters."""

_WIDEST = 32
"""Columns of an array of two dimensions, at the most, that are believed where it has fewer rows."""


@dataclass(frozen=True, slots=True)
class _Array:
    """An array with its values, flat, and its dimensions; where it stands in the text."""

    name: str
    values: FloatArray
    shape: tuple[int, ...]
    first: int
    offset: int


@dataclass(frozen=True, slots=True)
class _Scalar:
    """A scalar with its value; whether that is a length of time, in [s]; its text and where it stands."""

    name: str
    value: float
    timed: bool
    text: str
    offset: int


def read(program: Program) -> MemoryTable:
    """Return the arrays of a program as a table.

    Raises:
        LogError: If there are none with values, if their lengths differ, or the time between samples is
            unclear.
    """
    declared = list(_declarations(program))
    scalars = {one.name.lower(): one for one in declared if isinstance(one, _Scalar)}
    arrays = [one for raw in declared if isinstance(raw, _Raw) for one in _array(program, raw, scalars)]
    if not arrays:
        raise program.error(
            f"{program.language} without an array of numbers", "name : ARRAY[1..n] OF REAL := [...]"
        )
    columns = _columns(program, arrays)
    rows = len(next(iter(columns.values())))
    found = Inference("program", "structured text", f"{format_count(len(arrays), 'array')} of {rows} values")
    clock, said = _clock(program, columns, list(scalars.values()), rows)
    table = pa.table({name: arrow_column(values) for name, values in (*clock.items(), *columns.items())})
    return MemoryTable(program.path.stem, table, path=program.path, inferences=(found, *said))


@dataclass(frozen=True, slots=True)
class _Raw:
    """An array as it is declared: its bounds and the text of its values."""

    name: str
    bounds: tuple[tuple[str, str], ...]
    text: str
    offset: int


def _declarations(program: Program) -> Iterator[_Raw | _Scalar]:
    """Yield what is declared with a value that may be numbers."""
    for offset, statement in program.statements():
        head, sign, text = statement.partition(":=")
        match = _DECLARED.search(head) if sign else None
        if match is None:
            continue
        at = offset + match.start()
        if match["arrays"]:
            bounds = _BOUNDS.findall(match["arrays"])
            yield _Raw(match["name"], tuple(bounds), text.strip(), at)
        elif (value := _number(text.strip())) is not None:
            timed = _LENGTH.fullmatch(text.strip().replace("_", "")) is not None
            yield _Scalar(match["name"], value, timed, text.strip(), at)


def _number(text: str) -> float | None:
    """Return the number that a literal is; of a length of time such as T#4ms that in [s]; None of others."""
    if (match := _NUMBER.fullmatch(text)) is not None and not re.match(r"\d+#", text):
        return float(match[1].replace("_", ""))
    if (match := _LENGTH.fullmatch(text.replace("_", ""))) is not None:
        return math.fsum(float(count) * _SECONDS[unit.lower()] for count, unit in _PARTS.findall(match[1]))
    return {"true": 1.0, "false": 0.0}.get(text.lower())


def _array(program: Program, raw: _Raw, scalars: Mapping[str, _Scalar]) -> Iterator[_Array]:
    """Yield an array if its values are numbers, as many as are declared.

    Raises:
        LogError: If its list has no end, or holds more or fewer values than declared. A single one where more
            are declared only sets the first: it is no list of samples.
    """
    if raw.text.startswith("[") and raw.text.count("[") != raw.text.count("]"):
        raise program.error(f"a list of {raw.name} that does not end", "its values, then ];", raw.offset)
    shape, first = _shape(raw, scalars)
    known = math.prod(size for size in shape if size)
    try:
        values = _values(raw.text, _MOST if 0 in shape else known)
    except OverflowError:
        raise program.error(
            f"more than {_MOST} values in {raw.name}", "as many as that", raw.offset
        ) from None
    except ValueError:
        return
    if len(values) == 1 < known:
        return
    if shape.count(0) == 1 and len(values) % known == 0:
        shape[shape.index(0)] = len(values) // known
    if len(values) != math.prod(shape):
        allowed = " x ".join(str(size or "?") for size in shape)
        raise program.error(
            f"{len(values)} values in {raw.name}", f"{allowed}, as it is declared", raw.offset
        )
    yield _Array(raw.name, values, tuple(shape), first, raw.offset)


def _shape(raw: _Raw, scalars: Mapping[str, _Scalar]) -> tuple[list[int], int]:
    """Return the sizes of an array's dimensions, 0 for an unknown one, and the first index of the last."""
    sides = [tuple(_bound(end, scalars) for end in ends) for ends in raw.bounds]
    sizes = (math.nan if low is None or high is None else high - low + 1 for low, high in sides)
    shape = [max(0, int(size)) if math.isfinite(size) else 0 for size in sizes]
    first = sides[-1][0] if sides and math.isfinite(sides[-1][0] or 0) else None
    return shape or [0], 1 if first is None else int(first)


def _bound(text: str, scalars: Mapping[str, _Scalar]) -> float | None:
    """Return a bound of an array: a number, or a constant's; None of one that is computed or not there."""
    constant = scalars.get(text.strip().lower())
    return _number(text.strip()) if constant is None else constant.value


def _values(text: str, most: int) -> FloatArray:
    """Return the numbers of a list, flat: brackets may stand in it, and n(values) repeats them.

    A number of repetitions beyond `most` counts as one more than that.

    Raises:
        ValueError: If it holds something else than numbers.
        OverflowError: If they are more than `_MOST`.
    """
    inside = text.removeprefix("[").removesuffix("]").replace("_", "")
    try:
        return np.array([float(text) for text in inside.split(",")])
    except ValueError:
        pass
    kept: list[list[float]] = [[]]
    times: list[int] = []
    tokens = _TOKENS.findall(text)
    for token, following in zip(tokens, [*tokens[1:], ""], strict=True):
        if following == "(":
            times.append(int(token))
        elif token == "(":
            kept.append([])
        elif token == ")" and times:
            repeated, count = kept.pop(), times.pop()
            count = min(count, most + 1)
            if len(kept[-1]) + len(repeated) * count > _MOST:
                raise OverflowError
            kept[-1] += repeated * count
        elif token not in "[],":
            number = _number(token)
            if number is None:
                raise ValueError(token)
            kept[-1].append(number)
    return np.array(kept[0])


def _columns(program: Program, arrays: Sequence[_Array]) -> dict[str, FloatArray]:
    """Return the columns of the arrays by name.

    Raises:
        LogError: If their lengths differ.
    """
    plain = {array.shape[0] for array in arrays if len(array.shape) == 1}
    split = {array.name: _split(array, plain) for array in arrays}
    lengths = {name: len(next(iter(columns.values()))) for name, columns in split.items()}
    if len(set(lengths.values())) > 1:
        by_length: dict[int, list[str]] = {}
        for name, length in lengths.items():
            by_length.setdefault(length, []).append(name)
        parts = (f"{n} values in {shortened(', '.join(names))}" for n, names in by_length.items())
        delete = Hint("", effect="delete the arrays that are not columns of the log")
        raise program.error("; ".join(parts), "arrays of one length", None, delete)
    return {name: values for columns in split.values() for name, values in columns.items()}


def _split(array: _Array, rows: set[int]) -> dict[str, FloatArray]:
    """Return the columns of an array: of two dimensions several, numbered as it is.

    The last index runs fastest. Rows are the first index, unless only the second has as many values as the
    plain arrays, or the first has few and the second more than any arm has joints.
    """
    if len(array.shape) == 1:
        return {array.name: array.values}
    matrix = array.values.reshape(array.shape[0], -1)
    first, second = matrix.shape
    if second in rows or (first not in rows and first <= _WIDEST < second):
        matrix = matrix.T
    return {f"{array.name}_{array.first + k}": values.copy() for k, values in enumerate(matrix.T)}


def _clock(
    program: Program, columns: Mapping[str, FloatArray], scalars: Sequence[_Scalar], rows: int
) -> tuple[dict[str, IntArray], tuple[Inference, ...]]:
    """Return a column of times in [ns] from the time between samples, and what it rests on; or nothing.

    Raises:
        LogError: If that is unclear.
    """
    words = vocabulary()
    if program.options.time is not None or program.options.period is not None:
        return {}, ()
    if any(pattern.search(key(split_unit(name)[0])) for name in columns for pattern in words.time):
        return {}, ()
    named = [one for one in scalars if one.value > 0 and any(p.search(key(one.name)) for p in words.period)]
    periods = {one: _seconds(program, one) for one in named}
    if not periods:
        return {}, ()
    scalar, period = next(iter(periods.items()))
    if any(not math.isclose(period, other, rel_tol=1e-9) for other in periods.values()):
        hints = (Hint("period", other, f"takes {one.name}") for one, other in periods.items())
        found = " and ".join(f"{one.name} := {one.text}" for one in periods)
        raise program.error(found, "one time between rows", scalar.offset, *hints)
    evidence = f"{scalar.name} := {scalar.text} in line {program.line(scalar.offset)}"
    said = Inference("period", f"{period:g} s", evidence, hints=(Hint("period"),))
    times = np.rint(np.arange(rows) * (period * 1e9)).astype(np.int64)
    return {"t [ns]": times}, (said,)


def _seconds(program: Program, scalar: _Scalar) -> float:
    """Return a time between samples in [s]: its literal or its name says the unit, or it is small enough.

    Raises:
        LogError: If it may be in s or in ms.
    """
    unit = vocabulary().unit(split_unit(scalar.name)[1] or "")
    if scalar.timed:
        return scalar.value
    if unit is not None and unit.quantity == "time":
        return scalar.value * unit.factor
    if scalar.value <= SURELY_SECONDS:
        return scalar.value
    units = {"s": scalar.value, "ms": float(f"{scalar.value * 1e-3:.12g}")}
    if scalar.value >= 50.0:  # a controller's cycle in us
        units["us"] = float(f"{scalar.value * 1e-6:.12g}")
    hints = (Hint("period", value, f"reads it in {name}") for name, value in units.items())
    found = f"{scalar.name} := {shortened(scalar.text)} and no unit"
    raise program.error(found, "a time between rows in s", scalar.offset, *hints)
