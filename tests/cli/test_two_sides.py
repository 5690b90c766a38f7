"""What was asked for against what was done, in one file; and joints without an arm."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas
import pytest
from scipy.io import loadmat

import urmpipe
from asserting import refusal
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError, OptionError, RecordingError
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.robots.catalogue import load_robot

UR5E = load_robot("ur5e")
LATE = 4
"""Rows that what was done lags behind."""


def motions(rows: int = 250) -> tuple[FloatArray, FloatArray]:
    """Return the joints that were asked for and those that were done, in [rad]."""
    t = 0.008 * np.arange(rows + LATE)
    q = np.column_stack([0.3 * np.sin(0.9 * t + k) + 0.2 * k for k in range(6)])
    return q[LATE:], q[:-LATE]


def vectors(q: FloatArray) -> FloatArray:
    """Return x, y, z and the rotation vector as a UR writes them."""
    from scipy.spatial.transform import Rotation

    position, rotation = poses_over_log(UR5E, q)
    return np.column_stack((position, Rotation.from_matrix(rotation).as_rotvec()))


def written(path: Path, names: list[str], *parts: FloatArray, delimiter: str = ",") -> Path:
    """Write a table and return its path."""
    header = delimiter.join(names)
    np.savetxt(path, np.column_stack(parts), "%.12g", delimiter, header=header, comments="")
    return path


def six(pattern: str) -> list[str]:
    """Return names with the numbers 0 to 5."""
    return [pattern.format(k) for k in range(6)]


T = np.linspace(0.0, 1.992, 250)


@pytest.mark.parametrize("tcp", ["fk", "recorded"])
def test_target_and_actual_of_one_rtde_log(tmp_path: Path, tcp: str) -> None:
    asked, done = motions()
    names = ["timestamp", *six("target_q_{}"), *six("target_TCP_pose_{}"), *six("actual_q_{}")]
    names += six("actual_TCP_pose_{}")
    log = written(tmp_path / "rtde.csv", names, T, asked, vectors(asked), done, vectors(done), delimiter=" ")
    result = urmpipe.compare(log, robot="ur5e", sides=("target", "actual"), tcp=tcp)  # type: ignore[arg-type]
    one = result.runs[0]
    assert (result.reference.name, one.name) == ("rtde (target)", "rtde (actual)")
    exact = np.linalg.norm(vectors(asked)[:, :3] - vectors(done)[:, :3], axis=1)
    np.testing.assert_allclose(one.delta[:, 3], exact, atol=1e-10)  # twelve digits in the file
    assert one.joint_delta is not None
    np.testing.assert_allclose(one.joint_delta, asked - done, atol=1e-10)
    assert result.verdict == "fail" and exact.max() > 0.01
    assert result.assumptions == ()


SPECIMENS = {
    "ros2 controller": ("desired,actual", "desired.positions[{}]", "actual.positions[{}]"),
    "fri": ("commanded,measured", "commanded_position_{}", "measured_position_{}"),
    "suffixes": ("cmd,meas", "A{}_cmd", "A{}_meas"),
    "one word": ("des,rest", "q{}_des", "q{}"),
    "rest first": ("rest,actual", "q_{}", "actual_q_{}"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SPECIMENS)
def test_joints_of_two_sides_are_compared_without_a_robot(tmp_path: Path, name: str) -> None:
    words, of_asked, of_done = SPECIMENS[name]
    asked, done = motions()
    header = ["time [s]", *(f"{one} [rad]" for one in (*six(of_done), *six(of_asked)))]
    log = written(tmp_path / "log.csv", header, T, done, asked)
    reference, other = words.split(",")
    found = urmpipe.compare(log, sides=(reference, other), tolerance="joint=1mrad")
    one = found.runs[0]
    assert one.joint_delta is not None
    np.testing.assert_allclose(one.joint_delta, asked - done, atol=1e-10)
    assert one.verdict == "fail" and not one.statistics
    largest = max(one.joint_statistics.values(), key=lambda held: held.max)
    assert one.decisive == largest
    as_dict = found.to_dict()["runs"][0]
    assert (as_dict["delta"], as_dict["path"], as_dict["angle"], as_dict["start"]) == ({}, None, None, {})
    assert as_dict["worst"] == {"t": largest.t_max, "sample": largest.sample_max, "norm": None}
    assert urmpipe.compare(log, sides=(reference, other), tolerance="joint=9rad").verdict == "pass"


def test_joints_alone_come_back_from_a_recording_a_report_and_an_export(tmp_path: Path) -> None:
    asked, done = motions()
    for name, q in (("asked", asked), ("done", done)):
        written(tmp_path / f"{name}.csv", ["t", *six("q{} [rad]")], T, q)
    kept = tmp_path / "kept.rrd"
    made = urmpipe.compare(tmp_path / "asked.csv", tmp_path / "done.csv", tolerance="joint=1deg", output=kept)
    assert urmpipe.read_recording(kept).to_dict() == made.to_dict()
    page = tmp_path / "report.html"
    urmpipe.report(kept, output=page)
    assert "by the joints alone" in page.read_text(encoding="utf-8")
    table = tmp_path / "table.csv"
    urmpipe.export(kept, output=table)
    header, *rows = table.read_text().splitlines()
    assert header == "run,sample,t [s]," + ",".join(six("delta_q{} [rad]")) + ",out_of_tolerance"
    numbers = np.array([row.split(",")[3:9] for row in rows], np.float64)
    np.testing.assert_allclose(numbers, asked - done, atol=1e-10)
    said = refusal(RecordingError, urmpipe.export, kept, output=tmp_path / "poses.tum")
    assert said == f"{kept}: a comparison of joints alone, so no pose"


def test_joints_alone_leave_under_the_names_of_the_reference(tmp_path: Path) -> None:
    t, names, off = T[:50], ["foo [rad]", "bar [rad]", "baz [rad]"], np.array([0.001, 0.002, 0.003])
    q = np.column_stack([np.sin(t + k) for k in range(3)])
    written(tmp_path / "asked.csv", ["t", *names], t, q)
    written(tmp_path / "done.csv", ["t", *names], t, q + off)
    written(tmp_path / "turned.csv", ["t", *names[::-1]], t, (q + off)[:, ::-1])
    kept, logs = tmp_path / "kept.rrd", [tmp_path / "done.csv", tmp_path / "turned.csv"]
    urmpipe.compare(tmp_path / "asked.csv", logs, tolerance="joint=1deg", output=kept)
    urmpipe.export(kept, output=tmp_path / "table.parquet")
    table = pandas.read_parquet(tmp_path / "table.parquet")
    np.testing.assert_allclose(table.filter(like="delta_"), np.tile(-off, (100, 1)), atol=1e-10)
    urmpipe.export(kept, output=tmp_path / "all.mat")
    for one in loadmat(tmp_path / "all.mat", simplify_cells=True)["comparison"]["runs"]:
        assert one["joints"].tolist() == ["foo", "bar", "baz"] and "actual" not in one
        np.testing.assert_allclose(one["delta"], np.tile(-off, (50, 1)), atol=1e-10)


def test_nothing_is_known_of_joints_alone_within_a_step_of_the_reference(tmp_path: Path) -> None:
    q, _ = motions()
    step = q + np.where(np.arange(250) < 100, 0.0, 2.0)[:, np.newaxis]
    written(tmp_path / "asked.csv", ["t", *six("q{} [rad]")], T, step)
    between = (T[:-1] + T[1:]) / 2
    written(tmp_path / "done.csv", ["t", *six("q{} [rad]")], between, (q[:-1] + q[1:]) / 2)
    found = urmpipe.compare(tmp_path / "asked.csv", tmp_path / "done.csv", tolerance="joint=9rad", sync=0.004)
    np.testing.assert_array_equal(np.setdiff1d(np.arange(249), found.runs[0].sample), [99])


def test_a_name_never_stands_against_itself(tmp_path: Path) -> None:
    asked, done = motions()
    for name, q in (("asked", asked), ("done", done)):
        (tmp_path / name).mkdir()
        written(tmp_path / name / "log.csv", ["t", *six("q{} [rad]")], T, q)
    both = urmpipe.compare(tmp_path / "asked" / "log.csv", tmp_path / "done" / "log.csv", "ur5e")
    assert (both.reference.name, both.runs[0].name) == ("log (asked)", "log (done)")
    again = urmpipe.compare(tmp_path / "done" / "log.csv", tmp_path / "done" / "log.csv", "ur5e")
    assert (again.reference.name, again.runs[0].name) == ("log (done)", "log (done)-2")


def test_the_unit_of_a_column_reaches_the_logs_that_have_it(tmp_path: Path) -> None:
    """So a hint about the path can be followed as it stands, beside a log that has no such column."""
    asked, _ = motions()
    position = 1e3 * poses_over_log(UR5E, asked)[0]
    path = written(tmp_path / "path.csv", ["t", "x", "y", "z"], T, position)
    log = written(tmp_path / "log.csv", ["t", *six("q{} [rad]")], T, asked)
    said = refusal(LogError, urmpipe.compare, path, log, "ur5e")
    assert "--unit x=mm" in said
    result = urmpipe.compare(path, log, "ur5e", unit={"x": "mm", "y": "mm", "z": "mm"})
    assert (result.verdict, result.assumptions) == ("pass", ())
    assert result.runs[0].run.provenance.options["read"] == {"unit": {"x": "mm", "y": "mm", "z": "mm"}}
    assert refusal(OptionError, urmpipe.compare, path, log, "ur5e", unit={"w": "mm"}) == (
        "unit (--unit): found no column 'w', allowed: a column that a log has, and that is read"
    )


def test_what_is_assumed_of_a_log_is_not_said_of_one_of_its_name(tmp_path: Path) -> None:
    q, _ = motions()
    units = {"one": "q{}", "two": "q{} [rad]"}
    for name, pattern in units.items():
        (tmp_path / name / "x").mkdir(parents=True)
        written(tmp_path / name / "x" / "log.csv", ["t", *six(pattern)], T, q)
    reference, log = (tmp_path / name / "x" / "log.csv" for name in units)
    found = urmpipe.compare(reference, log, "ur5e")
    assert [found.reference.name, found.runs[0].name] == ["log (x)", "log (x)-2"]
    assert found.assumptions == ("the joints are in rad (log (x))",)


def test_rows_without_times_are_a_guess_where_they_are_not_compared_one_by_one(tmp_path: Path) -> None:
    q, _ = motions()
    one, two = (written(tmp_path / f"{name}.csv", six("q{} [rad]"), q) for name in ("one", "two"))
    fewer = written(tmp_path / "fewer.csv", six("q{} [rad]"), q[:200])
    guess = ("the rows are 5 ms apart",)
    assert urmpipe.compare(one, two, robot="ur5e").assumptions == ()
    assert urmpipe.compare(one, two, robot="ur5e", sync=0.1).assumptions == guess
    assert urmpipe.compare(one, fewer, robot="ur5e").assumptions == guess


def test_a_log_with_both_sides_names_the_command_that_compares_them(tmp_path: Path) -> None:
    asked, done = motions()
    names = ["timestamp", *six("target_q_{}"), *six("actual_q_{}"), *six("actual_TCP_pose_{}")]
    away = 0.5 * vectors(done)[::-1]  # of no arm
    log = written(tmp_path / "rtde.csv", names, T, asked, done, away)
    (unused,) = (
        one for one in urmpipe.ingest(log, robot="ur5e").log.inferences if one.what == "columns not used"
    )
    assert [str(one) for one in unused.hints] == ["urmpipe compare --sides target,actual"]
    assert refusal(LogError, urmpipe.compare, log) == (
        "rtde.csv: no robot is given, and no single one of the catalogue fits the recorded tool centre point"
        " as it is; --robot NAME|FILE sets one; --tool X,Y,Z adds its tool"
    )
