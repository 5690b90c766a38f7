"""Any result in a terminal: its verdict, and the facts and tables that are brief.

1. Result: the verdict with its facts, the body, then the sections: of many judged ones those that fail.
2. Columns: a table that does not fit the terminal continues below, each part with its key columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from urmpipe.printing.terminal import LISTED, format_verdict, join_lines, new_console
from urmpipe_models.display import format_count
from urmpipe_models.errors import escape_line
from urmpipe_pipeline import text
from urmpipe_pipeline.presentation.brief import (
    brief_columns,
    brief_facts,
    brief_tables,
    head_lines,
    rows_within,
)
from urmpipe_pipeline.presentation.digits import units_differ, written
from urmpipe_pipeline.presentation.section import Advice, Cell, Fact, Judged, Presentation, Ref, Section

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

MAX_JUDGED = 3  # judged sections; of more, only those that fail are printed
MAX_SECTIONS = 5  # failing sections that are printed
MAX_KEY_WIDTH = 32  # characters of a key or of words in a column; longer ones are folded
COLUMN_GAP = 2  # blanks between two columns


def print_presentation(presentation: Presentation) -> None:
    """Print the brief content of a result."""
    console = new_console()
    _print_verdict(console, presentation)
    _print_section(console, presentation.body, {fact.name for fact in presentation.facts})
    sections = [
        section for section in presentation.body.sections if not section.errors
    ]  # those are on stderr
    selected = _select_sections(sections)
    for section in selected:
        _print_section(console, section)
    if hidden := len(sections) - len(selected):
        console.print(f"{format_count(hidden, 'more section')}: --json, or the report")


def print_verdict(presentation: Presentation, *, err: bool = False) -> None:
    """Print the verdict with its facts alone, on standard error if asked to: why a quiet command fails."""
    console = new_console()
    console.stderr = err
    _print_verdict(console, presentation)


def _print_verdict(console: Console, presentation: Presentation) -> None:
    line: str | Text = presentation.headline
    if presentation.verdict:
        line = format_verdict(presentation.verdict, presentation.headline)
    console.print(line, soft_wrap=True)
    for fact in brief_facts(presentation.facts):
        console.print(f"      {_format_fact(fact)}", soft_wrap=True)


def _select_sections(sections: Sequence[Section]) -> Sequence[Section]:
    judged = [section for section in sections if section.verdict is not None]
    if len(judged) <= MAX_JUDGED:
        return [
            section for section in sections if section.verdict is not None or section.facts or section.tables
        ]
    return [section for section in judged if section.verdict == "fail"][-MAX_SECTIONS:]


def _print_section(console: Console, section: Section, printed_facts: set[str] | None = None) -> None:
    for table in brief_tables(section):
        rows = rows_within(table, LISTED)
        columns = [
            TerminalColumn(
                head_lines(column),
                [_format_cell(cell, unit=units_differ(column.cells)) for cell in column.cells[rows]],
                key=not number,
                words=all(isinstance(cell, (str, Ref, Advice, type(None))) for cell in column.cells),
            )
            for number, column in enumerate(brief_columns(table))
        ]
        print_columns(console, f"{section.title}: {table.title}", columns)
        if (hidden := len(table.columns[0].cells) - LISTED) > 0:
            console.print(f"... and {hidden} more; --json lists all")
    for fact in brief_facts(section.facts):
        if fact.name not in (printed_facts or ()):
            console.print(f"  {_format_fact(fact)}", soft_wrap=True)


def _format_cell(cell: Cell, *, unit: bool) -> str | Text:
    return format_verdict(cell.verdict) if isinstance(cell, Judged) else written(cell, unit=unit)


def _format_fact(fact: Fact) -> str:
    return f"{fact.name}: {written(fact.value, unit=True)}"


class TerminalColumn(NamedTuple):
    """One column of a table in the terminal.

    Attributes:
        head: The lines of its head.
        cells: One per row; None where there is no value.
        key: Whether it names the rows: it is at the left of every part.
        words: Whether it holds words, which are left-aligned and folded; else numbers.
    """

    head: Sequence[str]
    cells: Sequence[str | Text | None]
    key: bool = False
    words: bool = False

    @property
    def width(self) -> int:
        """Characters of the widest line."""
        from rich.cells import cell_len

        lines = [*self.head, *(str(cell or text.NOTHING) for cell in self.cells)]
        width = max(cell_len(escape_line(line)) for line in lines)
        return min(width, MAX_KEY_WIDTH) if self.key or self.words else width


def print_columns(console: Console, title: str, columns: Sequence[TerminalColumn]) -> None:
    """Print columns as one table, or as several below each other if the terminal is too narrow."""
    console.print()
    console.print(title, style="italic", soft_wrap=True)
    keys = [column for column in columns if column.key]
    part = list(keys)
    for column in (column for column in columns if not column.key):
        width = sum(fitted.width + COLUMN_GAP for fitted in [*part, column])
        if len(part) > len(keys) and width > console.width:
            console.print(_build_table(part))
            part = list(keys)
        part.append(column)
    console.print(_build_table(part))


def _build_table(columns: Sequence[TerminalColumn]) -> Table:
    from rich import box
    from rich.table import Table

    # Blanks between columns: one of the box, the others of the padding.
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, COLUMN_GAP - 1, 0, 0))
    for column in columns:
        is_text = column.key or column.words
        table.add_column(
            join_lines(column.head),
            justify="left" if is_text else "right",
            width=column.width,
            no_wrap=not is_text,
            overflow="fold",
        )
    for row in zip(*(column.cells for column in columns), strict=True):
        table.add_row(*(text.NOTHING if cell is None else cell for cell in row))
    return table
