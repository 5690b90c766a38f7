"""Paths of poses of arms with a closed form: the continuous branch, singular poses, jumps, limits, speeds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ik_arms import limited, times
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import OptionError
from urmpipe_models.ik.limits import joint_limits
from urmpipe_models.ik.path import find_jumps, solve_path
from urmpipe_models.ik.solutions import SearchOptions, Targets, forward_targets
from urmpipe_models.ik.solve import solve
from urmpipe_models.robots.catalogue import load_robot

ROUNDING = 1e-9  # rad: what a closed form's 1e-12 become where the Jacobian's least singular value is 1e-3
UR = np.array([0.3, -1.2, 1.4, -0.8, 1.2, 0.3])  # a pose in rad of a UR arm, its elbow and wrist bent
BENT = np.array([0.3, 0.4, -0.5, 0.7, -0.4, 0.2])  # one of an arm with a spherical wrist


def line(first: FloatArray, last: FloatArray, count: int) -> FloatArray:
    """Joint values on a line, shape (count, joints)."""
    return first + np.linspace(0.0, 1.0, count)[:, None] * (last - first)


amounts = st.lists(st.floats(-0.4, 0.4), min_size=6, max_size=6)


@settings(max_examples=15, deadline=None)  # the first case imports
@given(amounts, amounts, st.sampled_from(["ur3", "ur5e", "ur10e"]))
def test_the_motion_that_a_path_was_made_from_is_found_again(
    one: list[float], other: list[float], robot: str
) -> None:
    arm = load_robot(robot)
    q = line(UR + np.array(one), UR + np.array(other), 40)
    path = solve_path(arm, forward_targets(arm, q), times(40), start=q[0])
    np.testing.assert_allclose(path.q, q, rtol=0.0, atol=ROUNDING)
    assert path.jumps == ()
    assert path.singular == ()
    assert path.method == "three parallel axes"
    assert len(set(path.branch)) == 1


def test_turns_are_counted_on_up_to_the_limits() -> None:
    arm = load_robot("ur5e")
    q = line(
        UR + np.array([2.0, 0.0, 0.0, 0.0, 0.0, -6.0]), UR + np.array([5.5, 0.0, 0.0, 0.0, 0.0, 5.5]), 600
    )
    path = solve_path(arm, forward_targets(arm, q), times(600), start=q[0])
    np.testing.assert_allclose(path.q, q, rtol=0.0, atol=ROUNDING)
    assert path.jumps == ()


def aligned_half_way(robot: str) -> tuple[Chain, FloatArray]:
    """An arm and 201 joint values that pass exactly through an aligned wrist at sample 100."""
    arm = load_robot(robot)
    bent = UR if robot == "ur5e" else BENT
    # joints 4 and 6 of the UR arm turn about axes apart from each other, so that it must come in straight
    by = [0.3, 0.2, -0.2, 0.0, 0.0, 0.0] if robot == "ur5e" else [0.4, 0.3, 0.3, 0.0, 0.0, 0.0]
    q = line(bent, bent + np.array(by), 201)
    q[:, 4] = np.linspace(-0.3, 0.3, 201)
    q[100, 4] = 0.0
    return arm, q


@pytest.mark.parametrize("robot", ["arm6", "articulated6r", "ur5e"])
def test_through_an_aligned_wrist_the_joints_go_on_as_they_were(robot: str) -> None:
    arm, q = aligned_half_way(robot)
    path = solve_path(arm, forward_targets(arm, q), times(201), start=q[0])
    # rad: 1e-12 over the sine of 0.003 rad, with a margin of ten
    np.testing.assert_allclose(path.q, q, rtol=0.0, atol=1e-8)
    assert path.jumps == ()
    assert path.branch[0].endswith(", flipped") != path.branch[-1].endswith(", flipped")
    assert [one.text for one in path.singular] == ["sample 100 at 0.500 s: wrist aligned"]


@pytest.mark.parametrize("robot", ["arm6", "articulated6r", "ur5e"])
def test_a_path_within_an_aligned_wrist_keeps_the_free_joints_still(robot: str) -> None:
    arm, q = aligned_half_way(robot)
    q[:, 4] = 0.0
    path = solve_path(arm, forward_targets(arm, q), times(201), start=q[0])
    # rad: nothing is near singular here, the family is resolved as it is
    np.testing.assert_allclose(path.q, q, rtol=0.0, atol=ROUNDING)
    assert path.jumps == ()
    assert [one.text for one in path.singular] == ["samples 0 to 200, 0.000 to 1.000 s: wrist aligned"]


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


def test_what_is_out_of_reach_is_left_out_and_the_branch_goes_on() -> None:
    arm = load_robot("ur5e")
    q = line(UR, UR + np.array([1.0, 0.2, 0.1, 0.3, 0.2, -0.4]), 300)
    targets = forward_targets(arm, q)
    targets.position[100:150, 0] += 3.0
    targets.position[200] = math.nan
    path = solve_path(arm, targets, times(300), start=q[0])
    out = np.zeros(300, dtype=bool)
    out[100:150] = out[200] = True
    assert (path.reached == ~out).all()
    np.testing.assert_allclose(path.q[~out], q[~out], rtol=0.0, atol=ROUNDING)
    assert path.jumps == ()
    assert path.reasons[200] == "the position is nan, nan, nan m, allowed: finite numbers"
    assert all(" m" in text and "allowed" in text for text in path.reasons[100:150])
    assert set(path.branch[~out]) == {path.branch[0]}


def moved_over_a_gap(by: list[float]) -> tuple[FloatArray, Targets]:
    """Joint values in rad and poses of a UR5e that moves while its targets are out of reach."""
    first = line(UR, UR + 0.1, 20)
    first[:, 4] -= 0.9
    q = np.vstack((first, first + np.array(by)))
    targets = forward_targets(load_robot("ur5e"), q)
    targets.position[18:22, 2] += 3.0
    return q, targets


def test_after_a_gap_the_branch_of_before_goes_on_though_another_is_nearer() -> None:
    arm = load_robot("ur5e")
    q, targets = moved_over_a_gap([0.0, 0.0, 0.0, 2.9, 0.0, 2.9])
    path = solve_path(arm, targets, times(40), start=q[0])
    np.testing.assert_allclose(path.q[22:], q[22:], rtol=0.0, atol=ROUNDING)
    assert path.branch[22] == path.branch[17]
    assert path.jumps == ()
    nearest = solve_path(arm, targets.rows(slice(22, 40)), times(18), start=path.q[17])
    assert nearest.branch[0] != path.branch[22]


def test_another_branch_after_a_gap_is_told_as_a_jump() -> None:
    arm = limited(load_robot("ur5e"), -2.0, 2.0, 0)
    q, targets = moved_over_a_gap([2.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    path = solve_path(arm, targets, times(40), start=q[0])
    (jump,) = path.jumps
    assert jump.sample == 22
    assert (jump.from_branch, jump.to_branch) == (path.branch[17], path.branch[22])
    assert jump.from_branch != jump.to_branch


def test_a_joint_that_starts_anew_by_a_turn_over_a_gap_is_told_as_a_jump_and_as_too_fast() -> None:
    arm = load_robot("ur5e")
    upper = arm.moving[5].upper
    q = line(UR, UR + np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.2]), 40)
    q[:, 5] += upper - UR[5] - 0.1
    targets = forward_targets(arm, q)
    targets.position[18:22, 2] += 3.0
    path = solve_path(arm, targets, times(40), start=q[0])
    assert path.branch[22] == path.branch[17]
    (jump,) = path.jumps
    assert (jump.last, jump.sample, jump.from_branch) == (17, 22, jump.to_branch)
    (step,) = jump.joints
    assert step.step == pytest.approx(q[22, 5] - q[17, 5] - 2.0 * math.pi, abs=1e-9)
    assert "m: a jump since sample 17: " in jump.text
    (fast,) = path.too_fast
    assert (fast.joint, fast.first, fast.last, fast.t) == (arm.coordinates[5], 17, 22, 0.085)
    assert fast.speed == pytest.approx(-step.step / 0.025, rel=1e-9)


def test_within_the_tolerance_the_nearest_point_is_taken() -> None:
    arm = load_robot("ur5e")
    stretched = np.array([0.3, -0.9, 0.0, -0.7, 1.2, 0.3])
    q = line(stretched + np.array([0.0, 0.0, 0.4, 0.0, 0.0, 0.0]), stretched, 41)
    targets = forward_targets(arm, q)
    shoulder = np.array([0.0, 0.0, 0.1625])
    away = targets.position[-1] - shoulder
    targets.position[-1] += 0.002 * away / np.linalg.norm(away)
    assert not solve_path(arm, targets, times(41), start=q[0]).reached[-1]
    path = solve_path(arm, targets, times(41), start=q[0], search=SearchOptions(tolerance=0.0035))
    assert path.reached.all()
    assert path.branch[-1] == "nearest point"
    assert 0.0 < path.shortfall[-1] <= 0.002 + 1e-9  # m: the pose before the shift is that near
    assert not path.shortfall[:-1].any()


def test_nearest_points_one_after_the_other_stay_in_their_turns() -> None:
    arm = load_robot("ur5e")
    stretched = np.array([0.3, -0.9, 0.0, -0.7, 1.2, 0.3])
    q = line(stretched + np.array([0.0, 0.0, 0.4, 0.0, 0.0, 0.0]), stretched, 41)
    targets = forward_targets(arm, q)
    away = targets.position - np.array([0.0, 0.0, 0.1625])
    away /= np.linalg.norm(away, axis=1)[:, None]
    targets.position[:] += np.linspace(0.0, 0.004, 41)[:, None] * away
    path = solve_path(arm, targets, times(41), start=q[0], search=SearchOptions(tolerance=0.0035))
    assert path.reached.all()
    assert (path.branch == "nearest point").sum() > 10
    # rad: restarts find other turns of the same points, up to 12.6 away
    assert np.abs(np.diff(path.q, axis=0)).max() < math.pi


def test_a_branch_that_ends_is_left_by_a_jump_that_is_told() -> None:
    free = load_robot("ur5e")
    arm = limited(free, -3.0, 3.0, 0)
    q = line(
        UR + np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]), UR + np.array([3.2, 0.0, 0.0, 0.0, 0.0, 0.0]), 121
    )
    targets = forward_targets(free, q)
    path = solve_path(arm, targets, times(121), start=q[0])
    assert path.reached.all()
    assert path.q[:, 0].max() <= 3.0
    (jump,) = path.jumps
    assert jump.sample == int(np.argmax(q[:, 0] > 3.0))
    assert jump.t == pytest.approx(0.005 * jump.sample, abs=1e-12)
    assert jump.position == tuple(targets.position[jump.sample])
    assert (jump.from_branch, jump.to_branch) == tuple(path.branch[jump.sample - 1 : jump.sample + 1])
    assert jump.from_branch != jump.to_branch
    steps = path.q[jump.sample] - path.q[jump.sample - 1]
    assert {one.joint: one.step for one in jump.joints} == {
        name: step for name, step in zip(arm.coordinates, steps, strict=True) if abs(step) >= 0.1
    }
    x, y, z = jump.position
    assert jump.text == (
        f"sample {jump.sample} at {jump.t:.3f} s, ({x:.4f}, {y:.4f}, {z:.4f}) m: a jump from"
        f" {jump.from_branch} to {jump.to_branch}: " + ", ".join(map(str, jump.joints))
    )
    assert {one.joint for one in path.too_fast} <= {one.joint for one in jump.joints}


def test_a_joint_at_the_end_of_its_turns_starts_anew_and_that_is_told() -> None:
    arm = limited(limited(load_robot("ur5e"), -1.0, 1.0, 0), 0.1, 3.0, 4)  # no other branch within limits
    upper = arm.moving[5].upper
    q = line(UR, UR + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.4]), 81)
    q[:, 5] += upper - 0.5
    path = solve_path(arm, forward_targets(arm, q), times(81), start=q[0])
    (jump,) = path.jumps
    assert jump.sample == int(np.argmax(q[:, 5] > upper))
    assert jump.from_branch == jump.to_branch
    (step,) = jump.joints
    assert step.joint == arm.coordinates[5]
    assert step.step == pytest.approx(0.005 - 2.0 * math.pi, abs=1e-9)
    assert "a jump: " in jump.text


def test_a_joint_that_would_be_too_fast_is_told_once_a_stretch() -> None:
    arm = load_robot("ur5e")
    t = np.linspace(0.0, 1.0, 201)
    q = np.repeat(UR[None], 201, axis=0)
    q[:, 0] += 0.4 * np.sin(2.0 * math.pi * 2.0 * t)  # 5.03 rad/s at most, allowed: 3.14
    path = solve_path(arm, forward_targets(arm, q), times(201), start=q[0])
    speed = np.abs(np.diff(q[:, 0])) / 0.005
    over = speed > arm.moving[0].velocity
    assert [one.joint for one in path.too_fast] == [arm.coordinates[0]] * 5
    assert sum(one.last - one.first for one in path.too_fast) == over.sum()
    first = path.too_fast[0]
    assert (first.first, first.t) == (0, 0.0)
    assert first.speed == pytest.approx(speed.max(), abs=1e-6)
    assert first.text == (
        f"samples 0 to {first.last} from 0.000 s: joint {arm.coordinates[0]} moves at"
        f" {speed.max():.4g} rad/s, allowed: 3.142"
    )
    slow = solve_path(arm, forward_targets(arm, q), 2 * times(201), start=q[0])
    assert slow.too_fast == ()


def test_the_start_decides_the_branch() -> None:
    arm = load_robot("ur5e")
    q = line(UR, UR + 0.2, 20)
    targets = forward_targets(arm, q)
    away = UR * [1.0, 1.0, 1.0, 1.0, -1.0, 1.0] + np.array([0.0, 0.0, 0.0, 3.0, 0.0, 3.0])
    flipped = solve_path(arm, targets, times(20), start=away)
    assert flipped.branch[0] != solve_path(arm, targets, times(20), start=UR).branch[0]
    assert flipped.jumps == ()
    np.testing.assert_allclose(
        forward_targets(arm, flipped.q).position, targets.position, rtol=0.0, atol=1e-10
    )


def test_a_step_is_a_jump_only_if_half_of_it_leaves_the_path() -> None:
    arm = load_robot("ur5e")
    bent = UR
    every = solve(arm, forward_targets(arm, bent[None]), every=True)
    flipped = every.q[0, every.branches.index("left, elbow up, flipped")]
    aligned = UR * [1.0, 1.0, 1.0, 1.0, 0.0, 1.0]
    apart = np.array([0.0, 0.0, 0.0, 0.4, 0.0, 0.4])
    for q, expected in (
        (np.array([bent, bent + 0.05, bent + 0.4]), []),  # a long step along a smooth motion
        (np.array([bent, flipped]), [1]),
        (np.array([bent, bent + np.array([0, 0, 0, 0, 0, 2.0 * math.pi])]), [1]),
        (np.array([aligned, aligned + 0.01 + apart]), []),
    ):
        assert find_jumps(arm, q, False).tolist() == expected


def test_all_that_is_wrong_with_the_options_is_told_at_once() -> None:
    arm = load_robot("ur5e")
    targets = forward_targets(arm, line(UR, UR + 0.1, 3))
    search = SearchOptions(tolerance=-1.0, restarts=-1, seed=-1)
    with pytest.raises(OptionError) as caught:
        solve_path(arm, targets, np.array([0, 5, 5]), start=np.zeros(5), search=search)
    assert [str(one) for one in caught.value.findings] == [
        "t_ns: found 5 ns at sample 2 after 5 ns, allowed: times that rise",
        "start: found [0., 0., 0., 0., 0.], allowed: 6 finite numbers, in rad or m, one each of"
        f" {', '.join(arm.coordinates)}",
        *map(str, search.faults()),
    ]
    with pytest.raises(
        OptionError, match=r"t_ns: found float64 of shape \(2,\), allowed: integer ns of shape \(3,\)"
    ):
        solve_path(arm, targets, np.array([0.0, 1.0]))
    with pytest.raises(OptionError, match="targets: found none, allowed: a path of one sample or more"):
        solve_path(arm, Targets(np.empty((0, 3))), times(0))
