"""The first thing on the page: pass or fail in words, how much of how much, when, where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.symbols import size_of
from urmpipe_pipeline.comparison.wording import of_allowed, tolerance_words
from urmpipe_pipeline.inverse.verdict import faults, reached, solved
from urmpipe_pipeline.report.facts import Fact
from urmpipe_pipeline.runs.results import Run

NAMED = 3
"""Logs named in the headline; more are only counted."""


@dataclass(frozen=True, slots=True)
class Banner:
    """The verdict.

    Attributes:
        state: pass, fail, or ingested where nothing was judged.
        word: The same in capitals.
        headline: One sentence.
        facts: How much, when, where, against what.
        detail: What else is to be said.
    """

    state: str
    word: str
    headline: str
    facts: tuple[Fact, ...] = ()
    detail: str = ""


def banner(comparisons: Sequence[Comparison], runs: Sequence[Run], links: Sequence[Sequence[str]]) -> Banner:
    """Return the verdict over all comparisons, or what was ingested if there are none.

    Args:
        comparisons: Those of the page.
        runs: The logs of the page that were only ingested.
        links: Where each log of each comparison is told of, best to worst.
    """
    if not comparisons:
        return _ingested(runs)
    places = [
        (run, link)
        for comparison, some in zip(comparisons, links, strict=True)
        for run, link in zip(comparison.ranking, some, strict=True)
    ]
    failed = [run for run, _ in places if run.verdict == "fail"]
    run, href = max(places, key=lambda one: one[0].decisive.used or 0.0)
    total = len(places)
    if failed:
        headline = f"{_who(failed, total)} out of tolerance{_named(failed, total)}"
    else:
        headline = f"{_who([one for one, _ in places], total)} within tolerance"
    state = "fail" if any(one.verdict == "fail" for one in comparisons) else "pass"
    if state == "fail" and not failed:
        headline += ", but worse than the baseline"
    return Banner(state, state.upper(), headline, (*_decisive(run, href), *_against(comparisons)))


def _who(runs: Sequence[Deviation], total: int) -> str:
    """Return the subject and verb of the headline."""
    if total == 1:
        return f"{runs[0].name} is"
    every = "both logs" if total == 2 else f"all {total} logs"
    count = every if len(runs) == total else f"{len(runs)} of {total} logs"
    return f"{count} {'is' if len(runs) == 1 else 'are'}"


def _named(runs: Sequence[Deviation], total: int) -> str:
    """Return the names of some of many logs, unless they are all or too many as well."""
    return f": {', '.join(run.name for run in runs)}" if len(runs) < total and len(runs) <= NAMED else ""


def _decisive(run: Deviation, href: str) -> tuple[Fact, ...]:
    """Return which quantity uses up the largest share of its tolerance, how much, when and where."""
    one = run.decisive
    amount = f"{size_of(one)} = {text.quantity(one.max, one.unit, one.tolerance)}{of_allowed(one)}"
    return (
        Fact("Furthest out" if one.verdict == "fail" else "Closest to the limit", run.name, href=href),
        Fact("How much", amount),
        *_joint_furthest_off(run),
        Fact("When", f"t = {text.seconds(one.t_max)} s"),
        Fact("Where the log was (x, y, z)", f"{text.point(run.place(one))} m"),
    )


def _joint_furthest_off(run: Deviation) -> tuple[Fact, ...]:
    """Return the joint that deviates most, of a log that is out of tolerance by something else."""
    joint = run.furthest_joint("rad") or run.furthest_joint("m")
    if run.verdict == "pass" or joint is None or run.decisive.kind == "joint" or not joint.max:
        return ()
    return (Fact("Joint furthest off", f"{joint.quantity}: {text.quantity(joint.max, joint.unit)}"),)


def _against(comparisons: Sequence[Comparison]) -> tuple[Fact, ...]:
    """Return what was the reference and what is allowed, where it is the same for all."""
    references = sorted({comparison.reference.name for comparison in comparisons})
    tolerances = sorted({tolerance_words(comparison) for comparison in comparisons})
    return (
        Fact("Reference" if len(references) == 1 else "References", ", ".join(references)),
        Fact("Tolerance", tolerances[0] if len(tolerances) == 1 else "as each comparison says"),
    )


def _ingested(runs: Sequence[Run]) -> Banner:
    """Say what was ingested, or solved if nothing else was."""
    warnings = text.counted(sum(len(run.warnings) for run in runs), "warning")
    aimed = [run for run in runs if run.goals is not None]
    if aimed and (len(aimed) == len(runs) or not all(map(solved, aimed))):
        return _solved(aimed, warnings)
    rows = sum(run.log.rows for run in runs)
    wraps = sum(len(run.repolarizations) for run in runs)
    subject = runs[0].name if len(runs) == 1 else text.counted(len(runs), "log")
    headline = f"{subject}: {text.counted(rows, 'row')}, {text.counted(wraps, 'repolarization')}"
    detail = f"{warnings}. Nothing was compared: there is no verdict."
    return Banner("ingested", "INGESTED", headline, detail=detail)


def _solved(runs: Sequence[Run], warnings: str) -> Banner:
    """Say how many targets have a solution, and what keeps an arm from the path: the verdict of ik."""
    found, wanted = sum(map(reached, runs)), sum(run.log.rows for run in runs)
    subject = runs[0].name if len(runs) == 1 else text.counted(len(runs), "file")
    headline = f"{subject}: {found} of {text.counted(wanted, 'target')} with a solution"
    state, word = ("pass", "SOLVED") if all(map(solved, runs)) else ("fail", "FAIL")
    said = [fault for run in runs for fault in faults(run)]
    return Banner(state, word, headline, detail=". ".join([*said, warnings]) + ".")
