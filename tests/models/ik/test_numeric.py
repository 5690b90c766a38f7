"""The iterative inverse from one start: targets met, nearest points, limits, least motion."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from scipy.optimize import least_squares, lsq_linear

from closed_forms import assert_met
from ik_arms import by_shorter_way, joints_within, limited, planar
from urmpipe_models.arm.chain import Chain, Joint, Mimic
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik import numeric
from urmpipe_models.ik.limits import joint_limits
from urmpipe_models.ik.numeric import AT_LIMIT_TOLERANCE, METHODS, MOTION_TOLERANCE, RefinementResult, refine
from urmpipe_models.ik.solutions import Targets, forward_targets, pose_errors
from urmpipe_models.ik.task import build_task, orientation_length
from urmpipe_models.kinematics.forward import jacobian_over_log
from urmpipe_models.math3d import translation
from urmpipe_models.robots.catalogue import load_robot

# the default tolerance in [m] and [rad], plus the rounding of the oracle's rotation vector
MET = 1.01e-10
URM6, ARM = load_robot("urm6"), planar(0.5, 0.4)
FREE = [("urm8", True), ("urm8", False), ("urm6", False), ("panda", True), ("panda", False), ("iiwa14", True)]


def test_where_nothing_bends_each_step_is_what_was_foreseen_and_the_next_is_damped_an_eighth() -> None:
    """e' = e mu / (1 + mu) of an arm whose Jacobian is the unit matrix, mu = g |e|^2, g from 0.1."""
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    chain = Chain("gantry", tuple(Joint(f"q{k}", "prismatic", axis=axis) for k, axis in enumerate(axes)))
    error, gain = 3.0, 0.1
    for steps in range(1, 4):
        error, gain = error * gain * error**2 / (1.0 + gain * error**2), gain / 8.0
        found = refine(chain, Targets(np.array([[1.0, 2.0, 2.0]])), np.zeros((1, 3)), iterations=steps)
        # the last is 7e-8: the rounding of coordinates of 2 m
        np.testing.assert_allclose(found.residual, error, rtol=1e-14, atol=1e-15)


def posed(robot: str, pose: bool, count: int, noise: float) -> tuple[Chain, Targets, FloatArray]:
    """Return an arm, targets within its reach, and starts near the joint values that they come from."""
    chain, rng = load_robot(robot), np.random.default_rng(8)
    q = joints_within(chain, count, rng)
    targets = forward_targets(chain, q)
    home = np.clip(q + rng.normal(0.0, noise, q.shape), *joint_limits(chain))
    return chain, targets if pose else Targets(targets.position), home


def refined(chain: Chain, targets: Targets, start: FloatArray, **options: Any) -> RefinementResult:
    """Refine starts, and assert that all joints stay within limits and that converged ones meet targets."""
    found = refine(chain, targets, start, **options)
    lower, upper = joint_limits(chain)
    assert ((found.q >= lower) & (found.q <= upper)).all()
    assert_met(chain, targets.rows(found.converged), found.q[found.converged], MET)
    return found


@pytest.mark.parametrize("robot", ["urm6", "urm8", "ur5e", "panda", "iiwa14", "arm6"])
@pytest.mark.parametrize("pose", [True, False], ids=["pose", "position"])
def test_targets_near_the_start_are_met(robot: str, pose: bool) -> None:
    # the others start beyond a singular pose
    assert refined(*posed(robot, pose, 200, 0.05)).converged.mean() > 0.98


def test_each_method_meets_regular_targets_near_the_start_and_two_take_quadratic_steps() -> None:
    """From 0.01 rad: 1e-2, 1e-4, 1e-8, 1e-16; damped least squares with its constant is linear."""
    q = joints_within(URM6, 300, 3)
    q = q[np.linalg.svd(jacobian_over_log(URM6, q))[1][:, -1] > 0.05]  # damping slows what moves little
    found = {method: refined(URM6, forward_targets(URM6, q), q + 0.01, method=method) for method in METHODS}
    assert all(each.converged.all() for each in found.values())
    lm, dls, pinv = (np.median(found[method].iterations) for method in ("lm", "dls", "pinv"))
    assert lm <= 4 and pinv <= 4 and dls > 2 * pinv


def test_a_pseudoinverse_step_is_the_moore_penrose_one() -> None:
    chain = load_robot("urm8")
    q = joints_within(chain, 20, 3)
    start, targets = q + 1e-3, forward_targets(chain, q)
    error = np.hstack(pose_errors(chain, start, targets))
    error[:, 3:] *= orientation_length(chain)
    peer = np.einsum("nij,nj->ni", np.linalg.pinv(weighted_jacobian(chain, start, True)), error)
    step = refine(chain, targets, start, method="pinv", iterations=1, metres=1e-15, home=start)
    np.testing.assert_allclose(step.q - start, peer, atol=1e-9)  # steps of 1e-3, condition up to 1e3


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_chains_of_any_joints_are_solved(chains: SearchStrategy[Chain], data: st.DataObject) -> None:
    """Prismatic joints, mimics, fixed frames, limits, few freedoms: a start on the target stays there."""
    chain = data.draw(chains)
    lower, upper = joint_limits(chain)
    q = np.clip(np.random.default_rng(1).uniform(-1.0, 1.0, (5, len(lower))), lower, upper)
    targets = forward_targets(chain, q)
    refined(chain, targets, np.clip(q + 1e-4, lower, upper))
    exact = refined(chain, targets, q)
    assert exact.converged.all() and not exact.iterations.any()
    np.testing.assert_allclose(exact.q, q, atol=1e-15)


def test_a_joint_that_another_follows_is_solved_with_it() -> None:
    leader = Joint("a", origin=translation(0.3, 0.0, 0.0))
    follower = Joint("b", origin=translation(0.4, 0.0, 0.0), mimic=Mimic("a", -0.5, 0.1))
    chain = Chain("mimic", (Joint("z"), leader, follower), tip=translation(0.2, 0.0, 0.0))
    q = np.array([[0.3, 0.9]])
    found = refine(chain, forward_targets(chain, q), q + 0.1)
    np.testing.assert_allclose(found.q, q, atol=1e-8)  # regular: a miss of 1e-10 over arms of 0.2 m


def test_a_singular_target_is_met_from_elsewhere_and_a_singular_pose_is_left() -> None:
    for target, start in ((0.9, [0.3, -0.4]), (0.6, [0.3, 0.0])):
        assert refine(ARM, Targets(np.array([[target, 0.0, 0.0]])), np.array(start)).converged.all()


def test_a_target_beyond_reach_takes_the_nearest_point() -> None:
    nearest = refine(ARM, Targets(np.array([[0.0, 2.0, 0.0], [0.0, 0.6, 0.25]])), np.array([0.4, 0.7]))
    assert not nearest.converged.any()
    np.testing.assert_allclose(nearest.distance, [1.1, 0.25], atol=1e-9)  # 2 - 0.9; out of the plane
    np.testing.assert_allclose(nearest.q[0], [math.pi / 2, 0.0], atol=1e-3)  # flat: 1e-9 m is 1e-4 rad
    np.testing.assert_allclose(nearest.residual, nearest.distance)


def beyond_limits(count: int) -> tuple[Chain, Targets, FloatArray]:
    """Return urm6 with limits of 2 rad, poses 1.5 m above those that it can take, and starts."""
    chain, rng = limited(URM6, -2.0, 2.0), np.random.default_rng(2)
    targets = forward_targets(chain, rng.uniform(-2.0, 2.0, (count, 6)))
    targets.position[:, 2] += 1.5
    return chain, targets, rng.uniform(-2.0, 2.0, (count, 6))


def test_the_nearest_pose_is_that_of_another_solver() -> None:
    """SciPy's trust region, on the same miss and from what was found, finds nothing nearer.

    Row 3 once stood still: a step cut short by limits was foreseen to lead away, and did, as foreseen.
    """
    chain, targets, start = beyond_limits(8)
    nearest = refine(chain, targets, start, iterations=400)
    assert not nearest.converged.any()
    for row in range(8):

        def miss(q: FloatArray, row: int = row) -> FloatArray:
            distance, turn = pose_errors(chain, q[None], targets.rows(slice(row, row + 1)))
            return np.concatenate([distance[0], orientation_length(chain) * turn[0]])

        near = np.clip(nearest.q[row], -1.999999, 1.999999)
        peer = least_squares(miss, near, bounds=(-2.0, 2.0), xtol=1e-12, gtol=1e-12)
        found = np.linalg.norm(miss(nearest.q[row]))
        np.testing.assert_allclose(found, nearest.residual[row], rtol=1e-9)
        # a cosine of 1e-7 between miss and motion leaves 1e-14 of the miss, more where it is nearly flat
        np.testing.assert_allclose(found, np.sqrt(2.0 * peer.cost), rtol=1e-6)


def test_a_rough_descent_to_a_nearest_point_ends_early_and_not_far_from_it() -> None:
    targets = forward_targets(URM6, joints_within(URM6, 50, 3))
    targets.position[:, 2] += 3.0
    fine = refine(URM6, targets, np.array(URM6.start), iterations=500)
    rough = refine(URM6, targets, np.array(URM6.start), iterations=500, stationary=1e-2)
    assert rough.iterations.mean() < 0.5 * fine.iterations.mean()
    # cosines of 1e-2 at most: 1e-4 of the miss, more where the way is curved
    assert np.median(rough.residual / fine.residual) < 1.001


def test_a_joint_stays_at_a_limit_in_its_way_and_leaves_it_again() -> None:
    """Its neighbour does what it can: |target - tool| is least there."""
    arm = limited(ARM, -0.5, 0.5)
    nearest = refine(arm, Targets(np.array([[0.0, 0.8, 0.0]])), np.array([0.0, 0.1]))
    np.testing.assert_allclose(nearest.q, [[0.5, 0.5]], atol=1e-12)
    back = refine(arm, forward_targets(arm, np.array([[0.1, -0.3]])), nearest.q)
    assert back.converged.all()
    np.testing.assert_allclose(back.q, [[0.1, -0.3]], atol=1e-8)


def test_joints_stay_within_limits_at_every_step() -> None:
    chain = limited(URM6, -1.0, 1.0)
    rng = np.random.default_rng(4)
    targets = forward_targets(chain, rng.uniform(-1.5, 1.5, (100, 6)))
    start = rng.uniform(-1.2, 1.2, (100, 6))  # clipped
    for method, steps in product(METHODS, range(6)):
        q = refine(chain, targets, start, method=method, iterations=steps).q
        assert np.abs(q).max() <= 1.0, (method, steps)


def test_no_step_leads_away_from_the_target() -> None:
    """Limits cut steps short: what is left of one may lead away, and may have been foreseen to."""
    chain, targets, start = beyond_limits(200)
    residuals = [refine(chain, targets, start, iterations=steps).residual for steps in range(1, 17)]
    assert (np.diff(residuals, axis=0) <= 0.0).all()


def test_a_bad_row_stops_no_other() -> None:
    q = joints_within(URM6, 3, 3)
    targets = forward_targets(URM6, q)
    alone = refine(URM6, targets, q + 0.05)
    targets.position[1] = np.nan
    nearest = refine(URM6, targets, q + 0.05)
    np.testing.assert_array_equal(nearest.converged, [True, False, True])
    np.testing.assert_array_equal(nearest.q[[0, 2]], alone.q[[0, 2]])
    assert math.isnan(nearest.residual[1]) and nearest.iterations[1] == 0


@pytest.mark.parametrize("robot", ["urm6", "urm8", "panda", "ur5e"])
def test_rows_are_solved_to_the_same_bits_alone(robot: str, monkeypatch: pytest.MonkeyPatch) -> None:
    chain, targets, start = posed(robot, True, 40, 0.4)
    whole = refine(chain, targets, start)
    for row in range(0, 40, 7):
        alone = refine(chain, targets.rows(slice(row, row + 1)), start[row])
        np.testing.assert_array_equal(alone.q[0], whole.q[row])
        assert alone.iterations[0] == whole.iterations[row]
    monkeypatch.setattr("urmpipe_models.ik.numeric.BATCH_SIZE", 7)
    np.testing.assert_array_equal(refine(chain, targets, start, threads=3).q, whole.q)


def weighted_jacobian(chain: Chain, q: FloatArray, pose: bool) -> FloatArray:
    J = jacobian_over_log(chain, q)
    J[:, 3:] *= orientation_length(chain)
    return J if pose else J[:, :3]


def assert_least_motion(chain: Chain, q: FloatArray, home: FloatArray, pose: bool) -> None:
    """Assert the conditions of Karush, Kuhn and Tucker: home - q is J^T lambda and pulls against limits."""
    lower, upper = joint_limits(chain)
    for row, J in enumerate(weighted_jacobian(chain, q, pose)):
        low, high = q[row] <= lower + AT_LIMIT_TOLERANCE, q[row] >= upper - AT_LIMIT_TOLERANCE
        free = ~(low | high)
        # the joints at limits pull outwards or not at all: least squares over lambda and those pulls
        pulls = np.diag(np.where(low, -1.0, 1.0))[:, ~free]
        bounds = np.r_[np.full(len(J), -np.inf), np.zeros(pulls.shape[1])], np.inf
        left = lsq_linear(np.hstack([J.T, pulls]), home[row] - q[row], bounds, tol=1e-14)
        # t is a projection of what is left; released one at a time, each joint may leave LEAST_MOTION
        assert np.abs(left.fun).max() < 10.0 * MOTION_TOLERANCE, (row, free, left.fun)


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "pose"), FREE)
@pytest.mark.parametrize("noise", [0.1, 0.6])
def test_a_target_that_leaves_freedoms_is_met_with_least_motion(robot: str, pose: bool, noise: float) -> None:
    chain, targets, home = posed(robot, pose, 40, noise)
    found = refined(chain, targets, home)
    met = found.converged
    assert met.mean() > 0.9
    assert (found.slack[met] <= MOTION_TOLERANCE).all()
    assert_least_motion(chain, found.q[met], home[met], pose)


def test_joints_at_limits_take_part_in_the_rule() -> None:
    """Some solutions of the panda stand at a limit, others have come off one that they started at."""
    chain, targets, home = posed("panda", False, 300, 0.6)
    lower, upper = joint_limits(chain)
    home[::2, 3] = upper[3]
    found = refined(chain, targets, home)
    at_limit = (found.q <= lower + AT_LIMIT_TOLERANCE) | (found.q >= upper - AT_LIMIT_TOLERANCE)
    assert (at_limit.any(axis=1) & found.converged).sum() > 20
    assert ((found.q[::2, 3] < upper[3] - 0.01) & found.converged[::2]).sum() > 20
    assert_least_motion(chain, found.q[found.converged], home[found.converged], False)
    # what is left of a miss does not grow with the motion along the null space, of poses either
    assert refined(*posed("panda", True, 60, 0.8)).converged.any()


def test_the_least_motion_of_a_planar_arm_is_that_of_a_search_over_its_freedom() -> None:
    """Three joints, a position in the plane: one freedom, q1, tried at 20001 values."""
    arm = planar(0.4, 0.4, 0.4)
    target, home = np.array([0.5, 0.4, 0.0]), np.array([0.3, 0.4, 0.5])
    nearest = refine(arm, Targets(target[None]), home)
    q1 = np.linspace(-math.pi, math.pi, 20001)
    x, y = target[0] - 0.4 * np.cos(q1), target[1] - 0.4 * np.sin(q1)
    cosine = (x * x + y * y) / (2 * 0.4 * 0.4) - 1.0
    q3 = np.arccos(np.where(np.abs(cosine) <= 1.0, cosine, np.nan))
    distances = []
    for sign in (1.0, -1.0):
        q2 = np.arctan2(y, x) - sign * q3 / 2 - q1
        away = by_shorter_way(np.stack([q1, q2, sign * q3]) - home[:, None])
        distances.append(np.nanmin(np.square(away).sum(axis=0)))
    found = np.square(nearest.q[0] - home).sum()
    np.testing.assert_allclose(found, min(distances), atol=1e-6)  # steps of 3e-4: their square


@pytest.mark.parametrize(("robot", "pose"), [("urm6", False), ("urm8", True)])
def test_no_solution_is_left_for_one_that_is_farther_from_home(robot: str, pose: bool) -> None:
    """Homes anywhere: a step that has overshot may meet the target farther away, turns away even."""
    chain, targets, home = posed(robot, pose, 200, 2.0)
    q = posed(robot, pose, 200, 0.0)[2]
    settings = numeric.DescentOptions(*joint_limits(chain))
    after, _ = numeric.minimise_motion(build_task(chain, targets), q.T.copy(), home.T.copy(), settings)
    before = np.square(q - home).sum(axis=1)
    assert (np.square(after.T - home).sum(axis=1) <= before + 1e-12).all()  # rounding of a row at rest


def test_least_motion_counts_from_home_wherever_the_search_begins_and_no_whole_turns() -> None:
    chain, targets, home = posed("urm8", True, 20, 0.02)
    direct = refine(chain, targets, home)
    around = refine(chain, targets, direct.q + 0.02, home=home)
    assert around.converged.all()
    turned = refine(chain, targets, home + 2 * math.pi, home=home)  # its joints turn without end
    # all end within LEAST_MOTION of where the gradient is 0; its slope is about 1
    for found in (around, turned):
        np.testing.assert_allclose(found.q, direct.q, atol=100 * MOTION_TOLERANCE)


def test_a_radian_counts_as_a_metre() -> None:
    """Slides along x and y, and a turn of an arm of 0.5 m: at least motion home - q is J^T lambda.

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
