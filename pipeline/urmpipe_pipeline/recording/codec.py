"""Any result as a JSON tree and named arrays, and back: by the types of its fields, knowing no kind."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from urmpipe_pipeline.recording.array_form import ArrayOf, Column, In, Out
from urmpipe_pipeline.recording.forms import form_of, has_default, parts_of, stored


@dataclass(frozen=True, slots=True, eq=False)
class Encoded:
    """A result taken apart.

    Attributes:
        tree: All but its arrays, as JSON has it.
        columns: Its arrays.
        entities: The path of each array by its `id` and that of its times; see `entity_of`.
        clocks: The path of the times by which the rows of a plotted array are known, by its own.
    """

    tree: Any
    columns: tuple[Column, ...]
    entities: Mapping[tuple[int, int], str]
    clocks: Mapping[str, str]

    def entity_of(self, array: Any, t_ns: Any = None) -> str:
        """Return the path of an array on some times; empty for one that has no values, which is not kept."""
        return self.entities.get((id(array), id(t_ns)), "")

    def packed(self, rows: int, kept: Container[str]) -> Encoded:
        """Return it with arrays of more rows packed, but those of some paths: they are not plotted."""
        columns = tuple(
            replace(one, plotted=one.plotted and (one.rows <= rows or one.at in kept)) for one in self.columns
        )
        plotted = {one.at for one in columns if one.plotted}
        clocks = {own: clock for own, clock in self.clocks.items() if own in plotted}
        return replace(self, columns=columns, clocks=clocks)


def encode(result: Any) -> Encoded:
    """Return the tree of a dataclass and its arrays.

    Raises:
        CodecError: If a field holds what its type does not allow.
    """
    at = Out("", None, [], {})
    cls: Any = type(result)
    tree = form_of(cls).write(result, at)
    return Encoded(tree, tuple(at.columns), at.paths, _clocks(at))


def _clocks(at: Out) -> dict[str, str]:
    """Return the path of the times of each plotted array whose times rise, so that they tell its rows."""
    times = {id(one.t_ns): one.t_ns for one in at.columns if one.plotted and one.t_ns is not None}
    paths = {key: at.paths.get((key, id(None))) for key, t_ns in times.items() if (np.diff(t_ns) > 0).all()}
    found = ((one.at, paths.get(id(one.t_ns))) for one in at.columns if one.plotted)
    return {own: clock for own, clock in found if clock is not None}


def decode(cls: Any, tree: Any, array: ArrayOf) -> Any:
    """Return the object of a dataclass that a tree made by `encode` tells, and its arrays by their paths.

    Raises:
        CodecError: If the tree tells what the types of its fields do not allow.
    """
    return form_of(cls).read(tree, In("", array))


def schema(classes: Sequence[type]) -> str:
    """Return what is stored of some classes and all that stand in them: a line a field, "=" for a default."""
    waiting, lines = list(classes), []
    for one in waiting:
        parts = parts_of(one)
        lines.append(one.__name__)
        for field in stored(one):
            lines.append(f"    {field.name}: {parts[field.name].text}{' =' if has_default(field) else ''}")
            waiting += [cls for cls in parts[field.name].classes if cls not in waiting]
    return "\n".join(lines) + "\n"
