"""The recorded tool centre point: its columns, form and unit, told by names, numbers or kinematics."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Hint
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import rotation_angle
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs.columns import Column
from urmpipe_pipeline.logs.proofs import SAMPLES
from urmpipe_pipeline.logs.rotation import settle_rotation
from urmpipe_pipeline.logs.units import StatedUnit
from urmpipe_pipeline.logs.vocabulary import vocabulary

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]

UR5E = load_robot("ur5e")
ROWS = 40
TOOL_TURN = Rotation.from_euler("xyz", [0.3, -0.2, 0.5])
PRINTED = 1e-8
"""Ten decimals, in mm or deg at the worst."""


def motion() -> FloatArray:
    """A motion in which each joint moves in its own way."""
    t = np.linspace(0.0, 1.0, ROWS)[:, np.newaxis]
    return 0.4 + np.arange(6) * 0.3 + 0.5 * np.sin(t * (1.0 + 0.4 * np.arange(6)))


def text(names: Sequence[str], *columns: FloatArray) -> str:
    """A table with a header, written by NumPy."""
    from io import StringIO

    target = StringIO()
    t = np.arange(ROWS) * 0.005
    np.savetxt(
        target, np.column_stack((t, *columns)), "%.10f", ",", header=",".join(("t", *names)), comments=""
    )
    return target.getvalue()


Q = motion()
POSITION, MATRICES = poses_over_log(UR5E, Q)
ROTATION = Rotation.from_matrix(MATRICES) * TOOL_TURN
JOINTS = [f"q{k}" for k in range(1, 7)]
JOINTS_RAD = [f"q{k} [rad]" for k in range(1, 7)]
XYZ = ["x [mm]", "y [mm]", "z [mm]"]

BY_NAME = {
    "quat_xyzw": (["qx", "qy", "qz", "qw"], ROTATION.as_quat()),
    "letters in another order": (["qw", "qx", "qy", "qz"], ROTATION.as_quat()[:, [3, 0, 1, 2]]),
    "rpy": (["roll [deg]", "pitch [deg]", "yaw [deg]"], ROTATION.as_euler("xyz", degrees=True)),
    "zyx": (["A [deg]", "B [deg]", "C [deg]"], ROTATION.as_euler("ZYX", degrees=True)),
    "vector": (["rotvec_x", "rotvec_y", "rotvec_z"], ROTATION.as_rotvec()),
    "matrix": ([f"r{i}{j}" for i in "123" for j in "123"], ROTATION.as_matrix().reshape(-1, 9)),
}


@pytest.mark.parametrize("case", BY_NAME)
def test_forms_that_the_names_tell(case: str, read: Read) -> None:
    names, values = BY_NAME[case]
    log = read(text([*JOINTS_RAD, *XYZ, *names], Q, POSITION * 1e3, values))
    assert log.rotation_form == ("quat_xyzw" if "letters" in case else case)
    assert log.tcp_quat_xyzw is not None
    np.testing.assert_allclose(rotation_angle(log.tcp_quat_xyzw, ROTATION.as_quat()), 0.0, atol=PRINTED)
    assert log.tcp_position is not None
    np.testing.assert_allclose(log.tcp_position, POSITION, atol=PRINTED)
    assert log.joints == tuple(JOINTS)


@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize(("form", "sequence"), [("vector", ""), ("rpy", "xyz"), ("xyz", "XYZ")])
def test_the_kinematics_tell_what_rx_ry_rz_are(form: str, sequence: str, unit: str, read: Read) -> None:
    """No name and no unit: of six readings only one turns as the arm does."""
    values = ROTATION.as_euler(sequence) if sequence else ROTATION.as_rotvec()  # type: ignore[call-overload]
    written = np.degrees(values) if unit == "deg" else values
    table = text([*JOINTS_RAD, *XYZ, "rx", "ry", "rz"], Q, POSITION * 1e3, written)
    log = read(table, UR5E)
    assert log.rotation_form == form
    assert log.tcp_rotation is not None
    np.testing.assert_allclose(log.tcp_rotation, values, atol=PRINTED)
    (said,) = [i for i in log.inferences if i.what == "form of rx, ry, rz"]
    assert said.value == f"{form} in {unit}"
    assert said.evidence.startswith("with it the arm's orientation agrees within ")


def test_the_kinematics_tell_of_a_rotation_vector_in_another_unit_than_its_names_say(read: Read) -> None:
    names = ["rotvec_x [rad]", "rotvec_y [rad]", "rotvec_z [rad]"]
    table = text([*JOINTS_RAD, *XYZ, *names], Q, POSITION * 1e3, np.degrees(ROTATION.as_rotvec()))
    log = read(table, UR5E)
    assert log.tcp_rotation is not None
    np.testing.assert_allclose(log.tcp_rotation, ROTATION.as_rotvec(), atol=PRINTED)
    (warning,) = log.warnings
    assert warning.kind == "unit-contradiction"
    assert warning.message.startswith(
        "rotvec_x, rotvec_y, rotvec_z: rad contradicts the kinematics: taken as deg: with it the arm's"
        " orientation agrees within 0.00 deg, as vector in rad within "
    )
    assert warning.message.endswith(" deg")
    given = read(table, UR5E, unit={"rotvec_x": "rad"})
    assert (given.units["rotvec_z"], given.warnings[0].assumption) == ("rad", "the orientation is in rad")


def test_rows_spread_over_a_long_log_tell_the_unit_of_its_orientation() -> None:
    """Of twice the rows that decide every second one is looked at: the others need no kinematics."""
    rows = np.resize(np.repeat(np.arange(ROWS), 2), 2 * SAMPLES)
    turned = np.degrees(ROTATION.as_rotvec())[rows]
    turned[1::2] = 0.0
    columns = [Column(k + 1, 0, k, name, name, name, None, text=False) for k, name in enumerate("abc")]
    rad = vocabulary().units["rad"]
    told = (StatedUnit(rad, "name", "its name"),) * 3
    settled = settle_rotation(columns, ("vector",), turned, told, (UR5E, Q[rows]))
    assert [unit.name for unit in settled.units] == ["deg"] * 3


def test_rx_ry_rz_without_a_robot_are_not_guessed(read: Read) -> None:
    log = read(text([*JOINTS_RAD, *XYZ, "rx", "ry", "rz"], Q, POSITION * 1e3, ROTATION.as_rotvec()))
    assert (log.tcp_rotation, log.rotation_form) == (None, None)
    assert [(w.kind, w.message) for w in log.warnings] == [
        ("orientation", "rx, ry, rz may be of several forms: the recorded orientation is not used")
    ]
    assert "rx" not in log.units


def test_the_user_tells_the_form(read: Read) -> None:
    names = [*JOINTS_RAD, *XYZ, "rx [deg]", "ry [deg]", "rz [deg]"]
    table = text(names, Q, POSITION * 1e3, ROTATION.as_euler("xyz", degrees=True))
    log = read(table, rotation="rpy")
    assert log.rotation_form == "rpy"
    assert log.tcp_quat_xyzw is not None
    np.testing.assert_allclose(rotation_angle(log.tcp_quat_xyzw, ROTATION.as_quat()), 0.0, atol=PRINTED)
    assert not log.warnings


def transforms() -> FloatArray:
    """Homogeneous transforms, shape (n, 4, 4), in mm."""
    result = np.zeros((ROWS, 4, 4))
    result[:, :3, :3], result[:, :3, 3], result[:, 3, 3] = ROTATION.as_matrix(), POSITION * 1e3, 1.0
    return result


@pytest.mark.parametrize(
    ("names", "values"),
    [
        ([f"T{i}{j}" for i in "1234" for j in "1234"], transforms().reshape(-1, 16)),
        ([f"pose_{k}" for k in range(16)], transforms().reshape(-1, 16)),
        ([f"O_T_EE[{k}]" for k in range(16)], transforms().transpose(0, 2, 1).reshape(-1, 16)),  # libfranka
        ([f"m{k}" for k in range(12)], transforms()[:, :3].reshape(-1, 12)),  # CoppeliaSim
    ],
)
def test_homogeneous_transforms_by_rows_and_by_columns(
    names: list[str], values: FloatArray, read: Read
) -> None:
    log = read(text([*JOINTS_RAD, *names], Q, values), UR5E)
    assert log.rotation_form == "matrix"
    assert log.tcp_rotation is not None
    np.testing.assert_allclose(log.tcp_rotation, ROTATION.as_matrix().reshape(-1, 9), atol=PRINTED)
    assert log.tcp_position is not None
    np.testing.assert_allclose(log.tcp_position, POSITION, atol=PRINTED)


def test_a_transform_behind_the_joints_of_a_table_without_header(read: Read) -> None:
    rows = np.column_stack((np.degrees(Q), transforms().reshape(-1, 16)))
    log = read("".join(",".join(map(repr, row)) + "\n" for row in rows.tolist()), UR5E, period=0.005)
    np.testing.assert_allclose(log.q, Q, atol=PRINTED)
    assert log.tcp_position is not None
    np.testing.assert_allclose(log.tcp_position, POSITION, atol=PRINTED)
    assert log.rotation_form == "matrix"
    without = read("".join(",".join(map(repr, row)) + "\n" for row in rows.tolist()), unit={"": "deg"})
    assert without.joints == ("q1", "q2", "q3", "q4", "q5", "q6")


def test_sixteen_columns_that_are_no_transform_are_none(read: Read) -> None:
    values = transforms().reshape(-1, 16)
    values[:, 0] += 0.5
    log = read(text([*JOINTS_RAD, *(f"pose_{k}" for k in range(16))], Q, values))
    assert (log.tcp_position, log.rotation_form) == (None, None)


def test_quaternions_of_another_length_are_none(read: Read) -> None:
    log = read(text([*JOINTS_RAD, *XYZ, "qx", "qy", "qz", "qw"], Q, POSITION * 1e3, 2 * ROTATION.as_quat()))
    assert log.rotation_form is None
    assert [w.message for w in log.warnings] == [
        "qx, qy, qz, qw hold quaternions of length 2, allowed: 1; they are not used"
    ]


def test_named_columns_of_the_pose(read: Read) -> None:
    names = [*JOINTS_RAD, "a1", "a2", "a3", "b1", "b2", "b3"]
    table = text(names, Q, POSITION, ROTATION.as_rotvec())
    log = read(
        table,
        UR5E,
        joints=tuple(f"q{k}" for k in range(1, 7)),
        position=("a1", "a2", "a3"),
        orientation=("b1", "b2", "b3"),
        rotation="vector",
        unit={"a1": "m", "a2": "m", "a3": "m", "b1": "rad", "b2": "rad", "b3": "rad"},
    )
    assert log.tcp_position is not None
    np.testing.assert_allclose(log.tcp_position, POSITION, atol=PRINTED)
    assert log.rotation_form == "vector"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            {"position": ("a1", "a2", "a3", "b1")},
            "position: found 4 columns, allowed: x, y, z, or x, y of a planar arm",
        ),
        (
            {"position": ("a1", "a2", "a3"), "orientation": ("b1",)},
            "orientation: found 1 column, allowed: 3, 4 or 9",
        ),
        (
            {"position": ("a1", "a2", "a3"), "orientation": ("b1", "b2", "b3"), "rotation": "matrix"},
            "orientation: found 3 columns, allowed: 9, as matrix has",
        ),
    ],
)
def test_a_pose_needs_its_columns(options: dict[str, object], said: str, wrong: Wrong) -> None:
    table = text([*JOINTS_RAD, "a1", "a2", "a3", "b1", "b2", "b3"], Q, POSITION, ROTATION.as_rotvec())
    assert wrong(table, **options) == [said]


def test_positions_and_vectors_by_number(read: Read) -> None:
    vector = ROTATION.as_rotvec()
    for names in (
        [f"actual_TCP_pose_{k}" for k in range(1, 7)],
        [*(f"tcp_position_{k}" for k in range(1, 4)), *(f"rotvec_{k}" for k in range(1, 4))],
    ):
        log = read(text([*JOINTS_RAD, *names], Q, POSITION, vector), UR5E)
        assert log.tcp_position is not None
        assert log.tcp_rotation is not None
        np.testing.assert_allclose(log.tcp_position, POSITION, atol=PRINTED)
        np.testing.assert_allclose(log.tcp_rotation, vector, atol=PRINTED)


def test_a_quaternion_named_like_joints_is_known_by_its_length(read: Read) -> None:
    wxyz = ROTATION.as_quat()[:, [3, 0, 1, 2]]
    names = [*(f"J{k} [rad]" for k in range(1, 7)), *XYZ, "Q1", "Q2", "Q3", "Q4"]
    log = read(text(names, Q, POSITION * 1e3, wxyz), UR5E)
    assert log.joints == ("J1", "J2", "J3", "J4", "J5", "J6")
    assert log.rotation_form == "quat_wxyz"
    scara = read(text(["q1", "q2", "q3", "q4", *XYZ], Q[:, :4], POSITION * 1e3))
    assert (scara.joints, scara.rotation_form) == (("q1", "q2", "q3", "q4"), None)


def test_quaternions_have_no_unit_that_is_refused(read: Read) -> None:
    names = [*JOINTS_RAD, *XYZ, "qx [-]", "qy [-]", "qz [-]", "qw [-]"]
    assert read(text(names, Q, POSITION * 1e3, ROTATION.as_quat())).rotation_form == "quat_xyzw"


def test_a_trajectory_without_header_is_no_log_of_seven_joints(read: Read) -> None:
    rows = np.column_stack((np.arange(ROWS) * 0.005, POSITION, ROTATION.as_quat()))
    tum = "".join(" ".join(map(repr, row)) + "\n" for row in rows.tolist())
    log = read(tum)
    assert (log.joints, log.source) == ((), "path")
    assert log.tcp_position is not None
    np.testing.assert_array_equal(log.tcp_position, POSITION)
    assert read(tum, rotation="quat_xyzw").rotation_form == "quat_xyzw"
    seven = np.column_stack((np.arange(ROWS) * 0.005, Q, Q[:, 0]))
    assert len(read("".join(" ".join(map(repr, row)) + "\n" for row in seven.tolist())).joints) == 7


def test_an_orientation_without_a_whole_sample_is_not_used(read: Read) -> None:
    gappy = ROTATION.as_quat()
    gappy[::2, 0], gappy[1::2, 1] = np.nan, np.nan
    log = read(text([*JOINTS_RAD, *XYZ, "qx", "qy", "qz", "qw"], Q, POSITION * 1e3, gappy))
    assert (log.rotation_form, log.tcp_rotation) == (None, None)


@pytest.mark.parametrize(
    "names",
    [
        ("tcp_xx", "tcp_yy", "tcp_zz"),
        ("tpc_x", "tpc_y", "tpc_z"),
        ("TCP1", "TCP2", "TCP3"),
        ("tool x1", "tool y1", "tool z1"),
        ("tcp_x [mm]", "tcp_y [mm]", "tcp_y2 [mm]"),
    ],
)
def test_what_looks_like_a_recorded_tcp_and_is_none_is_said(read: Read, names: tuple[str, ...]) -> None:
    log = read(f"t,q1 [rad],{','.join(names)}\n0,0.1,1,2,3\n0.1,0.2,1,2,3\n")
    assert log.tcp_position is None
    assert [(one.kind, str(one)) for one in log.warnings] == [
        (
            "tcp-not-read",
            f"{', '.join(names)} look like a recorded TCP and are not read as one; name its columns tcp_x,"
            f" tcp_y, tcp_z; {Hint('position', [one.removesuffix(' [mm]') for one in names])} takes them",
        )
    ]


def test_two_recorded_tcps_are_said(read: Read) -> None:
    names = ["tcp_x", "tcp_y", "tcp_z", "tool_x", "tool_y", "tool_z"]
    log = read(f"t,q1 [rad],{','.join(names)}\n0,0.1,1,2,3,4,5,6\n0.1,0.2,1,2,3,4,5,6\n")
    assert list(map(str, log.warnings)) == [
        f"{', '.join(names)} look like a recorded TCP and are not read as one; name its columns tcp_x, tcp_y,"
        " tcp_z; --position X,Y,Z names them"
    ]


@pytest.mark.parametrize(
    "names",
    [
        ("actual_TCP_force_0", "actual_TCP_force_1", "actual_TCP_force_2"),
        ("TCP_speed_x", "TCP_speed_y", "TCP_speed_z"),
        ("tool_analog_input0", "tool_analog_input1", "tool_output_current_2"),
        ("fx", "tx", "ty"),
        ("tcp_x [deg]", "tcp_y [deg]", "tcp_a"),
        ("tcp_x", "load", "power"),
        ("cpu_pct_1", "cpu_pct_2", "duty_pct_3"),  # per cent
    ],
)
def test_what_a_tool_has_besides_its_place_is_no_tcp(read: Read, names: tuple[str, ...]) -> None:
    assert not read(f"t,q1 [rad],{','.join(names)}\n0,0.1,1,2,3\n0.1,0.2,1,2,3\n").warnings
