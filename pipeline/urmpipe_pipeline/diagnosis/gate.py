"""The gate that every named answer passes: causes that no engineer believes are refused, with the reason.

1. A number beyond `LARGEST` is that of no such cause, unless it alone leaves the noise. A factor below 0 is a
   sign, and a backlash of a turn is one.
2. Beside other causes no part of an arm differs by more than `REACHED` and `BESIDE`. One that alone leaves
   the noise may have any size.
3. A cause that alone makes the rms more than `CANCELS` times what it was before any only cancels another.
4. What a number fits has to hold all the time: x_k is replaced by sum_m x_km h_m(row) over two and over
   `SEGMENTS` hat functions h_m. It changes during the log if these leave significantly less (F test, in rows
   that are independent of each other), and differ from x_k by more than `CHANGING` of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.diagnosis.fit import Model, Rows, cost
from urmpipe_pipeline.diagnosis.formatting import CANCELLING, CLOCKS, TOO_LARGE
from urmpipe_pipeline.diagnosis.hypotheses import State
from urmpipe_pipeline.diagnosis.intervals import autocorrelation_time
from urmpipe_pipeline.diagnosis.result import STRUCTURE
from urmpipe_pipeline.diagnosis.selection import Subset
from urmpipe_pipeline.runs.reading_errors import Edits

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
