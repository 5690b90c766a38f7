"""The text beside the plots of a simulation: how it ended, its verdicts, its blocks and connections."""

from __future__ import annotations

from collections.abc import Iterator

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.delta_verdict import DeltaVerdict
from urmpipe_pipeline.comparison.wording import meter_words
from urmpipe_pipeline.recording.summary import shown, table_row, warning_lines
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.simulations.wording import outcome_words

LISTED = 30
"""Blocks and connections that are listed; the others are counted."""


def simulation_summary(result: Simulation) -> str:
    """Return a simulation in a few lines of Markdown."""
    return "\n".join(_lines(result))


def _lines(result: Simulation) -> Iterator[str]:
    yield f"### {_head(result)}"
    if result.description:
        yield f"{shown(result.description)}"
        yield ""
    if result.failed is not None:
        yield f"**{shown(result.failed)}** What was recorded until then is here."
        yield ""
    for one in result.verdicts:
        yield f"- {_verdict(one)}"
    step = f"communication step {1e3 * result.step:.6g} ms"
    yield ""
    yield f"{text.counted(len(result.t_ns), 'sample')}, {result.duration:.6g} s, {step}."
    yield from warning_lines(result.warnings)
    yield ""
    yield from _table(("block", "is"), [(one.name, f"{one.kind} {one.source}") for one in result.blocks])
    yield ""
    yield from _table(("input", "is given"), list(result.connections.items()))
    yield ""
    yield "The drawing of the system, parameters and start values: `urmpipe report` with this file."


def _head(result: Simulation) -> str:
    """Return the verdict, if there is one, and how it ended; else the name."""
    state = "FAILED" if result.failed is not None else (result.verdict or "").upper()
    return f"{state}: {shown(outcome_words(result))}" if state else shown(result.name)


def _verdict(one: DeltaVerdict) -> str:
    return f"**{one.verdict.upper()}** {shown(one.block)}: {shown(meter_words(one))}"


def _table(heads: tuple[str, str], rows: list[tuple[str, str]]) -> Iterator[str]:
    """Yield the first rows of a table; nothing without any."""
    if not rows:
        return
    yield table_row(heads)
    yield table_row("---" for _ in heads)
    for row in rows[:LISTED]:
        yield table_row(map(shown, row))
    if len(rows) > LISTED:
        yield ""
        yield f"and {len(rows) - LISTED} more, all in the report"
