"""Any result in the terminal: its verdict, the facts and tables that are brief, section by section."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from urmpipe.printing.columns import Column, print_columns
from urmpipe.printing.terminal import LISTED, judged, judged_line, new_console
from urmpipe_pipeline import text
from urmpipe_pipeline.presentation import section as shown
from urmpipe_pipeline.presentation.brief import (
    brief_columns,
    brief_facts,
    brief_tables,
    head_lines,
    rows_within,
)
from urmpipe_pipeline.presentation.digits import units_differ, written

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

MANY = 3
"""With more judged sections than these, only those that fail are printed."""

SECTIONS = 5
"""Sections that are printed at most."""


def print_presentation(one: shown.Presentation, *, every: bool = False) -> None:
    """Print what a result shows, as far as it is brief.

    Args:
        one: The presentation.
        every: Print all columns of the tables of its body, brief or not.
    """
    console = new_console()
    _print_verdict(console, one)
    told = {fact.name for fact in one.facts}
    _print_section(console, one.body, told, every=every)
    below = [part for part in one.body.sections if not part.errors]  # those are on standard error
    sections = _chosen(below)
    for section in sections:
        _print_section(console, section, set())
    if left := len(below) - len(sections):
        console.print(f"{text.counted(left, 'more section')}: --json, or the report")


def print_verdict(one: shown.Presentation, *, err: bool = False) -> None:
    """Print the verdict and its facts alone, on standard error if asked to: why a quiet command fails."""
    console = new_console()
    console.stderr = err
    _print_verdict(console, one)


def _print_verdict(console: Console, one: shown.Presentation) -> None:
    console.print(judged_line(one.verdict, one.headline) if one.verdict else one.headline, soft_wrap=True)
    for fact in brief_facts(one.facts):
        console.print(f"      {_fact(fact)}", soft_wrap=True)


def _chosen(sections: Sequence[shown.Section]) -> Sequence[shown.Section]:
    """Return the sections that are printed: of many judged ones those that fail."""
    judged_ones = [one for one in sections if one.verdict is not None]
    if len(judged_ones) <= MANY:
        return [one for one in sections if one.verdict is not None or one.facts or one.tables]
    return [one for one in judged_ones if one.verdict == "fail"][-SECTIONS:]


def _print_section(console: Console, section: shown.Section, told: set[str], *, every: bool = False) -> None:
    """Print the tables of a section, and its facts but those that were told."""
    for table in brief_tables(section):
        _print_table(console, section, table, every=every)
    for fact in brief_facts(section.facts):
        if fact.name not in told:
            console.print(f"  {_fact(fact)}", soft_wrap=True)


def _print_table(console: Console, section: shown.Section, table: shown.Table, *, every: bool) -> None:
    """Print the columns of a table that have a value, and as many rows as a person reads."""
    rows = rows_within(table, LISTED)
    columns = [
        Column(
            head_lines(one),
            [_cell(cell, unit=units_differ(one.cells)) for cell in one.cells[rows]],
            key=not number,
            words=all(isinstance(cell, (str, shown.Ref, shown.Advice, type(None))) for cell in one.cells),
        )
        for number, one in enumerate(brief_columns(table, every=every))
    ]
    print_columns(console, f"{section.title}: {table.title}", columns)
    if (more := len(table.columns[0].cells) - LISTED) > 0:
        console.print(f"... and {more} more; --json lists all")


def _cell(cell: shown.Cell, *, unit: bool) -> str | Text:
    return judged(cell.verdict) if isinstance(cell, shown.Judged) else written(cell, unit=unit)


def _fact(one: shown.Fact) -> str:
    return f"{one.name}: {written(one.value, unit=True)}"
