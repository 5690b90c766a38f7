"""A table of a log, from text or in memory: names, units, sampled cells, and one way to read its columns.

1. The head: names of the columns, their units, the cells of the first rows, what was found out.
2. `read`: the numbers of some columns and the times of a clock, with the faults of rows and cells.
3. All numbers, for what the first rows cannot prove: read once, when they are first looked at.

`TextTable` and `ArrowTable` know where the rows are. No table knows a joint.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.cells import count_numbers, is_missing, is_number, plain, to_float
from urmpipe_pipeline.logs.formats.clock_forms import UNPADDED_NS
from urmpipe_pipeline.logs.formats.numbers import ClockColumn, Numbers, end_rows

USUAL_COUNTS = (6, 7, 5, 4)  # joints of arms, the usual first
MAX_SAMPLED_ROWS = 250  # rows whose cells decide how a table is written


@dataclass(frozen=True, eq=False, kw_only=True)
class LogTable(ABC):
    """A table of a log.

    Attributes:
        names: Names of the columns as the header has them; 1, 2, ... without a header. One a cell of a
            row: empty for an unnamed index and for what follows a trailing delimiter.
        units: Texts of a second header line with units, or empty.
        header: Line of the header, None without one.
        first_line: Line of the file that holds row 1.
        delimiter: Sign between cells; a space stands for any run of spaces and tabs.
        decimal: Decimal sign.
        sample: Cells of the first rows.
        inferences: What was found out.
        rows: Data rows of the file that are read, from 0 and ascending, shape (n,); None for all of them.
        applied: Options of reading that its format applied already, such as "topic" or "episode".
        across: Whether one line of text has the rows of its only column.
        arrow: The Arrow table that it is, where it is no text: then it has no lines.
    """

    names: tuple[str, ...]
    units: tuple[str, ...] = ()
    header: int | None
    first_line: int
    delimiter: str = ","
    decimal: str = "."
    sample: tuple[tuple[str, ...], ...]
    inferences: tuple[Inference, ...] = ()
    rows: IntArray | None = None
    applied: tuple[str, ...] = ()
    across: bool = False
    arrow: Any = None
    _answers: list[tuple[object, Numbers]] = field(default_factory=list, init=False, repr=False)

    @property
    @abstractmethod
    def path(self) -> Path:
        """Its file, or the name of a table in memory."""

    @abstractmethod
    def _read(
        self, columns: Sequence[int], clock: Sequence[ClockColumn], allowed: Mapping[int, str]
    ) -> Numbers: ...

    @abstractmethod
    def count_rows(self) -> int:
        """Return the number of data rows."""

    @abstractmethod
    def iter_cells(self) -> Iterator[list[str]]:
        """Yield the cells of each row as text, without an empty one after a trailing delimiter."""

    @abstractmethod
    def take(self, rows: IntArray, *inferences: Inference) -> Self:
        """Return the table of some of its rows, by index from 0, ascending, shape (k,)."""

    @abstractmethod
    def lines_of(self, rows: Sequence[int]) -> dict[int, int]:
        """Return the line of the file of some data rows, both from 1; empty for a table in memory."""

    @property
    def file(self) -> str:
        """The path of its file."""
        return str(self.path)

    @property
    def header_line(self) -> int | None:
        """Line of the header for messages; None without one, and of a table in memory."""
        return self.header if self.arrow is None else None

    def error(self, message: str, column: str | None, *hints: Hint) -> LogError:
        """Return an error about its first row, or a column there."""
        line = self.first_line if self.arrow is None and self.rows is None else None
        return LogError(Finding(message, self.file, line, self.file_row(1), column, hints=hints))

    def file_row(self, row: int) -> int:
        """Return the data row of the file of a row that is read, both from 1."""
        return row if self.rows is None else int(self.rows[row - 1]) + 1

    def cells(self, column: int) -> list[str]:
        """Return the sampled cells of a column."""
        return [row[column] for row in self.sample if column < len(row)]

    def number_texts(self, column: int) -> Iterator[str]:
        """Yield the sampled numbers of a column, as Python spells them."""
        return (plain(cell, self.decimal) for cell in self.cells(column) if is_number(cell, self.decimal))

    def numbers(self, column: int) -> list[float]:
        """Return the sampled numbers of a column, without those that are infinite."""
        values = (to_float(cell, self.decimal) for cell in self.cells(column))
        return [value for value in values if value is not None and math.isfinite(value)]

    def read(
        self,
        columns: Sequence[int],
        clock: Sequence[ClockColumn] = (),
        allowed: Mapping[int, str] | None = None,
    ) -> Numbers:
        """Return the numbers of some columns, with a finding for each row and cell that holds none.

        The columns of the clock are added up in [ns]; if they are text, their cells are read as they are.
        The last answer is kept, and numbers that were read already without a fault are not read again.

        Args:
            columns: The columns of numbers.
            clock: The columns of the clock.
            allowed: What a cell of a column may hold, for messages, where it is not as in a log.
        """
        arguments = tuple(columns), tuple(clock), allowed
        if not self._answers or self._answers[0][0] != arguments:
            self._answers[:] = [(arguments, self._read_or_reuse(columns, clock, allowed or {}))]
        return self._answers[0][1]

    def _read_or_reuse(
        self, columns: Sequence[int], clock: Sequence[ClockColumn], allowed: Mapping[int, str]
    ) -> Numbers:
        known = self.__dict__.get("all_rows")
        if known is None or known.findings or known.left_out or not set(columns) <= {*self.numeric_columns}:
            return self._read(columns, clock, allowed)
        times = self._read((), clock, allowed) if clock else known
        if times.findings or len(times.values) != len(known.values):
            return self._read(columns, clock, allowed)
        places = [self.numeric_columns.index(column) for column in columns]
        is_all = places == list(range(len(self.numeric_columns)))
        return replace(times, values=known.values if is_all else known.values.take(places, axis=1))

    def texts(self, column: int) -> list[str]:
        """Return all cells of a column as text, without spaces and quotes around them."""
        cells = self._read((), [ClockColumn(column, forms=(UNPADDED_NS,))], {}).texts[0]
        return [cells.text(row).strip(" \"'") for row in range(len(cells))]

    @cached_property
    def numeric_columns(self) -> tuple[int, ...]:
        """The columns in which at least half of the sampled cells with content are numbers."""

        def holds_numbers(column: int) -> bool:
            cells = [cell for cell in self.cells(column) if not is_missing(cell)]
            return 2 * count_numbers(cells, self.decimal) >= len(cells) > 0

        return tuple(filter(holds_numbers, range(len(self.names))))

    @cached_property
    def all_rows(self) -> Numbers:
        """The numbers of the numeric columns in the file's units, with their faults."""
        return self._read(self.numeric_columns, (), {})

    @cached_property
    def samples(self) -> Numbers:
        """The same without the rows at the end that hold no sample."""
        ends = end_rows(self.all_rows.values)
        return self.all_rows.at(slice(-ends)) if ends else self.all_rows

    def values(self, columns: Sequence[int]) -> FloatArray:
        """Return samples, shape (n, columns), in the file's units; NaN where one is missing or wrong."""
        samples = self.samples.values
        values = np.full((len(samples), len(columns)), np.nan)
        for place, column in enumerate(columns):
            if column in self.numeric_columns:
                values[:, place] = samples[:, self.numeric_columns.index(column)]
        return values

    @cached_property
    def increasing(self) -> BoolArray:
        """Which numeric columns increase from each row to the next, over two rows or more, shape (c,)."""
        values = self.samples.values
        if len(values) < 2:
            return np.zeros(len(self.numeric_columns), dtype=bool)
        return np.asarray((np.diff(values, axis=0) > 0).all(axis=0))
