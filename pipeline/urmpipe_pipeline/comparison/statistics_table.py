"""The statistics of a comparison as CSV: one line a log and quantity, numbers that read back bit for bit."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Statistics
from urmpipe_pipeline.csv_rows import write_rows
from urmpipe_pipeline.text import exact

COLUMNS = ("run", "sync_offset", *(field.name for field in fields(Statistics)))
"""The header; lengths are in m, angles in rad, times in s."""


def write_statistics(result: Comparison, part: Path, path: Path) -> None:
    """Write the statistics of a comparison and read them back.

    Numbers stand in the shortest digits that are theirs; a cell is empty where there is no value.

    Args:
        result: The comparison.
        part: Where to write it, as `guarded_output` gives it.
        path: The name it is to have, for messages.

    Raises:
        OutputError: If it did not read back as it was written.
    """
    rows = [list(COLUMNS), *([exact(row[name]) for name in COLUMNS] for row in result.rows())]
    write_rows(rows, part, path)
