"""Tables whose cells hold arrays, as str of a NumPy array or a list writes them, also over several lines."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from urmpipe_models.errors import Finding, LogError
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.cells.cell import is_missing, is_number
from urmpipe_pipeline.logs.tables.form import (
    CLOSING,
    Form,
    Value,
    spread_names,
    usual_length,
    words_around,
)
from urmpipe_pipeline.logs.tables.sniff import Layout, sniff
from urmpipe_pipeline.logs.tables.text import HeadLine, Segment, head_lines

_PLAIN = "7"
"""Stands for an array where the layout of the other cells is found out."""

_STARTS = {
    opening: re.compile(rf'(?:^|[,;|\t ])"?{re.escape(opening)}+\s*(?:[-+.\d]|nan|\w+\.)', re.IGNORECASE)
    for opening in CLOSING
}
_COMMAS = re.compile(r"\d,\d")
_OTHERS = re.compile(r"\d(?:\s+|\s*;\s*)[-+.\d]")


def sniff_arrays(segment: Segment, delimiter: str | None = None, decimal: str | None = None) -> Layout | None:
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


def _spread(outer: Layout, form: Form, values: Sequence[list[Value]]) -> Layout:
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
