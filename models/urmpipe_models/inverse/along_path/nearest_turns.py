"""Samples that were solved beside each other, brought into the turns of the one before each."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.inverse.limits import in_nearest_turn


def in_nearest_turns(chain: Chain, q: FloatArray, last: FloatArray) -> FloatArray:
    """Return joint values with each joint in the allowed turn that is nearest to the sample before.

    Args:
        chain: The arm.
        q: Joint values in [rad] or [m], within limits, shape (m, joints); NaN where there are none.
        last: Those of the sample before them, in [rad] or [m], shape (joints,).

    Returns:
        Joint values in [rad] or [m], shape (m, joints).
    """
    turned = q.copy()
    for sample in np.flatnonzero(np.isfinite(q).all(axis=1)).tolist():
        turned[sample] = last = in_nearest_turn(chain, q[sample], last)[0]
    return turned
