"""How a table of targets is written, told by its header: x, y, z say more than rows of which some are wrong.

A few targets are typed by hand, and most of their rows may be wrong. How a log is written its rows tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from urmpipe_pipeline.sources.cells import DECIMALS, DELIMITERS, is_number, split_line
from urmpipe_pipeline.sources.sniff import COMMENTS, SAMPLED_LINES, Layout, sniff
from urmpipe_pipeline.sources.text import HeadLine, Segment, head_lines
from urmpipe_pipeline.sources.vocabulary import key, split_unit, vocabulary


def sniff_targets(segment: Segment, delimiter: str | None = None, decimal: str | None = None) -> Layout:
    """Return how a table is written: by the rows that have a cell for each name, if a header names x, y, z.

    All lines below the header are rows then, but for comments and a line of units.

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
        widths = _widths(header.text)
        below = [line for line in lines[place + 1 :] if not _is_comment(line)]
        whole = [line for line in below if _is_whole(line.text, widths)]
        if not whole:
            continue
        units = [line for line in below[:1] if line not in whole and _all_units(line.text, widths)]
        layout = sniff(segment, delimiter, decimal, [*lines[: place + 1], *units, *whole])
        if layout.header != header.number:
            break
        first = below[len(units)]
        return replace(layout, first_line=first.number, offset=first.offset)
    return sniff(segment, delimiter, decimal)


def _is_comment(line: HeadLine) -> bool:
    return line.text.lstrip().startswith(COMMENTS)


def _widths(text: str) -> dict[str, int]:
    """Return how many names a line has by the delimiters that make names of x, y and z of it."""
    for comment in COMMENTS:
        text = text.strip().removeprefix(comment)
    split = {delimiter: split_line(text, delimiter) for delimiter in DELIMITERS}
    return {delimiter: len(cells) for delimiter, cells in split.items() if _names_position(cells)}


def _names_position(cells: Sequence[str]) -> bool:
    """Tell whether names are those of x, y and z in one of the forms that are known."""
    keys = [key(split_unit(cell)[0]) for cell in cells if cell]
    for pattern in vocabulary().tcp_position:
        found = [match.groupdict().get("axis") for one in keys if (match := pattern.search(one))]
        if {"x", "y", "z"} <= set(found):
            return True
    return False


def _is_whole(text: str, widths: dict[str, int]) -> bool:
    """Tell whether a line has a cell for each name, one of them a number."""
    for delimiter, width in widths.items():
        cells = split_line(text, delimiter)
        cells = cells[:width] if not any(cells[width:]) else cells  # delimiters behind the last
        numbers = any(is_number(cell, decimal) for cell in cells for decimal in DECIMALS)
        if len(cells) == width and numbers:
            return True
    return False


def _all_units(text: str, widths: dict[str, int]) -> bool:
    """Tell whether a line holds units below the names."""
    return any(
        all(not cell or vocabulary().unit(cell.strip("[]() ")) for cell in split_line(text, delimiter))
        for delimiter in widths
    )
