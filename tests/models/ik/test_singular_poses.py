"""Closed forms at and near singular poses: every solution still meets its pose, and families are named."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq

import closed_forms
from closed_forms import ELBOW, arm_with_wrist, articulated, form_of, q2_on_axis_1, solve_poses
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import Targets, forward_targets
from urmpipe_models.ik.spherical import BATCH_SIZE
from urmpipe_models.math3d import from_offset
from urmpipe_models.robots.catalogue import load_robot

UR5E, ARM6 = load_robot("ur5e"), load_robot("arm6")
RIGHT, PI = math.pi / 2, math.pi
SHOULDER = articulated((0.4, 0.15, 0.0, 0.4, 0.0, 0.1), (0.05, 0.5, 0.02))  # 0.15 m from axis 1
# its axes are oblique to the world axes: a nearly parallel axis has no coordinate near zero
ASKEW = arm_with_wrist(np.random.default_rng(15), "like a PUMA", theta5=0.0, alpha4=RIGHT, alpha5=-RIGHT)
TILTED = arm_with_wrist(np.random.default_rng(8), "like a PUMA", alpha4=0.5, alpha5=-0.8, theta5=0.0)


def q2_beside_axis_1(q: FloatArray) -> float:
    """Return q2 that puts the wrist of ur5e as near to axis 1 as the shoulder lets it come."""

    def forward(q2: float) -> float:
        """Return how far forward of axis 1 the wrist is: a2 c2 + a3 c23 + d5 s234."""
        q23 = q2 + q[2]
        return float(-0.425 * math.cos(q2) - 0.3922 * math.cos(q23) + 0.0997 * math.sin(q23 + q[3]))

    samples = np.linspace(-PI, PI, 60)
    values = np.array([forward(q2) for q2 in samples])
    first = int(np.flatnonzero(values[:-1] * values[1:] < 0.0)[0])
    return float(brentq(forward, samples[first], samples[first + 1], xtol=1e-16, rtol=1e-15))


def q2_at_offset(q: FloatArray) -> float:
    """Return q2 that puts the wrist of SHOULDER as near to axis 1 as the offset lets it come."""
    x = 0.5 + 0.02 * math.cos(q[2]) + 0.4 * math.sin(q[2])
    y = 0.02 * math.sin(q[2]) - 0.4 * math.cos(q[2])
    return math.acos(-0.05 / math.hypot(x, y)) - math.atan2(y, x)


Place = float | Callable[[FloatArray], float]
FAMILIES: dict[str, tuple[Chain, str, dict[int, Place]]] = {  # arm, name of the family, and joints there
    "ur5e aligned": (UR5E, "wrist aligned", {4: 0.0}),
    "ur5e aligned backwards": (UR5E, "wrist aligned", {4: PI}),
    "ur5e stretched": (UR5E, "arm stretched", {2: 0.0}),
    "ur5e withdrawn": (UR5E, "arm withdrawn", {2: PI}),
    "ur5e near axis 1": (UR5E, "wrist beside axis 1", {1: q2_beside_axis_1}),
    "ur5e aligned and stretched": (UR5E, "wrist aligned", {2: 0.0, 4: 0.0}),
    "arm6 aligned": (ARM6, "wrist aligned", {4: 0.0}),
    "arm6 aligned backwards": (ARM6, "wrist aligned", {4: PI}),
    "arm6 on axis 1": (ARM6, "wrist on axis 1", {1: q2_on_axis_1(-1.2)}),
    "arm6 on axis 1 and aligned": (ARM6, "wrist on axis 1", {1: q2_on_axis_1(-1.2), 4: 0.0}),
    "arm6 stretched": (ARM6, "arm stretched", {2: ELBOW}),
    "arm6 withdrawn and aligned": (ARM6, "arm withdrawn", {2: ELBOW + PI, 4: 0.0}),
    "askew aligned": (ASKEW, "wrist aligned", {4: 0.0}),
    "offset shoulder near axis 1": (SHOULDER, "wrist beside axis 1", {1: q2_at_offset}),
    "flips": (TILTED, "flips meet", {4: 0.0}),
    "flips backwards": (TILTED, "flips meet", {4: PI}),
}


@pytest.mark.parametrize("kind", FAMILIES)
def test_poses_at_and_near_singular_ones_are_met(kind: str) -> None:
    chain, family, places = FAMILIES[kind]
    for distance in (0.0, *10.0 ** np.arange(-14, -2)):
        rng = np.random.default_rng(5)
        q = rng.uniform(-3.0, 3.0, (40, 6))
        if "on axis 1" in kind:
            q[:, 2] = -1.2
        step = distance * rng.uniform(-1.0, 1.0, 40)
        for joint, place in places.items():
            q[:, joint] = step + ([place(row) for row in q] if callable(place) else place)
        # two solutions that count as one differ by 4e-6 rad of q1, and by as much more in what turns with it
        given = 2e-5 if chain in (SHOULDER, TILTED) else math.inf
        assert solve_poses(chain, q, given=given).reached.any(axis=1).all()
        if distance == 0.0 and " and " not in kind and chain is not ASKEW:
            given = 1e-5  # the root of the rounding of poses where two branches meet
        solutions = solve_poses(chain, q, q, given=given)
        where = {str(pose.family): np.atleast_1d(pose.where.any(axis=1)) for pose in solutions.singular}
        if distance <= 1e-12 and chain is not ASKEW:
            assert where[family].all()
        assert not any(rows[np.abs(step) >= 1e-5].any() for rows in where.values())


def test_free_joints_are_found_to_all_digits_by_the_convention_and_from_a_near_row_per_target() -> None:
    aligned = [0.4, 0.5, -0.3, 0.7, 0.0, -0.2]
    q = np.array([aligned, [0.9, *aligned[1:]], [1.1, q2_on_axis_1(-1.2), -1.2, 0.4, 0.8, -0.5]])
    solve_poses(ARM6, q, q, given=1e-13)
    found = solve_poses(ARM6, q[:1], given=math.inf)
    for last in ([0.0, 0.0, 0.5], [PI, 0.0, 0.5 - PI]):
        assert closed_forms.distances(ARM6, found, np.array([[*aligned[:3], *last]])).min() < 1e-13


def test_where_q6_of_the_convention_is_out_of_reach_the_nearest_in_reach_is_taken() -> None:
    q = np.array([[0.3, -1.0, 0.001, -0.5, 0.0, 2.0]])
    solutions = solve_poses(UR5E, q, given=math.inf)
    (stretched,) = [pose for pose in solutions.singular if pose.family == "arm stretched"]
    q6 = solutions.q[0, stretched.where[0], 5]
    assert len(q6) and (np.abs(q6) > 0.1).all()  # not 0, and stretched: on the edge of what is in reach
    solve_poses(UR5E, q, np.array([0.0, 0.0, 0.0, 0.0, 0.0, 2.0]), given=1e-9)


def test_without_a_shoulder_offset_the_wrist_can_be_on_axis_1_which_leaves_q1_free() -> None:
    chain = closed_forms.flat_arm(0.4, 0.3)
    rotation: FloatArray = np.array(from_offset((0.0, 0.0, 0.0, 0.3, 0.2, -0.9)).rotation)[None]
    targets = Targets(np.array([0.0, 0.0, 0.6]) + 0.1 * rotation[:, :, 2], rotation)
    solutions, near = form_of(chain).solve(targets), form_of(chain).solve(targets, near=np.full(6, 0.25))
    for found in (solutions, near):
        closed_forms.assert_solved(chain, targets, found)
    (on_axis,) = [pose for pose in solutions.singular if pose.family == "wrist on axis 1"]
    assert (on_axis.free, on_axis.chosen) == ("a: any value", "a = 0, and pi more for the left arm")
    np.testing.assert_array_equal(on_axis.where, solutions.reached)
    sides = np.array([0.0 if "right" in branch else PI for branch in solutions.branches])[on_axis.where[0]]
    assert set(sides) == {0.0, PI}
    np.testing.assert_allclose(solutions.q[0, on_axis.where[0], 0], sides, atol=1e-15)
    assert near.q[0, on_axis.where[0], 0][0] == 0.25


@pytest.mark.parametrize(("chain", "stretched"), [(ARM6, ELBOW), (UR5E, 0.0)], ids=["arm6", "ur5e"])
def test_batches_are_as_single_targets_with_their_singular_poses(chain: Chain, stretched: float) -> None:
    q = np.random.default_rng(8).uniform(-PI, PI, (2 * BATCH_SIZE + 3, 6))
    aligned, in_second_batch = [0, BATCH_SIZE - 1, BATCH_SIZE, 2 * BATCH_SIZE + 1], BATCH_SIZE + 7
    q[aligned, 4], q[in_second_batch, 2] = 0.0, stretched
    targets = forward_targets(chain, q)
    targets.position[-1] = np.nan
    together = form_of(chain).solve(targets, q)
    assert [pose.family for pose in together.singular] == ["wrist aligned", "arm stretched"]
    for pose, rows in zip(together.singular, (aligned, [in_second_batch]), strict=True):
        assert np.flatnonzero(pose.where.any(axis=1)).tolist() == rows
    assert "the same as" in "".join(together.reasons[in_second_batch])
    for row in (*aligned, in_second_batch, len(q) - 1):
        alone = form_of(chain).solve(targets.rows(slice(row, row + 1)), q[row])
        np.testing.assert_array_equal(together.q[row], alone.q[0])
        assert together.reasons[row].tolist() == alone.reasons[0].tolist()
        assert together.families(row) == alone.families(0)
