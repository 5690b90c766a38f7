"""The cells of a workbook, for `subprocess_reader`. It imports nothing else, to start quickly.

Times in cells are numbers of days, which a number format makes times; calamine rounds them to ms. Those of
.xlsx, .xlsm and .xlsb are read again without their number formats: dates to the us, times of day and lengths
of time to the ns.
"""

from __future__ import annotations

import io
from datetime import date, datetime, time, timedelta
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias
from zipfile import ZipFile, is_zipfile

Cell: TypeAlias = int | float | str | bool | date | datetime | time | timedelta
Row: TypeAlias = list[Cell]

PASSWORD = "password"
DAY_NS = 86_400 * 10**9
_STYLES = ("xl/styles.xml", "xl/styles.bin")


class Sheet(NamedTuple):
    """A sheet of a workbook.

    Attributes:
        name: Its name.
        is_shown: Whether it is a visible sheet of cells.
        rows: Its rows from the first row and column on, without empty columns at the end.
    """

    name: str
    is_shown: bool
    rows: list[Row]


def read_through(path: str) -> list[Sheet] | str:
    """Return the sheets of a workbook; or why it cannot be read, `PASSWORD` if it is encrypted."""
    import python_calamine

    try:
        content = Path(path).read_bytes()
        with python_calamine.load_workbook(io.BytesIO(content)) as book:
            sheets = [_read_sheet(python_calamine, book, metadata) for metadata in book.sheets_metadata]
        kinds = {type(cell) for sheet in sheets for row in sheet.rows for cell in row}
        if kinds & {datetime, time, timedelta} and is_zipfile(io.BytesIO(content)):
            return _with_exact_times(python_calamine, content, sheets)
    except python_calamine.PasswordError:
        return PASSWORD
    except Exception as error:
        return str(error).rstrip(".") or type(error).__name__
    return sheets


def _read_sheet(calamine: Any, book: Any, metadata: Any) -> Sheet:
    """Return a sheet; a sheet of charts has no cells."""
    is_sheet = metadata.typ == calamine.SheetTypeEnum.WorkSheet
    rows = book.get_sheet_by_name(metadata.name).to_python(skip_empty_area=False) if is_sheet else []
    ends = (next((k + 1 for k in reversed(range(len(row))) if row[k] != ""), 0) for row in rows)
    width = max(ends, default=0)
    is_shown = is_sheet and metadata.visible == calamine.SheetVisibleEnum.Visible
    return Sheet(metadata.name, is_shown, [row[:width] for row in rows])


def _with_exact_times(calamine: Any, content: bytes, sheets: list[Sheet]) -> list[Sheet]:
    """Return sheets whose times have all digits of their cells."""
    plain = io.BytesIO()
    with ZipFile(io.BytesIO(content)) as archive, ZipFile(plain, "w") as copy:
        for part in archive.infolist():
            if part.filename not in _STYLES:
                copy.writestr(part.filename, archive.read(part))
    plain.seek(0)
    result = []
    with calamine.load_workbook(plain) as book:
        for sheet, metadata in zip(sheets, book.sheets_metadata, strict=True):
            days = _read_sheet(calamine, book, metadata).rows
            pairs = zip(sheet.rows, days, strict=True)
            result.append(sheet._replace(rows=[[*map(_exact_time, *pair)] for pair in pairs]))
    return result


def _exact_time(cell: Cell, days: Cell) -> Cell:
    """Return a date with its microseconds, a time of day or a length of time as text; or the cell as it is.

    Which day dates count from does not matter: exact and rounded time differ by half a millisecond at most.
    """
    if not isinstance(days, float) or not isinstance(cell, (datetime, date, time, timedelta)):
        return cell
    ns = round(Fraction(days) * DAY_NS)
    if isinstance(cell, timedelta):
        return f"{ns // DAY_NS} days {clock_text(ns % DAY_NS)}"
    if isinstance(cell, time):
        return clock_text(ns)
    if not isinstance(cell, datetime):
        if days.is_integer():
            return cell
        cell = datetime(cell.year, cell.month, cell.day)
    rounded = (cell - datetime(cell.year, cell.month, cell.day)) // timedelta(microseconds=1)
    half = DAY_NS // 2000
    return cell + timedelta(microseconds=(round(ns / 1000) - rounded + half) % (2 * half) - half)


def clock_text(ns: int) -> str:
    """Return a time of day as text, with 0, 3, 6 or 9 decimals."""
    seconds, rest = divmod(ns, 10**9)
    decimals = f"{rest:09d}"
    while decimals.endswith("000"):
        decimals = decimals[:-3]
    clock = f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    return f"{clock}.{decimals}" if decimals else clock
