"""The entry for targets: closed form or iterative, starts, limits, invalid targets."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from asserting import there
from closed_forms import assert_solved, distances
from ik_arms import joints_within, limited
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.limits import joint_limits
from urmpipe_models.ik.solutions import SearchOptions, Solutions, Targets, forward_targets, pose_errors
from urmpipe_models.ik.solve import solve
from urmpipe_models.robots.catalogue import load_robot

UR5E = load_robot("ur5e")


def poses(chain: Chain, count: int, seed: int = 0) -> tuple[FloatArray, Targets]:
    q = joints_within(chain, count, seed)
    return q, forward_targets(chain, q)


def solved(chain: Chain, targets: Targets, **options: Any) -> Solutions:
    """Solve targets, and assert that every solution is within limits and meets its target or has a reason."""
    found = solve(chain, targets, **options)
    assert_solved(chain, targets, found, 1e-9)  # the iterative solver stops there; closed forms: 1e-12
    lower, upper = joint_limits(chain)
    q = found.q[found.reached]
    assert ((q >= lower) & (q <= upper)).all()
    return found


@pytest.mark.parametrize("name", ["ur5e", "urm6", "arm6"])
def test_joints_that_a_pose_came_from_are_found_from_near_by(name: str) -> None:
    chain = load_robot(name)
    q, targets = poses(chain, 20)
    found = solved(chain, targets, start=q + 1e-3)
    assert found.q.shape == (20, 1, 6)
    # an iterative solution is the pose's to 1e-9; the joints near singular poses follow to less
    np.testing.assert_allclose(found.q[:, 0], q, atol=1e-5)


def test_one_solution_is_the_nearest_of_all_and_keeps_the_name_of_its_branch() -> None:
    _, targets = poses(UR5E, 50)
    start = np.full(6, 0.4)
    nearest, every = solve(UR5E, targets, start=start), solve(UR5E, targets, start=start, every=True)
    assert nearest.branches == ("nearest",) and len(every.branches) == 8
    distance = np.where(every.reached, np.square(every.q - start).sum(axis=2), np.inf)
    best = distance.argmin(axis=1)
    np.testing.assert_array_equal(nearest.q[:, 0], every.q[np.arange(50), best])
    assert nearest.labels[:, 0].tolist() == [every.branches[k] for k in best]
    assert len(set(nearest.labels[:, 0])) > 2
    # a tolerance changes nothing where the target is met
    within = solve(UR5E, targets, start=start, search=SearchOptions(tolerance=0.01))
    np.testing.assert_array_equal(nearest.q, within.q)


def test_a_joint_that_a_singular_pose_leaves_free_is_taken_from_the_start() -> None:
    q = np.array([0.3, -1.0, 1.2, -0.5, 0.0, 0.8])  # an aligned wrist: q6 is free
    targets = forward_targets(UR5E, q[None])
    np.testing.assert_allclose(solve(UR5E, targets, start=q).q[0, 0], q, atol=1e-9)
    every = solve(UR5E, targets, start=q, every=True)
    assert distances(UR5E, every, q[None]).min() < 1e-9
    # all solutions without a start: by the convention, not by the robot's own start
    turned = replace(UR5E, start=(*UR5E.start[:5], 0.8))
    found = every, solve(turned, targets, every=True), solve(turned, targets)
    (by_start,), (by_convention,), (by_own_start,) = (each.singular for each in found)
    assert by_start.chosen == by_own_start.chosen
    assert by_start.chosen.startswith("wrist_3_joint as near, a")
    assert by_convention.chosen.startswith("wrist_3_joint = 0, and pi more for the flipped wrist")


def test_solutions_are_in_the_turn_nearest_to_the_start_that_the_limits_allow() -> None:
    q, targets = poses(UR5E, 20)
    start = q + 2.0 * math.pi * np.array([1, 0, 0, 0, 0, 1]) * np.where(q < 0.0, 1.0, -1.0)
    np.testing.assert_allclose(solve(UR5E, targets, start=start).q[:, 0], start, atol=1e-8)
    home = np.array([UR5E.start])  # the start by default; three singular families meet there
    np.testing.assert_allclose(solve(UR5E, forward_targets(UR5E, home)).q[0], home, atol=1e-7)
    beyond = solved(UR5E, targets, start=start + 4.0 * math.pi)
    assert beyond.reached.all() and (beyond.q[:, 0] > -1e-9).all()  # the last turn that +-2 pi allows
    narrow = limited(UR5E, -2.0, 2.0)
    assert solved(narrow, poses(narrow, 5)[1], start=np.full(6, 50.0)).reached.all()  # a start outside


@pytest.mark.parametrize(
    ("name", "q", "limit"),
    [
        ("arm6", [0.4, 0.6, 0.5, 1.2, 0.0, 1.8], 2.0),  # q4 = 0 would need q6 = 3
        ("arm6", [0.4, 0.6, 0.5, -1.9, 0.0, -1.0], 2.0),
        ("ur5e", [0.3, -1.0, 1.2, -0.5, 0.0, 1.9], 2.0),
        ("ur5e", [0.3, -1.0, 1.2, 1.9, 0.0, 0.1], 1.95),
    ],
)
def test_where_limits_refuse_a_free_joint_they_choose_it(name: str, q: list[float], limit: float) -> None:
    chain = limited(load_robot(name), -limit, limit)
    targets = forward_targets(chain, np.array([q]))
    for start in (None, np.zeros(6), np.array(q)):
        found = solved(chain, targets, start=start, every=True)
        (aligned,) = [pose for pose in found.singular if pose.family == "wrist aligned"]
        assert (aligned.where & found.reached).any()
        assert start is not None or aligned.chosen.endswith(", or what the limits of the joints allow")
        distinct = np.round(found.q[0][found.reached[0]], 4)
        assert len(np.unique(distinct, axis=0)) == len(distinct)
    np.testing.assert_allclose(solve(chain, targets, start=np.array(q)).q[0, 0], q, atol=1e-9)


def test_limits_leave_out_branches_and_say_which_joint() -> None:
    chain = limited(UR5E, -1.5, 1.5)
    found = solved(chain, poses(chain, 200)[1], every=True)
    assert found.reached.any(axis=1).all() and not found.reached.all()
    texts = {text.split(" at ")[0] for text in found.reasons.ravel() if text.startswith("joint")}
    assert texts == {f"joint {name}" for name in chain.coordinates}


@pytest.mark.parametrize(("name", "every"), [("ur5e", True), ("urm6", False), ("urm6", True)])
def test_a_bad_target_stops_no_other(name: str, every: bool) -> None:
    chain = load_robot(name)
    _, targets = poses(chain, 4)
    good = targets.rows(np.array([0, 3]))
    targets.position[1], there(targets.rotation)[2] = np.nan, np.nan
    search = SearchOptions(restarts=40 if name == "urm6" else 0)
    found, alone = (solve(chain, these, every=every, search=search) for these in (targets, good))
    np.testing.assert_allclose(found.q[[0, 3]], alone.q, atol=1e-9)
    assert found.reached.any(axis=1).tolist() == [True, False, False, True]
    assert len(found) == 4 and found.position_residual.shape == found.labels.shape == found.reasons.shape


@pytest.mark.parametrize("name", ["ur5e", "arm6", "urm6"])
def test_a_position_beyond_all_digits_stops_no_other_and_there_may_be_no_target(name: str) -> None:
    chain = load_robot(name)
    q, targets = poses(chain, 1)
    position = np.vstack((targets.position, *([0.1, far, 0.3] for far in (1.1e9, 1e160, -1e308))))
    found = solve(chain, Targets(position, np.repeat(there(targets.rotation), 4, axis=0)), start=q[0])
    assert found.reached[:, 0].tolist() == [True, False, False, False]
    nothing = Targets(np.full((2, 3), np.nan), np.stack([np.eye(3)] * 2))
    assert solve(chain, nothing).reached.tolist() == [[False], [False]]
    assert len(solve(chain, Targets(np.empty((0, 3)), np.empty((0, 3, 3))))) == 0


def test_a_bad_target_before_a_singular_one_leaves_the_family_where_it_is() -> None:
    targets = forward_targets(UR5E, np.array([[0.3, -1.0, 1.2, -0.5, q5, 0.8] for q5 in (0.5, 1.0, 0.0)]))
    targets.position[0] = math.nan
    found = solve(UR5E, targets, every=True)
    assert [found.families(row) for row in range(3)] == [[], [], ["wrist aligned"]]


def test_a_rotation_written_with_seven_digits_is_the_nearest_rotation() -> None:
    q, targets = poses(UR5E, 20)
    written = Targets(targets.position, np.round(there(targets.rotation), 7))
    found = solve(UR5E, written, start=q)
    assert found.reached.all()
    position, angle = pose_errors(UR5E, found.q[:, 0], targets)
    assert np.abs(position).max() < 1e-12  # position is kept exactly, and the orientation to its digits
    assert 1e-9 < np.abs(angle).max() < 2e-7


def test_a_target_out_of_reach_takes_the_nearest_point_within_the_tolerance() -> None:
    q = np.array([0.3, -math.pi / 2, 0.0, -math.pi / 2, 1.2, 0.2])  # stretched straight up
    targets = forward_targets(UR5E, np.array([q, q]))
    targets.position[:, 2] += [0.002, 0.2]
    assert not solve(UR5E, targets, start=q).reached.any()
    found = solve(UR5E, targets, start=q, search=SearchOptions(tolerance=0.0035))
    assert found.reached[:, 0].tolist() == [True, False]
    assert found.labels[0, 0] == "nearest point"
    position, _ = pose_errors(UR5E, found.q[:1, 0], targets.rows(slice(0, 1)))
    assert np.abs(position).max() <= 0.0035
    np.testing.assert_allclose(found.position_residual[0, 0], np.linalg.norm(position), rtol=1e-6)
    assert found.position_residual[0, 0] > 1e-4 and found.position_residual[1, 0] == 0.0
    assert "from axis" in there(found.reason(1))
    every = solve(UR5E, targets, start=q, every=True, search=SearchOptions(tolerance=0.0035))
    assert every.reached.sum(axis=1).tolist() == [1, 0]
    assert every.labels[0, 0] == "nearest point"


@pytest.mark.parametrize("name", ["ur5e", "arm6"])
def test_the_iterative_way_finds_what_the_closed_form_finds(name: str) -> None:
    chain = load_robot(name)
    q, targets = poses(chain, 10, 4)
    start = q + 0.01
    closed = solve(chain, targets, start=start, method="closed")
    iterative = solve(chain, targets, start=start, method="iterative")
    np.testing.assert_allclose(iterative.q, closed.q, atol=1e-5)
    assert iterative.branches == ("1",)


@pytest.mark.parametrize(("name", "pose"), [("ur5e", False), ("panda", True)])
def test_positions_and_redundant_arms_are_solved_iteratively(name: str, pose: bool) -> None:
    chain = load_robot(name)
    _, targets = poses(chain, 5)
    targets = targets if pose else Targets(targets.position)
    found = solved(chain, targets, search=SearchOptions(restarts=40))
    assert found.reached.all() and found.q.shape == (5, 1, len(chain.coordinates))
