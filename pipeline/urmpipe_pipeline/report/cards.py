"""The cards under the banner: what a minute is enough to read about each compared log."""

from __future__ import annotations

from dataclasses import dataclass

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import Deviation, Statistics
from urmpipe_pipeline.comparison.symbols import size_of, used_words
from urmpipe_pipeline.report.facts import (
    Fact,
    alignment_value,
    speed_correlation,
    stretch,
    sync_value,
)


@dataclass(frozen=True, slots=True)
class Card:
    """One compared log.

    Attributes:
        name: Its name.
        href: Where its part of the page is, such as "#c1-1".
        state: pass or fail.
        size: What decides, such as |Δx|.
        amount: Its largest absolute value with the unit.
        allowed: What is allowed; empty where nothing is.
        share: Share of the tolerance that is used up, 0 to 1 at most, drawn as a bar; None without one.
        used: The same in words.
        facts: What else there is to know.
    """

    name: str
    href: str
    state: str
    size: str
    amount: str
    allowed: str
    share: float | None
    used: str
    facts: tuple[Fact, ...]


def card(deviation: Deviation, href: str, covered: float, warnings: int) -> Card:
    """Return the card of a compared log.

    Args:
        deviation: The log.
        href: Where its part of the page is.
        covered: Share of the reference's samples within its time, 0..1.
        warnings: How many there are of it.
    """
    decisive = deviation.decisive
    tolerance = decisive.tolerance
    shown = text.SHOWN[decisive.unit][0]
    return Card(
        name=deviation.name,
        href=href,
        state=deviation.verdict,
        size=size_of(decisive),
        amount=text.quantity(decisive.max, decisive.unit, tolerance),
        allowed="" if tolerance is None else f"{text.limit(tolerance, decisive.unit)} {shown}",
        share=None if decisive.used is None else min(decisive.used, 1.0),
        used=used_words(decisive),
        facts=tuple(fact for fact in _facts(deviation, covered, warnings) if fact.value),
    )


def _facts(deviation: Deviation, covered: float, warnings: int) -> list[Fact]:
    decisive = deviation.decisive
    found = deviation.statistics
    angle = found.get("angle")
    return [
        Fact("When", f"t = {text.seconds(decisive.t_max)} s"),
        Fact("Where (x, y, z)", f"{text.point(deviation.place(decisive))} m"),
        Fact("Covered", f"{text.percent(covered)} of the reference"),
        Fact("Largest ‖Δ‖", _largest(found["norm"])),
        Fact("Off the path", _largest(found["path"])),
        Fact("Largest angle", _largest(angle) if angle else ""),
        Fact("Largest joint", _largest_joint(deviation)),
        Fact("Out of tolerance", text.percent(deviation.share_out)),
        Fact("Longest out", stretch(deviation.longest_out)),
        Fact("Clocks", sync_value(deviation.sync)),
        Fact("Alignment", alignment_value(deviation)),
        Fact("r(‖Δ‖, speed)", speed_correlation(deviation)),
        Fact("Warnings", str(warnings)),
    ]


def _largest(statistics: Statistics) -> str:
    return text.quantity(statistics.max, statistics.unit, statistics.tolerance)


def _largest_joint(deviation: Deviation) -> str:
    """Return the joint that is furthest off, of each unit, with its deviation."""
    furthest = map(deviation.furthest_joint, text.SHOWN)
    return ", ".join(f"{_largest(one)} ({one.quantity})" for one in furthest if one)
