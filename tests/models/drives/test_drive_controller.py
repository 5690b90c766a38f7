"""Eq. 20 with the corrected sign, and when a sample is due."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.drives import Gains, JointMotion, control_voltage, sample_index

GAINS = Gains(position=7.5, velocity=0.75, acceleration=0.01)
REST = JointMotion(0.0, 0.0, 0.0)

values = st.floats(-100.0, 100.0)
motions = st.builds(JointMotion, values, values, values)


def test_eq_20_adds_the_weighted_errors_to_the_last_voltage() -> None:
    voltage = control_voltage(10.0, GAINS, JointMotion(1.0, 2.0, 30.0), JointMotion(0.5, 3.0, 10.0), 48.0)
    assert voltage == pytest.approx(10.0 + 7.5 * 0.5 - 0.75 * 1.0 + 0.01 * 20.0, rel=1e-15)  # rounding


@given(values, motions, motions)
def test_the_printed_minus_is_the_plus_with_negated_gains(
    last: float, wanted: JointMotion, real: JointMotion
) -> None:
    errors = [a - b for a, b in zip(wanted, real, strict=True)]
    printed = last - sum(gain * error for gain, error in zip(GAINS, errors, strict=True))
    negated = Gains(*(-gain for gain in GAINS))
    # Sums of a few thousand, whose order differs.
    assert control_voltage(last, negated, wanted, real, 1e9) == pytest.approx(printed, rel=1e-12, abs=1e-11)


@given(values, motions, motions, st.floats(0.0, 48.0))
def test_the_voltage_never_leaves_its_limit(
    last: float, wanted: JointMotion, real: JointMotion, limit: float
) -> None:
    assert abs(control_voltage(last, GAINS, wanted, real, limit)) <= limit


def test_the_limited_voltage_does_not_wind_up() -> None:
    voltage = 0.0
    for _ in range(1000):
        voltage = control_voltage(voltage, GAINS, JointMotion(1.0, 0.0, 0.0), REST, 48.0)
    assert voltage == 48.0
    assert control_voltage(voltage, GAINS, JointMotion(-1.0, 0.0, 0.0), REST, 48.0) == 48.0 - 7.5


def test_summed_over_fast_samples_it_is_a_pid_on_the_position() -> None:
    def error(t: float) -> tuple[float, float, float]:
        return np.sin(3.0 * t) + 0.2, 3.0 * np.cos(3.0 * t), -9.0 * np.sin(3.0 * t)

    off = []
    for period in (1e-3, 5e-4):
        gains = Gains(1500.0 * period, 150.0 * period, 2.0 * period)
        voltage = 0.0
        for n in range(round(1.0 / period)):
            voltage = float(control_voltage(voltage, gains, JointMotion(*error(n * period)), REST, 1e9))
        integral = (1.0 - np.cos(3.0)) / 3.0 + 0.2
        position, velocity = error(1.0)[0] - error(0.0)[0], error(1.0)[1] - error(0.0)[1]
        off.append(voltage - (1500.0 * integral + 150.0 * position + 2.0 * velocity))
    # A sum for an integral: off by a half of the period times what the summed terms change.
    assert abs(off[1]) < 0.2
    assert off[0] / off[1] == pytest.approx(2.0, rel=0.02)


@given(st.integers(0, 10**6), st.sampled_from([1e-4, 1e-3, 5e-3, 1.0 / 240.0, 0.1]))
def test_every_multiple_of_the_period_is_a_sample_and_what_is_before_it_is_not(n: int, period: float) -> None:
    assert sample_index(n * period, period) == n
    assert sample_index((n + 0.999) * period, period) == n
    assert sample_index((n + 1) * period, period) == n + 1


def test_times_summed_up_step_by_step_meet_their_samples_too() -> None:
    times = np.cumsum(np.full(20_000, 0.005))
    np.testing.assert_array_equal(sample_index(times, 0.005), np.arange(1, 20_001))
