"""How a table is written: delimiter, decimal sign, header, where the data begin. Never from the locale."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice

from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.logs.formats.cells import (
    DECIMALS,
    DELIMITERS,
    SPACE,
    count_numbers,
    count_up,
    header_of,
    is_missing,
    is_number,
    is_text,
    numbered,
    only_count,
    split_line,
)
from urmpipe_pipeline.logs.formats.clock_forms import is_clock_text
from urmpipe_pipeline.logs.formats.log_table import MAX_SAMPLED_ROWS, LogTable
from urmpipe_pipeline.logs.formats.numbers import capped
from urmpipe_pipeline.logs.formats.text import FEWEST_LINES, HeadLine, Segment, head_lines
from urmpipe_pipeline.logs.formats.text_table import TextTable
from urmpipe_pipeline.text import strip_apostrophe

LEAST_FIT = 0.2
"""A delimiter that fits less than this is not believed because it makes several columns."""

FEW = 0.25
"""Share of the rows that may be damaged where the others tell how the table is written."""

SCORED_LINES = 60
"""Lines that decide on the delimiter."""

COUNTED = 9
"""So many digits a number of a row may have: no table has a billion rows."""

_NAMES = {",": "comma", ";": "semicolon", "\t": "tab", SPACE: "spaces", "|": "bar", ".": "point"}
_SIGNS = {name: sign for sign, name in _NAMES.items()} | {"\\t": "\t", "space": SPACE, "pipe": "|"}

_TOLD = re.compile(r'"?sep=([,;|\t])"?', re.IGNORECASE)

Row = list[str]


@dataclass(frozen=True, slots=True)
class _Style:
    """Delimiter and decimal sign, the width of most rows with them, and how well they fit, 0..1."""

    delimiter: str
    decimal: str
    width: int = 0
    fit: float = 0.0


def sniff(
    segment: Segment,
    delimiter: str | None = None,
    decimal: str | None = None,
    lines: Sequence[HeadLine] | None = None,
) -> TextTable:
    """Return how a table is written.

    Args:
        segment: The table's text.
        delimiter: The sign between cells, or its name, if the file need not tell.
        decimal: The decimal sign, or its name, if the file need not tell.
        lines: The lines of its head with a plain cell for each array, if it holds arrays.

    Raises:
        LogError: If it holds no numbers, no rows, or a header that does not fit its rows.
        OptionError: If delimiter or decimal is none that is allowed.
    """
    lines = list(head_lines(segment)) if lines is None else lines
    told, lines = _told_delimiter(lines)
    delimiters = _choices("delimiter", delimiter or told, DELIMITERS)
    decimals = _choices("decimal", decimal, DECIMALS)
    body = [line for line in lines if not line.is_comment][:MAX_SAMPLED_ROWS]
    style = _best_style([line.text for line in body[:SCORED_LINES]], delimiters, decimals)
    rows = [split_line(line.text, style.delimiter) for line in body]
    width = _common_width(rows, style.decimal)
    numeric = _numeric_columns(rows, width, style.decimal)
    numbers = (i for i in range(len(rows)) if _is_data(rows, i, numeric, style.decimal))
    data = list(islice(numbers, 2))
    counted_below = (
        len(data) > 1 and data[0] > 0 and numbered(body[data[0] - 1], rows[data[0]], style.delimiter)
    )
    first = data[1] if counted_below else next(iter(data), None)
    if first is None:
        given = {"delimiter": delimiter, "decimal sign": decimal}
        raise LogError(_no_rows(segment, body, {what: sign for what, sign in given.items() if sign}))
    _refuse_prose(segment, body[first:], [len(row) for row in rows[first:]], width)
    before = [line for line in lines if line.number < body[first].number]
    header, units = header_of(before, style.delimiter, width)
    names, said = _names(segment, header, body[first:], rows[first:], width)
    if header and only_count(names):
        said = Inference("header", f"line {header[0]}", "its names only count: columns by number")
        header, names = None, _by_number(names)
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
        inferences=(*_style_inferences(style, delimiter, decimal, told)[bool(segment.delimiter) :], said),
    )


def _by_number(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return names that only count, or in their place numbers from 1, as users have them."""
    bare = all(name.isdigit() for name in names if name)
    return tuple(str(k + 1) if name else "" for k, name in enumerate(names)) if bare else names


def _told_delimiter(lines: Sequence[HeadLine]) -> tuple[str | None, Sequence[HeadLine]]:
    """Return the delimiter that a first line sep=; tells (Excel), and the other lines."""
    told = _TOLD.fullmatch(lines[0].text.rstrip("\r\n ")) if lines else None
    return (told[1], lines[1:]) if told else (None, lines)


def across(layout: LogTable) -> LogTable:
    """Return a table of a single line of numbers as one column; any other as it is."""
    if not isinstance(layout, TextTable) or layout.header is not None:
        return layout
    if len(layout.sample) != 1 or len(layout.names) < 3:
        return layout
    lines = layout.segment.lines()
    if any(line.strip() for number, line in lines if number > layout.first_line):
        return layout
    longer = layout.segment.has_more  # then the last value is cut
    cells = layout.sample[0][: -1 if longer else None][:MAX_SAMPLED_ROWS]
    column = tuple((cell,) for cell in cells)
    return replace(layout, names=("1",), sample=column, across=True)


def _choices(parameter: str, given: str | None, allowed: Sequence[str]) -> Sequence[str]:
    """Return the signs to try: the one given by the user, or all."""
    if given is None:
        return allowed
    sign = _SIGNS.get(given.lower(), given)
    if sign not in allowed:
        names = ", ".join(_NAMES[sign] for sign in allowed)
        allowed_signs = f"{names}, or the character itself"
        raise OptionError(Finding(parameter=parameter, found=format_value(given), allowed=allowed_signs))
    return (sign,)


def _best_style(lines: Sequence[str], delimiters: Sequence[str], decimals: Sequence[str]) -> _Style:
    """Return the style that fits best; of equals, the first.

    A single column is believed only where no delimiter makes more: 0,1 is two numbers before it is 0.1.
    """
    best = _Style(delimiters[0], decimals[0])
    for delimiter in delimiters:
        rows = [split_line(line, delimiter) for line in lines]
        if _credit(best)[0] and all(len(row) < 2 for row in rows):
            continue
        for decimal in decimals:
            width = _common_width(rows, decimal)
            style = _Style(delimiter, decimal, width, _fit(rows, width, decimal))
            if _credit(style) > _credit(best) and not _parts_words(lines, best, style):
                best = style
        if best.width > 1 and best.fit == 1.0:
            break
    return best


def _parts_words(lines: Sequence[str], best: _Style, style: _Style) -> bool:
    """Return whether spaces, in place of tabs, only part texts: they make no more numbers."""
    if (best.delimiter, style.delimiter) != ("\t", SPACE) or not _credit(best)[0]:
        return False
    with_tabs, with_spaces = (
        sum(count_numbers(split_line(line, one.delimiter), one.decimal) for line in lines)
        for one in (best, style)
    )
    return with_spaces <= with_tabs


def _fit(rows: Sequence[Row], width: int, decimal: str) -> float:
    """Return the share of rows of one width with numbers, times the share of their text that is numbers.

    A date or a time counts as a number: 0.005 sec and 2021-04-11 22:27:21 are one cell.
    """
    full = [row for row in rows if len(row) == width and count_numbers(row, decimal)]
    cells = [cell for row in full for cell in row if not is_missing(cell)]
    numbers = sum(len(cell) for cell in cells if is_number(cell, decimal) or is_clock_text(cell))
    return len(full) / len(rows) * numbers / sum(map(len, cells)) if full else 0.0


def _credit(style: _Style) -> tuple[bool, float]:
    return style.width > 1 and style.fit >= LEAST_FIT, style.fit


def _style_inferences(
    style: _Style, delimiter: str | None, decimal: str | None, told: str | None
) -> list[Inference]:
    given = "given as an option"
    parts = "the first line says so" if told else f"it makes rows of {style.width} cells"
    parts, reads = given if delimiter else parts, given if decimal else "with it most cells are numbers"
    return [
        Inference("delimiter", _NAMES[style.delimiter], parts, hints=(Hint("delimiter"),), basis="named"),
        Inference("decimal sign", _NAMES[style.decimal], reads, hints=(Hint("decimal"),), basis="named"),
    ]


def _common_width(rows: Sequence[Row], decimal: str) -> int:
    """Return the width of most rows, each counted as often as it has numbers."""
    widths: Counter[int] = Counter()
    for row in rows:
        widths[len(row)] += count_numbers(row, decimal)
    return widths.most_common(1)[0][0] if widths else 0


def _numeric_columns(rows: Sequence[Row], width: int, decimal: str) -> list[int]:
    """Return the columns in which at least half of the cells with content are numbers."""
    full = [row for row in rows if len(row) == width]
    columns = ([row[column] for row in full if not is_missing(row[column])] for column in range(width))
    numbers = [(count_numbers(cells, decimal), len(cells)) for cells in columns]
    return [column for column, (count, of) in enumerate(numbers) if count and 2 * count >= of]


def _is_data(rows: Sequence[Row], i: int, numeric: Sequence[int], decimal: str) -> bool:
    """Return whether row i is data: at least half of it, where numbers belong, are numbers.

    Of a row that is mostly empty, such as Rate,500,,,,, above a header, all must be.
    """
    cells = [rows[i][column] for column in numeric if column < len(rows[i])]
    cells = [cell for cell in cells if not is_missing(cell)]
    numbers = [cell for cell in cells if is_number(cell, decimal)]
    if 2 * len(cells) < len(numeric) and len(numbers) < len(cells):
        return False
    return bool(numbers) and 2 * len(numbers) >= len(cells) and not _is_numbered_header(rows, i, numbers)


def _is_numbered_header(rows: Sequence[Row], i: int, numbers: Sequence[str]) -> bool:
    """Return whether the first row holds the numbers 0, 1, 2, ... that pandas gives unnamed columns.

    pandas writes every float with a decimal point: whole numbers below mean that the row is data itself.
    """
    if i > 0 or len(rows) == 1 or len(numbers) < 3 or not count_up(numbers):
        return False
    others = len(rows[0]) - len(numbers)
    return others <= 1 and not any(cell.isdigit() for cell in rows[1][others:])


def _names(
    segment: Segment,
    header: tuple[int, Row] | None,
    lines: Sequence[HeadLine],
    rows: Sequence[Row],
    width: int,
) -> tuple[tuple[str, ...], Inference]:
    """Return a name for every cell of a row."""
    ends = [k for k, row in enumerate(rows) if len(row) == width and row[-1]]
    trailing = not ends
    if header is None:
        names = tuple(str(k + 1) for k in range(width - trailing))
        said = Inference("header", "none", "the first line is numbers: columns by number")
        return names + ("",) * trailing, said
    line, cells = header[0], [strip_apostrophe(cell) for cell in header[1]]
    found = Inference("header", f"line {line}", "the last line of names before the numbers")
    if len(cells) == width:
        return tuple(cells), found
    if len(cells) == width + 1 and not cells[-1]:
        return tuple(cells[:-1]), found
    if len(cells) == width - 1 and trailing:
        return (*cells, ""), Inference("header", f"line {line}", "each row ends with a delimiter")
    uncounted = _uncounted(rows, width)
    if len(cells) == width - 1 and not uncounted:
        return ("", *cells), Inference("header", f"line {line}", "the first column is an unnamed index")
    if len(cells) == width - 1:
        _refuse_few(segment, lines, rows, uncounted, 0, f"a count, as before what line {line} names")
        _refuse_few(segment, lines, rows, ends, -1, f"no cell behind what line {line} names")
    number = abs(len(cells) - width)
    remedy = f"{'add' if len(cells) < width else 'remove'} {format_count(number, 'name')}"
    wrong = (
        f"found {len(cells)} names over rows of {format_count(width, 'cell')}, allowed: one name per column;"
    )
    wrong += f" {remedy}, or delete line {line}: without names the columns are taken as joints in order"
    raise LogError(Finding(wrong, file=str(segment.path), line=line))


def _uncounted(rows: Sequence[Row], width: int) -> list[int]:
    """Return the rows that do not count up from 0 or 1 in their first cell; others may stand between."""
    found, last, count = [], -2, -1
    for k, row in enumerate(rows):
        if len(row) != width:
            continue
        cell = row[0]
        if cell.isdecimal() and len(cell) <= COUNTED and 1 <= int(cell) - count <= k - last:
            last, count = k, int(cell)
        else:
            found.append(k)
    return found


def _refuse_few(
    segment: Segment,
    lines: Sequence[HeadLine],
    rows: Sequence[Row],
    few: Sequence[int],
    column: int,
    allowed: str,
) -> None:
    """Raise with each of some rows if they are few: it is they that keep the others from being understood."""
    if len(few) > FEW * len(rows):
        return
    wrong = [(lines[k].number, format_value(rows[k][column])) for k in few]
    file = str(segment.path)
    findings = [Finding(file=file, line=line, found=cell, allowed=allowed) for line, cell in wrong]
    raise LogError(*capped(findings, file))


def _refuse_prose(segment: Segment, lines: Sequence[HeadLine], widths: Sequence[int], width: int) -> None:
    """Raise if most lines below the first with numbers are no rows of the same width."""
    if 2 * widths.count(width) < len(widths):
        text = lines[0].text.strip()[:60]
        message = f"found {text!r} and lines of {min(widths)} to {max(widths)} cells, allowed: a table"
        raise LogError(Finding(message, file=str(segment.path), line=lines[0].number))


def _no_rows(segment: Segment, body: Sequence[HeadLine], given: Mapping[str, str]) -> Finding:
    """Say why no row of numbers was found with the signs that were given."""
    file = str(segment.path)
    if segment.has_more and len(body) < FEWEST_LINES:
        found = f"no row of numbers in the first {len(segment.head)} letters"
        return Finding(file=file, found=found, allowed="a table with one row per sample")
    if not body:
        return Finding("found no line with content, allowed: a table with one row per sample", file=file)
    cells = [cell for line in body for cell in split_line(line.text, ",")]
    if len(body) <= 2 and all(is_text(cell, ".") for cell in cells if cell):
        return Finding(
            "found a header and no rows, allowed: one row per sample", file=file, line=body[0].number
        )
    text = body[0].text.strip()[:60]
    named = [f"{what} {_NAMES[_SIGNS.get(sign.lower(), sign)]}" for what, sign in given.items()]
    found = f"{text!r} and no row of numbers below it" + (f" with {' and '.join(named)}" if named else "")
    return Finding(file=file, line=body[0].number, found=found, allowed="a table with one row per sample")
