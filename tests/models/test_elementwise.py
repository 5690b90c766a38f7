"""Vector algebra against NumPy, folded constants, and sine and cosine against mpmath with 1200 bits."""

from __future__ import annotations

import hashlib
import math
import operator
from collections.abc import Sequence

import mpmath  # type: ignore[import-untyped]
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from urmpipe_models.elementwise import (
    BLOCK,
    Element,
    FloatArray,
    Vector,
    add,
    cosine_sine,
    cosine_sine_table,
    cross,
    dot,
    map_blocks,
    minus,
    plus,
    row_blocks,
    row_norms,
    scale,
    spread_rows,
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


def test_products_with_0_1_and_minus_1_and_sums_with_0_cost_none() -> None:
    x = Unused()
    for found in (times(0.0, x), times(x, 0.0)):
        assert (found, math.copysign(1.0, found)) == (0.0, 1.0)
    assert times(1.0, x) is times(x, 1.0) is x
    assert times(-1.0, x) == times(x, -1.0) == "opposite"
    assert plus(0.0, x) is plus(x, 0.0) is minus(x, 0.0) is x
    assert minus(0.0, x) == "opposite"


@pytest.mark.parametrize("constant", [0.0, 1.0, -1.0, 2.0, -2.0, 0.5])
def test_constants_and_columns_are_those_of_numpy_in_either_order(constant: float) -> None:
    x = np.array([-2.0, 0.0, 0.5, 3.0])
    for folded, plain in ((times, operator.mul), (plus, operator.add), (minus, operator.sub)):
        for element in (x, *x.tolist()):
            for pair in ((constant, element), (element, constant)):
                np.testing.assert_array_equal(folded(*pair) + 0.0 * x, plain(*pair) + 0.0 * x)


@given(vectors, vectors, small)
def test_vectors_are_those_of_numpy(a: Vector, b: Vector, factor: float) -> None:
    x, y = np.array(a), np.array(b)
    np.testing.assert_array_equal(add(a, b), x + y)
    np.testing.assert_array_equal(subtract(a, b), x - y)
    np.testing.assert_array_equal(scale(factor, a), factor * x)
    np.testing.assert_array_equal(cross(a, b), np.cross(x, y))
    assert dot(a, b) == x @ y


def test_long_arrays_are_computed_in_blocks() -> None:
    rows = np.random.default_rng(1).normal(size=(BLOCK + 1, 3))
    np.testing.assert_array_equal(row_norms(rows), np.linalg.norm(rows, axis=1))
    assert row_blocks(5, 2) == [slice(0, 2), slice(2, 4), slice(4, 5)]
    assert [spread_rows(5, most).tolist() for most in (9, 3, 1)] == [[0, 1, 2, 3, 4], [0, 2, 4], [0]]
    for threads in (1, 2):
        assert map_blocks(str, [2, 3], threads) == ["2", "3"]
        with pytest.raises(ZeroDivisionError):
            map_blocks(lambda number: 1 / number, [1, 0], threads)


def bits(robot: str, q: Sequence[Element]) -> list[list[int]]:
    """Return the bits of all entries of the poses p1..pn and of their Jacobians, one list per row of q."""
    chain = load_robot(robot)
    poses = forward(chain, q)
    entries = [entry for pose in poses for row in (*pose.rotation, pose.translation) for entry in row]
    for point in range(len(poses)):
        entries += [entry for column in jacobian(chain, q, point) for entry in column]
    rows = np.broadcast_arrays(np.empty(np.shape(q[0]) or 1), *entries)[1:]
    return [row.view(np.int64).tolist() for row in np.array(rows, dtype=np.float64).T.copy()]


@pytest.mark.parametrize("robot", robot_names())
def test_floats_scalars_and_columns_give_the_same_bits(robot: str) -> None:
    """Also of joints that start at right angles: the value of a joint is never taken for a constant."""
    start = [*map(float, load_robot(robot).start)]
    rows = np.vstack((start, np.random.default_rng(13).uniform(-4.0, 4.0, (3, len(start)))))
    for row, of_column in zip(rows.tolist(), bits(robot, [*rows.T]), strict=True):
        for values in (row, [*map(np.float64, row)], [np.array([value]) for value in row]):
            assert bits(robot, values) == [of_column]


@pytest.mark.parametrize("value", [0.0, 1.0, -1.0])
def test_only_a_float_is_a_constant(value: float) -> None:
    """A value of NumPy that happens to be 0, 1 or -1 is treated as the entry of a column."""
    x = np.float64(-0.0)
    for got, expected in ((times(np.float64(value), x), value * x), (plus(np.float64(value), x), value + x)):
        assert math.copysign(1.0, got) == math.copysign(1.0, expected)


EXACT = mpmath.MPContext()
EXACT.prec = 1200  # bits: also of 1e15 rad, and of a sine of 1e-200
NEAR = 1.2e-16  # half an ulp below 1 of the table and half of the sum, 1.11e-16, and 5e-18 of the rest
FAR = 6e-16  # beyond 2.5e4 rad the remainder by whole turns, up to 2 pi, is rounded to 4.5e-16 before


def largest_error(x: FloatArray) -> float:
    c, s = cosine_sine(x)
    rows = zip(x.tolist(), c.tolist(), s.tolist(), strict=True)
    errors = ((EXACT.cos(angle) - cosine, EXACT.sin(angle) - sine) for angle, cosine, sine in rows)
    return max(float(abs(error)) for pair in errors for error in pair)


def test_the_table_holds_the_nearest_doubles() -> None:
    cosines, sines = cosine_sine_table()
    assert len(cosines) == len(sines) == 4096
    for k in range(0, 513):
        angle = 2 * EXACT.pi * k / 4096
        assert (cosines[k], sines[k]) == (float(EXACT.cos(angle)), float(EXACT.sin(angle)))
    quarter = np.arange(1025)
    np.testing.assert_array_equal(cosines, np.roll(sines, -1024))
    np.testing.assert_array_equal(sines[2048 - quarter], sines[quarter])
    np.testing.assert_array_equal(sines[2048:], -sines[:2048])


@pytest.mark.slow
@pytest.mark.parametrize("reach", [1e-3, 1.0, 4.0, 100.0, 2.5e4, 2.6e4, 1e6, 1e10, 1e15])
def test_up_to_the_limit_the_error_is_an_ulp_and_beyond_it_is_small(reach: float) -> None:
    within = reach <= 2.5e4
    x = np.random.default_rng(1).uniform(0.0 if within else 0.99 * reach, reach, 400)
    between = (np.arange(-50, 50) + 0.5) * (2.0 * math.pi / 4096)  # where the rest is largest
    assert largest_error(np.concatenate((x, -x, between, [reach, -reach]))) < (NEAR if within else FAR)


def test_small_angles_keep_their_digits() -> None:
    x = 10.0 ** np.random.default_rng(3).uniform(-300.0, -3.2, 300)
    _, sine = cosine_sine(x)
    expected = [float(EXACT.sin(angle)) for angle in x[x > 1e-200].tolist()]
    # r^4 / 120 of the series at half a step
    np.testing.assert_allclose(sine[x > 1e-200], expected, rtol=4e-15, atol=0.0)
    np.testing.assert_array_equal(sine[x < 1e-9], x[x < 1e-9])


@settings(deadline=None, max_examples=50)
@given(st.lists(st.floats(), max_size=20))
def test_an_element_has_the_bits_that_it_has_alone(values: list[float]) -> None:
    with np.errstate(invalid="ignore"):  # of an infinite angle, as np.cos
        c, s = cosine_sine(np.array(values, dtype=np.float64))
        alone = [cosine_sine(value) for value in values]
        scalars = [cosine_sine(np.float64(value)) for value in values]
    assert {type(part) for pair in alone for part in pair} <= {float}
    assert {type(part) for pair in scalars for part in pair} <= {np.float64}
    np.testing.assert_array_equal(scalars, alone)
    np.testing.assert_array_equal(c, [pair[0] for pair in alone])
    np.testing.assert_array_equal(s, [pair[1] for pair in alone])
    finite = np.isfinite(values)
    assert np.isnan(c[~finite]).all()
    np.testing.assert_allclose(c[finite] ** 2 + s[finite] ** 2, 1.0, rtol=0.0, atol=1e-15)  # three roundings


def test_any_shape_and_strides_give_the_same_values() -> None:
    x = np.random.default_rng(4).uniform(-9.0, 9.0, (6, 8))
    before = x.copy()
    whole = cosine_sine(np.ascontiguousarray(x))
    for view in (np.s_[:], np.s_[::-2, ::3], np.s_[2:2], np.s_[1, 2, ...]):
        for got, of_all in zip(cosine_sine(x[view].T), whole, strict=True):
            assert got.shape == x[view].T.shape
            np.testing.assert_array_equal(got, of_all[view].T)
    np.testing.assert_array_equal(x, before)


def test_the_bits_are_the_same_on_every_platform() -> None:
    """Recorded once: angles of binary fractions, so that they are the same everywhere as well."""
    x = np.arange(-200_000, 200_000) * 0.125 + 2.0**-20
    c, s = cosine_sine(np.concatenate((x[np.abs(x) < 2.5e4], [1e5, 1e10, 1e15, 1e300])))
    found = hashlib.sha256(np.stack((c, s)).astype("<f8").tobytes()).hexdigest()
    assert found == "46adb61650808e18a72b8c94d34056567dc6d3644b7af1d2957a45a5dbc41680"
