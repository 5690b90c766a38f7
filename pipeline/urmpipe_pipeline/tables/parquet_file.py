"""Parquet: typed columns, each with its unit, and where they came from in the metadata."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from urmpipe_pipeline.presentation.exports import ExportTable, Times
from urmpipe_pipeline.tables.times import typed

KEY = b"urmpipe"
"""The key of our metadata in a file's schema."""

CLOCK = "clock [ns]"
"""The column of the exact clock; the file's own times are doubles where they count s, ms or us."""


def write_parquet(table: ExportTable, about: str, path: Path) -> list[str]:
    """Write a table and return how the file differs from it, read back.

    A missing sample is a null. The metadata `urmpipe` of the schema are `about` (JSON), the metadata `unit`
    of each column are its unit; the last column is the clock of the file in integer [ns], if it has one.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = table.columns
    arrays = [
        typed(column.values)
        if isinstance(column.values, Times)
        else pa.array(column.values, from_pandas=column.values.dtype.kind == "f")
        for column in columns
    ]
    fields = [
        pa.field(column.name, array.type, metadata={b"unit": column.unit.encode()})
        for column, array in zip(columns, arrays, strict=True)
    ]
    if table.clock_ns is not None and CLOCK not in [column.name for column in columns]:
        arrays.append(pa.array(table.clock_ns))
        fields.append(pa.field(CLOCK, pa.int64(), metadata={b"unit": b"ns"}))
    written = pa.Table.from_arrays(arrays, schema=pa.schema(fields, {KEY: about.encode()}))
    pq.write_table(written, path)
    return differences(written, path)


def is_ours(path: Path) -> bool:
    """Tell whether a file is Parquet that urmpipe wrote."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return KEY in (pq.read_schema(path).metadata or {})
    except pa.ArrowException:
        return False


def differences(written: Any, path: Path) -> list[str]:
    """Return how a file differs from an Arrow table: its schema, its rows, its first and last row."""
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        found = [] if file.schema_arrow.equals(written.schema, check_metadata=True) else ["the schema"]
        if file.metadata.num_rows != len(written):
            return [*found, f"{file.metadata.num_rows} rows of {len(written)}"]
        ends = {
            0: file.read_row_group(0)[:1],
            len(written) - 1: file.read_row_group(file.num_row_groups - 1)[-1:],
        }
    return found + [f"row {row + 1}" for row, end in ends.items() if not end.equals(written[row : row + 1])]
