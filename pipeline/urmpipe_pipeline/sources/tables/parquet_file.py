"""Parquet and Feather (Arrow's own file): the table that they hold, those of urmpipe with what they tell."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa

from urmpipe_models.errors import Finding, LogError
from urmpipe_pipeline.sources.tables.exact_clock import exact_times
from urmpipe_pipeline.sources.tables.frames import index_first
from urmpipe_pipeline.sources.tables.held import Held
from urmpipe_pipeline.sources.tables.own_tables import MARK, attributes_of, of_result, with_roles

CLOCK = "clock [ns]"
"""The exact clock of our own files; their times in s, ms and us are doubles."""


def read_parquet(path: Path, head: bytes) -> Held:
    """Return the table of a Parquet file, of which the first bytes are given.

    Raises:
        LogError: If it is encrypted or damaged.
    """
    import pyarrow.parquet as pq

    if head.startswith(b"PARE"):
        found = "found an encrypted Parquet file, allowed: one without encryption"
        raise LogError(Finding(found, str(path)))
    return _held(path, lambda: pq.ParquetFile(path).read(), "Parquet")


def read_feather(path: Path) -> Held:
    """Return the table of a Feather file (Arrow IPC).

    Raises:
        LogError: If it is damaged.
    """
    return _held(path, lambda: pa.ipc.open_file(pa.memory_map(str(path))).read_all(), "Feather")


def _held(path: Path, read: Callable[[], pa.Table], what: str) -> Held:
    try:
        table = read()
    except (pa.ArrowException, OSError) as error:
        reason = str(error).partition("\n")[0].partition(": ")[0].strip(" .")
        found = f"found a {what} file that cannot be read ({reason})"
        raise LogError(Finding(f"{found}, allowed: a whole one", str(path))) from None
    about = json.loads((table.schema.metadata or {}).get(MARK.encode(), b"null"))
    if about is None:
        told = attributes_of(table.schema.metadata)
        return Held(path.stem, of_result(index_first(table), told), path=path)
    return Held(path.stem, _ours(table, about), path=path)


def _ours(table: pa.Table, about: Any) -> pa.Table:
    """Return the table of a file of ours with what it tells of its columns, and its exact clock."""
    table = with_roles(table, about if about.get("rows") == "file" else {})
    if CLOCK not in table.column_names:
        return table
    clock = table.column(CLOCK)
    if (table.schema.field(CLOCK).metadata or {}).get(b"role"):
        return table  # the log's own clock
    return exact_times(table.drop_columns([CLOCK]), clock)
