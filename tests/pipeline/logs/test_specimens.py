"""Every specimen gives the motion that it holds, or the reason why it cannot.

The specimens are written by people's tools (`tests/specimens/make_specimens.py`); the truth comes from the
motion and each writer's rounding, never from a reader."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import asking
from make_specimens import paths
from specimen import SPECIMENS, Truth
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import UrmpipeError
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, format_map, map_of, read_log, read_map
from urmpipe_pipeline.runs.ingest import ingest_log

UR = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
NO_TIME = {"period": 0.02}


class Good(NamedTuple):
    """A specimen that loads: with which robot and option, and what its joints are called and measured in."""

    name: str
    robot: str | None = None
    options: Mapping[str, Any] = {}
    unit: str | Sequence[str] = "rad"
    joints: Sequence[str] = ()  # what each joint's name contains, in order; empty: no names
    rates: bool = False


class Wrong(NamedTuple):
    """A specimen that is refused, or loads with a warning: what the lines must hold, each some line."""

    name: str
    said: Sequence[str]
    robot: str | None = None
    stops: bool | None = True  # None: to be refused or warned of, whichever


Q = tuple(f"q{k}" for k in range(1, 8))

GOOD = [
    # Python and spreadsheets
    Good("pandas_default", joints=Q[:6]),
    Good("pandas_no_index", joints=Q[:6]),
    Good("pandas_time_index", joints=[f"joint_{k}" for k in range(1, 7)]),
    Good("pandas_index_counts_from_filter", joints=Q[:6]),
    Good("pandas_semicolon", joints=Q[:6]),
    Good("pandas_german", unit="deg", joints=[f"Gelenk {k}" for k in range(1, 7)]),
    Good("pandas_tabs_comma", joints=Q[:6]),
    Good("pandas_float_format", joints=Q[:6]),
    Good("pandas_float_format_g", joints=Q[:6]),
    Good("pandas_all_digits", joints=Q[:6]),
    Good("pandas_missing", joints=Q[:6]),
    Good("pandas_na_rep", joints=Q[:6]),
    Good("pandas_unnamed_columns", options=NO_TIME),
    Good("pandas_two_header_lines", unit="deg", joints=Q[:6]),
    Good("pandas_utf16", joints=Q[:6]),
    Good("pandas_bom", joints=Q[:6]),
    Good("pandas_quoted", joints=Q[:6]),
    Good("pandas_array_cells"),
    Good("pandas_two_array_cells", rates=True),
    Good("pandas_list_cells"),
    Good("numpy_savetxt_default"),
    Good("numpy_savetxt_header", joints=Q[:6]),
    Good("numpy_savetxt_two_header_lines", joints=Q[:6]),
    Good("numpy_savetxt_fixed_width", joints=Q[:6]),
    Good("numpy_savetxt_degrees", options=NO_TIME, unit="deg"),
    Good("csv_writer", joints=[f"joint{k}" for k in range(1, 7)]),
    Good("csv_dictwriter_order", joints=[f"joint_{k}" for k in range(1, 8)]),
    Good("csv_comma_in_name", unit="deg", joints=[f"Joint {k}" for k in range(1, 7)]),
    Good("csv_trailing_comma", joints=Q[:6]),
    Good("csv_twelve_columns", "ur5e", {**NO_TIME, "joints": ("1", "2", "3", "4", "5", "6")}),
    Good("csv_rates_beside", joints=Q[:6], rates=True),
    Good("csv_commanded_first", joints=[f"q{k}_meas" for k in range(1, 7)]),
    Good("fstring_spaces", joints=[f"J{k}" for k in range(1, 7)]),
    Good("fstring_degree_sign", unit="deg", joints=[f"J{k}" for k in range(1, 7)]),
    Good("tip_and_angles", "urm6", unit="deg", joints=[f"J{k}_Angle" for k in range(1, 7)]),
    Good("excel_german", joints=[f"Achse {k}" for k in range(1, 7)]),
    Good("excel_unicode_text", joints=[f"Winkel {k}" for k in range(1, 7)]),
    Good("spreadsheet_trailing_rows", joints=Q[:6]),
    # robots, simulators, recorders
    Good("coppeliasim_one_graph", unit="deg", joints=[f"phi_{k}" for k in range(1, 7)]),
    Good("coppeliasim_three_graphs", "urm6", joints=[f"J{k}" for k in range(1, 7)], rates=True),
    Good("solidworks_en", unit="deg"),
    Good("solidworks_de", unit="deg"),
    Good("matlab_writetable", joints=Q[:6], rates=True),
    Good("matlab_timetable", joints=Q[:6]),
    Good("matlab_save_ascii", options=NO_TIME),
    Good("matlab_save_ascii_with_time"),
    Good("matlab_writematrix_time_row"),
    Good(
        "simscape_suffixes",
        unit=("m", "m", "deg", "deg", "deg"),
        joints=["lateral", "vertical", "wigwag", "tilt", "swivel"],
    ),
    Good("ur_rtde_spaces", "ur5e", joints=[f"actual_q_{k}" for k in range(6)]),
    Good("ur_rtde_commas", "ur5e", joints=[f"actual_q_{k}" for k in range(6)]),
    Good("ur_rtde_no_time", "ur5e", NO_TIME, joints=[f"actual_q_{k}" for k in range(6)]),
    Good("rostopic_joint_states", joints=UR, rates=True),
    Good("rostopic_pose"),
    Good("ros2_echo_joint_states", joints=UR),
    Good("ros2_echo_with_gripper", "ur5e", joints=UR),
    Good("ur_short_names", unit="deg", joints=("base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3")),
    Good("plotjuggler_topics", joints=UR),
    Good("plotjuggler_padded_dates", joints=Q[:6]),
    Good("kuka_krc_trace", unit="deg", joints=[f"AxisPos_Act{k}" for k in range(1, 7)]),
    Good("kuka_fri"),
    Good("kuka_fri_gains"),
    Good("libfranka", joints=[f"state.q[{k}]" for k in range(7)], rates=True),
    Good("libfranka_pose", joints=[f"state.q[{k}]" for k in range(7)]),
    Good("abb", unit="deg", joints=[f"J{k}" for k in range(1, 7)]),
    Good("mixed_units", unit=("mm", "rad", "deg", "deg", "deg", "deg"), joints=Q[:6]),
    Good("joint_names_any_order", joints=UR),
    Good("cad_path_mm", options=NO_TIME),
    Good("cad_path_no_header", options={**NO_TIME, "source": "path", "unit": {"1": "mm"}}),
    # clocks
    Good("clock_ms", joints=Q[:6]),
    Good("clock_us", joints=Q[:6]),
    Good("clock_ms_unsaid", joints=Q[:6]),
    Good("clock_epoch_s", joints=Q[:6]),
    Good("clock_epoch_ms", joints=Q[:6]),
    Good("clock_epoch_us", joints=Q[:6]),
    Good("clock_epoch_ns", joints=Q[:6]),
    Good("clock_sec_nanosec", joints=Q[:6]),
    Good("clock_datetime", joints=Q[:6]),
    Good("clock_datetime_whole_second", joints=Q[:6]),
    Good("clock_pandas_datetime", joints=Q[:6]),
    Good("clock_pandas_timedelta", joints=Q[:6]),
    Good("clock_iso_utc", joints=Q[:6]),
    Good("clock_iso_offset", joints=Q[:6]),
    Good("clock_python_logging", joints=Q[:6]),
    Good("clock_german_date", joints=Q[:6]),
    Good("clock_american_date", joints=Q[:6]),
    Good("clock_date_and_time", joints=Q[:6]),
    Good("clock_time_of_day", joints=Q[:6]),
    Good("clock_time_of_day_midnight", joints=Q[:6]),
    Good("clock_seconds_of_day", joints=Q[:6]),
    Good("clock_micros_not_padded", joints=Q[:6]),
    Good("clock_micros_point_not_padded", joints=Q[:6]),
    Good("clock_minutes", joints=Q[:6]),
    Good("clock_uneven", joints=Q[:6]),
    # the tool beside the joints
    Good("tcp_xyz_m", "ur5e", joints=Q[:6]),
    Good("tcp_xyz_mm", "ur5e", joints=Q[:6]),
    Good("tcp_rotation_vector", "ur5e", joints=Q[:6]),
    Good("tcp_rx_ry_rz_are_euler", "ur5e", joints=Q[:6]),
    Good("tcp_rotation_vector_flips", "ur5e", joints=Q[:6]),
    Good("tcp_kuka_abc", "ur5e", joints=Q[:6]),
    Good("tcp_roll_pitch_yaw", "ur5e", joints=Q[:6]),
    Good("tcp_yaw_pitch_roll_deg", "ur5e", joints=Q[:6]),
    Good("tcp_quaternion_xyzw", "ur5e", joints=Q[:6]),
    Good("tcp_quaternion_wxyz", "ur5e", joints=Q[:6]),
    Good("tcp_quaternion_numbered", "ur5e", joints=Q[:6]),
    Good("tcp_ros_names", "ur5e", joints=Q[:6]),
    Good("tcp_matrix_16", "ur5e", joints=Q[:6]),
    Good("tcp_matrix_16_mm", "ur5e", joints=Q[:6]),
    Good("tcp_matrix_12", "ur5e", joints=Q[:6]),
    Good("tcp_matrix_no_header", "ur5e", NO_TIME, unit="deg"),
    Good("tcp_tells_degrees", "ur5e", unit="deg", joints=Q[:6]),
    Good("tcp_from_another_base", "ur5e", joints=Q[:6]),
    # values limited to an interval
    Good("wrap_180", unit="deg", joints=Q[:6]),
    Good("wrap_360", unit="deg", joints=Q[:6]),
    Good("wrap_270", unit="deg", joints=Q[:6]),
    Good("wrap_pi", joints=Q[:6]),
    Good("wrap_two_turns", joints=Q[:6]),
]

WRONG = [
    # the clock
    Wrong("time_backwards", [r"^log:13, column t: found 0\.12 s after 0\.2 s, allowed: "]),
    Wrong(
        "midnight_among_rows",
        [r"^log:15, column t: found 23:59:59\.995 after 24:00:00\.005, allowed: times that increase"],
    ),
    Wrong("time_repeated", [r"row 9: 1 of 30 rows repeats the time of the row before: .* next"], stops=False),
    Wrong("time_missing", [r"^log:7, column t: found no time, allowed: a time in every row"]),
    Wrong("time_of_one_second", [r"(?=.*rows repeat a time)(?=.*--period )"]),
    Wrong("time_in_steps", [r"15\.6\d* ms|0\.0156\d* s"], stops=False),
    Wrong("gap_of_two_seconds", [r"row 16: 2\.02 s"], stops=False),
    Wrong("gap_with_a_possible_turn", [r"(?=.*q5)(?=.*\b16\b)(?=.*(ambiguous|turn))"], stops=False),
    # the samples
    Wrong("repeated_samples", [r"(?=.*(repeat|same|held))(?=.*(40 ms|0\.04 s|\b4\b|\b36\b))"], stops=False),
    Wrong(
        "outlier_first_sample", [r"(?=.*q1)(?=.*(row 1\b|first))(?=.*(outlier|0\.7117|jump))"], stops=False
    ),
    Wrong("impossible_speed", [r"(?=.*q2)(?=.*(row 1[45]))(?=.*rad/s)"], "ur5e", stops=False),
    Wrong("beyond_limits", [r"(?=.*q3)(?=.*limit)(?=.*(6\.28|360))"], "ur5e", stops=False),
    Wrong("in_between_on_wrap", [r"(?=.*q5)(?=.*(in.between|between))(?=.*wrap)"], stops=False),
    Wrong("infinite_value", [r"^log:11, column q6: found inf, allowed: finite numbers"]),
    Wrong("stray_cell", [r"^log:9, column q4: found 'ERR', allowed: a number"]),
    Wrong("empty_column", [r"^log, column q4: found no value in any of 30 rows, allowed: "]),
    # the table
    Wrong("header_only", [r"^log:1: found a header and no rows, allowed: "]),
    Wrong("no_bytes", [r"^log: found .*, allowed: "]),
    Wrong("rows_of_one_cell", [r"^log:1: found 2 names over rows of 1 cell, allowed: one name per column"]),
    Wrong("header_with_fewer_names", [r"^log:1: found 6 names over rows of 7 cells, allowed: "]),
    Wrong("header_with_more_names", [r"^log:1: found 8 names over rows of 7 cells, allowed: "]),
    Wrong("header_with_a_name_twice", [r"^log:1, column q3: found as columns 4, 5, allowed: once"]),
    Wrong("header_with_all_names_twice", [r"^log:1, column q1: found as columns 2, 8, allowed: once"]),
    Wrong(
        "header_without_a_number",
        [r"^log: found joint columns .* none with number 3, allowed: .*--joints "],
    ),
    Wrong("header_of_unknown_unit", [r"^log, column q1 \[gon\]: found the unit 'gon', allowed: rad, deg"]),
    Wrong("rows_too_short", [r"^log:8: found 6 cells, allowed: 7", r"^log:20: found 6 cells"]),
    Wrong("row_cut_off", [r"^log:31: found 2 cells, allowed: 7"]),
    Wrong("row_of_two_rows", [r"^log:15: found 13 cells, allowed: 7"]),
    Wrong(
        "merge_conflict",
        [r"^log:10: found '<<<<<<< HEAD'.* a merge", r"^log:12: found '=======", r"^log:14: found '>>>>>>>"],
    ),
    Wrong("stray_text", [r"^log:12: found .*\[WARN\] connection lost"]),
    Wrong("nul_bytes", [r"(?i)^log:?.*found.*(NUL|zero|0x00|binary)"]),
    Wrong("two_logs", [r"^log:17.*found.*(2|another|second) log"]),
    Wrong("two_logs_with_headers", [r"^log:17.*found.*(header|two|another|second)"]),
    Wrong("two_publishers", [r"finger_joint"], "ur5e", None),
    Wrong("decimal_commas_between_commas", [r"found .*(14 cells|decimal).*allowed: "]),
    Wrong("seven_joints_for_six", [r"found 7 joint columns .*allowed: 6, as robot ur5e has"], "ur5e"),
    # the units
    Wrong(
        "angles_of_unknown_unit",
        [r"values up to 3[67]\.?\d* in q1, .* no unit, allowed: rad or deg; .*--unit "],
    ),
    Wrong("header_says_rad", [r"(?=.*J1)(?=.*found)(?=.*rad)(?=.*(deg|360))"]),
    Wrong("header_says_deg_krc", [r"(?=.*AxisPos_Act1)(?=.*rad)(?=.*(deg|°))(?=.*\d mm)"], "ur5e", None),
    Wrong("header_says_mm", [r"(?=.*\bx\b)(?=.*\bmm\b)(?=.*\bm\b)"], "ur5e", None),
    Wrong("tcp_of_another_order", [r"(?=.*(TCP|tool))(?=.*\d (mm|m)\b)"], "ur5e", None),
    Wrong(
        "quaternion_of_no_length", [r"(?=.*\bqw?\b|.*quaternion)(?=.*(length|norm))(?=.*0\.5)"], "ur5e", None
    ),
]


def _case(case: Any) -> Any:
    """Return a row of a table without its mark."""
    return case if isinstance(case, Good | Wrong) else case.values[0]


def _name(case: Good | Wrong) -> str:
    return case.name


def read(case: Good) -> JointLog:
    """Read a specimen with what its file cannot tell."""
    robot = load_robot(case.robot) if case.robot else None
    return read_log(paths(SPECIMENS[case.name]), LogMap(**case.options), robot)


def truth_of(case: Good) -> Truth:
    truth = SPECIMENS[case.name].make().truth
    assert truth is not None
    return truth


@pytest.mark.slow
@pytest.mark.parametrize("case", GOOD, ids=_name)
def test_a_specimen_gives_the_motion_that_it_holds(case: Good) -> None:
    truth, log = truth_of(case), read(case)
    np.testing.assert_allclose(log.t, truth.t, rtol=0, atol=truth.t_within)
    assert log.clock_start == pytest.approx(truth.start, abs=truth.t_within, rel=0)
    assert log.q.shape == truth.q.shape
    assert (np.isnan(log.q) == np.isnan(truth.q)).all()
    assert not (np.abs(log.q - truth.q) > truth.q_within).any()
    units = [case.unit] * len(log.joints) if isinstance(case.unit, str) else list(case.unit)
    assert [log.units[name] for name in log.joints] == units
    assert len(log.joints) >= len(case.joints)
    assert [n for n, part in zip(log.joints, case.joints, strict=False) if part not in n] == []
    if case.rates:
        # As finely as the joints; what is written with few digits is larger here by its rates' size.
        assert log.qd is not None
        np.testing.assert_allclose(log.qd, truth.rates, rtol=0, atol=5 * np.max(truth.q_within))
    _same_tool(log, truth)


def _same_tool(log: JointLog, truth: Truth) -> None:
    """Compare position and orientation of the tool; a quaternion and its negative are one orientation."""
    if truth.position is not None:
        assert log.tcp_position is not None
        np.testing.assert_allclose(log.tcp_position, truth.position, rtol=0, atol=truth.position_within)
    if truth.rotation is not None:
        assert log.tcp_quat_xyzw is not None
        between = Rotation.from_quat(log.tcp_quat_xyzw).inv() * truth.rotation
        assert between.magnitude().max() <= truth.rotation_within


@pytest.mark.slow
@pytest.mark.parametrize("case", GOOD, ids=_name)
def test_a_saved_map_reads_a_specimen_again_without_the_robot(case: Good, tmp_path: Path) -> None:
    files, given = paths(SPECIMENS[case.name]), LogMap(**case.options)
    log = read_log(files, given, load_robot(case.robot) if case.robot else None)
    lab = tmp_path / "lab.toml"
    lab.write_text(format_map(map_of(log, given)), encoding="utf-8")
    again = read_log(files, read_map(lab))
    assert (again.joints, again.rotation_form) == (log.joints, log.rotation_form)
    for name in ("t_ns", "q", "qd", "tcp_position", "tcp_rotation"):
        np.testing.assert_array_equal(getattr(again, name), getattr(log, name))  # the same bits


@pytest.mark.slow
@pytest.mark.parametrize("case", WRONG, ids=_name)
def test_what_is_wrong_with_a_specimen_is_said(case: Wrong) -> None:
    stopped, said = outcome(case)
    missing = [pattern for pattern in case.said if not any(re.search(pattern, line) for line in said)]
    assert not missing, said
    assert case.stops in (None, stopped)


def outcome(case: Wrong) -> tuple[bool, list[str]]:
    """Return whether a specimen was refused, and the lines that were said about it."""
    return _ingested(case.name, load_robot(case.robot) if case.robot else None)


def _ingested(name: str, robot: Chain | None) -> tuple[bool, list[str]]:
    """Return whether a specimen was refused without any option, and the lines that were said about it."""
    try:
        run = ingest_log(paths(SPECIMENS[name]), robot=robot)
    except UrmpipeError as error:
        files = {str(path) for path in paths(SPECIMENS[name])}
        assert {finding.file for finding in error.findings} <= files
        # Without the file's name, which tells what is wrong with it.
        return True, [str(replace(finding, file="log")) for finding in error.findings]
    return False, [f"row {w.row}: {w.sentence()}" for w in run.warnings]


NO_PERIOD = [case for case in map(_case, GOOD) if case.options == NO_TIME]


@pytest.mark.parametrize("case", NO_PERIOD, ids=_name)
def test_a_specimen_without_a_clock_loads_at_5_ms_and_the_option_is_named(case: Good) -> None:
    _, said = _ingested(case.name, load_robot(case.robot) if case.robot else None)
    assert [line for line in said if "5 ms" in line and "--period " in line]


def test_three_columns_without_names_may_be_a_path_and_the_option_is_named() -> None:
    stopped, said = _ingested("cad_path_no_header", None)
    assert stopped
    assert [line for line in said if "--source path" in line]


@pytest.mark.parametrize(
    ("name", "robot"),
    [
        ("tcp_xyz_m", "ur5e"),
        ("tip_and_angles", "urm6"),
        ("csv_writer", None),  # six joints are any arm's
        ("joint_names_any_order", None),  # the same names in ur3 to ur10e
        ("tcp_from_another_base", None),
    ],
)
def test_the_robot_is_inferred_where_the_recorded_tool_singles_it_out(name: str, robot: str | None) -> None:
    run = ingest_log(paths(SPECIMENS[name]))
    assert (run.robot.name if run.robot else None) == robot


@pytest.mark.slow
@pytest.mark.parametrize("case", GOOD, ids=_name)
def test_without_options_a_specimen_is_read_or_a_printed_choice_leads_to_it(case: Good) -> None:
    truth = truth_of(case)
    t = truth.t if case.options.get("period") is None else None
    position = None if truth.q.shape[1] else truth.position
    known = asking.Truth(truth.q, t, float(np.max(truth.q_within)), truth.t_within, position=position)
    robot = load_robot(case.robot) if case.robot else None
    verdict = asking.judge(paths(SPECIMENS[case.name]), known, LogMap(), robot)
    assert verdict.good, verdict


@pytest.mark.parametrize("case", WRONG, ids=_name)
def test_each_printed_choice_for_a_wrong_specimen_is_accepted(case: Wrong) -> None:
    files, robot = paths(SPECIMENS[case.name]), load_robot(case.robot) if case.robot else None
    first = asking.outcome(files, LogMap(), robot)
    for reading in asking.readings(files, first, depth=1):
        assert reading.log is not None or str(reading.came) != str(first.came), reading.answers


# The runs of these specimens must go on where their files wrap; the first row tells no turns.
TURNED = [
    "pandas_german", "numpy_savetxt_degrees", "fstring_degree_sign", "coppeliasim_one_graph", "wrap_180",
    "wrap_360", "wrap_270", "wrap_pi", "wrap_two_turns",
]  # fmt: skip


@pytest.mark.parametrize("name", TURNED)
def test_a_specimen_that_wraps_goes_on(name: str) -> None:
    case = next(case for case in map(_case, GOOD) if case.name == name)
    truth = truth_of(case)
    run = ingest_log(paths(SPECIMENS[name]), read=LogMap(**case.options))
    turns = (run.q[: len(truth.t)] - truth.turned) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns[:1]).repeat(len(truth.t), axis=0), rtol=0, atol=1e-3)
