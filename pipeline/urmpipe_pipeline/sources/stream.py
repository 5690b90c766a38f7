"""The bytes of a table as the CSV parser wants them: UTF-8, decimal points, one space for a run of them."""

from __future__ import annotations

import codecs
import os
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray
from pyarrow import NativeFile, OSFile

from urmpipe_pipeline.sources.cells import SPACE
from urmpipe_pipeline.sources.sniff import Layout

Bytes = NDArray[np.uint8]

_NEWLINES = b"\n\r"
_TO_POINTS = bytes.maketrans(b",.", b".~")
_FROM_POINTS = np.frombuffer(bytes.maketrans(b".~", b",."), dtype=np.uint8)


def open_table(layout: Layout) -> TableStream | NativeFile:
    """Return the rows of a table as a file to read from, header excluded.

    Where nothing is to be converted it is pyarrow's own, which needs no Python while it is read.
    """
    stream = TableStream(layout)
    path = layout.segment.path
    if stream.converts or layout.segment.end != path.stat().st_size:
        return stream
    stream.close()
    file = OSFile(os.fsencode(path))
    file.seek(layout.offset)
    return file


def as_written(layout: Layout, cells: Bytes) -> Bytes:
    """Return cells that a stream has read with the signs that the file has."""
    return _FROM_POINTS[cells] if layout.decimal == "," != layout.delimiter else cells


class TableStream:
    """The rows of a table as a file to read from, header excluded.

    Latin-1 passes as it is: numbers are the same bytes in UTF-8, and text columns are not read. Decimal
    commas become points here, since pyarrow 26 parses decimals with another point wrongly in threads (they
    share a buffer); a point becomes a sign that no number has, so that 1.5 stays no number.
    """

    def __init__(self, layout: Layout) -> None:
        segment = layout.segment
        self._file = Path(segment.path).open("rb", buffering=0)  # noqa: SIM115 (closed by close)
        self._file.seek(layout.offset)
        self._left = segment.end - layout.offset
        wide = segment.encoding.startswith("utf-16")
        self._decoder = codecs.getincrementaldecoder(segment.encoding)(errors="replace") if wide else None
        self._squeezed = layout.delimiter == SPACE
        self._across = layout.delimiter.encode() if layout.across else None
        self._signs = _TO_POINTS if layout.decimal == "," != layout.delimiter else None
        self._cut_line = b""
        self._ready = b""

    @property
    def converts(self) -> bool:
        """Whether the bytes read are others than the file's own."""
        return (
            self._decoder is not None or self._signs is not None or self._squeezed or self._across is not None
        )

    def read(self, size: int = -1) -> bytes:
        """Return up to so many bytes of the table, none at its end."""
        size = self._left if size < 0 else size
        while not self._ready:
            raw = self._file.read(min(size, self._left))
            self._left -= len(raw)
            self._ready = self._converted(raw)
            if not raw:
                break
        block, self._ready = self._ready[:size], self._ready[size:]
        return block

    def _converted(self, raw: bytes) -> bytes:
        """Return the next bytes of the file as the parser wants them; no bytes mean the end of the table."""
        block = raw if self._decoder is None else self._decoder.decode(raw, final=not raw).encode("utf-8")
        if self._signs is not None:
            block = block.translate(self._signs)
        if not self._squeezed:
            return block.replace(self._across, b"\n") if self._across else block
        block = self._cut_line + block
        end = max(block.rfind(b"\n"), block.rfind(b"\r")) + 1 if raw else len(block)
        self._cut_line = block[end:]
        block = squeeze(block[:end])
        return block.replace(self._across, b"\n") if self._across else block

    @property
    def closed(self) -> bool:
        """Whether the file is closed."""
        return self._file.closed

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> TableStream:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def squeeze(block: bytes) -> bytes:
    """Return whole lines with every run of spaces and tabs as one space, and none at either end of a line.

    Args:
        block: Whole lines.
    """
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
