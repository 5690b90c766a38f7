"""The load as a unit, against the closed forms of a body in a bearing."""

from __future__ import annotations

import numpy as np
import pytest

from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.dependencies import Dependencies
from urmpipe_fmus.run import Instance, run

T = np.linspace(0.0, 2.0, 41)


def constant(value: float) -> np.ndarray:
    return np.full(len(T), value)


def test_without_friction_a_constant_torque_makes_a_parabola() -> None:
    found = run(make_block("inertia"), T, {"tau": constant(3.0), "tau_ext": constant(-1.0)}, {"J": 4.0})
    # RK4 is exact for it; sums of 4000 internal steps round.
    np.testing.assert_allclose(found["theta"], 0.25 * T**2, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found["omega"], 0.5 * T, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(found["alpha"], constant(0.5))


def test_with_friction_the_speed_nears_torque_over_friction() -> None:
    start = {"J": 2.0, "d": 4.0, "omega": 3.0, "theta": 1.0}
    found = run(make_block("inertia"), T, {"tau": constant(8.0)}, start)
    omega = 2.0 + np.exp(-2.0 * T)
    # (h d / J)^5 / 120 a step of 0.5 ms: far below rounding.
    np.testing.assert_allclose(found["omega"], omega, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(
        found["theta"], 1.0 + 2.0 * T + 0.5 * (1.0 - np.exp(-2.0 * T)), rtol=0.0, atol=1e-12
    )
    np.testing.assert_allclose(found["alpha"], -2.0 * np.exp(-2.0 * T), rtol=0.0, atol=1e-11)


def test_the_acceleration_is_that_of_the_torques_as_they_stand() -> None:
    assert Dependencies(make_block("inertia")).outputs["alpha"] == {"J", "d", "omega", "tau", "tau_ext"}
    instance = Instance(make_block("inertia"))
    for torque in (5.0, -3.0):
        instance.set([instance.reference("tau")], [torque])
        # divided by 1: the rounding of the last place
        assert instance.get([instance.reference("alpha")]) == [pytest.approx(torque, rel=1e-15)]
