"""docs/drives.md against the code: its figures are those of the script, its values those of the units."""

from __future__ import annotations

import re
import runpy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asserting import there
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.cosim import load_system
from urmpipe_fmus.instance import Instance

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "drives.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def figures() -> Mapping[str, Any]:
    return runpy.run_path(str(DOCS / "drive_figures.py"))


@pytest.mark.slow
def test_the_table_of_stability_is_what_the_script_computes(figures: Mapping[str, Any]) -> None:
    lines = [line for line in PAGE.splitlines() if re.match(r"\| [\d.]+ ms ", line)]
    assert lines == figures["table"]()


@pytest.mark.slow
def test_the_picture_is_what_the_script_draws(figures: Mapping[str, Any]) -> None:
    texts = figures["picture"](), figures["PICTURE"].read_text(encoding="utf-8")
    number = re.compile(r"\d+(?:\.\d+)?")
    assert number.sub("", texts[0]) == number.sub("", texts[1])
    computed, kept = ([float(one) for one in number.findall(text)] for text in texts)
    assert computed == pytest.approx(kept, abs=0.15)  # a tenth of a pixel, rounded


def test_every_parameter_stands_with_its_unit_and_value() -> None:
    rows = re.findall(r"^\| (?:`\w+`)? ?\| `(\w+)` \|[^|]*\| ?([^|]*?) ?\| ([^|]+?) \|", PAGE, re.MULTILINE)
    told = {name: (unit, float(value)) for name, unit, value in rows}
    expected = {
        one.name: (one.unit, one.starts[0])
        for name in ("dc_drive", "inertia", "drive_controller")
        for one in make_block(name).parameters
        if one.name != "internal_step"
    }
    assert told == expected


def test_the_systems_have_the_step_and_the_loads_of_the_page(figures: Mapping[str, Any]) -> None:
    for name in ("one-drive", "six-drives"):
        assert f"`{name}`" in PAGE
        assert re.search(rf"`{name}`[^,(]* {1e3 * there(load_system(name).step):g} ms", PAGE)
    loads = [block.start["J"] for block in load_system("six-drives").blocks if block.unit == "inertia"]
    assert tuple(loads) == figures["INERTIAS"]


def steady_speed(step: float, voltage: float) -> float:
    """Return omega1 at communication points of a drive without load, when it does not change any more.

    A step from the unit vectors of omega1 and i_a, and from 0, gives the map whose fixed point it is.
    """
    drive = Instance(make_block("dc_drive"))
    omega, current = np.eye(3)[:2]
    for name, value in (("omega1", omega), ("omega2", omega), ("i_a", current), ("u", voltage)):
        drive.set([drive.reference(name)], [value])
    drive.do_step(0.0, step)
    after = np.array(drive.get([drive.reference(name) for name in ("omega1", "i_a")]))
    rest = after[:, 2]
    return float(np.linalg.solve(np.eye(2) - (after[:, :2] - rest[:, np.newaxis]), rest)[0])


def test_the_speed_without_load_is_that_of_the_closed_form_with_its_step() -> None:
    table = PAGE.split("| h | 1 ms |")[1].split("\n\n")[0].splitlines()
    head, _, formulas, speeds = (re.findall(r"[\d.]+", line) for line in table)
    for h, formula, speed in zip(("1", *head), formulas, (*speeds, None), strict=True):
        expected = 24.0 / 5.0 / (1.0 + float(h) * 1e-3 * 2500.0 * 0.5 / (2.0 * 5.0**2))
        assert float(formula) == pytest.approx(expected, abs=5e-4)  # as many digits
        if speed is not None:
            assert float(speed) == pytest.approx(steady_speed(float(h) * 1e-3, 24.0), abs=5e-4)
