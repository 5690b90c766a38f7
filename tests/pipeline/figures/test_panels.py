"""What stands on a sheet: data, peaks, limits, small plots; read back from matplotlib."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.text import Text

from toys import figure, shown
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import OptionError
from urmpipe_pipeline.figures.plot import plot
from urmpipe_pipeline.figures.sheet import BAND, FAULT, MUTED, Sheet
from urmpipe_pipeline.presentation.figure import Figure, Line, Mark, Over, Panel, View

RED, BLUE = "#c25000", "#21c3ff"
COUNT = 5000  # more than a drawn line has points
T_NS: IntArray = np.arange(COUNT, dtype=np.int64) * 5_000_000
T = T_NS / 1e9
WAVE: FloatArray = 0.004 * np.sin(T)


def panel(values: FloatArray, title: str = "Δx", unit: str = "m", **more: Any) -> Panel:
    columns = 1 if values.ndim == 1 else values.shape[1]
    names = (title,) if columns == 1 else tuple("xyz"[:columns])
    line = Line(values, names, (RED, BLUE, RED)[:columns], **more.pop("line", {}))
    return Panel(title, unit, (line,), **({"t_ns": T_NS[: len(values)]} | more))


def drawn(*panels: Panel, width: str = "column", **more: Any) -> Sheet:
    return plot(shown(figure(*panels, **more)), None, width, 8.0)


def axes_of(*panels: Panel, **more: Any) -> Axes:
    (axes,) = drawn(*panels, **more).axes
    return axes


def spans(axes: Axes, colour: str) -> list[Rectangle]:
    return [
        one for one in axes.patches if isinstance(one, Rectangle) and to_hex(one.get_facecolor()) == colour
    ]


def points(line: Line2D) -> list[tuple[float, float]]:
    return list(zip(np.asarray(line.get_xdata()), np.asarray(line.get_ydata()), strict=True))


def _entries(axes: Axes) -> list[Text]:
    found = axes.get_legend()
    return [] if found is None else found.get_texts()


def legend(axes: Axes) -> list[str]:
    return [one.get_text() for one in _entries(axes)]


def test_a_line_keeps_its_peaks_and_is_shown_in_mm() -> None:
    values = WAVE.copy()
    values[1234], values[3217] = 0.5, -0.7
    axes = axes_of(panel(values, small=True, peaks=(2000,)))
    line, peak = axes.lines
    x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    assert len(x) < COUNT / 2
    assert (np.min(y), np.max(y)) == (-700.0, 500.0)
    assert {T[1234], T[3217], T[2000]} <= set(x.tolist())
    np.testing.assert_array_equal(y, 1e3 * values[np.searchsorted(T, x)])
    assert (line.get_color(), axes.get_ylabel(), axes.get_xlabel()) == (RED, "Δx [mm]", "t [s]")
    assert axes.get_xlim() == (T[0], T[-1])
    assert peak.get_marker() == "D"
    assert points(peak) == [(T[2000], 1e3 * WAVE[2000])]


def test_a_limit_is_a_band_and_rows_out_of_it_are_tinted() -> None:
    axes = axes_of(panel(WAVE, limit=0.0035, small=True, tinted=T < 1.0))
    (band,) = spans(axes, BAND)
    assert (band.get_y(), band.get_height()) == (-3.5, 7.0)
    levels = [one.get_ydata()[0] for one in axes.lines if one.get_linestyle() != "-"]  # type: ignore[index]
    assert levels == [-3.5, 3.5]
    assert legend(axes) == ["tolerance ±3.5 mm"]
    first = spans(axes, FAULT)[0]
    out = T[np.abs(WAVE) > 0.0035]
    assert first.get_x() == out[0]
    (doubtful,) = spans(axes, MUTED)
    assert doubtful.get_x() == 0.0
    assert doubtful.get_width() == pytest.approx(T[T < 1.0][-1])


def test_a_size_begins_at_0_and_has_one_limit() -> None:
    axes = axes_of(panel(np.abs(WAVE), "‖Δ‖", limit=0.005, signed=False, small=True))
    assert axes.get_ylim()[0] == 0.0
    (band,) = spans(axes, BAND)
    assert (band.get_y(), band.get_height()) == (0.0, 5.0)
    assert legend(axes) == ["tolerance 5 mm"]


def test_a_tolerance_that_would_vanish_is_seen() -> None:
    axes = axes_of(panel(200.0 * WAVE, limit=0.0035, small=True))
    low, high = axes.transData.transform([(0.0, -3.5), (0.0, 3.5)])[:, 1]
    assert (high - low) / axes.bbox.height > 0.2  # of two scales it has 0.3 of the axis but for its margins
    assert legend(axes) == ["tolerance ±3.5 mm, smaller scale beyond"]
    shown_at = [float(one) for one in axes.get_yticks()]
    assert {-3.5, 0.0, 3.5} < set(shown_at)
    heights = axes.transData.transform([(0.0, one) for one in shown_at])[:, 1]
    assert np.diff(heights).min() > 8.0 * 100.0 / 72.0 * 0.9  # no word on the next: 8 pt at 100 dots an inch


def test_what_was_asked_for_is_dashed_and_steps_are_steps() -> None:
    both = Panel(
        "q",
        "rad",
        (
            Line(np.sin(T), ("set",), (BLUE,), dashed=True),
            Line(np.round(np.sin(T)).astype(np.float64), ("answer",), (RED,), steps=True),
        ),
        T_NS,
    )
    axes = axes_of(both)
    wanted, answer = axes.lines
    assert (wanted.get_linestyle(), answer.get_linestyle()) == ("--", "-")
    assert (wanted.get_drawstyle(), answer.get_drawstyle()) == ("default", "steps-post")
    assert legend(axes) == ["set", "answer"]


def test_a_logarithmic_axis_reaches_the_limit() -> None:
    both = np.column_stack([1e-6 * np.ones(COUNT), 0.01 * np.ones(COUNT)])
    made = drawn(panel(both, small=True, limit=2.0, signed=False, logarithmic=True))
    (axes,) = made.axes
    assert axes.get_yscale() == "log"
    low, high = axes.get_ylim()
    assert low < 1e-3
    assert high > 2000.0
    made.draw_without_rendering()
    assert "$" not in "".join(one.get_text() for one in axes.findobj(Text))  # no markup that is not read


def test_parts_of_a_sum_are_stacked() -> None:
    parts = np.column_stack([np.sin(T), 2.0 * np.cos(T)])
    axes = axes_of(panel(parts, "power", "W", line={"stacked": True}))
    low, high = axes.dataLim.intervaly
    # The peaks of the parts are kept; that of their sum lies between two of the rows that are drawn.
    assert high == pytest.approx(np.fmax(parts, 0.0).sum(axis=1).max(), rel=1e-3)
    assert low == pytest.approx(np.fmin(parts, 0.0).sum(axis=1).min(), rel=1e-3)
    assert legend(axes) == ["x", "y"]


def test_marks_stand_where_they_are_and_instants_go_through_all_panels() -> None:
    marked = panel(WAVE, small=True, marks=(Mark(2_000_000_000, 0.001, "up", BLUE, "turned"),))
    made = drawn(
        marked, panel(WAVE, "Δy"), instants={3_000_000_000: "decides", 3_100_000_000: "furthest off"}
    )
    first, second = made.axes
    (mark,) = (one for one in first.lines if one.get_marker() == "^")
    assert points(mark) == [(2.0, 1.0)]
    for axes in (first, second):
        at = [one.get_xdata()[0] for one in axes.lines if one.get_linestyle() == ":"]  # type: ignore[index]
        assert at == [3.0, 3.1]
    made.draw_without_rendering()
    boxes = [one.get_window_extent() for one in first.texts]
    assert [one.get_text() for one in first.texts] == ["decides", "furthest off"]
    assert not boxes[0].overlaps(boxes[1])


def test_a_quantity_as_axis_has_points_and_the_largest_is_among_them() -> None:
    speed = np.abs(np.cos(T))
    speed[5] = np.nan
    over = Over(speed, "‖v‖", "m/s")
    axes = axes_of(panel(abs(WAVE), "‖Δ‖", small=True, signed=False, over=over, peaks=(1234,)))
    (cloud,) = axes.lines
    assert (speed[1234], 1e3 * abs(WAVE[1234])) in points(cloud)
    assert np.isfinite(points(cloud)).all()
    assert axes.get_xlabel() == "‖v‖ [m/s]"


def test_set_points_and_answers_are_small_plots_a_pair_each() -> None:
    angles = np.sin(np.outer(T, np.arange(1, 7)))
    names = tuple(f"q{k}" for k in range(1, 7))
    wanted = Line(angles, tuple(f"{name} set" for name in names), (BLUE,) * 6, dashed=True)
    answers = Line(0.9 * angles, names, (RED,) * 6)
    made = drawn(Panel("q", "rad", (wanted, answers), T_NS))
    assert [one.get_title(loc="left") for one in made.axes] == [
        f"{name} set (dashed), {name}" for name in names
    ]
    assert [one.get_linestyle() for axes in made.axes for one in axes.lines] == ["--", "-"] * 6
    assert [one.get_xlabel() for one in made.axes] == ["", "", "", "", "t [s]", "t [s]"]


def test_panels_of_other_axes_are_figures_of_their_own() -> None:
    cloud = panel(WAVE, "Δy", over=Over(np.cos(T), "v", "m/s"))
    both = shown(Figure("Both", "", "", (View("view", (panel(WAVE), cloud)),)))
    assert plot(both, "Both", "column", 8.0).axes[0].get_xlabel() == "t [s]"
    assert plot(both, "both over *", "column", 8.0).axes[0].get_xlabel() == "v [m/s]"


@pytest.mark.slow
def test_no_text_lies_on_another_and_none_is_cut_off_in_a_column() -> None:
    long = "a quantity of many words"
    panels = [panel(100.0 * WAVE, f"{long} {k}", limit=0.0035, small=True) for k in range(5)]
    three = panel(np.column_stack([WAVE, 2.0 * WAVE, 3.0 * WAVE]), small=True)
    made = drawn(*panels, three, instants={10**9: "one instant", 2 * 10**9: "another instant"})
    made.settle()
    boxes = [
        one.get_window_extent()
        for axes in made.axes
        for one in (
            axes.yaxis.label, axes.xaxis.label, *axes.texts, *axes.get_yticklabels(),
            *_entries(axes),
        )
        if one.get_text() and one.get_visible() and _on_axis(one, axes)
    ]  # fmt: skip
    assert len(boxes) > 30
    assert not any(one.overlaps(two) for k, one in enumerate(boxes) for two in boxes[:k])
    width, height = made.bbox.size
    assert all(box.x0 >= 0.0 and box.y0 >= 0.0 and box.x1 <= width and box.y1 <= height for box in boxes)


def _on_axis(one: Text, axes: Axes) -> bool:
    """Tell whether a text is drawn: matplotlib keeps the labels of ticks out of view."""
    if one not in axes.get_yticklabels():
        return True
    low, high = axes.get_ylim()
    return low <= one.get_position()[1] <= high


def test_the_settings_of_whoever_uses_matplotlib_stay_and_change_nothing() -> None:
    with mpl.rc_context({"font.size": 31.0, "lines.linewidth": 9.0, "savefig.bbox": "tight"}):
        before = dict(mpl.rcParams)
        made = drawn(panel(WAVE))
        assert dict(mpl.rcParams) == before
        assert made.axes[0].yaxis.label.get_fontsize() == 8.0
        assert made.axes[0].lines[0].get_linewidth() == 1.0
    assert isinstance(made, mpl.figure.Figure)


def test_a_notebook_shows_it() -> None:
    assert drawn(panel(WAVE))._repr_png_().startswith(b"\x89PNG\r\n\x1a\n")


def test_rows_and_values_that_are_missing_are_drawn_as_far_as_they_go() -> None:
    gaps = WAVE.copy()
    gaps[100:200] = np.nan
    y = np.asarray(axes_of(panel(gaps)).lines[0].get_ydata())
    assert np.isnan(y).any()
    (alone,) = axes_of(panel(np.array([1.0]), "n", "", t_ns=None)).lines
    assert (alone.get_marker(), points(alone)) == ("o", [(1.0, 1.0)])
    for values in (np.empty(0), np.full(9, np.nan), np.array([np.inf, 1.0])):
        drawn(panel(values, limit=0.1), replace(panel(values), t_ns=None)).draw_without_rendering()


def test_without_a_figure_one_line_says_so() -> None:
    with pytest.raises(OptionError, match=r"^toy has no figure to plot$"):
        plot(shown(), None, "page", 8.0)
    with pytest.raises(OptionError) as caught:
        plot(shown(figure(panel(WAVE))), 3, "pge", 2.0)  # type: ignore[arg-type]
    assert str(caught.value) == (
        "width: found 'pge', allowed: column, page, or 40 mm to 1 m, such as 85mm or 3.5in\n"
        "font: found 2.0, allowed: 4 to 32, in pt"
    )
    with pytest.raises(OptionError, match=r"^title: found 3, allowed: the title of a figure$"):
        plot(shown(figure(panel(WAVE))), 3, "page", 8.0)  # type: ignore[arg-type]
    with pytest.raises(
        OptionError, match=r"^title: found 'Value' \(did you mean Values\?\), allowed: Values$"
    ):
        plot(shown(figure(panel(WAVE))), "Value", "page", 8.0)
