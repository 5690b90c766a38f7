"""Stretches of samples that have something in common.

The solutions of samples to choose from on the way along a path, each joint in any of its allowed turns.

Along a path with a closed form: every branch of every sample at once, then from sample to sample.

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

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import BoolArray, FloatArray, TextArray
from urmpipe_models.ik.closed import ClosedForm
from urmpipe_models.ik.solutions import (
    LIMIT_ROUNDING,
    TURN,
    SingularFamily,
    Solutions,
    Targets,
    joint_limits,
    limit_solutions,
)


def find_true_runs(where: BoolArray) -> list[tuple[int, int]]:
    """Return the first and last index of every run of true values of `where`, shape (n,), ascending."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], where, [False]))))
    return [(int(first), int(last) - 1) for first, last in edges.reshape(-1, 2)]


@dataclass(frozen=True, slots=True, eq=False)
class BranchCandidates:
    """The solutions of samples, and the whole turns that each joint may be off them.

    Attributes:
        q: In [rad], shape (n, k, joints); 0 where there is none.
        lost: Infinity where there is none, 0 elsewhere [-], shape (n, k).
        least: Whole turns that a joint may turn less [-], shape (n, k, joints).
        most: Whole turns that a joint may turn more [-], shape (n, k, joints).
    """

    q: FloatArray
    lost: FloatArray
    least: FloatArray
    most: FloatArray

    @classmethod
    def of(cls, chain: Chain, found: Solutions) -> BranchCandidates:
        """Return the choices that solutions within limits leave."""
        lower, upper = joint_limits(chain)
        q = np.where(found.reached[..., None], found.q, 0.0)
        least = np.ceil((lower - LIMIT_ROUNDING - q) / TURN)
        most = np.floor((upper + LIMIT_ROUNDING - q) / TURN)
        return cls(q, np.where(found.reached, 0.0, np.inf), least, most)

    def put(self, rows: slice, other: BranchCandidates) -> None:
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
            last: Joint values before in [rad] or [m], shape (joints,).
            column: Taken whatever its distance, if it has a solution; None to take the nearest.

        Returns:
            The column, and joint values in [rad] or [m], shape (joints,).
        """
        turns = np.rint((last - self.q[sample]) / TURN)
        near = self.q[sample] + TURN * np.minimum(np.maximum(turns, self.least[sample]), self.most[sample])
        away = near - last
        if column is None or self.lost[sample, column] > 0.0:
            column = int(np.argmin(np.einsum("kj,kj->k", away, away) + self.lost[sample]))
        return column, near[column]

    def going_on(self, rows: slice, column: int, last: FloatArray) -> FloatArray:
        """Return joint values in [rad] or [m] while a column is the nearest and allowed, shape (m, joints).

        Another solution can only be farther than the shorter way to it, so limits of its turns are not asked.

        Args:
            rows: Samples to look at, one after the other.
            column: Where the sample before them is.
            last: Joint values of that sample in [rad] or [m], shape (joints,).
        """
        own = self.q[rows, column]
        before = np.vstack((last, own[:-1]))
        turns = np.cumsum(np.rint((before - own) / TURN), axis=0)
        away = self.q[rows] - before[:, None]
        away -= TURN * np.rint(away / TURN)
        nearest = np.argmin(np.einsum("nkj,nkj->nk", away, away) + self.lost[rows], axis=1)
        allowed = (self.least[rows, column] <= turns) & (turns <= self.most[rows, column])
        stays = (nearest == column) & (self.lost[rows, column] == 0.0) & allowed.all(axis=1)
        return np.asarray((own + TURN * turns)[: int(np.argmin(np.append(stays, False)))])


FEW, MANY = 8, 1024
"""Samples that are looked at together in a column, twice as many each time while it is the nearest."""


@dataclass(frozen=True, slots=True, eq=False)
class BranchPath:
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


def follow_branches(chain: Chain, form: ClosedForm, targets: Targets, start: FloatArray) -> BranchPath:
    """Return the solutions that are taken along a path, limits kept.

    Args:
        chain: The arm, all its joints revolute as those of every closed form.
        form: Its closed form.
        targets: Poses, one a sample.
        start: Joint values in [rad] that the first sample shall be near to, shape (joints,).
    """
    found = limit_solutions(chain, form.solve(targets))
    way = _Way(chain, form, targets, found, start)
    for sample in np.flatnonzero(found.reached.any(axis=1)).tolist():
        if sample > way.at:
            way.step(sample)
            way.go_on()
    return BranchPath(way.q, *_told(found, way.column))


class _Way:
    """A way along the solutions of a path, taken sample by sample and, where it is plain, many at once.

    Attributes:
        at: The last sample with a solution, -1 before the first.
        q: The solutions taken, shape (n, joints).
        column: The columns that they are in, -1 where there is none, shape (n,).
    """

    def __init__(
        self, chain: Chain, form: ClosedForm, targets: Targets, found: Solutions, start: FloatArray
    ) -> None:
        """Stand before the first sample; the arguments are those of `walk`, and what it found."""
        self._chain, self._form, self._targets = chain, form, targets
        self._choices = BranchCandidates.of(chain, found)
        self._free = find_true_runs(_left_free(found))
        self._last, self._many = start, FEW
        self.at = -1
        self.q = np.full((len(found), len(start)), np.nan)
        self.column = np.full(len(found), -1, dtype=np.intp)

    def step(self, sample: int) -> None:
        """Take the nearest solution of a sample; after a gap the one of the same branch."""
        if self._free and self._free[0][0] <= sample:
            self._settle(slice(sample, self._free.pop(0)[1] + 1))
        same = int(self.column[self.at]) if 0 <= self.at < sample - 1 else None
        column, q = self._choices.nearest(sample, self._last, same)
        self._take(sample, column, q[None])

    def go_on(self) -> None:
        """Stay in the column as long as its solution is the nearest."""
        column, stop = int(self.column[self.at]), self._free[0][0] if self._free else len(self.q)
        while (first := self.at + 1) < stop:
            rows = slice(first, min(first + self._many, stop))
            found = self._choices.going_on(rows, column, self._last)
            if len(found):
                self._take(first, column, found)
            if len(found) < rows.stop - rows.start:
                self._many = FEW
                return
            self._many = min(2 * self._many, MANY)

    def _take(self, first: int, column: int, q: FloatArray) -> None:
        """Take solutions of a column, one a sample."""
        rows = slice(first, first + len(q))
        self.q[rows], self.column[rows] = q, column
        self.at, self._last = rows.stop - 1, q[-1]

    def _settle(self, rows: slice) -> None:
        """Leave the joints that are free at singular poses where they are."""
        found = self._form.solve(self._targets.rows(rows), self._last)
        self._choices.put(
            rows,
            BranchCandidates.of(self._chain, limit_solutions(self._chain, found, self._last)),
        )


def _left_free(found: Solutions) -> BoolArray:
    """Return the samples at which a family of singular poses leaves joints undetermined, shape (n,)."""
    free = np.zeros(len(found), dtype=bool)
    for family in found.singular:
        if family.free:
            free |= family.where.any(axis=1)
    return free


def _told(
    found: Solutions, column: NDArray[np.intp]
) -> tuple[TextArray, TextArray, dict[SingularFamily, BoolArray]]:
    """Return names, reasons and families of the solutions that were taken."""
    reached, rows = column >= 0, np.arange(len(found))
    branch = np.where(reached, found.labels[rows, column], "")
    reasons = np.full(len(found), "", dtype=np.object_)
    reasons[~reached] = [found.reason(sample) for sample in np.flatnonzero(~reached).tolist()]
    singular: dict[SingularFamily, BoolArray] = {}
    for family in found.singular:
        where = family.where[rows, column] & reached
        singular[family.family] = singular.get(family.family, False) | where
    return branch, reasons, singular
