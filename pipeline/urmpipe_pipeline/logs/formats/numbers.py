"""Numbers and times that are read of a table, in the file's units, with the faults of its rows.

Columns of Arrow: which types are numbers, the keys of their unit and role.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding
from urmpipe_pipeline.joint_log import Inference, LogWarning
from urmpipe_pipeline.logs.formats.cells import TextCells
from urmpipe_pipeline.logs.formats.clock_forms import ClockForm

UNIT, ROLE = (
    b"unit",
    b"role",
)  # keys of the unit of a column, and of its role and place

JOINT = b"joint"  # the role of a column that is a joint, but in no known place


def is_number(kind: pa.DataType) -> bool:
    """Return whether a type is that of numbers."""
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind))


_PLAIN: Mapping[str, np.dtype[Any]] = {
    "b": np.dtype(np.uint8),
    "f2": np.dtype(np.float32),
    "f16": np.dtype(np.float64),
}  # for types that Arrow does not have, or cannot write as text


def arrow_column(values: npt.NDArray[Any]) -> pa.Array:
    """Return values in any unit, shape (n,), as a column of their type."""
    kind = values.dtype
    if kind.kind in "mM":
        return pa.array(values)
    plain = _PLAIN.get(kind.kind, _PLAIN.get(kind.str[1:], kind.newbyteorder("=")))
    values = np.ascontiguousarray(values, dtype=plain)
    buffers = [None, pa.py_buffer(values)]  # pyarrow.array imports pandas, which takes a second
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), buffers)


MAX_FINDINGS = 20  # findings that are listed; further ones are counted


def capped(findings: Sequence[Finding], file: str) -> list[Finding]:
    """Return the first of many findings about a file, and one that counts the others."""
    more = len(findings) - MAX_FINDINGS
    return [*findings[:MAX_FINDINGS], *([Finding(f"{more} more findings", file)] if more > 0 else [])]


@dataclass(frozen=True, slots=True)
class ClockColumn:
    """A column of the clock.

    Attributes:
        column: Its place.
        exponent: Power of ten from its unit to [ns]: 9 for s.
        forms: The forms of its cells if they are text: then the exponent is not used.
    """

    column: int
    exponent: int = 0
    forms: tuple[ClockForm, ...] = ()


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
        findings: The first faults of rows and cells.
        wrong: How many such findings there are.
        lasting: Those of the findings that leaving out rows does not mend.
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
