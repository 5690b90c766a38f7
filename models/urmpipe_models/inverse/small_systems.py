"""Small symmetric positive definite systems, elementwise: one array an entry, all rows at once.

`numpy.linalg.solve` calls LAPACK once a row, which costs more than the Jacobian that the row is about.
Here a system of a few unknowns is written out entry by entry, so that one NumPy operation serves a
block of rows; constant zeros fold away (see `elementwise`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import Element, minus, plus, times


@dataclass(frozen=True, slots=True)
class Factor:
    """A = L D L^T, the Cholesky factor without square roots.

    Attributes:
        lower: Row i holds L_i0 .. L_i,i-1; the diagonal is 1.
        inverse: 1 / D_i.
    """

    lower: tuple[tuple[Element, ...], ...]
    inverse: tuple[Element, ...]

    def solve(self, b: Sequence[Element]) -> list[Element]:
        """Return x of A x = b."""
        x: list[Element] = []
        for row, right in zip(self.lower, b, strict=True):
            x.append(_less(right, row, x))
        x = [times(value, inverse) for value, inverse in zip(x, self.inverse, strict=True)]
        for i in reversed(range(len(x))):
            x[i] = _less(x[i], [row[i] for row in self.lower[i + 1 :]], x[i + 1 :])
        return x


def factor(A: Sequence[Sequence[Element]], damping: Element = 0.0) -> Factor:
    """Return the factor of A + damping I.

    Where A is positive semidefinite and the damping more than 0, no pivot D_i is less than the damping;
    rounding, which can make it so where A is singular, is held to that.

    Args:
        A: The lower triangle: row i holds A_i0 .. A_ii.
        damping: One element, not negative; 0 of a matrix that is positive definite by itself.
    """
    damped = not (isinstance(damping, float) and damping == 0.0)
    lower: list[tuple[Element, ...]] = []
    inverse: list[Element] = []
    for i, entries in enumerate(A):
        scaled: list[Element] = []  # L_ij D_j
        for j in range(i):
            scaled.append(_less(entries[j], lower[j], scaled))
        row = tuple(times(value, inverse[j]) for j, value in enumerate(scaled))
        pivot = _less(plus(entries[i], damping), row, scaled)
        lower.append(row)
        inverse.append(1.0 / (np.maximum(pivot, damping) if damped else pivot))
    return Factor(tuple(lower), tuple(inverse))


def gram(rows: Sequence[Sequence[Element]]) -> list[list[Element]]:
    """Return the lower triangle of M M^T, M given by its rows."""
    return [[dot_product(rows[i], rows[j]) for j in range(i + 1)] for i in range(len(rows))]


def dot_product(a: Sequence[Element], b: Sequence[Element]) -> Element:
    """Return sum_k a_k b_k."""
    total: Element = 0.0
    for x, y in zip(a, b, strict=True):
        total = plus(total, times(x, y))
    return total


def _less(value: Element, a: Sequence[Element], b: Sequence[Element]) -> Element:
    """Return value - sum_k a_k b_k."""
    for x, y in zip(a, b, strict=True):
        value = minus(value, times(x, y))
    return value
