"""CSV as every tool reads it: UTF-8, commas, decimal points, one line of names, empty cells for NaN."""

from __future__ import annotations

from pathlib import Path

from urmpipe_pipeline.presentation.exports import ExportTable
from urmpipe_pipeline.tables.lines import differences, quoted, texts, write_lines


def write_csv(table: ExportTable, path: Path) -> list[str]:
    """Write a table and return how the file differs from it, read back.

    Numbers have the shortest decimal text that gives the same double; times are exact.
    """
    head = ",".join(quoted(column.name) for column in table.columns) + "\n"
    values = texts([column.values for column in table.columns])
    write_lines(path, head, values, ",")
    return differences(path, head, values, ",")
