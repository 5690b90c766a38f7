"""What the report says of a simulation: its verdict, its system, its numbers, and no script of a stranger."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.report import render_report
from urmpipe_pipeline.report.page import Part, lay_out
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.report.tables import Table
from urmpipe_pipeline.simulations.simulation import Setting, Signal, SimulatedBlock, Simulation

MakeSimulation = Callable[..., Simulation]
HOSTILE = "</script><img src=x onerror=alert(1)>\"'&%{y}<b>"
EVIL_SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" onload="alert(1)"><script>alert(1)</script>'
    '<image href="http://example.com/x.png"/></svg>"><script>alert(1)</script>'
)


class Tags(HTMLParser):
    """The elements of a page with their attributes."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))

    def named(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.found if name == tag]


def tables(part: Part) -> dict[str, Table]:
    """Return the tables of a part and of those below by their titles."""
    own = {block.title: block for block in part.blocks if isinstance(block, Table)}
    return own | {title: table for child in part.parts for title, table in tables(child).items()}


def texts(table: Table) -> list[list[str]]:
    return [[cell.text for cell in row] for row in table.rows]


def array(spec: dict[str, Any]) -> FloatArray:
    """Return the numbers of a drawn array."""
    return np.frombuffer(base64.b64decode(spec["bdata"]), f"<{spec['dtype']}").astype(np.float64)


def figures(part: Part) -> dict[str, Figure]:
    return {f"{where}/{figure.title}": figure for where, figure in part.figures()}


def test_the_worst_meter_stands_first(make_simulation: MakeSimulation) -> None:
    page = lay_out([make_simulation(tolerance=0.005), make_simulation(name="other")])
    assert (page.banner.state, page.banner.word) == ("fail", "FAIL")
    assert page.banner.headline == "meter of other out of tolerance"
    assert [(fact.name, fact.value, fact.href) for fact in page.banner.facts] == [
        ("Furthest out", "other", "#s2"),
        ("How much", "|Δy| = 4.0000 mm of 3.5 mm allowed", ""),
        ("When", "t = 1.250 s", ""),
        ("Out of tolerance", "161 of 600 samples (26.8 %)", ""),
    ]
    assert [(card.name, card.state, card.amount, card.allowed) for card in page.summaries[0].cards] == [
        ("log-to-delta", "pass", "4.0000 mm", "5 mm"),
        ("other", "fail", "4.0000 mm", "3.5 mm"),
    ]


def test_the_card_of_a_meter_says_how_much_when_and_how_often(make_simulation: MakeSimulation) -> None:
    card = lay_out([make_simulation()]).summaries[0].cards[0]
    assert (card.size, card.amount, card.allowed, card.used) == (
        "|Δy|", "4.0000 mm", "3.5 mm", "1.14 times the tolerance",
    )  # fmt: skip
    assert [(fact.name, fact.value) for fact in card.facts[:2]] == [
        ("When", "t = 1.250 s"),
        ("Out of tolerance", "161 of 600 samples (26.8 %)"),
    ]


def test_one_that_failed_says_so_before_all(make_simulation: MakeSimulation) -> None:
    failed = make_simulation(101, failed="chain: fmi2DoStep returned fmi2Error", name="broken")
    page = lay_out([make_simulation(), failed])
    assert (page.banner.state, page.banner.word) == ("fail", "FAILED")
    assert page.banner.headline == "broken did not reach its end"
    assert [fact.value for fact in page.banner.facts] == ["broken", "t = 0.500 s", failed.failed]
    assert page.parts[1].notice == "Failed: chain: fmi2DoStep returned fmi2Error"
    card = page.summaries[0].cards[1]
    assert (card.state, card.size, card.amount) == ("fail", "Failed after", "0.500 s")
    line = figures(page.parts[1])["Block log/q"].spec["layout"]["shapes"][0]
    assert (line["x0"], line["label"]["text"]) == (0.5, "failed")


def test_one_that_failed_at_once_has_no_plots(make_simulation: MakeSimulation) -> None:
    page = lay_out([make_simulation(0, failed="chain: crashed")])
    assert page.figures == []
    assert page.banner.facts[1].value == "its start"
    assert "chain: crashed" in render_report([make_simulation(0, failed="chain: crashed")])


def test_of_several_simulations_all_are_counted(make_simulation: MakeSimulation) -> None:
    within, out = make_simulation(tolerance=0.005), make_simulation(name="other")
    banner = lay_out([within, out, replace(out, verdicts=())]).banner
    assert (banner.word, banner.headline) == ("FAIL", "meter of other out of tolerance")
    assert banner.detail == "Of 3 simulations: 1 failed, 1 passed, 1 without a verdict."


def test_set_points_are_dashed_beside_their_answers_behind_what_is_judged(
    make_simulation: MakeSimulation,
) -> None:
    simulation = make_simulation(5)
    wanted = Signal("set_point", "theta", np.arange(5.0), "rad", description="Set position")
    real = Signal("load", "theta", np.arange(5.0), "rad", description="Angle")
    simulation = replace(
        simulation,
        signals=(*simulation.signals, wanted, real),
        connections={"c.set_theta": "set_point.theta", "c.real_theta": "load.theta"},
    )
    page = lay_out([simulation])
    assert [part.title for part in page.parts[0].parts][:2] == ["Block meter", "Set point and answer"]
    figure = figures(page.parts[0])["Set point and answer/theta"]
    assert [(one["name"], one["line"]["dash"]) for one in figure.spec["data"]] == [
        ("set_point.theta", "dash"),
        ("load.theta", "solid"),
    ]
    assert figure.caption == "theta: Angle. Grey, dashed: the set point."


def test_nothing_judged_is_no_verdict(make_simulation: MakeSimulation) -> None:
    page = lay_out([replace(make_simulation(), verdicts=())])
    assert (page.banner.state, page.banner.word) == ("ingested", "SIMULATED")
    assert page.banner.headline == "log-to-delta: 600 samples"
    assert page.summaries[0].cards[0].state == "simulated"


@pytest.mark.parametrize(("tolerance", "ends"), [(0.0035, "fail"), (0.005, "pass")])
def test_a_comparison_that_passes_does_not_hide_a_simulation_that_fails(
    make_simulation: MakeSimulation, comparison: Comparison, tolerance: float, ends: str
) -> None:
    passing = replace(comparison, runs=tuple(replace(run, verdict="pass") for run in comparison.runs))
    page = lay_out([make_simulation(tolerance=tolerance), passing])
    assert page.banner.state == ends
    logs, meter = "within tolerance against path, by the joints on both sides", "meter of log-to-delta"
    assert page.banner.detail == (
        f"PASS: both logs {logs}." if ends == "fail" else f"PASS: {meter} within tolerance."
    )
    failing = lay_out([make_simulation(), comparison])
    assert (failing.banner.state, failing.banner.detail) == ("fail", f"FAIL: {meter} out of tolerance.")


def test_the_tables_have_blocks_settings_connections_and_extremes(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation()
    found = tables(lay_out([simulation]).parts[0])
    assert texts(found["Delta meters"]) == [
        ["meter", "4.0000", "3.5", "Δy", "1.250", "250", "161 (26.8 %)", "600", "FAIL"]
    ]
    assert texts(found["Blocks (3)"])[1] == ["chain", "unit", "kinematic_chain", "b" * 32, "An arm"]
    assert texts(found["Connections (2)"]) == [["chain.phi", "log.q"], ["meter.actual", "chain.p7"]]
    assert texts(found["Parameters and start values (2)"]) == [
        ["chain.r[1]", "parameter", "0.243215", "m", "the block"],
        ["meter.tolerance", "parameter", "0.0035", "m", "the system"],
    ]
    y = texts(found["Signals (14)"])[10]
    values = simulation.signal("meter.delta").values[:, 1]
    last = f"{values[-1]:.6g}"
    assert y == ["meter.delta[2]", "m", "0", last, last, "2.995", "0.004", "1.250"]
    assert texts(found["Warnings (1)"]) == [["gap", "7", "the log has a gap"]]


def test_each_block_and_unit_has_a_plot_in_the_unit_that_people_like(
    make_simulation: MakeSimulation,
) -> None:
    simulation = make_simulation()
    found = figures(lay_out([simulation]).parts[0])
    assert list(found) == [
        "Simulation log-to-delta/Path in space", "Block meter/delta, norm", "Block meter/out_of_tolerance",
        "Block log/q", "Block chain/p7",
    ]  # fmt: skip
    spec = found["Block meter/delta, norm"].spec
    assert spec["layout"]["yaxis"]["title"]["text"] == "delta, norm [mm]"
    assert [trace["name"] for trace in spec["data"]] == ["delta[1]", "delta[2]", "delta[3]", "norm"]
    delta = simulation.signal("meter.delta").values
    np.testing.assert_allclose(
        array(spec["data"][1]["y"]), 1e3 * delta[:, 1], rtol=0.0, atol=1e-5
    )  # drawn digits
    levels = [shape["y0"] for shape in spec["layout"]["shapes"] if shape["type"] == "line"]
    assert levels == [3.5, -3.5]
    assert found["Block log/q"].spec["layout"]["yaxis"]["title"]["text"] == "q [deg]"
    flag = found["Block meter/out_of_tolerance"].spec
    assert flag["data"][0]["line"]["shape"] == "hv"
    assert flag["layout"]["yaxis"]["tickvals"] == [0, 1]


def test_a_slim_path_stands_in_a_box_of_equal_sides(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation()
    found = figures(lay_out([simulation]).parts[0])["Simulation log-to-delta/Path in space"]
    scene = found.spec["layout"]["scene"]
    assert scene["aspectmode"] == "cube"
    position = simulation.signal("chain.p7").values
    ranges = np.array([scene[f"{axis}axis"]["range"] for axis in "xyz"])
    np.testing.assert_allclose(np.ptp(ranges, axis=1), 1.05 * np.ptp(position, axis=0).max(), rtol=1e-9)
    assert (ranges[:, 0] < position.min(axis=0)).all()
    assert (ranges[:, 1] > position.max(axis=0)).all()


def test_a_long_simulation_is_drawn_with_few_points_and_every_peak(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(50_000)
    found = figures(lay_out([simulation]).parts[0])["Block meter/delta, norm"].spec["data"][1]
    drawn = array(found["y"])
    assert len(drawn) <= 2000
    assert drawn.max() == pytest.approx(1e3 * simulation.signal("meter.delta").values[:, 1].max(), rel=1e-6)


def test_the_drawing_is_an_image_in_which_no_script_runs(make_simulation: MakeSimulation) -> None:
    html = render_report([replace(make_simulation(20), system_svg=EVIL_SVG)])
    tags = Tags(html)
    (image,) = tags.named("img")
    source = image["src"] or ""
    assert base64.b64decode(source.removeprefix("data:image/svg+xml;base64,")).decode() == EVIL_SVG
    assert image["alt"] == (
        "The blocks log, chain, meter, connected: log.q to chain.phi; chain.p7 to meter.actual."
    )
    assert "alert(1)" not in html
    assert not any(name.startswith("on") for _, attributes in tags.found for name in attributes)


def test_nothing_in_a_simulation_breaks_out_of_the_page(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(20)
    plain = len(Tags(render_report([simulation])).found)
    named = tuple(
        replace(one, description=HOSTILE, unit=HOSTILE, display_unit=HOSTILE, variable=f"{HOSTILE}{k}")
        for k, one in enumerate(simulation.signals)
    )
    hostile = replace(
        simulation, name=HOSTILE, description=HOSTILE, signals=named, system_text=HOSTILE,
        blocks=tuple(
            SimulatedBlock(HOSTILE, "fmu", HOSTILE, HOSTILE, (Setting(HOSTILE, 1.0, HOSTILE),), HOSTILE)
            for _ in simulation.blocks
        ),
        connections={HOSTILE: HOSTILE}, failed=HOSTILE, warnings=(LogWarning(HOSTILE, HOSTILE),),
        verdicts=tuple(replace(one, block=HOSTILE) for one in simulation.verdicts),
    )  # fmt: skip
    html = render_report([hostile])
    tags = Tags(html)
    assert len(tags.named("script")) == len(re.findall("<script", html))
    assert {str(one["src"])[:10] for one in tags.named("img")} == {"data:image"}
    assert not any(name.startswith("on") for _, attributes in tags.found for name in attributes)
    assert len(tags.found) < plain + 60  # the notice and the other units' plots, no elements of a stranger
    drawn = re.findall(r'<script type="application/json">(.*?)</script>', html)
    named_by = [trace["name"] for text in drawn for trace in json.loads(text)["data"] if "name" in trace]
    assert any("&lt;img" in name for name in named_by)
    assert not any("<" in name for name in named_by)


def test_a_signal_that_starts_late_has_its_own_axis_of_time(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(20)
    late = replace(
        simulation, t_ns=simulation.t_ns + 10**9, arms=(), verdicts=(),
        signals=(Signal("b", "x", np.full(20, np.nan)),),
    )  # fmt: skip
    (figure,) = figures(lay_out([late]).parts[0]).values()
    assert figure.spec["layout"]["xaxis"]["range"] == [1.0, 1.095]
    assert "NaN" not in render_report([late]).split('<div id="details"')[1].split("<footer>")[0]
