"""What a search for solutions is asked, whoever searches."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from numbers import Integral, Real

from urmpipe_models.errors import Finding, shown

MOST_RESTARTS = 10_000
"""Most random starts: so many take minutes for one target already."""


@dataclass(frozen=True, slots=True)
class Search:
    """How far a search goes for what does not follow from the start.

    Attributes:
        tolerance: In [m] along each axis: a target out of reach takes the nearest point that the tool can
            get to if it is no farther away than this, and turned by no more than tolerance / l with l of
            `turn_length`; `shortfall` says how far it is. None: it has no solution.
        restarts: Random starts of the iterative solver for what it does not reach from the start.
        seed: Of the random starts: the same seed, the same solutions.
    """

    tolerance: float | None = None
    restarts: int = 20
    seed: int = 0

    def faults(self) -> Iterator[Finding]:
        """Yield which of the values make no sense."""
        if self.tolerance is not None and not isinstance(self.tolerance, Real):
            allowed = "a number of m, more than 0"
            yield Finding(parameter="tolerance", found=shown(self.tolerance), allowed=allowed)
        elif self.tolerance is not None and not 0.0 < self.tolerance < math.inf:
            found = f"{self.tolerance:g} m"
            yield Finding(parameter="tolerance", found=found, allowed="more than 0, finite")
        for name, value in (("restarts", self.restarts), ("seed", self.seed)):
            if not isinstance(value, Integral) or value < 0:
                yield Finding(parameter=name, found=shown(value), allowed="a whole number, 0 or more")
            elif name == "restarts" and value > MOST_RESTARTS:
                yield Finding(parameter=name, found=shown(value), allowed=f"{MOST_RESTARTS} at most")


USUAL_SEARCH = Search()
"""The search where nothing else is asked."""
