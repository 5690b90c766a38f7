"""Explanations of a deviation: fitted, selected anew where a fit leads, and scored.

An explanation has discrete causes (edits) and numbers of a subset of the groups. Its fit and its subset are
consistent if the subset is selected again from the normal equations where the fit ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray, spread_rows
from urmpipe_pipeline.diagnosis.candidates import (
    residual_after_fit,
)
from urmpipe_pipeline.diagnosis.causes import CANCELLING
from urmpipe_pipeline.diagnosis.fit import (
    LONGEST,
    Model,
    Rows,
    autocorrelation_time,
    cost,
    fitted,
    inliers,
    normal_equations,
    residual,
)
from urmpipe_pipeline.diagnosis.hypotheses import Group, State, zero
from urmpipe_pipeline.diagnosis.selection import (
    Normal,
    Selection,
    Subset,
    find_unbelievable,
    leaves_noise,
    without_twins,
)
from urmpipe_pipeline.runs.reading_errors import Edits

COARSE = 300  # rows, spread evenly, on which discrete causes are ranked
MEDIUM = 600  # rows, spread evenly, on which starts are compared
HOPELESS = 2.0  # a start is given up if it leaves e times the rms of the best so far
SAME = 1e-3  # share of the square by which two fits of the same causes differ and are the same
STEPS = 6  # of a fit from a start; those of an explanation that is settled are more
ROUNDS = 6  # selections after each other: from a good start three are enough

ORDER: Mapping[str, float] = {
    "tool_shift": 0.0, "tool_rotation": 0.0, "base_shift": 0.3, "base_rotation": 0.3, "base_mirrored": 0.3,
    "time_lag": 0.6, "servo_lag": 1.0, "clock_drift": 1.0, "path_unit": 0.6, "other_robot": 1.5,
    "joint_sign": 1.0, "joints_swapped": 1.0, "joint_unit": 1.0, "joint_coupled": 1.0, "half_turn": 1.0,
    "mirrored": 2.0, "turns": 1.0, "joint_offset": 1.2, "joint_scale": 2.0, "joint_lag": 2.0,
    "link_length": 1.8, "backlash": 2.5, "compliance": 2.5, "sag": 2.5, "tilt": 2.5, "link_shift": 3.5,
}  # fmt: skip
"""What each kind adds to a score (twice the log of odds): setup before structure, e^(1.2 / 2) = 1.8 to 1."""


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
class Explanations:
    """The explanations that the hypotheses of a model allow.

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

    def _first_tau(self, state: State, rows: Rows) -> float:
        """Return the autocorrelation time in rows of what all numbers leave: at least that of noise."""
        if not self.timed:
            return 1.0
        left = residual_after_fit(self.model, state, rows.at, rows.weight, self.model.groups)
        left = left[:, np.isfinite(left).all(axis=0)]
        return autocorrelation_time(left.T, float((self.floor**2).sum()))

    def fitted(self, state: State, subset: Subset, rows: Rows, steps: int = 2 * STEPS) -> State:
        """Fit the numbers of a subset, and of the groups that are always fitted."""
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
                best = now if best is None or now.score < best.score else best
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
        """Fit a subset without the groups that the gate refuses; return the fit and these groups."""
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

    def _refitted(self, fit: SelfConsistentFit, start: State, subset: Subset) -> Explanation:
        """Return another explanation, fitted, and its score at full size."""
        there = self.beside_usual(self.fitted(start, subset, fit.rows), subset, fit.rows)
        alike = there.edits == fit.state.edits
        selection = fit.selection if alike else self._selection(there, fit.rows, fit.tau)
        least = max(cost(self.model, fit.state, fit.rows), np.finfo(float).tiny)
        left = float(fit.selection.left([fit.subset])[0]) * cost(self.model, there, fit.rows) / least
        return Explanation(there, subset, selection.score(left, subset))

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
