"""report --figures as a user runs it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pypdf import PdfReader

from pages import thinned
from urmpipe_datasets import LOGS

RunCommand = Callable[..., Any]


@pytest.fixture
def recording(urmpipe: RunCommand, tmp_path: Path) -> Path:
    """The recording of one log."""
    path, log = tmp_path / "run.rrd", tmp_path / "matlab.csv"
    log.write_text(thinned(LOGS / "matlab.csv"), encoding="utf-8")
    assert urmpipe("ingest", log, "--robot", "urm6", "-o", path).code == 0
    log.unlink()
    return path


def test_options_of_figures_without_a_folder_are_refused_all_at_once(
    urmpipe: RunCommand, recording: Path
) -> None:
    ran = urmpipe("report", recording, "--format", "svg", "--figure-width", "column")
    assert (ran.code, ran.out) == (2, "")
    for option in ("--formats", "--figure-width"):
        assert f"({option}): found without figures; --figures FIGURES names their folder" in ran.err
    assert not recording.with_suffix(".html").exists()


@pytest.mark.slow
def test_figures_are_chosen_written_and_listed(urmpipe: RunCommand, recording: Path, tmp_path: Path) -> None:
    ran = urmpipe(
        "report", recording, "--figures", "new/figures", "--formats", "pdf,svg", "--figure-names", "joints*",
        "--figure-names", "Motion", "--figure-width", "85mm", "--figure-font", "7", "--json",
    )  # fmt: skip
    assert (ran.code, ran.err) == (0, "")
    listed = json.loads(ran.out)["figures"]
    files = {tmp_path / one["file"] for one in listed}
    assert files == set((tmp_path / "new/figures").iterdir())
    assert {one["title"] for one in listed} == {"Joints before and after repolarization", "Motion"}
    assert sorted(path.suffix for path in files) == [".pdf", ".pdf", ".svg", ".svg"]
    for path in files:
        if path.suffix == ".pdf":
            width = float(PdfReader(path).pages[0].mediabox.width) / 72.0 * 25.4
            assert width == pytest.approx(85.0, rel=0.01)  # what the page may be off


def test_what_is_wrong_with_figures_is_told_by_options_and_nothing_is_written(
    urmpipe: RunCommand, recording: Path, tmp_path: Path
) -> None:
    wrong = ("--formats", "both", "--figure-width", "wide", "--figure-font", "99", "--figure-dpi", "3")
    ran = urmpipe("report", recording, "--figures", "figures", *wrong)
    assert ran.code == 2
    for line in (
        "formats (--formats): found both, allowed: pdf, svg, png",
        "figure_width (--figure-width): found 'wide', allowed: column, page, or 40 mm to 1 m, such as 85mm"
        " or 3.5in",
        "figure_font (--figure-font): found 99.0, allowed: 4 to 32, in pt",
        "figure_dpi (--figure-dpi): found 3, allowed: 50 to 1200",
    ):
        assert line in ran.err
    ran = urmpipe("report", recording, "--figures", "figures", "--figure-names", "Moton")
    assert ran.code == 2
    assert (
        "figure_names (--figure-names): found 'Moton' (did you mean Motion?), allowed: Joints before and"
        " after" in ran.err
    )
    assert [path.name for path in tmp_path.iterdir()] == ["run.rrd"]
