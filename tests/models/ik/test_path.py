"""Paths of poses of arms with a closed form: the continuous branch, singular poses, jumps, limits, speeds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ik_arms import UR, follow, limited, line, times
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.limits import joint_limits
from urmpipe_models.ik.path import find_jumps, solve_path
from urmpipe_models.ik.path_numeric import LeastMotionPath
from urmpipe_models.ik.solutions import SearchOptions, Targets, forward_targets
from urmpipe_models.ik.solve import solve
from urmpipe_models.robots.catalogue import load_robot

ROUNDING = 1e-9  # rad: what a closed form's 1e-12 become where the Jacobian's least singular value is 1e-3
UR5E, NEAR = load_robot("ur5e"), SearchOptions(tolerance=0.0035)


amounts = st.lists(st.floats(-0.4, 0.4), min_size=6, max_size=6)


@settings(max_examples=15, deadline=None)  # the first case imports
@given(amounts, amounts, st.sampled_from(["ur3", "ur5e", "ur10e"]))
def test_the_motion_of_a_path_is_found_again(first: list[float], by: list[float], robot: str) -> None:
    q = line(by, 40, UR + np.array(first))
    path = follow(load_robot(robot), q)
    np.testing.assert_allclose(path.q, q, rtol=0.0, atol=ROUNDING)
    assert not path.jumps and not path.singular
    assert path.method == "three parallel axes"
    assert len(set(path.branch)) == 1


@pytest.mark.slow
@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000), st.sampled_from(["arm6", "ur5e"]))
def test_a_walk_is_what_taking_the_nearest_sample_by_sample_gives(seed: int, robot: str) -> None:
    """All solutions in all allowed turns, and of them the nearest: written plainly, on coarse motions."""
    rng = np.random.default_rng(seed)
    arm = load_robot(robot)
    for joint in range(6):
        lower, upper = sorted(rng.uniform([-9.0, 2.0], [-2.0, 9.0]))
        arm = limited(arm, lower, upper, joint)
    t = np.linspace(0.0, 1.0, 40)[:, None]
    q = rng.uniform(-2.0, 2.0, 6) + rng.uniform(-2.0, 2.0, 6) * t
    targets = forward_targets(arm, q)
    path = solve_path(arm, targets, times(40), start=q[0])
    every = solve(arm, targets, every=True)
    turns = 2.0 * math.pi * np.arange(-4.0, 5.0)
    lower, upper = joint_limits(arm)
    last = q[0]
    gaps = np.flatnonzero(~every.reached.any(axis=1))
    for k, solutions in enumerate(every.q[: gaps[0] if len(gaps) else None]):
        options = []
        for one in solutions[every.reached[k]]:
            shifted = one + turns[:, None]
            shifted[(shifted < lower - 1e-9) | (shifted > upper + 1e-9)] = math.inf
            options.append(np.take_along_axis(shifted, np.abs(shifted - last).argmin(0)[None], 0)[0])
        last = options[int(np.argmin([np.square(one - last).sum() for one in options]))]
        np.testing.assert_allclose(path.q[k], last, rtol=0.0, atol=ROUNDING)
        last = path.q[k]


def stretching(beyond: FloatArray, q5: float = 1.2) -> tuple[FloatArray, Targets]:
    """Return joint values of a UR5e that stretches, and poses beyond theirs, in [m] from the shoulder."""
    count = len(beyond)
    q = line([0.0, 0.0, -0.4, 0.0, 0.0, 0.0], count, np.array([0.3, -0.9, 0.4, -0.7, q5, 0.3]))
    targets = forward_targets(UR5E, q)
    away = targets.position - np.array([0.0, 0.0, 0.1625])
    targets.position[:] += beyond[:, None] * away / np.linalg.norm(away, axis=1)[:, None]
    return q, targets


def test_within_the_tolerance_the_nearest_point_is_taken() -> None:
    q, targets = stretching(np.append(np.zeros(40), 0.002))
    assert not follow(UR5E, q, targets).reached[-1]
    path = follow(UR5E, q, targets, search=NEAR)
    assert path.reached.all()
    assert path.branch[-1] == "nearest point"
    assert 0.0 < path.position_residual[-1] <= 0.002 + 1e-9  # m: the pose before the shift is that near
    assert not path.position_residual[:-1].any()


def test_nearest_points_one_after_the_other_stay_in_their_turns() -> None:
    q, targets = stretching(np.linspace(0.0, 0.004, 41))
    path = follow(UR5E, q, targets, search=NEAR)
    assert path.reached.all()
    assert (path.branch == "nearest point").sum() > 10
    # rad: restarts find other turns of the same points, up to 12.6 away
    assert np.abs(np.diff(path.q, axis=0)).max() < math.pi
    q, targets = stretching(np.linspace(0.0, 0.004, 41), q5=0.3)  # and by least motion
    least = LeastMotionPath(UR5E, targets, q[0], NEAR, lambda share: None)
    assert np.isfinite(least.q).all()
    assert (least.shortfall > 0.0).sum() > 10
    assert np.abs(np.diff(least.q, axis=0)).max() < 1.0  # rad: other turns are 6.28 away


def test_the_start_decides_the_branch() -> None:
    targets = forward_targets(UR5E, line([0.2] * 6, 20))
    away = UR * [1.0, 1.0, 1.0, 1.0, -1.0, 1.0] + np.array([0.0, 0.0, 0.0, 3.0, 0.0, 3.0])
    flipped, path = (follow(UR5E, start[None], targets) for start in (away, UR))
    assert flipped.branch[0] != path.branch[0]
    assert flipped.jumps == ()
    reached = forward_targets(UR5E, flipped.q).position
    np.testing.assert_allclose(reached, targets.position, rtol=0.0, atol=1e-10)


def test_a_step_is_a_jump_only_if_half_of_it_leaves_the_path() -> None:
    every = solve(UR5E, forward_targets(UR5E, UR[None]), every=True)
    flipped = every.q[0, every.branches.index("left, elbow up, flipped")]
    aligned = UR * [1.0, 1.0, 1.0, 1.0, 0.0, 1.0]
    for q, expected in (
        ([UR, UR + 0.05, UR + 0.4], []),  # a long step along a smooth motion
        ([UR, flipped], [1]),
        ([UR, UR + np.array([0, 0, 0, 0, 0, 2.0 * math.pi])], [1]),
        ([aligned, aligned + 0.01 + np.array([0.0, 0.0, 0.0, 0.4, 0.0, 0.4])], []),
    ):
        assert find_jumps(UR5E, np.array(q), False).tolist() == expected
