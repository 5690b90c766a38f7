"""JSON: an object a line (.jsonl, .ndjson), an array of objects or of arrays, an object of arrays.

    {"t": 0.1, "arm": {"q": [0.2, 0.3]}}          t, arm/q[0], arm/q[1]

Numbers are read from their text, so that they have the same values as in a CSV file.

1. `sniff_json_lines`: JSON lines become text with tabs and the same line numbers. A damaged line is a row
   that cannot be read.
2. `read_json`: any other document becomes a table in memory, and messages name its rows. The forms that
   pandas writes are known.
"""

from __future__ import annotations

import json
import os.path
import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import islice
from typing import Any

import pyarrow as pa

from urmpipe_models.errors import Finding, LogError
from urmpipe_models.files import log_stem
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.cells import is_number, printable
from urmpipe_pipeline.logs.formats.log_table import MAX_SAMPLED_ROWS
from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.formats.text import Segment, head_lines, refuse_wide, text_segment
from urmpipe_pipeline.logs.formats.text_table import TextTable

SEPARATORS = str.maketrans('\t\r\n"', "   '")
"""What replaces signs that would end a cell or a line of text with tabs."""

_DECODER = json.JSONDecoder(parse_float=str, parse_int=str, parse_constant=str)
_BEGINNING = re.compile(r'\s*(?:\[\s*(?:[\[{]|$)|\{\s*")')
_DOCUMENT = re.compile(r"\s*(?:\[\s*\{|[\[{]\r?\n)")  # no other text begins so
_UNIT_LAST = re.compile(r"(.*\S)\s*[\[(]([^\[\]()\d]+)[\])]")
_CONSTANTS = 16  # an array of at most this length next to longer ones is none of samples: limits, a base
_DIGITS = 17  # decimal digits of a double
_ALLOWED = "an array of objects, or arrays of one length"

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
            rows.append((line.translate(SEPARATORS).strip(), 0))
            continue
        if record.keys() != names.keys():
            names |= dict.fromkeys(record)
            refuse_wide(len(names), str(segment.path))
            usual = [*names]
        is_usual = [*record] == usual
        row = "\t".join(record.values() if is_usual else [record.get(name, "") for name in names])
        if '"' in row or "\n" in row or "\r" in row or row.count("\t") >= len(names):
            row = "\t".join([record.get(name, "").translate(SEPARATORS) for name in names])
        rows.append((row, len(names)))
    text = "\n".join(row + "\t" * (len(names) - width) if width else row for row, width in rows)
    sample = (row.split("\t") for row in text.split("\n", MAX_SAMPLED_ROWS)[:MAX_SAMPLED_ROWS])
    return TextTable(
        segment=text_segment(segment.path, f"{text}\n", "\t", ()),
        delimiter="\t",
        decimal=".",
        names=tuple(printable(name.translate(SEPARATORS)) for name in names),
        units=(),
        header=1,
        first_line=1,
        offset=0,
        sample=tuple(tuple(row) for row in sample if len(row) == len(names)),
        inferences=(Inference("JSON", "an object a line", "each line is one"),),
    )


def read_json(segment: Segment) -> MemoryTable | None:
    """Return the table of a JSON document; None if the text is something else, or JSON lines.

    Raises:
        LogError: If it is damaged, or holds no arrays of numbers of one length.
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
        fault = (
            f"JSON that is damaged or cut ({error.msg if isinstance(error, json.JSONDecodeError) else error})"
        )
        line = error.lineno if isinstance(error, json.JSONDecodeError) else None
        raise LogError(Finding(file=file, line=line, found=fault, allowed="a whole document")) from None
    columns, left_out = _find_columns(document, file)
    named = not all(re.fullmatch(r"\[\d+\]", name) for name in columns)
    texts = [*columns.values()]
    if not named and not any(is_number(column[0], ".") for column in texts):  # names in the first row
        columns = {column[0]: column[1:] for column in texts}
        named = True
    table = pa.table({name: _column(cells) for name, cells in columns.items()})
    inferences = [Inference("JSON", "a document", "its beginning")]
    if left_out:
        inferences.append(Inference("arrays left out", ", ".join(left_out), "they have other lengths"))
    return MemoryTable(log_stem(segment.path), table, named, segment.path, tuple(inferences))


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
    return _cells(value, "", {}) if isinstance(value, dict) else None


def _cells(value: Any, name: str, record: Record) -> Record:
    """Add the texts of a value to a record: of objects as GROUP/NAME, of arrays as NAME[0]; return it."""
    if isinstance(value, str):
        record[name] = value
    elif isinstance(value, dict):
        for key, inner in value.items():
            _cells(inner, f"{name}/{key}" if name else key, record)
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            if isinstance(inner, str):  # most are numbers
                record[_indexed(name, k)] = inner
            else:
                _cells(inner, _indexed(name, k), record)
    else:
        record[name] = "" if value is None else str(value)
    return record


@lru_cache(1 << 14)
def _indexed(name: str, k: int) -> str:
    """Return the name of an entry, before the unit of the array: q [deg] becomes q[0] [deg]."""
    unit = _UNIT_LAST.fullmatch(name)
    return f"{unit[1]}[{k}] [{unit[2]}]" if unit else f"{name}[{k}]"


def _find_columns(document: Any, file: str) -> tuple[dict[str, list[str]], list[str]]:
    """Return the columns of a document, all of one length, and the names of its other arrays."""
    tables: dict[int, dict[str, list[str]]] = {}
    for name, array in _arrays(document, ""):
        records = [_cells(entry, name, {}) for entry in array]
        names = dict.fromkeys(key for record in records for key in record)
        refuse_wide(len(names), file)
        columns = {key: [record.get(key, "") for record in records] for key in names}
        tables.setdefault(len(array), {}).update(columns)
    numeric = {
        length: columns
        for length, columns in tables.items()
        if any(is_number(cell, ".") for cells in columns.values() for cell in cells)
    }
    if not numeric:
        raise LogError(Finding(file=file, found="JSON without an array of numbers", allowed=_ALLOWED))
    longest = max(numeric)
    lengths = [k for k in numeric if k != longest and (k > _CONSTANTS or longest <= _CONSTANTS)]
    if lengths:
        shown = (f"{next(iter(numeric[length]))} ({length})" for length in sorted([longest, *lengths]))
        raise LogError(Finding(file=file, found=f"arrays such as {', '.join(shown)}", allowed=_ALLOWED))
    shared = os.path.commonprefix([*numeric[longest]]).rpartition("/")[0]  # noqa: RUF071 (names, not paths)
    columns = {name.removeprefix(f"{shared}/"): cells for name, cells in numeric[longest].items()}
    return columns, [name for length in numeric if length != longest for name in numeric[length]]


def _arrays(value: Any, name: str) -> Iterator[tuple[str, Sequence[Any]]]:
    """Yield the arrays of a document by name; of pandas also objects with a value for each row."""
    if isinstance(value, list):
        yield name, value
    elif isinstance(value, dict) and isinstance(value.get("columns"), list) and "data" in value:
        yield name, [dict(zip(value["columns"], row, strict=False)) for row in value["data"]]
    elif isinstance(value, dict) and len(value) > 1 and all(map(str.isdigit, value)):
        yield name, list(value.values())
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from _arrays(inner, f"{name}/{key}" if name else key)


def _column(cells: Sequence[str]) -> pa.Array:
    """Return cells as numbers; as texts if they are not numbers, or have more digits than a double."""
    texts = pa.array([cell or None for cell in cells], pa.string())
    if any(len(cell) > _DIGITS and sum(map(str.isdigit, cell.lstrip("-0."))) > _DIGITS for cell in cells):
        return texts
    for kind in (pa.int64(), pa.float64()):
        try:
            return texts.cast(kind)
        except pa.ArrowInvalid:
            continue
    return texts
