"""JSON and YAML: an object a line, documents between ---, an array of objects or arrays, an object of arrays.

    {"t": 0.1, "arm": {"q": [0.2, 0.3]}}                 t, arm/q[0], arm/q[1]
    name: [elbow, wrist]  position: [0.2, 0.3]  ---      position.elbow, position.wrist

Numbers are read from their text, so that they have the same values as in a CSV file.

1. `sniff_records`: JSON lines, and messages as `rostopic echo` prints them, become text with tabs and the
   same line numbers. What is damaged is a row that cannot be read.
2. `read_document`: any other document, or a printed array, becomes a table in memory, and messages name its
   rows. Samples under names that count are in the order of their numbers. The forms that pandas writes are
   known; of arrays of several lengths, or episodes, the user chooses (`array_choice`).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from itertools import chain, islice
from typing import Any

import numpy as np

from urmpipe_models.errors import Finding, LogError
from urmpipe_models.files import log_stem
from urmpipe_pipeline.array_choice import Name, choose_arrays
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.arrays import Array, make_array_table, settle_choice
from urmpipe_pipeline.logs.formats.cells import find_numbers, is_number, printable
from urmpipe_pipeline.logs.formats.files import import_optional
from urmpipe_pipeline.logs.formats.log_table import MAX_SAMPLED_ROWS
from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.formats.text import Segment, check_width, head_lines, text_segment
from urmpipe_pipeline.logs.formats.text_table import TextTable
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.vocabulary import key, vocabulary

MAX_DIGITS = 17  # decimal digits of a double

_SEPARATORS = str.maketrans('\t\r\n"', "   '")  # would end a cell or a line of text with tabs
_DECODER = json.JSONDecoder(parse_float=str, parse_int=str, parse_constant=str)
_BEGINNING = re.compile(r'\s*(?:\[\s*(?:[\[{]|$)|\{\s*")')
# An array as Python, NumPy or PyTorch prints it, or assigns it to a variable: q = np.array([[0., 1.], [...]])
_PRINTED = re.compile(r"\s*(?:\w+ *= *)?(?:(?:\w+\.)?(?:array|tensor)\()?(?=\[\s*\[)")
_CALLED = re.compile(r"\s*(?:\w+ *= *)?(?:\w+\.)?(?:array|tensor)\(\[")  # surely no other text
_PRINTED_END = re.compile(r"\](?:,\s*\w+='?[\w.:]+'?)*,?\s*\)?\s*\Z")  # ], dtype=float32)
_LAST_COMMA = re.compile(r",\s*\]")
_BLANK = re.compile(r"(?<=[\d.\]nf])\s+(?=[-+.\d\[ni])")  # between numbers or rows that no comma parts
_POINT = re.compile(r"(?<=\d)\.(?!\d)")  # of 1., which JSON has not
_DOCUMENT = re.compile(r"\s*(?:\[\s*\{|[\[{]\r?\n)")  # no other text begins so
_YAML_LINE = re.compile(r"\s*+(?:-(?: .*)?|[\w./~]++:(?: .*)?|.*---|-?[\d.][^:]*|[^:]*\],?|#.*)")
_YAML_NEXT = re.compile(r"^( *+)(?:- )*[\w./~]++: *+\n(?:\1 +\S| *- )", re.MULTILINE)  # a key above its value
_COUNTED = re.compile(r"[^\d.]*\d+")  # names of samples that count: p1, p2; not 0.05, 0.1
_ENTRY = re.compile(r"(?P<stem>[^\[\]]*)\[\d+\]")  # of an array
_ALIAS = re.compile(r"(?:[-:] |^)[*&]\w", re.MULTILINE)
MIN_YAML = 0.9  # share of lines: a message of the program that prints may be among them
MAX_SAMPLE = 9  # numbers of an array: joints, or a position and a quaternion; more are rows of a column
_BETWEEN = "---"  # documents of YAML
_NOTE = re.compile(r"A message was lost")  # what `ros2 topic echo` prints between messages
_NAMES = ("joint_names", "names", "name")  # keys of the names of the values of other arrays
_UNIT_LAST = re.compile(r"(.*\S)\s*[\[(]([^\[\]()\d]+)[\])]")

Record = dict[str, str]


def sniff_records(segment: Segment) -> TextTable | None:
    """Return how JSON lines or documents of YAML are written, as rows of plain cells; None of other text.

    Raises:
        LogError: If there are too many columns, or PyYAML is not installed.
    """
    if _is_json_lines(segment):
        records, inference = _iter_lines(segment), Inference("JSON", "an object a line", "each line is one")
    elif _is_yaml(segment) and _has_documents(segment):
        records = _iter_documents(segment)
        inference = Inference("YAML", "a document a row", f"{_BETWEEN} separates them")
    else:
        return None
    names: dict[str, None] = {}
    usual: list[str] = []
    rows: list[tuple[str, int, int]] = []  # with the number of columns known so far, and of lines
    for text, count, record in records:
        if record is None:
            rows.append((text.translate(_SEPARATORS).strip(), 0, count))
            continue
        if record.keys() != names.keys():
            names |= dict.fromkeys(record)
            check_width(len(names), str(segment.path))
            usual = [*names]
        is_usual = [*record] == usual
        row = "\t".join(record.values() if is_usual else [record.get(name, "") for name in names])
        if '"' in row or "\n" in row or "\r" in row or row.count("\t") >= len(names):
            row = "\t".join([record.get(name, "").translate(_SEPARATORS) for name in names])
        rows.append((row, len(names), count))
    lines = [(row + "\t" * (len(names) - width) if width else row, count) for row, width, count in rows]
    sample = (row.split("\t") for row, _ in lines[:MAX_SAMPLED_ROWS])
    text = "".join(row + "\n" * count for row, count in lines)
    named, counted = not _only_indices(names), tuple(str(k + 1) for k in range(len(names)))
    return TextTable(
        segment=text_segment(segment.path, text, "\t", ()),
        delimiter="\t",
        decimal=".",
        names=tuple(printable(name.translate(_SEPARATORS)) for name in names) if named else counted,
        units=(),
        header=1 if named else None,
        first_line=1,
        offset=0,
        sample=tuple(tuple(row) for row in sample if len(row) == len(names)),
        inferences=(inference,),
    )


def _iter_lines(segment: Segment) -> Iterator[tuple[str, int, Record | None]]:
    """Yield each line, how many they are, and its record; None of a line that is damaged."""
    for _, line in segment.lines():
        yield line, 1, _read_record(line)


def _iter_documents(segment: Segment) -> Iterator[tuple[str, int, Record | None]]:
    """Yield each document of YAML as `_iter_lines` does, with the line that ends it."""
    lines = list[str]()
    for line in chain((line for _, line in segment.lines()), (_BETWEEN,)):
        if not line.rstrip().endswith(_BETWEEN):
            lines.append(line)
            continue
        record, text = None, "\n".join([*lines, line.rstrip().removesuffix(_BETWEEN)]).strip()
        if _NOTE.match(text):
            text = ""
        with suppress(ValueError, RecursionError):
            value = _read_yaml(segment, text)
            record = _add_cells(value, "", {}) if isinstance(value, dict | list) else None
        yield text, len(lines) + 1, record
        lines = []


def read_document(segment: Segment, options: LogMap) -> MemoryTable | None:
    """Return the table of a document of JSON or YAML; None if the text is something else, or has many.

    Raises:
        LogError: If it is damaged or holds no arrays of numbers; with a question if they have several
            lengths, or are those of several episodes.
    """
    is_json = _BEGINNING.match(segment.head) or _PRINTED.match(segment.head)
    form = "JSON" if is_json else "YAML" if _is_yaml(segment) else ""
    if not form or _is_json_lines(segment) or (form == "YAML" and _has_documents(segment)):
        return None
    file, text = str(segment.path), segment.text()
    try:
        document = _read_yaml(segment, text) if form == "YAML" else _decode(text)
    except (ValueError, RecursionError) as error:
        is_lone = "\n" not in text.strip()
        if form == "JSON" and not (
            is_lone or _DOCUMENT.match(text) or _CALLED.match(text) or segment.path.suffix.lower() == ".json"
        ):
            return None
        reason, line = str(error), None
        if isinstance(error, json.JSONDecodeError):
            reason, line = error.msg, error.lineno
        fault = f"{form} that is damaged or cut ({reason})"
        raise LogError(Finding(file=file, line=line, found=fault, allowed="a whole document")) from None
    arrays = dict[Name, dict[str, list[str]]]()
    for path, array, joints in _iter_arrays(document, ()):
        columns = _columns("/".join(path), array, joints, file)
        if any(is_number(cell, ".") for cells in columns.values() for cell in cells):
            arrays[path] = columns
    if not arrays:
        allowed = "an array of objects, or arrays of one length"
        raise LogError(Finding(file=file, found=f"{form} without an array of numbers", allowed=allowed))
    shapes = {path: (len(next(iter(columns.values()))),) for path, columns in arrays.items()}
    read = choose_arrays(shapes, options.episode, options.topic, separator="/", by_rows=True)
    choice = settle_choice(segment.path, read)
    columns = {name: cells for path in choice.names or arrays for name, cells in arrays[path].items()}
    named = not _only_indices(columns)
    if not named and not any(is_number(cells[0], ".") for cells in columns.values()):
        columns = {cells[0]: cells[1:] for cells in columns.values()}  # names in the first row
        named = True
    values = ((tuple(name.split("/")), "", _column(cells)) for name, cells in columns.items())
    entries = document.items() if isinstance(document, dict) else ()
    scalars = {
        name: float(value) for name, value in entries if isinstance(value, str) and is_number(value, ".")
    }
    unused = [name for path in choice.left_out for name in arrays[path]] if choice.names else []
    table = make_array_table(segment.path, choice, values, scalars, "/", options, unused, is_named=named)
    inferences = (Inference(form, "a document", "its beginning"), *table.inferences)
    return replace(table, name=log_stem(segment.path), inferences=inferences)


def _decode(text: str) -> Any:
    """Return a document of JSON, or an array as a program prints it, its numbers as texts.

    Raises:
        JSONDecodeError: If it is damaged.
    """
    with suppress(ValueError):
        return _DECODER.decode(text)
    if match := _PRINTED.match(text):
        text = _LAST_COMMA.sub("]", _PRINTED_END.sub("]", text[match.end() :]))
        text = _POINT.sub(".0", _BLANK.sub(",", text)).replace("nan", "NaN").replace("inf", "Infinity")
    return _DECODER.decode(text)


def _is_json_lines(segment: Segment) -> bool:
    """Return whether each sampled line begins as an object, and at least half of the lines are objects."""
    lines = [line.text for line in islice(head_lines(segment), MAX_SAMPLED_ROWS)]
    objects = [line.lstrip().startswith("{") for line in lines]
    return len(lines) > 1 and all(objects) and 2 * sum(map(bool, map(_read_record, lines))) >= len(lines)


def _is_yaml(segment: Segment) -> bool:
    """Return whether nearly all lines are those of YAML, with documents or a key above its value."""
    lines = [line.text.rstrip() for line in islice(head_lines(segment), MAX_SAMPLED_ROWS)]
    head = "\n".join(lines)
    keys = sum(bool(_YAML_LINE.fullmatch(line)) for line in lines)
    is_nested = bool(_YAML_NEXT.search(head)) or _BETWEEN in lines
    return keys >= MIN_YAML * len(lines) and is_nested and any("[" in line or ":" in line for line in lines)


def _has_documents(segment: Segment) -> bool:
    """Return whether the head of YAML has a line between documents, after its first line."""
    return any(line.text.rstrip().endswith(_BETWEEN) for line in islice(head_lines(segment), 1, None))


def _read_yaml(segment: Segment, text: str) -> Any:
    """Return a document of YAML, its scalars as texts.

    Raises:
        JSONDecodeError: If it is damaged.
    """
    yaml = import_optional("yaml", segment.path, "YAML")
    if match := _ALIAS.search(text):  # a few of them can stand for millions of values
        raise json.JSONDecodeError("an alias", text, match.start())
    try:
        return yaml.load(text, Loader=yaml.CBaseLoader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        reason = getattr(error, "problem", None) or str(error)
        raise json.JSONDecodeError(reason, text, mark.index if mark else 0) from None


def _read_record(line: str) -> Record | None:
    """Return the cells of an object in a line; None of any other line."""
    try:
        value = _DECODER.decode(line)
    except (ValueError, RecursionError):
        return None
    return _add_cells(value, "", {}) if isinstance(value, dict) else None


def _add_cells(value: Any, name: str, record: Record, joints: Sequence[str] = ()) -> Record:
    """Add the texts of a value to a record and return it.

    Entries of objects are GROUP/NAME, of arrays NAME[0], or NAME.JOINT where an object around them has as
    many names.
    """
    if isinstance(value, str):
        record[name] = value
    elif isinstance(value, dict):
        key_of_names, joints = _find_names(value, joints)
        for key, inner in value.items():
            if key != key_of_names:
                _add_cells(inner, f"{name}/{key}" if name else key, record, joints)
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            entry = f"{name}.{joints[k]}" if len(value) == len(joints) else _indexed(name, k)
            if isinstance(inner, str):  # most are numbers
                record[entry] = inner
            else:
                _add_cells(inner, entry, record, joints)
    else:
        record[name] = "" if value is None else str(value)
    return record


def _find_names(fields: Mapping[str, Any], known: Sequence[str]) -> tuple[str, Sequence[str]]:
    """Return the key of an object under which it names the values of arrays, and these names."""
    for label in _NAMES:
        names = fields.get(label)
        if isinstance(names, list) and names and all(map(_is_name, names)):
            return label, names
    return "", known


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and not is_number(value, ".")


def _only_indices(names: Iterable[str]) -> bool:
    """Return whether columns are the entries of one array that has no name, or none that a column has."""
    matches = [_ENTRY.fullmatch(name) for name in names]
    stems = {match["stem"] for match in matches if match}
    keys = [key(name) for name in names]
    is_known = stems != {""} and any(
        vocabulary().is_column(name) or any(p.search(name) for p in vocabulary().tcp_pose_vector)
        for name in keys
    )
    return all(matches) and len(stems) == 1 and not is_known


@lru_cache(1 << 14)
def _indexed(name: str, k: int) -> str:
    """Return the name of an entry, before the unit of the array: q [deg] becomes q[0] [deg]."""
    unit = _UNIT_LAST.fullmatch(name)
    return f"{unit[1]}[{k}] [{unit[2]}]" if unit else f"{name}[{k}]"


def _iter_arrays(
    value: Any, name: Name, joints: Sequence[str] = ()
) -> Iterator[tuple[Name, Sequence[Any], Sequence[str]]]:
    """Yield the arrays of a document by name, with the names of joints around each.

    They are also objects with a value for each row, as pandas writes, or with a sample under each name.
    Numbers that name whole tables are those of episodes.
    """
    if isinstance(value, list):
        yield name, value, joints
    elif isinstance(value, dict) and isinstance(value.get("columns"), list) and "data" in value:
        yield name, [dict(zip(value["columns"], row, strict=False)) for row in value["data"]], joints
    elif isinstance(value, dict) and len(value) > 1 and all(map(str.isdigit, value)):
        tables = {key: inner for key, inner in value.items() if _is_table(inner)}
        if not tables:
            yield name, list(value.values()), joints
        for key, inner in tables.items():
            yield (*name, key, ""), inner, joints
    elif isinstance(value, dict) and _are_samples(value):
        numbers = find_numbers([*value]) if all(map(_COUNTED.fullmatch, value)) else None
        order = np.argsort(numbers, kind="stable").tolist() if numbers else range(len(value))
        samples = list(value.values())
        yield name, [samples[k] for k in order], joints
    elif isinstance(value, dict):
        key_of_names, joints = _find_names(value, joints)
        for key, inner in value.items():
            if key != key_of_names:
                yield from _iter_arrays(inner, (*name, key), joints)


def _is_table(value: Any) -> bool:
    """Return whether a value is an array of arrays or objects, of which some may be missing."""
    rows = [row for row in value if row is not None] if isinstance(value, list) else []
    return bool(rows) and all(isinstance(row, list | dict) for row in rows)


def _are_samples(fields: Mapping[str, Any]) -> bool:
    """Return whether an object has a sample under each name: {"home": [0.1, 0.2], "pick": [0.3, 0.4]}.

    They are objects or arrays with short arrays of one length for each name, most with one name at least,
    and none is named like a column.
    """
    are_arrays = all(isinstance(value, list) for value in fields.values())
    if len(fields) < 2 or not (are_arrays or all(isinstance(value, dict) for value in fields.values())):
        return False
    shapes: dict[str, list[int]] = {}
    for value in fields.values():
        for name, length in _iter_shapes(value):
            shapes.setdefault(name, []).append(length)
    is_same = all(len(set(lengths)) == 1 and 0 < lengths[0] <= MAX_SAMPLE for lengths in shapes.values())
    is_usual = any(2 * len(lengths) > len(fields) for lengths in shapes.values())
    names = [name for name in fields if len(name) > 1 or are_arrays]  # A, B of objects are no angles
    return is_same and is_usual and not any(vocabulary().is_column(key(name)) for name in names)


def _iter_shapes(value: Any, name: str = "") -> Iterator[tuple[str, int]]:
    """Yield name and length of the arrays in a value, 0 of one with other arrays, 1 of a number."""
    if isinstance(value, list) and not (value and all(map(_is_name, value))):
        yield name, len(value) if all(isinstance(entry, str) for entry in value) else 0
    elif isinstance(value, str) and is_number(value, "."):
        yield name, 1
    elif isinstance(value, dict):
        for inner in value:
            yield from _iter_shapes(value[inner], f"{name}/{inner}")


def _columns(name: str, array: Sequence[Any], joints: Sequence[str], file: str) -> dict[str, list[str]]:
    """Return the cells of the entries of an array by name."""
    records = [_add_cells(entry, name, {}, joints) for entry in array]
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
