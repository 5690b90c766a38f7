"""Merge conflicts: the markers that git leaves in a file whose versions it could not merge.

    <<<<<<< HEAD            one version begins
    ||||||| 3f07bf4         what both began from (git's styles diff3 and zdiff3)
    =======                 the other version
    >>>>>>> branch          it ends

They are looked for in the whole file before anything else is: a header may be between them, and the rows
of two versions may form one motion.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from urmpipe_models.errors import Finding, LogError, format_value
from urmpipe_pipeline.logs.formats.numbers import capped
from urmpipe_pipeline.logs.formats.text import Segment
from urmpipe_pipeline.logs.formats.text_table import TextTable

_READ_BYTES = 1 << 20  # of the file at once
_WIDTH = 7  # signs of a marker
_MEANING = {
    "<": "the beginning of a merge conflict",
    "|": "the common ancestor in a merge conflict",
    "=": "the middle of a merge conflict",
    ">": "the end of a merge conflict",
}
_AROUND = r"[\s,;|\"]*"  # what spreadsheets and editors put around a line
_MARKER = re.compile(
    rf"(?:[\s,;\"]*|{_AROUND}(?!\|))(?P<text>(?:(?P<comment>[#%/]+)\s*)?"
    rf"(?P<run>(?P<sign>[<|=>])(?P=sign){{6,}})(?!(?P=sign))"  # in one way: rows may begin with many bars
    rf"(?P<label>[\s,;].*[^<>\s,;|\"])?){_AROUND}"
)  # a label with an angle at its end is an ornament: # >>>>>>> LOG <<<<<<<


class Marker(NamedTuple):
    """A line that may be a marker of a merge conflict.

    Attributes:
        line: Line of the file, from 1.
        text: Its text.
        sign: What it consists of: <, |, = or >.
        is_certain: Whether it is one anywhere. A line of = may underline a title, one of | be a row
            of empty cells, and a longer one an ornament: they are markers within a conflict.
        is_comment: Whether it stands in a comment.
    """

    line: int
    text: str
    sign: str
    is_certain: bool
    is_comment: bool


def find_markers(segment: Segment) -> list[Marker]:
    """Return the lines of a file that are markers if they are among its rows: single lines of =.

    Raises:
        LogError: If there is a merge conflict, or what remains of one, with all markers.
    """
    if not _may_hold_markers(segment):
        return []
    markers = [marker for line, text in segment.lines() if (marker := _parse_marker(line, text))]
    certain = [k for k, marker in enumerate(markers) if marker.is_certain]
    if not certain:
        plain = (marker for marker in markers if marker.sign == "=" and not marker.is_comment)
        return [marker for marker in plain if len(marker.text) == _WIDTH]
    first = certain[0] if markers[certain[0]].sign == "<" else 0
    end = certain[-1] + 1 if markers[certain[-1]].sign == ">" else len(markers)
    raise _conflict_error(segment, markers[first:end])


def check_rows_for_markers(table: TextTable, markers: Sequence[Marker]) -> None:
    """Raise a `LogError` if lines that may be markers are below the first row of a table."""
    among = [marker for marker in markers if marker.line >= table.first_line]
    if among:
        raise _conflict_error(table.segment, among)


def _conflict_error(segment: Segment, markers: Sequence[Marker]) -> LogError:
    file, allowed = str(segment.path), "one version, without git's markers"
    texts = [(marker.line, f"{format_value(marker.text)}, {_MEANING[marker.sign]}") for marker in markers]
    findings = [Finding(file=file, line=line, found=found, allowed=allowed) for line, found in texts]
    return LogError(*capped(findings, file))


def _parse_marker(line: int, text: str) -> Marker | None:
    match = _MARKER.fullmatch(text)
    if match is None or (match["sign"] == "=" and match["label"]):
        return None
    label = match["label"] or ""
    is_named = match["sign"] in "<>" or any(map(str.isalpha, label))
    is_plain = not match["comment"] or bool(label)
    is_certain = len(match["run"]) == _WIDTH and match["sign"] != "=" and is_named and is_plain
    return Marker(line, match["text"], match["sign"], is_certain, bool(match["comment"]))


def _may_hold_markers(segment: Segment) -> bool:
    """Return whether a sign of a marker is anywhere seven times in a row: quickly, most files have none.

    Numbers have none of the signs, which is seen faster than that seven are missing.
    """
    marks = [(sign.encode(), (sign * _WIDTH).encode(segment.encoding)) for sign in _MEANING]
    longest, end = max(len(mark) for _, mark in marks), b""
    with segment.open() as file:
        while read := file.read(_READ_BYTES):
            possible = [mark for sign, mark in marks if sign in read]
            block = end + read if possible else b""
            if any(mark in block for mark in possible):
                return True
            end = block[1 - longest :]
    return False
