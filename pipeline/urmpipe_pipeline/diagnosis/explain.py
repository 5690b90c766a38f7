"""What an explanation is worth: its causes in order, their sizes with intervals, twins, what would decide.

1. Causes are ordered: those that are decided, then the others; of each clocks first, then what takes the
   most away after those before it.
2. Each number has a 95 % interval that knows the correlation of the noise (intervals.py).
3. Rows that no explanation fits are a cause of their own, and left out.
4. Twins do exactly the same; rivals differ by less than the noise: these stay undecided.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray, map_blocks, row_blocks
from urmpipe_pipeline.diagnosis.cause_texts import short_name
from urmpipe_pipeline.diagnosis.causes import CLOCKS, NOT_CONSTANT, Alternative, Cause, Refused, rms
from urmpipe_pipeline.diagnosis.explanations import COARSE, Explanation, SearchResult
from urmpipe_pipeline.diagnosis.fit import (
    BLOCK,
    Model,
    batch_covariance,
    cost,
    deviation,
    inliers,
    student_quantile,
)
from urmpipe_pipeline.diagnosis.hypotheses import Group, State
from urmpipe_pipeline.diagnosis.models import ArmModel, JointsModel
from urmpipe_pipeline.diagnosis.motion import Clock, Motion
from urmpipe_pipeline.diagnosis.search import Search
from urmpipe_pipeline.diagnosis.selection import LARGEST, TWIN
from urmpipe_pipeline.runs.reading_errors import Edit, Edits

ORDERED = 1_000  # rows, spread evenly, on which the order of causes is found
PLACED = 4_000  # rows, spread evenly, on which what is always fitted follows
SWEPT = 120  # poses on which the joint is found whose motion tells two explanations apart
ABRUPT = 0.5  # share of its size by which a stretch of outliers begins and ends from one row to the next
SEVERAL = 1.2  # outliers are a cause if all rows have so many times the rms of the others
RATES = (*CLOCKS, "servo_lag", "joint_lag", "compliance", "backlash")
APART = 2.0  # times the largest other deviation that the median of outliers is
ALONG = 0.9  # share of the square of outliers that points along what such a cause changes: it is no outlier
ABOUT = 0.9  # share of a number that another one has at least, if one of them is shown for both
UNLIKE = 3.0  # outliers are so many times larger than what causes do that change with the rates of joints


@dataclass(frozen=True)
class Part:
    """One cause of an explanation: a discrete one, the numbers of a group, or rows that are left out.

    Attributes:
        edit: The discrete cause; None of others.
        group: Place of the group; -1 of others.
        rows: Places of the rows among those compared.
        usual: Places of the numbers that arms usually differ by, all of them one cause; none of others.
    """

    edit: Edit | None = None
    group: int = -1
    rows: tuple[int, ...] = ()
    usual: tuple[int, ...] = field(default=(), compare=False)


@dataclass(frozen=True, eq=False)
class ExplanationBuilder:
    """What a search found, in the words of the result.

    Attributes:
        search: What was looked for.
        found: What was found.
        names: What the log calls its joints.
        own_names: What the arm calls them.
        breaks: Tells whether a deviation in [m] or [rad], shape (k, n), is out of tolerance, of joints or of
            positions, along the path or not.
    """

    search: Search
    result: SearchResult
    names: tuple[str, ...]
    own_names: tuple[str, ...]
    breaks: Callable[[FloatArray, bool, bool], bool]
    _deviations: dict[tuple[bytes, Edits], FloatArray] = field(default_factory=dict)
    _covariances: dict[object, tuple[FloatArray, int]] = field(default_factory=dict)

    @property
    def model(self) -> Model:
        """The side that is modelled, with its data."""
        return self.search.model

    @cached_property
    def state(self) -> State:
        """The explanation that is reported."""
        best = self.result.best
        return best.state if best.subset or best.state.edits else self.search.zero

    @cached_property
    def outliers(self) -> Part | None:
        """The rows that the best explanation leaves far off, if they matter; None without any."""
        left = self._deviation(self.state)
        least = float(np.linalg.norm(self.search.floor[: len(left)]))
        known = np.isfinite(left).all(axis=0)
        far = np.flatnonzero(known & ~inliers(left, least))
        if not len(far) or len(far) == known.sum():
            return None
        size = np.sqrt((left**2).sum(axis=0))
        rest = np.setdiff1d(np.flatnonzero(known), far)
        if rms(left.T) < SEVERAL * rms(left[:, rest].T) and not self._is_out(left[:, far]):
            return None
        if self.search.timed and not _begin_abruptly(left, size, far):
            return None
        if np.median(size[far]) < APART * size[rest].max():
            return None
        made = self._made_by_rates()
        length = np.sqrt((made**2).sum(axis=0))
        along = (left * made).sum(axis=0)[far] / np.maximum(length[far], np.finfo(float).tiny)
        alike = (along**2).sum() > ALONG * (size[far] ** 2).sum()
        if alike or float(size[far].max()) < UNLIKE * float(np.nanmax(length, initial=0.0)):
            return None
        return Part(rows=tuple(far.tolist()))

    def _made_by_rates(self) -> FloatArray:
        """Return what causes change that jump or grow where the arm turns back or is pushed, shape (k, n)."""
        values = self.state.values.copy()
        rates = [g for g in self.result.best.subset if self.model.groups[g].kind in RATES]
        values[self._columns(rates)] = 0.0
        return self._deviation(self.state) - self._deviation(replace(self.state, values=values))

    def causes(self) -> tuple[tuple[Cause, ...], tuple[Alternative, ...]]:
        """Return the named causes in order, and the alternatives that the log does not decide between."""
        best = self.result.best
        every = [best, *(explanation for explanation in self.result.others if self._relevant(explanation))]
        rivals, twins = self._without_twins(every)
        common = set.intersection(*(set(self._parts(explanation)) for explanation in rivals))
        common = {part for part in common if all(self._is_same_number(part, other) for other in rivals)}
        named = self._causes(best, common, twins)[: len(common)]
        if len(rivals) == 1:
            return named, ()
        needs = self._needs(rivals)
        alternatives = (self._causes(explanation, common, {})[len(common) :] for explanation in rivals)
        return named, tuple(Alternative(causes, needs) for causes in alternatives)

    def _is_same_number(self, part: Part, other: Explanation) -> bool:
        """Tell whether a cause has the same numbers in the best explanation and in another, if it has any."""
        if part.group < 0:
            return True
        best, group = self.result.best, self.model.groups[part.group]
        mine, theirs = best.state.of(group), other.state.of(group)
        reach = self._half_width(best, part.group) + self._half_width(other, part.group)
        return bool((np.abs(mine - theirs) <= np.maximum(reach, (1.0 - ABOUT) * np.abs(mine))).all())

    def insignificant(self) -> set[int]:
        """Return the groups of the best explanation with intervals that all contain 0."""
        best = self.result.best
        return {g for g in best.subset if not self._is_significant(best, g)}

    def _is_significant(self, explanation: Explanation, g: int) -> bool:
        numbers = np.abs(explanation.state.of(self.model.groups[g]))
        return bool((numbers > self._half_width(explanation, g)).any())

    def explains(self, share: float) -> bool:
        """Tell whether causes take a share of the rms of all that was fitted away, or break a tolerance."""
        rows, nothing = self.result.rows, self._only(self.search.zero, ())
        left = cost(self.model, self.state, rows)
        if self.outliers is not None or left < (1.0 - share) ** 2 * cost(self.model, nothing, rows):
            return True
        return self._is_out(self.before - self._deviation(self.state))

    def _is_out(self, made: FloatArray, along: bool = False) -> bool:
        return self.breaks(made, self.model.of_joints, along)

    def _breaks_a_tolerance(self, part: Part, made: FloatArray, mended: State) -> bool:
        """Tell whether a cause alone breaks a tolerance, of what is judged or of joints."""
        if self._is_out(made, self._kind(part) in CLOCKS):
            return True
        if not isinstance(self.model, JointsModel) or self.model.of_joints or part.rows:
            return False
        rows = self.search.spread(ORDERED)
        nothing = self.model.residual(self.search.zero, rows)
        return self.breaks(nothing - self.model.residual(mended, rows), True, False)

    def refused(self) -> tuple[Refused, ...]:
        """Return what the gate refused though it leaves less, each with the rms before and after all."""
        rows = self.search.spread(ORDERED)
        before, refusals = self._left(self.search.zero, (), rows), list[Refused]()
        for explanation, reason, subset, edits in self.result.refused:
            after = rms(self.model.deviation(self.search.placed(explanation.state, self.result.rows), rows).T)
            parts = [*map(Part, edits), *(Part(group=g) for g in sorted(subset))]
            causes = (self._of_part(part, explanation, 0.0, ()) for part in parts)
            changed = tuple(replace(cause, rms_before=before, rms_after=after) for cause in causes)
            changes = reason == NOT_CONSTANT  # no other motion makes it constant
            needs = "" if changes else self._needs([explanation, self.result.best])
            refusals.append(Refused(changed, reason, needs))
        return tuple(refusals)

    def after(self) -> FloatArray:
        """Return what the causes leave in [m] or [rad], shape (k, n); NaN of rows that are left out."""
        left = self._deviation(self.state)
        if self.outliers is not None:
            left = left.copy()
            left[:, list(self.outliers.rows)] = np.nan
        return left

    def _without_twins(self, every: Sequence[Explanation]) -> tuple[list[Explanation], dict[Part, list[str]]]:
        """Return explanations that differ in what they do, and the names of what does exactly the same."""
        best, *others = every
        rivals, twins = [best], dict[Part, list[str]]()
        own = set(self._parts(best))
        rows = replace(self.result.rows, at=self.search.spread(COARSE))
        for explanation in others:
            mine, theirs = own - set(self._parts(explanation)), set(self._parts(explanation)) - own
            if self._alike(mine, theirs) and self.search.is_equivalent(best.state, explanation.state, rows):
                continue
            if len(mine) == len(theirs) == 1 and self._same_effect(best.state, explanation.state, rows.at):
                (part,), (other,) = mine, theirs
                if other.group < 0 or self._is_usual_size(other.group, explanation.state):
                    twins.setdefault(part, []).append(self._short_name(other, explanation))
            else:
                rivals.append(explanation)
        return rivals, twins

    def _alike(self, mine: set[Part], theirs: set[Part]) -> bool:
        """Tell whether causes are of the same kinds: a base turned by 180 deg, and by a number."""
        kinds = [sorted(self._kind(part) for part in parts) for parts in (mine, theirs)]
        frames = {*kinds[0]} <= {"base_shift", "base_rotation", "tool_shift", "tool_rotation"}
        return kinds[0] == kinds[1] and frames

    def _same_effect(self, first: State, second: State, rows: IntArray) -> bool:
        """Tell whether two explanations leave the same but for a hundredth of the noise floor."""
        one, two = (self.model.residual(state, rows) for state in (first, second))
        between = (one - two) / self.search.floor[:, np.newaxis]
        known = np.isfinite(between).all(axis=0)
        return bool(known.any() and np.sqrt(np.mean(between[:, known] ** 2)) < 0.01)

    def _relevant(self, explanation: Explanation) -> bool:
        """Tell whether each cause of an explanation has a number whose interval lies beside 0."""
        return all(self._is_significant(explanation, g) for g in explanation.subset)

    def _parts(self, explanation: Explanation) -> list[Part]:
        """Return the causes of an explanation: rows, what is usual, edits, then groups."""
        rows = [] if self.outliers is None else [self.outliers]
        usual = self._usual_columns(explanation)
        rows += [Part(usual=usual)] if usual else []
        return [
            *rows,
            *(Part(edit) for edit in explanation.state.edits),
            *(Part(group=g) for g in sorted(explanation.subset)),
        ]

    def _causes(
        self, explanation: Explanation, common: set[Part], twins: dict[Part, list[str]]
    ) -> tuple[Cause, ...]:
        """Return the causes of an explanation: what all explanations have in common, then the others.

        Of both clocks first, then what takes the most away after those before it.
        """
        rest, order = self._parts(explanation), list[Part]()
        few = self.search.spread(ORDERED)
        if self.outliers is not None:
            few = np.union1d(few, self.outliers.rows)
        while rest:
            next_ones = [part for part in rest if part in common] or rest
            clocks = [part for part in next_ones if self._kind(part) in CLOCKS]
            left = {part: self._left(explanation.state, [*order, part], few) for part in clocks or next_ones}
            order.append(min(left, key=lambda part: left[part]))
            rest.remove(order[-1])
        after = [self._left(explanation.state, order[:k]) for k in range(len(order) + 1)]
        nothing = self.before
        causes = []
        for k, part in enumerate(order):
            mended = self._only(explanation.state, (part,))
            made = nothing[:, list(part.rows)] if part.rows else nothing - self._deviation(mended)
            effect = float(np.nanmax(self._sizes(made), initial=0.0))
            causes.append(
                replace(
                    self._of_part(part, explanation, effect, twins.get(part, ())),
                    rms_before=after[k], rms_after=after[k + 1],
                    rms_alone=self._left(explanation.state, (part,)),
                    effect=effect, breaks=self._breaks_a_tolerance(part, made, mended),
                )
            )  # fmt: skip
        return tuple(causes)

    def _sizes(self, made: FloatArray) -> FloatArray:
        """Return how large deviations of rows are: a distance, or that of the joint furthest off."""
        if self.model.of_joints:
            return np.asarray(np.abs(made).max(axis=0))
        return np.asarray(np.sqrt((made**2).sum(axis=0)))

    def _of_part(self, part: Part, explanation: Explanation, effect: float, twins: Sequence[str]) -> Cause:
        """Return a cause without what it changes."""
        if part.rows:
            rows = tuple(self.model.sample[list(part.rows)].tolist())
            sizes = self._sizes(self.before[:, list(part.rows)])
            least = float(np.nanmin(sizes, initial=effect))
            value = (effect,) if least > ABOUT * effect else (least, effect)
            return Cause("outliers", "rows", rows=rows, value=value, unit=self.model.unit)
        if part.usual:
            return Cause("own_geometry", "arm")
        cause = self._of_edit(part.edit) if part.edit else self._of_group(part.group, explanation)
        return replace(cause, twins=(*cause.twins, *(name for name in twins if name not in cause.twins)))

    def _usual_columns(self, explanation: Explanation) -> tuple[int, ...]:
        """Return the places of what arms usually differ by, where it was fitted beside a cause."""
        columns = self._columns(set(self.search.usual) - explanation.subset)
        return tuple(c for c in columns if explanation.state.values[c])

    def _kind(self, part: Part) -> str:
        if part.rows or part.usual:
            return "outliers" if part.rows else "own_geometry"
        return part.edit.kind if part.edit else self.model.groups[part.group].kind

    def _left(self, state: State, mended: Sequence[Part], rows: IntArray | None = None) -> float:
        """Return the root mean square of what stays of rows when some causes of an explanation are mended."""
        gone = [place for part in mended for place in part.rows]
        only = self._only(state, mended)
        if rows is not None:
            return rms(self.model.deviation(only, np.setdiff1d(rows, gone)).T)
        left = self._deviation(only)
        return rms(np.delete(left, gone, axis=1).T if gone else left.T)

    @property
    def before(self) -> FloatArray:
        """What is judged before any cause is mended, of all rows, in [m] or [rad], shape (k, n)."""
        return self._deviation(self._only(self.search.zero, ()))

    def _deviation(self, state: State) -> FloatArray:
        """Return what stays of all rows, in [m] or [rad], shape (k, n); of one state once."""
        key = state.values.tobytes(), state.edits
        if key not in self._deviations:
            self._deviations[key] = deviation(self.model, state)
        return self._deviations[key]

    def _only(self, state: State, mended: Iterable[Part]) -> State:
        """Remove all causes but some from an explanation, and fit the groups that are always fitted again."""
        kept = set(mended)
        values = np.zeros_like(state.values)
        for g in [*self.search.forced, *(part.group for part in kept if part.group >= 0)]:
            columns = list(self.model.groups[g].columns)
            values[columns] = state.values[columns]
        columns = [c for part in kept for c in part.usual]
        values[columns] = state.values[columns]
        edits = tuple(edit for edit in state.edits if Part(edit) in kept)
        rows = self.result.rows
        few = rows.thinned(PLACED)
        return self.search.placed(State(values, edits), few)

    def _of_edit(self, edit: Edit) -> Cause:
        """Return a cause that is there or not."""
        joints = tuple(self.names[j] for j in edit.joints)
        name = edit.name or " and ".join(self.own_names[j] for j in edit.joints)
        if edit.kind == "base_rotation":
            axis, angle = edit.axis_angle
            if sum(axis) < 0.0:  # 90 deg about -x is -90 deg about x
                axis, angle = (-axis[0] + 0.0, -axis[1] + 0.0, -axis[2] + 0.0), -angle
            return Cause(edit.kind, name, axis=axis, value=(angle,), unit="rad")
        value = (edit.value,) if edit.kind in ("path_unit", "joint_unit", "joint_coupled", "turns") else ()
        unit = "turns" if edit.kind == "turns" else ""
        if edit.kind == "half_turn" and isinstance(self.model, JointsModel):  # of positions no sense shows
            value, unit = (edit.value * np.pi,), "rad"
        first = edit.first if edit.kind in ("half_turn", "mirrored", "turns") and edit.first else None
        return Cause(edit.kind, name, joints, value=value, unit=unit, from_sample=first)

    def _of_group(self, g: int, explanation: Explanation) -> Cause:
        """Return a cause of some size, with its interval and its twins."""
        group = self.model.groups[g]
        values, reach = explanation.state.of(group), self._half_width(explanation, g)
        nominal = 1.0 if group.kind == "joint_scale" else 0.0
        low, middle, high = (
            tuple((nominal + part).tolist()) for part in (values - reach, values, values + reach)
        )
        joint = () if group.joint is None else (self.names[group.joint],)
        return Cause(
            group.kind, self._name(group), joint, group.segment, group.axis, middle, group.unit, low, high,
            twins=tuple(dict.fromkeys(self._twins(g, explanation.state))),
        )  # fmt: skip

    def _name(self, group: Group) -> str:
        """Return what a cause is of, a joint as the arm calls it."""
        return group.name if group.joint is None else self.own_names[group.joint]

    def _short_name(self, part: Part, explanation: Explanation) -> str:
        """Return what a cause is called among twins."""
        if part.rows:
            return "outliers"
        return short_name(
            self._of_edit(part.edit) if part.edit else self._bare(self.model.groups[part.group])
        )

    def _bare(self, group: Group) -> Cause:
        """Return the cause of a group without numbers."""
        joint = () if group.joint is None else (self.names[group.joint],)
        return Cause(group.kind, self._name(group), joint, group.segment, group.axis, unit=group.unit)

    def _half_width(self, explanation: Explanation, g: int) -> FloatArray:
        """Return half the 95 % interval of a group's numbers, all numbers of the explanation fitted together.

        By batch means in correlated noise, not below what noise of the floor would make.
        """
        columns = self._columns(explanation.subset)
        covariance, free = self._covariance(explanation)
        own = [columns.index(c) for c in self.model.groups[g].columns]
        return np.asarray(student_quantile(free) * np.sqrt(np.maximum(np.diag(covariance)[own], 0.0)))

    def _columns(self, subset: Iterable[int]) -> list[int]:
        return [c for h in sorted(subset) for c in self.model.groups[h].columns]

    def _covariance(self, explanation: Explanation) -> tuple[FloatArray, int]:
        """Return the covariance of the numbers of an explanation, and its degrees of freedom."""
        key = explanation.key
        if key not in self._covariances:
            self._covariances[key] = self._estimate_covariance(explanation)
        return self._covariances[key]

    def _estimate_covariance(self, explanation: Explanation) -> tuple[FloatArray, int]:
        taken = explanation.subset | set(self.search.forced)
        rows, groups = self.result.rows, [self.model.groups[h] for h in sorted(taken)]
        columns = self._columns(taken)

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

    def _twins(self, g: int, state: State) -> Iterator[str]:
        """Yield the names of what would do the very same as a group, or as one of its three numbers."""
        groups, group = self.model.groups, self.model.groups[g]
        for h, other in enumerate(groups):
            stands = self.result.twins.get(h)
            single = len(group.columns) == len(other.columns) == 1
            apart = single if stands is None else not groups[stands].is_of_frame(group)
            if apart or other.is_of_frame(group):
                continue
            like = stands == g
            for k, c in enumerate(group.columns):
                own = f" ({'xyz'[k]})" if len(group.columns) > 1 else ""
                if len(other.columns) > 1:  # its single axes are groups of their own
                    continue
                (d,) = other.columns
                if state.values[c] and (like or self._same(c, d)) and self._stays_same(state, c, d):
                    yield f"{short_name(self._bare(other))}{own}"

    def _stays_same(self, state: State, c: int, d: int) -> bool:
        """Tell whether a number in place of another leaves the same at its full size."""
        other = self.search.exchange(state, c, d, self.result.normal.gram)
        some = replace(self.result.rows, at=self.search.spread(COARSE))
        (h,) = (h for h, group in enumerate(self.model.groups) if group.columns == (d,))
        return self._is_usual_size(h, other) and self.search.is_equivalent(state, other, some)

    def _is_usual_size(self, g: int, state: State) -> bool:
        """Tell whether a number is that of a cause of its kind: no backlash has half a turn."""
        group = self.model.groups[g]
        return bool(np.abs(state.of(group)).max() <= LARGEST.get(group.kind, np.inf))

    def _same(self, c: int, d: int) -> bool:
        """Tell whether two columns have one direction."""
        gram = self.result.normal.gram
        size = float(np.sqrt(max(gram[c, c], 0.0) * max(gram[d, d], 0.0)))  # rounding may leave less than 0
        return size > 0.0 and 1.0 - abs(float(gram[c, d])) / size < TWIN

    def _needs(self, every: Sequence[Explanation]) -> str:
        """Return the joint whose motion would decide between explanations; empty if none would."""
        joints = {j for explanation in every for j in self._joints_of(explanation)}
        if len(joints) == 1:
            (only,) = joints
            return "" if only is None else self.own_names[only]
        if not isinstance(self.model, ArmModel):
            return ""
        first, second = (explanation.state for explanation in every[:2])
        decides = deciding_joint(self.model, first, second, self.search.spread(SWEPT))
        return "" if decides is None else self.own_names[decides]

    def _joints_of(self, explanation: Explanation) -> set[int | None]:
        """Return the joints that an explanation changes, with None if a part of it changes no joint."""
        of_edits: set[int | None] = {j for edit in explanation.state.edits for j in edit.joints}
        return of_edits | {self.model.groups[g].joint for g in explanation.subset}


def _begin_abruptly(left: FloatArray, size: FloatArray, far: IntArray) -> bool:
    """Tell whether each stretch of rows is entered and left by a step of a large share of its size."""
    for stretch in np.split(far, np.flatnonzero(np.diff(far) > 1) + 1):
        largest = float(size[stretch].max())
        for inside, outside in ((stretch[0], stretch[0] - 1), (stretch[-1], stretch[-1] + 1)):
            if 0 <= outside < left.shape[1] and np.isfinite(size[outside]):
                step = float(np.linalg.norm(left[:, inside] - left[:, outside]))
                if step < ABRUPT * min(largest, float(size[inside])):
                    return False
    return True


SWEEP = 1.5
"""How far each joint is moved to both sides, in [rad]; one that slides by so many fifths of a [m]."""

TELLING = 2.0
"""A joint decides if its motion sets two explanations so many times further apart than the log does."""

GOLDEN = 0.6180339887498949
"""Multiples of the golden ratio, without their whole part, fill an interval evenly in mixed order."""


def deciding_joint(model: ArmModel, first: State, second: State, rows: IntArray) -> int | None:
    """Return the joint whose motion sets two explanations furthest apart; None if none does clearly.

    Args:
        model: The arm, beside where it should be.
        first: An explanation.
        second: Another.
        rows: Poses of the log from which each joint is moved in turn, shape (n,).
    """
    own = _apart(model, first, second, rows)
    swept = np.arange(len(rows))
    count = len(model.chain.moving)
    apart = [_apart(_with_moved(model, j, rows), first, second, swept) for j in range(count)]
    best = int(np.argmax(apart))
    return best if apart[best] > TELLING * own else None


def _apart(model: ArmModel, first: State, second: State, rows: IntArray) -> float:
    """Return how far two explanations put the tool centre point apart, root mean square in [m]."""
    return rms((model.deviation(first, rows) - model.deviation(second, rows)).T)


def _with_moved(model: ArmModel, j: int, rows: IntArray) -> ArmModel:
    """Return the same poses with one joint moved far to both sides."""
    q = model.motion.at(model.clock.t[rows])[0].copy()
    reach = SWEEP / 5.0 if model.chain.moving[j].kind == "prismatic" else SWEEP
    q[j] += reach * (2.0 * np.modf(np.arange(len(rows)) * GOLDEN)[0] - 1.0)
    t, none = np.arange(len(rows), dtype=float), np.zeros_like(q)
    rotation = None if model.rotation is None else model.rotation[:, :, rows]
    return replace(
        model, motion=Motion(t, q, none, none), clock=Clock(t, -1.0, t), sample=model.sample[rows],
        position=model.position[:, rows], rotation=rotation, judged=None,
    )  # fmt: skip
