"""Scenes: equal scale on all axes, everything on the sheet, colours by value, gaps that stay gaps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from toys import shown
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.figures.plot import plot
from urmpipe_pipeline.figures.sheet import Sheet
from urmpipe_pipeline.presentation.figure import SpaceFigure
from urmpipe_pipeline.presentation.palette import BEYOND_SCALE, VALUE_SCALE, WITHIN_SCALE
from urmpipe_pipeline.presentation.scene import Path, Sheets, Solid, Spot

ANGLE = np.linspace(0.0, 6.0, 60)
HELIX: FloatArray = np.column_stack([np.cos(ANGLE), np.sin(ANGLE), 0.1 * ANGLE])
RED = "#c25000"


def drawn(**content: Any) -> Sheet:
    one = SpaceFigure("Path in space", "", "", **content)
    return plot(shown(one), None, "column", 8.0)  # type: ignore[arg-type]


def scene(made: Sheet) -> Axes3D:
    axes = made.axes[0]
    assert isinstance(axes, Axes3D)
    return axes


def test_a_metre_is_as_long_on_all_axes_and_all_is_on_the_sheet() -> None:
    flat = HELIX * (1.0, 1.0, 0.2)
    made = drawn(paths=(Path("tcp", flat, None, RED),), spots=(Spot((1.0, 0.0, 0.0), "decides", RED),))
    axes = scene(made)
    spans = np.array([np.ptp(end) for end in (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())])
    ratios = np.asarray(axes._box_aspect) / spans
    assert ratios == pytest.approx(ratios[0])
    made.draw_without_rendering()
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        box = axis.get_tightbbox(made.renderer)
        assert min(box.x0, box.y0) >= -0.01  # in dots: it may touch the edge, as sums of floats do
        assert box.x1 <= made.bbox.width
    assert (axes.get_xlabel(), axes.get_zlabel()) == ("x [m]", "z [m]")
    assert [one.get_text() for one in axes.get_legend().get_texts()] == ["tcp", "decides"]


def test_around_a_slim_path_all_axes_are_equally_long() -> None:
    axes = scene(drawn(paths=(Path("tcp", HELIX * (1.0, 1e-3, 1e-3), None, RED),)))
    spans = [np.ptp(end) for end in (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())]
    assert spans == pytest.approx([spans[0]] * 3)


def test_a_path_is_coloured_by_its_values_with_a_scale_in_mm() -> None:
    made = drawn(paths=(Path("‖Δ‖", HELIX, None, RED, values=1e-3 * np.arange(60.0)),))
    axes, scale = made.axes
    (lines,) = (one for one in axes.collections if isinstance(one, Line3DCollection))
    assert len(lines.get_segments()) == 59
    assert lines.get_colors()[-1][:3] == pytest.approx(_rgb(VALUE_SCALE[-1][1]))
    assert scale.get_xlabel() == "‖Δ‖ [mm]"
    assert scale.get_xlim() == pytest.approx((0.0, 59.0))


def test_a_path_with_a_limit_has_the_colours_of_a_report_with_a_change_at_the_limit() -> None:
    sizes = 1e-3 * np.arange(60.0)
    wanted = Path("reference", HELIX, None, RED, asked=True)
    supposed = Path("without the causes", HELIX, None, RED, supposed=True)
    made = drawn(paths=(wanted, supposed, Path("‖Δ‖", HELIX, None, RED, values=sizes, limit=0.0305)))
    axes, scale = made.axes
    (lines,) = (one for one in axes.collections if isinstance(one, Line3DCollection))
    colours = lines.get_colors()
    assert colours[0][:3] == pytest.approx(_rgb(WITHIN_SCALE[0]), abs=0.03)  # of row 1 of 30
    assert colours[29][:3] == pytest.approx(_rgb(WITHIN_SCALE[1]), abs=0.03)
    assert colours[30][:3] == pytest.approx(_rgb(BEYOND_SCALE[0]), abs=0.03)
    assert colours[-1][:3] == pytest.approx(_rgb(BEYOND_SCALE[1]), abs=0.03)
    assert [one.get_text() for one in scale.get_xticklabels()] == ["0", "30.5 allowed", "50"]
    # What only would be is no wider than what was asked for, and hides nothing.
    assert [(one.get_linestyle(), one.get_linewidth()) for one in axes.lines[:2]] == [("--", 0.7), (":", 0.7)]


def _rgb(colour: str) -> list[float]:
    return [int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]


def test_a_path_is_broken_where_rows_are_missing() -> None:
    rows = np.delete(np.arange(60), slice(20, 30))
    axes = scene(drawn(paths=(Path("tcp", HELIX[rows], None, RED, sample=rows),)))
    x, _, _ = axes.lines[0].get_data_3d()
    assert np.flatnonzero(np.isnan(x)).tolist() == [20]
    np.testing.assert_array_equal(x[~np.isnan(x)], HELIX[rows, 0])


def test_solids_and_sheets_are_faces_and_the_hidden_are_left_out() -> None:
    corners = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]])
    body = Solid("bodies", "base", RED, corners[:, :3], lines=(HELIX,), label="base")
    hidden = Solid("bodies", "cover", RED, 9.0 * corners[:, :3], hidden=True)
    axes = scene(drawn(solids=(body, hidden), sheets=Sheets("planes", corners, "#21c3ff")))
    faces = [one for one in axes.collections if isinstance(one, Poly3DCollection)]
    assert len(faces) == 2
    assert [one.get_text() for one in axes.get_legend().get_texts()] == ["base", "planes"]
    assert axes.get_xlim()[1] < 2.0


@pytest.mark.slow
def test_a_scene_of_nothing_is_drawn() -> None:
    for position in (np.empty((0, 3)), np.full((5, 3), np.nan), np.ones((1, 3))):
        path = Path("tcp", position, None, RED, values=np.ones(len(position)))
        figure = drawn(paths=(path, Path("reference", position, None, RED, asked=True)))
        figure.draw_without_rendering()
        axes = scene(figure)
        limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
        assert np.isfinite(limits).all() and (limits[:, 0] < limits[:, 1]).all()
