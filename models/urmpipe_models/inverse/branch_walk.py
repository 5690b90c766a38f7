"""Along a path with a closed form: every branch of every sample at once, then from sample to sample.

Of the solutions of a sample, each joint in the nearest of its allowed turns, the one is taken that is nearest
to the sample before, sum (q_k - q_{k-1})^2. So a solution goes on continuously even where its name changes:
through an aligned wrist theta5 changes its sign, and a flipped wrist becomes one that is not.

Where a pose leaves a joint free (a singular family) it stays where it was. After samples without a solution
the branch of before goes on if there is one of its name, else the nearest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
        q: In [rad], shape (n, joints); NaN where there is none.
        branch: Their names, shape (n,); empty where there is none.
        reasons: Why there is none, shape (n,); empty where there is one.
        singular: Where they lie in each family of singular poses, shape (n,).
    """

    q: FloatArray
    branch: TextArray
    reasons: TextArray
    singular: dict[SingularFamily, BoolArray]


def walk(chain: Chain, form: ClosedForm, targets: Targets, start: FloatArray) -> Walked:
    """Return the solutions that are taken along a path, limits kept.

    Args:
        chain: The arm, all its joints revolute as those of every closed form.
        form: Its closed form.
        targets: Poses, one a sample.
        start: Joint values in [rad] that the first sample shall be near to, shape (joints,).
    """
    found = within_limits(chain, form.solve(targets))
    reached = np.asarray(found.reached.any(axis=1))
    q, column = np.full((len(targets), len(start)), np.nan), np.zeros(len(targets), dtype=np.intp)
    free_until = dict(stretches(_left_free(found) & reached))
    choices, last, before = _Choices.of(chain, found), start, -1
    for sample in np.flatnonzero(reached).tolist():
        if sample in free_until:
            rows = slice(sample, free_until[sample] + 1)
            near = within_limits(chain, form.solve(targets.rows(rows), last), last)
            choices.put(rows, _Choices.of(chain, near))
        label = column[before] if 0 <= before < sample - 1 else None
        column[sample], last = choices.nearest(sample, last, label)
        q[sample], before = last, sample
    return Walked(q, *_told(found, column, reached))


@dataclass(frozen=True, slots=True, eq=False)
class _Choices:
    """The solutions of samples, and the whole turns that each joint may be off them.

    Attributes:
        q: In [rad], shape (n, k, joints); 0 where there is none.
        lost: Infinity where there is none, 0 elsewhere, shape (n, k).
        least: Whole turns that a joint may turn less, shape (n, k, joints).
        most: Whole turns that a joint may turn more, shape (n, k, joints).
    """

    q: FloatArray
    lost: FloatArray
    least: FloatArray
    most: FloatArray

    @classmethod
    def of(cls, chain: Chain, found: Solutions) -> _Choices:
        """Return the choices that solutions within limits leave."""
        lower, upper = limits_of(chain)
        q = np.where(found.reached[..., None], found.q, 0.0)
        least = np.ceil((lower - LIMIT_ROUNDING - q) / TURN)
        most = np.floor((upper + LIMIT_ROUNDING - q) / TURN)
        return cls(q, np.where(found.reached, 0.0, np.inf), least, most)

    def put(self, rows: slice, other: _Choices) -> None:
        """Put in the place of some samples what was found for them anew."""
        for mine, others in (
            (self.q, other.q),
            (self.lost, other.lost),
            (self.least, other.least),
            (self.most, other.most),
        ):
            mine[rows] = others

    def nearest(self, sample: int, last: FloatArray, column: int | None) -> tuple[int, FloatArray]:
        """Return the column and the joint values that are nearest to the last ones.

        Args:
            sample: Its index.
            last: Joint values before, shape (joints,).
            column: Taken whatever its distance, if it has a solution; None to take the nearest.
        """
        turns = np.rint((last - self.q[sample]) / TURN)
        near = self.q[sample] + TURN * np.minimum(np.maximum(turns, self.least[sample]), self.most[sample])
        away = near - last
        if column is None or self.lost[sample, column] > 0.0:
            column = int(np.argmin(np.einsum("kj,kj->k", away, away) + self.lost[sample]))
        return column, near[column]


def _left_free(found: Solutions) -> BoolArray:
    """Return the samples at which a family of singular poses leaves joints undetermined, shape (n,)."""
    free = np.zeros(len(found), dtype=bool)
    for family in found.singular:
        if family.free:
            free |= family.where.any(axis=1)
    return free


def _told(
    found: Solutions, column: NDArray[np.intp], reached: BoolArray
) -> tuple[TextArray, TextArray, dict[SingularFamily, BoolArray]]:
    """Return names, reasons and families of the solutions that were taken."""
    rows = np.arange(len(found))
    branch = np.where(reached, found.labels[rows, column], "")
    reasons = np.full(len(found), "", dtype=np.object_)
    reasons[~reached] = [found.reason(sample) for sample in np.flatnonzero(~reached).tolist()]
    singular: dict[SingularFamily, BoolArray] = {}
    for family in found.singular:
        where = family.where[rows, column] & reached
        singular[family.family] = singular.get(family.family, False) | where
    return branch, reasons, singular
