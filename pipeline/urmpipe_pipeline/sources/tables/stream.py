"""The bytes of a table as the CSV parser wants them: UTF-8, decimal points, one space for a run of them."""

from __future__ import annotations

import codecs
import os
from collections.abc import Generator
from types import TracebackType

import numpy as np
from numpy.typing import NDArray
from pyarrow import NativeFile, OSFile

from urmpipe_pipeline.sources.cells.cell import SPACE
from urmpipe_pipeline.sources.tables.sniff import Layout

Bytes = NDArray[np.uint8]

BLOCK_BYTES = 1 << 20
"""What is read at once."""

_NEWLINES = b"\n\r"
_RUNS = (b"\t", b"  ", b" \n", b" \r", b"\n ", b"\r ")
"""None of these is in lines that are parted by single spaces already."""

_GOES_ON = (b"", b" ", b"\t")  # nothing: what comes next is not read yet
_TO_POINTS = bytes.maketrans(b",.", b".~")
_FROM_POINTS = np.frombuffer(bytes.maketrans(b".~", b",."), dtype=np.uint8)


def open_table(layout: Layout) -> TableStream | NativeFile:
    """Return the rows of a table as a file to read from, header excluded.

    Where nothing is to be converted it is pyarrow's own, which needs no Python while it is read.
    """
    path = layout.segment.path
    if _converts(layout) or layout.segment.end != path.stat().st_size:
        return TableStream(layout)
    file = OSFile(os.fsencode(path))
    file.seek(layout.offset)
    return file


def as_written(layout: Layout, cells: Bytes) -> Bytes:
    """Return cells that a stream has read, shape (bytes,), with the signs that the file has."""
    return _FROM_POINTS[cells] if layout.decimal == "," != layout.delimiter else cells


class TableStream:
    """The rows of a table as a file to read from, header excluded.

    Args:
        layout: How the table is written.
        block: Some whole rows, as they stand in the file, instead of all.

    Attributes:
        closed: Whether it is closed.
        left_out: Lines among labelled rows that are none, so far.
    """

    def __init__(self, layout: Layout, block: bytes | None = None) -> None:
        self._layout = layout
        self._blocks = row_blocks(layout) if block is None else (one for one in (block,))
        self._ready = b""
        self.closed = False
        self.left_out = 0

    def read(self, size: int = -1) -> bytes:
        """Return up to so many bytes of the table, none at its end.

        Raises:
            UnfitError: If rows with arrays or labels are not written like the others.
        """
        while not self._ready:
            block = next(self._blocks, None)
            if block is None:
                break
            self._ready, left_out = converted(self._layout, block)
            self.left_out += left_out
        size = len(self._ready) if size < 0 else size
        block, self._ready = self._ready[:size], self._ready[size:]
        return block

    def close(self) -> None:
        """Close the file."""
        self._blocks.close()
        self.closed = True

    def __enter__(self) -> TableStream:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def row_blocks(layout: Layout) -> Generator[bytes, None, None]:
    """Yield the rows of a table as they stand in the file, some thousand at a time, in `byte_encoding`.

    Args:
        layout: How the table is written.
    """
    segment = layout.segment
    left = segment.end - layout.offset
    wide = segment.encoding.startswith("utf-16")
    decoder = codecs.getincrementaldecoder(segment.encoding)(errors="replace") if wide else None
    cut_row = b""
    with segment.path.open("rb", buffering=0) as file:
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
    """Return whole rows as the parser wants them, and how many other lines were left out.

    Decimal commas become points here, since pyarrow 26 parses decimals with another point wrongly in threads
    (they share a buffer); a point becomes a sign that no number has, so that 1.5 stays no number.

    Args:
        layout: How the table is written.
        block: Whole rows as they stand in the file.

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


def _converts(layout: Layout) -> bool:
    """Return whether the parser wants other bytes than the file's own."""
    wide = layout.segment.encoding.startswith("utf-16")
    points = layout.decimal == "," != layout.delimiter
    return wide or points or layout.delimiter == SPACE or layout.form is not None or layout.across


def end_of_rows(block: bytes, layout: Layout) -> int:
    """Return where the last whole row of a block ends."""
    end = max(block.rfind(b"\n"), block.rfind(b"\r")) + 1
    while layout.form is not None and layout.form.continued and end and block[end : end + 1] in _GOES_ON:
        end = block.rfind(b"\n", 0, end - 1) + 1
    return end


def squeeze(block: bytes) -> bytes:
    """Return whole lines with every run of spaces and tabs as one space, and none at either end of a line.

    Args:
        block: Whole lines.
    """
    if not any(run in block for run in _RUNS) and block[:1] != b" " != block[-1:]:
        return block
    signs: Bytes = np.frombuffer(block, dtype=np.uint8)
    blank = (signs == ord(" ")) | (signs == ord("\t"))
    skipped = np.zeros_like(blank)
    ends = (signs == _NEWLINES[0]) | (signs == _NEWLINES[1])
    skipped[:1] = blank[:1]
    skipped[1:] = blank[1:] & (blank[:-1] | ends[:-1])
    result: bytes = np.where(blank, np.uint8(ord(" ")), signs)[~skipped].tobytes()
    for end in (b"\r", b"\n"):
        result = result.replace(b" " + end, end)
    return result.removesuffix(b" ")
