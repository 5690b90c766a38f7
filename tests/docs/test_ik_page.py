"""docs/ik.md against the code: its Python runs, its words are those of the code."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

from pages import indented, lay_files, text_of
from urmpipe_models.ik.closed import closed_form
from urmpipe_models.ik.solutions import NEAREST_POINT, SingularFamily
from urmpipe_models.robots.catalogue import load_robot

PAGE = text_of("docs/ik.md")
NAMED = set(re.findall(r"`([^`]+)`", PAGE))


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
def test_the_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lay_files(tmp_path, monkeypatch)
    names: dict[str, object] = {}
    exec(compile(indented("docs/ik.md", "import urmpipe"), "ik.md", "exec"), names)
    assert getattr(names["log"], "verdict", None) == "pass"
    assert getattr(names["found"], "reasons", None) == [None, None]
    assert {"targets.rrd", "joints.csv"} <= {path.name for path in tmp_path.iterdir()}
