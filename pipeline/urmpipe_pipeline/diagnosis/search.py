"""The search for the causes of a deviation.

1. Discrete causes (signs, exchanges, axes, units, another robot) are ranked on few rows (candidates.py), and
   with each plausible one single large causes are fitted exactly.
2. From each of these starts a subset of groups is selected (selection.py), fitted, and selected again where
   the fit ends, until it is stable (explanations.py).
3. The best is decided on up to `MAX_ROWS` rows, with the autocorrelation time of its residual, and with
   equivalent causes in place of its causes if these leave less at full size.
4. Explanations whose score is within `RIVAL_MARGIN` of the best are its rivals.

Every subset passes the gate (explanations.py); what it refuses is kept, with the reason:
`SearchResult.refused`.
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
    NOISE,
    ROUNDS,
    Explanation,
    Explanations,
    Refusal,
    SearchResult,
    SelfConsistentFit,
    remove_edit,
)
from urmpipe_pipeline.diagnosis.fit import WeightedRows, cost
from urmpipe_pipeline.diagnosis.hypotheses import State
from urmpipe_pipeline.diagnosis.models import ArmModel
from urmpipe_pipeline.diagnosis.selection import Subset
from urmpipe_pipeline.runs.reading_errors import Edit, Edits

SELECTION_ROWS = 2_000  # evenly spaced, that select before more of them decide
MAX_ROWS = 20_000  # evenly spaced, that decide; standard errors fall with the root of them
MAJOR = 0.35  # largest ratio of the square with a cause to that without it, if more than noise is left
PROMISED = 0.5  # fraction of the square that the rest of an explanation leaves at most
CLEAR = 100.0  # times the noise: a deviation so large that one cause which explains it has no rival
RIVAL_MARGIN = 6.0  # of scores: odds of twenty to one
HOPELESS_MARGIN = 100.0  # of scores on few rows, above which an explanation is no rival on more
MAX_RIVALS = 5
MIN_IMPROVEMENT = 0.95  # of the square of the best, which a rival with more causes leaves at most
UNIT_TOLERANCE = 0.01  # relative difference of a joint's scale from a factor between units
FRAMES = ("tool_shift", "base_shift", "base_rotation")


@dataclass(frozen=True, eq=False)
class Search(Explanations):
    """A search for the explanation of a deviation."""

    def find(self) -> SearchResult:
        """Return the causes of a deviation."""
        weight = self._weight(1.0 / self.floor, self.null)
        coarse = WeightedRows(self.spread(COARSE), weight)
        ranked = rank_discrete_causes(self.model, self.edits, self.null, coarse, self.floor)
        weight = self._weight(weight, self.null._replace(edits=ranked[0]), self.model.groups)
        medium = WeightedRows(self.spread(MEDIUM), weight, self._inlier_size(weight))
        coarse = coarse._replace(weight=weight)
        tau = self._first_tau(self.null._replace(edits=ranked[0]), medium)
        best, *candidates = self._explore(ranked, coarse, medium, tau)
        while (
            more := add_discrete_cause(self.model, self.edits, best.state, coarse, self.floor)
        ) is not None:
            candidate = self._explain(medium, more, tau)
            if candidate.score >= best.score:
                break
            best, candidates = candidate, [best, *candidates]
        for edit in best.state.edits:  # each was assumed by a start
            without = best.state._replace(edits=remove_edit(best.state.edits, edit))
            if not self._is_needless(without, best, coarse):
                candidate = self._explain(medium, without, tau)
                if candidate.score < best.score:
                    best, candidates = candidate, [best, *candidates]
        search = self
        if best.size > 2 or cost(self.model, best.state, coarse) > NOISE:
            zeros, candidate = self._explain_by_zeros(medium, tau)
            if candidate.score < best.score:
                search, best, candidates = zeros, candidate, [best, *candidates]
            for candidate in self._iter_turned_bases(coarse, medium, tau):
                if candidate.score < best.score:
                    search, best, candidates = self, candidate, [best, *candidates]
        weight = self._weight(weight, best.state, self.model.groups)
        rows = WeightedRows(self.spread(MAX_ROWS), weight, self._inlier_size(weight))
        return search._decide(rows, best, candidates)

    def _explore(
        self, ranked: Sequence[Edits], coarse: WeightedRows, medium: WeightedRows, tau: float
    ) -> list[Explanation]:
        """Return the explanations from all starts, the best first, each once."""
        candidates, visited = list[Explanation](), dict[tuple[Edits, Subset], float]()
        for start in self._iter_starts(ranked, coarse):
            best = min(candidates, key=_score, default=None)
            if best is not None and self._is_needless(start, best, coarse):
                continue
            margin = HOPELESS * len(medium.at) * len(medium.weight) / tau
            max_score = np.inf if best is None else best.score + margin
            candidates.append(self._explain(medium, start, tau, max_score, visited))
        distinct: dict[object, Explanation] = {}
        for candidate in sorted(candidates, key=_score):
            distinct.setdefault(candidate.key, candidate)
        return [*distinct.values()]

    def _iter_starts(self, ranked: Sequence[Edits], coarse: WeightedRows) -> Iterator[State]:
        """Yield the starts of selections: the discrete causes, the clock, and single large causes."""
        states = [self.null._replace(edits=edits) for edits in ranked]
        yield from states
        yield from self.starts
        single = [g for g in self._distinct[0] if len(self.model.groups[g].columns) == 1]
        if isinstance(self.model, ArmModel) and not self.forced:
            for edits in dict.fromkeys((states[0].edits, ())):
                yield from find_large_causes(self.model, self.null._replace(edits=edits), coarse, single)

    def _explain_by_zeros(self, rows: WeightedRows, tau: float) -> tuple[Search, Explanation]:
        """Search from a fit of all joint zeros; return a search that prefers zeros, and its explanation.

        A lost calibration makes many of them large at once; some are a shift or turn of a frame alone.
        """
        zeros = tuple(g for g, group in enumerate(self.model.groups) if group.kind == "joint_offset")
        search = replace(self, first=zeros)
        return search, search._explain(rows, self.fit(self.null, frozenset(zeros), rows), tau)

    def _iter_turned_bases(
        self, coarse: WeightedRows, medium: WeightedRows, tau: float
    ) -> Iterator[Explanation]:
        """Yield explanations by another robot whose base is turned or mirrored, too, if much deviates."""
        if cost(self.model, self.null, coarse) <= CLEAR * NOISE:
            return
        robots, bases = (
            [edit for edit, *more in self.edits if edit.kind in kinds and not more]
            for kinds in (("other_robot",), ("base_rotation", "base_mirrored"))
        )
        pairs = [*product(robots, bases)]
        for edits in rank_discrete_causes(self.model, pairs, self.null, coarse, self.floor) if pairs else ():
            if edits:
                yield self._explain(medium, self.null._replace(edits=edits), tau)

    def _is_needless(self, start: State, best: Explanation, rows: WeightedRows) -> bool:
        """Return whether at most one cause leaves noise, and a start with discrete causes needs more.

        If it is a discrete one that removes nearly all, no start that needs more is worth a search.
        """
        if best.size > 1 or cost(self.model, best.state, rows) > NOISE:
            return False
        clear = best.state.edits and cost(self.model, self.null, rows) > CLEAR * NOISE
        return bool(start.edits or clear) and cost(self.model, start, rows) > NOISE

    def _decide(
        self, rows: WeightedRows, best: Explanation, candidates: Sequence[Explanation]
    ) -> SearchResult:
        """Return the result on all rows, from what few rows selected."""
        some = rows._replace(at=self.spread(SELECTION_ROWS))
        fit = self._stable(some, best.state, None)
        margin = best.score + HOPELESS_MARGIN
        near = sorted((candidate for candidate in candidates if candidate.score < margin), key=_score)
        max_score = fit.score(fit.tau) + HOPELESS * fit.selection.normal.size / fit.tau
        near = [
            self._explain(fit.rows, candidate.state, fit.tau, max_score) for candidate in near[:MAX_RIVALS]
        ]
        for candidate in near:
            if candidate.score < fit.score(fit.tau):
                again = self._stable(some, candidate.state, None)
                if again.score(fit.tau) < fit.score(fit.tau):
                    fit = again
        search, fit = self._simplify(some, fit)
        search, fit, rivals = search._exchange_equivalents(some, fit)
        max_score = fit.score(fit.tau) + RIVAL_MARGIN
        if len(rows.at) > len(some.at):
            fit = search._stable(rows, fit.state, fit.subset)
        key = fit.state.edits, fit.subset
        near = [
            candidate
            for candidate in (*near, *rivals)
            if candidate.score < max_score and candidate.key != key
        ]
        fit = search._drop_minor(fit)
        result = search._conclude(fit, list(search._rescore(near, fit)))
        return search._drop_changing(result)

    def _simplify(self, rows: WeightedRows, fit: SelfConsistentFit) -> tuple[Search, SelfConsistentFit]:
        """Return an explanation with one cause at full size for several parameters, and the search for it.

        The zero of the last joint is a shift of the tool that has up to three parameters; a base turned by
        half a turn and back by a parameter is turned by one; a scale of 57.3 is a unit.
        """
        search = self
        for state, subset in [*self._single_causes(fit), *self._joined_turns(fit), *self._units(fit)]:
            now, start = self._fitted_score(fit, fit), self.fit(state, subset, fit.rows)
            now += RIVAL_MARGIN * (len(state.edits) > len(fit.state.edits))  # discrete causes are preferred
            if fit.selection.score(cost(self.model, start, fit.rows), subset) > now + HOPELESS_MARGIN:
                continue
            again = replace(self, first=(*(subset & self._distinct[1].keys()), *self.first))
            simple = again._stable(rows, start, None)
            if self._fitted_score(simple, fit) < now:
                search, fit = again, simple
        return search, fit

    def _fitted_score(self, fit: SelfConsistentFit, other: SelfConsistentFit) -> float:
        """Return the score of what an explanation really leaves, on the rows and with the tau of another."""
        selection = replace(fit.selection, independent=other.selection.independent)
        return selection.score(cost(self.model, fit.state, other.rows), fit.subset)

    def _single_causes(self, fit: SelfConsistentFit) -> Iterator[tuple[State, Subset]]:
        """Yield explanations with one parameter in place of those of a frame."""
        groups = self.model.groups
        candidates = sorted({*self._distinct[0], *self._distinct[1]} - fit.subset)
        single = [g for g in candidates if len(groups[g].columns) == 1]
        coarse = fit.rows._replace(at=self.spread(COARSE))
        for kind in FRAMES:
            of_frame = frozenset(g for g in fit.subset if groups[g].kind == kind)
            several = len(self._columns(sorted(of_frame))) > 1
            if isinstance(self.model, ArmModel) and not self.forced and several:
                rest = self._keep_only(fit.state, fit.subset - of_frame)
                for state in find_large_causes(self.model, rest, coarse, single):
                    (c,) = np.flatnonzero(state.values != rest.values).tolist()
                    added = next(g for g in single if groups[g].columns[0] == c)
                    yield state, fit.subset - of_frame | {added}

    def _joined_turns(self, fit: SelfConsistentFit) -> Iterator[tuple[State, Subset]]:
        """Yield explanations with a parameter alone in place of a turned base and one about its axis."""
        for edit in fit.state.edits:
            for g in fit.subset if edit.kind == "base_rotation" else ():
                group = self.model.groups[g]
                if group.kind == edit.kind and group.axis is not None:
                    axis, angle = edit.axis_angle
                    values = fit.state.values.copy()
                    values[list(group.columns)] += angle * np.dot(axis, group.axis)
                    yield State(values, remove_edit(fit.state.edits, edit)), fit.subset

    def _units(self, fit: SelfConsistentFit) -> Iterator[tuple[State, Subset]]:
        """Yield explanations with another unit of a joint in place of its scale."""
        for g in fit.subset:
            if (edit := self._unit_near_scale(fit.state, g)) is not None:
                rest = self._keep_only(fit.state, fit.subset - {g})
                yield rest._replace(edits=(*rest.edits, edit)), fit.subset - {g}

    def _unit_near_scale(self, state: State, g: int) -> Edit | None:
        """Return the unit of a joint whose factor is nearly its scale; None for other causes."""
        group = self.model.groups[g]
        units = (edit for edit, *more in self.edits if edit.kind == "joint_unit" and not more)
        of_joint = (edit for edit in units if group.kind == "joint_scale" and edit.joints == (group.joint,))
        scale = 1.0 + state.of(group)[0]
        return next((edit for edit in of_joint if abs(scale / edit.value - 1.0) < UNIT_TOLERANCE), None)

    def _drop_minor(self, fit: SelfConsistentFit) -> SelfConsistentFit:
        """Return an explanation without what explains little, if more than noise is left.

        What is not among the hypotheses would otherwise be explained by parts of many of them.
        """
        edits, before = fit.state.edits, cost(self.model, fit.state, fit.rows)
        for edit in edits:  # those that change the square by less than the floor
            without = fit.state._replace(edits=remove_edit(edits, edit))
            if cost(self.model, without, fit.rows) - before < fit.selection.floor:
                fit = fit._replace(state=fit.state._replace(edits=remove_edit(fit.state.edits, edit)))
        while (now := cost(self.model, fit.state, fit.rows)) > NOISE:
            state, subset = fit.state, fit.subset
            starts = [(state._replace(edits=remove_edit(state.edits, edit)), subset) for edit in state.edits]
            starts += [(state, subset - {g}) for g in sorted(subset)]
            fits = [
                (self.fit_usual(self.fit(start, kept, fit.rows), kept, fit.rows), kept)
                for start, kept in starts
            ]
            costs = [cost(self.model, candidate, fit.rows) for candidate, _ in fits]
            together = len(fits) > 1 and self._only_together(state, subset, fit.rows)
            if not costs or (now <= MAJOR * min(costs) and not together):
                break
            state, kept = fits[int(np.argmin(costs))]
            selection = self._selection(state, fit.rows, fit.tau)
            fit = fit._replace(state=state, subset=kept, selection=selection)
        return fit

    def _only_together(self, state: State, subset: Subset, rows: WeightedRows) -> bool:
        """Return whether none of several causes removes anything alone."""
        single = [self._keep_only(state._replace(edits=()), frozenset((g,))) for g in subset]
        single += [self.null._replace(edits=(edit,)) for edit in state.edits]
        nothing = cost(self.model, self.fit_forced(self.null, rows), rows)
        return all(cost(self.model, self.fit_forced(each, rows), rows) >= nothing for each in single)

    def _drop_changing(self, result: SearchResult) -> SearchResult:
        """Return a result without the causes that change during the log, the rest fitted again."""
        changing, edits = self._find_changing(result.best.state, result.best.subset, result.rows)
        if not changing and not edits:
            return result
        refused = (*result.refused, Refusal(result.best, NOT_CONSTANT, frozenset(changing), edits))
        rest = self.without(result, changing, edits)
        if cost(self.model, rest.best.state, rest.rows) > PROMISED * cost(self.model, self.null, rest.rows):
            rest = self.without(result, result.best.subset, result.best.state.edits)
        return self._drop_changing(rest._replace(rivals=(), refused=refused))

    def without(self, result: SearchResult, groups: Set[int], edits: Edits = ()) -> SearchResult:
        """Return a result without some causes, the rest fitted again."""
        kept = result.best.subset - groups
        rest = tuple(edit for edit in result.best.state.edits if edit not in edits)
        start = result.best.state._replace(edits=rest)
        state = self.fit_usual(self.fit(start, kept, result.rows), kept, result.rows)
        selection = self._selection(state, result.rows, result.tau)
        best = Explanation(state, kept, float(selection.scores([kept])[0]))
        return result._replace(best=best, normal=selection.normal)

    def _rescore(self, near: Sequence[Explanation], fit: SelfConsistentFit) -> Iterator[Explanation]:
        """Yield the rivals that are still near, with parameters and scores on the rows that decided."""
        max_score = fit.score(fit.tau) + RIVAL_MARGIN
        for candidate in near:
            if candidate.state.edits != fit.state.edits:
                yield candidate
            else:
                again = self._refit(fit, candidate.state, candidate.subset)
                if again.score < max_score:
                    yield again

    def _exchange_equivalents(
        self, rows: WeightedRows, fit: SelfConsistentFit
    ) -> tuple[Search, SelfConsistentFit, list[Explanation]]:
        """Return the best explanation with equivalents of its causes, the search for it, and its rivals.

        Equivalent causes do the same to first order. At full size one may leave less, or need fewer causes.
        """
        search, rivals = self, []
        for _ in range(ROUNDS):
            exchanged = search._exchanged(fit)
            now = fit.score(fit.tau)
            rivals += [candidate for _, candidate in exchanged]
            most = now + (len(fit.subset) > 1)
            better = [(g, candidate) for g, candidate in exchanged if candidate.score < most]
            if not better:
                break
            added, best = min(better, key=lambda each: each[1].score)
            again = replace(search, first=(added, *search.first))
            stable = again._stable(rows, best.state, None)
            if stable.score(fit.tau) >= now:
                break
            rivals.append(Explanation(fit.state, fit.subset, now))
            search, fit = again, stable
        return search, fit, rivals

    def _exchanged(self, fit: SelfConsistentFit) -> list[tuple[int, Explanation]]:
        """Return explanations with an equivalent that differs at full size, and the group that it adds."""
        gram, some = fit.selection.normal.gram, fit.rows._replace(at=self.spread(COARSE))
        exchanged = []
        for added, g in self._distinct[1].items():
            if g in fit.subset:
                c, d = self._columns([g, added])
                state = self.exchange(fit.state, c, d, gram)
                if not self.is_equivalent(fit.state, state, some):
                    exchanged.append((added, self._refit(fit, state, fit.subset - {g} | {added})))
        return exchanged

    def _conclude(self, fit: SelfConsistentFit, near: list[Explanation]) -> SearchResult:
        """Return the result of a final fit, with its rivals.

        Rivals with more causes have to leave less, and each of these moves the data by the floor or more.
        """
        state, subset, tau, rows, selection = fit
        moving = selection.moving
        final = Explanation(state, subset, float(selection.scores([subset])[0]))
        near += self._iter_neighbours(fit, final.score + RIVAL_MARGIN)
        simple, least = final.size, cost(self.model, state, rows)
        near = [
            candidate for candidate in near
            if (candidate.size <= simple
                or cost(self.model, candidate.state, rows) < MIN_IMPROVEMENT * least)
            and (candidate.state.edits != state.edits or moving(candidate.subset) == candidate.subset)
            and not any(self._unit_near_scale(candidate.state, g) in state.edits for g in candidate.subset)
        ]  # fmt: skip
        near = list({candidate.key: candidate for candidate in near}.values())
        rivals = tuple(sorted(near, key=_score)[:MAX_RIVALS])
        refused = tuple(self._iter_preferred(fit, final.score))
        return SearchResult(final, rivals, rows, tau, selection.normal, self._distinct[1], refused)

    def _iter_preferred(self, fit: SelfConsistentFit, score: float) -> Iterator[Refusal]:
        """Yield what the gate refused and the criterion prefers: the best for each reason."""
        some = fit.rows.thin(COARSE)
        for reason in dict.fromkeys(refusal.reason for refusal in self._refused):
            refusals = {each.explanation.key: each for each in self._refused if each.reason == reason}
            refusal = min(refusals.values(), key=lambda each: cost(self.model, each.explanation.state, some))
            again = self._refit(fit, refusal.explanation.state, refusal.subset)
            if again.score < score:
                yield refusal._replace(explanation=again)

    def _iter_neighbours(self, fit: SelfConsistentFit, max_score: float) -> Iterator[Explanation]:
        """Yield plausible exchanges of a cause of the best with a score below `max_score`."""
        for score, subset in fit.selection.exchanged(fit.subset, self._distinct[0])[:MAX_RIVALS]:
            if score >= max_score:
                break
            candidate = self._refit(fit, fit.state, subset)
            parameters = (candidate.state.of(self.model.groups[g]) for g in subset)
            is_fitted = all(values.any() for values in parameters)  # else the fit made no step
            is_near = candidate.score < max_score and is_fitted
            if is_near and not self._find_implausible(candidate.state, subset, fit.rows):
                yield candidate


def _score(explanation: Explanation) -> float:
    return explanation.score
