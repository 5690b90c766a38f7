"""Kinematics that do not come near the recorded tool centre point are told of, with what would help."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from asserting import there
from urmpipe_models.arrays import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.transform import from_offset, translation
from urmpipe_pipeline.joint_log import JointLog, LogColumn
from urmpipe_pipeline.runs.recorded_tcp import far_from_recorded, lacking_tool

UR5E = load_robot("ur5e")
T = np.linspace(0, 1, 60)[:, None]
Q = 0.4 + np.arange(6) * 0.3 + 0.5 * np.sin(T * (1 + 0.4 * np.arange(6)))


def log(q: FloatArray, recorded: FloatArray) -> JointLog:
    names = tuple(f"q{k}" for k in range(1, 7))
    t_ns = np.arange(len(q)) * 5_000_000
    return JointLog("log", "table", (), t_ns, names, q, tcp_position=recorded)


def said(q: FloatArray, recorded: FloatArray) -> str:
    (warning,) = far_from_recorded(UR5E, log(q, recorded))
    assert warning.kind == "recorded-tcp-far"
    return warning.message


@pytest.mark.parametrize("tool", [(0.0, 0.0, 0.0), (0.02, 0.0, 0.15)])
def test_an_unknown_tool_is_no_reason(tool: tuple[float, float, float]) -> None:
    recorded = positions_over_log(UR5E.placed(tool=translation(*tool)), Q)
    assert far_from_recorded(UR5E, log(Q, recorded)) == []


def test_exchanged_joints_are_found() -> None:
    message = said(Q[:, [0, 2, 1, 3, 4, 5]], positions_over_log(UR5E, Q))
    assert re.match(
        r"the kinematics of ur5e stay \d+\.\d mm \(rms\) from the recorded TCP \(\d+\.\d mm ", message
    )
    assert message.endswith(": with q2 and q3 exchanged they agree")


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
        (warning,) = far_from_recorded(UR5E, replace(exchanged, columns=columns))
        assert warning.words("command line").endswith(f"--joints {option} exchanges them")


def test_a_joint_that_is_counted_the_other_way_is_found() -> None:
    message = said(Q * np.array([1, 1, -1, 1, 1, 1]), positions_over_log(UR5E, Q))
    assert message.endswith(": with q3 counted the other way they agree")


def test_another_base_is_found_and_its_option_helps() -> None:
    base = from_offset((0.5, -0.3, 0.8, 0.0, 0.0, 1.2))
    recorded = positions_over_log(UR5E.placed(base=base), Q)
    (warning,) = far_from_recorded(UR5E, log(Q, recorded))
    assert warning.message.endswith("on another base they agree within 0.00 mm")
    (hint,) = warning.hints
    found = np.array(hint.value)
    np.testing.assert_allclose(found, (0.5, -0.3, 0.8, 0.0, 0.0, 1.2), atol=5e-5)  # as printed
    placed = UR5E.placed(base=from_offset(found.tolist()))
    assert far_from_recorded(placed, log(Q, recorded)) == []


def test_another_robot_is_only_told_of() -> None:
    message = said(Q, 1.3 * positions_over_log(UR5E, Q) + np.sin(9 * T))
    assert message.endswith(": robot, base, units, zeros, signs or order of the joints may differ")


def test_nothing_is_said_without_motion_robot_or_recorded_tcp() -> None:
    still = np.broadcast_to(Q[:1], Q.shape)
    assert far_from_recorded(UR5E, log(np.ascontiguousarray(still), np.full((60, 3), 0.5))) == []
    assert far_from_recorded(None, log(Q, np.full((60, 3), 0.5))) == []
    assert far_from_recorded(UR5E, JointLog("log", "table", (), np.arange(60), tuple("abcdef"), Q)) == []


def test_a_tool_that_was_not_told_is_found() -> None:
    recorded = positions_over_log(UR5E.placed(tool=translation(0.02, 0.0, 0.15)), Q)
    (warning,) = lacking_tool(UR5E, log(Q, recorded))
    assert warning.kind == "recorded-tcp-tool"
    assert warning.message == ("the kinematics of ur5e stay 151.3 mm (rms) from the recorded TCP")
    assert lacking_tool(UR5E.placed(tool=translation(0.02, 0.0, 0.15)), log(Q, recorded)) == []
    (other,) = lacking_tool(UR5E.placed(tool=translation(0.0, 0.0, 0.1)), log(Q, recorded))
    assert other.hints[0].value == [0.02, 0.0, 0.15]  # the whole tool, not what is lacking


@pytest.mark.parametrize(
    ("base", "said"),
    [((0.0, 0.02, -0.005), "0,0.02,-0.005"), ((0.0, 0.0, 0.0, 0.0, 0.0, 0.1), "0,0,0,0,0,0.1")],
)
def test_a_small_shift_of_the_base_is_found(base: tuple[float, ...], said: str) -> None:
    recorded = positions_over_log(UR5E.placed(base=from_offset(base)), Q)
    (warning,) = lacking_tool(UR5E, log(Q, recorded))
    told = warning.words("command line")
    assert told.endswith(f" mm (rms) from the recorded TCP; --base {said} brings them within 0.00 mm")


def test_no_tool_is_found_for_a_log_that_hardly_moves_or_needs_more_than_a_tool() -> None:
    still = np.repeat(Q[:1], len(Q), axis=0)
    (warning,) = lacking_tool(UR5E, log(still, positions_over_log(UR5E, still) + np.array([0.0, 0.0, 0.15])))
    assert warning.message == (
        "the kinematics of ur5e stay 150.0 mm (rms) from the recorded TCP, and the log moves too"
        " little to tell why: is a tool or a base missing?"
    )
    tooled = UR5E.placed(tool=translation(0.0, 0.0, 0.1))
    (warning,) = lacking_tool(tooled, log(still, positions_over_log(UR5E, still)))
    assert warning.message == (
        "the kinematics of ur5e stay 100.0 mm (rms) from the recorded TCP, and the log moves too"
        " little to tell why: is the tool, 100.0 mm long, the right one, or a base missing?"
    )
    assert lacking_tool(UR5E, log(Q, 1.3 * positions_over_log(UR5E, Q) + np.sin(9 * T))) == []


def test_a_recorded_rotation_vector_goes_on_past_pi() -> None:
    recorded = np.array([[0.0, 0.0, 3.1], [np.nan] * 3, [0.0, 0.0, 3.2 - 2 * np.pi]])
    nothing = np.empty((3, 0))
    bare = JointLog("log", "table", (), np.arange(3), (), nothing)
    found = there(replace(bare, tcp_rotation=recorded, rotation_form="vector").tcp_rotation_continuous)
    # 2 pi is taken away and added again: two roundings of 4e-16
    np.testing.assert_allclose(found[[0, 2]], [[0.0, 0.0, 3.1], [0.0, 0.0, 3.2]], rtol=0, atol=1e-15)
    assert np.isnan(found[1]).all()
    assert bare.tcp_rotation_continuous is None
