"""Vector algebra: that of NumPy, and constants that are folded away at no cost."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.elementwise import (
    Element,
    Vector,
    add,
    cosine_sine,
    cross,
    dot,
    minus,
    plus,
    scale,
    subtract,
    times,
)
from urmpipe_models.kinematics.forward import forward, jacobian
from urmpipe_models.robots.catalogue import load_robot, robot_names

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


def bits(robot: str, q: Sequence[Element]) -> list[list[int]]:
    """Return the bits of all entries of the poses p1..pn and of their Jacobians, one list per row of q."""
    chain = load_robot(robot)
    poses = forward(chain, q)
    entries = [entry for pose in poses for row in (*pose.rotation, pose.translation) for entry in row]
    for point in range(len(poses)):
        entries += [entry for column in jacobian(chain, q, point) for entry in column]
    rows = np.broadcast_arrays(np.empty(np.shape(q[0]) or 1), *entries)[1:]
    return np.array(rows, dtype=np.float64).T.copy().view(np.int64).tolist()


@pytest.mark.parametrize("robot", robot_names())
def test_floats_scalars_and_columns_give_the_same_bits(robot: str) -> None:
    """Also of joints that start at right angles: the value of a joint is never taken for a constant."""
    start = [*map(float, load_robot(robot).start)]
    (of_floats,) = bits(robot, start)
    assert bits(robot, [*map(np.float64, start)]) == [of_floats]
    assert bits(robot, [np.array([value]) for value in start]) == [of_floats]
    assert bits(robot, [np.full(3, value) for value in start]) == [of_floats] * 3


@pytest.mark.parametrize("value", [0.0, 1.0, -1.0])
def test_only_a_float_is_a_constant(value: float) -> None:
    """A value of NumPy that happens to be 0, 1 or -1 is treated as the entry of a column."""
    x = np.float64(-0.0)
    for got, expected in ((times(np.float64(value), x), value * x), (plus(np.float64(value), x), value + x)):
        assert math.copysign(1.0, got) == math.copysign(1.0, expected)
    assert {type(one) for one in cosine_sine(np.float64(value))} == {np.float64}
    assert {type(one) for one in cosine_sine(value)} == {float}
