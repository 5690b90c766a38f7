"""Solved targets on the page: how many were reached, which were not and why, and that poses are no motion."""

from __future__ import annotations

import base64
from dataclasses import replace

import numpy as np
import plotly.graph_objects as go
import pytest

from urmpipe_models.arrays import FloatArray
from urmpipe_models.inverse.targets import targets_of
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.report import gallery
from urmpipe_pipeline.report.banner import solved_banner
from urmpipe_pipeline.report.facts import run_facts
from urmpipe_pipeline.report.log_tables import missed_table
from urmpipe_pipeline.report.page import lay_out
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.solved_targets.drawn_run import goals_of, row_times, solved_run

FAR = "axis 4 is 1.174 m from axis 2, allowed: 0.0328 to 0.8172 m"


def drawn(figure: Figure, name: str) -> FloatArray:
    """Return the values of the one trace of a figure that is called so."""
    (spec,) = [one["y"] for one in figure.spec["data"] if one["name"] == name]
    return np.frombuffer(base64.b64decode(spec["bdata"]), f"<{spec['dtype']}").astype(np.float64)


@pytest.fixture
def run() -> Run:
    """Three targets; the second is out of reach."""
    robot = load_robot("ur5e")
    q = np.array([[1.7, -1.8, -1.5, -3.5, 1.6, -0.7], [0.3] * 6, [-0.3, 0.1, 1.3, -0.6, 1.1, -2.4]])
    goals = goals_of(targets_of(robot, q), row_times(3), ["", f"{FAR}; axis 4 is 2 m from axis 2", ""])
    q[1] = np.nan
    return solved_run("poses", robot, None, q, goals=goals)


def test_the_banner_counts_the_targets_that_are_reached(run: Run) -> None:
    said = lay_out([run]).banner
    assert (said.state, said.word, said.headline) == ("fail", "FAIL", "poses: ur5e reaches 2 of 3 targets")
    assert [(fact.name, fact.value) for fact in said.facts] == [("Warnings", "1")]
    assert said.detail == ""
    assert solved_banner([run, run]).headline == "2 files: ur5e reaches 4 of 6 targets"
    solved = replace(run, log=replace(run.log, q=np.zeros((3, 6))))
    said = lay_out([solved]).banner
    assert (said.state, said.word, said.headline) == ("pass", "PASS", "poses: ur5e reaches 3 targets")


def test_of_several_files_each_jump_is_told_with_its_file(run: Run) -> None:
    jump = replace(run, name="path", warnings=(LogWarning("jump", "1 jump: q1 by 90 deg", 2),))
    assert solved_banner([jump]).detail == "1 jump: q1 by 90 deg."
    assert solved_banner([run, jump]).detail == "path: 1 jump: q1 by 90 deg."


def test_targets_and_logs_are_both_told_of(run: Run) -> None:
    log = replace(run, name="log", goals=None)
    ingested = "INGESTED: log: 3 rows, 0 repolarizations."
    said = lay_out([log, run]).banner
    assert (said.word, said.detail) == ("FAIL", ingested)
    solved = replace(run, log=replace(run.log, q=np.zeros((3, 6))))
    said = lay_out([log, solved]).banner
    assert (said.word, said.detail) == ("PASS", ingested)


def test_the_table_of_targets_has_the_verdict_and_how_many_are_reached(run: Run) -> None:
    page = lay_out([run])
    (table,) = page.summaries[0].tables
    assert table.title == "What was solved"
    assert [column.title for column in table.columns[:2]] == ["Targets", "Verdict"]
    found = {column.title: cell.text for column, cell in zip(table.columns, table.rows[0], strict=True)}
    assert (found["Verdict"], found["Rows"], found["Reached"]) == ("FAIL", "3", "2")
    assert page.parts[0].verdict == "fail"
    (mixed,) = lay_out([run, replace(run, goals=None)]).summaries[0].tables
    assert mixed.title == "What was read"
    assert [row[1].text for row in mixed.rows] == ["FAIL", "–"]


def test_poses_without_times_have_no_duration(run: Run) -> None:
    (table,) = lay_out([run]).summaries[0].tables
    assert "Duration [s]" not in [column.title for column in table.columns]
    facts = {fact.name: fact.value for fact in run_facts(run)}
    assert facts["Rows"] == "3, without times"
    assert {"Grid", "Duration"} & set(facts) == set()


def test_each_target_that_was_missed_has_a_row(run: Run) -> None:
    table = missed_table(run)
    assert table is not None
    assert table.title == "Targets without a solution (1)"
    assert run.goals is not None
    x, y, z = run.goals.position[1]
    assert [[cell.text for cell in row] for row in table.rows] == [
        ["2", f"{x:.4f}, {y:.4f}, {z:.4f}", f"{FAR}; axis 4 is 2 m from axis 2"]
    ]
    assert missed_table(replace(run, goals=replace(run.goals, reasons=("",) * 3))) is None
    assert missed_table(replace(run, goals=None)) is None


def test_single_poses_are_points_that_nothing_joins(run: Run) -> None:
    found = gallery.run_figures(run)
    assert [figure.title for figure in found] == ["Joints", "Poses of the tool centre point"]
    assert run.tcp is not None
    for figure in found:
        go.Figure(figure.spec)  # raises on an unknown word or a wrong value
        assert {one["mode"] for one in figure.spec["data"]} == {"markers"}
    for axis, name in enumerate(("px", "py", "pz")):
        # Single precision.
        np.testing.assert_allclose(drawn(found[1], name), run.tcp.position[:, axis], rtol=2**-24, atol=0)
    for axis, name in enumerate(("rz", "ry", "rx")):  # each pose by itself: not another name of its rotation
        np.testing.assert_allclose(drawn(found[1], name), run.tcp.euler_zyx[:, axis], rtol=2**-24, atol=0)


def test_the_targets_missed_stand_before_the_figures(run: Run) -> None:
    (part,) = [part for part in lay_out([run]).parts if part.title == "Targets poses"]
    assert [block.title for block in part.blocks[:2]] == ["Targets without a solution (1)", "Joints"]


def test_the_heading_says_whether_logs_were_ingested_or_targets_solved(run: Run) -> None:
    log = replace(run, goals=None)
    assert [one.title for one in lay_out([run]).summaries] == ["Solved targets"]
    assert [one.title for one in lay_out([log]).summaries] == ["Ingested logs"]
    assert [one.title for one in lay_out([run, log]).summaries] == ["Ingested logs and solved targets"]
