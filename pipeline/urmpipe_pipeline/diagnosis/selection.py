"""Subset selection: which of many small causes a deviation has, by the columns of a linear model.

A deviation y is y = sum(J_g x_g) + noise over the groups g of a subset. Subsets are scored by the extended
Bayesian information criterion (EBIC)

    n ln(max(RSS / N, floor)) + k ln n + 2 ln C(K, s),

with RSS the sum of the N squares that s of K groups with k columns leave, and n the number of independent
ones among them: N divided by the autocorrelation time. The lowest score is best.

1. `drop_equivalent_groups`: of groups with equal columns one is selected from.
2. `Selection.best`: the subsets of 0, 1 and 2 groups, then add, drop and exchange from the best of them.
3. `Selection.moving`: groups that move the data by less than the floor are dropped: RSS cannot show that in
   larger noise.

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
from urmpipe_pipeline.diagnosis.fit import NormalEquations

Subset: TypeAlias = frozenset[int]  # indices of groups

MAX_GROUPS = 6  # a deviation with more has no list of causes
MAX_STARTS = 4  # best subsets of one or two groups from which the search continues
EQUIVALENT = 1e-9  # 1 - |cos| of two columns up to which they differ by rounding alone
NO_EFFECT = (
    1e-10  # fraction of a column's square that is left after the fitted columns; with less it has no effect
)
_RIDGE = 1e-11  # keeps the equations of equivalent columns solvable; columns have unit length


@dataclass(frozen=True, eq=False)
class Selection:
    """Subsets of groups and their scores.

    Attributes:
        normal: The normal equations.
        groups: The columns of each group, shape (k,) each.
        independent: n, the effective number of independent values of the N.
        floor: Negligible mean square.
        edits: Number of discrete causes that every subset has in addition.
        edit_parameters: Their parameters: one each, and one more if it begins at some row.
        hypotheses: K, the number of causes from which subsets are chosen.
        full_gram: J^T J [-] before parameters of a usual size were removed, shape (p, p): by it a group moves
            the data, even if the usual sizes could do so, too; None without them.
        prior: Part of the score [-] per group by its kind, shape (groups,); None for 0.
        edit_prior: The same of the discrete causes.
    """

    normal: NormalEquations
    groups: tuple[IntArray, ...]
    independent: float
    floor: float
    edits: int
    edit_parameters: int
    hypotheses: int
    full_gram: FloatArray | None = None
    prior: FloatArray | None = None
    edit_prior: float = 0.0

    @cached_property
    def _scaled(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Gram matrix, moment and full Gram matrix of columns of unit length."""
        size = np.sqrt(np.maximum(np.diag(self.normal.gram), 0.0))
        by = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
        gram = self.normal.gram * by[:, np.newaxis] * by
        full = gram if self.full_gram is None else self.full_gram * by[:, np.newaxis] * by
        return gram + _RIDGE * np.eye(len(gram)), self.normal.moment * by, full

    def residual_squares(self, subsets: Sequence[Subset]) -> FloatArray:
        """Return the mean square [-] that each subset leaves, shape (len(subsets),)."""
        return self._squares_of([self.columns(subset) for subset in subsets])

    def _squares_of(self, columns: list[list[int]]) -> FloatArray:
        """Return the mean square [-] that each choice of columns leaves, shape (len(columns),)."""
        gram, moment, _ = self._scaled
        explained = np.zeros(len(columns))
        sizes = np.array([len(choice) for choice in columns])
        for size in np.unique(sizes[sizes > 0]):
            at = np.flatnonzero(sizes == size)
            chosen = np.array([columns[i] for i in at])
            right = moment[chosen]
            inner = gram[chosen[:, :, np.newaxis], chosen[:, np.newaxis, :]]
            solution = np.linalg.solve(inner, right[:, :, np.newaxis])[:, :, 0]
            explained[at] = (solution * right).sum(axis=1)
        return self._mean_square(explained)

    def _mean_square(self, explained: FloatArray) -> FloatArray:
        """Return the mean square [-] that is left of y, without the square that is explained."""
        left: FloatArray = np.maximum(self.normal.square - explained, 0.0) / max(self.normal.size, 1)
        return left

    def moving(self, subset: Subset) -> Subset:
        """Return the groups of a subset that move the data by the floor or more, the least dropped first."""
        gram, moment, full = self._scaled
        while subset:
            columns = self.columns(subset)
            x = np.zeros(len(gram))
            x[columns] = np.linalg.solve(gram[np.ix_(columns, columns)], moment[columns])
            of_groups = ((g, self.columns([g])) for g in sorted(subset))
            moved = {g: float(x[at] @ full[np.ix_(at, at)] @ x[at]) / self.normal.size for g, at in of_groups}
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
        """Return the score [-] of each subset, shape (len(subsets),)."""
        columns = [self.columns(subset) for subset in subsets]
        left = self._squares_of(columns)
        penalty = [self.penalty(len(at), subset) for at, subset in zip(columns, subsets, strict=True)]
        return np.asarray(self._misfit(left) + np.array(penalty))

    def score_of(self, subset: Subset) -> float:
        """Return the score [-] of a subset."""
        return float(self.scores([subset])[0])

    def _misfit(self, left: FloatArray) -> FloatArray:
        """Return n ln(mean square) [-] of mean squares, shape (k,); below the floor that of the floor.

        If parameters of a usual size were removed, a mean square includes the cost of their sizes. This
        counts below the floor, too: by the tangent of the logarithm there.
        """
        over = left / self.floor
        below = 0.0 if self.full_gram is None else np.minimum(over, 1.0) - 1.0
        return np.asarray(self.independent * (np.log(self.floor * np.maximum(over, 1.0)) + below))

    def score(self, left: float, subset: Subset) -> float:
        """Return the score [-] of a subset that leaves a mean square [-]."""
        size = sum(len(self._columns[g]) for g in subset)
        return float(self._misfit(np.array(left))) + self.penalty(size, subset)

    def penalty(self, columns: int, subset: Subset) -> float:
        """Return the part of the score [-] of a subset for the number of its columns and groups."""
        prior = sum(self._priors[g] for g in subset)
        penalty = self._penalties[0] * (columns + self.edit_parameters) + self._penalties[1 + len(subset)]
        return float(penalty + prior + self.edit_prior)

    def solution(self, columns: Sequence[int]) -> FloatArray:
        """Return the least-squares parameters [-] of some columns, shape (len(columns),)."""
        gram, moment, _ = self._scaled
        size = np.sqrt(np.maximum(np.diag(self.normal.gram)[list(columns)], np.finfo(float).tiny))
        at = list(columns)
        return np.asarray(np.linalg.solve(gram[np.ix_(at, at)], moment[at]) / size)

    @cached_property
    def _penalties(self) -> list[float]:
        """Of a column; then of 0, 1, ... groups."""
        counts = (min(groups + self.edits, self.hypotheses) for groups in range(MAX_GROUPS + 2))
        return [
            log(max(self.independent, 2.0)),
            *(2.0 * log(comb(self.hypotheses, count)) for count in counts),
        ]

    @cached_property
    def _priors(self) -> FloatArray:
        return np.zeros(len(self.groups)) if self.prior is None else self.prior

    def best(self, among: Sequence[int]) -> Subset:
        """Return the best subset of some groups: by hill climbing from none, singles and pairs."""
        several = [g for g in among if len(self._columns[g]) > 1]
        starts = [(self.score_of(frozenset()), frozenset[int]()), *self.extended(frozenset(), among)]
        starts += self._best_pairs([g for g in among if len(self._columns[g]) == 1])
        for g in several:
            starts += self.extended(frozenset((g,)), among)[:MAX_STARTS]
        starts = sorted(starts, key=lambda scored: scored[0])[:MAX_STARTS]
        visited: set[Subset] = set()
        optima = [self.climb(subset, score, among, visited) for score, subset in starts]
        return min(optima, key=lambda optimum: optimum[1])[0]

    def _best_pairs(self, groups: Sequence[int]) -> list[tuple[float, Subset]]:
        """Return the best pairs of groups with one column each, with their scores: Cramer's rule for all."""
        if len(groups) < 2:
            return []
        gram, moment, _ = self._scaled
        columns = np.array([self._columns[g][0] for g in groups])
        first, second = np.triu_indices(len(groups), 1)
        c, d = columns[first], columns[second]
        a, b, across, m, n = gram[c, c], gram[d, d], gram[c, d], moment[c], moment[d]
        determinant = a * b - across**2
        explained = (m**2 * b - 2.0 * m * n * across + n**2 * a) / np.maximum(
            determinant, np.finfo(float).tiny
        )
        explained[determinant <= EQUIVALENT * a * b] = 0.0  # the second has no effect after the first
        prior = self._priors[list(groups)]
        scores = self._misfit(self._mean_square(explained)) + prior[first] + prior[second]
        best = np.argsort(scores, kind="stable")[:MAX_STARTS].tolist()
        common = self._penalties[0] * (2 + self.edit_parameters) + self._penalties[3] + self.edit_prior
        return [(float(scores[i] + common), frozenset((groups[first[i]], groups[second[i]]))) for i in best]

    def climb(
        self, subset: Subset, score: float, among: Sequence[int], visited: set[Subset]
    ) -> tuple[Subset, float]:
        """Return the local optimum from a subset by adding, dropping and exchanging groups, and its score.

        A climb ends where another one was before.
        """
        while subset not in visited:
            visited.add(subset)
            near = [(self.score_of(subset - {g}), subset - {g}) for g in sorted(subset)]
            near += self.exchanged(subset, among)
            near += self.extended(subset, among)[:1] if len(subset) < MAX_GROUPS else []
            best = min(near, key=lambda scored: scored[0], default=(np.inf, subset))
            if not best[0] < score - 1e-9:
                break
            score, subset = best
        return subset, score

    def exchanged(self, subset: Subset, among: Sequence[int]) -> list[tuple[float, Subset]]:
        """Return the best exchanges of each group of a subset for another, with their scores."""
        scored = []
        for dropped in sorted(subset):
            rest = subset - {dropped}
            scored += self.extended(rest, [g for g in among if g != dropped])[:MAX_STARTS]
        return sorted(scored, key=lambda each: each[0])

    def extended(self, subset: Subset, among: Sequence[int]) -> list[tuple[float, Subset]]:
        """Return a subset with each other group, and the scores, the best first (Schur complement)."""
        candidates = [g for g in among if g not in subset]
        if not candidates:
            return []
        gram, moment, _ = self._scaled
        columns, square = self.columns(subset), self.normal.square
        if columns:
            across = np.linalg.solve(gram[np.ix_(columns, columns)], gram[columns])
            square -= float(
                moment[columns] @ np.linalg.solve(gram[np.ix_(columns, columns)], moment[columns])
            )
            gram, moment = gram - gram[:, columns] @ across, moment - moment[columns] @ across
        diagonal = np.diag(gram)
        gain = np.where(diagonal > EQUIVALENT, moment**2 / np.maximum(diagonal, EQUIVALENT), 0.0)
        gains = np.array([gain[self._columns[g][0]] for g in candidates])
        sizes = np.array([len(self._columns[g]) for g in candidates])
        for i in np.flatnonzero(sizes > 1).tolist():
            at = list(self._columns[candidates[i]])
            inner = gram[np.ix_(at, at)] + EQUIVALENT * np.eye(len(at))
            gains[i] = moment[at] @ np.linalg.solve(inner, moment[at])
        left = np.maximum(square - gains, 0.0) / max(self.normal.size, 1)
        parameters = len(columns) + sizes + self.edit_parameters
        penalty = self._penalties[0] * parameters + self._penalties[2 + len(subset)]
        prior = self._priors[candidates] + sum(self._priors[g] for g in subset) + self.edit_prior
        scores = self._misfit(left) + penalty + prior
        order = np.argsort(scores, kind="stable").tolist()
        return [(float(scores[i]), subset | {candidates[i]}) for i in order]


def drop_equivalent_groups(
    normal: NormalEquations, groups: Sequence[IntArray], largest: FloatArray, first: Sequence[int] = ()
) -> tuple[list[int], dict[int, int]]:
    """Return the distinct groups: one of equivalent ones, and none without an effect.

    Args:
        normal: The normal equations.
        groups: The columns of each group, shape (k,) each; of equivalent ones the first represents all.
        largest: The squares of the columns [-] before other columns were fitted, shape (p,).
        first: Groups that represent their equivalents before all others.

    Returns:
        The distinct groups, in order, and for each equivalent one the group that represents it.
    """
    gram = normal.gram
    square = np.maximum(np.diag(gram), 0.0)
    size = np.sqrt(np.where(square > 0.0, square, 1.0))
    distinct: list[int] = []
    representatives: dict[int, int] = {}
    for g in [*first, *(g for g in range(len(groups)) if g not in first)]:
        columns = groups[g]
        if (square[columns] <= NO_EFFECT * largest[columns]).all():
            continue
        if len(columns) == 1:
            c = int(columns[0])
            single = ((h, int(groups[h][0])) for h in distinct if len(groups[h]) == 1)
            equal = (h for h, d in single if 1.0 - abs(gram[c, d]) / (size[c] * size[d]) < EQUIVALENT)
            if (representative := next(equal, None)) is not None:
                representatives[g] = representative
                continue
        distinct.append(g)
    return sorted(distinct), representatives
