"""Parquet and MATLAB's MAT (version 5): typed columns and arrays, with units and their origin.

Parquet has one column per column of the table, its unit in the metadata of the column, and the origin of the
table (JSON) in those of the schema. MAT, which MATLAB, Octave and SciPy load, has one struct named after the
kind of the result. Both are read back: the names and types, the number of rows, the first and the last row.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_models.errors import Finding, Hint, OutputError
from urmpipe_pipeline.outputs import EXPORT_HEADER
from urmpipe_pipeline.presentation.exports import DATE, DAY, TIME_OF_DAY, ExportTable, Times
from urmpipe_pipeline.subprocess_reader import mark_safe
from urmpipe_pipeline.tables.csv_files import EXPONENTS

METADATA_KEY = b"urmpipe"  # of our metadata in the schema of a Parquet file
CLOCK = "clock [ns]"  # column of the exact clock; the file's times are doubles where they count s, ms or us

DESCRIPTION_SIZE = 116  # bytes at the start of a MAT file that are free text
MAX_SIZE = 2**31 - 1  # bytes of a variable in version 5 of MAT


def write_parquet(table: ExportTable, about: str, path: Path) -> list[str]:
    """Write a table, and return how the file differs from it, read back.

    A missing sample is a null. The metadata `urmpipe` of the schema are `about` (JSON), the metadata `unit`
    of each column are its unit; the last column is the clock of the file in integer [ns], if it has one.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = table.columns
    arrays = [
        to_arrow_times(column.values)
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
    written = pa.Table.from_arrays(arrays, schema=pa.schema(fields, {METADATA_KEY: about.encode()}))
    pq.write_table(written, path)
    return find_parquet_differences(written, path)


def to_arrow_times(times: Times) -> Any:
    """Return times as an Arrow array of a type for them; [s], [ms] and [us] are doubles, rounded once.

    Times of day are durations if some are outside of a day.
    """
    import pyarrow as pa

    if times.unit == DATE:
        return pa.array(times.ns).cast(pa.timestamp("ns"))
    if times.unit == TIME_OF_DAY:
        is_within_day = times.ns.min(initial=0) >= 0 and times.ns.max(initial=0) < DAY
        return pa.array(times.ns).cast(pa.time64("ns") if is_within_day else pa.duration("ns"))
    if times.unit == "ns":
        return pa.array(times.ns)
    return pa.array(np.true_divide(times.ns, 10.0 ** EXPONENTS[times.unit], dtype=np.float64))


def is_our_parquet(path: Path) -> bool:
    """Return whether a file is Parquet that urmpipe wrote."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return METADATA_KEY in (pq.read_schema(path).metadata or {})
    except pa.ArrowException:
        return False


def find_parquet_differences(written: Any, path: Path) -> list[str]:
    """Return what of a file differs from an Arrow table: schema, number of rows, first and last row."""
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        differences = [] if file.schema_arrow.equals(written.schema, check_metadata=True) else ["the schema"]
        if file.metadata.num_rows != len(written):
            return [*differences, f"{file.metadata.num_rows} rows of {len(written)}"]
        ends = {
            0: file.read_row_group(0)[:1],
            len(written) - 1: file.read_row_group(file.num_row_groups - 1)[-1:],
        }
    return differences + [
        f"row {row + 1}" for row, end in ends.items() if not end.equals(written[row : row + 1])
    ]


def write_mat(name: str, fields: Mapping[str, Any], path: Path, target: Path) -> list[str]:
    """Write one struct, and return how the file differs from it, read back.

    Raises:
        OutputError: If it is larger than the format allows.
    """
    from scipy.io import savemat

    struct = {key: _to_matlab(value) for key, value in fields.items()}
    size = _byte_count(struct)
    if size > MAX_SIZE:
        allowed = f"{MAX_SIZE} in a MAT file of version 5"
        hint = Hint("to", "parquet", "takes all")
        raise OutputError(Finding(file=str(target), found=f"{size} bytes", allowed=allowed, hints=(hint,)))
    savemat(path, {name: struct}, appendmat=False, oned_as="column", long_field_names=True)
    with path.open("r+b") as file:
        file.write(f"MATLAB 5.0 MAT-file, {EXPORT_HEADER}".encode().ljust(DESCRIPTION_SIZE))
    differences = find_mat_differences(name, struct, path)
    mark_safe(path)
    return differences


def matlab_cells(items: Sequence[Any]) -> np.ndarray[tuple[int, int], np.dtype[np.object_]]:
    """Return n texts, numbers or structs as a row of MATLAB's cells [-], shape (1, n)."""
    row = np.empty((1, len(items)), dtype=object)
    for k, item in enumerate(items):
        row[0, k] = item
    return row


def _to_matlab(value: Any) -> Any:
    """Return a value with lists as rows of cells, at every depth, and arrays read."""
    if isinstance(value, Mapping):
        return {key: _to_matlab(item) for key, item in value.items()}
    if isinstance(value, list):
        return matlab_cells([_to_matlab(item) for item in value])
    return np.asarray(value) if hasattr(value, "__array__") else value


def _byte_count(value: Any) -> int:
    if isinstance(value, Mapping):
        return sum(map(_byte_count, value.values()))
    if isinstance(value, np.ndarray) and value.dtype == object:
        return sum(map(_byte_count, value.ravel()))
    return value.nbytes if isinstance(value, np.ndarray) else 0


def find_mat_differences(name: str, fields: Mapping[str, Any], path: Path) -> list[str]:
    """Return the paths in a struct at which a file differs: texts, shapes, first and last rows."""
    from scipy.io import loadmat

    content = loadmat(path, appendmat=False, struct_as_record=False, variable_names=[name])
    return list(_iter_mat_differences(name, dict(fields), content[name]))


def _iter_mat_differences(path: str, written: Any, read: Any) -> Iterator[str]:
    """Yield the paths of values that differ: of structs and cells at every depth."""
    if isinstance(written, dict):
        struct = read.item()
        for key, value in written.items():
            yield from _iter_mat_differences(f"{path}.{key}", value, getattr(struct, key))
    elif isinstance(written, np.ndarray) and written.dtype == object:
        if written.shape != read.shape:
            yield path
            return
        for k, (item, read_item) in enumerate(zip(written.ravel(), read.ravel(), strict=True), start=1):
            yield from _iter_mat_differences(f"{path}{{{k}}}", item, read_item)
    elif isinstance(written, np.ndarray):
        if not _has_same_ends(written, read):
            yield path
    elif (read.item() if read.size else "") != written:
        yield path


def _has_same_ends(written: Any, read: Any) -> bool:
    """Return whether two arrays have the same shape (a vector as a column), first and last row."""
    if (written.shape if written.ndim > 1 else (len(written), 1)) != read.shape:
        return False
    read = read.reshape(written.shape)
    ends = (0, -1) if len(written) else ()
    return all(np.array_equal(written[k], read[k], equal_nan=written.dtype.kind == "f") for k in ends)
