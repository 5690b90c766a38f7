"""report and its files of figures as a user runs them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from thinned_logs import lay_thinned_logs
from urmpipe_pipeline.results import present, read_recording

RunCommand = Callable[..., Any]
COMPARE = ("compare", "matlab.csv", "coppeliasim.csv", "--robot", "urm6", "--tolerance")
TOLERANCE = "axis=1mm,path=1mm,angle=0.5deg,joint=0.2deg"


@pytest.fixture
def recording(urmpipe: RunCommand, tmp_path: Path) -> Path:
    """The recording of one log against another one."""
    path = tmp_path / "run.rrd"
    lay_thinned_logs(tmp_path)
    assert urmpipe(*COMPARE, TOLERANCE, "-o", path).code == 1
    return path


@pytest.mark.slow
def test_json_lists_no_figures_where_none_were_asked_for(urmpipe: RunCommand, recording: Path) -> None:
    ran = urmpipe("report", recording, "--json")
    assert json.loads(ran.out) == {
        "schema": 1,
        "report": "run.html",
        "recordings": [{"name": "coppeliasim-against-matlab", "verdict": "fail"}],
        "figures": [],
    }


@pytest.mark.slow
@pytest.mark.parametrize(("x", "verdict", "reached"), [(0.3, "pass", ""), (9.0, "fail", "1 of ")])
def test_ik_its_recording_and_the_report_of_it_say_one_verdict(
    urmpipe: RunCommand, tmp_path: Path, x: float, verdict: str, reached: str
) -> None:
    (tmp_path / "poses.csv").write_text(f"x [m],y [m],z [m]\n0.4,0.2,0.3\n{x},0.2,0.4\n")
    ran = urmpipe("ik", "poses.csv", "--robot", "ur5e", "-o", "poses.rrd")
    said = f"poses: ur5e reaches {reached}2 targets (iterative)"
    assert (ran.code, ran.out.splitlines()[0]) == (
        ("pass", "fail").index(verdict),
        f"{verdict.upper()}  {said}",
    )
    recorded = present(read_recording(tmp_path / "poses.rrd"))
    assert (recorded.verdict, recorded.headline) == (verdict, said)
    ran = urmpipe("report", "poses.rrd", "--json")
    assert json.loads(ran.out)["recordings"] == [{"name": "poses", "verdict": verdict}]
    page = (tmp_path / "poses.html").read_text(encoding="utf-8")
    assert " ".join(re.sub("<[^>]*>", " ", page.split("<h1")[1].split("</h1")[0]).split()).endswith(
        f"{verdict.upper()} {said}"
    )


@pytest.mark.slow
def test_the_numbers_of_compare_stand_in_the_report_of_its_recording(
    urmpipe: RunCommand, recording: Path, tmp_path: Path
) -> None:
    ran = urmpipe(*COMPARE, TOLERANCE, "--json", "-o", tmp_path / "b.rrd")
    (run,) = json.loads(ran.out)["runs"]
    assert urmpipe("report", recording).code == 0
    page = recording.with_suffix(".html").read_text(encoding="utf-8")
    for one in (*run["delta"].values(), run["path"]):
        for key in ("max", "rms", "mean", "std", "p95"):
            assert f'title="{one[key]!r} m"' in page  # all digits to who points at a cell
    for one in (run["angle"], *run["joints"].values()):
        for key in ("max", "rms", "mean", "std", "p95"):
            assert f'title="{one[key]!r} rad"' in page
