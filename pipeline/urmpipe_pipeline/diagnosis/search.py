"""The search for the causes of a deviation: first what is there or not, then what has some size."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_pipeline.diagnosis.fit import Model, Rows, cost, fitted, inliers, normal_equations, residual
from urmpipe_pipeline.diagnosis.found import Explanation, Found, Stable
from urmpipe_pipeline.diagnosis.hypotheses import State, zero
from urmpipe_pipeline.diagnosis.independence import LONGEST, autocorrelation_time
from urmpipe_pipeline.diagnosis.plausible import further_edit, plausible_edits, projected
from urmpipe_pipeline.diagnosis.selection import Normal, Selection, Subset, without_twins
from urmpipe_pipeline.diagnosis.twins import exchanged, same_at_full_size
from urmpipe_pipeline.log_edits import Edits

COARSE = 300
"""Rows, spread evenly, on which causes are told that are there or not."""

MEDIUM = 2_000
"""Rows, spread evenly, on which the explanations with different edits are held against each other."""

MANY = 20_000
"""Rows, spread evenly, on which a selection is made stable before all rows decide."""

ROUNDS = 6
"""Times that causes are selected anew where the last fit led."""

LARGEST: Mapping[str, float] = {"joint_scale": 0.5, "compliance": 0.02, "clock_drift": 0.05}
"""Beyond this a number is that of no such cause, by kind: a joint that is read in other steps is off by less,
one that gives way by 0.02 s2 would swing at 1.1 Hz, and no clock is off by a twentieth."""

NEAR = 6.0
"""Explanations whose scores differ by less are not told apart: odds of twenty to one."""

FAR = 100.0
"""An explanation whose score on some rows is so much above the best is no rival on more."""

SHOWN = 5
"""So many explanations that are not told apart are named."""


@dataclass(frozen=True, eq=False)
class Search:
    """A search among the hypotheses of a model.

    Attributes:
        model: What is held against what it should be.
        edits: What may be there or not, alone or together.
        floor: What means nothing, of each component in [m] or [rad], shape (c,).
        forced: Groups that are always taken, since they are unknown.
        starts: Explanations to start from besides, such as a lag that the motions tell.
        usual: Groups that differ from arm to arm, with the size that is usual: only more is a cause.
        timed: Whether the rows follow each other in time: neighbours may then tell the same.
        first: Groups that stand for their twins before all others.
    """

    model: Model
    edits: tuple[Edits, ...]
    floor: FloatArray
    forced: tuple[int, ...] = ()
    starts: tuple[State, ...] = ()
    usual: Mapping[int, float] = field(default_factory=dict)
    timed: bool = True
    first: tuple[int, ...] = ()

    @property
    def zero(self) -> State:
        """Nothing that differs."""
        return zero(self.model.groups)

    def spread(self, count: int) -> IntArray:
        """Return the indices of so many rows, spread evenly over all, shape (count,)."""
        rows = self.model.rows
        return np.unique(np.linspace(0, rows - 1, min(rows, count)).round().astype(np.int64))

    def find(self) -> Found:
        """Return the causes of a deviation.

        Edits are told on few rows; with those that are plausible, numbers are selected on more; the best is
        then selected anew on all rows, until its own fit selects it again.
        """
        weight = self._weight(1.0 / self.floor, self.zero)
        coarse = self.spread(COARSE)
        plausible = plausible_edits(self.model, self.edits, self.zero, Rows(coarse, weight), self.floor)
        weight = self._weight(weight, replace(self.zero, edits=plausible[0]))
        medium = Rows(self.spread(MEDIUM), weight, self._least(weight))
        every: list[Explanation] = []
        for start in [*self.starts, *(replace(self.zero, edits=edits) for edits in plausible)]:
            most = min((one.score for one in every), default=np.inf) + len(medium.at)
            every.append(self._explained(medium, start, most=most))
        best, *others = sorted(every, key=lambda one: one.score)
        while True:
            further = further_edit(self.model, self.edits, best.state, Rows(coarse, weight), self.floor)
            found = None if further is None else self._explained(medium, further)
            if found is None or found.score >= best.score:
                break
            best, others = found, [best, *others]
        weight = self._weight(weight, best.state)
        rows = Rows(np.arange(self.model.rows), weight, self._least(weight))
        return self._settled(rows, best, others)

    def fitted(self, state: State, subset: Subset, rows: Rows) -> State:
        """Return an explanation with the best numbers of a subset, and of what is always taken."""
        taken = [self.model.groups[g] for g in sorted(subset | set(self.forced))]
        return fitted(self.model, state, taken, rows)

    def placed(self, state: State, rows: Rows) -> State:
        """Return an explanation with the best numbers of what is always taken, its others as they are."""
        numbers = [self.model.groups[g] for g in self.forced]
        return fitted(self.model, state, numbers, rows, others=True) if numbers else state

    @cached_property
    def _distinct(self) -> tuple[list[int], dict[int, int]]:
        """The groups that are chosen from, and the twins of some of them: as the arm is described."""
        rows = Rows(self.spread(COARSE), 1.0 / self.floor)
        normal = normal_equations(self.model, self.zero, rows)
        forced = self._columns(self.forced)
        groups = [np.array(group.columns) for group in self.model.groups]
        beside = normal.without(forced, np.zeros(len(forced)))
        stand, twins = without_twins(beside, groups, np.diag(normal.gram), self.first)
        return [g for g in stand if g not in self.forced], twins

    def _columns(self, groups: Sequence[int]) -> list[int]:
        """Return the places of the numbers of some groups."""
        return [c for g in groups for c in self.model.groups[g].columns]

    def _least(self, weight: FloatArray) -> float:
        """Return what means nothing of a whole row, in its weights."""
        return float(np.linalg.norm(self.floor * weight))

    def _weight(self, weight: FloatArray, state: State) -> FloatArray:
        """Return one over the noise of each component: what all numbers together leave, by blocks."""
        left = projected(self.model, state, self.spread(COARSE), weight)
        left = left[:, inliers(left * weight[:, np.newaxis])]
        blocks = self.model.blocks
        noise = [np.sqrt(np.mean(left[blocks == b] ** 2)) if left.size else 0.0 for b in blocks]
        return np.asarray(1.0 / np.maximum(noise, self.floor))

    def _selection(self, state: State, rows: Rows, tau: float) -> Selection:
        """Return what subsets of the groups are scored by, near an explanation."""
        among, _ = self._distinct
        forced = self._columns(self.forced)
        usual = [(c, size) for g, size in self.usual.items() if g in among for c in self._columns([g])]
        damping = np.array([*(0.0 for _ in forced), *(size**-2.0 for _, size in usual)])
        every = normal_equations(self.model, state, rows)
        normal = every.without([*forced, *(c for c, _ in usual)], damping)
        whole = every.without(forced, np.zeros(len(forced))).gram if usual else None
        groups = tuple(np.array(group.columns) for group in self.model.groups)
        floor = float(np.mean((self.floor * rows.weight) ** 2))
        edits = state.edits
        numbers = sum(1 + (edit.first > 0) for edit in edits)
        return Selection(normal, groups, normal.count / tau, floor, len(edits), numbers, len(among), whole)

    def _explained(self, rows: Rows, state: State, tau: float = 1.0, most: float = np.inf) -> Explanation:
        """Return the best explanation with some edits, selected anew where the last fit led until it stays.

        It is given up if its score stays above `most`.
        """
        best: Explanation | None = None
        taken: Subset | None = None
        seen: set[Subset] = set()
        beyond: set[int] = set()
        for _ in range(ROUNDS):
            some = rows.trimmed(residual(self.model, state, rows.at))
            selection = self._selection(state, some, tau)
            if taken is not None:
                now = Explanation(state, taken, float(selection.scores([taken])[0]))
                best = now if best is None else min(best, now, key=_score)
            chosen = selection.best([g for g in self._distinct[0] if g not in beyond])
            if chosen in seen or (len(seen) > 1 and best is not None and best.score > most):
                break
            seen.add(chosen)
            state, more = self._within(state, chosen, some)
            taken, beyond = chosen - more, beyond | more
        return best or Explanation(state, taken or frozenset(), np.inf)

    def _within(self, state: State, subset: Subset, rows: Rows) -> tuple[State, set[int]]:
        """Return an explanation with the best numbers of a subset, and the groups they exclude."""
        there = self.fitted(state, subset, rows)
        beyond = self._beyond(there)
        return (self.fitted(state, subset - beyond, rows) if beyond else there), beyond

    def _beyond(self, state: State) -> set[int]:
        """Return the groups whose number is larger than that of any such cause."""
        groups = enumerate(self.model.groups)
        return {g for g, group in groups if np.abs(state.of(group)).max() > LARGEST.get(group.kind, np.inf)}

    def _settled(self, every: Rows, best: Explanation, others: Sequence[Explanation]) -> Found:
        """Return what all rows decide; of very many, some tell first what is selected."""
        few = replace(every, at=self.spread(MANY))
        found = self._stable(few, best.state, None)
        near = [one for one in others if one.score < best.score + FAR * found.tau]
        near = [self._explained(found.rows, one.state, found.tau) for one in near]
        for one in near:
            if one.score < found.score(found.tau):
                again = self._stable(few, one.state, None)
                found = min(found, again, key=lambda each, tau=found.tau: each.score(tau))  # type: ignore[misc]
        search, found, rivals = self._with_twins(few, found)
        most = found.score(found.tau) + NEAR
        same = found.state.edits, found.subset
        near = [one for one in (*near, *rivals) if one.score < most and (one.state.edits, one.subset) != same]
        if len(few.at) < len(every.at):
            found = search._stable(every, found.state, found.subset)
        return search._concluded(found, near)

    def _with_twins(self, few: Rows, found: Stable) -> tuple[Search, Stable, list[Explanation]]:
        """Return the best explanation with twins in place of its causes, what finds it, and its rivals.

        Twins do the same to first order. At full size one of them may leave less, or need fewer causes.
        """
        search, rivals = self, []
        for _ in range(ROUNDS):
            others = list(search._exchanged(few, found))
            scores = [other.score(found.tau) for _, other in others]
            now = found.score(found.tau)
            rivals += [
                Explanation(*other[:2], score) for (_, other), score in zip(others, scores, strict=True)
            ]
            if min(scores, default=np.inf) >= now:
                break
            rivals.append(Explanation(*found[:2], now))
            search, found = others[int(np.argmin(scores))]
        return search, found, rivals

    def _exchanged(self, few: Rows, found: Stable) -> Iterator[tuple[Search, Stable]]:
        """Yield what is found where a twin that differs at full size stands for a cause."""
        gram, some = found.selection.normal.gram, replace(found.rows, at=self.spread(COARSE))
        for twin, g in self._distinct[1].items():
            if g in found.subset:
                c, d = self._columns([g, twin])
                other = exchanged(found.state, c, d, gram)
                if not same_at_full_size(self, found.state, other, some):
                    search = replace(self, first=(twin, *self.first))
                    yield search, search._stable(few, other, None)

    def _concluded(self, found: Stable, near: list[Explanation]) -> Found:
        """Return an explanation with what stays of it, and with those that are not told from it.

        Who takes more causes has to leave less, and each of them moves the floor or more.
        """
        state, subset, tau, rows, selection = found
        state = self._beside_usual(state, subset, selection.normal)
        final = Explanation(state, subset, float(selection.scores([subset])[0]))
        variance = max(float(selection.left([subset])[0]), selection.floor)
        near += self._neighbours(selection, final, rows)
        few = replace(rows, at=rows.at[:: max(len(rows.at) // MANY, 1)])
        simple, least = _count(final), cost(self.model, state, few)
        near = [
            one for one in near
            if (_count(one) <= simple or cost(self.model, one.state, few) < least)
            and (one.state.edits != state.edits or selection.moving(one.subset) == one.subset)
        ]  # fmt: skip
        near = list({(one.state.edits, one.subset): one for one in near}.values())
        shown = tuple(sorted(near, key=_score)[:SHOWN])
        return Found(final, shown, rows, tau, variance, selection.normal, self._distinct[1])

    def _beside_usual(self, state: State, subset: Subset, normal: Normal) -> State:
        """Return the numbers of a subset beside what arms usually differ by, fitted with it and held back."""
        columns = self._columns(sorted(subset))
        if not self.usual or not columns:
            return state
        values = state.values.copy()
        values[columns] = np.linalg.solve(normal.gram[np.ix_(columns, columns)], normal.moment[columns])
        return replace(state, values=values)

    def _stable(self, every: Rows, state: State, subset: Subset | None) -> Stable:
        """Return an explanation that is selected again where its fit leads.

        The autocorrelation time is that of what stays: of the whole, the causes themselves would count as
        noise. It only grows from one selection to the next.
        """
        tau = 1.0
        among = list(self._distinct[0])
        for _ in range(ROUNDS):
            rows = every.trimmed(residual(self.model, state, every.at))
            selection = self._selection(state, rows, tau)
            chosen = selection.best(among)
            state, beyond = self._within(state, chosen, rows)
            if beyond:
                among = [g for g in among if g not in beyond]
                continue
            if self.timed:
                tau = max(tau, self._tau(state, rows))
            selection = replace(selection, independent=selection.normal.count / tau)
            if chosen == subset and selection.best(among) == chosen:
                break
            subset = chosen
        kept = selection.moving(chosen - beyond)
        state = state if kept == chosen else self.fitted(state, kept, rows)
        return Stable(state, kept, tau, rows, selection)

    def _tau(self, state: State, rows: Rows) -> float:
        """Return the autocorrelation time of what an explanation leaves: the longest, of places or turns."""
        left = residual(self.model, state, rows.at[:LONGEST])
        left = left[:, np.isfinite(left).all(axis=0)]
        of_blocks = (self.model.blocks == block for block in np.unique(self.model.blocks))
        return max(
            autocorrelation_time(left[one].T, float((self.floor[one] ** 2).sum())) for one in of_blocks
        )

    def _neighbours(self, selection: Selection, final: Explanation, rows: Rows) -> Iterator[Explanation]:
        """Yield other subsets of nearly the same score, neither a part of the best nor around it.

        Their score is that of what they leave at full size, after a fit.
        """
        every = selection.neighbours(final.subset, self._distinct[0])
        subsets = [one for one in every if not (one <= final.subset or one >= final.subset)]
        scores = selection.scores(subsets) if subsets else np.zeros(0)
        few = replace(rows, at=rows.at[:: max(len(rows.at) // MANY, 1)])
        left, least = float(selection.left([final.subset])[0]), cost(self.model, final.state, few)
        for i in np.argsort(scores, kind="stable").tolist()[:SHOWN]:
            if scores[i] >= final.score + NEAR:
                break
            state = self.fitted(final.state, subsets[i], few)
            told = all(state.of(self.model.groups[g]).any() for g in subsets[i])  # else the fit got nowhere
            after = left * cost(self.model, state, few) / max(least, np.finfo(float).tiny)
            score = selection.score(after, subsets[i])
            if score < final.score + NEAR and told and not self._beyond(state):
                yield Explanation(state, subsets[i], score)


def _score(one: Explanation) -> float:
    return one.score


def _count(one: Explanation) -> int:
    """Return how many causes an explanation takes."""
    return len(one.subset) + len(one.state.edits)
