from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from eaik.IK_HP import HPRobot
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_models.errors import OptionError
from urmpipe_models.inverse.closed.closed_form import ClosedForm
from urmpipe_models.inverse.closed.parallel_axes import parallel_axes
from urmpipe_models.inverse.solutions import Solutions
from urmpipe_models.inverse.targets import Targets, misses, targets_of
from urmpipe_models.kinematics.screws import screws
from urmpipe_models.kinematics.singularity import singularity_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.transform import Transform, from_offset, rotation_about

UR = ("ur3", "ur3e", "ur5", "ur5e", "ur10", "ur10e")
WRISTS = ("meet", "parallel", "pass")
EXACT = 1e-10
"""What the issue asks of FK(IK(x)); regular poses are met to 1e-12."""


def form_of(chain: Chain) -> ClosedForm:
    of_chain = screws(chain)
    assert of_chain is not None
    form = parallel_axes(of_chain, chain.coordinates)
    assert form is not None
    return form


def poses(chain: Chain, count: int, seed: int = 0) -> tuple[FloatArray, Targets]:
    q = np.random.default_rng(seed).uniform(-math.pi, math.pi, (count, 6))
    return q, targets_of(chain, q)


def assert_every_solution_meets(chain: Chain, targets: Targets, solutions: Solutions, within: float) -> None:
    row, column = np.nonzero(solutions.reached)
    position, angle = misses(chain, solutions.q[row, column], targets.rows(row))
    assert np.abs(position).max(initial=0.0) < within
    assert np.abs(angle).max(initial=0.0) < within
    assert ((solutions.reasons != "") == ~solutions.reached).all()


def apart(solutions: Solutions, q: FloatArray) -> FloatArray:
    """Return how far the nearest solution is from q, the largest of the joints, by the shorter way."""
    away = np.abs(np.remainder(solutions.q - q[:, None] + math.pi, 2 * math.pi) - math.pi).max(axis=2)
    return np.asarray(np.where(solutions.reached, away, np.inf).min(axis=1))


def random_arm(
    rng: np.random.Generator, wrist: str, signs: tuple[int, int] = (1, 1), spread: float = 0.5
) -> Chain:
    """An arm with axes 2, 3, 4 parallel, every other twist and length random, on a base, with a tool.

    Of axes 5 and 6 that pass each other it is drawn again while they all but meet, at most 20 times.
    """
    for _ in range(20):
        chain = drawn_arm(rng, wrist, signs, spread)
        of_chain = screws(chain)
        if of_chain is not None and parallel_axes(of_chain, chain.coordinates) is not None:
            break
    return chain


def drawn_arm(rng: np.random.Generator, wrist: str, signs: tuple[int, int], spread: float) -> Chain:
    """Draw an arm; axes 5 and 6 pass each other about as far as `spread` in [m]."""
    direction = rng.normal(size=(6, 3))
    direction[2], direction[3] = direction[1] * signs[0], direction[1] * signs[1]
    point = rng.uniform(-0.5, 0.5, (6, 3))
    point[5] = point[4] + (0.0 if wrist == "meet" else rng.uniform(-spread, spread, 3))
    if wrist == "parallel":
        direction[5] = direction[4]
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    steps = np.diff(np.vstack((np.zeros(3), point)), axis=0)
    joints = tuple(
        Joint(f"j{k}", origin=from_offset(step.tolist()), axis=tuple(axis.tolist()))
        for k, (step, axis) in enumerate(zip(steps, direction, strict=True))
    )
    base, tip, tool = (from_offset(rng.uniform(-1.0, 1.0, 6).tolist()) for _ in range(3))
    return Chain("random", joints, tip, base, tool)


@pytest.mark.parametrize("name", UR)
def test_fk_of_ik_is_the_pose_of_ten_thousand_and_the_joints_it_came_from_are_found(name: str) -> None:
    chain = load_robot(name)
    q, targets = poses(chain, 10_000)
    solutions = form_of(chain).solve(targets)
    assert_every_solution_meets(chain, targets, solutions, EXACT)
    # of 10,000 poses the one nearest to a singular pose parts from its joints by the root of the rounding
    assert apart(solutions, q).max() < 1e-6
    assert solutions.reached.all(axis=1).mean() > 0.6


@pytest.mark.parametrize("wrist", WRISTS)
def test_random_arms_with_any_twist_base_and_tool_are_solved(wrist: str) -> None:
    rng = np.random.default_rng(7)
    for number in range(40):
        chain = random_arm(rng, wrist, ((1, 1), (1, -1), (-1, 1), (-1, -1))[number % 4])
        q, targets = poses(chain, 100, number)
        solutions = form_of(chain).solve(targets)
        assert_every_solution_meets(chain, targets, solutions, EXACT)
        assert apart(solutions, q).max() < 1e-6  # near singular poses: the root of the rounding


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
    of_chain = screws(load_robot("ur5e"))
    assert of_chain is not None
    point = of_chain.point.copy()
    point[5] += passing * np.cross(of_chain.direction[4], of_chain.direction[5])
    assert parallel_axes(replace(of_chain, point=point), ("a",) * 6) is None


def eaik_solutions(chain: Chain, targets: Targets, row: int) -> FloatArray:
    """Return what EAIK finds and its own forward kinematics confirms, shape (k, 6)."""
    of_chain = screws(chain)
    assert of_chain is not None and targets.rotation is not None
    offsets = np.diff(np.vstack((np.zeros(3), of_chain.point, of_chain.position)), axis=0)
    robot = HPRobot(of_chain.direction, offsets)
    pose = np.eye(4)
    pose[:3, :3] = targets.rotation[row] @ of_chain.rotation.T
    pose[:3, 3] = targets.position[row]
    found = [one for one in robot.IK(pose).Q if np.abs(robot.fwdKin(one) - pose).max() < 1e-6]
    return np.array(found).reshape(-1, 6)


@pytest.mark.parametrize("wrist", ["ur", *WRISTS])
def test_eaik_finds_as_many_solutions_and_the_same(wrist: str) -> None:
    # EAIK returns wrong values where axes 2, 3, 4 are antiparallel: its arms here have them one way
    rng = np.random.default_rng(3)
    chains = [random_arm(rng, wrist) for _ in range(10)] if wrist != "ur" else [load_robot(one) for one in UR]
    short = 0
    for number, chain in enumerate(chains):
        _, targets = poses(chain, 30, number)
        solutions = form_of(chain).solve(targets)
        for row in range(30):
            theirs, mine = eaik_solutions(chain, targets, row), solutions.q[row][solutions.reached[row]]
            away = np.abs(np.remainder(theirs[:, None] - mine + math.pi, 2 * math.pi) - math.pi).max(axis=2)
            assert (away.min(axis=1) < 1e-5).all()  # their root finder of general wrists leaves 1e-7
            short += len(mine) != len(theirs)
    assert short <= (2 if wrist == "parallel" else 0)  # there EAIK loses a pair of 8 now and then


def beside_axis_1(q: FloatArray) -> float:
    """Return q2 that puts the wrist of ur5e as near to axis 1 as the shoulder lets it come."""

    def forward(q2: float) -> float:
        """Return how far forward of axis 1 the wrist is: a2 c2 + a3 c23 + d5 s234."""
        return float(
            -0.425 * math.cos(q2) - 0.3922 * math.cos(q2 + q[2]) + 0.0997 * math.sin(q2 + q[2] + q[3])
        )

    samples = np.linspace(-math.pi, math.pi, 60)
    values = np.array([forward(one) for one in samples])
    first = int(np.flatnonzero(values[:-1] * values[1:] < 0.0)[0])
    return float(brentq(forward, samples[first], samples[first + 1], xtol=1e-16, rtol=1e-15))


def singular_joints(family: str, distance: float, count: int = 200) -> FloatArray:
    """Return joints of ur5e at a distance in [rad] from a family of singular poses."""
    q = np.random.default_rng(5).uniform(-math.pi, math.pi, (count, 6))
    if family == "wrist aligned":
        q[:, 4] = distance
    if family == "wrist aligned backwards":
        q[:, 4] = math.pi - distance
    if family == "arm stretched":
        q[:, 2] = distance
    if family == "arm withdrawn":
        q[:, 2] = math.pi - distance
    if family == "wrist beside axis 1":
        q[:, 1] = [beside_axis_1(one) + distance for one in q]
    return q


FAMILIES = (
    "wrist aligned",
    "wrist aligned backwards",
    "arm stretched",
    "arm withdrawn",
    "wrist beside axis 1",
)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(
    "distance", [0.0, 1e-14, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3]
)
def test_poses_at_and_near_singular_ones_are_met(family: str, distance: float) -> None:
    chain = load_robot("ur5e")
    q = singular_joints(family, distance)
    targets = targets_of(chain, q)
    for near in (None, q):
        solutions = form_of(chain).solve(targets, near)
        assert_every_solution_meets(chain, targets, solutions, EXACT)
        assert solutions.reached.any(axis=1).all()
    named = {str(one.family): one.where.any(axis=1) for one in solutions.singular}
    if distance <= 1e-12:
        assert named[family.removesuffix(" backwards")].all()
    if distance >= 1e-4:
        assert not named


@pytest.mark.parametrize("family", FAMILIES)
def test_at_singular_poses_the_joints_near_by_are_found_again(family: str) -> None:
    chain = load_robot("ur5e")
    q = singular_joints(family, 0.0)
    solutions = form_of(chain).solve(targets_of(chain, q), near=q)
    assert apart(solutions, q).max() < 1e-5  # the root of the rounding of poses where two branches meet


@pytest.mark.parametrize("distance", 10.0 ** np.arange(-12, -3))
def test_near_an_aligned_wrist_a_stretched_arm_stays_in_reach(distance: float) -> None:
    chain = load_robot("ur5e")
    q = singular_joints("wrist aligned", distance)
    q[:, 2] = distance
    targets = targets_of(chain, q)
    solutions = form_of(chain).solve(targets, q)
    assert_every_solution_meets(chain, targets, solutions, EXACT)
    assert solutions.reached.any(axis=1).all()


def test_straight_up_three_families_meet_and_the_start_is_found() -> None:
    chain = load_robot("ur5e")
    q = np.array([chain.start])
    solutions = form_of(chain).solve(targets_of(chain, q))
    assert solutions.families(0) == ["wrist beside axis 1", "wrist aligned", "arm stretched"]
    assert apart(solutions, q)[0] < 1e-7
    assert solutions.reached[0].tolist() == [True, *[False] * 7]
    assert set(solutions.reasons[0, 1:]) == {"the same as right, elbow up, not flipped: both meet here"}


def test_an_aligned_wrist_has_both_flips_and_says_what_is_free_and_what_was_chosen() -> None:
    chain = load_robot("ur5e")
    q = np.array([[0.3, -1.0, 1.2, -0.5, 0.0, 0.2]])
    solutions = form_of(chain).solve(targets_of(chain, q))
    assert solutions.reached.all()
    (aligned,) = [one for one in solutions.singular if one.family == "wrist aligned"]
    # with q5 = 0 the right or the left arm is aligned, and the other one reaches the pose with another q5
    side = "right" if aligned.where[0, 0] else "left"
    assert aligned.where[0].tolist() == [side in one for one in solutions.branches]
    there = [one for one, where in zip(solutions.branches, aligned.where[0], strict=True) if where]
    q6 = np.array([math.pi if one.endswith(", flipped") else 0.0 for one in there])
    np.testing.assert_allclose(np.abs(solutions.q[0, aligned.where[0], 5]), q6, atol=1e-12)
    assert aligned.free == (
        "wrist_3_joint: any value in reach, and shoulder_lift_joint, elbow_joint, wrist_1_joint with it"
    )
    assert aligned.chosen == (
        "wrist_3_joint = 0, and pi more for the flipped wrist, or the nearest value in reach"
    )


def test_where_q6_of_the_convention_is_out_of_reach_the_nearest_in_reach_is_taken() -> None:
    chain = load_robot("ur5e")
    q = np.array([[0.3, -1.0, 0.001, -0.5, 0.0, 2.0]])
    targets = targets_of(chain, q)
    solutions = form_of(chain).solve(targets)
    assert_every_solution_meets(chain, targets, solutions, EXACT)
    (stretched,) = [one for one in solutions.singular if one.family == "arm stretched"]
    q6 = solutions.q[0, stretched.where[0], 5]
    assert len(q6) and (np.abs(q6) > 0.1).all()  # not 0, and stretched: on the edge of what is in reach
    further = form_of(chain).solve(targets, near=np.array([0.0, 0.0, 0.0, 0.0, 0.0, 2.0]))
    assert apart(further, q)[0] < 1e-9


def arm_without_shoulder_offset(upper: float, fore: float) -> Chain:
    """An arm like a UR arm, whose axes 5 and 6 meet in the plane of its links, which goes through axis 1."""
    right = math.pi / 2
    return Chain(
        "flat",
        (
            Joint("a"),
            Joint("b", origin=from_offset((0.0, 0.1, 0.3, right, 0.0, 0.0))),
            Joint("c", origin=from_offset((upper, 0.0, 0.0))),
            Joint("d", origin=from_offset((fore, 0.0, 0.0))),
            Joint("e", origin=from_offset((0.0, 0.0, 0.1, right, 0.0, 0.0))),
            Joint("f", origin=from_offset((0.0, 0.0, 0.1, -right, 0.0, 0.0))),
        ),
        tip=Transform(translation=(0.0, 0.0, 0.1)),
    )


def test_an_arm_with_equal_links_leaves_q2_free_where_it_is_folded() -> None:
    chain = arm_without_shoulder_offset(0.4, 0.4)
    q = np.array([[0.4, 0.7, math.pi, -0.3, 1.0, 0.5]])
    targets = targets_of(chain, q)
    solutions = form_of(chain).solve(targets)
    assert_every_solution_meets(chain, targets, solutions, EXACT)
    (folded,) = [one for one in solutions.singular if one.free == "b: any value"]
    assert folded.family == "arm withdrawn" and folded.chosen == "b = 0"
    assert (solutions.q[0, folded.where[0], 1] == 0.0).all()
    near = form_of(chain).solve(targets, near=q)
    assert apart(near, q)[0] < 1e-7
    assert [one.chosen for one in near.singular if one.free == "b: any value"] == ["b as near"]


def test_without_a_shoulder_offset_the_wrist_can_be_on_axis_1_which_leaves_q1_free() -> None:
    chain = arm_without_shoulder_offset(0.4, 0.3)
    rotation = rotation_matrix(0.3, 0.2, -0.9)
    targets = Targets(np.array([0.0, 0.0, 0.6]) + 0.1 * rotation[:, :, 2], rotation)
    solutions = form_of(chain).solve(targets)
    assert solutions.reached.any()
    assert_every_solution_meets(chain, targets, solutions, EXACT)
    met = [one for one, there in zip(solutions.branches, solutions.reached[0], strict=True) if there]
    assert {one.split(",")[0] for one in met} == {"right", "left"}
    (on_axis,) = [one for one in solutions.singular if one.family == "wrist on axis 1"]
    assert (on_axis.free, on_axis.chosen) == ("a: any value", "a = 0, and pi more for the left arm")
    np.testing.assert_array_equal(on_axis.where, solutions.reached)
    sides = np.array([0.0 if "right" in one else math.pi for one in solutions.branches])
    np.testing.assert_allclose(solutions.q[0, :, 0][on_axis.where[0]], sides[on_axis.where[0]], atol=1e-15)
    near = form_of(chain).solve(targets, near=np.full(6, 0.25))
    assert_every_solution_meets(chain, targets, near, EXACT)
    assert near.q[0, on_axis.where[0], 0].tolist()[0] == 0.25


def rotation_matrix(rx: float, ry: float, rz: float) -> FloatArray:
    """Return Rz Ry Rx as an array of shape (1, 3, 3)."""
    return np.array(from_offset((0.0, 0.0, 0.0, rx, ry, rz)).rotation)[None]


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


def test_a_target_barely_out_of_reach_is_told_with_the_digits_that_say_so() -> None:
    chain = load_robot("ur5e")
    targets = targets_of(chain, np.array([[0.3, -math.pi / 2, 0.0, -math.pi / 2, math.pi / 2, 0.2]]))
    above = Targets(targets.position + np.array([0.0, 0.0, 1e-7]), targets.rotation)
    reason = str(form_of(chain).solve(above).reason(0)).split("; ")[0]
    # from axis 2 to axis 4 the stretched arm is 0.425 m + 0.3922 m long
    assert reason == "axis 4 is 0.8172001 m from axis 2, allowed: 0.0328 to 0.8172 m"


def turned_range(chain: Chain) -> tuple[float, float]:
    """Return the least and the largest angle between axes 4 and 6 in [rad], over a turn of joint 5."""
    of_chain = screws(chain)
    assert of_chain is not None
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
        of_chain = screws(chain)
        assert of_chain is not None
        z, p = of_chain.direction[1], of_chain.point
        upper, fore = (float(np.linalg.norm(np.cross(z, p[k + 1] - p[k]))) for k in (1, 2))
        bounds = {
            "from axis 2": (abs(upper - fore), upper + fore),
            "to axis 4": turned_range(chain),
        }
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
        of_chain = screws(chain)
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
        away = np.remainder(other.q + shift - one.q + math.pi, 2.0 * math.pi) - math.pi
        np.testing.assert_allclose(away[one.reached], 0.0, atol=1e-7)


@pytest.mark.parametrize("wrist", ["ur", "meet", "parallel"])
def test_a_branch_keeps_its_name_along_a_path_between_singular_poses(wrist: str) -> None:
    rng, looked_at = np.random.default_rng(22), 0
    for _ in range(6):
        chain = load_robot("ur5e") if wrist == "ur" else random_arm(rng, wrist)
        q = rng.uniform(-math.pi, math.pi, 6) + np.linspace(0.0, 1.0, 400)[:, None] * rng.uniform(-1, 1, 6)
        solutions = form_of(chain).solve(targets_of(chain, q))
        away = np.abs(np.remainder(solutions.q - q[:, None] + math.pi, 2.0 * math.pi) - math.pi).max(axis=2)
        column = np.where(solutions.reached, away, np.inf).argmin(axis=1)
        smallest = singularity_over_log(chain, q).smallest
        clear = np.minimum(smallest[1:], smallest[:-1]) > 0.01
        assert not (np.diff(column) != 0)[clear].any()
        looked_at += int(clear.sum())
    assert looked_at > 500


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
    "fault", ["axis 4 tilted", "links of no length", "axis 1 parallel", "axis 5 parallel"]
)
def test_what_has_another_geometry_is_not_recognised(fault: str) -> None:
    of_chain = screws(load_robot("ur5e"))
    assert of_chain is not None
    direction, point = of_chain.direction.copy(), of_chain.point.copy()
    if fault == "axis 4 tilted":  # a calibrated arm: 1e-6 rad is 1 um at 1 m
        direction[3] = np.array((math.sin(1e-6), *direction[3][1:]))
        direction[3] /= np.linalg.norm(direction[3])
    if fault == "links of no length":
        point[2] = point[1]
    if fault == "axis 1 parallel":
        direction[0] = direction[1]
    if fault == "axis 5 parallel":
        direction[4] = direction[1]
    assert parallel_axes(replace(of_chain, direction=direction, point=point), ("a",) * 6) is None
