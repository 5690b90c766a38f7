"""A table as CSV: one line a row, numbers that read back bit for bit."""

from __future__ import annotations

import csv
from pathlib import Path

from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.presentation.section import Advice, Cell, Judged, Place, Ref, Table, Value
from urmpipe_pipeline.text import csv_text, exact


def write_table(table: Table, part: Path, path: Path) -> None:
    """Write a table and read it back.

    The header holds the keys of the columns. Numbers stand in SI, in the shortest digits that are theirs; a
    cell is empty where there is no value.

    Raises:
        OutputError: If it did not read back as it was written.
    """
    cells = zip(*(map(_cell, column.cells) for column in table.columns), strict=True)
    rows = [[csv_text(column.key) for column in table.columns], *map(list, cells)]
    with part.open("w", encoding="utf-8", errors="surrogateescape", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
    with part.open(encoding="utf-8", errors="surrogateescape", newline="") as file:
        if list(csv.reader(file)) != rows:
            raise OutputError(Finding("differs when read back", str(path)))


def _cell(cell: Cell) -> str:
    match cell:
        case Value():
            return exact(cell.number)
        case Judged():
            return cell.verdict or ""
        case Ref():
            return csv_text(cell.title)
        case Place():
            return " ".join(map(exact, cell.position))
        case Advice():
            return csv_text(cell.words)
        case _:
            return csv_text(cell or "")
