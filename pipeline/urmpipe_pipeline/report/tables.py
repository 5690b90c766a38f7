"""Tables and facts of a presentation as the page shows them: cells as text, and where they lead."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from urmpipe_models.errors import Finding
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.brief import head
from urmpipe_pipeline.presentation.digits import held, units_differ, written
from urmpipe_pipeline.presentation.section import (
    Cell,
    Column,
    Fact,
    Judged,
    Place,
    Ref,
    Section,
    Table,
    Value,
)

LONG = 12
"""A table with more rows is folded away."""

MOST = 500
"""Rows of a table at most; what is left out is counted. The JSON output holds them all."""

Href: TypeAlias = Callable[[Cell], str]
"""Returns where a cell leads; empty if it leads nowhere."""


class Anchors:
    """Where the sections of a result are on the page."""

    def __init__(self, body: Section, ident: str) -> None:
        """Number the sections below a result's own: 1, 1-2, 1-2-1."""
        self._body = body
        self._of: dict[int, str] = {}
        self._titled: dict[str, str] = {}
        self._number(body, ident)

    def _number(self, section: Section, ident: str) -> None:
        self._of[id(section)] = ident
        self._titled.setdefault(section.title, ident)
        for number, child in enumerate(section.sections, start=1):
            self._number(child, f"{ident}-{number}")

    def ident(self, section: Section) -> str:
        """Return the anchor of a section."""
        return self._of[id(section)]

    def is_body(self, section: Section) -> bool:
        """Tell whether a section is the result's own, above all others."""
        return section is self._body

    def href(self, cell: Cell) -> str:
        """Return where a cell leads, such as "#r1-2": the first section of its title; empty without one."""
        return f"#{self._titled[cell.title]}" if isinstance(cell, Ref) and cell.title in self._titled else ""


@dataclass(frozen=True, slots=True)
class ShownCell:
    """A cell of a table.

    Attributes:
        text: What is written there.
        state: pass or fail, shown as a sign and a word; empty where it is no judgement.
        href: Where it leads.
        used: Share of the limit that is used up, 0..1, shown as a bar under the number.
        most: True for what stands out of its column: shown bold.
        colour: As #rrggbb, in which its subject is drawn in figures; empty if it has none.
        exact: The number with all its digits in SI, for who points at it; empty for what has no more.
    """

    text: str
    state: str = ""
    href: str = ""
    used: float | None = None
    most: bool = False
    colour: str = ""
    exact: str = ""


@dataclass(frozen=True, slots=True)
class Grid:
    """A table; the first cell of a row is the row's head.

    Attributes:
        title: Its heading.
        heads: The head of each column, and whether it holds numbers (set to the right) or words.
        rows: One cell a column.
        folded: True if it is closed until someone opens it.
        note: A line under it.
    """

    title: str
    heads: tuple[tuple[str, bool], ...]
    rows: tuple[tuple[ShownCell, ...], ...]
    folded: bool
    note: str


@dataclass(frozen=True, slots=True)
class ShownFact:
    """A fact.

    Attributes:
        name: What it is of.
        value: What it is.
        help: What that means; empty where it explains itself.
        href: Where the value leads.
        leads: Whether it stands on a line of its own, before the others.
    """

    name: str
    value: str
    help: str = ""
    href: str = ""
    leads: bool = False


def from_worst(table: Table) -> Table:
    """Return a table whose rows are ranked from best to worst with the worst first; else the table."""
    if not table.page_title:
        return table
    columns = tuple(replace(one, cells=list(one.cells)[::-1]) for one in table.columns)
    return replace(table, title=table.page_title, columns=columns)


def grid(table: Table, href: Href, *, folds: bool = True) -> Grid:
    """Return a table without its empty columns, cut where it is very long."""
    rows = max((len(column.cells) for column in table.columns), default=0)
    drawn = [(column, list(_cells(column, href))) for column in table.columns if column.page]
    kept = [pair for pair in drawn if any(cell.text != text.NOTHING for cell in pair[1])]
    more = f"{rows - MOST} more; the JSON output lists them all." if rows > MOST else ""
    return Grid(
        table.title,
        tuple((head(column), _is_number(column)) for column, _ in kept),
        tuple(zip(*(cells for _, cells in kept), strict=True)),
        table.folded or (folds and rows > LONG),
        " ".join(filter(None, (more, table.note))),
    )


def errors_table(errors: Sequence[Finding]) -> Table:
    """Return why a part could not be judged, one line an error."""
    return Table(
        f"Errors ({len(errors)})",
        (
            Column("place", "Place", [one.place() for one in errors]),
            Column("message", "What", [one.sentence() for one in errors]),
        ),
    )


def warnings_table(warnings: Sequence[LogWarning]) -> Table:
    """Return what a person should know, one line a warning."""
    return Table(
        f"Warnings ({len(warnings)})",
        (
            Column("kind", "Kind", [one.kind for one in warnings]),
            Column("about", "About", [": ".join(filter(None, (one.about, one.column))) for one in warnings]),
            Column("row", "Row", [Value(one.row) for one in warnings]),
            Column("message", "What", [one.sentence() for one in warnings]),
        ),
    )


def shown_facts(facts: Sequence[Fact], href: Href) -> Iterator[ShownFact]:
    """Yield the facts that have a value, with what is allowed of it: first those that lead."""
    for fact in sorted(facts, key=lambda one: not one.leads):
        if not fact.page:
            continue
        value = held(fact.value) if isinstance(fact.value, Value) else written(fact.value, unit=True)
        if value != text.NOTHING:
            yield ShownFact(fact.name, value, fact.help, href(fact.value), fact.leads)


def _is_number(column: Column) -> bool:
    return any(isinstance(cell, (Value, Place)) for cell in column.cells[:MOST])


def _cells(column: Column, href: Href) -> Iterator[ShownCell]:
    """Yield the cells of a column; each has its unit if they differ."""
    unit = units_differ(column.cells)
    for cell in column.cells[:MOST]:
        shown = ShownCell(written(cell, unit=unit), href=href(cell))
        match cell:
            case Ref():
                yield replace(shown, colour=cell.colour)
            case Judged(verdict=str(verdict)):
                yield replace(shown, state=verdict)
            case Value(number=int() | float() as number):
                exact = f"{number!r} {cell.unit}" if isinstance(number, float) else ""
                state = "fail" if cell.verdict == "fail" else ""
                used = None if cell.used is None else min(cell.used, 1.0)
                yield replace(shown, state=state, used=used, most=cell.most, exact=exact)
            case _:
                yield shown
