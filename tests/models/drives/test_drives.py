"""Drives: the equations one by one and together; laws of set points; the sampled controller."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from made_masses import DRIVE
from urmpipe_models import drives
from urmpipe_models.drives import Drive, Gains, JointMotion, control_voltage, sample_index, shaft_torque
from urmpipe_models.elementwise import FloatArray

LOAD = 1.0
angles, bounds = st.floats(-10.0, 10.0), st.floats(0.05, 20.0)


def integrated(drive: Drive, voltage: float, t: FloatArray) -> FloatArray:
    """Return the states of the drive and its free load from rest, shape (5, n)."""
    states = solve_ivp(
        lambda _, x: rates(x, drive, voltage), (0.0, t[-1]), np.zeros(5), "DOP853", t, rtol=1e-12, atol=1e-14
    )
    return np.asarray(states.y)


def rates(x: FloatArray, drive: Drive = DRIVE, voltage: float = 0.0) -> FloatArray:
    """Return the derivatives of theta1, omega1, i_a, theta2, omega2 of a drive with a free load."""
    theta1, omega1, current, theta2, omega2 = x
    torque = shaft_torque(drive, theta1, omega1, theta2, omega2)
    motor = drives.shaft_acceleration(drive, current, torque)
    load = drives.load_acceleration(LOAD, 0.0, omega2, torque, 0.0)
    return np.array([omega1, motor, drives.current_rate(drive, voltage, omega1, current), omega2, load])


def eigenvalues(drive: Drive) -> NDArray[np.complex128]:
    """Return those of x' = A x without a voltage: the equations are linear, so A's columns are rates."""
    return np.linalg.eigvals(np.column_stack([rates(unit, drive) for unit in np.eye(5)])).astype(complex)


def test_eq_14_to_18_at_values_that_can_be_done_by_hand() -> None:
    exactly = partial(pytest.approx, rel=1e-15)  # sums and products of short decimals: rounding
    assert shaft_torque(DRIVE, 0.3, 2.0, 0.1, 1.0) == exactly(2500.0 * 0.2 + 5.0 * 1.0)
    assert drives.motor_torque(DRIVE, 4.0) == exactly(100.0 * 0.05 * 4.0)
    assert drives.shaft_acceleration(DRIVE, 4.0, 5.0) == exactly((20.0 - 5.0) / 0.5)
    assert drives.current_rate(DRIVE, 24.0, 2.0, 4.0) == exactly((24.0 - 10.0 - 2.0) / 1e-3)
    assert drives.load_acceleration(2.0, 0.5, 4.0, 5.0, 7.0) == exactly((5.0 + 7.0 - 2.0) / 2.0)


@given(st.tuples(angles, angles), st.tuples(angles, angles), st.tuples(angles, angles))
def test_the_shaft_feels_the_twist_alone_and_pulls_back_on_the_other_end(
    end1: tuple[float, float], end2: tuple[float, float], shift: tuple[float, float]
) -> None:
    torque = shaft_torque(DRIVE, *end1, *end2)
    # Sums of angles up to 20 rad round at 4e-15, times 2500 N.m/rad.
    close_to_torque = pytest.approx(torque, rel=1e-13, abs=1e-10)
    assert shaft_torque(DRIVE, *np.add(end1, shift), *np.add(end2, shift)) == close_to_torque
    assert -shaft_torque(DRIVE, *end2, *end1) == close_to_torque


def test_elements_are_columns_as_well_as_numbers() -> None:
    columns = np.random.default_rng(1).uniform(-3.0, 3.0, (5, 7))
    together = rates(columns, voltage=12.0)
    for k in range(7):
        assert_array_equal(together[:, k], rates(columns[:, k], voltage=12.0))


def test_motor_and_load_swing_with_the_eigenfrequency_of_two_masses_or_of_the_load_alone() -> None:
    free = eigenvalues(DRIVE._replace(constant=1e-12))  # no torque of the motor, and no induced voltage
    reduced = DRIVE.inertia * LOAD / (DRIVE.inertia + LOAD)
    decay, undamped = DRIVE.damping / (2.0 * reduced), np.sqrt(DRIVE.stiffness / reduced)
    # A twofold eigenvalue of 0 (both turn freely) next to them costs half the digits at most.
    swinging = [-decay + 1j * np.sqrt(undamped**2 - decay**2)]
    assert free[free.imag > 1.0] == pytest.approx(swinging, rel=1e-8)
    assert undamped == pytest.approx(86.6025403784, rel=1e-11)
    locked = eigenvalues(DRIVE._replace(inertia=1e15, damping=1e-9))
    assert max(locked.imag) == pytest.approx(np.sqrt(DRIVE.stiffness / LOAD), rel=1e-9)


def test_the_current_of_a_shaft_at_rest_rises_with_its_time_constant() -> None:
    t = np.linspace(0.0, 0.01, 11)
    expected = 10.0 / DRIVE.resistance * (1.0 - np.exp(-t * DRIVE.resistance / DRIVE.inductance))
    current = integrated(DRIVE._replace(inertia=1e15), 10.0, t)[2]
    assert_allclose(current, expected, rtol=0.0, atol=1e-10)  # of up to 20 A, rtol 1e-12 a step


def test_without_load_a_constant_voltage_ends_at_the_speed_that_induces_it() -> None:
    theta1, omega1, current, theta2, omega2 = integrated(DRIVE, 24.0, np.array([0.0, 3.0]))[:, -1]
    # The slowest time constant is near (I1 + J) R / (C i_p)^2 = 30 ms: e^-100 is left of it after 3 s.
    assert [omega1, omega2] == pytest.approx([24.0 / (DRIVE.constant * DRIVE.ratio)] * 2, rel=1e-9)
    assert current == pytest.approx(0.0, abs=1e-8)
    assert theta1 - theta2 == pytest.approx(0.0, abs=1e-9)


def rigid_speed(t: FloatArray, voltage: float) -> FloatArray:
    """Return the speed of the drive and its load on a rigid shaft, by eigenvalues."""
    total, torque = DRIVE.inertia + LOAD, DRIVE.constant * DRIVE.ratio
    A = np.array([[0.0, torque / total], [-torque / DRIVE.inductance, -DRIVE.resistance / DRIVE.inductance]])
    values, vectors = np.linalg.eig(A)
    parts = np.linalg.solve(vectors, [-voltage / torque, 0.0])
    return np.real(voltage / torque + (vectors[0] * parts) @ np.exp(np.outer(values, t)))


def test_the_stiffer_the_shaft_the_nearer_the_rigid_drive_in_proportion_to_1_over_k() -> None:
    t, distances = np.linspace(0.05, 0.2, 16), []
    for stiffness in (2.5e5, 2.5e6, 2.5e7):
        # Damping that keeps the shaft's own swing at half of critical, so that it has died away by 0.05 s.
        stiff = DRIVE._replace(stiffness=stiffness, damping=np.sqrt(stiffness / 3.0))
        distances.append(float(np.abs(integrated(stiff, 24.0, t)[1] - rigid_speed(t, 24.0)).max()))
    # The next term of the expansion is 1 / k^1.5 here (the damping grows with the root of k).
    assert np.divide(distances[:-1], distances[1:]) == pytest.approx([10.0, 10.0], rel=0.2)
    assert distances[2] < 1e-4


@given(angles, angles, bounds, bounds, st.floats(-1.0, 1.0))
@example(1.0, 1.0, 2.0, 10.0, 0.1)
@example(0.0, 5e-324, 2.0, 10.0, 0.1)
def test_a_trapezoid_keeps_its_limits_and_rates_and_arrives_to_the_bit_on_time(
    initial: float, target: float, speed: float, acceleration: float, begin: float
) -> None:
    distance = abs(target - initial)
    is_triangle = distance < speed**2 / acceleration
    total = 2.0 * np.sqrt(distance / acceleration) if is_triangle else distance / speed + speed / acceleration
    t = begin + np.linspace(-0.1, 1.1, 2_001) * max(total, 1e-3)
    motion = drives.trapezoid(t, begin, initial, target, speed, acceleration)
    slack = 1.0 + 1e-12  # a product of roots, rounded
    assert np.abs(motion.velocity).max() <= speed * slack
    assert np.abs(motion.acceleration).max() <= acceleration
    assert motion.position.min() >= min(initial, target) - 1e-12
    assert motion.position.max() <= max(initial, target) + 1e-12
    arrived = t >= begin + total * slack + 1e-12
    assert (motion.position[arrived] == target).all()
    assert (motion.velocity[arrived] == 0.0).all()
    assert (motion.position[t < begin] == initial).all()
    h, rounded = t[1] - t[0], 1e-15 * (total + 1.0)  # of differences of times
    # Exact except in an interval with a corner in it, where the trapezoidal rule is off by a h / 4 at most.
    allowed = 0.25 * acceleration * h * h + 4.0 * speed * rounded + 1e-14
    means = 0.5 * (motion.velocity[1:] + motion.velocity[:-1])
    assert_allclose(np.diff(motion.position), h * means, rtol=0.0, atol=allowed)
    rise = min(speed / acceleration, np.sqrt(distance / acceleration))
    corners = np.searchsorted(t, begin + np.array([0.0, rise, total - rise, total]))
    differences = np.diff(motion.velocity) - h * motion.acceleration[:-1]
    differences[np.add.outer(corners, (-2, -1, 0))] = 0.0  # a corner may be rounded to either side
    assert np.abs(differences).max() <= 4.0 * acceleration * rounded


@pytest.mark.parametrize("parts", [1, 3, 7, 16, 50])
def test_communication_points_meet_a_corner_though_their_times_are_rounded(parts: int) -> None:
    h, points = 5e-3 / parts, np.arange(100 * parts)
    for t in (points * h + h, np.cumsum(np.full(100 * parts, h))):
        signals = (
            drives.step(t, 0.1, 0.0, 1.0).position,
            drives.ramp(t, 0.1, 0.0, 1.0, 1.0).velocity,
            drives.trapezoid(t, 0.1, 0.0, 1.0, 1.0, 10.0).acceleration,
        )
        assert [np.argmax(signal > 0.5) for signal in signals] == [20 * parts - 1] * 3


@pytest.mark.parametrize(("kind", "count"), [(drives.STEP, 3), (drives.RAMP, 4), (drives.TRAPEZOID, 5)])
def test_the_kind_chooses_the_form_for_columns_and_numbers(kind: int, count: int) -> None:
    t, arguments = np.linspace(0.0, 2.0, 41), (0.1, 0.5, 1.5, 2.0, 10.0)
    motion = drives.evaluate_setpoint(kind, t, *arguments)
    assert_array_equal(motion, (drives.step, drives.ramp, drives.trapezoid)[kind](t, *arguments[:count]))
    at_9 = drives.evaluate_setpoint(float(kind), float(t[9]), *arguments)
    assert [float(value) for value in at_9] == [column[9] for column in motion]


GAINS = Gains(position=7.5, velocity=0.75, acceleration=0.01)
REST = JointMotion(0.0, 0.0, 0.0)
values = st.floats(-100.0, 100.0)
motions = st.builds(JointMotion, values, values, values)


def test_eq_20_adds_the_weighted_errors_to_the_last_voltage_and_does_not_wind_up() -> None:
    voltage = control_voltage(10.0, GAINS, JointMotion(1.0, 2.0, 30.0), JointMotion(0.5, 3.0, 10.0), 48.0)
    assert voltage == pytest.approx(10.0 + 7.5 * 0.5 - 0.75 * 1.0 + 0.01 * 20.0, rel=1e-15)  # rounding
    for _ in range(10):
        voltage = control_voltage(voltage, GAINS, JointMotion(1.0, 0.0, 0.0), REST, 48.0)
    assert voltage == 48.0
    assert control_voltage(voltage, GAINS, JointMotion(-1.0, 0.0, 0.0), REST, 48.0) == 48.0 - 7.5


@given(values, motions, motions, st.floats(0.0, 48.0))
def test_the_printed_minus_is_the_plus_with_negated_gains_within_the_limit(
    last: float, setpoint: JointMotion, measured: JointMotion, limit: float
) -> None:
    errors = np.subtract(setpoint, measured)
    negated = Gains(*(-gain for gain in GAINS))
    # Sums of a few thousand, whose order differs.
    printed = pytest.approx(last - np.dot(GAINS, errors), rel=1e-12, abs=1e-11)
    assert control_voltage(last, negated, setpoint, measured, 1e9) == printed
    assert abs(control_voltage(last, GAINS, setpoint, measured, limit)) <= limit


def test_summed_over_fast_samples_it_is_a_pid_on_the_position() -> None:
    def error(t: float) -> tuple[float, float, float]:
        return np.sin(3.0 * t) + 0.2, 3.0 * np.cos(3.0 * t), -9.0 * np.sin(3.0 * t)

    deviations = []
    for period in (1e-3, 5e-4):
        gains, voltage = Gains(1500.0 * period, 150.0 * period, 2.0 * period), 0.0
        for n in range(round(1.0 / period)):
            voltage = float(control_voltage(voltage, gains, JointMotion(*error(n * period)), REST, 1e9))
        integral = (1.0 - np.cos(3.0)) / 3.0 + 0.2
        position, velocity, _ = np.subtract(error(1.0), error(0.0))
        deviations.append(voltage - (1500.0 * integral + 150.0 * position + 2.0 * velocity))
    # A sum for an integral: off by a half of the period times what the summed terms change.
    assert abs(deviations[1]) < 0.2
    assert deviations[0] / deviations[1] == pytest.approx(2.0, rel=0.02)


@given(st.integers(0, 10**6), st.sampled_from([1e-4, 1e-3, 5e-3, 1.0 / 240.0, 0.1]))
def test_every_multiple_of_the_period_is_a_sample_and_what_is_before_it_is_not(n: int, period: float) -> None:
    samples = sample_index(np.array([n, n + 0.999, n + 1]) * period, period)
    assert_array_equal(samples, [n, n, n + 1])
    summed_up = np.cumsum(np.full(20_000, period))
    assert_array_equal(sample_index(summed_up, period), np.arange(1, 20_001))
