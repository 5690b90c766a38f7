"""What is read of a table: numbers and times in the file's own units, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding
from urmpipe_pipeline.joint_log import Inference, LogWarning
from urmpipe_pipeline.logs.cells.text_cells import TextCells
from urmpipe_pipeline.logs.cells.text_clock import Form

SHOWN_FINDINGS = 20
"""Findings that are told one by one; the others are counted."""

NO_TIME = np.iinfo(np.int64).min
"""Stands where a row has no time."""
REPORTED = NO_TIME + 1
"""Stands where a row has no time because of a finding that is reported already."""
UNREADABLE = NO_TIME + 2
"""Stands where the text of a row's time is none."""


def capped(findings: Sequence[Finding], file: str) -> list[Finding]:
    """Return the first of many findings about a file, and one that counts the others."""
    more = len(findings) - SHOWN_FINDINGS
    return [*findings[:SHOWN_FINDINGS], *([Finding(f"{more} more findings", file)] if more > 0 else [])]


@dataclass(frozen=True, slots=True)
class ClockColumn:
    """A column of the clock.

    Attributes:
        column: Its place.
        exponent: Power of ten from its unit to [ns]: 9 for s.
        forms: What its cells may be if they are text: then exponent means nothing.
    """

    column: int
    exponent: int = 0
    forms: tuple[Form, ...] = ()


@dataclass(frozen=True, slots=True)
class RowFault:
    """What is wrong with a row that cannot be used.

    Attributes:
        said: What was found, and what is allowed.
        columns: The columns in which it was found; none for the row as a whole.
    """

    said: str
    columns: tuple[str, ...] = ()

    def __str__(self) -> str:
        if not self.columns:
            return self.said
        return f"column{'s' * (len(self.columns) > 1)} {', '.join(self.columns)}: {self.said}"


@dataclass(frozen=True, slots=True, eq=False)
class Numbers:
    """What was read of a table.

    Attributes:
        values: Numbers in the file's own units, shape (n, columns); NaN where a sample is missing.
        clock: Time of each row in [ns] on the file's clock, shape (n,), or NO_TIME, REPORTED or UNREADABLE;
            None without a clock; without meaning while the texts of the clock are not read.
        findings: What is wrong with rows and cells, the first of them.
        wrong: How many such findings there are.
        lasting: Those of the findings that leaving out rows does not mend.
        unread: Rows that could not be read, by their index, with all that is wrong with each.
        left_out: Lines among labelled rows that are none.
        rows: Data row of the file of each row, from 1, shape (n,), where some were left out.
        texts: The cells of the clock's columns, if they are text.
        inferences: What the clock's rows told about it.
        warnings: What a person should know about it.
        still: Whether the rows are static poses, and a clock of theirs was a label.
    """

    values: FloatArray
    clock: IntArray | None
    findings: tuple[Finding, ...] = ()
    wrong: int = 0
    lasting: tuple[Finding, ...] = ()
    unread: Mapping[int, Sequence[RowFault]] = field(default_factory=dict)
    left_out: int = 0
    rows: IntArray | None = None
    texts: tuple[TextCells, ...] = ()
    inferences: tuple[Inference, ...] = ()
    warnings: tuple[LogWarning, ...] = ()
    still: bool = False

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
