"""`urmpipe ik` as a user runs it: targets and paths in; a table, JSON, a joint log or a recording out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ik_runs import answer, wave, write_path
from urmpipe.main import run
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import shell_quote
from urmpipe_models.ik.solutions import forward_targets, pose_errors
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.results import read_recording
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.solved_targets.result import IkResult
from urmpipe_pipeline.solved_targets.scene import ghosts

Captured = pytest.CaptureFixture[str]

HALF_PI = "1.5707963267948966"
DEFAULT = f"-0.069,0,0.112,0.7853981633974483,-{HALF_PI},-0.7853981633974483\n"
"""The default position of the 2019 paper, where theta5 = 0 in one of its solutions."""

PRINTED = """
-3.1416 -1.1547 -0.4276  3.1416  1.5593  0
-3.1416 -1.1547 -0.4276  0      -1.5593  3.1416
-3.1416  1.7113  0.7329  0       0.6974  3.1416
-3.1416  1.7113  0.7329 -3.1416 -0.6974  0
 0       0       0       0       0       0
 0       4.0689  0.3053  0       1.9090  0
 0       4.0689  0.3053  3.1416 -1.9090  3.1416
"""
"""Its solutions as the paper prints them, without the one at theta5 = 0 that is not one (see errata)."""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with targets of arm6: the default position, one out of reach, one that is none."""
    rows = [DEFAULT, "2,0,0.1,0,0,0\n", "nan,0,0.3,0,0,0\n", "0,0,0.3,0,0,0\n"]
    (tmp_path / "targets.csv").write_text("x,y,z,rz,ry,rx\n" + "".join(rows))
    (tmp_path / "default.csv").write_text("x,y,z,rz,ry,rx\n" + DEFAULT)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def turned(angles: FloatArray) -> FloatArray:
    """Return angles within -pi to pi."""
    return np.asarray(angles - 2 * np.pi * np.round(angles / (2 * np.pi)))


# --- targets -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [(), ("--all",)])
def test_json_lists_all_eight_solutions_of_the_papers_default_position(
    capsys: Captured, options: tuple[str, ...]
) -> None:
    found = answer(capsys, 0, "default.csv", "--robot", "arm6", *options)
    assert (found["schema"], found["method"], found["verdict"]) == (1, "spherical wrist", "pass")
    (target,) = found["targets"]
    assert (target["row"], target["reason"]) == (1, None)
    assert target["singular"] == ["wrist aligned"]
    solutions = np.array([one["q"] for one in target["solutions"]])
    assert len(solutions) == 8
    assert len({one["branch"] for one in target["solutions"]}) == 8
    assert max(one["position_error"] for one in target["solutions"]) < 1e-12
    assert max(one["angle"] for one in target["solutions"]) < 1e-12
    printed = np.array([line.split() for line in PRINTED.split("\n") if line], dtype=float)
    away = np.abs(turned(solutions[None] - printed[:, None])).max(axis=2)
    assert (away.min(axis=1) < 1e-4).all()  # the paper prints four digits
    assert target["nearest"] == int(np.argmin(np.abs(solutions).sum(axis=1)))


def test_one_bad_row_does_not_stop_the_others(capsys: Captured) -> None:
    found = answer(capsys, 1, "targets.csv", "--robot", "arm6")
    assert (found["verdict"], found["reached"]) == ("fail", 2)
    assert [one["row"] for one in found["targets"]] == [1, 2, 3, 4]
    assert [len(one["solutions"]) for one in found["targets"]] == [8, 0, 0, 8]
    reasons = [one["reason"] for one in found["targets"]]
    assert reasons[0] is None
    assert reasons[3] is None
    assert reasons[2] == "column x: found no number, allowed: a finite number"
    assert "allowed: " in reasons[1]


def test_the_table_has_the_solution_nearest_to_the_start_and_tells_why_others_are_not_reached(
    capsys: Captured,
) -> None:
    assert run(["ik", "targets.csv", "--robot", "arm6"]) == 1
    out, err = capsys.readouterr()
    lines = out.splitlines()
    assert lines[0] == "FAIL  targets: arm6 reaches 2 of 4 targets (closed form: spherical wrist)"
    first = next(line for line in lines if line.startswith("1 "))
    assert first.split()[-7:-1] == ["0.0"] * 6
    assert lines[1].startswith("      Not reached: row 2: ")
    assert lines[2] == "      Not reached: row 3: column x: found no number, allowed: a finite number"
    warnings = err.splitlines()
    assert any(line.startswith("warning: row 1: wrist aligned: theta4 and theta6: ") for line in warnings)


def test_all_prints_every_solution_and_start_chooses(capsys: Captured) -> None:
    assert run(["ik", "default.csv", "--robot", "arm6", "--all"]) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("1 ")]
    assert len(rows) == 8
    assert run(["ik", "default.csv", "--robot", "arm6", "--start", "3.1,1.7,0.7,0,0.7,3.1"]) == 0
    (row,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("1 ")]
    assert row.split()[-7:-1] == ["180.0", "98.05", "41.99", "0.0", "39.96", "180.0"]  # four digits


def test_warnings_are_of_the_solutions_that_are_shown(capsys: Captured) -> None:
    start = ("--start", "3.1,1.7,0.7,0,0.7,3.1")  # near a solution whose wrist is not aligned
    assert run(["ik", "default.csv", "--robot", "arm6", *start]) == 0
    assert capsys.readouterr().err == ""
    assert answer(capsys, 0, "default.csv", "--robot", "arm6", *start)["targets"][0]["singular"] == [
        "wrist aligned"
    ]
    assert run(["ik", "default.csv", "--robot", "arm6", "--all", *start]) == 0
    assert capsys.readouterr().err.startswith("warning: row 1: wrist aligned: ")


def test_the_papers_four_digits_and_a_start_in_degrees_are_warned_of(capsys: Captured, folder: Path) -> None:
    (folder / "four.csv").write_text("x,y,z,rz,ry,rx\n-0.069,0,0.112,0.7854,-1.5708,-0.7854\n")
    assert run(["ik", "four.csv", "--robot", "arm6", "--start", "0,0,-90,0,0,0"]) == 0
    said = capsys.readouterr().err.splitlines()
    assert said[0] == (
        "warning: start (--start): these values look like degrees: found theta3 = -90 rad (-5156.62 deg),"
        " allowed: rad"
    )
    assert said[1].startswith("warning: row 1: singular or nearly so: smallest singular value ")
    assert len(said) == 2


@pytest.mark.slow
def test_a_target_just_out_of_reach_takes_the_nearest_point_within_the_tolerance(
    capsys: Captured, folder: Path
) -> None:
    (folder / "high.csv").write_text("x,y,z\n-0.03,0,0.374\n")
    assert run(["ik", "high.csv", "--robot", "arm6"]) == 1
    capsys.readouterr()
    found = answer(capsys, 0, "high.csv", "--robot", "arm6", "--tolerance", "3.5mm")
    (solution,) = found["targets"][0]["solutions"]
    assert 1e-3 < solution["position_error"] < 3.5e-3
    (warning,) = [one for one in found["warnings"] if one["kind"] == "nearest-point"]
    assert warning["message"].startswith(
        "row 1: out of reach, the nearest point within the tolerance is taken: up to "
    )


def test_an_iterative_arm_lists_what_restarts_collect(capsys: Captured, folder: Path) -> None:
    arm = load_robot("urm6")
    q = np.array([[0.3, 2.9, -0.4, 3.3, 0.2, 2.8]])
    write_path(folder / "one.csv", "urm6", q)
    text = (folder / "one.csv").read_text().splitlines()
    (folder / "one.csv").write_text("\n".join(line.partition(",")[2] for line in text) + "\n")
    one = answer(capsys, 0, "one.csv", "--robot", "urm6")
    every = answer(capsys, 0, "one.csv", "--robot", "urm6", "--all")
    again = answer(capsys, 0, "one.csv", "--robot", "urm6", "--all")
    assert one["method"] == every["method"] == "iterative"
    assert len(one["targets"][0]["solutions"]) == 1
    solutions = np.array([found["q"] for found in every["targets"][0]["solutions"]])
    assert len(solutions) > 1
    position, turn = pose_errors(arm, solutions, forward_targets(arm, np.repeat(q, len(solutions), axis=0)))
    assert np.abs(position).max() < 1e-9
    assert np.abs(turn).max() < 1e-9
    assert again == every


# --- outputs -----------------------------------------------------------------------------------------


def test_a_joint_log_is_what_ingest_reads(capsys: Captured, folder: Path) -> None:
    q = wave([0.1, -0.9, 1.2, -0.5, 0.7, 0.2], 0.3, 60)
    start = write_path(folder / "path.csv", "ur5e", q)
    assert run(["ik", "path.csv", "--robot", "ur5e", "--start", start, "-o", "log.csv"]) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[0] == "PASS  path: ur5e reaches 60 targets (closed form: three parallel axes)"
    assert out.splitlines()[-1] == "Joints: log.csv  (read it: urmpipe ingest log.csv --robot ur5e)"
    log = ingest_log([folder / "log.csv"], robot=load_robot("ur5e")).log
    assert log.joints == load_robot("ur5e").coordinates
    assert np.array_equal(log.t_ns, 10_000_000 * np.arange(60))
    assert np.abs(log.q - q).max() < 1e-9  # the poses stand in the file with 16 digits
    assert run(["robot", "export", "ur5e", "-o", "mine.toml", "-q"]) == 0
    (folder / "mine.toml").replace(folder / "my arm.toml")
    assert run(["ik", "path.csv", "--robot", "my arm.toml", "-o", "my log.csv"]) == 0
    told = f"(read it: urmpipe ingest {shell_quote('my log.csv')} --robot {shell_quote('my arm.toml')})"
    assert capsys.readouterr().out.splitlines()[-1] == f"Joints: my log.csv  {told}"
    (folder / "my arm.toml").replace(folder / "mine.toml")
    assert run(["ik", "path.csv", "--robot", "mine.toml", "-o", "log.csv"]) == 0
    told = "(read it: urmpipe ingest log.csv --robot mine.toml; it replaced an earlier one)"
    assert capsys.readouterr().out.splitlines()[-1] == f"Joints: log.csv  {told}"


def test_targets_without_solution_are_left_out_of_a_log(capsys: Captured, folder: Path) -> None:
    assert run(["ik", "targets.csv", "--robot", "arm6", "-o", "log.csv", "-q"]) == 1
    table = np.genfromtxt(folder / "log.csv", delimiter=",", names=True)
    assert table["urmpipe_target_row"].tolist() == [1, 4]
    written = np.loadtxt(folder / "log.csv", delimiter=",", skiprows=1)[:, :-1]
    found = answer(capsys, 1, "targets.csv", "--robot", "arm6", "-o", "log.csv")
    assert found["output"] == "log.csv"
    nearest = [one["solutions"][one["nearest"]]["q"] for one in found["targets"] if one["solutions"]]
    assert np.array_equal(written, nearest)


@pytest.mark.slow
def test_a_recording_shows_the_solution_and_every_other_branch_as_a_ghost(
    capsys: Captured, folder: Path
) -> None:
    assert run(["ik", "targets.csv", "--robot", "arm6", "--all", "-o", "targets.rrd"]) == 1
    assert "Recording: targets.rrd" in capsys.readouterr().out
    made = read_recording(folder / "targets.rrd")
    assert isinstance(made, IkResult)
    assert np.isfinite(made.q).all(axis=1).tolist() == [True, False, False, True]
    assert len(ghosts(made)) == 8
    found = answer(capsys, 1, "targets.csv", "--robot", "arm6")
    for target in (0, 3):
        listed = {one["branch"]: one["q"] for one in found["targets"][target]["solutions"]}
        shown = {one.name: one.q[target].tolist() for one in ghosts(made) if np.isfinite(one.q[target]).all()}
        assert len(shown) == 7
        assert all(listed[name] == q for name, q in shown.items())
    head = "x,y,z,rz,ry,rx\n"
    (folder / "some.csv").write_text(
        f"{head}{DEFAULT}-0.309,0,0.072{DEFAULT[14:]}"
    )  # stretched: left arm only
    assert run(["ik", "some.csv", "--robot", "arm6", "--all", "-o", "some.rrd", "-q"]) == 0
    some = read_recording(folder / "some.rrd")
    assert isinstance(some, IkResult)
    assert sum(bool(np.isfinite(one.q[1]).all()) for one in ghosts(some)) == 3
    assert run(["ik", "targets.csv", "--robot", "arm6", "-o", "targets.rrd", "-q"]) == 1
    alone = read_recording(folder / "targets.rrd")
    assert isinstance(alone, IkResult)
    assert not ghosts(alone)


def test_all_of_a_path_records_the_branches_that_run_beside_it(capsys: Captured, folder: Path) -> None:
    q = wave([0.3, 0.8, -0.6, 0.5, 0.7, 0.2], 0.2, 40)
    start = write_path(folder / "path.csv", "arm6", q)
    assert run(["ik", "path.csv", "--robot", "arm6", "--start", start, "--all", "-o", "path.rrd"]) == 0
    made = read_recording(folder / "path.rrd")
    assert isinstance(made, IkResult)
    assert np.abs(made.q - q).max() < 1e-9
    assert {np.isfinite(one.q).all() for one in ghosts(made)} == {np.True_}
    arm, targets = load_robot("arm6"), forward_targets(load_robot("arm6"), q)
    for ghost in ghosts(made):
        position, turn = pose_errors(arm, ghost.q, targets)
        assert np.abs(position).max() < 1e-10
        assert np.abs(turn).max() < 1e-10
