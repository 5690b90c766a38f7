"""The text beside the arm: the verdict and what explains it first, warnings next, further tables last."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.brief import brief_columns, brief_facts, brief_tables, head, rows_within
from urmpipe_pipeline.presentation.digits import units_differ, written
from urmpipe_pipeline.presentation.palette import colour_name
from urmpipe_pipeline.presentation.scene import Path, Scene
from urmpipe_pipeline.presentation.section import Cell, Fact, Judged, Presentation, Ref, Section, Table

ROWS = 12
"""Rows of a table of verdicts that are shown; the others are counted. Of other tables only short ones are."""

LISTED = 4
"""Warnings that are listed; the others are counted."""

NAMED = 12
"""Paths whose colours are told; the others are counted."""


def summary(shown: Presentation, scene: Scene | None = None) -> tuple[str, str]:
    """Return a presentation as Markdown: a few lines that are seen at once, and further tables below."""
    word = (shown.verdict or shown.word).upper()
    title = f"{word}: {plain(shown.headline)}" if word else plain(shown.headline)
    sections = [shown.body, *(shown.body.sections if len(shown.body.sections) == 1 else ())]
    told = {one.name for one in shown.facts}
    lines = [f"### {title}", *_facts(shown.facts, strong=True)]
    for section in sections:
        lines += _facts([one for one in section.facts if one.name not in told])
        lines += ["", f"**{plain(section.notice)}**"] if section.notice else []
    tables = list(_tables(sections))
    lines += [line for one in tables if _has_verdicts(one) for line in _table(one)]
    lines += _colours(scene.paths if scene is not None else (), "\n".join(lines))
    lines += _warnings(list(_all_warnings(shown.body)))
    lines += ["", _where_to_go(shown)]
    below = (line for one in tables if not _has_verdicts(one) for line in _table(one))
    return "\n".join(lines), "\n".join(below)


def _where_to_go(shown: Presentation) -> str:
    at = f"{text.format_seconds(shown.opens_at_ns / 1e9)} s" if shown.opens_at_ns else ""
    at = f"row {shown.opens_at_row + 1}" if shown.opens_at_row else at
    opens = f"`urmpipe view` opens this at {at}, other programs at the beginning. " if at else ""
    return f"{opens}Everything else: `urmpipe report` with this file."


def _tables(sections: Sequence[Section]) -> Iterator[Table]:
    """Yield the tables there is room for; of several about the same things the first."""
    about: set[tuple[str, ...]] = set()
    for table in (table for section in sections for table in brief_tables(section)):
        names = tuple(map(written, table.columns[0].cells))
        if names not in about and (len(names) <= ROWS or _has_verdicts(table)):
            yield table
        about.add(names)


def _has_verdicts(table: Table) -> bool:
    return any(isinstance(cell, Judged) for one in table.columns for cell in one.cells[:ROWS])


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
    yield from ("", _row(map(head, columns)), f"|{' --- |' * len(columns)}")
    units = [units_differ(one.cells) for one in columns]
    for cells in zip(*(one.cells[rows] for one in columns), strict=True):
        yield _row(_coloured(cell, unit=unit) for cell, unit in zip(cells, units, strict=True))
    if (left := len(columns[0].cells) - ROWS) > 0:
        yield from ("", f"and {left} more, all in the report")


def _coloured(cell: Cell, *, unit: bool = False) -> str:
    """Return a cell, with the word for the colour in which its subject is drawn."""
    word = colour_name(cell.colour) if isinstance(cell, Ref) else ""
    return f"{written(cell, unit=unit)} ({word})" if word else written(cell, unit=unit)


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(map(plain, cells))} |"


def _colours(paths: Sequence[Path], told: str) -> Iterator[str]:
    """Yield which path has which colour, where there are several, but for those that are told already."""
    words = ((plain(one.name), colour_name(one.colour), ", dashed" if one.asked else "") for one in paths)
    looks = dict.fromkeys(look for look in words if look[1])
    named = [f"{name} {word}{dashed}" for name, word, dashed in looks if f"{name} ({word})" not in told]
    if len(looks) > 1 and named:
        more = [f"and {len(named) - NAMED} more"] if len(named) > NAMED else []
        yield from ("", f"Paths: {'; '.join([*named[:NAMED], *more])}.")


def _all_warnings(section: Section, about: str | None = None) -> Iterator[LogWarning]:
    """Yield the warnings of a section and below it, each with what it is about."""
    yield from (one if one.about or not about else one.of(about) for one in section.warnings)
    for one in section.sections:
        yield from _all_warnings(one, one.title)


def _warnings(warnings: Sequence[LogWarning]) -> Iterator[str]:
    """Yield the first warnings as a list."""
    every = list(dict.fromkeys(map(str, warnings)))
    if every:
        yield from ("", f"Warnings: {len(every)}", "")
    yield from (f"- {plain(one)}" for one in every[:LISTED])
    if len(every) > LISTED:
        yield f"- and {len(every) - LISTED} more, all in the report"


def plain(value: str) -> str:
    """Return a text so that Markdown shows it as it is."""
    return re.sub(r"([\\`*_{}\[\]<>#|~!-])", r"\\\1", " ".join(text.drop_surrogates(value).split()))
