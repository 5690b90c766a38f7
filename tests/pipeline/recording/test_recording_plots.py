"""The plots of a recording: lines with names and colours, limits, marks, instants, overviews, and axes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from recorded import columns, entities, packed, rows_of, static, times_of, views
from toys import COLOURS, PLOT, STEP_NS, Toy, figure, line, panel, recorded, root_of, shown, toy
from urmpipe_pipeline.presentation.figure import Figure, Mark, Over, Panel, Shape, View
from urmpipe_pipeline.presentation.palette import NEUTRAL_COLOUR, REFERENCE_COLOUR
from urmpipe_pipeline.recording import writer
from urmpipe_pipeline.recording.views.axes import LOW, MARGIN, TALL, span_with_numbers
from urmpipe_pipeline.recording.views.plots import COPIED, LONG, ROWS, SHARED_AXIS

SCALARS, PACKED = "Scalars:scalars", "urmpipe:packed"


def plots(path: Path) -> set[str]:
    """Return the names of the plots of a recording."""
    return {name for name in views(path)["ViewBlueprint:display_name"] if name.endswith(("]", "rows"))}


def first_plot(one: Figure) -> Any:
    """Return the first plot of a layout of one figure and a short summary."""
    _, plots = root_of(shown(one)).contents
    return next(iter(plots.contents))


# --- lines -----------------------------------------------------------------------------------------


def test_an_array_of_the_result_is_plotted_itself_with_names_and_colours(tmp_path: Path) -> None:
    one = toy()
    path = recorded(shown(figure(panel(one))), tmp_path, one)
    assert static(path, "/values", "SeriesLines:names") == ["a", "b"]
    assert static(path, "/values", "SeriesLines:colors") == [packed(colour) for colour in COLOURS[:2]]
    # Where samples are closer than pixels, the mean would hide peaks.
    assert static(path, "/values", "SeriesLines:aggregation_policy") == [
        rr.components.AggregationPolicy.MinMax.value
    ]
    assert not entities(path, "/shown/plots")
    assert "/values" in views(path)["ViewContents:query"]


@pytest.mark.slow
def test_times_are_exact_and_rows_count_from_one_where_times_do_not_tell_them(tmp_path: Path) -> None:
    one = toy(rows=40_000)
    assert list(rows_of(recorded(shown(), tmp_path, one), "/values", SCALARS)) == one.t_ns.tolist()
    still = replace(one, t_ns=np.zeros_like(one.t_ns))
    path = recorded(shown(), tmp_path, still)
    assert list(rows_of(path, "/values", SCALARS, "row")) == list(range(1, 40_001))


def test_where_an_array_looks_different_in_two_plots_each_plot_says_how(tmp_path: Path) -> None:
    one = toy()
    other = replace(line(one.values), names=("c", "d"))
    path = recorded(shown(figure(panel(one)), figure(panel(one, other))), tmp_path, one)
    assert static(path, "/values", "SeriesLines:names") == ["a", "b"]
    assert views(path)["SeriesLines:names"] == ["c", "d"]


def test_deviations_are_plotted_with_all_their_rows_in_the_units_that_people_read(tmp_path: Path) -> None:
    for unit, factor in (("m", 1e3), ("rad", math.degrees(1.0))):
        one = toy(rows=COPIED + 500)
        path = recorded(shown(figure(panel(one, unit=unit, small=True))), tmp_path, one)
        found = np.array(columns(path, f"{PLOT}/0/0", SCALARS))
        np.testing.assert_allclose(found, factor * one.values, rtol=1e-15)  # a rounding of pi / 180
        assert plots(path) == {f"Values [{'mm' if unit == 'm' else 'deg'}]"}


def test_what_is_no_array_of_the_result_is_thinned_out(tmp_path: Path) -> None:
    one = toy(rows=4 * COPIED)
    path = recorded(shown(figure(panel(one, line(one.values[:, 0] ** 2)))), tmp_path, one)
    (few,) = np.array(columns(path, f"{PLOT}/0/0", SCALARS)).T
    assert len(few) <= COPIED
    assert (few.min(), few.max()) == ((one.values[:, 0] ** 2).min(), (one.values[:, 0] ** 2).max())


@pytest.mark.parametrize("rows", [1, 20])
def test_the_viewer_draws_no_line_through_one_row_or_between_rows_without_times(
    rows: int, tmp_path: Path
) -> None:
    one = toy(rows=rows)
    untimed = replace(panel(one), t_ns=None if rows > 1 else one.t_ns)
    path = recorded(shown(figure(untimed), opens_at_row=0 if rows > 1 else None), tmp_path, one)
    (entity,) = [name for name in ("/values", f"{PLOT}/0/0") if columns(path, name, "SeriesPoints:names")]
    assert static(path, entity, "SeriesPoints:names") == ["a", "b"]
    assert not columns(path, entity, "SeriesLines:names")
    if rows > 1:
        np.testing.assert_array_equal(list(rows_of(path, entity, SCALARS, "row")), np.arange(1, rows + 1))


def test_steps_are_drawn_as_steps(tmp_path: Path) -> None:
    one = toy()
    for steps, wanted in ((True, [[rr.components.InterpolationMode.StepAfter.value]]), (False, [])):
        path = recorded(shown(figure(panel(one, line(one.values, steps=steps)))), tmp_path, one)
        assert columns(path, "/values", "SeriesLines:interpolation_mode") == wanted


def test_lines_that_have_names_have_a_legend_and_a_single_one_has_none() -> None:
    one = toy()
    single = line(one.values[:, 0])
    other = replace(single, names=("b",))
    for lines, legend in (((single,), False), ((single, other), True), ((line(one.values),), True)):
        view = first_plot(figure(panel(one, *lines)))
        assert view.properties["PlotLegend"].visible.as_arrow_array().to_pylist() == [legend]


# --- limits, marks, instants -----------------------------------------------------------------------


def test_each_limit_is_drawn_once_with_both_signs_of_what_has_one(tmp_path: Path) -> None:
    one = toy()

    def held(limit: float, *, signed: bool, colour: str) -> Panel:
        lines = (replace(line(one.values[:, 0]), colours=(colour,)),)
        return panel(one, *lines, unit="m", limit=limit, signed=signed, small=True)

    axes = [held(0.0035, signed=True, colour=colour) for colour in COLOURS[:2]]
    path = recorded(shown(figure(*axes)), tmp_path, one)
    assert columns(path, f"{PLOT}/limits/0", SCALARS) == [[3.5, -3.5]] * 2
    assert times_of(path, f"{PLOT}/limits/0") == [one.t_ns[0], one.t_ns[-1]]
    assert static(path, f"{PLOT}/limits/0", "SeriesLines:colors") == [packed(REFERENCE_COLOUR)] * 2
    assert entities(path, f"{PLOT}/limits") == {f"{PLOT}/limits/0"}
    norm = held(0.005, signed=False, colour=COLOURS[3])
    path = recorded(shown(figure(*axes, norm)), tmp_path, one)
    assert columns(path, f"{PLOT}/limits/1", SCALARS) == [[5.0]] * 2
    assert static(path, f"{PLOT}/limits/1", "SeriesLines:colors") == [packed(COLOURS[3])]


def test_marks_stand_at_their_times_on_their_lines(tmp_path: Path) -> None:
    one = toy()
    shapes: tuple[Shape, ...] = ("up", "down", "cross", "diamond")
    marks = [
        Mark(
            number * STEP_NS + 7, 0.1 * number, shapes[number % 4], COLOURS[number % 2], "", "ab"[number % 2]
        )
        for number in reversed(range(8))
    ]
    path = recorded(shown(figure(panel(one, marks=tuple(marks)))), tmp_path, one)
    for number, shape in enumerate(shapes):
        entity = f"{PLOT}/0/marks/{shape}"
        assert times_of(path, entity) == [number * STEP_NS + 7, (number + 4) * STEP_NS + 7]
        column = static(path, entity, "SeriesPoints:names").index("ab"[number % 2])
        values = np.array(columns(path, entity, SCALARS))
        np.testing.assert_array_equal(values[:, column], [0.1 * number, 0.1 * (number + 4)])
        assert np.isnan(values[:, 1 - column]).all()
        assert static(path, entity, "SeriesPoints:colors")[column] == packed(COLOURS[number % 2])
        kinds = static(path, entity, "SeriesPoints:markers")
        assert kinds == [rr.components.MarkerShape.auto(shape).value] * 2


def test_a_line_through_an_instant_stands_in_every_plot_of_its_section(tmp_path: Path) -> None:
    one = toy()
    at = 10 * STEP_NS
    first = figure(panel(one, unit="m", small=True), instants={at: "decides"})
    path = recorded(shown(first, figure(panel(one), name="Others")), tmp_path, one)
    for root, factor in ((PLOT, 1e3), (PLOT.replace("/0/0", "/1/0"), 1.0)):
        # A line between two values at one time is drawn as a point: one of them is a nanosecond later.
        assert times_of(path, f"{root}/instants/0") == [at, at + 1]
        ends = np.array(columns(path, f"{root}/instants/0", SCALARS))[:, 0]
        np.testing.assert_array_equal(ends, [factor * one.values.min(), factor * one.values.max()])
        assert static(path, f"{root}/instants/0", "SeriesLines:colors") == [packed(NEUTRAL_COLOUR)]


def test_one_sample_has_no_line_through_an_instant(tmp_path: Path) -> None:
    """Its nanosecond would be the whole axis."""
    for rows in (1, 2):
        one = toy(rows=rows)
        path = recorded(shown(figure(panel(one), instants={0: "decides"})), tmp_path, one)
        assert bool(entities(path, f"{PLOT}/instants")) is (rows > 1)


# --- what is long ----------------------------------------------------------------------------------


@pytest.mark.parametrize("small", [True, False])
def test_a_long_array_has_an_overview_that_keeps_every_extreme(small: bool, tmp_path: Path) -> None:
    one = toy(rows=LONG + 1)
    values = np.array(one.values)
    values[LONG // 2 + 1] = 0.1  # no extreme, but kept
    one = Toy(one.t_ns, values)
    path = recorded(shown(figure(panel(one, small=small, peaks=(LONG // 2 + 1,)))), tmp_path, one)
    few = np.array(columns(path, f"{PLOT}/0/0", SCALARS)) / (math.degrees(1.0) if small else 1.0)
    rows = np.array(times_of(path, f"{PLOT}/0/0")) // STEP_NS
    assert len(few) <= ROWS + 1
    np.testing.assert_allclose(few, values[rows], rtol=1e-15)  # a rounding of pi / 180
    np.testing.assert_allclose(few.min(axis=0), values.min(axis=0), rtol=1e-15)
    np.testing.assert_allclose(few.max(axis=0), values.max(axis=0), rtol=1e-15)
    assert LONG // 2 + 1 in rows
    unit = "deg" if small else "rad"
    assert plots(path) == {f"Values [{unit}], every peak of 50,001 rows", "all 50,001 rows [rad]"}
    assert {f"{PLOT}/0/0", "/values"} <= set(views(path)["ViewContents:query"])


def test_a_long_array_of_a_hidden_view_is_shown_by_its_overview_and_packed(tmp_path: Path) -> None:
    one = toy(rows=LONG + 1)
    values = np.array(one.values)
    values[LONG // 2, 0], values[-1, 1], values[7, 0] = np.nan, 9.0, np.inf
    one = Toy(one.t_ns, values)
    views = View("opened", (panel(one, line(values[:, 0] + 1.0)),)), View("hidden", (panel(one),))
    both = Figure("both", "caption", "alt", views, {STEP_NS: "decides"})
    path = recorded(shown(both), tmp_path, one)
    hidden = PLOT.replace("/0/0", "/0/1")
    assert entities(path, hidden) == {f"{hidden}/0/0", f"{hidden}/instants/0"}
    assert not any("all" in name for name in plots(path))
    ends = columns(path, f"{hidden}/instants/0", SCALARS)
    assert ends == [[np.min(values[np.isfinite(values)])], [9.0]]
    assert len(columns(path, "/values", PACKED)) < 10  # many rows stand as one


def test_of_very_many_rows_only_what_is_plotted_stands_by_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = toy()
    rows, plotted = len(one.values), shown(figure(panel(one)))
    assert len(columns(recorded(shown(), tmp_path, one), "/values", SCALARS)) == rows
    monkeypatch.setattr(writer, "MAX_PLOTTED_ROWS", rows - 1)
    assert len(columns(recorded(plotted, tmp_path, one), "/values", SCALARS)) == rows
    bare = recorded(shown(), tmp_path, one)
    assert len(columns(bare, "/values", PACKED)) == 1 and not columns(bare, "/values", SCALARS)


def test_what_is_plotted_over_a_quantity_is_left_to_the_report() -> None:
    one = toy()
    over = Over(one.values[:, 0], "‖v‖", "m/s")
    both = replace(
        figure(panel(one)),
        views=(View("cloud", (panel(one, over=over),)), View("Values", (panel(one),))),
    )
    assert first_plot(both).name == "Values [rad]"


# --- axes ------------------------------------------------------------------------------------------


def test_every_plot_has_its_unit(tmp_path: Path) -> None:
    one = toy()
    units = {"rad": "rad", "": "-", "m/s2": "m/s2"}
    figures = [figure(panel(one, unit=unit), name=f"{number}") for number, unit in enumerate(units)]
    both = figure(panel(one, unit="rad", small=True), panel(one, unit="m", small=True), name="both")
    path = recorded(shown(*figures, both), tmp_path, one)
    wanted = {f"{number} [{unit}]" for number, unit in enumerate(units.values())} | {"both [deg or mm]"}
    assert plots(path) == wanted


def test_an_axis_shows_more_numbers_than_0() -> None:
    """The viewer writes powers of ten and, where there is room, their multiples."""
    for low, high, most, reach in (
        (-0.9, 0.5, TALL, (-1.0, 0.5)),
        (-0.2, 0.9, TALL, (-0.2, 1.0)),
        (-0.25, 0.15, TALL, (-0.25, 0.15)),
        (0.0, 0.6, LOW, (0.0, 1.0)),
        (2.0, 3.0, TALL, (0.0, 3.0)),
    ):
        found = span_with_numbers(low, high, most)
        margin = MARGIN * (reach[1] - reach[0])
        assert found == pytest.approx((reach[0] - margin, reach[1] + margin))
    assert span_with_numbers(0.0, 0.0, TALL) is None


def test_the_axis_of_a_deviation_shows_what_is_allowed() -> None:
    one = toy()
    view = first_plot(figure(panel(one, line(1e-4 * one.values), unit="m", small=True, limit=0.0035)))
    ((low, high),) = view.properties["ScalarAxis"].range.as_arrow_array().to_pylist()
    assert low < -3.5 < 3.5 < high


@pytest.mark.parametrize(("timed", "wanted"), [(True, [-100_000_000, 12_400_000_000]), (False, [-19, 2481])])
def test_every_plot_shows_the_whole_axis(timed: bool, wanted: list[int], tmp_path: Path) -> None:
    """Else the viewer opens a long log on a minute of it; linked plots take the range of one known view."""
    one = toy(rows=2001)
    plot = panel(one) if timed else replace(panel(one), t_ns=None)
    reader = RrdReader(recorded(shown(figure(plot), opens_at_row=None if timed else 0), tmp_path, one))
    (entry,) = reader.blueprints()
    (batch,) = (
        chunk.to_record_batch()
        for chunk in reader.stream(store=entry)
        if chunk.entity_path == f"/view/{SHARED_AXIS}/TimeAxis"
    )
    (axis,) = batch.column("TimeAxis:view_range").to_pylist()
    assert [axis[0][end] for end in ("start", "end")] == wanted
