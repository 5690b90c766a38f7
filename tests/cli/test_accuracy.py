"""`urmpipe accuracy`: the running speed, the command and the call; accuracy.cases has its errors."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

import urmpipe
from flat_arm import ARM, MASSES, drive, lay_flat_arm
from urmpipe.driven_runs import Within, running_speed
from urmpipe.main import run
from urmpipe_models.planning.path import cube_rows

Captured = pytest.CaptureFixture[str]


def runs(good: Callable[[float], bool]) -> tuple[list[float], Within]:
    """Return what is within a limit by a rule, and the velocities that it is asked for."""
    asked: list[float] = []

    def within(velocities: Sequence[float]) -> list[bool]:
        asked.extend(velocities)
        return [good(one) for one in velocities]

    return asked, within


def test_the_running_speed_is_known_to_one_percent() -> None:
    asked, within = runs(lambda v: v <= 0.537)
    found = running_speed(within, [0.1, 0.5, 1.0])
    assert found is not None
    assert found <= 0.537
    assert any(0.537 < one <= 1.01 * found * (1 + 1e-12) for one in asked)


def test_the_first_velocity_that_fails_bounds_it() -> None:
    found = running_speed(runs(lambda v: v < 0.3 or v > 0.6)[1], [0.8, 0.2, 0.4])
    assert found is not None
    assert 0.3 / 1.01 <= found < 0.3


@pytest.mark.parametrize(("good", "speed"), [(True, 10.0), (False, None)])
def test_all_or_none_within(good: bool, speed: float | None) -> None:
    assert running_speed(runs(lambda _: good)[1], [0.1, 1.0]) == speed


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a short path and an arm."""
    monkeypatch.chdir(tmp_path)
    lay_flat_arm(tmp_path)
    return tmp_path


GIVEN = ("accuracy", "--robot", "arm.toml", "--path", "short.csv", "--backend", "python", "--json")


@pytest.mark.slow
def test_errors_of_the_command_and_of_the_call(folder: Path, capsys: Captured) -> None:
    assert run([*GIVEN, "--velocities", "0.05,0.025"]) == 0
    printed = capsys.readouterr()
    assert printed.err == "note: the arm runs in NumPy, some hundred times slower than machine code\n"
    result = urmpipe.accuracy("short.csv", "arm.toml", velocities=[0.05, 0.025, 0.05], backend="python")
    assert [one.velocity for one in result.errors] == [0.05, 0.025]
    assert result.verdict is None
    errors = result.to_dict()["errors"]
    assert json.loads(printed.out)["errors"] == errors
    rows = result.to_frame().set_index("velocity")
    assert [rows.error[v] for v in (0.05, 0.025)] == errors


@pytest.mark.slow
def test_the_error_that_decides_is_chosen_and_a_cube_is_its_rows(capsys: Captured) -> None:
    # as short a path as reaches 0.3 m/s; the contour of test_iso9283_accuracy.py begins there: the same FMU
    cube = "cube:wall,a=0.1,r=0.01,x=1.7,y=0.25,z=1"
    given = ("accuracy", "--robot", "irb60", "--path", cube, "--json")
    between = "0.0021"  # m: between the two errors at 0.3 m/s
    verdicts = []
    for which, code in (("time", 1), ("path", 0)):
        assert run([*given, "--limit", between, "--error", which, "--velocities", "0.27,0.3"]) == code
        verdicts.append(json.loads(capsys.readouterr().out))
    assert [one["verdict"] for one in verdicts] == ["fail", "pass"]
    assert [one["limited_error"] for one in verdicts] == ["time", "path"]
    by_path = verdicts[1]
    error, path_error = by_path["errors"][1], by_path["path_errors"][1]
    assert path_error < float(between) < error
    speed, tried = by_path["running_speed"], by_path["probed"]
    held = {one["velocity"]: one["path_error"] <= float(between) for one in tried}
    assert held[speed]
    assert min(v for v, within in held.items() if not within and v > speed) <= 1.01 * speed * (1 + 1e-12)
    assert 0.3 in held
    rows = urmpipe.accuracy(
        cube_rows("wall", 0.1, 0.01, np.array([1.7, 0.25, 1.0])), "irb60", velocities=[0.3]
    )
    assert [one.error for one in rows.errors] == [error]


@pytest.mark.slow
def test_an_arm_that_diverges(folder: Path, capsys: Captured) -> None:
    (folder / "short.csv").write_text("x,y,z\n0.5,0.5,0\n0.5,0.499,0\n")
    strong = drive("a", -7500.0).replace("u_max = 48.0", "u_max = 4.8e6")  # it diverges at once
    (folder / "arm.toml").write_text(ARM + MASSES + strong + drive("b"))
    assert run([*GIVEN, "--velocities", "0.01", "--limit", "1mm"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["errors"] == [None]
    assert found["diverged"][0]["joint"] in ("a", "b")
