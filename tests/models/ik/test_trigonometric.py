"""Equations in cos x and sin x: their roots satisfy them, all are found, and the boundary is sharp."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik import trigonometric
from urmpipe_models.ik.trigonometric import BOUNDARY, linear_roots, parabola_roots, quadric_roots, wrap_angle

ROUNDING = 4e-15  # an angle up to pi through atan2, a sum and a wrap
factors = st.floats(-10.0, 10.0)
angles = st.floats(-math.pi, math.pi, exclude_min=True)


def left_side(k: FloatArray, x: FloatArray) -> FloatArray:
    c, s = np.cos(x), np.sin(x)
    return np.asarray(k[0] * c * c + k[1] * c * s + k[2] * s * s + k[3] * c + k[4] * s + k[5])


def product(first: FloatArray, second: FloatArray) -> FloatArray:
    """The quadric whose roots are those of two equations a c + b s = d."""
    (a, b, d), (e, f, g) = first, second
    return np.array([a * e, a * f + b * e, b * f, -(a * g + d * e), -(b * g + d * f), d * g])


def through(x: float, y: float) -> FloatArray:
    """The equation a c + b s = d with the roots x and y."""
    middle, half = (x + y) / 2, (x - y) / 2
    return np.array([math.cos(middle), math.sin(middle), math.cos(half)])


def apart(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.asarray(np.abs(wrap_angle(x - y)))


def roots_of(k: FloatArray) -> FloatArray:
    return quadric_roots(k[:, None])[:, 0]


def test_angles_are_wrapped_into_a_half_open_turn() -> None:
    turns = np.array([0.0, math.pi, -math.pi, 3 * math.pi, 7.0, -7.0])
    expected = [0.0, math.pi, math.pi, math.pi, 7.0 - 2 * math.pi, 2 * math.pi - 7.0]
    np.testing.assert_allclose(wrap_angle(turns), expected, rtol=0, atol=ROUNDING)


@given(a=factors, b=factors, x=angles)
@example(a=1.0, b=0.0, x=math.pi)
def test_a_root_put_in_is_found_and_the_first_one_falls(a: float, b: float, x: float) -> None:
    r, c = math.hypot(a, b), a * math.cos(x) + b * math.sin(x)
    if r < 1e-100:
        return
    roots = np.array(linear_roots(np.array(a), np.array(b), np.array(c)))
    # near the double root an error of 1e-16 in c moves x by its square root
    assert apart(roots, np.array(x)).min() < 5e-8
    np.testing.assert_allclose(a * np.cos(roots) + b * np.sin(roots), c, atol=r * 1e-14)
    falling, rising = b * np.cos(roots) - a * np.sin(roots)
    assert falling <= r * 1e-14
    assert rising >= -r * 1e-14


def test_the_boundary_counts_up_to_its_tolerance_and_an_equation_without_an_angle_has_no_root() -> None:
    a, b = np.array([3.0, 3.0, 3.0, 3.0, 0.0, np.nan, 1.0]), np.array([4.0, 4.0, 4.0, 4.0, 0.0, 0.0, 0.0])
    inside, outside = 5.0 * (1.0 + BOUNDARY / 2), 5.0 * (1.0 + 2 * BOUNDARY)
    roots = linear_roots(a, b, np.array([inside, outside, -inside, -outside, 0.0, 0.5, np.nan]))
    stretched = math.atan2(4.0, 3.0)
    for root in roots:
        expected = [stretched, np.nan, stretched - math.pi, *[np.nan] * 4]
        np.testing.assert_allclose(root, expected, rtol=0, atol=ROUNDING)


@given(arrays(float, 4, elements=angles), st.floats(1e-3, 1e3))
@example(np.array([math.pi, 1.0, -2.0, 0.5]), 1.0)
@example(np.array([math.pi, 0.0, math.pi / 2, -math.pi / 2]), 1.0)
@example(np.array([0.3, 0.3, -1.0, 2.0]), 1.0)
@example(np.array([0.3, 0.3, 0.3, 0.3]), 1.0)
@example(np.array([0.3, 0.3, -2.0, -2.0]), 1.0)
def test_four_roots_put_in_are_found(put_in: FloatArray, factor: float) -> None:
    k = factor * product(through(put_in[0], put_in[1]), through(put_in[2], put_in[3]))
    roots = roots_of(k)
    assert np.isfinite(roots).all()
    # the worst, a fourfold root: the fourth root of the rounding, 1e-16 ** 0.25 = 1e-4
    assert apart(roots[:, None], put_in[None, :]).min(axis=0).max() < 2e-3
    np.testing.assert_allclose(left_side(k, roots), 0.0, atol=np.abs(k).sum() * BOUNDARY)


@given(arrays(float, 4, elements=angles))
def test_simple_roots_are_found_to_the_last_digits(put_in: FloatArray) -> None:
    if apart(put_in[:, None], put_in[None, :])[np.triu_indices(4, 1)].min() < 0.1:
        return
    roots = roots_of(product(through(put_in[0], put_in[1]), through(put_in[2], put_in[3])))
    away = apart(roots[:, None], put_in[None, :]).min(axis=0)
    np.testing.assert_allclose(away, 0.0, atol=1e-11)  # 1e-16 through slopes of 0.1 ** 3 and more


@given(arrays(float, 6, elements=factors))
def test_there_are_as_many_roots_as_the_left_side_changes_sign(k: FloatArray) -> None:
    size = np.abs(k).sum()
    values = left_side(k, np.linspace(-math.pi, math.pi, 2001))
    if size < 1e-3 or np.abs(values).min() < 1e-9 * size:
        return
    changes = np.count_nonzero(np.sign(values[1:]) != np.sign(values[:-1]))
    found = np.count_nonzero(np.isfinite(roots_of(k)))
    assert found >= changes and found % 2 == 0


def test_a_leading_coefficient_that_vanishes_loses_no_root() -> None:
    k = np.array([2.0, 0.0, 2.0, 3.0, 4.0, -4.5])  # 3 c + 4 s = 2.5: c^2 + s^2 is no quadric at all
    expected = np.sort(np.array(linear_roots(np.array(3.0), np.array(4.0), np.array(2.5))))
    np.testing.assert_allclose(roots_of(k), [*expected, np.nan, np.nan], rtol=0, atol=1e-14)


def test_roots_at_pi_are_roots_like_any_other() -> None:
    k = product(through(math.pi, math.pi / 2), through(0.0, -math.pi / 2))
    np.testing.assert_allclose(roots_of(k), [-math.pi / 2, 0.0, math.pi / 2, math.pi], rtol=0, atol=1e-14)


def test_an_extremum_is_a_double_root_within_the_rounding_alone() -> None:
    for beyond in (BOUNDARY / 10, 1e-11, 1e-8, 1e-3):
        roots = roots_of(np.array([0.0, 0.0, 0.0, 1.0, 0.0, -1.0 - beyond]))
        expected = [0.0, 0.0, np.nan, np.nan] if beyond < BOUNDARY else [np.nan] * 4
        np.testing.assert_allclose(roots, expected, atol=1e-6)


def test_rows_do_not_know_each_other() -> None:
    k = np.random.default_rng(7).normal(size=(6, 50))
    k[:, 10], k[:, 20], k[0, 30] = np.nan, 0.0, np.inf
    together = quadric_roots(k)
    np.testing.assert_array_equal(together.T, [roots_of(row) for row in k.T])
    assert np.isnan(together[:, [10, 20, 30]]).all()


numbers = st.floats(0.1, 3.0) | st.floats(-3.0, -0.1)
SLOPE_ROUNDING = 1e-14  # of slopes of up to 30, where both roots are one

units = st.sampled_from([2.0**-20, 1.0, 2.0**20])


@given(numbers, numbers, numbers, units)
def test_both_roots_of_a_parabola_satisfy_it_in_any_unit(a0: float, a1: float, s: float, unit: float) -> None:
    alpha, beta = np.array([a0, a1]), np.array([a0 * s + a1 * s * s])
    roots = parabola_roots(alpha, beta)
    np.testing.assert_array_equal(parabola_roots(unit * alpha, unit * beta).u, roots.u)
    other = -a0 / a1 - s
    # a double root is known to the square root of rounding, 1e-8 of numbers of up to 30
    np.testing.assert_allclose(np.sort(roots.u[0, :, 0]), sorted((s, other)), rtol=0, atol=1e-6)
    np.testing.assert_array_equal(roots.u[1], roots.u[0] ** 2)
    falls = a0 + 2.0 * a1 * roots.u[0, :, 0]
    assert falls[0] <= SLOPE_ROUNDING and falls[1] >= -SLOPE_ROUNDING


@pytest.mark.parametrize("unit", [2.0**-20, 1.0, 2.0**20])
def test_a_parabola_that_is_missed_by_rounding_is_touched(unit: float) -> None:
    """s + s^2 is -1/4 at least; below it the discriminant 1 + 4 beta is missed of a scale of 2."""
    alpha = unit * np.array([1.0, 1.0])
    low = np.array([-0.5, 0.5, 0.9, 1.1]) * 2.0 * BOUNDARY  # of the discriminant
    roots = parabola_roots(alpha, unit * (-0.25 - low / 4.0))
    assert np.isfinite(roots.u[0, 0]).tolist() == [True, True, True, False]
    assert roots.coincide.tolist() == [True, True, True, False]
    np.testing.assert_allclose(roots.u[0, :, 1:3], -0.5, rtol=0, atol=1e-12)
    high = np.array([0.9, 1.1]) * 2.0 * trigonometric.MEETING
    assert parabola_roots(alpha, unit * (-0.25 + high / 4.0)).coincide.tolist() == [True, False]


def test_a_parabola_along_its_axis_is_met_once() -> None:
    assert trigonometric.is_linear(np.array([-1.0, 1e-9]))
    assert not trigonometric.is_linear(np.array([-1.0, 1.01e-9]))
    assert not trigonometric.is_linear(np.array([0.0, 1e-30]))
    roots = parabola_roots(np.array([2.0, 0.0]), np.array([3.0, -1.0]))
    np.testing.assert_array_equal(roots.u, [[[1.5, -0.5]], [[2.25, 0.25]]])
    assert roots.coincide.tolist() == [False, False]


@given(st.floats(-math.pi, math.pi), st.floats(-3.0, 3.0), units)
def test_both_roots_of_a_circle_satisfy_it_in_any_unit(towards: float, angle: float, unit: float) -> None:
    alpha = unit * np.array([math.cos(towards), math.sin(towards)])
    beta = np.array([0.4 * unit * math.cos(angle)])
    roots = trigonometric.circle_roots(alpha, beta, 0.4)
    np.testing.assert_allclose(np.hypot(*roots.u), 0.4, rtol=1e-15)
    np.testing.assert_allclose(alpha @ roots.u[:, :, 0] / unit, beta[0] / unit, rtol=0, atol=1e-15)
    falls = alpha @ np.array([-roots.u[1, :, 0], roots.u[0, :, 0]]) / unit
    assert falls[0] <= SLOPE_ROUNDING and falls[1] >= -SLOPE_ROUNDING


def test_a_circle_out_of_reach_has_no_root_and_a_point_is_its_centre() -> None:
    alpha = np.array([3.0, 4.0])
    roots = trigonometric.circle_roots(alpha, 5.0 * np.array([0.4, 0.4 * (1.0 - 3e-12), 0.41, 0.0]), 0.4)
    assert np.isfinite(roots.u).all(axis=(0, 1)).tolist() == [True, True, False, True]
    assert roots.coincide.tolist() == [True, False, False, False]
    centre = trigonometric.circle_roots(alpha, np.zeros(1), 1e-12)
    np.testing.assert_array_equal(centre.u, np.zeros((2, 2, 1)))
    assert centre.coincide.tolist() == [False]
    assert np.isnan(trigonometric.circle_roots(alpha, np.array([1e-10, 1.0]), 1e-12).u).all()
