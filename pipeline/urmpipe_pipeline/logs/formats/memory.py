"""Tables in memory: an Arrow table in the place of text, its columns read as those of a CSV file would be.

1. `plain_table`: columns of any type as numbers and texts. Structs become a column per field, NAME.FIELD;
   lists a column per entry, NAME_1, NAME_2, ...
2. `to_log_table`: an `ArrowTable`, with the cells of its first rows as a CSV file has them.
3. Numbers are read as doubles, a clock in integer [ns] from the shortest digits of its numbers.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, LogError, format_value
from urmpipe_pipeline.joint_log import Inference, LogWarning, SourceFile
from urmpipe_pipeline.logs.formats.cells import (
    MAX_NS,
    TextCells,
    is_text,
    printable,
    to_float,
    to_nanoseconds,
)
from urmpipe_pipeline.logs.formats.clock_forms import NO_TIME, UNREADABLE
from urmpipe_pipeline.logs.formats.log_table import MAX_SAMPLED_ROWS, ClockColumn, LogTable, Numbers, RowFault
from urmpipe_pipeline.logs.formats.row_form import spread_names
from urmpipe_pipeline.logs.formats.sniff import only_count
from urmpipe_pipeline.logs.formats.text import MAX_TABLE_COLUMNS, check_width
from urmpipe_pipeline.logs.formats.text_table import MAY_BE_MISSING, find_missing
from urmpipe_pipeline.logs.vocabulary import vocabulary

UNIT, ROLE = b"unit", b"role"  # keys of the unit of a column, and of its role and place
JOINT = b"joint"  # the role of a column that is a joint, but in no known place
USUAL_SHARE = 0.9  # of the lists of a column that have one length, where the others are damaged

_DIGITS = 38  # of a decimal of 128 bits, half of them after the point
_SMALL = 0.01  # doubles of this size or more have no more decimals than that: 17 digits are theirs
_ULPS = 4  # units in the last place that a product of two doubles may be off that of their digits
_PLAIN: Mapping[str, np.dtype[Any]] = {
    "b": np.dtype(np.uint8),
    "f2": np.dtype(np.float32),
    "f16": np.dtype(np.float64),
}  # for types that Arrow does not have, or cannot write as text

Number = TypeVar("Number", np.float64, np.int64, np.uint64)


@dataclass(frozen=True, slots=True, eq=False)
class MemoryTable:
    """A table in memory.

    Attributes:
        name: What the log is called, in the place of a file's stem.
        columns: The columns, an Arrow table; units and roles may be in the metadata of its fields.
        named: Whether its columns have names; without them they are known by number, from 1.
        path: The file that it was read from; None of an object in memory.
        inferences: What was found out about it.
        applied: The reading options that its file was read by, such as "episode": they are done with.
        source: Name of the source that its schema states, which defines units.
        warnings: Warnings about its file.
    """

    name: str
    columns: pa.Table
    named: bool = True
    path: Path | None = None
    inferences: tuple[Inference, ...] = ()
    applied: tuple[str, ...] = ()
    source: str = ""
    warnings: tuple[LogWarning, ...] = ()

    @property
    def place(self) -> Path:
        """What messages name: its file, or its name."""
        return self.path or Path(self.name)


def fingerprint_of(memory: MemoryTable) -> SourceFile:
    """Return the name of a table in memory, and hash and length of its columns as Arrow streams them."""
    table, sink = memory.columns.combine_chunks(), pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema.remove_metadata()) as stream:
        stream.write_table(table.replace_schema_metadata(None))
    data = sink.getvalue()
    return SourceFile(memory.name, hashlib.sha256(data).hexdigest(), data.size)


# Columns of any type


def plain_table(table: pa.Table, place: str) -> pa.Table:
    """Return a table of numbers and texts alone, its names without blanks around them.

    Args:
        table: Columns of any type; units and roles may be in the metadata of their fields.
        place: The file, or what a table in memory is called, for errors.

    Raises:
        LogError: If a list has another length than those of nearly all other rows.
    """
    pairs = zip(table.schema, table.columns, strict=True)
    flat = (plain for field, column in pairs for plain in _flatten(field, column, place))
    columns = list(islice(flat, MAX_TABLE_COLUMNS + 1))
    check_width(len(columns), place)
    fields = [
        pa.field(printable(field.name.strip()), column.type, metadata=field.metadata)
        for field, column in columns
    ]
    schema = pa.schema(fields, table.schema.metadata)
    return pa.Table.from_arrays([column for _, column in columns], schema=schema)


def is_numeric(kind: pa.DataType) -> bool:
    """Return whether a type is that of numbers."""
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind))


def is_list(kind: pa.DataType) -> bool:
    """Return whether a column has lists, of one length or not."""
    return bool(pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind))


def arrow_column(values: NDArray[Any]) -> pa.Array:
    """Return values in any unit, shape (n,), as a column of their type."""
    kind = values.dtype
    if kind.kind in "mM":
        return pa.array(values)
    plain = _PLAIN.get(kind.kind, _PLAIN.get(kind.str[1:], kind.newbyteorder("=")))
    values = np.ascontiguousarray(values, dtype=plain)
    buffers = [None, pa.py_buffer(values)]  # pyarrow.array imports pandas, which takes a second
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), buffers)


def _flatten(
    field: pa.Field, column: pa.ChunkedArray, place: str
) -> Iterator[tuple[pa.Field, pa.ChunkedArray]]:
    """Yield a column, or those of a struct, or of lists of one length. Lists of many lengths are left out."""
    kind = column.type
    if isinstance(kind, pa.BaseExtensionType):
        yield from _flatten(field, column.cast(kind.storage_type), place)
    elif pa.types.is_dictionary(kind):
        values = [_without_view(chunk.dictionary).take(chunk.indices) for chunk in column.chunks]
        yield from _flatten(field, pa.chunked_array(values, None if values else pa.null()), place)
    elif pa.types.is_struct(kind):
        for inner, values in zip(kind, column.flatten(), strict=True):
            yield from _flatten(inner.with_name(f"{field.name}.{inner.name}"), values, place)
    elif pa.types.is_duration(kind):
        yield field.with_metadata({UNIT: kind.unit}), column.cast(pa.int64())
    elif not is_list(kind):
        yield field, _to_numbers_or_texts(column)
    else:
        lengths = np.asarray(pc.list_value_length(column).fill_null(-1).to_numpy())
        present = lengths[lengths >= 0]
        usual = int(np.bincount(present).argmax()) if len(present) else 0
        other = np.flatnonzero((lengths >= 0) & (lengths != usual))
        if not usual or len(other) > (1.0 - USUAL_SHARE) * len(present):
            return
        if len(other):
            fault, allowed = f"{lengths[other[0]]} entries", f"{usual}, as in the other rows"
            row = int(other[0]) + 1
            raise LogError(Finding(file=place, row=row, column=field.name, found=fault, allowed=allowed))
        check_width(usual, place)
        for k, name in enumerate(spread_names([field.name], [usual])):
            yield from _flatten(field.with_name(name), pc.list_element(column, k), place)


def _without_view(values: Any) -> Any:
    """Return texts of the type `string_view`, which many functions of Arrow do not take, as `string`."""
    return values.cast(pa.string()) if pa.types.is_string_view(values.type) else values


def _to_numbers_or_texts(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return numbers and texts as they are, all else as texts; of dates without times the days alone."""
    kind, types = column.type, pa.types
    if types.is_null(kind) or types.is_float16(kind):
        return column.cast(pa.float32())
    if is_numeric(kind):
        return column
    if types.is_string(kind) or types.is_large_string(kind) or types.is_string_view(kind):
        return pc.utf8_trim_whitespace(_without_view(column))
    if types.is_timestamp(kind) and kind.tz is None:
        days = pc.floor_temporal(column, unit="day")
        column = column.cast(pa.date32()) if pc.all(pc.equal(days, column)).as_py() else column
    if types.is_timestamp(kind) or types.is_date(kind) or types.is_time(kind):
        return column.cast(pa.string())
    texts = (None if value is None else printable(str(value)) for value in column.to_pylist())
    return pa.chunked_array([pa.array(texts, pa.string())])


# The table of a log


@dataclass(frozen=True, eq=False, kw_only=True)
class ArrowTable(LogTable):
    """A table in memory, as a log.

    Attributes:
        place: Its file, or its name.
    """

    place: Path

    @property
    def path(self) -> Path:
        """The file that it was read from, or its name."""
        return self.place

    def _read(
        self, columns: Sequence[int], clock: Sequence[ClockColumn], allowed: Mapping[int, str]
    ) -> Numbers:
        table = self.arrow
        values = np.empty((table.num_rows, len(columns)))
        faults: dict[int, list[RowFault]] = {}
        for j, column in enumerate(columns):
            values[:, j], wrong = numbers_of(table.column(column))
            for row, text in wrong.items():
                message = f"found {format_value(text)}, allowed: {MAY_BE_MISSING}"
                faults.setdefault(row, []).append(RowFault(message, (self.names[column],)))
        findings = tuple(
            Finding(fault.message, self.file, row=self.file_row(row + 1), column=fault.columns[0])
            for row in sorted(faults)
            for fault in faults[row]
        )
        rows = None if self.rows is None else self.rows + 1
        faulty = (findings, faults, 0, rows)
        if not clock:
            return Numbers(values, None, *faulty)
        texts = tuple(_text_cells(table.column(part.column)) for part in clock if part.forms)
        times = np.zeros(table.num_rows, dtype=np.int64)
        for part in () if texts else clock:
            part_times = _nanoseconds(table.column(part.column), part.exponent)
            is_known = (part_times > UNREADABLE) & (times > UNREADABLE)
            times = np.where(is_known, times + part_times, np.minimum(part_times, times))
        return Numbers(values, times, *faulty, texts=texts)

    def count_rows(self) -> int:
        """Return the number of rows."""
        return int(self.arrow.num_rows)

    def iter_cells(self) -> Iterator[list[str]]:
        """Yield the cells of each row as text."""
        columns = (column.cast(pa.string()).to_pylist() for column in self.arrow.columns)
        yield from ([cell or "" for cell in row] for row in zip(*columns, strict=True))

    def take(self, rows: IntArray, *inferences: Inference) -> Self:
        """Return the table of some of its rows, by index from 0, ascending, shape (k,)."""
        return replace(
            self,
            rows=rows if self.rows is None else self.rows[rows],
            arrow=(arrow := self.arrow.take(arrow_column(rows))),
            sample=_sample_cells(arrow),
            inferences=(*self.inferences, *inferences),
        )

    def lines_of(self, rows: Sequence[int]) -> dict[int, int]:
        """Return nothing: a table in memory has no lines."""
        return {}


def to_log_table(memory: MemoryTable) -> ArrowTable:
    """Return a table in memory as one that is written somewhere: its first rows as a CSV file has them.

    Raises:
        LogError: If it has no row, or no column of numbers.
    """
    file, labels = str(memory.place), memory.columns.column_names
    if not memory.columns.num_rows or not labels:
        raise LogError(Finding("found a table without rows, allowed: one row per sample", file))
    table = plain_table(memory.columns, file)
    sample = _sample_cells(table)
    if all(is_text(cell, ".") for row in sample for cell in row if cell):
        names = ", ".join(map(str, labels[:8]))
        raise LogError(Finding(f"found no number in {names}, allowed: one column per joint", file))
    named = memory.named and not only_count(table.column_names)
    units = tuple((field.metadata or {}).get(UNIT, b"").decode(errors="replace") for field in table.schema)
    known = tuple(unit if vocabulary().unit(unit) else "" for unit in units)
    return ArrowTable(
        place=memory.place,
        names=tuple(table.column_names if named else map(str, range(1, table.num_columns + 1))),
        units=known if any(known) else (),
        header=1 if named else None,
        first_line=2 if named else 1,
        sample=sample,
        inferences=memory.inferences,
        arrow=table,
        applied=memory.applied,
    )


def _sample_cells(table: pa.Table) -> tuple[tuple[str, ...], ...]:
    """Return the cells of the first rows of a table in memory, as a CSV file has them."""
    columns = [_texts(column.slice(0, MAX_SAMPLED_ROWS)).to_pylist() for column in table.columns]
    return tuple(tuple(cell or "" for cell in row) for row in zip(*columns, strict=True))


def _texts(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return a column as a CSV file has it: of numbers the shortest digits, of floats with a point."""
    texts = column.cast(pa.string()) if is_numeric(column.type) else column
    if not pa.types.is_floating(column.type):
        return texts
    return pc.replace_substring_regex(texts, r"^(-?\d+)$", r"\1.0")


def _text_cells(column: pa.ChunkedArray) -> TextCells:
    """Return a column of text as cells; empty ones where there is no value."""
    texts = _texts(column).cast(pa.large_string()).fill_null("").combine_chunks()
    _, offsets, data = texts.buffers()
    starts = np.frombuffer(offsets, dtype=np.int64)[texts.offset : texts.offset + len(texts) + 1]
    signs = np.frombuffer(data, dtype=np.uint8) if data else np.empty(0, dtype=np.uint8)
    return TextCells(signs, starts)


# Numbers and times


def numbers_of(column: pa.ChunkedArray) -> tuple[FloatArray, dict[int, str]]:
    """Return a column in its own unit, shape (n,), NaN where a text is no number, and these texts by row."""
    if is_numeric(column.type):
        double = pa.types.is_float64(column.type)
        numbers, missing = _values(column if double else column.cast(pa.float64(), safe=False), np.float64)
        numbers[missing] = np.nan
        return numbers, {}
    texts = column.to_pylist()
    parsed = [np.nan if text is None else to_float(text, ".") for text in texts]
    wrong = {row: texts[row] for row, value in enumerate(parsed) if value is None}
    return np.array([np.nan if value is None else value for value in parsed], dtype=np.float64), wrong


def _values(column: pa.ChunkedArray, kind: type[Number]) -> tuple[NDArray[Number], BoolArray]:
    """Return the values of a column of this type, shape (n,), and which of them are missing.

    Its buffers are read as they are: pyarrow's own way imports pandas.
    """
    values, missing = np.zeros(len(column), dtype=kind), np.zeros(len(column), dtype=np.bool_)
    end = 0
    for chunk in filter(len, column.chunks):
        start, end = end, end + len(chunk)
        inside = slice(chunk.offset, chunk.offset + len(chunk))
        values[start:end] = np.frombuffer(chunk.buffers()[1], dtype=kind)[inside]
        if chunk.null_count:
            missing[start:end] = find_missing(chunk)
    return values, missing


@np.errstate(over="ignore", invalid="ignore")
def _nanoseconds(column: pa.ChunkedArray, exponent: int) -> IntArray:
    """Return a column of a clock in integer [ns], shape (n,), rounded once from the shortest digits.

    A product of doubles is rounded, too: where it may be on the other side of a half, the digits decide.
    NO_TIME where there is no value, UNREADABLE where it is no time that 64 bits hold.
    """
    if pa.types.is_integer(column.type):
        unsigned = pa.types.is_uint64(column.type)
        integers, missing = (
            _values(column, np.uint64) if unsigned else _values(column.cast(pa.int64()), np.int64)
        )
        far = np.abs(integers.astype(np.float64)) * 10.0**exponent >= MAX_NS
        times = np.where(far | missing, 0, integers).astype(np.int64) * 10**exponent
        return np.where(missing, NO_TIME, np.where(far, UNREADABLE, times))
    values, wrong = numbers_of(column)
    product = values * 10.0**exponent
    near = np.rint(product)
    is_sure = np.abs(product - near) + _ULPS * np.spacing(np.abs(product)) < 0.5
    is_sure &= pa.types.is_float64(column.type)
    times = np.where(np.isnan(values), NO_TIME, UNREADABLE)
    times[list(wrong)] = UNREADABLE
    times[is_sure] = near[is_sure].astype(np.int64)
    rest = np.flatnonzero(~is_sure & (np.abs(product) < MAX_NS))
    is_long = is_numeric(column.type) & (np.abs(values[rest]) >= _SMALL)
    rows = rest[is_long]
    exact = column.take(arrow_column(rows)).cast(pa.string()).cast(pa.decimal128(_DIGITS, _DIGITS // 2))
    rounded = pc.round(exact, ndigits=exponent, round_mode="half_to_even")
    fixed = rounded.cast(pa.decimal128(_DIGITS, exponent)).combine_chunks()
    words = np.frombuffer(fixed.buffers()[1], dtype="<i8").reshape(-1, 2)[fixed.offset :]
    times[rows] = words[: len(rows), 0]  # the low word of two: they fit
    rows = rest[~is_long]
    texts = column.take(arrow_column(rows)).cast(pa.string()).to_pylist()
    short = (to_nanoseconds(text, ".", exponent) for text in texts)
    times[rows] = [UNREADABLE if time is None else time for time in short]
    return times
