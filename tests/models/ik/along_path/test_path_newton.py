"""One sweep of Newton's method over a window: its recurrence, and what the damping leaves."""

from __future__ import annotations

import numpy as np
import pytest

from urmpipe_models.ik.path_numeric import DAMPING, newton_sweep, solve_recurrence
from urmpipe_models.ik.solutions import Targets, forward_targets
from urmpipe_models.ik.task import build_task
from urmpipe_models.kinematics.forward import jacobian_over_log
from urmpipe_models.robots.catalogue import load_robot


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 15, 16, 17, 100, 384])
def test_a_recurrence_in_sections_is_the_one_in_turn(count: int) -> None:
    rng = np.random.default_rng(count)
    J = rng.normal(size=(count, 3, 6))
    matrices, offsets = np.eye(6) - np.linalg.pinv(J) @ J, rng.normal(size=(count, 6))
    expected = [np.zeros(6)]
    for matrix, offset in zip(matrices, offsets, strict=True):
        expected.append(matrix @ expected[-1] + offset)
    # projections make nothing longer, so that 384 steps add up 384 roundings of numbers below 100 at most
    np.testing.assert_allclose(solve_recurrence(matrices, offsets), expected[1:], rtol=0.0, atol=1e-11)


def test_a_sweep_solves_the_linearised_path_exactly() -> None:
    """Each q least in |q - q_{k-1}|^2 + |e_k - J_k (q - p_k)|^2 / lambda^2: normal equations, in turn."""
    arm = load_robot("urm6")
    q = np.array([0.3, 2.0, 0.4, 2.5, 0.2, 1.0]) + 0.01 * np.arange(30)[:, None]
    targets = Targets(forward_targets(arm, q).position)
    guess = q + 0.002 * np.random.default_rng(1).normal(size=q.shape)
    held = np.full(6, np.nan)
    held[2] = guess[0, 2]
    guess[:, 2] = held[2]
    swept = newton_sweep(build_task(arm, targets), guess, q[0], held, np.full(30, DAMPING))
    free = np.isnan(held)
    J = jacobian_over_log(arm, guess)[:, :3] * free
    error = targets.position - forward_targets(arm, guess).position
    last = np.where(free, q[0], held)
    for k in range(30):
        A = np.eye(6) + J[k].T @ J[k] / DAMPING
        b = last - guess[k] + J[k].T @ error[k] / DAMPING
        last = guess[k] + np.linalg.solve(A, b)
        # rad: the normal equations lose the digits of 1 / DAMPING
        np.testing.assert_allclose(swept.q[k], last, rtol=0.0, atol=1e-7)
        last = swept.q[k]
    np.testing.assert_allclose(swept.error, np.linalg.norm(error, axis=1), rtol=1e-9)
