r"""Rows whose values are arrays in brackets or stand behind labels, and the plain cells that they mean.

    0.005,"[ 0.1  0.2\n  0.3]",7                  0.005,0.1,0.2,0.3,7
    Time: 0.005  q values: [0.1, 0.2] Type: 0     0.005;0.1;0.2;0

Each way there are two: row by row, which says what is wrong, and over the bytes of many rows at once, which
raises `UnfitError` where a row is not like the others.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from urmpipe_pipeline.logs.formats.cells import Bytes, is_missing, split_line
from urmpipe_pipeline.logs.vocabulary import split_unit

Value = str | list[str]
"""A plain cell, or the cells of an array."""

CLOSING = {"[": "]", "(": ")"}
_WORDS = re.compile(r"\b(?:\w+\.)?(?:float|int)\d+(?=\()")
_INNER = re.compile(r"[^\s,;\[\]()]+")
_SHOWN = 40
_MARK = "\x01"
_MARKERS = bytes((*range(1, 9), *range(14, 32)))
"""Signs that no text has: each stands for a label."""

_UNMARKED = bytes(set(range(256)) - set(_MARKERS + b"\n"))

_GLUED = np.isin(np.arange(256), [*b"0123456789.+-abcdefghijklmnopqrstuvwxyz"])
"""What is no part of a cell beside an array: signs of numbers and words."""

_SEPARATES = np.isin(np.arange(256), list(b" \t\r\n,;[]()"))


class UnfitError(ValueError):
    """Some rows are not written like the others: they are to be read one by one."""


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


@dataclass(frozen=True, slots=True)
class Form:
    """How the rows of a file are written that hold arrays or labels.

    Attributes:
        names: Names of the values of a row.
        lengths: How many numbers each value holds: 0 for a plain cell.
        delimiter: Sign between the values, and between the plain cells that come of them.
        decimal: Decimal sign of the plain values; inside brackets it is always a point.
        opening: The bracket that arrays begin with, empty if there are none.
        continued: Whether arrays go on in a next line, which then begins with a blank.
        words: What programs write around the numbers of arrays, such as np.float64: it is left out.
        labels: What stands before each value, in the order of the row; none in a plain table.
        tail: What ends each row behind its last value.
    """

    names: tuple[str, ...]
    lengths: tuple[int, ...]
    delimiter: str
    decimal: str = "."
    opening: str = ""
    continued: bool = False
    words: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()
    tail: str = ""

    def rows(self, lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
        """Yield each row with the number of its first line; other lines among labelled rows are left out."""
        waiting: tuple[int, str] | None = None
        for number, line in lines:
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
        return not self.labels or any(_label(label).search(line) for label in self.labels)

    def labels_in(self, line: str) -> int:
        """Return how many of the labels stand in a line."""
        return sum(bool(_label(label).search(line)) for label in self.labels)

    def values(self, text: str) -> list[Value]:
        """Return the values of a row.

        Raises:
            RowError: If a label or a bracket is missing.
        """
        for word in self.words:
            text = text.replace(word, "")
        if self.opening and text.count(self.opening) != text.count(CLOSING[self.opening]):
            both = self.opening + CLOSING[self.opening]
            raise RowError(f"found {_shown(text)}, allowed: as many {both[0]} as {both[1]}")
        if self.labels:
            return [self._value(part) for part in self._labelled(text)]
        arrays = iter(self.arrays(text))
        cells = split_line(self.replaced(text, lambda _: _MARK), self.delimiter)
        whole = (re.sub(_MARK, lambda _: next(arrays, _MARK), cell) for cell in cells)
        return [self._value(cell) for cell in whole]

    def readable(self, texts: Iterable[str]) -> list[list[Value]]:
        """Return the values of the rows that have all of them."""
        rows = []
        for text in texts:
            with suppress(RowError):
                values = self.values(text)
                rows += [values] if len(values) == len(self.names) else []
        return rows

    def arrays(self, text: str) -> list[str]:
        """Return the arrays of a row, with their brackets and quotes."""
        return _arrays(self.opening).findall(text)

    def replaced(self, text: str, function: Callable[[str], str]) -> str:
        """Return a row with something else for each array; without the words around them."""
        for word in self.words:
            text = text.replace(word, "")
        return _arrays(self.opening).sub(lambda match: function(match[0]), text)

    def sampled(self, rows: Iterable[Sequence[Value]]) -> tuple[tuple[str, ...], ...]:
        """Return the plain cells of some rows, without the rows whose arrays are not as the others."""
        sample = []
        for values in rows:
            with suppress(RowError):
                sample.append(tuple(self.spread(values)))
        return tuple(sample)

    def spread(self, values: Sequence[Value]) -> list[str]:
        """Return the plain cells of a row's values.

        Raises:
            RowError: If an array is shorter or longer than those of the other rows.
        """
        cells: list[str] = []
        for value, length, name in zip(values, self.lengths, self.names, strict=True):
            if isinstance(value, str) and length and not is_missing(value):
                raise RowError(f"found {_shown(value)}, allowed: an array of {length} numbers", name)
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

    def flat(self, block: bytes, encoding: str) -> tuple[bytes, int]:
        """Return whole rows as rows of plain cells, and how many other lines were left out.

        Raises:
            UnfitError: If a row is not like the others, or may not be.
        """
        for word in self.words:
            block = block.replace(word.encode(encoding), b"")
        left_out = 0
        if self.continued:
            for end in (b"\r\n", b"\n"):
                block = block.replace(end + b" ", b"  ").replace(end + b"\t", b"  ")
        if self.labels:
            block, left_out = self._marked(block, encoding)
        if self.opening:
            block = self._without_brackets(block)
        if self.labels:
            first, others = _MARKERS[:1], _MARKERS[1:]
            signs = b" " + self.delimiter.encode() * len(others)
            block = block.translate(bytes.maketrans(first + others, signs))
        return block, left_out

    def _labelled(self, text: str) -> list[str]:
        """Return what stands behind each label of a row."""
        end = len(text.rstrip()) - len(self.tail)
        starts: list[tuple[int, int]] = []
        place = 0
        for label in self.labels:
            found = text.find(label, place)
            if found < 0 or (not starts and text[:found].strip()):
                labels = " ".join(self.labels)
                raise RowError(f"found {_shown(text)}, allowed: rows with {labels}")
            place = found + len(label)
            starts.append((found, place))
        ends = [*(found for found, _ in starts[1:]), end]
        return [text[start:stop].strip() for (_, start), stop in zip(starts, ends, strict=True)]

    def _value(self, text: str) -> Value:
        """Return the cells of an array, or a plain value as it is."""
        text = text.strip('" ')
        whole = self.opening and text.startswith(self.opening) and text.endswith(CLOSING[self.opening])
        return self.inner(text) if whole else text

    @staticmethod
    def inner(array: str) -> list[str]:
        """Return the numbers of an array."""
        return _INNER.findall(array.replace('"', " "))

    def _marked(self, block: bytes, encoding: str) -> tuple[bytes, int]:
        """Return labelled rows with a marker for each label, and how many other lines were left out."""
        different = sorted(dict.fromkeys(self.labels), key=len, reverse=True)
        if len(self.labels) > len(_MARKERS) or len(different) < len(self.labels):
            raise UnfitError
        block = block.replace(b"\r", b"")
        block += b"" if block.endswith(b"\n") else b"\n"
        for label in different:
            k = self.labels.index(label)
            block = block.replace(label.encode(encoding), _MARKERS[k : k + 1])
        if self.tail:
            block = block.replace(self.tail.encode(encoding) + b"\n", b"\n")
        expected = _MARKERS[: len(self.labels)] + b"\n"
        if block.translate(None, _UNMARKED) == expected * block.count(b"\n"):
            return block, 0
        block, left_out = _without_other_lines(block)
        if block.translate(None, _UNMARKED) != expected * block.count(b"\n"):
            raise UnfitError
        return block, left_out

    def _without_brackets(self, block: bytes) -> bytes:
        """Return rows with the delimiter between the numbers of each array, and no brackets around it."""
        opening, closing = self.opening.encode(), CLOSING[self.opening].encode()
        block = block.replace(b'"' + opening, opening).replace(closing + b'"', closing)
        signs: Bytes = np.frombuffer(block, dtype=np.uint8)
        closes = signs == closing[0]
        depth = np.cumsum((signs == opening[0]).view(np.int8) - closes.view(np.int8), dtype=np.int8)
        inside = (depth != 0) | closes
        if (inside & (signs == ord("\n"))).any():  # an array goes on only where a line begins with a blank
            raise UnfitError
        outside = np.flatnonzero(_GLUED[signs] & ~inside)
        if (inside[np.minimum(outside + 1, len(signs) - 1)] | inside[np.maximum(outside - 1, 0)]).any():
            raise UnfitError  # something stands at a bracket, as in [1 2]3
        separates = _SEPARATES[signs] & inside
        edges = np.flatnonzero(np.diff(separates.view(np.int8), prepend=np.int8(0), append=np.int8(0)))
        first, last = edges[0::2], edges[1::2] - 1
        ends = closes[last] & (depth[last] == 0)
        between = first[(signs[first] != opening[0]) & ~ends]
        lengths = np.diff(np.searchsorted(between, last[ends]), prepend=0) + 1
        arrays = [length for length in self.lengths if length]
        if (
            len(lengths) % len(arrays)
            or (lengths.reshape(-1, len(arrays)) != arrays).any()
            or depth[-1:].any()
        ):
            raise UnfitError
        flat = signs.copy()
        if self.decimal != ".":
            flat[inside & (signs == ord("."))] = ord(self.decimal)
        flat[between] = ord(self.delimiter)
        separates[between] = False
        result: bytes = flat[~separates].tobytes()
        return result


def usual_length(values: Iterable[Value]) -> int:
    """Return how many numbers most values of a column hold, 0 for plain cells; of two alike, the more."""
    counts = Counter(0 if isinstance(value, str) else len(value) for value in values)
    return max(counts, key=lambda length: (counts[length], length), default=0)


def words_around(texts: Iterable[str]) -> tuple[str, ...]:
    """Return what programs write around the numbers of arrays, such as np.float64."""
    return tuple(sorted({word for text in texts for word in _WORDS.findall(text)}, key=len, reverse=True))


def spread_names(names: Sequence[str], lengths: Sequence[int]) -> Iterator[str]:
    """Yield a name for every plain cell: NAME, or NAME_1, NAME_2, ... with the array's unit behind it."""
    for name, length in zip(names, lengths, strict=True):
        label, unit = split_unit(name)
        if length and unit and label == name.strip():
            label = label[: -len(unit)].rstrip(" _./")
        suffix = f" [{unit}]" if unit else ""
        yield from (f"{label}_{k + 1}{suffix}" for k in range(length)) if length else (name,)


def _without_other_lines(block: bytes) -> tuple[bytes, int]:
    """Return the lines with a marker, and how many there were without one; blank ones are not counted."""
    signs: Bytes = np.frombuffer(block, dtype=np.uint8)
    marked = np.isin(np.arange(256), list(_MARKERS))[signs]
    ends = np.flatnonzero(signs == ord("\n"))
    starts = np.concatenate(([0], ends[:-1] + 1))
    rows = np.logical_or.reduceat(marked, starts)
    blank = np.logical_and.reduceat(signs <= ord(" "), starts) & ~rows
    kept: bytes = signs[np.repeat(rows, ends - starts + 1)].tobytes()
    return kept, int((~rows & ~blank).sum())


@lru_cache
def _label(label: str) -> re.Pattern[str]:
    """Return the pattern of a label that is no end of a longer word."""
    return re.compile((r"(?<!\w)" if label[:1].isalnum() else "") + re.escape(label))


@lru_cache
def _arrays(opening: str) -> re.Pattern[str]:
    """Return the pattern of an array with its quotes; one array may hold others (a matrix)."""
    a, b = re.escape(opening), re.escape(CLOSING[opening])
    array = f"{a}(?:[^{a}{b}]|{a}[^{a}{b}]*{b})*{b}"
    return re.compile(f'"{array}"|{array}')


def _shown(text: str) -> str:
    text = text.strip().strip('"')
    return repr(text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}...")
