"""docs/plan.md against the code: each table and each cube of the page reads as the page says."""

from __future__ import annotations

import math
import re
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from asserting import there
from pages import command_lines, indented, run_in_process
from urmpipe_models.errors import LogError
from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.laws import ARCS, Arcs, trapezoid_law
from urmpipe_models.planning.path import PLANES
from urmpipe_pipeline.planned_paths.given_path import given_path
from urmpipe_pipeline.planned_paths.path_file import GivenPath, read_path
from urmpipe_pipeline.planned_paths.presenter import CHECKS

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "plan.md").read_text(encoding="utf-8")
FIRST, TANGENTS, CORNERS, TURNED, WRONG = re.findall(r"```csv\n(.*?)```", PAGE, re.DOTALL)
REASONS = PAGE.split("```text\n")[1].split("```")[0].splitlines()
CUBES = re.findall(r"^    (cube:\S+)$", PAGE, re.MULTILINE)


def rows_of(folder: Path, text: str) -> GivenPath:
    (folder / "path.csv").write_text(text, encoding="utf-8")
    return read_path(folder / "path.csv")


@pytest.mark.slow
def test_commands_and_code_of_the_page_run_with_its_contour(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("contour.csv").write_text(FIRST, encoding="utf-8")
    lines = command_lines("docs/plan.md")
    assert {line: run_in_process(line) for line in lines} == dict.fromkeys(lines, 0)
    names: dict[str, Any] = {}
    exec(indented("docs/plan.md", "import numpy as np"), names)
    plan, rows = names["plan"], rows_of(tmp_path, FIRST).rows
    assert (plan.verdict, names["rows"].position.tolist()) == ("pass", rows.position.tolist())


def test_the_contour_of_the_paper_is_the_cube_s(tmp_path: Path) -> None:
    found, cube = rows_of(tmp_path, TANGENTS), given_path(CUBES[0]).rows
    # The cube's tangent points are computed: a few roundings of 2 m.
    np.testing.assert_allclose(found.rows.position, cube.position, rtol=0, atol=1e-15)
    assert (found.rows.radius.tolist(), found.warnings) == (cube.radius.tolist(), ())


def test_the_corners_of_the_page_are_r_before_its_tangent_points(tmp_path: Path) -> None:
    tangents, corners = rows_of(tmp_path, TANGENTS).rows, rows_of(tmp_path, CORNERS)
    assert (tangents.corner, corners.rows.corner, corners.warnings) == (False, True, ())
    assert corners.rows.radius.tolist() == tangents.radius.tolist()
    ahead = np.diff(corners.rows.position, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    before = corners.rows.position[1:] - tangents.radius[1:, np.newaxis] * ahead
    np.testing.assert_allclose(before, tangents.position[1:], rtol=0, atol=1e-15)  # a few roundings of 2 m


def test_the_orientations_of_the_page_are_read(tmp_path: Path) -> None:
    found = rows_of(tmp_path, TURNED)
    turned = Rotation.from_euler("ZYX", [[0, 180, 0], [0, 180, 0], [90, 180, 0]], degrees=True).as_matrix()
    # Sines and cosines of quarter turns, rounded.
    np.testing.assert_allclose(there(found.rows.rotation), turned, rtol=0, atol=1e-15)


def test_a_tool_turns_the_shorter_way_and_never_in_place(tmp_path: Path) -> None:
    header, first, *_ = TURNED.splitlines()
    turned = [f"0.5{first[3:]}", f"0.5{first[3:]}".replace(",0,3.14", f",{2.0 * math.pi!r},3.14")]
    turning = there(rows_to_path(rows_of(tmp_path, "\n".join((header, first, turned[1]))).rows).orientation)
    quaternions = turning.quaternions(np.linspace(0.0, 0.1, 5))
    np.testing.assert_allclose(quaternions, quaternions[:1].repeat(5, axis=0), rtol=0, atol=1e-15)
    in_place = "\n".join((header, first, turned[0], turned[0].replace(",0,3.14", ",1,3.14")))
    with pytest.raises(LogError, match=r"path\.csv:4"):
        rows_of(tmp_path, in_place)


def test_the_picture_is_what_its_script_draws() -> None:
    drawn = runpy.run_path(str(DOCS / "plan_figures.py"))
    texts = drawn["picture"](), drawn["PICTURE"].read_text(encoding="utf-8")
    number = re.compile(r"\d+(?:\.\d+)?")
    assert number.sub("", texts[0]) == number.sub("", texts[1])
    computed, kept = ([float(one) for one in number.findall(text)] for text in texts)
    assert computed == pytest.approx(kept, abs=0.15)  # a tenth of a pixel, rounded


@pytest.mark.parametrize("arcs", ARCS)
def test_the_times_of_the_page_are_those_of_the_contour(arcs: Arcs) -> None:
    law = trapezoid_law(rows_to_path(given_path(CUBES[0]).rows), 0.5, 6.0, arcs)
    assert f"{law.duration:.6f} s" in PAGE


def test_everything_in_the_way_is_on_the_page() -> None:
    assert set(re.findall(r"^\| `([a-z-]+)` \|", PAGE, re.MULTILINE)) >= set(CHECKS)


def test_wrong_rows_are_refused_as_the_page_says(tmp_path: Path) -> None:
    with pytest.raises(LogError) as caught:
        rows_of(tmp_path, WRONG)
    assert [str(one).replace(f"{tmp_path}/", "") for one in caught.value.findings] == REASONS


def test_the_cubes_of_the_page_are_read() -> None:
    assert [given_path(cube).name for cube in CUBES] == ["cube wall xy", "cube wall xz", "cube diagonal c2"]
    names = re.findall(r"`(\w\w)`", next(line for line in PAGE.splitlines() if line.startswith("| `plane`")))
    assert names == [plane for planes in PLANES.values() for plane in planes]


@pytest.mark.parametrize(
    ("length", "sides"), [(2.348496, 4 * 0.6), (2.845552, 2 * 0.6 + 2 * 0.6 * math.sqrt(2.0))]
)
def test_the_lengths_of_the_page_are_those_of_its_sum(length: float, sides: float) -> None:
    assert f"{length}" in PAGE
    assert sides - 8 * 0.03 + 2 * math.pi * 0.03 == pytest.approx(length, abs=5e-7, rel=0)  # six decimals
