"""How much of a deviation each of several causes explains."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from itertools import combinations
from math import factorial
from typing import TypeVar

Part = TypeVar("Part", bound=Hashable)


def shapley_shares(parts: Sequence[Part], left: Callable[[frozenset[Part]], float]) -> dict[Part, float]:
    """Return the share of the mean square that each cause explains, whatever their order.

    phi_i = sum_S |S|! (m - |S| - 1)! / m! (v(S) - v(S + i)) / v(nothing), with v(S) what is left without the
    causes S, over all sets S of the m - 1 others. The shares add up to what all of them explain together.

    Args:
        parts: The m causes.
        left: Returns the mean square that is left without some of them, in any unit.

    Source: [Shapley1953]_.
    """
    count = len(parts)
    square = {kept: left(kept) for size in range(count + 1) for kept in _subsets(parts, size)}
    whole = square[frozenset()] or 1.0
    shares = {}
    for part in parts:
        others = [other for other in parts if other != part]
        shares[part] = sum(
            factorial(size) * factorial(count - size - 1) / factorial(count)
            * (square[gone] - square[gone | {part}]) / whole
            for size in range(count) for gone in _subsets(others, size)
        )  # fmt: skip
    return shares


def _subsets(parts: Sequence[Part], size: int) -> list[frozenset[Part]]:
    """Return the sets of so many causes."""
    return [frozenset(some) for some in combinations(parts, size)]
