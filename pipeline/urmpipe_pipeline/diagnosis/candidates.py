"""Candidates with which a search starts: discrete causes, and single causes too large for a linear search.

- `iter_onsets`: a half turn or a mirrored angle from some row s on, with the least sum_{i < s} |r_i|^2 +
  sum_{i >= s} |r'_i|^2; `find_whole_turns`: whole turns, where both sides have joints.
- `rank_discrete_causes`: which signs, exchanges, units, axes or robots leave little, after base, tool, clock
  and zeros are fitted linearly.
- `add_discrete_cause`: one more of them, if something is left to explain.
- `find_large_causes`: each turn and each joint fitted alone, exactly. A turn by theta about the unit vector
  w, which moves a point by v per radian at first, moves it by sin(theta) v + (1 - cos(theta)) w x v.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray, spread_rows
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.diagnosis.fit import MAX_MEDIANS, WeightedRows, find_inliers
from urmpipe_pipeline.diagnosis.hypotheses import Group, Model, State
from urmpipe_pipeline.diagnosis.models import ArmModel
from urmpipe_pipeline.runs.reading_errors import Edit, EditKind, Edits

ONSET_ROWS = 400  # evenly spaced, on which an onset is searched for; then all rows near it
BORDER = 0.02  # fraction of the rows; an onset this near to the start holds from the start, to the end never
MIN_TURN_SAMPLES = 3  # fewer samples a turn away are outliers
ONSET_KINDS: tuple[tuple[EditKind, float], ...] = (("half_turn", -1.0), ("half_turn", 1.0), ("mirrored", 1.0))
ONSET_SHOWN = (
    36.0  # medians of the squares by which the rows before an onset have to be worse with the change
)

# what a discrete cause may need in addition to leave little; lengths and tilts are small
SETUP = ("base_shift", "base_rotation", "tool_shift", "tool_rotation", "time_lag", "joint_offset")
FITTED_CAUSES = 8  # discrete causes that are fitted with these, those that leave the least alone
PLAUSIBLE = 4.0  # a discrete cause is plausible if it leaves up to this times the least square
MAX_PLAUSIBLE = 5
AS_GOOD = 1.5  # times the least square up to which no discrete cause comes first
NO_EFFECT = 1e-3  # fraction of the noise floor below which a discrete cause changes nothing
HALF = 0.5  # a further discrete cause has to leave less than this fraction of the square
RIDGE = 1e-10  # keeps the equations of equal columns solvable; columns have unit length

# [rad]: starts of fits of a single angle, with its linear estimate: a cosine has few minima
ANGLES = (0.3, -0.3, 0.8, -0.8, 1.57, -1.57, 2.4, -2.4, np.pi)
ROW_STEP = 3  # of the rows every third shows the residual of a single angle
LINEAR = 0.02  # [rad]: below it the linear search needs no other start, its error is theta^2 / 2
MAX_SINGLE_STARTS = 4
MIN_GAIN = 0.5  # fraction of the gain of the best single cause that makes another one a start


def iter_onsets(
    model: Model, sample: IntArray, is_revolute: Sequence[bool], start: State, *, both_ways: bool
) -> Iterator[Edits]:
    """Yield what may begin at some row: a half turn of a joint, or its angle mirrored.

    If the rows before the onset do not show it, all rows are changed; a mirrored joint then is a sign.

    Args:
        model: The model.
        sample: Rows of the log, shape (n,).
        is_revolute: Shape (joints,).
        start: The explanation to which the change is added.
        both_ways: Whether half a turn ahead differs from half a turn back.
    """
    kinds = ONSET_KINDS if both_ways else ONSET_KINDS[1:]
    rows = spread_rows(model.rows, ONSET_ROWS)
    before = _squares(model.residual(start, rows))
    for j, revolute in enumerate(is_revolute):
        for kind, value in kinds if revolute else ():
            edit = Edit(kind, (j,), value)
            changed = State(start.values, (*start.edits, edit))
            after = _squares(model.residual(changed, rows))
            first = _best_onset(before, after)
            if first >= (1.0 - BORDER) * len(rows):
                continue
            usual = float(np.median(np.minimum(before, after)))
            if first <= BORDER * len(rows) or (after - before)[:first].sum() <= ONSET_SHOWN * usual:
                if kind == "half_turn":
                    yield (edit,)
                continue
            near = np.arange(rows[max(first - 2, 0)], rows[min(first + 2, len(rows) - 1)] + 1)
            pair = (_squares(model.residual(state, near)) for state in (start, changed))
            yield (Edit(kind, (j,), value, int(sample[near[min(_best_onset(*pair), len(near) - 1)]])),)


def find_whole_turns(residuals: FloatArray, sample: IntArray, is_revolute: Sequence[bool]) -> Edits:
    """Return the whole turns that joints have from the start or gain later, each from a row on.

    Args:
        residuals: reference - log of each joint in [rad], shape (joints, n).
        sample: Rows of the log, shape (n,).
        is_revolute: Shape (joints,).
    """
    edits: list[Edit] = []
    for j in np.flatnonzero(is_revolute).tolist():
        known = np.flatnonzero(np.isfinite(residuals[j]))
        turns = np.rint(residuals[j, known] / FULL_TURN).astype(np.int64)
        starts = (np.flatnonzero(np.diff(turns)) + 1).tolist()
        before = 0
        for start, end in pairwise([0, *starts, len(turns)]):
            if end - start >= MIN_TURN_SAMPLES:
                step, before = int(turns[start]) - before, int(turns[start])
                if step:
                    edits.append(Edit("turns", (j,), float(step), int(sample[known[start]])))
    return tuple(edits)


def _squares(residuals: FloatArray) -> FloatArray:
    """Return the squared lengths of residuals, shape (n,); 0 where unknown."""
    return np.asarray(np.nan_to_num((residuals**2).sum(axis=0)))


def _best_onset(before: FloatArray, after: FloatArray) -> int:
    """Return the index from which on the second squares, and the first before it, have the least sum."""
    gained = np.concatenate(([0.0], np.cumsum((before - after)[::-1])))[::-1]
    return int(np.argmax(gained))


def rank_discrete_causes(
    model: Model, edits: Sequence[Edits], null: State, rows: WeightedRows, floor: FloatArray
) -> list[Edits]:
    """Return the discrete causes with which setup and zeros could leave little, the best first.

    No discrete cause is always in the result, and comes first if it leaves about as little.

    Args:
        model: The model.
        edits: The discrete causes, alone or together.
        null: The explanation without any cause.
        rows: Some rows.
        floor: Noise floor of each component in [m] or [rad], shape (c,).
    """
    candidates: list[Edits] = [(), *edits]
    least = float(np.linalg.norm(floor * rows.weight))
    raw = list(model.residuals(candidates, rows.at))
    unshifted = mean_squares(raw, rows.weight, least)
    shifted = mean_squares([left - _row_mean(left) for left in raw], rows.weight, least)
    unseen = NO_EFFECT * floor[:, np.newaxis]
    order = np.argsort(np.minimum(unshifted, shifted), kind="stable")
    seen = [i for i in order.tolist() if not np.allclose(raw[i] - raw[0], 0.0, 0.0, unseen, equal_nan=True)]
    tried = [0, *seen[:FITTED_CAUSES]]
    groups = [
        group
        for group in model.groups
        if group.kind in SETUP and (group.axis is None or group.joint is not None)
    ]
    residuals = [
        residual_after_fit(model, null._replace(edits=candidates[i]), rows.at, rows.weight, groups)
        for i in tried
    ]
    squares = mean_squares(residuals, rows.weight, least)
    most = PLAUSIBLE * max(float(squares.min()), least**2)
    ranked = [i for i in np.argsort(squares, kind="stable").tolist() if squares[i] <= most][:MAX_PLAUSIBLE]
    without_fit = [i for i in range(len(tried)) if unshifted[tried[i]] <= most and i not in ranked]
    ranked += without_fit[:MAX_PLAUSIBLE]
    if squares[0] <= AS_GOOD * squares.min():
        ranked.insert(0, 0)
    return [candidates[tried[i]] for i in dict.fromkeys([*ranked, 0])]


def add_discrete_cause(
    model: Model, edits: Sequence[Edits], best: State, rows: WeightedRows, floor: FloatArray
) -> State | None:
    """Return an explanation with one discrete cause more, if something is left and that halves its square.

    The noise floor is in [m] and [rad], shape (c,).
    """
    least = float(np.linalg.norm(floor * rows.weight))
    noise = PLAUSIBLE * len(rows.weight)  # all parameters together leave about 1 of each component
    now = model.residual(best, rows.at)
    if mean_squares([now], rows.weight, least)[0] <= noise:
        return None
    present = {(edit.kind, edit.joints) for edit in best.edits}
    states = [
        best._replace(edits=(*best.edits, *each))
        for each in edits
        if len(each) == 1 and (each[0].kind, each[0].joints) not in present
    ]
    residuals = [now, *(model.residual(state, rows.at) for state in states)]
    squares = mean_squares(residuals, rows.weight, least)
    nearest = int(np.argmin(squares))
    return states[nearest - 1] if nearest and squares[nearest] <= HALF * squares[0] else None


def find_large_causes(
    model: ArmModel, state: State, rows: WeightedRows, among: Sequence[int]
) -> Iterator[State]:
    """Yield explanations with one parameter more, if it is too large for a linear search.

    Args:
        model: The model.
        state: The explanation to which it is added; the parameters of `among` are 0.
        rows: Some rows.
        among: Groups with one parameter each.
    """
    groups = [model.groups[g] for g in among]
    left, velocity, turn = model.motions(state, rows.at[::ROW_STEP], groups)
    known = np.flatnonzero(np.isfinite(left).all(axis=0))
    known = known[find_inliers(left[:, known])] if len(known) else known
    if not len(known) or not groups:
        return
    left, velocity, turn = left[:, known], velocity[:, :, known], turn[:, :, known]
    values, squares = fit_each(left, velocity, turn)
    angles = np.abs(values) * np.linalg.norm(turn, axis=1).max(axis=1)
    gain = float((left**2).sum()) - squares
    worth = gain > MIN_GAIN * gain.max()
    order = [i for i in np.argsort(squares, kind="stable").tolist() if worth[i] and angles[i] > LINEAR]
    for i in order[:MAX_SINGLE_STARTS]:
        changed = state.values.copy()
        changed[groups[i].columns[0]] = values[i]
        yield state._replace(values=changed)


def fit_each(left: FloatArray, velocity: FloatArray, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the parameter [-] of each cause fitted alone, and the squares it leaves, shape (p,) each.

    Args:
        left: data - model in [m], shape (3, n).
        velocity: How each parameter moves the tool centre point, in [m] per unit, shape (p, 3, n).
        turn: How it turns what it moves, in [rad] per unit, shape (p, 3, n).
    """
    rate = np.linalg.norm(turn, axis=1)  # rad per unit, (p, n)
    by = np.where(rate > 1e-12, rate, 1.0)[:, np.newaxis]
    turning = (rate > 1e-12)[:, np.newaxis]
    along = np.where(turning, velocity / by, velocity)
    across = np.where(turning, np.cross(turn / by, along, axis=1), 0.0)

    def residuals(value: FloatArray) -> tuple[FloatArray, FloatArray]:
        angle = (value[:, np.newaxis] * rate)[:, np.newaxis]
        sine = np.where(turning, np.sin(angle), value[:, np.newaxis, np.newaxis])
        moved = sine * along + (1.0 - np.cos(angle)) * across
        slope = np.where(turning, by * (np.cos(angle) * along + np.sin(angle) * across), along)
        return left - moved, slope

    def squares(value: FloatArray) -> FloatArray:
        return np.asarray((residuals(value)[0] ** 2).sum(axis=(1, 2)))

    steep = np.maximum((velocity**2).sum(axis=(1, 2)), np.finfo(float).tiny)
    best = (velocity * left).sum(axis=(1, 2)) / steep
    least = squares(best)
    most = np.where(rate.max(axis=1) > 1e-12, rate.max(axis=1), np.inf)
    for angle in ANGLES:
        start = angle / most
        now = squares(start)
        best, least = np.where(now < least, start, best), np.minimum(now, least)
    for _ in range(8):
        residual, slope = residuals(best)
        step = (slope * residual).sum(axis=(1, 2))
        step = step / np.maximum((slope**2).sum(axis=(1, 2)), np.finfo(float).tiny)
        now = squares(best + step)
        best, least = np.where(now < least, best + step, best), np.minimum(now, least)
    return best, least


def mean_squares(residuals: Sequence[FloatArray], weight: FloatArray, least: float) -> FloatArray:
    """Return the weighted mean square [-] of the residuals of explanations, shape (explanations,).

    Outliers are limited to the same size in all of them, by the median of the best.

    Args:
        residuals: In [m] and [rad], shape (c, n) each.
        weight: Of each component in [1/m] or [1/rad], shape (c,).
        least: Noise floor of a row, in its weights.
    """
    sizes = [np.sqrt(((left * weight[:, np.newaxis]) ** 2).sum(axis=0)) for left in residuals]
    medians = [float(np.median(size[np.isfinite(size)])) for size in sizes if np.isfinite(size).any()]
    most = MAX_MEDIANS * max(min(medians, default=least), least)
    squares = (np.minimum(size, most) ** 2 for size in sizes)
    known = (square[np.isfinite(square)] for square in squares)
    return np.array([float(square.mean()) if len(square) else np.inf for square in known])


def residual_after_fit(
    model: Model, state: State, rows: IntArray, weight: FloatArray, groups: Sequence[Group] | None = None
) -> FloatArray:
    """Return the residual after a linear fit of parameters in [m] and [rad], shape (c, n).

    Outliers of a first fit do not count. The scales of joints are not fitted: one of -1 undoes a sign.

    Args:
        model: The model.
        state: The explanation to which the parameters are added.
        rows: Indices of rows, shape (n,).
        weight: Of each component in [1/m] or [1/rad], shape (c,).
        groups: Whose parameters; all except scales by default.
    """
    if groups is None:
        groups = [group for group in model.groups if group.kind != "joint_scale"]
    left, jacobian = model.linear(state, rows, groups)
    known = np.isfinite(left).all(axis=0)
    after = left
    for _ in range(2):
        flat = (jacobian[:, :, known] * weight[:, np.newaxis]).reshape(len(jacobian), -1)
        size = np.sqrt(np.maximum((flat**2).sum(axis=1), np.finfo(float).tiny))
        flat = flat / size[:, np.newaxis]
        target = flat @ (left[:, known] * weight[:, np.newaxis]).ravel()
        x = np.linalg.solve(flat @ flat.T + RIDGE * np.eye(len(flat)), target) / size
        after = left - np.tensordot(x, jacobian, 1)
        known = find_inliers(after * weight[:, np.newaxis])
    return np.asarray(after)


def _row_mean(left: FloatArray) -> FloatArray:
    """Return the mean of each component over the known rows, shape (c, 1)."""
    known = np.isfinite(left).all(axis=0)
    return np.asarray(left[:, known].mean(axis=1, keepdims=True)) if known.any() else np.zeros((len(left), 1))
