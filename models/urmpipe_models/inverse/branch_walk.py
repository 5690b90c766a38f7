"""Along a path with a closed form: every branch of every sample at once, then from sample to sample.

Of the solutions of a sample, each joint in that of its allowed turns that is nearest, the one is taken that is
nearest to the sample before, sum (q_k - q_{k-1})^2. So a solution goes on continuously even where its name
changes: through an aligned wrist theta5 changes its sign, and a flipped wrist is one that is not.

Where a pose leaves a joint free (a singular family) it stays where it was. After samples without a solution
the branch of before goes on if there is one of its name, else the nearest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from urmpipe_models.chain import Chain
from urmpipe_models.inverse.closed_form import ClosedForm
from urmpipe_models.inverse.iterative import limits_of
from urmpipe_models.inverse.limits import LIMIT_ROUNDING, TURN, within_limits
from urmpipe_models.inverse.solutions import BoolArray, FloatArray, SingularFamily, Solutions, TextArray
from urmpipe_models.inverse.stretches import stretches
from urmpipe_models.inverse.targets import Targets


@dataclass(frozen=True, slots=True, eq=False)
class Walked:
    """The solutions taken along a path.

    Attributes:
        q: In [rad] or [m], shape (n, joints); NaN where there is none.
        branch: Their names, shape (n,); empty where there is none.
        reasons: Why there is none, shape (n,); empty where there is one.
        singular: Where they lie in each family of singular poses, shape (n,).
    """

    q: FloatArray
    branch: TextArray
    reasons: TextArray
    singular: dict[SingularFamily, BoolArray]


class BranchWalk:
    """One way along the solutions of a path."""

    def __init__(self, chain: Chain, form: ClosedForm, targets: Targets, start: FloatArray) -> None:
        """Solve every sample.

        Args:
            chain: The arm.
            form: Its closed form.
            targets: Poses, one a sample.
            start: Joint values in [rad] or [m] that the first sample shall be near to, shape (joints,).
        """
        self._chain, self._form, self._targets = chain, form, targets
        self._last, self._label = start, -1
        self._lower, self._upper = limits_of(chain)
        self._found = within_limits(chain, form.solve(targets))
        self._q = np.where(self._found.reached[..., None], self._found.q, 0.0)

    def walk(self) -> Walked:
        """Go from sample to sample and return what was taken."""
        found = self._found
        count, _, joints = found.q.shape
        q, column = np.full((count, joints), np.nan), np.zeros(count, dtype=np.intp)
        least = np.ceil((self._lower - LIMIT_ROUNDING - self._q) / TURN)
        most = np.floor((self._upper + LIMIT_ROUNDING - self._q) / TURN)
        for sample in range(count):
            ...
