"""What stands in a recording, as Rerun reads it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader


def rows_of(path: Path, entity: str, name: str, timeline: str = "t") -> dict[int, list[Any]]:
    """Return one component of an entity by its times in [ns], or by another timeline."""
    found: dict[int, list[Any]] = {}
    for chunk in RrdReader(path).store().stream().filter(content=entity, components=name):
        batch = chunk.to_record_batch()
        if timeline in batch.schema.names:
            times = batch.column(timeline).to_numpy(zero_copy_only=False).astype(np.int64).tolist()
            found |= zip(times, batch.column(name).to_pylist(), strict=True)
    return dict(sorted(found.items()))


def static(path: Path, entity: str, name: str) -> Any:
    """Return one component of an entity that stands at all times."""
    stream = RrdReader(path).store().stream().filter(content=entity, components=name)
    (row,) = [row for chunk in stream for row in chunk.to_record_batch().column(name).to_pylist()]
    return row
