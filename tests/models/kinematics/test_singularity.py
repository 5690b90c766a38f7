"""The distance to a singular pose: closed forms, laws, and what the 2019 paper says of its arm."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from arm6 import Arm6Lengths, arm6_determinant
from asserting import there
from urmpipe_models.arm.chain import Chain, Joint, Mimic
from urmpipe_models.arm.denavit_hartenberg import DHRow, GeometricModelRow, dh_chain, geometric_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics import singularity
from urmpipe_models.kinematics.forward import jacobian_over_log
from urmpipe_models.kinematics.singularity import characteristic_length, singularity_over_log
from urmpipe_models.math3d import Transform, from_offset, rotation_about, rotation_z, translation
from urmpipe_models.robots.catalogue import load_robot, robot_names

ARM6 = load_robot("arm6")

SINGULAR = 1e-14  # a singular value that is zero but for the rounding of entries of about 1
REGULAR = 1e-3  # far from singular: twelve digits of the least motion remain


def poses(chain: Chain, count: int, seed: int) -> FloatArray:
    return np.random.default_rng(seed).uniform(-math.pi, math.pi, (count, len(chain.moving)))


def test_the_factors_of_arm6_are_its_determinant() -> None:
    joints = {joint.name: joint.origin.translation for joint in ARM6.joints}
    lengths = (-joints["aux2"][0], joints["theta3"][0], joints["theta4"][0], joints["aux5"][2])
    assert lengths == Arm6Lengths()
    base, tool = from_offset((1.0, 2.0, 3.0, 0.1, 0.2, 0.3)), from_offset((0.0, 0.1, 0.2, 1.0, 0.0, 0.5))
    a1, a2, a4, d5 = others = Arm6Lengths(-0.1, 0.4, 0.3, 0.2)
    half = math.pi / 2
    rows = [
        *(DHRow(d=0.2, a=-a1, alpha=half), DHRow(a=a2), DHRow(theta=half, a=a4, alpha=-half)),
        *(DHRow(d=d5, alpha=half), DHRow(alpha=-half), DHRow(d=0.1)),
    ]
    q = poses(ARM6, 2000, 1)
    assert np.abs(arm6_determinant(list(q.T))).max() > 3e-3
    # products of six entries of up to 0.3 m and 1, of up to 4 m on the other base: rounding
    for chain, lengths, count, rounding in (
        (ARM6, Arm6Lengths(), 2000, 2e-17),
        (ARM6.placed(base, tool), Arm6Lengths(), 2000, 1e-15),
        (dh_chain("other", rows), others, 200, 1e-16),
    ):
        determinants = np.linalg.det(jacobian_over_log(chain, q[:count]))
        assert_allclose(arm6_determinant(list(q[:count].T), lengths), determinants, rtol=0.0, atol=rounding)


# Singular poses of the paper, and corrections in errata.md
ELBOW = 0.7 - math.pi / 2  # theta3 of an elbow that is neither stretched nor withdrawn
A1, A2, A4, D5 = Arm6Lengths()
ALONG = A2 - A4 * math.sin(ELBOW) - D5 * math.cos(ELBOW)
ACROSS = D5 * math.sin(ELBOW) - A4 * math.cos(ELBOW)
# theta2 that brings the wrist onto axis 1: X = 0, X + a1 = along cos t2 + across sin t2
WRIST = math.atan2(ACROSS, ALONG) + math.acos(A1 / math.hypot(ALONG, ACROSS))
COLLINEAR = math.acos((0.03 - 0.02) / 0.12)  # a2 cos t2 + a4 = a1: axis 4 lies on axis 1
STRETCHED = math.atan2(0.02, 0.13)  # a4 cos t3 = d5 sin t3: the wrist on the line of the upper arm
HALF = math.pi / 2
FAMILIES = {  # theta2 to theta5 of singular poses, and of regular ones next to them
    "wrist on axis 1": (
        [(WRIST, ELBOW, 0.3, 0.9), (WRIST, ELBOW, 1.2, -0.4)],
        [(WRIST + 0.1, ELBOW, 0.3, 0.9)],
    ),
    "axis 4 on axis 1": ([(COLLINEAR, -COLLINEAR - HALF, 0.3, 0.9)], [(0.6, -0.6 - HALF, 0.3, 0.9)]),
    "axes 4 and 6 aligned": ([(0.6, ELBOW, 0.3, 0.0), (0.6, ELBOW, 0.3, math.pi)], [(0.6, ELBOW, 0.3, 0.9)]),
    "stretched": ([(0.6, STRETCHED, 0.3, 0.9)], [(0.6, STRETCHED + 0.2, 0.3, 0.9)]),
    "withdrawn": ([(0.6, STRETCHED + math.pi, 0.3, 0.9)], [(0.6, STRETCHED + math.pi + 0.2, 0.3, 0.9)]),
}


@pytest.mark.parametrize("family", FAMILIES)
def test_families_of_singular_poses(family: str) -> None:
    singular, regular = (np.array([[0.4, *angles, 0.6] for angles in part]) for part in FAMILIES[family])
    values = singularity_over_log(ARM6, singular)
    assert values.smallest.max() < SINGULAR
    # rounding of products of three lengths of 0.3 m
    assert_allclose(there(values.determinant), 0.0, atol=2e-17)
    assert_allclose(values.manipulability, 0.0, atol=2e-17)
    values = singularity_over_log(ARM6, regular)
    assert values.smallest.min() > REGULAR
    assert np.abs(there(values.determinant)).min() > 1e-5
    axes = jacobian_over_log(ARM6, np.vstack((singular, regular)))[:, 3:]
    if family == "wrist on axis 1":
        assert np.abs(axes[:, 2, 5]).max() < 0.95  # axis 6 need not be aligned with it, and leans against it
    elif family == "axis 4 on axis 1":
        assert_allclose(axes[:, :, 3], axes[:, :, 0], rtol=0.0, atol=1e-15)  # both point up
    elif family == "axes 4 and 6 aligned":  # they lose a turn, but no way
        assert singularity_over_log(ARM6, singular, orientation=False).smallest.min() > REGULAR


@pytest.mark.parametrize("name", robot_names())
@pytest.mark.parametrize("orientation", [True, False])
def test_values_are_those_of_numpy_pose_by_pose(name: str, orientation: bool) -> None:
    chain = load_robot(name)
    q = poses(chain, 20, 4)
    values = singularity_over_log(chain, q, orientation=orientation)
    rows = 6 if orientation else 3
    free = [joint.lower < joint.upper for joint in chain.moving]
    for k, J in enumerate(jacobian_over_log(chain, q)[:, :rows, free]):
        scaled = np.vstack((J[:3] / values.length, J[3:]))
        assert values.smallest[k] == pytest.approx(np.linalg.svd(scaled, compute_uv=False).min(), abs=1e-14)
        gram = J @ J.T if rows <= len(J.T) else J.T @ J
        volume = math.sqrt(max(np.linalg.det(gram), 0.0))
        assert values.manipulability[k] == pytest.approx(volume, rel=1e-6)  # of a root of a difference
    if rows == sum(free):
        assert_allclose(np.abs(there(values.determinant)), values.manipulability, rtol=1e-10)
    else:
        assert values.determinant is None
    metre = singularity_over_log(chain, q, orientation=orientation, length=1.0)
    smallest = np.linalg.svd(jacobian_over_log(chain, q)[:, :rows, free], compute_uv=False)[:, -1]
    assert_allclose(metre.smallest, smallest, rtol=0.0, atol=1e-14)
    assert metre.length == 1.0


@pytest.mark.slow
@given(st.floats(0.01, 100.0), st.integers(0, 2**32 - 1))
def test_a_scale_model_is_as_near_to_singular(factor: float, seed: int) -> None:
    rows: list[tuple[Any, Any, Any]] = [
        *(("R", "z", [0.0, 0.0, 0.3]), ("T", "y", [0.1, 0.2, 0.0]), ("R", "x", [0.2, 0.0, 0.4])),
        *(("R", "y", [0.0, 0.3, 0.1]), ("R", "z", [0.1, 0.0, 0.0]), ("R", "x", [0.0, 0.1, 0.2])),
    ]

    def scaled(factor: float) -> Chain:
        links = [GeometricModelRow(kind, axis, tuple(factor * x for x in r)) for kind, axis, r in rows]
        return geometric_chain("scaled", links, tip=(0.0, 0.1 * factor, 0.1 * factor))

    q = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, 6))
    unit = singularity_over_log(scaled(1.0), q)
    model = singularity_over_log(scaled(factor), q * np.array([1.0, factor, 1.0, 1.0, 1.0, 1.0]))
    assert model.length == pytest.approx(factor * unit.length, rel=1e-12)
    assert_allclose(model.smallest, unit.smallest, rtol=0.0, atol=1e-13)
    assert_allclose(model.manipulability, factor**2 * unit.manipulability, rtol=1e-9, atol=1e-300)


def columns(values: singularity.SingularityLog) -> FloatArray:
    return np.array([values.smallest, values.manipulability, there(values.determinant)])


def test_rows_without_values_stay_without_and_stop_no_other() -> None:
    q = poses(ARM6, 4, 6)
    complete = columns(singularity_over_log(ARM6, q))
    q[1, 2] = complete[:, 1] = np.nan
    assert_array_equal(columns(singularity_over_log(ARM6, q)), complete)
    for missing in (np.full((2, 6), np.nan), np.empty((0, 6))):
        assert singularity_over_log(ARM6, missing).smallest.shape == (len(missing),)


@pytest.mark.parametrize("orientation", [True, False])
def test_a_joint_whose_limits_are_equal_counts_as_if_it_were_fixed_there(orientation: bool) -> None:
    panda = replace(load_robot("panda"), inertials=())  # a joint with a mass may not lose its name
    q = poses(panda, 50, 8)
    q[:, 2] = 0.4
    first, second, third, *rest = panda.joints
    both = replace(third, lower=0.4, upper=0.4), Joint("fixed", "fixed", third.origin @ rotation_z(0.4))
    locked, fixed = (replace(panda, joints=(first, second, joint, *rest), start=()) for joint in both)
    with_limits = singularity_over_log(locked, q, orientation=orientation, length=1.0)
    without = singularity_over_log(fixed, np.delete(q, 2, axis=1), orientation=orientation, length=1.0)
    # rounding of a frame that is multiplied before instead of after: entries and products of about 1
    assert_allclose(with_limits.smallest, without.smallest, rtol=0.0, atol=1e-14)
    assert_allclose(with_limits.manipulability, without.manipulability, rtol=0.0, atol=1e-14)
    if orientation:  # six joints are left of seven
        assert_allclose(columns(with_limits), columns(without), rtol=0.0, atol=1e-14)
    else:
        assert with_limits.determinant is without.determinant is None


def test_where_no_joint_can_move_all_count() -> None:
    statue = replace(ARM6, joints=tuple(replace(joint, lower=0.0, upper=0.0) for joint in ARM6.joints))
    q = poses(ARM6, 5, 9)
    assert_array_equal(columns(singularity_over_log(statue, q)), columns(singularity_over_log(ARM6, q)))


PASSING = [  # axes pass each other at any angle
    *(DHRow(d=0.3, a=0.4, alpha=0.7), DHRow(theta=0.5, d=-0.2, a=-0.5, alpha=-1.2)),
    *(DHRow(theta=-0.9, d=0.6, a=0.25, alpha=2.0), DHRow(theta=1.1, d=-0.35, a=0.15, alpha=0.4)),
]
SKEW = dh_chain("skew", PASSING)
LENGTHS = [
    (ARM6, 0.03 + 0.12 + 0.02 + 0.13 + 0.029),
    (load_robot("articulated6r"), 0.45 + 0.4 + 0.15),
    (load_robot("ur5"), 0.425 + 0.39225 + 0.10915 + 0.09465 + 0.0823),
    (load_robot("panda"), 0.316 + 0.0825 + 0.0825 + 0.384 + 0.088 + 0.107),
    # 0.4 + 0.5 + 0.25 between the axes, 0.2 + 0.6 along the second and the third; the last is the tip's
    (SKEW, 1.95 + math.hypot(0.35, 0.15)),
]


@pytest.mark.parametrize(("chain", "length"), LENGTHS)
def test_the_length_is_that_of_the_links_after_the_first_axis(chain: Chain, length: float) -> None:
    """It depends neither on the base nor on the places of frames and the zeros of joints."""
    assert characteristic_length(chain) == pytest.approx(length, rel=1e-14)
    longer = chain.placed(from_offset((1.0, 2.0, 3.0, 0.4, 0.5, 0.6)), translation(0.0, 0.0, 0.25))
    if chain is not SKEW:  # along its last axis
        assert characteristic_length(longer) == pytest.approx(length + 0.25, rel=1e-14)
    joints, back = list[Joint](), Transform()
    for k, joint in enumerate(chain.joints):
        shift = translation(*np.multiply(0.1 * k, joint.axis)) @ rotation_about(joint.axis, 0.3 * k)
        joints.append(replace(joint, origin=back @ joint.origin @ shift))
        back = shift.inverse()
    moved = replace(chain, joints=tuple(joints), tip=back @ chain.tip)
    assert characteristic_length(moved) == pytest.approx(length, rel=1e-13)


def test_axes_are_parallel_below_a_sine_of_a_tenth_not_from_it_on() -> None:
    """At 0.1 the axes meet 3 m down the first one: the way to the tip is longer than the 0.3 m across."""
    limit = singularity.MAX_PARALLEL_SINE
    for lean, length in ((limit, 3.0), (limit - 1e-9, 0.3)):
        axis = (lean, 0.0, math.sqrt(1.0 - lean * lean))
        turns = (Joint("first"), Joint("second", origin=translation(0.3, 0.0, 0.0), axis=axis))
        assert characteristic_length(Chain("leaning", turns)) == pytest.approx(length, rel=0.02)
    leaning = Joint("second", origin=from_offset([0.4, 0.0, 0.0, 0.0, 1e-4, 0.0]))  # they meet 4 km away
    calibrated = Chain("calibrated", (Joint("first"), leaning), tip=translation(0.3, 0.0, 0.0))
    assert characteristic_length(calibrated) == pytest.approx(0.7, rel=1e-6)


def test_arms_of_few_axes() -> None:
    turn, slide, far = Joint("turn"), Joint("slide", "prismatic"), translation(0.3, 0.4, 5.0)
    follower = Joint("follow", origin=translation(0.5, 0.0, 0.0), mimic=Mimic("turn", 2.0))
    assert characteristic_length(Chain("one", (turn,), tip=far)) == 0.5
    assert characteristic_length(Chain("slider", (slide,), tip=far)) == 1.0
    assert characteristic_length(Chain("point", (turn,))) == 1.0
    assert characteristic_length(Chain("two", (turn, follower), tip=translation(0.2, 0.0, 0.0))) == 0.7
