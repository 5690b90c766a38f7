"""Arms with three parallel axes: every pose is met, branches have the names of their places, EAIK agrees."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from eaik.IK_HP import HPRobot
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from asserting import there
from ik_arms import by_shorter_way
from parallel_arms import EXACT, UR, WRISTS, apart, assert_every_solution_meets, form_of, poses, random_arm
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import OptionError
from urmpipe_models.ik.parallel_axes import parallel_axes
from urmpipe_models.ik.solutions import Targets, forward_targets
from urmpipe_models.kinematics.forward import chain_to_screws
from urmpipe_models.kinematics.singularity import singularity_over_log
from urmpipe_models.math3d import rotation_about
from urmpipe_models.robots.catalogue import load_robot


@pytest.mark.slow
@pytest.mark.parametrize("name", UR)
def test_fk_of_ik_is_the_pose_of_ten_thousand_and_the_joints_it_came_from_are_found(name: str) -> None:
    chain = load_robot(name)
    q, targets = poses(chain, 10_000)
    solutions = form_of(chain).solve(targets)
    assert_every_solution_meets(chain, targets, solutions, EXACT)
    # of 10,000 poses the one nearest to a singular pose parts from its joints by the root of the rounding
    assert apart(solutions, q).max() < 1e-6
    assert solutions.reached.all(axis=1).mean() > 0.6


@pytest.mark.slow
@pytest.mark.parametrize("wrist", WRISTS)
def test_random_arms_with_any_twist_base_and_tool_are_solved(wrist: str) -> None:
    rng = np.random.default_rng(7)
    for number in range(40):
        chain = random_arm(rng, wrist, ((1, 1), (1, -1), (-1, 1), (-1, -1))[number % 4])
        q, targets = poses(chain, 100, number)
        solutions = form_of(chain).solve(targets)
        assert_every_solution_meets(chain, targets, solutions, EXACT)
        assert apart(solutions, q).max() < 1e-6  # near singular poses: the root of the rounding


@pytest.mark.slow
def test_axes_5_and_6_that_pass_each_other_closely_leave_all_digits() -> None:
    rng = np.random.default_rng(9)
    for number in range(30):
        chain = random_arm(rng, "pass", spread=0.05)
        q, targets = poses(chain, 100, number)
        solutions = form_of(chain).solve(targets)
        assert_every_solution_meets(chain, targets, solutions, 1e-12)  # 1e-11 without the last polish
        assert apart(solutions, q).max() < 1e-5


@pytest.mark.parametrize("passing", [1e-3, 1e-4, 1e-5, 1e-7, 1e-9])
def test_axes_5_and_6_that_all_but_meet_are_left_to_the_iterative_solver(passing: float) -> None:
    of_chain = there(chain_to_screws(load_robot("ur5e")))
    point = of_chain.point.copy()
    point[5] += passing * np.cross(of_chain.direction[4], of_chain.direction[5])
    assert parallel_axes(replace(of_chain, point=point), ("a",) * 6) is None


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(WRISTS))
def test_one_pose_alone_is_solved_as_among_many(seed: int, wrist: str) -> None:
    chain = random_arm(np.random.default_rng(seed), wrist)
    _, targets = poses(chain, 5, seed)
    form = form_of(chain)
    together = form.solve(targets)
    for row in range(5):
        alone = form.solve(targets.rows(slice(row, row + 1)))
        np.testing.assert_array_equal(alone.reached[0], together.reached[row])
        np.testing.assert_allclose(alone.q[0], together.q[row], atol=1e-9)


def test_positions_alone_are_refused() -> None:
    form = form_of(load_robot("ur5e"))
    with pytest.raises(OptionError) as caught:
        form.solve(Targets(np.zeros((1, 3))))
    assert str(caught.value) == "three parallel axes: found positions with any orientation, allowed: poses"


@pytest.mark.parametrize(
    "fault", ["axis 3 tilted", "axis 4 tilted", "links of no length", "axis 1 parallel", "axis 5 parallel"]
)
def test_what_has_another_geometry_is_not_recognised(fault: str) -> None:
    of_chain = there(chain_to_screws(load_robot("ur5e")))
    direction, point = of_chain.direction.copy(), of_chain.point.copy()
    if fault in {"axis 3 tilted", "axis 4 tilted"}:  # a calibrated arm: 1e-6 rad is 1 um at 1 m
        tilted = int(fault.split()[1]) - 1
        direction[tilted] = np.array((math.sin(1e-6), *direction[tilted][1:]))
        direction[tilted] /= np.linalg.norm(direction[tilted])
    if fault == "links of no length":
        point[2] = point[1]
    if fault == "axis 1 parallel":
        direction[0] = direction[1]
    if fault == "axis 5 parallel":
        direction[4] = direction[1]
    assert parallel_axes(replace(of_chain, direction=direction, point=point), ("a",) * 6) is None


def test_reasons_say_what_was_found_and_what_is_allowed() -> None:
    chain = load_robot("ur5e")
    rotation = np.array(np.broadcast_to(np.eye(3), (2, 3, 3)))
    targets = Targets(np.array([[0.0, 0.05, 0.6], [1.4, 0.0, 0.4]]), rotation)
    solutions = form_of(chain).solve(targets)
    assert not solutions.reached.any()
    # the wrist is the tool's 0.0996 m behind the first target, which is on the axis of its rotation
    assert solutions.reason(0) == "the wrist is 0.05 m from axis 1, allowed: at least 0.1333 m"
    reason = solutions.reason(1)
    assert reason is not None and reason.endswith(" m from axis 2, allowed: 0.0328 to 0.8172 m")


def turned_range(chain: Chain) -> tuple[float, float]:
    """Return the least and the largest angle between axes 4 and 6 in [rad], over a turn of joint 5."""
    of_chain = there(chain_to_screws(chain))
    k4, k5, k6 = of_chain.direction[3:]
    axis6 = Rotation.from_rotvec(np.linspace(-math.pi, math.pi, 20_001)[:, None] * k5).apply(k6)
    angles = np.arccos(axis6 @ k4 * np.sign(k4 @ of_chain.direction[1]))
    return float(angles.min()), float(angles.max())


def test_the_limits_that_reasons_tell_are_those_of_the_arm() -> None:
    """What joints 2, 3 and 5 can do at all, over a turn of each, bounds what a reason says is allowed."""
    rng = np.random.default_rng(31)
    told: set[str] = set()
    for number in range(10):
        chain = random_arm(rng, "meet", ((1, 1), (-1, 1), (1, -1), (-1, -1))[number % 4])
        of_chain = there(chain_to_screws(chain))
        z, p = of_chain.direction[1], of_chain.point
        upper, fore = (float(np.linalg.norm(np.cross(z, p[k + 1] - p[k]))) for k in (1, 2))
        bounds = {"from axis 2": (abs(upper - fore), upper + fore), "to axis 4": turned_range(chain)}
        _, targets = poses(chain, 100, number)
        texts = set(form_of(chain).solve(targets).reasons.ravel().tolist())
        for text in texts:
            for what, (least, most) in bounds.items():
                if what in text:
                    figures = [
                        float(one) for one in re.findall(r"[0-9.]+(?:e-[0-9]+)?(?= (?:m|rad|to))", text)
                    ]
                    found, *limits = figures
                    np.testing.assert_allclose(limits, (least, most), rtol=6e-4, atol=2e-4)  # four digits
                    assert not limits[0] <= found <= limits[1]
                    told.add(what)
    assert told == {"from axis 2", "to axis 4"}


def test_branches_are_where_they_say() -> None:
    chain = load_robot("ur5e")
    form = form_of(chain)
    _, targets = poses(chain, 300, 11)
    solutions = form.solve(targets)
    assert form.branches[0] == "right, elbow up, not flipped" and len(set(form.branches)) == 8
    for column, branch in enumerate(form.branches):
        q1, q2, q3, q4, q5, _ = solutions.q[solutions.reached[:, column], column].T
        # a positive q2 lifts an arm that points along +x of the frame that q1 turns: there is right
        wrist = -0.425 * np.cos(q2) - 0.3922 * np.cos(q2 + q3) + 0.0997 * np.sin(q2 + q3 + q4)
        assert (np.sign(wrist) == (1 if "right" in branch else -1)).all(), q1
        elbow = -0.425 * np.sin(q2)
        fore = elbow - 0.3922 * np.sin(q2 + q3)
        along = -0.425 * np.cos(q2) - 0.3922 * np.cos(q2 + q3)
        line = elbow * along - fore * (-0.425 * np.cos(q2))  # above the line from axis 2 to axis 4, outwards
        assert (np.sign(line) == (1 if ("up" in branch) == ("right" in branch) else -1)).all()
        assert (np.sign(q5) == (-1 if branch.endswith(", flipped") else 1)).all()


def test_where_axes_5_and_6_are_parallel_right_is_where_axis_6_points() -> None:
    rng = np.random.default_rng(23)
    for number in range(4):
        chain = random_arm(rng, "parallel", ((1, 1), (1, -1), (-1, 1), (-1, -1))[number])
        of_chain = chain_to_screws(chain)
        _, targets = poses(chain, 50, number)
        solutions = form_of(chain).solve(targets)
        assert of_chain is not None and targets.rotation is not None
        axis1, axis2, *_, axis6 = of_chain.direction
        row, column = np.nonzero(solutions.reached)
        turned2 = Rotation.from_rotvec(solutions.q[row, column, :1] * axis1).apply(axis2)
        turned6 = targets.rotation[row] @ of_chain.rotation.T @ axis6
        side = (np.cross(axis1, turned2) * turned6).sum(axis=1)
        right = np.array(["right" in one for one in solutions.branches])[column]
        np.testing.assert_array_equal(side > 0.0, right)
        assert 0 < right.sum() < len(right)


def with_other_zeros(chain: Chain, shift: FloatArray) -> Chain:
    """Return the same arm with joints that count from elsewhere: q is the chain's less the shift."""
    joints = tuple(
        replace(joint, origin=joint.origin @ rotation_about(joint.axis, by))
        for joint, by in zip(chain.joints, shift.tolist(), strict=True)
    )
    return replace(chain, joints=joints, visuals=())


@pytest.mark.parametrize("wrist", ["ur", *WRISTS])
def test_names_of_branches_do_not_depend_on_where_joints_count_from(wrist: str) -> None:
    rng = np.random.default_rng(21)
    for number in range(6):
        chain = load_robot("ur5e") if wrist == "ur" else random_arm(rng, wrist, ((1, 1), (-1, 1))[number % 2])
        shift = rng.uniform(-3.0, 3.0, 6)
        _, targets = poses(chain, 50, number)
        one = form_of(chain).solve(targets)
        other = form_of(with_other_zeros(chain, shift)).solve(targets)
        np.testing.assert_array_equal(other.reached, one.reached)
        away = by_shorter_way(other.q + shift - one.q)
        np.testing.assert_allclose(away[one.reached], 0.0, atol=1e-7)


@pytest.mark.parametrize("wrist", ["ur", "meet", "parallel"])
def test_a_branch_keeps_its_name_along_a_path_between_singular_poses(wrist: str) -> None:
    rng, looked_at = np.random.default_rng(22), 0
    for _ in range(6):
        chain = load_robot("ur5e") if wrist == "ur" else random_arm(rng, wrist)
        q = rng.uniform(-math.pi, math.pi, 6) + np.linspace(0.0, 1.0, 400)[:, None] * rng.uniform(-1, 1, 6)
        solutions = form_of(chain).solve(forward_targets(chain, q))
        away = np.abs(by_shorter_way(solutions.q - q[:, None])).max(axis=2)
        column = np.where(solutions.reached, away, np.inf).argmin(axis=1)
        smallest = singularity_over_log(chain, q).smallest
        clear = np.minimum(smallest[1:], smallest[:-1]) > 0.01
        assert not (np.diff(column) != 0)[clear].any()
        looked_at += int(clear.sum())
    assert looked_at > 500


def eaik_solutions(chain: Chain, targets: Targets, row: int) -> FloatArray:
    """Return what EAIK finds and its own forward kinematics confirms, shape (k, 6)."""
    of_chain = chain_to_screws(chain)
    assert of_chain is not None and targets.rotation is not None
    offsets = np.diff(np.vstack((np.zeros(3), of_chain.point, of_chain.position)), axis=0)
    robot = HPRobot(of_chain.direction, offsets)
    pose = np.eye(4)
    pose[:3, :3] = targets.rotation[row] @ of_chain.rotation.T
    pose[:3, 3] = targets.position[row]
    found = [one for one in robot.IK(pose).Q if np.abs(robot.fwdKin(one) - pose).max() < 1e-6]
    return np.array(found).reshape(-1, 6)


@pytest.mark.slow
@pytest.mark.parametrize("wrist", ["ur", *WRISTS])
def test_eaik_finds_as_many_solutions_and_the_same(wrist: str) -> None:
    # EAIK returns wrong values where axes 2, 3, 4 are antiparallel: its arms here have them one way
    rng = np.random.default_rng(3)
    chains = [random_arm(rng, wrist) for _ in range(10)] if wrist != "ur" else [load_robot(one) for one in UR]
    short = 0
    for number, chain in enumerate(chains):
        _, targets = poses(chain, 15, number)
        solutions = form_of(chain).solve(targets)
        for row in range(15):
            theirs, mine = eaik_solutions(chain, targets, row), solutions.q[row][solutions.reached[row]]
            away = np.abs(by_shorter_way(theirs[:, None] - mine)).max(axis=2)
            assert (away.min(axis=1) < 1e-5).all()  # their root finder of general wrists leaves 1e-7
            short += len(mine) != len(theirs)
    assert short <= (2 if wrist == "parallel" else 0)  # there EAIK loses a pair of 8 now and then
