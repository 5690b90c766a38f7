"""The plots of a recording: what is thinned out and keeps its extremes, and what stands as an array."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from recorded import columns, times_of
from toys import PLOT, STEP_NS, figure, line, panel, recorded, shown, toy
from urmpipe_pipeline.recording import writer
from urmpipe_pipeline.recording.views.plots import COPIED, LONG, ROWS

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
