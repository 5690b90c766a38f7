"""Small symmetric positive definite systems, many at once: one array an entry.

`numpy.linalg.solve` calls LAPACK once a system, which costs more than the Jacobian that a system of six
unknowns is about. Here a matrix is an array of shape (k, k, n), so that an entry's n values lie side by side
and each elimination is a few NumPy operations on all systems. Sums are written term by term: their rounding
must not depend on n, or what one row comes to would depend on which others are solved beside it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Factor:
    """A = L D L^T, the Cholesky factor without square roots.

    Attributes:
        lower: L below its diagonal of ones, shape (k, k, n); what stands elsewhere is not used.
        inverse: 1 / D_i, shape (k, n).
    """

    lower: FloatArray
    inverse: FloatArray

    def solve(self, b: FloatArray) -> FloatArray:
        """Return x of A x = b, both of shape (k, n)."""
        x = np.array(b)
        for j in range(len(x) - 1):
            x[j + 1 :] -= self.lower[j + 1 :, j] * x[j]
        x *= self.inverse
        for j in range(len(x) - 1, 0, -1):
            x[:j] -= self.lower[j, :j] * x[j]
        return x


def factor(A: FloatArray, damping: FloatArray | float = 0.0) -> Factor:
    """Return the factor of A + mu I.

    Where A is positive semidefinite no pivot D_i is less than mu. Rounding, which can make it so where A is
    singular, is held to that: the factor is finite for any such A if mu > 0.

    Args:
        A: Symmetric, shape (k, k, n); positive definite where mu is 0.
        damping: mu, not negative, shape (n,) or one for all.
    """
    lower, scaled, inverse = np.zeros(A.shape), np.zeros(A.shape), np.empty(A.shape[1:])
    for j in range(len(A)):
        column = A[j:, j] - product(lower[j:, :j], scaled[j, :j]) if j else A[:, 0]
        np.divide(1.0, np.maximum(column[0] + damping, damping), out=inverse[j])
        scaled[j + 1 :, j] = column[1:]
        np.multiply(column[1:], inverse[j], out=lower[j + 1 :, j])
    return Factor(lower, inverse)


def gram(M: FloatArray) -> FloatArray:
    """Return M M^T, shape (k, k, n), of matrices of shape (k, p, n)."""
    square = np.empty((len(M), len(M), M.shape[2]))
    for i, row in enumerate(M):
        square[i, : i + 1] = square[: i + 1, i] = product(M[: i + 1], row)
    return square


def product(M: FloatArray, x: FloatArray) -> FloatArray:
    """Return M x, shape (k, n), of matrices of shape (k, p, n) and vectors of shape (p, n)."""
    total: FloatArray = M[:, 0] * x[0]
    for p in range(1, len(x)):
        total += M[:, p] * x[p]
    return total


def transposed_product(M: FloatArray, x: FloatArray) -> FloatArray:
    """Return M^T x, shape (p, n), of matrices of shape (k, p, n) and vectors of shape (k, n)."""
    return dot_product(M, x)


def dot_product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return sum_k a_k b_k, shape (..., n), of a of shape (k, ..., n) and b of shape (k, n) or that of a."""
    total: FloatArray = a[0] * b[0]
    for k in range(1, len(a)):
        total += a[k] * b[k]
    return total
