"""A path without a closed form: least motion from sample to sample, restarts where that ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, TextArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.along_path.nearest_turns import in_nearest_turns
from urmpipe_models.inverse.along_path.sliding_window import SlidingWindow
from urmpipe_models.inverse.search import Search
from urmpipe_models.inverse.solve import solve
from urmpipe_models.inverse.targets import Targets

MOST_AT_ONCE = 512
"""Samples out of reach that are tried together: a few hundred cost hardly more than one."""

MORE = 4
"""How many times as many are tried next while all are out of reach."""


@dataclass(eq=False)
class LeastMotionPath:
    """Joint values along a path, and why samples have none.

    Where a sample does not follow from the one before by least motion, `solve` looks for it, from the
    sample before and from random restarts. If it is out of reach, so are probably the next ones: they are
    tried together, more of them each time.

    Attributes:
        chain: The arm.
        targets: Poses or positions, one a sample.
        start: Joint values in [rad] or [m] that the first sample moves least from, shape (joints,).
        search: How far to search for what does not follow from the sample before.
        progress: Told the share of the samples that is done, 0 to 1.
        q: Joint values found in [rad] or [m], shape (n, joints); NaN where there are none.
        reasons: Why there are none, shape (n,); empty where there are.
        shortfall: How far the tool stays from targets out of reach, in [m], shape (n,).
    """

    chain: Chain
    targets: Targets
    start: FloatArray
    search: Search
    progress: Callable[[float], None]
    q: FloatArray = field(init=False)
    reasons: TextArray = field(init=False)
    shortfall: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        count = len(self.targets)
        self.reasons = np.full(count, "", dtype=np.object_)
        self.shortfall = np.zeros(count)
        self._at_once = 1
        window = SlidingWindow(self.chain, self.targets, self.start, self._look_for)
        self.q = window.slide(self.progress)

    def _look_for(self, sample: int, last: FloatArray) -> FloatArray:
        """Return the joint values of a sample, or of it and those after it that are as much out of reach."""
        rows = slice(sample, sample + self._at_once)
        targets = self.targets.rows(rows)
        found = solve(self.chain, targets, start=last, method="iterative", search=self.search)
        met = found.reached[:, 0] & (found.shortfall[:, 0] == 0.0)
        alike = 1 if met[0] else _alike(met, found.reached[:, 0])
        self._at_once = min(MOST_AT_ONCE, MORE * self._at_once) if alike == len(met) and not met[0] else 1
        self.reasons[sample : sample + alike] = found.reasons[:alike, 0]
        self.shortfall[sample : sample + alike] = found.shortfall[:alike, 0]
        return in_nearest_turns(self.chain, found.q[:alike, 0], last)


def _alike(met: BoolArray, reached: BoolArray) -> int:
    """Return how many samples from the first on are not met and reached, or not, as the first is."""
    other = met | (reached != reached[0])
    return int(np.argmax(np.append(other, True)))
