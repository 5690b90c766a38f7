"""[Serial6dof2019]_: the printed numbers of section 6, and the equations of sections 3 and 4.

The paper prints millimetres and radians with four decimals. Its forward rows start from angles with four
decimals, which are typed in here as they stand, so that a result differs by half a unit of its last decimal.
Its inverse solutions are printed with four decimals, too, and bring the tool to the target only so far.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from serial_6dof_rows import INVERSE, UPSIDE
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import iter_frames, poses_over_log, tip_pose
from urmpipe_models.math3d import Transform, euler_zyx, from_rpy
from urmpipe_models.robots.catalogue import load_robot

ARM = load_robot("arm6")

PRINTED = 5e-5
"""Half a unit of the last printed decimal, in [mm] and [rad]."""

ROUNDING = 1e-15
"""Eight products of matrices with entries of up to 1."""

TABLE_3_1 = [  # frame, alpha_{i-1}, a_{i-1} [mm], d_i [mm], theta_i at 0, which theta moves it
    ("1", 0.0, 0.0, 47.0, 0.0, 0),
    ("2'", 0.0, -30.0, 45.0, 0.0, None),
    ("2", math.pi / 2, 0.0, 0.0, 0.0, 1),
    ("3", 0.0, 120.0, 0.0, math.pi / 2, 2),
    ("4", -math.pi / 2, 20.0, 0.0, 0.0, 3),
    ("5'", 0.0, 0.0, 130.0, 0.0, None),
    ("5", math.pi / 2, 0.0, 0.0, 0.0, 4),
    ("6", -math.pi / 2, 0.0, 29.0, 0.0, 5),
]

# fmt: off
FORWARD = [  # section 6.1, the seven re-entered rows: theta1..theta6, then x, y, z, alpha, beta, gamma
    ([-3.1416, -1.1547, -0.4276, 3.1416, 1.5593, 0.0],
     [-68.9973, 0.0003, 112.0003, 3.1301, -1.5708, -3.1301]),
    ([-3.1416, -1.1547, -0.4276, 0.0, -1.5593, 3.1416],
     [-68.9973, 0.0005, 112.0003, 2.3562, -1.5708, -2.3562]),
    ([-3.1416, 1.7113, 0.7329, 0.0, 0.6974, 3.1416],
     [-68.9981, 0.0005, 111.9985, 0.7854, -1.5708, -0.7854]),
    ([-3.1416, 1.7113, 0.7329, -3.1416, -0.6974, 0.0],
     [-68.9981, 0.0004, 111.9985, -0.6540, -1.5708, 0.6540]),
    ([0.0, 0.0, 0.0, 3.1416, 0.0, 3.1416],
     [-69.0, 0.0, 112.0, 1.5708, -1.5708, -1.5708]),
    ([0.0, 4.0689, 0.3053, 0.0, 1.9090, 0.0],
     [-69.0004, 0.0, 111.9995, 3.1416, -1.5708, -3.1416]),
    ([0.0, 4.0689, 0.3053, 3.1416, -1.9090, 3.1416],
     [-69.0004, -0.0002, 111.9995, 2.8192, -1.5708, -2.8191]),
]
# fmt: on


def equation_3_1(alpha: float, a: float, d: float, theta: float) -> FloatArray:
    ct, st, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    return np.array(
        [
            [ct, -st, 0.0, a],
            [st * ca, ct * ca, -sa, -sa * d],
            [st * sa, ct * sa, ca, ca * d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def homogeneous(frame: Transform) -> FloatArray:
    """Return a frame with its translation in [mm]."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = frame.rotation, np.multiply(frame.translation, 1e3)
    return result


def some_poses(count: int) -> list[list[float]]:
    values: list[list[float]] = np.random.default_rng(8).uniform(-math.pi, math.pi, (count, 6)).tolist()
    return values


def turned(alpha: float, beta: float, gamma: float) -> FloatArray:
    """Return Rz(alpha) Ry(beta) Rx(gamma): alpha turns about Z, gamma about X in this paper."""
    return np.array(from_rpy(gamma, beta, alpha).rotation, dtype=float)


# --- section 3 -------------------------------------------------------------------------------------


def test_eq_3_1_and_3_2_with_table_3_1_are_the_frames_of_the_arm() -> None:
    for q in some_poses(20):
        product = np.eye(4)
        _, *links = iter_frames(ARM, q)
        for (_, alpha, a, d, theta, moves), link in zip(TABLE_3_1, links, strict=True):
            product = product @ equation_3_1(alpha, a, d, theta + (0.0 if moves is None else q[moves]))
            # entries of up to 1, and 330 mm
            np.testing.assert_allclose(homogeneous(link), product, rtol=0.0, atol=400 * ROUNDING)
        np.testing.assert_allclose(homogeneous(tip_pose(ARM, q)), product, rtol=0.0, atol=400 * ROUNDING)


def test_the_default_position() -> None:
    tip = tip_pose(ARM, [0.0] * 6)
    np.testing.assert_allclose(np.multiply(tip.translation, 1e3), [-69.0, 0.0, 112.0], rtol=0.0, atol=1e-13)
    # beta = -pi/2: alpha and gamma are a choice, which is another one in the paper; the rotation is none
    *_, singular = euler_zyx(tip.rotation)
    assert singular
    np.testing.assert_allclose(
        tip.rotation, turned(*UPSIDE), rtol=0.0, atol=2 * PRINTED
    )  # two angles turn one


@pytest.mark.parametrize("row", range(7))
def test_the_re_entered_forward_rows(row: int) -> None:
    q, printed = FORWARD[row]
    tip = tip_pose(ARM, q)
    np.testing.assert_allclose(np.multiply(tip.translation, 1e3), printed[:3], rtol=0.0, atol=PRINTED)
    alpha, beta, gamma, singular = euler_zyx(tip.rotation)
    assert beta == pytest.approx(printed[4], abs=PRINTED)
    assert not singular  # 3.1416 is not pi: beta is some 1e-5 from -pi/2, and alpha and gamma are told
    got = np.array([alpha, gamma])
    apart = np.remainder(got - (printed[3], printed[5]) + math.pi, 2.0 * math.pi) - math.pi
    np.testing.assert_allclose(apart, 0.0, atol=PRINTED)


# --- section 4 -------------------------------------------------------------------------------------


def test_eq_4_3_is_the_wrist_centre() -> None:
    for q in some_poses(20):
        *_, frame5, _ = iter_frames(ARM, q)
        tip = tip_pose(ARM, q)
        centre = np.array(tip.translation) - np.array(tip.rotation) @ (0.0, 0.0, 0.029)
        np.testing.assert_allclose(frame5.translation, centre, rtol=0.0, atol=ROUNDING)


def test_eq_4_6_turns_the_position_the_other_way_back() -> None:
    for q in some_poses(20):
        frame3 = list(iter_frames(ARM, q))[4]
        rotation: FloatArray = np.array(frame3.rotation)
        position: FloatArray = np.array(frame3.translation)
        back = frame3.inverse().translation
        np.testing.assert_allclose(back, -rotation.T @ position, rtol=0.0, atol=ROUNDING)
        assert np.abs(back - rotation.T @ position).max() > 0.01  # as printed, without the minus


def test_eq_4_7_is_frame_6_in_frame_3() -> None:
    a4, d5, d6 = 0.020, 0.130, 0.029
    for q in some_poses(20):
        _, _, _, t4, t5, t6 = q
        c4, c5, c6, s4, s5, s6 = (*map(math.cos, (t4, t5, t6)), *map(math.sin, (t4, t5, t6)))
        expected = np.array(
            [
                [c4 * c5 * c6 - s4 * s6, -c4 * c5 * s6 - s4 * c6, -c4 * s5],
                [s5 * c6, -s5 * s6, c5],
                [-s4 * c5 * c6 - c4 * s6, s4 * c5 * s6 - c4 * c6, s4 * s5],
            ]
        )
        found = list(iter_frames(ARM, q))[4].inverse() @ tip_pose(ARM, q)
        np.testing.assert_allclose(found.rotation, expected, rtol=0.0, atol=ROUNDING)
        translation = [-d6 * c4 * s5 + a4, d6 * c5 + d5, d6 * s4 * s5]
        np.testing.assert_allclose(found.translation, translation, rtol=0.0, atol=ROUNDING)


def test_eq_4_7_as_printed_is_not() -> None:
    """Entry (1,2) holds c6 for c5."""
    t4, t5, t6 = np.array(some_poses(20)).T[3:]
    printed = -np.cos(t4) * np.cos(t6) * np.sin(t6) - np.sin(t4) * np.cos(t6)
    right = -np.cos(t4) * np.cos(t5) * np.sin(t6) - np.sin(t4) * np.cos(t6)
    assert np.abs(printed - right).max() > 0.5


# --- section 6 -------------------------------------------------------------------------------------


@pytest.mark.parametrize("section", list(INVERSE))
def test_every_printed_solution_brings_the_tool_to_its_target(section: str) -> None:
    """Those at theta5 = 0, too, where the split between theta4 and theta6 is a choice."""
    target, solutions = INVERSE[section]
    q = np.array([solution for solution in solutions if not np.isnan(solution).any()])
    position, rotation = poses_over_log(ARM, q)
    # six angles of four decimals, each at a lever of up to 330 mm, and a target of four decimals
    farthest = 6 * PRINTED * 330.0
    np.testing.assert_allclose(position * 1e3, np.tile(target[:3], (len(q), 1)), rtol=0.0, atol=farthest)
    expected = np.tile(turned(*target[3:]), (len(q), 1, 1))
    np.testing.assert_allclose(rotation, expected, rtol=0.0, atol=8 * PRINTED)  # six angles and two


def test_the_arm_stretched_upwards_is_372_5294643797_mm_high() -> None:
    """Section 6.5 takes a2 for 130 mm; it is 120."""
    lean = math.atan2(20.0, 130.0)  # between the forearm's axis 4 and the line from elbow to wrist
    q = [0.0, math.pi / 2, lean - math.pi, 0.0, -lean, 0.0]
    *_, frame5, _ = iter_frames(ARM, q)
    shoulder, elbow = (-0.03, 0.0, 0.092), (-0.03, 0.0, 0.212)
    assert math.dist(elbow, frame5.translation) * 1e3 == pytest.approx(131.52946438, abs=1e-8)  # as printed
    assert math.dist(shoulder, frame5.translation) * 1e3 == pytest.approx(251.52946438, abs=1e-8)
    tip = tip_pose(ARM, q)
    np.testing.assert_allclose(tip.rotation[2], (0.0, 0.0, 1.0), rtol=0.0, atol=ROUNDING)  # upright
    highest = (-30.0, 0.0, 372.5294643797)
    np.testing.assert_allclose(np.multiply(tip.translation, 1e3), highest, rtol=0.0, atol=1e-10)
