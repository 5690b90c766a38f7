"""docs/ik.md against the code: its commands and its Python run, its words are those of the code."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

from urmpipe.main import run
from urmpipe_datasets import LOGS
from urmpipe_models.inverse.closed.closed_form import closed_form
from urmpipe_models.inverse.solutions import NEAREST_POINT, SingularFamily
from urmpipe_models.robots.catalogue import load_robot

PAGE = (Path(__file__).parents[2] / "docs" / "ik.md").read_text(encoding="utf-8")
NAMED = set(re.findall(r"`([^`]+)`", PAGE))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder with the files that the page names."""
    (tmp_path / "path.csv").write_bytes((LOGS / "path.csv").read_bytes())
    (tmp_path / "targets.csv").write_text("x,y,z,rz,ry,rx\n0.1,0.05,0.25,0.3,0.4,0.1\n0,0,0.3,0,0,0\n")
    (tmp_path / "poses.csv").write_text("x,y,z,qx,qy,qz,qw\n0.4,0.1,0.3,1,0,0,0\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_family_and_every_word_of_a_branch_is_named() -> None:
    assert set(get_args(SingularFamily)) - NAMED == set()
    forms = [closed_form(load_robot(name)) for name in ("arm6", "articulated6r", "ur5e")]
    words = {word for form in forms if form for branch in form.branches for word in branch.split(", ")}
    assert len(words) == 6
    assert (words | {NEAREST_POINT, "posture 1", "shoulder 1"}) - NAMED == set()


def test_the_robots_have_the_inverse_that_the_page_says() -> None:
    for row in (line for line in PAGE.splitlines() if line.startswith(("| closed form", "| iterative"))):
        name, arms = row.strip("| ").split(" | ")[:2]
        for robot in re.findall(r"\b(arm6|articulated6r|urm6|panda|iiwa14)\b", arms):
            form = closed_form(load_robot(robot))
            assert name == (f"closed form, {form.name}" if form else "iterative")


@pytest.mark.slow
def test_the_commands_run(folder: Path) -> None:
    commands = re.findall(r"^    urmpipe (.*?)(?:\s+#.*)?$", PAGE, re.MULTILINE)
    assert len(commands) == 6
    assert [run([*command.split(), "-q"]) for command in commands] == [0] * 6
    assert {"targets.rrd", "log.csv", "log-against-path.rrd"} <= {path.name for path in folder.iterdir()}


@pytest.mark.slow
def test_the_python_runs(folder: Path) -> None:
    start = PAGE.index("    import urmpipe")
    code = "\n".join(line[4:] for line in PAGE[start : PAGE.index("Instead of a file")].splitlines())
    names: dict[str, object] = {}
    exec(compile(code, "ik.md", "exec"), names)
    assert getattr(names["log"], "verdict", None) == "pass"
    assert getattr(names["found"], "reasons", None) == [None, None]
    assert {"targets.rrd", "log.csv"} <= {path.name for path in folder.iterdir()}
