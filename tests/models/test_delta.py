"""The deviation delta and its flag."""

from __future__ import annotations

import numpy as np

from urmpipe_models.delta import Delta, delta, exceeds_tolerance


def test_delta_is_reference_minus_actual_with_its_norm() -> None:
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, 100, 3))
    result = np.column_stack(delta(tuple(a.T), tuple(b.T)))
    np.testing.assert_array_equal(result[:, :3], a - b)
    np.testing.assert_allclose(result[:, 3], np.linalg.norm(a - b, axis=1), rtol=4e-16)  # two roundings


def test_the_tolerance_is_of_an_axis_and_the_bound_itself_is_inside() -> None:
    x = np.array([0.0035, -0.0035, 0.00350001, 0.0, 0.0])
    z = np.array([0.0, 0.0, 0.0, -0.004, np.nan])
    zero = np.zeros(5)
    assert exceeds_tolerance(Delta(x, zero, z, zero), 0.0035).tolist() == [False, False, True, True, True]
    # an axis at its bound in all three: the norm may reach sqrt(3) times the tolerance
    assert not exceeds_tolerance(Delta(0.0035, -0.0035, 0.0035, 0.00606), 0.0035)
