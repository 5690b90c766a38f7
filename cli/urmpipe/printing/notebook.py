"""Any result in a notebook: its verdict, the facts and tables that are brief, and its warnings, as HTML."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from urmpipe_models.display import HEAD_ROWS
from urmpipe_models.errors import escape_html
from urmpipe_pipeline.presentation.brief import brief_columns, brief_facts, brief_tables, head, rows_within
from urmpipe_pipeline.presentation.digits import units_differ, written
from urmpipe_pipeline.presentation.section import Fact, Section, Table


def notebook_page(result: Any) -> str | None:
    """Return what a notebook shows of a result; None of what does not present itself."""
    from urmpipe_pipeline.results import is_result, present

    if not is_result(result):
        return None
    shown = present(result)
    word = (shown.verdict or shown.word).upper()
    headline = f"<p><b>{type(result).__name__}</b> {escape_html(word)} {escape_html(shown.headline)}</p>"
    return headline + _facts(shown.facts) + "".join(_section(shown.body))


def _section(section: Section) -> Iterator[str]:
    yield from map(_table, brief_tables(section))
    yield _facts(section.facts)
    if section.warnings:
        yield f"<ul>{''.join(f'<li>{escape_html(str(one))}</li>' for one in section.warnings)}</ul>"
    for below in section.sections:
        if below.facts or below.tables or below.warnings:
            yield f"<p><b>{escape_html(below.title)}</b></p>"
            yield from _section(below)


def _facts(facts: tuple[Fact, ...]) -> str:
    told = [(one.name, written(one.value, unit=True)) for one in brief_facts(facts)]
    rows = (f"<tr><th>{escape_html(name)}</th><td>{escape_html(value)}</td></tr>" for name, value in told)
    return f"<table>{''.join(rows)}</table>" if told else ""


def _table(table: Table) -> str:
    columns, shown = list(brief_columns(table)), rows_within(table, HEAD_ROWS)
    count = len(columns[0].cells)
    heads = "".join(f"<th>{escape_html(head(one))}</th>" for one in columns)
    cells = ([written(cell, unit=units_differ(one.cells)) for cell in one.cells[shown]] for one in columns)
    rows = zip(*cells, strict=True)
    lines = (f"<tr>{''.join(f'<td>{escape_html(cell)}</td>' for cell in row)}</tr>" for row in rows)
    more = f"<p>{HEAD_ROWS} of {count} rows</p>" if count > HEAD_ROWS else ""
    return f"<p>{escape_html(table.title)}</p><table><tr>{heads}</tr>{''.join(lines)}</table>{more}"
