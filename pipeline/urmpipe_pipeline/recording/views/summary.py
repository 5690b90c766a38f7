"""The text beside the arm: the verdict first, then the facts and tables that are brief, then warnings."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.palette import colour_word
from urmpipe_pipeline.presentation.brief import brief_columns, brief_facts, brief_tables, head, rows_within
from urmpipe_pipeline.presentation.digits import written
from urmpipe_pipeline.presentation.section import Cell, Fact, Presentation, Ref, Section, Table

ROWS = 12
"""Rows of a table of verdicts that are shown; the others are counted. Of other tables only short ones are."""

LISTED = 4
"""Warnings that are listed; the others are counted."""


def summary(shown: Presentation) -> str:
    """Return a presentation in a few lines of Markdown."""
    word = (shown.verdict or shown.word).upper()
    head = f"{word}: {plain(shown.headline)}" if word else plain(shown.headline)
    lines = [f"### {head}", *_facts(shown.facts, strong=True)]
    told = {one.name for one in shown.facts}
    lines += _section(shown.body, told)
    if len(shown.body.sections) == 1:
        lines += _section(shown.body.sections[0], told)
    lines += _warnings(list(_all_warnings(shown.body)))
    lines += ["", _where_to_go(shown)]
    return "\n".join(lines)


def _where_to_go(shown: Presentation) -> str:
    where = f"{text.seconds(shown.opens_at_ns / 1e9)} s" if shown.opens_at_ns else ""
    if shown.opens_at_row:
        where = f"row {shown.opens_at_row + 1}"
    at = f"`urmpipe view` opens this at {where}. " if where else ""
    return f"{at}Everything else: `urmpipe report` with this file."


def _section(section: Section, told: set[str]) -> Iterator[str]:
    """Yield the facts that were not told yet, and the tables."""
    yield from _facts([one for one in section.facts if one.name not in told])
    if section.notice:
        yield from ("", f"**{plain(section.notice)}**")
    for table in brief_tables(section):
        if len(table.columns[0].cells) <= ROWS or rows_within(table, ROWS).start is not None:
            yield ""
            yield from _table(table)


def _facts(facts: Sequence[Fact], *, strong: bool = False) -> Iterator[str]:
    """Yield the brief facts in one paragraph."""
    mark = "**" if strong else ""
    told = [(plain(one.name), plain(_coloured(one.value, unit=True))) for one in brief_facts(facts)]
    if told:
        yield ""
        yield "; ".join(f"{name}: {mark}{value}{mark}" for name, value in told)


def _table(table: Table) -> Iterator[str]:
    """Yield the brief columns, and as many rows as fit."""
    columns, rows = list(brief_columns(table)), rows_within(table, ROWS)
    yield _row(map(head, columns))
    yield f"|{' --- |' * len(columns)}"
    for cells in zip(*(one.cells[rows] for one in columns), strict=True):
        yield _row(map(_coloured, cells))
    if (left := len(columns[0].cells) - ROWS) > 0:
        yield ""
        yield f"and {left} more, all in the report"


def _coloured(cell: Cell, *, unit: bool = False) -> str:
    """Return a cell, with the word for the colour in which its subject is drawn."""
    word = colour_word(cell.colour) if isinstance(cell, Ref) else ""
    return f"{written(cell, unit=unit)} ({word})" if word else written(cell, unit=unit)


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(map(plain, cells))} |"


def _all_warnings(section: Section) -> Iterator[LogWarning]:
    yield from section.warnings
    for one in section.sections:
        yield from _all_warnings(one)


def _warnings(warnings: Sequence[LogWarning]) -> Iterator[str]:
    """Yield the first warnings as a list."""
    every = list(dict.fromkeys(one.words("command line") for one in warnings))
    if every:
        yield from ("", f"Warnings: {len(every)}", "")
    yield from (f"- {plain(one)}" for one in every[:LISTED])
    if len(every) > LISTED:
        yield f"- and {len(every) - LISTED} more, all in the report"


def plain(value: str) -> str:
    """Return a text so that Markdown shows it as it is."""
    return re.sub(r"([\\`*_{}\[\]<>#|~!-])", r"\\\1", " ".join(text.encodable(value).split()))
