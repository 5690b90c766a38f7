"""Several starts: which targets are solved, how many solutions there are, and why there are none."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from asserting import there
from closed_forms import assert_met
from ik_arms import by_shorter_way, joints_within, limited, planar
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik import restarts as attempts
from urmpipe_models.ik.closed import closed_form
from urmpipe_models.ik.limits import joint_limits, limit_solutions
from urmpipe_models.ik.numeric import refine
from urmpipe_models.ik.restarts import random_starts, solve_iteratively
from urmpipe_models.ik.solutions import NEAREST_POINT, SearchOptions, Targets, forward_targets
from urmpipe_models.math3d import rotation_about, translation
from urmpipe_models.robots.catalogue import load_robot

MET = 1.01e-10  # in [m] and [rad]: what is promised, and the rounding of the peer's rotation vector
URM6, ARM, NEAR = load_robot("urm6"), planar(0.5, 0.4), SearchOptions(tolerance=0.0035)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "restarts", "least", "count"),
    [("urm6", 20, 995, 1000), ("urm6", 200, 1000, 1000), ("panda", 20, 20, 20), ("ur5e", 20, 20, 20)],
)
def test_random_poses_take_the_promised_restarts(robot: str, restarts: int, least: int, count: int) -> None:
    """Of urm6 995 of 1000 within 20 restarts, all within 200; poses and starts are uniformly random."""
    chain = load_robot(robot)
    targets, start = forward_targets(chain, joints_within(chain, count, 2021)), joints_within(chain, count, 9)
    found = solve_iteratively(chain, targets, start=start, search=SearchOptions(restarts=restarts))
    assert found.branches == ("1",)
    assert found.reached.sum() >= least
    assert_met(chain, targets, found.q, MET)
    lower, upper = joint_limits(chain)
    q = found.q[found.reached]
    assert ((q >= lower) & (q <= upper)).all()


def test_the_solution_from_the_start_is_kept_and_a_singular_target_is_met_by_however_short_steps() -> None:
    """The wrist of the second pose is aligned to 1e-5: the last of the way takes hundreds of steps."""
    q = joints_within(URM6, 50, 1)
    solutions = solve_iteratively(URM6, forward_targets(URM6, q), start=q + 1e-3)
    np.testing.assert_allclose(solutions.q[:, 0], q, atol=1e-6)  # poses of conditions up to 1e4
    chain = load_robot("ur5e")
    targets = forward_targets(chain, joints_within(planar(*[1.0] * 6), 1000, 1)[958:959])
    found = solve_iteratively(chain, targets)
    assert found.reached.all()
    assert_met(chain, targets, found.q, MET)


@pytest.mark.slow
def test_of_the_solutions_that_are_found_first_the_nearest_to_the_start_is_taken() -> None:
    """Attempts come one, two, four, ... at a time; here each is made alone."""
    targets, start = forward_targets(URM6, joints_within(URM6, 40, 6)), np.array(URM6.start)
    found = solve_iteratively(URM6, targets).q[:, 0]
    restarts, others = random_starts(URM6, 7, 0), 0
    for row in np.flatnonzero(~refine(URM6, targets, start).converged):
        repeated = targets.rows(np.full(7, row))
        refined = refine(URM6, repeated, restarts, stationary=attempts.ATTEMPT_STATIONARY)
        for some in (slice(0, 1), slice(1, 3), slice(3, 7)):
            q = refined.q[some][refined.converged[some]]
            if len(q):
                away = np.square(by_shorter_way(q - start)).sum(axis=1)
                turned = by_shorter_way(found[row] - q[np.argmin(away)])
                np.testing.assert_allclose(turned, 0.0, atol=1e-9)  # whole turns apart
                others += int(np.argmin(away) > 0)
                break
    assert others > 0  # of some the first is not the nearest


@pytest.mark.parametrize(
    ("limit", "q1", "start", "nearer"),
    # from 3.0 rad a joint that ends at +-3.1 gets to -2.9 by 5.9, not by 0.38
    [(math.inf, 0.3, (0.2, 0.7), 0), (3.1, -2.9, (3.0, 0.8), 1)],
)
def test_both_solutions_of_a_planar_arm_are_found_nearest_first_by_the_way_that_limits_leave(
    limit: float, q1: float, start: tuple[float, float], nearer: int
) -> None:
    arm = limited(planar(0.5, 0.4), -limit, limit)
    position = Targets(forward_targets(arm, np.array([[q1, 0.8]])).position)
    found = solve_iteratively(arm, position, start=np.array(start), every=True)
    assert found.branches == ("1", "2")
    angle = 2 * math.atan2(0.4 * math.sin(0.8), 0.5 + 0.4 * math.cos(0.8))
    both = [[q1, 0.8], [q1 + angle, -0.8]]
    np.testing.assert_allclose(found.q[0], [both[nearer], both[1 - nearer]], atol=1e-8)


def test_every_solution_of_a_closed_form_is_found() -> None:
    """Of the UR5e: as many as the three parallel axes have, the same values."""
    chain = load_robot("ur5e")
    targets = forward_targets(chain, joints_within(chain, 12, 6))
    peer = limit_solutions(chain, there(closed_form(chain)).solve(targets), np.array(chain.start))
    found = solve_iteratively(chain, targets, every=True, search=SearchOptions(restarts=150))
    np.testing.assert_array_equal(found.reached.sum(axis=1), peer.reached.sum(axis=1))
    for row in range(12):
        for q in peer.q[row][peer.reached[row]]:  # a miss of 1e-10, conditions up to 1e4
            assert np.nanmin(np.abs(by_shorter_way(found.q[row] - q)).max(axis=1)) < 1e-6


def test_every_solution_is_distinct_ordered_and_met() -> None:
    targets = forward_targets(URM6, joints_within(URM6, 30, 6))
    found = solve_iteratively(URM6, targets, every=True)
    assert_met(URM6, targets, found.q, MET)
    counts = found.reached.sum(axis=1)
    assert counts.min() >= 1
    assert counts.max() >= 6
    away = found.q - np.array(URM6.start)
    for row, count in enumerate(counts):
        assert found.reached[row, :count].all()
        assert (np.diff(np.square(away[row, :count]).sum(axis=1)) >= -1e-9).all()
        assert np.abs(away[row, :count]).max() <= math.pi + 1e-9
        for a, b in combinations(found.q[row, :count], 2):
            assert np.abs(by_shorter_way(a - b)).max() > attempts.DISTINCT_TOLERANCE
        assert set(found.reasons[row, count:]) <= {"no further solution in 20 restarts"}
        assert set(found.reasons[row, :count]) == {""}


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["urm6", "urm8"])
def test_the_same_seed_finds_the_same_and_another_seed_begins_elsewhere(robot: str) -> None:
    chain = load_robot(robot)
    targets, search = forward_targets(chain, joints_within(chain, 12, 6)), SearchOptions(restarts=6, seed=4)
    first, again = (solve_iteratively(chain, targets, every=True, search=search) for _ in range(2))
    np.testing.assert_array_equal(first.q, again.q)
    assert (random_starts(chain, 6, 4) != random_starts(chain, 6, 5)).all()
    np.testing.assert_array_equal(random_starts(chain, 6, 4), random_starts(chain, 20, 4)[:6])


@pytest.mark.parametrize("every", [False, True])
def test_what_is_found_for_a_target_does_not_depend_on_the_others(every: bool) -> None:
    targets, search = forward_targets(URM6, joints_within(URM6, 15, 6)), SearchOptions(restarts=8)
    together = solve_iteratively(URM6, targets, every=every, search=search)
    for row in (14, 3):
        alone = solve_iteratively(URM6, targets.rows(slice(row, row + 1)), every=every, search=search)
        count = alone.q.shape[1]
        np.testing.assert_array_equal(together.q[row, :count], alone.q[0])
        assert not together.reached[row, count:].any()


def test_random_starts_lie_within_limits() -> None:
    ends = [(-math.inf, math.inf), (-0.5, 0.2), (1.0, math.inf), (-math.inf, -2.0)]
    turning = [Joint(f"r{k}", lower=a, upper=b) for k, (a, b) in enumerate(ends)]
    sliding = [Joint(f"p{k}", "prismatic", lower=a, upper=b) for k, (a, b) in enumerate(ends)]
    chain = Chain("ends", (*turning, *sliding), tip=translation(3.0, 0.0, 0.0), start=(0, 0, 1, -2) * 2)
    draws = random_starts(chain, 5000, 0)
    turn, reach = 2 * math.pi, 3.0  # the arm is 3 m long
    spans = [(-math.pi, math.pi), (-0.5, 0.2), (1.0, 1.0 + turn), (-2.0 - turn, -2.0)]
    spans += [(-reach, reach), (-0.5, 0.2), (1.0, 1.0 + 2 * reach), (-2.0 - 2 * reach, -2.0)]
    for column, (low, high) in zip(draws.T, spans, strict=True):
        assert low <= column.min() < low + 0.01 * (high - low)
        assert high >= column.max() > high - 0.01 * (high - low)


def test_a_pose_out_of_reach_has_the_distance_and_the_turn_that_are_left() -> None:
    pose = forward_targets(ARM, np.array([[0.0, 0.0]]))
    pose.position[:] += 0.1
    reason = there(solve_iteratively(ARM, pose, search=SearchOptions(restarts=1)).reason(0))
    assert reason.startswith("no solution in 1 restart; nearest: 0.1")
    assert reason.endswith(" rad away")


def test_a_target_out_of_reach_takes_the_nearest_point_within_the_tolerance() -> None:
    targets = Targets(np.array([[0.903, 0.0, 0.0], [0.91, 0.0, 0.0], [0.5, 0.1, 0.0]]))
    found = solve_iteratively(ARM, targets, start=np.array([0.1, 0.2]), search=NEAR)
    assert found.reached[:, 0].tolist() == [True, False, True]
    np.testing.assert_allclose(found.position_residual[:, 0], [0.003, 0.0, 0.0], atol=1e-9)
    assert found.labels[:, 0].tolist() == [NEAREST_POINT, "1", "1"]
    np.testing.assert_allclose(found.q[0, 0], [0.0, 0.0], atol=1e-3)  # flat there: 1e-9 m is 1e-4 rad
    assert found.reason(0) is None


def test_a_nearest_pose_that_is_turned_too_far_is_none() -> None:
    """The point is met only with another orientation: the arm in the plane cannot tilt its tool."""
    tilted = forward_targets(ARM, np.array([[0.3, 0.8]]))
    tilt: FloatArray = np.array(rotation_about((1.0, 0.0, 0.0), 0.1).rotation)
    found = solve_iteratively(ARM, replace(tilted, rotation=tilt @ there(tilted.rotation)), search=NEAR)
    assert found.reason(0) is not None


def test_a_target_that_is_not_finite_has_a_reason_and_stops_no_other() -> None:
    targets = forward_targets(URM6, joints_within(URM6, 3, 6))
    targets.position[1, 2] = np.inf
    found = solve_iteratively(URM6, targets)
    assert found.reached[:, 0].tolist() == [True, False, True]
    assert found.reason(1) == "the target is not finite, allowed: finite numbers"
    nothing = solve_iteratively(URM6, Targets(np.empty((0, 3)), np.empty((0, 3, 3))), every=True)
    assert nothing.q.shape == (0, 1, 6)
