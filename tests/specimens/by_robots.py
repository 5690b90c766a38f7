"""Logs as controllers and recorders of robots write them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from by_python import comma, writer
from specimen import DEG, Made, Truth, degrees, lines, made, motion, rounding, specimen
from urmpipe_models.elementwise import FloatArray

UR = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
BY_ALPHABET = (2, 1, 0, 3, 4, 5)
"""Where each joint of a UR stands when its driver sorts their names: elbow, shoulder lift, shoulder pan."""
EPOCH = 1_618_172_841
"""2021-04-11 20:27:21 UTC."""


def _rtde(separator: str, *, timed: bool) -> tuple[str, Truth]:
    """Return the table of the RTDE client's recorder: asked for and measured joints, and the tool's pose."""
    truth, asked = motion(20, robot="ur5e"), motion(20, begin=0.008)
    pose = np.column_stack((truth.tool, np.round(truth.turn.as_rotvec(), 9)))
    groups = (("target_q", asked.q), ("actual_q", truth.q), ("actual_TCP_pose", pose))
    names = [f"{group}_{k}" for group, _ in groups for k in range(6)]
    values = np.column_stack([truth.t, *(columns for _, columns in groups)])
    start = 5000.0
    values[:, 0] = np.round(values[:, 0] + start, 6)
    names = ["timestamp", *names] if timed else names
    rows = [separator.join(str(v) for v in (row if timed else row[1:])) for row in values.tolist()]
    return lines(separator.join(names), *rows, end="\r\n"), replace(truth, start=start if timed else 0.0)


@specimen
def ur_rtde_spaces() -> Made:
    """UR RTDE recorder: spaces, CR LF, target_q_0.., actual_q_0.., actual_TCP_pose_0.. (rotation vector)."""
    text, truth = _rtde(" ", timed=True)
    return made("ur_rtde_spaces.csv", text, truth)


@specimen
def ur_rtde_commas() -> Made:
    """UR RTDE recorder with commas."""
    text, truth = _rtde(",", timed=True)
    return made("ur_rtde_commas.csv", text, truth)


@specimen
def ur_rtde_no_time() -> Made:
    """UR RTDE recorder without a timestamp."""
    text, truth = _rtde(" ", timed=False)
    return made("ur_rtde_no_time.csv", text, truth)


@specimen
def rostopic_joint_states() -> Made:
    """rostopic echo -p /joint_states: %time in ns, names as cells, by the alphabet, positions likewise."""
    truth, order = motion(20), list(BY_ALPHABET)
    stamps = np.rint(truth.t * 1e9).astype(int) + EPOCH * 10**9 + 123_456_789
    header = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
    header += [f"field.{group}{k}" for group in ("name", "position", "velocity") for k in range(6)]
    names = [UR[j] for j in BY_ALPHABET]
    rows = [
        [stamp, 40 + i, stamp - 5000, "", *names, *q[order], *qd[order]]
        for i, (stamp, q, qd) in enumerate(zip(stamps.tolist(), truth.q, truth.rates, strict=True))
    ]
    text = lines(",".join(header), *(",".join(map(str, row)) for row in rows))
    return made("rostopic_joint_states.csv", text, replace(truth, start=EPOCH + 0.123456789))


@specimen
def rostopic_pose() -> Made:
    """rostopic echo -p of a PoseStamped: field.pose.position.x.., field.pose.orientation.x..w; no joints."""
    truth = motion(robot="ur5e")
    stamps = np.rint(truth.t * 1e9).astype(int) + EPOCH * 10**9
    header = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
    header += [f"field.pose.position.{a}" for a in "xyz"] + [f"field.pose.orientation.{a}" for a in "xyzw"]
    pose = np.column_stack((truth.tool, np.round(truth.turn.as_quat(), 9)))
    rows = [
        [stamp, i, stamp, "base", *values]
        for i, (stamp, values) in enumerate(zip(stamps.tolist(), pose.tolist(), strict=True))
    ]
    text = lines(",".join(header), *(",".join(map(str, row)) for row in rows))
    none = np.empty((len(truth.t), 0))
    return made("rostopic_pose.csv", text, replace(truth, start=float(EPOCH), q=none, turned=none, qd=None))


def ros2_row(t: float, names: Sequence[str], q: Sequence[float]) -> str:
    """Return a JointState as ros2 topic echo --csv writes it, at 0.9 s past a second and t; rates are 0."""
    stamp = round(t * 1e9) + 900_000_000
    cells = [EPOCH + stamp // 10**9, stamp % 10**9, "", *names, *q, *[0.0] * len(q), *[0.0] * len(q)]
    return ",".join(map(str, cells))


@specimen
def ros2_echo_joint_states() -> Made:
    """ros2 topic echo --csv /joint_states: no header, s and ns apart, names in the rows by the alphabet."""
    truth = replace(motion(20), qd=None, start=EPOCH + 0.9)
    names = [UR[j] for j in BY_ALPHABET]
    rows = [ros2_row(t, names, q[list(BY_ALPHABET)].tolist()) for t, q in zip(truth.t, truth.q, strict=True)]
    return made("ros2_echo_joint_states.csv", lines(*rows), truth)


@specimen
def ros2_echo_with_gripper() -> Made:
    """ros2 topic echo --csv: the gripper's finger_joint stands among the arm's six (ur5e)."""
    truth = replace(motion(20), qd=None, start=EPOCH + 0.9)
    names = ["elbow_joint", "finger_joint", *(UR[j] for j in BY_ALPHABET[1:])]
    order = list(BY_ALPHABET[1:])
    rows = [
        ros2_row(t, names, [q[2], 0.4, *(q[j] for j in order)])
        for t, q in zip(truth.t, truth.q.tolist(), strict=True)
    ]
    return made("ros2_echo_with_gripper.csv", lines(*rows), truth)


@specimen
def ur_short_names() -> Made:
    """csv.DictWriter with sorted keys: base,elbow,shoulder,wrist1,wrist2,wrist3 in deg (UR)."""
    truth = replace(motion(24), q_within=rounding(6, DEG))
    order = [0, 2, 1, 3, 4, 5]
    rows = np.column_stack((truth.t, degrees(truth.q[:, order]))).tolist()
    header = [
        "time",
        *(f"{joint} [deg]" for joint in ("base", "elbow", "shoulder", "wrist1", "wrist2", "wrist3")),
    ]
    return made("ur_short_names.csv", writer([header, *rows]), truth)


@specimen
def plotjuggler_topics() -> Made:
    """PlotJuggler, export of two topics: __time in epoch seconds, every other row of the joints is empty."""
    truth = motion(30, 0.01)
    names = [f"/joint_states/{UR[j]}/position" for j in BY_ALPHABET]
    rows = []
    for i, (t, row) in enumerate(zip(truth.t, truth.q[:, list(BY_ALPHABET)], strict=True)):
        cells = [""] * 6 if i % 2 else [f"{v:.9f}" for v in row]
        rows.append(",".join([f"{EPOCH + t:.6f}", *cells, f"{20 + t:.6f}" if i % 2 else ""]))
    text = lines(",".join(["__time", *names, "/temperature/data"]), *rows)
    own = truth.q[::2]
    truth = replace(truth, t=truth.t[::2], q=own, turned=own, qd=None, start=float(EPOCH), t_within=2e-7)
    return made("plotjuggler_topics.csv", text, truth)


@specimen
def plotjuggler_padded_dates() -> Made:
    """PlotJuggler's quoted, padded dates: " 01/20/2021 10:11:32.332"; blanks before the values."""
    truth = replace(motion(20), q_within=rounding(6), start=1_611_137_492.332)
    rows = [
        f'" 01/20/2021 10:11:{32.332 + t:06.3f}", ' + ", ".join(f"{v:.6f}" for v in q)
        for t, q in zip(truth.t, truth.q, strict=True)
    ]
    return made("plotjuggler_padded_dates.csv", lines("timestamp,q1,q2,q3,q4,q5,q6", *rows), truth)


def krc_trace(q_written: FloatArray, truth: Truth) -> str:
    """Return a KUKA KRC trace: the tool in mm and degrees (A about Z, B about Y, C about X), and the axes."""
    abc = truth.turn.as_euler("ZYX", degrees=True)
    names = ["Zeit[sec]", "X_Act[mm]", "Y_Act[mm]", "Z_Act[mm]", "A_Act[°]", "B_Act[°]", "C_Act[°]"]
    names += [f"AxisPos_Act{k}[°]" for k in range(1, 7)]
    rows = zip(truth.t, np.column_stack((1000 * truth.tool, abc, q_written)), strict=True)
    return lines(
        ";".join(names), *(f"{t:.3f};" + ";".join(f"{v:.6f}" for v in row) for t, row in rows), end="\r\n"
    )


@specimen
def kuka_krc_trace() -> Made:
    """KUKA KRC trace: ; and Latin-1, Zeit[sec], X_Act[mm].., A_Act[°].., AxisPos_Act1[°].. (ur5e moves)."""
    truth = motion(20, 0.012, robot="ur5e").limited(-np.pi, np.pi)
    text = krc_trace(degrees(truth.q), truth)
    fine = replace(truth, q_within=rounding(6, DEG), position_within=rounding(6, 1e-3), rotation_within=1e-7)
    return made("kuka_krc_trace.csv", text, fine, "latin-1")


def _fri(truth: Truth, tail: Sequence[str]) -> list[str]:
    """Return rows of an FRI client's log."""
    rows = zip(truth.t + 0.015, truth.q, tail, strict=True)
    return [
        f"Time: {t:f}  q values: [" + ", ".join(f"{v:8.5f}" for v in q) + f"]{more}" for t, q, more in rows
    ]


@specimen
def kuka_fri() -> Made:
    """KUKA iiwa, FRI client: `Time: 0.015000  q values: [...]`, a blank line first."""
    truth = replace(motion(30, 0.003, joints=7), q_within=rounding(5), start=0.015)
    return made("kuka_fri.txt", lines("", *_fri(truth, [""] * 30)), truth)


@specimen
def kuka_fri_gains() -> Made:
    """KUKA iiwa, FRI client: a gains line first, p0 values (a virtual position) and gains behind each row."""
    truth = replace(motion(24, 0.015, joints=7), q_within=rounding(5), start=0.015)
    tail = [
        f" p0 values: [{0.6 + 0.01 * k:.5f}, 0.10551, 0.38457] Type: 0 K gains0.000000" for k in range(24)
    ]
    return made("kuka_fri_gains.txt", lines("K gains0.000000", *_fri(truth, tail)), truth)


@specimen
def libfranka() -> Made:
    """libfranka's logToCSV: time in ms, state.q[0].., state.q_d[0].., state.dq[0].. (Panda, 7 joints)."""
    truth, asked = motion(20, 0.001, joints=7), motion(20, 0.001, joints=7, begin=0.01)
    truth = replace(truth, q_within=rounding(8))
    names = ["time", "success_rate"]
    names += [f"{group}[{k}]" for group in ("state.q", "state.q_d", "state.dq") for k in range(7)]
    values = np.column_stack((truth.q, asked.q, truth.rates))
    rows = [
        f"{1000 * t:.0f},1," + ",".join(f"{v:.9g}" for v in row)
        for t, row in zip(truth.t, values, strict=True)
    ]
    return made("libfranka.csv", lines(",".join(names), *rows), truth)


@specimen
def libfranka_pose() -> Made:
    """libfranka's state.O_T_EE[0..15] beside state.q: a 4x4 matrix column by column (seven joints)."""
    truth = motion(20, 0.001, joints=7)
    moved = motion(20, 0.001, robot="ur5e")
    matrices = poses(moved).transpose(0, 2, 1).reshape(-1, 16)
    names = ["time", *(f"state.q[{k}]" for k in range(7)), *(f"state.O_T_EE[{k}]" for k in range(16))]
    values = np.column_stack((truth.q, matrices))
    rows = [
        f"{1000 * t:.0f}," + ",".join(f"{v:.9g}" for v in row) for t, row in zip(truth.t, values, strict=True)
    ]
    truth = replace(truth, q_within=rounding(8), position=moved.tool, rotation=moved.turn)
    return made("libfranka_pose.csv", lines(",".join(names), *rows), truth)


def poses(truth: Truth, unit: float = 1.0) -> FloatArray:
    """Return the tool's 4x4 matrices, shape (n, 4, 4), lengths in a unit."""
    matrices = np.tile(np.eye(4), (len(truth.t), 1, 1))
    matrices[:, :3, :3] = np.round(truth.turn.as_matrix(), 9)
    matrices[:, :3, 3] = np.round(truth.tool / unit, 9)
    return matrices


@specimen
def abb() -> Made:
    """ABB: `timestamp, cmd_num, J1, ..., J6` in deg, each row twice (slow controller), a gap of 135 ms."""
    moved = motion(15, 0.02)
    q, times = np.repeat(moved.q, 2, axis=0), np.round(np.arange(30) * 0.01, 9)
    times[20:] += 0.125
    start = 1_618_172_841.5
    rows = [
        f"{start + t:.6f}, {i // 10}, " + ", ".join(f"{v:.3f}" for v in degrees(row, 3))
        for i, (t, row) in enumerate(zip(times, q, strict=True))
    ]
    truth = Truth(times, q, q, q_within=rounding(3, DEG), t_within=2e-6, start=start)
    return made("abb.csv", lines("timestamp, cmd_num, J1, J2, J3, J4, J5, J6", *rows), truth)


@specimen
def mixed_units() -> Made:
    """A lab's own header with a unit a column: rail [mm], q1 [rad], q2 [deg], ... q5 [deg]."""
    truth = motion()
    q = truth.q.copy()
    q[:, 0] = np.round(0.4 + 0.1 * q[:, 0], 6)
    written = np.column_stack((truth.t, 1000 * q[:, 0], q[:, 1], degrees(q[:, 2:])))
    header = "time [s],q1 [mm],q2 [rad],q3 [deg],q4 [deg],q5 [deg],q6 [deg]"
    rows = [",".join(f"{v:.9g}" for v in row) for row in written]
    truth = replace(truth, q=q, turned=q, q_within=rounding(6, DEG), qd=None)
    return made("mixed_units.csv", lines(header, *rows), truth)


@specimen
def joint_names_any_order() -> Made:
    """csv.DictWriter with the robot's own joint names, sorted: elbow_joint, shoulder_lift_joint, ... (UR)."""
    truth = motion()
    rows = np.column_stack((truth.t, truth.q[:, list(BY_ALPHABET)])).tolist()
    text = writer([["time", *(UR[j] for j in BY_ALPHABET)], *rows])
    return made("joint_names_any_order.csv", text, truth)


@specimen
def cad_path_mm() -> Made:
    """A path from a CAD system: X [mm];Y [mm];Z [mm] with decimal commas, no time, no joints."""
    truth = motion(40, robot="urm6")
    rows = [";".join(comma(v, 4) for v in row) for row in 1000 * truth.tool]
    none = np.empty((40, 0))
    truth = replace(truth, q=none, turned=none, qd=None, rotation=None, position_within=rounding(4, 1e-3))
    return made("cad_path_mm.csv", lines("X [mm];Y [mm];Z [mm]", *rows), truth)


@specimen
def cad_path_no_header() -> Made:
    """A path as points: three columns of numbers in mm between blanks, no header, no time."""
    truth = motion(40, robot="urm6")
    rows = [" ".join(f"{v:.3f}" for v in row) for row in 1000 * truth.tool]
    none = np.empty((40, 0))
    truth = replace(truth, q=none, turned=none, qd=None, rotation=None, position_within=rounding(3, 1e-3))
    return made("cad_path_no_header.xyz", lines(*rows), truth)
