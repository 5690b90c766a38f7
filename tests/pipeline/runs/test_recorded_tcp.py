"""Kinematics that do not come near the recorded tool centre point are told of, with what would help."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asserting import there
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log, positions_over_log
from urmpipe_models.math3d import from_offset, translation
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_pipeline.joint_log import JointLog, LogColumn
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.recorded_tcp import (
    count_initial_outliers,
    infer_robot,
    missing_tool_warning,
    recorded_tcp_warnings,
)
from urmpipe_pipeline.sources import ReadOptions
from urmpipe_pipeline.sources.units.kinematic_units import Recorded
from urmpipe_pipeline.sources.vocabulary import vocabulary

SHARED = Path(__file__).parents[4] / "shared" / "logs"
needs_shared = pytest.mark.skipif(not SHARED.is_dir(), reason="the folder shared is not beside the checkout")

UR5E = load_robot("ur5e")
T = np.linspace(0, 1, 60)[:, None]
Q = 0.4 + np.arange(6) * 0.3 + 0.5 * np.sin(T * (1 + 0.4 * np.arange(6)))


def log(q: FloatArray, recorded: FloatArray) -> JointLog:
    names = tuple(f"q{k}" for k in range(1, 7))
    t_ns = np.arange(len(q)) * 5_000_000
    return JointLog("log", "table", (), t_ns, names, q, tcp_position=recorded)


def said(q: FloatArray, recorded: FloatArray) -> str:
    (warning,) = recorded_tcp_warnings(UR5E, log(q, recorded))
    assert warning.kind == "recorded-tcp-far"
    return warning.message


@pytest.mark.parametrize("tool", [(0.0, 0.0, 0.0), (0.02, 0.0, 0.15)])
def test_an_unknown_tool_is_no_reason(tool: tuple[float, float, float]) -> None:
    recorded = positions_over_log(UR5E.placed(tool=translation(*tool)), Q)
    assert recorded_tcp_warnings(UR5E, log(Q, recorded)) == []


def test_exchanged_joints_are_found() -> None:
    message = said(Q[:, [0, 2, 1, 3, 4, 5]], positions_over_log(UR5E, Q))
    assert re.match(
        r"the kinematics of ur5e stay \d+\.\d mm \(rms\) from the recorded TCP \(\d+\.\d\d mm ", message
    )
    assert message.endswith(": with q2 and q3 exchanged they agree within 0.00 mm")


def test_exchanged_joints_are_named_as_the_file_names_its_columns() -> None:
    exchanged = log(Q[:, [0, 2, 1, 3, 4, 5]], positions_over_log(UR5E, Q))
    named = [f"J{k} [rad]" for k in range(1, 7)]
    for headers, option in (
        (["A"] + [""] * 5, "A,9,8,10,11,12"),
        (list("ABCDEF"), "A,C,B,D,E,F"),
        (named, "J1,J3,J2,J4,J5,J6"),
        (["Achse 1 (rad)", "A,2", "A3", "A", "A", "A6"], "'Achse 1,A3,8,10,11,A6'"),
    ):
        columns = tuple(
            LogColumn(exchanged.joints[k], header, "joint", k, "rad", number=k + 7)
            for k, header in enumerate(headers)
        )
        (warning,) = recorded_tcp_warnings(UR5E, replace(exchanged, columns=columns))
        assert str(warning).endswith(f"--joints {option} exchanges them")


def test_a_joint_that_is_counted_the_other_way_is_found() -> None:
    message = said(Q * np.array([1, 1, -1, 1, 1, 1]), positions_over_log(UR5E, Q))
    assert message.endswith(": with q3 reversed in sign they agree within 0.00 mm")


def test_another_base_is_found_and_its_option_helps() -> None:
    base = from_offset((0.5, -0.3, 0.8, 0.0, 0.0, 1.2))
    recorded = positions_over_log(UR5E.placed(base=base), Q)
    (warning,) = recorded_tcp_warnings(UR5E, log(Q, recorded))
    assert warning.message.endswith("on another base they agree within 0.00 mm")
    (hint,) = warning.hints
    found = np.array(hint.value)
    np.testing.assert_allclose(found, (0.5, -0.3, 0.8, 0.0, 0.0, 1.2), atol=5e-5)  # as printed
    placed = UR5E.placed(base=from_offset(found.tolist()))
    assert recorded_tcp_warnings(placed, log(Q, recorded)) == []


def test_another_robot_is_only_told_of() -> None:
    message = said(Q, 1.3 * positions_over_log(UR5E, Q) + np.sin(9 * T))
    assert message.endswith(": robot, base, units, zeros, signs or order of the joints may differ")


def test_nothing_is_said_without_motion_robot_or_recorded_tcp() -> None:
    still = np.broadcast_to(Q[:1], Q.shape)
    assert recorded_tcp_warnings(UR5E, log(np.ascontiguousarray(still), np.full((60, 3), 0.5))) == []
    assert recorded_tcp_warnings(None, log(Q, np.full((60, 3), 0.5))) == []
    assert recorded_tcp_warnings(UR5E, JointLog("log", "table", (), np.arange(60), tuple("abcdef"), Q)) == []


def test_a_tool_that_was_not_told_is_found() -> None:
    recorded = positions_over_log(UR5E.placed(tool=translation(0.02, 0.0, 0.15)), Q)
    (warning,) = missing_tool_warning(UR5E, log(Q, recorded))
    assert warning.kind == "recorded-tcp-tool"
    assert warning.message == ("the kinematics of ur5e stay 151.3 mm (rms) from the recorded TCP")
    assert missing_tool_warning(UR5E.placed(tool=translation(0.02, 0.0, 0.15)), log(Q, recorded)) == []
    (other,) = missing_tool_warning(UR5E.placed(tool=translation(0.0, 0.0, 0.1)), log(Q, recorded))
    assert other.hints[0].value == [0.02, 0.0, 0.15]  # the whole tool, not what is lacking


@pytest.mark.parametrize(
    ("base", "said"),
    [((0.0, 0.02, -0.005), "0,0.02,-0.005"), ((0.0, 0.0, 0.0, 0.0, 0.0, 0.1), "0,0,0,0,0,0.1")],
)
def test_a_small_shift_of_the_base_is_found(base: tuple[float, ...], said: str) -> None:
    recorded = positions_over_log(UR5E.placed(base=from_offset(base)), Q)
    (warning,) = missing_tool_warning(UR5E, log(Q, recorded))
    told = str(warning)
    assert told.endswith(
        f" mm (rms) from the recorded TCP; --robot ur5e --base {said} brings them within 0.00 mm"
    )


def test_no_tool_is_found_for_a_log_that_hardly_moves_or_needs_more_than_a_tool() -> None:
    still = np.repeat(Q[:1], len(Q), axis=0)
    (warning,) = missing_tool_warning(
        UR5E, log(still, positions_over_log(UR5E, still) + np.array([0.0, 0.0, 0.15]))
    )
    up = np.linalg.inv(poses_over_log(UR5E, still[:1])[1][0])[:, 2] * 0.15
    shown = ",".join(f"{value:g}" for value in np.round(up, 4) + 0.0)
    assert str(warning) == (
        "the kinematics of ur5e stay 150.0 mm (rms) from the recorded TCP, and the log moves too"
        " little to show why: perhaps a tool or a base is missing; --robot ur5e --tool"
        f" {shown} brings them within {1e3 * np.linalg.norm(np.round(up, 4) - up):.2f} mm here"
    )
    few = still[:3]  # too few poses for a tool, and not one tool for all of them
    scattered = positions_over_log(UR5E, few) + np.array([[0.15], [0.25], [0.2]])
    (warning,) = missing_tool_warning(UR5E, log(few, scattered))
    assert str(warning).endswith("base is missing; --tool X,Y,Z or --base X,Y,Z sets it")
    tooled = UR5E.placed(tool=translation(0.0, 0.0, 0.1))
    (warning,) = missing_tool_warning(tooled, log(still, positions_over_log(UR5E, still)))
    assert str(warning) == (
        "the kinematics of ur5e stay 100.0 mm (rms) from the recorded TCP, and the log moves too"
        " little to show why: perhaps the tool, 100.0 mm long, is another, or a base is missing;"
        " --robot ur5e --tool 0,0,0 brings them within 0.00 mm here"
    )
    assert missing_tool_warning(UR5E, log(Q, 1.3 * positions_over_log(UR5E, Q) + np.sin(9 * T))) == []


def turning(robot: Chain, q: FloatArray) -> dict[str, Any]:
    """What a log holds of the orientations of an arm."""
    _, rotation = poses_over_log(robot, q)
    return {"tcp_rotation": rotation.reshape(-1, 9), "rotation_form": "matrix"}


SIX = [name for name in robot_names() if len(load_robot(name).moving) == 6]
TWINS = {"ur3": "ur3e", "ur3e": "ur3"}


@pytest.mark.slow
@pytest.mark.parametrize("true", SIX)
def test_another_robot_of_the_catalogue_is_found_behind_a_tool_and_a_calibration(true: str) -> None:
    rng = np.random.default_rng(SIX.index(true))
    tool = translation(0.02, 0.0, 0.15)
    recorded = positions_over_log(calibrated(load_robot(true).placed(tool=tool), 3e-4, rng), Q)
    assert recorded_tcp_warnings(load_robot(true), log(Q, recorded)) == []
    for given in sorted({*SIX} - {true, TWINS.get(true)}):
        (warning,) = recorded_tcp_warnings(load_robot(given), log(Q, recorded))
        assert ("robot", true) in [(hint.parameter, hint.value) for hint in warning.hints]


def test_a_still_arm_tells_of_another_robot_that_needs_no_tool() -> None:
    still = np.repeat(Q[:1], len(Q), axis=0)
    recorded = positions_over_log(UR5E, still) + np.array([0.001, 0.0, 0.001])
    (warning,) = recorded_tcp_warnings(load_robot("ur5"), log(still, recorded))
    assert re.fullmatch(
        r"the kinematics of ur5 stay \d+\.\d mm \(rms\) from the recorded TCP:"
        r" those of ur5e agree within 1.41 mm",
        warning.message,
    )
    assert missing_tool_warning(load_robot("ur5"), log(still, recorded)) == []  # one line a cause
    assert recorded_tcp_warnings(UR5E, log(still, recorded)) == []


@pytest.mark.parametrize("joint", range(5))
def test_a_sign_shows_in_a_small_motion_too(joint: int) -> None:
    """The arm comes within 20 mm of it by some tool, in a motion of 22 mm rms."""
    q = Q[0] + 0.15 * (Q - Q[0])
    (warning,) = recorded_tcp_warnings(
        UR5E, log(q * np.where(np.arange(6) == joint, -1, 1), positions_over_log(UR5E, q))
    )
    assert float(warning.message.partition("TCP (")[2].partition(" mm")[0]) < 20.0
    assert warning.message.endswith(f"with q{joint + 1} reversed in sign they agree within 0.00 mm")


def test_the_orientation_tells_of_a_joint_that_moves_no_point() -> None:
    recorded = positions_over_log(UR5E, Q)
    backwards = replace(log(Q * [1, 1, 1, 1, 1, -1], recorded), **turning(UR5E, Q))
    (warning,) = recorded_tcp_warnings(UR5E, backwards)
    assert "with q6 reversed in sign they agree within 0.00 mm and" in warning.message
    assert recorded_tcp_warnings(UR5E, replace(log(Q, recorded), **turning(UR5E, Q))) == []


def calibrated(robot: Chain, size: float, rng: np.random.Generator) -> Chain:
    """An arm as it was built: its frames are off by so much in [m], and in [rad] per half a metre."""
    frames = [
        replace(
            joint, origin=joint.origin @ from_offset([*rng.normal(0, size, 3), *rng.normal(0, 2 * size, 3)])
        )
        for joint in robot.joints
    ]
    return replace(robot, joints=tuple(frames))


def any_motion(rng: np.random.Generator) -> FloatArray:
    """Joints that swing, some of them or all, little or much, about any pose or a square one."""
    t = np.linspace(0, 1, int(rng.choice([12, 60, 300])))[:, None]
    about = rng.choice(np.pi / 2 * np.arange(-2, 3), 6) if rng.random() < 0.5 else rng.uniform(-3, 3, 6)
    wide = rng.uniform(0, 1.5, 6) * rng.choice([0.02, 0.1, 0.5, 1.0]) * (rng.random(6) < rng.choice([0.3, 1]))
    return np.asarray(about + wide * np.sin(t * rng.uniform(0.5, 6, 6) + rng.uniform(0, 6, 6)))


@pytest.mark.slow
def test_nothing_is_said_of_logs_that_are_right() -> None:
    """With the calibration of a real arm, noise and rounding, a tool that was given or not."""
    for seed in range(120):
        rng = np.random.default_rng(seed)
        robot, q = load_robot(SIX[seed % len(SIX)]), any_motion(rng)
        tool = from_offset([*rng.uniform(-0.1, 0.2, 3), *rng.uniform(-1, 1, 3)])
        held = calibrated(robot.placed(tool=tool), rng.choice([0.0, 3e-4, 6e-4]), rng)
        noisy = positions_over_log(held, q) + rng.normal(0, rng.choice([0, 1e-4, 1e-3]), (len(q), 3))
        one = log(q, np.round(noisy, rng.choice([4, 9])))
        if seed % 2:
            one = replace(one, **turning(held, q))
        given = robot.placed(tool=tool) if seed % 3 else robot
        assert recorded_tcp_warnings(given, one) == [], f"seed {seed}"


def test_the_rotation_of_a_tool_is_in_the_hint_and_helps() -> None:
    tool = from_offset((0.02, 0.0, 0.15, 0.3, -0.2, np.pi / 2))
    recorded = replace(
        log(Q, positions_over_log(UR5E.placed(tool=tool), Q)), **turning(UR5E.placed(tool=tool), Q)
    )
    for turned in (False, True):
        (warning,) = missing_tool_warning(UR5E, recorded, turned=turned)
        (hint,) = warning.hints
        assert str(hint) == "--robot ur5e --tool 0.02,0,0.15,0.3,-0.2,1.5708"
        assert isinstance(hint.value, list)
        given = UR5E.placed(tool=from_offset([float(value) for value in hint.value]))
        assert missing_tool_warning(given, recorded, turned=turned) == []


def test_only_a_turned_tool_is_found_where_orientations_are_judged() -> None:
    tool = from_offset((0.0, 0.0, 0.0, 0.0, 0.0, 0.5))
    recorded = replace(log(Q, positions_over_log(UR5E, Q)), **turning(UR5E.placed(tool=tool), Q))
    assert missing_tool_warning(UR5E, recorded) == []
    (warning,) = missing_tool_warning(UR5E, recorded, turned=True)
    assert str(warning) == (
        "the kinematics of ur5e stay 0.0 mm and 28.65 deg (rms) from the recorded TCP;"
        " --robot ur5e --tool 0,0,0,0,0,0.5 brings them within 0.00 mm and 0.0 deg"
    )


def test_an_arm_from_a_file_is_not_called_by_a_name_of_the_catalogue() -> None:
    own = replace(UR5E, tip=translation(0.0, 0.0, 0.01))
    recorded = positions_over_log(own.placed(tool=translation(0.0, 0.0, 0.15)), Q)
    (warning,) = missing_tool_warning(own, log(Q, recorded))
    assert str(warning.hints[0]) == "--tool 0,0,0.15"


# The first rows


TOOLED = UR5E.placed(tool=translation(0.0, 0.02, 0.15))


@pytest.mark.parametrize("rows", [1, 7, 25])
def test_first_rows_without_a_tool_are_told_and_count_nowhere_else(rows: int) -> None:
    recorded = positions_over_log(TOOLED, Q)
    recorded[:rows] = positions_over_log(UR5E, Q)[:rows]
    first = "the first row" if rows == 1 else f"the first {rows} rows"
    (told,) = recorded_tcp_warnings(TOOLED, log(Q, recorded))
    assert (told.kind, told.row, told.message) == (
        "recorded-tcp-start",
        1,
        f"{first} of 60 recorded the TCP 151.3 mm from where the others have it: no tool or pose known"
        " yet? They are kept and judged with the others",
    )
    assert missing_tool_warning(TOOLED, log(Q, recorded)) == []
    (lacking,) = missing_tool_warning(UR5E, log(Q, recorded))
    assert lacking.hints[0].value == [0.0, 0.02, 0.15]


def test_first_points_of_zeros_are_told_without_a_robot_and_hide_none() -> None:
    recorded = positions_over_log(TOOLED, Q)
    recorded[:12] = 0.0
    for robot in (None, TOOLED, UR5E):
        (told,) = recorded_tcp_warnings(robot, log(Q, recorded))
        assert told.message.startswith("the first 12 rows of 60 recorded the TCP as 0, 0, 0: ")
    position = positions_over_log(UR5E, Q) * (np.arange(60) > 11)[:, None]
    rad, metre = (vocabulary().units[name] for name in ("rad", "m"))
    found = infer_robot(Recorded(log(Q, position).joints, Q, position, (rad,) * 6, (metre,) * 3))
    assert found is not None
    assert found[0] == UR5E


def test_the_last_outlying_row_of_a_long_log_is_found_between_those_looked_at() -> None:
    t = np.linspace(0, 1, 50_000)[:, None]
    q = 0.4 + np.arange(6) * 0.3 + 0.5 * np.sin(t * (1 + 0.4 * np.arange(6)))
    recorded = positions_over_log(TOOLED, q)
    recorded[:3210] = positions_over_log(UR5E, q)[:3210]
    assert count_initial_outliers(TOOLED, log(q, recorded))[0] == 3210


@pytest.mark.filterwarnings("error")
def test_a_start_is_not_told_where_no_row_has_both_sides() -> None:
    q, recorded = Q.copy(), positions_over_log(UR5E, Q)
    q[::2], recorded[1::2] = np.nan, np.nan
    assert count_initial_outliers(TOOLED, log(q, recorded)) == (0, np.inf)


REAL = {
    "ur5e-rtde-static/robot_data.csv": ("ur5e", None),
    "ur-rtde-10rows/robot_data.csv": ("ur5e", None),
    "ur5-factory-calibration/joint-eef-data.csv": ("ur5e", None),
    "pybotics-ur10-fk/ur10-joints-poses.csv": ("ur10", {"": "deg"}),
}


@pytest.mark.slow
@needs_shared
@pytest.mark.parametrize("file", REAL)
def test_real_logs_tell_their_robot_from_any_other(file: str) -> None:
    robot, unit = REAL[file]
    run = ingest_log([SHARED / file], robot=load_robot(robot), read=ReadOptions(unit=unit or {}))
    assert [one for one in run.warnings if one.kind.startswith("recorded-tcp")] == []
    for given in [] if "10rows" in file else sorted({*SIX} - {robot}):
        (warning,) = recorded_tcp_warnings(load_robot(given), run.log)
        assert [(hint.parameter, hint.value) for hint in warning.hints] == [("robot", robot)], given
        assert f": those of {robot} agree within " in warning.message


def test_a_recorded_rotation_vector_goes_on_past_pi() -> None:
    recorded = np.array([[0.0, 0.0, 3.1], [np.nan] * 3, [0.0, 0.0, 3.2 - 2 * np.pi]])
    nothing = np.empty((3, 0))
    bare = JointLog("log", "table", (), np.arange(3), (), nothing)
    found = there(replace(bare, tcp_rotation=recorded, rotation_form="vector").tcp_rotation_continuous)
    # 2 pi is taken away and added again: two roundings of 4e-16
    np.testing.assert_allclose(found[[0, 2]], [[0.0, 0.0, 3.1], [0.0, 0.0, 3.2]], rtol=0, atol=1e-15)
    assert np.isnan(found[1]).all()
    assert bare.tcp_rotation_continuous is None
