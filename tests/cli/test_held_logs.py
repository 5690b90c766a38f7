"""Logs that are held between samples: their clock, and how communication points meet their samples."""

from __future__ import annotations

import numpy as np
import pytest

from urmpipe.systems.logs import hold_warning, snap_to_points
from urmpipe_fmus.block import Table
from urmpipe_models.elementwise import IntArray
from urmpipe_pipeline.runs.grid import row_clock


def stamps(rate: float, unit_ns: int, rows: int = 2000) -> IntArray:
    """Return times of a clock of `rate` in [Hz] as a file of so many nanoseconds a digit holds them."""
    return np.rint(np.arange(rows) / rate * 1e9 / unit_ns).astype(np.int64) * unit_ns


@pytest.mark.parametrize("rate", [30.0, 60.0, 125.0, 200.0, 240.0])
@pytest.mark.parametrize("unit_ns", [1, 1_000, 100_000, 1_000_000])
def test_each_communication_point_of_a_regular_log_reads_its_own_row(rate: float, unit_ns: int) -> None:
    clock = row_clock(stamps(rate, unit_ns))
    step = clock.period / 1e9
    assert step == pytest.approx(1.0 / rate, rel=1e-5)  # by the ends of 2000 rows, to a digit
    times = snap_to_points(clock.t_ns, step)
    k = np.arange(len(times))
    read = Table(times, k[:, None].astype(float)).rows_at(k * step)
    np.testing.assert_array_equal(read.before[0], k)
    np.testing.assert_array_equal(read.fraction, 0.0)
    assert hold_warning("log", times, step, len(times) - 1) is None


def test_samples_off_the_points_stay_where_they_are_and_are_told() -> None:
    times = np.array([0, 5_000_000, 7_500_000, 15_000_010], dtype=np.int64)
    met = snap_to_points(times, 0.005)
    assert met.tolist() == [0, 5_000_000, 7_500_000, 15_000_000]
    said = hold_warning("log", met, 0.005, 9)
    assert said is not None
    assert said.message == (
        "block log: 1 of 4 communication points lie between samples of the log, where the previous"
        " sample is held for at most 2.5 ms: deviations there are not those of the log"
    )


def test_the_period_of_an_irregular_log_is_its_median_and_one_row_has_none() -> None:
    assert row_clock(np.array([0, 10, 20, 90, 100], dtype=np.int64) * 1_000_000).period == 10e6
    assert row_clock(np.array([0], dtype=np.int64)).period == 0.0
    assert snap_to_points(np.array([0], dtype=np.int64), 0.005).tolist() == [0]
