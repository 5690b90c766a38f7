"""The parts of the page: which facts, tables and figures stand where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TypeAlias

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.trajectory import Trajectory
from urmpipe_pipeline.comparison.wording import tolerance_words
from urmpipe_pipeline.report import (
    gallery,
    log_tables,
    simulation_parts,
    simulation_tables,
    verdict_tables,
)
from urmpipe_pipeline.report.banner import (
    Banner,
    comparison_banner,
    ingested_banner,
    joined,
    solved_banner,
)
from urmpipe_pipeline.report.baseline_table import baseline_table
from urmpipe_pipeline.report.cards import Card, card
from urmpipe_pipeline.report.drawings import Drawing, Listing, system_drawing, system_file
from urmpipe_pipeline.report.facts import Fact, comparison_facts, deviation_facts, made, run_facts
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.report.tables import Table
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.simulations.answers import answers_of
from urmpipe_pipeline.simulations.signal_groups import Group, groups_of
from urmpipe_pipeline.simulations.simulation import Result, Simulation
from urmpipe_pipeline.solved_targets.verdict import verdict_of

Block: TypeAlias = Table | Figure | Drawing | Listing


@dataclass(frozen=True, slots=True)
class Summary:
    """What a minute is enough to read about a comparison, the simulations, or the logs only ingested.

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
        blocks: Its tables, figures, drawings and texts, in order.
        parts: The parts below it.
        ident: Its anchor.
        verdict: pass or fail, shown at the heading; empty where there is none.
        facts: What it is about.
        explained: Facts that need a word each, in a list of their own.
        notice: What must not be overseen; empty for nothing.
        link: What its figures, side by side, share their time axis by; empty for its anchor.
    """

    title: str
    blocks: tuple[Block, ...] = ()
    parts: tuple[Part, ...] = ()
    ident: str = ""
    verdict: str = ""
    facts: tuple[Fact, ...] = ()
    explained: tuple[Fact, ...] = ()
    notice: str = ""
    link: str = ""

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
        parts: All there is, one a comparison, one a simulation and one a log that was only ingested.
    """

    title: str
    banner: Banner
    summaries: tuple[Summary, ...]
    parts: tuple[Part, ...]

    @property
    def figures(self) -> list[tuple[str, Figure]]:
        """Every figure from the top, each with the title of its part."""
        return [found for part in self.parts for found in part.figures()]


def lay_out(results: Sequence[Result]) -> Page:
    """Return the page about some results: comparisons first, then simulations, then logs only ingested."""
    comparisons = [result for result in results if isinstance(result, Comparison)]
    runs = [result for result in results if isinstance(result, Run)]
    simulations = [result for result in results if isinstance(result, Simulation)]
    simulated = [f"#s{i}" for i in range(1, len(simulations) + 1)]
    links = [
        [f"#c{i}-{k}" for k in range(1, len(comparison.runs) + 1)]
        for i, comparison in enumerate(comparisons, start=1)
    ]
    several = len(comparisons) > 1
    summaries = [_side_by_side(comparisons, links)] if several else []
    summaries += [_summary(*pair, several) for pair in zip(comparisons, links, strict=True)]
    if simulations:
        summaries.append(_simulations_summary(simulations, simulated))
    if runs:
        table = log_tables.ingest_table(runs, [f"#r{i}" for i in range(1, len(runs) + 1)])
        summaries.append(Summary(_logs_title(runs), (), (table,)))
    return Page(
        title=", ".join(result.name for result in results),
        banner=_banner(comparisons, simulations, runs, links, simulated),
        summaries=tuple(summaries),
        parts=(
            *(_comparison_part(one, f"c{i}", several) for i, one in enumerate(comparisons, start=1)),
            *(_simulation_part(one, f"s{i}") for i, one in enumerate(simulations, start=1)),
            *(_run_part(run, f"r{i}") for i, run in enumerate(runs, start=1)),
        ),
    )


def _logs_title(runs: Sequence[Run]) -> str:
    """Return what is above runs that were not compared: logs, targets of inverse kinematics, or both."""
    kinds = ("Ingested logs" if run.goals is None else "Solved targets" for run in runs)
    return " and ".join(sorted(set(kinds))).replace("and Solved", "and solved")


def _banner(
    comparisons: Sequence[Comparison],
    simulations: Sequence[Simulation],
    runs: Sequence[Run],
    links: Sequence[Sequence[str]],
    simulated: Sequence[str],
) -> Banner:
    """Return the verdict over all that was judged, or what was simulated or ingested."""
    aimed = [run for run in runs if run.goals is not None]
    logs = [run for run in runs if run.goals is None]
    found = [comparison_banner(comparisons, links)] if comparisons else []
    found += [simulation_parts.simulation_banner(simulations, simulated)] if simulations else []
    found += [solved_banner(aimed)] if aimed else []
    found += [ingested_banner(logs)] if logs else []
    return joined(found)


def _simulations_summary(simulations: Sequence[Simulation], links: Sequence[str]) -> Summary:
    """Return the cards of the simulations, and of several a table of them."""
    several = len(simulations) > 1
    cards = (simulation_parts.simulation_card(*pair) for pair in zip(simulations, links, strict=True))
    tables = (simulation_tables.simulations_table(simulations, links),) if several else ()
    return Summary("Simulations" if several else "Simulation", tuple(cards), tables)


def _signals_part(simulation: Simulation, groups: Sequence[Group], link: str) -> Part:
    """Return the part of a block, or of several like ones: its signals."""
    block = groups[0].block
    title = block if groups[0].wanted else f"{'Blocks' if groups[0].family else 'Block'} {block}"
    return Part(title, tuple(gallery.signal_figures(simulation, groups)), link=link)


def _simulation_part(simulation: Simulation, ident: str) -> Part:
    """Return the part of a simulation: the system, its verdicts, then what each block did, meters first."""
    meters = (simulation_tables.meters_table(simulation.verdicts),) if simulation.verdicts else ()
    drawing, file = system_drawing(simulation), system_file(simulation)
    judged = {one.block for one in simulation.verdicts}
    every = [*answers_of(simulation), *groups_of(simulation)]
    groups = sorted(every, key=lambda group: group.block not in judged)  # what decides first
    blocks = [
        _signals_part(simulation, list(some), ident)
        for _, some in groupby(groups, key=lambda group: group.block)
    ]
    made = (
        simulation_tables.signals_table(simulation),
        simulation_tables.settings_table(simulation),
        log_tables.warnings_table(simulation),
        *((file,) if file else ()),
        log_tables.inputs_table("Input files", simulation.provenance.inputs),
        log_tables.provenance_table(simulation.provenance),
    )
    return Part(
        f"Simulation {simulation.name}",
        (
            *((drawing,) if drawing else ()),
            *meters,
            simulation_tables.blocks_table(simulation),
            simulation_tables.connections_table(simulation),
            *gallery.simulation_figures(simulation),
        ),
        (*(part for part in blocks if part.blocks), Part("Values and provenance", made)),
        ident,
        simulation.verdict or "",
        simulation_parts.simulation_facts(simulation),
        notice="" if simulation.failed is None else f"Failed: {simulation.failed}",
    )


def _side_by_side(comparisons: Sequence[Comparison], links: Sequence[Sequence[str]]) -> Summary:
    """Return several comparisons, such as this month's and last month's, in one table."""
    table = verdict_tables.side_by_side(comparisons, links)
    return Summary(f"{len(comparisons)} comparisons side by side", (), (table,))


def _which(comparison: Comparison, several: bool) -> str:
    """Return which of several comparisons it is: they may all have one name."""
    return f" ({comparison.recording or made(comparison)})" if several else ""


def _summary(comparison: Comparison, links: Sequence[str], beside: bool) -> Summary:
    """Return the cards of a comparison, what changed since its baseline, and how several logs rank."""
    several = len(comparison.runs) > 1
    changed = () if comparison.baseline is None else (baseline_table(comparison.baseline),)
    return Summary(
        f"Verdict{'s' if several else ''} against {comparison.reference.name}"
        f"{', best to worst' if several else ''}{_which(comparison, beside)}",
        tuple(
            card(run, link, comparison.covered(run), len(comparison.warnings_of(run)))
            for run, link in zip(comparison.ranking, links, strict=True)
        ),
        (*changed, *(verdict_tables.ranking_tables(comparison, links) if several else ())),
        f"Tolerance: {tolerance_words(comparison)}. The bars show how much of it is used up.",
    )


def _comparison_part(comparison: Comparison, ident: str, beside: bool) -> Part:
    """Return the part of a comparison: all logs together, one part a log, then how it was made."""
    about = Part(
        "Provenance of the comparison",
        (
            log_tables.inputs_table("Reference files", comparison.reference.files),
            log_tables.provenance_table(comparison.provenance),
        ),
    )
    logs = (
        _deviation_part(run, f"{ident}-{k}", comparison.reference)
        for k, run in enumerate(comparison.ranking, start=1)
    )
    warnings = (log_tables.warnings_table(comparison),) if comparison.warnings else ()
    return Part(
        f"Comparison {comparison.name}{_which(comparison, beside)}",
        (*warnings, *gallery.comparison_figures(comparison)),
        (*logs, about),
        ident,
        comparison.verdict,
        comparison_facts(comparison),
    )


def _deviation_part(deviation: Deviation, ident: str, reference: Trajectory) -> Part:
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
        deviation_facts(deviation, reference),
    )


def _run_part(run: Run, ident: str) -> Part:
    """Return the part of one log that was only ingested."""
    missed = log_tables.missed_table(run)
    blocks = (*((missed,) if missed else ()), *gallery.run_figures(run), *_run_tables(run))
    title = f"Log {run.name}" if run.goals is None else f"Targets {run.name}"
    return Part(title, blocks, (), ident, verdict_of(run) or "", run_facts(run))


def _run_tables(run: Run) -> tuple[Block, ...]:
    return (
        *((log_tables.audit_table(run),) if run.log.joints else ()),
        log_tables.warnings_table(run),
        log_tables.inference_table(run),
        log_tables.inputs_table("Input files", run.log.files),
        log_tables.provenance_table(run.provenance),
    )
