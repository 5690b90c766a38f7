"""Rows of text as a CSV file that reads back as it was written."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from urmpipe_models.errors import Finding, OutputError


def write_rows(rows: Sequence[Sequence[str]], part: Path, path: Path) -> None:
    """Write rows of cells, the header first, and read them back.

    Args:
        rows: The cells, as text.
        part: Where to write them, as `guarded_output` gives it.
        path: The name the file is to have, for messages.

    Raises:
        OutputError: If they did not read back as they were written.
    """
    with part.open("w", encoding="utf-8", errors="surrogateescape", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
    with part.open(encoding="utf-8", errors="surrogateescape", newline="") as file:
        if list(csv.reader(file)) != [list(row) for row in rows]:
            raise OutputError(Finding("reads back otherwise than written", str(path)))
