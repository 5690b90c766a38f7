"""Joint logs that are held between samples: their samples on communication points, and between them.

Joint values may wrap, so nothing is in between: at a communication point that misses a sample the one before
is held, against a reference that has moved on.
"""

from __future__ import annotations

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.runs.grid import REGULAR


def on_points(t_ns: IntArray, step: float) -> IntArray:
    """Return times of which those on a communication point are exactly its time, not a rounding off it.

    Args:
        t_ns: Times in integer [ns], strictly rising, shape (n,).
        step: Communication step in [s].

    Returns:
        The times in integer [ns], shape (n,).
    """
    if len(t_ns) < 2:
        return t_ns
    points = _points(np.rint(t_ns / (step * 1e9)), step)
    near = np.abs(points - t_ns) <= REGULAR * np.diff(t_ns).min()
    return np.where(near, points, t_ns)


def between_samples(block: str, t_ns: IntArray, step: float, count: int) -> LogWarning | None:
    """Return that communication points lie between two samples of a log; None if none does.

    Args:
        block: The block that plays the log.
        t_ns: Times of its samples in integer [ns], strictly rising, shape (n,).
        step: Communication step in [s].
        count: Number of steps.
    """
    points = _points(np.arange(count + 1), step)
    points = points[(points >= t_ns[0]) & (points <= t_ns[-1])]
    late = points - t_ns[np.searchsorted(t_ns, points, side="right") - 1]
    if not np.any(late):
        return None
    found = f"{np.count_nonzero(late)} of {len(points)} communication points lie between samples of the log"
    held = f"where the previous sample is held for at most {late.max() / 1e6:.4g} ms"
    return LogWarning("held", f"block {block}: {found}, {held}: deviations there are not those of the log")


def _points(k: FloatArray | IntArray, step: float) -> IntArray:
    """Return the times of communication points in integer [ns], as a table rounds them."""
    return np.rint(k * step * 1e9).astype(np.int64)
