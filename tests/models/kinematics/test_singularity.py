"""The distance to a singular pose: closed forms, laws, and what the 2019 paper says of its arm."""

from __future__ import annotations

import math
from dataclasses import replace

import casadi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arm6 import Arm6Lengths, arm6_determinant
from asserting import there
from urmpipe_models.arm.chain import Chain, Joint, Mimic
from urmpipe_models.arm.denavit_hartenberg import DHRow, GeometricModelRow, dh_chain, geometric_chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import jacobian_over_log
from urmpipe_models.kinematics.singularity import (
    MAX_PARALLEL_SINE,
    characteristic_length,
    singularity_over_log,
)
from urmpipe_models.math3d import Transform, from_offset, rotation_z, translation
from urmpipe_models.robots.catalogue import load_robot, robot_names

ARM6 = load_robot("arm6")

SINGULAR = 1e-14
"""A singular value that is zero but for the rounding of entries of about 1."""

REGULAR = 1e-3
"""Far from singular: twelve digits of the least motion remain."""


def poses(chain: Chain, count: int, seed: int) -> FloatArray:
    return np.random.default_rng(seed).uniform(-math.pi, math.pi, (count, len(chain.moving)))


def smallest(q: list[float], *, orientation: bool = True) -> float:
    return float(singularity_over_log(ARM6, np.array([q]), orientation=orientation).smallest[0])


# --- the determinant of arm6 -----------------------------------------------------------------------


def test_the_factors_of_arm6_are_its_determinant_on_2000_poses() -> None:
    q = poses(ARM6, 2000, 1)
    placed = ARM6.placed(
        from_offset((1.0, 2.0, 3.0, 0.1, 0.2, 0.3)), from_offset((0.0, 0.1, 0.2, 1.0, 0.0, 0.5))
    )
    factors = arm6_determinant(list(q.T))
    assert np.abs(factors).max() > 3e-3
    # products of six entries of up to 0.3 m and 1, of up to 4 m on the other base: rounding
    np.testing.assert_allclose(factors, np.linalg.det(jacobian_over_log(ARM6, q)), rtol=0.0, atol=2e-17)
    np.testing.assert_allclose(factors, np.linalg.det(jacobian_over_log(placed, q)), rtol=0.0, atol=1e-15)


def test_the_lengths_of_the_factors_are_those_of_the_catalogue() -> None:
    joints = {joint.name: joint.origin.translation for joint in ARM6.joints}
    lengths = Arm6Lengths()
    assert (-joints["aux2"][0], joints["theta3"][0], joints["theta4"][0], joints["aux5"][2]) == lengths


def test_the_factors_with_other_lengths() -> None:
    a1, a2, a4, d5 = lengths = Arm6Lengths(-0.1, 0.4, 0.3, 0.2)
    rows = [
        DHRow(d=0.2, a=-a1, alpha=math.pi / 2),
        DHRow(a=a2),
        DHRow(theta=math.pi / 2, a=a4, alpha=-math.pi / 2),
        DHRow(d=d5, alpha=math.pi / 2),
        DHRow(alpha=-math.pi / 2),
        DHRow(d=0.1),
    ]
    chain = dh_chain("other", rows)
    q = poses(chain, 200, 2)
    expected = np.linalg.det(jacobian_over_log(chain, q))
    np.testing.assert_allclose(arm6_determinant(list(q.T), lengths), expected, rtol=0.0, atol=1e-16)


def test_the_factors_take_floats_and_symbols() -> None:
    q = poses(ARM6, 5, 3)
    casadi.GlobalOptions.setNumpyMode(-1)
    symbols = casadi.SX.sym("q", 6)
    function = casadi.Function("determinant", [symbols], [arm6_determinant(symbols.elements())])
    for row, expected in zip(q.tolist(), arm6_determinant(list(q.T)), strict=True):
        assert arm6_determinant(row) == pytest.approx(expected, abs=1e-18)
        assert float(function(row)) == pytest.approx(expected, abs=1e-18)


# --- what the paper says of singular poses, and what errata.md corrects -------------------------------

ELBOW = 0.7 - math.pi / 2
"""theta3 of an elbow that is neither stretched nor withdrawn."""


def wrist_on_axis_1(t3: float) -> float:
    """Return theta2 that brings the wrist of arm6 onto axis 1: X = 0."""
    a1, a2, a4, d5 = Arm6Lengths()
    along, across = a2 - a4 * math.sin(t3) - d5 * math.cos(t3), -a4 * math.cos(t3) + d5 * math.sin(t3)
    # X + a1 = along cos t2 + across sin t2
    return math.atan2(across, along) + math.acos(a1 / math.hypot(along, across))


def test_the_wrist_on_axis_1_suffices_axis_6_need_not_be_aligned_with_it() -> None:
    t2 = wrist_on_axis_1(ELBOW)
    for t4, t5 in [(0.3, 0.9), (1.2, -0.4)]:
        q = [0.4, t2, ELBOW, t4, t5, 0.6]
        axis = jacobian_over_log(ARM6, np.array([q]))[0, 3:, 5]
        assert abs(axis[2]) < 0.95  # axis 6 leans against axis 1
        assert smallest(q) < SINGULAR
    assert smallest([0.4, t2 + 0.1, ELBOW, 0.3, 0.9, 0.6]) > REGULAR


def test_axes_1_and_4_collinear_are_singular_and_merely_parallel_are_regular() -> None:
    collinear = math.acos((0.03 - 0.02) / 0.12)  # a2 cos t2 + a4 = a1: axis 4 lies on axis 1
    for t2, least, most in [(collinear, 0.0, SINGULAR), (0.6, REGULAR, 1.0)]:
        q = [0.4, t2, -t2 - math.pi / 2, 0.3, 0.9, 0.6]
        columns = jacobian_over_log(ARM6, np.array([q]))[0, 3:]
        np.testing.assert_allclose(columns[:, 3], columns[:, 0], rtol=0.0, atol=1e-15)  # both point up
        assert least <= smallest(q) < most


def test_axes_4_and_6_aligned_lose_a_turn_but_no_way() -> None:
    for t5 in (0.0, math.pi):
        q = [0.4, 0.6, ELBOW, 0.3, t5, 0.6]
        assert smallest(q) < SINGULAR
        assert smallest(q, orientation=False) > REGULAR


@pytest.mark.parametrize("turn", [0.0, math.pi])
def test_stretched_and_withdrawn_arms_are_singular(turn: float) -> None:
    t3 = math.atan2(0.02, 0.13) + turn  # a4 cos t3 = d5 sin t3: the wrist on the line of the upper arm
    assert smallest([0.4, 0.6, t3, 0.3, 0.9, 0.6]) < SINGULAR
    assert smallest([0.4, 0.6, t3 + 0.2, 0.3, 0.9, 0.6]) > REGULAR


def test_every_family_makes_the_determinant_zero() -> None:
    singular = [
        [0.4, wrist_on_axis_1(ELBOW), ELBOW, 0.3, 0.9, 0.6],
        [0.4, 0.6, ELBOW, 0.3, 0.0, 0.6],
        [0.4, 0.6, math.atan2(0.02, 0.13), 0.3, 0.9, 0.6],
    ]
    found = singularity_over_log(ARM6, np.array([*singular, [0.4, 0.6, ELBOW, 0.3, 0.9, 0.6]]))
    assert found.determinant is not None
    # rounding of products of three lengths of 0.3 m
    np.testing.assert_allclose(found.determinant[:3], 0.0, atol=2e-17)
    np.testing.assert_allclose(found.manipulability[:3], 0.0, atol=2e-17)
    assert abs(found.determinant[3]) > 1e-5


# --- laws ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", robot_names())
@pytest.mark.parametrize("orientation", [True, False])
def test_they_are_what_numpy_says_pose_by_pose(name: str, orientation: bool) -> None:
    chain = load_robot(name)
    q = poses(chain, 20, 4)
    found = singularity_over_log(chain, q, orientation=orientation)
    rows = 6 if orientation else 3
    free = [joint.lower < joint.upper for joint in chain.moving]
    for k, jacobian in enumerate(jacobian_over_log(chain, q)[:, :rows, free]):
        scaled = jacobian.copy()
        scaled[:3] /= found.length
        expected = np.linalg.svd(scaled, compute_uv=False).min()
        assert found.smallest[k] == pytest.approx(expected, abs=1e-14)
        gram = jacobian @ jacobian.T if rows <= len(jacobian.T) else jacobian.T @ jacobian
        volume = math.sqrt(max(np.linalg.det(gram), 0.0))
        assert found.manipulability[k] == pytest.approx(volume, rel=1e-6)  # of a root of a difference
    if rows == sum(free):
        np.testing.assert_allclose(np.abs(there(found.determinant)), found.manipulability, rtol=1e-10)
    else:
        assert found.determinant is None


@pytest.mark.slow
@given(st.floats(0.01, 100.0), st.integers(0, 2**32 - 1))
def test_a_scale_model_is_as_near_to_singular(factor: float, seed: int) -> None:
    rows = (
        GeometricModelRow("R", "z", (0.0, 0.0, 0.3)),
        GeometricModelRow("T", "y", (0.1, 0.2, 0.0)),
        GeometricModelRow("R", "x", (0.2, 0.0, 0.4)),
        GeometricModelRow("R", "y", (0.0, 0.3, 0.1)),
        GeometricModelRow("R", "z", (0.1, 0.0, 0.0)),
        GeometricModelRow("R", "x", (0.0, 0.1, 0.2)),
    )
    larger = [replace(row, r=tuple(factor * value for value in row.r)) for row in rows]
    q = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, 6))
    one = singularity_over_log(geometric_chain("one", rows, tip=(0.0, 0.1, 0.1)), q)
    ways = q * np.array([1.0, factor, 1.0, 1.0, 1.0, 1.0])
    other = singularity_over_log(
        geometric_chain("other", larger, tip=(0.0, 0.1 * factor, 0.1 * factor)), ways
    )
    assert other.length == pytest.approx(factor * one.length, rel=1e-12)
    np.testing.assert_allclose(other.smallest, one.smallest, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(other.manipulability, factor**2 * one.manipulability, rtol=1e-9, atol=1e-300)


def test_rows_without_values_stay_without_and_stop_no_other() -> None:
    q = poses(ARM6, 4, 6)
    q[1, 2] = np.nan
    found, whole = singularity_over_log(ARM6, q), singularity_over_log(ARM6, q[[0, 2, 3]])
    for got, expected in [
        (found.smallest, whole.smallest),
        (found.manipulability, whole.manipulability),
        (found.determinant, whole.determinant),
    ]:
        assert got is not None
        assert np.isnan(got[1])
        np.testing.assert_array_equal(got[[0, 2, 3]], there(expected))
    assert singularity_over_log(ARM6, np.full((2, 6), np.nan)).smallest.shape == (2,)
    assert singularity_over_log(ARM6, np.empty((0, 6))).smallest.shape == (0,)


def test_another_length_weighs_ways_against_turns() -> None:
    q = poses(ARM6, 10, 7)
    metre = singularity_over_log(ARM6, q, length=1.0)
    expected = np.linalg.svd(jacobian_over_log(ARM6, q), compute_uv=False)[:, -1]
    np.testing.assert_allclose(metre.smallest, expected, rtol=1e-12)
    assert metre.length == 1.0


# --- joints that cannot move ----------------------------------------------------------------------


@pytest.mark.parametrize("orientation", [True, False])
def test_a_joint_whose_limits_are_equal_counts_as_if_it_were_fixed_there(orientation: bool) -> None:
    panda = replace(load_robot("panda"), inertials=())  # a joint with a mass may not lose its name
    q = poses(panda, 50, 8)
    q[:, 2] = 0.4
    locked, fixed = (
        replace(panda, joints=(*panda.joints[:2], third, *panda.joints[3:]), start=())
        for third in (
            replace(panda.joints[2], lower=0.4, upper=0.4),
            Joint("fixed", "fixed", panda.joints[2].origin @ rotation_z(0.4)),
        )
    )
    found = singularity_over_log(locked, q, orientation=orientation, length=1.0)
    expected = singularity_over_log(fixed, np.delete(q, 2, axis=1), orientation=orientation, length=1.0)
    # rounding of a frame that is multiplied before instead of after: entries and products of about 1
    np.testing.assert_allclose(found.smallest, expected.smallest, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(found.manipulability, expected.manipulability, rtol=0.0, atol=1e-14)
    if orientation:  # six joints are left of seven
        np.testing.assert_allclose(
            there(found.determinant), there(expected.determinant), rtol=0.0, atol=1e-14
        )
    else:
        assert found.determinant is expected.determinant is None


def test_where_no_joint_can_move_all_count() -> None:
    statue = replace(ARM6, joints=tuple(replace(joint, lower=0.0, upper=0.0) for joint in ARM6.joints))
    q = poses(ARM6, 5, 9)
    found, whole = singularity_over_log(statue, q), singularity_over_log(ARM6, q)
    np.testing.assert_array_equal(found.smallest, whole.smallest)
    np.testing.assert_array_equal(there(found.determinant), there(whole.determinant))


# --- the characteristic length ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "length"),
    [
        ("arm6", 0.03 + 0.12 + 0.02 + 0.13 + 0.029),
        ("articulated6r", 0.45 + 0.4 + 0.15),
        ("ur5", 0.425 + 0.39225 + 0.10915 + 0.09465 + 0.0823),
        ("panda", 0.316 + 0.0825 + 0.0825 + 0.384 + 0.088 + 0.107),
    ],
)
def test_the_length_is_that_of_the_links_after_the_first_axis(name: str, length: float) -> None:
    chain = load_robot(name)
    assert characteristic_length(chain) == pytest.approx(length, rel=1e-14)
    longer = chain.placed(from_offset((1.0, 2.0, 3.0, 0.4, 0.5, 0.6)), translation(0.0, 0.0, 0.25))
    assert characteristic_length(longer) == pytest.approx(length + 0.25, rel=1e-14)


SKEW = dh_chain(
    "skew",
    [
        DHRow(d=0.3, a=0.4, alpha=0.7),
        DHRow(theta=0.5, d=-0.2, a=-0.5, alpha=-1.2),
        DHRow(theta=-0.9, d=0.6, a=0.25, alpha=2.0),
        DHRow(theta=1.1, d=-0.35, a=0.15, alpha=0.4),
    ],
)
"""An arm whose axes pass each other at any angle."""


def test_between_skew_axes_it_is_the_sum_of_the_parameters_of_denavit_and_hartenberg() -> None:
    # 0.4 + 0.5 + 0.25 between the axes, 0.2 + 0.6 along the second and the third; the last is the tip's
    assert characteristic_length(SKEW) == pytest.approx(1.95 + math.hypot(0.35, 0.15), rel=1e-14)


@pytest.mark.parametrize("name", ["panda", "ur5", "arm6", "skew"])
def test_it_does_not_ask_where_frames_stand_or_where_joints_are_zero(name: str) -> None:
    chain = SKEW if name == "skew" else load_robot(name)
    shifts = [translation(0.0, 0.0, 0.1 * k) @ rotation_z(0.3 * k) for k in range(len(chain.joints))]
    before = [Transform(), *(shift.inverse() for shift in shifts)]
    joints = tuple(
        replace(joint, origin=back @ joint.origin @ shift)
        for joint, back, shift in zip(chain.joints, before, shifts, strict=False)
    )
    moved = replace(chain, joints=joints, tip=shifts[-1].inverse() @ chain.tip)
    assert characteristic_length(moved) == pytest.approx(characteristic_length(chain), rel=1e-13)


def test_axes_that_were_meant_to_be_parallel_are() -> None:
    leaning = Joint("second", origin=from_offset([0.4, 0.0, 0.0, 0.0, 1e-4, 0.0]))  # they meet 4 km away
    chain = Chain("calibrated", (Joint("first"), leaning), tip=translation(0.3, 0.0, 0.0))
    assert characteristic_length(chain) == pytest.approx(0.7, rel=1e-6)


def test_axes_are_parallel_below_a_sine_of_a_tenth_not_from_it_on() -> None:
    """At 0.1 the axes meet 3 m down the first one: the way to the tip is longer than the 0.3 m across."""
    for lean, length in ((MAX_PARALLEL_SINE, 3.0), (MAX_PARALLEL_SINE - 1e-9, 0.3)):
        axis = (lean, 0.0, math.sqrt(1.0 - lean * lean))
        turns = (Joint("first"), Joint("second", origin=translation(0.3, 0.0, 0.0), axis=axis))
        assert characteristic_length(Chain("leaning", turns)) == pytest.approx(length, rel=0.02)


def test_arms_of_few_axes() -> None:
    turn, slide, far = Joint("turn"), Joint("slide", "prismatic"), translation(0.3, 0.4, 5.0)
    follower = Joint("follow", origin=translation(0.5, 0.0, 0.0), mimic=Mimic("turn", 2.0))
    assert characteristic_length(Chain("one", (turn,), tip=far)) == 0.5
    assert characteristic_length(Chain("slider", (slide,), tip=far)) == 1.0
    assert characteristic_length(Chain("point", (turn,))) == 1.0
    assert characteristic_length(Chain("two", (turn, follower), tip=translation(0.2, 0.0, 0.0))) == 0.7
