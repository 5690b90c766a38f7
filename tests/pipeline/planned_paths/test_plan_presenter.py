"""What a plan shows in words: headline, facts, checks, tables, events."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asserting import there
from made_plans import CONTOUR, FAILED, SMALL, limited, planned
from presented import cells, facts, figures
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.outputs import safe_output
from urmpipe_pipeline.planned_paths.obstacles import ObstacleKind
from urmpipe_pipeline.planned_paths.parts import MANY, obstacle_words
from urmpipe_pipeline.planned_paths.presenter import CHECKS
from urmpipe_pipeline.planned_paths.result import PlannedPath
from urmpipe_pipeline.presentation.figure import Drawing
from urmpipe_pipeline.presentation.section import Table, Value
from urmpipe_pipeline.results import present
from urmpipe_pipeline.tables.junit import write_junit

ROUNDED = 5.1e-10
"""Joint values and shares are shown rounded to 1e-9."""


def tables(plan: PlannedPath) -> dict[str, Table]:
    return {table.title: table for table in present(plan).body.tables}


def brief(plan: PlannedPath) -> dict[str, Any]:
    """The facts under the headline by their names."""
    return {fact.name: fact.value for fact in present(plan).facts}


# --- words -------------------------------------------------------------------------------------------


def test_headline_and_facts_of_a_plan_that_holds(contour: PlannedPath) -> None:
    shown = present(contour)
    assert shown.headline == "path: irb60 runs 2.348 m in 4.780 s (trapezoid)"
    assert (shown.name, shown.verdict, shown.body.verdict, shown.opens_at_ns) == ("path", "pass", "pass", 0)
    told = facts(shown.body)
    near = told.pop("Nearest to a singularity")
    assert told == {
        "Robot": "irb60",
        "Rows": "6 rows; with a radius they are first points of arcs",
        "Length": "2.348496 m",
        "Duration": contour.duration,
        "Law": "trapezoid, up to 0.5 m/s and 6 m/s² along the path",
        "Reduced": "",
        "Limits": "the robot has no velocity or acceleration limits",
        "Recording": "",
    }
    smallest = there(contour.joints).singularity.smallest
    k = int(np.argmin(smallest))
    assert near.startswith(
        f"at t = {contour.t[k]:.3f} s (row {contour.row[k]}): smallest singular value {smallest[k]:.4g}, "
    )


def test_headline_and_facts_of_a_plan_that_a_joint_slows_down(slowed: PlannedPath) -> None:
    joints = there(slowed.joints)
    share = f"{100 * slowed.speed_factor:.1f} %"
    assert present(slowed).headline == (
        f"path: ur5e runs 1.148 m in {slowed.duration:.3f} s (jerk), reduced to {share} of the speed"
        " by shoulder_pan_joint"
    )
    told = brief(slowed)
    fastest = int(np.abs(joints.qd[:, 0]).argmax())
    unreduced = np.abs(joints.qd[:, 0]).max() / slowed.speed_factor / 0.5
    assert told["Law"] == "jerk, up to 0.5 m/s, 6 m/s² and 100 m/s³ along the path"
    assert told["Reduced"] == (
        f"to {share} of the speed, {slowed.speed:.4g} m/s:"
        f" shoulder_pan_joint would need {unreduced:.3g} times its largest rate"
    )
    used, t = told["Limits"].split(" of its largest rate, at t = ")
    assert used in ("shoulder_pan_joint uses 100 %", "shoulder_pan_joint uses 99.99 %")  # rounding of 1
    assert t == f"{slowed.t[fastest]:.3f} s"


def test_what_decides_is_the_largest_share_of_a_limit(slowed: PlannedPath, contour: PlannedPath) -> None:
    decisive = present(slowed).body.facts[0]
    assert decisive.name == "Largest rate: shoulder_pan_joint"
    assert isinstance(decisive.value, Value)
    assert (decisive.value.limit, decisive.value.verdict) == (1.0, "pass")
    assert decisive.value.used == pytest.approx(1.0, abs=1e-3)  # speeds are reduced to 0.1 %
    assert "Limits" not in facts(present(slowed).body)  # the same in words
    assert isinstance(present(contour).body.facts[0].value, str)


@pytest.mark.slow
def test_by_an_acceleration_speeds_fall_as_its_root() -> None:
    plan = planned(limited("ur5e", acceleration=2.0), SMALL)
    name, limit, share, _ = there(plan.joints).most_used
    # the largest acceleration is at the end of an arc, from which a sample is up to a period away
    assert limit == "largest acceleration"
    assert share == pytest.approx(1.0, abs=0.02)
    unreduced = planned(load_robot("ur5e"), SMALL)
    column = load_robot("ur5e").coordinates.index(name)
    needed = np.abs(there(unreduced.joints).qdd[:, column]).max() / 2.0
    times = float(brief(plan)["Reduced"].split(f"{name} would need ")[1].split(" times")[0])
    assert times == pytest.approx(needed, rel=0.02)  # likewise


def test_headline_and_facts_without_a_robot(alone: PlannedPath) -> None:
    shown = present(alone)
    way = f"{alone.path.total:.4g} m in {alone.duration:.3f} s"
    assert shown.headline == f"path: {way} (trapezoid), without a robot"
    assert (shown.verdict, shown.word, shown.body.checks, shown.body.properties) == (None, "planned", (), {})
    assert [fact.name for fact in shown.facts] == ["Length", "Duration", "Law"]
    assert list(tables(alone)) == ["Segments (6)"]
    assert tables(alone)["Segments (6)"].brief
    assert [figure.title for figure in figures(shown.body)] == ["Motion along the path"]
    assert not [one for one in shown.body.blocks() if isinstance(one, Drawing)]


@pytest.mark.parametrize(
    ("timing", "said"),
    [
        ({"arcs": "total"}, "trapezoid, up to 0.5 m/s and 6 m/s² in total"),
        ({"velocity": 0.25}, "trapezoid, up to 0.25 m/s and 6 m/s² along the path"),
    ],
)
def test_the_law_is_told_with_what_it_was_given(timing: dict[str, Any], said: str) -> None:
    assert brief(planned(None, CONTOUR, **timing))["Law"] == said


@pytest.mark.slow
def test_the_law_of_limits_tells_what_was_asked_beside_them() -> None:
    arm = limited("ur5e", acceleration=20.0)
    for timing, said in (
        ({}, "limits of the joints"),
        ({"velocity": 0.2}, "limits of the joints, up to 0.2 m/s along the path"),
    ):
        assert brief(planned(arm, SMALL, law="limits", **timing))["Law"] == said


@pytest.mark.slow
@pytest.mark.parametrize("kind", FAILED)
def test_what_is_in_the_way_is_headline_fact_check_and_event(kind: ObstacleKind, tmp_path: Path) -> None:
    plan = FAILED[kind]()
    shown = present(plan)
    words = [obstacle_words(one) for one in plan.infeasibilities]
    way = f"{plan.path.total:.4g} m in {plan.duration:.3f} s (trapezoid)"
    cannot = f"path: {there(plan.robot).name} cannot run {way}"
    first = plan.infeasibilities[0]
    assert shown.headline == f"{cannot}: {first.kind} at t = {first.t:.3f} s (row {first.row})"
    assert [fact.value for fact in shown.facts if fact.name == "Infeasible"] == words
    assert not {fact.name for fact in shown.body.facts} & {"Limits", "Reduced"}  # of speeds that are not run
    assert not any(isinstance(fact.value, Value) and fact.value.limit for fact in shown.body.facts)
    found: dict[str, str] = {}
    for one in plan.infeasibilities:
        joint = f", joint {one.joint}" if one.kind == "singular" else ""
        place = f"at t = {one.t:.3f} s (segment {one.segment + 1}, row {one.row}{joint})"
        found.setdefault(one.kind, f"{place}: {one.message}")
    assert kind in found
    assert [(check.kind, check.verdict, check.words) for check in shown.body.checks] == [
        (key, "fail" if key in found else "pass", found.get(key, "")) for key in CHECKS
    ]
    errors = [(event.t_ns, event.words) for event in shown.body.events() if event.level == "error"]
    assert errors == [(round(one.t * 1e9), f"{one.kind}: {one.message}") for one in plan.infeasibilities]
    with safe_output(tmp_path / "plan.xml", [], "junit") as part:
        write_junit(shown, part, tmp_path / "plan.xml")
    root = ET.parse(tmp_path / "plan.xml").getroot()
    cases = {case.get("name"): case.find("failure") for case in root.iter("testcase")}
    assert list(cases) == list(CHECKS.values())
    failed = {name: there(case.get("message")) for name, case in cases.items() if case is not None}
    assert failed == {CHECKS[key]: said for key, said in found.items()}  # type: ignore[index]
    assert root.get("failures") == str(len(found))


def test_of_many_things_in_the_way_the_rest_is_counted() -> None:
    plan = FAILED["unreachable"]()
    plan = replace(plan, infeasibilities=plan.infeasibilities[:1] * (MANY + 3))
    told = [fact.value for fact in present(plan).facts if fact.name == "Infeasible"]
    assert (len(told), told[-1]) == (MANY + 1, "and 3 more")


@pytest.mark.slow
@pytest.mark.parametrize("kind", FAILED)
def test_the_viewer_opens_before_what_is_in_the_way(kind: ObstacleKind) -> None:
    """At the last sample before it: from then on there may be no arm."""
    plan = FAILED[kind]()
    opens = present(plan).opens_at_ns
    (at,) = np.flatnonzero(plan.t_ns == opens)
    assert plan.reached[at]
    first = min(one.t for one in plan.infeasibilities)
    assert plan.t[at] < first <= plan.t[at + 1]


def test_the_checks_of_a_plan_that_holds_all_pass(contour: PlannedPath) -> None:
    body = present(contour).body
    assert [(check.verdict, check.words) for check in body.checks] == [("pass", "")] * 4
    assert body.properties == {
        "length": contour.path.total, "duration": contour.duration, "speed_factor": 1.0, "law": "trapezoid",
    }  # fmt: skip


# --- tables ------------------------------------------------------------------------------------------


def test_the_segments_are_those_of_the_plan(contour: PlannedPath, ring: PlannedPath) -> None:
    for plan, title, folded in ((contour, "Segments (9)", False), (ring, "Segments (197)", True)):
        table = tables(plan)[title]
        told, segments = cells(table), plan.to_dict()["segments"]
        assert told.pop("segment") == list(range(1, len(segments) + 1))
        assert told == {key: [one[key] for one in segments] for key in segments[0]}
        assert (table.folded, table.brief) == (folded, False)


def test_the_joints_are_those_of_the_plan(slowed: PlannedPath) -> None:
    table, joints = tables(slowed)["Joints along the path"], there(slowed.joints)
    told = cells(table)
    assert told["joint"] == list(load_robot("ur5e").coordinates)
    for key, wanted in (
        ("min", joints.q.min(axis=0)),
        ("max", joints.q.max(axis=0)),
        ("rate", np.abs(joints.qd).max(axis=0)),
        ("acceleration", np.abs(joints.qdd).max(axis=0)),
    ):
        np.testing.assert_allclose(told[key], wanted, rtol=0, atol=ROUNDED)
    assert told["rate_limit"] == [0.5, 3.0, *[None] * 4]
    assert told["acceleration_limit"] == [None, None, None, 50.0, None, None]
    for one in slowed.to_dict()["limits"]:
        row = told["joint"].index(one["joint"])
        for key in ("velocity_share", "acceleration_share"):
            assert told[key][row] == (None if one[key] is None else pytest.approx(one[key], abs=ROUNDED))
    units = {
        column.key: {cell.unit for cell in column.cells if isinstance(cell, Value)}
        for column in table.columns
    }
    assert (units["min"], units["rate"], units["acceleration"]) == ({"rad"}, {"rad/s"}, {"rad/s2"})


def test_shares_above_the_limit_fail_those_of_samples_out_of_reach_do_not_count() -> None:
    plan = FAILED["unreachable"]()
    table, joints = tables(plan)["Joints along the path"], there(plan.joints)
    told, q = cells(table), joints.q[plan.reached]
    np.testing.assert_allclose(told["min"], q.min(axis=0), rtol=0, atol=ROUNDED)
    np.testing.assert_allclose(told["max"], q.max(axis=0), rtol=0, atol=ROUNDED)
    (column,) = (column for column in table.columns if column.key == "velocity_share")
    verdicts = [cell.verdict for cell in column.cells if isinstance(cell, Value)]
    largest = np.nanmax(joints.velocity_share, axis=0)
    assert verdicts == ["fail" if share > 1.0 else "pass" for share in largest]
    assert {*verdicts} == {"fail", "pass"}


# --- events ------------------------------------------------------------------------------------------


def test_rows_are_events_when_the_path_passes_them(contour: PlannedPath, alone: PlannedPath) -> None:
    """A first tangent point when its arc begins; a corner, at a steady speed, in the middle of its arc."""
    for plan, part, rows in ((contour, 0.0, [2, 3, 4, 5]), (alone, 0.5, [2, 3])):
        events = {str(event.words): there(event.t_ns) for event in present(plan).body.events()}
        last = len(plan.rows)
        stops = [row for row in range(2, last) if row not in rows]
        assert list(events) == sorted(events, key=lambda words: events[words])
        assert sorted(events) == sorted(
            [
                "starts at row 1",
                *(f"passes row {row}" for row in rows),
                *(f"stops at row {row}" for row in stops),
                f"ends at row {last}",
            ]
        )
        arcs = {one["row"]: one for one in plan.segments() if one["kind"] == "arc"}
        for row in rows:
            wanted = arcs[row]["t"] + part * arcs[row]["duration"]
            assert events[f"passes row {row}"] == pytest.approx(1e9 * wanted, abs=2)  # whole ns
        # where a law ends at rest its time is known to the root of rounding
        assert events["starts at row 1"] == 0
        assert events[f"ends at row {last}"] == pytest.approx(1e9 * plan.duration, abs=100)
        at = plan.t_ns.searchsorted(list(events.values())).clip(max=len(plan) - 1)
        away = np.linalg.norm(plan.position[at] - plan.path.points(plan.path.at).position, axis=1)
        assert away.max() <= 0.5 * plan.tsp  # a sample later, at 0.5 m/s


def test_warnings_are_events_at_their_rows(contour: PlannedPath) -> None:
    some = LogWarning("columns-not-used", "w is not used"), LogWarning("uneven-turn", "rates step", row=3)
    plan = replace(contour, warnings=some)
    found = {event.words: event.t_ns for event in present(plan).body.events() if event.level == "warning"}
    assert found == {some[0]: None, some[1]: round(1e9 * contour.row_times[2])}
