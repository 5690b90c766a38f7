"""How a table of targets is written, told by its header: x, y, z say more than rows of which some are wrong.

A few targets are typed by hand, and all of their rows may be wrong. How a log is written its rows tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

from urmpipe_pipeline.logs.cells.cell import DECIMALS, DELIMITERS, count_up, is_number, split_line
from urmpipe_pipeline.logs.tables.sniff import SAMPLED_LINES, Layout, sniff
from urmpipe_pipeline.logs.tables.text import COMMENTS, HeadLine, Segment, head_lines
from urmpipe_pipeline.logs.vocabulary import key, split_unit, vocabulary


def sniff_targets(
    segment: Segment, delimiter: str | None = None, decimal: str | None = None, position: Sequence[str] = ()
) -> Layout:
    """Return how a table is written: by its soundest rows, if a header names x, y, z or the columns given.

    These are the rows with a cell for each name and the most numbers for x, y, z. All lines below the header
    are rows then, but for comments and a line of units. If no row is sound, the first line that is no comment
    may be such a header still, or the next one below a title.

    Raises:
        LogError: If it holds no rows, no numbers below a header without x, y, z, or a header that does not
            fit its rows.
        OptionError: As `sniff`.
    """
    lines = list(islice(head_lines(segment), SAMPLED_LINES))
    for place, line in enumerate(lines):
        below = [other for other in lines[place + 1 :] if not other.is_comment]
        whole = _soundest(below, _headers(line.text, position))
        if whole:
            # The first line may tell the delimiter; any other above the header tells nothing.
            layout = sniff(segment, delimiter, decimal, [*lines[: min(place, 1)], line, *whole])
            return (
                _from(layout, below) if layout.header == line.number else sniff(segment, delimiter, decimal)
            )
    body = [line for line in lines if not line.is_comment]
    for place, line in enumerate(body[:2]):
        header = _fitting(body[place + 1 :], _headers(line.text, position))
        if header and delimiter is None:
            return _by_header(segment, decimal, body[: place + 1], header, body[place + 1 :])
    return sniff(segment, delimiter, decimal)


def _by_header(
    segment: Segment,
    decimal: str | None,
    head: Sequence[HeadLine],
    header: _Header,
    below: Sequence[HeadLine],
) -> Layout:
    """Return a layout that the header alone tells, of rows that are all wrong."""
    sound = replace(below[0], text=header.delimiter.join(["0"] * header.width))  # as the header asks for
    layout = _from(sniff(segment, None, decimal, [*head, sound]), below)
    rows = [line for line in below if line.number >= layout.first_line]
    return replace(layout, sample=tuple(tuple(split_line(line.text, header.delimiter)) for line in rows))


def _from(layout: Layout, below: Sequence[HeadLine]) -> Layout:
    """Return a layout whose rows begin right below its header, or behind a line of units."""
    cells = split_line(below[0].text, layout.delimiter)
    units = tuple(cells) if len(below) > 1 and _are_units(cells) else ()
    first = below[1 if units else 0]
    return replace(layout, units=units, first_line=first.number, offset=first.offset)


def _are_units(cells: Sequence[str]) -> bool:
    """Return whether the cells of a line are units."""
    told = [vocabulary().unit(cell.strip("[]() ")) for cell in cells if cell]
    return bool(told) and all(told)


@dataclass(frozen=True, slots=True)
class _Header:
    """A line of names: the sign between them, how many there are, and which are those of x, y, z."""

    delimiter: str
    width: int
    position: tuple[int, ...]


def _headers(text: str, named: Sequence[str]) -> list[_Header]:
    """Return what a line is as a header, by each delimiter that makes names of x, y and z of it."""
    for comment in COMMENTS:
        text = text.strip().removeprefix(comment)
    split = [(delimiter, split_line(text, delimiter)) for delimiter in DELIMITERS]
    return [_Header(sign, len(cells), found) for sign, cells in split if (found := _position(cells, named))]


def _position(cells: Sequence[str], named: Sequence[str]) -> tuple[int, ...]:
    """Return which names are those of x, y and z, or of a transform with them; none without all of them."""
    labels = [split_unit(cell)[0] for cell in cells]
    told = tuple(k for k, label in enumerate(labels) if {label, cells[k]} & {*named})
    if len(told) == 3:
        return told
    keys = [key(label) for label in labels]
    for pattern in vocabulary().tcp_position:
        found = ((k, pattern.search(one)) for k, one in enumerate(keys))
        matches = {k: match.groupdict().get("axis") for k, match in found if match}
        if {"x", "y", "z"} <= set(matches.values()):
            return tuple(k for k, axis in matches.items() if axis)
    entries = next(pattern for pattern in vocabulary().tcp_matrix if "i" in pattern.groupindex)
    transform = tuple(k for k, one in enumerate(keys) if entries.search(one))
    return transform if len(transform) in (12, 16) else ()


def _soundest(below: Sequence[HeadLine], headers: Sequence[_Header]) -> list[HeadLine]:
    """Return the lines with the most numbers for x, y, z, by the header and decimal sign with most lines."""
    best: tuple[int, list[HeadLine]] = 0, []
    for header in headers:
        for decimal in DECIMALS:
            numbers = [_numbers(line.text, header, decimal) for line in below]
            most = max(numbers, default=0)
            whole = [line for line, count in zip(below, numbers, strict=True) if count == most > 0]
            if (most, len(whole)) > (best[0], len(best[1])):
                best = most, whole
    return best[1]


def _numbers(text: str, header: _Header, decimal: str) -> int:
    """Return how many numbers a line has for x, y, z; 0 if it has other than a cell for each name."""
    cells = split_line(text, header.delimiter)
    if len(cells) < header.width or any(cells[header.width :]):
        return 0
    return sum(is_number(cells[k], decimal) for k in header.position)


def _fitting(below: Sequence[HeadLine], headers: Sequence[_Header]) -> _Header | None:
    """Return the header that fits most of some rows; None without one, or if they begin with an index."""

    def widths(header: _Header) -> list[int]:
        """Return how many cells each row has by a header's delimiter."""
        return [len(split_line(line.text, header.delimiter)) for line in below]

    found = max(headers, key=lambda header: widths(header).count(header.width), default=None)
    if found is None or not below:
        return None
    rows = [split_line(line.text, found.delimiter) for line in below]
    if len(rows) == 1 and _are_units(rows[0]):
        return None
    first = [cells[0] for cells in rows]
    indexed = set(widths(found)) == {found.width + 1} and len(below) > 1 and count_up(first)
    return None if indexed else found
