"""The scores as tables, with the interval where only a sample was tried."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from mutants.modules import inner
from mutants.results import Score

Z = 1.96
"""Of the 95 % interval."""


COLUMNS = (
    *("module", "mutants", "tried", "killed", "timeout", "survived"),
    *("of these equivalent", "no tests", "broken", "raw", "score"),
)


class Share(NamedTuple):
    """A share that a sample tells, and its 95 % interval."""

    found: float
    low: float
    high: float

    def __str__(self) -> str:
        """Return it in per cent, with its interval if it has one."""
        text = f"{100 * self.found:.1f} %"
        return text if self.low == self.high else f"{text} ({100 * self.low:.0f} to {100 * self.high:.0f} %)"


def interval(found: int, tried: int) -> tuple[float, float]:
    """Return the 95 % interval of a share of which a sample is known (Wilson 1927)."""
    if not tried:
        return 0.0, 1.0
    p = found / tried
    middle = p + Z * Z / (2 * tried)
    half = Z * math.sqrt(p * (1 - p) / tried + Z * Z / (4 * tried * tried))
    return (middle - half) / (1 + Z * Z / tried), (middle + half) / (1 + Z * Z / tried)


def share(found: int, of: int, whole: bool) -> Share:
    """Return the share of a module's mutants, with an interval if only a sample was tried."""
    value = found / of if of else 1.0
    return Share(value, value, value) if whole else Share(value, *interval(found, of))


def total(scores: Sequence[Score], raw: bool = False) -> Share:
    """Return the share of all mutants that tests find, each module by how many mutants it has.

    The interval is that of a stratified sample, none where all were tried (Cochran 1977, section 5.6). The
    variance in a module is that of (found + 1) / (tried + 2): a sample without a survivor is no proof.
    """
    mutants = sum(one.mutants for one in scores)
    value = variance = 0.0
    for one in scores:
        of = one.tried if raw else one.meaningful
        weight, p = one.mutants / mutants, (one.found + 1) / (of + 2)
        value += weight * share(one.found, of, whole=True).found
        variance += weight**2 * p * (1 - p) / max(of, 1) * (1 - one.tried / one.mutants)
    half = Z * math.sqrt(variance)
    return Share(value, max(value - half, 0.0), min(value + half, 1.0))


def table(title: str, scores: Sequence[Score]) -> list[str]:
    """Return a Markdown table, the lowest score first."""
    if not scores:
        return []
    raw, score = total(scores, raw=True), total(scores)
    return [
        "",
        f"## {title}: {score}, with the equivalent ones {raw}",
        "",
        f"| {' | '.join(COLUMNS)} |",
        "|---" * len(COLUMNS) + "|",
        *(
            _row(one)
            for one in sorted(scores, key=lambda one: (one.found / max(one.meaningful, 1), one.module))
        ),
    ]


def _row(score: Score) -> str:
    """Return the line of a module."""
    whole = score.tried == score.mutants
    cells = (
        inner(score.module),
        score.mutants,
        "all" if whole else score.tried,
        *(score.count(what) for what in ("killed", "timeout", "survived")),
        len(score.equivalent),
        *(score.count(what) for what in ("no tests", "broken")),
        f"{100 * share(score.found, score.tried, whole=True).found:.1f} %",
        share(score.found, score.meaningful, whole),
    )
    return f"| {' | '.join(map(str, cells))} |"


def unclear(scores: Sequence[Score]) -> list[str]:
    """Return what stands for neither killed nor survived: broken processes, and mutants left untried."""
    lines = [f"- {name}: exit code {score.codes[name]}" for score in scores for name in score.names("broken")]
    lines += [f"- {name}: not tried" for score in scores for name in score.names("untried")]
    return (
        [
            "",
            "Broken processes count as not found; mutants that could not be tried count as nothing:",
            "",
            *lines,
        ]
        if lines
        else []
    )


def survivors(scores: Sequence[Score], changes: Mapping[str, str]) -> list[str]:
    """Return the survivors that are not known to be no change, each with what it changes."""
    return [
        line
        for score in scores
        for name in score.left
        for line in (name, *(f"    {one}" for one in changes[name].splitlines()))
    ]
