"""ingest, compare and report as a user runs them."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thinned_logs import lay_thinned_logs
from urmpipe_datasets import LOGS
from urmpipe_pipeline.results import read_recording
from urmpipe_pipeline.runs.run import Run

PATH, COPPELIA, MATLAB = LOGS / "path.csv", LOGS / "coppeliasim.csv", LOGS / "matlab.csv"
FEW = pytest.mark.usefixtures("few")
COMPARE_FEW = ("compare", "path.csv", "matlab.csv", "--robot", "urm6")

RunCommand = Callable[..., Any]
"""What the fixture `urmpipe` gives: arguments in; exit code, standard output and standard error out."""


@pytest.fixture
def few(tmp_path: Path) -> None:
    """The bundled logs in fewer rows, in the working folder."""
    lay_thinned_logs(tmp_path)


def files_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_ingest_says_what_it_inferred_and_changed(urmpipe: RunCommand, tmp_path: Path) -> None:
    ran = urmpipe("ingest", COPPELIA, "--robot", "urm6")
    assert ran.code == 0, ran.err
    assert files_in(tmp_path) == ["coppeliasim.rrd"]
    for word in ("delimiter", "coppeliasim", "repolarizations", "urm6", "Recording: coppeliasim.rrd"):
        assert word in ran.out
    assert "error" not in ran.err


def test_ingest_json_is_all_that_stands_on_standard_output(urmpipe: RunCommand, tmp_path: Path) -> None:
    ran = urmpipe("ingest", MATLAB, "--robot", "urm6", "--rotation", "zyx", "--json", "-o", "run.rrd")
    assert ran.code == 0
    answer = json.loads(ran.out)
    run = read_recording(tmp_path / "run.rrd")
    assert isinstance(run, Run)
    assert answer["samples"] == answer["grid_samples"] == run.log.rows == 7383
    assert answer["period"] == answer["tsp"] == 0.005
    assert answer["duration"] == 36.91
    assert answer["joints"] == list(run.log.joints)
    assert [one["row"] for one in answer["repolarizations"]] == [one.row for one in run.repolarizations]
    assert all(one["row"] == one["sample"] + 1 for one in answer["repolarizations"])
    assert answer["recording"] == "run.rrd"
    assert [w["kind"] for w in answer["warnings"]] == ["rotation-not-used"]
    assert "warning:" in ran.err


@FEW
@pytest.mark.slow
def test_compare_passes_and_its_exit_code_is_the_verdict(urmpipe: RunCommand, tmp_path: Path) -> None:
    ran = urmpipe(*COMPARE_FEW, "coppeliasim.csv", "solidworks", "--json", "-o", "a.rrd")
    assert ran.code == 0, ran.err
    answer = json.loads(ran.out)
    assert answer["verdict"] == "pass"
    assert [run["name"] for run in answer["runs"]] == ["matlab", "coppeliasim", "solidworks"]
    stored = read_recording(tmp_path / "a.rrd")
    assert json.loads(json.dumps(stored.to_dict()["runs"])) == answer["runs"]
    shifted = answer["runs"][2]["delta"]["norm"]
    assert shifted["mean"] == pytest.approx(0.0025, abs=5e-5)
    assert shifted["std"] < 5e-5


def test_compare_of_the_counter_rotating_module_fails(urmpipe: RunCommand, tmp_path: Path) -> None:
    ran = urmpipe("compare", PATH, LOGS / "counter_rotating.csv", "--robot", "urm6")
    assert ran.code == 1
    assert ran.out.splitlines()[:2] == [
        "FAIL  counter_rotating out of tolerance against path, assuming the positions are in m (path)",
        "      Furthest out: counter_rotating",
    ]
    assert files_in(tmp_path) == ["counter_rotating-against-path.rrd"]


@FEW
@pytest.mark.slow
def test_recordings_are_operands_too(urmpipe: RunCommand) -> None:
    assert urmpipe("ingest", "matlab.csv", "--robot", "urm6", "-o", "m.rrd").code == 0
    direct = json.loads(urmpipe(*COMPARE_FEW, "--json", "-o", "a.rrd").out)
    recorded = json.loads(urmpipe("compare", "path.csv", "m.rrd", "--json", "-o", "b.rrd").out)
    assert direct["runs"][0]["delta"] == recorded["runs"][0]["delta"]
    own = urmpipe("compare", "m.rrd", "m.rrd", "--json", "-o", "c.rrd")
    assert own.code == 0
    assert json.loads(own.out)["runs"][0]["delta"]["norm"]["max"] == 0.0
    ran = urmpipe("compare", "path.csv", "a.rrd")
    assert ran.code == 2
    assert "found the recording of a comparison, allowed: one that ingest wrote" in ran.err


@pytest.mark.slow
def test_a_path_without_time_goes_by_sample_index(urmpipe: RunCommand, tmp_path: Path) -> None:
    rows = np.loadtxt(PATH, delimiter=",", skiprows=1)
    np.savetxt(tmp_path / "as.csv", rows[:, 1:], delimiter=",", header="x,y,z", comments="", fmt="%.9f")
    ran = urmpipe("compare", "as.csv", MATLAB, "--robot", "urm6", "--json")
    assert ran.code == 0, ran.err
    assert json.loads(ran.out)["runs"][0]["samples"] == 7383


@FEW
@pytest.mark.slow
def test_report_is_written_beside_and_named_after_the_recording(urmpipe: RunCommand, tmp_path: Path) -> None:
    assert urmpipe(*COMPARE_FEW, "-q", "-o", "run.rrd").code == 0
    ran = urmpipe("report", "run.rrd")
    assert ran.code == 0, ran.err
    assert ran.out.startswith("Report: run.html")
    text = (tmp_path / "run.html").read_text(encoding="utf-8")
    assert "PASS" in text
    assert json.loads(urmpipe("report", "run.rrd", "--json").out)["report"] == "run.html"
    (tmp_path / "run.html").write_text("<p>somebody's own page</p>")
    ran = urmpipe("report", "run.rrd")
    assert ran.code == 2
    assert (tmp_path / "run.html").read_text() == "<p>somebody's own page</p>"


@FEW
@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no closed pipes of this kind")
def test_a_reader_that_leaves_does_not_turn_a_pass_into_a_fail(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "urmpipe", *COMPARE_FEW]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    said = process.stderr.read().decode()
    process.stderr.close()
    assert process.wait() == 0
    assert "Traceback" not in said
