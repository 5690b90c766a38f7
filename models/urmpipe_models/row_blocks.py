"""Long arrays, worked on in blocks of rows, several blocks side by side."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray

BLOCK = 16384
"""Rows worked on at a time: long enough that NumPy outweighs Python, short enough for a core's cache."""

THREADS = min(4, os.cpu_count() or 1)
"""Blocks worked on side by side: beyond some, Python's own work, which runs alone, sets the pace."""

Block = TypeVar("Block")
Result = TypeVar("Result")


def row_blocks(count: int, size: int = BLOCK) -> list[slice]:
    """Return the slices that part `count` rows into blocks of `size`, the last one shorter."""
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]


def spread_rows(count: int, most: int) -> IntArray:
    """Return at most so many indices of `count` rows, spread evenly from first to last, shape (k,)."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def norms(vectors: FloatArray) -> FloatArray:
    """Return the lengths of vectors, in their unit, shape (n,), with memory for a block of rows beside them.

    Args:
        vectors: In any unit, shape (n, k).
    """
    lengths = np.empty(len(vectors))
    with np.errstate(over="ignore"):  # of a coordinate beyond 1e154, whose square is infinite
        for block in row_blocks(len(vectors)):
            lengths[block] = np.linalg.norm(vectors[block], axis=1)
    return lengths


def side_by_side(
    work: Callable[[Block], Result], blocks: Sequence[Block], threads: int = THREADS
) -> list[Result]:
    """Return what work makes of each block, several at a time: NumPy computes without Python's lock.

    Args:
        work: Called once a block.
        blocks: Slices, indices of rows, or rows themselves.
        threads: Blocks worked on at a time.

    Raises:
        Exception: What work raised first, in the order of the blocks.
    """
    if len(blocks) < 2 or threads < 2:
        return [work(block) for block in blocks]
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, blocks))
