"""Merge conflicts: the markers that git leaves in a file whose versions it could not merge.

    <<<<<<< HEAD            one version begins
    ||||||| 3f07bf4         what both began from (git's styles diff3 and zdiff3)
    =======                 the other version
    >>>>>>> branch          it ends

They are looked for in the whole file before anything else is: a header may stand between them, and the rows
of two versions may go on from one another as one motion.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from urmpipe_models.errors import Finding, LogError, format_value
from urmpipe_pipeline.logs.tables.numbers import capped
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.tables.text import Segment

_READ_BYTES = 1 << 20
_WIDTH = 7
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
)
"""A line that may be a marker; a label with an angle at its end is an ornament: # >>>>>>> LOG <<<<<<<"""


@dataclass(frozen=True, slots=True)
class Marker:
    """A line that may be a marker of a merge conflict.

    Attributes:
        line: Line of the file, from 1.
        text: What stands there.
        sign: What it consists of: <, |, = or >.
        certain: Whether it is one wherever it stands. A line of = may underline a title, one of | be a row
            of empty cells, and a longer one an ornament: they are markers within a conflict.
        is_comment: Whether it stands in a comment.
    """

    line: int
    text: str
    sign: str
    certain: bool
    is_comment: bool

    def finding(self, file: str) -> Finding:
        """Return it as a finding."""
        found = f"{format_value(self.text)}, {_MEANING[self.sign]}"
        return Finding(file=file, line=self.line, found=found, allowed="one version, without git's markers")


def refuse_conflict(segment: Segment) -> list[Marker]:
    """Return the lines of a file that are markers if they stand among its rows: single lines of =.

    Raises:
        LogError: If there is a merge conflict, or what is left of one, with all markers.
    """
    if not _may_hold_markers(segment):
        return []
    markers = [marker for line, text in segment.lines() if (marker := _marker(line, text))]
    certain = [k for k, marker in enumerate(markers) if marker.certain]
    if not certain:
        return [one for one in markers if one.sign == "=" and not one.is_comment and len(one.text) == _WIDTH]
    first = certain[0] if markers[certain[0]].sign == "<" else 0
    end = certain[-1] + 1 if markers[certain[-1]].sign == ">" else len(markers)
    raise _error(segment, markers[first:end])


def refuse_among_rows(layout: Layout, markers: Sequence[Marker]) -> None:
    """Raise a `LogError` if lines that may be markers stand below the first row of a table."""
    among = [marker for marker in markers if marker.line >= layout.first_line]
    if among:
        raise _error(layout.segment, among)


def _error(segment: Segment, markers: Sequence[Marker]) -> LogError:
    file = str(segment.path)
    return LogError(*capped([marker.finding(file) for marker in markers], file))


def _marker(line: int, text: str) -> Marker | None:
    """Return what a line is, if it may be a marker."""
    match = _MARKER.fullmatch(text)
    if match is None or (match["sign"] == "=" and match["label"]):
        return None
    label = match["label"] or ""
    named = match["sign"] in "<>" or any(map(str.isalpha, label))
    plain = not match["comment"] or bool(label)
    certain = len(match["run"]) == _WIDTH and match["sign"] != "=" and named and plain
    return Marker(line, match["text"], match["sign"], certain, bool(match["comment"]))


def _may_hold_markers(segment: Segment) -> bool:
    """Return whether a sign of a marker stands seven times on end anywhere: quickly, most files have none.

    In numbers none of the signs stands at all, which is seen faster than that seven are missing.
    """
    marks = [(sign.encode(), (sign * _WIDTH).encode(segment.encoding)) for sign in _MEANING]
    longest, end = max(len(mark) for _, mark in marks), b""
    with segment.open() as file:
        while read := file.read(_READ_BYTES):
            wanted = [mark for sign, mark in marks if sign in read]
            block = end + read if wanted else b""
            if any(mark in block for mark in wanted):
                return True
            end = block[1 - longest :]
    return False
