"""Explanations of a deviation: fitted, selected again where the fit leads, and passed through a gate.

An explanation has discrete causes (edits) and parameters of a subset of the groups. Fit and subset are
consistent if the subset is selected again from the normal equations where the fit ends (`_stable`).

The gate: causes that are implausible are refused, with the reason.

1. A parameter beyond `MAX_SIZE` is of no such cause, unless it alone leaves the noise. A factor below 0 is a
   sign, and a backlash of a turn is one.
2. Together with other causes no part of an arm differs by more than `MAX_LENGTH_RATIO` and
   `MAX_ANGLE_OR_SCALE`. One that alone leaves the noise may have any size.
3. A cause that alone makes the rms more than `CANCELLING_RATIO` times that without any only cancels another.
4. A parameter has to be constant: x_k is replaced by sum_m x_km h_m(row) over two and over `SEGMENTS` hat
   functions h_m. It changes during the log if these leave significantly less (F test, in rows that are
   independent of each other), and differ from x_k by more than `MAX_CHANGE` of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray, spread_rows
from urmpipe_pipeline.diagnosis.candidates import residual_after_fit
from urmpipe_pipeline.diagnosis.causes import CANCELLING, CLOCKS, STRUCTURE, TOO_LARGE
from urmpipe_pipeline.diagnosis.fit import (
    MAX_SAMPLES,
    NormalEquations,
    WeightedRows,
    autocorrelation_time,
    cost,
    find_inliers,
    fit_parameters,
    normal_equations,
    residual,
)
from urmpipe_pipeline.diagnosis.hypotheses import Group, Model, State, null_state
from urmpipe_pipeline.diagnosis.selection import Selection, Subset, drop_equivalent_groups
from urmpipe_pipeline.runs.reading_errors import Edit, Edits

COARSE = 300  # rows, evenly spaced, on which discrete causes are ranked
MEDIUM = 600  # rows, evenly spaced, on which starts are compared
HOPELESS = 2.0  # a start is given up if it leaves e times the rms of the best so far
EQUAL_FIT = 1e-3  # fraction of the square up to which two fits of the same causes are the same
STEPS = 6  # of a fit from a start; a final explanation has more
ROUNDS = 6  # selections after each other: from a good start three are enough
NONLINEAR = 0.05  # parameter of a linear fit from which on it is a second start

# added to a score by kind (twice the log of odds): setup before structure, e^(1.2 / 2) = 1.8 to 1
ORDER: Mapping[str, float] = {
    "tool_shift": 0.0, "tool_rotation": 0.0, "base_shift": 0.3, "base_rotation": 0.3, "base_mirrored": 0.3,
    "time_lag": 0.6, "servo_lag": 1.0, "clock_drift": 1.0, "path_unit": 0.6, "other_robot": 1.5,
    "joint_sign": 1.0, "joints_swapped": 1.0, "joint_unit": 1.0, "joint_coupled": 1.0, "half_turn": 1.0,
    "mirrored": 2.0, "turns": 1.0, "joint_offset": 1.2, "joint_scale": 2.0, "joint_lag": 2.0,
    "link_length": 1.8, "backlash": 2.5, "compliance": 2.5, "sag": 2.5, "tilt": 2.5, "link_shift": 3.5,
}  # fmt: skip

MAX_SIZE: Mapping[str, float] = {
    "joint_scale": 0.5,  # a joint that is read in other steps is off by less
    "compliance": 0.02,  # s2: more would swing below 1.1 Hz
    "clock_drift": 0.05,  # no clock is off by a twentieth
    "servo_lag": 1.0,  # s: a slower drive follows nothing
    "joint_lag": 1.0,  # s
    "backlash": 0.1,  # rad: 6 deg
    "sag": 0.01,  # rad/kg or rad/(N m): no arm gives way by half a degree under 1 kg
}
MAX_LENGTH_RATIO: Mapping[str, float] = {"link_length": 0.2, "link_shift": 0.2}  # of the reach
MAX_ANGLE_OR_SCALE: Mapping[str, float] = {"tilt": np.radians(10.0), "joint_scale": 0.02}

NOISE = 4.0  # mean square, in weights of the noise, up to which it is noise
CANCELLING_RATIO = 3.0  # of the rms with a cause alone to that without any
SEGMENTS = 6  # of a log, in which a parameter may differ
CLOCK_SEGMENTS = 40  # the same of a clock: missing rows make it jump
MAX_CHANGE = 0.3  # of a parameter, rms over the segments, relative to it
MAX_CLOCK_CHANGE = 0.1  # the same of a clock, which nothing of an arm resembles
SIGNIFICANT = 5.0  # standard deviations of F, sqrt(2 / added parameters) each, by which it exceeds 1
GATE_ROWS = 300  # evenly spaced, on which causes are applied alone
SEGMENT_ROWS = 2_000  # evenly spaced, on which parameters may change


class Explanation(NamedTuple):
    """Causes, with their sizes.

    Attributes:
        state: Discrete causes and parameters.
        subset: The groups with parameters.
        score: Lower is better.
    """

    state: State
    subset: Subset
    score: float

    @property
    def size(self) -> int:
        """Number of causes."""
        return len(self.subset) + len(self.state.edits)

    @property
    def key(self) -> tuple[Edits, Subset]:
        """The causes, regardless of their sizes."""
        return self.state.edits, self.subset


class Refusal(NamedTuple):
    """An explanation that leaves less, but is implausible.

    Attributes:
        explanation: The explanation.
        reason: Why.
        subset: The groups that are refused.
        edits: The discrete causes that are refused.
    """

    explanation: Explanation
    reason: str
    subset: Subset
    edits: Edits


class SearchResult(NamedTuple):
    """The result of a search.

    Attributes:
        best: The best explanation.
        rivals: Explanations that the log does not distinguish from it.
        rows: The rows that counted: without outliers, in the weights of their noise.
        tau: The autocorrelation time of the residual, in rows.
        normal: The normal equations at the best explanation.
        representatives: Equivalent groups, each with the group that represents it.
        refused: What the gate refused.
    """

    best: Explanation
    rivals: tuple[Explanation, ...]
    rows: WeightedRows
    tau: float
    normal: NormalEquations
    representatives: dict[int, int]
    refused: tuple[Refusal, ...] = ()


class SelfConsistentFit(NamedTuple):
    """An explanation that is selected again where its fit ends.

    Attributes:
        state: Discrete causes and parameters.
        subset: The groups with parameters.
        tau: The autocorrelation time of the residual, in rows.
        rows: The rows without outliers.
        selection: What it was selected from.
    """

    state: State
    subset: Subset
    tau: float
    rows: WeightedRows
    selection: Selection

    def score(self, tau: float) -> float:
        """Return its score with another autocorrelation time in rows."""
        selection = replace(self.selection, independent=self.selection.normal.size / tau)
        return float(selection.scores([self.subset])[0])


@dataclass(frozen=True, eq=False)
class Explanations:
    """The explanations that the hypotheses of a model allow.

    Attributes:
        model: The model.
        edits: Discrete causes, alone or together.
        floor: Noise floor of each component in [m] or [rad], shape (c,).
        forced: Groups that are always fitted, since they are unknown.
        starts: Additional explanations to start from, such as a lag that the motions show.
        usual: Groups that differ from arm to arm, with their usual size: only more is a cause.
        timed: Whether the rows have times: the noise of consecutive rows may then be correlated.
        first: Groups that represent their equivalents before all others.
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
    def null(self) -> State:
        """The explanation without any cause."""
        return null_state(self.model.groups)

    def spread(self, count: int) -> IntArray:
        """Return the indices [-] of at most `count` rows, evenly spaced over all, shape (m,)."""
        return spread_rows(self.model.rows, count)

    def _first_tau(self, state: State, rows: WeightedRows) -> float:
        """Return the autocorrelation time in rows after all parameters are fitted: at least that of noise."""
        if not self.timed:
            return 1.0
        left = residual_after_fit(self.model, state, rows.at, rows.weight, self.model.groups)
        left = left[:, np.isfinite(left).all(axis=0)]
        return autocorrelation_time(left.T, float((self.floor**2).sum()))

    def fit(self, state: State, subset: Subset, rows: WeightedRows, max_steps: int = 2 * STEPS) -> State:
        """Fit the parameters of a subset, and of the groups that are always fitted."""
        groups = [self.model.groups[g] for g in sorted(subset | set(self.forced))]
        return fit_parameters(self.model, state, groups, rows, max_steps=max_steps)

    def fit_forced(self, state: State, rows: WeightedRows) -> State:
        """Fit only the groups that are always fitted; all other parameters keep their values."""
        groups = [self.model.groups[g] for g in self.forced]
        return fit_parameters(self.model, state, groups, rows, keep_others=True) if groups else state

    def exchange(self, state: State, c: int, d: int, gram: FloatArray) -> State:
        """Return an explanation with one parameter in place of another, of the same effect to first order.

        Args:
            state: The explanation.
            c: Column of the parameter that is removed.
            d: Column of the parameter that is added.
            gram: J^T J [-] of all parameters, in the weights of the rows, shape (p, p).
        """
        values = state.values.copy()
        values[d] += values[c] * gram[c, d] / max(gram[d, d], np.finfo(float).tiny)
        values[c] = 0.0
        return state._replace(values=values)

    def is_equivalent(self, state: State, other: State, rows: WeightedRows) -> bool:
        """Return whether two explanations leave the same at full size: a difference below the floor."""
        first, second = (self.model.residual(self.fit_forced(each, rows), rows.at) for each in (state, other))
        between = (first - second) / self.floor[:, np.newaxis]
        known = np.isfinite(between).all(axis=0)
        return bool(known.any() and np.mean(between[:, known] ** 2) < 1.0)

    @cached_property
    def _distinct(self) -> tuple[list[int], dict[int, int]]:
        """The groups that are selected from, and the equivalents of some of them, without any cause."""
        rows = WeightedRows(self.spread(COARSE), 1.0 / self.floor)
        normal = normal_equations(self.model, self.null, rows)
        forced = self._columns(self.forced)
        groups = [np.array(group.columns) for group in self.model.groups]
        after = normal.without(forced, np.zeros(len(forced)))
        distinct, equivalents = drop_equivalent_groups(after, groups, np.diag(normal.gram), self.first)
        return [g for g in distinct if g not in self.forced], equivalents

    @cached_property
    def _prior(self) -> FloatArray:
        return np.array([ORDER.get(group.kind, 0.0) for group in self.model.groups])

    def _columns(self, groups: Sequence[int]) -> list[int]:
        return [c for g in groups for c in self.model.groups[g].columns]

    def _inlier_size(self, weight: FloatArray) -> float:
        """Return the noise floor of a row, in its weights."""
        return float(np.linalg.norm(self.floor * weight))

    def _weight(self, weight: FloatArray, state: State, groups: Sequence[Group] | None = None) -> FloatArray:
        """Return one over the noise of each component, after a fit of all parameters, by blocks."""
        left = residual_after_fit(self.model, state, self.spread(COARSE), weight, groups)
        left = left[:, find_inliers(left * weight[:, np.newaxis])]
        blocks = self.model.blocks
        noise = [np.sqrt(np.mean(left[blocks == b] ** 2)) if left.size else 0.0 for b in blocks]
        return np.asarray(1.0 / np.maximum(noise, self.floor))

    def _selection(self, state: State, rows: WeightedRows, tau: float) -> Selection:
        """Return the selection of subsets near an explanation."""
        forced = self._columns(self.forced)
        usual = self._usual_columns(frozenset())
        damping = np.array([*(0.0 for _ in forced), *(size**-2.0 for _, size in usual)])
        full = normal_equations(self.model, state, rows)
        normal = full.without([*forced, *(c for c, _ in usual)], damping)
        edits = state.edits
        begins = 2.0 * np.log(self.model.rows)  # an onset may be at any row
        return Selection(
            normal=normal,
            groups=tuple(np.array(group.columns) for group in self.model.groups),
            independent=normal.size / tau,
            floor=float(np.mean((self.floor * rows.weight) ** 2)),
            edits=len(edits),
            edit_parameters=sum(1 + (edit.first > 0) for edit in edits),
            hypotheses=len(self._distinct[0]),
            full_gram=full.without(forced, np.zeros(len(forced))).gram if usual else None,
            prior=self._prior,
            edit_prior=sum(ORDER.get(edit.kind, 0.0) + begins * (edit.first > 0) for edit in edits),
        )

    def _explain(
        self,
        rows: WeightedRows,
        state: State,
        tau: float,
        max_score: float = np.inf,
        visited: dict[tuple[Edits, Subset], float] | None = None,
    ) -> Explanation:
        """Return the best explanation with some edits, selected again where each fit ends until it is stable.

        It is given up if its score stays above `max_score`, or if another start led to the same fit:
        `visited` has the square that each leaves.
        """
        best: Explanation | None = None
        subset: Subset | None = None
        seen: set[Subset] = set()
        refused: set[int] = set()
        for _ in range(ROUNDS):
            inliers = rows.without_outliers(residual(self.model, state, rows.at))
            if not len(inliers.at):  # a lag beyond the log
                break
            selection = self._selection(state, inliers, tau)
            if subset is not None:
                now = Explanation(state, subset, float(selection.scores([subset])[0]))
                best = now if best is None or now.score < best.score else best
            chosen = selection.best([g for g in self._distinct[0] if g not in refused])
            promised = selection.score_of(chosen) - HOPELESS * selection.independent
            promised = promised if best is None else best.score
            if chosen in seen or promised > max_score:
                break
            seen.add(chosen)
            state, more = self._fit_plausible(state, chosen, inliers, selection, STEPS)
            left, key = cost(self.model, state, inliers), (state.edits, chosen - more)
            met = visited is not None and np.isclose(visited.get(key, np.inf), left, rtol=EQUAL_FIT)
            if met or selection.score(left, chosen - more) > max_score:
                break
            if visited is not None:
                visited[key] = left
            subset, refused = chosen - more, refused | more
        return best or Explanation(state, subset or frozenset(), np.inf)

    def _fit_plausible(
        self,
        state: State,
        subset: Subset,
        rows: WeightedRows,
        selection: Selection,
        max_steps: int = 2 * STEPS,
    ) -> tuple[State, set[int]]:
        """Fit a subset without the groups that the gate refuses; return the fit and these groups."""
        refused: set[int] = set()
        guess = self._guess(state, subset, selection)
        while True:
            kept = subset - refused
            starts = [state] if guess is None else [state, guess]
            start = min(starts, key=lambda each: cost(self.model, self._keep_only(each, kept), rows))
            fit = self.fit(start, kept, rows, max_steps)
            more = self._find_implausible(fit, kept, rows)
            if not more:
                return fit, refused
            refused |= more
            guess = None

    def _keep_only(self, state: State, subset: Subset) -> State:
        """Set all parameters to 0 except those of a subset and of the groups that are always fitted."""
        values, columns = np.zeros_like(state.values), self._columns([*self.forced, *subset])
        values[columns] = state.values[columns]
        return state._replace(values=values)

    def _guess(self, state: State, subset: Subset, selection: Selection) -> State | None:
        """Return the parameters of a linear fit, if they differ much from those to start from."""
        columns = selection.columns(subset)
        if not columns or state.values[columns].any() or self.usual:
            return None
        values = np.zeros_like(state.values)
        values[columns] = selection.solution(columns)
        return state._replace(values=values) if np.abs(values).max() > NONLINEAR else None

    def _refit(self, fit: SelfConsistentFit, start: State, subset: Subset) -> Explanation:
        """Return another explanation, fitted, and its score at full size."""
        state = self.fit_usual(self.fit(start, subset, fit.rows), subset, fit.rows)
        same_edits = state.edits == fit.state.edits
        selection = fit.selection if same_edits else self._selection(state, fit.rows, fit.tau)
        least = max(cost(self.model, fit.state, fit.rows), np.finfo(float).tiny)
        linear = float(fit.selection.residual_squares([fit.subset])[0])
        left = linear * cost(self.model, state, fit.rows) / least
        return Explanation(state, subset, selection.score(left, subset))

    def fit_usual(self, state: State, subset: Subset, rows: WeightedRows) -> State:
        """Fit what arms usually differ by, damped, together with the parameters of a subset."""
        usual = self._usual_columns(subset)
        if not usual or not (subset or state.edits):
            return state
        undamped = self._columns([*self.forced, *sorted(subset)])
        columns = [*undamped, *(c for c, _ in usual)]
        normal = normal_equations(self.model, state, rows)
        damped = normal.gram[np.ix_(columns, columns)]
        damped += np.diag([*(0.0 for _ in undamped), *(size**-2.0 for _, size in usual)])
        size = np.sqrt(np.maximum(np.diag(damped), np.finfo(float).tiny))
        solved = np.linalg.lstsq(
            damped / size / size[:, np.newaxis], normal.moment[columns] / size, rcond=1e-13
        )
        values = state.values.copy()
        values[columns] = solved[0] / size
        fit = state._replace(values=values)
        return fit if cost(self.model, fit, rows) <= cost(self.model, state, rows) else state

    def _usual_columns(self, subset: Subset) -> list[tuple[int, float]]:
        """Return the columns that arms usually differ by, without those of a subset, each with its size."""
        among = set(self._distinct[0]) - subset
        return [(c, size) for g, size in self.usual.items() if g in among for c in self._columns([g])]

    def _stable(self, rows: WeightedRows, state: State, subset: Subset | None) -> SelfConsistentFit:
        """Return an explanation that is selected again where its fit ends.

        The autocorrelation time is that of the residual: before the fit, the causes themselves would count as
        noise. It only grows from one selection to the next.
        """
        medium = rows._replace(at=self.spread(MEDIUM))
        tau = self._first_tau(self.null._replace(edits=state.edits), medium)
        tau *= len(rows.at) / len(medium.at) if tau > 1.0 else 1.0
        among = list(self._distinct[0])
        for _ in range(ROUNDS):
            inliers = rows.without_outliers(residual(self.model, state, rows.at))
            selection = self._selection(state, inliers, tau)
            chosen = selection.best(among)
            fit, refused = self._fit_plausible(state, chosen, inliers, selection)
            if refused:  # the rest is selected again where all of it is still fitted
                among = [g for g in among if g not in refused]
                chosen -= refused
                continue
            state = self.fit_usual(fit, chosen, inliers)
            if self.timed:
                tau = max(tau, self._tau(state, inliers))
            selection = replace(selection, independent=selection.normal.size / tau)
            if chosen == subset and selection.best(among) == chosen:
                break
            subset = chosen
        kept = selection.moving(chosen)
        if kept != chosen or refused:
            state = self.fit_usual(self.fit(state, kept, inliers), kept, inliers)
        return SelfConsistentFit(state, kept, tau, inliers, selection)

    def _tau(self, state: State, rows: WeightedRows) -> float:
        """Return the autocorrelation time of the residual: the longest, of positions or turns."""
        left = residual(self.model, state, rows.at[:MAX_SAMPLES])
        left = left[:, np.isfinite(left).all(axis=0)]
        of_blocks = (self.model.blocks == block for block in np.unique(self.model.blocks))
        return max(
            autocorrelation_time(left[block].T, float((self.floor[block] ** 2).sum())) for block in of_blocks
        )

    def _find_implausible(self, state: State, subset: Subset, rows: WeightedRows) -> set[int]:
        """Return the groups of a subset whose parameters are implausible; store the refusal."""
        implausible, reason = self._implausible_sizes(state, subset, rows)
        if implausible and reason != CANCELLING and len(subset) > 1 and not state.edits:
            for g in sorted(implausible):  # one of them that alone leaves noise is plausible
                if self._leaves_noise(self.fit(state, frozenset((g,)), rows), rows):
                    return set(subset) - {g}
        if implausible and reason:
            refused = Explanation(state, subset, np.inf)
            self._refused.append(Refusal(refused, reason, subset, state.edits))
        return implausible

    def _implausible_sizes(self, state: State, subset: Subset, rows: WeightedRows) -> tuple[set[int], str]:
        """Return the groups of a subset whose parameters are too large or cancel others, and which."""
        groups = self.model.groups
        sizes = {g: float(np.abs(state.of(groups[g])).max()) for g in subset}
        beyond = {g for g in subset if sizes[g] > MAX_SIZE.get(groups[g].kind, np.inf)}
        if len(subset) + len(state.edits) < 2:
            signs = {g for g in beyond if groups[g].kind == "joint_scale" and state.of(groups[g])[0] <= -1.0}
            signs |= {g for g in beyond if groups[g].kind == "backlash"}
            return (signs if self._leaves_noise(state, rows) else beyond), ""
        if beyond:
            return beyond, ""
        reach = getattr(self.model, "reach", np.inf)
        lengths = {kind: ratio * reach for kind, ratio in MAX_LENGTH_RATIO.items()}
        limits = {**lengths, **MAX_ANGLE_OR_SCALE}
        beyond = {g for g in subset if sizes[g] > limits.get(groups[g].kind, np.inf)}
        return (beyond, TOO_LARGE) if beyond else (self._find_cancelling(state, subset, rows), CANCELLING)

    def _leaves_noise(self, state: State, rows: WeightedRows) -> bool:
        """Return whether an explanation leaves noise, and less than half the square of a larger deviation."""
        left = cost(self.model, state, rows)
        if left > NOISE:
            return False
        return cost(self.model, self.fit_forced(self.null, rows), rows) > max(NOISE, 2.0 * left)

    def _find_cancelling(self, state: State, subset: Subset, rows: WeightedRows) -> set[int]:
        some, groups = rows.thin(GATE_ROWS), self.model.groups
        before = cost(self.model, self.fit_forced(self.null, some), some)
        most = CANCELLING_RATIO**2 * max(before, float(np.mean((self.floor * rows.weight) ** 2)))
        worse = set()
        for g in subset:
            values, columns = np.zeros_like(state.values), list(groups[g].columns)
            values[columns] = state.values[columns]
            if cost(self.model, self.fit_forced(State(values), some), some) > most:
                worse.add(g)
        return {g for g in worse if groups[g].kind in STRUCTURE} or worse

    def _find_changing(self, state: State, subset: Subset, rows: WeightedRows) -> tuple[set[int], Edits]:
        """Return the groups and the discrete causes of a fitted explanation that change during the log.

        The parameter of a discrete cause is 1, and its column the change that it makes.
        """
        model, groups = self.model, [self.model.groups[g] for g in sorted(subset)]
        at = rows.thin(SEGMENT_ROWS).at
        left, jacobian = model.linear(state, at, [*groups, *(model.groups[g] for g in self.forced)])
        known = np.isfinite(left).all(axis=0)
        without = [state._replace(edits=remove_edit(state.edits, edit)) for edit in state.edits]
        changes = [model.residual(each, at) - left for each in without]
        known &= np.isfinite([*changes, left]).all(axis=(0, 1)) & np.isfinite(jacobian).all(axis=(0, 1))
        weight = rows.weight[:, np.newaxis]
        left, jacobian = left[:, known] * weight, jacobian[..., known] * weight
        count = len(jacobian) - sum(len(model.groups[g].columns) for g in self.forced)
        columns = [*jacobian[:count], *(change[:, known] * weight for change in changes)]
        of_groups = [g for g in sorted(subset) for _ in model.groups[g].columns]
        owners = [*of_groups, *(-1 - k for k in range(len(without)))]
        values = np.concatenate([*(state.of(group) for group in groups), np.ones(len(without))])
        forced = jacobian[count:].reshape(-1, left.size) if self.forced else None
        floor = float(np.mean((self.floor * rows.weight) ** 2))
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
            change = size * _changes(left, forced, parts, self.timed, floor)
            for g, clock in zip(owners, clocks, strict=True):
                of_cause = np.array(owners) == g
                ratio = MAX_CLOCK_CHANGE if clock else MAX_CHANGE
                if np.linalg.norm(change[of_cause]) > ratio * np.linalg.norm((values * size)[of_cause]):
                    changing.add(g)
        # the sense of a backlash is a guess at rest
        changing -= {g for g in subset if model.groups[g].kind == "backlash"}
        return {g for g in changing if g >= 0}, tuple(state.edits[-1 - g] for g in changing if g < 0)


def remove_edit(edits: Edits, removed: Edit) -> Edits:
    """Return edits without one of them."""
    return tuple(edit for edit in edits if edit != removed)


def _hats(segments: int, rows: int) -> FloatArray:
    """Return hat functions over rows, whose sum is 1, shape (segments, rows)."""
    at = np.linspace(0.0, segments - 1.0, rows)
    return np.maximum(1.0 - np.abs(at - np.arange(segments)[:, np.newaxis]), 0.0)


def _changes(
    left: FloatArray, forced: FloatArray | None, parts: Sequence[FloatArray], timed: bool, floor: float
) -> FloatArray:
    """Return the rms changes of parameters over the segments, shape (k,); 0 if they are not significant.

    Args:
        left: Residual in weights of the noise [-], shape (c, n).
        forced: Columns of the parameters that are always fitted, shape (p, c n); None without any.
        parts: Columns of each parameter in its segments, shape (segments, c n) each.
        timed: Whether the rows have times.
        floor: Negligible mean square.
    """
    columns = np.concatenate([*parts, *([] if forced is None else [forced])])
    scale = np.sqrt(np.maximum((columns**2).sum(axis=1), np.finfo(float).tiny))
    columns = columns / scale[:, np.newaxis]
    solved = np.linalg.lstsq(columns @ columns.T, columns @ left.ravel(), rcond=1e-9)[0]
    after = left - (solved @ columns).reshape(left.shape)
    tau = autocorrelation_time(after.T) if timed else 1.0
    noise = max(float((after**2).sum()), floor * left.size)
    added = sum(len(part) - 1 for part in parts)
    gain = (float((left**2).sum()) - float((after**2).sum())) / added
    free = max(left.size / tau - len(columns), 1.0)
    if gain < (1.0 + SIGNIFICANT * np.sqrt(2.0 / added)) * noise / free:
        return np.zeros(len(parts))
    changes, first, values = [], 0, solved / scale
    for part in parts:
        in_segments, weight = values[first : first + len(part)], (part**2).sum(axis=1)
        weight = weight / max(float(weight.sum()), np.finfo(float).tiny)
        changes.append(float(np.sqrt(weight @ (in_segments - weight @ in_segments) ** 2)))
        first += len(part)
    return np.array(changes)
