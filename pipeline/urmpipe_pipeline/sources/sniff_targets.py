"""How a table of targets is written, told by its header: x, y, z say more than rows of which some are wrong.

A few targets are typed by hand, and most of their rows may be wrong. How a log is written its rows tell.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from urmpipe_pipeline.sources.cells import DECIMALS, DELIMITERS, is_number, split_line
from urmpipe_pipeline.sources.sniff import COMMENTS, SAMPLED_LINES, Layout, sniff
from urmpipe_pipeline.sources.text import HeadLine, Segment, head_lines
from urmpipe_pipeline.sources.vocabulary import key, split_unit, vocabulary


def sniff_targets(segment: Segment, delimiter: str | None = None, decimal: str | None = None) -> Layout:
    """Return how a table is written: by its soundest rows, if a header names x, y, z.

    These are the rows with a cell for each name and the most numbers for x, y, z. All lines below the header
    are rows then, but for comments and a line of units.

    Args:
        segment: The table's text.
        delimiter: The sign between cells, or its name, if the file need not tell.
        decimal: The decimal sign, or its name, if the file need not tell.

    Raises:
        LogError: If it holds no numbers, no rows, or a header that does not fit its rows.
        OptionError: If delimiter or decimal is none that is allowed.
    """
    lines = head_lines(segment)[:SAMPLED_LINES]
    for place, header in enumerate(lines):
        headers = list(_headers(header.text))
        below = [line for line in lines[place + 1 :] if not _is_comment(line)]
        sound = [max((_numbers(line.text, one) for one in headers), default=0) for line in below]
        if not any(sound):
            continue
        whole = [line for line, numbers in zip(below, sound, strict=True) if numbers == max(sound)]
        # The first line may tell the delimiter; any other above the header tells nothing.
        layout = sniff(segment, delimiter, decimal, [*lines[: min(place, 1)], header, *whole])
        return _from(layout, below) if layout.header == header.number else sniff(segment, delimiter, decimal)
    return sniff(segment, delimiter, decimal)


def _from(layout: Layout, below: Sequence[HeadLine]) -> Layout:
    """Return a layout whose rows begin right below its header, or behind a line of units."""
    units = split_line(below[0].text, layout.delimiter)
    told = [vocabulary().unit(cell.strip("[]() ")) for cell in units if cell]
    has_units = bool(told) and all(told)
    first = below[1 if has_units else 0]
    return replace(
        layout, units=tuple(units) if has_units else (), first_line=first.number, offset=first.offset
    )


def _is_comment(line: HeadLine) -> bool:
    return line.text.lstrip().startswith(COMMENTS)


@dataclass(frozen=True, slots=True)
class _Header:
    """A line of names: the sign between them, how many there are, and which are those of x, y, z."""

    delimiter: str
    width: int
    position: tuple[int, ...]


def _headers(text: str) -> Iterator[_Header]:
    """Yield what a line is as a header, by each delimiter that makes names of x, y and z of it."""
    for comment in COMMENTS:
        text = text.strip().removeprefix(comment)
    for delimiter in DELIMITERS:
        cells = split_line(text, delimiter)
        position = _position(cells)
        if position:
            yield _Header(delimiter, len(cells), position)


def _position(cells: Sequence[str]) -> tuple[int, ...]:
    """Return which names are those of x, y and z in one of the forms that are known; none without all."""
    keys = [key(split_unit(cell)[0]) for cell in cells]
    for pattern in vocabulary().tcp_position:
        matches = {
            k: match.groupdict().get("axis") for k, one in enumerate(keys) if (match := pattern.search(one))
        }
        if {"x", "y", "z"} <= set(matches.values()):
            return tuple(k for k, axis in matches.items() if axis)
    return ()


def _numbers(text: str, header: _Header) -> int:
    """Return how many numbers a line has for x, y, z; 0 if it has other than a cell for each name."""
    cells = split_line(text, header.delimiter)
    if len(cells) < header.width or any(cells[header.width :]):
        return 0
    return sum(any(is_number(cells[k], decimal) for decimal in DECIMALS) for k in header.position)
