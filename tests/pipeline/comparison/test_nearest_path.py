"""Distance from a path, against a look at every piece of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.path_distance import _distances, distance_from_path

ROUNDING = 1e-12
"""Distances of points up to 10 m away round at 2e-15; feet of perpendiculars on tiny pieces at some more."""


def distance_by_hand(point: FloatArray, path: FloatArray, joined: NDArray[np.bool_]) -> float:
    """Of every vertex, and of the foot of the perpendicular on every piece."""
    known: NDArray[np.bool_] = np.asarray(np.isfinite(path).all(axis=1))
    step = np.diff(path, axis=0)[joined & known[1:] & known[:-1]]
    first = path[:-1][joined & known[1:] & known[:-1]]
    length = np.linalg.norm(step, axis=1)
    first, direction, length = (one[length > 0.0] for one in (first, step, length))
    direction /= length[:, np.newaxis]
    along = np.clip(((point - first) * direction).sum(axis=1), 0.0, length)
    feet = first + along[:, np.newaxis] * direction
    return float(np.linalg.norm(point - np.concatenate((path[known], feet)), axis=1).min())


def assert_distances(points: FloatArray, path: FloatArray, joined: NDArray[np.bool_]) -> None:
    expected = np.array([distance_by_hand(point, path, joined) for point in points])
    assert_near(distance_from_path(points, path, joined), expected)


def assert_near(found: FloatArray, expected: FloatArray) -> None:
    """Never too small, and too large by no more than what is promised."""
    assert (found >= expected - ROUNDING).all()
    assert (found <= expected + 1e-9 + 1e-6 * found + ROUNDING).all()


# On a coarse grid points lie on the path, vertices repeat and distances tie; the fine ones have no pattern.
coordinates = st.integers(-3, 3).map(float) | st.floats(-10, 10).map(lambda value: round(value, 6))


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.data())
def test_the_distance_is_that_of_the_nearest_piece(data: st.DataObject) -> None:
    count = data.draw(st.integers(1, 40))
    path = data.draw(arrays(np.float64, (count, 3), elements=coordinates))
    path[data.draw(st.lists(st.integers(1, count - 1), max_size=3)) if count > 1 else []] = np.nan
    joined = data.draw(arrays(np.bool_, count - 1))
    assert_distances(data.draw(arrays(np.float64, (6, 3), elements=coordinates)), path, joined)


@pytest.mark.slow
@pytest.mark.parametrize("far", [0.0, 0.01, 1.0])
def test_a_long_path_with_loops_corners_and_dwells(far: float) -> None:
    rng = np.random.default_rng(1)
    t = np.linspace(0, 40, 3000)
    path = np.column_stack([np.sin(0.9 * t), np.abs(np.cos(1.1 * t)), 0.2 * np.sin(5 * t)])
    path[500:900] = path[500]  # stands
    path[1500:1700] = path[1500] + rng.normal(0, 1e-6, (200, 3))  # stands and trembles
    path[2000] = np.nan
    joined = np.ones(2999, bool)
    joined[2500] = False
    points = path[np.isfinite(path).all(axis=1)][::150] + far
    points += rng.normal(0, 1e-4, points.shape)
    assert_distances(points, path, joined)


def test_a_raster_of_long_lines_is_met_between_their_ends() -> None:
    rows = np.arange(50)
    ends = np.where(rows % 2 == 0, 0.0, 1.0)
    path = np.column_stack([np.stack((ends, 1 - ends), 1).ravel(), np.repeat(rows * 0.001, 2), np.zeros(100)])
    points = np.column_stack([np.full(40, 0.5), np.linspace(0, 0.049, 40), np.full(40, 0.0002)])
    assert_distances(points, path, np.ones(99, bool))


def test_a_path_of_one_point_and_a_gap() -> None:
    point, path = np.array([[0.0, 0.0, 1.0]]), np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert distance_from_path(point, path[:1], np.empty(0, bool)).tolist() == [np.sqrt(2.0)]
    assert distance_from_path(point, path, np.array([True])).tolist() == [1.0]
    assert distance_from_path(point, path, np.array([False])).tolist() == [np.sqrt(2.0)]
    assert distance_from_path(point, np.insert(path, 1, np.nan, axis=0), np.ones(2, bool)).tolist() == [
        np.sqrt(2.0)
    ]
    assert distance_from_path(np.empty((0, 3)), path, np.array([True])).tolist() == []


def test_the_middle_of_a_circle_is_as_far_from_every_piece() -> None:
    angle = np.cumsum(np.random.default_rng(2).uniform(0.001, 0.004, 2000))
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(2000)])
    assert_distances(np.random.default_rng(3).normal(0, 1e-7, (5, 3)), circle, np.ones(1999, bool))


@pytest.mark.slow
@pytest.mark.parametrize("far", [0.0, 0.9])
def test_a_log_is_as_far_from_a_path_as_each_of_its_points(far: float) -> None:
    t = np.linspace(0, 20, 5000)
    path = np.column_stack([np.sin(0.9 * t), np.abs(np.cos(1.1 * t)), 0.2 * np.sin(5 * t)])
    points = path + far + np.random.default_rng(5).normal(0, 1e-4, path.shape)
    found = distance_from_path(points, path, np.ones(4999, bool))
    expected = [distance_by_hand(point, path, np.ones(4999, bool)) for point in points[::1000]]
    assert_near(found[::1000], np.array(expected))


@pytest.mark.slow
def test_a_log_in_the_middle_of_a_circle_is_not_held_against_every_piece() -> None:
    angle = np.linspace(0, 6, 100_000)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(100_000)])
    points = np.random.default_rng(6).normal(0, 1e-7, (10_000, 3))
    found, looked = _distances(points, circle, np.ones(99_999, bool))
    np.testing.assert_allclose(found, 1.0, rtol=0, atol=1.001e-6 + 5e-7)  # that, and how far the points are
    assert looked < 100 * len(points)  # not 1e9


@pytest.mark.slow
@pytest.mark.parametrize("digits", [6, 12])
def test_a_path_that_stands_and_trembles_is_met_exactly(digits: int) -> None:
    rng = np.random.default_rng(4)
    path = np.vstack([rng.normal(0, 1e-6, (3000, 3)), np.linspace((0, 0, 0), (0, 0, 10), 1000)]).round(digits)
    points, joined = rng.normal(0, 1e-6, (1000, 3)), np.ones(3999, bool)
    found, looked = _distances(points, path, joined)
    expected = [distance_by_hand(point, path, joined) for point in points[:5]]
    assert_near(found[:5], np.array(expected))
    assert looked < 2000 * len(points)  # not 4000


def test_a_rest_of_thousands_of_rows_costs_no_more_than_one() -> None:
    path = np.vstack([np.linspace((0, 0, 0), (1, 0, 0), 100), np.tile([1.0, 0.0, 0.0], (20_000, 1))])
    found, looked = _distances(path + np.array([0, 0.001, 0]), path, np.ones(len(path) - 1, bool))
    np.testing.assert_allclose(found, 0.001, rtol=1e-6)
    assert looked < 100 * len(path)


def repeated(times: int, noise: float, seed: int, white: bool) -> FloatArray:
    """Repetitions of one motion of 100 samples; the noise moves each of them whole, or each sample."""
    t = np.linspace(0, 2 * np.pi, 100)
    motion = np.column_stack([np.sin(t), np.cos(2 * t), 0.3 * np.sin(3 * t)])
    moved = np.random.default_rng(seed).normal(0, noise, (times, 100 if white else 1, 3))
    return np.asarray((motion + moved).reshape(-1, 3))


noisy = pytest.mark.parametrize(
    ("noise", "white"), [(1e-5, False), (1e-5, True), (1e-4, False), (1e-4, True)]
)


def pairs_of(times: int, noise: float, white: bool) -> int:
    points, path = (repeated(times, noise, seed, white) for seed in (1, 2))
    return _distances(points, path, np.ones(len(path) - 1, bool))[1]


@pytest.mark.parametrize("times", [3, 30])
def test_ten_times_the_exact_repetitions_make_at_most_twelve_times_the_pairs(times: int) -> None:
    assert pairs_of(10 * times, 0.0, False) <= 12 * pairs_of(times, 0.0, False)


@noisy
def test_ten_times_the_noisy_repetitions_make_far_less_than_a_hundred_times_the_pairs(
    noise: float, white: bool
) -> None:
    assert pairs_of(30, noise, white) <= 36 * pairs_of(3, noise, white)


@pytest.mark.slow
@noisy
def test_repetitions_are_met_exactly(noise: float, white: bool) -> None:
    points, path = (repeated(30, noise, seed, white) for seed in (3, 4))
    joined = np.ones(len(path) - 1, bool)
    expected = [distance_by_hand(point, path, joined) for point in points[::300]]
    assert_near(distance_from_path(points, path, joined)[::300], np.array(expected))


def test_nothing_that_is_given_is_changed() -> None:
    path = np.array([[0.0, 0, 0], [0, 0, 0], [np.nan, 0, 0], [1, 0, 0]])
    points, joined = np.ones((2, 3)), np.ones(3, bool)
    before = path.copy()
    distance_from_path(points, path, joined)
    np.testing.assert_array_equal(path, before)
    assert joined.all()
    assert (points == 1.0).all()
