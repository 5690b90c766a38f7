"""Simulations on a page: the worst leads, and nothing in a file of a stranger breaks out or runs."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.report import render_report
from urmpipe_pipeline.report.page import Page, lay_out
from urmpipe_pipeline.results import present
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


def page_of(*results: Simulation | Comparison) -> Page:
    return lay_out([present(one) for one in results])


def test_the_worst_meter_stands_first(make_simulation: MakeSimulation) -> None:
    page = page_of(make_simulation(tolerance=0.005), make_simulation(name="other"))
    assert (page.banner.state, page.banner.word) == ("fail", "FAIL")
    assert page.banner.headline == "1 of 2 systems"
    assert page.banner.others[0] == "FAIL: meter of other out of tolerance."
    assert page.banner.facts[0].href.startswith("#r2")
    ranked = [table for summary in page.summaries[1:] for table in summary.tables]
    states = [[cell.state for row in table.rows for cell in row if cell.text.isupper()] for table in ranked]
    assert states == [["fail"], ["pass"]]
    assert [part.title for part in page.parts] == ["Simulation other", "Simulation log-to-delta"]


def test_one_that_failed_says_so_before_all(make_simulation: MakeSimulation) -> None:
    failed = make_simulation(101, failed="chain: fmi2DoStep returned fmi2Error", name="broken")
    page = page_of(make_simulation(tolerance=0.005), failed)
    assert (page.banner.state, page.banner.headline) == ("fail", "1 of 2 systems")
    assert page.banner.others[0] == "FAIL: broken did not reach its end."
    assert failed.failed in [fact.value for fact in page.banner.facts]
    assert page.parts[0].notice == "Failed: chain: fmi2DoStep returned fmi2Error"
    figure = next(figure for _, figure in page.figures if not figure.space)
    (line,) = [one for one in figure.spec["layout"]["shapes"] if one["yref"] == "paper"]
    assert line["x0"] == 0.5
    assert page_of(make_simulation(0, failed="chain: crashed")).figures == []


@pytest.mark.slow
@pytest.mark.parametrize(("tolerance", "ends"), [(0.0035, "fail"), (0.005, "pass")])
def test_a_comparison_that_passes_does_not_hide_a_simulation_that_fails(
    make_simulation: MakeSimulation, comparison: Comparison, tolerance: float, ends: str
) -> None:
    passing = replace(comparison, runs=tuple(replace(run, verdict="pass") for run in comparison.runs))
    page = page_of(make_simulation(tolerance=tolerance), passing)
    assert page.banner.state == ends
    assert [said.partition(":")[0] for said in page.banner.others] == [ends.upper(), "PASS"]
    failing = page_of(make_simulation(), comparison)
    assert (failing.banner.state, failing.banner.others) == (
        "fail",
        (f"FAIL: {present(comparison).headline}.", "FAIL: meter of log-to-delta out of tolerance."),
    )


def test_a_signal_that_starts_late_has_its_own_axis_of_time(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(20)
    late = replace(
        simulation, t_ns=simulation.t_ns + 10**9, arms=(), verdicts=(),
        signals=(Signal("b", "x", np.full(20, np.nan)),),
    )  # fmt: skip
    ((_, figure),) = page_of(late).figures
    assert figure.spec["layout"]["xaxis"]["range"] == [1.0, 1.095]
    assert "NaN" not in render_report([present(late)]).split('<div id="details"')[1].split("<footer>")[0]


def test_the_drawing_is_an_image_in_which_no_script_runs(make_simulation: MakeSimulation) -> None:
    html = render_report([present(replace(make_simulation(20), system_svg=EVIL_SVG))])
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
    plain = len(Tags(render_report([present(simulation)])).found)
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
    html = render_report([present(hostile)])
    tags = Tags(html)
    assert len(tags.named("script")) == len(re.findall("<script", html))
    assert {str(one["src"])[:10] for one in tags.named("img")} == {"data:image"}
    assert not any(name.startswith("on") for _, attributes in tags.found for name in attributes)
    # the notice, a card and the other units' plots, no elements of a stranger
    assert len(tags.found) < plain + 80
    drawn = re.findall(r'<script type="application/json">(.*?)</script>', html)
    named_by = [trace["name"] for text in drawn for trace in json.loads(text)["data"] if "name" in trace]
    assert any("&lt;img" in name for name in named_by)
    assert not any("<" in name for name in named_by)
