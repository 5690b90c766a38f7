"""Cells of text: how a line is split, what is a number, what a missing sample; a column of text as bytes.

A column of text is `TextCells`: all bytes in one array, so that NumPy reads many cells of one length at once.
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
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.elementwise import IntArray
from urmpipe_pipeline.logs.vocabulary import vocabulary

SPACE = " "  # as a delimiter it stands for any run of spaces and tabs
DELIMITERS = (",", ";", "\t", SPACE, "|")
DECIMALS = (".", ",")
MAX_COARSE_DIGITS = 6  # significant digits of a format that is worth telling: its steps show in derivatives
MAX_NS = 1 << 62  # times in [ns] stay below, 146 years: then their differences fit into 64 bits as well
MAX_CELL_LENGTH = 64  # no form of a clock has more signs
BLOCK = 1 << 15  # cells read at once: their bytes stay in the processor's cache
_CACHED_CELLS = 1 << 14  # those of a file's head are looked at many times

_INFINITE = re.compile(r"[+-]?(?:inf|infinity|1\.#inf)\Z", re.IGNORECASE)
_GROUPED = re.compile(r"(?<![\w.,])[+-]?\d{1,3}(?:(?:\.\d{3})+,\d+|(?:,\d{3})+\.\d+)(?![\w.,])")

Bytes = NDArray[np.uint8]


@lru_cache
def _number_pattern(decimal: str) -> re.Pattern[str]:
    point = re.escape(decimal)
    return re.compile(rf"[+-]?(?:\d+(?:{point}\d*)?|{point}\d+)(?:[eEdD][+-]?\d+)?\Z")


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
    """Return whether a cell stands for a missing sample: empty, Null, NaN, ..."""
    return cell.lower() in vocabulary().missing


@lru_cache(_CACHED_CELLS)
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
    return int(exact.to_integral_value(ROUND_HALF_EVEN)) if abs(exact) < MAX_NS else None


def grouped_number(text: str) -> str | None:
    """Return the first number in a text with signs between its thousands, as spreadsheets write; or None."""
    match = _GROUPED.search(text)
    return match[0] if match else None


def significant_digits(cells: Iterable[str]) -> int | None:
    """Return the digits of a coarse fixed format such as +1.571e+00 (4), or None.

    Only numbers with an exponent tell: their mantissa shows the digits that the writer allowed itself.
    Zeros are ignored, since writers shorten them. The cells have a decimal point.
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
    return lengths.pop() if len(lengths) == 1 and max(lengths) <= MAX_COARSE_DIGITS else None


def count_up(cells: Sequence[str]) -> bool:
    """Return whether the cells are whole numbers that count up from 0 or 1 in steps of 1."""
    if not cells or cells[0] not in ("0", "1"):
        return False
    first = int(cells[0])
    return list(cells) == [str(first + k) for k in range(len(cells))]


def find_numbers(names: Sequence[str]) -> list[int] | None:
    """Return the last number in each name, if the names are the same without it and the numbers differ."""
    matches = [re.fullmatch(r"(.*?)(\d+)(\D*)", name) for name in names]
    parts = [match.groups() for match in matches if match]
    numbers = [int(number) for _, number, _ in parts]
    same = len({(before, after) for before, _, after in parts}) == 1
    return numbers if same and len(set(numbers)) == len(names) else None


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
        return cls(np.frombuffer(b"".join(encoded), dtype=np.uint8), _cumulate([*map(len, encoded)]))

    @classmethod
    def joined(cls, parts: Sequence[TextCells]) -> TextCells:
        """Return the cells of several parts of a column, one below the other."""
        starts = _cumulate(np.concatenate([np.diff(part.starts) for part in parts]))
        return cls(np.concatenate([part.data[part.starts[0] : part.starts[-1]] for part in parts]), starts)

    def at(self, rows: IntArray | slice) -> TextCells:
        """Return the cells of some rows: by index, shape (k,), or as a slice from the first one on."""
        lengths = np.diff(self.starts)[rows]
        starts = _cumulate(lengths)
        places = np.repeat(self.starts[rows] - starts[:-1], lengths) + np.arange(starts[-1])
        return TextCells(self.data[places], starts)

    def __len__(self) -> int:
        return len(self.starts) - 1

    def text(self, row: int) -> str:
        """Return one cell."""
        return self.data[self.starts[row] : self.starts[row + 1]].tobytes().decode("latin-1")

    def blocks(self) -> Iterator[tuple[IntArray, Bytes]]:
        """Yield some cells of one length each time: their rows, and their bytes, shape (n, length).

        Empty cells, and those that are too long, are ignored.
        """
        for first in range(0, len(self), BLOCK):
            starts = self.starts[first : first + BLOCK + 1]
            lengths = np.minimum(np.diff(starts), MAX_CELL_LENGTH)
            for length in np.flatnonzero(np.bincount(lengths)).tolist():
                if not 0 < length < MAX_CELL_LENGTH:
                    continue
                rows = np.flatnonzero(lengths == length)
                if len(rows) == len(lengths):
                    cells = self.data[starts[0] : starts[-1]].reshape(-1, length)
                else:
                    cells = self.data[starts[rows][:, np.newaxis] + np.arange(length)]
                yield rows + first, cells


def _cumulate(lengths: Sequence[int] | IntArray) -> IntArray:
    return np.concatenate((np.zeros(1, dtype=np.int64), np.cumsum(lengths, dtype=np.int64)))
