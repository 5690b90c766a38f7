"""--poses and --measured, as a user gives them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import urmpipe as package
from urmpipe.systems.logs import read_table
from urmpipe_models.errors import LogError

RunCommand = Callable[..., object]


def slow(path: Path) -> Path:
    """Write a smooth motion with columns A, B, C beside it."""
    t = np.arange(30.0)
    q = np.column_stack([np.sin(0.02 * t + k) for k in range(6)])
    rows = [",".join(f"{value:.6f}" for value in (*row, *row[:3])) for row in q]
    path.write_text("\n".join(["q1,q2,q3,q4,q5,q6,A,B,C", *rows, ""]))
    return path


def test_poses_and_measured_reach_the_log(urmpipe: RunCommand, tmp_path: Path) -> None:
    log = slow(tmp_path / "log.csv")
    given = ("--unit", "rad", "--measured", "A,B,C")
    ran = urmpipe("ingest", log, "--poses", *given, "--write-map", "lab.toml", "--json")
    assert ran.code == 0, ran.err  # type: ignore[attr-defined]
    answer = json.loads(ran.out)  # type: ignore[attr-defined]
    assert (answer["duration"], answer["tsp"], answer["period"]) == (None, None, None)
    lab = (tmp_path / "lab.toml").read_text()
    assert "poses = true" in lab and 'position = ["A", "B", "C"]\nmeasured = true' in lab
    run = package.ingest(log, map=tmp_path / "lab.toml")
    assert not run.timed and run.log.externally_measured
    assert package.ingest(log, map=tmp_path / "lab.toml", poses=False).timed


def test_the_rows_are_told_in_the_terminal(urmpipe: RunCommand, tmp_path: Path) -> None:
    ran = urmpipe("ingest", slow(tmp_path / "log.csv"), "--poses", "--unit", "rad")
    assert ran.out.splitlines()[0] == "log: 30 still poses"  # type: ignore[attr-defined]
    assert "  Rows: 30, without times" in ran.out.splitlines()  # type: ignore[attr-defined]


def test_poses_drive_no_simulation(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    np.savetxt(
        path,
        np.random.default_rng(1).uniform(-3, 3, (20, 6)),
        delimiter=",",
        header="q1,q2,q3,q4,q5,q6",
        comments="",
    )
    with pytest.raises(LogError) as error:
        read_table(path)
    said = "found still poses, allowed: a motion with times; --period SECONDS reads the rows as a motion"
    assert str(error.value) == f"{path}: {said}"
