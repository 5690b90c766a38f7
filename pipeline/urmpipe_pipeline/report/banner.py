"""The first thing on the page: pass or fail in words, how much, when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from urmpipe_pipeline.comparison import AXES, Comparison, Deviation
from urmpipe_pipeline.report import text
from urmpipe_pipeline.results import Run

NAMED = 3
"""Logs named in the headline; more are only counted."""


@dataclass(frozen=True, slots=True)
class Banner:
    """The verdict.

    Attributes:
        state: pass, fail, or ingested where nothing was compared.
        word: The same in capitals.
        headline: One sentence.
        detail: How much, where and when.
    """

    state: str
    word: str
    headline: str
    detail: str


def banner(comparisons: Sequence[Comparison], runs: Sequence[Run]) -> Banner:
    """Return the verdict over all comparisons, or what was ingested if there are none."""
    if not comparisons:
        return _ingested(runs)
    deviations = [run for comparison in comparisons for run in comparison.runs]
    failed = [run for run in deviations if run.verdict == "fail"]
    state = "fail" if failed else "pass"
    if failed:
        headline = f"{_who(failed, len(deviations))} out of tolerance{_named(failed, len(deviations))}"
    else:
        headline = f"{_who(deviations, len(deviations))} within tolerance"
    return Banner(state, state.upper(), headline, f"{_nearest(failed or deviations)} {_against(comparisons)}")


def _who(runs: Sequence[Deviation], total: int) -> str:
    """Return the subject and verb of the headline."""
    if total == 1:
        return f"{runs[0].name} is"
    count = f"all {total} logs" if len(runs) == total else f"{len(runs)} of {total} logs"
    return f"{count} {'is' if len(runs) == 1 else 'are'}"


def _named(runs: Sequence[Deviation], total: int) -> str:
    """Return the names of some of many logs, unless they are too many as well."""
    return f": {', '.join(run.name for run in runs)}" if total > 1 and len(runs) <= NAMED else ""


def _against(comparisons: Sequence[Comparison]) -> str:
    """Say what was the reference and what is allowed, where it is the same for all."""
    references = sorted({comparison.reference.name for comparison in comparisons})
    tolerances = sorted({text.tolerance(comparison.tolerance) for comparison in comparisons})
    reference = references[0] if len(references) == 1 else f"{len(references)} of them"
    allowed = tolerances[0] if len(tolerances) == 1 else "as each comparison says"
    return f"Reference: {reference}. Tolerance: {allowed}."


def _nearest(runs: Sequence[Deviation]) -> str:
    """Say which quantity uses up the largest share of its tolerance, how much, and when."""
    held = [
        (statistics.max / statistics.tolerance, axis, run)
        for run in runs
        for axis in AXES
        if (statistics := run.statistics[axis]).tolerance
    ]
    if not held:
        return ""
    _, axis, run = max(held, key=lambda item: item[0])
    statistics = run.statistics[axis]
    word = "Furthest out" if statistics.verdict == "fail" else "Closest to the limit"
    return (
        f"{word}: |{text.SYMBOLS[axis]}| = {text.millimetres(statistics.max, statistics.tolerance)} mm"
        f" of {text.limit(statistics.tolerance)} mm allowed, at t = {text.seconds(statistics.t_max)} s"
        f" ({run.name})."
    )


def _ingested(runs: Sequence[Run]) -> Banner:
    """Say what was ingested."""
    rows = sum(run.log.rows for run in runs)
    wraps = sum(len(run.repolarizations) for run in runs)
    warnings = sum(len(run.warnings) for run in runs)
    subject = runs[0].name if len(runs) == 1 else text.counted(len(runs), "log")
    return Banner(
        "ingested",
        "INGESTED",
        f"{subject}: {text.counted(rows, 'row')}, {text.counted(wraps, 'repolarization')}",
        f"{text.counted(warnings, 'warning')}. Nothing was compared: there is no verdict.",
    )
