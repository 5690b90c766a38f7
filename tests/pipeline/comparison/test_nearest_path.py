"""Distance from a path, against a look at every piece of it; `measure.cases` has a point and a gap."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.path_distance import _distances, distance_from_path

Sides = tuple[FloatArray, FloatArray]

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


def assert_near(found: FloatArray, points: FloatArray, path: FloatArray, joined: NDArray[np.bool_]) -> None:
    """Never too small, and too large by no more than what is promised."""
    expected = np.array([distance_by_hand(point, path, joined) for point in points])
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
    points = data.draw(arrays(np.float64, (6, 3), elements=coordinates))
    assert_near(distance_from_path(points, path, joined), points, path, joined)


def long_path(far: float) -> Sides:
    """A log as far from a path with loops, corners and dwells as each of its points."""
    rng = np.random.default_rng(1)
    t = np.linspace(0, 40, 5000)
    path = np.column_stack([np.sin(0.9 * t), np.abs(np.cos(1.1 * t)), 0.2 * np.sin(5 * t)])
    path[500:900] = path[500]  # stands
    path[1500:1700] = path[1500] + rng.normal(0, 1e-6, (200, 3))  # stands and trembles
    points = path + far + rng.normal(0, 1e-4, path.shape)
    path[2000] = np.nan
    return points, path


def raster() -> Sides:
    """Points between the ends of long lines."""
    rows = np.arange(50)
    ends = np.where(rows % 2 == 0, 0.0, 1.0)
    path = np.column_stack([np.stack((ends, 1 - ends), 1).ravel(), np.repeat(rows * 0.001, 2), np.zeros(100)])
    return np.column_stack([np.full(40, 0.5), np.linspace(0, 0.049, 40), np.full(40, 0.0002)]), path


def circle() -> Sides:
    """Points in the middle of a circle, as far from every piece."""
    angle = np.cumsum(np.random.default_rng(2).uniform(3e-5, 9e-5, 100_000))
    path = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(100_000)])
    return np.random.default_rng(3).normal(0, 1e-7, (10_000, 3)), path


def trembling(digits: int) -> Sides:
    """A path that stands and trembles."""
    rng = np.random.default_rng(4)
    path = np.vstack([rng.normal(0, 1e-6, (3000, 3)), np.linspace((0, 0, 0), (0, 0, 10), 1000)]).round(digits)
    return rng.normal(0, 1e-6, (1000, 3)), path


def resting() -> Sides:
    path = np.vstack([np.linspace((0, 0, 0), (1, 0, 0), 100), np.tile([1.0, 0.0, 0.0], (20_000, 1))])
    return path + np.array([0, 0.001, 0]), path


def repeated(times: int, noise: float, white: bool) -> Sides:
    """Repetitions of one motion of 100 samples; the noise moves each of them whole, or each sample."""
    t = np.linspace(0, 2 * np.pi, 100)
    motion = np.column_stack([np.sin(t), np.cos(2 * t), 0.3 * np.sin(3 * t)])
    moved = np.random.default_rng(1).normal(0, noise, (2, times, 100 if white else 1, 3))
    points, path = (motion + moved).reshape(2, -1, 3)
    return points, path


NOISY = [(1e-5, False), (1e-5, True), (1e-4, False), (1e-4, True)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "given", "pairs"),
    [
        *((long_path, (far,), 5000) for far in (0.0, 0.01, 0.9)),
        (raster, (), 100),
        (circle, (), 100),
        *((trembling, (digits,), 2000) for digits in (6, 12)),  # not 4000
        (resting, (), 100),
        *((repeated, (30, *noise), 3000) for noise in NOISY),
    ],
)
def test_the_nearest_piece_is_found_among_few(
    make: Callable[..., Sides], given: tuple[float, ...], pairs: int
) -> None:
    """Pairs of a point and a piece, or of groups, per point; what is given stays as it is."""
    points, path = make(*given)
    joined = np.ones(len(path) - 1, bool)
    joined[len(path) // 2] = False
    for one in (points, path, joined):
        one.setflags(write=False)
    found, searched = _distances(points, path, joined)
    assert searched < pairs * len(points)
    some = slice(None, None, -(-len(points) // 20))
    assert_near(found[some], points[some], path, joined)


@pytest.mark.parametrize(
    ("times", "noise", "white", "factor"),
    [(3, 0.0, False, 12), (30, 0.0, False, 12), *((3, *noise, 36) for noise in NOISY)],
)
def test_ten_times_the_repetitions_make_far_less_than_a_hundred_times_the_pairs(
    times: int, noise: float, white: bool, factor: int
) -> None:
    few, many = (repeated(count, noise, white) for count in (times, 10 * times))
    pairs = [_distances(*sides, np.ones(len(sides[1]) - 1, bool))[1] for sides in (few, many)]
    assert pairs[1] <= factor * pairs[0]
