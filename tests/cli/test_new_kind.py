"""A new kind of result is its class, its presenter and a line in the registry: here all three in a test."""

from __future__ import annotations

import csv
import json
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from rerun.chunk import RrdReader

import urmpipe
from recorded import columns, views
from same_results import assert_same
from urmpipe.printing.results import print_presentation
from urmpipe.printing.terminal import print_json
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline import results
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.exports import ExportColumn, Exports, ExportTable, Rows, Times
from urmpipe_pipeline.presentation.figure import Figure, Line, Panel, View
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.presentation.scene import Path as Way
from urmpipe_pipeline.presentation.scene import Scene
from urmpipe_pipeline.presentation.section import (
    Check,
    Column,
    Event,
    Fact,
    Judged,
    Presentation,
    Section,
    Table,
    Value,
)
from urmpipe_pipeline.results import Kind, present
from urmpipe_pipeline.tables.csv_files import write_table
from urmpipe_pipeline.tables.junit import write_junit
from urmpipe_pipeline.text import format_number

LIMIT = 0.25


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Swing(Result):
    """How far a pendulum swings: the toy."""

    name: str
    t_ns: IntArray
    angle: FloatArray
    limit: float
    turns: tuple[int, ...]
    warnings: tuple[LogWarning, ...] = ()
    recording: Path | None = None

    def _headline(self) -> str:
        return f"{self.name}: {len(self.t_ns)} samples"

    def to_frame(self) -> pd.DataFrame:
        return pd.DataFrame({"t": self.t_ns / 1e9, "angle": self.angle})

    def to_dict(self) -> dict[str, Any]:
        return {"schema": 1, "name": self.name, "largest": float(np.abs(self.angle).max())}


def swing(name: str = "pendulum") -> Swing:
    t_ns = np.arange(200) * 5_000_000
    angle = 0.3 * np.sin(t_ns / 1e8)
    return Swing(name, t_ns, angle, LIMIT, (1, -2), (LogWarning("damped", "it comes to rest", row=7),))


def present_swing(one: Swing) -> Presentation:
    """Return what a swing shows of itself."""
    row = int(np.argmax(np.abs(one.angle)))
    largest = Value(float(np.abs(one.angle[row])), "rad", one.limit, "fail")
    body = Section(
        f"Swing {one.name}",
        "fail",
        (Fact("Largest angle", largest),),
        (Table("Turns", (Column("turn", "Turn", [Value(turn) for turn in one.turns]),)),),
        figures=partial(_figures, one),
        checks=(Check("angle", "fail", "the angle is too large"),),
        properties={"largest": largest.number},
        events=lambda: [Event(int(one.t_ns[row]), "it turns back", "warning")],
        warnings=one.warnings,
    )
    return Presentation(
        one.name, "it swings too far", "fail", (Fact("Limit", Value(one.limit, "rad")),), body,
        opens_at_ns=int(one.t_ns[row]), scene=partial(_scene, one),
        lines=({"Swing": one.name, "Verdict": Judged("fail"), "Largest": largest},),
        rows=partial(_rows, largest),
    )  # fmt: skip


def _figures(one: Swing) -> list[Figure]:
    panel = Panel("angle", "rad", (Line(one.angle, ("angle",), ("#c25000",)),), one.t_ns, one.limit)
    return [
        Figure("Angle over time", "How it swings.", "The angle.", (View("Angle of the pendulum", (panel,)),))
    ]


def _scene(one: Swing) -> Scene:
    tip = np.column_stack([np.sin(one.angle), np.zeros(len(one.angle)), -np.cos(one.angle)])
    return Scene("Tip of the pendulum [m]", paths=(Way("tip", tip, one.t_ns, "#c25000"),))


def _rows(largest: Value) -> Table:
    return Table("Largest", (Column("quantity", "Quantity", ["angle"]), Column("max", "max", [largest])))


def export_swing(one: Swing) -> Exports:
    """Return what leaves of a swing."""
    table = ExportTable(
        (ExportColumn("t [s]", "s", Times(one.t_ns, "s")), ExportColumn("angle [rad]", "rad", one.angle)),
        one.t_ns,
    )
    rows = {"swung": Rows(lambda: table, lambda made: {"angle": one.angle})}
    return Exports("swing", {"name": one.name}, rows, {}, {})


@pytest.fixture(autouse=True)
def known(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    kind = Kind("swing", *(f"{__name__}:{part}" for part in ("Swing", "present_swing", "export_swing")))
    monkeypatch.setattr(results, "KINDS", (*results.KINDS, kind))
    monkeypatch.chdir(tmp_path)


def test_its_recording_reads_back_equal_and_opens_with_its_views() -> None:
    one = swing()
    path = urmpipe.write_recording(one, "swing.rrd")
    found = urmpipe.read_recording(path)
    assert_same(found, Swing(**{name: getattr(one, name) for name in Swing.__slots__} | {"recording": path}))
    said = views(path)
    names = said["ViewBlueprint:display_name"]
    assert {"Summary", "Angle of the pendulum [rad]", "Events, at t [s]", "Tip of the pendulum [m]"} <= set(
        names
    )
    (words,) = columns(path, "/shown/summary", "TextDocument:text")
    assert words[0].startswith("### FAIL: it swings too far")
    assert RrdReader(path).recordings()[0].application_id == "urmpipe"


def test_a_report_has_its_section_beside_those_of_other_results() -> None:
    report = urmpipe.report([swing(), swing("other")], "page.html")
    largest = float(np.abs(swing().angle).max())
    page = report.path.read_text(encoding="utf-8")
    words = ["it swings too far", "Swing pendulum", "Swing other", "Angle over time", "Turns"]
    assert all(word in page for word in [*words, format_number(largest, "rad", LIMIT)])
    assert [one["verdict"] for one in report.to_dict()["recordings"]] == ["fail", "fail"]


def test_the_terminal_and_a_notebook_show_it(capsys: pytest.CaptureFixture[str]) -> None:
    print_presentation(present(swing()))
    said = capsys.readouterr().out
    assert said.startswith("FAIL  it swings too far\n      Limit: 14.32 deg\n")
    assert "Largest angle: 17.19 deg" in said
    html = swing()._repr_html_()
    assert html.startswith("<p><b>Swing</b> FAIL it swings too far</p>")
    assert "it comes to rest" in html


def test_json_junit_csv_and_exports_hold_its_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    one = swing()
    print_json(one.to_dict())
    largest = json.loads(capsys.readouterr().out)["largest"]
    assert largest == float(np.abs(one.angle).max())
    write_junit(present(one), Path("v.xml"), Path("v.xml"))
    suite = ET.parse("v.xml").getroot()[0]
    assert [case.attrib["name"] for case in suite.findall("testcase")] == ["angle"]
    assert suite.findtext("testcase/failure") == "the angle is too large"
    assert suite.findtext("system-out") == "damped: row 7: it comes to rest"
    assert float(suite.find("properties/property").attrib["value"]) == largest  # type: ignore[union-attr]
    rows = present(one).rows
    assert rows is not None
    write_table(rows(), Path("v.csv"), Path("v.csv"))
    with Path("v.csv").open(encoding="utf-8", newline="") as file:
        assert list(csv.reader(file)) == [["quantity", "max"], ["angle", repr(largest)]]
    urmpipe.export(one, "v.parquet")
    np.testing.assert_array_equal(pd.read_parquet("v.parquet")["angle [rad]"], one.angle)
