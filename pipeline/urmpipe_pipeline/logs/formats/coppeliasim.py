"""CoppeliaSim's graph exports (File > Export > selected graphs as CSV): several tables in one file.

Line 1 is the graph's path, line 2 `Time (s),<stream> (<unit>),...`, then the data; after a blank line
the next graph follows with its own path, header and time.
"""

from __future__ import annotations

import mmap
import re
from contextlib import ExitStack

from urmpipe_pipeline.logs.formats.cells import printable
from urmpipe_pipeline.logs.formats.text import Segment

_HEADER = b"Time ("
_ROW = re.compile(rb"[-+0-9.]+,")
_BEGINNING = re.compile(r'\A[^\r\n]*\r?\n"?Time \([^)]*\)"?,')


def is_export(segment: Segment) -> bool:
    """Return whether a file begins like a graph export: a graph's path, and below it a time and streams."""
    return segment.encoding in ("utf-8", "latin-1") and bool(_BEGINNING.match(segment.head.lstrip("\r\n")))


def graphs(segment: Segment) -> list[tuple[str, Segment]]:
    """Return the graphs of an export: the path of each, and where it stands."""
    result = []
    with ExitStack() as opened:
        file = opened.enter_context(segment.open())
        content = segment.data or opened.enter_context(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
        starts = _starts(content, segment.start)
        line, counted = segment.first_line, segment.start
        for start, end in zip(starts, [*starts[1:], segment.end], strict=False):
            line += _count_lines(content, counted, start)
            counted = start
            stop = content.find(b"\n", start)
            title = printable(content[start:stop].decode(segment.encoding, errors="replace").strip())
            result.append((title, segment.cut(start, end, line)))
    return result


def _starts(content: mmap.mmap | bytes, first: int) -> list[int]:
    """Return where each graph begins: at its path above the header, or at the header if there is no path."""
    starts = []
    place = content.find(_HEADER, first)
    while place >= 0:
        header = place - 1 if content[place - 1 : place] == b'"' else place
        if header == first or content[header - 1 : header] == b"\n":
            above = max(first, content.rfind(b"\n", 0, max(header - 1, 0)) + 1)
            path = content[above:header].strip()
            starts.append(above if path and not _ROW.match(path) else header)
        place = content.find(_HEADER, place + 1)
    return starts


def _count_lines(content: mmap.mmap | bytes, start: int, end: int, step: int = 1 << 20) -> int:
    """Return the line feeds of a stretch, a part at a time so that a large file is not copied."""
    return sum(content[at : min(at + step, end)].count(b"\n") for at in range(start, end, step))
