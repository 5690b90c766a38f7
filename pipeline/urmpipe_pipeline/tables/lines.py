"""CSV and TUM: lines of shortest round-trip decimals, a slice of rows at a time, and their check."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_pipeline.outputs import EXPORT_HEADER
from urmpipe_pipeline.presentation.exports import ExportTable, Poses, Times
from urmpipe_pipeline.tables.times import text_of
from urmpipe_pipeline.text import csv_text

SLICE = 65_536
"""Rows written at a time: few enough to keep memory low."""

TAIL = 1 << 16
"""The last line stands within so many bytes of the end."""

TUM_HEAD = f"# {EXPORT_HEADER}\n# t[s] x[m] y[m] z[m] qx qy qz qw\n"
"""The names and units of a trajectory's columns, by which it is read back; a unit has no space before it."""


def write_csv(table: ExportTable, path: Path) -> list[str]:
    """Write a table as every tool reads it, UTF-8 with commas, and return how the file differs, read back.

    Numbers have the shortest decimal text that gives the same double, NaN is an empty cell; times are exact.
    """
    columns = table.columns
    return write_columns(path, [one.name for one in columns], [one.values for one in columns])


def write_columns(path: Path, names: Sequence[str], columns: Sequence[Any]) -> list[str]:
    """Write columns under their names as CSV, and return how the file differs from them, read back."""
    return _written(path, ",".join(map(quoted, names)) + "\n", columns, ",")


def write_tum(poses: Poses, path: Path) -> list[str]:
    """Write a trajectory as evo reads it, `t x y z qx qy qz qw`, and return how the file differs, read back.

    Times are those of the log's clock in [s], exact in decimals.
    """
    columns = [Times(poses.clock_ns, "s"), *poses.position.T, *poses.quat_xyzw.T]
    return _written(path, TUM_HEAD, columns, " ")


def _written(path: Path, head: str, columns: Sequence[Any], delimiter: str) -> list[str]:
    values = texts(columns)
    write_lines(path, head, values, delimiter)
    return differences(path, head, values, delimiter)


def texts(columns: Sequence[Any]) -> list[Any]:
    """Return columns as they are written: times as Arrow arrays of their text, all others as they are."""
    return [text_of(column) if isinstance(column, Times) else column for column in columns]


def write_lines(path: Path, head: str, columns: Sequence[Any], delimiter: str) -> None:
    """Write a head and a line a row.

    Args:
        path: The file.
        head: What stands above the rows, with its line end.
        columns: What `texts` returned, each of shape (n,); NaN is an empty cell.
        delimiter: The sign between cells.
    """
    rows = len(columns[0])
    with path.open("wb") as file:
        file.write(head.encode())
        for start in range(0, rows, SLICE):
            file.write(_lines([column[start : start + SLICE] for column in columns], delimiter))


def differences(path: Path, head: str, columns: Sequence[Any], delimiter: str) -> list[str]:
    """Return how a file differs from what was to be written: its head, its rows, its first and last row."""
    rows = len(columns[0])
    with path.open("rb") as file:
        found = [] if file.read(len(head.encode())) == head.encode() else ["the head"]
        first = file.readline().decode(errors="replace")
        count = bool(first) + sum(block.count(b"\n") for block in iter(lambda: file.read(1 << 20), b""))
        file.seek(max(0, file.tell() - TAIL))
        last = file.read().decode(errors="replace").rstrip("\n").rpartition("\n")[2]
    if count != rows:
        found.append(f"{count} rows of {rows}")
    ends = {0: first.rstrip("\n"), rows - 1: last} if rows else {}
    return found + [
        f"row {row + 1}" for row, line in ends.items() if not _holds(line, columns, row, delimiter)
    ]


def quoted(cell: str) -> str:
    """Return a text as a cell of a CSV file, see `csv_text`, quoted where it must be."""
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow([csv_text(cell)])
    return text.getvalue()


def _lines(columns: Sequence[Any], delimiter: str) -> memoryview:
    """Return the bytes of the lines of some rows."""
    import pyarrow.compute as pc

    missing = "" if len(columns) > 1 else '""'  # a line without any sign is no row to most readers
    cells = pc.binary_join_element_wise(*(_cells(column, missing) for column in columns), delimiter)
    lines = pc.binary_join_element_wise(cells, "", "\n")
    _, offsets, content = lines.buffers()
    ends = np.frombuffer(offsets, dtype=np.int32)[lines.offset : lines.offset + len(lines) + 1]
    return memoryview(content)[int(ends[0]) : int(ends[-1])]


def _cells(column: Any, missing: str) -> Any:
    """Return the texts of some rows of a column."""
    import pyarrow as pa

    if not isinstance(column, np.ndarray):
        return column  # times are text already
    if column.dtype.kind == "U":
        names, places = np.unique(column, return_inverse=True)
        return pa.array(list(map(quoted, names.tolist())), pa.string()).take(pa.array(places))
    return pa.array(column, from_pandas=True).cast(pa.string()).fill_null(missing)


def _holds(line: str, columns: Sequence[Any], row: int, delimiter: str) -> bool:
    """Tell whether a line holds the values of a row: numbers as numbers, all else to the letter."""
    cells = next(csv.reader([line], delimiter=delimiter), [])
    values = [column[row] if isinstance(column, np.ndarray) else column[row].as_py() for column in columns]
    return len(cells) == len(values) and all(map(_same, cells, values))


def _same(cell: str, value: Any) -> bool:
    if isinstance(value, np.str_):
        return cell == csv_text(value)
    if isinstance(value, str):  # a time, as it was written
        return cell == value
    try:
        return float(cell or "nan") == value or (cell == "" and bool(np.isnan(value)))
    except ValueError:
        return False
