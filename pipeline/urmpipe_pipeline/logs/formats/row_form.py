r"""Rows whose values are arrays in brackets or follow labels, and the plain cells that they mean.

    0.005,"[ 0.1  0.2\n  0.3]",7                  0.005,0.1,0.2,0.3,7
    Time: 0.005  q values: [0.1, 0.2] Type: 0     0.005;0.1;0.2;0

1. `RowForm.rows`: the lines of a row as one; lines without a label are other messages.
2. `RowForm.values`, `RowForm.spread`: one row as its values, and these as plain cells, or the error.
3. `RowForm.flatten`: many rows at once by one pattern of a row; None where one does not match it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache

from urmpipe_pipeline.logs.formats.cells import SPACE, is_missing, split_line
from urmpipe_pipeline.logs.vocabulary import split_unit

Value = str | list[str]  # a plain cell, or the numbers of an array

CLOSING = {"[": "]", "(": ")", "{": "}"}
MAX_SHOWN = 40  # characters of a row in a message
_WRAPPED = re.compile(r"\b(?:\w+\.)?(?:float|int)\d+\(([^()]*)\)")  # np.float64(0.1)
_NUMBERS = re.compile(r"[^\s,;\[\](){}\"]+")
_PLAIN = r"(?:[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan)"
_QUOTED = re.compile(rf'"\s*({_PLAIN}(?:[,;\s]+{_PLAIN}){{2,}})\s*"')  # "0.1,0.2,0.3": an array
_THOUSANDS = re.compile(r"[-+]?\d{1,3}(,\d{3})+(\.\d+)?")
_ARRAY_SIGN = "\x01"  # no text has it


class RowError(ValueError):
    """A row is not written like the others.

    Attributes:
        message: What was found, and what is allowed.
        name: The column, if it is one.
    """

    def __init__(self, message: str, name: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.name = name


@dataclass(frozen=True, eq=False)
class RowForm:
    """How the rows of a file are written that hold arrays or labels.

    Attributes:
        names: Names of the values of a row.
        lengths: How many numbers each value holds: 0 for a plain cell.
        delimiter: Sign between the values, and between the plain cells that come of them.
        decimal: Decimal sign of the plain values; inside brackets it is always a point.
        opening: The bracket that arrays begin with, empty if there are none.
        continued: Whether arrays continue in a next line, which then begins with a blank.
        labels: The text before each value, in the order of the row; empty in a plain table.
        tail: The end of each row after its last value.
        quoted: Whether arrays have quotes for brackets.
    """

    names: tuple[str, ...]
    lengths: tuple[int, ...]
    delimiter: str
    decimal: str = "."
    opening: str = ""
    continued: bool = False
    labels: tuple[str, ...] = ()
    tail: str = ""
    quoted: bool = False

    def rows(self, lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
        """Yield each row with the number of its first line; other lines among labelled rows are left out."""
        waiting: tuple[int, str] | None = None
        for number, text in lines:
            line = with_brackets(text) if self.quoted else text
            if waiting and self.continued and line[:1] in (" ", "\t"):
                waiting = (waiting[0], f"{waiting[1]} {line.lstrip()}")
                continue
            if waiting:
                yield waiting
            waiting = (number, line) if self.is_row(line) else None
        if waiting:
            yield waiting

    def is_row(self, line: str) -> bool:
        """Return whether a line holds a row: among labelled ones, all that have none of the labels do not."""
        return not self.labels or self.count_labels(line) > 0

    def count_labels(self, line: str) -> int:
        """Return how many of the labels a line has, none of them as the end of a longer word."""
        return sum(bool(_label_pattern(label).search(line)) for label in self.labels if label)

    def values(self, text: str) -> list[Value]:
        """Return the values of a row.

        Raises:
            RowError: If a label or a bracket is missing.
        """
        text = _WRAPPED.sub(r"\1", text)
        closing = CLOSING.get(self.opening, "")
        if self.opening and text.count(self.opening) != text.count(closing):
            raise RowError(f"found {shorten(text)}, allowed: as many {self.opening} as {closing}")
        if self.labels:
            cells = self._after_labels(text)
        else:
            arrays = iter(self.arrays(text))
            cells = split_line(self.replace_arrays(text, lambda _: _ARRAY_SIGN), self.delimiter)
            cells = [re.sub(_ARRAY_SIGN, lambda _: next(arrays, _ARRAY_SIGN), cell) for cell in cells]
        cells = [cell.strip('" ') for cell in cells]
        is_array = [bool(self.opening) and c.startswith(self.opening) and c.endswith(closing) for c in cells]
        return [numbers_in(cell) if array else cell for cell, array in zip(cells, is_array, strict=True)]

    def _after_labels(self, text: str) -> list[str]:
        places: list[tuple[int, int]] = []
        end = 0
        for label in self.labels:
            start = text.find(label, end)
            if start < 0 or (not places and text[:start].strip()):
                raise RowError(f"found {shorten(text)}, allowed: rows with {' '.join(self.labels)}")
            end = start + len(label)
            places.append((start, end))
        ends = [*(start for start, _ in places[1:]), len(text.rstrip()) - len(self.tail)]
        return [text[start:stop] for (_, start), stop in zip(places, ends, strict=True)]

    def spread(self, values: Sequence[Value]) -> list[str]:
        """Return the plain cells of a row's values.

        Raises:
            RowError: If an array is shorter or longer than those of the other rows.
        """
        cells: list[str] = []
        for value, length, name in zip(values, self.lengths, self.names, strict=True):
            if isinstance(value, str) and length and not is_missing(value):
                raise RowError(f"found {shorten(value)}, allowed: an array of {length} numbers", name)
            if isinstance(value, list) and length and len(value) != length:
                allowed = f"{length}, as in the other rows"
                raise RowError(f"found an array of {len(value)} numbers, allowed: {allowed}", name)
            if isinstance(value, str):
                cells += [value] * max(length, 1)
            elif length:
                cells += [cell.replace(".", self.decimal) for cell in value]
            else:  # a plain cell that looks like an array
                cells.append(self.opening + " ".join(value) + CLOSING[self.opening])
        return cells

    def read_values(self, texts: Iterable[str]) -> list[list[Value]]:
        """Return the values of the rows that have all of them."""
        rows = []
        for text in texts:
            with suppress(RowError):
                values = self.values(text)
                rows += [values] if len(values) == len(self.names) else []
        return rows

    def read_cells(self, rows: Iterable[Sequence[Value]]) -> tuple[tuple[str, ...], ...]:
        """Return the plain cells of some rows, without those whose arrays are not as the others."""
        cells = []
        for values in rows:
            with suppress(RowError):
                cells.append(tuple(self.spread(values)))
        return tuple(cells)

    def arrays(self, text: str) -> list[str]:
        """Return the arrays of a row, with their brackets and quotes."""
        return _array_pattern(self.opening).findall(text) if self.opening else []

    def replace_arrays(self, text: str, function: Callable[[str], str]) -> str:
        """Return a row with something else for each array."""
        text = _WRAPPED.sub(r"\1", text)
        return _array_pattern(self.opening).sub(lambda match: function(match[0]), text)

    def flatten(self, text: str) -> tuple[str, int] | None:
        """Return whole rows as rows of plain cells, and how many other lines were left out.

        Returns:
            None if a row is not like the others, or may not be: it is to be read as `values` does.
        """
        if self.quoted:
            text = with_brackets(text)
        if "(" in text and self.opening:
            text = _WRAPPED.sub(r"\1", text)
        if self.continued:
            text = text.replace("\r\n", "\n").replace("\n ", "  ").replace("\n\t", "  ")
        pattern = self._row_pattern
        rows = pattern.findall(text)
        if pattern.groups == 1:
            rows = [(cell,) for cell in rows]
        left_out = 0
        if len(rows) < text.count("\n") + (not text.endswith("\n")):
            remaining = [line for line in pattern.sub("", text).split("\n") if line.strip()]
            if remaining and (not self.labels or any(map(self.is_row, remaining))):
                return None
            left_out = len(remaining)
        if self.decimal != ".":
            is_array = [length > 0 for length in self.lengths for _ in range(max(length, 1))]
            columns = [
                [cell.replace(".", self.decimal) for cell in cells] if array else cells
                for cells, array in zip(zip(*rows, strict=True), is_array, strict=False)
            ]
            rows = list(zip(*columns, strict=True))
        return "\n".join([*map(self.delimiter.join, rows), ""]), left_out

    @cached_property
    def _row_pattern(self) -> re.Pattern[str]:
        """The pattern of a row with a group for each plain cell."""
        opening, closing = re.escape(self.opening), re.escape(CLOSING.get(self.opening, ""))
        delimiter = r"[ \t]" if self.delimiter == SPACE else re.escape(self.delimiter)
        between = r"[ \t]++" if self.delimiter == SPACE else rf"[ ]*+{delimiter}[ ]*+"
        plain = rf'("(?:[^"\n]|"")*+"|[^"\r\n{delimiter.strip("[]")}{opening}]*+)'
        values = []
        for k, length in enumerate(self.lengths):
            array = r"[ \t,;]++".join([r'([^\s,;\[\](){}"]++)'] * length)
            array = rf'"?{opening}[ \t]*+{array}[ \t,;]*+{closing}"?'
            if not self.labels:
                values.append(array if length else plain)
                continue
            last = k + 1 == len(self.labels)
            end = rf"{re.escape(self.tail)}[ \t]*+\r?$" if last else re.escape(self.labels[k + 1])
            value = array if length else r"([^\n]*?)"
            values.append(rf'(?>"?[ \t]*+{value}[ \t"]*+{end})')
        if self.labels:
            row = re.escape(self.labels[0]) + "".join(values)
        else:
            row = between.join(values) + r"[ \t]*+\r?$"
        return re.compile(rf"^[ \t]*+{row}", re.MULTILINE)


def with_brackets(text: str) -> str:
    """Return a text with brackets in place of the quotes around arrays."""
    return _QUOTED.sub(lambda match: f"[{match[1]}]" if _is_array(match[1]) else match[0], text)


def quoted_lengths(text: str) -> tuple[int, ...]:
    """Return how many numbers each array in quotes has."""
    return tuple(len(numbers_in(array)) for array in _QUOTED.findall(text) if _is_array(array))


def _is_array(text: str) -> bool:
    """Return whether numbers in quotes are an array: no codes, no number with signs between its thousands."""
    return ("." in text or "nan" in text) and not _THOUSANDS.fullmatch(text)


def numbers_in(array: str) -> list[str]:
    """Return the numbers of an array."""
    return _NUMBERS.findall(array)


def usual_length(values: Iterable[Value]) -> int:
    """Return how many numbers most values of a column hold, 0 for plain cells; of two alike, the more."""
    counts = Counter(0 if isinstance(value, str) else len(value) for value in values)
    return max(counts, key=lambda length: (counts[length], length), default=0)


def spread_names(names: Sequence[str], lengths: Sequence[int]) -> Iterator[str]:
    """Yield a name for every plain cell: NAME, or NAME_1, NAME_2, ... with the array's unit at the end."""
    for name, length in zip(names, lengths, strict=True):
        label, unit = split_unit(name)
        if length and unit and label == name.strip():
            label = label[: -len(unit)].rstrip(" _./")
        suffix = f" [{unit}]" if unit else ""
        yield from (f"{label}_{k + 1}{suffix}" for k in range(length)) if length else (name,)


def shorten(text: str) -> str:
    """Return the beginning of a text for a message."""
    text = text.strip().strip('"')
    return repr(text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}...")


@lru_cache
def _label_pattern(label: str) -> re.Pattern[str]:
    return re.compile((r"(?<!\w)" if label[:1].isalnum() else "") + re.escape(label))


@lru_cache
def _array_pattern(opening: str) -> re.Pattern[str]:
    """Return the pattern of an array with its quotes; one array may hold others (a matrix)."""
    a, b = re.escape(opening), re.escape(CLOSING[opening])
    array = f"{a}(?:[^{a}{b}]|{a}[^{a}{b}]*{b})*{b}"
    return re.compile(f'"{array}"|{array}')
