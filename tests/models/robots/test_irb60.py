"""irb60 of the catalogue: absolute angles by parallelograms, lengths that are assumed, a level wrist."""

from __future__ import annotations

import math

import numpy as np
import pytest

from asserting import there
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.ik.path import solve_path
from urmpipe_models.ik.solutions import Targets
from urmpipe_models.ik.solve import solve
from urmpipe_models.kinematics.forward import jacobian_over_log, poses_over_log, positions_over_log
from urmpipe_models.kinematics.singularity import singularity_over_log
from urmpipe_models.robots.catalogue import load_robot

ARM = load_robot("irb60")
LENGTHS = {one.name: one.value for one in ARM.parameters if one.source == "assumption"}
L1, L2, L3, L4 = (float(LENGTHS[name]) for name in ("l1", "l2", "l3", "l4"))

ROUNDING = 1e-12
"""Of sums of five lengths of about 1 m, through six frames."""


def random_angles(*, level: bool) -> FloatArray:
    q = np.random.default_rng(5).uniform(-math.pi, math.pi, (1000, 4))
    q[:, 3] *= not level
    return q


def radius(q: FloatArray) -> FloatArray:
    """Return how far the tip is from axis 1 in the arm's plane, in [m]."""
    return np.asarray(L2 * np.sin(q[:, 1]) + L3 * np.cos(q[:, 2]) + L4 * np.cos(q[:, 3]))


def contour() -> FloatArray:
    """Return points in [m], every 2 mm, of the square through the corners of the paper's contour."""
    way = np.linspace(-0.3, 0.3, 301)
    side = np.full_like(way, 0.3)
    around = [(way, side), (side, -way), (-way, -side), (-side, way)]
    x, y = np.concatenate(around, axis=1)
    return np.column_stack((1.7 + x, y, np.ones_like(x)))


@pytest.mark.parametrize("level", [True, False])
def test_its_tip_is_the_closed_form_in_absolute_angles(level: bool) -> None:
    q = random_angles(level=level)
    r, (t1, t2, t3, t4) = radius(q), q.T
    z = L1 + L2 * np.cos(t2) - L3 * np.sin(t3) - L4 * np.sin(t4)
    position, rotation = poses_over_log(ARM, q)
    np.testing.assert_allclose(position.T, [np.cos(t1) * r, np.sin(t1) * r, z], rtol=0.0, atol=ROUNDING)
    wrist = [np.cos(t1) * np.cos(t4), np.sin(t1) * np.cos(t4), -np.sin(t4)]  # along the tool's x
    np.testing.assert_allclose(rotation[:, :, 0].T, wrist, rtol=0.0, atol=ROUNDING)


def test_its_jacobian_is_that_of_the_closed_form() -> None:
    q = random_angles(level=False)
    r, (t1, *tilts) = radius(q), q.T
    zero = np.zeros_like(t1)
    outwards = L2 * np.cos(tilts[0]), -L3 * np.sin(tilts[1]), -L4 * np.sin(tilts[2])
    upwards = -L2 * np.sin(tilts[0]), -L3 * np.cos(tilts[1]), -L4 * np.cos(tilts[2])
    columns = [[-np.sin(t1) * r, np.cos(t1) * r, zero]]
    columns += [[np.cos(t1) * x, np.sin(t1) * x, z] for x, z in zip(outwards, upwards, strict=True)]
    J = jacobian_over_log(ARM, q)
    np.testing.assert_allclose(J[:, :3], np.array(columns).transpose(2, 1, 0), rtol=0.0, atol=ROUNDING)
    # theta2 and theta3 carry the wrist without turning it
    np.testing.assert_array_equal(J[:, 3:, 1:3], 0.0)


def test_its_determinant_is_that_of_the_joints_that_move() -> None:
    q = random_angles(level=True)
    found = singularity_over_log(ARM, q, orientation=False)
    expected = L2 * L3 * radius(q) * np.cos(q[:, 1] - q[:, 2])
    np.testing.assert_allclose(there(found.determinant), expected, rtol=0.0, atol=10 * ROUNDING)
    np.testing.assert_allclose(found.manipulability, np.abs(expected), rtol=0.0, atol=10 * ROUNDING)


def test_stretched_folded_and_above_its_axis_it_is_singular_by_position() -> None:
    above = -math.asin((L4 + L3 * math.cos(1.5)) / L2)  # radius 0
    tilts = [(0.9, 0.9 - math.pi / 2), (0.9, 0.9 + math.pi / 2), (above, 1.5), (0.9, 0.3)]
    found = singularity_over_log(ARM, np.array([(0.4, *pair, 0.0) for pair in tilts]), orientation=False)
    assert found.smallest[:3].max() < 1e-15  # rounding of entries of about 1
    assert found.smallest[3] > 0.1


def test_its_inverse_reaches_the_papers_contour_with_a_level_wrist() -> None:
    points = contour()
    found = solve(ARM, Targets(points, None))
    assert found.reached.all()
    np.testing.assert_array_equal(found.q[:, 0, 3], 0.0)
    path = solve_path(ARM, Targets(points, None), np.arange(len(points)))
    assert not path.jumps
    np.testing.assert_array_equal(path.q[:, 3], 0.0)
    for q in (found.q[:, 0], path.q):  # a nanometre is what an inverse promises
        np.testing.assert_allclose(positions_over_log(ARM, q), points, rtol=0.0, atol=1e-9)
    assert there(path.singularity.determinant).min() > 1.0


def test_each_position_has_its_elbow_up_or_down_in_front_of_axis_1_or_behind_it() -> None:
    """Turns of joints that a parallelogram undoes are no further solutions."""
    q = np.array([[0.3, 0.5, 0.2, 0.0]])
    every = solve(ARM, Targets(positions_over_log(ARM, q), None), every=True)
    found = every.q[0, every.reached[0]]
    assert np.isclose(found, q, rtol=0.0, atol=1e-9).all(axis=1).sum() == 1
    turned = np.cos(found[:, 0] - 0.3), np.cos(found[:, 1] - found[:, 2])
    assert sorted(map(tuple, np.sign(turned).T.tolist())) == [(-1, -1), (-1, 1), (1, -1), (1, 1)]
