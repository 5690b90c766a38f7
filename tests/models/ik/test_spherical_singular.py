"""Singular poses of arms with a spherical wrist: named, resolved as documented, and harmless close by."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from asserting import there
from spherical_arms import assert_explained, assert_reached, away_from, inverse_of, random_arm
from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.denavit_hartenberg import DHRow, dh_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import Solutions, Targets, forward_targets
from urmpipe_models.ik.spherical import BATCH_SIZE
from urmpipe_models.kinematics.forward import jacobian_over_log
from urmpipe_models.robots.catalogue import load_robot

ARM = load_robot("arm6")
FORM = inverse_of(ARM)
DISTANCES = [10.0**-k for k in range(3, 13)]  # rad

ELBOW = math.atan2(20.0, 130.0) - math.pi
"""theta3 of arm6 where the forearm, 20 mm across and 130 mm along, is in line with the upper arm."""


def q2_on_axis_1(q3: float) -> float:
    """theta2 that brings the wrist of arm6 over axis 1, for theta3."""
    tilt = q3 + math.pi / 2
    x = 120.0 + 20.0 * math.cos(tilt) - 130.0 * math.sin(tilt)
    y = 20.0 * math.sin(tilt) + 130.0 * math.cos(tilt)
    return math.acos(30.0 / math.hypot(x, y)) - math.atan2(y, x)


def solved(chain: Chain, q: FloatArray) -> Solutions:
    """Solve for the poses of joint values, with all solutions held against them."""
    targets = forward_targets(chain, q)
    solutions = inverse_of(chain).solve(targets)
    assert_reached(chain, targets, solutions)
    assert_explained(solutions)
    return solutions


def families(solutions: Solutions) -> dict[str, list[int]]:
    """The slots that lie in each family, of the first target."""
    found: dict[str, list[int]] = {}
    for one in solutions.singular:
        found.setdefault(one.family, []).extend(np.flatnonzero(one.where[0]).tolist())
    return found


def least_singular_value(q: FloatArray) -> FloatArray:
    """Of the Jacobian of arm6, lengths in units of 0.1 m."""
    j = jacobian_over_log(ARM, q)
    j[:, :3] *= 10.0
    return np.asarray(np.linalg.svd(j, compute_uv=False)[:, -1])


def test_wrist_aligned_alone_lists_both_flips() -> None:
    solutions = solved(ARM, np.array([[0.4, 0.5, -0.3, 0.7, 0.0, -0.2]]))
    (slots,) = families(solutions).values()
    assert families(solutions) == {"wrist aligned": slots}
    assert len(slots) == 2
    (one,) = solutions.singular
    assert one.free == "theta4 and theta6: only their sum is determined"
    not_flipped, flipped = solutions.q[0, slots]
    np.testing.assert_allclose(not_flipped, [0.4, 0.5, -0.3, 0.0, 0.0, 0.5], atol=1e-13)
    np.testing.assert_allclose(flipped, [0.4, 0.5, -0.3, math.pi, 0.0, 0.5 - math.pi], atol=1e-13)
    assert least_singular_value(solutions.q[0, slots]).max() < 1e-12


def test_wrist_folded_back_leaves_the_difference() -> None:
    solutions = solved(ARM, np.array([[0.4, 0.5, -0.3, 0.7, math.pi, -0.2]]))
    (one,) = solutions.singular
    assert one.family == "wrist aligned"
    assert one.free == "theta4 and theta6: only their difference is determined"
    slot = int(np.flatnonzero(one.where[0])[0])
    np.testing.assert_allclose(solutions.q[0, slot, 3:], [0.0, math.pi, -0.9], atol=1e-13)


def test_a_free_joint_is_taken_from_near() -> None:
    q = np.array([[0.4, 0.5, -0.3, 0.7, 0.0, -0.2]])
    solutions = FORM.solve(forward_targets(ARM, q), near=np.array([9.0, 9.0, 9.0, 0.3, 9.0, 9.0]))
    (one,) = solutions.singular
    assert one.chosen == "theta4 as near, and pi more for the flipped wrist"
    not_flipped, flipped = solutions.q[0, one.where[0]]
    np.testing.assert_allclose(not_flipped[3:], [0.3, 0.0, 0.2], atol=1e-13)
    np.testing.assert_allclose(flipped[3:], [0.3 - math.pi, 0.0, 0.2 - math.pi], atol=1e-13)


def test_near_may_be_a_row_a_target() -> None:
    q = np.array([[0.4, 0.5, -0.3, 0.7, 0.0, -0.2], [0.9, 0.5, -0.3, 0.7, 0.0, -0.2]])
    targets = forward_targets(ARM, q)
    solutions = FORM.solve(targets, near=q)
    assert away_from(ARM, solutions, q).min(axis=1).max() < 1e-13


def test_wrist_on_axis_1_alone_takes_0_and_pi_or_near() -> None:
    q = np.array([[1.1, q2_on_axis_1(-1.2), -1.2, 0.4, 0.8, -0.5]])
    solutions = solved(ARM, q)
    assert families(solutions) == {"wrist on axis 1": list(range(8))}
    np.testing.assert_allclose(solutions.q[0, :4, 0], 0.0, atol=0)
    np.testing.assert_allclose(solutions.q[0, 4:, 0], math.pi, atol=0)
    assert least_singular_value(solutions.q[0]).max() < 1e-12
    targets = forward_targets(ARM, q)
    near = FORM.solve(targets, near=q[0])
    assert_reached(ARM, targets, near)
    assert away_from(ARM, near, q).min() < 1e-13
    assert near.singular[0].chosen == "theta1 as near, and pi more for the left arm"


def test_wrist_on_axis_1_and_aligned_at_once() -> None:
    solutions = solved(ARM, np.array([[0.0, q2_on_axis_1(-1.2), -1.2, 0.4, 0.0, -0.5]]))
    found = families(solutions)
    assert set(found) == {"wrist on axis 1", "wrist aligned"}
    assert found["wrist on axis 1"] == list(range(8))
    assert found["wrist aligned"] == [0, 1]
    assert solutions.reached.all()


@pytest.mark.parametrize(("elbow", "family"), [(ELBOW, "arm stretched"), (ELBOW + math.pi, "arm withdrawn")])
def test_both_elbows_of_a_stretched_or_withdrawn_arm_are_told_once(elbow: float, family: str) -> None:
    q = np.array([[0.3, 1.2, elbow, 0.4, 0.9, -0.5]])
    solutions = solved(ARM, q)
    assert away_from(ARM, solutions, q).min() < 1e-6
    slots = families(solutions)[family]
    assert len(slots) == 2
    assert least_singular_value(solutions.q[0, slots]).max() < 1e-6
    told = [text for text in solutions.reasons[0] if text.startswith("the same as")]
    side, elbow_word, _ = solutions.branches[slots[0]].split(", ")
    assert told == [f"the same as {side}, {elbow_word}: both meet here"] * 2
    (one,) = (one for one in solutions.singular if one.family == family)
    assert (one.free, one.chosen) == ("", "")


def test_all_three_families_at_once() -> None:
    """The wrist over axis 1, the arm stretched and the wrist aligned: each told, each pose reached."""
    q = np.array([[0.0, math.acos(30.0 / (120.0 + math.hypot(20.0, 130.0))), ELBOW, 0.4, 0.0, -0.5]])
    solutions = solved(ARM, q)
    assert set(families(solutions)) == {"wrist on axis 1", "arm stretched", "wrist aligned"}
    assert solutions.reached[0].tolist() == [True, True, False, False] * 2


@pytest.mark.parametrize("distance", DISTANCES)
def test_just_beside_a_singular_pose_every_solution_still_reaches(distance: float) -> None:
    generator = np.random.default_rng(4)
    rows = []
    for _ in range(60):
        q1, q2, q3, q4, q6 = generator.uniform(-3.0, 3.0, 5)
        step = distance * generator.uniform(-1.0, 1.0, 4)
        over = q2_on_axis_1(-1.2)
        rows += [
            [q1, q2, q3, q4, step[0], q6],
            [q1, q2, q3, q4, math.pi + step[0], q6],
            [q1, over + step[1], -1.2, q4, 0.8, q6],
            [q1, over + step[1], -1.2, q4, step[0], q6],
            [q1, q2, ELBOW + step[2], q4, 0.8, q6],
            [q1, q2, ELBOW + math.pi + step[2], q4, step[0], q6],
        ]
    q = np.array(rows)
    solutions = solved(ARM, q)
    assert solutions.reached.any(axis=1).all()


@pytest.mark.parametrize("distance", DISTANCES)
def test_just_beside_an_aligned_wrist_of_an_arm_askew_every_solution_still_reaches(distance: float) -> None:
    """Axes along no axis of the world: what is nearly along one is no small coordinate."""
    generator = np.random.default_rng(15)
    q = generator.uniform(-3.0, 3.0, (60, 6))
    chain = random_arm(generator, "like a PUMA", "RRR", theta5=0.0, alpha4=math.pi / 2, alpha5=-math.pi / 2)
    q[:, 4] = distance * generator.uniform(-1.0, 1.0, 60)
    solutions = solved(chain, q)
    assert solutions.reached.any(axis=1).all()


def articulated(d: tuple[float, ...], a: tuple[float, ...], slide: float | None = None) -> Chain:
    """An arm by d1 to d6 and a1 to a3 in [m]; joint 3 slides where its alpha is given in [rad]."""
    right = math.pi / 2
    twists = (
        (right, 0.0, right, -right, right, 0.0)
        if slide is None
        else (-right, right, slide, -right, right, 0.0)
    )
    rows = [DHRow(d=d[k], a=(*a, 0.0, 0.0, 0.0)[k], alpha=twists[k]) for k in range(6)]
    if slide is not None:
        rows[2] = replace(rows[2], kind="prismatic")
    return dh_chain("articulated", rows)


OFFSET_SHOULDER = articulated((0.4, 0.15, 0.0, 0.4, 0.0, 0.1), (0.05, 0.5, 0.02))  # 0.15 m from axis 1


@pytest.mark.parametrize("distance", [0.0, *DISTANCES])
def test_beside_where_right_and_left_meet(distance: float) -> None:
    """The wrist of an arm with an offset shoulder is no farther from axis 1 than the offset."""
    chain = OFFSET_SHOULDER
    generator = np.random.default_rng(5)
    q = generator.uniform(-3.0, 3.0, (40, 6))
    x = 0.5 + 0.02 * np.cos(q[:, 2]) + 0.4 * np.sin(q[:, 2])
    y = 0.02 * np.sin(q[:, 2]) - 0.4 * np.cos(q[:, 2])
    q[:, 1] = np.arccos(-0.05 / np.hypot(x, y)) - np.arctan2(y, x) + distance * generator.uniform(-1, 1, 40)
    solutions = solved(chain, q)
    # two solutions that count as one differ by 4e-6 rad of q1, and by as much more in what turns with it
    assert away_from(chain, solutions, q).min(axis=1).max() < 2e-5
    meeting = [one for one in solutions.singular if one.family == "wrist beside axis 1"]
    if distance == 0.0:
        (one,) = meeting
        assert one.where.any(axis=1).all()
        assert (one.free, one.chosen) == ("", "")
        reasons = {text for text in solutions.reasons.ravel() if text.startswith("the same")}
        assert reasons == {
            "the same as right, elbow down: both meet here",
            "the same as right, elbow up: both meet here",
        }
    if distance >= 1e-4:
        assert not any(one.where.all(axis=1).any() for one in meeting)


def test_a_wrist_nearer_to_axis_1_than_the_offset_is_told_with_figures() -> None:
    chain = OFFSET_SHOULDER
    targets = forward_targets(chain, np.zeros((1, 6)))
    targets.position[0] = there(targets.rotation)[0] @ np.array([0.0, 0.0, 0.1]) + np.array([0.03, 0.04, 0.6])
    solutions = inverse_of(chain).solve(targets)
    assert solutions.reason(0) == "the wrist centre is 0.050 m from axis 1, allowed: 0.150 m or more"


@pytest.mark.parametrize(
    ("distance", "said"),
    [
        (0.95, "0.950 m from axis 2, allowed: 0.100 to 0.900 m"),
        (0.9 + 2e-5, "0.900020 m from axis 2, allowed: 0.100000 to 0.900000 m"),
        (0.1 - 2e-4, "0.09980 m from axis 2, allowed: 0.10000 to 0.90000 m"),
        (0.05, "0.050 m from axis 2, allowed: 0.100 to 0.900 m"),
    ],
)
def test_a_wrist_out_of_reach_of_the_links_is_told_from_axis_2(distance: float, said: str) -> None:
    """Links of 0.5 and 0.4 m in a plane 0.15 m beside axis 1; as many digits as tell the figures apart."""
    chain = articulated((0.4, 0.15, 0.0, 0.4, 0.0, 0.0), (0.0, 0.5, 0.0))
    places = [
        [math.hypot(0.15, distance), 0.0, 0.4],
        [math.hypot(0.15, 0.6 * distance), 0.0, 0.4 + 0.8 * distance],
    ]
    found = inverse_of(chain).solve(Targets(np.array(places), np.tile(np.eye(3), (2, 1, 1))))
    assert [found.reason(0), found.reason(1)] == [f"the wrist centre is {said}"] * 2


def test_a_wrist_nearer_than_a_slide_can_draw_it_is_told_with_figures() -> None:
    """The slide passes the point where axes 1 and 2 meet."""
    chain = articulated((0.4, 0.15, 0.0, 0.1, 0.0, 0.0), (0.0, 0.1, 0.05), slide=0.3)
    # the slide draws the wrist along z of joint 3; across it stand 0.1 + 0.05 and 0.15 less 0.1 sin 0.3
    least = math.hypot(0.1 + 0.05, 0.15 - 0.1 * math.sin(0.3))
    target = Targets(np.array([[0.16, 0.0, 0.4]]), np.eye(3)[None])
    found = inverse_of(chain).solve(target).reason(0)
    where = "from the point where axes 1 and 2 meet"
    assert found == f"the wrist centre is 0.160 m {where}, allowed: {least:.3f} m or more"


def test_wrist_on_axis_2_leaves_joint_2() -> None:
    """Upper arm and forearm of one length, folded: joint 2 turns the wrist on the spot."""
    chain = articulated((0.4, 0.0, 0.0, 0.5, 0.0, 0.1), (0.1, 0.5, 0.0))
    q = np.array([[0.3, 0.8, -math.pi / 2, 0.4, 0.7, 0.1]])
    solutions = solved(chain, q)
    found = families(solutions)
    assert set(found) == {"wrist on axis 2", "arm withdrawn"}
    (one,) = (one for one in solutions.singular if one.family == "wrist on axis 2")
    assert (one.free, one.chosen) == ("q2: any value", "q2 = 0")
    np.testing.assert_array_equal(solutions.q[0, found["wrist on axis 2"], 1], 0.0)
    near = inverse_of(chain).solve(forward_targets(chain, q), near=q[0])
    assert away_from(chain, near, q).min() < 1e-7


@pytest.mark.parametrize("distance", [0.0, *DISTANCES])
def test_beside_where_the_flips_of_a_wrist_that_is_not_square_meet(distance: float) -> None:
    generator = np.random.default_rng(8)
    chain = random_arm(generator, "like a PUMA", "RRR", alpha4=0.5, alpha5=-0.8, theta5=0.0)
    q = generator.uniform(-3.0, 3.0, (40, 6))
    q[:, 4] = np.where(np.arange(40) % 2, 0.0, math.pi) + distance * generator.uniform(-1.0, 1.0, 40)
    solutions = solved(chain, q)
    assert away_from(chain, solutions, q).min(axis=1).max() < 2e-5
    meeting = [one for one in solutions.singular if one.family == "flips meet"]
    if distance == 0.0:
        assert meeting[0].where.any(axis=1).all()
        assert "the same as right, elbow down, not flipped: both meet here" in solutions.reasons
    if distance >= 1e-4:
        assert meeting == []


def test_blocks_of_targets_are_as_single_ones_with_their_singular_poses() -> None:
    q = np.random.default_rng(8).uniform(-math.pi, math.pi, (2 * BATCH_SIZE + 3, 6))
    aligned = [0, BATCH_SIZE - 1, BATCH_SIZE, 2 * BATCH_SIZE + 1]
    q[aligned, 4] = 0.0
    stretched = BATCH_SIZE + 7  # in the second block alone
    q[stretched, 2] = ELBOW
    targets = forward_targets(ARM, q)
    targets.position[2 * BATCH_SIZE + 2] = np.nan
    every = FORM.solve(targets, q)
    assert [(one.family, one.free) for one in every.singular] == [
        ("wrist aligned", "theta4 and theta6: only their sum is determined"),
        ("arm stretched", ""),
    ]
    assert np.flatnonzero(every.singular[0].where.any(axis=1)).tolist() == aligned
    assert np.flatnonzero(every.singular[1].where.any(axis=1)).tolist() == [stretched]
    for row in (*aligned, stretched, 2 * BATCH_SIZE + 2):
        alone = FORM.solve(targets.rows(slice(row, row + 1)), q[row])
        np.testing.assert_array_equal(every.q[row], alone.q[0])
        assert every.reasons[row].tolist() == alone.reasons[0].tolist()
        assert every.families(row) == alone.families(0)
