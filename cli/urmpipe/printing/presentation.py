"""Any result in the terminal: its verdict, the facts and tables that are brief, section by section."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from urmpipe.printing.columns import Column, print_columns
from urmpipe.printing.terminal import LISTED, judged, judged_line, new_console
from urmpipe_pipeline import text
from urmpipe_pipeline.presentation import section as shown
from urmpipe_pipeline.presentation.digits import unit_of, written

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

MANY = 3
"""With more judged sections than these, only those that fail are printed."""

SECTIONS = 5
"""Sections that are printed at most."""


def print_presentation(one: shown.Presentation) -> None:
    """Print what a result shows, as far as it is brief."""
    console = new_console()
    _print_verdict(console, one)
    _print_section(console, one.body)
    sections = _chosen(one.body.sections)
    for section in sections:
        _print_section(console, section)
    if left := len(one.body.sections) - len(sections):
        console.print(f"{text.counted(left, 'more section')}: --json, or the report")


def print_verdict(one: shown.Presentation, *, err: bool = False) -> None:
    """Print the verdict and its facts alone, on standard error if asked to: why a quiet command fails."""
    console = new_console()
    console.stderr = err
    _print_verdict(console, one)


def _print_verdict(console: Console, one: shown.Presentation) -> None:
    console.print(judged_line(one.verdict, one.headline) if one.verdict else one.headline, soft_wrap=True)
    for fact in _brief(one.facts):
        console.print(f"      {_fact(fact)}", soft_wrap=True)


def _chosen(sections: Sequence[shown.Section]) -> Sequence[shown.Section]:
    """Return the sections that are printed: of many judged ones those that fail."""
    judged_ones = [one for one in sections if one.verdict is not None]
    if len(judged_ones) <= MANY:
        return [one for one in sections if one.verdict is not None or one.facts or one.tables]
    return [one for one in judged_ones if one.verdict == "fail"][-SECTIONS:]


def _print_section(console: Console, section: shown.Section) -> None:
    for table in section.tables:
        if table.brief and table.columns and len(table.columns[0].cells):
            _print_table(console, section, table)
    for fact in _brief(section.facts):
        console.print(f"  {_fact(fact)}", soft_wrap=True)


def _print_table(console: Console, section: shown.Section, table: shown.Table) -> None:
    """Print the brief columns of a table that have a value, and as many rows as a person reads."""
    rows = len(table.columns[0].cells)
    print_columns(console, f"{section.title}: {table.title}", list(_columns(table)))
    if rows > LISTED:
        console.print(f"... and {rows - LISTED} more; --json lists all")


def _columns(table: shown.Table) -> Iterator[Column]:
    for number, one in enumerate(table.columns):
        cells = one.cells[:LISTED]
        if one.brief and (not number or any(written(cell) != text.NOTHING for cell in cells)):
            unit = unit_of(one.cells)
            head = f"{one.title}\n[{unit}]" if unit else one.title
            yield Column(head, [_cell(cell) for cell in cells], key=not number)


def _cell(cell: shown.Cell) -> str | Text:
    return judged(cell.verdict) if isinstance(cell, shown.Judged) else written(cell)


def _brief(facts: Sequence[shown.Fact]) -> Iterator[shown.Fact]:
    """Yield the facts that are shown where there is little room."""
    return (one for one in facts if one.brief and one.value not in (None, ""))


def _fact(one: shown.Fact) -> str:
    return f"{one.name}: {written(one.value, unit=True)}"
