"""What stands in a recording file, as Rerun reads it."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader

from urmpipe_pipeline.palette import rgb


def columns(path: Path, entity: str, component: str) -> list[Any]:
    """Return the values of one component of an entity, row by row."""
    stream = RrdReader(path).store().stream().filter(content=entity, components=component)
    return [row for chunk in stream for row in chunk.to_record_batch().column(component).to_pylist()]


def times_of(path: Path, entity: str) -> list[int]:
    """Return the times of an entity in [ns], in the order of writing."""
    stream = RrdReader(path).store().stream().filter(content=entity, is_static=False)
    return [at for chunk in stream for at in chunk.to_record_batch().column("t").cast("int64").to_pylist()]


def views(path: Path) -> dict[str, list[Any]]:
    """Return what the layout says, by component."""
    reader = RrdReader(path)
    (entry,) = reader.blueprints()
    found: dict[str, list[Any]] = {}
    for chunk in reader.stream(store=entry):
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if ":" in name:
                values = batch.column(name).to_pylist()
                found.setdefault(name, []).extend(itertools.chain.from_iterable(filter(None, values)))
    return found


def packed(colour: str) -> int:
    """Return a colour as Rerun stores it: red, green, blue and full alpha in one number."""
    red, green, blue = rgb(colour)
    return (red << 24) + (green << 16) + (blue << 8) + 255
