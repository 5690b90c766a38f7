"""docs/drives.md against the code: its figures are those of the script, its values those of the units."""

from __future__ import annotations

import re
import runpy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from urmpipe_fmus.cosim import load_system
from urmpipe_fmus.units import make_unit

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
        for one in make_unit(name).parameters
        if one.name != "internal_step"
    }
    assert told == expected


def test_the_systems_have_the_step_and_the_loads_of_the_page(figures: Mapping[str, Any]) -> None:
    for name in ("one-drive", "six-drives"):
        assert load_system(name).step == 1e-3
    loads = [block.start["J"] for block in load_system("six-drives").blocks if block.unit == "inertia"]
    assert tuple(loads) == figures["INERTIAS"]
