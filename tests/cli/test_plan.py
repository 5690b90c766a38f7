"""`urmpipe plan` and `urmpipe.plan` as a user runs them: rows in; a table, JSON, a log or a recording out."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import urmpipe as package
from asserting import refusal, there
from plan_logs import gantry
from urmpipe_models.planning.path import PathRows
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.toml import robot_toml
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.results import read_recording

RunCommand = Callable[..., Any]
"""What the fixture `urmpipe` gives: arguments in; exit code, standard output and standard error out."""

CUBE = "cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1"
LENGTH, DURATION = 2.348496, 4.780324
"""Of the paper's contour in [m], and at 0.5 m/s and 6 m/s2 in [s]."""

CONTOUR = """x,y,z,r
1.7,0.3,1,0
1.97,0.3,1,0.03
2,-0.27,1,0.03
1.43,-0.3,1,0.03
1.4,0.27,1,0.03
1.7,0.3,1,0
"""

SINGULAR = "x,y,z\n0.6,0,1.6\n0.3,0,1.6\n-0.3,0,1.6\n"
"""Rows over the axis of theta1 of irb60."""

ACROSS = "x,y,z,rz,ry,rx\n0.3,0.3,0.3,0,0,3.141593\n-0.3,-0.3,0.3,0,0,3.141593\n"
"""Rows on either side of the column of ur5e."""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path) -> Path:
    """The folder of the command, with paths in it."""
    (tmp_path / "path.csv").write_text(CONTOUR)
    (tmp_path / "singular.csv").write_text(SINGULAR)
    (tmp_path / "across.csv").write_text(ACROSS)
    return tmp_path


def answer(urmpipe: RunCommand, code: int, *arguments: str | Path) -> dict[str, Any]:
    """Return what a command prints as JSON."""
    ran = urmpipe("plan", *arguments, "--json")
    assert ran.code == code, ran.err
    found: dict[str, Any] = json.loads(ran.out)
    return found


# --- the answer --------------------------------------------------------------------------------------


def test_json_is_that_of_python_and_of_a_file_that_of_the_cube(urmpipe: RunCommand) -> None:
    assert answer(urmpipe, 0, CUBE, "--robot", "irb60") == package.plan(CUBE, "irb60").to_dict()
    file, cube = answer(urmpipe, 0, "path.csv"), answer(urmpipe, 0, CUBE)
    assert (file.pop("name"), cube.pop("name")) == ("path", "cube wall xy")
    for ours, theirs in zip(file.pop("segments"), cube.pop("segments"), strict=True):
        assert ours == pytest.approx(theirs, abs=1e-9)  # decimal fractions, or sums of halves
    for key in ("length", "duration"):
        assert file.pop(key) == pytest.approx(cube.pop(key), abs=1e-9)
    assert file == cube


@pytest.mark.parametrize(
    ("options", "duration"),
    [
        (("--arcs", "total"), 4.855270),
        (("--velocity", "0.25", "--acceleration", "3"), 4.0 * 2.348496 + 0.25 / 3.0),
        (("--law", "jerk", "--jerk", "1e9"), DURATION),
    ],
)
def test_options_of_the_law(urmpipe: RunCommand, options: tuple[str, ...], duration: float) -> None:
    # from rest to rest L / v + v / a; a jerk without end is none; L is known to 1e-6
    assert answer(urmpipe, 0, CUBE, *options)["duration"] == pytest.approx(duration, abs=5e-6)


@pytest.mark.slow
def test_a_plan_that_fails_is_exit_1(urmpipe: RunCommand) -> None:
    found = answer(urmpipe, 1, "singular.csv", "--robot", "irb60")
    assert found["verdict"] == "fail"
    at = [found["infeasibilities"][0].pop(key) for key in ("s", "t")]
    # Two stops, and half of the second line: 0.6 m / v + 1.5 v / a; the path is looked at on a grid.
    assert at == pytest.approx([0.6, 1.325], abs=4e-4)
    assert found["infeasibilities"] == [
        {"kind": "singular", "segment": 1, "row": 2, "joint": "theta3",
         "message": "the arm passes a singular pose"}
    ]  # fmt: skip
    ran = urmpipe("plan", "singular.csv", "--robot", "irb60")
    assert (ran.code, ran.err) == (1, "")
    assert ran.out.splitlines()[:2] == [
        "FAIL  singular: irb60 cannot run 0.9 m in 1.967 s (trapezoid): singular at t = 1.325 s (row 2)",
        "      In the way: at t = 1.325 s (segment 2, row 2, joint theta3): the arm passes a singular pose",
    ]


@pytest.mark.slow
def test_start_chooses_the_branch(urmpipe: RunCommand, folder: Path) -> None:
    """The elbow of ur5e up or down at the first sample."""
    (folder / "arm.csv").write_text(
        "x,y,z,rz,ry,rx\n0.5,0.1,0.3,0,0,3.141592653589793\n0.5,0.2,0.3,0,0,3.141592653589793\n"
    )
    first = {}
    for sign, start in ((1, "0,-1.6,1.6,-1.6,-1.57,0"), (-1, "0,-0.5,-1.6,-1,-1.57,0")):
        ran = urmpipe("plan", "arm.csv", "--robot", "ur5e", "--start", start, "-o", f"{sign}.csv")
        assert ran.code == 0, ran.out
        first[sign] = float(pd.read_csv(folder / f"{sign}.csv")["elbow_joint (rad)"][0])
    assert first[-1] < 0.0 < first[1]


# --- what is written ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_csv_has_the_samples_at_their_times(urmpipe: RunCommand, folder: Path) -> None:
    ran = urmpipe("plan", CUBE, "--robot", "irb60", "--tsp", "10ms", "-o", "plan.csv")
    assert ran.code == 0
    assert ran.out.splitlines()[-1] == "Plan: plan.csv  (read it: urmpipe ingest plan.csv)"
    frame = pd.read_csv(folder / "plan.csv")
    wanted = package.plan(CUBE, "irb60", tsp=0.01)
    assert len(frame) == len(wanted) == 480
    np.testing.assert_array_equal(frame["t (s)"], np.arange(480) / 100)
    names = [f"{name} (rad)" for name in load_robot("irb60").coordinates]
    np.testing.assert_array_equal(frame[names], there(wanted.joints).q)
    np.testing.assert_array_equal(frame[["x (m)", "y (m)", "z (m)"]], wanted.position)
    assert answer(urmpipe, 0, CUBE, "-o", "again.csv")["output"] == "again.csv"


@pytest.mark.slow
def test_a_recording_is_the_plan(urmpipe: RunCommand, folder: Path) -> None:
    ran = urmpipe("plan", "path.csv", "--robot", "irb60", "-o", "plan.rrd")
    assert ran.code == 0
    assert ran.out.splitlines()[-1].startswith("Recording: plan.rrd  (open it: ")
    back = read_recording(folder / "plan.rrd")
    assert isinstance(back, PlannedPath)
    wanted = package.plan(folder / "path.csv", "irb60")
    np.testing.assert_array_equal(there(back.joints).q, there(wanted.joints).q)
    assert [one.name for one in back.provenance.inputs] == ["path.csv"]


@pytest.mark.slow
def test_how_to_read_a_plan_names_what_is_not_in_the_file(urmpipe: RunCommand, folder: Path) -> None:
    (folder / "arm.toml").write_text(robot_toml(load_robot("irb60")), encoding="utf-8")
    for options, read in (
        (["--robot", "arm.toml"], "plan.csv --robot arm.toml"),
        (["--robot", "irb60", "--tool", "0,0,-0.1"], "plan.csv --robot irb60 with the same --tool"),
        ([], "plan.csv"),
    ):
        ran = urmpipe("plan", CUBE, *options, "-o", "plan.csv")
        assert ran.out.splitlines()[-1].startswith(f"Plan: plan.csv  (read it: urmpipe ingest {read}")
        command = read.split(" with the same ")[0].split()
        again = urmpipe("ingest", *command, *options[2:], "--strict")
        assert again.code == 0, again.err


def test_joints_that_slide_and_turn_have_their_units_in_a_notebook() -> None:
    arm, rows = gantry(), PathRows(np.array([[0.5, 0.1, 0.6], [0.6, 0.1, 0.6]]))
    page = there(package.plan(rows, arm)._repr_html_())
    cells = re.findall("<td>([^<]*)</td>", page)
    assert {"x", "t"} <= {*cells}
    assert any(cell.endswith(" mm") for cell in cells)
    assert any(cell.endswith(" deg") for cell in cells)


@pytest.mark.slow
def test_a_plan_that_fails_writes_no_csv_but_a_recording(urmpipe: RunCommand, folder: Path) -> None:
    across = ("across.csv", "--robot", "ur5e", "-o")
    found = answer(urmpipe, 1, *across, "plan.csv")
    assert found["output"] is None
    assert [one["kind"] for one in found["warnings"]] == ["not-written"]
    assert urmpipe("plan", *across, "plan.rrd", "-q").code == 1
    back = read_recording(folder / "plan.rrd")
    assert isinstance(back, PlannedPath)
    assert back.verdict == "fail"


@pytest.mark.slow
def test_compare_passes_in_both_orders(urmpipe: RunCommand, folder: Path) -> None:
    assert urmpipe("plan", "path.csv", "-o", "alone.csv", "-q").code == 0
    assert urmpipe("plan", "path.csv", "--robot", "irb60", "-o", "plan.csv", "-q").code == 0
    for files in (("alone.csv", "plan.csv"), ("plan.csv", "alone.csv")):
        ran = urmpipe("compare", *files, "--json", "--output", "both.rrd")
        assert ran.code == 0, ran.err
        found = json.loads(ran.out)
        assert found["verdict"] == "pass"
        assert found["runs"][0]["delta"]["norm"]["max"] < 1e-9  # the tool is on the curve


# --- in Python ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_rows_of_arrays_are_a_path() -> None:
    points = np.array(
        [[1.7, 0.3, 1], [2.0, 0.3, 1], [2.0, -0.3, 1], [1.4, -0.3, 1], [1.4, 0.3, 1], [1.7, 0.3, 1]]
    )
    rows = PathRows(points, 0.03, corner=True)
    found = package.plan(rows, "irb60")
    assert (found.path.total, found.duration) == pytest.approx((LENGTH, DURATION), abs=1e-6)
    assert (found.verdict, found.robot, found.law) == ("pass", load_robot("irb60"), "trapezoid")
    assert (found.recording, found.log, found.output, found.provenance.inputs) == (None, None, None, ())
    assert found.to_dict() == package.plan(rows, load_robot("irb60")).to_dict()
    np.testing.assert_allclose(found.corners, points[1:-1], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found.stops, points[[0, -1]])
    frame = found.to_frame()
    assert list(frame.columns) == [
        "t", "row", "s", "v", "a", "j", "x", "y", "z",
        *(f"{prefix}theta{k}" for prefix in ("", "d_", "dd_") for k in (1, 2, 3, 4)),
    ]  # fmt: skip
    assert len(frame) == len(found) == 958


def test_progress_rises_to_one(folder: Path) -> None:
    done: list[float] = []
    package.plan(CUBE, "irb60", output=folder / "plan.rrd", progress=done.append)
    assert done == sorted(done)
    assert (done[0], done[-1]) == (0.0, 1.0)
    assert len({*done}) > 3


def test_a_plan_takes_no_time_column() -> None:
    time: Any = {"time": "t"}
    assert "'time'" in refusal(TypeError, package.plan, CUBE, **time)
