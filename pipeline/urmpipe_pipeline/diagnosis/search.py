"""The search for the causes of a deviation.

1. Discrete causes (signs, exchanges, axes, units, another robot) are ranked on few rows (candidates.py), and
   with each plausible one single large causes are fitted exactly.
2. From each of these starts a subset of numbers is selected (selection.py), fitted, and selected again where
   the fit leads, until it stays.
3. The best is settled on up to `MANY` rows, with the autocorrelation time of what it leaves, and with
   equivalent causes in place of its own where these leave less at full size.
4. Explanations whose score is within `NEAR` of the best are its rivals.

Every subset passes the gate (gate.py); what it refuses is kept, with the reason: `SearchResult.refused`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from urmpipe_pipeline.diagnosis.candidates import (
    add_discrete_cause,
    find_large_causes,
    rank_discrete_causes,
)
from urmpipe_pipeline.diagnosis.causes import NOT_CONSTANT
from urmpipe_pipeline.diagnosis.explanations import (
    COARSE,
    HOPELESS,
    MEDIUM,
    ROUNDS,
    Explanation,
    Explanations,
    Refusal,
    SearchResult,
    SelfConsistentFit,
)
from urmpipe_pipeline.diagnosis.fit import Rows, cost
from urmpipe_pipeline.diagnosis.hypotheses import State
from urmpipe_pipeline.diagnosis.models import ArmModel
from urmpipe_pipeline.diagnosis.selection import NOISE, Subset, find_changing
from urmpipe_pipeline.runs.reading_errors import Edit, Edits

SOME = 2_000  # rows, spread evenly, that select before more of them settle it
MANY = 20_000  # rows, spread evenly, that settle an explanation; standard errors fall with the root of them
MAJOR = 0.35  # share of the square that stays, where more than noise does, with a cause and not without it
PROMISED = 0.5  # share of the square that what is left of an explanation leaves at most
CLEAR = 100.0  # times the noise that a deviation is which one cause that explains it leaves without a rival
NEAR = 6.0  # explanations whose scores differ by less are rivals: odds of twenty to one
FAR = 100.0  # an explanation whose score on some rows is so much above the best is no rival on more
SHOWN = 5  # so many rivals are kept
LESS = 0.95  # share of the square of the best that a rival with more causes leaves at most
NEARLY = 0.01  # share by which the scale of a joint differs from a factor between units
FRAMES = ("tool_shift", "base_shift", "base_rotation")


@dataclass(frozen=True, eq=False)
class Search(Explanations):
    """A search for the explanation of a deviation."""

    def find(self) -> SearchResult:
        """Return the causes of a deviation."""
        weight = self._weight(1.0 / self.floor, self.zero)
        coarse = Rows(self.spread(COARSE), weight)
        ranked = rank_discrete_causes(self.model, self.edits, self.zero, coarse, self.floor)
        weight = self._weight(weight, replace(self.zero, edits=ranked[0]), self.model.groups)
        medium = Rows(self.spread(MEDIUM), weight, self._least(weight))
        coarse = replace(coarse, weight=weight)
        tau = self._first_tau(replace(self.zero, edits=ranked[0]), medium)
        best, *others = self._explored(ranked, coarse, medium, tau)
        while True:
            coarse = replace(coarse, weight=weight)
            further = add_discrete_cause(self.model, self.edits, best.state, coarse, self.floor)
            candidate = None if further is None else self._explained(medium, further, tau)
            if candidate is None or candidate.score >= best.score:
                break
            best, others = candidate, [best, *others]
        for edit in best.state.edits:  # what a start took for granted
            without = replace(best.state, edits=_but(best.state.edits, edit))
            if not self._is_needless(without, best, coarse):
                candidate = self._explained(medium, without, tau)
                if candidate.score < best.score:
                    best, others = candidate, [best, *others]
        search = self
        if best.size > 2 or cost(self.model, best.state, coarse) > NOISE:
            zeros, candidate = self._with_zeros(medium, tau)
            if candidate.score < best.score:
                search, best, others = zeros, candidate, [best, *others]
            for candidate in self._on_turned_bases(coarse, medium, tau):
                if candidate.score < best.score:
                    search, best, others = self, candidate, [best, *others]
        weight = self._weight(weight, best.state, self.model.groups)
        rows = Rows(self.spread(MANY), weight, self._least(weight))
        return search._settled(rows, best, others)

    def _explored(self, ranked: Sequence[Edits], coarse: Rows, medium: Rows, tau: float) -> list[Explanation]:
        """Return what is found from each start, the best first, each once."""
        every, passed = list[Explanation](), dict[tuple[Edits, Subset], float]()
        for start in self._starts(ranked, coarse):
            best = min(every, key=_score, default=None)
            if best is not None and self._is_needless(start, best, coarse):
                continue
            margin = HOPELESS * len(medium.at) * len(medium.weight) / tau
            most = np.inf if best is None else best.score + margin
            every.append(self._explained(medium, start, tau, most, passed))
        distinct: dict[object, Explanation] = {}
        for candidate in sorted(every, key=_score):
            distinct.setdefault(candidate.key, candidate)
        return [*distinct.values()]

    def _starts(self, ranked: Sequence[Edits], coarse: Rows) -> Iterator[State]:
        """Yield where selections begin: the discrete causes, the clock, and single large causes."""
        states = [replace(self.zero, edits=edits) for edits in ranked]
        yield from states
        yield from self.starts
        single = [g for g in self._distinct[0] if len(self.model.groups[g].columns) == 1]
        if isinstance(self.model, ArmModel) and not self.forced:
            for state in dict.fromkeys((states[0].edits, ())):
                yield from find_large_causes(self.model, replace(self.zero, edits=state), coarse, single)

    def _with_zeros(self, rows: Rows, tau: float) -> tuple[Search, Explanation]:
        """Search from a fit of all joint zeros; return a search that prefers zeros to twins, and its result.

        A lost calibration makes many of them large at once; some are a shift or turn of a frame alone.
        """
        zeros = tuple(g for g, group in enumerate(self.model.groups) if group.kind == "joint_offset")
        search = replace(self, first=zeros)
        return search, search._explained(rows, self.fitted(self.zero, frozenset(zeros), rows), tau)

    def _on_turned_bases(self, coarse: Rows, medium: Rows, tau: float) -> Iterator[Explanation]:
        """Yield what other robots explain whose bases are turned or mirrored, too, where much deviates."""
        if cost(self.model, self.zero, coarse) <= CLEAR * NOISE:
            return
        robots, bases = (
            [edit for edit, *more in self.edits if edit.kind in kinds and not more]
            for kinds in (("other_robot",), ("base_rotation", "base_mirrored"))
        )
        pairs = [*product(robots, bases)]
        for edits in rank_discrete_causes(self.model, pairs, self.zero, coarse, self.floor) if pairs else ():
            if edits:
                yield self._explained(medium, replace(self.zero, edits=edits), tau)

    def _is_needless(self, start: State, best: Explanation, rows: Rows) -> bool:
        """Tell whether one cause, or none, leaves noise, and a start with discrete causes needs more.

        Where it is a discrete one that takes nearly all away, no start that needs more is worth a search.
        """
        if best.size > 1 or cost(self.model, best.state, rows) > NOISE:
            return False
        clear = best.state.edits and cost(self.model, self.zero, rows) > CLEAR * NOISE
        return bool(start.edits or clear) and cost(self.model, start, rows) > NOISE

    def _settled(self, rows: Rows, best: Explanation, others: Sequence[Explanation]) -> SearchResult:
        """Return what many rows decide, from what some select."""
        some = replace(rows, at=self.spread(SOME))
        fit = self._stable(some, best.state, None)
        near = sorted((candidate for candidate in others if candidate.score < best.score + FAR), key=_score)
        most = fit.score(fit.tau) + HOPELESS * fit.selection.normal.count / fit.tau
        near = [self._explained(fit.rows, candidate.state, fit.tau, most) for candidate in near[:SHOWN]]
        for candidate in near:
            if candidate.score < fit.score(fit.tau):
                again = self._stable(some, candidate.state, None)
                fit = min(fit, again, key=lambda each, tau=fit.tau: each.score(tau))  # type: ignore[misc]
        search, fit = self._simplified(some, fit)
        search, fit, rivals = search._with_twins(some, fit)
        most = fit.score(fit.tau) + NEAR
        if len(rows.at) > len(some.at):
            fit = search._stable(rows, fit.state, fit.subset)
        same = fit.state.edits, fit.subset
        near = [
            candidate for candidate in (*near, *rivals) if candidate.score < most and candidate.key != same
        ]
        fit = search._without_minor(fit)
        result = search._concluded(fit, list(search._rescored(near, fit)))
        return search._without_changing(result)

    def _simplified(self, rows: Rows, fit: SelfConsistentFit) -> tuple[Search, SelfConsistentFit]:
        """Return an explanation with one cause at full size for several numbers, and what finds it.

        The zero of the last joint is a shift of the tool that takes up to three numbers; a base turned by
        half a turn and back by a number is turned by one; a scale of 57.3 is a unit.
        """
        search = self
        for state, subset in [*self._single_causes(fit), *self._turned_at_once(fit), *self._units(fit)]:
            now, start = self._fitted_score(fit, fit), self.fitted(state, subset, fit.rows)
            now += NEAR * (len(state.edits) > len(fit.state.edits))  # what is no number goes first
            if fit.selection.score(cost(self.model, start, fit.rows), subset) > now + FAR:
                continue
            again = replace(self, first=(*(subset & self._distinct[1].keys()), *self.first))
            there = again._stable(rows, start, None)
            if self._fitted_score(there, fit) < now:
                search, fit = again, there
        return search, fit

    def _fitted_score(self, fit: SelfConsistentFit, other: SelfConsistentFit) -> float:
        """Return the score of what an explanation really leaves, on the rows and with the tau of another."""
        selection = replace(fit.selection, independent=other.selection.independent)
        return selection.score(cost(self.model, fit.state, other.rows), fit.subset)

    def _single_causes(self, fit: SelfConsistentFit) -> Iterator[tuple[State, Subset]]:
        """Yield explanations with one number in place of those of a frame."""
        groups = self.model.groups
        every = sorted({*self._distinct[0], *self._distinct[1]} - fit.subset)
        single = [g for g in every if len(groups[g].columns) == 1]
        coarse = replace(fit.rows, at=self.spread(COARSE))
        for kind in FRAMES:
            own = frozenset(g for g in fit.subset if groups[g].kind == kind)
            if isinstance(self.model, ArmModel) and not self.forced and len(self._columns(sorted(own))) > 1:
                rest = self._bare(fit.state, fit.subset - own)
                for state in find_large_causes(self.model, rest, coarse, single):
                    (c,) = np.flatnonzero(state.values != rest.values).tolist()
                    alone = next(g for g in single if groups[g].columns[0] == c)
                    yield state, fit.subset - own | {alone}

    def _turned_at_once(self, fit: SelfConsistentFit) -> Iterator[tuple[State, Subset]]:
        """Yield explanations with a number alone in place of a turned base and that number about its axis."""
        for edit in fit.state.edits:
            for g in fit.subset if edit.kind == "base_rotation" else ():
                group = self.model.groups[g]
                if group.kind == edit.kind and group.axis is not None:
                    axis, angle = edit.axis_angle
                    values = fit.state.values.copy()
                    values[list(group.columns)] += angle * np.dot(axis, group.axis)
                    yield State(values, _but(fit.state.edits, edit)), fit.subset

    def _units(self, fit: SelfConsistentFit) -> Iterator[tuple[State, Subset]]:
        """Yield explanations with another unit of a joint in place of its scale."""
        for g in fit.subset:
            if (edit := self._unit_like(fit.state, g)) is not None:
                rest = self._bare(fit.state, fit.subset - {g})
                yield replace(rest, edits=(*rest.edits, edit)), fit.subset - {g}

    def _unit_like(self, state: State, g: int) -> Edit | None:
        """Return the unit of a joint that its scale is nearly the factor of; None of others."""
        group = self.model.groups[g]
        units = (edit for edit, *more in self.edits if edit.kind == "joint_unit" and not more)
        own = (edit for edit in units if group.kind == "joint_scale" and edit.joints == (group.joint,))
        scale = 1.0 + state.of(group)[0]
        return next((edit for edit in own if abs(scale / edit.value - 1.0) < NEARLY), None)

    def _without_minor(self, fit: SelfConsistentFit) -> SelfConsistentFit:
        """Return an explanation without what explains little, where more than noise is left.

        What is not among the causes that are looked for is otherwise shared out among many of them.
        """
        idle = [edit for edit in fit.state.edits if self._does_nothing(fit, edit)]
        for edit in idle:
            fit = fit._replace(state=replace(fit.state, edits=_but(fit.state.edits, edit)))
        while (now := cost(self.model, fit.state, fit.rows)) > NOISE:
            state, subset = fit.state, fit.subset
            less = [(replace(state, edits=_but(state.edits, edit)), subset) for edit in state.edits]
            less += [(state, subset - {g}) for g in sorted(subset)]
            fits = [
                (self.beside_usual(self.fitted(start, kept, fit.rows), kept, fit.rows), kept)
                for start, kept in less
            ]
            costs = [cost(self.model, candidate, fit.rows) for candidate, _ in fits]
            together = len(fits) > 1 and self._only_together(state, subset, fit.rows)
            if not costs or (now <= MAJOR * min(costs) and not together):
                break
            there, kept = fits[int(np.argmin(costs))]
            fit = fit._replace(state=there, subset=kept, selection=self._selection(there, fit.rows, fit.tau))
        return fit

    def _only_together(self, state: State, subset: Subset, rows: Rows) -> bool:
        """Tell whether none of several causes takes anything away alone."""
        alone = [self._bare(replace(state, edits=()), frozenset((g,))) for g in subset]
        alone += [replace(self.zero, edits=(edit,)) for edit in state.edits]
        nothing = cost(self.model, self.placed(self.zero, rows), rows)
        return all(cost(self.model, self.placed(one, rows), rows) >= nothing for one in alone)

    def _without_changing(self, result: SearchResult) -> SearchResult:
        """Return what was found without the causes that change during the log, what is left fitted again."""
        changing, edits = find_changing(self, result.best.state, result.best.subset, result.rows)
        if not changing and not edits:
            return result
        refused = (*result.refused, Refusal(result.best, NOT_CONSTANT, frozenset(changing), edits))
        rest = self.without(result, changing, edits)
        if cost(self.model, rest.best.state, rest.rows) > PROMISED * cost(self.model, self.zero, rest.rows):
            rest = self.without(result, result.best.subset, result.best.state.edits)
        return self._without_changing(replace(rest, others=(), refused=refused))

    def without(self, result: SearchResult, groups: Set[int], edits: Edits = ()) -> SearchResult:
        """Return what was found without some causes, what is left fitted again."""
        kept = result.best.subset - groups
        left = tuple(edit for edit in result.best.state.edits if edit not in edits)
        start = replace(result.best.state, edits=left)
        there = self.beside_usual(self.fitted(start, kept, result.rows), kept, result.rows)
        selection = self._selection(there, result.rows, result.tau)
        best = Explanation(there, kept, float(selection.scores([kept])[0]))
        return replace(result, best=best, normal=selection.normal)

    def _does_nothing(self, fit: SelfConsistentFit, edit: Edit) -> bool:
        """Tell whether a discrete cause leaves no less than the floor on the rows that count."""
        without = replace(fit.state, edits=_but(fit.state.edits, edit))
        gain = cost(self.model, without, fit.rows) - cost(self.model, fit.state, fit.rows)
        return gain < fit.selection.floor

    def _rescored(self, near: Sequence[Explanation], fit: SelfConsistentFit) -> Iterator[Explanation]:
        """Yield rivals with their numbers and scores on the rows that decided, those that are still near."""
        most = fit.score(fit.tau) + NEAR
        for candidate in near:
            if candidate.state.edits != fit.state.edits:
                yield candidate
            elif (there := self._refitted(fit, candidate.state, candidate.subset)).score < most:
                yield there

    def _with_twins(
        self, rows: Rows, fit: SelfConsistentFit
    ) -> tuple[Search, SelfConsistentFit, list[Explanation]]:
        """Return the best explanation with twins in place of its causes, what finds it, and its rivals.

        Twins do the same to first order. At full size one of them may leave less, or need fewer causes.
        """
        search, rivals = self, []
        for _ in range(ROUNDS):
            others = search._exchanged(fit)
            now = fit.score(fit.tau)
            rivals += [candidate for _, candidate in others]
            most = now + (len(fit.subset) > 1)
            better = [(twin, candidate) for twin, candidate in others if candidate.score < most]
            if not better:
                break
            twin, other = min(better, key=lambda each: each[1].score)
            again = replace(search, first=(twin, *search.first))
            there = again._stable(rows, other.state, None)
            if there.score(fit.tau) >= now:
                break
            rivals.append(Explanation(*fit[:2], now))
            search, fit = again, there
        return search, fit, rivals

    def _exchanged(self, fit: SelfConsistentFit) -> list[tuple[int, Explanation]]:
        """Return explanations with a twin that differs at full size in place of a cause, and that twin."""
        gram, some = fit.selection.normal.gram, replace(fit.rows, at=self.spread(COARSE))
        exchanged = []
        for twin, g in self._distinct[1].items():
            if g in fit.subset:
                c, d = self._columns([g, twin])
                other = self.exchange(fit.state, c, d, gram)
                if not self.is_equivalent(fit.state, other, some):
                    exchanged.append((twin, self._refitted(fit, other, fit.subset - {g} | {twin})))
        return exchanged

    def _concluded(self, fit: SelfConsistentFit, near: list[Explanation]) -> SearchResult:
        """Return an explanation with what stays of it, and with those that are not told from it.

        Who takes more causes has to leave less, and each of them moves the floor or more.
        """
        state, subset, tau, rows, selection = fit
        moving = selection.moving
        final = Explanation(state, subset, float(selection.scores([subset])[0]))
        near += self._neighbours(fit, final.score + NEAR)
        simple, least = final.size, cost(self.model, state, rows)
        near = [
            candidate for candidate in near
            if (candidate.size <= simple or cost(self.model, candidate.state, rows) < LESS * least)
            and (candidate.state.edits != state.edits or moving(candidate.subset) == candidate.subset)
            and not any(self._unit_like(candidate.state, g) in state.edits for g in candidate.subset)
        ]  # fmt: skip
        near = list({candidate.key: candidate for candidate in near}.values())
        shown = tuple(sorted(near, key=_score)[:SHOWN])
        refused = tuple(self._preferred(fit, final.score))
        return SearchResult(final, shown, rows, tau, selection.normal, self._distinct[1], refused)

    def _preferred(self, fit: SelfConsistentFit, score: float) -> Iterator[Refusal]:
        """Yield what the gate refused and the criterion prefers: the best of each reason."""
        some = fit.rows.thinned(COARSE)
        for reason in dict.fromkeys(refusal.reason for refusal in self._refused):
            every = {each.explanation.key: each for each in self._refused if each.reason == reason}.values()
            refusal = min(every, key=lambda each: cost(self.model, each.explanation.state, some))
            again = self._refitted(fit, refusal.explanation.state, refusal.subset)
            if again.score < score:
                yield refusal._replace(explanation=again)

    def _neighbours(self, fit: SelfConsistentFit, most: float) -> Iterator[Explanation]:
        """Yield other subsets with a score below `most`, neither a part of the best nor around it."""
        for score, subset in fit.selection.exchanged(fit.subset, self._distinct[0])[:SHOWN]:
            if score >= most:
                break
            candidate = self._refitted(fit, fit.state, subset)
            numbers = (candidate.state.of(self.model.groups[g]) for g in subset)
            moved = all(number.any() for number in numbers)  # else the fit got nowhere
            if candidate.score < most and moved and not self._unbelievable(candidate.state, subset, fit.rows):
                yield candidate


def _score(explanation: Explanation) -> float:
    return explanation.score


def _but(edits: Edits, gone: Edit) -> Edits:
    return tuple(edit for edit in edits if edit != gone)
