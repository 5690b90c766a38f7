"""The figures are what plotly.js understands, and hold the data of the results."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest

from urmpipe_pipeline.comparison import Comparison
from urmpipe_pipeline.joint_log import FloatArray
from urmpipe_pipeline.report import figures, paths
from urmpipe_pipeline.report.spec import Figure, Panel, line, stacked, typed
from urmpipe_pipeline.results import Run


def numbers(spec: dict[str, Any]) -> FloatArray:
    """The array that plotly.js reads from a typed one."""
    values = np.frombuffer(base64.b64decode(spec["bdata"]), f"<{spec['dtype']}").astype(np.float64)
    return values.reshape([int(n) for n in spec["shape"].split(",")]) if "shape" in spec else values


def all_figures(comparison: Comparison) -> list[Figure]:
    found: list[Figure | None] = []
    for deviation in comparison.runs:
        run = deviation.run
        found += [figures.deviation_figure(deviation), paths.path_figure(deviation)]
        found += [figures.joints_figure(run), paths.run_path_figure(run), figures.motion_figure(run)]
    return [figure for figure in found if figure is not None]


def test_plotly_accepts_every_figure(comparison: Comparison, hostile: Comparison, bare_run: Run) -> None:
    joints = figures.joints_figure(bare_run)
    assert joints is not None
    found = [*all_figures(comparison), *all_figures(hostile), joints]
    assert len(found) == 16
    for figure in found:
        go.Figure(figure.spec)  # raises on an unknown word or a wrong value


def test_a_log_without_a_robot_has_joints_only(bare_run: Run) -> None:
    assert figures.motion_figure(bare_run) is None
    assert paths.run_path_figure(bare_run) is None


def test_typed_arrays_come_back() -> None:
    values = np.array([[0.0, -1.5], [np.nan, 1e6]])
    np.testing.assert_array_equal(numbers(typed(values)), values)
    exact = np.array([0.005 * 1e6, np.pi])
    np.testing.assert_array_equal(numbers(typed(exact, "f8")), exact)


def test_the_drawn_deviation_keeps_its_largest_value_and_its_tolerance(comparison: Comparison) -> None:
    deviation = comparison.runs[1]
    spec = figures.deviation_figure(deviation).spec
    for name, axis in (("Δx", "x"), ("Δy", "y"), ("Δz", "z"), ("‖Δ‖", "norm")):
        (trace,) = [trace for trace in spec["data"] if trace["name"] == name]
        peak = np.abs(numbers(trace["y"])).max()
        # drawn in single precision: 24 bits of mantissa
        assert peak == pytest.approx(deviation.statistics[axis].max * 1e3, rel=2**-24)
        assert len(numbers(trace["y"])) < len(deviation.t)
    levels = sorted(
        shape["y0"] for shape in spec["layout"]["shapes"] if shape["type"] == "line" and shape["yref"] == "y"
    )
    assert levels == [-3.5, 3.5]


def test_every_repolarization_is_marked_where_it_is(comparison: Comparison) -> None:
    run = comparison.runs[0].run
    assert {item.joint for item in run.repolarizations} >= {"phi1", "phi4"}
    figure = figures.joints_figure(run)
    assert figure is not None
    marks = [trace for trace in figure.spec["data"] if trace["mode"] == "markers"]
    above, below = ([trace for trace in marks if trace["yaxis"] == axis] for axis in ("y", "y2"))
    for panel in (above, below):
        times = np.sort(np.concatenate([numbers(trace["x"]) for trace in panel]))
        np.testing.assert_array_equal(times, np.sort([item.t for item in run.repolarizations]))
    notes = [note for trace in above for note in trace["text"]]
    item = run.repolarizations[0]
    assert (
        f"repolarization of {item.joint}, row {item.row}: step {item.step:+.4f} rad,"
        f" k {item.before} → {item.after}"
    ) in notes
    assert f"{len(notes)} repolarizations" in figure.caption


def test_axes_say_what_they_measure(comparison: Comparison) -> None:
    for figure in all_figures(comparison):
        layout = figure.spec["layout"]
        axes = layout.get("scene", layout)
        titles = [axis["title"]["text"] for name, axis in axes.items() if "axis" in name]
        assert len(titles) >= 3
        assert all(title.endswith("]") and "[" in title for title in titles)


def test_the_scene_has_equal_scales_and_shows_the_worst_point(comparison: Comparison) -> None:
    deviation = comparison.runs[1]
    spec = paths.path_figure(deviation).spec
    assert spec["layout"]["scene"]["aspectmode"] == "data"
    (worst,) = [trace for trace in spec["data"] if trace["name"] == "worst"]
    place = [numbers(worst[axis])[0] for axis in "xyz"]
    # drawn in single precision: 24 bits of mantissa of a coordinate below 2 m
    np.testing.assert_allclose(place, deviation.actual[deviation.worst], rtol=0, atol=2**-23)
    (actual,) = [trace for trace in spec["data"] if trace["name"] == "actual"]
    assert numbers(actual["customdata"])[:, 1].max() == deviation.statistics["norm"].max * 1e3


def test_panels_do_not_overlap_and_fill_the_height() -> None:
    t = np.arange(3.0)
    panels = [Panel("a [m]", [line(t, t, "a", "#000000", "m")], share=share) for share in (2.0, 1.0, 1.0)]
    layout = stacked(panels, 2.0)["layout"]
    domains = [layout[f"yaxis{number}"]["domain"] for number in ("", "2", "3")]
    assert domains[0][1] == 1.0
    assert domains[2][0] == pytest.approx(0.0, abs=1e-3)  # rounded to four digits
    assert domains[0][0] > domains[1][1] > domains[1][0] > domains[2][1]
    assert layout["xaxis"]["range"] == [0.0, 2.0]
