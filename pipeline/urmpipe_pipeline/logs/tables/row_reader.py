"""Rows that the parser refuses, cell by cell: read, or told with the line and column of what is wrong."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, Hint
from urmpipe_pipeline.logs.cells.cell import (
    is_missing,
    is_number,
    is_text,
    split_line,
    to_float,
    to_nanoseconds,
)
from urmpipe_pipeline.logs.cells.text_cells import TextCells
from urmpipe_pipeline.logs.tables.form import RowError, Value
from urmpipe_pipeline.logs.tables.numbers import (
    NO_TIME,
    REPORTED,
    SHOWN_FINDINGS,
    ClockColumn,
    Numbers,
    RowFault,
)
from urmpipe_pipeline.logs.tables.sniff import Layout
from urmpipe_pipeline.logs.tables.text import COMMENTS, MOST_HEAD
from urmpipe_pipeline.logs.vocabulary import split_unit

_SHOWN_TEXT = 60
_LAST_BYTES = 1 << 12
_FIXED_ROWS = 100
"""So many rows tell that a column is written with the same number of decimals."""

HEADER = "the header again"

MAY_BE_MISSING = "a number, or an empty, Null or NaN cell where a sample is missing"
"""What a cell of a log may hold."""


def lines_of_rows(layout: Layout, rows: Sequence[int]) -> dict[int, int]:
    """Return the line of the file of some data rows, both counted from 1; none of a table in memory."""
    if layout.held is not None:
        return {}
    numbered = enumerate(data_lines(layout, layout.segment.lines()), start=1)
    wanted = set(rows)
    return {row: line for row, (line, _) in islice(numbered, max(rows, default=0)) if row in wanted}


def data_lines(layout: Layout, lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Yield number and text of each line with a data row, not of blank lines and comments."""
    lines = (line for line in lines if line[0] >= layout.first_line)
    for number, line in lines if layout.form is None else layout.form.rows(lines):
        text = line.strip()
        if not text or text.startswith(COMMENTS):
            continue
        for row in split_line(text, layout.delimiter) if layout.across else (line,):
            yield number, row


def first_left_out(layout: Layout) -> tuple[int, str]:
    """Return number and beginning of the first line among labelled rows that is none."""
    form, lines = layout.form, layout.segment.lines()
    others = ((n, text) for n, text in lines if n >= layout.first_line and text.strip())
    number, text = next((n, text) for n, text in others if form is not None and not form.is_row(text))
    return number, _shown(text)


def cut_cell(layout: Layout) -> str | None:
    """Return the last cell of a file if it is cut: no line end is behind it, and it lacks decimals."""
    segment, usual = layout.segment, layout.cells(len(layout.names) - 1)
    if layout.form is not None or layout.across or len(usual) < _FIXED_ROWS:
        return None
    with segment.open() as file:
        file.seek(max(segment.start, segment.end - _LAST_BYTES))
        text = file.read(segment.end - file.tell()).decode(segment.encoding, errors="replace")
    last = text.rpartition(segment.newline)[2]
    cells = split_line(last, layout.delimiter)
    if last.lstrip().startswith(COMMENTS) or len(cells) != len(layout.names):
        return None
    found, *others = {len(one.partition(layout.decimal)[2]) for one in usual}
    cut = not others and len(cells[-1].partition(layout.decimal)[2]) < found
    return cells[-1] if cut and is_number(cells[-1], layout.decimal) else None


@dataclass(slots=True)
class _Fault:
    """Something wrong with a row, and with how many rows after it in the same way."""

    message: str
    line: int
    row: int
    column: str | None
    more: int = 0
    hints: tuple[Hint, ...] = ()

    def finding(self, file: str) -> Finding:
        """Return it as a finding."""
        more = f" (and so {self.more} more row{'s' if self.more > 1 else ''} below it)" if self.more else ""
        return Finding(self.message + more, file, self.line, self.row, self.column, hints=self.hints)


class RowReader:
    """Goes through rows one by one and keeps the first findings.

    Attributes:
        layout: How the table is written.
        columns: Which columns hold numbers.
        clock: The columns of its clock.
        allowed: What a cell of a column may hold, for messages, where it is not as in a log.
        ended: Whether the next rows are not to be read: they are those of a second log.
    """

    def __init__(
        self,
        layout: Layout,
        columns: Sequence[int],
        clock: Sequence[ClockColumn],
        allowed: Mapping[int, str] | None = None,
    ) -> None:
        self.layout = layout
        self.columns = columns
        self.clock = clock
        self.allowed = allowed or {}
        self._faults: list[_Fault] = []
        self._lasting: list[_Fault] = []
        self._wrong = 0
        self._last: _Fault | None = None
        self._unread: dict[int, list[RowFault]] = {}
        self._next_line = layout.first_line
        self._line = 0
        self._row = 0
        self._text_parts = [part for part in clock if part.forms]
        self._texts: list[list[str]] = []
        self.ended = False
        self._wanted = (*columns, *(part.column for part in clock))
        self._rows_read = None if layout.rows is None else frozenset(layout.rows.tolist())

    def pass_over(self, rows: int, lines: int) -> None:
        """Count rows and lines that were read otherwise."""
        self._row += rows
        self._next_line += lines

    def read(self, lines: Sequence[str]) -> Numbers:
        """Return the numbers of the rows on the next lines: NaN and REPORTED where something is wrong."""
        numbered = list(enumerate((line.rstrip("\r\n") for line in lines), start=self._next_line))
        self._next_line += len(lines)
        values, times, rows = array("d"), array("q"), 0
        self._texts = [[] for _ in self._text_parts]
        for time, row in self._rows(numbered):
            times.append(time)
            values.extend(row)
            rows += 1
        form = self.layout.form
        others = sum(bool(line.strip()) and not form.is_row(line) for _, line in numbered) if form else 0
        return Numbers(
            np.array(values).reshape(rows, len(self.columns)),
            np.array(times, dtype=np.int64) if self.clock else None,
            left_out=others,
            texts=tuple(TextCells.of(texts) for texts in self._texts),
        )

    def verdict(self) -> Numbers:
        """Return what was found to be wrong, without numbers."""
        file = self.layout.file
        return Numbers(
            np.empty((0, len(self.columns))),
            None,
            findings=tuple(fault.finding(file) for fault in self._faults),
            wrong=self._wrong,
            lasting=tuple(fault.finding(file) for fault in self._lasting),
            unread=self._unread,
        )

    def _rows(self, lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, list[float]]]:
        """Yield time in [ns] and values of each row."""
        nothing = [math.nan] * len(self.columns)
        for line, text in data_lines(self.layout, lines):
            if self.ended:
                return
            self._line, self._row = line, self._row + 1
            cells = self._cells(text) if self._is_read() else None
            for texts, part in zip(self._texts, self._text_parts, strict=True):
                texts.append("" if cells is None else cells[part.column])
            yield (REPORTED, nothing) if cells is None else (self._time(cells), self._values(cells))

    def _is_read(self) -> bool:
        """Return whether this row is among those that are read."""
        return self._rows_read is None or self._row - 1 in self._rows_read

    def _values(self, cells: Sequence[str]) -> list[float]:
        wanted = [cells[j] for j in self.columns]
        if self.layout.decimal == "." and not any("_" in cell for cell in wanted):  # float() takes 1_000
            try:
                return [float(cell) for cell in wanted]
            except ValueError:
                pass
        return [self._value(cells, j) for j in self.columns]

    def _cells(self, text: str) -> list[str] | None:
        """Return the cells of a row; None if it is not written like the others, or has no numbers at all."""
        form = self.layout.form
        if len(text) > MOST_HEAD:
            self._report(f"found a line of {len(text)} letters, allowed: {len(self.layout.names)} cells")
            return None
        try:
            values: list[Value] = (
                [*split_line(text, self.layout.delimiter)] if form is None else form.values(text)
            )
            if not self._is_whole(text, values):
                return None
            cells = [str(value) for value in values] if form is None else form.spread(values)
        except RowError as error:
            self._report(error.message, error.name)
            return None
        if len(self._wanted) > 1 and all(is_text(cells[j], self.layout.decimal) for j in self._wanted):
            self._report(f"found {_shown(text)}, allowed: a row of numbers")
            return None
        return cells

    def _is_whole(self, text: str, values: list[Value]) -> bool:
        """Return whether a row has as many values as the others, having reported what it is if not."""
        names = self.layout.form.names if self.layout.form else self.layout.names
        width = len(names)
        if again := self._header_again(text, values, names):
            self._report(f"found {again}, allowed: one log per file; a second log begins here", lasting=True)
            if self._last and not self.allowed:  # a table of targets has no such option
                first = 1 + min(self._rows_read or [0])
                parts = [f"{first}:{self._row - 1}", f"{self._row + 1}:-1"][: 2 if again == HEADER else 1]
                self._last.hints = tuple(Hint("rows", part, "reads these rows") for part in parts)
            self.ended = True
            return False
        if len(values) == width - 1 and not names[-1]:
            values.append("")  # a row without the trailing delimiter that the others have
        if len(values) != width and any([*values[width:], len(values) < width]):
            numbers = any(not isinstance(v, str) or is_number(v, self.layout.decimal) for v in values)
            shown = "" if numbers else f" ({_shown(text)})"
            self._report(f"found {format_count(len(values), 'cell')}{shown}, allowed: {width}")
            return False
        del values[width:]
        return True

    def _header_again(self, text: str, values: Sequence[Value], names: Sequence[str]) -> str | None:
        """Return what to call a row that is the header again, perhaps in other units; None if it is none."""
        if self.layout.header is None or not any(names):
            return None
        if tuple(values[: len(names)]) == tuple(names):
            return HEADER
        if any(not isinstance(value, str) or is_number(value, self.layout.decimal) for value in values):
            return None
        known = {split_unit(name)[0].lower() for name in names if name}
        alike = [str(value) for value in values if split_unit(str(value))[0].lower() in known]
        return f"another header, {_shown(text)}" if len(alike) > 1 and 2 * len(alike) >= len(names) else None

    def refuse_cut_row(self) -> None:
        """Report the last row if the file ends within its last cell."""
        layout = self.layout
        cut = cut_cell(layout) if len(layout.names) - 1 in self._wanted else None
        if cut is not None and not self.ended and self._is_read():
            self._line = lines_of_rows(layout, [self._row])[self._row]
            self._report(f"found {cut!r} where the file ends, allowed: as many decimals as in the other rows")

    def _time(self, cells: Sequence[str]) -> int:
        total = 0
        for part in () if self._text_parts else self.clock:
            cell = cells[part.column]
            time = to_nanoseconds(cell, self.layout.decimal, part.exponent)
            if time is None and is_missing(cell):
                return NO_TIME
            if time is None:
                name = self.layout.names[part.column]
                self._report(f"found {_shown(cell)}, allowed: a number in every row", name)
                return REPORTED
            total += time
        return total

    def _value(self, cells: Sequence[str], column: int) -> float:
        value = to_float(cells[column], self.layout.decimal)
        if value is not None:
            return value
        allowed = self.allowed.get(column, MAY_BE_MISSING)
        self._report(f"found {_shown(cells[column])}, allowed: {allowed}", self.layout.names[column])
        return math.nan

    def _report(self, message: str, column: str | None = None, *, lasting: bool = False) -> None:
        """Keep a finding about this row: a lasting one stays without it, the same in rows on end is one."""
        if not lasting:
            fault = RowFault(message, (column,) if column else ())
            self._unread.setdefault(self._row - 1, []).append(fault)
        last = self._last
        if last and (last.message, last.column, last.row + last.more + 1) == (message, column, self._row):
            last.more += 1
            return
        self._last = _Fault(message, self._line, self._row, column)
        self._wrong += 1
        if len(self._faults) < SHOWN_FINDINGS:
            self._faults.append(self._last)
        if lasting:
            self._lasting.append(self._last)


def _shown(text: str) -> str:
    text = text.strip()
    return repr(text if len(text) <= _SHOWN_TEXT else text[: _SHOWN_TEXT - 3] + "...")
