"""docs/iso.md against the code: its output, its criteria, its numbers and its pictures."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path
from typing import Any

import pytest

import urmpipe
from asserting import there
from pages import DOCS, command_lines, lay_files, snippets, text_of
from urmpipe.main import run
from urmpipe_pipeline.comparison.iso import STANDARD_CYCLES, IsoOptions
from urmpipe_pipeline.iso9283.criteria import UNITS

PAGE = text_of("docs/iso.md")
DRAWN = runpy.run_path(str(DOCS / "iso_figures.py"))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that pages name."""
    lay_files(tmp_path, monkeypatch)
    return tmp_path


def lines_of(text: str) -> list[str]:
    """Return lines without the blanks at their ends."""
    return [line.rstrip() for line in text.strip().splitlines()]


@pytest.mark.slow
def test_the_output_of_the_page_is_what_its_second_command_prints(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """If not, the page is to be brought up to date: `python -m pytest -vv` shows both."""
    assert run(command_lines("docs/iso.md")[1].split()[1:]) == 0
    shown = lines_of(PAGE.split("```text\n")[1].split("```")[0])
    assert lines_of(capsys.readouterr().out)[: len(shown)] == shown


def test_every_criterion_has_a_row() -> None:
    cells = re.findall(r"^\| ([^|]+) \|", PAGE, re.MULTILINE)
    named = {name.removesuffix("_rz") for cell in cells for name in re.findall(r"\w*[A-Z]\w*", cell)}
    assert named == {name.partition("_")[0] for name in UNITS}


def test_numbers_of_the_page_are_those_of_the_code() -> None:
    assert f"takes {STANDARD_CYCLES['poses']} for poses and {STANDARD_CYCLES['paths']} for paths" in PAGE
    assert f"cut it: {IsoOptions().planes}, or `--planes N`" in PAGE
    assert f"±{IsoOptions().band * 1e3:g} mm by default" in PAGE


@pytest.mark.slow
def test_the_object_of_the_page_has_the_keys_and_values_of_the_code() -> None:
    told = json.loads(snippets("docs/iso.md", "json")[0])
    found = there(urmpipe.iso("square.csv", "test.csv", tolerance="AP=0.4mm").iso).to_dict()
    assert told["poses"] == found["poses"]
    for key, digits in (("cycles", 4), ("criteria", 6)):
        assert told[key] == [rounded(one, digits) for one in found[key][: len(told[key])]]


def rounded(entry: dict[str, Any], digits: int) -> dict[str, Any]:
    """Return an object with its numbers rounded."""
    return {key: round(value, digits) if isinstance(value, float) else value for key, value in entry.items()}


@pytest.mark.slow
def test_the_code_of_the_page_runs(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {}
    exec(snippets("docs/iso.md", "python")[0], names)
    assert names["found"].verdict == "pass"
    assert names["cloud"].shape == (10, 2, 3)
    assert names["worst"].at.startswith("plane ")
    assert "AP" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("name", DRAWN["DRAWINGS"])
def test_the_pictures_are_what_their_script_draws(name: str) -> None:
    """If not: python docs/iso_figures.py."""
    texts = DRAWN["picture"](name), (DRAWN["PICTURES"] / name).read_text(encoding="utf-8")
    number = re.compile(r"-?\d+(?:\.\d+)?")
    assert number.sub("", texts[0]) == number.sub("", texts[1])
    computed, kept = ([float(one) for one in number.findall(text)] for text in texts)
    assert computed == pytest.approx(kept, abs=0.15)  # a tenth of a pixel, rounded
    assert f"(pictures/{name})" in PAGE
