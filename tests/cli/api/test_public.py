"""The public functions: what they take in one way everywhere, and what they refuse."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from inspect import signature
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd
import pytest

import urmpipe
from urmpipe.arm_placing import parse_frame
from urmpipe.main import cli
from urmpipe_models.errors import Finding
from urmpipe_models.math3d import Transform, from_offset


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of an arm, and the path of its tool."""
    place = tmp_path_factory.mktemp("logs")
    t = np.arange(40) / 100
    q = 0.4 * np.sin(t[:, None] + np.arange(6))
    names = [f"q{i} [rad]" for i in range(1, 7)]
    pd.DataFrame(np.column_stack([t, q]), columns=["t [s]", *names]).to_csv(place / "log.csv", index=False)
    run = urmpipe.ingest(place / "log.csv", "urm6")
    assert run.tcp is not None
    rows = np.column_stack([run.t, run.tcp.position])
    path = pd.DataFrame(rows, columns=["t [s]", "x [m]", "y [m]", "z [m]"])
    path.to_csv(place / "path.csv", index=False)
    return place


@pytest.fixture
def run(folder: Path) -> urmpipe.Run:
    return urmpipe.ingest(folder / "log.csv", "urm6")


TOOL = (0.0, 0.0, 0.15)


def test_a_run_is_held_as_its_log_is_with_another_tool(folder: Path, run: urmpipe.Run) -> None:
    of_run = urmpipe.compare(folder / "path.csv", run, "urm6", tool=TOOL)
    of_log = urmpipe.compare(folder / "path.csv", folder / "log.csv", "urm6", tool=TOOL)
    assert of_run.verdict == "fail"
    assert of_run.runs[0].statistics == of_log.runs[0].statistics
    assert urmpipe.compare(folder / "path.csv", run).verdict == "pass"


def test_one_is_a_list_of_one(folder: Path, run: urmpipe.Run, tmp_path: Path) -> None:
    path, log = folder / "path.csv", folder / "log.csv"
    given: list[Any] = [str(log), log, run, [run], (log,), (one for one in [run])]
    names = [urmpipe.compare(path, logs, "urm6").name for logs in given]
    assert names == ["log-against-path"] * 6
    assert urmpipe.report(run, tmp_path / "one.html").results == (run,)


@pytest.mark.parametrize(
    "given", [(0.1, 0.2, 0.3), [0.1, 0.2, 0.3, 0.4, -0.5, 0.6], np.array([0.1, 0.2, 0.3, 3.0, 0.0, 0.0])]
)
def test_a_frame_is_numbers_a_matrix_or_a_transform(given: Any) -> None:
    wanted = from_offset([float(value) for value in given])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = wanted.rotation, wanted.translation
    assert parse_frame("tool", given) == parse_frame("tool", wanted) == parse_frame("tool", matrix) == wanted


def test_numbers_and_flags_of_numpy_are_taken(folder: Path, run: urmpipe.Run) -> None:
    held = urmpipe.ingest(folder / "log.csv", "urm6", tsp=np.float32(0.01), strict=np.bool_(True))  # type: ignore[arg-type]
    np.testing.assert_allclose(held.q[:40], run.q, atol=1e-6)  # the period has seven digits


def test_a_warning_is_shown_once(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t [s],q1,q2,q3,q4,q5,q6\n" + "".join(f"{i / 100},0,{i / 90},0,0,0,0\n" for i in range(9)))
    with pytest.warns(urmpipe.UrmpipeWarning, match="no unit is given"):
        run = urmpipe.ingest(log, "urm6", period=0.01)
    with pytest.warns(urmpipe.UrmpipeWarning, match="the same data as log") as shown:
        compared = urmpipe.compare(run, run, tolerance=0.01)
    assert len(shown) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        urmpipe.compare(compared, baseline=compared)
        report = urmpipe.report([compared, run], tmp_path / "report.html")
    assert {one.kind for one in run.warnings} == {"assumed-unit", "period-not-used"}
    assert report.results == (compared, run)


def test_files_may_be_text(folder: Path, run: urmpipe.Run, tmp_path: Path) -> None:
    urmpipe.write_recording(run, f"{tmp_path}/log.rrd")
    assert isinstance(urmpipe.read_recording(f"{tmp_path}/log.rrd"), urmpipe.Run)
    urmpipe.write_map(run, f"{tmp_path}/log.toml")
    again = urmpipe.ingest(folder / "log.csv", "urm6", map=f"{tmp_path}/log.toml")
    assert (again.q == run.q).all()


def test_what_was_solved_and_written_is_json(tmp_path: Path) -> None:
    solved = urmpipe.ik([[0.3, 0.1, 0.4]], "ur5e", output=tmp_path / "joints.csv")
    assert json.loads(json.dumps(solved.to_dict()))["output"] == str(tmp_path / "joints.csv")


def options_of(command: click.Command) -> set[str]:
    """Return the options of a command and those below it."""
    own = {name for param in command.params if isinstance(param, click.Option) for name in param.opts}
    if not isinstance(command, click.Group):
        return own
    context = click.Context(command)
    below = (command.get_command(context, name) for name in command.list_commands(context))
    return own.union(*(options_of(one) for one in below if one))


def test_a_message_names_only_options_that_there_are() -> None:
    functions = [getattr(urmpipe, name) for name in urmpipe.__all__]
    keywords = {
        keyword
        for function in functions
        if callable(function) and not isinstance(function, type)
        for keyword in signature(function).parameters
    }
    subjects = (str(Finding("x", parameter=keyword)) for keyword in keywords)
    named = {subject.partition("(")[2].partition(")")[0] for subject in subjects} - {""}
    assert "--unit" in named
    assert named <= options_of(cli)


def test_the_robot_of_a_run_may_be_exchanged(folder: Path, run: urmpipe.Run) -> None:
    arm = run.robot
    assert arm is not None
    other = replace(arm, name="other", tool=Transform(translation=TOOL))
    held = urmpipe.compare(folder / "path.csv", run, other).runs[0].run
    assert held.robot == other
    assert run.robot == arm
