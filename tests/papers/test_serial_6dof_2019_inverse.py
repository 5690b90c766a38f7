"""[Serial6dof2019]_ section 6: every printed inverse solution that has one value, and what it claims.

The inputs are the paper's, in millimetres and radians; where it prints 0.7854 and 1.5708 the angles that are
meant, pi/4 and pi/2, are put in. The rows have four decimals.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from asserting import there
from serial_6dof_rows import INVERSE
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.solutions import Solutions, Targets, pose_errors
from urmpipe_models.ik.spherical import SphericalWrist, spherical_wrist
from urmpipe_models.kinematics.forward import chain_to_screws
from urmpipe_models.math3d import from_rpy
from urmpipe_models.robots.catalogue import load_robot

ARM = load_robot("arm6")
PRINTED = 5.1e-5
"""Half a unit of the last printed decimal, and what rounding adds where that is a five."""

QUARTER, EIGHTH = math.pi / 2, math.pi / 4
DEFAULT = (EIGHTH, -QUARTER, -EIGHTH)
REACH = 372.5294643797
"""The highest z of the wrist, in [mm]: 47 + 45 + 120 + hypot(20, 130) + 29, less the wrist's own."""


@pytest.fixture(scope="module")
def inverse() -> SphericalWrist:
    found = there(chain_to_screws(ARM))
    return there(spherical_wrist(found, ARM.coordinates))


def target(
    x: float, y: float, z: float, alpha: float = 0.0, beta: float = 0.0, gamma: float = 0.0
) -> Targets:
    """The paper's input: millimetres, and angles about moving Z, Y, X."""
    rotation = np.array(from_rpy(gamma, beta, alpha).rotation, dtype=float)
    return Targets(np.array([[x, y, z]]) / 1000.0, rotation[None])


def assert_rows(solutions: Solutions, first: int, rows: list[list[float]]) -> None:
    """Hold slots from `first` on against printed rows, angles by turns."""
    found = solutions.q[0, first : first + len(rows)]
    away = found - np.array(rows)
    away -= 2 * math.pi * np.round(away / (2 * math.pi))
    np.testing.assert_allclose(away, 0.0, rtol=0, atol=PRINTED)


def assert_reached(targets: Targets, q: FloatArray, within: float) -> None:
    """Hold joint values against a pose, in [m] and [rad], by forward kinematics."""
    position, rotation = pose_errors(ARM, np.atleast_2d(q), targets)
    np.testing.assert_allclose(position, 0.0, rtol=0, atol=within)
    np.testing.assert_allclose(rotation, 0.0, rtol=0, atol=within)


def assert_all_reached(solutions: Solutions, targets: Targets) -> None:
    """Hold every solution against its pose: a rounding of some 1e-16, ten times over."""
    for q in solutions.q[0][solutions.reached[0]]:
        assert_reached(targets, q, 2e-15)


def test_6_1_default_position_has_eight_solutions_in_the_papers_order(inverse: SphericalWrist) -> None:
    pose = target(-69, 0, 112, *DEFAULT)
    solutions = inverse.solve(pose)
    assert_all_reached(solutions, pose)
    assert_rows(solutions, 0, INVERSE["6.1"][1])
    assert inverse.branches == (
        "right, elbow down, not flipped",
        "right, elbow down, flipped",
        "right, elbow up, not flipped",
        "right, elbow up, flipped",
        "left, elbow up, not flipped",
        "left, elbow up, flipped",
        "left, elbow down, not flipped",
        "left, elbow down, flipped",
    )
    (aligned,) = solutions.singular
    assert aligned.family == "wrist aligned"
    assert aligned.where.tolist() == [[False] * 4 + [True] * 2 + [False] * 2]
    assert aligned.free == "theta4 and theta6: only their sum is determined"
    assert aligned.chosen == "theta4 = 0, and pi more for the flipped wrist"


def test_6_2_stretched_forward_the_right_arm_is_out_of_reach(inverse: SphericalWrist) -> None:
    pose = target(-309, 0, 72, *DEFAULT)
    solutions = inverse.solve(pose)
    assert_all_reached(solutions, pose)
    assert solutions.reached.tolist() == [[False] * 4 + [True] * 4]
    assert_rows(solutions, 4, INVERSE["6.2"][1][4:])
    # the wrist is 280 mm from axis 1, the shoulder 30 mm behind it, 20 mm above; a2 = 120, hypot(20, 130)
    assert set(solutions.reasons[0, :4]) == {
        "the wrist centre is 0.311 m from axis 2, allowed: 0.012 to 0.252 m"
    }
    assert set(solutions.reasons[0, 4:]) == {""}
    assert solutions.singular == ()


def test_6_3_wrist_on_axis_1_takes_0_and_pi(inverse: SphericalWrist) -> None:
    pose = target(0, 0, 300)
    solutions = inverse.solve(pose)
    assert_all_reached(solutions, pose)
    assert_rows(solutions, 0, INVERSE["6.3"][1])
    (on_axis,) = solutions.singular
    assert on_axis.family == "wrist on axis 1"
    assert on_axis.where.all()
    assert on_axis.free == "theta1: any value"
    assert on_axis.chosen == "theta1 = 0, and pi more for the left arm"


def test_6_4_aligned_wrist_has_four_solutions_two_of_them_of_many(inverse: SphericalWrist) -> None:
    pose = target(-10, 0, 371)
    solutions = inverse.solve(pose)
    assert_all_reached(solutions, pose)
    assert solutions.reached.tolist() == [[False] * 4 + [True] * 4]
    assert_rows(solutions, 4, INVERSE["6.4"][1][4:6])
    # at theta5 = 0 the paper splits the sum of theta4 and theta6 otherwise: the first three are unique
    for slot, printed in (
        (6, [6.2832, 1.5708, 3.1416, 0.2450, 0.0, -0.2450]),
        (7, [6.2832, 1.5708, 3.1416, -2.8966, 0.0, 2.8966]),
    ):
        assert_reached(pose, np.array(printed), 4e-5)  # the printed rows have four decimals
        ours = solutions.q[0, slot]
        away = np.array([*(ours[:3] - printed[:3]), ours[3] + ours[5] - printed[3] - printed[5]])
        np.testing.assert_allclose(away - 2 * math.pi * np.round(away / (2 * math.pi)), 0.0, atol=1.1e-4)
    assert [(one.family, one.where.tolist()) for one in solutions.singular] == [
        ("wrist aligned", [[False] * 6 + [True] * 2])
    ]
    assert set(solutions.reasons[0, :4]) == {
        "the wrist centre is 0.253 m from axis 2, allowed: 0.012 to 0.252 m"
    }


def reached(inverse: SphericalWrist, z: float) -> int:
    """How many solutions there are at the height z [mm] above the shoulder."""
    return int(inverse.solve(target(-30, 0, z)).reached.sum())


def test_6_5_highest_z_is_found_by_bisection(inverse: SphericalWrist) -> None:
    low, high = 300.0, 400.0
    while high - low > 1e-11:
        middle = (low + high) / 2
        low, high = (middle, high) if reached(inverse, middle) else (low, middle)
    assert 92.0 + 120.0 + math.hypot(20.0, 130.0) + 29.0 == pytest.approx(REACH, abs=5e-11)
    assert low == pytest.approx(REACH, abs=1e-7)


def test_6_5_the_limit_that_the_paper_tells(inverse: SphericalWrist) -> None:
    assert reached(inverse, 372.52) == 4
    assert reached(inverse, 372.5294643) == 4
    assert reached(inverse, 372.52946438) == 0
    assert reached(inverse, 372.53) == 0
    reasons = inverse.solve(target(-30, 0, 372.53)).reasons[0]
    assert set(reasons[:4]) == {"the wrist centre is 0.259 m from axis 2, allowed: 0.012 to 0.252 m"}
    assert set(reasons[4:]) == {
        "the wrist centre is 0.25153000 m from axis 2, allowed: 0.01152946 to 0.25152946 m"
    }


def test_6_5_stretched_upwards_theta5_is_not_0_a_hair_below_the_limit(inverse: SphericalWrist) -> None:
    """The paper's theta5 is what rounding the limit leaves; at the limit the whole arm is in line with z."""
    solutions = inverse.solve(target(-30, 0, 372.5294643))
    kept = solutions.q[0][solutions.reached[0]]
    assert np.abs(kept[:, 4]).min() > 1e-5
    stretched = inverse.solve(target(-30, 0, REACH - 1e-10))
    assert "arm stretched" in stretched.families(0)
    assert stretched.reached.tolist() == [[False] * 4 + [True, True, False, False]]
    assert set(stretched.reasons[0, 6:]) == {"the same as left, elbow up: both meet here"}
