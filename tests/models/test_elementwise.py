"""Vector algebra: that of NumPy, and constants that are folded away at no cost."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.elementwise import Vector, add, cross, dot, minus, plus, scale, subtract, times

small = st.integers(-3, 3).map(float)  # products and sums of them are exact, and 0, 1, -1 are frequent
vectors = st.tuples(small, small, small)


class Unused:
    """An element that can only be turned round: any other operation on it fails."""

    def __neg__(self) -> str:
        """Return what stands for the opposite."""
        return "opposite"


def test_products_with_0_1_and_minus_1_cost_none() -> None:
    x = Unused()
    for found in (times(0.0, x), times(x, 0.0)):
        assert (found, math.copysign(1.0, found)) == (0.0, 1.0)
    assert times(1.0, x) is times(x, 1.0) is x
    assert times(-1.0, x) == times(x, -1.0) == "opposite"


def test_sums_with_0_cost_none() -> None:
    x = Unused()
    assert plus(0.0, x) is plus(x, 0.0) is minus(x, 0.0) is x
    assert minus(0.0, x) == "opposite"


@pytest.mark.parametrize("constant", [0.0, 1.0, -1.0, 2.0, -2.0, 0.5])
def test_constants_and_columns_are_those_of_numpy_in_either_order(constant: float) -> None:
    x = np.array([-2.0, 0.0, 0.5, 3.0])
    for element in (x, *x.tolist()):
        np.testing.assert_array_equal(times(constant, element) + 0.0 * x, constant * element + 0.0 * x)
        np.testing.assert_array_equal(times(element, constant) + 0.0 * x, constant * element + 0.0 * x)
        np.testing.assert_array_equal(plus(constant, element), constant + element)
        np.testing.assert_array_equal(plus(element, constant), constant + element)
        np.testing.assert_array_equal(minus(constant, element), constant - element)
        np.testing.assert_array_equal(minus(element, constant), element - constant)


@given(vectors, vectors, small)
def test_vectors_are_those_of_numpy(a: Vector, b: Vector, factor: float) -> None:
    x, y = np.array(a), np.array(b)
    np.testing.assert_array_equal(add(a, b), x + y)
    np.testing.assert_array_equal(subtract(a, b), x - y)
    np.testing.assert_array_equal(scale(factor, a), factor * x)
    np.testing.assert_array_equal(cross(a, b), np.cross(x, y))
    assert dot(a, b) == x @ y
