"""The parts of the page: which facts, tables and figures stand where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison import Comparison, Deviation
from urmpipe_pipeline.report import gallery, log_tables, verdict_tables
from urmpipe_pipeline.report.banner import Banner, banner
from urmpipe_pipeline.report.cards import Card, card
from urmpipe_pipeline.report.facts import Fact, comparison_facts, deviation_facts, run_facts
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.report.tables import Table
from urmpipe_pipeline.results import Run
from urmpipe_pipeline.wording import tolerance_words

Block: TypeAlias = Table | Figure


@dataclass(frozen=True, slots=True)
class Summary:
    """What a minute is enough to read about a comparison, or about the logs that were only ingested.

    Attributes:
        title: The heading.
        cards: One a compared log, best to worst.
        tables: One line a log.
        note: A line under the cards.
    """

    title: str
    cards: tuple[Card, ...]
    tables: tuple[Table, ...]
    note: str = ""


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the page under a heading.

    Attributes:
        title: The heading.
        blocks: Its tables and figures, in order.
        parts: The parts below it.
        ident: Its anchor; figures of one part share their time axis.
        verdict: pass or fail, shown at the heading; empty where there is none.
        facts: What it is about.
        explained: Facts that need a word each, in a list of their own.
    """

    title: str
    blocks: tuple[Block, ...] = ()
    parts: tuple[Part, ...] = ()
    ident: str = ""
    verdict: str = ""
    facts: tuple[Fact, ...] = ()
    explained: tuple[Fact, ...] = ()

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
        parts: All there is, one a comparison and one a log that was only ingested.
    """

    title: str
    banner: Banner
    summaries: tuple[Summary, ...]
    parts: tuple[Part, ...]

    @property
    def figures(self) -> list[tuple[str, Figure]]:
        """Every figure from the top, each with the title of its part."""
        return [found for part in self.parts for found in part.figures()]


def lay_out(results: Sequence[Run | Comparison]) -> Page:
    """Return the page about some results: comparisons first, then logs that were only ingested."""
    comparisons = [result for result in results if isinstance(result, Comparison)]
    runs = [result for result in results if isinstance(result, Run)]
    links = [
        [f"#c{i}-{k}" for k in range(1, len(comparison.runs) + 1)]
        for i, comparison in enumerate(comparisons, start=1)
    ]
    summaries = [_summary(*pair) for pair in zip(comparisons, links, strict=True)]
    if runs:
        table = log_tables.ingest_table(runs, [f"#r{i}" for i in range(1, len(runs) + 1)])
        summaries.append(Summary("Ingested logs", (), (table,)))
    return Page(
        title=", ".join(result.name for result in results),
        banner=banner(comparisons, runs, links),
        summaries=tuple(summaries),
        parts=(
            *(_comparison_part(comparison, f"c{i}") for i, comparison in enumerate(comparisons, start=1)),
            *(_run_part(run, f"r{i}") for i, run in enumerate(runs, start=1)),
        ),
    )


def _summary(comparison: Comparison, links: Sequence[str]) -> Summary:
    """Return the cards of a comparison, and of several logs the tables that rank them."""
    several = len(comparison.runs) > 1
    return Summary(
        f"Verdict{'s' if several else ''} against {comparison.reference.name}"
        f"{', best to worst' if several else ''}",
        tuple(card(run, link) for run, link in zip(comparison.ranking, links, strict=True)),
        verdict_tables.ranking_tables(comparison, links) if several else (),
        f"Tolerance: {tolerance_words(comparison)}. The bars show how much of it is used up.",
    )


def _comparison_part(comparison: Comparison, ident: str) -> Part:
    """Return the part of a comparison: all logs together, one part a log, then how it was made."""
    about = Part(
        "Provenance of the comparison",
        (
            log_tables.inputs_table("Reference files", comparison.reference.files),
            log_tables.provenance_table(comparison.provenance),
        ),
    )
    samples = len(comparison.reference.t_ns)
    logs = (
        _deviation_part(run, f"{ident}-{k}", samples) for k, run in enumerate(comparison.ranking, start=1)
    )
    warnings = (log_tables.warnings_table(comparison),) if comparison.warnings else ()
    return Part(
        f"Comparison {comparison.name}",
        (*warnings, *gallery.comparison_figures(comparison)),
        (*logs, about),
        ident,
        comparison.verdict,
        comparison_facts(comparison),
    )


def _deviation_part(deviation: Deviation, ident: str, reference_samples: int) -> Part:
    """Return the part of one compared log."""
    return Part(
        deviation.name,
        (
            *verdict_tables.statistics_tables(deviation),
            *gallery.deviation_figures(deviation),
            *_run_tables(deviation.run),
        ),
        (),
        ident,
        deviation.verdict,
        (*run_facts(deviation.run), Fact("Compared", text.counted(len(deviation.sample), "sample"))),
        deviation_facts(deviation, reference_samples),
    )


def _run_part(run: Run, ident: str) -> Part:
    """Return the part of one log that was only ingested."""
    blocks = (*gallery.run_figures(run), *_run_tables(run))
    return Part(f"Log {run.name}", blocks, (), ident, "", run_facts(run))


def _run_tables(run: Run) -> tuple[Block, ...]:
    return (
        *((log_tables.audit_table(run),) if run.log.joints else ()),
        log_tables.warnings_table(run),
        log_tables.inference_table(run),
        log_tables.inputs_table("Input files", run.log.files),
        log_tables.provenance_table(run.provenance),
    )
