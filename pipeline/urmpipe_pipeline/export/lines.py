"""Text tables: lines of shortest round-trip decimals, a slice of rows at a time, and their check."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_pipeline.export.times import Times

SLICE = 65_536
"""Rows written at a time: few enough to keep memory low."""

TAIL = 1 << 16
"""The last line stands within so many bytes of the end."""


def write_lines(path: Path, head: str, columns: Sequence[Any], delimiter: str) -> None:
    """Write a head and a line a row.

    Args:
        path: The file.
        head: What stands above the rows, with its line end.
        columns: Arrays of shape (n,), or `Times`; NaN is an empty cell.
        delimiter: The sign between cells.
    """
    ready = [column.text() if isinstance(column, Times) else column for column in columns]
    rows = len(ready[0])
    with path.open("wb") as file:
        file.write(head.encode())
        for start in range(0, rows, SLICE):
            file.write(_lines([column[start : start + SLICE] for column in ready], delimiter))


def differences(path: Path, head: str, columns: Sequence[Any], delimiter: str) -> list[str]:
    """Return how a file differs from what was to be written: its head, its rows, its first and last row."""
    rows = len(columns[0].ns if isinstance(columns[0], Times) else columns[0])
    with path.open("rb") as file:
        found = [] if file.read(len(head.encode())) == head.encode() else ["the head"]
        first = file.readline().decode()
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
    """Return a text as a cell of a CSV file, quoted where it must be."""
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow([cell])
    return text.getvalue()


def _lines(columns: Sequence[Any], delimiter: str) -> memoryview:
    """Return the bytes of the lines of some rows."""
    import pyarrow.compute as pc

    cells = pc.binary_join_element_wise(*(_cells(column) for column in columns), delimiter)
    lines = pc.binary_join_element_wise(cells, "", "\n")
    _, offsets, content = lines.buffers()
    ends = np.frombuffer(offsets, dtype=np.int32)[lines.offset : lines.offset + len(lines) + 1]
    return memoryview(content)[int(ends[0]) : int(ends[-1])]


def _cells(column: Any) -> Any:
    """Return the texts of some rows of a column."""
    import pyarrow as pa

    if not isinstance(column, np.ndarray):
        return column  # times are text already
    if column.dtype.kind == "U":
        texts = {name: quoted(name) for name in np.unique(column).tolist()}
        return pa.array([texts[name] for name in column.tolist()], pa.string())
    return pa.array(column, from_pandas=True).cast(pa.string()).fill_null("")


def _holds(line: str, columns: Sequence[Any], row: int, delimiter: str) -> bool:
    """Tell whether a line holds the values of a row: numbers as numbers, all else as text."""
    cells = next(csv.reader([line], delimiter=delimiter), [])
    return len(cells) == len(columns) and all(map(_same, cells, (_at(column, row) for column in columns)))


def _at(column: Any, row: int) -> Any:
    """Return one value of a column; of times its text without the zeros that other rows may need."""
    return column[row] if isinstance(column, np.ndarray) else Times(column.ns[row : row + 1], column.unit)


def _same(cell: str, value: Any) -> bool:
    """Tell whether a cell holds a value."""
    if isinstance(value, Times):
        return cell.startswith(value.text()[0].as_py())
    if isinstance(value, str):
        return cell == value
    return (cell == "" and bool(np.isnan(value))) or (cell != "" and float(cell) == value)
