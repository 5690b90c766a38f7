"""What every export tells about itself, as far as its format can hold it, and which files tell it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from urmpipe_pipeline.json_values import json_ready

MARK = "urmpipe export"
"""Stands in every file that can hold it; only such a file is replaced."""

HEAD = 128
"""The mark of a MAT or TUM file stands within so many bytes of its start."""

PARQUET = b"PAR1"
"""Every Parquet file starts so."""


def is_export(path: Path) -> bool:
    """Tell whether a file is a MAT, TUM or Parquet file that urmpipe exported."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if head.startswith(PARQUET):
        from urmpipe_pipeline.tables.parquet_file import is_ours

        return is_ours(path)
    return MARK.encode() in head and head.startswith((b"# ", b"MATLAB 5.0"))


def described(about: Mapping[str, Any], rows: str) -> dict[str, Any]:
    """Return what a reader of the file needs to know: whose it is, what its rows are, where it came from."""
    return {"mark": MARK, "schema": 1, "name": about["name"], "rows": rows, **about}


def as_json(about: Mapping[str, Any]) -> str:
    """Return a description as JSON, which every encoding can hold."""
    return json.dumps(json_ready(about))
