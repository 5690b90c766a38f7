"""What stands in a recording, as Rerun reads it."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader

from urmpipe_pipeline.presentation.palette import rgb


def columns(path: Path, entity: str, component: str) -> list[Any]:
    """Return the values of one component of an entity, row by row."""
    stream = RrdReader(path).store().stream().filter(content=entity, components=component)
    return [row for chunk in stream for row in chunk.to_record_batch().column(component).to_pylist()]


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
    (row,) = columns(path, entity, name)
    return row


def times_of(path: Path, entity: str) -> list[int]:
    """Return the times of an entity in [ns], in the order of writing."""
    stream = RrdReader(path).store().stream().filter(content=entity, is_static=False)
    return [at for chunk in stream for at in chunk.to_record_batch().column("t").cast("int64").to_pylist()]


def entities(path: Path, root: str = "/") -> set[str]:
    """Return what stands below a path."""
    chunks = RrdReader(path).store().stream().filter(content=f"{root.rstrip('/')}/**")
    return {chunk.entity_path for chunk in chunks}


def views(path: Path) -> dict[str, list[Any]]:
    """Return what the layout says, by component, in the order in which it was written."""
    reader = RrdReader(path)
    (entry,) = reader.blueprints()
    found: dict[str, list[Any]] = {}
    batches = [chunk.to_record_batch() for chunk in reader.stream(store=entry)]
    for batch in sorted(batches, key=lambda one: one.column("rerun.controls.RowId")[0].as_py()):
        for name in batch.schema.names:
            if ":" in name:
                values = batch.column(name).to_pylist()
                found.setdefault(name, []).extend(itertools.chain.from_iterable(filter(None, values)))
    return found


def packed(colour: str) -> int:
    """Return a colour as Rerun stores it: red, green, blue and full alpha in one number."""
    red, green, blue = rgb(colour)
    return (red << 24) + (green << 16) + (blue << 8) + 255
