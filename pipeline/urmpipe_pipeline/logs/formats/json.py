"""JSON: an object a line (.jsonl, .ndjson), an array of objects or of arrays, an object of arrays.

    {"t": 0.1, "arm": {"q": [0.2, 0.3]}}          t, arm/q[0], arm/q[1]

Numbers are read from their text, so that they have the same values as in a CSV file.

1. `sniff_json_lines`: JSON lines become text with tabs and the same line numbers. A damaged line is a row
   that cannot be read.
2. `read_json`: any other document becomes a table in memory, and messages name its rows. The forms that
   pandas writes are known; of arrays of several lengths, or episodes, the user chooses (`array_choice`).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from itertools import islice
from typing import Any

import numpy as np

from urmpipe_models.errors import Finding, LogError
from urmpipe_models.files import log_stem
from urmpipe_pipeline.array_choice import Name, choose_arrays
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.arrays import Array, make_array_table, settle_choice
from urmpipe_pipeline.logs.formats.cells import is_number, printable
from urmpipe_pipeline.logs.formats.log_table import MAX_SAMPLED_ROWS
from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.formats.text import Segment, check_width, head_lines, text_segment
from urmpipe_pipeline.logs.formats.text_table import TextTable
from urmpipe_pipeline.logs.log_map import LogMap

MAX_DIGITS = 17  # decimal digits of a double

_SEPARATORS = str.maketrans('\t\r\n"', "   '")  # would end a cell or a line of text with tabs
_DECODER = json.JSONDecoder(parse_float=str, parse_int=str, parse_constant=str)
_BEGINNING = re.compile(r'\s*(?:\[\s*(?:[\[{]|$)|\{\s*")')
_DOCUMENT = re.compile(r"\s*(?:\[\s*\{|[\[{]\r?\n)")  # no other text begins so
_UNIT_LAST = re.compile(r"(.*\S)\s*[\[(]([^\[\]()\d]+)[\])]")

Record = dict[str, str]


def sniff_json_lines(segment: Segment) -> TextTable | None:
    """Return how JSON lines are written, as rows of plain cells; None if the text is something else.

    Raises:
        LogError: If there are too many columns.
    """
    if not _is_json_lines(segment):
        return None
    names: dict[str, None] = {}
    usual: list[str] = []
    rows: list[tuple[str, int]] = []  # with the number of columns known so far
    for _, line in segment.lines():
        record = _read_record(line)
        if record is None:
            rows.append((line.translate(_SEPARATORS).strip(), 0))
            continue
        if record.keys() != names.keys():
            names |= dict.fromkeys(record)
            check_width(len(names), str(segment.path))
            usual = [*names]
        is_usual = [*record] == usual
        row = "\t".join(record.values() if is_usual else [record.get(name, "") for name in names])
        if '"' in row or "\n" in row or "\r" in row or row.count("\t") >= len(names):
            row = "\t".join([record.get(name, "").translate(_SEPARATORS) for name in names])
        rows.append((row, len(names)))
    text = "\n".join(row + "\t" * (len(names) - width) if width else row for row, width in rows)
    sample = (row.split("\t") for row in text.split("\n", MAX_SAMPLED_ROWS)[:MAX_SAMPLED_ROWS])
    return TextTable(
        segment=text_segment(segment.path, f"{text}\n", "\t", ()),
        delimiter="\t",
        decimal=".",
        names=tuple(printable(name.translate(_SEPARATORS)) for name in names),
        units=(),
        header=1,
        first_line=1,
        offset=0,
        sample=tuple(tuple(row) for row in sample if len(row) == len(names)),
        inferences=(Inference("JSON", "an object a line", "each line is one"),),
    )


def read_json(segment: Segment, options: LogMap) -> MemoryTable | None:
    """Return the table of a JSON document; None if the text is something else, or JSON lines.

    Raises:
        LogError: If it is damaged or holds no arrays of numbers; with a question if they have several
            lengths, or are those of several episodes.
    """
    if not _BEGINNING.match(segment.head) or _is_json_lines(segment):
        return None
    file, text = str(segment.path), segment.text()
    try:
        document = _DECODER.decode(text)
    except (ValueError, RecursionError) as error:
        is_lone = "\n" not in text.strip()
        if not (is_lone or _DOCUMENT.match(text) or segment.path.suffix.lower() == ".json"):
            return None
        reason, line = str(error), None
        if isinstance(error, json.JSONDecodeError):
            reason, line = error.msg, error.lineno
        fault = f"JSON that is damaged or cut ({reason})"
        raise LogError(Finding(file=file, line=line, found=fault, allowed="a whole document")) from None
    arrays = dict[Name, dict[str, list[str]]]()
    for path, array in _iter_arrays(document, ()):
        columns = _columns("/".join(path), array, file)
        if any(is_number(cell, ".") for cells in columns.values() for cell in cells):
            arrays[path] = columns
    if not arrays:
        allowed = "an array of objects, or arrays of one length"
        raise LogError(Finding(file=file, found="JSON without an array of numbers", allowed=allowed))
    shapes = {path: (len(next(iter(columns.values()))),) for path, columns in arrays.items()}
    read = choose_arrays(shapes, options.episode, options.topic, separator="/", by_rows=True)
    choice = settle_choice(segment.path, read)
    columns = {name: cells for path in choice.names or arrays for name, cells in arrays[path].items()}
    named = not all(re.fullmatch(r"\[\d+\]", name) for name in columns)
    if not named and not any(is_number(cells[0], ".") for cells in columns.values()):
        columns = {cells[0]: cells[1:] for cells in columns.values()}  # names in the first row
        named = True
    values = ((tuple(name.split("/")), "", _column(cells)) for name, cells in columns.items())
    entries = document.items() if isinstance(document, dict) else ()
    scalars = {
        key: float(value) for key, value in entries if isinstance(value, str) and is_number(value, ".")
    }
    unused = [name for path in choice.left_out for name in arrays[path]] if choice.names else []
    table = make_array_table(segment.path, choice, values, scalars, "/", options, unused, is_named=named)
    inferences = (Inference("JSON", "a document", "its beginning"), *table.inferences)
    return replace(table, name=log_stem(segment.path), inferences=inferences)


def _is_json_lines(segment: Segment) -> bool:
    """Return whether each sampled line begins as an object, and at least half of the lines are objects."""
    lines = [line.text for line in islice(head_lines(segment), MAX_SAMPLED_ROWS)]
    objects = [line.lstrip().startswith("{") for line in lines]
    return len(lines) > 1 and all(objects) and 2 * sum(map(bool, map(_read_record, lines))) >= len(lines)


def _read_record(line: str) -> Record | None:
    """Return the cells of an object in a line; None of any other line."""
    try:
        value = _DECODER.decode(line)
    except (ValueError, RecursionError):
        return None
    return _add_cells(value, "", {}) if isinstance(value, dict) else None


def _add_cells(value: Any, name: str, record: Record) -> Record:
    """Add the texts of a value to a record: of objects as GROUP/NAME, of arrays as NAME[0]; return it."""
    if isinstance(value, str):
        record[name] = value
    elif isinstance(value, dict):
        for key, inner in value.items():
            _add_cells(inner, f"{name}/{key}" if name else key, record)
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            if isinstance(inner, str):  # most are numbers
                record[_indexed(name, k)] = inner
            else:
                _add_cells(inner, _indexed(name, k), record)
    else:
        record[name] = "" if value is None else str(value)
    return record


@lru_cache(1 << 14)
def _indexed(name: str, k: int) -> str:
    """Return the name of an entry, before the unit of the array: q [deg] becomes q[0] [deg]."""
    unit = _UNIT_LAST.fullmatch(name)
    return f"{unit[1]}[{k}] [{unit[2]}]" if unit else f"{name}[{k}]"


def _iter_arrays(value: Any, name: Name) -> Iterator[tuple[Name, Sequence[Any]]]:
    """Yield the arrays of a document by name; of pandas also objects with a value for each row."""
    if isinstance(value, list):
        yield name, value
    elif isinstance(value, dict) and isinstance(value.get("columns"), list) and "data" in value:
        yield name, [dict(zip(value["columns"], row, strict=False)) for row in value["data"]]
    elif isinstance(value, dict) and len(value) > 1 and all(map(str.isdigit, value)):
        yield name, list(value.values())
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from _iter_arrays(inner, (*name, key))


def _columns(name: str, array: Sequence[Any], file: str) -> dict[str, list[str]]:
    """Return the cells of the entries of an array by name."""
    records = [_add_cells(entry, name, {}) for entry in array]
    names = dict.fromkeys(key for record in records for key in record)
    check_width(len(names), file)
    return {key: [record.get(key, "") for record in records] for key in names}


def _column(cells: Sequence[str]) -> Array:
    """Return cells as numbers; as texts if they are not numbers, or have more digits than a double."""
    digits = (sum(map(str.isdigit, cell.lstrip("-0."))) for cell in cells if len(cell) > MAX_DIGITS)
    if not any(count > MAX_DIGITS for count in digits):
        filled = np.array([cell or "nan" for cell in cells])
        for kind in (np.int64, np.float64):
            with suppress(ValueError, OverflowError):
                return filled.astype(kind)
    return np.array([cell or None for cell in cells], dtype=object)
