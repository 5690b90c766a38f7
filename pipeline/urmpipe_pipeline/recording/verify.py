"""Read a recording back before it gets its name: footer, row counts, some samples and the metadata."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from urmpipe_models.errors import Finding, OutputError, RecordingError
from urmpipe_pipeline.recording.codec import Column, Encoded
from urmpipe_pipeline.recording.store import SLICE, Store


def verify(part: Path, path: Path, encoded: Encoded, metadata: str) -> None:
    """Hold what stands in the file against what was written.

    Raises:
        OutputError: With everything that differs.
    """
    try:
        store = Store(part)
    except RecordingError as error:
        raise OutputError(
            Finding(f"could not be read back: {error.findings[0].sentence()}", str(path))
        ) from error
    found = list(_differences(store, encoded, metadata))
    if found:
        raise OutputError(*(Finding(f"differs when read back: {one}", str(path)) for one in found))


def _differences(store: Store, encoded: Encoded, metadata: str) -> Iterator[str]:
    if store.metadata != metadata:
        yield "the metadata"
    for column in encoded.columns:
        wanted = column.rows if column.plotted else -(-column.rows // SLICE)
        if (rows := store.rows.get(column.at, 0)) != wanted:
            yield f"{column.at} has {rows} rows of {wanted}"
        elif (row := _wrong_row(store, column, timed=column.at in encoded.clocks)) is not None:
            yield f"{column.at} in row {row + 1}"


def _wrong_row(store: Store, column: Column, *, timed: bool) -> int | None:
    """Return one of the verified rows of an array that does not stand in the recording as it should."""
    values = column.values if column.values.ndim else column.values.reshape(1)
    missing, t_ns = verified(column.rows), column.t_ns if timed else None
    for numbers, rows in store.parts(column.at, values.shape[1:], values.dtype, t_ns):
        for row in [row for row in missing if row in numbers]:
            if rows[int(np.argmax(numbers == row))].tobytes() != np.asarray(values[row]).tobytes():
                return row
            missing.remove(row)
        if not missing:
            return None
    return missing[0]


def verified(rows: int) -> list[int]:
    """Return the rows of an array that are read back: the first, the last and one between.

    The writer sends the slices with these rows first, so that few need to be read.
    """
    return sorted({0, rows // 2, rows - 1})
