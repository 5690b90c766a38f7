"""A table that is text: its rows in blocks, parsed together, or one by one where something is wrong.

1. `row_blocks`: whole rows as they are in the file; `to_parser`: as the CSV parser wants them.
2. `BlockParser`: pyarrow parses the columns that are needed straight into float64, and those of the clock
   into decimals, whose integers are [ns].
3. `RowReader`: what the parser refuses, cell by cell: read, though it is unusual (blanks as missing samples,
   1.5d0, comments), or reported with line and column. A block is halved until it is short.

The result does not depend on where blocks are cut.
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
from typing import Any, Self

import numpy as np
import pyarrow as pa
from pyarrow import csv

from urmpipe_models.display import format_count
from urmpipe_models.elementwise import BoolArray, IntArray
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
from urmpipe_pipeline.logs.formats.log_table import MAX_SAMPLED_ROWS, ClockColumn, LogTable, Numbers, RowFault
from urmpipe_pipeline.logs.formats.row_form import RowError, RowForm, Value
from urmpipe_pipeline.logs.formats.text import COMMENTS, MAX_HEAD_BYTES, Segment
from urmpipe_pipeline.logs.vocabulary import split_unit, vocabulary

BLOCK_BYTES = 1 << 22  # read at once: enough rows for several threads to parse, few enough to keep memory low
PARSED_BYTES = 1 << 20  # parsed at once by one thread
READ_BY_ROW = 1 << 16  # bytes that are read row by row together if there is something wrong in them

HEADER = "the header again"
MAY_BE_MISSING = "a number, or an empty, Null or NaN cell where a sample is missing"  # what a cell may hold

_PRECISION = 38  # digits of a decimal128
_MAX_SHOWN = 60  # characters of a cell or a line in a message
_LAST_BYTES = 1 << 12  # of a file, which hold its last line
_MIN_FIXED_ROWS = 100  # rows that show that a column has the same number of decimals
_TO_POINTS = bytes.maketrans(b",.", b".~")
_FROM_POINTS = np.frombuffer(bytes.maketrans(b".~", b",."), dtype=np.uint8)


@dataclass(frozen=True, eq=False, kw_only=True)
class TextTable(LogTable):
    """A table that is text.

    Attributes:
        segment: Its place in a file.
        offset: Offset of its first row in bytes.
        form: How its rows become rows of plain cells, if they hold arrays or labels.
    """

    segment: Segment
    offset: int
    form: RowForm | None = None

    @property
    def path(self) -> Path:
        """The file that it is in."""
        return self.segment.path

    @property
    def byte_encoding(self) -> str:
        """The encoding of blocks: UTF-8, or Latin-1, whose numbers are the same bytes in UTF-8."""
        return "latin-1" if self.segment.encoding == "latin-1" else "utf-8"

    @property
    def has_decimal_commas(self) -> bool:
        """Whether commas are decimal signs, and not the delimiter as well."""
        return self.decimal == "," != self.delimiter

    def _read(
        self, columns: Sequence[int], clock: Sequence[ClockColumn], allowed: Mapping[int, str]
    ) -> Numbers:
        parser, reader = BlockParser(self, columns, clock), RowReader(self, columns, clock, allowed)
        parts = [part for block in row_blocks(self) for part in _read_block(parser, reader, block)]
        reader.check_last_row()
        values = [part.values for part in parts] or [np.empty((0, len(columns)))]
        times = [np.zeros(len(p.values), np.int64) if p.clock is None else p.clock for p in parts]
        texts = zip(*(part.texts for part in parts), strict=True)
        numbers = replace(
            reader.summary(),
            values=np.concatenate(values),
            clock=np.concatenate([np.empty(0, dtype=np.int64), *times]) if clock else None,
            texts=tuple(TextCells.joined(cells) for cells in texts),
            left_out=sum(part.left_out for part in parts),
        )
        if self.rows is None:
            return numbers
        return numbers.at(self.rows[self.rows < len(numbers.values)])  # fewer if another header ends them

    def data_lines(self, lines: Iterable[tuple[int, str]] | None = None) -> Iterator[tuple[int, str]]:
        """Yield number and text of each line with a data row, not of blank lines and comments."""
        lines = self.segment.lines() if lines is None else lines
        lines = (line for line in lines if line[0] >= self.first_line)
        for number, line in lines if self.form is None else self.form.rows(lines):
            text = line.strip()
            if not text or text.startswith(COMMENTS):
                continue
            for row in split_line(text, self.delimiter) if self.across else (line,):
                yield number, row

    def count_rows(self) -> int:
        """Return the number of data rows."""
        return sum(1 for _ in self.data_lines())

    def iter_cells(self) -> Iterator[list[str]]:
        """Yield the cells of each row as text, without an empty one after a trailing delimiter."""
        for _, line in self.data_lines():
            cells = split_line(line.strip("\r\n "), self.delimiter)
            yield cells[:-1] if len(cells) > 1 and not cells[-1] else cells

    def take(self, rows: IntArray, *inferences: Inference) -> Self:
        """Return the table of some of its rows, by index from 0, ascending, shape (k,)."""
        in_file = rows if self.rows is None else self.rows[rows]
        sampled = in_file[:MAX_SAMPLED_ROWS].tolist()
        chosen, lines = frozenset(sampled), islice(self.data_lines(), sampled[-1] + 1)
        texts = [text for row, (_, text) in enumerate(lines) if row in chosen]
        if self.form is not None:
            sample = self.form.read_cells(self.form.read_values(texts))
        else:
            sample = tuple(tuple(split_line(text, self.delimiter)) for text in texts)
        inferences = (*self.inferences, *inferences)
        return replace(self, rows=in_file, sample=sample, inferences=inferences)

    def lines_of(self, rows: Sequence[int]) -> dict[int, int]:
        """Return the line of the file of some data rows, both from 1."""
        chosen, numbered = frozenset(rows), enumerate(self.data_lines(), start=1)
        return {row: line for row, (line, _) in islice(numbered, max(rows, default=0)) if row in chosen}

    def first_other_line(self) -> tuple[int, str]:
        """Return number and beginning of the first line among labelled rows that is not a row."""
        for number, text in self.segment.lines():
            is_row = self.form is None or self.form.is_row(text)
            if number >= self.first_line and text.strip() and not is_row:
                return number, _shorten(text)
        return self.first_line, ""


def row_blocks(table: TextTable) -> Iterator[bytes]:
    """Yield the rows of a table as they are in the file, some thousand at a time, in `byte_encoding`."""
    segment = table.segment
    remaining = segment.end - table.offset
    is_wide = segment.encoding.startswith("utf-16")
    decoder = codecs.getincrementaldecoder(segment.encoding)(errors="replace") if is_wide else None
    cut_row = b""
    with segment.open() as file:
        file.seek(table.offset)
        while remaining > 0:
            raw = file.read(min(BLOCK_BYTES, remaining))
            remaining -= len(raw) if raw else remaining
            block = raw if decoder is None else decoder.decode(raw, final=remaining <= 0).encode("utf-8")
            block = cut_row + block
            end = _end_of_rows(block, table) if remaining > 0 else len(block)
            cut_row = block[end:]
            if end:
                yield block[:end]


def _end_of_rows(block: bytes, table: TextTable) -> int:
    end = max(block.rfind(b"\n"), block.rfind(b"\r")) + 1
    is_continued = table.form is not None and table.form.continued
    while (
        is_continued and end and block[end : end + 1] in (b"", b" ", b"\t")
    ):  # b"": what comes is not read yet
        end = block.rfind(b"\n", 0, end - 1) + 1
    return end


def _read_block(parser: BlockParser, reader: RowReader, block: bytes) -> Iterator[Numbers]:
    """Yield the numbers of some whole rows: of all at once, or of either half."""
    table, newline = parser.table, parser.table.segment.newline
    numbers = None if reader.has_ended else parser.parse(block)
    if numbers is not None:
        signs = np.frombuffer(block, dtype=np.uint8)
        reader.pass_over(len(numbers.values), int(np.count_nonzero(signs == ord(newline))))
        yield numbers
    elif len(block) > READ_BY_ROW and (end := _end_of_rows(block[: len(block) // 2], table)):
        yield from _read_block(parser, reader, block[:end])
        yield from _read_block(parser, reader, block[end:])
    else:
        text = block.decode(table.byte_encoding, errors="surrogateescape")
        yield reader.read(text.removesuffix(newline).split(newline))


def to_parser(table: TextTable, block: bytes) -> tuple[bytes, int] | None:
    """Return whole rows as the parser wants them, in UTF-8, and the number of other lines among them.

    Decimal commas become points here, since pyarrow 26 parses decimals with another point wrongly in threads
    (they share a buffer); a point becomes a sign that no number has, so that 1.5 stays no number.

    Returns:
        None if rows with arrays or labels are not written like the others.
    """
    left_out = 0
    if table.form is not None:
        flat = table.form.flatten(block.decode(table.byte_encoding, "surrogateescape"))
        if flat is None:
            return None
        block, left_out = flat[0].encode(table.byte_encoding, "surrogateescape"), flat[1]
    if table.has_decimal_commas:
        block = block.translate(_TO_POINTS)
    block = squeeze(block) if table.delimiter == SPACE else block
    return (block.replace(table.delimiter.encode(), b"\n") if table.across else block), left_out


def squeeze(block: bytes) -> bytes:
    """Return whole lines with every run of spaces and tabs as one space, and none at either end of a line."""
    signs: Bytes = np.frombuffer(block, dtype=np.uint8)
    is_blank = (signs == ord(" ")) | (signs == ord("\t"))
    is_end = (signs == ord("\n")) | (signs == ord("\r"))
    is_skipped = np.zeros_like(is_blank)
    is_skipped[:1] = is_blank[:1]
    is_skipped[1:] = is_blank[1:] & (is_blank[:-1] | is_end[:-1])
    before_end = bool((is_blank[:-1] & is_end[1:]).any()) or block[-1:] == b" "
    if not (is_skipped.any() or before_end or b"\t" in block):
        return block
    result: bytes = np.where(is_blank, np.uint8(ord(" ")), signs)[~is_skipped].tobytes()
    return result.replace(b" \r", b"\r").replace(b" \n", b"\n").removesuffix(b" ")


class BlockParser:
    """Parses blocks of whole rows with pyarrow.

    Args:
        table: The table.
        columns: The columns of numbers.
        clock: The columns of the clock: numbers are added up in [ns]; the cells of text are read as they are.
    """

    def __init__(self, table: TextTable, columns: Sequence[int], clock: Sequence[ClockColumn]) -> None:
        self.table = table
        self._columns = columns
        self._texts = [part for part in clock if part.forms]
        self._clock = [part for part in clock if not part.forms]
        scales = (
            tuple(self._choose_scale(part, exact=exact) for part in self._clock) for exact in (False, True)
        )
        self._scales = tuple(dict.fromkeys(scales))  # decimals of the clock: as few as may do, then all

    def parse(self, block: bytes) -> Numbers | None:
        """Return the numbers of whole rows, None if the parser stumbles over a row or a cell."""
        plain = to_parser(self.table, block)
        if plain is None:
            return None
        for scales in self._scales:
            try:
                parsed = self._parse(plain[0], scales)
                numbers = self._to_numbers(parsed, scales)
            except (pa.ArrowException, OverflowError):
                # Of any kind: pyarrow 26 was seen to lose a chunk of sound numbers among its threads, once in
                # hundreds of files ("failed converting for an unknown reason"). The halves are tried then.
                continue
            texts = tuple(self._text_cells(parsed.column(str(part.column))) for part in self._texts)
            return replace(numbers, texts=texts, left_out=plain[1])
        return None

    def _choose_scale(self, part: ClockColumn, *, exact: bool) -> int:
        """Return how many decimals of the clock are read.

        As many as reach [ns] if the sampled cells have no more: then the parsed integers are [ns]. Else as
        many as fit with the digits before the point (and two more, since the clock continues).
        """
        cells = list(self.table.number_texts(part.column))
        decimals = max((len(cell.partition("e")[0].partition(".")[2]) for cell in cells), default=0)
        if not exact and decimals <= part.exponent:
            return part.exponent
        values = [abs(to_float(cell, ".") or 0.0) for cell in cells]
        digits = max((len(str(int(value))) for value in values if math.isfinite(value)), default=1)
        return max(part.exponent, _PRECISION - digits - 2)

    def _parse(self, rows: bytes, scales: Sequence[int]) -> pa.Table:
        """Return the columns as pyarrow parses them: float64, decimals for the clock, bytes for its texts."""
        table = self.table
        types: dict[str, Any] = {str(column): pa.float64() for column in self._columns}
        for part, scale in zip(self._clock, scales, strict=True):
            types[str(part.column)] = pa.decimal128(_PRECISION, scale)
        types |= {str(part.column): pa.binary() for part in self._texts}
        names = [str(column) for column in range(len(table.names))]
        quoted_commas = table.delimiter == table.decimal  # "0,5","1,5": `to_parser` leaves them
        return csv.read_csv(
            pa.BufferReader(rows),
            csv.ReadOptions(column_names=names, block_size=PARSED_BYTES, use_threads=not quoted_commas),
            csv.ParseOptions(delimiter=table.delimiter),
            csv.ConvertOptions(
                column_types=types,
                include_columns=list(types),
                null_values=_spell_missing(),
                decimal_point=table.decimal if quoted_commas else ".",
            ),
            memory_pool=pa.system_memory_pool(),  # the default one keeps what it once had
        )

    def _to_numbers(self, parsed: pa.Table, scales: Sequence[int]) -> Numbers:
        """Return a parsed table as arrays, batch by batch, so that the rows filled stay in the cache."""
        values = np.empty((parsed.num_rows, len(self._columns)))
        times = np.zeros(parsed.num_rows, dtype=np.int64)
        start = 0
        for batch in parsed.to_batches():
            rows = slice(start, start + batch.num_rows)
            for k, column in enumerate(self._columns):
                chunk = batch.column(str(column))
                place = slice(chunk.offset, chunk.offset + len(chunk))
                values[rows, k] = np.frombuffer(chunk.buffers()[1], dtype="<f8")[place]
                if chunk.null_count:
                    values[rows, k][find_missing(chunk)] = np.nan
            for part, scale in zip(self._clock, scales, strict=True):
                _add_time(times[rows], batch.column(str(part.column)), part.exponent, scale)
            start += batch.num_rows
        return Numbers(values, times if self._clock or self._texts else None)

    def _text_cells(self, column: pa.ChunkedArray) -> TextCells:
        """Return a parsed column of bytes: offsets of 32 bits, and the bytes between them."""
        cells = column.combine_chunks(pa.system_memory_pool())
        _, offsets, content = cells.buffers()
        starts = np.frombuffer(offsets, dtype="<i4")[cells.offset : cells.offset + len(cells) + 1]
        data = np.frombuffer(content or b"", dtype=np.uint8)
        data = _FROM_POINTS[data] if self.table.has_decimal_commas else data
        return TextCells(data, starts.astype(np.int64))


@lru_cache
def _spell_missing() -> list[str]:
    """Return the words for a missing sample in the usual spellings; read row by row, all are taken."""
    words = vocabulary().missing
    return sorted({spelled for word in words for spelled in (word, word.upper(), word.capitalize(), "NaN")})


def _add_time(target: IntArray, chunk: pa.Array, exponent: int, scale: int) -> None:
    """Add a chunk of the clock in [ns], NO_TIME where it has no value.

    A decimal128 is an integer of two 64-bit words, the low one first; of scale 9 it is [ns], if the unit
    is s, and the low word holds it if the high one only repeats its sign.

    Raises:
        OverflowError: If a time is beyond what 64 bits hold.
    """
    is_without = (target == NO_TIME) | (find_missing(chunk) if chunk.null_count else False)
    if scale > exponent:
        from pyarrow import compute

        rounded = compute.round(chunk, ndigits=exponent, round_mode="half_to_even")
        chunk = rounded.cast(pa.decimal128(_PRECISION, exponent))
    words = np.frombuffer(chunk.buffers()[1], dtype="<i8").reshape(-1, 2)
    low, high = words[chunk.offset : chunk.offset + len(chunk)].T
    if (((low >> 63) != high) & ~is_without).any():
        raise OverflowError
    target += low
    target[is_without] = NO_TIME


def find_missing(chunk: pa.Array) -> BoolArray:
    """Return where a chunk has no value, shape (n,): its validity bits, the first row in the lowest bit.

    Read from the buffer, since `to_numpy` and `is_null` load pandas and pyarrow.compute first.
    """
    bits = np.unpackbits(np.frombuffer(chunk.buffers()[0], dtype=np.uint8), bitorder="little")
    return np.asarray(bits[chunk.offset : chunk.offset + len(chunk)] == 0)


class RowReader:
    """Goes through rows one by one and keeps the findings.

    Args:
        table: The table.
        columns: Which columns hold numbers.
        clock: The columns of its clock.
        allowed: What a cell of a column may hold, for messages, where it is not as in a log.

    Attributes:
        has_ended: Whether the next rows are not to be read: they are those of a second log.
    """

    def __init__(
        self,
        table: TextTable,
        columns: Sequence[int],
        clock: Sequence[ClockColumn],
        allowed: Mapping[int, str] | None = None,
    ) -> None:
        self.has_ended = False
        self._table, self._columns, self._clock, self._allowed = table, columns, clock, allowed or {}
        self._text_parts = [part for part in clock if part.forms]
        self._used = (*columns, *(part.column for part in clock))
        self._rows_read = None if table.rows is None else frozenset(table.rows.tolist())
        self._next_line, self._line, self._row = table.first_line, 0, 0
        self._findings: list[tuple[Finding, int]] = []  # with the number of rows below with the same fault
        self._unread: dict[int, list[RowFault]] = {}

    def pass_over(self, rows: int, lines: int) -> None:
        """Count rows and lines that were read otherwise."""
        self._row += rows
        self._next_line += lines

    def read(self, lines: Sequence[str]) -> Numbers:
        """Return the numbers of the rows on the next lines: NaN and REPORTED where something is wrong."""
        numbered = list(enumerate((line.rstrip("\r\n") for line in lines), start=self._next_line))
        self._next_line += len(lines)
        values, times, rows = array("d"), array("q"), 0
        texts: list[list[str]] = [[] for _ in self._text_parts]
        for line, text in self._table.data_lines(numbered):
            if self.has_ended:
                break
            self._line, self._row, rows = line, self._row + 1, rows + 1
            cells = self._read_cells(text) if self._is_read() else None
            for column_texts, part in zip(texts, self._text_parts, strict=True):
                column_texts.append("" if cells is None else cells[part.column])
            times.append(REPORTED if cells is None else self._read_time(cells))
            values.extend([math.nan] * len(self._columns) if cells is None else self._read_values(cells))
        form = self._table.form
        other_lines = sum(bool(line.strip()) and not form.is_row(line) for _, line in numbered) if form else 0
        return Numbers(
            np.array(values).reshape(rows, len(self._columns)),
            np.array(times, dtype=np.int64) if self._clock else None,
            left_out=other_lines,
            texts=tuple(TextCells.of(column_texts) for column_texts in texts),
        )

    def summary(self) -> Numbers:
        """Return what was found to be wrong, without numbers."""
        findings = tuple(
            replace(finding, message=f"{finding.message} (and so {format_count(more, 'more row')} below it)")
            if more
            else finding
            for finding, more in self._findings
        )
        return Numbers(np.empty((0, len(self._columns))), None, findings, self._unread)

    def check_last_row(self) -> None:
        """Report the last row if the file ends within its last cell, which then lacks decimals."""
        table = self._table
        usual = table.cells(len(table.names) - 1)
        is_plain = table.form is None and not table.across and len(table.names) - 1 in self._used
        if not is_plain or len(usual) < _MIN_FIXED_ROWS or self.has_ended or not self._is_read():
            return
        with table.segment.open() as file:
            file.seek(max(table.segment.start, table.segment.end - _LAST_BYTES))
            raw = file.read(table.segment.end - file.tell())
        text = raw.decode(table.segment.encoding, errors="replace").rpartition(table.segment.newline)[2]
        cells = split_line(text, table.delimiter)
        decimals, *further = {len(cell.partition(table.decimal)[2]) for cell in usual}
        if text.lstrip().startswith(COMMENTS) or len(cells) != len(table.names) or further:
            return
        if is_number(cells[-1], table.decimal) and len(cells[-1].partition(table.decimal)[2]) < decimals:
            self._line = table.lines_of([self._row])[self._row]
            allowed = "as many decimals as in the other rows"
            self._report(f"found {cells[-1]!r} where the file ends, allowed: {allowed}")

    def _is_read(self) -> bool:
        return self._rows_read is None or self._row - 1 in self._rows_read

    def _read_cells(self, text: str) -> list[str] | None:
        """Return the cells of a row; None if it is not written like the others, or has no numbers at all."""
        table, form = self._table, self._table.form
        if len(text) > MAX_HEAD_BYTES:
            self._report(f"found a line of {len(text)} letters, allowed: {len(table.names)} cells")
            return None
        try:
            values: list[Value] = [*split_line(text, table.delimiter)] if form is None else form.values(text)
            if not self._has_all(text, values):
                return None
            cells = [str(value) for value in values] if form is None else form.spread(values)
        except RowError as error:
            self._report(error.message, error.name)
            return None
        if len(self._used) > 1 and all(is_text(cells[column], table.decimal) for column in self._used):
            self._report(f"found {_shorten(text)}, allowed: a row of numbers")
            return None
        return cells

    def _has_all(self, text: str, values: list[Value]) -> bool:
        """Return whether a row has as many values as the others, having reported what it is if not."""
        names = self._table.form.names if self._table.form else self._table.names
        width = len(names)
        if again := self._header_again(text, values, names):
            message = f"found {again}, allowed: one log per file; a second log begins here"
            first = 1 + min(self._rows_read or [0])
            parts = [f"{first}:{self._row - 1}", f"{self._row + 1}:-1"][: 2 if again == HEADER else 1]
            parts = [] if self._allowed else parts  # a table of targets has no such option
            hints = tuple(Hint("rows", part, "reads these rows") for part in parts)
            self._findings.append((replace(self._finding(message), hints=hints), 0))
            self.has_ended = True
            return False
        if len(values) == width - 1 and not names[-1]:
            values.append("")  # a row without the trailing delimiter that the others have
        if len(values) != width and any([*values[width:], len(values) < width]):
            numbers = any(not isinstance(v, str) or is_number(v, self._table.decimal) for v in values)
            shown = "" if numbers else f" ({_shorten(text)})"
            self._report(f"found {format_count(len(values), 'cell')}{shown}, allowed: {width}")
            return False
        del values[width:]
        return True

    def _header_again(self, text: str, values: Sequence[Value], names: Sequence[str]) -> str | None:
        """Return what to call a row that is the header again, perhaps in other units; None if it is not."""
        if self._table.header is None or not any(names):
            return None
        if tuple(values[: len(names)]) == tuple(names):
            return HEADER
        if any(not isinstance(value, str) or is_number(value, self._table.decimal) for value in values):
            return None
        known = {split_unit(name)[0].lower() for name in names if name}
        count = sum(split_unit(str(value))[0].lower() in known for value in values)
        return f"another header, {_shorten(text)}" if count > 1 and 2 * count >= len(names) else None

    def _read_values(self, cells: Sequence[str]) -> list[float]:
        used = [cells[column] for column in self._columns]
        if self._table.decimal == "." and not any("_" in cell for cell in used):  # float() takes 1_000
            try:
                return [float(cell) for cell in used]
            except ValueError:
                pass
        values = []
        for column, cell in zip(self._columns, used, strict=True):
            value = to_float(cell, self._table.decimal)
            if value is None:
                allowed = self._allowed.get(column, MAY_BE_MISSING)
                self._report(f"found {_shorten(cell)}, allowed: {allowed}", self._table.names[column])
            values.append(math.nan if value is None else value)
        return values

    def _read_time(self, cells: Sequence[str]) -> int:
        total = 0
        for part in () if self._text_parts else self._clock:
            cell = cells[part.column]
            time = to_nanoseconds(cell, self._table.decimal, part.exponent)
            if time is None and is_missing(cell):
                return NO_TIME
            if time is None:
                name = self._table.names[part.column]
                self._report(f"found {_shorten(cell)}, allowed: a number in every row", name)
                return REPORTED
            total += time
        return total

    def _report(self, message: str, column: str | None = None) -> None:
        """Keep a finding about this row; the same in the rows below it is counted."""
        self._unread.setdefault(self._row - 1, []).append(RowFault(message, (column,) if column else ()))
        if self._findings:
            first, more = self._findings[-1]
            if (first.message, first.column, (first.row or 0) + more + 1) == (message, column, self._row):
                self._findings[-1] = first, more + 1
                return
        self._findings.append((self._finding(message, column), 0))

    def _finding(self, message: str, column: str | None = None) -> Finding:
        return Finding(message, self._table.file, self._line, self._row, column)


def _shorten(text: str) -> str:
    text = text.strip()
    return repr(text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 3] + "...")
