"""Figures of a presentation become what plotly.js understands, and hold the data with every peak and mark."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.presentation.figure import (
    Drawing,
    Figure,
    Line,
    Mark,
    Over,
    Panel,
    SpaceFigure,
    Text,
    View,
)
from urmpipe_pipeline.presentation.layout import BAND_SHARE
from urmpipe_pipeline.presentation.scene import Arrows, Path, Sheets, Spot
from urmpipe_pipeline.presentation.section import Block, Fact, Presentation, Section
from urmpipe_pipeline.report import spec
from urmpipe_pipeline.report.figures import Multiples, drawn_figures, time_span
from urmpipe_pipeline.report.page import Page, lay_out
from urmpipe_pipeline.report.render import data_address
from urmpipe_pipeline.report.space import drawn_space
from urmpipe_pipeline.results import present
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.simulations.simulation import Simulation

RED, BLUE = "#c25000", "#21c3ff"
COUNT = 3000  # more than a drawn line has points
T_NS: IntArray = np.arange(COUNT, dtype=np.int64) * 5_000_000
T = T_NS / 1e9
WAVE: FloatArray = 0.004 * np.sin(T)


def numbers(array: dict[str, Any]) -> FloatArray:
    """The array that plotly.js reads from a typed one."""
    values = np.frombuffer(base64.b64decode(array["bdata"]), f"<{array['dtype']}").astype(np.float64)
    return values.reshape([int(n) for n in array["shape"].split(",")]) if "shape" in array else values


def panel(values: FloatArray, title: str = "Δx", unit: str = "m", **more: Any) -> Panel:
    columns = 1 if values.ndim == 1 else values.shape[1]
    names = (title,) if columns == 1 else tuple("xyz"[:columns])
    return Panel(title, unit, (Line(values, names, (RED, BLUE, RED)[:columns]),), **({"t_ns": T_NS} | more))


def figure(*panels: Panel, **more: Any) -> Figure:
    return Figure("Title", "Caption.", "Alt.", (View("view", panels),), **more)


def whole(one: Figure) -> list[spec.Figure]:
    """The figures of a figure none of whose panels becomes small multiples."""
    found = list(drawn_figures(one, time_span([one])))
    assert not [each for each in found if isinstance(each, Multiples)]
    return [each for each in found if isinstance(each, spec.Figure)]


def drawn(one: Figure) -> spec.Figure:
    (found,) = whole(one)
    go.Figure(found.spec)  # raises on an unknown word or a wrong value
    return found


def trace(found: spec.Figure, name: str) -> dict[str, Any]:
    """The one trace of a figure that is called so."""
    (one,) = [one for one in found.spec["data"] if one.get("name") == name]
    return dict(one)


def shapes(found: spec.Figure, axis: str) -> list[dict[str, Any]]:
    return [one for one in found.spec["layout"]["shapes"] if one.get("yref") == axis]


def levels(found: spec.Figure, axis: str = "y") -> list[float]:
    return [one["y0"] for one in shapes(found, axis) if one["type"] == "line"]


def page_of(*blocks: Block, sections: tuple[Section, ...] = (), **more: Any) -> Page:
    section = Section("toy", blocks=lambda: blocks, sections=sections, **more)
    return lay_out([Presentation("toy", "it is", None, (), section)])


def test_a_line_keeps_its_extremes_and_its_times() -> None:
    found = trace(drawn(figure(panel(WAVE, small=True))), "Δx")
    at = np.searchsorted(T, numbers(found["x"]))
    np.testing.assert_array_equal(T[at], numbers(found["x"]))
    # single precision: 24 bits of mantissa
    np.testing.assert_allclose(numbers(found["y"]), 1e3 * WAVE[at], rtol=2**-23, atol=0)
    assert len(at) <= 2000
    assert {int(np.argmax(WAVE)), int(np.argmin(WAVE))} <= set(at)
    assert found["hovertemplate"] == "%{y:.4f} mm"


def test_uneven_times_keep_more_points() -> None:
    t_ns = np.sort(np.concatenate([T_NS, 7_000_000_000 + np.arange(3000, dtype=np.int64)]))
    values = np.where((t_ns > 7e9) & (t_ns < 7e9 + 2000), 1.0, 0.0)
    found = trace(drawn(figure(panel(values, t_ns=t_ns, small=True))), "Δx")
    assert 2000 < len(numbers(found["y"])) <= 4000
    assert numbers(found["y"]).max() == 1e3


@pytest.mark.parametrize(
    ("unit", "small", "title", "factor"),
    [
        ("m", True, "Δx [mm]", 1e3), ("m", False, "Δx [m]", 1.0), ("rad", True, "Δx [deg]", 180 / np.pi),
        ("rad", False, "Δx [rad]", 1.0), ("m/s2", False, "Δx [m/s²]", 1.0), ("", False, "Δx [-]", 1.0),
    ],
)  # fmt: skip
def test_deviations_are_drawn_in_millimetres_and_degrees_and_places_in_si(
    unit: str, small: bool, title: str, factor: float
) -> None:
    found = drawn(figure(panel(WAVE, unit=unit, small=small)))
    assert found.spec["layout"]["yaxis"]["title"]["text"] == title
    most = numbers(trace(found, "Δx")["y"]).max()
    assert most == pytest.approx(factor * WAVE.max(), rel=2**-23)


def test_a_unit_that_people_prefer_is_taken_where_it_measures_the_same() -> None:
    for wanted, factor in (("deg", 180 / np.pi), ("mm", 1.0), ("nonsense", 1.0)):
        found = trace(drawn(figure(panel(WAVE, unit="rad", display_unit=wanted))), "Δx")
        assert numbers(found["y"]).max() == pytest.approx(factor * WAVE.max(), rel=2**-23)


def test_a_limit_is_a_band_and_what_is_out_of_it_is_tinted() -> None:
    signed, size = (
        panel(WAVE, small=True, limit=0.0035),
        panel(abs(WAVE), "‖Δ‖", small=True, limit=0.001, signed=False),
    )
    found = drawn(figure(signed, size))
    assert levels(found) == [3.5, -3.5]
    assert levels(found, "y2") == [1.0]
    bands = [
        (one["y0"], one["y1"]) for axis in ("y", "y2") for one in shapes(found, axis) if one["type"] == "rect"
    ]
    assert bands == [(-3.5, 3.5), (0.0, 1.0)]
    words = [one["label"]["text"] for axis in ("y", "y2") for one in shapes(found, axis) if "label" in one]
    assert words == ["±3.5 mm", "", "1 mm"]
    assert found.spec["layout"]["yaxis2"]["rangemode"] == "tozero"
    for axis, limit in (("y domain", 0.0035), ("y2 domain", 0.001)):
        spans = [(one["x0"], one["x1"]) for one in shapes(found, axis)]
        outside = np.abs(WAVE) > limit
        tinted = np.any([(start <= T) & (end >= T) for start, end in spans], axis=0)
        assert tinted[outside].all()
        # What is tinted besides lies in a gap below a two-hundredth of the 15 s.
        assert np.abs(T[tinted][:, np.newaxis] - T[outside]).min(axis=1).max() < 15 / 400


@pytest.mark.parametrize(("limit", "side"), [(0.0001, "bottom"), (1.0, "top")])
def test_a_limit_is_told_on_the_side_of_its_line_that_has_room(limit: float, side: str) -> None:
    found = drawn(figure(panel(abs(WAVE), small=True, limit=limit, signed=False)))
    (told,) = [one["label"] for one in shapes(found, "y") if "label" in one]
    assert (told["text"], told["yanchor"]) == (f"{1e3 * limit:g} mm", side)


def test_what_was_asked_for_is_dashed_and_not_held_against_the_limit() -> None:
    lines = (Line(10 * WAVE, ("wanted",), (RED,), dashed=True), Line(WAVE, ("real",), (BLUE,)))
    found = drawn(figure(Panel("p", "m", lines, T_NS, limit=0.005, peaks=(314,))))
    assert trace(found, "wanted")["line"]["dash"] == "dash"
    assert trace(found, "real")["line"]["dash"] == "solid"
    assert shapes(found, "y domain") == []
    assert [one["name"] for one in found.spec["data"] if one["mode"] == "markers"] == ["largest real"]


def test_rows_are_tinted_and_colours_that_repeat_have_other_dashes() -> None:
    tinted = (T >= 2.0) & (T <= 3.0)
    lines = Line(np.column_stack([WAVE, WAVE]), ("a", "b"), (RED, RED), steps=True)
    found = drawn(figure(Panel("p", "m", (lines,), T_NS, tinted=tinted)))
    (shape,) = shapes(found, "y domain")
    assert (shape["x0"], shape["x1"]) == (2.0, 3.0)
    assert [(one["line"]["dash"], one["line"]["shape"]) for one in found.spec["data"]] == [
        ("solid", "hv"), ("dash", "hv"),
    ]  # fmt: skip


def test_yes_and_no_have_an_axis_of_their_own() -> None:
    line = Line((WAVE > 0.0).astype(float), ("out",), (RED,), steps=True)
    found = drawn(figure(Panel("out", "", (line,), T_NS)))
    assert found.spec["layout"]["yaxis"]["tickvals"] == [0, 1]
    assert "tickvals" not in drawn(figure(panel(WAVE))).spec["layout"]["yaxis"]


def test_peaks_marks_and_instants_are_where_they_are() -> None:
    peak = int(np.argmax(WAVE))
    marked = (
        Mark(2_000_000_000, 0.001, "up", RED, "turn <added>", "Δx"),
        Mark(3_000_000_000, 0.002, "down", RED, "turn taken", "Δx"),
        Mark(4_000_000_000, 0.0, "cross", BLUE, "doubt"),
    )
    at = {int(T_NS[peak]): "decides at 1.570 s"}
    found = drawn(figure(panel(WAVE, small=True, peaks=(peak,), marks=marked), instants=at))
    largest = trace(found, "largest Δx")
    assert (numbers(largest["x"])[0], numbers(largest["y"])[0]) == (T[peak], 1e3 * WAVE[peak])
    turns, doubt = (one for one in found.spec["data"] if "text" in one)
    assert turns["marker"]["symbol"] == ["triangle-up", "triangle-down"]
    np.testing.assert_array_equal(numbers(turns["x"]), [2.0, 3.0])
    np.testing.assert_array_equal(numbers(turns["y"]), [1.0, 2.0])
    assert (turns["text"][0], doubt["marker"]["symbol"]) == ("turn &lt;added&gt;", ["x"])
    (line,) = [one for one in found.spec["layout"]["shapes"] if one["yref"] == "paper"]
    assert (line["x0"], line["label"]["text"]) == (T[peak], "decides at 1.570 s")


def test_very_many_marks_are_counted() -> None:
    marked = tuple(Mark(k, 0.0, "up", RED, "turn") for k in range(1200))
    found = drawn(figure(panel(WAVE, marks=marked)))
    assert len(trace(found, ", marked")["text"]) == 1000
    assert found.caption == "Caption. The first 1000 of 1200 marks are drawn."


def test_a_name_of_several_panels_is_one_entry_of_the_legend() -> None:
    both = np.column_stack([WAVE, -WAVE])
    panels = (panel(both, "p"), panel(both, "v", "m/s"), panel(WAVE, "‖v‖", "m/s"))
    found = drawn(figure(*panels))
    entries = [(one["name"], one["yaxis"]) for one in found.spec["data"] if one["showlegend"]]
    assert entries == [("x", "y"), ("y", "y")]
    groups = [one.get("legendgroup") for one in found.spec["data"]]
    assert groups == ["x", "y", "x", "y", None]
    assert found.spec["data"][2]["hovertemplate"] == "%{y:.4f} m/s<extra>v x</extra>"
    through = drawn(figure(*panels, instants={0: "start"}))
    above = (through.spec["layout"]["legend"]["y"] - 1.0) * (through.height - 64)  # px
    assert above >= 7  # the words at the head of the line are 11 px high and half of them stand above it


def test_lines_may_have_times_of_their_own() -> None:
    lines = (Line(WAVE, ("a",), (RED,), t_ns=T_NS), Line(WAVE[:100], ("b",), (BLUE,), t_ns=2 * T_NS[:100]))
    found = drawn(figure(Panel("Δ", "m", lines, limit=0.0001)))
    assert numbers(trace(found, "b")["x"])[-1] == 2 * T[99]
    assert found.spec["layout"]["xaxis"]["range"] == [0.0, T[-1]]
    assert shapes(found, "y domain")


def test_a_logarithmic_axis_reaches_the_limit() -> None:
    both = np.column_stack([1e-6 * np.ones(COUNT), 0.01 * np.ones(COUNT)])
    found = drawn(figure(panel(both, small=True, limit=2.0, signed=False, logarithmic=True)))
    axis = found.spec["layout"]["yaxis"]
    assert axis["type"] == "log"
    assert levels(found) == [2000.0]
    assert axis["range"][0] < np.log10(1e-3)
    assert axis["range"][1] > np.log10(2000.0)
    assert [one["type"] for one in found.spec["layout"]["shapes"]] == ["line"]


def test_a_quantity_as_axis_has_points_and_the_largest_is_among_them() -> None:
    speed = np.abs(np.cos(T))
    speed[5] = np.nan
    over = Over(speed, "‖v‖", "m/s")
    found = drawn(figure(panel(abs(WAVE), "‖Δ‖", small=True, signed=False, over=over, peaks=(1234,))))
    (cloud,) = found.spec["data"]
    at = np.searchsorted(T, numbers(cloud["customdata"]))
    assert 1234 in at
    assert 5 not in at
    assert len(at) in (1500, 1501)
    np.testing.assert_allclose(numbers(cloud["x"]), speed[at], rtol=2**-24)
    np.testing.assert_allclose(numbers(cloud["y"]), 1e3 * np.abs(WAVE[at]), rtol=2**-23)
    assert found.over == "‖v‖"
    assert found.spec["layout"]["xaxis"]["title"]["text"] == "‖v‖ [m/s]"
    assert found.spec["layout"]["xaxis"]["rangemode"] == "tozero"


def test_rows_without_times_are_points_that_nothing_joins() -> None:
    found = drawn(figure(panel(WAVE[:5], t_ns=None), instants={3: "here"}))
    (points,) = found.spec["data"]
    assert points["mode"] == "markers"
    np.testing.assert_array_equal(numbers(points["x"]), np.arange(1.0, 6.0))
    assert found.spec["layout"]["xaxis"]["title"]["text"] == "row"
    assert found.over == "row"
    assert found.spec["layout"]["shapes"][0]["x0"] == 4


def test_panels_of_other_axes_become_figures_of_their_own() -> None:
    both = figure(panel(WAVE), panel(WAVE, over=Over(T, "‖v‖", "m/s")))
    first, second = whole(both)
    assert (first.title, first.over) == ("Title", "t")
    assert (second.title, second.over) == ("Title over ‖v‖", "‖v‖")


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_rows_or_none_are_drawn(count: int) -> None:
    values = np.full((count, 2), np.nan)
    some: dict[str, Any] = {"t_ns": T_NS[:count], "limit": 1.0, "small": True}
    for one in (panel(values, **some), panel(values, logarithmic=True, **some), panel(values, t_ns=None)):
        np.testing.assert_array_equal(numbers(trace(drawn(figure(one)), "x")["y"]), values[:, 0])
    without_place = drawn(figure(panel(values, over=Over(np.full(count, np.nan), "v", "m/s"))))
    assert not len(numbers(trace(without_place, "x")["y"]))
    path = Path("a", np.full((count, 3), np.nan), T_NS[:count], RED)
    found = drawn_space(SpaceFigure("S", "C.", "A.", (path,)))
    np.testing.assert_array_equal(numbers(trace(found, "a")["x"]), values[:, 0])


def test_figures_of_a_part_have_one_axis_of_time() -> None:
    late = panel(WAVE, t_ns=T_NS + 10**9)
    page = page_of(figure(late), figure(panel(WAVE[:10], t_ns=T_NS[:10])))
    ranges = [found.spec["layout"]["xaxis"]["range"] for _, found in page.figures]
    assert ranges == [[0.0, T[-1] + 1.0]] * 2


def test_parts_with_the_same_times_move_together() -> None:
    same, other = (
        Section(title, blocks=lambda t_ns=t_ns: [figure(panel(WAVE, t_ns=t_ns))])  # type: ignore[misc]
        for title, t_ns in (("same", T_NS), ("other", T_NS.copy()))
    )
    (part,) = page_of(figure(panel(WAVE)), sections=(same, other)).parts
    assert [part.link, *(one.link for one in part.parts)] == ["r1", "r1", "r1-2"]


def test_small_figures_stand_side_by_side_and_others_do_not() -> None:
    small, tall = figure(panel(WAVE)), figure(*[panel(WAVE)] * 4)
    assert page_of(small, small, facts=(Fact("a", "b"),)).parts[0].pairs
    assert not page_of(small, tall).parts[0].pairs
    assert not page_of().parts[0].pairs


PLACES = np.column_stack([np.cos(T), np.sin(T), 0.9 * T / T[-1]])


def test_paths_keep_their_places_and_colours_tell_their_values() -> None:
    asked = Path("reference", PLACES, T_NS, RED, asked=True)
    actual = Path("actual", PLACES, T_NS, RED, values=np.abs(WAVE), kept=(1234,))
    spots = (Spot((1.0, 0.0, 0.0), "start", RED, False), Spot((0.0, 1.0, 0.0), "end", RED, False),
             Spot((0.5, 0.5, 0.5), "decides", BLUE))  # fmt: skip
    found = drawn_space(SpaceFigure("Path", "Caption.", "Alt.", (asked, actual), spots))
    go.Figure(found.spec)
    assert found.space
    assert found.spec["layout"]["scene"]["aspectmode"] == "data"
    one = trace(found, "actual")
    told = numbers(one["customdata"])
    assert told[:, 1].max() == 1e3 * np.abs(WAVE).max()
    assert T[1234] in told[:, 0]
    assert one["line"]["colorbar"]["title"]["text"] == "actual [mm]"
    at = np.searchsorted(T, told[:, 0])
    for axis, values in zip("xyz", PLACES.T, strict=True):
        # single precision: 24 bits of mantissa
        np.testing.assert_allclose(numbers(one[axis]), values[at], rtol=2**-23, atol=2**-40)
    symbols = [trace(found, spot.words)["marker"]["symbol"] for spot in spots]
    assert symbols == ["circle", "square", "diamond"]
    assert [numbers(trace(found, "decides")[axis])[0] for axis in "xyz"] == [0.5] * 3


def test_a_path_is_broken_where_rows_are_missing() -> None:
    sample = np.concatenate([np.arange(5), np.arange(50, 55)])
    one = Path("a", PLACES[:10], T_NS[:10], RED, sample=sample)
    x = numbers(trace(drawn_space(SpaceFigure("S", "C.", "A.", (one,))), "a")["x"])
    assert np.flatnonzero(np.isnan(x)).tolist() == [5]
    np.testing.assert_allclose(np.delete(x, 5), PLACES[:10, 0], rtol=2**-23)


def test_a_slim_path_stands_in_a_box_of_equal_sides() -> None:
    slim = PLACES * [1.0, 0.01, 0.01]
    found = drawn_space(SpaceFigure("S", "C.", "A.", (Path("a", slim, T_NS, RED),)))
    scene = found.spec["layout"]["scene"]
    assert scene["aspectmode"] == "cube"
    ranges = np.array([scene[f"{axis}axis"]["range"] for axis in "xyz"])
    np.testing.assert_allclose(np.ptp(ranges, axis=1), 1.05 * np.ptp(slim, axis=0).max(), rtol=1e-9)
    assert (ranges[:, 0] < slim.min(axis=0)).all()
    assert (ranges[:, 1] > slim.max(axis=0)).all()


def test_drawings_are_images_and_texts_stay_texts() -> None:
    blocks = Drawing("System", "Blocks.", "<svg/>"), Text("File", "a <b>")
    (part,) = page_of(*blocks).parts
    assert part.blocks == blocks
    assert base64.b64decode(data_address("<svg/>").removeprefix("data:image/svg+xml;base64,")) == b"<svg/>"


@pytest.mark.slow
def test_plotly_accepts_every_figure_of_every_kind(
    comparison: Comparison, hostile: Comparison, bare_run: Run, make_simulation: Any
) -> None:
    simulation: Simulation = make_simulation()
    results = [comparison, hostile, bare_run, comparison.runs[0].run, simulation]
    found = lay_out([present(one) for one in results]).figures
    assert len(found) > 30
    for _, one in found:
        go.Figure(one.spec)  # raises on an unknown word or a wrong value
        layout = one.spec["layout"]
        axes = layout.get("scene", layout)
        titles = [axis["title"]["text"] for name, axis in axes.items() if "axis" in name]
        assert len(titles) >= 2
        assert all(title.endswith("]") and "[" in title for title in titles)


def test_arrows_are_told_by_their_rows_of_the_log() -> None:
    sizes, rows = np.array([0.001, 0.003]), np.array([4, 17])
    arrows = Arrows("deviation x50", np.zeros((2, 3)), np.ones((2, 3)), sizes, rows)
    found = drawn_space(SpaceFigure("S", "C.", "A.", (), (), arrows))
    told = [numbers(one["customdata"]) for one in found.spec["data"] if "customdata" in one]
    np.testing.assert_array_equal(told, [np.column_stack((rows + 1, 1e3 * sizes))])


def test_sheets_are_rectangles_of_two_triangles_with_an_outline() -> None:
    corners = np.array(
        [[[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], [[0, 0, 0], [0, 3, 0], [0, 3, 1], [0, 0, 1]]]
    )
    found = drawn_space(SpaceFigure("S", "C.", "A.", (), sheets=Sheets("planes", corners.astype(float), RED)))
    go.Figure(found.spec)
    faces, edges = found.spec["data"]
    points = np.column_stack([numbers(faces[axis]) for axis in "xyz"])
    np.testing.assert_array_equal(points, corners.reshape(-1, 3))
    triangles = points[np.column_stack([faces[name] for name in "ijk"])]
    sides = np.diff(triangles, axis=1)
    areas = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    assert sorted(areas.tolist()) == [1.0, 1.0, 1.5, 1.5]
    assert 0.0 < faces["opacity"] < 0.5
    outline = np.column_stack([numbers(edges[axis]) for axis in "xyz"]).reshape(2, 6, 3)
    np.testing.assert_array_equal(outline[:, :4], corners)
    np.testing.assert_array_equal(outline[:, 4], corners[:, 0])
    assert np.isnan(outline[:, 5]).all()
    assert (edges.get("showlegend", True), faces["showlegend"]) == (True, False)
    assert edges["legendgroup"] == faces["legendgroup"]  # one entry of the legend switches both


def test_places_on_a_line_are_larger_than_poses_that_nothing_joins() -> None:
    """They have to be seen on it."""
    some = Path("stops", PLACES[:4], None, BLUE, line=False)
    alone = trace(drawn_space(SpaceFigure("S", "C.", "A.", (some,))), "stops")
    both = drawn_space(SpaceFigure("S", "C.", "A.", (Path("way", PLACES, T_NS, RED), some)))
    assert trace(both, "stops")["marker"]["size"] >= trace(both, "way")["line"]["width"]
    assert alone["marker"]["size"] < trace(both, "stops")["marker"]["size"]


def test_parts_of_a_sum_are_stacked_on_both_sides_of_0() -> None:
    parts = np.column_stack((np.sin(T), 1.5 + np.cos(3.0 * T), np.sin(2.0 * T)))
    total = parts.sum(axis=1)
    lines = (
        Line(parts, ("a", "b", "c"), (RED, BLUE, RED), stacked=True),
        Line(total, ("sum",), (BLUE,)),
    )
    made = drawn(figure(Panel("τ", "N.m", lines, T_NS)))
    *areas, line = made.spec["data"]
    sides = [(one["name"], one["stackgroup"], one["showlegend"]) for one in areas]
    assert sides == [
        ("a", "up 0", True), ("a", "down 0", False), ("b", "up 0", True), ("c", "up 0", True),
        ("c", "down 0", False),
    ]  # fmt: skip
    kept = numbers(areas[0]["x"])
    rows = np.rint(kept / 0.005).astype(np.int64)
    assert len(kept) < COUNT
    for one in areas:  # plotly.js stacks what stands at the same time
        np.testing.assert_array_equal(numbers(one["x"]), kept)
    stack = sum(numbers(one["y"]) for one in areas)
    np.testing.assert_allclose(stack, total[rows], rtol=0, atol=1e-6)  # single precision
    told = numbers(areas[0]["customdata"])
    np.testing.assert_allclose(told, parts[rows, 0], rtol=0, atol=1e-7)
    assert all(numbers(one["y"]).min() >= 0.0 for one in areas if one["stackgroup"] == "up 0")
    assert all(numbers(one["y"]).max() <= 0.0 for one in areas if one["stackgroup"] == "down 0")
    assert line["name"] == "sum"
    assert made.spec["layout"]["hoversubplots"] == "overlaying"  # the pointer tells one sum
    go.Figure(made.spec)


def test_a_line_over_a_quantity_is_parted_dashed_and_pointed() -> None:
    quantity = np.append(np.linspace(0.0, 1.0, 150), np.nan)
    quantity = np.concatenate((quantity, quantity))  # twice there and a gap: two runs of one line
    many, few = np.tile(np.append(np.sin(quantity[:150]), 0.0), 2), np.full(len(quantity), np.nan)
    few[[0, 149]] = 0.5
    lines = (
        Line(many, ("runs",), (RED,)),
        Line(few, ("allowed",), (BLUE,), dashed=True),
        Line(few, ("few",), (BLUE,)),
    )
    over = Over(quantity, "s", "m", joined=True)
    made = drawn(figure(Panel("v", "m/s", lines, over=over), instants={10: "corner"}))
    assert {one["name"]: (one["mode"], one["line"]["dash"]) for one in made.spec["data"]} == {
        "runs": ("lines", "solid"), "allowed": ("lines", "dash"), "few": ("lines+markers", "solid"),
    }  # fmt: skip
    x = numbers(trace(made, "runs")["x"])
    assert np.flatnonzero(np.isnan(x)).tolist() == [150, 301]
    assert made.spec["layout"]["legend"]["y"] > 1.0  # above the word of the corner


def test_a_tolerance_that_would_vanish_has_a_scale_of_its_own() -> None:
    """The pointer tells the value, not the height; the band takes its share of the axis."""
    values = np.array([0.0, 0.807, -0.2, 0.001, 0.0035])
    found = drawn(figure(panel(values, "Δx", "m", limit=0.0035, small=True, peaks=(1,), t_ns=T_NS[:5])))
    (line, peak) = found.spec["data"]
    np.testing.assert_allclose(
        numbers(line["customdata"]), 1e3 * values, rtol=1e-6
    )  # in mm, single precision
    assert line["hovertemplate"].startswith("%{customdata:")
    heights = numbers(line["y"])
    assert heights[1] == 1.0
    assert heights[4] == pytest.approx(BAND_SHARE)
    assert numbers(peak["y"])[0] == 1.0
    axis = found.spec["layout"]["yaxis"]
    assert axis["ticktext"] == ["−500", "−3.5", "0", "3.5", "500"]
    (band,) = [one for one in found.spec["layout"]["shapes"] if one.get("fillcolor") == spec.BAND]
    assert (band["y0"], band["y1"]) == (-BAND_SHARE, BAND_SHARE)
    assert found.caption.endswith("a larger one within the tolerance, a smaller one beyond it.")


def test_many_answers_with_their_set_points_are_small_multiples() -> None:
    grey = tuple(Line(WAVE, (f"set {k}",), ("#8f9ba0",), dashed=True) for k in range(3))
    answers = Line(np.column_stack([WAVE] * 3), ("q1", "q2", "q3"), (RED, BLUE, RED))
    one = figure(Panel("theta", "rad", (*grey, answers), T_NS))
    (found,) = drawn_figures(one, time_span([one]))
    assert isinstance(found, Multiples)
    assert [small.title for small in found.figures] == ["q1", "q2", "q3"]
    for k, small in enumerate(found.figures):
        assert [trace["name"] for trace in small.spec["data"]] == [f"set {k}", f"q{k + 1}"]
        assert [trace["line"]["dash"] for trace in small.spec["data"]] == ["dash", "solid"]
        assert small.alt == f"q{k + 1} and its set point set {k}, dashed, over time."
