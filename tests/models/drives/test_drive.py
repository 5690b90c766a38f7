"""The flexible drive: its equations one by one, and what they say together."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from urmpipe_models.drives import (
    Drive,
    current_rate,
    load_acceleration,
    motor_torque,
    shaft_acceleration,
    shaft_torque,
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
