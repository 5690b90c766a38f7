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

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.row_blocks import spread_rows
from urmpipe_pipeline.diagnosis.arm import ArmModel
from urmpipe_pipeline.diagnosis.candidates import (
    add_discrete_cause,
    find_large_causes,
    rank_discrete_causes,
    residual_after_fit,
)
from urmpipe_pipeline.diagnosis.fit import Model, Rows, cost, fitted, inliers, normal_equations, residual
from urmpipe_pipeline.diagnosis.formatting import CANCELLING, NOT_CONSTANT
from urmpipe_pipeline.diagnosis.gate import NOISE, find_changing, find_unbelievable, leaves_noise
from urmpipe_pipeline.diagnosis.hypotheses import Group, State, zero
from urmpipe_pipeline.diagnosis.intervals import LONGEST, autocorrelation_time
from urmpipe_pipeline.diagnosis.selection import Normal, Selection, Subset, without_twins
from urmpipe_pipeline.log_edits import Edit, Edits

COARSE = 300  # rows, spread evenly, on which discrete causes are ranked
MEDIUM = 600  # rows, spread evenly, on which starts are compared
SOME = 2_000  # rows, spread evenly, that select before more of them settle it
MANY = 20_000  # rows, spread evenly, that settle an explanation; standard errors fall with the root of them
MAJOR = 0.35  # share of the square that stays, where more than noise does, with a cause and not without it
PROMISED = 0.5  # share of the square that what is left of an explanation leaves at most
HOPELESS = 2.0  # a start is given up if it leaves e times the rms of the best so far
SAME = 1e-3  # share of the square by which two fits of the same causes differ and are the same
CLEAR = 100.0  # times the noise that a deviation is which one cause that explains it leaves without a rival
STEPS = 6  # of a fit from a start; those of an explanation that is settled are more
ROUNDS = 6  # selections after each other: from a good start three are enough
NEAR = 6.0  # explanations whose scores differ by less are rivals: odds of twenty to one
FAR = 100.0  # an explanation whose score on some rows is so much above the best is no rival on more
SHOWN = 5  # so many rivals are kept
LESS = 0.95  # share of the square of the best that a rival with more causes leaves at most
NEARLY = 0.01  # share by which the scale of a joint differs from a factor between units

ORDER: Mapping[str, float] = {
    "tool_shift": 0.0, "tool_rotation": 0.0, "base_shift": 0.3, "base_rotation": 0.3, "base_mirrored": 0.3,
    "time_lag": 0.6, "servo_lag": 1.0, "clock_drift": 1.0, "path_unit": 0.6, "other_robot": 1.5,
    "joint_sign": 1.0, "joints_swapped": 1.0, "joint_unit": 1.0, "joint_coupled": 1.0, "half_turn": 1.0,
    "mirrored": 2.0, "turns": 1.0, "joint_offset": 1.2, "joint_scale": 2.0, "joint_lag": 2.0,
    "link_length": 1.8, "backlash": 2.5, "compliance": 2.5, "sag": 2.5, "tilt": 2.5, "link_shift": 3.5,
}  # fmt: skip
"""What each kind adds to a score (twice the log of odds): setup before structure, e^(1.2 / 2) = 1.8 to 1."""


FRAMES = ("tool_shift", "base_shift", "base_rotation")


class Explanation(NamedTuple):
    """Causes, with their sizes.

    Attributes:
        state: Discrete causes and numbers.
        subset: The groups whose numbers are taken.
        score: Lower is better.
    """

    state: State
    subset: Subset
    score: float

    @property
    def size(self) -> int:
        """How many causes it takes."""
        return len(self.subset) + len(self.state.edits)

    @property
    def key(self) -> tuple[Edits, Subset]:
        """Which causes it takes, whatever their sizes."""
        return self.state.edits, self.subset


class Refusal(NamedTuple):
    """An explanation that leaves less, and that no engineer believes.

    Attributes:
        explanation: The explanation.
        reason: Why.
        subset: Its groups that this is about.
        edits: Its discrete causes that this is about.
    """

    explanation: Explanation
    reason: str
    subset: Subset
    edits: Edits


@dataclass(frozen=True, eq=False)
class SearchResult:
    """What a search found.

    Attributes:
        best: The best explanation.
        others: Those that the log does not tell from it.
        rows: The rows that counted: without outliers, in the weights of their noise.
        tau: The autocorrelation time of what stays, in rows.
        normal: The normal equations there.
        twins: Which groups stand for another that does exactly the same.
        refused: What the gate refused.
    """

    best: Explanation
    others: tuple[Explanation, ...]
    rows: Rows
    tau: float
    normal: Normal
    twins: dict[int, int]
    refused: tuple[Refusal, ...] = ()


class SelfConsistentFit(NamedTuple):
    """An explanation that its own fit selects again.

    Attributes:
        state: Discrete causes and numbers.
        subset: The groups that are taken.
        tau: The autocorrelation time of what stays, in rows.
        rows: The rows without outliers.
        selection: What it was selected from.
    """

    state: State
    subset: Subset
    tau: float
    rows: Rows
    selection: Selection

    def score(self, tau: float) -> float:
        """Return its score where so many rows tell as much as one."""
        selection = replace(self.selection, independent=self.selection.normal.count / tau)
        return float(selection.scores([self.subset])[0])


@dataclass(frozen=True, eq=False)
class Search:
    """A search among the hypotheses of a model.

    Attributes:
        model: The side that is modelled, with its data.
        edits: What may be there or not, alone or together.
        floor: Noise floor of each component in [m] or [rad], shape (c,).
        forced: Groups that are always fitted, since they are unknown.
        starts: Explanations to start from besides, such as a lag that the motions show.
        usual: Groups that differ from arm to arm, with the size that is usual: only more is a cause.
        timed: Whether the rows follow each other in time: neighbours may then show the same.
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
    _refused: list[Refusal] = field(default_factory=list)

    @property
    def zero(self) -> State:
        """Nothing that differs."""
        return zero(self.model.groups)

    def spread(self, count: int) -> IntArray:
        """Return the indices of so many rows, spread evenly over all, shape (count,)."""
        return spread_rows(self.model.rows, count)

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

    def _first_tau(self, state: State, rows: Rows) -> float:
        """Return the autocorrelation time in rows of what all numbers leave: at least that of noise."""
        if not self.timed:
            return 1.0
        left = residual_after_fit(self.model, state, rows.at, rows.weight, self.model.groups)
        left = left[:, np.isfinite(left).all(axis=0)]
        return autocorrelation_time(left.T, float((self.floor**2).sum()))

    def _is_needless(self, start: State, best: Explanation, rows: Rows) -> bool:
        """Tell whether one cause, or none, leaves noise, and a start with discrete causes needs more.

        Where it is a discrete one that takes nearly all away, no start that needs more is worth a search.
        """
        if best.size > 1 or cost(self.model, best.state, rows) > NOISE:
            return False
        clear = best.state.edits and cost(self.model, self.zero, rows) > CLEAR * NOISE
        return bool(start.edits or clear) and cost(self.model, start, rows) > NOISE

    def fitted(self, state: State, subset: Subset, rows: Rows, steps: int = 2 * STEPS) -> State:
        """Return an explanation with the best numbers of a subset, and of what is always fitted."""
        taken = [self.model.groups[g] for g in sorted(subset | set(self.forced))]
        return fitted(self.model, state, taken, rows, steps=steps)

    def placed(self, state: State, rows: Rows) -> State:
        """Fit only the groups that are always fitted; all other numbers stay as they are."""
        numbers = [self.model.groups[g] for g in self.forced]
        return fitted(self.model, state, numbers, rows, others=True) if numbers else state

    def exchange(self, state: State, c: int, d: int, gram: FloatArray) -> State:
        """Return an explanation with one number in place of another, of the same effect to first order.

        Args:
            state: The explanation.
            c: Place of the number that goes.
            d: Place of the number that comes.
            gram: J^T J [-] of all numbers, in the weights of the rows, shape (p, p).
        """
        values = state.values.copy()
        values[d] += values[c] * gram[c, d] / max(gram[d, d], np.finfo(float).tiny)
        values[c] = 0.0
        return replace(state, values=values)

    def is_equivalent(self, state: State, other: State, rows: Rows) -> bool:
        """Tell whether two explanations leave the same at full size: a difference below the floor."""
        first, second = (self.model.residual(self.placed(each, rows), rows.at) for each in (state, other))
        between = (first - second) / self.floor[:, np.newaxis]
        known = np.isfinite(between).all(axis=0)
        return bool(known.any() and np.mean(between[:, known] ** 2) < 1.0)

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

    @cached_property
    def _prior(self) -> FloatArray:
        """What each group adds to a score by its kind."""
        return np.array([ORDER.get(group.kind, 0.0) for group in self.model.groups])

    def _columns(self, groups: Sequence[int]) -> list[int]:
        """Return the places of the numbers of some groups."""
        return [c for g in groups for c in self.model.groups[g].columns]

    def _least(self, weight: FloatArray) -> float:
        """Return the noise floor of a whole row, in its weights."""
        return float(np.linalg.norm(self.floor * weight))

    def _weight(self, weight: FloatArray, state: State, groups: Sequence[Group] | None = None) -> FloatArray:
        """Return one over the noise of each component: what all numbers together leave, by blocks."""
        left = residual_after_fit(self.model, state, self.spread(COARSE), weight, groups)
        left = left[:, inliers(left * weight[:, np.newaxis])]
        blocks = self.model.blocks
        noise = [np.sqrt(np.mean(left[blocks == b] ** 2)) if left.size else 0.0 for b in blocks]
        return np.asarray(1.0 / np.maximum(noise, self.floor))

    def _selection(self, state: State, rows: Rows, tau: float) -> Selection:
        """Return what subsets of the groups are scored by, near an explanation."""
        among, _ = self._distinct
        forced = self._columns(self.forced)
        usual = self._usual_columns(frozenset())
        damping = np.array([*(0.0 for _ in forced), *(size**-2.0 for _, size in usual)])
        every = normal_equations(self.model, state, rows)
        normal = every.without([*forced, *(c for c, _ in usual)], damping)
        whole = every.without(forced, np.zeros(len(forced))).gram if usual else None
        groups = tuple(np.array(group.columns) for group in self.model.groups)
        floor = float(np.mean((self.floor * rows.weight) ** 2))
        edits = state.edits
        numbers = sum(1 + (edit.first > 0) for edit in edits)
        begins = 2.0 * np.log(self.model.rows)  # it may begin at any row
        more = sum(ORDER.get(edit.kind, 0.0) + begins * (edit.first > 0) for edit in edits)
        return Selection(
            normal, groups, normal.count / tau, floor, len(edits), numbers, len(among), whole,
            prior=self._prior, more=more,
        )  # fmt: skip

    def _explained(
        self,
        rows: Rows,
        state: State,
        tau: float,
        most: float = np.inf,
        passed: dict[tuple[Edits, Subset], float] | None = None,
    ) -> Explanation:
        """Return the best explanation with some edits, selected anew where the last fit led until it stays.

        It is given up if its score stays above `most`, or if another start led to the same fit: `passed` has
        what each leaves.
        """
        best: Explanation | None = None
        taken: Subset | None = None
        seen: set[Subset] = set()
        beyond: set[int] = set()
        for _ in range(ROUNDS):
            some = rows.trimmed(residual(self.model, state, rows.at))
            if not len(some.at):  # a lag beyond the log
                break
            selection = self._selection(state, some, tau)
            if taken is not None:
                now = Explanation(state, taken, float(selection.scores([taken])[0]))
                best = now if best is None else min(best, now, key=_score)
            chosen = selection.best([g for g in self._distinct[0] if g not in beyond])
            promised = selection.score_of(chosen) - HOPELESS * selection.independent
            promised = promised if best is None else best.score
            if chosen in seen or promised > most:
                break
            seen.add(chosen)
            state, more = self._within(state, chosen, some, selection, STEPS)
            left, key = cost(self.model, state, some), (state.edits, chosen - more)
            met = passed is not None and np.isclose(passed.get(key, np.inf), left, rtol=SAME)
            if met or selection.score(left, chosen - more) > most:
                break
            if passed is not None:
                passed[key] = left
            taken, beyond = chosen - more, beyond | more
        return best or Explanation(state, taken or frozenset(), np.inf)

    def _within(
        self, state: State, subset: Subset, rows: Rows, selection: Selection, steps: int = 2 * STEPS
    ) -> tuple[State, set[int]]:
        """Return the best numbers of what is believed of a subset, and the groups it lacks."""
        gone: set[int] = set()
        guess = self._guess(state, subset, selection)
        while True:
            kept = subset - gone
            starts = [state] if guess is None else [state, guess]
            start = min(starts, key=lambda one: cost(self.model, self._bare(one, kept), rows))
            there = self.fitted(start, kept, rows, steps)
            beyond = self._unbelievable(there, kept, rows)
            if not beyond:
                return there, gone
            gone |= beyond
            guess = None

    def _bare(self, state: State, subset: Subset) -> State:
        """Set all numbers to 0 but those of a subset and of the groups that are always fitted."""
        values, columns = np.zeros_like(state.values), self._columns([*self.forced, *subset])
        values[columns] = state.values[columns]
        return replace(state, values=values)

    def _guess(self, state: State, subset: Subset, selection: Selection) -> State | None:
        """Return the numbers of a linear fit, where they differ by much from those to start from."""
        columns = selection.columns(subset)
        if not columns or state.values[columns].any() or self.usual:
            return None
        values = np.zeros_like(state.values)
        values[columns] = selection.solution(columns)
        return replace(state, values=values) if np.abs(values).max() > 0.05 else None

    def _unbelievable(self, state: State, subset: Subset, rows: Rows) -> set[int]:
        """Return the groups of a subset whose numbers no engineer believes, the reason noted."""
        beyond, reason = find_unbelievable(self, state, subset, rows)
        if (
            reason != CANCELLING and len(subset) > 1 and not state.edits
        ):  # one of them that alone leaves noise is believed
            for g in sorted(beyond):
                if leaves_noise(self, self.fitted(state, frozenset((g,)), rows), rows):
                    return set(subset) - {g}
        if beyond and reason:
            refused = Explanation(state, subset, np.inf)
            self._refused.append(Refusal(refused, reason, subset, state.edits))
        return beyond

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

    def _refitted(self, fit: SelfConsistentFit, start: State, subset: Subset) -> Explanation:
        """Return another explanation, fitted, and its score at full size."""
        there = self.beside_usual(self.fitted(start, subset, fit.rows), subset, fit.rows)
        alike = there.edits == fit.state.edits
        selection = fit.selection if alike else self._selection(there, fit.rows, fit.tau)
        least = max(cost(self.model, fit.state, fit.rows), np.finfo(float).tiny)
        left = float(fit.selection.left([fit.subset])[0]) * cost(self.model, there, fit.rows) / least
        return Explanation(there, subset, selection.score(left, subset))

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

    def beside_usual(self, state: State, subset: Subset, rows: Rows) -> State:
        """Return an explanation with what arms usually differ by, fitted with its numbers and damped."""
        usual = self._usual_columns(subset)
        if not usual or not (subset or state.edits):
            return state
        own = self._columns([*self.forced, *sorted(subset)])
        columns = [*own, *(c for c, _ in usual)]
        normal = normal_equations(self.model, state, rows)
        damped = normal.gram[np.ix_(columns, columns)]
        damped += np.diag([*(0.0 for _ in own), *(size**-2.0 for _, size in usual)])
        size = np.sqrt(np.maximum(np.diag(damped), np.finfo(float).tiny))
        solved = np.linalg.lstsq(
            damped / size / size[:, np.newaxis], normal.moment[columns] / size, rcond=1e-13
        )
        values = state.values.copy()
        values[columns] = solved[0] / size
        there = replace(state, values=values)
        return there if cost(self.model, there, rows) <= cost(self.model, state, rows) else state

    def _usual_columns(self, subset: Subset) -> list[tuple[int, float]]:
        """Return the places of numbers that arms usually differ by, without a subset, each with its size."""
        among = set(self._distinct[0]) - subset
        return [(c, size) for g, size in self.usual.items() if g in among for c in self._columns([g])]

    def _stable(self, every: Rows, state: State, subset: Subset | None) -> SelfConsistentFit:
        """Return an explanation that is selected again where its fit leads.

        The autocorrelation time is that of what stays: of the whole, the causes themselves would count as
        noise. It only grows from one selection to the next.
        """
        tau = self._first_tau(replace(self.zero, edits=state.edits), replace(every, at=self.spread(MEDIUM)))
        tau *= len(every.at) / len(self.spread(MEDIUM)) if tau > 1.0 else 1.0
        among = list(self._distinct[0])
        for _ in range(ROUNDS):
            rows = every.trimmed(residual(self.model, state, every.at))
            selection = self._selection(state, rows, tau)
            chosen = selection.best(among)
            there, beyond = self._within(state, chosen, rows, selection)
            if beyond:  # what is left is selected anew where all of it still fitted
                among = [g for g in among if g not in beyond]
                chosen -= beyond
                continue
            state = self.beside_usual(there, chosen, rows)
            if self.timed:
                tau = max(tau, self._tau(state, rows))
            selection = replace(selection, independent=selection.normal.count / tau)
            if chosen == subset and selection.best(among) == chosen:
                break
            subset = chosen
        kept = selection.moving(chosen)
        if kept != chosen or beyond:
            state = self.beside_usual(self.fitted(state, kept, rows), kept, rows)
        return SelfConsistentFit(state, kept, tau, rows, selection)

    def _tau(self, state: State, rows: Rows) -> float:
        """Return the autocorrelation time of what an explanation leaves: the longest, of places or turns."""
        left = residual(self.model, state, rows.at[:LONGEST])
        left = left[:, np.isfinite(left).all(axis=0)]
        of_blocks = (self.model.blocks == block for block in np.unique(self.model.blocks))
        return max(
            autocorrelation_time(left[one].T, float((self.floor[one] ** 2).sum())) for one in of_blocks
        )

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
