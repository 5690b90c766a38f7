"""One line and one cell of a text table: how it is split, what is a number, what is a missing sample."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from decimal import ROUND_HALF_EVEN, Decimal, DecimalException
from functools import lru_cache
from itertools import repeat

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
