"""Drives: the equations one by one and together; set points; the sampled controller."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from urmpipe_models.drives import (
    CORNER_SLACK,
    RAMP,
    STEP,
    TRAPEZOID,
    Drive,
    Gains,
    JointMotion,
    control_voltage,
    current_rate,
    evaluate_setpoint,
    load_acceleration,
    motor_torque,
    ramp,
    sample_index,
    shaft_acceleration,
    shaft_torque,
    step,
    trapezoid,
)
from urmpipe_models.elementwise import FloatArray

DRIVE = Drive(
    stiffness=2500.0, damping=5.0, ratio=100.0, constant=0.05, resistance=0.5, inductance=1e-3, inertia=0.5
)
LOAD = 1.0

angles = st.floats(-10.0, 10.0)


def integrated(drive: Drive, voltage: float, t: FloatArray) -> FloatArray:
    """Return the states of the drive and its free load from rest, shape (5, n)."""
    found = solve_ivp(
        lambda _, x: rates(x, drive, voltage),
        (0.0, float(t[-1])),
        np.zeros(5),
        method="DOP853",
        t_eval=t,
        rtol=1e-11,
        atol=1e-13,
    )
    return np.asarray(found.y)


def rates(x: FloatArray, drive: Drive = DRIVE, voltage: float = 0.0) -> FloatArray:
    """Return the derivatives of theta1, omega1, i_a, theta2, omega2 of a drive with a free load."""
    theta1, omega1, current, theta2, omega2 = x
    torque = shaft_torque(drive, theta1, omega1, theta2, omega2)
    return np.array(
        [
            omega1,
            shaft_acceleration(drive, current, torque),
            current_rate(drive, voltage, omega1, current),
            omega2,
            load_acceleration(LOAD, 0.0, omega2, torque, 0.0),
        ]
    )


def system_matrix(drive: Drive) -> FloatArray:
    """Return A of x' = A x without a voltage: the equations are linear, so its columns are rates."""
    return np.column_stack([rates(unit, drive) for unit in np.eye(5)])


def test_eq_14_to_18_at_values_that_can_be_done_by_hand() -> None:
    # Sums and products of short decimals: equal but for their rounding.
    assert shaft_torque(DRIVE, 0.3, 2.0, 0.1, 1.0) == pytest.approx(2500.0 * 0.2 + 5.0 * 1.0, rel=1e-15)
    assert motor_torque(DRIVE, 4.0) == pytest.approx(100.0 * 0.05 * 4.0, rel=1e-15)
    assert shaft_acceleration(DRIVE, 4.0, 5.0) == pytest.approx((20.0 - 5.0) / 0.5, rel=1e-15)
    assert current_rate(DRIVE, 24.0, 2.0, 4.0) == pytest.approx((24.0 - 10.0 - 2.0) / 1e-3, rel=1e-15)
    assert load_acceleration(2.0, 0.5, 4.0, 5.0, 7.0) == pytest.approx((5.0 + 7.0 - 2.0) / 2.0, rel=1e-15)


@given(angles, angles, angles, angles, angles, angles)
def test_the_shaft_feels_the_twist_alone_and_pulls_back_on_the_other_end(
    theta1: float, omega1: float, theta2: float, omega2: float, turned: float, turning: float
) -> None:
    torque = shaft_torque(DRIVE, theta1, omega1, theta2, omega2)
    # Sums of angles up to 20 rad round at 4e-15, times 2500 N.m/rad.
    with_both_turned = shaft_torque(
        DRIVE, theta1 + turned, omega1 + turning, theta2 + turned, omega2 + turning
    )
    assert with_both_turned == pytest.approx(torque, rel=1e-13, abs=1e-10)
    assert shaft_torque(DRIVE, theta2, omega2, theta1, omega1) == pytest.approx(-torque, rel=1e-13, abs=1e-10)


def test_elements_are_columns_as_well_as_numbers() -> None:
    columns = np.random.default_rng(1).uniform(-3.0, 3.0, (5, 7))
    together = rates(columns, voltage=12.0)
    for k in range(7):
        np.testing.assert_array_equal(together[:, k], rates(columns[:, k], voltage=12.0))


def test_without_current_motor_and_load_swing_with_the_eigenfrequency_of_two_masses() -> None:
    free = DRIVE._replace(constant=1e-12)  # no torque of the motor, and no induced voltage
    eigenvalues = np.linalg.eigvals(system_matrix(free))
    reduced = DRIVE.inertia * LOAD / (DRIVE.inertia + LOAD)
    decay, undamped = DRIVE.damping / (2.0 * reduced), np.sqrt(DRIVE.stiffness / reduced)
    swinging = eigenvalues[eigenvalues.imag > 1.0]
    # A twofold eigenvalue of 0 (both turn freely) beside them costs half the digits at most.
    assert swinging == pytest.approx([-decay + 1j * np.sqrt(undamped**2 - decay**2)], rel=1e-8)
    assert undamped == pytest.approx(86.6025403784, rel=1e-11)


def test_with_the_motor_locked_the_load_swings_with_the_root_of_k_over_its_inertia() -> None:
    locked = DRIVE._replace(inertia=1e15, damping=1e-9)
    eigenvalues = np.linalg.eigvals(system_matrix(locked))
    assert max(eigenvalues.imag) == pytest.approx(np.sqrt(DRIVE.stiffness / LOAD), rel=1e-9)


def test_the_current_of_a_shaft_at_rest_rises_with_its_time_constant() -> None:
    t = np.linspace(0.0, 0.01, 11)
    found = solve_ivp(
        lambda _, i: [current_rate(DRIVE, 10.0, 0.0, i[0])],
        (0.0, 0.01),
        [0.0],
        t_eval=t,
        rtol=1e-12,
        atol=1e-14,
    )
    expected = 10.0 / DRIVE.resistance * (1.0 - np.exp(-t * DRIVE.resistance / DRIVE.inductance))
    np.testing.assert_allclose(found.y[0], expected, rtol=0.0, atol=1e-10)  # of up to 20 A, rtol 1e-12 a step


def test_without_load_a_constant_voltage_ends_at_the_speed_that_induces_it() -> None:
    found = integrated(DRIVE, 24.0, np.array([0.0, 3.0]))
    speed = 24.0 / (DRIVE.constant * DRIVE.ratio)
    theta1, omega1, current, theta2, omega2 = found[:, -1]
    # The slowest time constant is near (I1 + J) R / (C i_p)^2 = 30 ms: e^-100 is left of it after 3 s.
    assert omega1 == pytest.approx(speed, rel=1e-9)
    assert omega2 == pytest.approx(speed, rel=1e-9)
    assert current == pytest.approx(0.0, abs=1e-8)
    assert theta1 - theta2 == pytest.approx(0.0, abs=1e-9)


def rigid_speed(t: FloatArray, voltage: float) -> FloatArray:
    """Return the speed of the drive and its load on a rigid shaft, by eigenvalues."""
    total, torque = DRIVE.inertia + LOAD, DRIVE.constant * DRIVE.ratio
    A = np.array([[0.0, torque / total], [-torque / DRIVE.inductance, -DRIVE.resistance / DRIVE.inductance]])
    values, vectors = np.linalg.eig(A)
    steady = np.array([voltage / torque, 0.0])
    parts = np.linalg.solve(vectors, -steady)
    return np.real(steady[0] + (vectors[0] * parts) @ np.exp(np.outer(values, t)))


def test_the_stiffer_the_shaft_the_nearer_the_rigid_drive_in_proportion_to_1_over_k() -> None:
    t = np.linspace(0.05, 0.2, 16)
    apart = []
    for stiffness in (2.5e5, 2.5e6, 2.5e7):
        # Damping that keeps the shaft's own swing at half of critical, so that it has died away by 0.05 s.
        stiff = DRIVE._replace(stiffness=stiffness, damping=np.sqrt(stiffness / 3.0))
        apart.append(float(np.abs(integrated(stiff, 24.0, t)[1] - rigid_speed(t, 24.0)).max()))
    # The next term of the expansion is 1 / k^1.5 here (the damping grows with the root of k).
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.2)
    assert apart[1] / apart[2] == pytest.approx(10.0, rel=0.2)
    assert apart[2] < 1e-4


positions = st.floats(-10.0, 10.0)
bounds = st.floats(0.05, 20.0)


def duration(way: float, speed: float, acceleration: float) -> float:
    """Return how long a trapezoid takes: its two halves are a triangle where it is too short."""
    if way < speed**2 / acceleration:
        return float(2.0 * np.sqrt(way / acceleration))
    return way / speed + speed / acceleration


def test_the_step_is_at_its_target_from_its_time_on() -> None:
    found = step(np.array([0.0, 0.999, 1.0, 5.0]), 1.0, 0.5, -2.0)
    np.testing.assert_array_equal(found.position, [0.5, 0.5, -2.0, -2.0])
    np.testing.assert_array_equal(found.velocity, np.zeros(4))
    np.testing.assert_array_equal(found.acceleration, np.zeros(4))


def test_a_corner_is_reached_just_its_slack_early() -> None:
    early = np.array([np.nextafter(-CORNER_SLACK, -1.0), -CORNER_SLACK])
    np.testing.assert_array_equal(step(early, 0.0, 0.5, -2.0).position, [0.5, -2.0])
    np.testing.assert_array_equal(ramp(early, 0.0, 0.5, -2.0, 3.0).velocity, [0.0, -3.0])


def test_the_ramp_goes_with_its_speed_all_the_way() -> None:
    found = ramp(np.array([0.0, 1.0, 1.25, 2.0, 3.0]), 1.0, 0.5, -1.5, 2.0)
    np.testing.assert_array_equal(found.position, [0.5, 0.5, 0.0, -1.5, -1.5])
    np.testing.assert_array_equal(found.velocity, [0.0, -2.0, -2.0, 0.0, 0.0])
    np.testing.assert_array_equal(found.acceleration, np.zeros(5))


def test_the_way_of_a_ramp_is_what_lies_between_its_ends() -> None:
    found = ramp(np.array([0.5, 0.75, 1.0]), 0.0, 3.0, 1.0, 2.0)
    np.testing.assert_array_equal(found.position, [2.0, 1.5, 1.0])
    np.testing.assert_array_equal(found.velocity, [-2.0, -2.0, 0.0])


def test_the_trapezoid_at_its_corners_and_midway() -> None:
    # 4 rad with 2 rad/s and 4 rad/s2: 0.5 s up over 0.5 rad, 1.5 s level over 3 rad, 0.5 s down.
    t = 1.0 + np.array([-0.5, 0.0, 0.25, 0.5, 1.25, 2.0, 2.25, 2.5, 9.0])
    found = trapezoid(t, 1.0, -1.0, 3.0, 2.0, 4.0)
    np.testing.assert_allclose(
        found.position, [-1.0, -1.0, -0.875, -0.5, 1.0, 2.5, 2.875, 3.0, 3.0], rtol=0.0, atol=1e-15
    )
    np.testing.assert_allclose(
        found.velocity, [0.0, 0.0, 1.0, 2.0, 2.0, 2.0, 1.0, 0.0, 0.0], rtol=0.0, atol=1e-15
    )
    np.testing.assert_array_equal(found.acceleration, [0.0, 4.0, 4.0, 0.0, 0.0, -4.0, -4.0, 0.0, 0.0])


def test_a_short_trapezoid_is_a_triangle_that_turns_back_halfway() -> None:
    found = trapezoid(np.array([0.25, 0.5, 0.75, 1.0]), 0.0, 0.0, 1.0, 100.0, 4.0)
    np.testing.assert_array_equal(found.position, [0.125, 0.5, 0.875, 1.0])
    np.testing.assert_array_equal(found.velocity, [1.0, 2.0, 1.0, 0.0])
    np.testing.assert_array_equal(found.acceleration, [4.0, -4.0, -4.0, 0.0])


@given(positions, positions, bounds, bounds, st.floats(-1.0, 1.0))
@example(1.0, 1.0, 2.0, 10.0, 0.1)
@example(0.0, 5e-324, 2.0, 10.0, 0.1)
def test_a_trapezoid_keeps_its_limits_stays_on_its_way_and_arrives_to_the_bit_on_time(
    initial: float, target: float, speed: float, acceleration: float, begin: float
) -> None:
    total = duration(abs(target - initial), speed, acceleration)
    t = begin + np.linspace(-0.1, 1.1, 401) * max(total, 1e-3)
    found = trapezoid(t, begin, initial, target, speed, acceleration)
    slack = 1.0 + 1e-12  # a product of roots, rounded
    assert np.abs(found.velocity).max() <= speed * slack
    assert np.abs(found.acceleration).max() <= acceleration
    low, high = sorted((initial, target))
    assert found.position.min() >= low - 1e-12
    assert found.position.max() <= high + 1e-12
    arrived = t >= begin + total * slack + 1e-12
    assert (found.position[arrived] == target).all()
    assert (found.velocity[arrived] == 0.0).all()
    assert (found.position[t < begin] == initial).all()


@given(positions, positions, bounds, bounds)
def test_velocity_is_the_rate_of_the_position_and_acceleration_that_of_the_velocity(
    initial: float, target: float, speed: float, acceleration: float
) -> None:
    total = duration(abs(target - initial), speed, acceleration)
    t = np.linspace(-0.5, total + 0.5, 2_001)
    found = trapezoid(t, 0.0, initial, target, speed, acceleration)
    h = t[1] - t[0]
    rounded = 1e-15 * (total + 1.0)  # of differences of times
    means = 0.5 * (found.velocity[1:] + found.velocity[:-1])
    # Exact but for an interval with a corner in it, where the trapezoidal rule is off by a h / 4 at most.
    np.testing.assert_allclose(
        np.diff(found.position),
        h * means,
        rtol=0.0,
        atol=0.25 * acceleration * h * h + 4.0 * speed * rounded + 1e-14,
    )
    rise = min(speed / acceleration, np.sqrt(abs(target - initial) / acceleration))
    corners = np.searchsorted(t, [0.0, rise, total - rise, total])
    smooth = np.ones(len(t) - 1, dtype=bool)
    for beside in (-2, -1, 0):  # a corner on a sample may be rounded to either side of it
        smooth[corners + beside] = False
    np.testing.assert_allclose(
        np.diff(found.velocity)[smooth],
        h * found.acceleration[:-1][smooth],
        rtol=0.0,
        atol=4.0 * acceleration * rounded,
    )


@pytest.mark.parametrize("parts", [1, 3, 7, 16, 50])
def test_communication_points_meet_a_corner_though_their_times_are_rounded(parts: int) -> None:
    step_of = 5e-3 / parts
    points = np.arange(100 * parts)
    for t in (points * step_of + step_of, np.cumsum(np.full(100 * parts, step_of))):
        for found in (step(t, 0.1, 0.0, 1.0).position, ramp(t, 0.1, 0.0, 1.0, 1.0).velocity):
            assert np.argmax(found > 0.5) == 20 * parts - 1
        assert np.argmax(trapezoid(t, 0.1, 0.0, 1.0, 1.0, 10.0).acceleration > 0.0) == 20 * parts - 1


@pytest.mark.parametrize("kind", [STEP, RAMP, TRAPEZOID])
def test_the_kind_chooses_the_form_for_columns_and_numbers_alike(kind: int) -> None:
    t = np.linspace(0.0, 2.0, 41)
    arguments = (0.1, 0.5, 1.5, 2.0, 10.0)
    forms: list[JointMotion] = [step(t, *arguments[:3]), ramp(t, *arguments[:4]), trapezoid(t, *arguments)]
    found = evaluate_setpoint(kind, t, *arguments)
    np.testing.assert_array_equal(found, forms[kind])
    one = evaluate_setpoint(float(kind), float(t[9]), *arguments)
    assert [float(value) for value in one] == [column[9] for column in found]


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
