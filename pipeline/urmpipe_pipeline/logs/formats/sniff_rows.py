"""Rows that are no plain cells: values after labels, arrays in cells, rows that name their joints.

1. `sniff_labels`: `Time: 0.015  q values: [0.1, 0.2]  mode=3`, as KUKA's FRI examples and consoles write. The
   labels are learnt from the first rows: all of them have the same ones, in the same order. An array
   may precede the first label.
2. `sniff_arrays`: cells that are str of a NumPy array or a list, over several lines as well, or numbers in
   quotes. A number replaces each array while the other cells are understood.
3. `name_echoed_columns`: `ros2 topic echo --csv /joint_states`, a table without header.
   Source: rosidl_runtime_py, message_to_csv: the fields of sensor_msgs/JointState in order (seconds,
   nanoseconds, frame, names, positions, velocities, efforts), arrays spread over cells, an empty one as one.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import dropwhile, islice, pairwise, takewhile
from operator import not_

from urmpipe_models.errors import Finding, LogError
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.cells import is_missing, is_number, is_text, printable
from urmpipe_pipeline.logs.formats.log_table import MAX_SAMPLED_ROWS
from urmpipe_pipeline.logs.formats.row_form import (
    CLOSING,
    RowForm,
    numbers_in,
    quoted_lengths,
    spread_names,
    usual_length,
    with_brackets,
)
from urmpipe_pipeline.logs.formats.sniff import sniff
from urmpipe_pipeline.logs.formats.text import HeadLine, Segment, head_lines
from urmpipe_pipeline.logs.formats.text_table import TextTable
from urmpipe_pipeline.logs.vocabulary import key, vocabulary

MIN_LABELS = 2  # a line with one label may be anything, unless an array follows it
UNLABELLED = "array"  # the name of an array before the first label

_ARRAY = r"\[[^\[\]]*\]|\([^()]*\)|\{[^{}:]*\}"
_NUMBER = r"[-+]?(?:\d+(?:[.,]\d*)?|\.\d+)(?:[eE][-+]?\d+)?(?![\w.:]|\s*[:=])"
_WORD = r"\"[^\"]*\"|[^\s,;|\[\](){}\"]+"
_PAIR = re.compile(
    rf"""(?P<before>[\s,;|{{]*+["']?[^\W\d][^:=\[\](){{}}"',;|]{{0,200}}?["']?)
    (?: \s*+[:=]\s*+(?P<signed>{_ARRAY}|{_NUMBER}|{_WORD})
      | \s*+(?P<array>{_ARRAY})
      | \s++(?P<number>{_NUMBER})
      | (?P<glued>[-+]?\d+\.\d+(?![\w.:]|\s*[:=])) )""",
    re.VERBOSE,
)
_FIRST = re.compile(rf"\s*+({_ARRAY})(?=\s*+[,;|])")
_TAIL = re.compile(r"[\s,;}]*\Z")
_AROUND_NAME = re.compile(r"""[\s{},;|"':=]+|\b(?i:values?)\b""")


def sniff_labels(segment: Segment) -> TextTable | None:
    """Return a log with labels in its rows as a table of plain cells; None if it has none."""
    lines = list(islice(head_lines(segment), MAX_SAMPLED_ROWS))
    groups_of_lines: dict[tuple[tuple[str, ...], str], list[HeadLine]] = {}
    for line in lines:
        if (labels_and_tail := _split_labels(line.text)) is not None:
            groups_of_lines.setdefault(labels_and_tail, []).append(line)
    labelled = sum(map(len, groups_of_lines.values()))
    (labels, tail), rows = max(groups_of_lines.items(), key=lambda item: len(item[1]), default=(((), ""), []))
    if not rows or 2 * labelled < len(lines) or 2 * len(rows) < labelled:
        return None
    opening = next((sign for sign in CLOSING if all(sign in row.text for row in rows)), "")
    names = tuple(_AROUND_NAME.sub(" ", label).strip() or UNLABELLED for label in labels)
    form = RowForm(names, (0,) * len(names), ";", opening=opening, labels=labels, tail=tail)
    values = form.read_values(row.text for row in rows)
    lengths = tuple(usual_length(row[k] for row in values) for k in range(len(names)))
    plain = [value for row in values for value in row if isinstance(value, str)]
    decimal = "," if any(is_number(cell, ",") and not is_number(cell, ".") for cell in plain) else "."
    form = replace(form, lengths=lengths, decimal=decimal, opening=opening if any(lengths) else "")
    sample = form.read_cells(form.read_values(row.text for row in rows))
    if not sample or not any(is_number(cell, decimal) for cell in sample[0]):
        return None
    some = min(MIN_LABELS, len(labels))
    torn = (line for line in lines if not line.is_comment and form.count_labels(line.text) >= some)
    first = next(torn, rows[0])  # a torn row may be the first, with some of the labels
    shown = " ".join(label.strip(",;{ ") for label in labels)
    spread = tuple(spread_names(names, lengths))
    is_named = len(labels) > 1 or any(vocabulary().is_column(key(name)) for name in spread)
    return TextTable(
        segment=segment,
        delimiter=form.delimiter,
        decimal=decimal,
        names=spread if is_named else tuple(str(k + 1) for k in range(len(spread))),
        header=first.number if is_named else None,
        first_line=first.number,
        offset=first.offset,
        sample=sample,
        inferences=(Inference("labels", shown, "they come before the values of every row"),),
        form=form,
    )


def _split_labels(text: str) -> tuple[tuple[str, ...], str] | None:
    """Return the label before each value of a line, and the text after the last; None without labels."""
    first = _FIRST.match(text)
    labels, place = ([""], first.end()) if first else (list[str](), 0)
    while match := _PAIR.match(text, place):
        start = next(match.start(group) for group in ("signed", "array", "number", "glued") if match[group])
        labels.append(text[place:start].strip())
        place = match.end()
    tail = _TAIL.match(text, place)
    has_sign = any(label.endswith((":", "=")) for label in labels)
    is_array = len(labels) == 1 and text[place - 1] in CLOSING.values()
    if tail is None or not has_sign or (len(labels) < MIN_LABELS and not is_array):
        return None
    return tuple(labels), tail[0].strip()


_STAND_IN = "7"  # a number in the place of an array
_STARTS = {
    opening: re.compile(rf'(?:^|[,;|\t ])"?{re.escape(opening)}+\s*(?:[-+.\d]|nan|\w+\.)', re.IGNORECASE)
    for opening in CLOSING
}
_COMMAS = re.compile(r"\d,\d")
_OTHER_SEPARATORS = re.compile(r"\d(?:\s+|\s*;\s*)[-+.\d]")


def sniff_arrays(
    segment: Segment, delimiter: str | None = None, decimal: str | None = None, *, by_number: bool = False
) -> TextTable | None:
    """Return a table with arrays in its cells as one of plain cells; None if it has none.

    A column NAME of arrays becomes NAME_1, NAME_2, ...

    Raises:
        LogError: As `sniff`, or if the arrays have decimal commas.
        OptionError: As `sniff`.
    """
    lines = list(head_lines(segment)) if any(sign in segment.head for sign in (*CLOSING, '"')) else []
    in_quotes = {*dropwhile(not_, (quoted_lengths(line.text) for line in lines))}
    quoted = len(in_quotes) == 1  # of several lengths they are texts
    plain = [replace(line, text=with_brackets(line.text)) for line in lines] if quoted else lines
    opening = next((sign for sign in CLOSING if _begin_cells(plain, sign)), None)
    if opening is None:
        return None
    # a line with an open bracket continues in the next one, if that begins with a blank
    continued = any(
        line.text.count(opening) > line.text.count(CLOSING[opening]) and after.text.startswith((" ", "\t"))
        for line, after in pairwise(plain)
    )
    form = RowForm((), (), ",", opening=opening, continued=continued, quoted=quoted)
    places = {line.number: line.offset for line in lines}
    numbered = form.rows((line.number, line.text) for line in lines)
    rows = [HeadLine(number, places[number], text) for number, text in numbered]
    if continued and segment.has_more and len(rows) > 1:
        rows.pop()  # the head may end within it

    def stand_in(array: str) -> str:
        cells = numbers_in(array)
        is_numeric = any(is_number(cell, ".") for cell in cells) and all(
            is_number(cell, ".") or is_missing(cell) for cell in cells
        )
        return _STAND_IN if is_numeric or "'" in array else array

    plain = [replace(row, text=form.replace_arrays(row.text, stand_in)) for row in rows]
    outer = sniff(segment, delimiter, decimal, plain, by_number=by_number)
    form = replace(form, delimiter=outer.delimiter, decimal=outer.decimal, names=outer.names)
    body = [row for row in rows if row.number >= outer.first_line and not row.is_comment]
    values = form.read_values(row.text for row in body)
    lengths = tuple(usual_length(row[k] for row in values) for k in range(len(outer.names)))
    if not any(lengths):
        return None
    for row in rows:
        for array in form.arrays(row.text):
            if _COMMAS.search(array) and _OTHER_SEPARATORS.search(array):
                allowed = "allowed: arrays whose numbers have decimal points"
                raise LogError(Finding(f"found {array.strip()[:40]!r}, {allowed}", outer.file, row.number))
    return _spread_columns(outer, replace(form, lengths=lengths), values)


def _begin_cells(lines: Sequence[HeadLine], opening: str) -> bool:
    """Return whether every second line or more has a cell that begins with a bracket and a number.

    Lines that begin with a blank may continue an array that began above.
    """
    count = sum(opening in line.text and bool(_STARTS[opening].search(line.text)) for line in lines)
    rows = sum(not line.text.startswith((" ", "\t")) for line in lines[1:])
    return count > 0 and 2 * count >= rows


def _spread_columns(outer: TextTable, form: RowForm, values: Sequence[list[str | list[str]]]) -> TextTable:
    names = tuple(spread_names(outer.names, form.lengths))
    if outer.header is None:
        names = tuple(str(k + 1) if name else "" for k, name in enumerate(names))
    units = [*outer.units, *("" for _ in range(len(outer.names) - len(outer.units)))] if outer.units else []
    pairs = zip(outer.names, form.lengths, strict=True)
    arrays = ", ".join(f"{name or k + 1} ({n})" for k, (name, n) in enumerate(pairs) if n)
    inference = Inference("arrays", arrays, "their cells hold as many numbers in brackets")
    return replace(
        outer,
        names=names,
        units=tuple(unit for unit, n in zip(units, form.lengths, strict=False) for _ in range(n or 1)),
        sample=form.read_cells(values),
        inferences=(*outer.inferences, inference),
        form=form,
    )


_FIRST_NAME = 3  # cells before the names: seconds, nanoseconds, frame


def name_echoed_columns(table: TextTable) -> TextTable:
    """Return a table with names for its columns if most rows name joints after a stamp, else as it is.

    Raises:
        LogError: If one file has rows of several publishers, each with its joints.
    """
    if table.header is not None:
        return table
    names_in_rows = [_names_in(row, table.decimal) for row in table.sample]
    usual = max(filter(None, names_in_rows), key=names_in_rows.count, default=())
    for row, names in enumerate(names_in_rows, start=1):
        if names and names[: len(usual)] != usual:  # a text where a number belongs is no publisher
            listed, known = (", ".join(map(printable, joints)) for joints in (names, usual))
            message = f"found a row with the joints {listed} among rows with {known}, allowed: one publisher"
            line = table.lines_of([row]).get(row)
            raise LogError(Finding(f"{message}; keep the rows of one of them", table.file, line, row))
    joints = tuple(map(printable, usual))
    is_usual = 2 * names_in_rows.count(usual) > len(names_in_rows)
    if not joints or len(set(joints)) < len(joints) or not is_usual:
        return table
    count, cells = len(joints), table.sample[names_in_rows.index(usual)]
    velocity = _FIRST_NAME + 2 * count
    has_rates = cells[velocity : velocity + 1] != ("",)
    filled = {
        2 * count: (True, True, True),
        count + 1: (True, has_rates, not has_rates),
        2: (True, False, False),
    }.get(len(cells) - velocity)
    if filled is None:
        return table
    columns = ["sec", "nanosec", "frame_id", *(f"name.{joint}" for joint in joints)]
    for group, is_filled in zip(("position", "velocity", "effort"), filled, strict=True):
        columns += [f"{group}.{joint}" for joint in joints] if is_filled else [f"{group}."]
    why = "seconds, nanoseconds and names of joints, as ros2 topic echo writes"
    further = tuple(inference for inference in table.inferences if inference.what != "header")
    inferences = (*further, Inference("header", "none", why))
    return replace(table, names=tuple(columns), header=table.first_line, inferences=inferences)


def _names_in(row: Sequence[str], decimal: str) -> tuple[str, ...]:
    """Return the texts after a stamp, empty if the row does not begin with one."""
    if len(row) < _FIRST_NAME + 4 or not (row[0].isdecimal() and row[1].isdecimal() and int(row[1]) < 10**9):
        return ()
    return tuple(takewhile(lambda cell: is_text(cell, decimal), row[_FIRST_NAME:]))
