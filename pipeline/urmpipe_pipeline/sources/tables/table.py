"""The numbers of a table, fast: pyarrow parses the columns that are needed straight into float64."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import csv

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.errors import Finding
from urmpipe_pipeline.joint_log import Inference, LogWarning
from urmpipe_pipeline.sources.cells.cell import is_number, plain, to_float
from urmpipe_pipeline.sources.cells.text_cells import TextCells
from urmpipe_pipeline.sources.cells.text_clock import Form
from urmpipe_pipeline.sources.tables.form import UnfitError
from urmpipe_pipeline.sources.tables.sniff import Layout
from urmpipe_pipeline.sources.tables.stream import BLOCK_BYTES, TableStream, as_written, open_table
from urmpipe_pipeline.sources.vocabulary import vocabulary

NO_TIME = np.iinfo(np.int64).min
"""Stands where a row has no time."""
REPORTED = NO_TIME + 1
"""Stands where a row has no time because of a finding that is reported already."""
UNREADABLE = NO_TIME + 2
"""Stands where the text of a row's time is none."""

_PRECISION = 38  # digits of a decimal128


@dataclass(frozen=True, slots=True)
class ClockColumn:
    """A column of the clock.

    Attributes:
        column: Its place.
        exponent: Power of ten from its unit to [ns]: 9 for s.
        forms: What its cells may be if they are text: then exponent means nothing.
    """

    column: int
    exponent: int = 0
    forms: tuple[Form, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Numbers:
    """What was read of a table.

    Attributes:
        values: Numbers in the file's own units, shape (n, columns); NaN where a sample is missing.
        clock: Time of each row in [ns] on the file's clock, shape (n,), or NO_TIME, REPORTED or UNREADABLE;
            None without a clock; without meaning while the texts of the clock are not read.
        findings: What is wrong with rows and cells, the first of them.
        wrong: How many such findings there are.
        lasting: Those of the findings that leaving out rows does not mend.
        unread: Rows that could not be read, by their index, with what is wrong with each.
        left_out: Lines among labelled rows that are none.
        rows: Data row of the file of each row, from 1, shape (n,), where some were left out.
        texts: The cells of the clock's columns, if they are text.
        inferences: What the clock's rows told about it.
        warnings: What a person should know about it.
    """

    values: FloatArray
    clock: IntArray | None
    findings: tuple[Finding, ...] = ()
    wrong: int = 0
    lasting: tuple[Finding, ...] = ()
    unread: Mapping[int, str] = field(default_factory=dict)
    left_out: int = 0
    rows: IntArray | None = None
    texts: tuple[TextCells, ...] = ()
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()

    def file_row(self, row: int) -> int:
        """Return the data row of the file of a row that was read, both from 1."""
        return row if self.rows is None else int(self.rows[row - 1])


Scales: TypeAlias = tuple[tuple[int, ...], ...]
"""How many decimals of each column of numbers of a clock are read: as few as may do, then all."""


def clock_scales(layout: Layout, clock: Sequence[ClockColumn]) -> Scales:
    """Return how many decimals of a clock are read, the same for all blocks of a table."""
    numeric = [part for part in clock if not part.forms]
    both = (tuple(_scale(layout, part, exact) for part in numeric) for exact in (False, True))
    return tuple(dict.fromkeys(both))


def read_fast(
    layout: Layout,
    columns: Sequence[int],
    clock: Sequence[ClockColumn],
    block: bytes | None = None,
    scales: Scales | None = None,
) -> Numbers | None:
    """Return the numbers of some columns, or None if the parser stumbles over a row or a cell.

    Args:
        layout: How the table is written.
        columns: Which columns hold numbers.
        clock: The columns of its clock; their values in [ns] are added. If they are text, their cells are
            read as they are.
        block: Some whole rows, as they stand in the file, instead of all.
        scales: What `clock_scales` returned, of a table that is read in many blocks.
    """
    texts = [part for part in clock if part.forms]
    numeric = [part for part in clock if not part.forms]
    for decimals in clock_scales(layout, clock) if scales is None else scales:
        try:
            table, left_out = _parse(layout, columns, numeric, decimals, texts, block)
            numbers = _numbers(table, columns, numeric, decimals)
            cells = tuple(_text_cells(table, layout, part) for part in texts)
            return replace(numbers, texts=cells, left_out=left_out)
        except (pa.ArrowInvalid, OverflowError):
            continue
        except UnfitError:
            break
    return None


def release_memory() -> None:
    """Give what the parser needed back to the system, before the arrays to come need as much.

    glibc keeps what threads have freed, here some 80 MB of a million rows; elsewhere nothing is done.
    """
    try:
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    except (OSError, AttributeError):
        return


@lru_cache
def _nulls() -> list[str]:
    """Return the words for a missing sample in the usual spellings; the careful pass takes all."""
    words = vocabulary().missing
    return sorted({spelled for word in words for spelled in (word, word.upper(), word.capitalize(), "NaN")})


def _numbers(
    table: pa.Table, columns: Sequence[int], clock: Sequence[ClockColumn], scales: Sequence[int]
) -> Numbers:
    """Return a parsed table as arrays, block by block, so that the rows being filled stay in the cache."""
    values = np.empty((table.num_rows, len(columns)))
    times = np.zeros(table.num_rows, dtype=np.int64)
    start = 0
    for batch in table.to_batches():
        rows = slice(start, start + batch.num_rows)
        for j, column in enumerate(columns):
            _fill(values[rows, j], batch.column(str(column)))
        for part, scale in zip(clock, scales, strict=True):
            _add_time(times[rows], batch.column(str(part.column)), part.exponent, scale)
        start += batch.num_rows
    return Numbers(values, times if clock else None)


def _parse(
    layout: Layout,
    columns: Sequence[int],
    clock: Sequence[ClockColumn],
    scales: Sequence[int],
    texts: Sequence[ClockColumn],
    block: bytes | None,
) -> tuple[pa.Table, int]:
    """Return the columns as pyarrow parses them, and how many lines that are no rows were left out.

    They are float64, decimals for the clock, bytes for its texts.
    """
    types: dict[str, Any] = {str(column): pa.float64() for column in columns}
    for part, scale in zip(clock, scales, strict=True):
        types[str(part.column)] = pa.decimal128(_PRECISION, scale)
    types |= {str(part.column): pa.binary() for part in texts}
    names = [str(column) for column in range(len(layout.names))]
    quoted_commas = layout.delimiter == layout.decimal  # "0,5","1,5": the stream leaves them
    with open_table(layout) if block is None else TableStream(layout, block) as stream:
        threads = not quoted_commas and block is None
        table = csv.read_csv(
            stream,
            csv.ReadOptions(column_names=names, block_size=BLOCK_BYTES, use_threads=threads),
            csv.ParseOptions(delimiter=layout.delimiter),
            csv.ConvertOptions(
                column_types=types,
                include_columns=list(types),
                null_values=_nulls(),
                decimal_point=layout.decimal if quoted_commas else ".",
            ),
            memory_pool=pa.system_memory_pool(),  # the default one keeps what it once had
        )
        return table, stream.left_out if isinstance(stream, TableStream) else 0


def _text_cells(table: pa.Table, layout: Layout, part: ClockColumn) -> TextCells:
    """Return the cells of a parsed column of bytes: offsets of 32 bits, and the bytes between them."""
    data, starts, total = [], [np.zeros(1, dtype=np.int64)], 0
    for chunk in table.column(str(part.column)).chunks:
        _, offsets, content = chunk.buffers()
        own = np.frombuffer(offsets, dtype="<i4")[chunk.offset : chunk.offset + len(chunk) + 1]
        if len(chunk) and content is not None:
            data.append(np.frombuffer(content, dtype=np.uint8)[own[0] : own[-1]])
        starts.append(own[1:].astype(np.int64) + (total - own[0]))
        total += int(own[-1] - own[0])
    joined = np.concatenate(data) if data else np.empty(0, dtype=np.uint8)
    return TextCells(as_written(layout, joined), np.concatenate(starts))


def _fill(target: FloatArray, chunk: pa.Array) -> None:
    """Copy a chunk of float64, with NaN where it has no value."""
    target[:] = np.frombuffer(chunk.buffers()[1], dtype="<f8")[chunk.offset : chunk.offset + len(chunk)]
    if chunk.null_count:
        target[_missing(chunk)] = np.nan


def _add_time(target: IntArray, chunk: pa.Array, exponent: int, scale: int) -> None:
    """Add a chunk of the clock in [ns], NO_TIME where it has no value.

    A decimal128 is an integer of two 64-bit words, the low one first; of scale 9 it is [ns], if the unit
    is s, and the low word holds it if the high one only repeats its sign.

    Raises:
        OverflowError: If a time is beyond what 64 bits hold.
    """
    missing = (target == NO_TIME) | (_missing(chunk) if chunk.null_count else False)
    if scale > exponent:
        from pyarrow import compute

        rounded = compute.round(chunk, ndigits=exponent, round_mode="half_to_even")
        chunk = rounded.cast(pa.decimal128(_PRECISION, exponent))
    words = np.frombuffer(chunk.buffers()[1], dtype="<i8").reshape(-1, 2)
    low, high = words[chunk.offset : chunk.offset + len(chunk)].T
    if (((low >> 63) != high) & ~missing).any():
        raise OverflowError
    target += low
    target[missing] = NO_TIME


def _missing(chunk: pa.Array) -> NDArray[np.bool_]:
    """Return where a chunk has no value: its validity bits, the first row in the lowest bit, turned round.

    Read from the buffer, since `to_numpy` and `is_null` load pandas and pyarrow.compute first.
    """
    bits = np.frombuffer(chunk.buffers()[0], dtype=np.uint8)
    valid = np.unpackbits(bits, bitorder="little")[chunk.offset : chunk.offset + len(chunk)]
    missing: NDArray[np.bool_] = valid == 0
    return missing


def _scale(layout: Layout, part: ClockColumn, exact: bool) -> int:
    """Return how many decimals of the clock are read.

    As many as reach [ns] if the sampled cells have no more: then the parsed integers are [ns]. Else as
    many as fit beside the digits before the point (and two more, since the clock goes on).
    """
    cells = [plain(c, layout.decimal) for c in layout.cells(part.column) if is_number(c, layout.decimal)]
    decimals = max((len(cell.partition("e")[0].partition(".")[2]) for cell in cells), default=0)
    if not exact and decimals <= part.exponent:
        return part.exponent
    values = [abs(to_float(cell, ".") or 0.0) for cell in cells]
    before = max((len(str(int(value))) for value in values if math.isfinite(value)), default=1)
    return max(part.exponent, _PRECISION - before - 2)
