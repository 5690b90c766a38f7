"""The page: which parts of the presentations stand where, under which anchors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TypeAlias

from urmpipe_models.errors import OptionError
from urmpipe_pipeline.presentation.curves import Span
from urmpipe_pipeline.presentation.figure import Drawing, SpaceFigure, Text
from urmpipe_pipeline.presentation.figure import Figure as GivenFigure
from urmpipe_pipeline.presentation.section import Block, Presentation, Ref, Section, Table
from urmpipe_pipeline.report.figures import SMALL_PX, Links, drawn_figures, time_span
from urmpipe_pipeline.report.space import drawn_space
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.report.summary import (
    PLAIN,
    Banner,
    Card,
    Summary,
    banner_of,
    cards_of,
    side_by_side,
    worst_first,
)
from urmpipe_pipeline.report.tables import Anchors, Grid, ShownFact, grid, shown_facts, warnings_table

Shown: TypeAlias = Grid | Figure | Drawing | Text


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the page under a heading.

    Attributes:
        title: The heading.
        ident: Its anchor.
        state: pass, fail or plain, shown at the heading; empty where there is none.
        facts: What it is about; those that need a word each stand in a list of their own.
        notice: What must not be overseen; empty for nothing.
        blocks: Its tables, figures, drawings and texts, in order.
        parts: The parts below it.
        link: What its figures share their time axis by.
    """

    title: str
    ident: str
    state: str
    facts: tuple[ShownFact, ...]
    notice: str
    blocks: tuple[Shown, ...]
    parts: tuple[Part, ...]
    link: str

    @property
    def pairs(self) -> bool:
        """Whether its blocks stand side by side: small figures and nothing else."""
        small = (isinstance(block, Figure) and block.height <= SMALL_PX for block in self.blocks)
        return bool(self.blocks) and all(small) and not self.parts

    def figures(self) -> list[tuple[str, Figure]]:
        """Return every figure of the part and of those below, each with the title of its part."""
        own = [(self.title, block) for block in self.blocks if isinstance(block, Figure)]
        return own + [found for part in self.parts for found in part.figures()]


@dataclass(frozen=True, slots=True)
class Page:
    """The page.

    Attributes:
        title: The names of what it shows.
        banner: The verdict.
        summaries: What a minute is enough for.
        parts: All there is, one a result.
    """

    title: str
    banner: Banner
    summaries: tuple[Summary, ...]
    parts: tuple[Part, ...]

    @property
    def figures(self) -> list[tuple[str, Figure]]:
        """Every figure from the top, each with the title of its part."""
        return [found for part in self.parts for found in part.figures()]


def lay_out(presentations: Sequence[Presentation]) -> Page:
    """Return the page about some results, in the order in which they are given.

    Raises:
        OptionError: If there is none.
    """
    if not presentations:
        raise OptionError("a report needs at least one run, comparison or simulation; found none")
    shown = [(one, Anchors(one.body, f"r{number}")) for number, one in enumerate(presentations, start=1)]
    titles = Counter(one.body.title for one in presentations)
    return Page(
        ", ".join(one.name for one in presentations),
        banner_of(shown),
        tuple(_summaries(shown)),
        tuple(
            _part(one.body, anchors, Links(), _made(one) if titles[one.body.title] > 1 else "")
            for one, anchors in shown
        ),
    )


def _made(one: Presentation) -> str:
    """Return what tells a result from others of its title: when it was made, to the minute."""
    return f" ({one.created[:16].replace('T', ' ')})" if one.created else ""


def _summaries(shown: Sequence[tuple[Presentation, Anchors]]) -> Iterator[Summary]:
    """Yield the results side by side, then cards: of each result that ranks its parts, of the others."""
    beside = tuple(side_by_side(shown))
    if beside:
        yield Summary("Side by side", (), beside)
    for ranked, some in groupby(worst_first(shown), lambda pair: bool(_ranking(pair[0].body))):
        for group in [[pair] for pair in some] if ranked else [list(some)]:
            cards = cards_of(group, plain=not beside)
            ranked_by = ((table, anchors) for one, anchors in group for table in _ranking(one.body))
            tables = tuple(grid(table, anchors.href, folds=False) for table, anchors in ranked_by)
            if cards or tables:
                which = f": {group[0][0].body.title}" if ranked and len(shown) > 1 else ""
                yield Summary(f"{_heading(cards)}{which}", cards, tables)


def _heading(cards: Sequence[Card]) -> str:
    """Return what stands above some cards."""
    if all(card.state == PLAIN for card in cards):
        return "Results" if len(cards) > 1 else "Result"
    return "Verdicts, the worst first" if len(cards) > 1 else "Verdict"


def _ranking(body: Section) -> list[Table]:
    """Return the tables about the parts of a result, which stand with their cards."""
    tables = (one for one in body.tables if one.columns)
    return [one for one in tables if any(isinstance(cell, Ref) for cell in one.columns[0].cells)]


def _part(section: Section, anchors: Anchors, links: Links, which: str = "") -> Part:
    """Return a section as a part of the page."""
    ident = anchors.ident(section)
    blocks = [*section.figures(), *section.blocks()]
    figures = [block for block in blocks if isinstance(block, GivenFigure)]
    span, link = time_span(figures), links.of(figures, ident)
    first = [one for one in section.tables if not (anchors.is_body(section) and one in _ranking(section))]
    return Part(
        f"{section.title}{which}",
        ident,
        section.verdict or "",
        tuple(shown_facts(section.facts, anchors.href)),
        section.notice,
        (
            *(grid(table, anchors.href, folds=False) for table in first),
            *([grid(warnings_table(section.warnings), anchors.href)] if section.warnings else []),
            *(shown for block in blocks for shown in _shown(block, anchors, span)),
        ),
        tuple(_part(one, anchors, links) for one in sorted(section.sections, key=lambda one: one.rank)),
        link,
    )


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
