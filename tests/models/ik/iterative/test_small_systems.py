"""Systems solved entry by entry, against LAPACK's."""

from __future__ import annotations

import numpy as np
import pytest

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.task import (
    column_squares,
    dot_product,
    factor,
    gram,
    outer_sum,
    product,
    take_rows,
    transposed_product,
)

SIZES = (1, 2, 3, 6, 8)


def matrices(k: int, p: int, n: int = 50) -> FloatArray:
    return np.random.default_rng(k * 10 + p).normal(size=(k, p, n))


@pytest.mark.parametrize("k", SIZES)
def test_a_positive_definite_system_is_solved_as_lapack_solves_it(k: int) -> None:
    A, b = gram(matrices(k, k + 3)), matrices(k, 1)[:, 0]
    peer = np.linalg.solve(A.transpose(2, 0, 1), b.T[..., None])[..., 0].T
    # normal random matrices k x (k + 3) have conditions up to 1e3 squared: 1e-16 * 1e6, with room
    np.testing.assert_allclose(factor(A).solve(b), peer, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("k", SIZES)
def test_a_damped_system_is_that_with_the_damping_on_the_diagonal(k: int) -> None:
    A, b = gram(matrices(k, 2)), matrices(k, 1)[:, 0]
    damping = np.random.default_rng(1).uniform(0.1, 1.0, (b.shape[1],))
    damped = A.transpose(2, 0, 1) + damping[:, None, None] * np.eye(k)
    peer = np.linalg.solve(damped, b.T[..., None])[..., 0].T
    np.testing.assert_allclose(factor(A, damping).solve(b), peer, rtol=1e-10, atol=1e-12)  # condition < 1e3


def test_a_singular_system_has_a_finite_damped_solution() -> None:
    """Rank 1 of 6, damped by 1e-13 of its trace: rounding alone would make pivots negative."""
    rows = matrices(6, 1, 2000)
    A = gram(rows)
    trace = np.einsum("iin->n", A)
    least = 1e-18 * trace  # less than the rounding of the pivots
    assert (factor(A, least).inverse <= 1.0001 / least).all()
    assert (factor(A, least).inverse > 0.0).all()
    step = transposed_product(rows, factor(A, 1e-13 * trace).solve(product(rows, np.ones((1, 2000)))))
    np.testing.assert_allclose(step, 1.0, atol=1e-2)  # rounding 1e-16 beside a damping of 1e-13


def test_products_are_those_of_matrices() -> None:
    M, x, y = matrices(6, 8), matrices(8, 1)[:, 0], matrices(6, 1)[:, 0]
    each = M.transpose(2, 0, 1)
    np.testing.assert_allclose(product(M, x), np.einsum("nij,jn->in", each, x), atol=1e-13)
    np.testing.assert_allclose(transposed_product(M, y), np.einsum("nij,in->jn", each, y), atol=1e-13)
    np.testing.assert_allclose(gram(M), np.einsum("nij,nkj->ikn", each, each), atol=1e-13)
    np.testing.assert_allclose(column_squares(M), np.square(each).sum(axis=1).T, atol=1e-13)
    np.testing.assert_allclose(dot_product(y, y), np.square(y).sum(axis=0), atol=1e-13)
    other = matrices(6, 2)
    peer = each.transpose(0, 2, 1) @ other.transpose(2, 0, 1)
    np.testing.assert_allclose(outer_sum(M, other).transpose(2, 0, 1), peer, atol=1e-13)


@pytest.mark.parametrize("n", [1, 2, 3, 7])
def test_a_system_has_the_same_solution_to_the_last_bit_beside_any_others(n: int) -> None:
    A, b = gram(matrices(6, 7, 100)), matrices(6, 1, 100)[:, 0]
    whole, part = factor(A, 0.01).solve(b), factor(A[..., :n], 0.01).solve(b[:, :n])
    np.testing.assert_array_equal(whole[:, :n], part)


@pytest.mark.parametrize("rows", [[5], [5, 6], [9, 2, 40], list(range(31))], ids=len)
def test_a_sum_has_the_same_bits_beside_any_others_however_its_rows_are_stored(rows: list[int]) -> None:
    M, x, y = matrices(6, 8), matrices(8, 1)[:, 0], matrices(6, 1)[:, 0]
    for form, a, b in ((product, M, x), (transposed_product, M, y), (outer_sum, M, M), (dot_product, x, x)):
        whole = form(a, b)[..., rows]
        np.testing.assert_array_equal(form(take_rows(a, np.array(rows)), take_rows(b, np.array(rows))), whole)
        np.testing.assert_array_equal(form(a[..., rows], b[..., rows]), whole)  # a matrix apart


def test_some_rows_stand_side_by_side() -> None:
    M = matrices(6, 8)
    some = take_rows(M, np.array([3, 1, 7]))
    np.testing.assert_array_equal(some, M[..., [3, 1, 7]])
    assert some.flags.c_contiguous
