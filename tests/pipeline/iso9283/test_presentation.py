"""What a test after ISO 9283 shows: numbers in tables, verdicts, JUnit, rows; no section of each cycle."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

import urmpipe
from asserting import there
from made_runs import path_run
from presented import cells, every_section, facts, scene_of
from repeated import along, still
from urmpipe.printing.results import print_presentation
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.baseline import compare_with_baseline
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.exports import exports
from urmpipe_pipeline.iso9283.criteria import UNITS, judge_criterion
from urmpipe_pipeline.iso9283.evaluate import IsoOptions
from urmpipe_pipeline.iso9283.result import IsoTest
from urmpipe_pipeline.iso9283.tables import format_tolerance, meaning, sort_worst_first, to_value
from urmpipe_pipeline.outputs import safe_output
from urmpipe_pipeline.presentation.section import Judged, Presentation, Section, Table
from urmpipe_pipeline.report.render import render_report
from urmpipe_pipeline.results import present, read_recording, write_recording
from urmpipe_pipeline.tables.junit import write_junit

SQUARE = ((0.0, 0.0, 0.3), (0.2, 0.0, 0.3), (0.2, 0.2, 0.3), (0.0, 0.2, 0.35), (0.0, 0.0, 0.3))
"""Corners in [m]: the second is a pose, as is the last; at the two others the motion turns."""

ALLOWED = {"AP": 1e-3, "RT": 1e-9, "CO": 2e-3, "AV": 0.5}
"""Of all of them, RT is out."""


def squares(
    count: int = 4, tolerance: Mapping[str, float] = ALLOWED, path: FloatArray | None = None
) -> Comparison:
    """Return a test of so many cycles, each off by 0.1 mm and as much at random."""
    path = along(SQUARE, 0.2, rests=(2,)) if path is None else path
    rng = np.random.default_rng(7)
    runs = [path_run(path + 1e-4 + rng.normal(0.0, 1e-4, 3), name=f"cycle{k}") for k in range(count)]
    return compare_runs(path_run(path), runs, CompareOptions(dict(tolerance), iso=IsoOptions()))


@pytest.fixture(scope="module")
def result() -> Comparison:
    return squares()


@pytest.fixture(scope="module")
def iso(result: Comparison) -> IsoTest:
    return there(result.iso)


@pytest.fixture(scope="module")
def shown(result: Comparison) -> Presentation:
    return present(result)


def section(shown: Presentation, title: str) -> Section:
    return next(one for one in shown.body.sections if one.title == title)


def table(shown: Presentation, title: str) -> Table:
    return next(one for part in every_section(shown.body) for one in part.tables if one.title == title)


# --- verdict ---------------------------------------------------------------------------------------


def test_what_is_out_is_named_with_value_and_tolerance(shown: Presentation, iso: IsoTest) -> None:
    rt = next(one for one in iso.overall if one.name == "RT")
    assert shown.verdict == "fail" and "4 cycles out of tolerance against path: RT " in shown.headline
    assert f"{1e3 * there(rt.value):.4f} mm of 1e-06 mm allowed" in shown.headline
    assert [fact.name for fact in shown.facts[:2]] == ["Decided by", "Where"]
    assert shown.facts[1].value == iso.worst_of("RT").at


def test_the_tightest_criterion_is_named_where_all_are_within() -> None:
    result = squares(tolerance={"AP": 1e-3, "CO": 1.0})
    shown = present(result)
    assert shown.verdict == "pass" and "within tolerance" in shown.headline and ": AP 0." in shown.headline


def test_without_a_tolerance_nothing_is_judged(tmp_path: Path) -> None:
    result = squares(tolerance={})
    shown = present(result)
    assert (result.verdict, shown.verdict, shown.word) == (None, None, "measured")
    assert "no criterion is judged" in shown.headline
    assert all(one.verdict is None and not one.checks for one in every_section(shown.body))
    assert [one.title for one in shown.body.tables] == ["Criteria", "Cycles"]
    assert "MEASURED" in render_report([shown])
    held = compare_with_baseline(result, result)
    with_baseline = present(replace(result, baseline=held))
    assert with_baseline.verdict == "pass" and with_baseline.word == ""
    known = [one.name for one in there(result.iso).overall if one.value is not None]
    assert [one.name for one in with_baseline.body.sections[-1].checks] == known


def test_a_section_fails_if_one_of_its_criteria_does(shown: Presentation) -> None:
    verdicts = {one.title: one.verdict for one in shown.body.sections}
    assert verdicts == {"Poses": "pass", "Path": "fail", "Corners": "pass", "Speed": "pass"}
    assert [one.rank for one in shown.body.sections] == [1, 0, 2, 3]  # what fails is read first
    (fails,) = (one for part in shown.body.sections for one in part.checks if one.verdict == "fail")
    assert fails.name == "RT" and " of 1e-06 mm allowed at plane " in fails.words


# --- numbers ---------------------------------------------------------------------------------------


def test_the_criteria_stand_worst_first_and_others_behind(shown: Presentation, iso: IsoTest) -> None:
    first, second, _ = shown.body.tables
    by_name = {one.name: one for one in iso.overall}
    for part in (first, second):
        found = cells(part)
        assert found["value"] == [by_name[name].value for name in found["name"]]
        assert found["meaning"] == [meaning(name) for name in found["name"]]
        assert found["where"] == [
            iso.worst_of(name).at if by_name[name].value is not None else "" for name in found["name"]
        ]
        assert found["cycles"] == [4] * len(found["name"])
    judged_ones = cells(first)
    used = [there(by_name[name].utilisation) for name in judged_ones["name"]]
    assert set(judged_ones["name"]) == set(ALLOWED) and used == sorted(used, reverse=True)
    assert judged_ones["tolerance"] == [ALLOWED[name] for name in judged_ones["name"]]
    assert judged_ones["verdict"] == [Judged(by_name[name].verdict) for name in judged_ones["name"]]
    others = [list(UNITS).index(name) for name in cells(second)["name"]]
    assert others == sorted(others) and len(others) + len(ALLOWED) == len(iso.overall)


@pytest.mark.parametrize(
    ("title", "names"),
    [("By pose", ("AP", "RP", "PSt", "OV", "dAP", "dRP")), ("By corner", ("CR", "CO")),
     ("By leg", ("AV", "RV", "FV")), ("Between poses", ("AD", "RD"))],
)  # fmt: skip
def test_each_place_has_its_row(
    shown: Presentation, iso: IsoTest, title: str, names: tuple[str, ...]
) -> None:
    found = cells(table(shown, title))
    assert len(found["at"]) == {"By pose": 2, "By corner": 2, "By leg": 4, "Between poses": 1}[title]
    for name in names:
        assert found[name] == [there(iso.at(at, name)).value for at in found["at"]]


def test_the_planes_stand_on_the_page_alone(shown: Presentation, iso: IsoTest) -> None:
    path = there(iso.path)
    (planes,) = (one for one in section(shown, "Path").blocks() if isinstance(one, Table))
    found = cells(planes)
    assert planes.folded and not planes.brief
    np.testing.assert_array_equal(found["s"], path.s)
    np.testing.assert_array_equal(found["AT"], path.accuracy)
    np.testing.assert_array_equal(found["RT"], there(path.repeatability))
    legs = cells(table(shown, "By leg"))
    assert legs["mean"] == [one.mean for one in path.legs]
    assert legs["commanded"] == [one.commanded for one in path.legs]


def test_cycles_are_told_by_their_rows_and_clocks(shown: Presentation, iso: IsoTest) -> None:
    found = cells(table(shown, "Cycles"))
    assert found["name"] == [one.name for one in iso.cycles]
    assert found["last_row"] == [one.last_row for one in iso.cycles]
    assert found["sync_offset"] == [one.sync_offset for one in iso.cycles]


def test_rows_and_exports_are_the_criteria(result: Comparison, iso: IsoTest, shown: Presentation) -> None:
    every = [asdict(one) for one in iso.criteria]
    rows = cells(there(shown.rows)())
    assert [dict(zip(rows, row, strict=True)) for row in zip(*rows.values(), strict=True)] == every
    out = exports(result).rows["criteria"]
    columns = {one.name: one.values for one in out.table().columns}
    for name in ("name", "at", "unit", "verdict"):
        assert np.asarray(columns[name]).tolist() == [one[name] or "" for one in every]
    for name in ("value", "tolerance", "cycles"):
        known = [math.nan if one[name] is None else one[name] for one in every]
        np.testing.assert_array_equal(np.asarray(columns[name]), known)
    assert out.fields(out.table())["name"] == [one["name"] for one in every]


def test_a_share_is_shown_in_percent_and_a_speed_in_m_per_s() -> None:
    away, fast = judge_criterion("AV", None, -0.05, 3, {"AV": 0.1}), judge_criterion("FV", None, 0.002, 3, {})
    assert (there(to_value(away)).unit, there(to_value(fast)).unit) == ("%", "m/s")
    assert (
        format_tolerance({"AP": 4e-4, "AV": 0.05, "AP_rz": math.pi / 180}) == "AP 0.4 mm, AV 5 %, AP_rz 1 deg"
    )
    near = judge_criterion("AP", None, 1e-6, 3, {"AP": 1.1e-6})
    assert sort_worst_first([away, fast, near]) == [near, away, fast]


# --- JUnit, report, terminal -----------------------------------------------------------------------


def test_junit_has_a_case_each_tolerance_and_every_value(
    result: Comparison, iso: IsoTest, shown: Presentation, tmp_path: Path
) -> None:
    path = tmp_path / "verdict.xml"
    with safe_output(path, [], "junit") as part:
        write_junit(shown, part, path)
    root = ET.parse(path).getroot()
    assert (root.get("tests"), root.get("failures")) == ("4", "1")
    assert [one.get("name") for one in root] == ["Poses", "Path", "Corners", "Speed"]
    cases = {case.get("name"): case for case in root.iter("testcase")}
    assert set(cases) == set(ALLOWED)
    assert "allowed at plane" in str(there(cases["RT"].find("failure")).text)
    values = {one.get("name"): float(one.attrib["value"]) for one in root.iter("property")}
    assert values == {one.name: one.value for one in iso.overall if one.value is not None}


def test_tests_stand_side_by_side_in_one_report(result: Comparison) -> None:
    page = render_report([present(result), present(squares(6, {}))])
    assert "Test: 2 results" in page


def test_the_terminal_names_every_criterion(
    shown: Presentation, iso: IsoTest, capsys: pytest.CaptureFixture[str]
) -> None:
    print_presentation(shown)
    said = capsys.readouterr().out
    assert all(f"\n{one.name} " in said for one in iso.overall)
    assert "After ISO 9283" in said and "onform" not in said


# --- whatever is there -----------------------------------------------------------------------------


def recorded(result: Comparison, folder: Path) -> Presentation:
    """Return what is shown of a result that was recorded and read back, after a report of it."""
    write_recording(result, folder / "test.rrd")
    shown = present(read_recording(folder / "test.rrd"))
    assert render_report([shown]) == render_report([present(read_recording(folder / "test.rrd"))])
    return shown


def titles(shown: Presentation) -> list[str]:
    return [one.title for one in shown.body.sections]


@pytest.mark.slow
def test_one_cycle_has_no_repeatability(tmp_path: Path) -> None:
    shown = recorded(squares(1, {"AP": 1e-3}), tmp_path)
    assert "RP" not in cells(shown.body.tables[0])["name"]
    assert cells(table(shown, "By pose"))["RP"] == [None, None]
    assert scene_of(shown).balls is None
    assert shown.headline.startswith("1 cycle of cycle0 within tolerance")


@pytest.mark.slow
def test_still_poses_have_no_path(tmp_path: Path) -> None:
    poses = np.random.default_rng(1).uniform(-0.3, 0.3, (5, 3))
    visits = np.tile(poses, (30, 1)) + np.random.default_rng(2).normal(0.0, 1e-4, (150, 3))
    result = urmpipe.iso(
        still(tmp_path / "poses.csv", poses), still(tmp_path / "visits.csv", visits), poses=True,
        tolerance={"AP": 1e-3}, output=tmp_path / "still.rrd",
    )  # fmt: skip
    shown = recorded(result, tmp_path)
    assert titles(shown) == ["Poses"] and shown.headline.startswith("30 cycles of visits within")
    scene = scene_of(shown)
    assert not scene.arms and len(there(scene.balls).radius) == 5
    assert all(one.t_ns is None for one in scene.paths)


@pytest.mark.slow
def test_a_curve_without_rests_has_no_poses_corners_or_legs(tmp_path: Path) -> None:
    turn = np.linspace(0.0, 1.8 * np.pi, 800)
    curve = 0.2 * np.column_stack((np.cos(turn), np.sin(turn), 0.2 * turn))
    shown = recorded(squares(3, {}, curve), tmp_path)
    assert titles(shown) == ["Path"]
    assert [type(one).__name__ for one in section(shown, "Path").blocks()] == [
        "SpaceFigure", "Figure", "Figure", "Table",
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("poses", "count"), [(1, 5), (30, 3), (2, 30)])
def test_few_and_many_poses_and_cycles(poses: int, count: int, tmp_path: Path) -> None:
    nodes = np.random.default_rng(3).uniform(-0.2, 0.2, (poses + 1, 3))
    path = along(nodes.tolist(), 1.0, rest=0.2, rests=range(1, poses + 1))[40:]  # it begins in no pose
    shown = recorded(squares(count, {"AP": 1e-3}, path), tmp_path)
    assert len(cells(table(shown, "By pose"))["at"]) == facts(section(shown, "Poses"))["Poses"] == poses
    assert len(titles(shown)) <= 4  # whatever the number of cycles
    moving = [one for one in scene_of(shown).paths if one.t_ns is not None]
    assert len(moving) == count
