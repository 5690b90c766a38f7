"""The contents of files whose readers may crash: MAT 5, HDF5 and workbooks, for `subprocess_reader`.

It imports little, to start quickly; `hdf5_contents` has HDF5 files.

Times in cells of a workbook are numbers of days, which a number format makes times; calamine rounds them to
ms. Those of .xlsx, .xlsm and .xlsb are read again without their number formats: dates to the us, times of
day and lengths of time to the ns.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from datetime import date, datetime, time, timedelta
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias
from zipfile import ZipFile, is_zipfile

from urmpipe_pipeline.array_choice import OPAQUE

Cell: TypeAlias = int | float | str | bool | date | datetime | time | timedelta
Row: TypeAlias = list[Cell]

PASSWORD = "password"  # why an encrypted workbook cannot be read
DAY_NS = 86_400 * 10**9
_STYLES = ("xl/styles.xml", "xl/styles.bin")


def read_through(path: str, form: str, *arguments: str) -> tuple[Any, str]:
    """Return the contents of a file and an empty text, or None and why there are none.

    Args:
        path: The file.
        form: "mat" for variables of a MAT file by name, "hdf5" for `hdf5_contents.Contents`, "workbook" for a
            list of sheets.
        arguments: Further ones of the reader of HDF5.
    """
    try:
        return _READERS[form](path, *arguments), ""
    except Exception as error:  # of damaged bytes libraries raise anything, SciPy an UnboundLocalError too
        return None, str(error).partition("\n")[0].strip(" .") or type(error).__name__


# MAT files of version 5


def _read_mat(path: str) -> dict[str, Any]:
    """Return variables, structs as dictionaries, an object of a class as the pair of OPAQUE and its class."""
    from scipy.io import loadmat

    variables = loadmat(path, appendmat=False, simplify_cells=True)
    return dict(_without_objects(name, value) for name, value in variables.items() if name[:2] != "__")


def _without_objects(name: str, value: Any) -> tuple[str, Any]:
    """Return a variable by its name; SciPy before 1.18 keeps that of an object inside."""
    if isinstance(value, dict):
        return name, dict(_without_objects(key, inner) for key, inner in value.items())
    fields = getattr(getattr(value, "dtype", None), "names", None) or ()
    if fields[-2:] not in (("s2", "arr"), ("_Class", "_ObjectMetadata")):
        return name, value
    cells = (value.ravel()[0][field] for field in fields[:-1])
    texts = [cell.decode("latin-1") if isinstance(cell, bytes) else str(cell) for cell in cells]
    return (texts[0] if name == "None" else name), (OPAQUE, texts[-1])


# HDF5


def _read_hdf5(path: str, most: str, episode: str, topic: str) -> Any:
    from urmpipe_pipeline.hdf5_contents import read_contents

    return read_contents(path, int(most), episode or None, topic or None)


# Workbooks


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


def _read_workbook(path: str) -> list[Sheet]:
    import python_calamine

    content = Path(path).read_bytes()
    try:
        with python_calamine.load_workbook(io.BytesIO(content)) as book:
            sheets = [_read_sheet(python_calamine, book, metadata) for metadata in book.sheets_metadata]
    except python_calamine.PasswordError:
        raise ValueError(PASSWORD) from None
    kinds = {type(cell) for sheet in sheets for row in sheet.rows for cell in row}
    if not kinds & {datetime, time, timedelta} or not is_zipfile(io.BytesIO(content)):
        return sheets
    plain = io.BytesIO()
    with ZipFile(io.BytesIO(content)) as archive, ZipFile(plain, "w") as copy:
        for part in archive.infolist():
            if part.filename not in _STYLES:
                copy.writestr(part.filename, archive.read(part))
    plain.seek(0)
    with python_calamine.load_workbook(plain) as book:
        days = [_read_sheet(python_calamine, book, metadata).rows for metadata in book.sheets_metadata]
    return [
        sheet._replace(rows=[[*map(_exact_time, *pair)] for pair in zip(sheet.rows, numbers, strict=True)])
        for sheet, numbers in zip(sheets, days, strict=True)
    ]


def _read_sheet(calamine: Any, book: Any, metadata: Any) -> Sheet:
    """Return a sheet; a sheet of charts has no cells."""
    is_sheet = metadata.typ == calamine.SheetTypeEnum.WorkSheet
    rows = book.get_sheet_by_name(metadata.name).to_python(skip_empty_area=False) if is_sheet else []
    ends = (next((k + 1 for k in reversed(range(len(row))) if row[k] != ""), 0) for row in rows)
    width = max(ends, default=0)
    is_shown = is_sheet and metadata.visible == calamine.SheetVisibleEnum.Visible
    return Sheet(metadata.name, is_shown, [row[:width] for row in rows])


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


_READERS: dict[str, Callable[..., Any]] = {"mat": _read_mat, "hdf5": _read_hdf5, "workbook": _read_workbook}
