"""In-between samples: what a linear resampling leaves on a wrap, found in a whole log and repaired.

A log that was resampled before its wraps were undone holds values on the straight line from +pi to -pi,
where the joint never was. `repolarize` tells those that hide a wrap from it. Here the others are found: next
to a step that is a wrap alone, where it takes the sample after to see them. The offline part of the
repolarizer, then, which needs the whole log.
"""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray

FAR = 4.0
"""A sample lies off the line of its neighbours if by more than this times the motion around it ..."""

PERCEPTIBLE = 5e-4
"""... and by more than this share of a period: 0.18 deg, a few steps of a coarse encoder."""

AROUND = (-4, -3, -2, -1, 2, 3, 4, 5)
"""The steps around sample s whose speeds are the motion around it: step i leads to sample i."""


def beside_wraps(q: FloatArray, x: FloatArray, t: FloatArray, wraps: IntArray, period: float) -> IntArray:
    """Return the in-between samples beside the wraps of a joint, as far as they can be told.

    An in-between sample lies between its neighbours in the file, which are a wrap apart; but off the line
    between them, once repolarized, by far more than the joint moves in the samples around. A clean wrap
    never lies between its neighbours, whatever the noise or the speed.

    Args:
        q: Values in the file's turns that are not missing, in the unit of the period, shape (n,).
        x: The same repolarized, in the unit of the period, shape (n,).
        t: Their times in [s], shape (n,).
        wraps: Index of every value to which a wrap leads, shape (r,).
        period: P, 2 pi for [rad], 360 for [deg].

    Returns:
        Their indices, ascending, shape (b,).
    """
    at = np.setxor1d(wraps - 1, wraps)  # one of the two steps beside each is a wrap, not both
    at = at[(at > 0) & (at < len(q) - 1)]
    at = at[(q[at] - q[at - 1]) * (q[at + 1] - q[at]) > 0.0]
    off = np.abs(off_line(x, t, at))
    motion = np.abs(x[at + 1] - x[at - 1]) / (t[at + 1] - t[at - 1])
    for offset in AROUND:
        i = at + offset
        inside = (i > 0) & (i < len(x))
        j = np.where(inside, i, 1)
        motion = np.maximum(motion, np.where(inside, np.abs(x[j] - x[j - 1]) / (t[j] - t[j - 1]), 0.0))
    usual = motion * (t[at + 1] - t[at - 1]) / 2.0
    return np.asarray(at[(off > FAR * usual) & (off > PERCEPTIBLE * period)], dtype=np.int64)


def off_line(x: FloatArray, t: FloatArray, at: IntArray) -> FloatArray:
    """Return how far samples lie from the straight line, in time, through their neighbours.

    Args:
        x: Values in any unit, shape (n,).
        t: Their times in [s], shape (n,).
        at: Indices of the samples, neither the first nor the last, shape (b,).

    Returns:
        Signed distances x_s - (x_{s-1} + (t_s - t_{s-1}) / (t_{s+1} - t_{s-1}) (x_{s+1} - x_{s-1})) in the
        unit of x, shape (b,).
    """
    share = (t[at] - t[at - 1]) / (t[at + 1] - t[at - 1])
    return np.asarray(x[at] - x[at - 1] - share * (x[at + 1] - x[at - 1]), dtype=np.float64)


def repair(x: FloatArray, t: FloatArray, in_between: IntArray) -> FloatArray:
    """Return repolarized values with the in-between samples on the straight line through their neighbours.

    Args:
        x: Repolarized values of the joints in any unit, shape (n, joints); NaN where a sample is missing.
        t: Time of each row in [s], shape (n,).
        in_between: Row and joint index of each in-between sample, shape (b, 2).

    Returns:
        A new array in the unit of x, shape (n, joints); every other value is the same bit for bit.
    """
    repaired = x.copy()
    for j in np.unique(in_between[:, 1]):
        rows = in_between[in_between[:, 1] == j, 0]
        good = ~np.isnan(x[:, j])
        good[rows] = False
        repaired[rows, j] = np.interp(t[rows], t[good], x[good, j])
    return repaired
