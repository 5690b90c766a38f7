"""The numbers of whole rows, fast: pyarrow parses the columns that are needed straight into float64."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import csv

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.logs.cells.cell import to_float
from urmpipe_pipeline.logs.cells.text_cells import TextCells
from urmpipe_pipeline.logs.tables.blocks import as_written, converted
from urmpipe_pipeline.logs.tables.form import UnfitError
from urmpipe_pipeline.logs.tables.numbers import NO_TIME, ClockColumn, Numbers
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.vocabulary import vocabulary

PARSED_BYTES = 1 << 20
"""What one thread parses at once."""

_PRECISION = 38  # digits of a decimal128

Scales: TypeAlias = tuple[tuple[int, ...], ...]
"""How many decimals of each column of numbers of a clock are read: as few as may do, then all."""


def clock_scales(layout: Layout, clock: Sequence[ClockColumn]) -> Scales:
    """Return how many decimals of a clock are read, the same for all blocks of a table."""
    numeric = [part for part in clock if not part.forms]
    both = (tuple(_scale(layout, part, exact) for part in numeric) for exact in (False, True))
    return tuple(dict.fromkeys(both))


def parse_block(
    layout: Layout, columns: Sequence[int], clock: Sequence[ClockColumn], block: bytes, scales: Scales
) -> Numbers | None:
    """Return the numbers of some columns, or None if the parser stumbles over a row or a cell.

    The block is some whole rows as they stand in the file, the scales are those of `clock_scales`. The values
    of the clock in [ns] are added; if they are text, their cells are read as they are.
    """
    texts = [part for part in clock if part.forms]
    numeric = [part for part in clock if not part.forms]
    try:
        rows, left_out = converted(layout, block)
    except UnfitError:
        return None
    for decimals in scales:
        try:
            table = _parse(layout, columns, numeric, decimals, texts, rows)
            numbers = _numbers(table, columns, numeric, decimals)
        except (pa.ArrowException, OverflowError):
            # Of any kind: pyarrow 26 was seen to lose a chunk of sound numbers among its threads, once in
            # hundreds of files ("failed converting for an unknown reason"). Who gets None tries the halves.
            continue
        cells = tuple(_text_cells(table, layout, part) for part in texts)
        return replace(numbers, texts=cells, left_out=left_out)
    return None


@lru_cache
def _nulls() -> list[str]:
    """Return the words for a missing sample in the usual spellings; read row by row, all are taken."""
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
    rows: bytes,
) -> pa.Table:
    """Return the columns as pyarrow parses them: float64, decimals for the clock, bytes for its texts."""
    types: dict[str, Any] = {str(column): pa.float64() for column in columns}
    for part, scale in zip(clock, scales, strict=True):
        types[str(part.column)] = pa.decimal128(_PRECISION, scale)
    types |= {str(part.column): pa.binary() for part in texts}
    names = [str(column) for column in range(len(layout.names))]
    quoted_commas = layout.delimiter == layout.decimal  # "0,5","1,5": `converted` leaves them
    return csv.read_csv(
        pa.BufferReader(rows),
        csv.ReadOptions(column_names=names, block_size=PARSED_BYTES, use_threads=not quoted_commas),
        csv.ParseOptions(delimiter=layout.delimiter),
        csv.ConvertOptions(
            column_types=types,
            include_columns=list(types),
            null_values=_nulls(),
            decimal_point=layout.decimal if quoted_commas else ".",
        ),
        memory_pool=pa.system_memory_pool(),  # the default one keeps what it once had
    )


def _text_cells(table: pa.Table, layout: Layout, part: ClockColumn) -> TextCells:
    """Return the cells of a parsed column of bytes: offsets of 32 bits, and the bytes between them."""
    cells = table.column(str(part.column)).combine_chunks(pa.system_memory_pool())
    _, offsets, content = cells.buffers()
    starts = np.frombuffer(offsets, dtype="<i4")[cells.offset : cells.offset + len(cells) + 1]
    data = np.frombuffer(content or b"", dtype=np.uint8)
    return TextCells(as_written(layout, data), starts.astype(np.int64))


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
    cells = list(layout.number_texts(part.column))
    decimals = max((len(cell.partition("e")[0].partition(".")[2]) for cell in cells), default=0)
    if not exact and decimals <= part.exponent:
        return part.exponent
    values = [abs(to_float(cell, ".") or 0.0) for cell in cells]
    before = max((len(str(int(value))) for value in values if math.isfinite(value)), default=1)
    return max(part.exponent, _PRECISION - before - 2)
