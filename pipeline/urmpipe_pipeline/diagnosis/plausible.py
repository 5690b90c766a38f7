"""Which causes that are there or not are worth a close look: those with which numbers could leave little."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_pipeline.diagnosis.fit import OUTLIER, Model, Rows, inliers
from urmpipe_pipeline.diagnosis.hypotheses import State
from urmpipe_pipeline.log_edits import Edits

NEAREST = 12
"""So many edits are held against all numbers together, those that leave the least by themselves."""

PLAUSIBLE = 4.0
"""An edit is plausible if all numbers together could then leave no more than this times the least square."""

MOST = 6
"""So many edits are plausible at most, the best."""

UNSEEN = 1e-3
"""An edit that changes nothing by more than this share of what means nothing cannot be told from none."""

HALF = 0.5
"""A further edit is worth a look if it leaves less than this share of the square."""

_RIDGE = 1e-10
"""Keeps the equations of twins solvable; columns have unit length."""


def plausible_edits(
    model: Model, edits: Sequence[Edits], zero: State, rows: Rows, floor: FloatArray
) -> list[Edits]:
    """Return the edits with which all numbers together could leave little, the best first.

    Those are looked at that leave the least but for a shift; no edit at all is always looked at.

    Args:
        model: What is held against what it should be.
        edits: What may be there, alone or together.
        zero: Nothing that differs.
        rows: Some rows.
        floor: What means nothing of each component in [m] or [rad], shape (c,).
    """
    every: list[Edits] = [(), *edits]
    least = float(np.linalg.norm(floor * rows.weight))
    states = [replace(zero, edits=one) for one in every]
    raw = [model.residual(state, rows.at) for state in states]
    order = np.argsort(squares([left - _middle(left) for left in raw], rows.weight, least), kind="stable")
    unseen = UNSEEN * floor[:, np.newaxis]
    telling = [
        i for i in order.tolist() if not np.allclose(raw[i] - raw[0], 0.0, 0.0, unseen, equal_nan=True)
    ]
    looked_at = [0, *telling[:NEAREST]]
    lefts = [projected(model, states[i], rows.at, rows.weight) for i in looked_at]
    left_over = squares(lefts, rows.weight, least)
    most = PLAUSIBLE * max(float(left_over.min()), least**2)
    near = [i for i in np.argsort(left_over, kind="stable").tolist() if left_over[i] <= most][:MOST]
    return [every[looked_at[i]] for i in (near if 0 in near else [*near, 0])]


def further_edit(
    model: Model, edits: Sequence[Edits], best: State, rows: Rows, floor: FloatArray
) -> State | None:
    """Return an explanation with one edit more, if something is left to explain and that halves it.

    What means nothing (`floor`) is in [m] and [rad], shape (c,).
    """
    least = float(np.linalg.norm(floor * rows.weight))
    noise = PLAUSIBLE * len(rows.weight)  # all numbers together leave about 1 of each component
    now = model.residual(best, rows.at)
    if squares([now], rows.weight, least)[0] <= noise:
        return None
    states = [
        replace(best, edits=(*best.edits, *one))
        for one in edits
        if len(one) == 1 and one[0] not in best.edits
    ]
    every = squares([now, *(model.residual(one, rows.at) for one in states)], rows.weight, least)
    nearest = int(np.argmin(every))
    return states[nearest - 1] if nearest and every[nearest] <= HALF * every[0] else None


def squares(lefts: Sequence[FloatArray], weight: FloatArray, least: float) -> FloatArray:
    """Return the mean square [-] of what each of some explanations leaves, shape (explanations,).

    Outliers of the best count alike.

    Args:
        lefts: What each leaves in [m] and [rad], shape (c, n) each.
        weight: Of each component in [1/m] or [1/rad], shape (c,).
        least: What means nothing of a row, in its weights.
    """
    sizes = [np.sqrt(((left * weight[:, np.newaxis]) ** 2).sum(axis=0)) for left in lefts]
    medians = [float(np.median(size[np.isfinite(size)])) for size in sizes if np.isfinite(size).any()]
    most = OUTLIER * max(min(medians, default=least), least)
    return np.array([_mean(np.minimum(size, most) ** 2) for size in sizes])


def projected(model: Model, state: State, rows: IntArray, weight: FloatArray) -> FloatArray:
    """Return what all numbers together could leave in [m] and [rad], shape (c, n).

    Outliers of a first fit do not count. The scales of joints are not among them: one of -1 undoes a sign.

    Args:
        model: What is held against what it should be.
        state: What is taken for granted.
        rows: Rows, by index, shape (n,).
        weight: Of each component in [1/m] or [1/rad], shape (c,).
    """
    left, jacobian = model.linear(state, rows, [one for one in model.groups if one.kind != "joint_scale"])
    known = np.isfinite(left).all(axis=0)
    after = left
    for _ in range(2):
        flat = (jacobian[:, :, known] * weight[:, np.newaxis]).reshape(len(jacobian), -1)
        size = np.sqrt(np.maximum((flat**2).sum(axis=1), np.finfo(float).tiny))
        flat = flat / size[:, np.newaxis]
        wanted = flat @ (left[:, known] * weight[:, np.newaxis]).ravel()
        x = np.linalg.solve(flat @ flat.T + _RIDGE * np.eye(len(flat)), wanted) / size
        after = left - np.tensordot(x, jacobian, 1)
        known = inliers(after * weight[:, np.newaxis])
    return np.asarray(after)


def _middle(left: FloatArray) -> FloatArray:
    """Return the mean of each component over the rows that are known, shape (c, 1)."""
    known = np.isfinite(left).all(axis=0)
    return np.asarray(left[:, known].mean(axis=1, keepdims=True)) if known.any() else np.zeros((len(left), 1))


def _mean(values: FloatArray) -> float:
    """Return the mean of what is known; inf of nothing."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else np.inf
