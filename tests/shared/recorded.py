"""What stands in a recording, as Rerun reads it."""

from __future__ import annotations

import itertools
import math
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np
from rerun.chunk import RrdReader

from urmpipe_pipeline.recording.reader import Store
from urmpipe_pipeline.recording.views.plots import SHARED_AXIS

KINDS = {1: "Tabs", 2: "Horizontal", 3: "Vertical", 4: "Grid"}
"""Containers by Rerun's numbers."""

HIDDEN = "", "instruction_ids", "space_origin"
"""What a layout leaves out: numbers that are drawn anew each time, and places that its contents repeat."""


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


def drawing(path: Path, *roots: str) -> str:
    """Return what stands below some entities: at which times each component is there, and what it is."""
    found: dict[tuple[str, str, str], list[tuple[int, Any]]] = defaultdict(list)
    for chunk in (
        one for root in roots for one in RrdReader(path).store().stream().filter(content=f"{root}/**")
    ):
        batch, timeline = chunk.to_record_batch(), next(iter(chunk.timeline_names), "")
        at = batch.column(timeline).cast("int64").to_pylist() if timeline else [0] * batch.num_rows
        for name in (one for one in batch.schema.names if ":" in one):
            values = zip(at, batch.column(name).to_pylist(), strict=True)
            found[chunk.entity_path, name, timeline] += [row for row in values if row[1] is not None]
    lines = []
    for entity, keys in itertools.groupby(sorted(found), key=lambda key: key[0]):
        lines.append(entity)
        for _, name, timeline in keys:
            rows = sorted(found[entity, name, timeline], key=lambda row: row[0])
            there, gone = ([at for at, row in rows if bool(row) is wanted] for wanted in (True, False))
            when = f" at {_times(there, timeline)}" if timeline else ""
            when += f", none at {_times(gone, timeline)}" if gone else ""
            lines.append(f"  {name}{when}: {_text([row for _, row in rows if row], name)}")
    return "\n".join(lines)


def layout(path: Path, *, whole: bool = True) -> str:
    """Return where a recording opens, and its views as an indented list, with their properties or without."""
    reader, parts = RrdReader(path), defaultdict[str, dict[str, Any]](dict)
    (entry,) = reader.blueprints()
    for chunk in reader.stream(store=entry):
        batch = chunk.to_record_batch()
        own = {name.partition(":")[2]: batch.column(name)[0].as_py() for name in batch.schema.names}
        parts[chunk.entity_path.lstrip("/")] |= own

    def line(at: str) -> str:
        own = {name: value for name, value in sorted(parts[at].items()) if name not in HIDDEN}
        kind = [KINDS[one] for one in own.pop("container_kind", [])] + own.pop("class_identifier", [])
        contents = own.pop("contents", [])
        if "active_tab" in own:
            own["active_tab"] = contents.index(own["active_tab"][0])
        words = [*kind, *own.pop("display_name", []), *(f"{name}={_text(own[name], name)}" for name in own)]
        return " ".join(words) + (" (its axis is that of all)" if at.endswith(str(SHARED_AXIS)) else "")

    def lines(at: str, margin: str) -> Iterator[str]:
        yield margin + line(at)
        for one in parts[at].get("contents", []):
            yield from lines(one, f"{margin}  ")
        for one in sorted(name for name in parts if whole and name.startswith(f"{at}/")):
            yield f"{margin}    {re.sub('/visualizers.*', '', one.removeprefix(f'{at}/'))} {line(one)}"

    root = UUID(bytes=bytes(parts["viewport"]["root_container"][0]))
    timeline, at = Store(path).opening
    return "\n".join([f"opens at {timeline} {at}: {line('time_panel')}", *lines(f"container/{root}", "")])


def _times(at: list[int], timeline: str) -> str:
    """Return times in [ms] or rows, those at equal distances from the first to the last."""
    runs: list[list[int]] = []
    for one in at:
        if runs and (len(runs[-1]) == 1 or one - runs[-1][-1] == runs[-1][1] - runs[-1][0]):
            runs[-1].append(one)
        else:
            runs.append([one])
    scale, unit = (1e-6, "ms") if timeline == "t" else (1, timeline)
    said = []
    for run in runs:
        ends = [f"{scale * one:.10g}" for one in run]
        step = f"{scale * (run[-1] - run[-2]):.10g}" if run[2:] else ""
        said.append(f"{ends[0]} to {ends[-1]} by {step}" if step else ", ".join(ends))
    some = said if len(said) <= 8 else [*said[:2], f"... {len(at)} ...", said[-1]]
    return f"{', '.join(some)} {unit}"


def _text(value: Any, name: str) -> str:
    """Return a component: numbers to four digits, of many values the first, how many, and the last."""
    if isinstance(value, list):
        if len(value) == 1:
            return _text(value[0], name)
        if "quaternion" in name and isinstance(value[0], float):  # both signs are the same turn
            value = [one * math.copysign(1, next(filter(lambda at: abs(at) > 1e-6, value))) for one in value]
        some = value if len(value) <= 6 else [*value[:2], f"... {len(value)} ...", value[-1]]
        return f"[{', '.join(_text(one, name) for one in some)}]"
    if isinstance(value, float):
        return f"{round(value, 9) + 0.0:.4g}"
    return (
        f"#{value:08x}"
        if name.endswith("colors") and isinstance(value, int)
        else str(value).replace("\n", "\\n")
    )
