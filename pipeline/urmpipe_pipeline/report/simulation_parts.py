"""The part of the page about a simulation, its card and what it says at the top of the page."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.delta_verdict import DeltaVerdict
from urmpipe_pipeline.comparison.wording import meter_amount, meter_size, meter_used, out_words
from urmpipe_pipeline.report.banner import Banner
from urmpipe_pipeline.report.cards import Card
from urmpipe_pipeline.report.facts import Fact
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.simulations.wording import outcome_words

STATES = {"pass": "pass", "fail": "fail", None: "simulated"}
"""How a card looks, by the verdict."""


def simulation_banner(simulations: Sequence[Simulation], links: Sequence[str]) -> Banner:
    """Return the verdict over simulations: what failed or is worst, or what was simulated.

    Args:
        simulations: At least one.
        links: Where each is told of.
    """
    shown, href = max(zip(simulations, links, strict=True), key=lambda pair: _badness(pair[0]))
    if shown.failed is not None:
        end = f"t = {text.seconds(float(shown.t[-1]))} s" if len(shown.t_ns) else "its start"
        said = (Fact("System", shown.name, href=href), Fact("Recorded until", end), Fact("Why", shown.failed))
        return Banner("fail", "FAILED", outcome_words(shown), said, _counts(simulations))
    worst = shown.judged_worst
    if worst is None:
        samples = text.counted(sum(len(one.t_ns) for one in simulations), "sample")
        several = f"{text.counted(len(simulations), 'system')}: {samples}"
        headline = outcome_words(shown) if len(simulations) == 1 else several
        return Banner("ingested", "SIMULATED", headline, detail="Nothing was judged: there is no verdict.")
    facts = (
        Fact("Furthest out" if worst.verdict == "fail" else "Closest to the limit", shown.name, href=href),
        Fact("How much", meter_amount(worst)),
        *_judged_facts(worst),
    )
    return Banner(worst.verdict, worst.verdict.upper(), outcome_words(shown), facts, _counts(simulations))


def _counts(simulations: Sequence[Simulation]) -> str:
    """Return how several simulations ended; nothing of one."""
    if len(simulations) == 1:
        return ""
    verdicts = [one.verdict for one in simulations]
    told = {"fail": "{} failed", "pass": "{} passed", None: "{} without a verdict"}
    counts = [said.format(verdicts.count(key)) for key, said in told.items() if key in verdicts]
    return f"Of {len(simulations)} simulations: {', '.join(counts)}."


def simulation_card(simulation: Simulation, href: str) -> Card:
    """Return the card of a simulation."""
    worst = simulation.judged_worst
    allowed = worst.allowed if worst is not None else None
    return Card(
        name=simulation.name,
        href=href,
        state=STATES[simulation.verdict],
        size="Failed after" if simulation.failed is not None else _size(worst),
        amount=_length(simulation) if simulation.failed is not None or worst is None else _worst(worst),
        allowed="" if allowed is None or simulation.failed is not None else f"{text.limit(allowed)} mm",
        share=None if worst is None or worst.used is None else min(worst.used, 1.0),
        used="" if worst is None else meter_used(worst),
        facts=_card_facts(simulation),
    )


def simulation_facts(simulation: Simulation) -> tuple[Fact, ...]:
    """Return what a simulation is: its description, its samples, its step."""
    found = (
        Fact("Description", simulation.description),
        Fact("Samples", str(len(simulation.t_ns))),
        Fact("Duration", _length(simulation)),
        Fact("Communication step", f"{text.seconds(simulation.step)} s"),
        Fact("Recording", str(simulation.recording) if simulation.recording else ""),
    )
    return tuple(fact for fact in found if fact.value)


def _card_facts(simulation: Simulation) -> tuple[Fact, ...]:
    worst = simulation.judged_worst
    judged = () if worst is None else _judged_facts(worst)
    found = (
        Fact("Why", simulation.failed or ""),
        *judged,
        Fact("Duration", _length(simulation)),
        Fact("Step", f"{text.seconds(simulation.step)} s"),
        Fact("Samples", str(len(simulation.t_ns))),
        Fact("Blocks", str(len(simulation.blocks))),
        Fact("Warnings", str(len(simulation.warnings))),
    )
    return tuple(fact for fact in found if fact.value)


def _judged_facts(worst: DeltaVerdict) -> tuple[Fact, ...]:
    """Return when a delta meter was worst, and how often it was out of tolerance."""
    return (
        Fact("When", f"t = {text.seconds(worst.t)} s"),
        Fact("Out of tolerance", out_words(worst.out_of_tolerance, worst.samples)),
    )


def _badness(simulation: Simulation) -> tuple[bool, bool, float]:
    """Return what puts the worst simulation last: failed, out of tolerance, share of it used up."""
    worst = simulation.judged_worst
    used = -1.0 if worst is None else float("inf") if worst.used is None else worst.used
    return simulation.failed is not None, simulation.verdict == "fail", used


def _length(simulation: Simulation) -> str:
    return f"{text.seconds(simulation.duration)} s"


def _size(worst: DeltaVerdict | None) -> str:
    """Return what is worst, such as |Δx|; nothing where nothing is judged."""
    if worst is None:
        return "Simulated"
    return meter_size(worst)


def _worst(worst: DeltaVerdict) -> str:
    return "no value" if worst.used is None else text.quantity(worst.worst, "m", worst.allowed)
