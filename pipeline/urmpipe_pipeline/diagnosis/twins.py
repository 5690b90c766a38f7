"""Twins: causes that do the same to first order, and at full size too, or not."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline.diagnosis.fit import Model, Rows
from urmpipe_pipeline.diagnosis.hypotheses import State


class Placing(Protocol):
    """A search among the hypotheses of a model."""

    @property
    def model(self) -> Model:
        """What is held against what it should be."""

    @property
    def floor(self) -> FloatArray:
        """What means nothing, of each component in [m] or [rad], shape (c,)."""

    def placed(self, state: State, rows: Rows) -> State:
        """Return an explanation with the best numbers of what is always taken."""


def exchanged(state: State, c: int, d: int, gram: FloatArray) -> State:
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


def same_at_full_size(search: Placing, state: State, other: State, rows: Rows) -> bool:
    """Tell whether two explanations leave the same: root mean square of the difference below the floor."""
    one, two = (search.model.residual(search.placed(each, rows), rows.at) for each in (state, other))
    between = (one - two) / search.floor[:, np.newaxis]
    known = np.isfinite(between).all(axis=0)
    return bool(known.any() and np.mean(between[:, known] ** 2) < 1.0)
