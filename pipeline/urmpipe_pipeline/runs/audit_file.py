"""The audit of a run as a CSV file: a line for each thing that was undone, repaired, left or not decided."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from urmpipe_pipeline.csv_rows import write_rows
from urmpipe_pipeline.outputs import AUDIT_COLUMNS
from urmpipe_pipeline.runs.results import Run


def write_audit(run: Run, part: Path, path: Path) -> None:
    """Write the audit of a run and read it back: joint, row, t [s], kind, step [rad], from, to [turns].

    Args:
        run: The run.
        part: Where to write it, as `guarded_output` gives it.
        path: The name it is to have, for messages.

    Raises:
        OutputError: If it did not read back as it was written.
    """
    rows = [list(AUDIT_COLUMNS), *([str(cell) for cell in _cells(one.to_dict())] for one in run.audit)]
    write_rows(rows, part, path)


def _cells(entry: dict[str, Any]) -> list[Any]:
    """Return the cells of one entry."""
    return [entry[name] for name in AUDIT_COLUMNS]
