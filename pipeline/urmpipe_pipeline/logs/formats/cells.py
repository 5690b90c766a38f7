"""One line and one cell of a text table: how it is split, what is a number, what is a missing sample.

The cells of a column of text as bytes in one array, so that NumPy reads them.

The lines above the numbers: names of the columns, groups over them, and their units.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Decimal, DecimalException
from functools import lru_cache
from itertools import groupby, pairwise, repeat

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import IntArray
from urmpipe_pipeline.logs.formats.text import HeadLine
from urmpipe_pipeline.logs.vocabulary import vocabulary

SPACE = " "
"""As a delimiter it stands for any run of spaces and tabs."""

DELIMITERS = (",", ";", "\t", SPACE, "|")
DECIMALS = (".", ",")

COARSE_DIGITS = 6
"""A format of this many significant digits or fewer is worth telling: its steps show in derivatives."""


_CELLS = 1 << 14
"""Cells that are remembered as numbers or not: those of a file's head are looked at many times."""


@lru_cache
def _number_pattern(decimal: str) -> re.Pattern[str]:
    point = re.escape(decimal)
    return re.compile(rf"[+-]?(?:\d+(?:{point}\d*)?|{point}\d+)(?:[eEdD][+-]?\d+)?\Z")


LONGEST_NS = 1 << 62
"""Times in [ns] stay below this, 146 years: then their differences fit into 64 bits as well."""

_INFINITE = re.compile(r"[+-]?(?:inf|infinity|1\.#inf)\Z", re.IGNORECASE)


_GROUPED = re.compile(r"(?<![\w.,])[+-]?\d{1,3}(?:(?:\.\d{3})+,\d+|(?:,\d{3})+\.\d+)(?![\w.,])")
"""A number with a point or a comma between its thousands, and the other one before its decimals."""


def grouped_number(text: str) -> str | None:
    """Return the first number in a text that has signs between its thousands, as spreadsheets write it."""
    found = _GROUPED.search(text)
    return found[0] if found else None


def split_line(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, without the spaces and quotes around them.

    Args:
        line: One line of the file.
        delimiter: The sign between cells; a space stands for any run of spaces and tabs.
    """
    if delimiter == SPACE:
        return [cell.strip('"') for cell in line.split()]
    if '"' in line:
        with suppress(csv.Error):  # a stray carriage return, a quote that never ends
            rows = csv.reader([line], delimiter=delimiter, skipinitialspace=True)
            return [cell.strip() for cell in next(rows)]
    return [cell.strip() for cell in line.split(delimiter)]


def printable(text: str) -> str:
    """Return a text from a file with ? for what would break a line or a terminal."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)


def is_missing(cell: str) -> bool:
    """Return whether a cell says that there is no sample: empty, Null, NaN, ..."""
    return cell.lower() in vocabulary().missing


@lru_cache(_CELLS)
def is_number(cell: str, decimal: str) -> bool:
    """Return whether a cell is a number with this decimal sign (infinities included)."""
    return bool(_number_pattern(decimal).match(cell) or _INFINITE.match(cell))


def count_numbers(cells: Iterable[str], decimal: str) -> int:
    """Return how many cells are numbers with this decimal sign."""
    return sum(map(is_number, cells, repeat(decimal)))


def is_text(cell: str, decimal: str) -> bool:
    """Return whether a cell is neither a number nor a missing sample."""
    return not is_number(cell, decimal) and not is_missing(cell)


def plain(cell: str, decimal: str) -> str:
    """Return a number's text as Python spells it: decimal point, exponent e."""
    return cell.replace(decimal, ".").replace("d", "e").replace("D", "e")


def to_float(cell: str, decimal: str) -> float | None:
    """Return a cell's value, NaN for a missing sample, None for text."""
    if _number_pattern(decimal).match(cell):
        return float(plain(cell, decimal))
    if is_missing(cell):
        return math.nan
    if _INFINITE.match(cell):
        return -math.inf if cell.startswith("-") else math.inf
    return None


def to_nanoseconds(cell: str, decimal: str, exponent: int) -> int | None:
    """Return a clock's cell in integer [ns], rounded once from its exact text; None if it is no time.

    Args:
        cell: Text of the cell.
        decimal: The file's decimal sign.
        exponent: Power of ten from the clock's unit to [ns]: 9 for s, 6 for ms, 3 for us, 0 for ns.
    """
    if not _number_pattern(decimal).match(cell):
        return None
    try:
        exact = Decimal(plain(cell, decimal)).scaleb(exponent)
    except DecimalException:  # an exponent of millions
        return None
    return int(exact.to_integral_value(ROUND_HALF_EVEN)) if abs(exact) < LONGEST_NS else None


def significant_digits(cells: Iterable[str]) -> int | None:
    """Return the digits of a coarse fixed format such as +1.571e+00 (4), or None.

    Only numbers with an exponent tell: their mantissa shows the digits that the writer allowed itself.
    Zeros are left out, since writers shorten them. The cells have a decimal point.
    """
    lengths = set()
    for cell in cells:
        mantissa, sign, _ = cell.lower().lstrip("+-").partition("e")
        digits = mantissa.replace(".", "")
        if not digits.strip("0"):
            continue
        if not sign:
            return None
        lengths.add(len(digits))
    return lengths.pop() if len(lengths) == 1 and max(lengths) <= COARSE_DIGITS else None


def count_up(cells: Sequence[str]) -> bool:
    """Return whether the cells are whole numbers that count up from 0 or 1 in steps of 1."""
    if not cells or cells[0] not in ("0", "1"):
        return False
    first = int(cells[0])
    return list(cells) == [str(first + k) for k in range(len(cells))]


Bytes = NDArray[np.uint8]

BLOCK = 1 << 15
"""Cells read at once: their bytes stay in the cache."""

LONGEST_CELL = 64
"""No form of a clock has more signs."""


@dataclass(frozen=True, slots=True, eq=False)
class TextCells:
    """The cells of a column of text.

    Attributes:
        data: Their bytes, one after the other (ASCII, or signs that no clock has).
        starts: Where each begins, and where the last ends, shape (n + 1,).
    """

    data: Bytes
    starts: IntArray

    @classmethod
    def of(cls, texts: Iterable[str]) -> TextCells:
        """Return texts as cells."""
        encoded = [text.encode("ascii", "replace") for text in texts]
        starts = np.cumsum([0, *map(len, encoded)], dtype=np.int64)
        return cls(np.frombuffer(b"".join(encoded), dtype=np.uint8), starts)

    @classmethod
    def joined(cls, parts: Sequence[TextCells]) -> TextCells:
        """Return the cells of several parts of a column, one below the other."""
        lengths = np.concatenate([np.diff(part.starts) for part in parts])
        starts = np.concatenate((np.zeros(1, dtype=np.int64), np.cumsum(lengths)))
        return cls(np.concatenate([part.data[part.starts[0] : part.starts[-1]] for part in parts]), starts)

    def at(self, rows: IntArray | slice) -> TextCells:
        """Return the cells of some rows: by index, shape (k,), or as a slice from the first one on."""
        lengths = np.diff(self.starts)[rows]
        starts = np.concatenate((np.zeros(1, dtype=np.int64), np.cumsum(lengths)))
        place = np.repeat(self.starts[rows] - starts[:-1], lengths) + np.arange(starts[-1])
        return TextCells(self.data[place], starts)

    def __len__(self) -> int:
        return len(self.starts) - 1

    def text(self, row: int) -> str:
        """Return one cell."""
        return self.data[self.starts[row] : self.starts[row + 1]].tobytes().decode("latin-1")

    def blocks(self) -> Iterator[tuple[IntArray, Bytes]]:
        """Yield some cells of one length each time: their rows, and their bytes, shape (n, length).

        Empty cells, and those that are too long, are left out.
        """
        for first in range(0, len(self), BLOCK):
            starts = self.starts[first : first + BLOCK + 1]
            lengths = np.minimum(np.diff(starts), LONGEST_CELL)
            for length in np.flatnonzero(np.bincount(lengths)).tolist():
                if not 0 < length < LONGEST_CELL:
                    continue
                rows = np.flatnonzero(lengths == length)
                if len(rows) == len(lengths):
                    cells = self.data[starts[0] : starts[-1]].reshape(-1, length)
                else:
                    cells = self.data[starts[rows][:, np.newaxis] + np.arange(length)]
                yield rows + first, cells


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
