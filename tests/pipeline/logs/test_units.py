"""Units: in the name, given, known of the source, told by the data, or assumed with a warning."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from asserting import OTHER_TIME
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import OptionError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]
Arm = Callable[..., Chain]

DEG = np.pi / 180


def csv_of(values: FloatArray, period: float = 0.01, names: tuple[str, ...] = ("q1",)) -> str:
    rows = [f"{k * period:.6f}," + ",".join(map(repr, row)) for k, row in enumerate(values.tolist())]
    return "\n".join([",".join(("t", *names)), *rows, ""])


def evidence(log: JointLog, what: str) -> str:
    return next(i.evidence for i in log.inferences if i.what == what)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("q1 [deg]", "deg"), ("q1 (rad)", "rad"), ("q1 (°)", "deg"), ("q1[Grad]", "deg"), ("q1_deg", "deg"),
        ("q1_rad", "rad"), ("q1 [degrees]", "deg"), ("q1 (Radians)", "rad"), ("q1 [deg sign]", "deg"),
        ("q1 (grd)", "deg"), ("q1 [Grad]", "deg"), ("achse_1_grad", "deg"),
    ],
)  # fmt: skip
def test_units_in_names(read: Read, name: str, unit: str) -> None:
    value = 30 if unit == "deg" else 3
    log = read(f"t,{name}\n0,{value}\n0.1,{value + 1}\n")
    assert log.q[0, 0] == value * (DEG if unit == "deg" else 1.0)
    assert list(log.units.values()) == ["s", unit]
    assert not log.warnings


def test_a_unit_that_is_not_known_is_refused(wrong: Wrong) -> None:
    text = "t,q1,q2\n0,30,30\n0.1,31,30\n"
    assert wrong(text, unit={"": "gon"}) == ["unit (--unit): found 'gon', allowed: rad, deg"]
    assert wrong(text, unit={"q1": "gon"}) == [
        "unit (--unit): found 'gon', allowed: rad, deg, m, mm, cm, s, ms, us, ns, dmy, mdy"
    ]
    assert wrong("t,q1 [gon]\n0,30\n0.1,31\n") == [
        "log.csv, column q1 [gon]: found the unit 'gon', allowed: rad, deg, m, mm, cm;"
        " convert the values; --unit q1=deg keeps the values unchanged"
    ]


def test_mixed_units_of_slides_and_turns(read: Read, arm: Arm) -> None:
    text = ",time,lift_mm,c_arm_lateral_m,c_arm_wigwag_deg\n0,0.0,100,0.1,90\n1,0.1,110,0.2,91\n"
    for robot in (None, arm(3, "prismatic", "prismatic", "revolute")):
        log = read(text, robot)
        assert log.joints == ("lift_mm", "c_arm_lateral_m", "c_arm_wigwag_deg")
        assert log.q[0].tolist() == [0.1, 0.1, 90 * DEG]
        assert log.units == {"time": "s", "lift_mm": "mm", "c_arm_lateral_m": "m", "c_arm_wigwag_deg": "deg"}


def test_a_slide_without_unit_is_taken_as_m(read: Read, arm: Arm) -> None:
    log = read("t,q1,q2\n0,0.5,0.5\n0.1,0.6,0.6\n", arm(2, "prismatic", "revolute"))
    assert log.units == {"t": "s", "q1": "m", "q2": "rad"}
    assert [warning.message for warning in log.warnings] == [
        "no unit is given for q1: the prismatic joints are taken as m",
        "no unit is given for q2: the joints are taken as rad",
    ]


def test_rates_follow_their_joints_unless_they_say_their_own_unit(read: Read) -> None:
    log = read("t,q1 [deg],q2 [deg],qd1,qd2\n0,30,30,60,60\n0.1,31,31,60,60\n")
    assert log.qd is not None
    assert log.qd[0, 0] == 60 * DEG
    assert log.units["qd1"] == "deg/s"
    log = read("t,q1 [deg],qd1 [rad/s]\n0,30,60\n0.1,31,60\n")
    assert log.qd is not None
    assert log.qd[0, 0] == 60
    assert log.units["qd1"] == "rad/s"


def test_units_given_by_the_user(read: Read, wrong: Wrong, arm: Arm) -> None:
    text = "t,q1,q2,q3\n0,30,0.5,5\n600,31,0.5,5\n"
    log = read(
        text, arm(3, "revolute", "revolute", "prismatic"), unit={"": "deg", "t": "ms", "2": "rad", "q3": "mm"}
    )
    assert log.q[0].tolist() == [30.0, 0.5 * DEG, 0.005]
    assert log.period == 0.6
    assert [(w.message.split(", though")[0], w.assumption) for w in log.warnings] == [
        ("q1: rad (given as an option) is used", "q1 is in rad"),
        ("q2: deg (given as an option) is used", "q2 is in deg"),
    ]
    assert wrong(text, unit={"": "mm"}) == ["unit (--unit): found 'mm', allowed: rad, deg"]
    assert wrong(text, unit={"q1": "inch"}) == [
        "unit (--unit): found 'inch', allowed: rad, deg, m, mm, cm, s, ms, us, ns, dmy, mdy"
    ]
    assert wrong(text, unit={"q9": "deg"}) == ["unit (--unit): found no column 'q9', allowed: t, q1, q2, q3"]
    assert wrong(text, unit={"q1": "s", "t": "s"}) == [
        "column q1: unit (--unit): found the unit s (given as an option), allowed: rad, deg, m, mm, cm"
    ]
    assert wrong(text, unit={"t": "deg"}) == [
        "unit (--unit): found deg for the time 't', allowed: s, ms, us, ns" + OTHER_TIME
    ]


def test_a_unit_that_does_not_fit_the_robot(wrong: Wrong, arm: Arm) -> None:
    assert wrong("t,q1 [mm]\n0,30\n0.1,31\n", arm(1)) == [
        "log.csv, column q1 [mm]: found the unit mm (its name), allowed: rad, deg"
    ]


def test_a_unit_that_is_not_known(wrong: Wrong, read: Read) -> None:
    text = "t,J1 [counts]\n0,30\n0.1,31\n"
    assert wrong(text) == [
        "log.csv, column J1 [counts]: found the unit 'counts', allowed: rad, deg, m, mm, cm;"
        " convert the values; --unit J1=deg keeps the values unchanged"
    ]
    assert read(text, unit={"J1": "deg"}).q[0, 0] == 30 * DEG


def test_a_line_of_units_that_are_not_known(read: Read, wrong: Wrong) -> None:
    text = "t,J1,J2\n[s],[counts],[counts]\n0,30,1\n0.1,31,1\n"
    said = "found the unit 'counts', allowed: rad, deg, m, mm, cm; convert the values;"
    said += " --unit J1=deg keeps the values unchanged"
    assert wrong(text) == [f"log.csv, column J1: {said}"]
    assert read(text, unit={"": "deg"}).units == {"t": "s", "J1": "deg", "J2": "deg"}
    powers = read("t,J1,J1,M,n\n[s],[rad],[Nm],[kg m2/s2],(1/min)\n0,30,1,1,1\n0.1,31,1,1,1\n")
    assert (powers.joints, powers.units) == (("J1",), {"t": "s", "J1": "rad"})
    numbered = read("a,b,c\n[t0],[q1],[q2]\n0,30,1\n0.1,31,1\n", joints=("2", "3"), unit={"": "deg"})
    assert numbered.joints == ("[q1]", "[q2]")
    named = read("of today\n[t],[q],[p]\n0,30,1\n0.1,31,1\n", joints=("2", "3"), unit={"": "deg"})
    assert named.joints == ("[q]", "[p]")


def test_radians_are_assumed_and_said(read: Read) -> None:
    log = read(csv_of(np.linspace(-3, 3, 50)[:, np.newaxis]))
    assert log.units["q1"] == "rad"
    assert [(w.kind, w.message) for w in log.warnings] == [
        ("assumed-unit", "no unit is given for q1: the joints are taken as rad")
    ]


def test_wraps_of_360_tell_degrees(read: Read) -> None:
    turning = (np.arange(0, 800, 0.05) + 180) % 360 - 180
    log = read(csv_of(turning[:, np.newaxis]))
    assert log.units["q1"] == "deg"
    assert evidence(log, "unit of q1") == "2 steps of about 360 from one row to the next"
    assert not log.warnings


def test_speeds_that_no_joint_reaches_are_a_reason_to_assume_degrees(read: Read) -> None:
    swinging = 40 * np.sin(2 * np.pi * 0.5 * np.arange(400) * 0.01)  # up to 126 a second
    log = read(csv_of(swinging[:, np.newaxis]))
    assert log.units["q1"] == "deg"
    said = "the joints are taken as deg: as rad it would turn at 124 rad/s for a tenth of the time"
    assert [(w.message, w.assumption) for w in log.warnings] == [
        (f"no unit is given for q1: {said}", "the joints are in deg")
    ]


def test_the_robots_limits_prove_no_unit(arm: Arm, wrong: Wrong) -> None:
    """Values beyond them in rad may be ticks as well as deg."""
    limited = arm(3)
    limited = replace(limited, joints=tuple(replace(j, lower=-6.3, upper=6.3) for j in limited.joints))
    for robot in (arm(3), limited):
        asked = wrong("10,-20,170\n-120,80,90\n", robot)[0]
        assert asked.startswith("log.csv: found values up to 170 in phi1, phi2, phi3 and no unit")


def test_slow_large_values_may_be_either(wrong: Wrong) -> None:
    assert wrong(csv_of(np.linspace(0, 60, 1000)[:, np.newaxis])) == [
        "log.csv: found values up to 60 in q1 and no unit, allowed: rad or deg; --unit rad or"
        " --unit deg specifies it"
    ]


def test_up_to_two_turns_are_radians_and_more_are_asked_about(read: Read, wrong: Wrong) -> None:
    assert read(csv_of(np.linspace(-12, 12, 2000)[:, np.newaxis])).units["q1"] == "rad"
    assert " and no unit, allowed: rad or deg" in wrong(csv_of(np.linspace(-20, 20, 2000)[:, np.newaxis]))[0]


def test_outliers_and_noise_prove_no_degrees(read: Read, wrong: Wrong) -> None:
    values = np.linspace(-3, 3, 500)
    values[[100, 200, 300]] = [20.0, -20.0, 15.0]
    assert read(csv_of(values[:, np.newaxis])).units["q1"] == "rad"
    noise = np.random.default_rng(1).normal(0, 5, (500, 1))  # too fast for rad, and for deg as well
    assert " and no unit, allowed: rad or deg" in wrong(csv_of(noise, 0.001))[0]


def test_a_joint_without_unit_is_like_the_others(read: Read) -> None:
    log = read("t,q1 [deg],q2\n0,30,40\n0.1,31,41\n")
    assert log.units == {"t": "s", "q1": "deg", "q2": "deg"}
    assert evidence(log, "unit of q2") == "as the other joint columns"


def test_positions_are_not_rescaled_because_they_look_too_far(read: Read) -> None:
    table = "x,y,z\n350,-659,625\n351,-658,625\n"
    log = read(table)
    assert log.tcp_position is not None
    np.testing.assert_array_equal(log.tcp_position[0], [350, -659, 625])
    (warning,) = [one for one in log.warnings if one.role == "position"]
    assert (warning.kind, warning.assumption, warning.blocks_verdict) == (
        "assumed-unit",
        "the positions are in m",
        True,
    )
    assert str(warning) == (
        "no unit is given for x, y, z: the positions are taken as m, though values of 658 reach further than"
        " any arm; --unit x=mm --unit y=mm --unit z=mm or --unit x=m --unit y=m --unit z=m specifies it"
    )
    for hint, per_m in zip(warning.hints, (1e3, 1.0), strict=True):
        told = read(table, unit=hint.value)
        assert told.tcp_position is not None
        np.testing.assert_allclose(told.tcp_position[0], np.array([350, -659, 625]) / per_m, rtol=1e-15)
        assumed = [one.assumption for one in told.warnings if one.role == "position"]
        assert assumed == (["the positions are in m"] if per_m == 1.0 else [])  # m is used, and not likely


def test_positions_far_beyond_an_arm_are_in_mm_beside_its_joints(read: Read) -> None:
    log = read("t,q1 [rad],x,y,z\n0,0.1,350,-659,625\n0.1,0.2,351,-658,625\n")
    assert log.tcp_position is not None
    np.testing.assert_allclose(log.tcp_position[0], [0.35, -0.659, 0.625], rtol=1e-15)
    (warning,) = log.warnings
    assert (warning.assumption, warning.blocks_verdict) == ("the positions are in mm", False)


def test_a_spike_among_positions_changes_no_unit(read: Read) -> None:
    rows = "".join(f"{k / 100},0.1,0.2,{9000 if k == 50 else 0.3}\n" for k in range(300))
    log = read(f"t,x,y,z\n{rows}")
    assert log.tcp_position is not None
    assert log.tcp_position[0].tolist() == [0.1, 0.2, 0.3]
    assert [one.blocks_verdict for one in log.warnings] == [False]


def test_positions_in_mm_by_their_names(read: Read) -> None:
    log = read("t;X_Act[mm];Y_Act[mm];Z_Act[mm]\n0;1;2;3\n0,1;1;2;3\n")
    assert log.tcp_position is not None
    np.testing.assert_array_equal(log.tcp_position[0], np.array([1, 2, 3]) * 1e-3)


def test_positions_without_unit_are_taken_as_m(read: Read) -> None:
    log = read("t,x,y,z\n0,0.1,0.2,0.3\n0.1,0.1,0.2,0.3\n")
    assert [w.message for w in log.warnings] == ["no unit is given for x, y, z: the positions are taken as m"]


def test_digits_of_a_coarse_format(read: Read) -> None:
    def digits(*cells: str) -> int | None:
        return read("t,q1\n" + "".join(f"{0.1 * k:.1f},{cell}\n" for k, cell in enumerate(cells))).digits

    assert digits("+1.571e+00", "0.0", "-3.142e-05", "Null") == 4
    assert digits("1.57e0", "2.00e0") == 3
    assert digits("7.6916151e-01", "2.4290446e-01") is None  # fine enough
    assert digits("1.571e+00", "1.57e+00") is None
    assert digits("1.571", "1.572") is None  # a short number need not be a coarse one
    assert digits("0.0", "0.0") is None


def test_a_position_without_unit_is_like_the_others(read: Read) -> None:
    log = read("t,x [mm],y,z\n0,100,200,300\n0.1,400,500,600\n")
    assert log.tcp_position is not None
    np.testing.assert_allclose(log.tcp_position, [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]], rtol=1e-15)
    assert not log.warnings


def test_a_rate_in_an_unknown_unit_is_refused_as_a_joint_is(wrong: Wrong) -> None:
    said = "found the unit 'rpm', allowed: rad, deg, m, mm, cm; convert the values;"
    said += " --unit qd1=deg keeps the values unchanged"
    assert wrong("t,q1 [rad],qd1 [rpm]\n0,1,2\n1,2,3\n") == [f"log.csv, column qd1 [rpm]: {said}"]


def test_recorded_rotation_vectors_follow_their_unit(read: Read, wrong: Wrong) -> None:
    header = ",".join(f"actual_TCP_pose_{k}{{}}" if k > 2 else f"actual_TCP_pose_{k}" for k in range(6))
    rows = "0,0.1,0,0,0,90,0,0\n0.1,0.1,0,0,0,,0,0\n"
    log = read("timestamp,actual_q_0," + header.replace("{}", " [deg]") + "\n" + rows)
    half = np.sqrt(0.5)
    assert log.tcp_quat_xyzw is not None
    np.testing.assert_allclose(log.tcp_quat_xyzw[0], [half, 0, 0, half], atol=1e-15)
    assert np.isnan(log.tcp_quat_xyzw[1, 0])
    assert [warning.kind for warning in log.warnings].count("missing") == 1
    said = wrong("timestamp,actual_q_0," + header.replace("{}", " [mm]") + "\n" + rows)
    assert said == ["log.csv, column actual_TCP_pose_3 [mm]: found the unit mm (its name), allowed: rad, deg"]


@pytest.mark.filterwarnings("error")
def test_huge_numbers_are_read_without_a_warning_of_numpy(read: Read, wrong: Wrong) -> None:
    rows = "0,1e308\n1,-1e308\n2,0\n"
    assert read(f"t [s],q1 [rad]\n{rows}").q[0, 0] == 1e308
    assert wrong(f"t [s],q1\n{rows}") == [
        "log.csv: found values up to 1e+308 in q1 and no unit, allowed: rad or deg; convert ticks and counts;"
        " --unit rad or --unit deg specifies it"
    ]


def test_a_unit_given_for_every_angle_does_not_reach_columns_whose_names_tell_another(read: Read) -> None:
    table = "t,q1 [deg],q2 [deg],q3\n0,1,2,3\n0.1,1,2,3\n"
    log = read(table, unit={"": "rad"})
    assert log.units == {"t": "s", "q1": "deg", "q2": "deg", "q3": "rad"}
    assert [(one.kind, str(one), one.assumption, one.role) for one in log.warnings] == [
        (
            "unit-not-reached",
            "q1, q2: rad does not reach them: their names say deg; --unit q1=rad --unit q2=rad does",
            "q1, q2 are in deg",
            "joint",
        )
    ]
    told = read(table, unit={"": "rad", **log.warnings[0].hints[0].value})  # type: ignore[dict-item]
    assert set(told.units.values()) == {"s", "rad"}
    assert not told.warnings


def test_a_unit_given_for_every_angle_reaches_what_the_source_tells_and_the_orientation(read: Read) -> None:
    names = [*(f"actual_q_{k}" for k in range(6)), *(f"actual_TCP_pose_{k}" for k in range(6))]
    rows = "".join(
        f"{k},{','.join(map(str, (*range(20, 26), 0.1, 0.2, 0.3, 50, 60, 70)))}\n" for k in range(2)
    )
    log = read(f"timestamp,{','.join(names)}\n{rows}", unit={"": "deg"})
    assert log.source == "ur-rtde"
    assert (log.units["actual_q_5"], log.units["actual_TCP_pose_5"]) == ("deg", "deg")
    assert not log.warnings


def test_numbers_name_columns_and_what_is_no_list_is_refused(read: Read) -> None:
    assert read("t,a,b\n0,1,2\n0.1,1,2\n", joints=[3, 2], time=1, unit={2: "deg"}).joints == ("b", "a")
    once: Any = (f"q{k}" for k in (1, 2))
    assert LogMap(joints=once).joints == ("q1", "q2")
    with pytest.raises(OptionError) as caught:
        LogMap(joints="q1", position=3, unit=3, interval=2.0)  # type: ignore[arg-type]
    columns = "allowed: columns by name or number, such as q1,q2 or 2,3"
    assert str(caught.value).split("\n") == [
        f"joints (--joints): found 'q1', {columns}",
        f"position (--position): found 3, {columns}",
        "unit (--unit): found 3, allowed: a unit of every angle, such as deg, or units by column, such as"
        " q1=deg",
        "interval (--interval): found 2.0, allowed: two ends for all revolute joints, or ends by joint, such"
        " as q1=-180:180",
    ]


@pytest.mark.parametrize("name", [one.name for one in fields(LogMap) if one.compare])
def test_each_option_of_reading_refuses_what_is_of_a_wrong_kind(name: str) -> None:
    default = getattr(LogMap(), name)
    odd_ones: list[Any] = [None, object(), 3j, {"q1": 3}, [None], pd.DataFrame({"q1": [1.0]})]
    for odd in odd_ones:
        if odd is default:
            continue
        with pytest.raises(OptionError) as caught:
            LogMap(**{name: odd})
        assert re.fullmatch(rf"{name}( \(--[a-z-]+\))?: found .{{1,60}}, allowed: .+", str(caught.value))


def test_lists_of_signs_and_offsets_are_taken(read: Read) -> None:
    log = read("t [s],a [rad],b [rad]\n0,1,2\n0.1,1,2\n", joints=[2, 3], signs=[1, -1], offsets=[0.5, 0])
    np.testing.assert_array_equal(log.q[0], [1.5, -2.0])
