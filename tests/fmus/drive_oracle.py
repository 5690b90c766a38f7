"""Eq. 14-19 of a drive and its load, written out: an oracle that uses nothing of what is tested."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.integrate import solve_ivp

from urmpipe_models.elementwise import FloatArray

# The parameters of the units at their start values.
K, DAMPING, RATIO, C, R, L, I1, J = 2500.0, 5.0, 100.0, 0.05, 0.5, 1e-3, 0.5, 1.0


def drive_matrix() -> FloatArray:
    """Return A of x' = A x with x = theta1, omega1, i_a, theta2, omega2, u, and u constant."""
    theta1, omega1, current, theta2, omega2, u = np.eye(6)
    torque = K * (theta1 - theta2) + DAMPING * (omega1 - omega2)
    motor = (RATIO * C * current - torque) / I1
    return np.array([omega1, motor, (u - C * RATIO * omega1 - R * current) / L, omega2, torque / J, 0.0 * u])


def integrate(A: FloatArray, x: FloatArray, duration: float) -> FloatArray:
    """Return x after a time, by DOP853."""
    solved = solve_ivp(lambda _, x: A @ x, (0.0, duration), x, method="DOP853", rtol=1e-12, atol=1e-14)
    return np.asarray(solved.y[:, -1])


def motor_after(values: Mapping[str, float], duration: float) -> FloatArray:
    """Return theta1, omega1, i_a after a time with the inputs u, theta2, omega2 constant."""
    A = drive_matrix()
    A[3:] = 0.0
    names = ("theta1", "omega1", "i_a", "theta2", "omega2", "u")
    x = np.array([values.get(name, 0.0) for name in names])
    return integrate(A, x, duration)[:3]
