"""What a search finds: explanations with their scores, and what they rest on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from urmpipe_pipeline.diagnosis.fit import Rows
from urmpipe_pipeline.diagnosis.hypotheses import State
from urmpipe_pipeline.diagnosis.selection import Normal, Selection, Subset


class Explanation(NamedTuple):
    """Causes, with their sizes.

    Attributes:
        state: Edits and numbers.
        subset: The groups whose numbers are taken.
        score: Lower is better.
    """

    state: State
    subset: Subset
    score: float


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found.

    Attributes:
        best: The best explanation.
        others: Those that the log does not tell from it.
        rows: The rows that counted: without outliers, in the weights of their noise.
        tau: The autocorrelation time of what stays, in rows.
        variance: Mean square of what stays of a component in its weight, not below the floor.
        normal: The normal equations there.
        twins: Which groups are told by another.
    """

    best: Explanation
    others: tuple[Explanation, ...]
    rows: Rows
    tau: float
    variance: float
    normal: Normal
    twins: dict[int, int]


class Stable(NamedTuple):
    """An explanation that its own fit selects again.

    Attributes:
        state: Edits and numbers.
        subset: The groups that are taken.
        tau: The autocorrelation time of what stays, in rows.
        rows: The rows without outliers.
        selection: What it was selected from.
    """

    state: State
    subset: Subset
    tau: float
    rows: Rows
    selection: Selection

    def score(self, tau: float) -> float:
        """Return its score where so many rows tell as much as one."""
        selection = replace(self.selection, independent=self.selection.normal.count / tau)
        return float(selection.scores([self.subset])[0])
