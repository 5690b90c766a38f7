"""Tables in memory: an Arrow table in the place of text, its columns read as those of a CSV file would be."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_pipeline.joint_log import SourceFile
from urmpipe_pipeline.sources.cells.cell import LONGEST_NS, to_nanoseconds
from urmpipe_pipeline.sources.cells.text_cells import TextCells
from urmpipe_pipeline.sources.tables.numbers import NO_TIME, UNREADABLE, ClockColumn, Numbers
from urmpipe_pipeline.sources.tables.sniff import SAMPLED_LINES, Layout
from urmpipe_pipeline.sources.tables.text import Segment

_DIGITS = 38
"""Digits that a decimal of 128 bits holds."""


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """A table in memory.

    Attributes:
        name: What the log is called, in the place of a file's stem.
        columns: The columns, an Arrow table: of numbers, texts, dates or lengths of time.
        named: Whether its columns have names; without them they are known by number, from 1.
        path: The file that it was read from; None of an object in memory.
    """

    name: str
    columns: pa.Table
    named: bool = True
    path: Path | None = None

    @property
    def place(self) -> Path:
        """What messages name: its file, or its name."""
        return self.path or Path(self.name)


def layout_of(held: Held) -> Layout:
    """Return a table in memory as one that is written somewhere: its first rows as a CSV file has them."""
    table = held.columns
    columns = [_texts(column.slice(0, SAMPLED_LINES)).to_pylist() for column in table.columns]
    sample = tuple(tuple(cell or "" for cell in row) for row in zip(*columns, strict=True))
    names = tuple(table.column_names) if held.named else tuple(str(k + 1) for k in range(table.num_columns))
    return Layout(
        segment=Segment(held.place, "", 0, 0, 1, ""),
        delimiter=",",
        decimal=".",
        names=names,
        units=(),
        header=1 if held.named else None,
        first_line=2 if held.named else 1,
        offset=0,
        sample=sample,
        inferences=(),
        held=table,
    )


def fingerprint_of(held: Held) -> SourceFile:
    """Return the name of a table in memory, and hash and length of its numbers as bytes."""
    digest, size = hashlib.sha256(), 0
    for column in held.columns.columns:
        for chunk in column.chunks:
            for buffer in filter(None, chunk.buffers()):
                digest.update(buffer)
                size += buffer.size
    return SourceFile(held.name, digest.hexdigest(), size)


def read_held(layout: Layout, columns: Sequence[int], clock: Sequence[ClockColumn]) -> Numbers:
    """Return the numbers of some columns of a table in memory; arguments as those of `read_table`."""
    table = layout.held
    values = np.empty((table.num_rows, len(columns)))
    for j, column in enumerate(columns):
        values[:, j] = numbers_of(table.column(column))
    texts = tuple(_text_cells(table.column(part.column)) for part in clock if part.forms)
    if not clock:
        return Numbers(values, None)
    times = np.zeros(table.num_rows, dtype=np.int64)
    for part in () if texts else clock:
        own = _nanoseconds(table.column(part.column), part.exponent)
        times = np.where((own <= UNREADABLE) | (times <= UNREADABLE), np.minimum(own, times), times + own)
    return Numbers(values, times, texts=texts)


def numbers_of(column: pa.ChunkedArray) -> FloatArray:
    """Return a column as numbers, NaN where there is none, shape (n,); of texts those that they spell."""
    kind = column.type
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)):
        if not (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
            return np.full(len(column), np.nan)
        import pyarrow.compute as pc

        trimmed = pc.utf8_trim_whitespace(column)
        numeric = pc.match_substring_regex(trimmed, r"^[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?$")
        column = pc.if_else(numeric, trimmed, None)
    numbers = column.cast(pa.float64())
    return np.asarray(numbers.to_numpy(zero_copy_only=False), dtype=np.float64)


def _texts(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return a column as a CSV file has it: the shortest digits that are its numbers'."""
    return column.cast(pa.string())


def _text_cells(column: pa.ChunkedArray) -> TextCells:
    """Return a column of text as cells; empty ones where there is no value."""
    return TextCells.of(cell or "" for cell in _texts(column).to_pylist())


def _nanoseconds(column: pa.ChunkedArray, exponent: int) -> IntArray:
    """Return a column of a clock in integer [ns], shape (n,), rounded once from the shortest digits.

    NO_TIME where there is no value, UNREADABLE where it is no time that 64 bits hold.
    """
    missing = np.asarray(column.is_null(nan_is_null=True))
    if pa.types.is_integer(column.type):
        whole = np.asarray(column.fill_null(0).to_numpy(), dtype=np.int64)
        far = np.abs(whole) >= LONGEST_NS // 10**exponent
        return np.where(missing, NO_TIME, np.where(far, UNREADABLE, whole * 10**exponent))
    far = np.abs(numbers_of(column)) * 10.0**exponent
    readable = ~missing & (far < LONGEST_NS)
    times = np.where(missing, NO_TIME, UNREADABLE)
    times[readable] = _rounded(column.filter(pa.array(readable)), exponent)
    return times


def _rounded(column: pa.ChunkedArray, exponent: int) -> IntArray:
    """Return finite numbers times ten to a power, rounded once, half to even, from their shortest digits."""
    import pyarrow.compute as pc

    texts = column.cast(pa.string())
    try:
        exact = texts.cast(pa.decimal128(_DIGITS, _DIGITS // 2))
    except pa.ArrowInvalid:  # more decimals than that: many of them behind zeros
        return np.array([to_nanoseconds(text, ".", exponent) for text in texts.to_pylist()], dtype=np.int64)
    rounded = pc.round(exact, ndigits=exponent, round_mode="half_to_even")
    fixed = rounded.cast(pa.decimal128(_DIGITS, exponent)).combine_chunks()
    words = np.frombuffer(fixed.buffers()[1], dtype="<i8").reshape(-1, 2)
    return words[fixed.offset : fixed.offset + len(fixed), 0]  # the low word of two: they fit
