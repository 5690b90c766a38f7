"""Workbooks (.xlsx, .xlsm, .xlsb, .xls, .ods): a sheet as text with a line for each of its rows.

1. `read_workbook` finds the sheet: the only one with a table, or `--sheet`.
2. Its cells become text with tabs between them. Header, units and decimal sign are then inferred as those of
   any text, and line numbers are the row numbers of the sheet.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.file_contents import Cell, Row, Sheet, clock_text
from urmpipe_pipeline.joint_log import Basis, Inference
from urmpipe_pipeline.logs.formats.cells import is_number
from urmpipe_pipeline.logs.formats.files import (
    choice_error,
    choose_part,
    first_bytes,
    import_optional,
    password_error,
    read_separately,
)
from urmpipe_pipeline.logs.formats.text import Segment, check_unpacked_size, text_segment
from urmpipe_pipeline.logs.log_map import LogMap

_ZIP, _OLE = b"PK\x03\x04", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_SUFFIXES = (".xlsx", ".xlsm", ".xlsb", ".ods")
_PARTS = {"xl/workbook.xml", "xl/workbook.bin"}
_OPEN_DOCUMENT = b"application/vnd.oasis.opendocument.spreadsheet"
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+\Z")
_DECIMAL_POINT = re.compile(r"[+-]?\d+\.\d+\Z")
_SEPARATORS = str.maketrans('\t\r\n"', "   '")  # would end a cell or a line


def read_workbook(path: Path, options: LogMap) -> Segment | None:
    """Return a sheet of a workbook as text; None if the file is no workbook.

    Args:
        path: The file.
        options: Of these `sheet` and `decimal`.

    Raises:
        LogError: If the file is damaged or has a password, if no sheet or more than one has a table, or if
            python-calamine is not installed.
        OptionError: If there is no such sheet.
    """
    head = first_bytes(path, len(_OLE))
    is_zipped = head.startswith(_ZIP) and _is_zipped_workbook(path)
    if not is_zipped and head != _OLE:
        return None
    if not is_zipped and path.suffix.lower() in _SUFFIXES:  # a zip archive, encrypted in a compound file
        raise password_error(path)
    import_optional("python_calamine", path, "a workbook")
    save = Hint("", effect="open it in a spreadsheet program and save it again")
    sheets = read_separately(path, "a workbook", "workbook", hints=(save,))
    sheet, why = _choose_sheet(path, sheets, options.sheet)
    basis: Basis = "named" if options.sheet is None else "given"
    inference = Inference("sheet", sheet.name, why, hints=(Hint("sheet"),), basis=basis)
    return text_segment(path, "\n".join(_lines(sheet.rows, options.decimal)) + "\n", "\t", (inference,))


def _is_zipped_workbook(path: Path) -> bool:
    """Return whether a zip archive is a workbook, by its parts; a damaged one by its suffix."""
    try:
        with ZipFile(path) as archive:
            names = set(archive.namelist())
            is_book = bool(names & _PARTS) or (
                "mimetype" in names and archive.read("mimetype").startswith(_OPEN_DOCUMENT)
            )
            if is_book:
                check_unpacked_size(path, sum(part.file_size for part in archive.infolist()))
            return is_book
    except (BadZipFile, OSError, ValueError, NotImplementedError, RuntimeError, EOFError, zlib.error):
        return path.suffix.lower() in _SUFFIXES


def _choose_sheet(path: Path, sheets: Sequence[Sheet], requested: str | None) -> tuple[Sheet, str]:
    """Return a sheet, and why it is chosen."""
    names = [sheet.name for sheet in sheets]
    if requested is not None:
        by_number = {str(number): name for number, name in enumerate(names, start=1)}
        requested = requested if requested in names else by_number.get(requested, requested)
        chosen = choose_part(path, "sheet", requested, dict.fromkeys(names, ""), "sheets")
        return sheets[names.index(chosen)], "given as an option"
    shown = [sheet for sheet in sheets if sheet.is_shown] or sheets
    tables = [sheet for sheet in shown if _numeric_rows(sheet, 2) > 1]
    tables = tables or [sheet for sheet in shown if _numeric_rows(sheet, 1) > 1]
    if len(tables) == 1:
        return tables[0], "the only sheet" if len(names) == 1 else "the only sheet with a table"
    if tables:
        counts = {
            sheet.name: f"its {format_count(_numeric_rows(sheet, 1), 'row')} of numbers" for sheet in tables
        }
        raise choice_error(path, "sheet", None, counts, "sheets with a table")
    fault = f"no rows of numbers in {format_count(len(shown), 'sheet')} ({', '.join(names)})"
    allowed = "a table with one row per sample"
    values = Hint(
        "", effect="if its cells are formulas, save it in a spreadsheet program, which adds their values"
    )
    raise LogError(Finding(file=str(path), found=fault, allowed=allowed, hints=(values,)))


def _numeric_rows(sheet: Sheet, count: int) -> int:
    """Return how many rows have at least this number of numbers."""
    return sum(sum(map(_is_numeric, row)) >= count for row in sheet.rows)


def _is_numeric(cell: Cell) -> bool:
    if isinstance(cell, str):
        return is_number(cell.strip(), ".") or is_number(cell.strip(), ",")
    return not isinstance(cell, bool)


def _lines(rows: Sequence[Row], decimal: str | None) -> Iterator[str]:
    """Yield each row as a line; a title, which is alone in its row, without the empty cells after it."""
    if decimal is None:
        texts = [cell for row in rows for cell in row if isinstance(cell, str)]
        has_points = any(map(_DECIMAL_POINT.match, texts))
        decimal = "," if any(map(_DECIMAL_COMMA.match, texts)) and not has_points else "."
    has_times = {k for row in rows for k, cell in enumerate(row) if isinstance(cell, datetime)}
    for row in rows:
        cells = [_TEXTS[type(cell)](cell) for cell in row]
        for k, cell in enumerate(row):
            if isinstance(cell, float) and decimal in (",", "comma"):
                cells[k] = cells[k].replace(".", ",")
            elif k in has_times and type(cell) is date:
                cells[k] += " 00:00:00"
        if sum(map(bool, cells)) == 1 and not any(_is_numeric(cell) for cell in row if cell != ""):
            cells = cells[: next(k for k, text in enumerate(cells) if text) + 1]
        yield "\t".join(cells) if any(cells) else ""


def _duration_text(length: timedelta) -> str:
    rest = length - timedelta(length.days)
    return f"{length.days} days {clock_text(rest // timedelta(microseconds=1) * 1000)}"


_TEXTS: Mapping[type, Callable[[Any], str]] = {
    float: lambda cell: repr(cell).removesuffix(".0"),  # whole numbers as spreadsheets show them
    int: str,
    bool: str,
    str: lambda cell: "" if cell == "#N/A" else cell.translate(_SEPARATORS).strip(),
    date: date.isoformat,
    datetime: lambda cell: cell.isoformat(" "),
    time: time.isoformat,
    timedelta: _duration_text,
}
