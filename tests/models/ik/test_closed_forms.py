"""Laws of all closed forms: every pose is met, branches keep their names, EAIK finds the same."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from eaik.IK_HP import HPRobot
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import closed_forms
from asserting import there
from closed_forms import EXACT, FOLD, SPECIAL, UR, WRISTS, arm_of_kind, form_of, random_joints, solve_poses
from ik_arms import by_shorter_way
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import BoolArray, FloatArray
from urmpipe_models.ik.closed import exact_closed_form
from urmpipe_models.ik.solutions import Targets, forward_targets
from urmpipe_models.ik.spherical import SphericalWrist
from urmpipe_models.kinematics.forward import chain_to_screws, jacobian_over_log
from urmpipe_models.kinematics.singularity import singularity_over_log
from urmpipe_models.math3d import from_offset, rotation_about
from urmpipe_models.robots.catalogue import load_robot


def slow(*kinds: str) -> list[object]:
    return [pytest.param(kind, marks=pytest.mark.slow) for kind in kinds]


seeds = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("name", [*slow(*UR), "arm6", "articulated6r", "kr3"])
def test_ten_thousand_poses_are_met_by_every_solution_the_given_one_among_them(name: str) -> None:
    rng = np.random.default_rng(0 if name in UR else 2019)
    chain = arm_of_kind(rng, name)
    # of the poses of UR arms the nearest to a singular one parts from its joints by the root of the rounding
    solutions = solve_poses(chain, random_joints(rng, chain, 10_000), given=1e-6 if name in UR else FOLD)
    counts = solutions.reached.sum(axis=1)
    assert ((counts == 8).mean() > 0.6) if name in UR else (set(counts) <= {2, 4, 6, 8})
    assert np.nanmin(solutions.q) > -math.pi and np.nanmax(solutions.q) <= math.pi


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*SPECIAL, *WRISTS, "closely"])
def test_random_arms_are_solved(kind: str) -> None:
    rng = np.random.default_rng(len(kind))
    for number in range(8 if kind in list(SPECIAL)[1:] else 40):
        if kind == "closely":  # axes 5 and 6 pass each other; 1e-11 without the last polish
            chain = closed_forms.arm_with_parallel_axes(rng, WRISTS[2], spread=0.05)
            within, given = 1e-12, 1e-5
        else:  # the root of the rounding
            chain, within, given = arm_of_kind(rng, kind, number), EXACT, 1e-6 if kind in WRISTS else FOLD
        q = random_joints(rng, chain, 60 if kind in SPECIAL else 100)
        solve_poses(chain, q, within=within, given=given)


@pytest.mark.parametrize("kinds", [*slow("PPP", "PPR", "PRR", "RPP", "RPR", "RRP"), "PRP"])
def test_prismatic_joints_among_the_first_three(kinds: str) -> None:
    for special in ("plain", "axes 1 and 2 meet", "axes 1 and 2 parallel"):
        rng = np.random.default_rng(7)
        chains = [closed_forms.arm_with_wrist(rng, special, kinds) for _ in range(6)]
        with_form = [chain for chain in chains if exact_closed_form(chain)]
        for chain in with_form:
            solve_poses(chain, random_joints(rng, chain, 60))
        # two parallel prismatic joints bring the wrist nowhere but to a surface
        assert len(with_form) == (0 if special == "axes 1 and 2 parallel" and kinds.startswith("PP") else 6)


@settings(max_examples=15, deadline=None)
@given(seeds, st.sampled_from(WRISTS))
@example(1, "plain")
@example(1, "like a PUMA")
def test_one_pose_alone_is_solved_as_among_many(seed: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    chain = arm_of_kind(rng, kind)
    targets = forward_targets(chain, random_joints(rng, chain, 8))
    targets.position[::7] += 3.0  # some out of reach
    together = form_of(chain).solve(targets)
    for row in range(8):
        alone = form_of(chain).solve(targets.rows(slice(row, row + 1)))
        np.testing.assert_allclose(alone.q[0], together.q[row], rtol=0, atol=1e-9)
        assert together.reasons[row].tolist() == alone.reasons[0].tolist()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("special", ["plain", "like a PUMA", "axes 1 and 2 meet"])
def test_a_bad_row_gives_its_reason_and_touches_no_other(special: str) -> None:
    rng = np.random.default_rng(2)
    chain = closed_forms.arm_with_wrist(rng, special)
    targets = forward_targets(chain, random_joints(rng, chain, 6))
    good = form_of(chain).solve(targets)
    targets.position[1], targets.position[2], there(targets.rotation)[3] = np.nan, np.inf, np.nan
    solutions = form_of(chain).solve(targets)
    for row in (1, 2, 3):
        assert not solutions.reached[row].any()
        assert solutions.reason(row) == "the target is not finite, allowed: finite numbers"
    np.testing.assert_array_equal(solutions.q[[0, 4, 5]], good.q[[0, 4, 5]])


def is_crowded(q: FloatArray) -> BoolArray:
    """Return where two solutions of a target are nearer than 0.01 rad in every joint."""
    near = np.nan_to_num(np.abs(by_shorter_way(q[:, :, None] - q[:, None])).max(axis=3), nan=9.0) < 1e-2
    near[:, np.arange(q.shape[1]), np.arange(q.shape[1])] = False
    return np.asarray(near.any(axis=(1, 2)))


@pytest.mark.parametrize("kind", [*slow(*SPECIAL), *WRISTS, "ur5e"])
@settings(max_examples=5, deadline=None)
@given(seed=seeds)
def test_names_base_tool_and_zeros_change_no_branch(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain = arm_of_kind(rng, kind, seed)
    zeros = rng.uniform(-3.0, 3.0, 6)
    base, tool = (from_offset(rng.uniform(-1.0, 1.0, 6).tolist()) for _ in range(2))
    other = closed_forms.described_anew(chain, base, tool, zeros)
    assert form_of(chain).branches == form_of(other).branches
    q = random_joints(rng, chain, 20)
    both = (chain, q), (other, q - zeros)
    first, second = (form_of(arm).solve(forward_targets(arm, at)) for arm, at in both)
    # away from where two solutions meet: there a rounding may part or unite them, or move the given digits
    clear = (first.reached.sum(axis=1) == second.reached.sum(axis=1)) & ~is_crowded(first.q)
    assert clear.sum() >= 10
    away = by_shorter_way(first.q[clear] - zeros - second.q[clear])
    np.testing.assert_array_equal(first.reached[clear], second.reached[clear])
    np.testing.assert_allclose(away[first.reached[clear]], 0.0, atol=1e-7)


@pytest.mark.parametrize("special", ["axes 2 and 3 parallel", "like a PUMA", "anthropomorphic"])
def test_an_elbow_joint_that_counts_the_other_way_changes_no_branch(special: str) -> None:
    rng = np.random.default_rng(14)
    chain = closed_forms.arm_with_wrist(rng, special)
    joints = list(chain.joints)
    x, y, z = joints[2].axis
    joints[2] = Joint("other way", "revolute", joints[2].origin, (-x, -y, -z))
    other = Chain("other way", tuple(joints), tip=chain.tip, base=chain.base, tool=chain.tool)
    targets = forward_targets(chain, random_joints(rng, chain, 50))
    first, second = (form_of(arm).solve(targets) for arm in (chain, other))
    np.testing.assert_array_equal(first.reached, second.reached)
    away = by_shorter_way(first.q * [1.0, 1.0, -1.0, 1.0, 1.0, 1.0] - second.q)
    np.testing.assert_allclose(away[first.reached], 0.0, rtol=0, atol=1e-7)


# the postures of a plain arm are numbered, as it may change from one to another
@pytest.mark.parametrize("kind", ["ur5e", *WRISTS[:2], *list(SPECIAL)[1:]])
def test_a_branch_keeps_its_name_along_a_path_between_singular_poses(kind: str) -> None:
    rng, compared = np.random.default_rng(22), 0
    motion, least = (0.3, 0.003) if kind in SPECIAL else (1.0, 0.01)
    for _ in range(6):
        chain = arm_of_kind(rng, kind)
        line = np.linspace(0.0, motion, 400)[:, None] * rng.uniform(-1, 1, 6)
        q = random_joints(rng, chain, 1) + line
        column = closed_forms.distances(chain, form_of(chain).solve(forward_targets(chain, q)), q).argmin(
            axis=1
        )
        smallest = singularity_over_log(chain, q).smallest
        clear = np.minimum(smallest[1:], smallest[:-1]) > least
        assert not (np.diff(column) != 0)[clear].any()
        compared += int(clear.sum())
    assert compared > 500


def arm_points(form: SphericalWrist, q: FloatArray) -> list[FloatArray]:
    """Return where points of axes 2 and 3 and the wrist centre are, all in the plane of these arms."""
    points = [form.screws.point[1], form.screws.point[2], form.centre]
    for joint, first in ((2, 2), (1, 1), (0, 0)):
        rotation = rotation_about(form.screws.direction[joint].tolist(), float(q[joint])).rotation
        turn, origin = np.array(rotation, dtype=float), form.screws.point[joint]
        points[first:] = [origin + turn @ (point - origin) for point in points[first:]]
    return points


@pytest.mark.parametrize("chain", [load_robot("arm6"), closed_forms.kr3()], ids=lambda chain: chain.name)
def test_elbow_up_is_above_the_line_from_shoulder_to_wrist_on_both_sides(chain: Chain) -> None:
    """Axis 1 of the first arm points upwards, of the other one downwards, and so does up."""
    form = form_of(chain)
    assert isinstance(form, SphericalWrist)
    solutions = form.solve(forward_targets(chain, random_joints(np.random.default_rng(5), chain, 300)))
    up, column = form.screws.direction[0], form.screws.point[0]
    compared = 0
    for slot, name in enumerate(form.branches):
        for row in np.flatnonzero(solutions.reached[:, slot])[:60]:
            shoulder, elbow, wrist = arm_points(form, solutions.q[row, slot])
            arm, out = wrist - shoulder, wrist - column
            if arm @ (out - up * (up @ out)) <= 0.0:
                continue  # the wrist is above or behind the shoulder
            above = (elbow - shoulder) @ (up * (arm @ arm) - arm * (arm @ up))
            assert (above > 0.0) == ("elbow up" in name)
            compared += 1
    assert compared > 200


def test_branches_of_a_ur_arm_are_where_they_say() -> None:
    chain = load_robot("ur5e")
    form = form_of(chain)
    solutions = form.solve(forward_targets(chain, random_joints(np.random.default_rng(11), chain, 300)))
    for column, branch in enumerate(form.branches):
        _, q2, q3, q4, q5, _ = solutions.q[solutions.reached[:, column], column].T
        # a positive q2 lifts an arm that points along +x of the frame that q1 turns: there is right
        along = -0.425 * np.cos(q2) - 0.3922 * np.cos(q2 + q3)
        assert (np.sign(along + 0.0997 * np.sin(q2 + q3 + q4)) == (1 if "right" in branch else -1)).all()
        elbow = -0.425 * np.sin(q2)
        fore = elbow - 0.3922 * np.sin(q2 + q3)
        line = elbow * along - fore * (-0.425 * np.cos(q2))  # above the line from axis 2 to axis 4, outwards
        assert (np.sign(line) == (1 if ("up" in branch) == ("right" in branch) else -1)).all()
        assert (np.sign(q5) == (-1 if branch.endswith(", flipped") else 1)).all()


def test_where_axes_5_and_6_are_parallel_right_is_where_axis_6_points() -> None:
    rng = np.random.default_rng(23)
    for senses in closed_forms.SENSES:
        chain = closed_forms.arm_with_parallel_axes(rng, WRISTS[1], senses)
        screws, targets = there(chain_to_screws(chain)), forward_targets(chain, random_joints(rng, chain, 50))
        solutions = form_of(chain).solve(targets)
        axis1, axis2, *_, axis6 = screws.direction
        row, column = np.nonzero(solutions.reached)
        turned2 = Rotation.from_rotvec(solutions.q[row, column, :1] * axis1).apply(axis2)
        turned6 = there(targets.rotation)[row] @ screws.rotation.T @ axis6
        right = np.array(["right" in branch for branch in solutions.branches])[column]
        np.testing.assert_array_equal((np.cross(axis1, turned2) * turned6).sum(axis=1) > 0.0, right)
        assert 0 < right.sum() < len(right)


def angle_range(chain: Chain) -> tuple[float, float]:
    """Return the least and the largest angle between axes 4 and 6 in [rad], over a turn of joint 5."""
    _, k2, _, k4, k5, k6 = there(chain_to_screws(chain)).direction
    axis6 = Rotation.from_rotvec(np.linspace(-math.pi, math.pi, 20_001)[:, None] * k5).apply(k6)
    angles = np.arccos(axis6 @ k4 * np.sign(k4 @ k2))
    return float(angles.min()), float(angles.max())


def test_the_limits_in_reasons_are_those_of_the_arm() -> None:
    """A reason states the limits that joints 2, 3 and 5 reach over a turn, and a value outside them."""
    rng = np.random.default_rng(31)
    seen: set[str] = set()
    for number in range(10):
        chain = closed_forms.arm_with_parallel_axes(rng, WRISTS[0], closed_forms.SENSES[number % 4])
        screws = there(chain_to_screws(chain))
        z, p = screws.direction[1], screws.point
        upper, fore = (float(np.linalg.norm(np.cross(z, p[k + 1] - p[k]))) for k in (1, 2))
        bounds = {"from axis 2": (abs(upper - fore), upper + fore), "to axis 4": angle_range(chain)}
        targets = forward_targets(chain, random_joints(rng, chain, 100))
        for text in set(form_of(chain).solve(targets).reasons.ravel()):
            for what, allowed in bounds.items():
                if what in text:
                    numbers = re.findall(r"[0-9.]+(?:e-[0-9]+)?(?= (?:m|rad|to))", text)
                    found, *limits = map(float, numbers)
                    np.testing.assert_allclose(limits, allowed, rtol=6e-4, atol=2e-4)  # four digits
                    assert not limits[0] <= found <= limits[1]
                    seen.add(what)
    assert seen == {"from axis 2", "to axis 4"}


def test_unreachable_tilt_of_a_wrist_that_is_not_square_has_figures() -> None:
    chain = closed_forms.arm_with_wrist(np.random.default_rng(8), "like a PUMA", alpha4=0.5, alpha5=-0.8)
    targets = forward_targets(chain, random_joints(np.random.default_rng(9), chain, 200))
    turned = Targets(targets.position, there(targets.rotation)[::-1].copy())
    solutions = form_of(chain).solve(turned)
    closed_forms.assert_solved(chain, turned, solutions)
    texts = {text for text in solutions.reasons.ravel() if text.startswith("axis 6")}
    assert len(texts) >= 20
    for text in texts:
        found = float(text.split()[5])
        assert text == f"axis 6 must stand at {found:.6f} rad to axis 4, allowed: 0.300000 to 1.300000 rad"
        assert not 0.3 < found < 1.3


CLEAR = 1e-2  # least singular value of the Jacobian away from singular poses, in [rad] and [m]


def least_singular_value(chain: Chain, q: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.svd(jacobian_over_log(chain, q), compute_uv=False)[:, -1])


def eaik_solutions(chain: Chain, targets: Targets, row: int) -> FloatArray:
    """Return what EAIK finds and its own forward kinematics confirms, shape (k, 6)."""
    screws = there(chain_to_screws(chain))
    points = np.vstack((np.zeros(3), screws.point, screws.position))
    robot = HPRobot(screws.direction, np.diff(points, axis=0))
    assert robot.hasSphericalWrist() == (form_of(chain).name == "spherical wrist")
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = there(targets.rotation)[row] @ screws.rotation.T, targets.position[row]
    found = [q for q in robot.IK(pose).Q if np.abs(robot.fwdKin(q) - pose).max() < 1e-6]
    return np.array(found).reshape(-1, 6)


def clear_poses(rng: np.random.Generator, kind: str) -> tuple[Chain, FloatArray]:
    """Return an arm and joint values away from singular poses; a small random arm with few is left out."""
    count = 60 if kind in SPECIAL else 200
    while True:
        chain = arm_of_kind(rng, kind)
        q = random_joints(rng, chain, 4 * count)
        q = q[least_singular_value(chain, q) > CLEAR][:count]
        if len(q) == count or kind not in SPECIAL:
            assert len(q) > 0.5 * count
            return chain, q


@pytest.mark.parametrize("kind", ["arm6", "articulated6r", *slow(*list(SPECIAL)[1:])])
def test_eaik_finds_the_same_solutions_of_arms_with_a_spherical_wrist(kind: str) -> None:
    rng = np.random.default_rng(21)
    for chain, q in (clear_poses(rng, kind) for _ in range(3 if kind in SPECIAL else 1)):
        targets = forward_targets(chain, q)
        solutions = form_of(chain).solve(targets)
        for row in range(len(q)):
            ours = solutions.q[row][solutions.reached[row]]
            if least_singular_value(chain, ours).min() < CLEAR:
                continue  # another solution of the pose is singular
            theirs = eaik_solutions(chain, targets, row)
            away = np.abs(by_shorter_way(ours[:, None] - theirs[None])).max(axis=2)
            assert len(ours) == len(theirs)
            # EAIK works to some 1e-11, and a least singular value of 0.01 makes a hundred times more of it
            assert max(away.min(axis=0).max(), away.min(axis=1).max()) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ur", *WRISTS])
def test_eaik_finds_as_many_solutions_of_arms_with_parallel_axes_and_the_same(kind: str) -> None:
    # EAIK returns wrong values where axes 2, 3, 4 are antiparallel: its arms here have them one way
    rng = np.random.default_rng(3)
    chains = [arm_of_kind(rng, kind) for _ in range(10)] if kind in WRISTS else map(load_robot, UR)
    fewer = 0
    for chain in chains:
        targets = forward_targets(chain, random_joints(rng, chain, 15))
        solutions = form_of(chain).solve(targets)
        for row in range(15):
            theirs, ours = eaik_solutions(chain, targets, row), solutions.q[row][solutions.reached[row]]
            away = np.abs(by_shorter_way(theirs[:, None] - ours)).max(axis=2)
            assert (away.min(axis=1) < 1e-5).all()  # their root finder of general wrists leaves 1e-7
            fewer += len(ours) != len(theirs)
    assert fewer <= (2 if kind == WRISTS[1] else 0)  # there EAIK loses a pair of 8 now and then
