"""Rates on the grid: exact on polynomials, smooth on quantised logs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_filter

from urmpipe_pipeline.runs.derivatives import (
    WINDOW,
    MatchingUnit,
    Method,
    derivatives,
    find_matching_unit,
    is_same_rate,
)

TSP = 0.005
T = TSP * np.arange(400, dtype=np.float64)


@pytest.mark.parametrize("method", ["central", "savgol"])
def test_a_parabola_is_differentiated_exactly(method: Method) -> None:
    q = np.column_stack([1.0 + 2.0 * T - 3.0 * T**2, T, np.ones_like(T)])
    qd, qdd = derivatives(q, TSP, method)
    # q to 10 rounds at 1e-15; over T^2 = 2.5e-5 this is 1e-10, the filter's sums a little more
    np.testing.assert_allclose(qd, np.column_stack([2.0 - 6.0 * T, np.ones_like(T), 0 * T]), atol=1e-9)
    np.testing.assert_allclose(qdd, np.column_stack([np.full_like(T, -6.0), 0 * T, 0 * T]), atol=1e-7)


def test_central_differences_are_second_order() -> None:
    q = np.sin(T)[:, None]
    qd, qdd = derivatives(q, TSP)
    assert np.abs(qd[:, 0] - np.cos(T)).max() < TSP**2  # error T^2 / 6 inside, T^2 / 3 at the ends
    assert np.abs(qdd[1:-1, 0] + np.sin(T)[1:-1]).max() < TSP**2


def test_four_digit_angles_need_smoothing() -> None:
    q = 2.0 * np.sin(T)[:, None]
    quantised = np.round(q, 3)
    _, rough = derivatives(quantised, TSP)
    _, smooth = derivatives(quantised, TSP, "savgol")
    exact = -2.0 * np.sin(T)[:, None]
    inner = slice(WINDOW, -WINDOW)
    assert np.abs(rough - exact)[inner].max() > 10.0
    assert np.abs(smooth - exact)[inner].max() < 1.0


@pytest.mark.parametrize("count", [5, 6, 30, 31, 32, 400, 16_500])
def test_smoothing_is_that_of_savitzky_and_golay(count: int) -> None:
    q = np.random.default_rng(count).normal(size=(count, 3))
    window = min(WINDOW, count - 1 + count % 2)
    for k, got in enumerate(derivatives(q, TSP, "savgol"), start=1):
        expected = savgol_filter(q, window, 3, deriv=k, delta=TSP, axis=0)
        # 31 products, each rounded at 1e-16 of the largest value, and the fit's condition of 1e2
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


def test_a_missing_sample_leaves_only_its_neighbours_without_a_derivative() -> None:
    q = T[:, None].copy()
    q[100] = np.nan
    qd, qdd = derivatives(q, TSP)
    assert np.flatnonzero(np.isnan(qd)).tolist() == [99, 101]
    assert np.flatnonzero(np.isnan(qdd)).tolist() == [99, 100, 101]


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_samples_have_no_derivative(count: int) -> None:
    qd, qdd = derivatives(np.ones((count, 2)), TSP)
    assert qd.shape == qdd.shape == (count, 2)
    assert np.isnan(qd).all()


def test_recorded_rates_are_trusted_only_where_they_are_rates() -> None:
    q = np.sin(5 * T)[:, None]
    qd, _ = derivatives(q, TSP)
    assert is_same_rate(5 * np.cos(5 * T)[:, None], qd)
    assert not is_same_rate(np.zeros_like(qd), qd)  # velocity columns of 0 while the joints move
    assert not is_same_rate(np.degrees(qd), qd)
    assert is_same_rate(np.zeros_like(qd), 1e-3 * qd)  # a robot at rest
    assert not is_same_rate(np.full_like(qd, np.nan), qd)


@pytest.mark.parametrize("row", [0, 5, 20, 200, 394, 399])
def test_smoothing_leaves_a_gap_around_a_missing_sample_and_nothing_else(row: int) -> None:
    q = np.column_stack([np.sin(T), T])
    whole = derivatives(q, TSP, "savgol")
    q[row, 0] = np.nan
    half = WINDOW // 2
    fitted = np.clip(np.arange(len(T)), half, len(T) - 1 - half)  # the middle of the window that is fitted
    lost = np.abs(fitted - row) <= half
    for got, expected in zip(derivatives(q, TSP, "savgol"), whole, strict=True):
        np.testing.assert_array_equal(np.isnan(got), np.column_stack([lost, np.zeros_like(lost)]))
        np.testing.assert_array_equal(got[~lost], expected[~lost])


@pytest.mark.parametrize(
    ("factor", "order", "said"),
    [
        (1e3, 1, MatchingUnit("with the time in ms", "ms")),
        (1e6, 2, MatchingUnit("with the time in ms", "ms")),
        (1e6, 1, MatchingUnit("with the time in us", "us")),
        (1e-3, 1, MatchingUnit("with the time in s, not in ms", "s")),
        (180.0 / np.pi, 1, MatchingUnit("in deg")),
        (np.pi / 180.0, 2, MatchingUnit("with the joints in deg")),
        (1.5, 1, None),
        (0.0, 1, None),
    ],
)
def test_the_unit_in_which_recorded_rates_agree_is_told(
    factor: float, order: int, said: MatchingUnit | None
) -> None:
    computed = np.column_stack((np.sin(np.arange(50.0)), np.cos(np.arange(50.0))))
    computed[7] = np.nan
    assert find_matching_unit(factor * computed, computed, order) == said
    assert find_matching_unit(factor * computed[::-1], computed, order) is None
