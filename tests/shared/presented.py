"""What tests ask of a presentation: columns by their keys, facts by their names, arrays to be left alone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from asserting import there
from urmpipe_pipeline.presentation.figure import Figure
from urmpipe_pipeline.presentation.scene import Scene
from urmpipe_pipeline.presentation.section import Cell, Presentation, Section, Table, Value


def cells(table: Table) -> dict[str, list[Any]]:
    """The plain values of a table by the keys of its columns: of a value its number."""
    return {column.key: [plain(cell) for cell in column.cells] for column in table.columns}


def plain(cell: Cell) -> Any:
    """The number of a value, and any other cell as it is."""
    return cell.number if isinstance(cell, Value) else cell


def facts(section: Section) -> dict[str, Any]:
    """The facts of a section by their names."""
    return {fact.name: plain(fact.value) for fact in section.facts}


def figures(section: Section) -> list[Figure]:
    """The plots of a section."""
    return [one for one in section.figures() if isinstance(one, Figure)]


def scene_of(shown: Presentation) -> Scene:
    """The scene of what has one."""
    return there(there(shown.scene)())


def every_section(section: Section) -> Iterator[Section]:
    """The section and all below it."""
    yield section
    for below in section.sections:
        yield from every_section(below)


class Untouched:
    """Stands for an array that nobody may look into."""

    def __init__(self, rows: int) -> None:
        self._rows = rows

    def __len__(self) -> int:
        return self._rows

    def __getitem__(self, index: object) -> Any:
        raise AssertionError("looked into")

    def __array__(self, *args: object, **more: object) -> Any:
        raise AssertionError("looked into")
