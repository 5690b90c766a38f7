"""Headers that lie, and logs that are written well: all is right, asked for, or said to be assumed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import translation
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, format_map, map_of, read_log, read_map
from urmpipe_pipeline.repolarization.audit import is_revolute
from urmpipe_pipeline.runs.ingest import ingest_log

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]
Write = Callable[..., Path]
Arm = Callable[..., Chain]

UR5E = load_robot("ur5e")
ROWS = 200
T: FloatArray = np.linspace(0.0, 0.02 * (ROWS - 1), ROWS, dtype=np.float64)
DEG = 180 / np.pi
PRINTED = 1e-8
"""Ten decimals, in mm or deg at the worst."""

Q = 0.4 + np.arange(6) * 0.3 + 0.5 * np.sin(T[:, None] * (1 + 0.4 * np.arange(6)))
TURNING = Q + np.array([0, 0, 0, 0, 0, 3.0]) * T[:, None]
WRAPPED = np.remainder(TURNING + np.pi, 2 * np.pi) - np.pi
FLANGE, MATRICES = poses_over_log(UR5E, Q)
ROTATION = Rotation.from_matrix(MATRICES) * Rotation.from_euler("xyz", [0.3, -0.2, 0.5])
XYZ = ["x [m]", "y [m]", "z [m]"]


def csv(names: Sequence[str], *columns: FloatArray, t: FloatArray = T) -> str:
    target = StringIO()
    header = ",".join(("t [s]", *names))
    np.savetxt(target, np.column_stack((t, *columns)), "%.10f", ",", header=header, comments="")
    return target.getvalue()


def joints(unit: str = "", count: int = 6) -> list[str]:
    return [f"q{k}{unit}" for k in range(1, count + 1)]


def assumed(log: JointLog) -> list[tuple[str, str | None, bool]]:
    return [(one.assumption, one.role, one.blocks_verdict) for one in log.warnings if one.assumption]


def follow_hints(read: Callable[..., JointLog], log: JointLog) -> None:
    """Each hint with a value, followed, removes the complaint that it stands beside."""
    for warning in log.warnings:
        for hint in warning.hints:
            told = read(**{hint.parameter: hint.value})
            assert warning.message not in [one.message for one in told.warnings]


@pytest.mark.parametrize(
    ("unit", "values", "why"),
    [
        ("deg", Q, "values of no more than 2.4 may be rad as well"),
        ("deg", TURNING, "values of no more than 15.2 may be rad as well"),
        ("rad", Q * DEG * 0.2, "values of 27.4 are more than a turn as rad"),
    ],
)
def test_a_header_over_values_that_may_be_in_the_other_unit_is_doubted(
    unit: str, values: FloatArray, why: str, read: Read
) -> None:
    if unit == "deg":
        values = (
            values[: 1 + np.argmax(np.abs(values).max(axis=1) > 12)] if np.abs(values).max() > 12 else values
        )
    table = csv(joints(f" [{unit}]"), values, t=T[: len(values)])
    log = read(table)
    assert set(log.units.values()) == {"s", unit}
    assert assumed(log) == [(f"the joints are in {unit}", "joint", False)]
    assert [one.kind for one in log.warnings] == ["doubted-unit"]
    follow_hints(lambda **given: read(table, **given), log)


def test_a_doubt_says_what_decides(read: Read) -> None:
    (warning,) = read(csv(joints(" [deg]", 2), Q[:, :2])).warnings
    assert str(warning) == (
        "q1, q2: deg (its name) is doubted: values of no more than 1.2 may be rad as well;"
        " --unit q1=rad --unit q2=rad or --unit q1=deg --unit q2=deg specifies it"
    )


WELL_WRITTEN: Mapping[str, tuple[str, FloatArray]] = {
    "rad": ("rad", Q),
    "rad, wraps": ("rad", WRAPPED),
    "rad, multi-turn and wraps": ("rad", np.column_stack((WRAPPED, 5 * T))),
    "deg": ("deg", Q * DEG),
    "deg, wraps": ("deg", WRAPPED * DEG),
    "deg, small and fast": ("deg", 8 * np.sin(20 * T)[:, None]),
    "deg, still": ("deg", np.zeros((ROWS, 6))),
    "rad, a spike": ("rad", np.where(np.arange(ROWS)[:, None] == 77, 360.0, Q)),
}


@pytest.mark.parametrize("case", WELL_WRITTEN)
def test_a_log_that_is_written_well_is_neither_asked_for_nor_doubted(case: str, read: Read) -> None:
    unit, values = WELL_WRITTEN[case]
    log = read(csv(joints(f" [{unit}]", values.shape[1]), values))
    np.testing.assert_allclose(log.q, values / (DEG if unit == "deg" else 1.0), atol=PRINTED)
    assert not log.warnings


def test_small_poses_in_degrees_are_no_wraps_of_radians(read: Read) -> None:
    poses = np.random.default_rng(3).uniform(-6, 6, (ROWS, 6))
    log = read(csv(joints(" [deg]"), poses))
    assert assumed(log) == [("the joints are in deg", "joint", False)]


UNLABELLED: Mapping[str, tuple[FloatArray, FloatArray, str]] = {
    "spikes of 360 in rad": (np.where(np.arange(ROWS)[:, None] % 50 == 20, 360.4, Q[:, :1]), T, "asked"),
    "a value of 360 held": (np.where(np.abs(np.arange(ROWS)[:, None] - 50) < 5, 360.7, Q[:, :1]), T, "asked"),
    "a clock that hurries": (
        5 * T[:, None],
        np.repeat(T[::4], 4) + np.tile(np.arange(4) * 1e-5, ROWS // 4),
        "asked",
    ),
    "a clock in another unit": (5 * T[:, None], T / 1e3 * 5, "deg"),
    "a slide in mm": (np.column_stack((Q[:, :2], 300 + 200 * np.sin(T))), T, "asked"),
    "deg, fast": (Q * DEG * 2, T, "deg"),
    "a slide in mm, wraps": (np.column_stack((WRAPPED[:, 5], 300 + 200 * np.sin(T))), T, "asked"),
}


@pytest.mark.parametrize("case", UNLABELLED)
def test_without_a_unit_nothing_but_wraps_is_a_proof(case: str, read: Read, wrong: Wrong) -> None:
    values, t, taken = UNLABELLED[case]
    table = csv(joints(count=values.shape[1]), values, t=t)
    if taken == "asked":
        assert " and no unit, allowed: " in wrong(table)[0]
        return
    log = read(table)
    assert (f"the joints are in {taken}", "joint", False) in assumed(log)
    follow_hints(lambda **given: read(table, **given), log)


def test_wraps_prove_the_unit_of_joints_that_cannot_slide(read: Read) -> None:
    assert not read(csv(joints(), WRAPPED)).warnings
    assert not read(csv(joints(), WRAPPED * DEG), UR5E).warnings
    assert assumed(read(csv(joints(), WRAPPED * DEG)))[0][0] == "q1, q2, q3, q4, q5 are in deg"


def test_one_bad_row_decides_on_no_unit(read: Read) -> None:
    spiky = np.where(np.arange(ROWS)[:, None] == 77, 100.0, Q)
    assert assumed(read(csv(joints(), spiky), UR5E)) == [("the joints are in rad", "joint", False)]
    assert not read(csv(joints(" [rad]"), spiky), UR5E).warnings


def test_one_column_that_lies_is_named(read: Read, wrong: Wrong) -> None:
    values = np.column_stack((Q[:, :2] * DEG, WRAPPED[:, 5:]))
    (said,) = wrong(csv(joints(" [deg]", 3), values))
    assert said.startswith(
        "log.csv: found q3 in deg by name or source, but 2 steps of about 6.28 from one row"
    )
    assert said.endswith("--unit q3=rad or --unit q3=deg specifies it")


def test_the_kinematics_name_the_one_joint_that_lies(read: Read) -> None:
    values = Q * np.where(np.arange(6) == 2, DEG, 1.0)
    log = read(csv([*joints(" [rad]"), *XYZ], values, FLANGE), UR5E)
    np.testing.assert_allclose(log.q, Q, atol=PRINTED)
    (warning,) = log.warnings
    assert warning.message.startswith(
        "q3: rad (its name) contradicts the kinematics: taken as deg: with it the kinematics follow"
    )
    assert warning.hints[0].value == {"q3": "rad"}


def test_a_joint_that_does_not_move_the_tool_keeps_the_unit_in_its_name(read: Read) -> None:
    """The last joint turns about the flange: what the others are in is not what it is in."""
    names = [*joints(" [rad]", 5), "q6 [deg]"]
    log = read(csv([*names, *XYZ], Q * np.where(np.arange(6) == 5, DEG, 1.0), FLANGE), UR5E)
    np.testing.assert_allclose(log.q, Q, atol=PRINTED)
    assert not log.warnings


def test_a_still_joint_in_another_base_is_in_the_unit_of_its_name(read: Read) -> None:
    """As deg the first joint would hardly turn, which is what another base does."""
    q = Q.copy()
    q[:, 0] = 1.3
    turned = Rotation.from_euler("z", -1.3).apply(poses_over_log(UR5E, q)[0])
    log = read(csv([*joints(" [rad]"), *XYZ], q, turned), UR5E)
    np.testing.assert_allclose(log.q, q, atol=PRINTED)
    assert not log.warnings


@pytest.mark.slow
@pytest.mark.parametrize("tool", [0.0, 0.15])
@pytest.mark.parametrize(
    ("header", "values", "lengths"),
    [(" [deg]", Q, 1.0), ("", Q * DEG, 1e3), (" [rad]", Q * DEG, 1.0), ("", Q * DEG * 1.0, 1.0)],
)
def test_robot_and_units_are_found_together(
    header: str, values: FloatArray, lengths: float, tool: float, write: Write
) -> None:
    position, _ = poses_over_log(UR5E.placed(tool=translation(0.0, 0.0, tool)), Q)
    xyz = XYZ if lengths == 1.0 else ["x", "y", "z"]
    run = ingest_log([write(csv([*joints(header), *xyz], values, position * lengths))])
    assert run.robot == UR5E
    np.testing.assert_allclose(run.log.q, Q, atol=PRINTED)
    assert run.log.tcp_position is not None
    np.testing.assert_allclose(run.log.tcp_position, position, atol=PRINTED)
    assert [one.kind for one in run.log.warnings] == (["unit-contradiction"] if header else [])


def test_wraps_that_contradict_the_header_are_decided_where_the_tool_was_recorded(write: Write) -> None:
    position, _ = poses_over_log(UR5E, WRAPPED)
    run = ingest_log([write(csv([*joints(" [deg]"), *XYZ], WRAPPED, position))])
    np.testing.assert_allclose(run.log.q, WRAPPED, atol=PRINTED)
    assert [one.kind for one in run.log.warnings] == ["unit-contradiction"]


EULER = ROTATION.as_euler("xyz")
SPINNING = np.column_stack((EULER[:, :2], np.remainder(EULER[:, 2] + 3 * T + np.pi, 2 * np.pi) - np.pi))
RPY = ("roll", "pitch", "yaw")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("header", "values", "taken", "asks"),
    [
        ("deg", EULER, "deg", False),
        ("deg", SPINNING, "deg", True),
        ("rad", EULER * DEG, "rad", True),
        ("rad", SPINNING * DEG, "rad", True),
        ("", EULER, "rad", False),
        ("", EULER * 4, "deg", False),
        ("", EULER * DEG, "deg", None),
        ("", SPINNING, "rad", None),
        ("rad", EULER, "rad", None),
        ("deg", SPINNING * DEG, "deg", None),
    ],
)
def test_the_unit_of_an_orientation_without_a_robot(
    header: str, values: FloatArray, taken: str, asks: bool | None, read: Read
) -> None:
    names = [*joints(" [rad]"), *XYZ, *(f"{name} [{header}]" if header else name for name in RPY)]
    table = csv(names, Q, FLANGE, values)
    log = read(table)
    assert log.units["yaw"] == taken
    assert assumed(log) == ([] if asks is None else [(f"the orientation is in {taken}", "rotation", asks)])
    follow_hints(lambda **given: read(table, **given), log)


def test_a_rotation_vector_that_flips_tells_its_unit(read: Read) -> None:
    turning = Rotation.from_rotvec(np.outer(2.5 + 0.5 * T, [0.6, 0.8, 0.0])).as_rotvec()
    names = [*joints(" [rad]"), *XYZ, "rotvec_x", "rotvec_y", "rotvec_z"]
    for unit, values in (("rad", turning), ("deg", turning * DEG)):
        log = read(csv(names, Q, FLANGE, values))
        assert (log.units["rotvec_x"], log.warnings) == (unit, ())
        lying = [f"{name} [{'deg' if unit == 'rad' else 'rad'}]" for name in names[-3:]]
        (doubted,) = read(csv([*names[:-3], *lying], Q, FLANGE, values)).warnings
        assert (doubted.role, doubted.blocks_verdict) == ("rotation", True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "values", "said"),
    [
        (
            [f"{name} [deg]" for name in RPY],
            ROTATION.as_euler("XYZ", degrees=True),
            "rpy in deg .* as xyz in deg",
        ),
        ([f"{name} [deg]" for name in RPY], ROTATION.as_rotvec(), "rpy in deg .* as vector in rad"),
        (["rotvec_x", "rotvec_y", "rotvec_z"], ROTATION.as_euler("ZYX"), "vector in rad .* as zyx in rad"),
        (["qx", "qy", "qz", "qw"], ROTATION.as_quat()[:, [3, 0, 1, 2]], "quat_xyzw .* as quat_wxyz"),
        (
            [f"r{i}{j}" for i in "123" for j in "123"],
            ROTATION.as_matrix().transpose(0, 2, 1).reshape(-1, 9),
            "matrix by rows .* as matrix by columns",
        ),
    ],
)
def test_the_kinematics_decide_on_the_form_against_the_names(
    names: list[str], values: FloatArray, said: str, read: Read
) -> None:
    table = csv([*joints(" [rad]"), *XYZ, *names], Q, FLANGE, values)
    log = read(table, UR5E)
    assert log.tcp_quat_xyzw is not None
    np.testing.assert_allclose(
        np.abs((log.tcp_quat_xyzw * ROTATION.as_quat()).sum(axis=1)), 1.0, atol=PRINTED
    )
    (warning,) = log.warnings
    assert warning.kind == "unit-contradiction"
    was, now = said.split(" .* ")
    assert f": {was} contradicts the kinematics: taken {now}: with it" in warning.message
    follow_hints(lambda **given: read(table, UR5E, **given), log)


@pytest.mark.parametrize("turns", [EULER, EULER * np.nan], ids=["of several forms", "empty"])
def test_a_unit_of_every_angle_is_no_matter_to_an_orientation_that_is_not_used(
    turns: FloatArray, read: Read
) -> None:
    table = csv([*joints(" [rad]"), *XYZ, "rx", "ry", "rz"], Q, FLANGE, turns)
    assert read(table, unit={"": "rad"}).rotation_form is None


@pytest.mark.parametrize(("unit", "per_m"), [("m", 1e3), ("mm", 1.0), ("cm", 0.01)])
def test_positions_where_no_arm_works_are_doubted(unit: str, per_m: float, read: Read) -> None:
    table = csv([*joints(" [rad]"), *(f"{axis} [{unit}]" for axis in "xyz")], Q, FLANGE * per_m)
    log = read(table)
    assert log.units["x"] == unit
    assert assumed(log) == [(f"the positions are in {unit}", "position", False)]
    follow_hints(lambda **given: read(table, **given), log)


@pytest.mark.slow
@pytest.mark.parametrize(
    "table",
    [
        csv(joints(" [deg]"), Q),
        csv(joints(), Q),
        csv([*joints(" [rad]"), "x", "y", "z", *RPY], Q, FLANGE * 1e3, EULER),
        csv([*joints(" [rad]"), *XYZ, *(f"{name} [deg]" for name in RPY)], Q, FLANGE, EULER),
        csv(joints(" [rad]"), Q, t=T / 200).replace("t [s]", "t"),
        "\n".join(line.split(",", 1)[1] for line in csv(joints(" [rad]"), Q).splitlines()),
    ],
    ids=[
        "doubted joints",
        "assumed joints",
        "far positions",
        "orientation",
        "a unit of the time",
        "no time",
    ],
)
def test_a_map_gives_nothing_that_is_only_assumed(table: str, write: Write) -> None:
    log = read_log([write(table)])
    written = format_map(map_of(log))
    again = read_log([write(table)], read_map(write(written, "lab.toml")))
    assert [str(one) for one in again.warnings] == [str(one) for one in log.warnings]
    assert (again.units, again.columns) == (log.units, log.columns)
    for column in log.columns:
        if column.uncertainty:
            assert f'= "{column.unit}"  # assumed: {column.uncertainty}' in written


def test_joints_turn_by_their_own_columns(write: Write) -> None:
    """A joint may be called as a recorded x is, which slides; one that nobody gave a column turns."""
    names = ["a [deg]", "b [deg]", *XYZ]
    table = csv(names, Q[:, :2] * DEG, FLANGE)
    options = LogMap(joints=("a", "b"), names=("x", "b"))
    run = ingest_log([write(table)], read=options)
    assert (is_revolute(run.log, None).tolist(), run.joint_units) == ([True, True], ["rad", "rad"])
    bare = replace(run.log, columns=())
    assert (is_revolute(bare, None).tolist(), bare.joint_units) == ([True, True], ("rad", "rad"))


def test_the_same_unit_for_every_angle_confirms_the_names(read: Read) -> None:
    assert not read(csv(joints(" [deg]"), Q), unit={"": "deg"}).warnings
    with pytest.raises(LogError, match="found q1, q2, q3, q4, q5, q6 in deg by name or source"):
        read(csv(joints(" [deg]"), WRAPPED), unit={"": "rad"})


@pytest.mark.parametrize("by_column", [False, True])
@pytest.mark.parametrize(
    ("unit", "values", "why"),
    [
        ("deg", Q, "values of no more than 2.39999 may be rad as well"),
        ("deg", WRAPPED, "2 steps of about 6.28 from one row to the next"),
        ("rad", 6 * Q, "values of 14.3964 are more than two turns as rad"),
        ("rad", WRAPPED * DEG, "2 steps of about 360 from one row to the next"),
        ("rad", Q * 2, None),
        ("deg", Q * DEG, None),
        ("deg", WRAPPED * DEG, None),
        ("rad", WRAPPED, None),
    ],
)
def test_a_given_unit_is_used_and_what_contradicts_it_is_named(
    unit: str, values: FloatArray, why: str | None, by_column: bool, read: Read, write: Write
) -> None:
    """A saved map is applied to a file in other units: not in silence."""
    given = dict.fromkeys(joints(), unit) if by_column else {"": unit}
    log = read(csv(joints(), values), unit=given)
    np.testing.assert_allclose(log.q, values / (DEG if unit == "deg" else 1.0), atol=PRINTED)
    assert assumed(log) == ([(f"the joints are in {unit}", "joint", False)] if why else [])
    if why is not None:
        (warning,) = log.warnings
        other = "rad" if unit == "deg" else "deg"
        assert f": {unit} (given as an option) is used, though {why}" in warning.message
        assert warning.hints[0].value == dict.fromkeys(joints(), other)
        lab = write(format_map(map_of(log)), "lab.toml")
        again = read_log([write(csv(joints(), values))], read_map(lab))
        assert (again.units, assumed(again)) == (log.units, assumed(log))


@pytest.mark.parametrize(
    ("unit", "values", "taken"),
    [("rad", EULER * DEG, "rad"), ("deg", EULER, "deg"), ("deg", EULER * DEG, None), ("rad", SPINNING, None)],
)
def test_a_given_unit_of_an_orientation_is_compared_with_its_size_and_wraps(
    unit: str, values: FloatArray, taken: str | None, read: Read
) -> None:
    table = csv([*joints(" [rad]"), *XYZ, *RPY], Q, FLANGE, values)
    log = read(table, unit=dict.fromkeys(RPY, unit))
    assert log.units["yaw"] == unit
    assert assumed(log) == ([(f"the orientation is in {taken}", "rotation", False)] if taken else [])


def test_a_given_form_or_unit_of_an_orientation_that_contradicts_the_kinematics_is_used(read: Read) -> None:
    table = csv([*joints(" [rad]"), *XYZ, "rx", "ry", "rz"], Q, FLANGE, ROTATION.as_rotvec())
    log = read(table, UR5E, rotation="rpy")
    assert (log.rotation_form, assumed(log)) == (
        "rpy",
        [("the orientation is rpy in rad", "rotation", False)],
    )
    (warning,) = log.warnings
    assert "taken as rpy in rad, though as vector in rad it would fit: with it the arm's" in warning.message
    follow_hints(lambda **given: read(table, UR5E, **given), log)
    log = read(table, UR5E, rotation="vector", unit=dict.fromkeys(("rx", "ry", "rz"), "deg"))
    assert (log.units["rx"], assumed(log)) == ("deg", [("the orientation is in deg", "rotation", False)])
