"""`urmpipe ik` along a path: its summary, joints that are too fast, jumps, and the demo's path."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ik_runs import answer, wave, write_path
from urmpipe import ik
from urmpipe.main import run
from urmpipe_datasets import LOGS
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.results import present, read_recording

Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with one target of arm6."""
    (tmp_path / "default.csv").write_text("x,y,z,rz,ry,rx\n0.1,0.05,0.25,0.3,0.4,0.1\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_path_has_a_summary_and_one_solution_a_row_in_json(capsys: Captured, folder: Path) -> None:
    q = wave([0.3, 0.8, -0.6, 0.5, 0.7, 0.2], 0.2, 40)
    start = write_path(folder / "path.csv", "arm6", q)
    assert run(["ik", "path.csv", "--robot", "arm6", "--start", start]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "PASS  path: arm6 reaches 40 targets (closed form: spherical wrist)"
    assert lines[1].startswith("      Branch: ")
    assert lines[2].startswith("      Nearest to a singularity: at t = 0.")
    assert lines[3].startswith("      Off by: ")
    found = answer(capsys, 0, "path.csv", "--robot", "arm6", "--start", start)
    assert (found["jumps"], found["speed_violations"]) == ([], [])
    solved = np.array([one["solutions"][0]["q"] for one in found["targets"]])
    assert np.abs(solved - q).max() < 1e-9
    assert [one["t"] for one in found["targets"]] == pytest.approx(0.01 * np.arange(40), abs=1e-12)


def test_a_period_makes_a_path_of_targets_without_times(capsys: Captured, folder: Path) -> None:
    (folder / "line.csv").write_text("x,y,z\n" + "".join(f"0.2,{0.001 * k},1.0\n" for k in range(20)))
    found = answer(capsys, 0, "line.csv", "--robot", "urm6", "--tsp", "5ms")
    assert [one["t"] for one in found["targets"]] == pytest.approx(0.005 * np.arange(20), abs=1e-12)
    assert "jumps" in found
    (folder / "late.csv").write_text(
        "t,x,y,z\n" + "".join(f"{7 + k},0.2,{0.001 * k},1.0\n" for k in range(4))
    )
    late = answer(capsys, 0, "late.csv", "--robot", "urm6")
    assert [one["t"] for one in late["targets"]] == [7.0, 8.0, 9.0, 10.0]
    alone = answer(capsys, 0, "line.csv", "--robot", "urm6")
    assert "jumps" not in alone
    assert "t" not in alone["targets"][0]


def test_a_joint_that_is_too_fast_fails_the_path(capsys: Captured, folder: Path) -> None:
    q = np.tile([0.1, -0.9, 1.2, -0.5, 0.7, 0.2], (30, 1))
    q[:, 0] += 0.05 * np.arange(30)  # 5 rad/s at 10 ms; the arm's first joint is allowed 3.14
    start = write_path(folder / "path.csv", "ur5e", q)
    found = answer(capsys, 1, "path.csv", "--robot", "ur5e", "--start", start)
    assert found["reached"] == 30
    (fast,) = found["speed_violations"]
    assert (fast["row"], fast["last_row"]) == (1, 30)
    assert fast["joint"] == load_robot("ur5e").coordinates[0]
    assert fast["speed"] == pytest.approx(5.0, abs=1e-6)
    assert run(["ik", "path.csv", "--robot", "ur5e", "--start", start]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == (
        "FAIL  path: ur5e reaches 30 targets (closed form: three parallel axes), with 1 joint too fast"
    )
    joint = fast["joint"]
    assert (
        f"      Too fast: {joint} at 286.5 deg/s of 180 deg/s allowed, at t = 0.000 s (row 1) to row 30"
        in lines
    )


def errors(shown: Presentation) -> list[tuple[int | None, str]]:
    """Return the times and the first words of what fails a path."""
    return [(one.t_ns, str(one.words).split(": ")[0]) for one in shown.body.events() if one.level == "error"]


def test_recording_and_report_of_a_path_that_is_too_fast_fail_as_ik_does(folder: Path) -> None:
    q = np.tile([0.1, -0.9, 1.2, -0.5, 0.7, 0.2], (30, 1))
    q[:, 0] += 0.05 * np.arange(30)
    q[:, 5] += 0.05 * np.arange(30)
    write_path(folder / "path.csv", "ur5e", q)
    found = ik("path.csv", "ur5e", start=q[0].tolist(), output="path.rrd")
    assert (found.verdict, int(found.reached.sum())) == ("fail", 30)
    kept = present(read_recording(folder / "path.rrd"))
    assert (kept.verdict, kept.headline) == ("fail", present(found).headline)
    assert kept.headline.endswith(", with 2 joints too fast")
    assert errors(kept) == [(0, "too fast")] * 2


def test_a_jump_over_rows_that_are_not_reached_tells_from_where_it_comes(
    capsys: Captured, folder: Path
) -> None:
    arm = load_robot("ur5e")
    q = np.array([0.1, -0.9, 1.2, -0.5, 0.7, 0.2]) + np.linspace(0.0, 0.1, 40)[:, None] * np.eye(6)[0]
    q[:, 5] = np.linspace(arm.moving[5].upper - 0.1, arm.moving[5].upper + 0.1, 40)  # a turn back in the gap
    start = write_path(folder / "path.csv", "ur5e", q)
    lines = (folder / "path.csv").read_text().splitlines()
    lines[17:24] = [line.replace(line.split(",")[3], "3.0") for line in lines[17:24]]  # rows 17 to 23: z
    (folder / "path.csv").write_text("\n".join(lines) + "\n")
    found = answer(capsys, 1, "path.csv", "--robot", "ur5e", "--start", start)
    assert [one["row"] for one in found["targets"] if one["reason"]] == list(range(17, 24))
    (jump,) = found["jumps"]
    assert (jump["from_row"], jump["row"]) == (16, 24)
    assert jump["steps"] == pytest.approx({"wrist_3_joint": q[23, 5] - q[15, 5] - 2 * np.pi}, abs=1e-9)
    ik("path.csv", "ur5e", start=q[0].tolist(), output="path.rrd")
    kept = present(read_recording(folder / "path.rrd"))
    assert kept.verdict == "fail"
    assert kept.headline.startswith("path: ur5e reaches 33 of 40 targets (")
    assert kept.headline.endswith("), with 1 jump and 1 joint too fast")
    when = [(160_000_000, "not reached"), (230_000_000, "jump at t = 0.230 s (row 24), since row 16, at (")]
    assert [
        (t, words[: len(begin)]) for (t, words), (_, begin) in zip(errors(kept), when, strict=False)
    ] == when
    assert run(["ik", "path.csv", "--robot", "ur5e", "--start", start]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("      Jump: at t = 0.230 s (row 24), since row 16, at (") for line in lines)
    (last,) = [line.split() for line in lines if line.startswith("wrist_3_joint ")]
    fastest = np.degrees(abs(jump["steps"]["wrist_3_joint"]) / 0.08)
    assert last[-4] == f"{fastest:.0f}" == "4471"  # over the gap, as the joint that is too fast


def test_a_wrap_of_values_within_pi_is_no_speed(capsys: Captured, folder: Path) -> None:
    q = np.array([-3.0, -1.0, 1.2, 0.5, 0.8, 3.0]) + np.outer(0.01 * np.arange(60), [-1, 0, 0, 0, 0, 2])
    start = write_path(folder / "path.csv", "urm6", q)
    for more in ((), ("--within-pi",)):
        assert run(["ik", "path.csv", "--robot", "urm6", "--start", start, *more]) == 0
        lines = [line.split() for line in capsys.readouterr().out.splitlines() if line.startswith("phi")]
        assert [line[5] for line in lines] == ["57.30", *["0.0000"] * 4, "114.6"]  # deg/s
        assert (abs(float(lines[0][4])) < 180.0) == bool(more)  # the last value is within pi


@pytest.mark.slow
def test_the_demo_path_solved_for_urm6_passes_against_itself(
    urmpipe: Callable[..., Any], folder: Path
) -> None:
    ran = urmpipe("ik", LOGS / "path.csv", "--robot", "urm6", "-o", "log.csv")
    assert ran.code == 0, ran.err
    assert ran.out.startswith("PASS  path: urm6 reaches 7383 targets (iterative)\n")
    ran = urmpipe(
        "compare", LOGS / "path.csv", "log.csv", "--robot", "urm6", "--tolerance", "0.0035", "--json"
    )
    assert ran.code == 0, ran.err
    found = json.loads(ran.out)
    assert found["verdict"] == "pass"
    assert found["runs"][0]["delta"]["norm"]["max"] < 1e-8
