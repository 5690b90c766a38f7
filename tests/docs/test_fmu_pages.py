"""docs/fmu.md, docs/simulate.md and docs/import/fmpy.md against the code: what they show runs."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pages import run_lines, snippets
from urmpipe.api.simulate import simulate
from urmpipe_datasets import LOGS
from urmpipe_fmus.cosim import system_names
from urmpipe_fmus.native import native_unavailable_reason
from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_models.robots.catalogue import load_robot

DOCS = Path(__file__).parents[2] / "docs"
NAMED = set(re.findall(r"`(\w+)`", (DOCS / "json.md").read_text(encoding="utf-8")))


@pytest.mark.slow
def test_the_page_of_fmpy_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    missing = native_unavailable_reason()
    if missing:
        pytest.skip(missing)
    (commands,) = snippets("docs/import/fmpy.md", "sh")
    run_lines(commands, tmp_path)
    arm = load_robot("urm6")
    posed = np.array([[0.5, *arm.start[1:]]])
    table = np.genfromtxt(tmp_path / "points.csv", delimiter=",", names=True, deletechars="")
    tips = np.column_stack([table[f"p7[{i}]"] for i in (1, 2, 3)])
    assert tips.shape == (5, 3)
    # the same products of cosines; C and NumPy may differ in their last bits
    np.testing.assert_allclose(
        tips, np.tile(points_over_log(arm, posed)[0, -1], (5, 1)), rtol=0.0, atol=1e-15
    )
    monkeypatch.chdir(tmp_path)
    shown: dict[str, Any] = {}
    for code in snippets("docs/import/fmpy.md", "python"):
        exec(compile(code, "fmpy.md", "exec"), shown)
    q = np.zeros((200, 6))
    q[:, 0] = np.sin(0.005 * np.arange(200))
    np.testing.assert_allclose(shown["fresh"], points_over_log(arm, q)[:, -1, 0], rtol=0.0, atol=1e-15)


@pytest.mark.slow
def test_the_system_of_the_page_runs(tmp_path: Path) -> None:
    system = next(one for one in snippets("docs/simulate.md", "toml") if one.startswith("[system]"))
    (tmp_path / "my-arm.toml").write_text(system, encoding="utf-8")
    shutil.copy(LOGS / "matlab.csv", tmp_path / "log.csv")
    shutil.copy(LOGS / "path.csv", tmp_path / "path.csv")
    result = simulate(tmp_path / "my-arm.toml", duration=0.1)
    assert (result.name, result.verdict, len(result.t_ns)) == ("my-arm", "pass", 21)


@pytest.mark.slow
def test_the_system_of_the_page_goes_straight_between_the_points_of_a_coarse_path(tmp_path: Path) -> None:
    system = next(one for one in snippets("docs/simulate.md", "toml") if one.startswith("[system]"))
    (tmp_path / "my-arm.toml").write_text(system, encoding="utf-8")
    shutil.copy(LOGS / "matlab.csv", tmp_path / "log.csv")
    head, *rows = (LOGS / "path.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "path.csv").write_text(
        "\n".join([head, *rows[::20]]) + "\n", encoding="utf-8"
    )  # every 100 ms
    result = simulate(tmp_path / "my-arm.toml", duration=3.0)
    assert result.verdict == "pass"  # held, the path is up to 100 ms behind


def test_each_shipped_system_has_its_line() -> None:
    page = (DOCS / "simulate.md").read_text(encoding="utf-8")
    section = page.split("\n## The systems of the catalogue\n")[1].split("\n## ")[0]
    assert tuple(sorted(re.findall(r"^- \*\*(.+?)\*\*", section, re.MULTILINE))) == system_names()
