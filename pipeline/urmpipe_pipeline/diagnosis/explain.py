"""What an explanation is worth: sizes with their intervals, shares, twins, what would decide."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_pipeline.diagnosis.arm import ArmModel
from urmpipe_pipeline.diagnosis.deciding import deciding_joint
from urmpipe_pipeline.diagnosis.fit import Model
from urmpipe_pipeline.diagnosis.found import Explanation, Found
from urmpipe_pipeline.diagnosis.hypotheses import Group, State
from urmpipe_pipeline.diagnosis.joints import JointsModel
from urmpipe_pipeline.diagnosis.result import Alternative, Cause, rms
from urmpipe_pipeline.diagnosis.search import COARSE, Search
from urmpipe_pipeline.diagnosis.twins import exchanged, same_at_full_size
from urmpipe_pipeline.log_edits import Edit

SAMPLES = 4_000
"""Rows, spread evenly, on which shares are told: each takes all combinations of causes."""

SWEPT = 120
"""Poses on which it is looked for which joint's motion tells two explanations apart."""

EXACT = 1e-9
"""Two columns are one if 1 - |cos| of their directions is less: they differ by rounding alone."""

CONFIDENCE = 1.96
"""Standard deviations to both sides that hold 95 % of a normal distribution."""

ORDERED = 1_000
"""Rows, spread evenly, on which the order of causes is found."""

TIME = ("time_lag", "clock_drift")

TWINS = {
    "joint_offset": "offset of {}", "joint_scale": "scale of {}", "compliance": "compliance of {}",
    "base_shift": "base shift", "base_rotation": "base rotation",
    "tool_shift": "tool shift", "tool_rotation": "tool rotation",
    "time_lag": "time lag", "clock_drift": "clock drift",
}  # fmt: skip
"""What causes are called among twins; others by their name alone."""


@dataclass(frozen=True)
class Part:
    """One cause of an explanation: an edit, or the numbers of a group.

    Attributes:
        edit: The edit; None of a group.
        group: Place of the group; -1 of an edit.
    """

    edit: Edit | None = None
    group: int = -1


@dataclass(frozen=True, eq=False)
class Explained:
    """What a search found, in the words of the result.

    Attributes:
        search: What was looked for.
        found: What was found.
        names: What the log calls its joints.
        own_names: What the arm calls them.
        breaks: Tells whether a deviation in [m] or [rad], shape (k, n), is out of tolerance.
    """

    search: Search
    found: Found
    names: tuple[str, ...]
    own_names: tuple[str, ...]
    breaks: Callable[[FloatArray], bool]

    @property
    def model(self) -> Model:
        """What was held against what it should be."""
        return self.search.model

    @property
    def metres(self) -> bool:
        """Whether positions are judged, not joints alone."""
        return not isinstance(self.model, JointsModel) or self.model.chain is not None

    def causes(self) -> tuple[tuple[Cause, ...], tuple[Alternative, ...]]:
        """Return the named causes, the largest share first, and what the log does not decide between."""
        best = self.found.best
        every = [best, *(one for one in self.found.others if self._relevant(one))]
        common = set.intersection(*(set(_parts(one)) for one in every))
        named = self._causes(best, common)
        if len(every) == 1:
            return named, ()
        needs = self._needs(every)
        return named, tuple(Alternative(self._causes(one, set(_parts(one)) - common), needs) for one in every)

    def _relevant(self, one: Explanation) -> bool:
        """Tell whether each cause of an explanation has a number whose interval lies beside 0."""
        return all(
            (np.abs(one.state.of(self.model.groups[g])) > CONFIDENCE * self._deviations(one, g)).any()
            for g in one.subset
        )

    def _causes(self, one: Explanation, wanted: set[Part]) -> tuple[Cause, ...]:
        """Return some causes of an explanation: clocks first, then what takes most away after those before."""
        few, every = self.search.spread(ORDERED), np.arange(self.model.rows)
        rest, order = _parts(one), list[Part]()
        while rest:
            clocks = [part for part in rest if self._kind(part) in TIME]
            left = {part: self._left(one.state, [*order, part], few) for part in clocks or rest}
            order.append(min(left, key=lambda part: left[part]))
            rest.remove(order[-1])
        after = [self._left(one.state, order[:k], every) for k in range(len(order) + 1)]
        nothing = self.model.deviation(self._only(one.state, ()), every)
        causes = []
        for k, part in enumerate(order):
            alone = self.model.deviation(self._only(one.state, [part]), every)
            made = nothing - alone
            size = np.sqrt((made**2).sum(axis=0)) if self.metres else np.abs(made).max(axis=0)
            causes.append(
                replace(
                    self._of_edit(part.edit) if part.edit else self._of_group(part.group, one),
                    rms_before=after[k], rms_after=after[k + 1], rms_alone=rms(alone.T),
                    effect=float(np.nanmax(size, initial=0.0)), breaks=self.breaks(made),
                )
            )  # fmt: skip
        return tuple(cause for cause, part in zip(causes, order, strict=True) if part in wanted)

    def _kind(self, part: Part) -> str:
        return part.edit.kind if part.edit else self.model.groups[part.group].kind

    def _left(self, state: State, mended: Iterable[Part], rows: IntArray) -> float:
        """Return the root mean square of what stays when some causes of an explanation are mended."""
        return rms(self.model.deviation(self._only(state, mended), rows).T)

    def _only(self, state: State, mended: Iterable[Part]) -> State:
        """Return an explanation with some of its causes alone, and with what is always taken."""
        kept = set(mended)
        values = np.zeros_like(state.values)
        for g in [*self.search.forced, *(part.group for part in kept if part.edit is None)]:
            columns = list(self.model.groups[g].columns)
            values[columns] = state.values[columns]
        edits = tuple(edit for edit in state.edits if Part(edit) in kept)
        rows = self.found.rows
        few = replace(rows, at=rows.at[:: max(len(rows.at) // SAMPLES, 1)])
        return self.search.placed(State(values, edits), few)

    def _of_edit(self, edit: Edit) -> Cause:
        """Return a cause that is there or not."""
        joints = tuple(self.names[j] for j in edit.joints)
        name = edit.name or " and ".join(self.own_names[j] for j in edit.joints)
        value, unit = {"path_unit": ((edit.value,), ""), "turns": ((edit.value,), "turns")}.get(
            edit.kind, ((), "")
        )
        begins = edit.kind in ("half_turn", "mirrored", "turns")
        return Cause(
            edit.kind, name, joints, value=value, unit=unit, from_sample=edit.first if begins else None
        )

    def _of_group(self, g: int, one: Explanation) -> Cause:
        """Return a cause of some size, with its interval and its twins."""
        group = self.model.groups[g]
        values, reach = one.state.of(group), CONFIDENCE * self._deviations(one, g)
        nominal = 1.0 if group.kind == "joint_scale" else 0.0
        low, middle, high = (
            tuple((nominal + part).tolist()) for part in (values - reach, values, values + reach)
        )
        joint = () if group.joint is None else (self.names[group.joint],)
        return Cause(
            group.kind, self._name(group), joint, group.segment, group.axis, middle, group.unit, low, high,
            twins=tuple(self._twins(g, one.state)),
        )  # fmt: skip

    def _name(self, group: Group) -> str:
        """Return what a cause is of, a joint as the arm calls it."""
        return group.name if group.joint is None else self.own_names[group.joint]

    def _deviations(self, one: Explanation, g: int) -> FloatArray:
        """Return the standard deviations of a group's numbers, all causes fitted together."""
        columns = [c for h in sorted(one.subset) for c in self.model.groups[h].columns]
        gram = self.found.normal.gram[np.ix_(columns, columns)]
        size = np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
        inverse = np.linalg.pinv(gram / size / size[:, np.newaxis], rcond=1e-12, hermitian=True)
        variance = self.found.variance * self.found.tau * np.diag(inverse) / size**2
        own = [columns.index(c) for c in self.model.groups[g].columns]
        return np.asarray(np.sqrt(np.maximum(variance[own], 0.0)))

    def _twins(self, g: int, state: State) -> Iterator[str]:
        """Yield the names of what would do the very same as a group, or as one of its three numbers."""
        groups, group = self.model.groups, self.model.groups[g]
        for h, other in enumerate(groups):
            like = self.found.twins.get(h) == g
            single = len(group.columns) == len(other.columns) == 1
            if h == g or not (like or (h not in self.found.twins and not single)):
                continue
            for k, c in enumerate(group.columns):
                own = f" ({'xyz'[k]})" if len(group.columns) > 1 else ""
                for i, d in enumerate(other.columns):
                    if state.values[c] and (like or self._same(c, d)) and self._stays_same(state, c, d):
                        axis = f" {'xyz'[i]}" if len(other.columns) > 1 else ""
                        yield f"{self._called(other)}{axis}{own}"

    def _stays_same(self, state: State, c: int, d: int) -> bool:
        """Tell whether a number in place of another leaves the same at its full size."""
        other = exchanged(state, c, d, self.found.normal.gram)
        some = replace(self.found.rows, at=self.search.spread(COARSE))
        return same_at_full_size(self.search, state, other, some)

    def _called(self, group: Group) -> str:
        """Return what a cause is called among twins."""
        return TWINS.get(group.kind, "{}").format(self._name(group))

    def _same(self, c: int, d: int) -> bool:
        """Tell whether two columns have one direction."""
        gram = self.found.normal.gram
        size = float(np.sqrt(max(gram[c, c], 0.0) * max(gram[d, d], 0.0)))  # rounding may leave less than 0
        return size > 0.0 and 1.0 - abs(float(gram[c, d])) / size < EXACT

    def _needs(self, every: Sequence[Explanation]) -> str:
        """Return the joint whose motion would decide between explanations; empty if none would."""
        joints = {j for one in every for j in self._joints_of(one)}
        if len(joints) == 1:
            (only,) = joints
            return "" if only is None else self.names[only]
        if not isinstance(self.model, ArmModel):
            return ""
        first, second = (one.state for one in every[:2])
        decides = deciding_joint(self.model, first, second, self.search.spread(SWEPT))
        return "" if decides is None else self.names[decides]

    def _joints_of(self, one: Explanation) -> set[int | None]:
        """Return the joints that an explanation changes, with None if a part of it changes no joint."""
        of_edits: set[int | None] = {j for edit in one.state.edits for j in edit.joints}
        return of_edits | {self.model.groups[g].joint for g in one.subset}


def _parts(one: Explanation) -> list[Part]:
    """Return the causes of an explanation: its edits, then its groups."""
    return [*(Part(edit) for edit in one.state.edits), *(Part(group=g) for g in sorted(one.subset))]
