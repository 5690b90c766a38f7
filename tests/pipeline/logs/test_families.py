"""Families of names: taken whole, or asked about."""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log

Read = Callable[..., JointLog]

T = np.arange(60) / 50


def table(names: str, sign: str = ",") -> str:
    """Return a table of smooth columns, the time first where its name says so."""
    columns = names.split()
    values = [np.round(0.8 * np.sin(T * (1 + 0.3 * k) + k), 6) for k in range(len(columns))]
    if columns[0] in ("t", "time", "timestamp"):
        values[0] = T
    return "\n".join(
        [sign.join(columns), *(sign.join(map(repr, row)) for row in np.transpose(values).tolist())]
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "joints", "rates"),
    [
        # families whose names share a word, whatever else is in them
        ("t wrist_angle_pos elbow_pos shoulder_pos", "2 3 4", ""),
        ("t waist_pos elbow_pos wrist_angle_pos waist_vel elbow_vel wrist_angle_vel", "2 3 4", "5 6 7"),
        ("t angle_rad_base angle_rad_elbow angle_rad_wrist", "2 3 4", ""),
        ("t pos_1 pos_2 vel_1 vel_2 eff_1 eff_2", "2 3", "4 5"),
        # Interbotix
        ("time waist shoulder elbow forearm_roll wrist_angle wrist_rotate gripper left_finger",
         "2 3 4 5 6 7", ""),
        ("time wrist_rotate wrist_angle waist shoulder elbow gripper", "4 5 6 3 2", ""),
        # LeRobot
        ("time shoulder_pan.pos shoulder_lift.pos elbow_flex.pos wrist_flex.pos wrist_roll.pos gripper.pos",
         "2 3 4 5 6", ""),
        ("timestamp frame_index observation.state_1 observation.state_2 action_1 action_2", "3 4", ""),
        ("timestamp action.a.pos action.b.pos observation.a.pos observation.b.pos", "4 5", ""),
        # RAPID
        ("time robax.rax_1 robax.rax_2 robax.rax_3 extax.eax_a extax.eax_b", "2 3 4", ""),
        ("time;rax_1;rax_2;rax_3;eax_a", "2 3 4", ""),
        # asked for and done
        ("t q_des_1 q_des_2 q_act_1 q_act_2", "4 5", ""),
        ("t q1_des q2_des q1_act q2_act", "4 5", ""),
        ("t qdes1 qdes2 qact1 qact2", "4 5", ""),
        ("t q_des_1 q_des_2 tau_1 tau_2", "2 3", ""),
        # a unit inside a name
        ("t joint_rad_1 joint_rad_2", "2 3", ""),
        ("t q_rad_1 q_rad_2 qd_rad_s_1 qd_rad_s_2", "2 3", "4 5"),
        ("t q_rad_1 q_rad_2 dq_rad_per_s_1 dq_rad_per_s_2", "2 3", "4 5"),
        # simulators
        ("time qpos_0 qpos_1 qvel_0 qvel_1 ctrl_0 ctrl_1", "2 3", "4 5"),
        ("t dof_pos_0 dof_pos_1 dof_vel_0 dof_vel_1", "2 3", "4 5"),
        ("wrist_1 shoulder upper_arm forearm wrist_2 wrist_3 robotiq_gripper ins_x ins_xr",
         "2 3 4 1 5 6", ""),
        ("time panda_joint1 panda_joint2 panda_finger_joint1 panda_finger_joint2", "2 3", ""),
    ],
)  # fmt: skip
def test_what_each_column_is(names: str, joints: str, rates: str, read: Read) -> None:
    sign = ";" if ";" in names else ","
    log = read(table(names.replace(";", " "), sign))
    found = {role: [str(c.number) for c in log.columns if c.role == role] for role in ("joint", "rate")}
    assert found == {"joint": joints.split(), "rate": rates.split()}


@pytest.mark.parametrize(
    ("names", "answers"),
    [
        ("t shoulder elbow wrist_angle", ["shoulder elbow wrist_angle", "wrist_angle"]),
        ("t shoulder_angle elbow_angle wrist_roll", ["shoulder_angle elbow_angle wrist_roll",
                                                     "shoulder_angle elbow_angle"]),
        ("t left_j1 left_j2 right_j1 right_j2", ["left", "right"]),
        ("t left_pan left_lift right_pan right_lift", ["left_pan left_lift", "right_pan right_lift"]),
        ("t A B C D", ["A B C D"]),
        ("t q1_rad q2_rad q1_deg q2_deg", ["q1_rad q2_rad", "q1_deg q2_deg"]),
    ],
)  # fmt: skip
def test_what_is_asked(names: str, answers: list[str], read: Read) -> None:
    with pytest.raises(LogError) as asked:
        read(table(names))
    (finding,) = asked.value.findings
    values = [hint.value or [] for hint in finding.hints]
    given = [value if isinstance(value, str) else " ".join(map(str, value)) for value in values]  # type: ignore[arg-type]
    assert given == [*answers, ""]
    first = finding.hints[0]
    joints = tuple(name for name in names.split() if name in answers[0].split() or answers[0] in name)
    assert read(table(names), **{first.parameter: first.value}).joints == joints


def test_units_inside_of_names(read: Read) -> None:
    log = read(table("t joint_deg_1 joint_deg_2 vel_deg_s_1 vel_deg_s_2"))
    assert set(log.units.values()) == {"s", "deg", "deg/s"}


def test_a_position_by_numbers_beside_a_quaternion_is_no_arm_of_four_joints(read: Read) -> None:
    angle = np.linspace(0.1, 1.4, 50)
    quaternion = np.stack([np.cos(angle), np.sin(angle), 0 * angle, 0 * angle], axis=1)
    values = np.column_stack([T[:50], quaternion[:, :3] * 0.3, quaternion])
    lines = [",".join(map(repr, row)) for row in values.tolist()]
    log = read("\n".join(["time,p1,p2,p3,q1,q2,q3,q4", *lines]), rotation="quat_wxyz")
    assert not log.joints
    assert log.tcp_position is not None
    assert log.tcp_position.tolist() == values[:, 1:4].tolist()
    assert log.tcp_rotation is not None
    assert log.tcp_rotation.tolist() == quaternion.tolist()


@pytest.mark.slow
@pytest.mark.parametrize("sign", [",", ";"])
def test_a_row_a_joint_is_told_with_the_command_that_makes_a_row_a_sample(
    sign: str, write: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ("shoulder", "elbow", "wrist")
    rows = [f"{t!r}{sign}{name}{sign}{t + k!r}" for t in T.tolist() for k, name in enumerate(names)]
    path = write("\n".join([f"time{sign}joint{sign}position", *rows]))
    with pytest.raises(LogError, match="found one row per joint: joint goes round 3 names") as refused:
        read_log([path])
    command = refused.value.findings[0].hints[0].effect
    monkeypatch.chdir(tmp_path)
    subprocess.run([sys.executable, *shlex.split(command)[1:]], check=True)
    log = read_log([tmp_path / "table.csv"], LogMap(joints=names))
    assert log.q.tolist() == [[t, t + 1, t + 2] for t in T.tolist()]
    assert log.t.tolist() == T.tolist()


def test_a_file_of_which_nothing_is_used_is_told(write: Callable[..., Path]) -> None:
    q = write(table("q1 q2 q3"), "q.csv")
    others = write(table("seq stamp_s load"), "times.csv")
    (warning,) = [one for one in read_log([q, others]).warnings if one.kind == "file-not-used"]
    takes = f"--time {others}:COLUMN takes the times from one of its columns"
    assert str(warning) == f"none of the columns of times.csv is used; {takes}"


def test_numbers_that_are_neither_rad_nor_deg_are_asked_about(read: Read) -> None:
    """Ticks of servos: as deg they would be seven turns."""
    ticks = "\n".join(f"{t!r},{2048 + 600 * k % 97},{1500 + k}" for k, t in enumerate(T.tolist()))
    with pytest.raises(
        LogError, match=r"found values up to .* in dxl_1_position, dxl_2_position and no unit"
    ):
        read(f"time,dxl_1_position,dxl_2_position\n{ticks}\n")


def test_columns_by_a_range_of_numbers(read: Read) -> None:
    text = table("a b c d e")
    assert read(text, joints=["2-4"], time="none").joints == ("b", "c", "d")
    assert read(text, joints=["5", "1-2"], time="none").joints == ("e", "a", "b")
    with pytest.raises(LogError, match=r"joints \(--joints\): found no column '6', allowed: a, b, c, d, e"):
        read(text, joints=["4-9"])
    assert read(table("2-3 q1 q2"), joints=["2-3"]).joints == ("2-3",)


def test_a_quaternion_named_as_joints_is_asked_about(read: Read) -> None:
    rows = [f"{t!r},{np.cos(t):.9f},{np.sin(t):.9f},0.0,0.0" for t in T.tolist()]
    with pytest.raises(LogError, match="found q0, q1, q2, q3 with length 1 in each row"):
        read("\n".join(["t,q0,q1,q2,q3", *rows]))


def test_several_logs_in_a_file_are_one_line(read: Read) -> None:
    rows = [f"{t!r},{np.sin(t + k):.9f}" for k in range(3) for t in T.tolist()]
    with pytest.raises(LogError, match=r"found 3 logs in one file: .* rows 61, 121, ") as asked:
        read("\n".join(["t,q1", *rows]))
    assert len(asked.value.findings) == 1


@pytest.mark.parametrize(("file_dt", "period"), [(0.01, 0.01), (2.0, 0.005)])
def test_the_time_between_samples_in_a_numpy_file(file_dt: float, period: float, tmp_path: Path) -> None:
    """2.0 may be ms, and says nothing: the period is assumed, and said."""
    q = np.column_stack([np.sin(T), np.cos(3 * T)])
    np.savez(tmp_path / "log.npz", q=q, dt=file_dt)
    log = read_log([tmp_path / "log.npz"])
    assert (log.q.tolist(), log.period) == (q.tolist(), period)
    assert log.period_assumed == (file_dt > 1)


def test_joints_as_rows_beside_a_time_in_a_numpy_file(tmp_path: Path) -> None:
    q = np.column_stack([np.sin(T), np.cos(3 * T)])
    np.savez(tmp_path / "log.npz", t=T, q=q.T)
    log = read_log([tmp_path / "log.npz"])
    assert (log.q.tolist(), log.t.tolist()) == (q.tolist(), T.tolist())


def test_units_above_the_names(read: Read) -> None:
    rows = "\n".join(f"{t!r},{90 * np.sin(t):.9f},{300 * np.cos(t):.9f}" for t in T.tolist())
    log = read(f"[s],[deg],[deg]\nt,q1,q2\n{rows}\n")
    assert log.units == {"t": "s", "q1": "deg", "q2": "deg"}


@pytest.mark.parametrize("names", ["0,1,2", "Var1,Var2,Var3", "f0,f1,f2"])
def test_names_that_only_count_are_none(names: str, read: Read) -> None:
    rows = "\n".join(f"{t!r},{np.sin(t):.9f},{np.cos(3 * t):.9f}" for t in T.tolist())
    log = read(f"{names}\n{rows}\n", time="1")
    assert (log.t.tolist(), log.joints) == (T.tolist(), ("q1", "q2"))
