"""The causes of a deviation that begin at some row, as far as two sides can tell them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray, spread_rows
from urmpipe_models.wraps import FULL_TURN
from urmpipe_pipeline.diagnosis.fit import Model
from urmpipe_pipeline.diagnosis.hypotheses import State
from urmpipe_pipeline.runs.reading_errors import Edit, EditKind, Edits

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
