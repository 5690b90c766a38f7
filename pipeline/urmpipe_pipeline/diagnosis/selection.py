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

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import comb, log
from typing import Protocol, TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.diagnosis.causes import CANCELLING, CLOCKS, STRUCTURE, TOO_LARGE
from urmpipe_pipeline.diagnosis.fit import Model, Normal, Rows, autocorrelation_time, cost
from urmpipe_pipeline.diagnosis.hypotheses import State
from urmpipe_pipeline.runs.reading_errors import Edits

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


LARGEST: Mapping[str, float] = {
    "joint_scale": 0.5,  # a joint that is read in other steps is off by less
    "compliance": 0.02,  # s2: more would swing below 1.1 Hz
    "clock_drift": 0.05,  # no clock is off by a twentieth
    "servo_lag": 1.0,  # s: a slower drive follows nothing
    "joint_lag": 1.0,  # s
    "backlash": 0.1,  # rad: 6 deg
    "sag": 0.01,  # rad/kg or rad/(N m): no arm gives way by half a degree under 1 kg
}
"""Beyond this a number is that of no such cause, by kind."""

REACHED: Mapping[str, float] = {"link_length": 0.2, "link_shift": 0.2}
BESIDE: Mapping[str, float] = {"tilt": np.radians(10.0), "joint_scale": 0.02}
"""Beside other causes no length changes by more than a share of the reach, and no tilt or scale by more."""

NOISE = 4.0  # a mean square, in weights of the noise, that is taken for it
CANCELS = 3.0  # times the rms before any cause
SEGMENTS = 6  # of a log, in which a number may differ
CLOCK_SEGMENTS = 40  # the same of a clock: rows that are missing make it jump
CHANGING = 0.3  # share of a number by which it changes, rms over the segments
UNEVEN = 0.1  # the same of a clock, which nothing of an arm resembles
SIGNIFICANT = 5.0  # standard deviations of F, sqrt(2 / numbers more) each, by which it lies above 1
FEW = 300  # rows, spread evenly, on which causes are applied alone
SOME = 2_000  # rows, spread evenly, on which numbers may change


class Fitter(Protocol):
    """A search among the hypotheses of a model."""

    @property
    def model(self) -> Model:
        """The side that is modelled, with its data."""

    @property
    def floor(self) -> FloatArray:
        """Noise floor of each component in [m] or [rad], shape (c,)."""

    @property
    def zero(self) -> State:
        """Nothing that differs."""

    @property
    def forced(self) -> tuple[int, ...]:
        """Groups that are always fitted."""

    @property
    def timed(self) -> bool:
        """Whether the rows follow each other in time."""

    def placed(self, state: State, rows: Rows) -> State:
        """Return an explanation with the best numbers of what is always fitted."""


def find_unbelievable(search: Fitter, state: State, subset: Subset, rows: Rows) -> tuple[set[int], str]:
    """Return the groups of a subset whose numbers no engineer believes, and why.

    Args:
        search: What was looked for.
        state: The explanation.
        subset: Its groups.
        rows: The rows that count.
    """
    groups = search.model.groups
    largest = {g: float(np.abs(state.of(groups[g])).max()) for g in subset}
    beyond = {g for g in subset if largest[g] > LARGEST.get(groups[g].kind, np.inf)}
    if len(subset) + len(state.edits) < 2:
        signs = {g for g in beyond if groups[g].kind == "joint_scale" and state.of(groups[g])[0] <= -1.0}
        signs |= {g for g in beyond if groups[g].kind == "backlash"}
        return (signs if leaves_noise(search, state, rows) else beyond), ""
    if beyond:
        return beyond, ""
    reach = getattr(search.model, "reach", np.inf)
    limit = {g: BESIDE.get(groups[g].kind, REACHED.get(groups[g].kind, np.inf) * reach) for g in subset}
    beyond = {g for g in subset if largest[g] > limit[g]}
    return (beyond, TOO_LARGE) if beyond else (_find_cancelling(search, state, subset, rows), CANCELLING)


def leaves_noise(search: Fitter, state: State, rows: Rows) -> bool:
    """Tell whether an explanation leaves noise, and less than half the square of a deviation that is more."""
    left = cost(search.model, state, rows)
    if left > NOISE:
        return False
    return cost(search.model, search.placed(search.zero, rows), rows) > max(NOISE, 2.0 * left)


def _find_cancelling(search: Fitter, state: State, subset: Subset, rows: Rows) -> set[int]:
    some = rows.thinned(FEW)
    before = cost(search.model, search.placed(search.zero, some), some)
    most = CANCELS**2 * max(before, float(np.mean((search.floor * rows.weight) ** 2)))
    worse = set()
    for g in subset:
        alone = np.zeros_like(state.values)
        columns = list(search.model.groups[g].columns)
        alone[columns] = state.values[columns]
        if cost(search.model, search.placed(State(alone), some), some) > most:
            worse.add(g)
    return {g for g in worse if search.model.groups[g].kind in STRUCTURE} or worse


def find_changing(search: Fitter, state: State, subset: Subset, rows: Rows) -> tuple[set[int], Edits]:
    """Return the groups and the discrete causes of an explanation that change during the log.

    The number of a discrete cause is 1, and its column what it changes.

    Args:
        search: What was looked for.
        state: The explanation, where it leaves the least.
        subset: Its groups.
        rows: The rows that count.
    """
    model, own = search.model, [search.model.groups[g] for g in sorted(subset)]
    at = rows.thinned(SOME).at
    left, jacobian = model.linear(state, at, [*own, *(model.groups[g] for g in search.forced)])
    known = np.isfinite(left).all(axis=0)
    without = [replace(state, edits=tuple(one for one in state.edits if one != edit)) for edit in state.edits]
    changed = [model.residual(one, at) - left for one in without]
    known &= np.isfinite([*changed, left]).all(axis=(0, 1)) & np.isfinite(jacobian).all(axis=(0, 1))
    weight = rows.weight[:, np.newaxis]
    left, jacobian = left[:, known] * weight, jacobian[..., known] * weight
    count = len(jacobian) - sum(len(model.groups[g].columns) for g in search.forced)
    columns = [*jacobian[:count], *(one[:, known] * weight for one in changed)]
    owners = [g for g in sorted(subset) for _ in model.groups[g].columns] + [
        -1 - k for k in range(len(without))
    ]
    values = np.concatenate([*(state.of(group) for group in own), np.ones(len(without))])
    fitted = jacobian[count:].reshape(-1, left.size) if search.forced else None
    floor = float(np.mean((search.floor * rows.weight) ** 2))
    clocks = [g >= 0 and model.groups[g].kind in CLOCKS for g in owners]
    changing = set[int]()
    for segments in ([2] * len(owners), [CLOCK_SEGMENTS if clock else SEGMENTS for clock in clocks]):
        if not owners or left.shape[1] < 4 * sum(segments):
            continue
        parts = [
            (column * _hats(count, left.shape[1])[:, np.newaxis]).reshape(count, -1)
            for column, count in zip(columns, segments, strict=True)
        ]
        size = np.array([np.linalg.norm(part) for part in parts])
        spread = size * _spread(left, fitted, parts, search.timed, floor)
        for g, clock in zip(owners, clocks, strict=True):
            its = np.array(owners) == g
            most = (UNEVEN if clock else CHANGING) * np.linalg.norm((values * size)[its])
            if np.linalg.norm(spread[its]) > most:
                changing.add(g)
    changing -= {g for g in subset if model.groups[g].kind == "backlash"}  # its sense is a guess at rest
    return {g for g in changing if g >= 0}, tuple(state.edits[-1 - g] for g in changing if g < 0)


def _hats(segments: int, rows: int) -> FloatArray:
    """Return hat functions over rows, whose sum is 1, shape (segments, rows)."""
    at = np.linspace(0.0, segments - 1.0, rows)
    return np.maximum(1.0 - np.abs(at - np.arange(segments)[:, np.newaxis]), 0.0)


def _spread(
    left: FloatArray, fitted: FloatArray | None, parts: Sequence[FloatArray], timed: bool, floor: float
) -> FloatArray:
    """Return by how much numbers differ in the segments, rms, shape (k,); 0 where that leaves no less.

    Args:
        left: What is left in weights of the noise [-], shape (c, n).
        fitted: Columns of what is always fitted, shape (p, c n); None without any.
        parts: Columns of each number in its segments, shape (segments, c n) each.
        timed: Whether the rows follow each other in time.
        floor: Least mean square that means anything.
    """
    every = np.concatenate([*parts, *([] if fitted is None else [fitted])])
    scale = np.sqrt(np.maximum((every**2).sum(axis=1), np.finfo(float).tiny))
    every = every / scale[:, np.newaxis]
    solved = np.linalg.lstsq(every @ every.T, every @ left.ravel(), rcond=1e-9)[0]
    after = left - (solved @ every).reshape(left.shape)
    tau = autocorrelation_time(after.T) if timed else 1.0
    noise = max(float((after**2).sum()), floor * left.size)
    more = sum(len(part) - 1 for part in parts)
    gain = (float((left**2).sum()) - float((after**2).sum())) / more
    if gain < (1.0 + SIGNIFICANT * np.sqrt(2.0 / more)) * noise / max(left.size / tau - len(every), 1.0):
        return np.zeros(len(parts))
    spread, first, numbers = [], 0, solved / scale
    for part in parts:
        own, weight = numbers[first : first + len(part)], (part**2).sum(axis=1)
        weight = weight / max(float(weight.sum()), np.finfo(float).tiny)
        spread.append(float(np.sqrt(weight @ (own - weight @ own) ** 2)))
        first += len(part)
    return np.array(spread)
