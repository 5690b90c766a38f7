"""Logs with the tool centre point beside the joints (ur5e), each in another form that people write."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from by_python import Q6, writer
from by_robots import poses
from specimen import DEG, Made, Truth, degrees, made, motion, rounding, specimen
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.robots.catalogue import load_robot


def _arm(rows: int = 16) -> tuple[Truth, FloatArray]:
    """Return the ur5e's motion, and where its tool is in [m]."""
    truth = replace(motion(rows, robot="ur5e"), qd=None)
    return truth, truth.tool


def beside(name: str, columns: Sequence[str], tool: FloatArray, truth: Truth) -> Made:
    """Return a log of t, q1..q6 in rad and the columns of the tool."""
    rows = np.column_stack((truth.t, truth.q, np.round(tool, 9))).tolist()
    return made(f"{name}.csv", writer([["t", *Q6, *columns], *rows]), truth)


@specimen
def tcp_xyz_m() -> Made:
    """x,y,z without a unit, in m."""
    truth, p = _arm()
    return beside("tcp_xyz_m", "xyz", p, replace(truth, rotation=None))


@specimen
def tcp_xyz_mm() -> Made:
    """TCP_X,TCP_Y,TCP_Z without a unit, in mm: further than any arm reaches in m."""
    truth, p = _arm()
    return beside("tcp_xyz_mm", ["TCP_X", "TCP_Y", "TCP_Z"], 1000 * p, replace(truth, rotation=None))


@specimen
def tcp_rotation_vector() -> Made:
    """tcp_x..tcp_z, tcp_rx..tcp_rz: a rotation vector in rad, as the joints' motion confirms."""
    truth, p = _arm()
    names = [f"tcp_{word}" for word in ("x", "y", "z", "rx", "ry", "rz")]
    return beside("tcp_rotation_vector", names, np.column_stack((p, truth.turn.as_rotvec())), truth)


@specimen
def tcp_rx_ry_rz_are_euler() -> Made:
    """The same names, but rx, ry, rz are angles about x, y, z (Rz Ry Rx): only the kinematics tell."""
    truth, p = _arm()
    names = [f"tcp_{word}" for word in ("x", "y", "z", "rx", "ry", "rz")]
    return beside("tcp_rx_ry_rz_are_euler", names, np.column_stack((p, truth.turn.as_euler("xyz"))), truth)


@specimen
def tcp_rotation_vector_flips() -> Made:
    """UR pose vector that changes sign at an angle of pi: actual_TCP_pose_3..5 jump, the tool does not."""
    truth, p = _arm(20)
    vectors = truth.turn.as_rotvec()
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    vectors[10:] -= (2 * np.pi / angle * vectors)[10:]  # the same turn the other way round
    names = [f"actual_TCP_pose_{k}" for k in range(6)]
    return beside("tcp_rotation_vector_flips", names, np.column_stack((p, vectors)), truth)


@specimen
def tcp_kuka_abc() -> Made:
    """X [mm],Y [mm],Z [mm],A [deg],B [deg],C [deg]: KUKA's angles, A about Z, B about Y, C about X."""
    truth, p = _arm()
    names = [*(f"{a} [mm]" for a in "XYZ"), *(f"{a} [deg]" for a in "ABC")]
    return beside(
        "tcp_kuka_abc", names, np.column_stack((1000 * p, truth.turn.as_euler("ZYX", degrees=True))), truth
    )


@specimen
def tcp_roll_pitch_yaw() -> Made:
    """x,y,z,roll,pitch,yaw in m and rad: Rz(yaw) Ry(pitch) Rx(roll)."""
    truth, p = _arm()
    names = ["x", "y", "z", "roll", "pitch", "yaw"]
    return beside("tcp_roll_pitch_yaw", names, np.column_stack((p, truth.turn.as_euler("xyz"))), truth)


@specimen
def tcp_yaw_pitch_roll_deg() -> Made:
    """ee_x..ee_z, then yaw [deg], pitch [deg], roll [deg]: the other order of columns, the same rotation."""
    truth, p = _arm()
    names = ["ee_x", "ee_y", "ee_z", "yaw [deg]", "pitch [deg]", "roll [deg]"]
    return beside(
        "tcp_yaw_pitch_roll_deg", names, np.column_stack((p, truth.turn.as_euler("ZYX", degrees=True))), truth
    )


@specimen
def tcp_quaternion_xyzw() -> Made:
    """x,y,z,qx,qy,qz,qw: the scalar last (ROS, scipy, TUM)."""
    truth, p = _arm()
    names = ["x", "y", "z", "qx", "qy", "qz", "qw"]
    return beside("tcp_quaternion_xyzw", names, np.column_stack((p, truth.turn.as_quat())), truth)


@specimen
def tcp_quaternion_wxyz() -> Made:
    """tcp_x..tcp_z, tcp_qw,tcp_qx,tcp_qy,tcp_qz: the scalar first (Eigen's constructor, MuJoCo, ABB)."""
    truth, p = _arm()
    names = [f"tcp_{word}" for word in ("x", "y", "z", "qw", "qx", "qy", "qz")]
    wxyz = truth.turn.as_quat()[:, [3, 0, 1, 2]]
    return beside("tcp_quaternion_wxyz", names, np.column_stack((p, wxyz)), truth)


@specimen
def tcp_quaternion_numbered() -> Made:
    """ABB's x,y,z in mm with rot_q1..rot_q4: q1 is the scalar."""
    truth, p = _arm()
    names = ["x [mm]", "y [mm]", "z [mm]", *(f"rot_q{k}" for k in range(1, 5))]
    wxyz = truth.turn.as_quat()[:, [3, 0, 1, 2]]
    return beside("tcp_quaternion_numbered", names, np.column_stack((1000 * p, wxyz)), truth)


@specimen
def tcp_ros_names() -> Made:
    """/tcp/pose/position/x.. and /tcp/pose/orientation/x..w beside the joints (PlotJuggler's names)."""
    truth, p = _arm()
    names = [f"/tcp/pose/position/{a}" for a in "xyz"] + [f"/tcp/pose/orientation/{a}" for a in "xyzw"]
    return beside("tcp_ros_names", names, np.column_stack((p, truth.turn.as_quat())), truth)


@specimen
def tcp_matrix_16() -> Made:
    """T00,T01,...,T33: a 4x4 matrix row by row, lengths in m."""
    truth, _ = _arm()
    names = [f"T{row}{column}" for row in range(4) for column in range(4)]
    return beside("tcp_matrix_16", names, poses(truth).reshape(-1, 16), truth)


@specimen
def tcp_matrix_16_mm() -> Made:
    """T_0..T_15: a 4x4 matrix row by row, lengths in mm, not said."""
    truth, _ = _arm()
    names = [f"T_{k}" for k in range(16)]
    return beside("tcp_matrix_16_mm", names, poses(truth, 1e-3).reshape(-1, 16), truth)


@specimen
def tcp_matrix_12() -> Made:
    """r11,r12,r13,px,r21,...,r33,pz: the upper three rows of the matrix."""
    truth, _ = _arm()
    names = [name for row, a in enumerate("xyz", 1) for name in (f"r{row}1", f"r{row}2", f"r{row}3", f"p{a}")]
    return beside("tcp_matrix_12", names, poses(truth)[:, :3].reshape(-1, 12), truth)


@specimen
def tcp_matrix_no_header() -> Made:
    """pybotics' form: `# joints[:ndof], pose[-16:]`, six joints in deg, then 4x4 in mm; no names, no time."""
    truth, _ = _arm()
    truth = truth.limited(-np.pi, np.pi)
    values = np.column_stack((degrees(truth.q), poses(truth, 1e-3).reshape(-1, 16))).tolist()
    text = "# joints[:ndof], pose[-16:]\n" + writer(values, lineterminator="\n")
    fine = replace(truth, q_within=rounding(6, DEG))
    return made("tcp_matrix_no_header.csv", text, fine)


@specimen
def tcp_tells_degrees() -> Made:
    """q1..q6 in deg, slow and small, no unit: as rad they were possible, only the recorded tool tells."""
    slow = motion(24, 0.2, robot="ur5e")
    q = np.round(0.03 * slow.q, 9)
    truth = replace(slow, q=q, turned=q, qd=None, rotation=None, q_within=rounding(6, DEG))
    p = _tool(q)
    rows = np.column_stack((truth.t, degrees(q), p)).tolist()
    text = writer([["t", *Q6, "x [m]", "y [m]", "z [m]"], *rows])
    return made("tcp_tells_degrees.csv", text, replace(truth, position=p))


def _tool(q: FloatArray) -> FloatArray:
    """Return where the ur5e's tool is in [m]."""
    return np.round(positions_over_log(load_robot("ur5e"), q), 9)


@specimen
def tcp_from_another_base() -> Made:
    """x,y,z in the cell's frame: 1.5 m beside and 0.8 m above the arm's base, joints in rad."""
    truth, p = _arm()
    moved = np.round(p + np.array([1.5, -0.25, 0.8]), 9)
    return beside("tcp_from_another_base", "xyz", moved, replace(truth, position=moved, rotation=None))


def _wrapped(name: str, low: float, high: float) -> Made:
    """Return a longer log whose joints are limited to an interval in [deg], said in the header."""
    truth = replace(motion(40, 0.05).limited(low * DEG, high * DEG), qd=None, q_within=rounding(6, DEG))
    rows = np.column_stack((truth.t, degrees(truth.q))).tolist()
    return made(f"{name}.csv", writer([["t", *(f"q{k} [deg]" for k in range(1, 7))], *rows]), truth)


@specimen
def wrap_180() -> Made:
    """Encoders that show -180..180 deg."""
    return _wrapped("wrap_180", -180, 180)


@specimen
def wrap_360() -> Made:
    """Encoders that show 0..360 deg."""
    return _wrapped("wrap_360", 0, 360)


@specimen
def wrap_270() -> Made:
    """Encoders that show -90..270 deg."""
    return _wrapped("wrap_270", -90, 270)


@specimen
def wrap_pi() -> Made:
    """Encoders that show -pi..pi, rad not said."""
    truth = replace(motion(40, 0.05).limited(-np.pi, np.pi), qd=None)
    rows = np.column_stack((truth.t, truth.q)).tolist()
    return made("wrap_pi.csv", writer([["t", *Q6], *rows]), truth)


@specimen
def wrap_two_turns() -> Made:
    """Joints that show -2 pi..2 pi, as some controllers do, and pass the end: a step of 4 pi (rad said)."""
    moved = motion(40, 0.05)
    q = moved.q + np.array([0, 0, 0, 0, 1.4, -1.6]) * np.pi / 2
    wide = replace(moved, q=np.round(q, 9), turned=np.round(q, 9), qd=None).limited(-2 * np.pi, 2 * np.pi)
    rows = np.column_stack((wide.t, wide.q)).tolist()
    return made("wrap_two_turns.csv", writer([["t", *(f"q{k} [rad]" for k in range(1, 7))], *rows]), wide)
