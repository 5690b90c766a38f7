"""Solved joint values in a recording: every branch and every target comes back as it was."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from same_results import assert_same
from urmpipe_models.inverse.targets import Targets
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.inverse.solved import goals_of
from urmpipe_pipeline.recording import read_recording, write_recording
from urmpipe_pipeline.runs.results import Run

MakeSolved = Callable[..., Run]

BRANCHES = ("right, elbow up, flipped", "left, elbow down, not flipped")


@pytest.mark.parametrize("timed", [True, False])
def test_a_solved_run_comes_back_as_it_was(timed: bool, make_solved: MakeSolved, tmp_path: Path) -> None:
    run = make_solved(timed=timed)
    assert [ghost.name for ghost in run.ghosts] == list(BRANCHES)
    assert_same(read_recording(write_recording(run, tmp_path / "solved.rrd")), run)


@pytest.mark.parametrize("branches", [("a",) * 40, ("a", "b") * 20, ("",) * 39 + ("ü, 肘",), ("", "a") * 20])
def test_the_names_of_the_branches_chosen_come_back(
    branches: tuple[str, ...], make_solved: MakeSolved, tmp_path: Path
) -> None:
    run = make_solved()
    assert run.goals is not None
    run = replace(run, goals=replace(run.goals, branches=branches))
    assert_same(read_recording(write_recording(run, tmp_path / "solved.rrd")), run)


def test_positions_alone_and_targets_that_are_none_come_back_as_they_were(
    make_solved: MakeSolved, tmp_path: Path
) -> None:
    run = make_solved(timed=False)
    assert run.goals is not None
    position = run.goals.position.copy()
    position[5] = np.nan
    goals = goals_of(Targets(position), run.t_ns, run.goals.reasons)
    run = replace(run, goals=goals, ghosts=())
    assert_same(read_recording(write_recording(run, tmp_path / "solved.rrd")), run)


def test_branches_may_be_called_anything(make_solved: MakeSolved, tmp_path: Path) -> None:
    names = ("1", "q", "a/b", "a\\", "a", "a ", "", "unnamed", "same", "same", "elbow (2)", "ü, 肘", "**")
    run = make_solved(names=names, rows=20)
    assert [ghost.name for ghost in run.ghosts] == list(names)
    assert_same(read_recording(write_recording(run, tmp_path / "solved.rrd")), run)


def test_a_comparison_keeps_the_branches_of_each_run(make_solved: MakeSolved, tmp_path: Path) -> None:
    run = make_solved()
    comparison = compare_runs(run, [run, replace(run, name="again")], CompareOptions({"axis": 1e-3}))
    back = read_recording(write_recording(comparison, tmp_path / "both.rrd"))
    assert isinstance(back, Comparison)
    for one in back.runs:
        assert_same(one.run.ghosts, run.ghosts)
        assert_same(one.run.goals, run.goals)
