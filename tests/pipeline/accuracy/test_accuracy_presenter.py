"""What an accuracy shows: headline, facts, tables, checks, plots, and the page about two arms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from asserting import there
from made_plans import SMALL
from presented import cells, facts, figures, scene_of
from urmpipe_pipeline import text
from urmpipe_pipeline.accuracy.driven_motion import DrivenMotion
from urmpipe_pipeline.accuracy.figures import velocity_figure
from urmpipe_pipeline.accuracy.published import FIG7
from urmpipe_pipeline.accuracy.result import AccuracyResult
from urmpipe_pipeline.presentation.figure import Figure, Panel, SpaceFigure
from urmpipe_pipeline.presentation.palette import REFERENCE_COLOUR
from urmpipe_pipeline.presentation.section import Value
from urmpipe_pipeline.report.render import render_report
from urmpipe_pipeline.results import present

Make = Callable[..., AccuracyResult]


def mm(value: float | None) -> str:
    return text.format_number(value, "m")


def panels(figure: Figure) -> list[Panel]:
    return [panel for view in figure.views for panel in view.panels]


# --- words -------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_headline_with_a_limit(limited: AccuracyResult, accuracy: Make) -> None:
    shown = present(limited)
    assert shown.headline == "cube wall xy: irb60 runs up to 0.2 m/s within 0.4 mm (time)"
    assert (shown.verdict, shown.body.title) == ("fail", "Accuracy of irb60, cube wall xy")
    none = present(accuracy(limit=1e-9, limited_error="path"))
    assert none.headline == "cube wall xy: irb60 runs at no velocity within 1e-06 mm (path)"
    assert facts(none.body)["Running speed"] == "none"


@pytest.mark.parametrize("limited_error", ["time", "path"])
def test_the_path_is_coloured_by_the_limited_error_with_its_limit(accuracy: Make, limited_error: str) -> None:
    result = accuracy(0.5, limit=4e-4, limited_error=limited_error)
    (motion,) = result.motions
    (figure,) = (one for one in present(result).body.blocks() if isinstance(one, SpaceFigure))
    (real,) = (path for path in figure.paths if path.values is not None)
    values = motion.delta[:, 3] if limited_error == "time" else motion.from_path
    np.testing.assert_array_equal(real.values, values)
    assert real.limit == 4e-4


@pytest.mark.slow
def test_headline_without_a_limit(accuracy: Make) -> None:
    result = accuracy()
    shown = present(result)
    most = mm(result.errors[2].error)
    assert shown.headline == f"cube wall xy: irb60 is up to {most} mm off (time) at 1 m/s"
    assert (shown.verdict, shown.word) == (None, "simulated")
    assert not {"Limit", "Running speed"} & {*facts(shown.body)}
    assert "verdict" not in cells(shown.body.tables[0])
    assert not shown.body.checks
    assert len(shown.body.tables) == 1  # nothing was tried


def test_a_motion_that_diverged(accuracy: Make) -> None:
    result = accuracy(0.5, 1.0, gone=1.0, limit=1.0)
    end = f"diverged at t = {result.motions[1].t[-1]:.4g} s (theta2)"
    table = cells(present(result).body.tables[0])
    assert table["error"] == [result.errors[0].error, end]
    assert [one.verdict for one in present(result).body.checks] == ["pass", "fail"]
    assert present(result).body.checks[1].words == f"{end} (time), allowed: 1000 mm"
    free = accuracy(1.0, gone=1.0)
    assert present(free).headline == "cube wall xy: irb60 diverges at 1 m/s"
    assert "diverged" in figures(present(free).body.sections[0])[0].instants.values()
    assert render_report([present(free)])


def test_facts_say_how_it_was_run(accuracy: Make) -> None:
    told = facts(present(accuracy(0.5, force=(0.0, 0.0, -50.0), compiled=False)).body)
    assert told["Acceleration"] == "6 m/s² at all velocities, law trapezoid"
    assert told["Force on the tool"] == "(0, 0, -50) N"
    assert told["Ran as"] == "NumPy"
    assert told["Error that decides"] == "time: from the set point of the same time"


@pytest.mark.slow
def test_table_and_checks(limited: AccuracyResult) -> None:
    asked, tried = present(limited).body.tables
    found = cells(asked)
    assert found["error"] == [one.error for one in limited.errors]
    assert found["path_error"] == [one.path_error for one in limited.errors]
    assert found["saturated_share"] == [one.saturated_share for one in limited.errors]
    assert (found["saturated_share"][0], tried.folded, tried.brief) == (0.0, True, False)
    assert cells(tried)["velocity"] == ["0.1 m/s", "0.2 m/s", "0.3 m/s"]
    checks = present(limited).body.checks
    assert [(one.name, one.verdict) for one in checks] == [
        ("0.1 m/s", "pass"), ("0.5 m/s", "fail"), ("1 m/s", "fail"),
    ]  # fmt: skip
    assert checks[1].words == f"{mm(limited.errors[1].error)} mm (time), allowed: 0.4 mm"


# --- plots -------------------------------------------------------------------------------------------


def test_error_over_velocity(limited: AccuracyResult) -> None:
    figure = velocity_figure(limited)
    (panel,) = panels(figure)
    over = there(panel.over)
    assert over.values.tolist() == [0.1, 0.2, 0.3, 0.5, 1.0]
    assert (panel.logarithmic, panel.limit) == (True, limited.limit)
    path, time, published = panel.lines
    assert [line.strong for line in panel.lines] == [False, True, False]
    every = {one.velocity: one for one in (*limited.probed, *limited.errors)}
    assert time.values[:].tolist() == [every[v].error for v in over.values]
    assert path.values[:].tolist() == [every[v].path_error for v in over.values]
    assert published.values[:].tolist() == [one.error for one in FIG7]
    assert [mark.words for mark in panel.marks if mark.shape == "up"] == ["published: more than 17 mm"]
    assert figure.instants == {1: "0.2 m/s"}


def test_published_points_are_those_of_its_arm_and_contour(accuracy: Make) -> None:
    result = accuracy(0.5, 1.0)
    others = replace(result, robot=replace(result.robot, name="ur5e")), replace(result, rows=SMALL)
    assert len(panels(velocity_figure(result))[0].lines) == 3
    for other in others:
        assert len(panels(velocity_figure(other))[0].lines) == 2
        assert "Iso9283" not in velocity_figure(other).caption


@pytest.mark.parametrize("limited_error", ["time", "path"])
def test_plots_of_a_motion(accuracy: Make, limited_error: str) -> None:
    result = accuracy(0.5, limit=4e-4, limited_error=limited_error)
    (section,), (motion,) = present(result).body.sections, result.motions
    deviation, joints, drives = figures(section)
    limits = {panel.title: panel.limit for panel in panels(deviation)}
    assert [limits["‖Δ‖"], limits["path"]] == ([4e-4, None] if limited_error == "time" else [None, 4e-4])
    assert list(deviation.instants) == motion.corner_times_ns.tolist()
    for panel, real, asked in zip(
        panels(joints), (motion.q, motion.qd), (motion.set_q, motion.set_qd), strict=True
    ):
        behind, front = panel.lines
        assert (behind.dashed, {*behind.colours}) == (True, {REFERENCE_COLOUR})
        np.testing.assert_array_equal(behind.values[:], asked)
        np.testing.assert_array_equal(front.values[:], real)
    voltage, current = panels(drives)
    assert (voltage.limit, current.limit) == (36.0, None)
    np.testing.assert_array_equal(voltage.lines[0].values[:], motion.voltage)


def test_drives_of_other_voltages_have_panels_of_their_own(accuracy: Make) -> None:
    one = accuracy(0.5)
    motion: DrivenMotion = replace(one.motions[0], limits=np.array([24.0, 36.0, 24.0]))
    drives = figures(present(replace(one, motions=(motion,))).body.sections[0])[2]
    found = [(panel.limit, panel.lines[0].names) for panel in panels(drives)[:2]]
    assert found == [(24.0, ("theta1", "theta3")), (36.0, ("theta2",))]


def test_scene_shows_the_motion_nearest_to_half_a_metre_per_second(limited: AccuracyResult) -> None:
    shown, motion = present(limited), limited.motions[1]
    assert shown.opens_at_ns == motion.t_ns[motion.worst]
    assert [one.opened for one in shown.body.sections] == [False, True, False]
    scene = scene_of(shown)
    assert "0.5 m/s" in scene.title
    assert scene.arms[0].q is motion.q
    _, real, larger, _ = scene.paths
    np.testing.assert_array_equal(there(real.values), motion.delta[:, 3])
    factor = int(larger.name.removeprefix("deviation x"))
    np.testing.assert_allclose(
        larger.position - motion.planned, factor * (motion.position - motion.planned), atol=1e-15
    )


# --- page --------------------------------------------------------------------------------------------


def test_page_of_an_accuracy(limited: AccuracyResult) -> None:
    page = render_report([present(limited)])
    for said in ("runs up to 0.2 m/s", "Error over velocity", "Arm on the path at 0.5 m/s", "Voltages"):
        assert said in page
    assert all(mm(one.error) in page and mm(one.path_error) in page for one in limited.errors)


def test_two_arms_stand_side_by_side(limited: AccuracyResult) -> None:
    spring = replace(limited, robot=replace(limited.robot, name="irb60-spring"), running=None)
    first, second = (present(one).lines[0] for one in (limited, spring))
    assert list(first) == list(second)
    assert [first["Running speed"], second["Running speed"]] == [Value(0.2, "m/s"), None]
    fastest = first["Error at 1 m/s"]
    assert isinstance(fastest, Value)
    assert fastest.number == limited.errors[2].error
    page = render_report([present(limited), present(spring)])
    heads = ("Side by side", "Robot: 2 results", "Accuracy of irb60-spring, cube wall xy")
    at = [page.index(said) for said in heads]
    assert all(one < other for one, other in pairwise(at))
