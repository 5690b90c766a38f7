"""Points of circles and parabolas that satisfy a linear equation: which there are, and where two are one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.ik.trigonometric import BOUNDARY, MEETING, circle_roots, is_straight, parabola_roots

numbers = st.floats(0.1, 3.0) | st.floats(-3.0, -0.1)
ROUNDING = 1e-14
"""Of slopes of up to 30, where both roots are one."""

units = st.sampled_from([2.0**-20, 1.0, 2.0**20])


@given(numbers, numbers, numbers, units)
def test_both_roots_of_a_parabola_satisfy_the_equation_in_any_unit(
    a0: float, a1: float, s: float, unit: float
) -> None:
    alpha, beta = np.array([a0, a1]), np.array([a0 * s + a1 * s * s])
    roots = parabola_roots(alpha, beta)
    np.testing.assert_array_equal(parabola_roots(unit * alpha, unit * beta).u, roots.u)
    other = -a0 / a1 - s
    # a double root is known to the square root of rounding, 1e-8 of numbers of up to 30
    np.testing.assert_allclose(np.sort(roots.u[0, :, 0]), sorted((s, other)), rtol=0, atol=1e-6)
    np.testing.assert_array_equal(roots.u[1], roots.u[0] ** 2)
    falls = a0 + 2.0 * a1 * roots.u[0, :, 0]
    assert falls[0] <= ROUNDING and falls[1] >= -ROUNDING


@pytest.mark.parametrize("unit", [2.0**-20, 1.0, 2.0**20])
def test_a_parabola_that_is_missed_by_rounding_is_touched(unit: float) -> None:
    """s + s^2 is -1/4 at least; below it the discriminant 1 + 4 beta is missed of a scale of 2."""
    alpha = unit * np.array([1.0, 1.0])
    low = np.array([-0.5, 0.5, 0.9, 1.1]) * 2.0 * BOUNDARY  # of the discriminant
    roots = parabola_roots(alpha, unit * (-0.25 - low / 4.0))
    assert np.isfinite(roots.u[0, 0]).tolist() == [True, True, True, False]
    assert roots.coincide.tolist() == [True, True, True, False]
    np.testing.assert_allclose(roots.u[0, :, 1:3], -0.5, rtol=0, atol=1e-12)
    high = np.array([0.9, 1.1]) * 2.0 * MEETING
    assert parabola_roots(alpha, unit * (-0.25 + high / 4.0)).coincide.tolist() == [True, False]


def test_a_parabola_along_its_axis_is_met_once() -> None:
    assert is_straight(np.array([-1.0, 1e-9]))
    assert not is_straight(np.array([-1.0, 1.01e-9]))
    assert not is_straight(np.array([0.0, 1e-30]))
    roots = parabola_roots(np.array([2.0, 0.0]), np.array([3.0, -1.0]))
    np.testing.assert_array_equal(roots.u, [[[1.5, -0.5]], [[2.25, 0.25]]])
    assert roots.coincide.tolist() == [False, False]


@given(st.floats(-math.pi, math.pi), st.floats(-3.0, 3.0), units)
def test_both_roots_of_a_circle_satisfy_the_equation_in_any_unit(
    towards: float, angle: float, unit: float
) -> None:
    alpha = unit * np.array([math.cos(towards), math.sin(towards)])
    beta = np.array([0.4 * unit * math.cos(angle)])
    roots = circle_roots(alpha, beta, 0.4)
    np.testing.assert_allclose(np.hypot(*roots.u), 0.4, rtol=1e-15)
    np.testing.assert_allclose(alpha @ roots.u[:, :, 0] / unit, beta[0] / unit, rtol=0, atol=1e-15)
    falls = alpha @ np.array([-roots.u[1, :, 0], roots.u[0, :, 0]]) / unit
    assert falls[0] <= ROUNDING and falls[1] >= -ROUNDING


def test_a_circle_out_of_reach_has_no_root_and_a_point_is_its_centre() -> None:
    alpha = np.array([3.0, 4.0])
    roots = circle_roots(alpha, 5.0 * np.array([0.4, 0.4 * (1.0 - 3e-12), 0.41, 0.0]), 0.4)
    assert np.isfinite(roots.u).all(axis=(0, 1)).tolist() == [True, True, False, True]
    assert roots.coincide.tolist() == [True, False, False, False]
    centre = circle_roots(alpha, np.zeros(1), 1e-12)
    np.testing.assert_array_equal(centre.u, np.zeros((2, 2, 1)))
    assert centre.coincide.tolist() == [False]
    assert np.isnan(circle_roots(alpha, np.array([1e-10, 1.0]), 1e-12).u).all()
