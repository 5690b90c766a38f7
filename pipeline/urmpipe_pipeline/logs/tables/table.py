"""The numbers of a table, block by block: parsed, or where a row is not as it should be read row by row."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.elementwise import IntArray
from urmpipe_pipeline.logs.cells.text_cells import TextCells
from urmpipe_pipeline.logs.tables.block_parser import Scales, clock_scales, parse_block
from urmpipe_pipeline.logs.tables.blocks import byte_encoding, end_of_rows, row_blocks
from urmpipe_pipeline.logs.tables.held import read_held
from urmpipe_pipeline.logs.tables.numbers import ClockColumn, Numbers
from urmpipe_pipeline.logs.tables.row_reader import RowReader
from urmpipe_pipeline.logs.tables.sniff import Layout

READ_BY_ROW = 1 << 16
"""Bytes that are read row by row together if there is something wrong in them."""


def read_table(
    layout: Layout,
    columns: Sequence[int],
    clock: Sequence[ClockColumn],
    allowed: Mapping[int, str] | None = None,
) -> Numbers:
    """Return the numbers of some columns, with a finding for each row and cell that holds none.

    Read row by row is also what the parser refuses though it is sound: blanks as missing samples, 1.5d0,
    comments. The values of the clock in [ns] are added; if they are text, their cells are read as they are.
    What a cell may hold is told as in a log, or by its column in other words.
    """
    if layout.held is not None:
        return read_held(layout, columns, clock)
    reader = RowReader(layout, columns, clock, allowed)
    scales = clock_scales(layout, clock)
    parts = [part for block in row_blocks(layout) for part in _parts(reader, block, scales)]
    reader.refuse_cut_row()
    values = [part.values for part in parts] or [np.empty((0, len(columns)))]
    times = [_times(part) for part in parts] or [np.empty(0, dtype=np.int64)]
    numbers = replace(
        reader.verdict(),
        values=np.concatenate(values),
        clock=np.concatenate(times) if clock else None,
        texts=tuple(TextCells.joined(texts) for texts in zip(*(part.texts for part in parts), strict=True)),
        left_out=sum(part.left_out for part in parts),
    )
    if layout.rows is None:
        return numbers
    return numbers.at(layout.rows[layout.rows < len(numbers.values)])  # fewer if another header ends them


def _times(part: Numbers) -> IntArray:
    """Return the times of a part; none yet where they are text, which is read of all parts at once."""
    return np.zeros(len(part.values), dtype=np.int64) if part.clock is None else part.clock


def _parts(reader: RowReader, block: bytes, scales: Scales) -> Iterator[Numbers]:
    """Yield the numbers of some whole rows: of all at once, or of either half."""
    layout = reader.layout
    newline = layout.segment.newline
    numbers = None if reader.ended else parse_block(layout, reader.columns, reader.clock, block, scales)
    if numbers is not None:
        signs = np.frombuffer(block, dtype=np.uint8)
        reader.pass_over(len(numbers.values), int(np.count_nonzero(signs == ord(newline))))
        yield numbers
    elif len(block) > READ_BY_ROW and (end := end_of_rows(block[: len(block) // 2], layout)):
        for half in (block[:end], block[end:]):
            yield from _parts(reader, half, scales)
    else:
        text = block.decode(byte_encoding(layout), errors="surrogateescape")
        yield reader.read(text.removesuffix(newline).split(newline))
