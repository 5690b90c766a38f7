"""Tables in memory: an Arrow table in the place of text, its columns read as those of a CSV file would be."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self, TypeVar

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, LogError, format_value
from urmpipe_pipeline.joint_log import Inference, LogWarning, SourceFile
from urmpipe_pipeline.logs.formats.cells import (
    MAX_NS,
    TextCells,
    is_text,
    to_float,
    to_nanoseconds,
)
from urmpipe_pipeline.logs.formats.clock_forms import NO_TIME, UNREADABLE
from urmpipe_pipeline.logs.formats.log_table import MAX_SAMPLED_ROWS, LogTable
from urmpipe_pipeline.logs.formats.numbers import (
    MAX_FINDINGS,
    UNIT,
    ClockColumn,
    Numbers,
    RowFault,
    arrow_column,
    is_number,
)
from urmpipe_pipeline.logs.formats.sniff import only_count
from urmpipe_pipeline.logs.formats.text_table import MAY_BE_MISSING, find_missing
from urmpipe_pipeline.logs.vocabulary import vocabulary

_DIGITS = 38  # of a decimal of 128 bits
_DECIMALS = _DIGITS // 2  # those of them after the point
_SMALL = 0.01  # doubles of this size or more have no more decimals than that: 17 digits are theirs
_ULPS = 4  # units in the last place that a product of two doubles may be off that of the decimals

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
            for row in sorted(faults)[:MAX_FINDINGS]
            for fault in faults[row]
        )
        rows = None if self.rows is None else self.rows + 1
        faulty = (findings[:MAX_FINDINGS], sum(map(len, faults.values())), (), faults, 0, rows)
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
            sample=sampled_cells(arrow),
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
    from urmpipe_pipeline.logs.formats.arrow_columns import plain_table  # its imports take long

    table = plain_table(memory.columns, str(memory.place))
    _check_content(memory, table)
    named = memory.named and not only_count(table.column_names)
    names = tuple(table.column_names) if named else tuple(str(k + 1) for k in range(table.num_columns))
    units = tuple((field.metadata or {}).get(UNIT, b"").decode(errors="replace") for field in table.schema)
    known = tuple(unit if vocabulary().unit(unit) else "" for unit in units)
    return ArrowTable(
        place=memory.place,
        names=names,
        units=known if any(known) else (),
        header=1 if named else None,
        first_line=2 if named else 1,
        sample=sampled_cells(table),
        inferences=memory.inferences,
        arrow=table,
        applied=memory.applied,
    )


def sampled_cells(table: pa.Table) -> tuple[tuple[str, ...], ...]:
    """Return the cells of the first rows of a table in memory, as a CSV file has them."""
    columns = [_texts(column.slice(0, MAX_SAMPLED_ROWS)).to_pylist() for column in table.columns]
    return tuple(tuple(cell or "" for cell in row) for row in zip(*columns, strict=True))


def _check_content(memory: MemoryTable, table: pa.Table) -> None:
    """Raise a `LogError` if a table has no row, or none of its columns holds a number."""
    file = str(memory.place)
    if not memory.columns.num_rows or not memory.columns.num_columns:
        raise LogError(Finding("found a table without rows, allowed: one row per sample", file))
    first = (_texts(column.slice(0, MAX_SAMPLED_ROWS)).to_pylist() for column in table.columns)
    if all(is_text(cell, ".") for cells in first for cell in cells if cell):
        names = ", ".join(map(str, memory.columns.column_names[:8]))
        raise LogError(Finding(f"found no number in {names}, allowed: one column per joint", file))


def fingerprint_of(memory: MemoryTable) -> SourceFile:
    """Return the name of a table in memory, and hash and length of its columns as Arrow streams them."""
    sink = _Hashing()
    table = memory.columns.combine_chunks()
    with pa.ipc.new_stream(pa.PythonFile(sink, "w"), table.schema.remove_metadata()) as stream:
        stream.write_table(table.replace_schema_metadata(None))
    return SourceFile(memory.name, sink.digest.hexdigest(), sink.size)


class _Hashing:
    """A file of which only hash and length are kept."""

    closed = False

    def __init__(self) -> None:
        self.digest, self.size = hashlib.sha256(), 0

    def write(self, data: bytes) -> int:
        """Take some bytes."""
        self.digest.update(data)
        self.size += len(data)
        return len(data)

    def flush(self) -> None:
        """Keep nothing back."""


def numbers_of(column: pa.ChunkedArray) -> tuple[FloatArray, dict[int, str]]:
    """Return a column in its own unit, shape (n,), NaN where a text is no number, and these texts by row."""
    if is_number(column.type):
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


def _texts(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return a column as a CSV file has it: of numbers the shortest digits that are theirs."""
    from urmpipe_pipeline.logs.formats.arrow_columns import number_texts

    return number_texts(column) if is_number(column.type) else column


def _text_cells(column: pa.ChunkedArray) -> TextCells:
    """Return a column of text as cells; empty ones where there is no value."""
    texts = _texts(column).cast(pa.large_string()).fill_null("").combine_chunks()
    _, offsets, data = texts.buffers()
    starts = np.frombuffer(offsets, dtype=np.int64)[texts.offset : texts.offset + len(texts) + 1]
    signs = np.frombuffer(data, dtype=np.uint8) if data else np.empty(0, dtype=np.uint8)
    return TextCells(signs, starts)


def _nanoseconds(column: pa.ChunkedArray, exponent: int) -> IntArray:
    """Return a column of a clock in integer [ns], shape (n,), rounded once from the shortest digits.

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
    missing = np.isnan(values)
    missing[list(wrong)] = False
    readable = np.abs(values) * 10.0**exponent < MAX_NS
    times = np.where(missing, NO_TIME, UNREADABLE)
    times[readable] = _rounded(_at(column, readable), values[readable], exponent)
    return times


def _rounded(column: pa.ChunkedArray, values: FloatArray, exponent: int) -> IntArray:
    """Return finite numbers times ten to a power, rounded once, half to even, from their shortest digits.

    A product of doubles is rounded, too: where it may be on the other side of a half, the digits decide.
    """
    product = values * 10.0**exponent
    near = np.rint(product)
    sure = np.abs(product - near) + _ULPS * np.spacing(np.abs(product)) < 0.5
    sure &= pa.types.is_float64(column.type)
    result = near.astype(np.int64)
    if not sure.all():
        result[~sure] = _by_digits(_at(column, ~sure), values[~sure], exponent)
    return result


def _by_digits(column: pa.ChunkedArray, values: FloatArray, exponent: int) -> IntArray:
    """Return numbers times ten to a power, rounded once, half to even, from their shortest digits."""
    import pyarrow.compute as pc

    small = (np.abs(values) < _SMALL) | (not is_number(column.type))  # any decimals, or spelled in any way
    result = np.empty(len(values), dtype=np.int64)
    texts = column.cast(pa.string())
    few = _at(texts, small).to_pylist()
    result[small] = [to_nanoseconds(text, ".", exponent) or 0 for text in few]
    exact = _at(texts, ~small).cast(pa.decimal128(_DIGITS, _DECIMALS))
    rounded = pc.round(exact, ndigits=exponent, round_mode="half_to_even")
    fixed = rounded.cast(pa.decimal128(_DIGITS, exponent)).combine_chunks()
    words = np.frombuffer(fixed.buffers()[1], dtype="<i8").reshape(-1, 2)
    result[~small] = words[fixed.offset : fixed.offset + len(fixed), 0]  # the low word of two: they fit
    return result


def _at(column: pa.ChunkedArray, rows: BoolArray) -> pa.ChunkedArray:
    """Return some rows of a column."""
    return column if rows.all() else column.take(arrow_column(np.flatnonzero(rows)))
