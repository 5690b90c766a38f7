"""A result as HTML for a notebook: its verdict, and the facts, tables and warnings that are brief."""

from __future__ import annotations

from collections.abc import Iterator

from urmpipe_models.display import HEAD_ROWS
from urmpipe_models.errors import escape_html
from urmpipe_pipeline.presentation.brief import brief_columns, brief_facts, brief_tables, head, rows_within
from urmpipe_pipeline.presentation.digits import units_differ, written
from urmpipe_pipeline.presentation.section import Fact, Presentation, Section, Table


def notebook_page(name: str, presentation: Presentation) -> str:
    """Return the HTML of a presentation, under the name of the result's class."""
    word = (presentation.verdict or presentation.word).upper()
    headline = escape_html(presentation.headline)
    title = f"<p><b>{name}</b> {escape_html(word)} {headline}</p>"
    return title + _facts_html(presentation.facts) + "".join(_iter_section_html(presentation.body))


def _iter_section_html(section: Section) -> Iterator[str]:
    yield from map(_table_html, brief_tables(section))
    yield _facts_html(section.facts)
    if section.warnings:
        items = (f"<li>{escape_html(str(warning))}</li>" for warning in section.warnings)
        yield f"<ul>{''.join(items)}</ul>"
    for subsection in section.sections:
        if subsection.facts or subsection.tables or subsection.warnings:
            yield f"<p><b>{escape_html(subsection.title)}</b></p>"
            yield from _iter_section_html(subsection)


def _facts_html(facts: tuple[Fact, ...]) -> str:
    rows = [
        f"<tr><th>{escape_html(fact.name)}</th><td>{escape_html(written(fact.value, unit=True))}</td></tr>"
        for fact in brief_facts(facts)
    ]
    return f"<table>{''.join(rows)}</table>" if rows else ""


def _table_html(table: Table) -> str:
    columns, rows = list(brief_columns(table)), rows_within(table, HEAD_ROWS)
    count = len(columns[0].cells)
    heads = "".join(f"<th>{escape_html(head(column))}</th>" for column in columns)
    cells = (
        [written(cell, unit=units_differ(column.cells)) for cell in column.cells[rows]] for column in columns
    )
    lines = (
        f"<tr>{''.join(f'<td>{escape_html(cell)}</td>' for cell in row)}</tr>"
        for row in zip(*cells, strict=True)
    )
    more = f"<p>{HEAD_ROWS} of {count} rows</p>" if count > HEAD_ROWS else ""
    return f"<p>{escape_html(table.title)}</p><table><tr>{heads}</tr>{''.join(lines)}</table>{more}"
