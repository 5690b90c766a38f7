"""Parquet and Feather (Arrow's own file): the table that they hold, those of urmpipe with what they tell."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from urmpipe_models.errors import Finding, LogError
from urmpipe_pipeline.logs.options import LogMap
from urmpipe_pipeline.logs.tables.exact_clock import exact_times
from urmpipe_pipeline.logs.tables.frames import index_first
from urmpipe_pipeline.logs.tables.held import MemoryTable
from urmpipe_pipeline.logs.tables.lerobot import EPISODE, chosen_episode, with_names
from urmpipe_pipeline.logs.tables.limits import refuse_unpacked
from urmpipe_pipeline.logs.tables.own_tables import MARK, attributes_of, of_result, told_in, with_roles

CLOCK = "clock [ns]"
"""The exact clock of our own files; their times in s, ms and us are doubles."""


def read_parquet(path: Path, head: bytes, options: LogMap) -> MemoryTable:
    """Return the table of a Parquet file, of which the first bytes are given.

    Of a file of episodes (LeRobot), only the rows of a given episode are read, and no images.

    Raises:
        LogError: If it is encrypted or damaged.
    """
    import pyarrow.parquet as pq

    if head.startswith(b"PARE"):
        found = "found an encrypted Parquet file, allowed: one without encryption"
        raise LogError(Finding(found, str(path)))
    applied: list[str] = []

    def read() -> pa.Table:
        with pq.ParquetFile(path) as file:
            refuse_unpacked(path, _unpacked(file.metadata))
            if EPISODE not in file.schema_arrow.names:
                return file.read()
            columns = [field.name for field in file.schema_arrow if not _is_image(field.type)]
            numbers = sorted(pc.unique(file.read([EPISODE]).column(EPISODE)).drop_null().to_pylist())
        column, _, value = (options.episode or "").rpartition("=")
        asks = options.rows is None and column in ("", EPISODE)
        number = chosen_episode(path, numbers, value or None) if asks and numbers else None
        applied.extend(["episode"] * (number is not None))
        rows = None if number is None else [(EPISODE, "==", number)]
        return with_names(pq.read_table(path, columns=columns, filters=rows, partitioning=None), path)

    return replace(_held(path, read, "Parquet"), applied=tuple(applied))


def _is_image(kind: pa.DataType) -> bool:
    return bool(pa.types.is_struct(kind) and any(pa.types.is_binary(field.type) for field in kind))


def read_feather(path: Path) -> MemoryTable:
    """Return the table of a Feather file (Arrow IPC).

    Raises:
        LogError: If it is damaged.
    """

    def read() -> pa.Table:
        unpacked, batches = 0, []
        with (
            pa.OSFile(str(path)) as source,
            pa.ipc.open_file(source) as file,
        ):  # mapped, it could shrink under us
            for number in range(file.num_record_batches):
                batches.append(file.get_batch(number))
                unpacked += batches[-1].nbytes
                refuse_unpacked(path, unpacked)
            return pa.Table.from_batches(batches, file.schema)

    return _held(path, read, "Feather")


def _unpacked(about: Any) -> int:
    """Return the bytes that a Parquet file says its columns take: of repeated values it holds one."""
    groups = map(about.row_group, range(about.num_row_groups))
    chunks = (group.column(k) for group in groups for k in range(group.num_columns))
    return sum(max(chunk.total_uncompressed_size, 8 * chunk.num_values) for chunk in chunks)


def _held(path: Path, read: Callable[[], pa.Table], what: str) -> MemoryTable:
    try:
        table = read()
        table.validate()
    except (pa.ArrowException, OSError) as error:
        reason = str(error).partition("\n")[0].partition(": ")[0].strip(" .")
        found = f"found a {what} file that cannot be read ({reason})"
        raise LogError(Finding(f"{found}, allowed: a whole one", str(path))) from None
    about = told_in(table.schema.metadata, MARK)
    if not about and MARK.encode() in (table.schema.metadata or {}):
        found = f"found a {what} file of urmpipe whose metadata are damaged"
        raise LogError(Finding(f"{found}, allowed: as `export` wrote it", str(path)))
    if not about:
        told = attributes_of(table.schema.metadata)
        return MemoryTable(path.stem, of_result(index_first(table), told), path=path)
    return MemoryTable(path.stem, _ours(table, about), path=path)


def _ours(table: pa.Table, about: Mapping[str, Any]) -> pa.Table:
    """Return the table of a file of ours with what it tells of its columns, and its exact clock."""
    table = with_roles(table, about if about.get("rows") == "file" else {})
    if CLOCK not in table.column_names:
        return table
    clock = table.column(CLOCK)
    if (table.schema.field(CLOCK).metadata or {}).get(b"role"):
        return table  # the log's own clock
    return exact_times(table.drop_columns([CLOCK]), clock)
