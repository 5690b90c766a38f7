"""A user's own unit: the examples of the documentation, and random files."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings

from asserting import refusal
from random_units import PATIENT, random_unit_sources
from urmpipe_fmus.blocks.user import block_from_source, load_block_file
from urmpipe_fmus.run import run
from urmpipe_models.errors import UnitError

DOCS = Path(__file__).resolve().parents[3] / "docs"


def test_the_backlash_of_the_documentation_holds_a_joint_until_the_slack_is_taken_up() -> None:
    model = load_block_file(DOCS / "examples" / "backlash.py")
    assert model.parameters[0].starts == (math.radians(0.05),)
    t = np.linspace(0.0, 2.0, 401, dtype=np.float64)
    motor = np.sin(np.pi * t)[:, np.newaxis] * np.ones(6)
    play = 0.2
    joint = run(model, t, {"motor": motor}, {"play": play})["joint"]
    assert np.abs(joint - motor).max() <= play / 2 + 1e-15  # rounding of motor +- play / 2
    rising = (t > 0.1) & (t < 0.5)  # the slack of play / 2 = 0.1 is taken up at asin(0.1) / pi = 0.03 s
    np.testing.assert_allclose(joint[rising], motor[rising] - play / 2, rtol=0.0, atol=1e-15)
    turning = (t > 0.5) & (motor[:, 0] > 1.0 - play) & (t < 1.0)
    assert turning.sum() > 20
    assert len(np.unique(joint[turning])) == 1  # at rest while the motor goes from one flank to the other


def test_the_low_pass_of_the_documentation_follows_as_its_solution_does() -> None:
    model = load_block_file(DOCS / "examples" / "low_pass.py")
    t = np.linspace(0.0, 0.2, 41, dtype=np.float64)
    y = run(model, t, {"u": np.ones_like(t)}, {"T": 0.05})["y"]
    # RK4 with h = 1 ms: the error is about t h^4 / (120 T^5) = 5e-9 at 0.2 s
    np.testing.assert_allclose(y, 1.0 - np.exp(-t / 0.05), rtol=0.0, atol=1e-8)


def test_the_page_shows_the_examples_as_they_are() -> None:
    page = (DOCS / "units.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    for example in sorted((DOCS / "examples").glob("*.py")):
        assert example.read_text(encoding="utf-8") in blocks, example.name


@pytest.mark.slow
@settings(max_examples=30, **PATIENT)
@given(random_unit_sources())
def test_any_file_with_a_correct_unit_is_read(tmp_path_factory: pytest.TempPathFactory, source: str) -> None:
    path = tmp_path_factory.mktemp("unit") / "own.py"
    path.write_text(source, encoding="utf-8")
    model = load_block_file(path)
    assert model.recipe.source == source
    assert model.variables == block_from_source(source, "own.py").variables


def test_a_file_that_is_nested_too_deeply_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.py"
    path.write_text(f"x = {'-' * 100_000}1\n", encoding="utf-8")
    assert refusal(UnitError, load_block_file, path).startswith(f"{path}: cannot be run: ")
