"""What a gap is: rows that lie further apart than the others, between which nothing is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import IntArray

GAP = 3.0
"""Two rows further apart than this many median periods have a gap between them."""


def apart(known_ns: IntArray) -> NDArray[np.bool_]:
    """Tell which times are followed by a gap.

    Args:
        known_ns: Rising times in [ns], shape (n,).

    Returns:
        Shape (n - 1,).
    """
    step = np.diff(known_ns)
    return np.asarray(step > GAP * np.median(step)) if len(step) else np.empty(0, dtype=np.bool_)


def inside_gaps(at_ns: IntArray, known_ns: IntArray) -> NDArray[np.bool_]:
    """Tell which times lie strictly inside a gap between two known ones.

    Args:
        at_ns: Times in [ns], shape (n,).
        known_ns: Rising times in [ns], shape (k,).

    Returns:
        Shape (n,).
    """
    if len(known_ns) < 2:
        return np.zeros(len(at_ns), dtype=np.bool_)
    after = np.clip(np.searchsorted(known_ns, at_ns, side="left"), 1, len(known_ns) - 1)
    wide = apart(known_ns)[after - 1]
    return np.asarray(wide & (at_ns > known_ns[after - 1]) & (at_ns < known_ns[after]))
