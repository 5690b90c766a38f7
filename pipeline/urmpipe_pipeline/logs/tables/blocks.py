"""Whole rows of a table: as they stand in the file, and as the CSV parser wants them."""

from __future__ import annotations

import codecs
from collections.abc import Iterator

import numpy as np

from urmpipe_pipeline.logs.cells.cell import SPACE
from urmpipe_pipeline.logs.cells.text_cells import Bytes
from urmpipe_pipeline.logs.tables.sniff import Layout

BLOCK_BYTES = 1 << 22
"""What is read at once: enough rows for several threads to parse, few enough to keep memory low."""

_NEWLINES = b"\n\r"
_GOES_ON = (b"", b" ", b"\t")  # nothing: what comes next is not read yet
_TO_POINTS = bytes.maketrans(b",.", b".~")
_FROM_POINTS = np.frombuffer(bytes.maketrans(b".~", b",."), dtype=np.uint8)


def as_written(layout: Layout, cells: Bytes) -> Bytes:
    """Return cells of `converted` rows, shape (bytes,), with the signs that the file has."""
    return _FROM_POINTS[cells] if layout.decimal == "," != layout.delimiter else cells


def row_blocks(layout: Layout) -> Iterator[bytes]:
    """Yield the rows of a table as they stand in the file, some thousand at a time, in `byte_encoding`."""
    segment = layout.segment
    left = segment.end - layout.offset
    wide = segment.encoding.startswith("utf-16")
    decoder = codecs.getincrementaldecoder(segment.encoding)(errors="replace") if wide else None
    cut_row = b""
    with segment.open() as file:
        file.seek(layout.offset)
        while left > 0:
            raw = file.read(min(BLOCK_BYTES, left))
            left -= len(raw) if raw else left
            block = raw if decoder is None else decoder.decode(raw, final=left <= 0).encode("utf-8")
            block = cut_row + block
            end = end_of_rows(block, layout) if left > 0 else len(block)
            cut_row = block[end:]
            if end:
                yield block[:end]


def byte_encoding(layout: Layout) -> str:
    """Return the encoding of the blocks: UTF-8, or Latin-1, whose numbers are the same bytes in UTF-8."""
    return "latin-1" if layout.segment.encoding == "latin-1" else "utf-8"


def converted(layout: Layout, block: bytes) -> tuple[bytes, int]:
    """Return whole rows as the parser wants them, in UTF-8 and with one space for a run of them.

    Lines among labelled rows that are none are left out; how many they are is the second value.

    Decimal commas become points here, since pyarrow 26 parses decimals with another point wrongly in threads
    (they share a buffer); a point becomes a sign that no number has, so that 1.5 stays no number.

    Raises:
        UnfitError: If rows with arrays or labels are not written like the others.
    """
    left_out = 0
    if layout.form is not None:
        block, left_out = layout.form.flat(block, byte_encoding(layout))
    if layout.decimal == "," != layout.delimiter:
        block = block.translate(_TO_POINTS)
    block = squeeze(block) if layout.delimiter == SPACE else block
    return (block.replace(layout.delimiter.encode(), b"\n") if layout.across else block), left_out


def end_of_rows(block: bytes, layout: Layout) -> int:
    """Return where the last whole row of a block ends."""
    end = max(block.rfind(b"\n"), block.rfind(b"\r")) + 1
    while layout.form is not None and layout.form.continued and end and block[end : end + 1] in _GOES_ON:
        end = block.rfind(b"\n", 0, end - 1) + 1
    return end


def squeeze(block: bytes) -> bytes:
    """Return whole lines with every run of spaces and tabs as one space, and none at either end of a line."""
    signs: Bytes = np.frombuffer(block, dtype=np.uint8)
    blank = (signs == ord(" ")) | (signs == ord("\t"))
    ends = (signs == _NEWLINES[0]) | (signs == _NEWLINES[1])
    skipped = np.zeros_like(blank)
    skipped[:1] = blank[:1]
    skipped[1:] = blank[1:] & (blank[:-1] | ends[:-1])
    if not (skipped.any() or (blank[:-1] & ends[1:]).any() or b"\t" in block or block[-1:] == b" "):
        return block
    result: bytes = np.where(blank, np.uint8(ord(" ")), signs)[~skipped].tobytes()
    for end in (b"\r", b"\n"):
        result = result.replace(b" " + end, end)
    return result.removesuffix(b" ")
