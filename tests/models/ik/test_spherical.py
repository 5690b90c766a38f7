"""Arms with a spherical wrist: every solution reaches its pose, none is lost, branches keep their names."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from asserting import there
from ik_arms import by_shorter_way
from spherical_arms import (
    SPECIAL,
    assert_explained,
    assert_reached,
    away_from,
    described_anew,
    inverse_of,
    random_arm,
    random_joints,
)
from urmpipe_models.arm.chain import Chain, Joint, Mimic
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import Solutions, Targets, forward_targets
from urmpipe_models.ik.spherical import spherical_wrist
from urmpipe_models.kinematics.forward import Screws, chain_to_screws, jacobian_over_log
from urmpipe_models.math3d import from_offset, rotation_about, translation
from urmpipe_models.robots.catalogue import load_robot

FOUND = 2e-5
"""The given joints come back to this, in [rad] or [m]: the digits that a pose near a fold of the arm has."""

FOUR = "right, elbow down", "right, elbow up", "left, elbow up", "left, elbow down"


def screws_of(chain: Chain) -> Screws:
    return there(chain_to_screws(chain))


def kr3() -> Chain:
    """A small industrial arm whose axes 1, 4 and 6 point the other way: lengths of its public description."""
    return Chain(
        "kr3r540",
        (
            Joint("joint_a1", origin=translation(0.0, 0.0, 0.345), axis=(0.0, 0.0, -1.0)),
            Joint("joint_a2", origin=translation(0.02, 0.0, 0.0), axis=(0.0, 1.0, 0.0)),
            Joint("joint_a3", origin=translation(0.26, 0.0, 0.0), axis=(0.0, 1.0, 0.0)),
            Joint("joint_a4", origin=translation(0.0, 0.0, 0.02), axis=(-1.0, 0.0, 0.0)),
            Joint("joint_a5", origin=translation(0.26, 0.0, 0.0), axis=(0.0, 1.0, 0.0)),
            Joint("joint_a6", origin=translation(0.075, 0.0, 0.0), axis=(-1.0, 0.0, 0.0)),
        ),
    )


def assert_given_found(chain: Chain, q: FloatArray) -> Solutions:
    """Every solution reaches its pose, and the joint values that poses were made of are among them."""
    targets = forward_targets(chain, q)
    solutions = inverse_of(chain).solve(targets)
    assert_reached(chain, targets, solutions)
    assert_explained(solutions)
    assert away_from(chain, solutions, q).min(axis=1).max() < FOUND
    return solutions


@pytest.mark.parametrize("robot", ["arm6", "articulated6r", "kr3"])
def test_ten_thousand_poses_are_reached_by_every_solution_the_given_one_among_them(robot: str) -> None:
    chain = kr3() if robot == "kr3" else load_robot(robot)
    solutions = assert_given_found(chain, random_joints(np.random.default_rng(2019), chain, 10_000))
    assert set(solutions.reached.sum(axis=1)) <= {2, 4, 6, 8}
    assert np.nanmax(solutions.q) <= math.pi
    assert np.nanmin(solutions.q) > -math.pi


@pytest.mark.slow
@pytest.mark.parametrize("special", SPECIAL)
def test_random_arms_are_reached_by_every_solution_the_given_one_among_them(special: str) -> None:
    generator = np.random.default_rng(len(special))
    for _ in range(40 if special == "plain" else 8):
        chain = random_arm(generator, special)
        assert_given_found(chain, random_joints(generator, chain, 60))


@pytest.mark.parametrize(
    ("special", "kinds"),
    [
        pytest.param(special, kinds, marks=[pytest.mark.slow] if (special, kinds) != ("plain", "PRP") else [])
        for special in ("plain", "axes 1 and 2 meet", "axes 1 and 2 parallel")
        for kinds in ("PPP", "PPR", "PRP", "PRR", "RPP", "RPR", "RRP")
    ],
)
def test_prismatic_joints_among_the_first_three(special: str, kinds: str) -> None:
    generator = np.random.default_rng(7)
    forms = 0
    for _ in range(6):
        chain = random_arm(generator, special, kinds)
        form = spherical_wrist(screws_of(chain), chain.coordinates)
        if form is None:
            continue
        forms += 1
        assert_given_found(chain, random_joints(generator, chain, 60))
    # two parallel prismatic joints bring the wrist nowhere but to a surface
    assert forms == (0 if special == "axes 1 and 2 parallel" and kinds.startswith("PP") else 6)


@pytest.mark.parametrize(
    ("special", "kinds", "branches"),
    [
        ("plain", "RRR", ("posture 1", "posture 2", "posture 3", "posture 4")),
        ("like a PUMA", "RRR", FOUR),
        ("axes 1 and 2 meet", "RRP", FOUR),
        ("axes 1 and 2 parallel", "RRP", ("right", "left")),
        ("plain", "PPP", ("",)),
        ("plain", "PPR", ("elbow down", "elbow up")),
    ],
)
def test_an_arm_has_as_many_branches_as_its_joints_have_roots(
    special: str, kinds: str, branches: tuple[str, ...]
) -> None:
    form = inverse_of(random_arm(np.random.default_rng(3), special, kinds))
    assert form.arm.branches == branches
    assert len(form.branches) == 2 * len(branches)
    assert form.branches[:2] == tuple(
        ", ".join(filter(None, (branches[0], flip))) for flip in ("not flipped", "flipped")
    )
    assert form.name == "spherical wrist"


def test_elbow_up_is_above_the_line_from_shoulder_to_wrist_on_both_sides() -> None:
    """Axis 1 of the first arm points upwards, of the other one downwards, and so does up."""
    for chain in (load_robot("arm6"), kr3()):
        form = inverse_of(chain)
        q = random_joints(np.random.default_rng(5), chain, 300)
        solutions = form.solve(forward_targets(chain, q))
        (up, *_), (column, *_) = form.screws.direction, form.screws.point
        held = 0
        for slot, name in enumerate(form.branches):
            for row in np.flatnonzero(solutions.reached[:, slot])[:60]:
                shoulder, elbow, wrist = arm_points(form.screws, form.centre, solutions.q[row, slot])
                arm, out = wrist - shoulder, wrist - column
                out -= up * (up @ out)
                if arm @ out <= 0.0:
                    continue  # the wrist is above or behind the shoulder
                above = (elbow - shoulder) @ (up * (arm @ arm) - arm * (arm @ up))
                assert (above > 0.0) == ("elbow up" in name)
                held += 1
        assert held > 200


def arm_points(found: Screws, centre: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where points of axes 2 and 3 and the wrist centre are, all in the plane of these arms."""
    points = [found.point[1], found.point[2], centre]
    for joint, first in ((2, 2), (1, 1), (0, 0)):
        rotation = rotation_about(found.direction[joint].tolist(), float(q[joint])).rotation
        turn = np.array(rotation, dtype=float)
        for k in range(first, 3):
            points[k] = found.point[joint] + turn @ (points[k] - found.point[joint])
    return points[0], points[1], points[2]


@pytest.mark.slow
@given(seed=st.integers(0, 2**32 - 1), special=st.sampled_from(sorted(SPECIAL)))
@settings(max_examples=25, deadline=None)
def test_names_base_tool_and_zeros_change_no_branch(seed: int, special: str) -> None:
    generator = np.random.default_rng(seed)
    chain = random_arm(generator, special)
    zeros = generator.uniform(-3.0, 3.0, 6)
    base, tool = (from_offset(generator.uniform(-1.0, 1.0, 6).tolist()) for _ in range(2))
    other = described_anew(chain, base, tool, zeros)
    form, anew = inverse_of(chain), inverse_of(other)
    assert form.branches == anew.branches
    q = random_joints(generator, chain, 20)
    one, two = form.solve(forward_targets(chain, q)), anew.solve(forward_targets(other, q - zeros))
    # away from where two solutions meet: there a rounding may part or unite them, or move the given digits
    clear = (one.reached.sum(axis=1) == two.reached.sum(axis=1)) & ~_crowded(chain, one.q)
    assert clear.sum() >= 10
    away = by_shorter_way(one.q[clear] - zeros - two.q[clear])
    np.testing.assert_array_equal(one.reached[clear], two.reached[clear])
    np.testing.assert_allclose(away[one.reached[clear]], 0.0, atol=1e-7)


def _crowded(chain: Chain, q: FloatArray) -> NDArray[np.bool_]:
    """Where two solutions of a target are nearer than 0.01 rad in every joint."""
    away = by_shorter_way(q[:, :, None] - q[:, None])
    near = np.nan_to_num(np.abs(away).max(axis=3), nan=9.0) < 1e-2
    near[:, np.arange(q.shape[1]), np.arange(q.shape[1])] = False
    return np.asarray(near.any(axis=(1, 2)))


@pytest.mark.parametrize("special", ["axes 2 and 3 parallel", "like a PUMA", "anthropomorphic"])
def test_an_elbow_joint_that_counts_the_other_way_changes_no_branch(special: str) -> None:
    generator = np.random.default_rng(14)
    chain = random_arm(generator, special)
    joints = list(chain.joints)
    x, y, z = joints[2].axis
    joints[2] = Joint("other way", "revolute", joints[2].origin, (-x, -y, -z))
    other = Chain("other way", tuple(joints), tip=chain.tip, base=chain.base, tool=chain.tool)
    q = random_joints(generator, chain, 50)
    one, two = (inverse_of(arm).solve(forward_targets(chain, q)) for arm in (chain, other))
    np.testing.assert_array_equal(one.reached, two.reached)
    away = by_shorter_way(one.q * [1.0, 1.0, -1.0, 1.0, 1.0, 1.0] - two.q)
    np.testing.assert_allclose(away[one.reached], 0.0, rtol=0, atol=1e-7)


def test_a_branch_keeps_its_name_along_a_path_without_singular_poses() -> None:
    generator = np.random.default_rng(11)
    for special in SPECIAL:
        if special == "plain":
            continue  # its postures are numbered, as such an arm may change from one to another
        chain = random_arm(generator, special)
        form = inverse_of(chain)
        start = random_joints(generator, chain, 1)[0]
        q = start + np.linspace(0.0, 1.0, 400)[:, None] * generator.uniform(-0.3, 0.3, 6)
        solutions = form.solve(forward_targets(chain, q))
        followed = away_from(chain, solutions, q).argmin(axis=1)
        clear = ~_crowded(chain, solutions.q)
        assert clear.sum() > 100
        for stretch in np.split(followed, np.flatnonzero(~clear)):
            assert len(set(stretch[1:].tolist())) <= 1


def test_many_targets_at_once_are_one_by_one() -> None:
    for special in ("plain", "like a PUMA"):
        generator = np.random.default_rng(1)
        chain = random_arm(generator, special)
        form = inverse_of(chain)
        q = random_joints(generator, chain, 21)
        targets = forward_targets(chain, q)
        targets.position[::7] += 3.0  # some out of reach
        together = form.solve(targets)
        for row in range(21):
            alone = form.solve(targets.rows(slice(row, row + 1)))
            np.testing.assert_allclose(together.q[row], alone.q[0], rtol=0, atol=1e-9)
            assert together.reasons[row].tolist() == alone.reasons[0].tolist()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("special", ["plain", "like a PUMA", "axes 1 and 2 meet"])
def test_a_bad_row_gives_its_reason_and_touches_no_other(special: str) -> None:
    generator = np.random.default_rng(2)
    chain = random_arm(generator, special)
    form = inverse_of(chain)
    targets = forward_targets(chain, random_joints(generator, chain, 6))
    good = form.solve(targets)
    targets.position[1] = np.nan
    targets.position[2] = np.inf
    there(targets.rotation)[3] = np.nan
    solutions = form.solve(targets)
    for row in (1, 2, 3):
        assert not solutions.reached[row].any()
        assert solutions.reason(row) == "the target is not finite, allowed: finite numbers"
    np.testing.assert_array_equal(solutions.q[[0, 4, 5]], good.q[[0, 4, 5]])


def test_positions_alone_have_no_closed_form() -> None:
    with pytest.raises(ValueError, match=r"^targets without orientation; allowed: poses$"):
        inverse_of(load_robot("arm6")).solve(Targets(np.zeros((1, 3))))


def test_what_has_no_spherical_wrist_is_not_taken_for_one() -> None:
    for robot in ("urm6", "panda", "iiwa14", "ur5e"):
        chain = load_robot(robot)
        assert spherical_wrist(screws_of(chain), chain.coordinates) is None


@pytest.mark.parametrize(("beside", "taken"), [(1e-12, True), (1e-9, False), (1e-4, False)])
def test_axes_that_just_miss_each_other_do_not_meet(beside: float, taken: bool) -> None:
    chain = random_arm(np.random.default_rng(4), a5=beside)
    assert (spherical_wrist(screws_of(chain), chain.coordinates) is not None) == taken


@pytest.mark.parametrize(
    ("special", "fixed"),
    [
        ("axes 1 and 2 parallel", {"alpha2": 0.0}),  # three parallel axes: a plane
        ("axes 1 and 2 meet", {"a2": 0.0, "d2": 0.0}),  # a ball
        ("plain", {"a3": 0.0, "d4": 0.0}),  # the wrist on axis 3
        ("plain", {"alpha4": 0.0}),  # axes 4 and 5 are one
    ],
)
def test_an_arm_that_brings_its_wrist_to_no_volume_has_no_closed_form(
    special: str, fixed: dict[str, float]
) -> None:
    chain = random_arm(np.random.default_rng(6), special, "RRR", **fixed)
    assert spherical_wrist(screws_of(chain), chain.coordinates) is None


def test_a_joint_that_follows_another_is_no_screw() -> None:
    chain = load_robot("arm6")
    joints = tuple(
        Joint(joint.name, joint.kind, joint.origin, joint.axis, mimic=Mimic("theta2"))
        if joint.name == "theta3"
        else joint
        for joint in chain.joints
    )
    assert chain_to_screws(Chain("following", joints, tip=chain.tip)) is None


def test_unreachable_tilt_of_a_wrist_that_is_not_square_is_told_with_figures() -> None:
    chain = random_arm(np.random.default_rng(8), "like a PUMA", alpha4=0.5, alpha5=-0.8)
    generator = np.random.default_rng(9)
    targets = forward_targets(chain, random_joints(generator, chain, 200))
    turned = Targets(targets.position, there(targets.rotation)[::-1].copy())
    solutions = inverse_of(chain).solve(turned)
    assert_reached(chain, turned, solutions)
    assert_explained(solutions)
    told = {text for text in solutions.reasons.ravel() if text.startswith("axis 6")}
    assert len(told) >= 20
    for text in told:
        found = float(text.split()[5])
        assert text == f"axis 6 must stand at {found:.6f} rad to axis 4, allowed: 0.300000 to 1.300000 rad"
        assert not 0.3 < found < 1.3


CLEAR = 1e-2
"""The least singular value of the Jacobian away from singular poses, angles in [rad], lengths in [m]."""

AGREEMENT = 1e-8
"""EAIK works to some 1e-11, and a least singular value of 0.01 makes a hundred times more of it."""


def clear_poses(chain: Chain, generator: np.random.Generator, count: int) -> FloatArray:
    """Up to `count` random joint values away from singular poses."""
    q = random_joints(generator, chain, 4 * count)
    return q[np.linalg.svd(jacobian_over_log(chain, q), compute_uv=False)[:, -1] > CLEAR][:count]


def assert_agreement(chain: Chain, q: FloatArray) -> None:
    """Hold our solutions of the poses at q against those of EAIK, both ways."""
    hp = pytest.importorskip("eaik.IK_HP", reason="needs eaik")
    found = there(chain_to_screws(chain))
    links = np.vstack((found.point[:1], np.diff(found.point, axis=0), found.position - found.point[-1]))
    peer = hp.HPRobot(found.direction, links)
    assert peer.hasSphericalWrist()
    targets = forward_targets(chain, q)
    solutions = inverse_of(chain).solve(targets)
    for row in range(len(q)):
        ours = solutions.q[row][solutions.reached[row]]
        if np.linalg.svd(jacobian_over_log(chain, ours), compute_uv=False)[:, -1].min() < CLEAR:
            continue  # another solution of the pose is singular
        pose = np.eye(4)
        pose[:3, 3] = targets.position[row]
        pose[:3, :3] = there(targets.rotation)[row] @ found.rotation.T
        answer = peer.IK(pose)
        theirs = np.array(answer.Q)[~np.array(answer.is_LS, dtype=bool)]
        away = by_shorter_way(ours[:, None] - theirs[None])
        distance = np.abs(away).max(axis=2)
        assert len(ours) == len(theirs)
        assert distance.min(axis=0).max() < AGREEMENT
        assert distance.min(axis=1).max() < AGREEMENT


@pytest.mark.slow
@pytest.mark.parametrize("special", [name for name in SPECIAL if name != "plain"])
def test_arms_with_axes_that_meet_or_are_parallel(special: str) -> None:
    generator = np.random.default_rng(21)
    held = 0
    while held < 3:
        chain = random_arm(generator, special)
        q = clear_poses(chain, generator, 60)
        if len(q) == 60:  # else a small arm
            assert_agreement(chain, q)
            held += 1


@pytest.mark.parametrize("robot", ["arm6", "articulated6r"])
def test_arms_of_the_papers(robot: str) -> None:
    chain = load_robot(robot)
    q = clear_poses(chain, np.random.default_rng(22), 200)
    assert len(q) > 100
    assert_agreement(chain, q)
