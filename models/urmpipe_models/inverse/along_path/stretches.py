"""Stretches of samples that have something in common."""

from __future__ import annotations

import numpy as np

from urmpipe_models.arrays import BoolArray


def stretches(where: BoolArray) -> list[tuple[int, int]]:
    """Return the first and last index of every run of true values of `where`, shape (n,), ascending."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], where, [False]))))
    return [(int(first), int(last) - 1) for first, last in edges.reshape(-1, 2)]
