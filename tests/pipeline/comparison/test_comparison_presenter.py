"""What a comparison shows: its arrays, and nothing computed too early; `presentation.cases` has its words."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from asserting import there
from made_runs import arms, off, paths
from presented import Untouched, cells, every_section, facts, figures, scene_of
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import AXES
from urmpipe_pipeline.presentation.figure import Figure, SpaceFigure
from urmpipe_pipeline.presentation.palette import run_colour
from urmpipe_pipeline.presentation.section import Place, Ref, Section
from urmpipe_pipeline.results import present


def noisy(seed: int, size: float = 0.001, samples: int = 60) -> FloatArray:
    """Random deviations of six joints."""
    return size * np.random.default_rng(seed).normal(size=(samples, 6))


def log_section(result: Comparison, name: str) -> Section:
    return next(one for one in present(result).body.sections if one.title == name)


def test_the_rows_are_the_statistics() -> None:
    result = arms({"a": noisy(1), "b": noisy(2)}, tolerance={"axis": 0.001, "joint": 0.002})
    rows = there(present(result).rows)
    table = cells(rows())
    assert list(zip(*table.values(), strict=True)) == [tuple(row.values()) for row in result.rows()]
    assert list(table) == list(next(result.rows()))


def test_the_first_fact_is_what_decided() -> None:
    result = arms({"a": noisy(1), "b": noisy(2, 0.01)}, tolerance={"joint": 0.002})
    for one in result.runs:
        section = log_section(result, one.name)
        held, value = one.worst_statistics, cast("Any", section.facts[0].value)
        assert (value.number, value.unit, value.limit) == (held.max, held.unit, held.tolerance)
        assert (value.used, value.verdict) == (held.utilisation, held.verdict)
        found = facts(section)
        assert found["Time"] == held.t_max
        assert found["Position"] == Place(tuple(one.actual[one.worst_statistics_index].tolist()))
        assert found["r(‖Δ‖, speed)"] == one.speed_correlation
    shown = present(result)
    worst = result.worst
    assert shown.facts[0].value == Ref(worst.name, run_colour(result.runs.index(worst)))
    assert shown.opens_at_ns == worst.t_ns[worst.worst_statistics_index]


def test_many_logs_are_drawn_together_in_their_order_and_colours() -> None:
    deltas = {f"log{k}": off(0.001 * (1 + (7 * k) % 12)) for k in range(12)}
    result = paths(deltas, tolerance={"axis": 0.006})
    shown = present(result)
    ranks = {one.title: one.rank for one in shown.body.sections}
    assert sorted(ranks, key=ranks.__getitem__) == [one.name for one in result.ranking]
    (overview,) = [one for one in shown.body.blocks() if isinstance(one, Figure)]
    for line, one in zip(overview.views[0].panels[0].lines, result.ranking, strict=True):
        np.testing.assert_array_equal(line.values, one.delta[:, 3])
        assert line.t_ns is one.t_ns
        assert line.colours == (run_colour(result.runs.index(one)),)


def test_the_plots_are_the_deviation_with_what_is_allowed() -> None:
    result = arms({"a": noisy(1)}, tolerance={"axis": 0.001, "angle": 0.002, "joint": 0.002})
    one = result.runs[0]
    deviation, joints, *_ = figures(log_section(result, "a"))
    delta, path, angle = deviation.views
    for i, (axis, panel) in enumerate(zip(AXES, delta.panels, strict=True)):
        held = one.statistics[axis]
        np.testing.assert_array_equal(panel.lines[0].values, one.delta[:, i])
        assert (panel.limit, panel.unit, panel.signed) == (held.tolerance, "m", axis != "norm")
        assert abs(panel.lines[0].values[:][panel.peaks[0]]) == held.max
    assert path.panels[0].lines[0].values is one.path
    assert angle.panels[0].lines[0].values is one.angle
    np.testing.assert_array_equal(joints.views[0].panels[0].lines[0].values, np.asarray(one.joint_delta))
    assert list(deviation.instants) == [one.t_ns[one.worst_statistics_index]]


def test_the_scene_is_the_worst_arm_all_paths_and_what_decided() -> None:
    result = arms({"a": noisy(1, 0.01), "b": noisy(2, 0.001)})
    scene, worst = scene_of(present(result)), result.worst
    assert scene.arms[0].q is worst.run.q
    whole, moving, a, b, larger = scene.paths
    assert whole.position is result.reference.position
    assert (whole.t_ns, moving.line) == (None, False)
    assert moving.position is worst.reference
    assert [path.position for path in (a, b)] == [one.actual for one in result.runs]
    assert scene.spots[0].position == tuple(worst.actual[worst.worst_statistics_index].tolist())
    factor = int(larger.name.removeprefix("deviation x"))
    np.testing.assert_array_equal(
        larger.position, worst.reference + factor * (worst.actual - worst.reference)
    )


@pytest.mark.parametrize("align", ["none", "start", "rigid", "tool"])
def test_the_arm_stands_where_its_aligned_path_is(align: str) -> None:
    result = arms({"a": noisy(1, 0.01)}, align=align)
    one = result.runs[0]
    (arm,) = scene_of(present(result)).arms
    # Two ways of adding up one motion: rounding of lengths below 2 m.
    np.testing.assert_allclose(
        positions_over_log(arm.chain, one.run.q[one.sample]), one.actual, rtol=0, atol=1e-12
    )


def test_a_page_shows_the_paths_coloured_by_the_deviation() -> None:
    result = paths({"a": off(0.004)})
    one = result.runs[0]
    space = next(b for b in log_section(result, "a").blocks() if isinstance(b, SpaceFigure))
    reference, actual = space.paths
    assert reference.position is one.reference
    assert actual.position is one.actual
    np.testing.assert_array_equal(np.asarray(actual.values), one.delta[:, 3])


def test_no_array_of_a_motion_is_looked_into_before_it_is_shown() -> None:
    result = arms({"a": noisy(1), "b": noisy(2)})

    def hidden(run: Any) -> Any:
        untouched = {name: cast("Any", Untouched(len(run.q))) for name in ("q", "qd", "qdd")}
        tcp = replace(run.tcp, **dict.fromkeys(("position", "velocity", "acceleration"), untouched["q"]))
        return replace(run, tcp=tcp, **untouched)

    runs = tuple(replace(one, run=hidden(one.run)) for one in result.runs)
    shown = present(replace(result, runs=runs))
    assert shown.verdict == result.verdict


def test_a_log_of_one_row_is_shown() -> None:
    shown = present(paths({"a": np.zeros((1, 3))}))
    scene_of(shown)
    for section in every_section(shown.body):
        assert all(figure.views for figure in figures(section))
        list(section.blocks())
        list(section.events())
