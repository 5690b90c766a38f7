"""The page: which tables and figures stand where, and the one HTML file that holds them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TypeAlias

from urmpipe_models.errors import OptionError
from urmpipe_pipeline.comparison import Comparison, Deviation
from urmpipe_pipeline.outputs import guarded_output
from urmpipe_pipeline.report import gallery, tables, text
from urmpipe_pipeline.report.banner import banner
from urmpipe_pipeline.report.markup import asset, environment, script_hash
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.report.tables import Table
from urmpipe_pipeline.results import Run

Block: TypeAlias = Table | Figure


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the page under a heading.

    Attributes:
        title: The heading.
        blocks: Its tables and figures, in order.
        parts: The parts below it.
        ident: Its anchor; figures of one part share their time axis.
        verdict: pass or fail, shown at the heading; empty where there is none.
        facts: What it is about, as names and values.
    """

    title: str
    blocks: tuple[Block, ...] = ()
    parts: tuple[Part, ...] = ()
    ident: str = ""
    verdict: str = ""
    facts: tuple[tuple[str, str], ...] = ()


def render_report(results: Sequence[Run | Comparison]) -> str:
    """Return the report as one HTML file that needs no network.

    The verdict stands first, then a part a log with its figures, statistics, audit, warnings and
    provenance. Everything that came from a file is escaped, and a content security policy lets only
    the page's own two scripts run, known by their hashes.

    Args:
        results: Ingested logs and comparisons, in the order in which they are shown.

    Raises:
        OptionError: If there is nothing to report.
    """
    if not results:
        raise OptionError("a report needs at least one run or comparison; found none")
    from plotly.offline import get_plotlyjs

    comparisons = [result for result in results if isinstance(result, Comparison)]
    runs = [result for result in results if isinstance(result, Run)]
    plotly, script = get_plotlyjs(), asset("page.js")
    return (
        environment()
        .get_template("template.html.jinja")
        .render(
            banner=banner(comparisons, runs),
            summaries=_summaries(comparisons, runs),
            parts=[_comparison_part(c, f"c{i}") for i, c in enumerate(comparisons, start=1)]
            + [_run_part(run, f"r{i}") for i, run in enumerate(runs, start=1)],
            title=", ".join(result.name for result in results),
            version=version("urmpipe"),
            hashes=[script_hash(plotly), script_hash(script)],
            style=asset("style.css"),
            plotly=plotly,
            script=script,
        )
    )


def write_report(results: Sequence[Run | Comparison], path: Path, inputs: Sequence[Path] = ()) -> Path:
    """Write the report; an existing file is replaced only if it is a report of ours and no input.

    Args:
        results: As `render_report` takes them.
        path: Where to.
        inputs: Files that must not be overwritten.

    Returns:
        The path written.

    Raises:
        OptionError: If there is nothing to report.
        OutputError: If it may not be written there.
    """
    page = render_report(results)
    with guarded_output(path, inputs, kind="report") as part:
        part.write_bytes(page.encode("utf-8"))
    return path


def _summaries(comparisons: Sequence[Comparison], runs: Sequence[Run]) -> list[Table]:
    """Return the tables under the banner: one line a log."""
    found = [
        tables.verdict_table(comparison, [f"#c{i}-{k}" for k in range(1, len(comparison.runs) + 1)])
        for i, comparison in enumerate(comparisons, start=1)
    ]
    return found + ([tables.ingest_table(runs, [f"#r{i}" for i in range(1, len(runs) + 1)])] if runs else [])


def _comparison_part(comparison: Comparison, ident: str) -> Part:
    """Return the part of a comparison: one part a log, then how it was made."""
    about = Part(
        "Provenance of the comparison",
        (
            tables.inputs_table("Reference files", comparison.reference.files),
            tables.provenance_table(comparison.provenance),
        ),
    )
    logs = (_deviation_part(run, f"{ident}-{k}") for k, run in enumerate(comparison.runs, start=1))
    facts = [
        ("Reference", comparison.reference.name),
        ("Reference samples", str(len(comparison.reference.t_ns))),
        ("Tolerance", text.tolerance(comparison.tolerance)),
        ("Recording", str(comparison.recording) if comparison.recording else ""),
    ]
    return Part(
        f"Comparison {comparison.name}",
        (
            *((tables.warnings_table(comparison),) if comparison.warnings else ()),
            *gallery.comparison_figures(comparison),
        ),
        (*logs, about),
        ident,
        comparison.verdict,
        _given(facts),
    )


def _deviation_part(deviation: Deviation, ident: str) -> Part:
    """Return the part of one compared log."""
    facts = [
        *_run_facts(deviation.run),
        ("Compared", text.counted(len(deviation.sample), "sample")),
        ("Out of tolerance", text.counted(int(deviation.outside.sum()), "sample")),
        ("Left out", text.counted(deviation.left_out, "sample")),
        ("Sync offset", f"{text.seconds(deviation.sync.offset)} s"),
    ]
    blocks = (
        tables.statistics_table(deviation),
        *gallery.deviation_figures(deviation),
        *_run_tables(deviation.run),
    )
    return Part(deviation.name, blocks, (), ident, deviation.verdict, _given(facts))


def _run_part(run: Run, ident: str) -> Part:
    """Return the part of one log that was only ingested."""
    blocks = (*gallery.run_figures(run), *_run_tables(run))
    return Part(f"Log {run.name}", blocks, (), ident, "", _given(_run_facts(run)))


def _run_tables(run: Run) -> tuple[Block, ...]:
    return (
        *((tables.audit_table(run),) if run.log.joints else ()),
        tables.warnings_table(run),
        tables.inference_table(run),
        tables.inputs_table("Input files", run.log.files),
        tables.provenance_table(run.provenance),
    )


def _run_facts(run: Run) -> list[tuple[str, str]]:
    return [
        ("Robot", run.robot.name if run.robot else "none: no kinematics"),
        ("Source", run.log.source),
        ("Rows", f"{run.log.rows} every {text.seconds(run.log.period)} s"),
        ("Grid", f"{len(run.t_ns)} samples every {text.seconds(run.tsp)} s"),
        ("Duration", f"{text.seconds(run.duration)} s"),
        ("Recording", str(run.recording) if run.recording else ""),
    ]


def _given(facts: Sequence[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    return tuple(fact for fact in facts if fact[1])
