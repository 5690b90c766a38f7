"""Tables that are not a row a sample: joints as rows, and arrays flattened to numbers one after another.

Their rows cannot tell it, only the numbers: where these go on along the rows, or at every sixth place, it is
asked. Read so, a table is one in memory.

Tables whose cells hold arrays, as str of a NumPy array or a list writes them, also over several lines.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, islice, pairwise

import numpy as np
import pyarrow as pa

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.cells import is_missing, is_number, is_text, plain, to_float
from urmpipe_pipeline.logs.formats.form import (
    CLOSING,
    Form,
    Value,
    spread_names,
    usual_length,
    words_around,
)
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.memory import MemoryTable, to_log_table
from urmpipe_pipeline.logs.formats.padding import MOST_JOINTS, flat_ways, goes_along_rows
from urmpipe_pipeline.logs.formats.sniff import across, sniff
from urmpipe_pipeline.logs.formats.text import HeadLine, Segment, head_lines
from urmpipe_pipeline.logs.formats.text_table import TextTable

AS_TABLE, TRANSPOSED = "table", "transposed"

SHOWN_WAYS = 3
"""Ways to read a flat array that are offered."""

GIVEN = "given as an option"

_TABLE = Hint("layout", AS_TABLE, "takes each row as a sample")

_Rows = Sequence[Sequence[str]]


def turned(layout: LogTable, given: str | None, *, alone: bool = True) -> LogTable:
    """Return a table as one with a row a sample.

    Rows that begin with a name each, and go on smoothly, are joints. Others are asked about.

    Args:
        layout: How it is written.
        given: What the user says: "table", "transposed", "flat:N", "flat-by-joint:N".
        alone: Whether it is all of a log: one of several files may be a single column or row.

    Raises:
        LogError: If its numbers say that it may be no row a sample, or they do not fit what is given.
    """
    if given is not None:
        return _as_given(layout, given)
    if not alone or getattr(layout, "form", None) is not None:
        return layout
    column = across(layout) if layout.arrow is None else layout
    if len(column.names) == 1 or (layout.arrow is not None and layout.arrow.num_rows == 1):
        return _one_by_one(layout, column)
    if len(layout.sample) > MOST_JOINTS or not _unnamed(layout):
        return layout
    rows = list(islice(layout.iter_cells(), MOST_JOINTS + 1))
    return _joints_as_rows(layout, rows) if len({len(row) for row in rows}) == 1 else layout


def _as_given(layout: LogTable, given: str) -> LogTable:
    """Return a table as the user says."""
    if given == AS_TABLE:
        return replace(layout, inferences=(*layout.inferences, _said(AS_TABLE, GIVEN)))
    if given == TRANSPOSED:
        return _transposed(layout, list(layout.iter_cells()), GIVEN)
    return _unflattened(layout, given)


def _unnamed(layout: LogTable) -> bool:
    """Return whether columns have no names, or the numbers that pandas gives them."""
    names = [name for name in layout.names if name]
    return layout.header is None or all(is_number(name, ".") for name in names)


def _one_by_one(layout: LogTable, column: LogTable) -> LogTable:
    """Return a single column or row as it is, if it may be one joint over time or one sample; else ask."""
    numbers = column.all_rows
    if numbers.findings:
        return layout
    x = numbers.values.ravel()
    ways = [f"{order}:{count}" for order, count in flat_ways(x)[:SHOWN_WAYS]]
    if ways:
        found = f"found {len(x)} numbers one by one that go on smoothly from one to the {_place(ways[0])}"
        hints = [Hint("layout", way, _does(way)) for way in ways]
        as_it_is = Hint("layout", AS_TABLE, f"takes {'them' if column.across else 'each'} as a sample")
        raise LogError(Finding(f"{found}, which may be a flat array", layout.file, hints=(*hints, as_it_is)))
    if len(layout.names) > 1 and goes_along_rows(x[np.newaxis]):
        _ask(layout, 1, len(x))
    return layout


def _place(way: str) -> str:
    """Return where a flat array goes on."""
    order, _, count = way.partition(":")
    return f"{count}th behind it" if order == "flat" else f"next, but for {int(count) - 1} jumps"


def _does(way: str) -> str:
    """Return what a way to read a flat array does."""
    order, _, count = way.partition(":")
    return f"takes {count} numbers a sample" if order == "flat" else f"takes {count} joints one by one"


def _joints_as_rows(layout: LogTable, rows: _Rows) -> LogTable:
    """Return rows that are joints by their names and numbers turned; by numbers alone they are asked."""
    if len(rows) < 2 or len(rows) > MOST_JOINTS:
        return layout
    names, cells = _named(rows, layout.decimal)
    values = _values(cells, layout.decimal)
    if values is None or not goes_along_rows(values):
        return layout
    if not names or len(set(names)) < len(names):
        _ask(layout, *values.shape)
    why = f"{len(rows)} rows begin with a name, and their {values.shape[1]} numbers go on smoothly"
    return _transposed(layout, rows, why, _TABLE)


def _ask(layout: LogTable, rows: int, columns: int) -> None:
    """Raise the question whether rows are joints."""
    row = "1 row" if rows == 1 else f"{rows} rows"
    verb = "goes on smoothly along it, which may be a joint as a row"
    verb = verb if rows == 1 else "go on smoothly along the rows, which may be joints as rows"
    found = f"found {row} of {columns} numbers that {verb}"
    so = Hint("layout", TRANSPOSED, "applies this")
    raise LogError(Finding(found, layout.file, hints=(so, _TABLE)))


def _transposed(layout: LogTable, rows: _Rows, why: str, *otherwise: Hint) -> LogTable:
    """Return a table whose rows are columns; a text at the beginning of a row is its name."""
    width = max(map(len, rows))
    odd = next((k for k, row in enumerate(rows) if len(row) != width), None)
    if odd is not None:
        found = f"found a row of {len(rows[odd])} cells, allowed: {width}, as others have"
        raise LogError(Finding(found, layout.file, row=odd + 1))
    names, cells = _named(rows, layout.decimal)
    columns = [_column(row, layout.decimal) for row in cells]
    return _in_memory(layout, columns, names, _said(TRANSPOSED, why, *otherwise))


def _unflattened(layout: LogTable, way: str) -> LogTable:
    """Return numbers that follow each other, row by row, as a table of N columns."""
    order, _, text = way.partition(":")
    numbers, count = (across(layout) if isinstance(layout, TextTable) else layout).all_rows, int(text)
    if numbers.findings:
        raise LogError(*numbers.findings)
    x = numbers.values.ravel()
    if not len(x) or len(x) % count:
        found = f"found {len(x)} numbers, allowed with {way}: a multiple of {count}"
        raise LogError(Finding(found, layout.file))
    table = x.reshape(-1, count).T if order == "flat" else x.reshape(count, -1)
    return _in_memory(layout, [pa.array(column) for column in table], (), _said(way, GIVEN))


def _in_memory(
    layout: LogTable, columns: Sequence[pa.Array], names: Sequence[str], said: Inference
) -> LogTable:
    """Return a table in memory in the place of one that is written otherwise."""
    table = pa.Table.from_arrays(list(columns), names=list(names or map(str, range(1, len(columns) + 1))))
    path = layout.path
    kept = (one for one in layout.inferences if one.what != "header")
    held = MemoryTable(path.stem, table, named=bool(names), path=path)
    return replace(to_log_table(held), inferences=(*kept, said))


def _said(value: str, evidence: str, *hints: Hint) -> Inference:
    return Inference("layout", value, evidence, hints=hints)


def _named(rows: _Rows, decimal: str) -> tuple[tuple[str, ...], list[Sequence[str]]]:
    """Return the names that rows begin with, if they do, and the other cells."""
    if not any(is_text(row[0], decimal) for row in rows if row):
        return (), list(rows)
    return tuple(row[0] for row in rows), [row[1:] for row in rows]


def _values(rows: _Rows, decimal: str) -> FloatArray | None:
    """Return cells as numbers, shape (rows, columns), NaN where one is missing; None if one is text."""
    values = [to_float(cell, decimal) for cell in chain.from_iterable(rows)]
    if None in values:
        return None
    return np.array(values, dtype=np.float64).reshape(len(rows), -1)


def _column(cells: Sequence[str], decimal: str) -> pa.Array:
    """Return cells as a column of whole numbers, of numbers, or of text."""
    spelled = [None if is_missing(cell) else cell for cell in cells]
    if any(cell is not None and is_text(cell, decimal) for cell in spelled):
        return pa.array(spelled, pa.string())
    texts = [None if cell is None else plain(cell, decimal) for cell in spelled]
    try:
        return pa.array([None if text is None else int(text) for text in texts], pa.int64())
    except (ValueError, pa.ArrowInvalid, OverflowError):
        return pa.array([None if text is None else float(text) for text in texts], pa.float64())


_PLAIN = "7"
"""Stands for an array where the layout of the other cells is found out."""

_STARTS = {
    opening: re.compile(rf'(?:^|[,;|\t ])"?{re.escape(opening)}+\s*(?:[-+.\d]|nan|\w+\.)', re.IGNORECASE)
    for opening in CLOSING
}
_COMMAS = re.compile(r"\d,\d")
_OTHERS = re.compile(r"\d(?:\s+|\s*;\s*)[-+.\d]")


def sniff_arrays(
    segment: Segment, delimiter: str | None = None, decimal: str | None = None
) -> TextTable | None:
    """Return how a table with arrays in its cells is written, as rows of plain cells; None if it has none.

    A column NAME of arrays becomes NAME_1, NAME_2, ...

    Raises:
        LogError: As `sniff`, or if the arrays have decimal commas.
        OptionError: As `sniff`.
    """
    lines = list(head_lines(segment)) if any(sign in segment.head for sign in CLOSING) else []
    opening = next((sign for sign in CLOSING if _begin_cells(lines, sign)), None)
    if opening is None:
        return None
    form = Form((), (), ",", opening=opening, continued=_goes_on(lines, opening))
    rows = _joined(form, lines, whole=not segment.has_more)
    form = replace(form, words=words_around(row.text for row in rows))
    outer = sniff(
        segment, delimiter, decimal, [replace(row, text=_with_plain(form, row.text)) for row in rows]
    )
    form = replace(form, delimiter=outer.delimiter, decimal=outer.decimal, names=outer.names)
    body = (row for row in rows if row.number >= outer.first_line and not row.is_comment)
    values = form.readable(row.text for row in body)
    lengths = tuple(usual_length(row[j] for row in values) for j in range(len(outer.names)))
    if not any(lengths):
        return None
    _refuse_commas(segment, form, rows)
    return _spread(outer, replace(form, lengths=lengths), values)


def _begin_cells(lines: Sequence[HeadLine], opening: str) -> bool:
    """Return whether every second line or more has a cell that begins with a bracket and a number.

    Lines that begin with a blank may go on with an array that began above.
    """
    count = sum(opening in line.text and bool(_STARTS[opening].search(line.text)) for line in lines)
    rows = sum(not line.text.startswith((" ", "\t")) for line in lines[1:])
    return count > 0 and 2 * count >= rows


def _goes_on(lines: Sequence[HeadLine], opening: str) -> bool:
    """Return whether a line with an open bracket is followed by one that begins with a blank."""
    return any(
        line.text.count(opening) > line.text.count(CLOSING[opening]) and after.text.startswith((" ", "\t"))
        for line, after in pairwise(lines)
    )


def _joined(form: Form, lines: Sequence[HeadLine], *, whole: bool) -> list[HeadLine]:
    """Return one line for each row; not the last one, if the head may end within it."""
    places = {line.number: line.offset for line in lines}
    rows = [
        HeadLine(number, places[number], text)
        for number, text in form.rows((line.number, line.text) for line in lines)
    ]
    return rows if whole or len(rows) < 2 or not form.continued else rows[:-1]


def _with_plain(form: Form, text: str) -> str:
    """Return a row with a plain number for each array."""
    return form.replaced(text, lambda array: _PLAIN if _is_numeric(array) or "'" in array else array)


def _is_numeric(value: Value) -> bool:
    cells = Form.inner(value) if isinstance(value, str) else value
    return any(is_number(cell, ".") for cell in cells) and all(
        is_number(cell, ".") or is_missing(cell) for cell in cells
    )


def _refuse_commas(segment: Segment, form: Form, rows: Sequence[HeadLine]) -> None:
    """Raise if commas stand within numbers while something else stands between them."""
    for row in rows:
        for array in form.arrays(row.text):
            if _COMMAS.search(array) and _OTHERS.search(array):
                message = f"found {array.strip()[:40]!r}, allowed: arrays whose numbers have decimal points"
                raise LogError(Finding(message, str(segment.path), row.number))


def _spread(outer: TextTable, form: Form, values: Sequence[list[Value]]) -> TextTable:
    """Return the layout of the plain cells."""
    names = tuple(spread_names(outer.names, form.lengths))
    if outer.header is None:
        names = tuple(str(k + 1) for k in range(len(names)))
    units = [*outer.units, *("" for _ in range(len(outer.names) - len(outer.units)))] if outer.units else []
    sample = form.sampled(values)
    named = zip(outer.names, form.lengths, strict=True)
    arrays = ", ".join(f"{name or j + 1} ({n})" for j, (name, n) in enumerate(named) if n)
    said = Inference("arrays", arrays, "their cells hold as many numbers in brackets")
    return replace(
        outer,
        names=names,
        units=tuple(u for u, n in zip(units, form.lengths, strict=False) for _ in range(n or 1)),
        sample=sample,
        inferences=(*outer.inferences, said),
        form=form,
    )
