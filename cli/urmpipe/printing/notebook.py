"""Any result in a notebook: its verdict, the facts and tables that are brief, and its warnings, as HTML."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from urmpipe_models.display import HEAD
from urmpipe_models.errors import one_line
from urmpipe_pipeline import text
from urmpipe_pipeline.presentation.digits import unit_of, written
from urmpipe_pipeline.presentation.section import Fact, Presentation, Section, Table


def notebook_html(one: Presentation) -> str:
    """Return what a notebook shows of a result."""
    word = (one.verdict or one.word).upper()
    headline = f"<p><b>{_shown(word)}</b> {_shown(one.headline)}</p>"
    return headline + _facts(one.facts) + "".join(_section(one.body))


def _section(section: Section) -> Iterator[str]:
    yield from (_table(table) for table in section.tables if table.brief and table.columns)
    yield _facts(section.facts)
    if section.warnings:
        yield f"<ul>{''.join(f'<li>{_shown(one.message)}</li>' for one in section.warnings)}</ul>"
    for below in section.sections:
        if below.facts or below.tables or below.warnings:
            yield f"<p><b>{_shown(below.title)}</b></p>"
            yield from _section(below)


def _facts(facts: tuple[Fact, ...]) -> str:
    brief = [one for one in facts if one.brief and one.value not in (None, "")]
    rows = (
        f"<tr><th>{_shown(one.name)}</th><td>{_shown(written(one.value, unit=True))}</td></tr>"
        for one in brief
    )
    return f"<table>{''.join(rows)}</table>" if brief else ""


def _table(table: Table) -> str:
    """Return the first rows of the brief columns that have a value."""
    columns = [
        one
        for number, one in enumerate(table.columns)
        if one.brief and (not number or any(written(cell) != text.NOTHING for cell in one.cells))
    ]
    heads = (f"{one.title} [{unit}]" if (unit := unit_of(one.cells)) else one.title for one in columns)
    rows = len(table.columns[0].cells)
    lines = zip(*(map(written, one.cells[:HEAD]) for one in columns), strict=True)
    body = "".join(f"<tr>{''.join(f'<td>{_shown(cell)}</td>' for cell in line)}</tr>" for line in lines)
    more = f"<p>{HEAD} of {rows} rows</p>" if rows > HEAD else ""
    head = "".join(f"<th>{_shown(one)}</th>" for one in heads)
    return f"<p>{_shown(table.title)}</p><table><tr>{head}</tr>{body}</table>{more}"


def _shown(value: str) -> str:
    return escape(one_line(value))
