"""The entry for targets: closed form or iterative, starts, limits, invalid targets, options."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from asserting import refusal, there
from ik_arms import joints_within, limited
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import OptionError
from urmpipe_models.ik.limits import joint_limits
from urmpipe_models.ik.solutions import SearchOptions, Solutions, Targets, forward_targets, pose_errors
from urmpipe_models.ik.solve import Method, solve
from urmpipe_models.robots.catalogue import load_robot

MET = 1e-9  # what the iterative solver stops at; the closed forms are at 1e-12


def poses(chain: Chain, count: int, seed: int = 0) -> tuple[FloatArray, Targets]:
    q = joints_within(chain, count, seed)
    return q, forward_targets(chain, q)


def assert_met(chain: Chain, targets: Targets, found: Solutions, within: float = MET) -> None:
    row, column = np.nonzero(found.reached)
    position, angle = pose_errors(chain, found.q[row, column], targets.rows(row))
    assert np.abs(position).max(initial=0.0) < within
    assert np.abs(angle).max(initial=0.0) < within
    lower, upper = joint_limits(chain)
    assert ((found.q[row, column] >= lower) & (found.q[row, column] <= upper)).all()


@pytest.mark.parametrize("name", ["ur5e", "urm6", "arm6"])
def test_joints_that_a_pose_came_from_are_found_from_near_by(name: str) -> None:
    chain = load_robot(name)
    q, targets = poses(chain, 20)
    found = solve(chain, targets, start=q + 1e-3)
    assert found.q.shape == (20, 1, 6)
    assert_met(chain, targets, found)
    # an iterative solution is the pose's to 1e-9; the joints near singular poses follow to less
    np.testing.assert_allclose(found.q[:, 0], q, atol=1e-5)


def test_one_solution_is_the_nearest_of_all_and_keeps_the_name_of_its_branch() -> None:
    chain = load_robot("ur5e")
    _, targets = poses(chain, 50)
    start = np.full(6, 0.4)
    one, every = solve(chain, targets, start=start), solve(chain, targets, start=start, every=True)
    assert one.branches == ("nearest",) and len(every.branches) == 8
    distance = np.where(every.reached, np.square(every.q - start).sum(axis=2), np.inf)
    best = distance.argmin(axis=1)
    np.testing.assert_array_equal(one.q[:, 0], every.q[np.arange(50), best])
    assert one.labels[:, 0].tolist() == [every.branches[k] for k in best]
    assert len(set(one.labels[:, 0])) > 2


def test_a_joint_that_a_singular_pose_leaves_free_is_taken_from_the_start() -> None:
    chain = load_robot("ur5e")
    q = np.array([0.3, -1.0, 1.2, -0.5, 0.0, 0.8])  # an aligned wrist: q6 is free
    targets = forward_targets(chain, q[None])
    np.testing.assert_allclose(solve(chain, targets, start=q).q[0, 0], q, atol=1e-9)
    every = solve(chain, targets, start=q, every=True)
    assert np.abs(every.q[0] - q).max(axis=1)[every.reached[0]].min() < 1e-9
    assert [one.chosen[:24] for one in every.singular] == ["wrist_3_joint as near, a"]
    # all solutions without a start: by the convention, not by the robot's own start
    turned = replace(chain, start=(*chain.start[:5], 0.8))
    (aligned,) = solve(turned, targets, every=True).singular
    assert aligned.chosen.startswith("wrist_3_joint = 0, and pi more for the flipped wrist")
    (aligned,) = solve(turned, targets).singular
    assert aligned.chosen.startswith("wrist_3_joint as near")


def test_solutions_are_in_the_turn_nearest_to_the_start_that_the_limits_allow() -> None:
    chain = load_robot("ur5e")
    q, targets = poses(chain, 20)
    start = q + np.array([2.0 * math.pi, 0.0, 0.0, 0.0, 0.0, 2.0 * math.pi]) * np.where(q < 0.0, 1.0, -1.0)
    found = solve(chain, targets, start=start)
    np.testing.assert_allclose(found.q[:, 0], start, atol=1e-8)
    home = np.array([chain.start])  # the start by default; three singular families meet there
    np.testing.assert_allclose(solve(chain, forward_targets(chain, home)).q[0], home, atol=1e-7)
    beyond = solve(chain, targets, start=start + 4.0 * math.pi)
    assert_met(chain, targets, beyond)
    assert beyond.reached.all() and (beyond.q[:, 0] > -1e-9).all()  # the last turn that +-2 pi allows


@pytest.mark.parametrize(
    ("name", "q", "limit"),
    [
        ("arm6", [0.4, 0.6, 0.5, 1.2, 0.0, 1.8], 2.0),  # q4 = 0 would need q6 = 3
        ("arm6", [0.4, 0.6, 0.5, -1.9, 0.0, -1.0], 2.0),
        ("ur5e", [0.3, -1.0, 1.2, -0.5, 0.0, 1.9], 2.0),
        ("ur5e", [0.3, -1.0, 1.2, 1.9, 0.0, 0.1], 1.95),
    ],
)
def test_where_limits_refuse_the_choice_of_a_free_joint_they_choose(
    name: str, q: list[float], limit: float
) -> None:
    chain = limited(load_robot(name), -limit, limit)
    targets = forward_targets(chain, np.array([q]))
    for start in (None, np.zeros(6), np.array(q)):
        found = solve(chain, targets, start=start, every=True)
        assert found.reached.any()
        assert_met(chain, targets, found)
        assert ((found.reasons != "") == ~found.reached).all()
        aligned = [one for one in found.singular if one.family == "wrist aligned"]
        assert aligned and (aligned[0].where & found.reached).any()
        if start is None:
            assert aligned[0].chosen.endswith(", or what the limits of the joints allow")
        distinct = np.round(found.q[0][found.reached[0]], 4)
        assert len(np.unique(distinct, axis=0)) == len(distinct)
    here = solve(chain, targets, start=np.array(q))
    np.testing.assert_allclose(here.q[0, 0], q, atol=1e-9)


def test_limits_leave_out_branches_and_say_which_joint() -> None:
    chain = limited(load_robot("ur5e"), -1.5, 1.5)
    _, targets = poses(chain, 200)
    found = solve(chain, targets, every=True)
    assert_met(chain, targets, found)
    assert found.reached.any(axis=1).all() and not found.reached.all()
    texts = {text.split(" at ")[0] for text in found.reasons.ravel() if text.startswith("joint")}
    assert texts == {f"joint {name}" for name in chain.coordinates}


def bad_targets(chain: Chain) -> Targets:
    """Seven targets of which the first and the last are good."""
    _, targets = poses(chain, 7)
    position, rotation = targets.position.copy(), there(targets.rotation).copy()
    position[1, 2] = np.nan
    position[2, 0] = np.inf
    rotation[3] *= 1.01
    rotation[4, :, 0] *= -1.0
    rotation[5, 0, 0] = np.nan
    return Targets(position, rotation)


@pytest.mark.parametrize("name", ["ur5e", "urm6"])
@pytest.mark.parametrize("every", [False, True])
def test_a_bad_target_has_a_reason_and_stops_no_other(name: str, every: bool) -> None:
    chain = load_robot(name)
    targets = bad_targets(chain)
    found = solve(chain, targets, every=every, search=SearchOptions(restarts=40 if name == "urm6" else 0))
    good = targets.rows(np.array([0, 6]))
    alone = solve(chain, good, every=every, search=SearchOptions(restarts=40 if name == "urm6" else 0))
    np.testing.assert_allclose(found.q[[0, 6]], alone.q, atol=1e-9)
    assert alone.reached.any(axis=1).all()
    x, y = (f"{value:g}" for value in targets.position[1, :2])
    below, z = (f"{value:g}" for value in targets.position[2, 1:])
    assert [found.reason(row) for row in range(7)] == [
        None,
        f"the position is {x}, {y}, nan m, allowed: finite numbers",
        f"the position is inf, {below}, {z} m, allowed: finite numbers",
        "the orientation is not a rotation: R^T R differs from 1 by 0.0201, allowed: 1e-06",
        "the orientation is not a rotation: its determinant is -1, a mirror, allowed: 1",
        "the orientation is not finite, allowed: finite numbers",
        None,
    ]
    assert len(found) == 7 and found.shortfall.shape == found.labels.shape == found.reasons.shape


@pytest.mark.parametrize("far", [1.1e9, 1e160, -1e308])
@pytest.mark.parametrize("name", ["ur5e", "arm6", "urm6"])
def test_a_position_beyond_all_digits_stops_no_other(name: str, far: float) -> None:
    chain = load_robot(name)
    q, targets = poses(chain, 1)
    position = np.vstack((targets.position, [0.1, far, 0.3]))
    both = Targets(position, np.repeat(there(targets.rotation), 2, axis=0))
    found = solve(chain, both, start=q[0])
    assert found.reached[:, 0].tolist() == [True, False]
    assert found.reason(1) == (f"the position is 0.1, {far:g}, 0.3 m, allowed: up to 1e+09 m along each axis")


def test_a_bad_target_before_a_singular_one_leaves_the_family_where_it_is() -> None:
    chain = load_robot("ur5e")
    targets = forward_targets(
        chain, np.array([[0.3, -1.0, 1.2, -0.5, 1.0, 0.8], [0.3, -1.0, 1.2, -0.5, 0.0, 0.8]])
    )
    position = np.vstack((np.full((1, 3), math.nan), targets.position))
    found = solve(chain, Targets(position, np.vstack((np.eye(3)[None], there(targets.rotation)))), every=True)
    assert [found.families(row) for row in range(3)] == [[], [], ["wrist aligned"]]


def test_only_bad_targets_are_no_error() -> None:
    for name in ("ur5e", "urm6"):
        found = solve(load_robot(name), Targets(np.full((2, 3), np.nan), np.stack([np.eye(3)] * 2)))
        assert len(found) == 2 and not found.reached.any()
        assert found.reason(1) == "the position is nan, nan, nan m, allowed: finite numbers"


def test_no_targets_give_no_solutions() -> None:
    empty = Targets(np.empty((0, 3)), np.empty((0, 3, 3)))
    for name in ("ur5e", "arm6", "urm6"):
        assert len(solve(load_robot(name), empty)) == 0


def test_a_rotation_written_with_seven_digits_is_the_nearest_rotation() -> None:
    chain = load_robot("ur5e")
    q, targets = poses(chain, 20)
    written = Targets(targets.position, np.round(there(targets.rotation), 7))
    found = solve(chain, written, start=q)
    assert found.reached.all()
    position, angle = pose_errors(chain, found.q[:, 0], targets)
    assert np.abs(position).max() < 1e-12  # position is kept exactly, and the orientation to its digits
    assert 1e-9 < np.abs(angle).max() < 2e-7


def test_a_target_out_of_reach_takes_the_nearest_point_within_the_tolerance() -> None:
    chain = load_robot("ur5e")
    q = np.array([0.3, -math.pi / 2, 0.0, -math.pi / 2, 1.2, 0.2])  # stretched straight up
    targets = forward_targets(chain, q[None])
    above = targets.position + np.array([[0.0, 0.0, 0.002], [0.0, 0.0, 0.2]])
    out = Targets(above, np.repeat(there(targets.rotation), 2, axis=0))
    refused = solve(chain, out, start=q)
    assert not refused.reached.any()
    found = solve(chain, out, start=q, search=SearchOptions(tolerance=0.0035))
    assert found.reached[:, 0].tolist() == [True, False]
    assert found.labels[0, 0] == "nearest point"
    position, _ = pose_errors(chain, found.q[:1, 0], out.rows(slice(0, 1)))
    assert np.abs(position).max() <= 0.0035
    np.testing.assert_allclose(found.shortfall[0, 0], np.linalg.norm(position), rtol=1e-6)
    assert found.shortfall[0, 0] > 1e-4 and found.shortfall[1, 0] == 0.0
    assert found.reason(1) is not None and "from axis" in str(found.reason(1))
    every = solve(chain, out, start=q, every=True, search=SearchOptions(tolerance=0.0035))
    assert every.reached.sum(axis=1).tolist() == [1, 0]
    assert every.labels[0, 0] == "nearest point"


def test_a_tolerance_changes_nothing_where_the_target_is_met() -> None:
    chain = load_robot("ur5e")
    _, targets = poses(chain, 20)
    np.testing.assert_array_equal(
        solve(chain, targets).q, solve(chain, targets, search=SearchOptions(tolerance=0.01)).q
    )


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
    found = solve(chain, targets, search=SearchOptions(restarts=40))
    assert found.reached.all() and found.q.shape == (5, 1, len(chain.coordinates))
    assert_met(chain, targets, found)


def test_a_start_outside_the_limits_is_a_place_to_be_near_to() -> None:
    chain = limited(load_robot("ur5e"), -2.0, 2.0)
    _, targets = poses(chain, 5)
    found = solve(chain, targets, start=np.full(6, 50.0))
    assert_met(chain, targets, found)
    assert found.reached.all()


def test_everything_wrong_with_the_options_is_told_at_once() -> None:
    chain = load_robot("urm6")
    _, targets = poses(chain, 2)
    odd: Method = "exact"  # type: ignore[assignment]
    search = SearchOptions(tolerance=-1.0, restarts=-2, seed=-1)
    with pytest.raises(OptionError) as caught:
        solve(chain, targets, start=np.zeros(5), method=odd, search=search)
    assert [str(one) for one in caught.value.findings] == [
        f"start: found values of shape (5,), allowed: (6,), one each of {', '.join(chain.coordinates)},"
        " or (2, 6), as many for each target",
        *map(str, search.faults()),
        "method: found 'exact', allowed: auto, closed, iterative",
    ]
    with pytest.raises(OptionError) as caught:
        solve(chain, targets, start=np.array([0, 0, 0, 0, 0, math.nan]), method="closed")
    assert [str(one) for one in caught.value.findings] == [
        "start: found a value that is not finite, allowed: finite numbers in rad and m",
        "method: robot urm6 has no closed form, allowed: closed for six joints whose last three axes meet in"
        ' a point or whose axes 2, 3 and 4 are parallel, exactly or nearly; method="iterative" searches',
    ]


def test_a_closed_form_needs_poses() -> None:
    assert refusal(OptionError, solve, load_robot("ur5e"), Targets(np.zeros((1, 3))), method="closed") == (
        "method: positions with any orientation have no closed form, allowed: closed for poses;"
        ' method="iterative" searches'
    )


@pytest.mark.parametrize(
    ("targets", "text"),
    [
        (Targets(np.zeros(3)), "targets: found positions of shape (3,), allowed: (n, 3)"),
        (Targets(np.zeros((2, 2))), "targets: found positions of shape (2, 2), allowed: (n, 3)"),
        (
            Targets(np.zeros((2, 3)), np.zeros((3, 3, 3))),
            "targets: found rotations of shape (3, 3, 3) for 2 positions, allowed: (2, 3, 3)",
        ),
    ],
)
def test_targets_of_another_shape_are_refused(targets: Targets, text: str) -> None:
    assert refusal(OptionError, solve, load_robot("ur5e"), targets) == text
