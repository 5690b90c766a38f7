"""Solved joint values in a recording: branches and targets come back, and are drawn where they are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from same_results import assert_same
from urmpipe_models.catalogue import load_robot
from urmpipe_models.errors import OutputError
from urmpipe_models.inverse.targets import Targets, targets_of
from urmpipe_pipeline.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison import Comparison
from urmpipe_pipeline.joint_log import FloatArray, SourceFile
from urmpipe_pipeline.recording import read_recording, write_recording
from urmpipe_pipeline.recording.entities import blocks
from urmpipe_pipeline.recording.metadata import to_json
from urmpipe_pipeline.recording.store import Store
from urmpipe_pipeline.recording.verify import verify
from urmpipe_pipeline.results import Run
from urmpipe_pipeline.solved import Ghost, goals_of, row_times, solved_run

UR5E = load_robot("ur5e")
FILE = SourceFile("targets.csv", "0" * 64, 123)
STEP_NS = 20_000_000
TOO_FAR = "the wrist centre is 1.2 m away, allowed: 0.1 to 0.9 m"
BRANCHES = ("right, elbow up, flipped", "left, elbow down, not flipped")


def way(rows: int) -> FloatArray:
    """Return a slow motion of six joints, a row 20 ms."""
    t = np.arange(rows)[:, None] * STEP_NS / 1e9
    return np.array([0.1, -1.2, 1.3, -0.4, 0.7, 0.3]) + np.array([0.3, 0.2, -0.2, 0.4, -0.3, 0.5]) * t


def build_solved(rows: int = 40, timed: bool = True, names: tuple[str, ...] = BRANCHES) -> Run:
    """Return a solved run: rows 5 to 8 unreachable, and ghost k there from row 2 k on, 20 to 29 apart."""
    q = way(rows)
    times = np.arange(rows) * STEP_NS if timed else row_times(rows)
    targets = targets_of(UR5E, q)
    q[5:9] = np.nan
    reasons = [TOO_FAR if 5 <= k < 9 else "" for k in range(rows)]
    ghosts = []
    for k, name in enumerate(names):
        there = np.r_[2 * k : min(20, rows), 30:rows] if rows > 30 else np.arange(min(k, rows - 1), rows)
        ghosts.append(Ghost(name, times[there], way(rows)[there] + 0.3 * (k + 1)))
    return solved_run(
        "targets", UR5E, times if timed else None, q, goals=goals_of(targets, times, reasons), ghosts=ghosts,
        files=[FILE], options={"robot": "ur5e", "all": True},
    )  # fmt: skip


@pytest.mark.parametrize("timed", [True, False])
def test_a_solved_run_comes_back_as_it_was(timed: bool, tmp_path: Path) -> None:
    run = build_solved(timed=timed)
    assert [ghost.name for ghost in run.ghosts] == list(BRANCHES)
    assert_same(read_recording(write_recording(run, tmp_path / "solved.rrd")), run)


def test_positions_alone_and_targets_that_are_none_come_back_as_they_were(tmp_path: Path) -> None:
    run = build_solved(timed=False)
    assert run.goals is not None
    position = run.goals.position.copy()
    position[5] = np.nan
    goals = goals_of(Targets(position), run.t_ns, run.goals.reasons)
    run = replace(run, goals=goals, ghosts=())
    assert_same(read_recording(write_recording(run, tmp_path / "solved.rrd")), run)


def test_branches_may_be_called_anything(tmp_path: Path) -> None:
    names = ("1", "q", "a/b", "a\\", "a", "a ", "", "unnamed", "same", "same", "elbow (2)", "ü, 肘", "**")
    run = build_solved(names=names, rows=20)
    assert [ghost.name for ghost in run.ghosts] == list(names)
    assert_same(read_recording(write_recording(run, tmp_path / "solved.rrd")), run)


def test_branches_stand_below_their_names() -> None:
    found = {block.entity: block for block in blocks(build_solved())}
    ghost = found["/branches/right\\,\\ elbow\\ up\\,\\ flipped/q"]
    assert ghost.names == UR5E.coordinates
    assert ghost.numbers is not None
    assert ghost.numbers[0] == "row"
    assert ghost.numbers[1].tolist() == [*range(1, 21), *range(31, 41)]
    assert found["/targets/position"].values.shape == (40, 3)
    assert found["/targets/quat_xyzw"].names == ("qx", "qy", "qz", "qw")


def test_a_comparison_keeps_the_branches_of_each_run(tmp_path: Path) -> None:
    run = build_solved()
    comparison = compare_runs(run, [run, replace(run, name="again")], CompareOptions({"axis": 1e-3}))
    back = read_recording(write_recording(comparison, tmp_path / "both.rrd"))
    assert isinstance(back, Comparison)
    for one in back.runs:
        assert_same(one.run.ghosts, run.ghosts)
        assert_same(one.run.goals, run.goals)


def test_a_branch_that_reads_back_otherwise_is_refused(tmp_path: Path) -> None:
    run = build_solved()
    path = write_recording(run, tmp_path / "solved.rrd")
    wrong = [replace(ghost, q=ghost.q + 1e-15) for ghost in run.ghosts]
    every = blocks(replace(run, ghosts=tuple(wrong)))
    with pytest.raises(OutputError) as error:
        verify(path, path, every, Store(path).metadata)
    assert [one.message.split(" in row")[0] for one in error.value.findings] == [
        f"reads back otherwise than written: {block.entity}" for block in every if "/branches" in block.entity
    ]
    assert len(error.value.findings) == 2


def test_the_metadata_of_a_log_say_nothing_of_branches() -> None:
    run = replace(build_solved(), ghosts=(), goals=None)
    assert '"ghosts"' not in to_json(run, blocks(run))
