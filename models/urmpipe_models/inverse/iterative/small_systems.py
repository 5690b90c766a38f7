"""Small symmetric positive definite systems, many at once: one array an entry.

`numpy.linalg.solve` calls LAPACK once a system, which costs more than the Jacobian that a system of six
unknowns is about. Here a matrix is an array of shape (k, k, n), so that an entry's n values lie side by side
and each elimination is a few NumPy operations on all systems. Sums run term by term (see `_sum`): their
rounding must not depend on n, or what one row comes to would depend on which others are solved beside it.
Entries may be in any unit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.arrays import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Factor:
    """A = L D L^T, the Cholesky factor without square roots.

    Attributes:
        lower: L below its diagonal of ones [-], shape (k, k, n); what stands elsewhere is not used.
        inverse: 1 / D_i in one over the unit of A, shape (k, n).
    """

    lower: FloatArray
    inverse: FloatArray

    def solve(self, b: FloatArray) -> FloatArray:
        """Return x of A x = b, both of shape (k, n), b in any unit, x in that over the unit of A."""
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
        A: Symmetric, in any unit, shape (k, k, n); positive definite where mu is 0.
        damping: mu in the same unit, not negative, shape (n,) or one for all.
    """
    lower, scaled, inverse = np.empty(A.shape), np.empty(A.shape), np.empty(A.shape[1:])
    for j in range(len(A)):
        column = A[j:, j] - product(lower[j:, :j], scaled[j, :j]) if j else A[:, 0]
        np.divide(1.0, np.maximum(column[0] + damping, damping), out=inverse[j])
        scaled[j + 1 :, j] = column[1:]
        np.multiply(column[1:], inverse[j], out=lower[j + 1 :, j])
    return Factor(lower, inverse)


def gram(M: FloatArray) -> FloatArray:
    """Return M M^T, shape (k, k, n), of matrices of shape (k, p, n) in any unit."""
    return _sum("ipn,jpn->ijn", M, M)


def product(M: FloatArray, x: FloatArray) -> FloatArray:
    """Return M x, shape (k, n), of matrices of shape (k, p, n) and vectors of shape (p, n) in any unit."""
    return _sum("kpn,pn->kn", M, x)


def transposed_product(M: FloatArray, x: FloatArray) -> FloatArray:
    """Return M^T x, shape (p, n), of matrices of shape (k, p, n) and vectors of shape (k, n) in any unit."""
    return _sum("kpn,kn->pn", M, x)


def dot_product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return sum_k a_k b_k, shape (n,), of a and b of shape (k, n) in any unit."""
    return _sum("kn,kn->n", a, b)


def column_squares(M: FloatArray) -> FloatArray:
    """Return the squared lengths, shape (p, n), of the columns of M, shape (k, p, n), in any unit."""
    return _sum("kpn,kpn->pn", M, M)


def outer_sum(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return sum_k a_k b_k^T, shape (p, r, n), of a, shape (k, p, n), and b, (k, r, n), in any units."""
    return _sum("kpn,krn->prn", a, b)


def rows_of(a: FloatArray, rows: NDArray[np.intp]) -> FloatArray:
    """Return some of the n of an array of shape (..., n) in any unit, their values side by side.

    a[..., rows] has them a matrix apart, which makes all that follows several times as slow.
    """
    return np.take(a, rows, axis=-1)


def _sum(subscripts: str, a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a sum of products whose inner loop runs over the n systems, term after term for each.

    Such is `numpy.einsum` where the n values lie side by side and are more than one; of one alone it would
    sum in another order.
    """
    if a.shape[-1] == 1:
        return np.asarray(np.einsum(subscripts, a.repeat(2, -1), b.repeat(2, -1))[..., :1])
    return np.asarray(np.einsum(subscripts, _side_by_side(a), _side_by_side(b)))


def _side_by_side(a: FloatArray) -> FloatArray:
    """Return an array whose n values lie side by side."""
    return a if a.strides[-1] == a.itemsize else np.ascontiguousarray(a)
