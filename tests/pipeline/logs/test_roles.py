"""Which columns are the joints, in which order, and what is recorded beside them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from urmpipe_models.arm.chain import Chain
from urmpipe_models.math3d import to_quaternions
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs.formats.cells import grouped_number

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]
Arm = Callable[..., Chain]

OPTION = "--joints A,B,C names the joint columns, in the robot's order"
RECORD = "record every joint; --robot NAME|FILE gives another arm"


def table(names: Sequence[str]) -> str:
    """A table whose column k holds k and k + 0.5."""
    rows = [",".join(str(k + part) for k in range(len(names))) for part in (0, 0.5)]
    return "\n".join([",".join(names), *rows, ""])


@pytest.mark.parametrize(
    "joints",
    [
        ["q1", "q2", "q3"],
        ["q_0", "q_1", "q_2"],
        ["q[0]", "q[1]", "q[2]"],
        ["q(1)", "q(2)", "q(3)"],
        ["J1", "J2", "J3"],
        ["A1", "A2", "A3"],
        ["Joint 1", "Joint 2", "Joint 3"],
        ["joint1 [rad]", "joint2 [rad]", "joint3 [rad]"],
        ["J1_Angle", "J2_Angle", "J3_Angle"],
        ["theta1", "theta2", "theta3"],
        ["θ1", "θ2", "θ3"],
        ["phi_1", "phi_2", "phi_3"],
        ["field.position0", "field.position1", "field.position2"],
        ["state.q[0]", "state.q[1]", "state.q[2]"],
        [
            "/robot/joint_states/joint_1/position",
            *(f"/robot/joint_states/joint_{k}/position" for k in (2, 3)),
        ],
        ["AxisPos_Act1", "AxisPos_Act2", "AxisPos_Act3"],
        ["Gelenk 1 (rad)", "Gelenk 2 (rad)", "Gelenk 3 (rad)"],
        ["Achswinkel1", "Achswinkel2", "Achswinkel3"],
        ["angle of shoulder", "angle of elbow", "angle of wrist"],
        ["boom_rad", "stick_rad", "bucket_rad"],
    ],
)
def test_names_of_joints(read: Read, arm: Arm, joints: list[str]) -> None:
    for robot in (None, arm(3)):
        log = read(table(["t", *joints, "force1", "tau_2", "motor_current_3", "temperature"]), robot)
        assert log.q[0].tolist() == [1.0, 2.0, 3.0]


def test_joints_in_any_order_are_put_in_that_of_their_numbers(read: Read) -> None:
    log = read(table(["t", *(f"q{k}" for k in (4, 5, 3, 1, 2, 6, 7))]))
    assert log.joints == tuple(f"q{k}" for k in range(1, 8))
    assert log.q[0].tolist() == [4.0, 5.0, 3.0, 1.0, 2.0, 6.0, 7.0]


def test_ten_joints_are_sorted_as_numbers(read: Read) -> None:
    log = read(table(["t", *sorted(f"q{k}" for k in range(1, 13))]))
    assert log.joints == tuple(f"q{k}" for k in range(1, 13))


def test_measured_joints_are_preferred_to_commanded_ones(read: Read) -> None:
    names = [f"{kind}_q_{k}" for kind in ("target", "actual") for k in range(6)]
    rates = [f"{kind}_qd_{k}" for kind in ("target", "actual") for k in range(6)]
    seconds = [f"target_qdd_{k}" for k in range(6)]
    log = read(table(["timestamp", *names, *rates, *seconds]))
    assert log.source == "ur-rtde"
    assert log.joints == tuple(f"actual_q_{k}" for k in range(6))
    assert log.qd is not None
    assert log.qd[0].tolist() == [19.0, 20.0, 21.0, 22.0, 23.0, 24.0]
    assert log.qdd is None  # only the commanded ones are logged


def test_commanded_joints_where_there_are_no_others(read: Read) -> None:
    log = read(table(["t", "target_q_0", "target_q_1", "target_qd_0", "target_qd_1"]))
    assert log.joints == ("target_q_0", "target_q_1")
    assert log.qd is not None


@pytest.mark.parametrize(
    ("rates", "seconds"),
    [
        (["dq1", "dq2"], ["ddq1", "ddq2"]),
        (["qd1", "qd2"], ["qdd1", "qdd2"]),
        (["velocity1", "velocity2"], ["acceleration1", "acceleration2"]),
        (["joint_1_velocity", "joint_2_velocity"], ["joint_1_acceleration", "joint_2_acceleration"]),
        (["J1_speed [rad/s]", "J2_speed [rad/s]"], ["J1_acc [rad/s^2]", "J2_acc [rad/s^2]"]),
        (
            ["Winkelgeschwindigkeit 1", "Winkelgeschwindigkeit 2"],
            ["Winkelbeschleunigung1", "Winkelbeschleunigung2"],
        ),
    ],
)
def test_recorded_rates_and_accelerations(read: Read, rates: list[str], seconds: list[str]) -> None:
    log = read(table(["t", "q1", "q2", *rates, *seconds]))
    assert log.qd is not None
    assert log.qdd is not None
    assert log.qd[0].tolist() == [3.0, 4.0]
    assert log.qdd[0].tolist() == [5.0, 6.0]


def test_rates_of_other_joints_are_not_theirs(read: Read) -> None:
    assert read(table(["t", "q1", "q2", "dq1", "dq2", "dq3"])).qd is None


def test_empty_rates_are_none(read: Read) -> None:
    assert read("t,q1,dq1\n0,1,\n0.1,2,\n").qd is None


def test_the_robots_names_decide(read: Read, arm: Arm) -> None:
    names = ("base_yaw", "boom", "stick")
    columns = [
        f"/joint_states/{name}/{what}" for what in ("position", "velocity") for name in sorted(names)[::-1]
    ]
    log = read(table(["__time", *columns]), arm(3, names=names))
    assert log.joints == tuple(f"/joint_states/{name}/position" for name in names)
    assert log.q[0].tolist() == [3.0, 2.0, 1.0]
    assert log.qd is not None
    assert log.qd[0].tolist() == [6.0, 5.0, 4.0]


def test_alphabetical_joint_states_of_a_known_arm_are_put_in_order(read: Read, arm: Arm) -> None:
    names = ["elbow", "shoulder_lift", "shoulder_pan", "wrist_1", "wrist_2", "wrist_3"]
    log = read(table(["time", *(f"{name}_joint" for name in names)]), arm(6))
    assert log.q[0].tolist() == [3.0, 2.0, 1.0, 4.0, 5.0, 6.0]


def test_as_many_columns_as_joints_are_no_proof(read: Read, wrong: Wrong, arm: Arm) -> None:
    text = table(["t", "boom", "stick"])
    (asked,) = wrong(text, arm(2))
    assert "--joints boom,stick takes these" in asked
    assert read(text, arm(2), joints=("boom", "stick")).joints == ("boom", "stick")


def test_joints_as_the_user_says(read: Read, wrong: Wrong) -> None:
    text = table(["t", "boom [deg]", "stick [deg]", "other"])
    assert read(text, joints=("stick", "2")).joints == ("stick", "boom")
    assert read(text, joints=("stick [deg]", "BOOM")).joints == ("stick", "boom")
    assert wrong(text, joints=("stick", "arm")) == [
        "joints (--joints): found no column 'arm', allowed: boom [deg], stick [deg], other"
    ]
    assert wrong(text, joints=("stick", "3")) == [
        "log.csv: joints (--joints): found stick [deg], stick [deg], allowed: each column once"
    ]


def test_without_a_word_for_joints_the_user_must_say(wrong: Wrong, arm: Arm) -> None:
    text = table(["t", "boom", "stick", "bucket"])
    assert wrong(text) == [
        "log.csv: found no joint columns in boom, stick, bucket, allowed: such as q1, q2, ... or J1, J2, ...;"
        f" --joints boom,stick,bucket takes these; {OPTION}"
    ]
    assert wrong(text, arm(2)) == [
        f"log.csv: found no joint columns in boom, stick, bucket, allowed: 2 for robot arm; {OPTION}"
    ]


def test_too_few_and_too_many_for_the_robot(wrong: Wrong, arm: Arm) -> None:
    text = table(["t", "q1", "q2", "q3"])
    assert wrong(text, arm(6)) == [
        "log.csv: found 3 joint columns (q1, q2, q3) and none with number 4, 5, 6, allowed: 6, as robot arm"
        f" has; {RECORD}"
    ]
    assert wrong(text, arm(2)) == [
        f"log.csv: found 3 joint columns (q1, q2, q3), allowed: 2, as robot arm has; {OPTION}"
    ]
    assert wrong("0.1,0.2\n0.3,0.1\n", arm(6)) == [
        f"log.csv: found 2 joint columns (1, 2), allowed: 6, as robot arm has; {RECORD}"
    ]


def test_a_missing_number_is_named(wrong: Wrong, arm: Arm) -> None:
    allowed = "allowed: numbers without a gap; record the missing one;"
    assert wrong(table(["t", "a", "J2", "J3"])) == [
        f"log.csv: found joint columns J2, J3 and none with number 1, {allowed} {OPTION}"
    ]
    assert wrong(table(["t", "J1", "J2", "J4"])) == [
        f"log.csv: found joint columns J1, J2, J4 and none with number 3, {allowed} {OPTION}"
    ]
    assert wrong(table(["t", "J1", "J2", "J4"]), arm(4)) == [
        "log.csv: found joint columns J1, J2, J4 and none with number 3, allowed: the 4 joints of the robot;"
        " record the missing one; --robot NAME|FILE gives another arm"
    ]
    assert wrong(table(["t", "J1", "J2", "Jthree", "J4"]), arm(4)) == [
        "log.csv: found joint columns J1, J2, J4 and none with number 3, allowed: the 4 joints of the robot;"
        f" record the missing one; {OPTION}"
    ]


def test_a_missing_name_is_named(wrong: Wrong, arm: Arm) -> None:
    names = ["shoulder_pan", "shoulder_lift", "wrist_1", "wrist_2", "wrist_3"]
    found = f"log.csv: found joint columns {', '.join(names)} and none for elbow, allowed:"
    assert wrong(table(["t", *names]), arm(6)) == [
        f"{found} 6 for robot arm; record the missing one; --robot NAME|FILE gives another arm"
    ]
    assert wrong(table(["t", *names, "forearm", "other"]), arm(6)) == [
        f"{found} 6 for robot arm; record the missing one; {OPTION}"
    ]
    assert wrong(table(["t", *names])) == [
        f"{found} such as q1, q2, ... or J1, J2, ...; record the missing one;"
        " --joints shoulder_pan,shoulder_lift,wrist_1,wrist_2,wrist_3 takes these;"
        f" {OPTION}"
    ]
    own = ["base_yaw", "lower_arm", "upper_arm", "hand"]
    assert wrong(table(["t", *own[:3]]), arm(4, names=tuple(own))) == [
        "log.csv: found joint columns base_yaw, lower_arm, upper_arm and none for hand, allowed: 4 for robot"
        " arm; record the missing one; --robot NAME|FILE gives another arm"
    ]


def test_two_groups_are_ambiguous_unless_one_fits_the_robot(wrong: Wrong, read: Read, arm: Arm) -> None:
    names = ["left_q1", "left_q2", "right_q1", "right_q2"]
    said = "found several groups of joint columns: left_q1, left_q2; right_q1, right_q2, allowed: one"
    answers = "--side left or --side right takes these"
    assert wrong(table(["t", *names])) == [f"log.csv: {said}; {answers}; {OPTION}"]
    assert read(table(["t", *names, "right_q3"]), arm(3)).joints == ("right_q1", "right_q2", "right_q3")


def test_names_that_stand_twice(wrong: Wrong) -> None:
    assert wrong(table(["t", "q1", "q2", "q2", "note", "note"])) == [
        "log.csv:1, column q2: found as columns 3, 4, allowed: once; --joints A,B,C selects them: give"
        " their numbers"
    ]
    assert wrong(table(["t", "q1 [deg]", "q1 [rad]"])) == [
        "log.csv:1, column q1 [deg]: found as columns 2, 3, allowed: once; --joints A,B,C selects"
        " them: give their numbers"
    ]


def test_a_header_that_does_not_fit_its_rows(wrong: Wrong) -> None:
    assert wrong("t,q1\n0,1,2,3\n0.1,1,2,3\n") == [
        "log.csv:1: found 2 names over rows of 4 cells, allowed: one name per column; add 2 names,"
        " or delete line 1: without names the columns are taken as joints in order"
    ]


def test_text_columns_are_left_out(read: Read) -> None:
    log = read("t,name1,q1,state\n0,arm,0.5,idle\n0.1,arm,0.6,moving\n")
    assert log.joints == ("q1",)


@pytest.mark.parametrize(
    "names",
    [
        ("x", "y", "z"),
        ("Tip_X", "Tip_Y", "Tip_Z"),
        ("tcp.x", "tcp.y", "tcp.z"),
        ("X_Act", "Y_Act", "Z_Act"),
        ("/tcp/pose/position/x", "/tcp/pose/position/y", "/tcp/pose/position/z"),
    ],
)
def test_recorded_positions(read: Read, names: tuple[str, ...]) -> None:
    log = read(table(["t", "q1", *names]))
    assert log.joints == ("q1",)
    assert log.tcp_position is not None
    assert log.tcp_position[0].tolist() == [2.0, 3.0, 4.0]


def test_several_positions(read: Read, wrong: Wrong) -> None:
    names = ["p6_x", "p6_y", "p6_z", "p7_x", "p7_y", "p7_z"]
    assert read(table(["t", "q1", *names])).tcp_position is None
    assert wrong(table(["t", *names])) == [
        "log.csv: found several positions: p6_x, p6_y, p6_z; p7_x, p7_y, p7_z; allowed: one x, y, z"
    ]


def test_tcp_pose_of_ur_is_a_position_and_a_rotation_vector(read: Read) -> None:
    names = [f"actual_q_{k}" for k in range(6)] + [f"actual_TCP_pose_{k}" for k in range(6)]
    names += [f"target_TCP_pose_{k}" for k in range(6)]
    log = read(table(["timestamp", *names]))
    assert log.tcp_position is not None
    assert log.tcp_quat_xyzw is not None
    assert log.tcp_position[0].tolist() == [7.0, 8.0, 9.0]
    np.testing.assert_array_equal(
        log.tcp_quat_xyzw[0], to_quaternions(np.array([[10.0, 11.0, 12.0]]), "vector")[0]
    )


def test_ros2_topic_echo(read: Read, arm: Arm) -> None:
    names = "elbow_joint,shoulder_lift_joint,shoulder_pan_joint,wrist_1_joint,wrist_2_joint,wrist_3_joint"
    rows = [
        f"1740416404,{stamp},base,{names},3,2,1,4,5,6,0.3,0.2,0.1,0.4,0.5,0.6,"
        for stamp in (999_000_000, 999_500_000)
    ]
    log = read(
        "\n".join([*rows, f"1740416405,0,base,{names},3,2,1,4,5,6,0.3,0.2,0.1,0.4,0.5,0.6,", ""]), arm(6)
    )
    assert log.source == "ros2"
    assert log.t_ns.tolist() == [0, 500_000, 1_000_000]
    assert log.clock_start == 1740416404.999
    assert log.q[0].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert log.qd is not None
    assert log.qd[0].tolist() == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    assert not log.warnings


def test_ros2_topic_echo_of_positions_only(read: Read) -> None:
    log = read("5,1,,joint1,joint2,0.1,0.2,,\n5,2,,joint1,joint2,0.1,0.2,,\n")
    assert log.joints == ("position.joint1", "position.joint2")
    assert log.qd is None
    assert log.t_ns.tolist() == [0, 1]


def test_ur_logs_may_have_no_time(read: Read) -> None:
    """The controller's execution time is no clock of the log."""
    log = read(table([*(f"actual_q_{k}" for k in range(6)), "actual_execution_time", "runtime_state"]))
    assert log.source == "ur-rtde"
    assert log.t_ns.tolist() == [0, 5_000_000]


@pytest.mark.parametrize(
    ("word", "attribute"), [("vel", "qd"), ("dot", "qd"), ("acc", "qdd"), ("ddot", "qdd")]
)
def test_rates_named_behind_the_number(read: Read, word: str, attribute: str) -> None:
    log = read(table(["t", "q1", "q2", f"q1_{word}", f"q2_{word}"]))
    assert getattr(log, attribute).tolist() == [[3.0, 4.0], [3.5, 4.5]]


def test_forces_and_torques_are_neither_joints_nor_a_position(read: Read, wrong: Wrong, arm: Arm) -> None:
    wrench = ["Fx", "Fy", "Fz", "Tx", "Ty", "Tz"]
    assert read(table(["t", "q1", "q2", *wrench])).tcp_position is None
    said = "found no joint columns in Fx, Fy, Fz, Mx, My, Mz, allowed: 6 for robot arm"
    names = ["t", "Fx", "Fy", "Fz", "Mx", "My", "Mz"]
    assert wrong(table(names), arm(6)) == [f"log.csv: {said}; {OPTION}"]


def test_three_angles_beside_a_position_are_no_joints(read: Read) -> None:
    log = read(table(["t", "X [mm]", "Y [mm]", "Z [mm]", "W [deg]", "P [deg]", "R [deg]"]))
    assert log.joints == ()
    assert log.tcp_position is not None


@pytest.mark.parametrize(
    ("head", "row", "found", "plain"),
    [
        ("Zeit [s];X [mm];Y [mm];Z [mm]", "0,0{k};1.234,567;-2.965,000;1.731,830", "1.234,567", "1234,567"),
        ("Zeit [s]\tX [mm]\tY [mm]\tZ [mm]", "0,0{k}\t3,5\t-2.965,0\t173,5", "-2.965,0", "-2965,0"),
        ("t,X [mm],Y [mm],Z [mm]", '0.0{k},173.5,"-1,234,567.5",3.0', "-1,234,567.5", "-1234567.5"),
    ],
)
def test_signs_between_thousands_are_told(wrong: Wrong, head: str, row: str, found: str, plain: str) -> None:
    text = "\n".join([head, *(row.format(k=k) for k in range(9)), ""])
    said = f"allowed: {plain}; export the table without thousands separators"
    assert wrong(text) == [f"log.csv: found '{found}', {said}"]


@pytest.mark.parametrize(
    "text", ["1,234", "1.234", "447,688", "1.2345,6", "a1.234,5", "1,234,567", "1.234,567,8"]
)
def test_what_may_be_a_list_or_a_fraction_has_no_thousands(text: str) -> None:
    assert grouped_number(text) is None


def test_a_comma_between_columns_is_none_between_thousands(wrong: Wrong) -> None:
    (said,) = wrong("boom,stick\n1.234,567\n1.235,568\n")
    assert said.startswith("log.csv: found no joint columns in boom, stick")
