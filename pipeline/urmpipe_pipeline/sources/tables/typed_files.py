"""Files whose columns have types: read as tables in memory."""

from __future__ import annotations

from pathlib import Path

from urmpipe_pipeline.sources.tables.held import Held


def read_typed(path: Path) -> Held | None:
    """Return the table of a file of typed columns; None of any other file, which may be text.

    Raises:
        LogError: If the file is damaged, or holds no table of columns.
    """
    return None
