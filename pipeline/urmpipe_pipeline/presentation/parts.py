"""Parts that several kinds of results share: tables of cells, input files, how a result was made."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Generic, TypeAlias, TypeVar, overload

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import SourceFile
from urmpipe_pipeline.presentation.palette import INK_COLOUR
from urmpipe_pipeline.presentation.scene import Spot
from urmpipe_pipeline.presentation.section import Cell, Column, Fact, Table, Value
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.text import format_option_value

Item = TypeVar("Item")

Heads: TypeAlias = Mapping[str, tuple[str, Callable[[Item], Cell]]]
"""The title of each column by its key, and what makes its cells."""


class Cells(Sequence[Cell], Generic[Item]):
    """The cells of a column that may be long, each made when it is shown.

    Args:
        items: What the rows are of.
        cell: Returns the cell of one.
    """

    def __init__(self, items: Sequence[Item], cell: Callable[[Item], Cell]) -> None:
        self._items, self._cell = items, cell

    def __len__(self) -> int:
        return len(self._items)

    @overload
    def __getitem__(self, index: int) -> Cell: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[Cell]: ...

    def __getitem__(self, index: int | slice) -> Cell | Sequence[Cell]:
        if isinstance(index, slice):
            return Cells(self._items[index], self._cell)
        return self._cell(self._items[index])


def columns_of(items: Sequence[Item], heads: Heads[Item]) -> tuple[Column, ...]:
    """Return columns about some items, a row each; their cells are made when they are shown."""
    return tuple(Column(key, title, Cells(items, cell)) for key, (title, cell) in heads.items())


def table_of(
    title: str,
    heads: Mapping[str, str],
    rows: Iterable[Sequence[Cell]],
    *,
    brief: bool = False,
    folded: bool = False,
) -> Table:
    """Return a table of rows, a cell a column; the titles of the columns stand by their keys."""
    cells = list(rows)
    columns = (Column(key, head, [row[i] for row in cells]) for i, (key, head) in enumerate(heads.items()))
    return Table(title, tuple(columns), brief=brief, folded=folded)


def rows_table(title: str, keys: Iterable[str], rows: Iterable[Mapping[str, Any]]) -> Table:
    """Return a table for CSV: rows of numbers in SI and words by their keys."""
    every = list(rows)
    return Table(title, tuple(Column(key, key, [_plain(row[key]) for row in every]) for key in keys))


def _plain(value: str | float | None) -> Cell:
    return value if value is None or isinstance(value, str) else Value(value)


def inputs_table(title: str, files: Iterable[SourceFile]) -> Table:
    """Return input files by name, length and hash."""
    heads = {"file": "File", "size": "Size [bytes]", "sha256": "SHA-256"}
    rows = [(file.name, Value(file.size), file.sha256) for file in files]
    return table_of(title, heads, rows, folded=True)


OPTION_UNITS = {
    "acceleration": "m/s2", "band": "m", "duration": "s", "force": "N", "jerk": "m/s3", "limit": "m",
    "period": "s", "start": "(rad, m)", "step": "s", "sync": "s", "tolerance": "m", "tsp": "s",
    "velocities": "m/s", "velocity": "m/s",
}  # fmt: skip
"""The units of options that are numbers, or lists of them."""


def provenance_table(
    provenance: Provenance, title: str = "How it was made", kinds: Mapping[str, str] | None = None
) -> Table:
    """Return how to repeat a result: command, options, versions, when.

    Args:
        provenance: How it was made.
        title: The title of the table.
        kinds: The SI unit of each kind of tolerance.
    """
    options = {name: option_words(name, value, kinds) for name, value in provenance.options.items()}
    rows = [("command", provenance.command), ("created", provenance.created)]
    rows += [(f"option {name}", words) for name, words in options.items()]
    rows += [(f"version of {name}", one) for name, one in provenance.versions.items()]
    return table_of(title, {"what": "What", "value": "Value"}, rows, folded=True)


def option_words(name: str, value: Any, kinds: Mapping[str, str] | None = None) -> str:
    """Return the value of an option as one line, numbers with their units: "0.25 m/s", {"axis": "3.5 mm"}."""
    return format_option_value(_in_unit(value, name, {**OPTION_UNITS, **(kinds or {})}))


def _in_unit(value: Any, name: str, units: Mapping[str, str]) -> Any:
    if isinstance(value, Mapping) and name in ("read", "tolerance"):  # the keys of others are no options
        return {key: _in_unit(one, key, units) for key, one in value.items()}
    if name not in units or isinstance(value, (str, bool, Mapping)) or value is None:
        return value
    if isinstance(value, (list, tuple)):
        return f"{', '.join(f'{one:.6g}' for one in value)} {units[name]}"
    return text.format_stated(value, units[name])


def recording_fact(recording: Path | None) -> Fact:
    """Return where a result is recorded; nothing is shown where it is not."""
    return Fact("Recording", "" if recording is None else str(recording), brief=False)


def minute(provenance: Provenance) -> str:
    """Return when a result was made, to the minute: "2026-11-22 10:30 UTC"."""
    created = minute_of(provenance.created)
    return f"{created} UTC" if created else ""


def minute_of(created: str) -> str:
    """Return a time of ISO 8601 to the minute: "2026-11-22 10:30"; empty stays empty."""
    return created[:16].replace("T", " ")


def ends(position: FloatArray) -> tuple[Spot, ...]:
    """Return where a path in [m], shape (n, 3), starts and ends."""
    known = np.flatnonzero(np.isfinite(position).all(axis=1))
    if not len(known):
        return ()
    return tuple(
        Spot(spot_at(position[row]), word, INK_COLOUR, always=False)
        for word, row in (("start", known[0]), ("end", known[-1]))
    )


def within_words(position: FloatArray) -> str:
    """Return between which corners a path in [m], shape (n, 3), stays: "within (0, ...) m and (1, ...) m"."""
    low, high = (text.format_point(end(position, axis=0)) for end in (np.nanmin, np.nanmax))
    return f"within ({low}) m and ({high}) m"


def spot_at(position: FloatArray) -> tuple[float, float, float]:
    """Return a place in [m] of shape (3,) as x, y, z."""
    x, y, z = (float(value) for value in position)
    return x, y, z
