"""The specimens are what their makers write."""

from __future__ import annotations

import numpy as np
import pytest

from make_specimens import FOLDER, files
from specimen import motion


def test_making_the_specimens_again_gives_the_same_bytes() -> None:
    there = {path for path in FOLDER.rglob("*") if path.suffix in {".csv", ".txt", ".xyz", ".md"}}
    made = files()
    assert there == set(made)
    assert [path.name for path, content in made.items() if path.read_bytes() != content] == []


def test_the_specimens_stay_small() -> None:
    logs = {path.name: len(content) for path, content in files().items() if path.suffix != ".md"}
    assert [name for name, size in logs.items() if size >= 12_000] == []
    written = [path for path in FOLDER.rglob("*") if path.is_file() and path.suffix != ".pyc"]
    assert sum(path.stat().st_size for path in written) < 500_000


def test_the_motion_is_what_its_formula_says() -> None:
    """By hand at t = 0.14 s: q1 = 0.4 + 0.35 t + 0.30 sin(2.1 t), q6 = -2.3 - 1.7 t + 0.33 sin(1.3 t + 5)."""
    moved = motion(30, 0.02, robot="ur5e")
    assert moved.t[7] == 0.14
    assert moved.q[7, 0] == pytest.approx(0.4 + 0.049 + 0.30 * np.sin(0.294), abs=1e-9)
    assert moved.q[7, 5] == pytest.approx(-2.3 - 0.238 + 0.33 * np.sin(5.182), abs=1e-9)
    assert (np.abs(np.diff(moved.q, axis=0)) / 0.02 < np.pi).all()  # what a ur5e can do
    assert moved.q[:, 4].max() > np.pi > moved.q[0, 4]
    assert moved.q[:, 5].min() < -np.pi < moved.q[0, 5]
