"""Two links in a plane: joints 2 and 3 of an arm whose axes 2, 3 and 4 are parallel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from urmpipe_models.arrays import BoolArray, FloatArray, TextArray
from urmpipe_models.inverse.closed.outer_joints import EDGE, REACH, texts_where
from urmpipe_models.inverse.closed.parallel_geometry import ParallelGeometry


@dataclass(frozen=True, slots=True)
class TwoLinks:
    """Joints 2 and 3 of both elbows, each of shape (2, a, b, n); their signs are those of z.

    Attributes:
        q2: In [rad].
        q3: In [rad].
        reasons: Why there are none.
        stretched: Where both elbows are one, the links stretched.
        withdrawn: The same, one link folded back on the other.
        free: Where axis 4 is on axis 2, which leaves q2 free.
    """

    q2: FloatArray
    q3: FloatArray
    reasons: TextArray
    stretched: BoolArray
    withdrawn: BoolArray
    free: BoolArray


def two_links(
    arm: ParallelGeometry, place: tuple[FloatArray, FloatArray], side: FloatArray, near: FloatArray
) -> TwoLinks:
    """Return q2 and q3 that bring the point p4 to a place in the plane.

    With the links' lengths l2, l3, the distance r and the angle psi between the links
    tan^2(psi/2) = (l2 + l3 - r)(l2 + l3 + r) / ((r - |l2 - l3|)(r + |l2 - l3|)).

    Args:
        arm: The arm.
        place: Where p4 shall be in the plane in [m], two arrays of the same shape (..., n).
        side: 1 or -1 [-]: the sign of the first elbow's bend, shape (..., n) or one that broadcasts to it.
        near: What q2 takes where it is free, in [rad], likewise.
    """
    upper, fore = link_lengths(arm)
    r = np.hypot(*place)
    short, long = abs(upper - fore), upper + fore
    stretched, withdrawn = long - r <= EDGE * arm.size, r - short <= EDGE * arm.size
    reached = (r <= long + REACH * arm.size) & (r >= short - REACH * arm.size)
    up = np.where(stretched, 0.0, (long - r) * (long + r))
    down = np.where(withdrawn, 0.0, (r - short) * (r + short))
    psi = 2.0 * np.arctan2(np.sqrt(np.maximum(up, 0.0)), np.sqrt(np.maximum(down, 0.0)))
    psi = np.where(reached, np.stack((-side * psi, side * psi)), np.nan)
    first = float(np.arctan2(arm.p3[1], arm.p3[0]))
    second = float(np.arctan2(arm.p4[1] - arm.p3[1], arm.p4[0] - arm.p3[0]))
    free = reached & (r <= REACH * arm.size)
    to_place = np.arctan2(place[1], place[0])
    bend = np.arctan2(fore * np.sin(psi), upper + fore * np.cos(psi))
    q2 = np.where(free, near, to_place - first - bend)
    reasons = texts_where(
        ~reached & np.isfinite(r),
        "axis 4 is {} m from axis 2, allowed: {} to {} m",
        r,
        short,
        long,
    )
    return TwoLinks(
        q2 + np.zeros_like(psi),
        psi - (second - first),
        np.broadcast_to(reasons, psi.shape),
        stretched & reached,
        withdrawn & reached,
        free,
    )


def link_lengths(arm: ParallelGeometry) -> tuple[float, float]:
    """Return the lengths of the links from axis 2 to axis 3 and on to axis 4, in [m]."""
    return (
        float(np.hypot(arm.p3[0], arm.p3[1])),
        float(np.hypot(arm.p4[0] - arm.p3[0], arm.p4[1] - arm.p3[1])),
    )
