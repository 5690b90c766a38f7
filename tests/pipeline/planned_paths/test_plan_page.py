"""Plans on a page: with and without an arm, failed, beside each other, long."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace

import pytest

from made_plans import CONTOUR, FAILED, SMALL, limited, planned
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.presentation.figure import Drawing
from urmpipe_pipeline.report import render_report
from urmpipe_pipeline.report.page import Page, lay_out
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.report.tables import Grid
from urmpipe_pipeline.results import present

PLANS: Mapping[str, Callable[[], PlannedPath]] = {
    "arm": lambda: planned(limited("ur5e", acceleration=20.0), SMALL),
    "alone": lambda: planned(None, CONTOUR, arcs="total"),
    **{str(kind): make for kind, make in FAILED.items()},
}


def page_of(*plans: PlannedPath) -> Page:
    return lay_out([present(plan) for plan in plans])


def test_a_page_has_all_of_a_plan(slowed: PlannedPath) -> None:
    page = page_of(slowed)
    assert (page.banner.word, page.banner.headline) == ("PASS", present(slowed).headline)
    (part,) = page.parts
    shown = [block.title for block in part.blocks if isinstance(block, (Grid, Figure, Drawing))]
    assert shown == [
        "Motion along the path",
        "Joints along the path",
        "Segments (9)",
        "Joints over time",
        "Distance from singular poses",
        "Path in space",
        "Arm at the rows",
        "How it was made",
    ]
    assert page.summaries == ()  # one result stands below, and no number twice
    names = [fact.name for fact in (*page.banner.facts, *part.facts)]
    assert "Largest rate: shoulder_pan_joint" in names
    assert len(set(names)) == len(names)
    (motion, joints, singular, space) = (block for block in part.blocks if isinstance(block, Figure))
    for figure, axes in (
        (motion, ["s [m]", "s′ [m/s]", "s″ [m/s²]", "s‴ [m/s³]"]),
        (joints, ["q [rad]", "q′ [rad/s]", "|q′| / limit [%]", "q″ [rad/s²]", "|q″| / limit [%]"]),
        (singular, ["σ min [-]", "det J [m³]"]),
    ):
        layout = figure.spec["layout"]
        found = [layout[name]["title"]["text"] for name in layout if name.startswith("yaxis")]
        assert found == axes
    legend = [one["name"] for one in joints.spec["data"] if one["showlegend"]]
    assert legend == list(load_robot("ur5e").coordinates)  # each joint once
    names = [one["name"] for one in space.spec["data"] if one.get("showlegend", True)]
    assert names == ["planes", "tangent points", "stops"]


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", PLANS)
def test_every_plan_has_a_page(name: str) -> None:
    plan = PLANS[name]()
    html = render_report([present(plan)])
    details = html.split('<div id="details"')[1].split("<footer>")[0]
    assert "NaN" not in details
    assert not re.search(r"\bnan\b", details)
    page = page_of(plan)
    assert page.banner.state == (plan.verdict or "plain")
    drawings = [block for block in page.parts[0].blocks if isinstance(block, Drawing)]
    assert len(drawings) == (plan.robot is not None)
    if plan.infeasibilities:
        assert "Infeasible" in [fact.name for fact in page.banner.facts]
        joints = next(one for _, one in page.figures if one.title == "Joints over time")
        lines = [one["label"]["text"] for one in joints.spec["layout"]["shapes"] if one["yref"] == "paper"]
        wanted = [f"{one.kind}, row {one.row}" for one in plan.infeasibilities]
        assert lines[-len(wanted) :] == wanted  # behind those of stops


@pytest.mark.slow
def test_plans_stand_side_by_side(slowed: PlannedPath) -> None:
    page = page_of(slowed, FAILED["jump"]())
    assert page.banner.state == "fail"
    (beside,) = page.summaries[0].tables
    heads = [head for head, _ in beside.heads]
    assert heads[:5] == ["Plan", "Verdict", "Robot", "Law", "Length [mm]"]
    first = beside.rows[0][heads.index("Speed left")]
    assert first.text == f"{100 * slowed.speed_factor:.1f} %"


@pytest.mark.slow
def test_a_page_grows_little_with_the_samples() -> None:
    """Lines are thinned out: of 40 times as many samples no more than 10 times as much is drawn."""
    short, long = (planned(load_robot("irb60"), CONTOUR, tsp=tsp) for tsp in (0.01, 0.00025))
    assert (len(short), len(long)) == (480, 19_123)
    sizes = [len(render_report([present(plan)])) for plan in (short, long)]
    library = len(render_report([present(planned(None, CONTOUR, tsp=1.0))]))
    assert sizes[1] - library < 10 * (sizes[0] - library)


def test_names_of_a_stranger_are_drawn_letter_by_letter(slowed: PlannedPath) -> None:
    evil = "</script><img src=x onerror=alert(1)>"
    html = render_report([present(replace(slowed, name=evil))])
    assert "<img src=x" not in html
