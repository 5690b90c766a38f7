"""What is shown where there is little room: terminal, notebook, summary."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from urmpipe_pipeline import text
from urmpipe_pipeline.presentation.digits import unit_of, written
from urmpipe_pipeline.presentation.section import Column, Fact, Judged, Section, Table


def brief_facts(facts: Sequence[Fact]) -> list[Fact]:
    """Return the facts that are brief and have a value."""
    return [one for one in facts if one.brief and one.value not in (None, "")]


def brief_tables(section: Section) -> list[Table]:
    """Return the tables of a section that are brief and have a row."""
    return [one for one in section.tables if one.brief and one.columns and len(one.columns[0].cells)]


def brief_columns(table: Table) -> Iterator[Column]:
    """Yield the first column and the brief ones that have a value."""
    for number, one in enumerate(table.columns):
        valued = not number or any(written(cell) != text.NOTHING for cell in one.cells)
        if valued and one.brief:
            yield one


def rows_within(table: Table, most: int) -> slice:
    """Return the rows that are shown of a table: of one that ranks verdicts, the worst."""
    ranks = not table.worst_first and any(
        isinstance(cell, Judged) for one in table.columns for cell in one.cells
    )
    return slice(-most, None) if ranks and len(table.columns[0].cells) > most else slice(most)


def head(column: Column) -> str:
    """Return the title of a column with the unit of its values."""
    return " ".join(head_lines(column))


def head_lines(column: Column) -> list[str]:
    """Return the title of a column and, where they have one, the unit of its values."""
    unit = unit_of(column.cells)
    return [column.title, f"[{unit}]"] if unit else [column.title]
