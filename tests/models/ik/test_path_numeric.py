"""Paths without a closed form: least motion from sample to sample, limits, reach."""

from __future__ import annotations

import math

import numpy as np
import pytest

from closed_forms import assert_met as assert_poses_met
from ik_arms import follow, line, planar, times
from urmpipe_datasets import LOGS
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik import path_numeric
from urmpipe_models.ik.path import JointPath, solve_path
from urmpipe_models.ik.path_numeric import DAMPING, SlidingWindow, newton_sweep, solve_recurrence
from urmpipe_models.ik.solutions import SearchOptions, Targets, forward_targets, pose_errors
from urmpipe_models.ik.task import build_task
from urmpipe_models.kinematics.forward import jacobian_over_log
from urmpipe_models.math3d import translation
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.wraps import repolarize

NANOMETRE = 1e-9  # what the solver promises: targets are met within it
ARM = planar(1.0, 1.0, 1.0)
DEMO = Targets(np.loadtxt(LOGS / "path.csv", delimiter=",", skiprows=1)[:, 1:])  # 7383 samples at 5 ms


@pytest.fixture(scope="module")
def followed() -> JointPath:
    return solve_path(load_robot("urm6"), DEMO, times(len(DEMO)))


def assert_met(path: JointPath, targets: Targets) -> None:
    assert path.reached.all(), list(path.reasons[path.reasons != ""])
    # rad: the solver counts rotations as arcs of a quarter of the arm, 0.2 m and more of these arms
    assert_poses_met(path.chain, targets, path.q, NANOMETRE, 5.0 * NANOMETRE)


def in_plane(x: FloatArray, y: FloatArray | float = 0.0) -> Targets:
    """Return positions in the plane of planar arms, in [m]."""
    return Targets(np.stack(np.broadcast_arrays(x, y, 0.0), axis=-1))


def assert_least_motion(path: JointPath, least_singular: float) -> None:
    """Every step lies in the row space of J at its end: nothing of it could be left out."""
    J = jacobian_over_log(path.chain, path.q)[1:, : 3 if path.position_only else 6]
    _, sigma, rows = np.linalg.svd(J, full_matrices=False)
    step = np.diff(path.q, axis=0)[:, :, None]
    left = (step - rows.transpose(0, 2, 1) @ (rows @ step))[..., 0]
    regular = sigma[:, -1] > least_singular
    assert regular.mean() > 0.9
    # rad: a sample has converged once a sweep moves it by less than 1e-10; its neighbours' errors add up
    assert np.abs(left[regular]).max() < 1e-9


def test_urm6_follows_the_demo_path_to_a_nanometre_without_a_jump(followed: JointPath) -> None:
    assert_met(followed, DEMO)
    assert not (followed.jumps or followed.speed_violations or followed.singular)
    assert set(followed.branch) == {"1"}
    assert followed.method == "least motion"
    assert not followed.position_residual.any()
    # rad a sample: 0.59 m/s are 3 mm, over singular values down to 0.07 m/rad and briefly less
    assert np.abs(np.diff(followed.q, axis=0)).max() < 0.015
    assert_least_motion(followed, 0.01)
    # it starts at p7 of the calibration, to the nanometre that the file is written to, in a singular pose;
    # rad: the joints do not follow the rounding of the file there: 0.086 by least motion alone
    np.testing.assert_allclose(followed.q[0], load_robot("urm6").start, rtol=0.0, atol=1e-15)
    assert np.linalg.norm(np.diff(followed.q[:200], axis=0), axis=1).sum() < 0.06
    smallest = followed.singularity.smallest
    J = jacobian_over_log(followed.chain, followed.q)[:, :3] / followed.singularity.length
    # the same matrix, decomposed twice
    np.testing.assert_allclose(smallest, np.linalg.svd(J, compute_uv=False)[:, -1], rtol=0.0, atol=1e-12)
    assert smallest[0] < 1e-12 and smallest[1000:].min() > 1e-3


@pytest.mark.slow
def test_windows_give_what_one_sample_after_the_other_gives(followed: JointPath) -> None:
    """Newton's method on min |q - q_{k-1}|^2 subject to FK(q) = x_k, written plainly, sample by sample."""
    chain, rows = followed.chain, slice(1000, 1060)
    expected = [followed.q[rows.start]]
    for target in DEMO.position[rows.start + 1 : rows.stop]:
        q = last = expected[-1]
        for _ in range(6):
            error, _ = pose_errors(chain, q[None], Targets(target[None]))
            J = jacobian_over_log(chain, q[None])[0, :3]
            q = last + np.linalg.pinv(J) @ (error[0] + J @ (q - last))
        expected.append(q)
    # rad: 60 samples, each converged to 1e-10 and damped by 1e-8 m^2 / sigma^2 of a step of 1e-3
    np.testing.assert_allclose(followed.q[rows], expected, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("longest", [96, 1000])
def test_windows_of_other_sizes(followed: JointPath, longest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(path_numeric, "WINDOW_SIZE", longest)
    count = 1500
    path = solve_path(followed.chain, DEMO.rows(slice(count)), times(count))
    # rad: at the singular start the nanometre leaves that open; what comes after goes on from there
    np.testing.assert_allclose(path.q, followed.q[:count], rtol=0.0, atol=2e-6)
    steps, expected = np.diff(path.q[1000:], axis=0), np.diff(followed.q[1000:count], axis=0)
    # rad: where the nanometre is just kept or not, lambda^2 is 1e-8 or 1e-9 m2 of steps of 4e-3 over sigma^2
    np.testing.assert_allclose(steps, expected, rtol=0.0, atol=2e-8)


def test_joints_within_pi_are_unwrapped_by_the_repolarizer(followed: JointPath) -> None:
    wrapped = solve_path(followed.chain, DEMO, followed.t_ns, within_pi=True)
    assert np.abs(followed.q).max() > math.pi
    assert wrapped.q.min() > -math.pi and wrapped.q.max() <= math.pi
    again = repolarize(wrapped.q, np.append(0.0, np.diff(followed.t_ns) * 1e-9))
    assert len(again.rows) > 0
    # rad: whole turns taken off and added again
    np.testing.assert_allclose(again.q + followed.q[0] - again.q[0], followed.q, rtol=0.0, atol=1e-13)
    assert wrapped.jumps == ()


def test_a_redundant_arm_follows_poses_within_its_limits() -> None:
    panda = load_robot("panda")
    t = np.linspace(0.0, 6.0, 500)[:, None]
    q = np.array(panda.start) + 0.4 * np.sin(t * np.linspace(0.3, 1.0, 7))
    path = follow(panda, q)
    assert_met(path, forward_targets(panda, q))
    assert path.jumps == ()
    assert_least_motion(path, 0.01)
    # a redundant arm finds a shorter way than the one that the poses were made from
    assert np.square(np.diff(path.q, axis=0)).sum() < np.square(np.diff(q, axis=0)).sum()


def test_a_joint_stays_on_its_limit_and_leaves_it_again() -> None:
    limited, start = planar(1.0, 1.0, 1.0, upper=0.5), np.array([[0.2, -0.6, 0.3]])
    t = np.linspace(0.0, 2.0 * math.pi, 400)
    x, y, _ = forward_targets(ARM, start).position[0]
    circle = in_plane(x + 0.6 * (np.cos(t) - 1.0), y + 0.6 * np.sin(t))
    without, path = follow(ARM, start, circle), follow(limited, start, circle)
    assert without.q[:, 0].max() > 0.6
    assert_met(path, circle)
    assert path.q[:, 0].max() == 0.5
    assert path.jumps == ()
    on = path.q[:, 0] == 0.5
    assert on.sum() > 20 and not on[0] and not on[-1]
    step = np.diff(path.q, axis=0)
    J = jacobian_over_log(limited, path.q)[1:, :2]
    for k in np.flatnonzero(~on[1:]):
        assert np.abs(np.linalg.svd(J[k])[2][2] @ step[k]) < 1e-8  # rad: least motion of all three
    for k in np.flatnonzero(on[1:] & on[:-1]):
        y = np.linalg.solve(J[k, :, 1:].T, step[k, 1:])  # the two free joints move by J^T y ...
        assert J[k, :, 0] @ y > -1e-8  # ... and the third one would go on outwards


def test_what_is_out_of_reach_or_not_finite_has_a_reason_and_the_path_goes_on_after_it() -> None:
    start, reach = np.array([[0.6, -1.0, 0.1]]), 2.5 + 1.2 * np.sin(math.pi * np.linspace(0.0, 1.0, 401))
    whole = follow(ARM, start, in_plane(reach))
    reach[10] = math.nan
    path = follow(ARM, start, in_plane(reach))
    out = ~(reach <= 3.0)
    assert (path.reached == ~out).all()
    assert (path.reasons != "").tolist() == (path.branch == "").tolist() == out.tolist()
    assert path.reasons[10] == "the position is nan, 0, 0 m, allowed: finite numbers"
    assert_poses_met(ARM, in_plane(reach), path.q, NANOMETRE)
    assert path.jumps == ()
    # rad: least motion of two steps and of one, 0.01 m each, differ in second order
    np.testing.assert_allclose(path.q[~out], whole.q[~out], rtol=0.0, atol=1e-4)


def test_another_bend_after_a_gap_is_a_jump() -> None:
    q = line([0.2, 0.0], 41, np.array([0.9, -1.0]))
    targets = Targets(forward_targets(planar(1.0, 1.0), q).position)
    targets.position[18:22] *= 2.0
    path = follow(planar(1.0, 1.0, upper=1.0), q, targets)
    assert (np.flatnonzero(~path.reached) == np.arange(18, 22)).all()
    (jump,) = path.jumps
    assert (jump.last, jump.sample, jump.from_branch, jump.to_branch) == (17, 22, "1", "2")
    # rad: the mirror image about the line to the target
    np.testing.assert_allclose(path.q[22], [q[22, 0] - 1.0, 1.0], rtol=0.0, atol=1e-8)


def test_within_the_tolerance_the_nearest_point_is_taken() -> None:
    reach = 2.9 + 0.102 * np.sin(np.linspace(0.0, math.pi, 101))
    search = SearchOptions(tolerance=0.003)
    path = follow(ARM, np.array([[0.3, -0.5, 0.1]]), in_plane(reach), search=search)
    assert path.reached.all()
    # m: along x the arm reaches 3 m; the nearest point is found to 1e-6 rad about it, so much better
    np.testing.assert_allclose(path.position_residual, np.maximum(reach - 3.0, 0.0), rtol=0.0, atol=1e-9)


def test_one_sample_and_equal_samples_are_paths_too() -> None:
    arm, start = load_robot("urm6"), np.array([[0.3, 2.0, 0.4, 2.5, 0.2, 1.0]])
    single = forward_targets(arm, start + 0.05)
    assert_met(follow(arm, start, single), single)
    twice = Targets(np.repeat(single.position, 2, axis=0))
    path = follow(arm, start, twice)
    assert_met(path, twice)
    # rad: there is nothing to move for
    np.testing.assert_allclose(path.q[0], path.q[1], rtol=0.0, atol=1e-9)
    # from a nearly singular start no large correction is trusted
    start, target = np.array([[0.1, 0.02, 0.0]]), in_plane(np.zeros(1), 1.2)
    path = follow(ARM, start, target)
    assert_met(path, target)
    # rad: 2.07 by steps of 0.1; the whole first correction ends 8.03 away, after a turn in vain
    assert np.linalg.norm(path.q - start) < 2.5


@pytest.mark.parametrize("robot", ["ur5e", "arm6", "urm6"])
@pytest.mark.parametrize(("place", "reason"), [(math.nan, "finite numbers"), (9.0, " m")])
def test_each_sample_of_a_path_without_solutions_has_a_reason(robot: str, place: float, reason: str) -> None:
    arm = load_robot(robot)
    targets = forward_targets(arm, np.full((3, 6), 0.3))
    targets.position[:] = place
    path = solve_path(arm, targets, times(3), within_pi=True, search=SearchOptions(restarts=2))
    assert not path.reached.any()
    assert all(reason in text for text in path.reasons)
    assert list(path.branch) == ["", "", ""]
    assert not (path.jumps or path.speed_violations or path.singular)


def test_prismatic_joints_follow_too() -> None:
    slides = [Joint("x", "prismatic", axis=(1.0, 0.0, 0.0)), Joint("y", "prismatic", axis=(0.0, 1.0, 0.0))]
    gantry = Chain("gantry", (*slides, Joint("z", "prismatic", upper=0.5), Joint("c")))
    t = np.linspace(0.0, 3.0, 100)
    q = np.column_stack((np.sin(t), np.cos(t), 0.4 * np.sin(t), 0.7 * t))
    # m and rad: linear in the lengths, so as near as targets are met
    np.testing.assert_allclose(follow(gantry, q).q, q, rtol=0.0, atol=5.0 * NANOMETRE)
    positions = follow(gantry, q, Targets(forward_targets(gantry, q).position))
    np.testing.assert_allclose(positions.q[:, :3], q[:, :3], rtol=0.0, atol=NANOMETRE)
    assert (positions.q[:, 3] == q[0, 3]).all()  # nothing asks the last joint to turn


START = np.array([[0.8, -0.9, -0.9]])


def test_far_apart_samples_are_followed_one_by_one_from_the_sample_before_turns_and_all() -> None:
    for angles in (np.linspace(0.0, 3.0, 7), np.append(np.linspace(0.0, 9.0, 400), [10.5, 12.0])):
        circle = in_plane(2.0 * np.cos(angles), 2.0 * np.sin(angles))
        path = follow(ARM, START, circle)
        assert_met(path, circle)
        if len(angles) == 7:
            assert path.jumps == ()
        else:
            assert path.q[-1, 0] - path.q[0, 0] > 9.0
            # rad: the base turns by about 1.5 a step
            assert np.abs(np.diff(path.q[-3:], axis=0)).max() < 2.0


def test_after_a_rescue_no_joint_stays_on_the_limit_of_before() -> None:
    q = line([0.3, 0.09, 0.0], 40, np.array([0.45, -0.6, 0.3]))
    elsewhere = np.array([-1.8, 0.4, 0.3])  # out of reach with joint 1 at 0.5 rad
    targets = forward_targets(ARM, np.vstack((q, line([0.02] * 3, 20, elsewhere))))
    asked = []

    def rescue(sample: int, last: FloatArray) -> FloatArray:
        """Return the pose that the far samples were made from."""
        asked.append(sample)
        assert last[0] == 0.5
        return elsewhere[None]

    limited = planar(1.0, 1.0, 1.0, upper=0.5)
    found = SlidingWindow(limited, Targets(targets.position), q[0], rescue).slide(lambda share: None)
    assert asked == [40]
    assert (found[30:40, 0] == 0.5).all()
    # rad: the joints go on from where the rescue brought them, 0.02 in 20 samples
    assert np.abs(found[40:] - elsewhere).max() < 0.05


@pytest.mark.parametrize(("robot", "reports"), [("urm6", 4), ("ur5e", 1)])  # window after window, or at once
def test_the_completed_share_rises_to_the_whole(robot: str, reports: int) -> None:
    arm = load_robot(robot)
    q = line([0.5] * 6, 900, np.array(arm.start) + 0.3)
    targets = forward_targets(arm, q)
    targets.position[300:400] += 9.0
    shares: list[float] = []
    follow(arm, q, targets, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[0] >= 0.0 and shares[-1] == 1.0
    assert len(set(shares)) >= reports


def test_the_same_seed_gives_the_same_motion_bit_for_bit() -> None:
    targets = in_plane(*np.random.default_rng(5).uniform(-2.5, 2.5, (8, 2)).T)
    search = SearchOptions(seed=3, restarts=5)
    first, again = (solve_path(ARM, targets, times(8), search=search).q for _ in range(2))
    assert np.array_equal(first, again, equal_nan=True)


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
    fixed = np.full(6, np.nan)
    fixed[2] = guess[0, 2]
    guess[:, 2] = fixed[2]
    swept = newton_sweep(build_task(arm, targets), guess, q[0], fixed, np.full(30, DAMPING))
    free = np.isnan(fixed)
    J = jacobian_over_log(arm, guess)[:, :3] * free
    error = targets.position - forward_targets(arm, guess).position
    last = np.where(free, q[0], fixed)
    for k in range(30):
        A = np.eye(6) + J[k].T @ J[k] / DAMPING
        b = last - guess[k] + J[k].T @ error[k] / DAMPING
        last = guess[k] + np.linalg.solve(A, b)
        # rad: the normal equations lose the digits of 1 / DAMPING
        np.testing.assert_allclose(swept.q[k], last, rtol=0.0, atol=1e-7)
        last = swept.q[k]
    np.testing.assert_allclose(swept.error, np.linalg.norm(error, axis=1), rtol=1e-9)


@pytest.mark.parametrize("robot", ["urm6", "panda", "iiwa14", "ur5e", "arm6"])
def test_no_posture_is_too_far(robot: str) -> None:
    arm = load_robot(robot).placed(base=translation(5.0, -3.0, 1.0), tool=translation(0.1, 0.0, 0.2))
    q = np.random.default_rng(0).uniform(-math.pi, math.pi, (5000, len(arm.coordinates)))
    assert not any(path_numeric.find_out_of_reach(arm, forward_targets(arm, q), None))
