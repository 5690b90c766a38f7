"""Which of many small causes a deviation takes: subsets of the columns of a linear model, scored.

A deviation y is y = sum(J_g x_g) + noise over the groups g of columns that are taken. Subsets are scored by
the extended Bayesian information criterion

    n ln(max(RSS / N, floor)) + k ln n + 2 ln C(K, s),

with RSS the sum of the N squares that s of K groups with k columns leave, and n the number of independent
ones among them: N divided by the autocorrelation time. The lowest score is best. Of the
best, groups whose columns move less than the floor are dropped: RSS cannot show that under larger noise.

Source: [ChenChen2008]_ eq. 2, gamma = 1.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb, log
from typing import TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray

Subset: TypeAlias = frozenset[int]
"""The groups that are taken, by their index."""

MOST = 6
"""Groups that are taken at most: a deviation that takes more is no list of causes."""

STARTS = 4
"""So many of the best subsets of one or two groups are searched on from."""

TWIN = 1e-9
"""Columns whose directions differ by less, as 1 - |cos|, are the same but for rounding."""

NOTHING = 1e-10
"""A column of which no more is left (of its square) when what is always taken is taken away moves nothing."""

_RIDGE = 1e-11
"""Keeps the equations of twins solvable; columns have unit length."""


@dataclass(frozen=True, eq=False)
class Normal:
    """The normal equations of all columns: all that subsets are scored by.

    Attributes:
        gram: J^T J [-], in the weights of the rows, shape (p, p).
        moment: J^T y [-], shape (p,).
        square: y^T y.
        count: N, the number of rows that stand in them.
    """

    gram: FloatArray
    moment: FloatArray
    square: float
    count: int

    def __add__(self, other: Normal) -> Normal:
        """Return the equations of the rows of both."""
        return Normal(
            self.gram + other.gram,
            self.moment + other.moment,
            self.square + other.square,
            self.count + other.count,
        )

    def without(self, taken: Sequence[int], damping: FloatArray) -> Normal:
        """Return the equations of what is left when some columns are always taken (Schur complement).

        With a damping of sigma^2 / s^2 a column has numbers of about s beside noise of about sigma: what so
        much of it explains needs no other cause.

        Args:
            taken: The columns.
            damping: Of each of them, in the square of its unit to the -1, shape (len(taken),).
        """
        at = np.array(taken, dtype=np.int64)
        if not len(at):
            return self
        inner = self.gram[np.ix_(at, at)] + np.diag(damping)
        size = np.sqrt(np.maximum(np.diag(inner), 1e-300))
        inverse = np.linalg.pinv(inner / size / size[:, np.newaxis], rcond=1e-13, hermitian=True)
        inverse = inverse / size / size[:, np.newaxis]
        across = self.gram[:, at] @ inverse
        gram = self.gram - across @ self.gram[at]
        moment = self.moment - across @ self.moment[at]
        square = self.square - float(self.moment[at] @ inverse @ self.moment[at])
        return Normal(gram, moment, max(square, 0.0), self.count - int(np.count_nonzero(damping == 0.0)))


@dataclass(frozen=True, eq=False)
class Selection:
    """Subsets of groups and their scores.

    Attributes:
        normal: The normal equations.
        groups: The columns of each group, shape (k,) each.
        independent: n, how many of the N rows tell something of their own.
        floor: Least mean square that means anything.
        taken: Causes that are taken besides, those that are there or not.
        numbers: Their numbers: one each, and one more where it begins at some row.
        hypotheses: K, among how many causes is chosen.
        whole: J^T J [-] before numbers of a usual size were taken away, shape (p, p): by it a group moves
            what it moves, though the usual could do so too; None where none were.
        prior: What each group adds to a score [-] by its kind, shape (groups,); None for nothing.
        more: The same of the causes that are taken besides.
    """

    normal: Normal
    groups: tuple[IntArray, ...]
    independent: float
    floor: float
    taken: int
    numbers: int
    hypotheses: int
    whole: FloatArray | None = None
    prior: FloatArray | None = None
    more: float = 0.0

    @cached_property
    def _scaled(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The normal equations of columns of unit length."""
        size = np.sqrt(np.maximum(np.diag(self.normal.gram), 0.0))
        by = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
        gram = self.normal.gram * by[:, np.newaxis] * by
        whole = gram if self.whole is None else self.whole * by[:, np.newaxis] * by
        return gram + _RIDGE * np.eye(len(gram)), self.normal.moment * by, whole

    def left(self, subsets: Sequence[Subset]) -> FloatArray:
        """Return the mean square [-] that each of some subsets leaves, shape (len(subsets),)."""
        return self._left_by([self.columns(subset) for subset in subsets])

    def _left_by(self, columns: list[list[int]]) -> FloatArray:
        """Return the mean square [-] that each of some choices of columns leaves, shape (len(columns),)."""
        gram, moment, _ = self._scaled
        explained = np.zeros(len(columns))
        sizes = np.array([len(one) for one in columns])
        for size in np.unique(sizes[sizes > 0]):
            at = np.flatnonzero(sizes == size)
            taken = np.array([columns[i] for i in at])
            right = moment[taken]
            inner = gram[taken[:, :, np.newaxis], taken[:, np.newaxis, :]]
            found = np.linalg.solve(inner, right[:, :, np.newaxis])[:, :, 0]
            explained[at] = (found * right).sum(axis=1)
        left: FloatArray = np.maximum(self.normal.square - explained, 0.0) / max(self.normal.count, 1)
        return left

    def moving(self, subset: Subset) -> Subset:
        """Return the groups of a subset that move the floor or more, the least dropped first."""
        gram, moment, whole = self._scaled
        while subset:
            columns = self.columns(subset)
            x = np.zeros(len(gram))
            x[columns] = np.linalg.solve(gram[np.ix_(columns, columns)], moment[columns])
            own = ((g, self.columns([g])) for g in sorted(subset))
            moved = {g: float(x[at] @ whole[np.ix_(at, at)] @ x[at]) / self.normal.count for g, at in own}
            least = min(moved, key=lambda g: moved[g])
            if moved[least] >= self.floor:
                break
            subset -= {least}
        return subset

    @cached_property
    def _columns(self) -> list[tuple[int, ...]]:
        """The columns of each group."""
        return [tuple(group.tolist()) for group in self.groups]

    def columns(self, subset: Iterable[int]) -> list[int]:
        """Return the columns of some groups."""
        return [c for g in sorted(subset) for c in self._columns[g]]

    def scores(self, subsets: Sequence[Subset]) -> FloatArray:
        """Return the score [-] of each of some subsets, shape (len(subsets),)."""
        columns = [self.columns(subset) for subset in subsets]
        left = self._left_by(columns)
        penalty = [self.penalty(len(at), one) for at, one in zip(columns, subsets, strict=True)]
        return np.asarray(self._misfit(left) + np.array(penalty))

    def _misfit(self, left: FloatArray) -> FloatArray:
        """Return n ln(mean square) [-] of mean squares, shape (k,); below the floor that of the floor.

        Where numbers of a usual size were taken away, a mean square has what their sizes cost. This counts
        below the floor, too: by the tangent of the logarithm there.
        """
        over = left / self.floor
        below = 0.0 if self.whole is None else np.minimum(over, 1.0) - 1.0
        return np.asarray(self.independent * (np.log(self.floor * np.maximum(over, 1.0)) + below))

    def score(self, left: float, subset: Subset) -> float:
        """Return the score [-] of a subset that leaves a mean square [-]."""
        size = sum(len(self._columns[g]) for g in subset)
        return float(self._misfit(np.array(left))) + self.penalty(size, subset)

    def penalty(self, columns: int, subset: Subset) -> float:
        """Return what a subset with some columns in all pays."""
        prior = sum(self._priors[g] for g in subset)
        penalty = self._penalties[0] * (columns + self.numbers) + self._penalties[1 + len(subset)]
        return float(penalty + prior + self.more)

    def solution(self, columns: Sequence[int]) -> FloatArray:
        """Return the numbers [-] of some columns that leave the least, shape (len(columns),)."""
        gram, moment, _ = self._scaled
        size = np.sqrt(np.maximum(np.diag(self.normal.gram)[list(columns)], np.finfo(float).tiny))
        at = list(columns)
        return np.asarray(np.linalg.solve(gram[np.ix_(at, at)], moment[at]) / size)

    @cached_property
    def _penalties(self) -> list[float]:
        """Of a column; then of so many groups, from 0."""
        counts = (min(groups + self.taken, self.hypotheses) for groups in range(MOST + 2))
        return [
            log(max(self.independent, 2.0)),
            *(2.0 * log(comb(self.hypotheses, count)) for count in counts),
        ]

    def best(self, among: Sequence[int]) -> Subset:
        """Return the best subset of some groups: none, singles, pairs, and what they grow into."""
        several = [g for g in among if len(self._columns[g]) > 1]
        starts = [(self.score_of(frozenset()), frozenset[int]()), *self.extended(frozenset(), among)]
        starts += self._best_pairs([g for g in among if len(self._columns[g]) == 1])
        for g in several:
            starts += self.extended(frozenset((g,)), among)[:STARTS]
        starts = sorted(starts, key=lambda one: one[0])[:STARTS]
        passed: set[Subset] = set()
        climbed = [self.climb(subset, score, among, passed) for score, subset in starts]
        return min(climbed, key=lambda one: one[1])[0]

    def _best_pairs(self, groups: Sequence[int]) -> list[tuple[float, Subset]]:
        """Return the best pairs of groups with one column each, with their scores: Cramer's rule for all."""
        if len(groups) < 2:
            return []
        gram, moment, _ = self._scaled
        columns = np.array([self._columns[g][0] for g in groups])
        first, second = np.triu_indices(len(groups), 1)
        c, d = columns[first], columns[second]
        a, b, across, m, n = gram[c, c], gram[d, d], gram[c, d], moment[c], moment[d]
        rest = a * b - across**2
        explained = (m**2 * b - 2.0 * m * n * across + n**2 * a) / np.maximum(rest, np.finfo(float).tiny)
        explained[rest <= TWIN * a * b] = 0.0  # one of the two does all that both do
        left = np.maximum(self.normal.square - explained, 0.0) / max(self.normal.count, 1)
        prior = self._priors[list(groups)]
        scores = self._misfit(left) + prior[first] + prior[second]
        best = np.argsort(scores, kind="stable")[:STARTS].tolist()
        common = self._penalties[0] * (2 + self.numbers) + self._penalties[3] + self.more
        return [(float(scores[i] + common), frozenset((groups[first[i]], groups[second[i]]))) for i in best]

    def climb(
        self, subset: Subset, score: float, among: Sequence[int], passed: set[Subset]
    ) -> tuple[Subset, float]:
        """Return where adding, dropping and exchanging groups leads from a subset, and the score there.

        A climb ends where another one passed.
        """
        while subset not in passed:
            passed.add(subset)
            near = [(self.score_of(subset - {gone}), subset - {gone}) for gone in sorted(subset)]
            near += self.exchanged(subset, among)
            near += self.extended(subset, among)[:1] if len(subset) < MOST else []
            best = min(near, key=lambda one: one[0], default=(np.inf, subset))
            if not best[0] < score - 1e-9:
                break
            score, subset = best
        return subset, score

    def exchanged(self, subset: Subset, among: Sequence[int]) -> list[tuple[float, Subset]]:
        """Return the best exchanges of each group of a subset for another, with their scores."""
        found = []
        for gone in sorted(subset):
            rest = subset - {gone}
            found += self.extended(rest, [g for g in among if g != gone])[:STARTS]
        return sorted(found, key=lambda one: one[0])

    def extended(self, subset: Subset, among: Sequence[int]) -> list[tuple[float, Subset]]:
        """Return a subset with each other group, and the scores, the best first (Schur complement)."""
        others = [g for g in among if g not in subset]
        if not others:
            return []
        gram, moment, _ = self._scaled
        columns, square = self.columns(subset), self.normal.square
        if columns:
            across = np.linalg.solve(gram[np.ix_(columns, columns)], gram[columns])
            square -= float(
                moment[columns] @ np.linalg.solve(gram[np.ix_(columns, columns)], moment[columns])
            )
            gram, moment = gram - gram[:, columns] @ across, moment - moment[columns] @ across
        own = np.diag(gram)
        gain = np.where(own > TWIN, moment**2 / np.maximum(own, TWIN), 0.0)
        gains = np.array([gain[self._columns[g][0]] for g in others])
        sizes = np.array([len(self._columns[g]) for g in others])
        for i in np.flatnonzero(sizes > 1).tolist():
            at = list(self._columns[others[i]])
            inner = gram[np.ix_(at, at)] + TWIN * np.eye(len(at))
            gains[i] = moment[at] @ np.linalg.solve(inner, moment[at])
        left = np.maximum(square - gains, 0.0) / max(self.normal.count, 1)
        penalty = (
            self._penalties[0] * (len(columns) + sizes + self.numbers) + self._penalties[2 + len(subset)]
        )
        prior = self._priors[others] + sum(self._priors[g] for g in subset) + self.more
        scores = self._misfit(left) + penalty + prior
        order = np.argsort(scores, kind="stable").tolist()
        return [(float(scores[i]), subset | {others[i]}) for i in order]

    def score_of(self, subset: Subset) -> float:
        """Return the score [-] of a subset."""
        return float(self.scores([subset])[0])

    @cached_property
    def _priors(self) -> FloatArray:
        return np.zeros(len(self.groups)) if self.prior is None else self.prior


def without_twins(
    normal: Normal, groups: Sequence[IntArray], largest: FloatArray, first: Sequence[int] = ()
) -> tuple[list[int], dict[int, int]]:
    """Return which groups stand for all: twins are told by one, and what moves nothing not at all.

    Args:
        normal: The normal equations.
        groups: The columns of each group, shape (k,) each; of twins the first stands for all.
        largest: The squares of the columns [-] before anything was taken away, shape (p,).
        first: Groups that stand for their twins before all others.

    Returns:
        The groups that stand, in order, and for each twin the group that tells it.
    """
    gram = normal.gram
    square = np.maximum(np.diag(gram), 0.0)
    size = np.sqrt(np.where(square > 0.0, square, 1.0))
    stand: list[int] = []
    twins: dict[int, int] = {}
    for g in [*first, *(g for g in range(len(groups)) if g not in first)]:
        columns = groups[g]
        if (square[columns] <= NOTHING * largest[columns]).all():
            continue
        if len(columns) == 1:
            c = int(columns[0])
            single = ((h, int(groups[h][0])) for h in stand if len(groups[h]) == 1)
            like = (h for h, d in single if 1.0 - abs(gram[c, d]) / (size[c] * size[d]) < TWIN)
            if (twin := next(like, None)) is not None:
                twins[g] = twin
                continue
        stand.append(g)
    return sorted(stand), twins
