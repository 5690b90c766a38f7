"""How a table is written: delimiter, decimal sign, header, units, first row. Never from the locale.

1. Style: the delimiter and decimal sign that make rows of one width, most of whose text is numbers.
2. Data: the first row with numbers where most rows have them.
3. Header: the last line of names above it, with a line of units and the groups over repeated names.
4. Names: one for every cell of a row, also with an unnamed index or a trailing delimiter.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby, islice, pairwise
from typing import NamedTuple

from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.cells import (
    DECIMALS,
    DELIMITERS,
    SPACE,
    count_numbers,
    count_up,
    is_missing,
    is_number,
    is_text,
    printable,
    split_line,
    to_float,
)
from urmpipe_pipeline.logs.formats.clock_forms import is_clock_text
from urmpipe_pipeline.logs.formats.log_table import MAX_SAMPLED_ROWS, USUAL_COUNTS, LogTable, capped
from urmpipe_pipeline.logs.formats.text import MIN_LINES, HeadLine, Segment, head_lines
from urmpipe_pipeline.logs.formats.text_table import TextTable
from urmpipe_pipeline.logs.vocabulary import vocabulary
from urmpipe_pipeline.text import strip_apostrophe

MIN_FIT = 0.2  # a delimiter that fits less is not believed because it makes several columns
FEW = 0.25  # share of the rows that may be damaged where the others show how the table is written
STYLE_LINES = 60  # lines that decide on the delimiter
MAX_COUNT_DIGITS = 9  # of the number of a row: no table has a billion rows
GIVEN = "given as an option"

_STATED_DELIMITER = re.compile(r'"?sep=([,;|\t])"?', re.IGNORECASE)  # the first line that Excel writes
_NAMES = {",": "comma", ";": "semicolon", "\t": "tab", SPACE: "spaces", "|": "bar", ".": "point"}
_SIGNS = {name: sign for sign, name in _NAMES.items()} | {"\\t": "\t", "space": SPACE, "pipe": "|"}

Row = list[str]


class _Style(NamedTuple):
    """Delimiter and decimal sign, the width of most rows with them, and how well they fit, 0..1."""

    delimiter: str
    decimal: str
    width: int = 0
    fit: float = 0.0

    @property
    def credit(self) -> tuple[bool, float]:
        return self.width > 1 and self.fit >= MIN_FIT, self.fit


def sniff(
    segment: Segment,
    delimiter: str | None = None,
    decimal: str | None = None,
    lines: Sequence[HeadLine] | None = None,
    *,
    by_number: bool = False,
) -> TextTable:
    """Return a table by how it is written.

    Args:
        segment: The table's text.
        delimiter: The sign between cells, or its name, if the file need not show it.
        decimal: The decimal sign, or its name, if the file need not show it.
        lines: The lines of its head with a plain cell for each array, if it holds arrays.
        by_number: Whether a header that does not fit the rows is left out: the user numbers the columns.

    Raises:
        LogError: If it holds no numbers, no rows, or a header that does not fit its rows.
        OptionError: If delimiter or decimal is not allowed.
    """
    lines = list(head_lines(segment)) if lines is None else lines
    match = _STATED_DELIMITER.fullmatch(lines[0].text.rstrip("\r\n ")) if lines else None
    stated, lines = (match[1], lines[1:]) if match else (None, lines)
    delimiters = _signs("delimiter", delimiter or stated, DELIMITERS)
    decimals = _signs("decimal", decimal, DECIMALS)
    body = [line for line in lines if not line.is_comment][:MAX_SAMPLED_ROWS]
    style = _best_style([line.text for line in body[:STYLE_LINES]], delimiters, decimals)
    rows = [split_line(line.text, style.delimiter) for line in body]
    width = _common_width(rows, style.decimal)
    first = _first_data_row(body, rows, width, style)
    if first is None:
        options = {"delimiter": delimiter, "decimal sign": decimal}
        raise LogError(_no_rows(segment, body, {what: sign for what, sign in options.items() if sign}))
    widths = [len(row) for row in rows[first:]]
    if 2 * widths.count(width) < len(widths):
        text = body[first].text.strip()[:60]
        message = f"found {text!r} and lines of {min(widths)} to {max(widths)} cells, allowed: a table"
        raise LogError(Finding(message, file=str(segment.path), line=body[first].number))
    above = [line for line in lines if line.number < body[first].number]
    header, units = _find_header(above, style.delimiter, width)
    names, inference = _name_cells(segment, header, body[first:], rows[first:], width, by_number=by_number)
    if header and only_count(names):
        if len(header[1]) == len(names):
            inference = Inference("header", f"line {header[0]}", "its names only count: columns by number")
        if all(name.isdigit() for name in names if name):
            names = tuple(str(k + 1) if name else "" for k, name in enumerate(names))  # users count from 1
        header = None
    by_rows = "the first line says so" if stated else f"it makes rows of {style.width} cells"
    why = GIVEN if delimiter else by_rows
    reads = GIVEN if decimal else "with it most cells are numbers"
    inferences = [
        Inference("delimiter", _NAMES[style.delimiter], why, hints=(Hint("delimiter"),), basis="named"),
        Inference("decimal sign", _NAMES[style.decimal], reads, hints=(Hint("decimal"),), basis="named"),
        inference,
    ]
    return TextTable(
        segment=segment,
        delimiter=style.delimiter,
        decimal=style.decimal,
        names=names,
        units=tuple(units),
        header=header[0] if header else None,
        first_line=body[first].number,
        offset=body[first].offset,
        sample=tuple(tuple(row) for row in rows[first:]),
        inferences=tuple(inferences[bool(segment.delimiter) :]),
    )


def across(table: LogTable) -> LogTable:
    """Return a text of a single line of numbers as one column; any other table as it is."""
    is_line = table.header is None and len(table.sample) == 1 and len(table.names) > 2
    if not isinstance(table, TextTable) or not is_line:
        return table
    if any(line.strip() for number, line in table.segment.lines() if number > table.first_line):
        return table
    cells = table.sample[0][: -1 if table.segment.has_more else None]  # of a longer line the last one is cut
    sample = tuple((cell,) for cell in cells[:MAX_SAMPLED_ROWS])
    return replace(table, names=("1",), sample=sample, across=True)


def only_count(names: Sequence[str]) -> bool:
    """Return whether names are nothing but numbers of columns: 0, 1, 2 of pandas, Var1, Var2."""
    matches = [_COUNTED.fullmatch(name) for name in names if name]
    if len(matches) < 3 or not all(matches):
        return False
    parts = [(match["stem"], int(match["n"])) for match in matches if match]
    return len({stem for stem, _ in parts}) == 1 and all(b == a + 1 for (_, a), (_, b) in pairwise(parts))


_COUNTED = re.compile(
    r"(?P<stem>(Var|V|f|X|[Cc]ol(umn)?|[Ff]ield|[Cc]h(annel)?|data|ans|arr|Unnamed:)?[ _.]*)(?P<n>\d+)"
)  # what pandas, MATLAB, R and NumPy call columns that nobody named


def _signs(parameter: str, chosen: str | None, allowed: Sequence[str]) -> Sequence[str]:
    """Return the signs to try: the one given by the user, or all."""
    if chosen is None:
        return allowed
    sign = _SIGNS.get(chosen.lower(), chosen)
    if sign not in allowed:
        names = ", ".join(_NAMES[sign] for sign in allowed)
        fault = format_value(chosen)
        raise OptionError(
            Finding(parameter=parameter, found=fault, allowed=f"{names}, or the character itself")
        )
    return (sign,)


def _best_style(lines: Sequence[str], delimiters: Sequence[str], decimals: Sequence[str]) -> _Style:
    """Return the style that fits best; of equals, the first.

    A single column is believed only where no delimiter makes more: 0,1 is two numbers before it is 0.1.
    Spaces are not taken in place of tabs where they only part texts and make no more numbers.
    """
    best = _Style(delimiters[0], decimals[0])
    best_rows: list[Row] = []
    for delimiter in delimiters:
        rows = [split_line(line, delimiter) for line in lines]
        if best.credit[0] and all(len(row) < 2 for row in rows):
            continue
        for decimal in decimals:
            width = _common_width(rows, decimal)
            style = _Style(delimiter, decimal, width, _fit(rows, width, decimal))
            if style.credit <= best.credit:
                continue
            if best.credit[0] and (best.delimiter, delimiter) == ("\t", SPACE):
                with_spaces = sum(count_numbers(row, decimal) for row in rows)
                if with_spaces <= sum(count_numbers(row, best.decimal) for row in best_rows):
                    continue
            best, best_rows = style, rows
        if best.width > 1 and best.fit == 1.0:
            break
    return best


def _fit(rows: Sequence[Row], width: int, decimal: str) -> float:
    """Return the share of rows of one width with numbers, times the share of their text that is numbers.

    A date or a time counts as a number: 0.005 sec and 2021-04-11 22:27:21 are one cell.
    """
    full = [row for row in rows if len(row) == width and count_numbers(row, decimal)]
    cells = [cell for row in full for cell in row if not is_missing(cell)]
    numbers = sum(len(cell) for cell in cells if is_number(cell, decimal) or is_clock_text(cell))
    return len(full) / len(rows) * numbers / sum(map(len, cells)) if full else 0.0


def _common_width(rows: Sequence[Row], decimal: str) -> int:
    """Return the width of most rows, each counted as often as it has numbers."""
    widths: Counter[int] = Counter()
    for row in rows:
        widths[len(row)] += count_numbers(row, decimal)
    return widths.most_common(1)[0][0] if widths else 0


def _first_data_row(body: Sequence[HeadLine], rows: Sequence[Row], width: int, style: _Style) -> int | None:
    """Return the index of the first row of data: at least half of it, where numbers belong, are numbers.

    Of a row that is mostly empty, such as Rate,500,,,,, above a header, all must be. Numbers belong into the
    columns in which at least half of the cells with content are numbers.
    """
    full = [row for row in rows if len(row) == width]
    columns = [[row[k] for row in full if not is_missing(row[k])] for k in range(width)]
    counts = [count_numbers(cells, style.decimal) for cells in columns]
    numeric = [k for k, count in enumerate(counts) if count and 2 * count >= len(columns[k])]

    def is_data(row: Row) -> bool:
        cells = [row[column] for column in numeric if column < len(row)]
        cells = [cell for cell in cells if not is_missing(cell)]
        numbers = [cell for cell in cells if is_number(cell, style.decimal)]
        if 2 * len(cells) < len(numeric) and len(numbers) < len(cells):
            return False
        is_counted = row is rows[0] and _is_counted_header(rows, numbers)
        return bool(numbers) and 2 * len(numbers) >= len(cells) and not is_counted

    data = list(islice((k for k, row in enumerate(rows) if is_data(row)), 2))
    if len(data) > 1 and data[0] > 0 and _counts_below(body[data[0] - 1], rows[data[0]], style.delimiter):
        return data[1]
    return next(iter(data), None)


def _is_counted_header(rows: Sequence[Row], numbers: Sequence[str]) -> bool:
    """Return whether the first row holds the numbers 0, 1, 2, ... that pandas gives unnamed columns.

    pandas writes every float with a decimal point: whole numbers below mean that the row is data itself.
    """
    if len(rows) == 1 or len(numbers) < 3 or not count_up(numbers):
        return False
    texts = len(rows[0]) - len(numbers)
    return texts <= 1 and not any(cell.isdigit() for cell in rows[1][texts:])


def _counts_below(above: HeadLine, row: Sequence[str], delimiter: str) -> bool:
    """Return whether a row of numbers is the second line of a header: it counts up below each group.

    Below q, q, q, qd, qd, qd are 1, 2, 3, 1, 2, 3, as pandas writes columns of two levels.
    """
    groups = _split_header(above.text, delimiter, len(row))
    if len(groups) != len(row):
        return False
    pairs = [(group, name) for group, name in zip(groups, row, strict=True) if name]
    counts = {group: [name for _, name in cells] for group, cells in groupby(pairs, key=lambda pair: pair[0])}
    return bool(counts) and all(
        len(count) > 1 and count_up(count) and not group[-1:].isdigit() for group, count in counts.items()
    )


def _find_header(above: Sequence[HeadLine], delimiter: str, width: int) -> tuple[tuple[int, Row] | None, Row]:
    """Return line and names of the header, and the cells of a line of units between it and the data.

    Where names repeat and the line above has groups that distinguish them, as Position and Velocity do over
    the names of joints, a name is GROUP/NAME.
    """
    units: Row = []
    split = [_split_header(line.text, delimiter, width) for line in above]
    for k in reversed(range(len(above))):
        line, cells = above[k], split[k]
        if abs(len(cells) - width) > 1 and (line.is_comment or len(cells) == 1):
            continue  # a comment or a title
        names = [cell for cell in cells if cell]
        if line.is_comment and 2 * count_numbers(names, ".") >= len(names) and not count_up(names):
            continue  # a row that is left out
        if not units and k > 0 and _are_units(cells, split[:k]):
            units = cells
            continue
        if k and cells[0] and not any(cells[1:]):  # the name of an index alone, below those of the columns
            split[k - 1] = [cells[0], *split[k - 1][1:]]
            continue
        groups = split[k - 1] if k else []
        names = _join_groups(cells, groups)
        if not units and names == cells and len(groups) == len(cells) and _are_units(groups, [cells]):
            units = groups
        return (line.number, [printable(cell) for cell in names]), units
    return None, units


def _join_groups(names: Row, groups: Row) -> Row:
    """Return names with the groups above them, where they repeat and with their groups do not.

    An empty cell has the group before it, as merged cells have, unless groups repeat.
    """
    repeated = [k for k, name in enumerate(names) if name and names.count(name) > 1]
    if len(groups) == len(repeated) and all(groups):  # blanks between them are no cells
        places = dict(zip(repeated, groups, strict=True))
        groups = [places.get(k, "") for k in range(len(names))]
    elif repeated and len(groups) == len(names) - 1 and all(groups) and _begin_as_first(names, ["", *groups]):
        groups = ["", *groups]  # that of the time is blank
    if abs(len(groups) - len(names)) > 1:
        return names
    groups = [*groups, ""][: len(names)]
    joined, last, are_merged = [], "", not _repeat(groups)
    for name, group in zip(names, groups, strict=True):
        last = group or (last if are_merged else "")
        joined.append(f"{last}/{name}" if last and name else name or group)
    return joined if repeated and not _repeat(joined) else names


def _begin_as_first(names: Row, groups: Row) -> bool:
    """Return whether each group with names that repeat begins with the first of these."""
    pairs = list(zip(names, groups, strict=True))
    first = next(name for name in names if names.count(name) > 1)
    starts = {group: name for name, group in reversed(pairs)}
    return all(starts[group] == first for name, group in pairs if names.count(name) > 1)


def _repeat(names: Row) -> bool:
    known = [name for name in names if name]
    return len(set(known)) < len(known)


def _split_header(text: str, delimiter: str, width: int) -> Row:
    """Split a header line, with its own delimiter if only that gives a name per column (numpy.savetxt).

    A comment may have a word and a colon before the names, and a remark in brackets after them.
    """
    if width == 1:
        return _split_over_one_column(text)
    text = text.strip(" " if delimiter == "\t" else None)  # a tab before the first name: an unnamed index
    for comment in ("#", "//", "% "):
        text = text.removeprefix(comment)
    match = _REMARKED.match(text)
    texts = (text, match["names"]) if match else (text,)
    rows = [split_line(names, sign) for names in texts for sign in (delimiter, *DELIMITERS)]
    return next((cells for cells in rows if len(cells) == width), rows[0])


def _split_over_one_column(text: str) -> Row:
    """Split a header line over rows of one cell, which show no sign between cells: by what parts most names.

    A name with its unit after a comma is one name, and so is a comment of several words.
    """
    names = text.strip().lstrip("#%/ ")
    parts = max((split_line(names, sign) for sign in DELIMITERS if sign != SPACE), key=len)
    with_unit = len(parts) == 2 and vocabulary().unit(parts[1]) is not None
    is_comment = names != text.strip() and any(" " in part for part in parts)
    return split_line(names, "\t") if with_unit or is_comment else parts


_REMARKED = re.compile(r"\s*[A-Za-z]+:\s+(?P<names>.*?)\s*(\([^()]*\))?\s*$")
_UNIT = r"(?:[^\])\d]|(?<=[sm^])[23]|1(?=/))*"
_BRACKETED = re.compile(rf"\[{_UNIT}\]|\({_UNIT}\)")  # [rad/s^2], (1/min); else an index


def _are_units(cells: Row, above: Sequence[Row]) -> bool:
    """Return whether a line holds units alone: known ones, or any in brackets below a line of names."""
    words = [cell.strip("[]() ") for cell in cells]
    is_bracketed = all(_BRACKETED.fullmatch(cell.strip()) for cell in cells if cell.strip())
    is_below_names = is_bracketed and any(len(row) == len(cells) for row in above)
    are_known = all(not word or vocabulary().unit(word) for word in words)
    return any(words) and (is_below_names or are_known)


def _name_cells(
    segment: Segment,
    header: tuple[int, Row] | None,
    lines: Sequence[HeadLine],
    rows: Sequence[Row],
    width: int,
    *,
    by_number: bool,
) -> tuple[tuple[str, ...], Inference]:
    """Return a name for every cell of a row; numbers if the header does not fit and the user numbers them."""
    filled = [k for k, row in enumerate(rows) if len(row) == width and row[-1]]
    has_trailing = not filled
    if header is None:
        names = (*(str(k + 1) for k in range(width - has_trailing)), *[""] * has_trailing)
        return names, Inference("header", "none", "the first line is numbers: columns by number")
    line, cells = header[0], [strip_apostrophe(cell) for cell in header[1]]
    last_line = Inference("header", f"line {line}", "the last line of names before the numbers")
    if len(cells) == width:
        return tuple(cells), last_line
    if len(cells) == width + 1 and not cells[-1]:
        return tuple(cells[:-1]), last_line
    if len(cells) == width - 1:
        if has_trailing:
            return (*cells, ""), Inference("header", f"line {line}", "each row ends with a delimiter")
        uncounted = _uncounted_rows(rows, width)
        if not uncounted:
            return ("", *cells), Inference("header", f"line {line}", "the first column is an unnamed index")
        # if few rows keep the others from being understood, each of them is named
        for few, column, allowed in (
            (uncounted, 0, f"a count, as before what line {line} names"),
            (filled, -1, f"no cell after what line {line} names"),
        ):
            if len(few) <= FEW * len(rows):
                file = str(segment.path)
                wrong = [(lines[k].number, format_value(rows[k][column])) for k in few]
                findings = [Finding(file=file, line=n, found=cell, allowed=allowed) for n, cell in wrong]
                raise LogError(*capped(findings, file))
    if by_number:
        inference = Inference("header", f"line {line}", "it does not fit the rows: columns by number")
        return tuple(str(k + 1) for k in range(width)), inference
    number = abs(len(cells) - width)
    remedy = f"{'add' if len(cells) < width else 'remove'} {format_count(number, 'name')}"
    wrong_count = f"found {len(cells)} names over rows of {format_count(width, 'cell')}"
    message = f"{wrong_count}, allowed: one name per column; {remedy}"
    hints = _blocks_by_number(rows, width) if width != 2 * len(cells) else []  # 0,5 is two cells
    raise LogError(Finding(message, file=str(segment.path), line=line, hints=tuple(hints)))


def _blocks_by_number(rows: Sequence[Row], width: int) -> list[Hint]:
    """Return the hints that take columns as the joints by number, after a first one that increases."""
    first = [to_float(row[0], ".") for row in rows if len(row) == width]
    rises = [a is not None and b is not None and a < b for a, b in pairwise(first)]
    start = 2 if rises and all(rises) else 1
    count = width + 1 - start
    counts = [n for n in USUAL_COUNTS if count % n == 0][:2] or [min(count, max(USUAL_COUNTS))]
    effect = "takes these without the names"
    return [Hint("joints", [f"{start}-{start + n - 1}"], effect) for n in counts if 1 < n <= count]


def _uncounted_rows(rows: Sequence[Row], width: int) -> list[int]:
    """Return the rows that do not count up from 0 or 1 in their first cell; other rows may be between."""
    uncounted, last, count = [], -2, -1
    for k, row in enumerate(rows):
        if len(row) != width:
            continue
        cell = row[0]
        if cell.isdecimal() and len(cell) <= MAX_COUNT_DIGITS and 1 <= int(cell) - count <= k - last:
            last, count = k, int(cell)
        else:
            uncounted.append(k)
    return uncounted


def _no_rows(segment: Segment, body: Sequence[HeadLine], options: Mapping[str, str]) -> Finding:
    """Return why no row of numbers was found with the signs that were given."""
    file, allowed = str(segment.path), "a table with one row per sample"
    if segment.has_more and len(body) < MIN_LINES:
        fault = f"no row of numbers in the first {len(segment.head)} letters"
        return Finding(file=file, found=fault, allowed=allowed)
    if not body:
        return Finding(f"found no line with content, allowed: {allowed}", file=file)
    line = body[0].number
    cells = [cell for head_line in body for cell in split_line(head_line.text, ",")]
    if len(body) <= 2 and all(is_text(cell, ".") for cell in cells if cell):
        return Finding("found a header and no rows, allowed: one row per sample", file=file, line=line)
    signs = [f"{what} {_NAMES[_SIGNS.get(sign.lower(), sign)]}" for what, sign in options.items()]
    fault = f"{body[0].text.strip()[:60]!r} and no row of numbers below it"
    fault += f" with {' and '.join(signs)}" if signs else ""
    return Finding(file=file, line=line, found=fault, allowed=allowed)
