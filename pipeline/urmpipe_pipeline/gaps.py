"""Gaps: rows of a log that are further apart than its others."""

from __future__ import annotations

import numpy as np

from urmpipe_models.elementwise import BoolArray, IntArray

GAP = 3.0
"""Two rows further apart than this many median periods have a gap between them, in which nothing is known."""

MISSED_SAMPLE = 1.5
"""Two values of a joint further apart than this many median periods lack one between them; a joint may turn
unseen there."""


def gaps_behind(t_ns: IntArray) -> BoolArray:
    """Return which rows at integer times in [ns], shape (n,), have a gap behind them, shape (n - 1,)."""
    step = np.diff(t_ns)
    return np.asarray(step > GAP * np.median(step)) if len(step) else np.empty(0, dtype=np.bool_)


def inside_gaps(at_ns: IntArray, known_ns: IntArray) -> BoolArray:
    """Return which times lie strictly inside a gap between two known ones, shape (n,).

    Both are integer times in [ns], of shape (n,) and, rising, (k,).
    """
    if len(known_ns) < 2:
        return np.zeros(len(at_ns), dtype=np.bool_)
    after = np.clip(np.searchsorted(known_ns, at_ns, side="left"), 1, len(known_ns) - 1)
    wide = gaps_behind(known_ns)[after - 1]
    return np.asarray(wide & (at_ns > known_ns[after - 1]) & (at_ns < known_ns[after]))
