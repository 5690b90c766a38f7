"""A table with wrong rows: what is sound is read fast, and only what stands around a wrong row with care."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.arrays import IntArray
from urmpipe_pipeline.sources.cells.text_cells import TextCells
from urmpipe_pipeline.sources.tables.diagnose import MAY_BE_MISSING, CarefulReader
from urmpipe_pipeline.sources.tables.sniff import Layout
from urmpipe_pipeline.sources.tables.stream import byte_encoding, end_of_rows, row_blocks
from urmpipe_pipeline.sources.tables.table import ClockColumn, Numbers, Scales, clock_scales, read_fast

READ_WITH_CARE = 1 << 16
"""Bytes that are read row by row if there is something wrong in them."""


def read_blockwise(
    layout: Layout, columns: Sequence[int], clock: Sequence[ClockColumn], allowed: str = MAY_BE_MISSING
) -> Numbers:
    """Return the numbers of some columns, with a finding for each row and cell that holds none.

    Also reads what the fast parser refuses though it is sound: blanks as missing samples, 1.5d0, comments.

    Args:
        layout: How the table is written.
        columns: Which columns hold numbers.
        clock: The columns of its clock.
        allowed: What a cell may hold, for the findings.
    """
    reader = CarefulReader(layout, columns, clock, allowed)
    scales = clock_scales(layout, clock)
    parts = [part for block in row_blocks(layout) for part in _parts(reader, block, scales)]
    values = [part.values for part in parts] or [np.empty((0, len(columns)))]
    times = [_times(part) for part in parts] or [np.empty(0, dtype=np.int64)]
    return replace(
        reader.verdict(),
        values=np.concatenate(values),
        clock=np.concatenate(times) if clock else None,
        texts=tuple(TextCells.joined(texts) for texts in zip(*(part.texts for part in parts), strict=True)),
        left_out=sum(part.left_out for part in parts),
    )


def _times(part: Numbers) -> IntArray:
    """Return the times of a part; none yet where they are text, which is read of all parts at once."""
    return np.zeros(len(part.values), dtype=np.int64) if part.clock is None else part.clock


def _parts(reader: CarefulReader, block: bytes, scales: Scales, *, small: bool = False) -> Iterator[Numbers]:
    """Yield the numbers of some whole rows: of all at once, or a small part at a time."""
    newline = reader.layout.segment.newline
    about = reader.layout, reader.columns, reader.clock
    numbers = None if reader.waits else read_fast(*about, block, scales)
    if numbers is not None:
        reader.pass_over(len(numbers.values), block.count(newline.encode()))
        yield numbers
    elif small:
        text = block.decode(byte_encoding(reader.layout), errors="surrogateescape")
        yield reader.read(text.removesuffix(newline).split(newline))
    else:
        for part in _small_parts(reader.layout, block):
            yield from _parts(reader, part, scales, small=True)


def _small_parts(layout: Layout, block: bytes) -> Iterator[bytes]:
    """Yield the rows of a block, as many at a time as are read with care together."""
    while block:
        end = end_of_rows(block[:READ_WITH_CARE], layout) if len(block) > READ_WITH_CARE else len(block)
        end = end or len(block)
        yield block[:end]
        block = block[end:]
