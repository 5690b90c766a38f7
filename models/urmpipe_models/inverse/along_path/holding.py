"""Joints held on their limits along a path: which one meets its limit, and which one leaves it again.

For least motion within limits each sample has to satisfy, with the multiplier y of its target: a joint
between its limits moves by J^T y; one on its upper limit would move up by it, one on its lower limit down.
"""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.inverse.limits import LIMIT_ROUNDING

INWARDS = 1e-10
"""A joint leaves its limit if it would move inwards by more, in [rad] or [m]: rounding lets none go."""


def change(
    q: FloatArray, pull: FloatArray | None, held: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[int, FloatArray]:
    """Return the first sample at which a joint meets or leaves its limit, and where joints are held then.

    Args:
        q: Joint values in [rad] or [m], shape (m, joints).
        pull: How far each joint would move if it were free, in [rad] or [m], shape (m, joints); None where
            all are free.
        held: Where a joint is held in [rad] or [m], NaN of one that is free, shape (joints,).
        lower: Limits in [rad] or [m], shape (joints,).
        upper: Limits in [rad] or [m], shape (joints,).

    Returns:
        The index of the sample, m if there is none, and where joints are held from it on in [rad] or [m],
        shape (joints,).
    """
    free = np.isnan(held)
    beyond = np.where(free, np.maximum(lower - q, q - upper), -np.inf)
    inwards = np.full_like(beyond, -np.inf)
    if pull is not None:
        sense = np.where(held == upper, -1.0, 1.0)
        inwards[:, ~free & (lower < upper)] = (sense * pull)[:, ~free & (lower < upper)]
    meets, leaves = beyond.max(axis=1) > LIMIT_ROUNDING, inwards.max(axis=1) > INWARDS
    at = int(np.argmax(np.append(meets | leaves, True)))
    following = held.copy()
    if at < len(q):
        joint = np.argmax(beyond[at] if meets[at] else inwards[at])
        on = upper[joint] if q[at, joint] > upper[joint] else lower[joint]
        following[joint] = on if meets[at] else np.nan
    return at, following
