"""Read a recording back before it gets its name: footer, row counts, some samples and the metadata."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from urmpipe_models.errors import Finding, OutputError, RecordingError
from urmpipe_pipeline.recording.entities import Block
from urmpipe_pipeline.recording.store import Store


def verify(part: Path, path: Path, every: Sequence[Block], metadata: str) -> None:
    """Hold what stands in the file against what was written.

    Args:
        part: The file as written.
        path: The name it is to have, for messages.
        every: What was written.
        metadata: The metadata that was written.

    Raises:
        OutputError: With everything that differs.
    """
    try:
        store = Store(part)
    except RecordingError as error:
        raise OutputError(
            Finding(f"could not be read back: {error.findings[0].message}", str(path))
        ) from error
    found = list(_differences(store, every, metadata))
    if found:
        raise OutputError(*(Finding(f"reads back otherwise than written: {one}", str(path)) for one in found))


def _differences(store: Store, every: Sequence[Block], metadata: str) -> Iterator[str]:
    if store.metadata != metadata:
        yield "the metadata"
    for block in every:
        if (rows := store.rows.get(block.entity, 0)) != len(block.t_ns):
            yield f"{block.entity} has {rows} rows of {len(block.t_ns)}"
        elif (row := _wrong_row(store, block)) is not None:
            yield f"{block.entity} in row {row}"


def _wrong_row(store: Store, block: Block) -> int | None:
    """Return the first of a block's verified rows that does not stand in the recording as it should.

    The writer sent the slices with these rows first, so that few chunks need to be read.
    """
    missing = set(block.verified)
    for chunk in store.chunks(block.entity):
        for row in sorted(missing):
            at = int(np.searchsorted(chunk.t_ns, block.t_ns[row]))
            if at == len(chunk.t_ns) or chunk.t_ns[at] != block.t_ns[row]:
                continue
            if not np.array_equal(chunk.values[at], block.values[row], equal_nan=True):
                return row
            missing.remove(row)
        if not missing:
            return None
    return min(missing, default=None)
