"""The page: which parts of the presentations stand where, under which anchors; what failed stands first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TypeAlias

from urmpipe_models.errors import OptionError
from urmpipe_pipeline.presentation.curves import Span
from urmpipe_pipeline.presentation.figure import Drawing, SpaceFigure, Text
from urmpipe_pipeline.presentation.figure import Figure as GivenFigure
from urmpipe_pipeline.presentation.parts import minute_of
from urmpipe_pipeline.presentation.section import Block, Presentation, Ref, Section, Table
from urmpipe_pipeline.report.figures import SMALL_PX, Links, Multiples, drawn_figures, time_span
from urmpipe_pipeline.report.space import drawn_space
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.report.summary import (
    Banner,
    Summary,
    badness,
    banner_of,
    cards_of,
    judged_parts,
    side_by_side,
    worst_first,
)
from urmpipe_pipeline.report.tables import (
    Anchors,
    Grid,
    ShownFact,
    errors_table,
    from_worst,
    grid,
    shown_facts,
    warnings_table,
)

FEW = 3
"""With fewer parts that no table leads to, a page needs no list of contents."""

Shown: TypeAlias = Grid | Figure | Multiples | Drawing | Text


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the page under a heading.

    Attributes:
        title: The heading.
        ident: Its anchor.
        state: pass, fail or plain, shown at the heading; empty where there is none.
        facts: What it is about; those that need a word each stand in a list of their own.
        notice: What must not be overseen; empty for nothing.
        content: Its tables, figures, drawings and texts, and the parts below it, in order.
        link: What its figures share their time axis by.
        folded: Whether it is closed until someone opens it: it passed, and others are judged, too.
    """

    title: str
    ident: str
    state: str
    facts: tuple[ShownFact, ...]
    notice: str
    content: tuple[Shown | Part, ...]
    link: str
    folded: bool

    @property
    def blocks(self) -> tuple[Shown, ...]:
        """What it shows itself, without the parts below it."""
        return tuple(one for one in self.content if not isinstance(one, Part))

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts below it."""
        return tuple(one for one in self.content if isinstance(one, Part))

    @property
    def pairs(self) -> bool:
        """Whether its blocks stand side by side: small figures and nothing else."""
        return bool(self.content) and all(
            isinstance(block, Figure) and block.height <= SMALL_PX and not block.folded
            for block in self.content
        )

    def every(self) -> Iterator[Part]:
        """Yield the part and all below it."""
        yield self
        for part in self.parts:
            yield from part.every()

    def figures(self) -> Iterator[tuple[str, Figure]]:
        """Yield every figure of the part and of those below, each with the title of its part."""
        for one in self.content:
            match one:
                case Figure():
                    yield self.title, one
                case Multiples():
                    yield from ((self.title, figure) for figure in one.figures)
                case Part():
                    yield from one.figures()


@dataclass(frozen=True, slots=True)
class Page:
    """The page.

    Attributes:
        title: The names of what it shows.
        banner: The verdict.
        summaries: What a minute is enough for.
        parts: All there is, one a result, the worst first.
    """

    title: str
    banner: Banner
    summaries: tuple[Summary, ...]
    parts: tuple[Part, ...]

    @property
    def figures(self) -> list[tuple[str, Figure]]:
        """Every figure from the top, each with the title of its part."""
        return [found for part in self.parts for found in part.figures()]

    @property
    def contents(self) -> tuple[Part, ...]:
        """The parts that the tables above them do not lead to, nor into; none if they are few."""
        tables = (table for summary in self.summaries for table in summary.tables)
        known = {cell.href for table in tables for row in table.rows for cell in row}
        known |= {card.href for summary in self.summaries for card in summary.cards}
        every = [one for part in self.parts for one in part.every()]
        left = [one for one in every if not any(f"#{part.ident}" in known for part in one.every())]
        return tuple(left) if len(left) >= FEW else ()


def lay_out(presentations: Sequence[Presentation]) -> Page:
    """Return the page about some results, the worst first.

    Raises:
        OptionError: If there is none.
    """
    if not presentations:
        raise OptionError("a report needs at least one run, comparison or simulation; found none")
    shown = [(one, Anchors(one.body, f"r{number}")) for number, one in enumerate(presentations, start=1)]
    judged = sum(len(judged_parts(one.body)) for one in presentations)
    banner = banner_of(shown)
    first, *others = (
        _part(one.body, anchors, Links(), _which(one, presentations), folds=judged > 1)
        for one, anchors in worst_first(shown)
    )
    above = {(fact.name, fact.value) for fact in banner.facts}
    left = tuple(fact for fact in first.facts if (fact.name, fact.value) not in above)
    return Page(
        ", ".join(one.name for one in presentations),
        banner,
        tuple(_summaries(shown)),
        (replace(first, facts=left), *others),
    )


def _which(one: Presentation, every: Sequence[Presentation]) -> str:
    """Return what tells a result from others of its title: its recording's name, or when it was made."""
    alike = [other for other in every if other.body.title == one.body.title]
    if len(alike) == 1:
        return ""
    alone = one.recording and sum(other.recording == one.recording for other in alike) == 1
    said = one.recording if alone else minute_of(one.created)
    return f" ({said})" if said else ""


def _summaries(shown: Sequence[tuple[Presentation, Anchors]]) -> Iterator[Summary]:
    """Yield the results side by side, then of each its parts: as it ranks them, or a card each."""
    beside = tuple(side_by_side(shown))
    if beside:
        yield Summary("Side by side", (), beside)
    for ranked, some in groupby(worst_first(shown), lambda pair: bool(_ranking(pair[0].body))):
        for group in [[pair] for pair in some] if ranked else [list(some)]:
            cards = () if ranked else cards_of(group)
            by = [(table, anchors) for one, anchors in group for table in _ranking(one.body)]
            tables = tuple(grid(from_worst(table), anchors.href, folds=False) for table, anchors in by)
            if cards or tables:
                which = f": {group[0][0].body.title}" if ranked and len(shown) > 1 else ""
                ordered = all(table.worst_first or table.page_title for table, _ in by)
                order = ", the worst first" if ordered else ""
                yield Summary(f"Verdicts{order}{which}", cards, tables)


def _ranking(body: Section) -> list[Table]:
    """Return the tables about the parts of a result, which stand at the top of the page."""
    tables = (one for one in body.tables if one.columns and one.page)
    return [one for one in tables if any(isinstance(cell, Ref) for cell in one.columns[0].cells)]


def _part(section: Section, anchors: Anchors, links: Links, which: str = "", *, folds: bool) -> Part:
    """Return a section as a part of the page."""
    ident = anchors.ident(section)
    blocks = [*section.figures(), *section.blocks()]
    figures = [block for block in blocks if isinstance(block, GivenFigure)]
    span, link = time_span(figures), links.of(figures, ident)
    return Part(
        f"{section.title}{which}",
        ident,
        section.verdict or "",
        tuple(shown_facts(section.facts, anchors.href)),
        section.notice,
        tuple(_content(section, anchors, blocks, span, links, folds=folds)),
        link,
        folds and section.verdict == "pass",
    )


def _content(
    section: Section, anchors: Anchors, blocks: Sequence[Block], span: Span, links: Links, *, folds: bool
) -> Iterator[Shown | Part]:
    """Yield what a part shows: of a judged one its first figure, tables, parts that failed, then the rest.

    What opens only on request stands last.
    """
    body = anchors.is_body(section)
    first = [one for one in section.tables if one.page and not (body and one in _ranking(section))]
    tables = [grid(table, anchors.href, folds=False) for table in first]
    if section.errors:
        tables.append(grid(errors_table(section.errors), anchors.href))
    if section.warnings:
        tables.append(grid(warnings_table(section.warnings), anchors.href))
    shown = [one for block in blocks for one in _shown(block, anchors, span)]
    leads = [one for one in shown if isinstance(one, (Figure, Multiples)) and not one.folded][:1]
    if not section.verdict or section.sections:
        leads = []
    below = sorted(section.sections, key=badness)
    failed = [one for one in below if one.verdict == "fail"]
    rest = [one for one in (*tables, *shown) if one not in leads]
    yield from leads
    yield from (one for one in rest if one in tables and not _closed(one))
    for part in failed:
        yield _part(part, anchors, links, folds=folds)
    yield from (one for one in rest if one not in tables and not _closed(one))
    for part in below:
        if part.verdict != "fail":
            yield _part(part, anchors, links, folds=folds)
    yield from filter(_closed, rest)


def _closed(block: Shown) -> bool:
    """Tell whether a block is closed until someone opens it."""
    return isinstance(block, Text) or (not isinstance(block, Drawing) and block.folded)


def _shown(block: Block, anchors: Anchors, span: Span) -> Iterator[Shown]:
    match block:
        case Table():
            yield grid(block, anchors.href)
        case GivenFigure():
            yield from drawn_figures(block, span)
        case SpaceFigure():
            yield drawn_space(block)
        case _:
            yield block
