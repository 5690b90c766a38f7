"""Plots that are thinned out and keep their extremes, and where the viewer opens; see also views.cases."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from recordable import build_comparison
from recorded import columns, entities, times_of
from toys import PLOT, STEP_NS, figure, line, panel, recorded, shown, toy
from urmpipe_pipeline.recording import writer
from urmpipe_pipeline.recording.viewer import openings
from urmpipe_pipeline.recording.views.plots import COPIED, LONG, ROWS
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.simulations.simulation import Simulation

SCALARS = "Scalars:scalars"


def test_what_is_no_array_of_the_result_is_thinned_out(tmp_path: Path) -> None:
    one = toy(rows=4 * COPIED)
    path = recorded(shown(figure(panel(one, line(one.values[:, 0] ** 2)))), tmp_path, one)
    (few,) = np.array(columns(path, f"{PLOT}/0/0", SCALARS)).T
    assert len(few) <= COPIED
    assert (few.min(), few.max()) == ((one.values[:, 0] ** 2).min(), (one.values[:, 0] ** 2).max())


@pytest.mark.parametrize("small", [True, False])
def test_a_long_array_has_an_overview_that_keeps_every_extreme(small: bool, tmp_path: Path) -> None:
    one = toy(rows=LONG + 1)
    one.values[LONG // 2 + 1] = 0.1  # no extreme, but kept
    path = recorded(shown(figure(panel(one, small=small, peaks=(LONG // 2 + 1,)))), tmp_path, one)
    few = np.array(columns(path, f"{PLOT}/0/0", SCALARS)) / (math.degrees(1.0) if small else 1.0)
    rows = np.array(times_of(path, f"{PLOT}/0/0")) // STEP_NS
    assert len(few) <= ROWS + 1
    np.testing.assert_allclose(few, one.values[rows], rtol=1e-15)  # a rounding of pi / 180
    np.testing.assert_allclose(few.min(axis=0), one.values.min(axis=0), rtol=1e-15)
    np.testing.assert_allclose(few.max(axis=0), one.values.max(axis=0), rtol=1e-15)
    assert LONG // 2 + 1 in rows


def test_of_very_many_rows_only_what_is_plotted_stands_by_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = toy()
    rows = len(one.values)
    monkeypatch.setattr(writer, "MAX_PLOTTED_ROWS", rows - 1)
    assert len(columns(recorded(shown(figure(panel(one))), tmp_path, one), "/values", SCALARS)) == rows
    bare = recorded(shown(), tmp_path, one)
    assert len(columns(bare, "/values", "urmpipe:packed")) == 1 and not columns(bare, "/values", SCALARS)


def test_results_open_where_their_verdict_was_decided(
    make_simulation: Callable[..., Simulation], tmp_path: Path
) -> None:
    comparison = build_comparison(("solidworks", "coppeliasim"))
    path = write_recording(comparison, tmp_path / "both.rrd")
    assert openings([path])[path].at / 1e9 == comparison.worst.worst_statistics.t_max > 0
    path = write_recording(make_simulation(), tmp_path / "simulation.rrd")
    assert openings([path])[path].at == 1_250_000_000


def test_what_is_drawn_stands_below_one_root_and_on_no_clock_of_the_writer(tmp_path: Path) -> None:
    """The other entities are the arrays of the result, at the paths of their fields."""
    path = write_recording(build_comparison(rows=50), tmp_path / "both.rrd")
    roots = {entity.split("/")[1] for entity in entities(path)}
    assert roots == {"shown", "reference", "runs"}
    timelines = {name for chunk in RrdReader(path).store().stream() for name in chunk.timeline_names}
    assert timelines == {"t", "row"}
