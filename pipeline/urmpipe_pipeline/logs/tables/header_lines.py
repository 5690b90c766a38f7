"""The lines above the numbers: names of the columns, groups over them, and their units."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import groupby, pairwise

from urmpipe_pipeline.logs.cells.cell import DELIMITERS, SPACE, count_up, printable, split_line
from urmpipe_pipeline.logs.tables.text import HeadLine
from urmpipe_pipeline.logs.vocabulary import vocabulary

_UNIT = r"(?:[^\])\d]|(?<=[sm^])[23]|1(?=/))*"
_BRACKETED = re.compile(rf"\[{_UNIT}\]|\({_UNIT}\)")
"""A unit in brackets, such as [rad/s^2] or (1/min); with another number it is an index."""

_COUNTED = re.compile(
    r"(?P<stem>(Var|V|f|X|[Cc]ol(umn)?|[Ff]ield|[Cc]h(annel)?|data|ans|arr|Unnamed:)?[ _.]*)(?P<n>\d+)"
)
"""What programs call columns that nobody named: pandas, MATLAB, R, NumPy."""

Row = list[str]


def header_of(before: Sequence[HeadLine], delimiter: str, width: int) -> tuple[tuple[int, Row] | None, Row]:
    """Return line and names of the header, and the cells of a line of units between it and the data.

    Where names repeat and the line above has groups that tell them apart, as Position and Velocity do over
    the names of joints, a name is GROUP/NAME.
    """
    units: Row = []
    split = [_header_cells(line.text, delimiter, width) for line in before]
    for at in reversed(range(len(before))):
        line, cells = before[at], split[at]
        if abs(len(cells) - width) > 1 and (line.is_comment or len(cells) == 1):
            continue  # a comment or a title
        if not units and at > 0 and _all_units(cells, split[:at]):
            units = cells
            continue
        if at and cells[0] and not any(cells[1:]):  # the name of an index alone, below those of the columns
            split[at - 1] = [cells[0], *split[at - 1][1:]]
            continue
        above = split[at - 1] if at else []
        names = _grouped(cells, above) if abs(len(above) - len(cells)) <= 1 else cells
        same = names == cells and len(above) == len(cells)
        units = above if not units and same and _all_units(above, [cells]) else units
        return (line.number, [printable(cell) for cell in names]), units
    return None, units


def only_count(names: Sequence[str]) -> bool:
    """Return whether names say nothing but the numbers of their columns: 0, 1, 2 of pandas, Var1, Var2."""
    found = [_COUNTED.fullmatch(name) for name in names if name]
    if len(found) < 3 or not all(found):
        return False
    parts = [(match["stem"], int(match["n"])) for match in found if match]
    return len({stem for stem, _ in parts}) == 1 and all(b == a + 1 for (_, a), (_, b) in pairwise(parts))


def numbered(above: HeadLine, row: Sequence[str], delimiter: str) -> bool:
    """Return whether a row of numbers is the second line of a header: it counts up below each group.

    Below q, q, q, qd, qd, qd stand 1, 2, 3, 1, 2, 3, as pandas writes columns of two levels.
    """
    groups = _header_cells(above.text, delimiter, len(row))
    if len(groups) != len(row):
        return False
    both = [(group, name) for group, name in zip(groups, row, strict=True) if name]
    counts = {group: [name for _, name in cells] for group, cells in groupby(both, key=lambda pair: pair[0])}
    return bool(counts) and all(
        len(count) > 1 and count_up(count) and not group[-1:].isdigit() for group, count in counts.items()
    )


def _grouped(names: Row, above: Row) -> Row:
    """Return names with the groups above them, where they repeat and with their groups do not."""
    above = [*above, *("" for _ in range(len(names) - len(above)))][: len(names)]
    groups, last = [], ""
    for cell in above:
        last = cell or last
        groups.append(last)
    joined = [
        f"{group}/{name}" if group and name else name or own
        for name, own, group in zip(names, above, groups, strict=True)
    ]
    return joined if _repeat(names) and not _repeat(joined) else names


def _repeat(names: Row) -> bool:
    """Return whether a name stands there twice."""
    known = sorted(filter(None, names))
    return any(one == other for one, other in pairwise(known))


def _header_cells(text: str, delimiter: str, width: int) -> Row:
    """Split a header line, with its own delimiter if only that gives a name a column (numpy.savetxt)."""
    if width == 1:
        return _over_one_column(text)
    text = text.strip(" " if delimiter == "\t" else None)  # a tab before the first name: an unnamed index
    for comment in ("#", "//", "% "):
        text = text.removeprefix(comment)
    tried = [split_line(text, sign) for sign in (delimiter, *DELIMITERS)]
    return next((cells for cells in tried if len(cells) == width), tried[0])


def _over_one_column(text: str) -> Row:
    """Split a header line over rows of one cell, which show no sign between cells: by what parts most names.

    A name with its unit behind a comma is one, and so is a comment in words.
    """
    plain = text.strip().lstrip("#%/ ")
    parts = max((split_line(plain, sign) for sign in DELIMITERS if sign != SPACE), key=len)
    with_unit = len(parts) == 2 and vocabulary().unit(parts[1]) is not None
    in_words = plain != text.strip() and any(" " in part for part in parts)
    return split_line(plain, "\t") if with_unit or in_words else parts


def _all_units(cells: Row, above: Sequence[Row]) -> bool:
    """Return whether a line holds units alone: known ones, or any in brackets below a line of names."""
    words = [cell.strip("[]() ") for cell in cells]
    bracketed = all(_BRACKETED.fullmatch(cell.strip()) for cell in cells if cell.strip())
    named = bracketed and any(len(row) == len(cells) for row in above)
    return any(words) and (named or all(not word or vocabulary().unit(word) for word in words))
