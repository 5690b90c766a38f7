"""Derivatives that are written out, against differences of what they are derivatives of."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from differences import assert_jacobian, assert_slope
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import RAMP, STEP, TRAPEZOID, evaluate_setpoint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik import trigonometric
from urmpipe_models.ik.loop_equations import jacobian_determinant
from urmpipe_models.ik.solutions import Targets, forward_targets
from urmpipe_models.ik.task import Task, build_task
from urmpipe_models.kinematics.forward import Screws, jacobian_over_log, screws_to_chain
from urmpipe_models.networks.joint_motion import left_jacobian_inverse
from urmpipe_models.robots.catalogue import load_robot, robot_names

# --- what an iterative inverse misses its targets by ---------------------------------------------------


def task_of(chain: Chain, count: int, *, pose: bool = True) -> tuple[Task, FloatArray]:
    """Return random targets of a chain, and other joint values, shape (joints, count)."""
    rng = np.random.default_rng(1)
    goals, q = rng.uniform(-2.0, 2.0, (2, len(chain.coordinates), count))
    targets = forward_targets(chain, goals.T)
    return build_task(chain, targets if pose else Targets(targets.position)), q


def assert_gradients(task: Task, q: FloatArray) -> None:
    """Compare grad(|e|^2 / 2) = -J^T e of every joint, at any miss."""
    error = task.error(q)
    slope = -np.einsum("ijn,in->jn", error.jacobian, error.vector)
    # m2: entries of e of up to 10 m, three derivatives of their products; 1 / sin(angle) near half a turn
    assert_jacobian(lambda at: 0.5 * task.error(at).square, slope, q, third=1e4, size=100.0)


@pytest.mark.parametrize("robot", robot_names())
@pytest.mark.parametrize("pose", [True, False], ids=["pose", "position"])
def test_the_gradient_of_the_squared_miss_is_minus_j_transposed_e_at_any_target(
    robot: str, pose: bool
) -> None:
    assert_gradients(*task_of(load_robot(robot), 20, pose=pose))


@settings(max_examples=20, deadline=None)
@given(data=st.data(), pose=st.booleans())
def test_it_is_so_for_any_chain(chains: SearchStrategy[Chain], data: st.DataObject, pose: bool) -> None:
    task, q = task_of(data.draw(chains), 3, pose=pose)
    error = task.error(q)
    if np.sqrt(error.angle2).max() < 3.0 * error.length:  # at half a turn the axis leaps
        assert_gradients(task, q)


@pytest.mark.parametrize("robot", ["urm6", "ur5e", "panda", "iiwa14"])
def test_the_miss_changes_by_the_jacobian_and_its_turn_by_that_of_the_logarithm(robot: str) -> None:
    """-de = A J dq, for the turn with A of R(e) = R_target R^T: a turn by w changes e by -A w."""
    task, q = task_of(load_robot(robot), 40)
    error = task.error(q)
    regular = np.sqrt(error.angle2) < 3.0 * error.length
    rows = np.flatnonzero(regular)
    task, q, error = task.rows(rows), q[:, regular], error.rows(rows)
    changes = error.jacobian.copy()
    changes[3:] = np.einsum(
        "ijn,jkn->ikn", left_jacobian_inverse(-error.vector[3:] / error.length), changes[3:]
    )
    # m: three derivatives of an arm of up to 10 m, and 1 / (pi - 3)^3 of the logarithm
    assert_jacobian(lambda at: task.error(at).vector, -changes.transpose(1, 0, 2), q, third=1e4, size=100.0)


# --- closed forms --------------------------------------------------------------------------------------


def test_slope_and_curvature_of_a_quadric_are_its_derivatives() -> None:
    rng = np.random.default_rng(3)
    k, x = rng.uniform(-1.0, 1.0, (6, 200)), rng.uniform(-4.0, 4.0, 200)
    value, slope, curvature = trigonometric._value, trigonometric._slope, trigonometric._curvature
    # up to 2^3 of each of the three products, 1 of the two others
    assert_slope(lambda h: value(k, x + h), slope(k, x), third=40.0, size=6.0)
    assert_slope(lambda h: slope(k, x + h), curvature(k, x), third=40.0, size=6.0)


@pytest.mark.parametrize("kinds", list(product((True, False), repeat=3)), ids=str)
def test_the_determinant_of_three_joints_is_that_of_the_wrist_s_jacobian(kinds: tuple[bool, ...]) -> None:
    rng = np.random.default_rng(5)
    direction = rng.normal(size=(3, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    wrist, q = rng.uniform(-1.0, 1.0, 3), rng.uniform(-2.0, 2.0, (3, 50))
    arm = Screws(direction, rng.uniform(-1.0, 1.0, (3, 3)), np.array(kinds), np.eye(3), wrist)
    J = jacobian_over_log(screws_to_chain(arm, ("a", "b", "c")), q.T)[:, :3]
    # products of three levers of up to 10 m
    np.testing.assert_allclose(jacobian_determinant(arm, wrist, q), np.linalg.det(J), rtol=0.0, atol=1e-11)


# --- set points ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [STEP, RAMP, TRAPEZOID])
@pytest.mark.parametrize(("value", "rate"), [(0, 1), (1, 2)], ids=["velocity", "acceleration"])
def test_rates_of_a_set_point_are_its_derivatives_but_at_corners(kind: int, value: int, rate: int) -> None:
    """The difference of a parabola is its derivative but for rounding; impulses at corners are left out."""
    h, t = 1e-5, np.linspace(0.0, 4.0, 397)
    arguments = (0.5, -1.0, 3.0, 2.0, 4.0)
    corners = np.array([0.5, 1.0, 2.5, 3.0])  # of the trapezoid; the step and the ramp have some of them
    within = t[(np.abs(t[:, None] - corners) > h).all(axis=1)]
    slope = evaluate_setpoint(kind, within, *arguments)[rate]
    assert_slope(
        lambda s: evaluate_setpoint(kind, within + s, *arguments)[value], slope, third=0.0, size=4.0, h=h
    )
