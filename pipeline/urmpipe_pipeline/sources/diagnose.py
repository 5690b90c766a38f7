"""The careful pass: reads a table cell by cell and says where each wrong row and cell is."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.errors import Finding
from urmpipe_pipeline.sources.cells import is_missing, is_text, split_line, to_float, to_nanoseconds
from urmpipe_pipeline.sources.sniff import COMMENTS, Layout
from urmpipe_pipeline.sources.table import NO_TIME, REPORTED, ClockColumn, Numbers
from urmpipe_pipeline.sources.text_cells import TextCells

SHOWN_FINDINGS = 20
"""Findings that are told one by one; the others are counted."""

_SHOWN_TEXT = 60


def read_carefully(layout: Layout, columns: Sequence[int], clock: Sequence[ClockColumn]) -> Numbers:
    """Return the numbers of some columns, with a finding for each row and cell that holds none.

    Reads what the fast parser refuses though it is sound (blanks as missing samples, 1.5d0), and
    leaves NaN and REPORTED where something is wrong.

    Args:
        layout: How the table is written.
        columns: Which columns hold numbers.
        clock: The columns of its clock.
    """
    reader = _Reader(layout, columns, clock)
    values, times, lines = array("d"), array("q"), array("q")
    for line, time, row in reader.rows():
        lines.append(line)
        times.append(time)
        values.extend(row)
    return Numbers(
        np.array(values).reshape(len(lines), len(columns)),
        np.array(times) if clock else None,
        tuple(reader.findings),
        reader.wrong,
        np.array(lines),
        tuple(TextCells.of(texts) for texts in reader.texts),
    )


def lines_of_rows(layout: Layout, rows: Sequence[int]) -> dict[int, int]:
    """Return the line of the file of some data rows, both counted from 1."""
    wanted, found = set(rows), {}
    for row, (line, _) in enumerate(data_lines(layout), start=1):
        if row in wanted:
            found[row] = line
            if len(found) == len(wanted):
                break
    return found


def data_lines(layout: Layout) -> Iterator[tuple[int, str]]:
    """Yield number and text of each line with a data row, not of blank lines and comments."""
    for number, line in layout.segment.lines():
        text = line.strip()
        if number < layout.first_line or not text or text.startswith(COMMENTS):
            continue
        for row in split_line(text, layout.delimiter) if layout.across else (line,):
            yield number, row


class _Reader:
    """Goes through the rows and keeps the first findings."""

    def __init__(self, layout: Layout, columns: Sequence[int], clock: Sequence[ClockColumn]) -> None:
        self.layout = layout
        self.columns = columns
        self.clock = clock
        self.findings: list[Finding] = []
        self.wrong = 0
        self._file = str(layout.segment.path)
        self._line = 0
        self._row = 0
        self.texts: list[list[str]] = [[] for part in clock if part.forms]
        self._wanted = (*columns, *(part.column for part in clock))

    def rows(self) -> Iterator[tuple[int, int, list[float]]]:
        """Yield line, time in [ns] and values of each row."""
        for line, text in data_lines(self.layout):
            self._line, self._row = line, self._row + 1
            cells = self._cells(text)
            for texts, part in zip(self.texts, self.clock, strict=False):
                texts.append("" if cells is None else cells[part.column])
            if cells is None:
                yield line, REPORTED, [math.nan] * len(self.columns)
            else:
                yield line, self._time(cells), self._values(cells)

    def _values(self, cells: Sequence[str]) -> list[float]:
        wanted = [cells[j] for j in self.columns]
        if self.layout.decimal == "." and not any("_" in cell for cell in wanted):  # float() takes 1_000
            try:
                return [float(cell) for cell in wanted]
            except ValueError:
                pass
        return [self._value(cells, j) for j in self.columns]

    def _cells(self, text: str) -> list[str] | None:
        """Return the cells of a row; None if it has too few or too many, or no numbers at all."""
        cells = split_line(text, self.layout.delimiter)
        width = len(self.layout.names)
        if len(cells) == width - 1 and not self.layout.names[-1]:
            cells.append("")  # a row without the trailing delimiter that the others have
        if len(cells) != width and any([*cells[width:], len(cells) < width]):
            shown = f" ({_shown(text)})" if len(cells) == 1 else ""
            plural = "" if len(cells) == 1 else "s"
            self._report(f"found {len(cells)} cell{plural}{shown}, allowed: {width}")
            return None
        if len(self._wanted) > 1 and all(is_text(cells[j], self.layout.decimal) for j in self._wanted):
            self._report(f"found {_shown(text)}, allowed: a row of numbers")
            return None
        return cells

    def _time(self, cells: Sequence[str]) -> int:
        total = 0
        for part in () if self.texts else self.clock:
            cell = cells[part.column]
            time = to_nanoseconds(cell, self.layout.decimal, part.exponent)
            if time is None and is_missing(cell):
                return NO_TIME
            if time is None:
                self._report(f"found {_shown(cell)}, allowed: a number in every row", part.column)
                return REPORTED
            total += time
        return total

    def _value(self, cells: Sequence[str], column: int) -> float:
        value = to_float(cells[column], self.layout.decimal)
        if value is not None:
            return value
        allowed = "a number, or an empty, Null or NaN cell where a sample is missing"
        self._report(f"found {_shown(cells[column])}, allowed: {allowed}", column)
        return math.nan

    def _report(self, message: str, column: int | None = None) -> None:
        self.wrong += 1
        if len(self.findings) < SHOWN_FINDINGS:
            name = None if column is None else self.layout.names[column]
            self.findings.append(Finding(message, self._file, self._line, self._row, name))


def _shown(text: str) -> str:
    text = text.strip()
    return repr(text if len(text) <= _SHOWN_TEXT else text[: _SHOWN_TEXT - 3] + "...")
