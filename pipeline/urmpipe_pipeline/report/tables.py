"""What a table of the report is made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from urmpipe_pipeline import text

LONG = 12
"""A table with more rows is folded away."""

MOST = 500
"""Rows of a table at most; what is left out is counted. The JSON output holds them all."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell.

    Attributes:
        text: What stands there.
        state: pass or fail, shown as a sign and a word; empty where it is no judgement.
        href: Where it leads, such as "#r1".
        used: Share of the tolerance that is used up, 0..1, shown as a bar under the number.
        most: True for what stands out of its column: shown bold.
    """

    text: str
    state: str = ""
    href: str = ""
    used: float | None = None
    most: bool = False


@dataclass(frozen=True, slots=True)
class Column:
    """One column: its head, and whether it holds numbers (set to the right) or words."""

    title: str
    number: bool = False


@dataclass(frozen=True, slots=True)
class Table:
    """One table; the first cell of a row is the row's head.

    Attributes:
        title: Its heading.
        columns: From the left.
        rows: One cell a column.
        folded: True if it is closed until someone opens it.
        note: A line under it.
    """

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    folded: bool = False
    note: str = ""
    kind: Literal["table"] = "table"


def words(*titles: str) -> tuple[Column, ...]:
    """Return columns of words."""
    return tuple(Column(title) for title in titles)


def numbers(*titles: str) -> tuple[Column, ...]:
    """Return columns of numbers."""
    return tuple(Column(title, True) for title in titles)


def listing(
    title: str, columns: tuple[Column, ...], rows: Iterable[Sequence[str]], *, folded: bool | None = None
) -> Table:
    """Return a table of plain cells: folded when it is long, cut with a note when it is very long."""
    cells = [tuple(Cell(value) for value in row) for row in rows]
    left = len(cells) - MOST
    note = f"{left} more; the JSON output lists them all." if left > 0 else ""
    return Table(title, columns, tuple(cells[:MOST]), len(cells) > LONG if folded is None else folded, note)


def without_empty_columns(table: Table) -> Table:
    """Return a table without the columns in which no row has a value."""
    kept = [i for i in range(len(table.columns)) if any(row[i].text != text.NOTHING for row in table.rows)]
    rows = tuple(tuple(row[i] for i in kept) for row in table.rows)
    return replace(table, columns=tuple(table.columns[i] for i in kept), rows=rows)


def judged(verdict: str | None) -> Cell:
    """Return a verdict as a sign and a word."""
    return Cell(text.NOTHING) if verdict is None else Cell(verdict.upper(), verdict)
