"""Where a search starts: causes that are there or not, and single causes of a size that no line shows.

- `rank_discrete_causes`: with which signs, exchanges, units, axes or robots base, tool, clock and zeros could
  leave little.
- `add_discrete_cause`: one more of them, where something is left to explain.
- `find_large_causes`: each rotation and each joint fitted alone, exactly. A turn by theta about the unit
  vector w, which moves a point by v per radian at first, moves it by sin(theta) v + (1 - cos(theta)) w x v.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray, spread_rows
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.diagnosis.fit import OUTLIER, Model, Rows, inliers
from urmpipe_pipeline.diagnosis.hypotheses import Group, State
from urmpipe_pipeline.diagnosis.models import ArmModel
from urmpipe_pipeline.runs.reading_errors import Edit, EditKind, Edits

SETUP = ("base_shift", "base_rotation", "tool_shift", "tool_rotation", "time_lag", "joint_offset")
"""What a discrete cause may need besides to leave little; lengths and tilts are small."""

NEAREST = 8  # discrete causes that are fitted with these, those that leave the least by themselves
PLAUSIBLE = 4.0  # a discrete cause is plausible if it leaves no more than this times the least square
MOST = 5  # so many of them at most
AS_WELL = 1.5  # times the least square that none of them may leave and still comes first
UNSEEN = 1e-3  # share of the noise floor below which a discrete cause changes nothing
HALF = 0.5  # a further discrete cause has to leave less than this share of the square
RIDGE = 1e-10  # keeps the equations of equal columns solvable; columns have unit length

ANGLES = (0.3, -0.3, 0.8, -0.8, 1.57, -1.57, 2.4, -2.4, np.pi)
"""Where fits of a single angle begin, in [rad], besides its linear estimate: a cosine has few minima."""

FEW = 3  # of so many rows one shows what a single angle leaves
LINEAR = (
    0.02  # an angle in [rad] below which the linear search needs no other start: its error is theta^2 / 2
)
STARTS = 4  # so many single causes are starts
WORTH = 0.5  # of what the best single cause takes away a start takes away so much


def rank_discrete_causes(
    model: Model, edits: Sequence[Edits], zero: State, rows: Rows, floor: FloatArray
) -> list[Edits]:
    """Return the discrete causes with which setup and zeros could leave little, the best first.

    None of them is always among the result, and the first where it leaves about as little.

    Args:
        model: The side that is modelled, with its data.
        edits: What may be there, alone or together.
        zero: Nothing that differs.
        rows: Some rows.
        floor: Noise floor of each component in [m] or [rad], shape (c,).
    """
    every: list[Edits] = [(), *edits]
    least = float(np.linalg.norm(floor * rows.weight))
    raw = list(model.residuals(every, rows.at))
    alone = mean_squares(raw, rows.weight, least)
    shifted = mean_squares([left - _middle(left) for left in raw], rows.weight, least)
    unseen = UNSEEN * floor[:, np.newaxis]
    order = np.argsort(np.minimum(alone, shifted), kind="stable")
    seen = [i for i in order.tolist() if not np.allclose(raw[i] - raw[0], 0.0, 0.0, unseen, equal_nan=True)]
    tried = [0, *seen[:NEAREST]]
    groups = [
        one for one in model.groups if one.kind in SETUP and (one.axis is None or one.joint is not None)
    ]
    lefts = [
        residual_after_fit(model, replace(zero, edits=every[i]), rows.at, rows.weight, groups) for i in tried
    ]
    left_over = mean_squares(lefts, rows.weight, least)
    most = PLAUSIBLE * max(float(left_over.min()), least**2)
    near = [i for i in np.argsort(left_over, kind="stable").tolist() if left_over[i] <= most][:MOST]
    bare = [i for i in range(len(tried)) if alone[tried[i]] <= most and i not in near][:MOST]
    near += bare
    if left_over[0] <= AS_WELL * left_over.min():
        near.insert(0, 0)
    return [every[tried[i]] for i in dict.fromkeys([*near, 0])]


def add_discrete_cause(
    model: Model, edits: Sequence[Edits], best: State, rows: Rows, floor: FloatArray
) -> State | None:
    """Return an explanation with one discrete cause more, if something is left and that halves its square.

    The noise floor is in [m] and [rad], shape (c,).
    """
    least = float(np.linalg.norm(floor * rows.weight))
    noise = PLAUSIBLE * len(rows.weight)  # all numbers together leave about 1 of each component
    now = model.residual(best, rows.at)
    if mean_squares([now], rows.weight, least)[0] <= noise:
        return None
    own = {(edit.kind, edit.joints) for edit in best.edits}
    states = [
        replace(best, edits=(*best.edits, *one))
        for one in edits
        if len(one) == 1 and (one[0].kind, one[0].joints) not in own
    ]
    lefts = [now, *(model.residual(one, rows.at) for one in states)]
    every = mean_squares(lefts, rows.weight, least)
    nearest = int(np.argmin(every))
    return states[nearest - 1] if nearest and every[nearest] <= HALF * every[0] else None


def find_large_causes(model: ArmModel, state: State, rows: Rows, among: Sequence[int]) -> Iterator[State]:
    """Yield explanations with one number besides discrete causes, where it is too large for a linear search.

    Args:
        model: The side that is modelled, with its data.
        state: What is taken for granted; the numbers of `among` are 0.
        rows: Some rows.
        among: Groups with one number each.
    """
    groups = [model.groups[g] for g in among]
    left, velocity, turn = model.motions(state, rows.at[::FEW], groups)
    known = np.flatnonzero(np.isfinite(left).all(axis=0))
    known = known[inliers(left[:, known])] if len(known) else known
    if not len(known) or not groups:
        return
    left, velocity, turn = left[:, known], velocity[:, :, known], turn[:, :, known]
    values, squares = fit_alone(left, velocity, turn)
    angles = np.abs(values) * np.linalg.norm(turn, axis=1).max(axis=1)
    gain = float((left**2).sum()) - squares
    worth = gain > WORTH * gain.max()
    order = [i for i in np.argsort(squares, kind="stable").tolist() if worth[i] and angles[i] > LINEAR]
    for i in order[:STARTS]:
        found = state.values.copy()
        found[groups[i].columns[0]] = values[i]
        yield replace(state, values=found)


def fit_alone(left: FloatArray, velocity: FloatArray, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the number [-] of each cause that leaves the least by itself, and its squares, shape (p,) each.

    Args:
        left: data - model in [m], shape (3, n).
        velocity: How each number moves the tool centre point, in [m] per unit, shape (p, 3, n).
        turn: How it turns what it moves, in [rad] per unit, shape (p, 3, n).
    """
    rate = np.linalg.norm(turn, axis=1)  # rad per unit, (p, n)
    by = np.where(rate > 1e-12, rate, 1.0)[:, np.newaxis]
    turning = (rate > 1e-12)[:, np.newaxis]
    along = np.where(turning, velocity / by, velocity)
    across = np.where(turning, np.cross(turn / by, along, axis=1), 0.0)

    def misses(value: FloatArray) -> tuple[FloatArray, FloatArray]:
        angle = (value[:, np.newaxis] * rate)[:, np.newaxis]
        sine = np.where(turning, np.sin(angle), value[:, np.newaxis, np.newaxis])
        moved = sine * along + (1.0 - np.cos(angle)) * across
        slope = np.where(turning, by * (np.cos(angle) * along + np.sin(angle) * across), along)
        return left - moved, slope

    def squares(value: FloatArray) -> FloatArray:
        return np.asarray((misses(value)[0] ** 2).sum(axis=(1, 2)))

    steep = np.maximum((velocity**2).sum(axis=(1, 2)), np.finfo(float).tiny)
    best = (velocity * left).sum(axis=(1, 2)) / steep
    least = squares(best)
    most = np.where(rate.max(axis=1) > 1e-12, rate.max(axis=1), np.inf)
    for angle in ANGLES:
        there = angle / most
        now = squares(there)
        best, least = np.where(now < least, there, best), np.minimum(now, least)
    for _ in range(8):
        miss, slope = misses(best)
        step = (slope * miss).sum(axis=(1, 2)) / np.maximum((slope**2).sum(axis=(1, 2)), np.finfo(float).tiny)
        now = squares(best + step)
        best, least = np.where(now < least, best + step, best), np.minimum(now, least)
    return best, least


def mean_squares(lefts: Sequence[FloatArray], weight: FloatArray, least: float) -> FloatArray:
    """Return the mean square [-] of what each of some explanations leaves, shape (explanations,).

    Outliers of the best count alike.

    Args:
        lefts: What each leaves in [m] and [rad], shape (c, n) each.
        weight: Of each component in [1/m] or [1/rad], shape (c,).
        least: Noise floor of a row, in its weights.
    """
    sizes = [np.sqrt(((left * weight[:, np.newaxis]) ** 2).sum(axis=0)) for left in lefts]
    medians = [float(np.median(size[np.isfinite(size)])) for size in sizes if np.isfinite(size).any()]
    most = OUTLIER * max(min(medians, default=least), least)
    return np.array([_mean(np.minimum(size, most) ** 2) for size in sizes])


def residual_after_fit(
    model: Model, state: State, rows: IntArray, weight: FloatArray, groups: Sequence[Group] | None = None
) -> FloatArray:
    """Return what numbers could leave together in [m] and [rad], shape (c, n).

    Outliers of a first fit do not count. The scales of joints are not among them: one of -1 undoes a sign.

    Args:
        model: The side that is modelled, with its data.
        state: What is taken for granted.
        rows: Rows, by index, shape (n,).
        weight: Of each component in [1/m] or [1/rad], shape (c,).
        groups: Whose numbers; all but scales by default.
    """
    taken = [one for one in model.groups if one.kind != "joint_scale"] if groups is None else groups
    left, jacobian = model.linear(state, rows, taken)
    known = np.isfinite(left).all(axis=0)
    after = left
    for _ in range(2):
        flat = (jacobian[:, :, known] * weight[:, np.newaxis]).reshape(len(jacobian), -1)
        size = np.sqrt(np.maximum((flat**2).sum(axis=1), np.finfo(float).tiny))
        flat = flat / size[:, np.newaxis]
        target = flat @ (left[:, known] * weight[:, np.newaxis]).ravel()
        x = np.linalg.solve(flat @ flat.T + RIDGE * np.eye(len(flat)), target) / size
        after = left - np.tensordot(x, jacobian, 1)
        known = inliers(after * weight[:, np.newaxis])
    return np.asarray(after)


def _middle(left: FloatArray) -> FloatArray:
    """Return the mean of each component over the rows that are known, shape (c, 1)."""
    known = np.isfinite(left).all(axis=0)
    return np.asarray(left[:, known].mean(axis=1, keepdims=True)) if known.any() else np.zeros((len(left), 1))


def _mean(values: FloatArray) -> float:
    """Return the mean without NaN; inf if there is no other value."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else np.inf


SPREAD = 400
"""Rows, spread evenly, on which it is looked for where a change begins; then all rows around are."""

BORDER = 0.02
"""A change within this share of the rows from their start is one of all of them; from their end, none."""

LASTING = 3
"""Fewer samples a turn away are outliers, no turn."""

_LATER: tuple[tuple[EditKind, float], ...] = (("half_turn", -1.0), ("half_turn", 1.0), ("mirrored", 1.0))
"""What may begin at some row; half a turn back first."""

TOLD = 36.0
"""The rows before a change tell that they lack it if it would leave so many times the usual square more."""


def later_edits(
    model: Model, sample: IntArray, turning: Sequence[bool], start: State, *, both_ways: bool
) -> Iterator[Edits]:
    """Yield what may begin at some row: half a turn of a joint, or its angle mirrored.

    The row s leaves the least sum of squares, sum_{i < s} |r_i|^2 + sum_{i >= s} |r'_i|^2, over all rows.
    Where the rows before it do not tell, all rows have it: a mirrored joint then counts the other way.

    Args:
        model: What is held against what it should be.
        sample: Rows of the log, shape (n,).
        turning: Which joints turn, shape (joints,).
        start: What is taken for granted.
        both_ways: Whether half a turn ahead is another thing than half a turn back.
    """
    kinds = _LATER if both_ways else _LATER[1:]
    rows = spread_rows(model.rows, SPREAD)
    before = _squares(model.residual(start, rows))
    for j, turns in enumerate(turning):
        for kind, value in kinds if turns else ():
            whole = Edit(kind, (j,), value)
            after = _squares(model.residual(_with(start, whole), rows))
            first = _best_start(before, after)
            if first >= (1.0 - BORDER) * len(rows):
                continue
            usual = float(np.median(np.minimum(before, after)))
            if first <= BORDER * len(rows) or (after - before)[:first].sum() <= TOLD * usual:
                if kind == "half_turn":
                    yield (whole,)
                continue
            near = np.arange(rows[max(first - 2, 0)], rows[min(first + 2, len(rows) - 1)] + 1)
            pair = (_squares(model.residual(state, near)) for state in (start, _with(start, whole)))
            yield (Edit(kind, (j,), value, int(sample[near[min(_best_start(*pair), len(near) - 1)]])),)


def turn_edits(left: FloatArray, sample: IntArray, turning: Sequence[bool]) -> Edits:
    """Return the whole turns that joints have from the start or gain on the way, each from a row on.

    Args:
        left: reference - log of each joint in [rad], shape (joints, n).
        sample: Rows of the log, shape (n,).
        turning: Which joints turn, shape (joints,).
    """
    found = []
    for j, turns in enumerate(turning):
        if not turns:
            continue
        known = np.flatnonzero(np.isfinite(left[j]))
        whole = np.rint(left[j, known] / FULL_TURN).astype(np.int64)
        steps = (np.flatnonzero(np.diff(whole)) + 1).tolist()
        for step, end in pairwise([0, *steps, len(whole)]):
            if end - step >= LASTING:
                found.append((j, int(sample[known[step]]), int(whole[step])))
    return tuple(_turns(found))


def _turns(found: Sequence[tuple[int, int, int]]) -> Iterator[Edit]:
    """Yield the steps between turns of the same joint, from joint, row and turns since the start."""
    of_joint: dict[int, int] = {}
    for joint, first, whole in found:
        step = whole - of_joint.get(joint, 0)
        of_joint[joint] = whole
        if step:
            yield Edit("turns", (joint,), float(step), first)


def _with(state: State, edit: Edit) -> State:
    """Return an explanation with one change more."""
    return State(state.values, (*state.edits, edit))


def _squares(left: FloatArray) -> FloatArray:
    """Return the squared lengths of what is left, shape (n,); 0 where it is not known."""
    return np.asarray(np.nan_to_num((left**2).sum(axis=0)))


def _best_start(before: FloatArray, after: FloatArray) -> int:
    """Return from which index on the second squares sum up to the least, with the first ones before it."""
    gained = np.concatenate(([0.0], np.cumsum((before - after)[::-1])))[::-1]
    return int(np.argmax(gained))
