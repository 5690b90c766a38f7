"""The reported causes of a search: in order, with intervals, equivalents, and what would decide.

1. Causes are ordered: those that are decided, then the others; of each clocks first, then what reduces the
   rms most after those before it.
2. Each parameter has a 95 % interval in correlated noise: student_quantile sqrt(diag C), with C of
   `fit.batch_covariance`.
3. Rows that no explanation fits are outliers, a separate cause, and are left out.
4. Equivalent causes do exactly the same; rivals differ by less than the noise: these stay undecided.
5. The joint whose motion would decide separates two explanations most (`most_discriminating_joint`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray, map_blocks, row_blocks
from urmpipe_pipeline.diagnosis.cause_texts import short_name
from urmpipe_pipeline.diagnosis.causes import (
    CLOCKS,
    NOT_CONSTANT,
    Alternative,
    Cause,
    UnidentifiableCauses,
    rms,
)
from urmpipe_pipeline.diagnosis.explanations import COARSE, MAX_SIZE, Explanation, SearchResult
from urmpipe_pipeline.diagnosis.fit import (
    BLOCK,
    batch_covariance,
    cost,
    deviation,
    find_inliers,
    student_quantile,
)
from urmpipe_pipeline.diagnosis.hypotheses import Group, Model, State
from urmpipe_pipeline.diagnosis.models import ArmModel, JointModel
from urmpipe_pipeline.diagnosis.motion import Clock, Motion
from urmpipe_pipeline.diagnosis.search import Search
from urmpipe_pipeline.diagnosis.selection import EQUIVALENT
from urmpipe_pipeline.runs.reading_errors import Edit, Edits

ORDERING_ROWS = 1_000  # evenly spaced, on which the order of causes is determined
FORCED_ROWS = 4_000  # evenly spaced, on which the groups that are always fitted are fitted again
SWEEP_ROWS = 120  # poses from which joints are moved to separate two explanations
FRAMES = {"tool_shift", "tool_rotation", "base_shift", "base_rotation"}
RATES = (*CLOCKS, "servo_lag", "joint_lag", "compliance", "backlash")  # jump or grow where the arm turns back

MIN_OUTLIER_EFFECT = 1.2  # rms of all rows over that of the others
MIN_OUTLIER_STEP = 0.5  # fraction of an interval's largest outlier by which it begins and ends
MIN_OUTLIER_SIZE = 2.0  # median of the outliers over the largest other deviation
ALIGNED = (
    0.9  # fraction of the square of outliers in the direction of what `RATES` change: they are no outliers
)
MIN_OUTLIER_TO_RATES = 3.0  # largest outlier over the largest change by `RATES`
SIMILAR = 0.9  # ratio of two numbers from which on one is shown for both
EQUAL_RESIDUAL = 0.01  # of the noise floor, rms: difference of two explanations that are the same

REVOLUTE_RANGE = 1.5  # [rad]: each joint is moved by up to this amount in both directions
PRISMATIC_RANGE = REVOLUTE_RANGE / 5.0  # [m]
MIN_GAIN = 2.0  # a joint decides if its motion separates the explanations this much more than the log
INVERSE_GOLDEN_RATIO = 0.6180339887498949  # fractional parts of its multiples fill [0, 1) evenly


@dataclass(frozen=True)
class Part:
    """One cause of an explanation: a discrete one, the parameters of a group, or rows that are left out.

    Attributes:
        edit: The discrete cause; None for others.
        group: Index of the group; -1 for others.
        rows: Indices of the rows among those compared.
        usual: Columns that arms usually differ by, all of them one cause; empty for others.
    """

    edit: Edit | None = None
    group: int = -1
    rows: tuple[int, ...] = ()
    usual: tuple[int, ...] = field(default=(), compare=False)


@dataclass(frozen=True, eq=False)
class ExplanationBuilder:
    """The result of a search as causes.

    Attributes:
        search: The search.
        result: Its result.
        log_joints: Names of the joints by the log.
        arm_joints: Names of the joints by the arm.
        exceeds_tolerance: Returns whether a deviation in [m] or [rad], shape (k, n), is out of tolerance, of
            joints or of positions, along the path or not.
    """

    search: Search
    result: SearchResult
    log_joints: tuple[str, ...]
    arm_joints: tuple[str, ...]
    exceeds_tolerance: Callable[[FloatArray, bool, bool], bool]
    _deviations: dict[tuple[bytes, Edits], FloatArray] = field(default_factory=dict)
    _covariances: dict[object, tuple[FloatArray, int]] = field(default_factory=dict)

    @property
    def model(self) -> Model:
        """The model."""
        return self.search.model

    @cached_property
    def state(self) -> State:
        """The explanation that is reported."""
        best = self.result.best
        return best.state if best.subset or best.state.edits else self.search.null

    @cached_property
    def outliers(self) -> Part | None:
        """The rows that the best explanation does not fit, if they matter; None without any."""
        left = self._deviation(self.state)
        least = float(np.linalg.norm(self.search.floor[: len(left)]))
        known = np.isfinite(left).all(axis=0)
        far = np.flatnonzero(known & ~find_inliers(left, least))
        if not len(far) or len(far) == known.sum():
            return None
        size = np.sqrt((left**2).sum(axis=0))
        rest = np.setdiff1d(np.flatnonzero(known), far)
        matters = rms(left.T) >= MIN_OUTLIER_EFFECT * rms(left[:, rest].T)
        if not matters and not self._is_out(left[:, far]):
            return None
        if self.search.timed and not _begin_abruptly(left, size, far):
            return None
        if np.median(size[far]) < MIN_OUTLIER_SIZE * size[rest].max():
            return None
        by_rates = self._change_by_rates()
        length = np.sqrt((by_rates**2).sum(axis=0))
        along = (left * by_rates).sum(axis=0)[far] / np.maximum(length[far], np.finfo(float).tiny)
        is_aligned = (along**2).sum() > ALIGNED * (size[far] ** 2).sum()
        largest = float(np.nanmax(length, initial=0.0))
        if is_aligned or float(size[far].max()) < MIN_OUTLIER_TO_RATES * largest:
            return None
        return Part(rows=tuple(far.tolist()))

    def _change_by_rates(self) -> FloatArray:
        """Return the deviation due to causes that change with the rates of joints, shape (k, n)."""
        values = self.state.values.copy()
        rates = [g for g in self.result.best.subset if self.model.groups[g].kind in RATES]
        values[self._columns(rates)] = 0.0
        return self._deviation(self.state) - self._deviation(self.state._replace(values=values))

    def causes(self) -> tuple[tuple[Cause, ...], tuple[Alternative, ...]]:
        """Return the named causes in order, and the alternatives that the log does not decide between."""
        best = self.result.best
        significant = (rival for rival in self.result.rivals if self._is_significant(rival))
        rivals, equivalents = self._split_equivalents(best, significant)
        common = set.intersection(*(set(self._parts(explanation)) for explanation in rivals))
        common = {part for part in common if all(self._has_same_size(part, rival) for rival in rivals)}
        named = self._causes(best, common, equivalents)[: len(common)]
        if len(rivals) == 1:
            return named, ()
        needs = self._needs(rivals)
        alternatives = (self._causes(explanation, common, {})[len(common) :] for explanation in rivals)
        return named, tuple(Alternative(causes, needs) for causes in alternatives)

    def _has_same_size(self, part: Part, other: Explanation) -> bool:
        """Return whether a cause has the same size in the best and in another explanation, if it has any."""
        if part.group < 0:
            return True
        best, group = self.result.best, self.model.groups[part.group]
        values, other_values = best.state.of(group), other.state.of(group)
        reach = self._half_width(best, part.group) + self._half_width(other, part.group)
        allowed = np.maximum(reach, (1.0 - SIMILAR) * np.abs(values))
        return bool((np.abs(values - other_values) <= allowed).all())

    def insignificant(self) -> set[int]:
        """Return the groups of the best explanation whose intervals all contain 0."""
        best = self.result.best
        return {g for g in best.subset if not self._has_significant(best, g)}

    def _is_significant(self, explanation: Explanation) -> bool:
        return all(self._has_significant(explanation, g) for g in explanation.subset)

    def _has_significant(self, explanation: Explanation, g: int) -> bool:
        """Return whether a group has a parameter whose interval does not contain 0."""
        sizes = np.abs(explanation.state.of(self.model.groups[g]))
        return bool((sizes > self._half_width(explanation, g)).any())

    def explains(self, fraction: float) -> bool:
        """Return whether causes remove a fraction of the rms of all that was fitted, or break a tolerance."""
        rows, nothing = self.result.rows, self._only(self.search.null, ())
        left = cost(self.model, self.state, rows)
        if self.outliers is not None or left < (1.0 - fraction) ** 2 * cost(self.model, nothing, rows):
            return True
        return self._is_out(self.before - self._deviation(self.state))

    def _is_out(self, change: FloatArray, along: bool = False) -> bool:
        return self.exceeds_tolerance(change, self.model.of_joints, along)

    def _breaks_a_tolerance(self, part: Part, change: FloatArray, without: State) -> bool:
        """Return whether a cause alone is out of tolerance, as the deviation is judged or by joints."""
        if self._is_out(change, self._kind(part) in CLOCKS):
            return True
        if not isinstance(self.model, JointModel) or self.model.of_joints or part.rows:
            return False
        rows = self.search.spread(ORDERING_ROWS)
        before = self.model.residual(self.search.null, rows)
        return self.exceeds_tolerance(before - self.model.residual(without, rows), True, False)

    def refused(self) -> tuple[UnidentifiableCauses, ...]:
        """Return what the gate refused though it leaves less, with the rms before and after its causes."""
        rows = self.search.spread(ORDERING_ROWS)
        before, refusals = self._rms_without(self.search.null, (), rows), list[UnidentifiableCauses]()
        for explanation, reason, subset, edits in self.result.refused:
            fit = self.search.fit_forced(explanation.state, self.result.rows)
            after = rms(self.model.deviation(fit, rows).T)
            parts = [*map(Part, edits), *(Part(group=g) for g in sorted(subset))]
            causes = (self._cause_of(part, explanation, 0.0, ()) for part in parts)
            changed = tuple(replace(cause, rms_before=before, rms_after=after) for cause in causes)
            is_changing = reason == NOT_CONSTANT  # no other motion makes it constant
            needs = "" if is_changing else self._needs([explanation, self.result.best])
            refusals.append(UnidentifiableCauses(changed, reason, needs))
        return tuple(refusals)

    def after(self) -> FloatArray:
        """Return the deviation that is left in [m] or [rad], shape (k, n); NaN for outliers."""
        left = self._deviation(self.state)
        if self.outliers is not None:
            left = left.copy()
            left[:, list(self.outliers.rows)] = np.nan
        return left

    def _split_equivalents(
        self, best: Explanation, candidates: Iterable[Explanation]
    ) -> tuple[list[Explanation], dict[Part, list[str]]]:
        """Return the explanations with different effects, and the equivalents of the best's causes."""
        rivals, equivalents = [best], dict[Part, list[str]]()
        of_best = set(self._parts(best))
        rows = self.result.rows._replace(at=self.search.spread(COARSE))
        for rival in candidates:
            of_rival = set(self._parts(rival))
            removed, added = of_best - of_rival, of_rival - of_best
            same_kinds = self._are_of_same_frames(removed, added)
            if same_kinds and self.search.is_equivalent(best.state, rival.state, rows):
                continue
            if len(removed) == len(added) == 1 and self._same_effect(best.state, rival.state, rows.at):
                (part,), (other,) = removed, added
                if other.group < 0 or self._is_usual_size(other.group, rival.state):
                    equivalents.setdefault(part, []).append(self._short_name(other))
            else:
                rivals.append(rival)
        return rivals, equivalents

    def _are_of_same_frames(self, first: set[Part], second: set[Part]) -> bool:
        """Return whether causes are of the same kinds of frames: a base turned by an edit or a parameter."""
        kinds = [sorted(self._kind(part) for part in parts) for parts in (first, second)]
        return kinds[0] == kinds[1] and {*kinds[0]} <= FRAMES

    def _same_effect(self, first: State, second: State, rows: IntArray) -> bool:
        """Return whether the residuals of two explanations differ by a negligible fraction of the floor."""
        residuals = [self.model.residual(state, rows) for state in (first, second)]
        between = (residuals[0] - residuals[1]) / self.search.floor[:, np.newaxis]
        known = np.isfinite(between).all(axis=0)
        return bool(known.any() and np.sqrt(np.mean(between[:, known] ** 2)) < EQUAL_RESIDUAL)

    def _parts(self, explanation: Explanation) -> list[Part]:
        """Return the causes of an explanation: rows, what is usual, edits, then groups."""
        usual = self._usual_columns(explanation)
        return [
            *([] if self.outliers is None else [self.outliers]),
            *([Part(usual=usual)] if usual else []),
            *map(Part, explanation.state.edits),
            *(Part(group=g) for g in sorted(explanation.subset)),
        ]

    def _causes(
        self, explanation: Explanation, common: set[Part], equivalents: dict[Part, list[str]]
    ) -> tuple[Cause, ...]:
        """Return the causes of an explanation: those that all explanations have, then the others.

        Of both clocks first, then what reduces the rms most after those before it.
        """
        rest, order = self._parts(explanation), list[Part]()
        few = self.search.spread(ORDERING_ROWS)
        if self.outliers is not None:
            few = np.union1d(few, self.outliers.rows)
        while rest:
            next_parts = [part for part in rest if part in common] or rest
            next_parts = [part for part in next_parts if self._kind(part) in CLOCKS] or next_parts
            left = {part: self._rms_without(explanation.state, [*order, part], few) for part in next_parts}
            order.append(min(left, key=lambda part: left[part]))
            rest.remove(order[-1])
        after = [self._rms_without(explanation.state, order[:k]) for k in range(len(order) + 1)]
        before = self.before
        causes = []
        for k, part in enumerate(order):
            without = self._only(explanation.state, (part,))
            change = before[:, list(part.rows)] if part.rows else before - self._deviation(without)
            effect = float(np.nanmax(self._sizes(change), initial=0.0))
            causes.append(
                replace(
                    self._cause_of(part, explanation, effect, equivalents.get(part, ())),
                    rms_before=after[k], rms_after=after[k + 1],
                    rms_alone=self._rms_without(explanation.state, (part,)),
                    effect=effect, exceeds_tolerance=self._breaks_a_tolerance(part, change, without),
                )
            )  # fmt: skip
        return tuple(causes)

    def _sizes(self, change: FloatArray) -> FloatArray:
        """Return the sizes of deviations: of positions a distance, of joints the largest component."""
        if self.model.of_joints:
            return np.asarray(np.abs(change).max(axis=0))
        return np.asarray(np.sqrt((change**2).sum(axis=0)))

    def _cause_of(
        self, part: Part, explanation: Explanation, effect: float, equivalents: Sequence[str]
    ) -> Cause:
        """Return a cause without the rms that it changes."""
        if part.rows:
            rows = tuple(self.model.sample[list(part.rows)].tolist())
            sizes = self._sizes(self.before[:, list(part.rows)])
            least = float(np.nanmin(sizes, initial=effect))
            value = (effect,) if least > SIMILAR * effect else (least, effect)
            return Cause("outliers", "rows", rows=rows, value=value, unit=self.model.unit)
        if part.usual:
            return Cause("own_geometry", "arm")
        cause = self._cause_of_edit(part.edit) if part.edit else self._cause_of_group(part.group, explanation)
        names = (*cause.equivalents, *(name for name in equivalents if name not in cause.equivalents))
        return replace(cause, equivalents=names)

    def _usual_columns(self, explanation: Explanation) -> tuple[int, ...]:
        """Return the columns that arms usually differ by, if they were fitted together with a cause."""
        columns = self._columns(set(self.search.usual) - explanation.subset)
        return tuple(c for c in columns if explanation.state.values[c])

    def _kind(self, part: Part) -> str:
        if part.rows or part.usual:
            return "outliers" if part.rows else "own_geometry"
        return part.edit.kind if part.edit else self.model.groups[part.group].kind

    def _rms_without(self, state: State, removed: Sequence[Part], rows: IntArray | None = None) -> float:
        """Return the root mean square deviation of rows when some causes of an explanation are removed."""
        left_out = [row for part in removed for row in part.rows]
        only = self._only(state, removed)
        if rows is not None:
            return rms(self.model.deviation(only, np.setdiff1d(rows, left_out)).T)
        left = self._deviation(only)
        return rms(np.delete(left, left_out, axis=1).T if left_out else left.T)

    @property
    def before(self) -> FloatArray:
        """The deviation before any cause is removed, of all rows, in [m] or [rad], shape (k, n)."""
        return self._deviation(self._only(self.search.null, ()))

    def _deviation(self, state: State) -> FloatArray:
        """Return the deviation of all rows, in [m] or [rad], shape (k, n); computed once per state."""
        key = state.values.tobytes(), state.edits
        if key not in self._deviations:
            self._deviations[key] = deviation(self.model, state)
        return self._deviations[key]

    def _only(self, state: State, kept: Iterable[Part]) -> State:
        """Remove all causes of an explanation except some; fit the groups that are always fitted again."""
        kept = set(kept)
        groups = [*self.search.forced, *(part.group for part in kept if part.group >= 0)]
        columns = [*self._columns(groups), *(c for part in kept for c in part.usual)]
        values = np.zeros_like(state.values)
        values[columns] = state.values[columns]
        edits = tuple(edit for edit in state.edits if Part(edit) in kept)
        return self.search.fit_forced(State(values, edits), self.result.rows.thin(FORCED_ROWS))

    def _cause_of_edit(self, edit: Edit) -> Cause:
        joints = tuple(self.log_joints[j] for j in edit.joints)
        name = edit.name or " and ".join(self.arm_joints[j] for j in edit.joints)
        if edit.kind == "base_rotation":
            axis, angle = edit.axis_angle
            if sum(axis) < 0.0:  # 90 deg about -x is -90 deg about x
                axis, angle = (-axis[0] + 0.0, -axis[1] + 0.0, -axis[2] + 0.0), -angle
            return Cause(edit.kind, name, axis=axis, value=(angle,), unit="rad")
        value = (edit.value,) if edit.kind in ("path_unit", "joint_unit", "joint_coupled", "turns") else ()
        unit = "turns" if edit.kind == "turns" else ""
        if edit.kind == "half_turn" and isinstance(self.model, JointModel):  # positions show no sense
            value, unit = (edit.value * np.pi,), "rad"
        first = edit.first if edit.kind in ("half_turn", "mirrored", "turns") and edit.first else None
        return Cause(edit.kind, name, joints, value=value, unit=unit, from_sample=first)

    def _cause_of_group(self, g: int, explanation: Explanation) -> Cause:
        """Return a cause of some size, with its interval and its equivalents."""
        group = self.model.groups[g]
        values, reach = explanation.state.of(group), self._half_width(explanation, g)
        nominal = 1.0 if group.kind == "joint_scale" else 0.0
        low, middle, high = (
            tuple((nominal + part).tolist()) for part in (values - reach, values, values + reach)
        )
        names = tuple(dict.fromkeys(self._iter_equivalents(g, explanation.state)))
        return replace(self._without_size(group), value=middle, low=low, high=high, equivalents=names)

    def _without_size(self, group: Group) -> Cause:
        """Return the cause of a group without its parameters."""
        joints = () if group.joint is None else (self.log_joints[group.joint],)
        name = group.name if group.joint is None else self.arm_joints[group.joint]
        return Cause(group.kind, name, joints, group.segment, group.axis, unit=group.unit)

    def _short_name(self, part: Part) -> str:
        """Return the name of a cause in a list of equivalents."""
        if part.rows:
            return "outliers"
        return short_name(
            self._cause_of_edit(part.edit) if part.edit else self._without_size(self.model.groups[part.group])
        )

    def _half_width(self, explanation: Explanation, g: int) -> FloatArray:
        """Return half the 95 % interval of a group's parameters, all of the explanation fitted together.

        By batch means in correlated noise, not below what noise of the floor would cause.
        """
        columns = self._columns(explanation.subset)
        covariance, free = self._covariance(explanation)
        at = [columns.index(c) for c in self.model.groups[g].columns]
        return np.asarray(student_quantile(free) * np.sqrt(np.maximum(np.diag(covariance)[at], 0.0)))

    def _columns(self, groups: Iterable[int]) -> list[int]:
        return [c for g in sorted(groups) for c in self.model.groups[g].columns]

    def _covariance(self, explanation: Explanation) -> tuple[FloatArray, int]:
        """Return the covariance of the parameters of an explanation, and its degrees of freedom."""
        key = explanation.key
        if key not in self._covariances:
            self._covariances[key] = self._estimate_covariance(explanation)
        return self._covariances[key]

    def _estimate_covariance(self, explanation: Explanation) -> tuple[FloatArray, int]:
        fitted = explanation.subset | set(self.search.forced)
        rows, groups = self.result.rows, [self.model.groups[g] for g in sorted(fitted)]
        columns = self._columns(fitted)

        def scores_of(block: slice) -> tuple[FloatArray, FloatArray]:
            left, jacobian = self.model.linear(explanation.state, rows.at[block], groups)
            known = np.isfinite(left).all(axis=0)
            left, jacobian = (part[..., known] * rows.weight[:, np.newaxis] for part in (left, jacobian))
            flat = jacobian.reshape(len(columns), -1)
            return np.einsum("pcn,cn->np", jacobian, left), flat @ flat.T

        parts = map_blocks(scores_of, row_blocks(len(rows.at), BLOCK))
        scores, gram = np.concatenate([part[0] for part in parts]), sum(part[1] for part in parts)
        size = np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
        inverse = np.linalg.pinv(gram / size / size[:, np.newaxis], rcond=1e-12, hermitian=True)
        inverse = inverse / size / size[:, np.newaxis]
        tau = self.result.tau if self.search.timed else 1.0
        omega, free = batch_covariance(scores - scores.mean(axis=0), tau)
        floor = float(np.mean((self.search.floor * rows.weight) ** 2))
        covariance = inverse @ omega @ inverse + floor * inverse
        at = np.searchsorted(columns, self._columns(explanation.subset))
        return covariance[np.ix_(at, at)], free

    def _iter_equivalents(self, g: int, state: State) -> Iterator[str]:
        """Yield the names of causes with exactly the effect of a group, or of one of its three parameters."""
        groups, group = self.model.groups, self.model.groups[g]
        for h, other in enumerate(groups):
            representative = self.result.representatives.get(h)
            if representative is None:
                is_distinct = len(group.columns) == len(other.columns) == 1
            else:
                is_distinct = not groups[representative].is_of_frame(group)
            if is_distinct or other.is_of_frame(group):
                continue
            for k, c in enumerate(group.columns):
                axis = f" ({'xyz'[k]})" if len(group.columns) > 1 else ""
                if len(other.columns) > 1:  # its single axes are separate groups
                    continue
                (d,) = other.columns
                is_candidate = representative == g or self._is_parallel(c, d)
                if state.values[c] and is_candidate and self._is_exchangeable(state, c, d):
                    yield f"{short_name(self._without_size(other))}{axis}"

    def _is_exchangeable(self, state: State, c: int, d: int) -> bool:
        """Return whether a parameter in place of another leaves the same at its full size."""
        other = self.search.exchange(state, c, d, self.result.normal.gram)
        some = self.result.rows._replace(at=self.search.spread(COARSE))
        (h,) = (h for h, group in enumerate(self.model.groups) if group.columns == (d,))
        return self._is_usual_size(h, other) and self.search.is_equivalent(state, other, some)

    def _is_usual_size(self, g: int, state: State) -> bool:
        """Return whether a parameter is small enough for its kind: no backlash has half a turn."""
        group = self.model.groups[g]
        return bool(np.abs(state.of(group)).max() <= MAX_SIZE.get(group.kind, np.inf))

    def _is_parallel(self, c: int, d: int) -> bool:
        """Return whether two columns have one direction."""
        gram = self.result.normal.gram
        size = float(np.sqrt(max(gram[c, c], 0.0) * max(gram[d, d], 0.0)))  # rounding may leave less than 0
        return size > 0.0 and 1.0 - abs(float(gram[c, d])) / size < EQUIVALENT

    def _needs(self, explanations: Sequence[Explanation]) -> str:
        """Return the joint whose motion would decide between explanations; empty if none would."""
        joints = {j for explanation in explanations for j in self._joints_of(explanation)}
        if len(joints) == 1:
            (only,) = joints
            return "" if only is None else self.arm_joints[only]
        if not isinstance(self.model, ArmModel):
            return ""
        first, second = (explanation.state for explanation in explanations[:2])
        joint = most_discriminating_joint(self.model, first, second, self.search.spread(SWEEP_ROWS))
        return "" if joint is None else self.arm_joints[joint]

    def _joints_of(self, explanation: Explanation) -> set[int | None]:
        """Return the joints that an explanation changes, with None if a part of it changes no joint."""
        of_edits: set[int | None] = {j for edit in explanation.state.edits for j in edit.joints}
        return of_edits | {self.model.groups[g].joint for g in explanation.subset}


def _begin_abruptly(left: FloatArray, size: FloatArray, far: IntArray) -> bool:
    """Return whether each interval of rows begins and ends with a step of a large fraction of its size."""
    for interval in np.split(far, np.flatnonzero(np.diff(far) > 1) + 1):
        largest = float(size[interval].max())
        for inside, outside in ((interval[0], interval[0] - 1), (interval[-1], interval[-1] + 1)):
            if 0 <= outside < left.shape[1] and np.isfinite(size[outside]):
                step = float(np.linalg.norm(left[:, inside] - left[:, outside]))
                if step < MIN_OUTLIER_STEP * min(largest, float(size[inside])):
                    return False
    return True


def most_discriminating_joint(model: ArmModel, first: State, second: State, rows: IntArray) -> int | None:
    """Return the joint whose motion separates two explanations most, or None if no joint separates them.

    Args:
        model: The model.
        first: An explanation.
        second: Another explanation.
        rows: Rows from whose poses each joint is moved in turn, shape (n,).
    """
    moved_rows = np.arange(len(rows))
    joints = range(len(model.chain.moving))
    separations = [_separation(_move_joint(model, j, rows), first, second, moved_rows) for j in joints]
    best = int(np.argmax(separations))
    return best if separations[best] > MIN_GAIN * _separation(model, first, second, rows) else None


def _separation(model: ArmModel, first: State, second: State, rows: IntArray) -> float:
    """Return the rms distance in [m] between the tool centre points of two explanations."""
    return rms((model.deviation(first, rows) - model.deviation(second, rows)).T)


def _move_joint(model: ArmModel, j: int, rows: IntArray) -> ArmModel:
    """Return the model at some rows, with joint j moved over its range in quasi-random order."""
    q = model.motion.at(model.clock.t[rows])[0].copy()
    reach = PRISMATIC_RANGE if model.chain.moving[j].kind == "prismatic" else REVOLUTE_RANGE
    q[j] += reach * (2.0 * np.modf(np.arange(len(rows)) * INVERSE_GOLDEN_RATIO)[0] - 1.0)
    t, zeros = np.arange(len(rows), dtype=float), np.zeros_like(q)
    rotation = None if model.rotation is None else model.rotation[:, :, rows]
    return replace(
        model, motion=Motion(t, q, zeros, zeros), clock=Clock(t, -1.0, t), sample=model.sample[rows],
        position=model.position[:, rows], rotation=rotation, judged=None,
    )  # fmt: skip
