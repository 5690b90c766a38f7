"""The first thing on the page: pass or fail in words, how much of how much, when, where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.comparison import Comparison, by_tolerance
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.wording import amount_words, tolerance_words, verdict_words
from urmpipe_pipeline.report.facts import Fact
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.solved_targets.verdict import faults, reached_words, solved

STATES = ("fail", "pass", "ingested")
"""What a banner may say, the most important first."""


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

    @property
    def sentence(self) -> str:
        """The same below another banner: "FAIL: poses: arm6 reaches 3 targets, with 1 jump. 1 jump: ..."."""
        said = f"{self.word}: {self.headline}."
        return said if self.state == "ingested" else f"{said} {self.detail}".rstrip()


def joined(banners: Sequence[Banner]) -> Banner:
    """Return one banner of several kinds of results: the first that fails leads, else the first judged one.

    What the others found stands below, each with its own word: none hides behind another.

    Args:
        banners: One a kind, at least one.
    """
    lead, *others = sorted(banners, key=lambda one: STATES.index(one.state))
    return replace(lead, detail=" ".join(filter(None, [lead.detail, *(one.sentence for one in others)])))


def comparison_banner(comparisons: Sequence[Comparison], links: Sequence[Sequence[str]]) -> Banner:
    """Return the verdict over all comparisons.

    Args:
        comparisons: Those of the page, at least one.
        links: Where each log of each comparison is told of, best to worst.
    """
    places = [
        (run, link)
        for comparison, some in zip(comparisons, links, strict=True)
        for run, link in zip(comparison.ranking, some, strict=True)
    ]
    run, href = sorted(places, key=lambda one: by_tolerance(one[0]))[-1]
    state = "fail" if any(one.verdict == "fail" for one in comparisons) else "pass"
    facts = (*_decisive(run, href), *_against(comparisons))
    return Banner(state, state.upper(), verdict_words(comparisons), facts)


def _decisive(run: Deviation, href: str) -> tuple[Fact, ...]:
    """Return which quantity uses up the largest share of its tolerance, how much, when and where."""
    one = run.decisive
    return (
        Fact("Furthest out" if one.verdict == "fail" else "Closest to the limit", run.name, href=href),
        Fact("How much", amount_words(one)),
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


def solved_banner(runs: Sequence[Run]) -> Banner:
    """Return how many targets are reached, and what keeps an arm from the path: the verdict of ik.

    Args:
        runs: Solved targets, at least one.
    """
    state = "pass" if all(map(solved, runs)) else "fail"
    facts = (Fact("Warnings", str(sum(len(run.warnings) for run in runs))),)
    told = ((f"{run.name}: " if len(runs) > 1 else "", fault) for run in runs for fault in faults(run))
    said = " ".join(f"{of}{fault}." for of, fault in told)
    return Banner(state, state.upper(), reached_words(runs), facts, said)


def ingested_banner(runs: Sequence[Run]) -> Banner:
    """Return what was ingested.

    Args:
        runs: Logs that were not compared, at least one.
    """
    rows = sum(run.log.rows for run in runs)
    wraps = sum(len(run.repolarizations) for run in runs)
    subject = runs[0].name if len(runs) == 1 else text.counted(len(runs), "log")
    headline = f"{subject}: {text.counted(rows, 'row')}, {text.counted(wraps, 'repolarization')}"
    warnings = text.counted(sum(len(run.warnings) for run in runs), "warning")
    detail = f"{warnings}. Nothing was compared: there is no verdict."
    return Banner("ingested", "INGESTED", headline, detail=detail)
