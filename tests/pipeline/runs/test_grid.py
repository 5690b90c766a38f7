"""The uniform grid: the log's own rows, or a resampling that says so."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike

from asserting import refusal
from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import JointLog, is_inside_gap
from urmpipe_pipeline.runs.grid import interpolate, make_grid

MS = 1_000_000


def log_at(t_ns: ArrayLike, q: ArrayLike | None = None) -> JointLog:
    t = np.asarray(t_ns, dtype=np.int64)
    values = np.zeros((len(t), 1)) if q is None else np.asarray(q, dtype=float).reshape(len(t), -1)
    return JointLog("log", "table", (), t, ("q1",), values)


def test_a_regular_log_keeps_its_own_rows() -> None:
    log = log_at(np.arange(100) * 5 * MS)
    grid = make_grid(log)
    assert grid.is_rows
    assert grid.t_ns is log.t_ns
    assert grid.tsp == 0.005
    assert grid.warnings == ()
    assert make_grid(log, 0.005).is_rows


def test_rounded_clocks_are_regular() -> None:
    """A period of 1/240 s printed to the microsecond."""
    assert make_grid(log_at(np.rint(np.arange(1000) / 240 * 1e6).astype(np.int64) * 1000)).is_rows


def test_an_irregular_log_is_resampled_to_its_median_period_and_says_so() -> None:
    rng = np.random.default_rng(3)
    t = np.sort(np.arange(200) * 10 * MS + rng.integers(-2 * MS, 2 * MS, 200))
    t -= t[0]
    grid = make_grid(log_at(t, 2.0 * t))
    assert not grid.is_rows
    assert grid.tsp == pytest.approx(np.median(np.diff(t)) / 1e9)
    # a straight line stays itself; values to 4e9, doubles round at 1e-6 of them
    np.testing.assert_allclose(grid.resample(2.0 * t[:, None])[:, 0], 2.0 * grid.t_ns, rtol=1e-12, atol=1e-5)
    assert [w.kind for w in grid.warnings] == ["resampled"]
    assert grid.warnings[0].message.startswith("200 rows with a median period of")


def test_nothing_is_upsampled_in_silence() -> None:
    grid = make_grid(log_at(np.arange(10) * 50 * MS), 0.005)
    assert len(grid.t_ns) == 91
    assert [w.kind for w in grid.warnings] == ["resampled", "upsampled"]
    assert grid.warnings[1].message == (
        "the grid of 5 ms is finer than the log's 50 ms: the samples between its rows are interpolated, not"
        " measured"
    )


def test_a_coarser_grid_takes_every_fourth_row() -> None:
    q = np.arange(101.0)
    grid = make_grid(log_at(np.arange(101) * 5 * MS, q), 0.02)
    np.testing.assert_array_equal(grid.resample(q[:, None])[:, 0], q[::4])
    assert [w.kind for w in grid.warnings] == ["resampled"]


def test_a_gap_is_left_open() -> None:
    t = np.concatenate([np.arange(50), np.arange(80, 120)]) * 5 * MS
    log = log_at(t, t * 1.0)
    grid = make_grid(log)
    values = grid.resample(log.q)[:, 0]
    assert len(values) == 120
    assert np.flatnonzero(np.isnan(values)).tolist() == list(range(50, 80))
    assert [(w.kind, w.message) for w in grid.warnings] == [
        (
            "resampled",
            "90 rows with a median period of 5 ms became 120 samples every 5 ms (linear); 30 of them lie"
            " inside gaps and have no value",
        )
    ]


def test_interpolation_gives_known_values_exactly_and_nothing_outside() -> None:
    known = np.array([0, 10, 20, 30]) * MS
    values = np.array([[0.1], [0.2], [0.7], [np.nan]])
    got = interpolate(np.array([-1, 0, 5, 10, 20, 25, 31]) * MS, known, values)[:, 0]
    np.testing.assert_array_equal(got[[1, 3, 4]], [0.1, 0.2, 0.7])
    assert np.isnan(got[[0, 5, 6]]).all()
    assert got[2] == pytest.approx(0.15)
    # a clock printed to the microsecond may end a rounding later
    np.testing.assert_array_equal(interpolate(np.array([-1000, -1001]), known, values)[:, 0], [0.1, np.nan])


@pytest.mark.parametrize("count", [0, 1])
def test_logs_of_no_and_one_row_have_a_grid(count: int) -> None:
    grid = make_grid(log_at(np.arange(count)))
    assert len(grid.t_ns) == count
    assert grid.is_rows
    assert not is_inside_gap(np.arange(3), np.arange(count)).any()


def test_a_clock_rounded_to_milliseconds_is_regular_and_that_is_said() -> None:
    """300 Hz in whole milliseconds: steps of 3, 3, 4 ms."""
    t = np.floor(np.arange(300) / 0.3).astype(np.int64) * MS
    grid = make_grid(log_at(t))
    assert grid.is_rows
    assert grid.tsp == pytest.approx(1 / 300, rel=1e-5)  # a millisecond in a second, over 300 rows
    assert np.abs(grid.t_ns - t).max() <= MS
    np.testing.assert_array_equal(grid.source_ns, grid.t_ns)
    assert [(w.kind, w.message) for w in grid.warnings] == [
        (
            "clock-rounded",
            f"the times are those of a regular clock of {grid.tsp * 1e3:.6g} ms in steps of 1 ms:"
            " the rows are taken as regular",
        )
    ]
    wider = make_grid(log_at(t), 0.01)
    assert not wider.is_rows
    np.testing.assert_array_equal(wider.source_ns, grid.t_ns)  # another grid changes no time of a row


def test_a_grid_that_would_fill_the_memory_is_refused() -> None:
    t = np.append(5 * MS * np.arange(10), 1_700_000_000_000 * MS)
    assert refusal(LogError, make_grid, log_at(t)) == (
        "log, row 11: found 340000000001 samples every 5 ms for 11 rows, 1.7e+09 s pass before row 11,"
        " allowed: 986895 samples; a clock without such a gap; --tsp SECONDS sets a longer period"
    )
    with pytest.raises(LogError, match="found 45000001 samples every 1e-06 ms for 10 rows"):
        make_grid(log_at(5 * MS * np.arange(10)), 1e-9)
