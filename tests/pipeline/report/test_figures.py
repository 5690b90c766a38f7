"""The figures are what plotly.js understands, and hold the data of the results."""

from __future__ import annotations

import base64
from dataclasses import replace
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest

from urmpipe_models.arrays import FloatArray
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.palette import AXIS_COLOURS, JOINT_COLOURS, run_colour
from urmpipe_pipeline.report import gallery
from urmpipe_pipeline.report.figures_deviation import deviation_figure, pose_figure, speed_figure
from urmpipe_pipeline.report.figures_motion import motion_figure
from urmpipe_pipeline.report.figures_overview import overview_figure
from urmpipe_pipeline.report.figures_repolarization import joints_figure, point_figure
from urmpipe_pipeline.report.paths import path_figure, repolarized_path_figure
from urmpipe_pipeline.report.spec import Figure
from urmpipe_pipeline.runs.playback import play_back
from urmpipe_pipeline.runs.results import Run


def numbers(spec: dict[str, Any]) -> FloatArray:
    """The array that plotly.js reads from a typed one."""
    values = np.frombuffer(base64.b64decode(spec["bdata"]), f"<{spec['dtype']}").astype(np.float64)
    return values.reshape([int(n) for n in spec["shape"].split(",")]) if "shape" in spec else values


def all_figures(comparison: Comparison) -> list[Figure]:
    found = gallery.comparison_figures(comparison)
    for deviation in comparison.runs:
        found += gallery.deviation_figures(deviation) + gallery.run_figures(deviation.run)
    return found


def trace(figure: Figure, name: str) -> dict[str, Any]:
    """The one trace of a figure that is called so."""
    (found,) = [one for one in figure.spec["data"] if one.get("name") == name]
    return dict(found)


def by_title(found: list[Figure], start: str) -> Figure:
    """The one figure whose title starts so."""
    (figure,) = [figure for figure in found if figure.title.startswith(start)]
    return figure


def assert_drawn(spec: dict[str, Any], t: FloatArray, values: FloatArray) -> None:
    """Assert that a line holds samples of some values at their own times, the extremes among them."""
    at, drawn = numbers(spec["x"]), numbers(spec["y"])
    places = np.searchsorted(t, at)
    np.testing.assert_array_equal(t[places], at)
    exact = values[places]
    # single precision at most: 24 bits of mantissa
    np.testing.assert_allclose(drawn, exact, rtol=2**-24, atol=0)
    assert np.nanmax(exact) == np.nanmax(values)
    assert np.nanmin(exact) == np.nanmin(values)


TITLES = [
    "Deviation and speed over time",
    "Path in space",
    "Deviation of orientation and joints",
    "Deviation over speed",
    "Motion of the tool centre point",
    "Joints before and after repolarization",
    "Tool centre point before and after repolarization",
    "Path in space before and after repolarization",
]


def test_the_gallery_of_each_kind_of_log(comparison: Comparison, bare_run: Run) -> None:
    assert [one.title for one in gallery.comparison_figures(comparison)] == ["Deviation of all logs"]
    single = replace(comparison, runs=comparison.runs[:1])
    assert gallery.comparison_figures(single) == []
    deviation = comparison.runs[0]
    assert [one.title for one in gallery.deviation_figures(deviation)] == TITLES
    assert [one.title for one in gallery.run_figures(deviation.run)] == [*TITLES[5:], TITLES[4], TITLES[1]]
    assert [one.title for one in gallery.run_figures(bare_run)] == ["Joints before and after repolarization"]
    calm = replace(bare_run, audit=())
    (joints,) = gallery.run_figures(calm)
    assert joints.title == "Joints"
    assert joints.caption == "No joint had to be repolarized: they are as in the file."
    assert_drawn(trace(joints, "phi1"), calm.t, calm.q[:, 0])


def test_plotly_accepts_every_figure(comparison: Comparison, hostile: Comparison, bare_run: Run) -> None:
    found = [*all_figures(comparison), *all_figures(hostile), *gallery.run_figures(bare_run)]
    # both logs together, each as compared and as ingested; a log without a jump; joints alone
    assert len(found) == 1 + 2 * (8 + 5) + 6 + 3 + 1
    for figure in found:
        go.Figure(figure.spec)  # raises on an unknown word or a wrong value


def test_the_drawn_deviation_is_that_of_the_tables_with_its_tolerance(comparison: Comparison) -> None:
    deviation = comparison.runs[1]
    figure = deviation_figure(deviation)
    names = (("Δx", "x"), ("Δy", "y"), ("Δz", "z"), ("‖Δ‖", "norm"), ("path", "path"))
    for (name, quantity), values in zip(names, [*deviation.delta.T, deviation.path], strict=True):
        drawn = trace(figure, name)
        assert_drawn(drawn, deviation.t, values * 1e3)
        statistics = deviation.statistics[quantity]
        said = f"{np.abs(numbers(drawn['y'])).max():.4f}"
        assert drawn["hovertemplate"] == "%{y:.4f} mm"
        assert said == text.millimetres(statistics.max)
        assert f"{name} {said} mm at {text.seconds(statistics.t_max)} s" in figure.alt
        assert len(numbers(drawn["y"])) < len(deviation.t)
    assert_drawn(trace(figure, "speed"), deviation.t, deviation.speed)
    shapes = figure.spec["layout"]["shapes"]
    levels = sorted(shape["y0"] for shape in shapes if shape["type"] == "line" and shape["yref"] == "y")
    assert levels == [-3.5, 3.5]
    assert f"Out of tolerance: {text.percent(deviation.share_out)} of the samples." in figure.alt


@pytest.fixture(scope="module")
def strict(comparison: Comparison) -> Deviation:
    """The log whose joint is 1 deg off, held against a tolerance of each kind."""
    first, second = (deviation.run for deviation in comparison.runs)
    given = CompareOptions(tolerance={"x": 0.004, "norm": 0.009, "angle": 0.015, "joint": 0.01})
    (found,) = compare_runs(first, [second], given).runs
    return found


def test_where_a_quantity_is_out_of_tolerance_is_tinted(strict: Deviation) -> None:
    shapes = deviation_figure(strict).spec["layout"]["shapes"]
    for axis, values, tolerance in (
        ("y domain", np.abs(strict.delta[:, 0]), 0.004),
        ("y4 domain", strict.delta[:, 3], 0.009),
    ):
        spans = [(shape["x0"], shape["x1"]) for shape in shapes if shape["yref"] == axis]
        assert spans
        outside = values > tolerance
        tinted = np.any([(strict.t >= start) & (strict.t <= end) for start, end in spans], axis=0)
        assert tinted[outside].all()
        # What is tinted besides lies in a gap below a two-hundredth of the 15 s.
        away = np.abs(strict.t[tinted][:, np.newaxis] - strict.t[outside]).min(axis=1)
        assert away.max() < 15 / 400
    assert not [shape for shape in shapes if shape["yref"] == "y2 domain"]


def test_angle_and_joints_are_drawn_in_degrees_with_their_tolerances(strict: Deviation) -> None:
    figure = pose_figure(strict)
    assert figure is not None
    assert strict.angle is not None
    assert strict.joint_delta is not None
    assert_drawn(trace(figure, "angle"), strict.t, np.degrees(strict.angle))
    colours = []
    for name, values in zip(strict.run.log.joints, strict.joint_delta.T, strict=True):
        drawn = trace(figure, name)
        at = np.searchsorted(strict.t, numbers(drawn["x"]))
        # factor and single precision: two roundings
        np.testing.assert_allclose(numbers(drawn["y"]), np.degrees(values)[at], rtol=1e-7, atol=1e-15)
        colours.append(drawn["line"]["color"])
    assert colours == list(JOINT_COLOURS[:6])
    assert numbers(trace(figure, "phi2")["y"]).min() == pytest.approx(-1.0, abs=1e-6)
    levels = {shape["y0"] for shape in figure.spec["layout"]["shapes"] if shape["type"] == "line"}
    assert levels == {np.degrees(0.015), np.degrees(0.01), -np.degrees(0.01)}
    assert f"phi2 {np.degrees(strict.joint_statistics['phi2'].max):.4f} deg" in figure.alt


def test_lengths_of_joints_stand_in_a_panel_of_their_own(strict: Deviation) -> None:
    slide = replace(strict.joint_statistics["phi6"], unit="m")
    mixed = replace(
        strict,
        joint_statistics=strict.joint_statistics | {"phi6": slide},
        statistics={name: one for name, one in strict.statistics.items() if name != "angle"},
        angle=None,
    )
    figure = pose_figure(mixed)
    assert figure is not None
    layout = figure.spec["layout"]
    titles = [layout[axis]["title"]["text"] for axis in ("yaxis", "yaxis2")]
    assert titles == ["Δ joints [mm]", "Δ joints [deg]"]
    assert trace(figure, "phi6")["yaxis"] == "y"
    assert figure.title == "Deviation of joints"
    assert pose_figure(replace(mixed, joint_statistics={}, joint_delta=None)) is None


def test_each_point_over_speed_is_a_sample_and_the_worst_is_there(comparison: Comparison) -> None:
    deviation = comparison.runs[1]
    figure = speed_figure(deviation)
    assert figure is not None
    (cloud,) = figure.spec["data"]
    at = np.searchsorted(deviation.t, numbers(cloud["customdata"]))
    assert deviation.worst in at
    assert len(at) in (1500, 1501)
    np.testing.assert_allclose(numbers(cloud["x"]), deviation.speed[at], rtol=2**-24)
    np.testing.assert_allclose(numbers(cloud["y"]), deviation.delta[at, 3] * 1e3, rtol=2**-24)
    assert {one.over for one in gallery.deviation_figures(deviation)} == {"t", "v"}
    assert figure.over == "v"
    silent = replace(deviation, speed=np.full(len(deviation.t), np.nan))
    assert speed_figure(silent) is None


@pytest.mark.parametrize(
    ("r", "said"),
    [
        (0.95, "r = +0.950: the deviation grows strongly with the speed, as a lag in time makes it grow."),
        (-0.5, "r = -0.500: the deviation shrinks moderately with the speed."),
        (0.25, "r = +0.250: the deviation grows weakly with the speed, as a lag in time makes it grow."),
        (0.1, "r = +0.100: the deviation does not go with the speed."),
        (None, "The norm or the speed does not change, so nothing can be said of how they go together."),
    ],
)
def test_the_correlation_is_said_in_words(comparison: Comparison, r: float | None, said: str) -> None:
    figure = speed_figure(replace(comparison.runs[0], speed_correlation=r))
    assert figure is not None
    assert said in figure.caption
    assert said in figure.alt


def test_the_motion_is_the_run_s(comparison: Comparison) -> None:
    run = comparison.runs[0].run
    figure = motion_figure(run)
    assert figure is not None
    assert run.tcp is not None
    for symbol, values in (("p", run.tcp.position), ("v", run.tcp.velocity), ("a", run.tcp.acceleration)):
        for i, axis in enumerate("xyz"):
            drawn = trace(figure, f"{symbol}{axis}")
            assert_drawn(drawn, run.t, values[:, i])
            assert drawn["line"]["color"] == AXIS_COLOURS[axis]
    assert_drawn(trace(figure, "‖a‖"), run.t, np.linalg.norm(run.tcp.acceleration, axis=1))
    layout = figure.spec["layout"]
    titles = [layout[f"yaxis{k}"]["title"]["text"] for k in ("", "2", "3", "4")]
    assert titles == ["p7 [m]", "v [m/s]", "a [m/s²]", "rz, ry, rx [rad]"]
    fastest = np.linalg.norm(run.tcp.velocity, axis=1).max()
    assert f"its speed reaches {fastest:.4f} m/s" in figure.alt


def test_euler_angles_do_not_jump_and_are_open_where_they_are_not_defined(comparison: Comparison) -> None:
    run = comparison.runs[0].run
    tcp = run.tcp
    assert tcp is not None
    assert np.abs(np.diff(tcp.euler_zyx[:, 0])).max() > 6  # the angle itself jumps by a turn
    singular = np.zeros(len(run.t), dtype=np.bool_)
    singular[1000:1010] = True
    figure = motion_figure(replace(run, tcp=replace(tcp, singular=singular)))
    assert figure is not None
    for i, name in enumerate(("rz", "ry", "rx")):
        drawn = trace(figure, name)
        at, angle = np.searchsorted(run.t, numbers(drawn["x"])), numbers(drawn["y"])
        inside = (at >= 1000) & (at < 1010)
        assert inside.any()
        assert np.isnan(angle[inside]).all()
        assert np.nanmax(np.abs(np.diff(angle))) < 1.0
        # This motion stays away from ry = 90 deg, so that only whole turns are added.
        turns = (angle - tcp.euler_zyx[at, i])[~inside] / (2 * np.pi)
        np.testing.assert_allclose(turns, np.rint(turns), rtol=0, atol=1e-6)
    (tint,) = [shape for shape in figure.spec["layout"]["shapes"] if shape["yref"] == "y4 domain"]
    assert tint["x0"] <= run.t[1000]
    assert tint["x1"] >= run.t[1009]
    assert "10 samples with ry at ±π/2" in figure.caption


def test_without_a_robot_the_recorded_motion_is_drawn(comparison: Comparison, bare_run: Run) -> None:
    tcp = comparison.runs[0].run.tcp
    assert tcp is not None
    log = replace(bare_run.log, tcp_rotation=tcp.euler_zyx, rotation_form="zyx")
    recorded = replace(bare_run, log=log, tcp_recorded=tcp.position)
    figure = by_title(gallery.run_figures(recorded), "Motion")
    assert_drawn(trace(figure, "py"), bare_run.t, tcp.position[:, 1])
    layout = figure.spec["layout"]
    assert [layout[a]["title"]["text"] for a in ("yaxis", "yaxis2")] == ["p [m]", "orientation [rad]"]
    assert len(figure.spec["data"]) == 6


def test_before_repolarization_the_tool_swings_away_and_after_it_does_not(comparison: Comparison) -> None:
    run = comparison.runs[0].run
    played = play_back(run)
    assert played is not None
    figure = point_figure(run, played)
    assert figure is not None
    assert run.tcp is not None
    for i, axis in enumerate("xyz"):
        assert_drawn(trace(figure, f"p{axis} before"), played.t, played.position[:, i])
        assert_drawn(trace(figure, f"p{axis} after"), run.t, run.tcp.position[:, i])
    for symbol, before, after in (
        ("v", played.velocity, run.tcp.velocity),
        ("a", played.acceleration, run.tcp.acceleration),
    ):
        assert_drawn(trace(figure, f"‖{symbol}‖ before"), played.t, np.linalg.norm(before, axis=1))
        assert_drawn(trace(figure, f"‖{symbol}‖ after"), run.t, np.linalg.norm(after, axis=1))
    worst = played.worst
    assert worst is not None
    t = float(played.t[worst])
    (item,) = [entry for entry in run.repolarizations if abs(entry.t - t) < run.tsp]
    assert (
        f"Before repolarization p7 goes wrong by up to {played.off[worst] * 1e3:.4f} mm, at t ="
        f" {text.seconds(t)} s, where {item.joint} jumps (row {item.row});"
    ) in figure.caption
    scene = repolarized_path_figure(run, played)
    assert scene is not None
    for name, place in (
        ("start", run.tcp.position[0]),
        ("end", run.tcp.position[-1]),
        ("furthest off", played.position[worst]),
    ):
        spot = [numbers(trace(scene, name)[axis])[0] for axis in "xyz"]
        # drawn in single precision: 24 bits of mantissa of a coordinate below 2 m
        np.testing.assert_allclose(spot, place, rtol=0, atol=2**-23)


def test_all_logs_stand_in_one_figure_from_best_to_worst(comparison: Comparison) -> None:
    figure = overview_figure(comparison)
    assert figure is not None
    best, worst = comparison.ranking
    assert best.statistics["norm"].max < worst.statistics["norm"].max
    assert [one["name"] for one in figure.spec["data"]] == [f"1. {best.name}", f"2. {worst.name}"]
    for drawn, one in zip(figure.spec["data"], (best, worst), strict=True):
        assert_drawn(drawn, one.t, one.delta[:, 3] * 1e3)
        assert drawn["line"]["color"] == run_colour(comparison.runs.index(one))
        most = text.millimetres(one.statistics["norm"].max)
        assert f"{one.name}: at most {most} mm, {one.verdict}" in figure.alt
    assert "type" not in figure.spec["layout"]["yaxis"]
    far = replace(worst, statistics=worst.statistics | {"norm": replace(worst.statistics["norm"], max=9.0)})
    wide = overview_figure(replace(comparison, runs=(best, far)))
    assert wide is not None
    assert wide.spec["layout"]["yaxis"]["type"] == "log"


def test_every_repolarization_is_marked_where_it_is(comparison: Comparison) -> None:
    run = comparison.runs[0].run
    assert {item.joint for item in run.repolarizations} >= {"phi1", "phi4"}
    figure = joints_figure(run)
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
        assert len(titles) >= 2
        assert all(title.endswith("]") and "[" in title for title in titles)


def test_the_scene_has_equal_scales_and_shows_the_place_that_decides(comparison: Comparison) -> None:
    deviation = comparison.runs[1]
    spec = path_figure(deviation).spec
    assert spec["layout"]["scene"]["aspectmode"] == "data"
    (decides,) = [trace for trace in spec["data"] if trace["name"] == "decides"]
    place = [numbers(decides[axis])[0] for axis in "xyz"]
    # drawn in single precision: 24 bits of mantissa of a coordinate below 2 m
    np.testing.assert_allclose(place, deviation.place(deviation.decisive), rtol=0, atol=2**-23)
    (actual,) = [trace for trace in spec["data"] if trace["name"] == "actual"]
    assert numbers(actual["customdata"])[:, 1].max() == deviation.statistics["norm"].max * 1e3


@pytest.mark.parametrize(("allowed", "side"), [(0.0001, "bottom"), (1.0, "top")])
def test_a_tolerance_is_told_on_the_side_of_its_line_that_has_room(
    comparison: Comparison, allowed: float, side: str
) -> None:
    reference, run = comparison.runs[0].run, comparison.runs[1].run
    (deviation,) = compare_runs(reference, [run], CompareOptions({"angle": allowed})).runs
    figure = pose_figure(deviation)
    assert figure is not None
    told = [shape["label"] for shape in figure.spec["layout"]["shapes"] if shape.get("label", {}).get("text")]
    assert [(one["text"], one["yanchor"]) for one in told] == [
        (f"{text.limit(allowed, 'rad')} deg", side),
    ]


def test_what_stands_at_the_head_of_a_line_is_not_under_the_legend(comparison: Comparison) -> None:
    run = comparison.runs[0].run
    played = play_back(run)
    assert played is not None
    figure = point_figure(run, played)
    assert figure is not None
    above = (figure.spec["layout"]["legend"]["y"] - 1.0) * (figure.height - 64)  # px
    assert above >= 14  # a line of text of 11 px
