"""Solved joint values in a recording: every branch and every target comes back as it was."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from same_results import assert_same
from urmpipe_models.errors import OutputError, RecordingError
from urmpipe_models.inverse.targets import Targets
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.inverse.solved import goals_of
from urmpipe_pipeline.recording import writer
from urmpipe_pipeline.recording.entities import blocks
from urmpipe_pipeline.recording.metadata import to_json
from urmpipe_pipeline.recording.store import Store
from urmpipe_pipeline.recording.verify import verify
from urmpipe_pipeline.results import read_recording, write_recording
from urmpipe_pipeline.runs.results import Run

MakeSolved = Callable[..., Run]

BRANCHES = ("right, elbow up, flipped", "left, elbow down, not flipped")
SENT = "/branches/right\\,\\ elbow\\ up\\,\\ flipped"
"""The entities of the first branch."""


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


def test_branches_stand_below_their_names(make_solved: MakeSolved) -> None:
    found = {block.entity: block for block in blocks(make_solved())}
    ghost = found[f"{SENT}/q"]
    assert ghost.names == load_robot("ur5e").coordinates
    assert ghost.numbers is not None
    assert ghost.numbers[0] == "row"
    assert ghost.numbers[1].tolist() == [*range(1, 21), *range(31, 41)]
    assert found["/targets/position"].values.shape == (40, 3)
    assert found["/targets/quat_xyzw"].names == ("qx", "qy", "qz", "qw")


def test_a_comparison_keeps_the_branches_of_each_run(make_solved: MakeSolved, tmp_path: Path) -> None:
    run = make_solved()
    comparison = compare_runs(run, [run, replace(run, name="again")], CompareOptions({"axis": 1e-3}))
    back = read_recording(write_recording(comparison, tmp_path / "both.rrd"))
    assert isinstance(back, Comparison)
    for one in back.runs:
        assert_same(one.run.ghosts, run.ghosts)
        assert_same(one.run.goals, run.goals)


def test_a_branch_that_reads_back_otherwise_is_refused(make_solved: MakeSolved, tmp_path: Path) -> None:
    run = make_solved()
    path = write_recording(run, tmp_path / "solved.rrd")
    wrong = [replace(ghost, q=ghost.q + 1e-15) for ghost in run.ghosts]
    every = blocks(replace(run, ghosts=tuple(wrong)))
    with pytest.raises(OutputError) as error:
        verify(path, path, every, Store(path).metadata)
    assert [one.message.split(" in row")[0] for one in error.value.findings] == [
        f"reads back otherwise than written: {block.entity}" for block in every if "/branches" in block.entity
    ]
    assert len(error.value.findings) == 2


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("chosen", [["a", 3]], "ValueError('3 branches chosen of 40 targets')"),
        ("chosen", [["a"]], "ValueError('not enough values to unpack (expected 2, got 1)')"),
        ("missed", [], "AttributeError(\"'list' object has no attribute 'get'\")"),
        ("ghosts", [{"name": "a", "entity": "/nowhere"}], "KeyError('/nowhere')"),
    ],
)
def test_damaged_metadata_of_branches_are_one_line(
    name: str, value: Any, said: str, make_solved: MakeSolved, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = make_solved()
    document = json.loads(to_json(run, blocks(run)))
    document["result"][name] = value
    monkeypatch.setattr(writer, "to_json", lambda *_: json.dumps(document))
    path = write_recording(run, tmp_path / "damaged.rrd")
    with pytest.raises(RecordingError) as error:
        read_recording(path)
    assert [str(one) for one in error.value.findings] == [
        f"{path}: found damaged metadata ({said}), allowed: what urmpipe wrote"
    ]


def test_the_metadata_of_a_log_say_nothing_of_branches(make_solved: MakeSolved) -> None:
    run = replace(make_solved(), ghosts=(), goals=None)
    assert '"ghosts"' not in to_json(run, blocks(run))
