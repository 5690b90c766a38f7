"""Many targets in blocks, so that a person sees how far the work is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.inverse.solutions import Singular, Solutions
from urmpipe_models.inverse.targets import Targets

BLOCK = 512
"""Targets of a block: enough to be solved together fast, few enough to be told of."""


def solve_in_blocks(
    solve: Callable[[Targets], Solutions], targets: Targets, progress: Callable[[float], None] | None
) -> Solutions:
    """Return the solutions of targets, solved block by block where somebody is told the progress.

    What is found for one target does not depend on which others there are: in blocks it is the same.

    Args:
        solve: Returns the solutions of some targets.
        targets: All of them.
        progress: Told the share that is done, 0..1.
    """
    if progress is None or len(targets) <= BLOCK:
        return solve(targets)
    blocks = []
    for first in range(0, len(targets), BLOCK):
        blocks.append(solve(targets.rows(slice(first, first + BLOCK))))
        progress(min(1.0, (first + BLOCK) / len(targets)))
    return joined(blocks)


def joined(blocks: Sequence[Solutions]) -> Solutions:
    """Return the solutions of several blocks of targets as one; those with fewer branches are filled up."""
    widest = max(blocks, key=lambda one: len(one.branches))
    count = len(widest.branches)
    return Solutions(
        np.concatenate([_filled(one.q, count, np.nan) for one in blocks]),
        widest.branches,
        np.concatenate([_filled(one.reasons, count, "") for one in blocks]),
        tuple(_families(blocks, count)),
        np.concatenate([_filled(one.shortfall, count, 0.0) for one in blocks]),
        np.concatenate([_filled(one.labels, count, "") for one in blocks]),
    )


def _filled(values: NDArray[Any], count: int, nothing: float | str) -> NDArray[Any]:
    """Return values of shape (n, k, ...) with as many columns as asked for."""
    wide = np.full((len(values), count, *values.shape[2:]), nothing, dtype=values.dtype)
    wide[:, : values.shape[1]] = values
    return wide


def _families(blocks: Sequence[Solutions], count: int) -> Iterator[Singular]:
    """Yield each family of singular poses with all its solutions."""
    named = dict.fromkeys((one.family, one.free, one.chosen) for block in blocks for one in block.singular)
    for name in named:
        parts = []
        for block in blocks:
            where = np.zeros((len(block), count), dtype=bool)
            for one in block.singular:
                if (one.family, one.free, one.chosen) == name:
                    where[:, : one.where.shape[1]] |= one.where
            parts.append(where)
        family, free, chosen = name
        yield Singular(family, np.concatenate(parts), free, chosen)
