"""Arms with three parallel axes, at and near their singular poses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from parallel_arms import EXACT, apart, assert_every_solution_meets, form_of, rotation_matrix
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import Targets, forward_targets
from urmpipe_models.math3d import Transform, from_offset
from urmpipe_models.robots.catalogue import load_robot


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


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(
    "distance", [0.0, 1e-14, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3]
)
def test_poses_at_and_near_singular_ones_are_met(family: str, distance: float) -> None:
    chain = load_robot("ur5e")
    q = singular_joints(family, distance)
    targets = forward_targets(chain, q)
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
    solutions = form_of(chain).solve(forward_targets(chain, q), near=q)
    assert apart(solutions, q).max() < 1e-5  # the root of the rounding of poses where two branches meet


@pytest.mark.parametrize("distance", 10.0 ** np.arange(-12, -3))
def test_near_an_aligned_wrist_a_stretched_arm_stays_in_reach(distance: float) -> None:
    chain = load_robot("ur5e")
    q = singular_joints("wrist aligned", distance)
    q[:, 2] = distance
    targets = forward_targets(chain, q)
    solutions = form_of(chain).solve(targets, q)
    assert_every_solution_meets(chain, targets, solutions, EXACT)
    assert solutions.reached.any(axis=1).all()


def test_straight_up_three_families_meet_and_the_start_is_found() -> None:
    chain = load_robot("ur5e")
    q = np.array([chain.start])
    solutions = form_of(chain).solve(forward_targets(chain, q))
    assert solutions.families(0) == ["wrist beside axis 1", "wrist aligned", "arm stretched"]
    assert apart(solutions, q)[0] < 1e-7
    assert solutions.reached[0].tolist() == [True, *[False] * 7]
    assert set(solutions.reasons[0, 1:]) == {"the same as right, elbow up, not flipped: both meet here"}


def test_an_aligned_wrist_has_both_flips_and_says_what_is_free_and_what_was_chosen() -> None:
    chain = load_robot("ur5e")
    q = np.array([[0.3, -1.0, 1.2, -0.5, 0.0, 0.2]])
    solutions = form_of(chain).solve(forward_targets(chain, q))
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
    targets = forward_targets(chain, q)
    solutions = form_of(chain).solve(targets)
    assert_every_solution_meets(chain, targets, solutions, EXACT)
    (stretched,) = [one for one in solutions.singular if one.family == "arm stretched"]
    q6 = solutions.q[0, stretched.where[0], 5]
    assert len(q6) and (np.abs(q6) > 0.1).all()  # not 0, and stretched: on the edge of what is in reach
    further = form_of(chain).solve(targets, near=np.array([0.0, 0.0, 0.0, 0.0, 0.0, 2.0]))
    assert apart(further, q)[0] < 1e-9


def test_two_branches_that_are_one_are_told_once_whatever_stands_before_them() -> None:
    chain = load_robot("ur5e")
    regular, stretched = [0.3, -1.0, 1.2, -0.5, 0.7, 0.2], [0.3, -1.0, 0.0, -0.5, 0.7, 0.2]
    targets = forward_targets(chain, np.array([regular, stretched, regular]))
    together = form_of(chain).solve(targets)
    assert any(text.startswith("the same as") for text in together.reasons[1])
    for row in range(3):
        alone = form_of(chain).solve(targets.rows(slice(row, row + 1)))
        np.testing.assert_array_equal(together.q[row], alone.q[0])
        assert together.reasons[row].tolist() == alone.reasons[0].tolist()


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
    targets = forward_targets(chain, q)
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
