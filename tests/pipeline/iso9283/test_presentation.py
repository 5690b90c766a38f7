"""What a test after ISO 9283 shows of unusual motions, on pages and in exports; the terminal and JUnit are in
presentation.cases."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from asserting import there
from made_runs import path_run
from presented import cells, every_section, facts, scene_of
from repeated import along, evaluated, still
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.iso import IsoOptions, measure_iso
from urmpipe_pipeline.comparison.tables import exports
from urmpipe_pipeline.iso9283.criteria import judge_criterion
from urmpipe_pipeline.iso9283.tables import format_tolerance, sort_worst_first, to_value
from urmpipe_pipeline.presentation.section import Presentation, Table
from urmpipe_pipeline.report.render import render_report
from urmpipe_pipeline.results import present, read_recording, write_recording

SQUARE = ((0.0, 0.0, 0.3), (0.2, 0.0, 0.3), (0.2, 0.2, 0.3), (0.0, 0.2, 0.35), (0.0, 0.0, 0.3))


def repetition(
    count: int = 4, tolerance: Mapping[str, float] | None = None, path: FloatArray | None = None
) -> Comparison:
    """Return a test of some cycles of a square or another path, each off by 0.1 mm and as much at random."""
    path = along(SQUARE, 0.2, rests=(2,)) if path is None else path
    rng = np.random.default_rng(7)
    runs = [path_run(path + 1e-4 + rng.normal(0.0, 1e-4, 3), name=f"cycle{k}") for k in range(count)]
    return measure_iso(path_run(path), runs, IsoOptions(tolerance or {}))


def table(shown: Presentation, title: str) -> Table:
    return next(one for part in every_section(shown.body) for one in part.tables if one.title == title)


def recorded(result: Comparison, folder: Path) -> Presentation:
    """Return what is shown of a result that was recorded and read back, after a report of it."""
    write_recording(result, folder / "test.rrd")
    shown = present(read_recording(folder / "test.rrd"))
    assert render_report([shown]) == render_report([present(read_recording(folder / "test.rrd"))])
    return shown


def titles(shown: Presentation) -> list[str]:
    return [section.title for section in shown.body.sections]


def test_planes_are_on_the_page_alone() -> None:
    result = repetition()
    path = there(there(result.iso).path)
    section = next(section for section in present(result).body.sections if section.title == "Path")
    (planes,) = (block for block in section.blocks() if isinstance(block, Table))
    columns = cells(planes)
    assert planes.folded and not planes.brief
    np.testing.assert_array_equal(columns["s"], path.s)
    np.testing.assert_array_equal(columns["AT"], path.accuracy)
    np.testing.assert_array_equal(columns["RT"], there(path.repeatability))


def test_rows_and_exports_are_the_criteria() -> None:
    result = repetition(tolerance={"AP": 1e-3, "RT": 1e-9})
    criteria = [asdict(criterion) for criterion in there(result.iso).criteria]
    rows = cells(there(present(result).rows)())
    assert [dict(zip(rows, row, strict=True)) for row in zip(*rows.values(), strict=True)] == criteria
    out = exports(result).rows["criteria"]
    columns = {column.name: column.values for column in out.table().columns}
    for name in ("name", "at", "unit", "verdict"):
        assert np.asarray(columns[name]).tolist() == [one[name] or "" for one in criteria]
    for name in ("value", "tolerance", "cycles"):
        known = [math.nan if one[name] is None else one[name] for one in criteria]
        np.testing.assert_array_equal(np.asarray(columns[name]), known)
    assert out.fields(out.table())["name"] == [one["name"] for one in criteria]


def test_shares_are_in_percent_and_criteria_sorted_by_utilisation() -> None:
    away, fast = judge_criterion("AV", None, -0.05, 3, {"AV": 0.1}), judge_criterion("FV", None, 0.002, 3, {})
    assert (there(to_value(away)).unit, there(to_value(fast)).unit) == ("%", "m/s")
    tolerance = {"AP": 4e-4, "AV": 0.05, "AP_rz": math.pi / 180}
    assert format_tolerance(tolerance) == "AP 0.4 mm, AV 5 %, AP_rz 1 deg"
    near = judge_criterion("AP", None, 1e-6, 3, {"AP": 1.1e-6})
    assert sort_worst_first([away, fast, near]) == [near, away, fast]


def test_tests_are_next_to_each_other_in_one_report() -> None:
    page = render_report([present(repetition()), present(repetition(6))])
    assert "Test: 2 results" in page and "MEASURED" in page


@pytest.mark.slow
def test_one_cycle_has_no_repeatability(tmp_path: Path) -> None:
    shown = recorded(repetition(1, {"AP": 1e-3}), tmp_path)
    assert cells(table(shown, "By pose"))["RP"] == [None, None] and scene_of(shown).balls is None


@pytest.mark.slow
def test_static_poses_have_no_path(tmp_path: Path) -> None:
    poses = np.random.default_rng(1).uniform(-0.3, 0.3, (5, 3))
    visits = np.tile(poses, (30, 1)) + np.random.default_rng(2).normal(0.0, 1e-4, (150, 3))
    result = evaluated(
        still(tmp_path / "poses.csv", poses), still(tmp_path / "visits.csv", visits), poses=True,
        tolerance={"AP": 1e-3}, output=tmp_path / "still.rrd",
    )  # fmt: skip
    shown = recorded(result, tmp_path)
    assert titles(shown) == ["Poses"] and shown.headline.startswith("30 cycles of visits within")
    scene = scene_of(shown)
    assert not scene.arms and len(there(scene.balls).radius) == 5
    assert all(path.t_ns is None for path in scene.paths)


@pytest.mark.slow
def test_a_curve_without_rests_has_no_poses_corners_or_legs(tmp_path: Path) -> None:
    turn = np.linspace(0.0, 1.8 * np.pi, 800)
    shown = recorded(
        repetition(3, {}, 0.2 * np.column_stack((np.cos(turn), np.sin(turn), 0.2 * turn))), tmp_path
    )
    assert titles(shown) == ["Path"]
    blocks = [type(block).__name__ for block in shown.body.sections[0].blocks()]
    assert blocks == ["SpaceFigure", "Figure", "Figure", "Table"]


@pytest.mark.slow
@pytest.mark.parametrize(("poses", "count"), [(1, 5), (30, 3), (2, 30)])
def test_few_and_many_poses_and_cycles(poses: int, count: int, tmp_path: Path) -> None:
    nodes = np.random.default_rng(3).uniform(-0.2, 0.2, (poses + 1, 3))
    path = along(nodes.tolist(), 1.0, rest=0.2, rests=range(1, poses + 1))[40:]  # it begins in no pose
    shown = recorded(repetition(count, {"AP": 1e-3}, path), tmp_path)
    assert len(titles(shown)) <= 4  # whatever the number of cycles
    assert len(cells(table(shown, "By pose"))["at"]) == facts(shown.body.sections[0])["Poses"] == poses
    assert len([path for path in scene_of(shown).paths if path.t_ns is not None]) == count
