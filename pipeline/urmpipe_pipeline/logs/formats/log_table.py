"""A table of a log, from text or in memory: names, units, sampled cells, and one way to read its columns.

1. The head: names of the columns, their units, the cells of the first rows, what was found out.
2. `LogTable.read`: the `Numbers` of some columns and the times of a clock, with the faults of rows and cells.
3. All numbers, for what the first rows cannot prove: read once, when they are first looked at.
4. `without_padding`: rows that hold no sample, the zeros of an array that was allocated in advance, a row
   that marks the end. In them every column is the same number, and no step of the motion leads there: with
   samples x of a column,

       |x[last] - mark| > MIN_JUMP max |x[i + 1] - x[i]|

   in a column that moves; turns by which angles wrap are no steps. An arm that really comes to zero gets
   there by its own steps.

`TextTable` and `ArrowTable` know where the rows are. No table knows a joint.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.joint_log import Inference, LogWarning
from urmpipe_pipeline.logs.formats.cells import (
    TextCells,
    count_numbers,
    is_missing,
    is_number,
    plain,
    to_float,
)
from urmpipe_pipeline.logs.formats.clock_forms import EXPONENTS, UNPADDED_NS, ClockForm

USUAL_COUNTS = (6, 7, 5, 4)  # joints of arms, the usual first
MAX_SAMPLED_ROWS = 250  # rows whose cells decide how a table is written
MAX_FINDINGS = 20  # findings that are listed; further ones are counted
MARKS = (0.0, -1.0, 9999.0, -9999.0)  # the value of every column of such a row
MIN_MARKS = 2  # columns; a mark in a single one may be a sample
MIN_JUMP = 3.0  # largest steps; a continued motion makes one, and three after two lost samples
MIN_SAMPLES = 3  # fewer have no usual step
TURN_TOLERANCE = 1.01  # x a turn; angles between -1 and 1 turn go beyond them by no more

END = "end-rows"
START = "start-rows"


# What is read


def capped(findings: Sequence[Finding], file: str) -> list[Finding]:
    """Return the first of many findings about a file, and one that counts the others."""
    more = len(findings) - MAX_FINDINGS
    return [*findings[:MAX_FINDINGS], *([Finding(f"{more} more findings", file)] if more > 0 else [])]


class ClockColumn(NamedTuple):
    """A column of the clock.

    Attributes:
        column: Its place.
        unit: Its unit: s, ms, us, ns, or of text "date" or "time of day".
        forms: The forms of its cells if they are text.
    """

    column: int
    unit: str
    forms: tuple[ClockForm, ...] = ()

    @property
    def exponent(self) -> int:
        """Power of ten from the unit of numbers to [ns]: 9 for s."""
        return EXPONENTS[self.unit]


@dataclass(frozen=True, slots=True)
class RowFault:
    """The fault of a row that cannot be used.

    Attributes:
        message: What was found, and what is allowed.
        columns: The columns in which it was found; none for the row as a whole.
    """

    message: str
    columns: tuple[str, ...] = ()

    def __str__(self) -> str:
        if not self.columns:
            return self.message
        return f"column{'s' * (len(self.columns) > 1)} {', '.join(self.columns)}: {self.message}"


@dataclass(frozen=True, slots=True, eq=False)
class Numbers:
    """What was read of a table.

    Attributes:
        values: Numbers in the file's own units, shape (n, columns); NaN where a sample is missing.
        clock: Time of each row in [ns] on the file's clock, shape (n,), or NO_TIME, REPORTED or UNREADABLE;
            None without a clock; without meaning while the texts of the clock are not read.
        findings: The faults of rows and cells.
        unread: Rows that could not be read, by their index, with all that is wrong with each.
        left_out: Lines among labelled rows that are not rows.
        rows: Data row of the file of each row, from 1, shape (n,), where some were left out.
        texts: The cells of the clock's columns, if they are text.
        inferences: What the clock's rows told about it.
        warnings: What a person should know about it.
        still: Whether the rows are static poses, and a clock of theirs was a label.
    """

    values: FloatArray
    clock: IntArray | None
    findings: tuple[Finding, ...] = ()
    unread: Mapping[int, Sequence[RowFault]] = field(default_factory=dict)
    left_out: int = 0
    rows: IntArray | None = None
    texts: tuple[TextCells, ...] = ()
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()
    still: bool = False

    @property
    def lasting(self) -> tuple[Finding, ...]:
        """The findings that leaving out the rows that cannot be read does not mend."""
        unread = {self.file_row(row + 1) for row in self.unread}
        return tuple(finding for finding in self.findings if finding.row not in unread)

    def at(self, rows: IntArray | slice) -> Numbers:
        """Return some of the rows: by index, shape (k,), ascending, or as a slice from the first on."""
        clock = None if self.clock is None else self.clock[rows]
        texts = tuple(cells.at(rows) for cells in self.texts)
        numbers, unread = self.rows, self.unread
        if isinstance(rows, slice):
            numbers = None if numbers is None else numbers[rows]
        else:
            numbers = rows + 1 if numbers is None else numbers[rows]
            places = {row: k for k, row in enumerate(rows.tolist())} if unread else {}
            unread = {places[row]: faults for row, faults in unread.items() if row in places}
        values = self.values[rows]
        return replace(self, values=values, clock=clock, texts=texts, rows=numbers, unread=unread)

    def file_row(self, row: int) -> int:
        """Return the data row of the file of a row that was read, both from 1."""
        return row if self.rows is None else int(self.rows[row - 1])


# The table


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
        uncut: The table with all rows, where some are chosen: durations are summed over all.
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
    uncut: LogTable | None = None
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
        cells = self._read((), [ClockColumn(column, UNPADDED_NS.unit, (UNPADDED_NS,))], {}).texts[0]
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


# Rows that hold no sample


def end_rows(values: FloatArray) -> int:
    """Return how many rows at the end hold no sample.

    Columns that rise or fall through the whole table, such as a clock or a count, are ignored.

    Args:
        values: All columns of numbers in the file's own units, shape (n, columns).
    """
    if len(values) <= MIN_SAMPLES:
        return 0
    row_steps = np.diff(values, axis=0)
    is_clock = (row_steps > 0).all(axis=0) | (row_steps < 0).all(axis=0)
    marked = [~is_clock, *(values[-1] == mark for mark in MARKS)]  # a joint may rise up to the mark
    return max(_count_marked(values[:, columns]) for columns in marked if (columns | is_clock).all())


def _count_marked(values: FloatArray) -> int:
    if values.shape[1] < MIN_MARKS or not _is_mark(values[-1]):
        return 0
    unmarked = np.flatnonzero((values != values[-1]).any(axis=1))
    if len(unmarked) < MIN_SAMPLES:
        return 0
    samples = values[: unmarked[-1] + 1]
    largest = np.array([np.fmax.reduce(np.abs(steps(column))) for column in samples.T])
    moves = largest > 0.0 if (largest > 0.0).any() else np.ones(len(largest), dtype=bool)
    jumps = np.abs(samples[-1] - values[-1]) > MIN_JUMP * largest
    return len(values) - len(samples) if (jumps & moves).any() else 0


def _is_mark(row: FloatArray) -> bool:
    return bool(row[0] in MARKS and (row == row[0]).all())


def without_padding(numbers: Numbers, read_all: Callable[[], Numbers]) -> tuple[Numbers, list[LogWarning]]:
    """Return numbers without the rows at the end that hold no sample, and the warnings.

    Such rows at the start are a warning, and stay.

    Args:
        numbers: The rows of the columns that are used.
        read_all: Gives all columns of numbers of the table; called where those that are used may be padded.
    """
    used = numbers.values
    if len(used) <= MIN_SAMPLES or not used.shape[1] or not (_is_mark(used[-1]) or _is_mark(used[0])):
        return numbers, []
    table, warnings = read_all(), []
    ends = end_rows(table.values)
    samples = table.values[: len(table.values) - ends]
    starts = end_rows(samples[::-1])
    if ends:
        last = table.file_row(len(table.values))
        place = f"data row {last}" if ends == 1 else f"data rows {table.file_row(len(samples) + 1)} to {last}"
        message = f"the end of the file, {place}, holds {used[-1, 0]:g} in every column"
        message += ", and no step of the motion leads there: left out as padding or end mark"
        warnings.append(LogWarning(END, message))
        rows = np.arange(1, len(used) + 1) if numbers.rows is None else numbers.rows
        count = np.searchsorted(rows, table.file_row(len(samples)), side="right")
        numbers = numbers.at(slice(int(count)))
    if starts > 1:
        message = f"the first {starts} rows hold {used[0, 0]:g} in every column, and then the values jump"
        warnings.append(
            LogWarning(START, f"{message}: the controller may not have started", numbers.file_row(1))
        )
    return numbers, warnings


def steps(x: FloatArray) -> FloatArray:
    """Return the steps between values in any unit, shape (n - 1, ...), without the turns of wrapped angles.

    Angles are wrapped where all lie within a turn to either side.
    """
    known = np.abs(x[np.isfinite(x)])
    peak = float(known.max()) if len(known) else 0.0
    turn = next((turn for turn in (FULL_TURN, 360.0) if peak <= TURN_TOLERANCE * turn), np.inf)
    step = np.diff(x, axis=0)
    return step if np.isinf(turn) else step - turn * np.rint(step / turn)
