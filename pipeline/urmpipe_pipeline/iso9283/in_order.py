"""Choices in order: one candidate a stage, each later than the one before, at the least cost in all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray, IntArray

Stage: TypeAlias = tuple[FloatArray, FloatArray]
"""Times of the candidates, rising, and what each costs, shape (n,) both."""


def in_order(stages: Sequence[Stage]) -> list[int] | int:
    """Return which candidate of each stage is taken, by dynamic programming.

    Of all choices whose times rise from stage to stage, the one with the least sum of costs. Where there is
    none, the number of the first stage, from 0, that no choice reaches.

    Args:
        stages: The candidates of each.
    """
    before: Stage = (np.array([-np.inf]), np.zeros(1))
    came: list[IntArray] = []
    for number, (t, cost) in enumerate(stages):
        earlier_t, earlier = before
        least = np.minimum.accumulate(earlier)
        new = np.concatenate(([True], earlier[1:] < least[:-1]))
        who = np.maximum.accumulate(np.where(new, np.arange(len(earlier)), 0))
        last = np.searchsorted(earlier_t, t, side="left") - 1  # the last of the earlier ones before it
        total = np.where(last >= 0, least[last] + cost, np.inf)
        if not np.isfinite(total).any():
            return number
        came.append(who[last])
        before = t, total
    if not stages:
        return []
    chosen = [int(np.argmin(before[1]))]
    for back in came[:0:-1]:
        chosen.append(int(back[chosen[-1]]))
    return chosen[::-1]
