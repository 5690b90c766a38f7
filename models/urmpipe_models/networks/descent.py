"""From rough configurations to such that close: Levenberg-Marquardt on many at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, IndexArray
from urmpipe_models.inverse.iterative.descent import FIRST_GAIN, GAINS, LEAST_RATIO, STATIONARY, damped_step
from urmpipe_models.inverse.iterative.small_systems import (
    column_squares,
    dot_product,
    product,
    transposed_product,
)
from urmpipe_models.networks.closure import scaled_closure
from urmpipe_models.networks.mechanism import Mechanism
from urmpipe_models.networks.rotations import wrap_rotation_vector

STEPS = 300
"""The most steps of a start."""

ENOUGH = 1e-14
"""The length of the residual, in lengths of the mechanism and [rad], from which on it is rounding."""

STUCK = 1e-3
"""Where the cosine between e and what each variable can change of it is less than this times the root of |e|,
e cannot be made 0 near by: on the way to a singular assembly, where |e| falls as the square of the distance,
the cosine falls as the distance."""

FLOOR = 1e-13
"""The least damping: singular directions, as of redundant constraints, must not amplify rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Reached:
    """Where starts have come to.

    Attributes:
        x: The variables, shape (variables, n), in [m], [rad] and as controls are given.
        gap: The largest entry of the residual, in lengths of the mechanism and [rad], shape (n,); NaN where x
            is no configuration.
    """

    x: FloatArray
    gap: FloatArray


def descend(mechanism: Mechanism, x: FloatArray, free: IndexArray, *, patient: bool = True) -> Reached:
    """Return the configurations nearby that close, or come nearest to it.

    Each step is the least of (J^T J + mu I) dx = -J^T e, in lengths of the mechanism and [rad], with mu in
    proportion to |e|^2: so it ends in steps of Gauss and Newton, and moves nothing that need not move.

    Args:
        mechanism: The network.
        x: The starts, shape (variables, n), in [m], [rad] and as controls are given.
        free: The numbers of the variables that may change, shape (free,) [-].
        patient: Whether the least gap is sought where nothing closes; else a start is given up there.
    """
    found = np.array(x, dtype=np.float64)
    rows = np.arange(found.shape[1])
    gain = np.full(len(rows), FIRST_GAIN)
    now = _scaled(mechanism, found, free)
    error = np.array(now.error)
    for _ in range(STEPS):
        going = _going(now, gain, patient)
        if not going.any():
            break
        rows, gain, now = rows[going], gain[going], now.kept(going)
        x_now = found[:, rows]
        square = dot_product(now.error, now.error)
        step = damped_step(now.jacobian, -now.error, gain * square + FLOOR)
        moved = np.array(x_now)
        moved[free] += step * mechanism.column_scales[free, np.newaxis]
        for some in mechanism.rotations:
            moved[some] = wrap_rotation_vector(tuple(moved[some]))
        new = _scaled(mechanism, moved, free)
        left = now.error + product(now.jacobian, step)
        foreseen = square - dot_product(left, left)
        gained = square - dot_product(new.error, new.error)
        taken = (gained > LEAST_RATIO * foreseen) & (gained > 0.0)
        good, poor = taken & (gained > 0.75 * foreseen), ~taken | (gained < 0.25 * foreseen)
        gain = np.clip(gain * np.where(good, 0.125, np.where(poor, 4.0, 1.0)), *GAINS)
        found[:, rows[taken]], error[:, rows[taken]] = moved[:, taken], new.error[:, taken]
        now = new.or_else(taken, now)
    return Reached(found, np.abs(error).max(axis=0, initial=0.0))


@dataclass(frozen=True, slots=True, eq=False)
class _Scaled:
    """Residual and Jacobian in lengths of the mechanism and [rad], shape (rows, n) and (rows, free, n)."""

    error: FloatArray
    jacobian: FloatArray

    def kept(self, which: BoolArray) -> _Scaled:
        """Return those of some starts."""
        return _Scaled(self.error[:, which], self.jacobian[:, :, which])

    def or_else(self, taken: BoolArray, other: _Scaled) -> _Scaled:
        """Return these where they are taken, else those of another."""
        return _Scaled(
            np.where(taken, self.error, other.error), np.where(taken, self.jacobian, other.jacobian)
        )


def _scaled(mechanism: Mechanism, x: FloatArray, free: IndexArray) -> _Scaled:
    """Return residual and Jacobian at configurations, scaled."""
    closure = scaled_closure(mechanism, x)
    return _Scaled(closure.residual, closure.jacobian[:, free])


def _going(now: _Scaled, gain: FloatArray, patient: bool) -> BoolArray:
    """Return which starts go on: those that are finite, not closed, and not at a least residual."""
    square = dot_product(now.error, now.error)
    slope = transposed_product(now.jacobian, now.error)
    least = np.maximum(STATIONARY, 0.0 if patient else STUCK * square**0.25)
    moves = slope * slope > least**2 * square * column_squares(now.jacobian)
    under_way = (square > ENOUGH**2) & (square < np.inf) & (gain < GAINS[1])
    return np.asarray(under_way & moves.any(axis=0))
