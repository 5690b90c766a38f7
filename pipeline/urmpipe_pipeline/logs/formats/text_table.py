"""Whole rows of a table: as they stand in the file, and as the CSV parser wants them.

The numbers of whole rows, fast: pyarrow parses the columns that are needed straight into float64.

Rows that the parser refuses, cell by cell: read, or told with the line and column of what is wrong.
"""

from __future__ import annotations

import codecs
import math
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, Self, TypeAlias

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import csv

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import Finding, Hint
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.cells import (
    SPACE,
    Bytes,
    TextCells,
    is_missing,
    is_number,
    is_text,
    split_line,
    to_float,
    to_nanoseconds,
)
from urmpipe_pipeline.logs.formats.clock_forms import NO_TIME, REPORTED
from urmpipe_pipeline.logs.formats.form import Form, RowError, UnfitError, Value
from urmpipe_pipeline.logs.formats.log_table import MAX_SAMPLED_ROWS, LogTable
from urmpipe_pipeline.logs.formats.numbers import (
    SHOWN_FINDINGS,
    ClockColumn,
    Numbers,
    RowFault,
)
from urmpipe_pipeline.logs.formats.text import COMMENTS, MOST_HEAD, Segment
from urmpipe_pipeline.logs.vocabulary import split_unit, vocabulary


@dataclass(frozen=True, eq=False, kw_only=True)
class TextTable(LogTable):
    """A table that is text.

    Attributes:
        segment: Where it stands.
        offset: Offset of its first row in bytes.
        form: How its rows become rows of plain cells, if they hold arrays or labels.
    """

    segment: Segment
    offset: int
    form: Form | None = None

    @property
    def path(self) -> Path:
        """The file that it stands in."""
        return self.segment.path

    def _read(
        self, columns: Sequence[int], clock: Sequence[ClockColumn], allowed: Mapping[int, str]
    ) -> Numbers:
        """Return what `read` does.

        Read row by row is also what the parser refuses though it is sound: blanks as missing samples, 1.5d0,
        comments.
        """
        reader = RowReader(self, columns, clock, allowed)
        scales = clock_scales(self, clock)
        parts = [part for block in row_blocks(self) for part in _parts(reader, block, scales)]
        reader.refuse_cut_row()
        values = [part.values for part in parts] or [np.empty((0, len(columns)))]
        times = [_times(part) for part in parts] or [np.empty(0, dtype=np.int64)]
        texts = zip(*(part.texts for part in parts), strict=True)
        numbers = replace(
            reader.verdict(),
            values=np.concatenate(values),
            clock=np.concatenate(times) if clock else None,
            texts=tuple(TextCells.joined(cells) for cells in texts),
            left_out=sum(part.left_out for part in parts),
        )
        if self.rows is None:
            return numbers
        return numbers.at(self.rows[self.rows < len(numbers.values)])  # fewer if another header ends them

    def count_rows(self) -> int:
        """Return the number of data rows."""
        return sum(1 for _ in data_lines(self))

    def iter_cells(self) -> Iterator[list[str]]:
        """Yield the cells of each row as text, without an empty one behind a trailing delimiter."""
        for _, line in data_lines(self):
            cells = split_line(line.strip("\r\n "), self.delimiter)
            yield cells[:-1] if len(cells) > 1 and not cells[-1] else cells

    def take(self, rows: IntArray, *inferences: Inference) -> Self:
        """Return the table of some of its rows, by index from 0, ascending, shape (k,)."""
        in_file = rows if self.rows is None else self.rows[rows]
        sampled, texts = in_file[:MAX_SAMPLED_ROWS], list[str]()
        chosen, last = frozenset(sampled.tolist()), int(sampled[-1])
        for row, (_, text) in enumerate(islice(data_lines(self), last + 1)):
            texts += [text] if row in chosen else []
        if self.form is not None:
            sample = self.form.sampled(self.form.readable(texts))
        else:
            sample = tuple(tuple(split_line(text, self.delimiter)) for text in texts)
        return replace(self, rows=in_file, sample=sample, inferences=(*self.inferences, *inferences))

    def lines_of(self, rows: Sequence[int]) -> dict[int, int]:
        """Return the line of the file of some data rows, both from 1."""
        numbered = islice(enumerate(data_lines(self), start=1), max(rows, default=0))
        return {row: line for row, (line, _) in numbered if row in {*rows}}


BLOCK_BYTES = 1 << 22
"""What is read at once: enough rows for several threads to parse, few enough to keep memory low."""

_NEWLINES = b"\n\r"
_GOES_ON = (b"", b" ", b"\t")  # nothing: what comes next is not read yet
_TO_POINTS = bytes.maketrans(b",.", b".~")
_FROM_POINTS = np.frombuffer(bytes.maketrans(b".~", b",."), dtype=np.uint8)


def as_written(layout: TextTable, cells: Bytes) -> Bytes:
    """Return cells of `converted` rows, shape (bytes,), with the signs that the file has."""
    return _FROM_POINTS[cells] if layout.decimal == "," != layout.delimiter else cells


def row_blocks(layout: TextTable) -> Iterator[bytes]:
    """Yield the rows of a table as they stand in the file, some thousand at a time, in `byte_encoding`."""
    segment = layout.segment
    left = segment.end - layout.offset
    wide = segment.encoding.startswith("utf-16")
    decoder = codecs.getincrementaldecoder(segment.encoding)(errors="replace") if wide else None
    cut_row = b""
    with segment.open() as file:
        file.seek(layout.offset)
        while left > 0:
            raw = file.read(min(BLOCK_BYTES, left))
            left -= len(raw) if raw else left
            block = raw if decoder is None else decoder.decode(raw, final=left <= 0).encode("utf-8")
            block = cut_row + block
            end = end_of_rows(block, layout) if left > 0 else len(block)
            cut_row = block[end:]
            if end:
                yield block[:end]


def byte_encoding(layout: TextTable) -> str:
    """Return the encoding of the blocks: UTF-8, or Latin-1, whose numbers are the same bytes in UTF-8."""
    return "latin-1" if layout.segment.encoding == "latin-1" else "utf-8"


def converted(layout: TextTable, block: bytes) -> tuple[bytes, int]:
    """Return whole rows as the parser wants them, in UTF-8 and with one space for a run of them.

    Lines among labelled rows that are none are left out; how many they are is the second value.

    Decimal commas become points here, since pyarrow 26 parses decimals with another point wrongly in threads
    (they share a buffer); a point becomes a sign that no number has, so that 1.5 stays no number.

    Raises:
        UnfitError: If rows with arrays or labels are not written like the others.
    """
    left_out = 0
    if layout.form is not None:
        block, left_out = layout.form.flat(block, byte_encoding(layout))
    if layout.decimal == "," != layout.delimiter:
        block = block.translate(_TO_POINTS)
    block = squeeze(block) if layout.delimiter == SPACE else block
    return (block.replace(layout.delimiter.encode(), b"\n") if layout.across else block), left_out


def end_of_rows(block: bytes, layout: TextTable) -> int:
    """Return where the last whole row of a block ends."""
    end = max(block.rfind(b"\n"), block.rfind(b"\r")) + 1
    while layout.form is not None and layout.form.continued and end and block[end : end + 1] in _GOES_ON:
        end = block.rfind(b"\n", 0, end - 1) + 1
    return end


def squeeze(block: bytes) -> bytes:
    """Return whole lines with every run of spaces and tabs as one space, and none at either end of a line."""
    signs: Bytes = np.frombuffer(block, dtype=np.uint8)
    blank = (signs == ord(" ")) | (signs == ord("\t"))
    ends = (signs == _NEWLINES[0]) | (signs == _NEWLINES[1])
    skipped = np.zeros_like(blank)
    skipped[:1] = blank[:1]
    skipped[1:] = blank[1:] & (blank[:-1] | ends[:-1])
    if not (skipped.any() or (blank[:-1] & ends[1:]).any() or b"\t" in block or block[-1:] == b" "):
        return block
    result: bytes = np.where(blank, np.uint8(ord(" ")), signs)[~skipped].tobytes()
    for end in (b"\r", b"\n"):
        result = result.replace(b" " + end, end)
    return result.removesuffix(b" ")


PARSED_BYTES = 1 << 20
"""What one thread parses at once."""

_PRECISION = 38  # digits of a decimal128

Scales: TypeAlias = tuple[tuple[int, ...], ...]
"""How many decimals of each column of numbers of a clock are read: as few as may do, then all."""


def clock_scales(layout: TextTable, clock: Sequence[ClockColumn]) -> Scales:
    """Return how many decimals of a clock are read, the same for all blocks of a table."""
    numeric = [part for part in clock if not part.forms]
    both = (tuple(_scale(layout, part, exact) for part in numeric) for exact in (False, True))
    return tuple(dict.fromkeys(both))


def parse_block(
    layout: TextTable, columns: Sequence[int], clock: Sequence[ClockColumn], block: bytes, scales: Scales
) -> Numbers | None:
    """Return the numbers of some columns, or None if the parser stumbles over a row or a cell.

    The block is some whole rows as they stand in the file, the scales are those of `clock_scales`. The values
    of the clock in [ns] are added; if they are text, their cells are read as they are.
    """
    texts = [part for part in clock if part.forms]
    numeric = [part for part in clock if not part.forms]
    try:
        rows, left_out = converted(layout, block)
    except UnfitError:
        return None
    for decimals in scales:
        try:
            table = _parse(layout, columns, numeric, decimals, texts, rows)
            numbers = _numbers(table, columns, numeric, decimals)
        except (pa.ArrowException, OverflowError):
            # Of any kind: pyarrow 26 was seen to lose a chunk of sound numbers among its threads, once in
            # hundreds of files ("failed converting for an unknown reason"). Who gets None tries the halves.
            continue
        cells = tuple(_text_cells(table, layout, part) for part in texts)
        return replace(numbers, texts=cells, left_out=left_out)
    return None


@lru_cache
def _nulls() -> list[str]:
    """Return the words for a missing sample in the usual spellings; read row by row, all are taken."""
    words = vocabulary().missing
    return sorted({spelled for word in words for spelled in (word, word.upper(), word.capitalize(), "NaN")})


def _numbers(
    table: pa.Table, columns: Sequence[int], clock: Sequence[ClockColumn], scales: Sequence[int]
) -> Numbers:
    """Return a parsed table as arrays, block by block, so that the rows being filled stay in the cache."""
    values = np.empty((table.num_rows, len(columns)))
    times = np.zeros(table.num_rows, dtype=np.int64)
    start = 0
    for batch in table.to_batches():
        rows = slice(start, start + batch.num_rows)
        for j, column in enumerate(columns):
            _fill(values[rows, j], batch.column(str(column)))
        for part, scale in zip(clock, scales, strict=True):
            _add_time(times[rows], batch.column(str(part.column)), part.exponent, scale)
        start += batch.num_rows
    return Numbers(values, times if clock else None)


def _parse(
    layout: TextTable,
    columns: Sequence[int],
    clock: Sequence[ClockColumn],
    scales: Sequence[int],
    texts: Sequence[ClockColumn],
    rows: bytes,
) -> pa.Table:
    """Return the columns as pyarrow parses them: float64, decimals for the clock, bytes for its texts."""
    types: dict[str, Any] = {str(column): pa.float64() for column in columns}
    for part, scale in zip(clock, scales, strict=True):
        types[str(part.column)] = pa.decimal128(_PRECISION, scale)
    types |= {str(part.column): pa.binary() for part in texts}
    names = [str(column) for column in range(len(layout.names))]
    quoted_commas = layout.delimiter == layout.decimal  # "0,5","1,5": `converted` leaves them
    return csv.read_csv(
        pa.BufferReader(rows),
        csv.ReadOptions(column_names=names, block_size=PARSED_BYTES, use_threads=not quoted_commas),
        csv.ParseOptions(delimiter=layout.delimiter),
        csv.ConvertOptions(
            column_types=types,
            include_columns=list(types),
            null_values=_nulls(),
            decimal_point=layout.decimal if quoted_commas else ".",
        ),
        memory_pool=pa.system_memory_pool(),  # the default one keeps what it once had
    )


def _text_cells(table: pa.Table, layout: TextTable, part: ClockColumn) -> TextCells:
    """Return the cells of a parsed column of bytes: offsets of 32 bits, and the bytes between them."""
    cells = table.column(str(part.column)).combine_chunks(pa.system_memory_pool())
    _, offsets, content = cells.buffers()
    starts = np.frombuffer(offsets, dtype="<i4")[cells.offset : cells.offset + len(cells) + 1]
    data = np.frombuffer(content or b"", dtype=np.uint8)
    return TextCells(as_written(layout, data), starts.astype(np.int64))


def _fill(target: FloatArray, chunk: pa.Array) -> None:
    """Copy a chunk of float64, with NaN where it has no value."""
    target[:] = np.frombuffer(chunk.buffers()[1], dtype="<f8")[chunk.offset : chunk.offset + len(chunk)]
    if chunk.null_count:
        target[_missing(chunk)] = np.nan


def _add_time(target: IntArray, chunk: pa.Array, exponent: int, scale: int) -> None:
    """Add a chunk of the clock in [ns], NO_TIME where it has no value.

    A decimal128 is an integer of two 64-bit words, the low one first; of scale 9 it is [ns], if the unit
    is s, and the low word holds it if the high one only repeats its sign.

    Raises:
        OverflowError: If a time is beyond what 64 bits hold.
    """
    missing = (target == NO_TIME) | (_missing(chunk) if chunk.null_count else False)
    if scale > exponent:
        from pyarrow import compute

        rounded = compute.round(chunk, ndigits=exponent, round_mode="half_to_even")
        chunk = rounded.cast(pa.decimal128(_PRECISION, exponent))
    words = np.frombuffer(chunk.buffers()[1], dtype="<i8").reshape(-1, 2)
    low, high = words[chunk.offset : chunk.offset + len(chunk)].T
    if (((low >> 63) != high) & ~missing).any():
        raise OverflowError
    target += low
    target[missing] = NO_TIME


def _missing(chunk: pa.Array) -> NDArray[np.bool_]:
    """Return where a chunk has no value: its validity bits, the first row in the lowest bit, turned round.

    Read from the buffer, since `to_numpy` and `is_null` load pandas and pyarrow.compute first.
    """
    bits = np.frombuffer(chunk.buffers()[0], dtype=np.uint8)
    valid = np.unpackbits(bits, bitorder="little")[chunk.offset : chunk.offset + len(chunk)]
    missing: NDArray[np.bool_] = valid == 0
    return missing


def _scale(layout: TextTable, part: ClockColumn, exact: bool) -> int:
    """Return how many decimals of the clock are read.

    As many as reach [ns] if the sampled cells have no more: then the parsed integers are [ns]. Else as
    many as fit beside the digits before the point (and two more, since the clock goes on).
    """
    cells = list(layout.number_texts(part.column))
    decimals = max((len(cell.partition("e")[0].partition(".")[2]) for cell in cells), default=0)
    if not exact and decimals <= part.exponent:
        return part.exponent
    values = [abs(to_float(cell, ".") or 0.0) for cell in cells]
    before = max((len(str(int(value))) for value in values if math.isfinite(value)), default=1)
    return max(part.exponent, _PRECISION - before - 2)


_SHOWN_TEXT = 60
_LAST_BYTES = 1 << 12
_FIXED_ROWS = 100
"""So many rows tell that a column is written with the same number of decimals."""

HEADER = "the header again"

MAY_BE_MISSING = "a number, or an empty, Null or NaN cell where a sample is missing"
"""What a cell of a log may hold."""


def data_lines(
    layout: TextTable, lines: Iterable[tuple[int, str]] | None = None
) -> Iterator[tuple[int, str]]:
    """Yield number and text of each line with a data row, not of blank lines and comments."""
    lines = layout.segment.lines() if lines is None else lines
    lines = (line for line in lines if line[0] >= layout.first_line)
    for number, line in lines if layout.form is None else layout.form.rows(lines):
        text = line.strip()
        if not text or text.startswith(COMMENTS):
            continue
        for row in split_line(text, layout.delimiter) if layout.across else (line,):
            yield number, row


def first_left_out(layout: LogTable) -> tuple[int, str]:
    """Return number and beginning of the first line among labelled rows that is none."""
    assert isinstance(layout, TextTable)
    form, lines = layout.form, layout.segment.lines()
    others = ((n, text) for n, text in lines if n >= layout.first_line and text.strip())
    number, text = next((n, text) for n, text in others if form is not None and not form.is_row(text))
    return number, _shown(text)


def cut_cell(layout: TextTable) -> str | None:
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
        layout: TextTable,
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
            self._line = layout.lines_of([self._row])[self._row]
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


READ_BY_ROW = 1 << 16
"""Bytes that are read row by row together if there is something wrong in them."""


def _times(part: Numbers) -> IntArray:
    """Return the times of a part; none yet where they are text, which is read of all parts at once."""
    return np.zeros(len(part.values), dtype=np.int64) if part.clock is None else part.clock


def _parts(reader: RowReader, block: bytes, scales: Scales) -> Iterator[Numbers]:
    """Yield the numbers of some whole rows: of all at once, or of either half."""
    layout = reader.layout
    newline = layout.segment.newline
    numbers = None if reader.ended else parse_block(layout, reader.columns, reader.clock, block, scales)
    if numbers is not None:
        signs = np.frombuffer(block, dtype=np.uint8)
        reader.pass_over(len(numbers.values), int(np.count_nonzero(signs == ord(newline))))
        yield numbers
    elif len(block) > READ_BY_ROW and (end := end_of_rows(block[: len(block) // 2], layout)):
        for half in (block[:end], block[end:]):
            yield from _parts(reader, half, scales)
    else:
        text = block.decode(byte_encoding(layout), errors="surrogateescape")
        yield reader.read(text.removesuffix(newline).split(newline))
