"""The null-space rule: what is found meets the conditions of least motion, held by other means."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.limits import joint_limits
from urmpipe_models.ik.numeric import (
    AT_LIMIT_TOLERANCE,
    MOTION_TOLERANCE,
    DescentOptions,
    minimise_motion,
    refine,
)
from urmpipe_models.ik.solutions import Targets, forward_targets, pose_errors
from urmpipe_models.ik.task import build_task, orientation_length
from urmpipe_models.kinematics.forward import jacobian_over_log
from urmpipe_models.math3d import translation
from urmpipe_models.robots.catalogue import load_robot


def posed(robot: str, pose: bool, count: int, noise: float) -> tuple[Chain, Targets, FloatArray]:
    """Return an arm, targets within its reach, and starts beside the joint values that they come from."""
    chain = load_robot(robot)
    lower, upper = joint_limits(chain)
    rng = np.random.default_rng(8)
    q = rng.uniform(np.maximum(lower, -math.pi), np.minimum(upper, math.pi), (count, len(lower)))
    targets = forward_targets(chain, q)
    home = np.clip(q + rng.normal(0.0, noise, q.shape), lower, upper)
    return chain, targets if pose else Targets(targets.position), home


def weighted_jacobian(chain: Chain, q: FloatArray, pose: bool) -> FloatArray:
    J = jacobian_over_log(chain, q)
    J[:, 3:] *= orientation_length(chain)
    return J if pose else J[:, :3]


def assert_least_motion(chain: Chain, q: FloatArray, home: FloatArray, pose: bool) -> None:
    """Hold the conditions of Karush, Kuhn and Tucker: home - q is J^T lambda and pulls against limits."""
    from scipy.optimize import lsq_linear

    lower, upper = joint_limits(chain)
    for row, J in enumerate(weighted_jacobian(chain, q, pose)):
        wish = home[row] - q[row]
        low, high = q[row] <= lower + AT_LIMIT_TOLERANCE, q[row] >= upper - AT_LIMIT_TOLERANCE
        free = ~(low | high)
        # the joints that are held pull outwards or not at all: least squares over lambda and those pulls
        pulls = np.diag(np.where(low, -1.0, 1.0))[:, ~free]
        bounds = np.r_[np.full(len(J), -np.inf), np.zeros(pulls.shape[1])], np.inf
        left = lsq_linear(np.hstack([J.T, pulls]), wish, bounds, tol=1e-14)
        # t is a projection of what is left; released one at a time, each joint may leave LEAST_MOTION
        assert np.abs(left.fun).max() < 10.0 * MOTION_TOLERANCE, (row, free, left.fun)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "pose"),
    [("urm8", True), ("urm8", False), ("urm6", False), ("panda", True), ("panda", False), ("iiwa14", True)],
)
@pytest.mark.parametrize("noise", [0.1, 0.6])
def test_a_target_that_leaves_freedoms_is_met_with_least_motion(robot: str, pose: bool, noise: float) -> None:
    chain, targets, home = posed(robot, pose, 40, noise)
    refined = refine(chain, targets, home)
    met = refined.converged
    assert met.mean() > 0.9
    assert (refined.slack[met] <= MOTION_TOLERANCE).all()
    assert_least_motion(chain, refined.q[met], home[met], pose)


def test_joints_at_limits_take_part_in_the_rule() -> None:
    """Some solutions of the panda stand at a limit, others have come off one that they started at."""
    chain, targets, home = posed("panda", False, 300, 0.6)
    lower, upper = joint_limits(chain)
    home[::2, 3] = upper[3]
    refined = refine(chain, targets, home)
    at_limit = (refined.q <= lower + AT_LIMIT_TOLERANCE) | (refined.q >= upper - AT_LIMIT_TOLERANCE)
    assert (at_limit.any(axis=1) & refined.converged).sum() > 20
    assert ((refined.q[::2, 3] < upper[3] - 0.01) & refined.converged[::2]).sum() > 20
    assert_least_motion(chain, refined.q[refined.converged], home[refined.converged], False)


def test_the_least_motion_of_a_planar_arm_is_that_of_a_search_over_its_freedom() -> None:
    """Three joints, a position in the plane: one freedom, q1, tried at 20001 values."""
    joints = [Joint("q1"), *(Joint(f"q{k}", origin=translation(0.4, 0.0, 0.0)) for k in (2, 3))]
    arm = Chain("planar", tuple(joints), tip=translation(0.4, 0.0, 0.0))
    target, home = np.array([0.5, 0.4, 0.0]), np.array([0.3, 0.4, 0.5])
    refined = refine(arm, Targets(target[None]), home)
    q1 = np.linspace(-math.pi, math.pi, 20001)
    x, y = target[0] - 0.4 * np.cos(q1), target[1] - 0.4 * np.sin(q1)
    cosine = (x * x + y * y) / (2 * 0.4 * 0.4) - 1.0
    q3 = np.arccos(np.where(np.abs(cosine) <= 1.0, cosine, np.nan))
    distances = []
    for sign in (1.0, -1.0):
        q2 = np.arctan2(y, x) - sign * q3 / 2 - q1
        away = np.stack([q1, q2, sign * q3]) - home[:, None]
        away -= 2 * math.pi * np.round(away / (2 * math.pi))
        distances.append(np.nanmin(np.square(away).sum(axis=0)))
    found = np.square(refined.q[0] - home).sum()
    np.testing.assert_allclose(found, min(distances), atol=1e-6)  # steps of 3e-4: their square


@pytest.mark.parametrize(("robot", "pose"), [("urm6", False), ("urm8", True)])
def test_no_solution_is_left_for_one_that_is_farther_from_home(robot: str, pose: bool) -> None:
    """Homes anywhere: a step that has overshot may meet the target farther away, turns away even."""
    chain, targets, home = posed(robot, pose, 200, 2.0)
    q = posed(robot, pose, 200, 0.0)[2]
    settings = DescentOptions(*joint_limits(chain))
    after, _ = minimise_motion(build_task(chain, targets), q.T.copy(), home.T.copy(), settings)
    before = np.square(q - home).sum(axis=1)
    assert (np.square(after.T - home).sum(axis=1) <= before + 1e-12).all()  # rounding of a row at rest


def test_least_motion_counts_from_home_wherever_the_search_begins() -> None:
    chain, targets, home = posed("urm8", True, 20, 0.02)
    direct = refine(chain, targets, home)
    around = refine(chain, targets, direct.q + 0.02, home=home)
    assert around.converged.all()
    # both end within LEAST_MOTION of where the gradient is 0; its slope is about 1
    np.testing.assert_allclose(around.q, direct.q, atol=100 * MOTION_TOLERANCE)


def test_a_whole_turn_is_no_motion_of_a_joint_that_turns_without_end() -> None:
    chain, targets, home = posed("urm8", True, 10, 0.02)
    plain, turned = refine(chain, targets, home), refine(chain, targets, home + 2 * math.pi, home=home)
    np.testing.assert_allclose(turned.q, plain.q, atol=100 * MOTION_TOLERANCE)


def test_a_radian_counts_as_a_metre() -> None:
    """Slides along x and y beside a turn of an arm of 0.5 m: at least motion home - q is J^T lambda.

    The turn moves the tool by 0.5 m a radian square to the arm, a slide by 1 m a metre.
    """
    slides = [Joint("x", "prismatic", axis=(1.0, 0.0, 0.0)), Joint("y", "prismatic", axis=(0.0, 1.0, 0.0))]
    arm = Chain("mixed", (*slides, Joint("turn")), tip=translation(0.5, 0.0, 0.0))
    found = refine(arm, Targets(np.array([[0.7, 0.4, 0.0]])), np.array([0.0, 0.0, 0.0]))
    x, y, turn = -found.q[0]
    assert abs(turn) > 0.05
    lever = 0.5 * np.array([math.sin(turn), math.cos(turn)])  # of -turn: what turns back by 1 rad moves
    np.testing.assert_allclose(turn, lever @ [x, y], atol=10 * MOTION_TOLERANCE)
    both = Chain("slides", (slides[0], replace(slides[0], name="x2")))
    shared = refine(both, Targets(np.array([[1.0, 0.0, 0.0]])), np.array([0.2, 0.0]))
    np.testing.assert_allclose(shared.q, [[0.6, 0.4]], atol=MOTION_TOLERANCE)  # 0.8 m shared by halves


def test_what_is_left_of_a_miss_does_not_grow_with_the_motion_along_the_null_space() -> None:
    chain, targets, home = posed("panda", True, 60, 0.8)
    refined = refine(chain, targets, home)
    distance, turn = pose_errors(chain, refined.q[refined.converged], targets.rows(refined.converged))
    assert np.linalg.norm(distance, axis=1).max() <= 1.01e-10
    assert np.linalg.norm(turn, axis=1).max() <= 1.01e-10
