"""The planes that cut a command path: where they lie, where cycles cross them, and where corners are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from repeated import Drawn, along, curve, eight, logs, overall, told, value, written
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.iso9283.result import CutPath, IsoTest

EXACT = 1e-12
"""In [m]: coordinates below 1 m are rounded by 1e-16, arc lengths of some 1000 pieces are sums of them."""


UP = np.array([0.0, 0.0, 1e-3])


def path_of(test: IsoTest) -> CutPath:
    assert test.path is not None
    return test.path


def circle(radius: float, middle: tuple[float, float] = (0.0, 0.0), rows: int = 4000) -> FloatArray:
    turn = np.linspace(0.0, 2.0 * np.pi, rows + 1)
    x, y = middle
    return np.column_stack((x + radius * np.cos(turn), y + radius * np.sin(turn), np.full_like(turn, 0.3)))


@pytest.mark.slow
@pytest.mark.parametrize("way", [(1.0, 0.0), (0.6, 0.8)])
def test_a_circle_run_eccentrically_by_e_is_off_by_e(way: tuple[float, float], tmp_path: Path) -> None:
    e = 1e-3
    reference = written(tmp_path / "command.csv", curve(circle(0.1), 0.1))
    done = [curve(circle(0.1, (e * way[0], e * way[1])), 0.1)] * 2
    test = told(reference, logs(tmp_path, done), planes=200)
    # A plane through the circle meets the other e cos(a) further out; of 200 planes one is at most 0.9 deg
    # from where that is e. Chords of rows 0.5 mm apart: 0.3 um of sagitta, the same on both sides.
    assert value(test, "AT") == pytest.approx(e, rel=0.01)
    assert value(test, "RT") == pytest.approx(0.0, abs=EXACT)


def test_points_are_interpolated_at_the_plane(tmp_path: Path) -> None:
    # Two cycles along y = 1 mm + 10 % of x and y = -1 mm - 10 % of x, a row each 20 mm at most: at a plane
    # at x they are at y = +-(1 mm + 0.1 x), half of which is the distance from their barycentre, 0.
    reference = written(tmp_path / "command.csv", along(((0, 0, 0), (0.3, 0, 0)), 0.1, rest=0.2))
    done = []
    for sign in (1.0, -1.0):
        start, end = (0.0, sign * 1e-3, 0.0), (0.3, sign * 0.031, 0.0)
        done.append(Drawn(*start).stay(40).to(15, *end).stay(40).values)
    test = told(reference, logs(tmp_path, done), planes=37)
    path = path_of(test)
    np.testing.assert_allclose(path.s, (np.arange(37) + 0.5) / 37 * 0.3, atol=EXACT)
    for k, x in enumerate(path.s):
        for cycle, sign in enumerate((1.0, -1.0)):
            np.testing.assert_allclose(path.crossed[cycle, k], (x, sign * (1e-3 + 0.1 * x), 0), atol=EXACT)
        assert value(test, "AT", f"plane {k + 1}") == pytest.approx(0.0, abs=EXACT)
        # distances 1 mm + 0.1 x twice: no spread of them
        assert value(test, "RT", f"plane {k + 1}") == pytest.approx(1e-3 + 0.1 * x, abs=EXACT)


def test_a_figure_eight_keeps_its_planes_in_order(tmp_path: Path) -> None:
    # Begun on a lobe, so that the crossing is passed twice; the second pass is off by 2 mm in z alone.
    points = np.concatenate((eight(0.2)[500:], eight(0.2)[1:501]))
    wanted = curve(points, 0.1)
    done = wanted.copy()
    half = np.arange(len(done)) > len(done) // 2
    done[half, 2] += 2e-3
    reference = written(tmp_path / "command.csv", wanted)
    test = told(reference, logs(tmp_path, [done] * 2), planes=100)
    off = path_of(test).crossed[0, :, 2] - path_of(test).command[:, 2]
    np.testing.assert_allclose(off[:49], 0.0, atol=EXACT)
    np.testing.assert_allclose(off[51:], 2e-3, atol=EXACT)
    np.testing.assert_allclose(path_of(test).accuracy, np.abs(off), atol=EXACT)


def test_the_same_line_twice_in_one_direction_keeps_its_planes_in_order(tmp_path: Path) -> None:
    # From (0, 0) to (0.2, 0) and around on one side, then the same line again and around on the other:
    # 1.4 m. From the second time on, after 0.8 m, the cycle is 3 mm above the command.
    one, other = ((0.2, 0.2, 0), (0, 0.2, 0)), ((0.2, -0.1, 0), (0, -0.1, 0))
    line = ((0, 0, 0), (0.2, 0, 0))
    wanted = along((*line, *one, *line, *other, (0, 0, 0)), 0.1, rest=0.2)
    done = wanted.copy()
    done[40 + 1600 + 1 :, 2] += 3e-3  # rows of 0.5 mm behind the rest of 40 rows
    reference = written(tmp_path / "command.csv", wanted)
    path = path_of(told(reference, logs(tmp_path, [done] * 2), planes=40))
    assert path.total == pytest.approx(1.4, abs=EXACT)
    np.testing.assert_allclose(path.crossed[0, :, 2], np.where(path.s > 0.8, 3e-3, 0.0), atol=EXACT)


@pytest.mark.slow
@pytest.mark.parametrize(("tick", "speed"), [(0.001, 0.1), (0.008, 0.1), (0.004, 0.05), (0.005, 0.3)])
def test_another_rate_and_another_speed_cross_at_the_same_places(
    tick: float, speed: float, tmp_path: Path
) -> None:
    corners = ((0, 0, 0.2), (0.24, 0, 0.2), (0.24, 0.24, 0.2), (0.48, 0.24, 0.2))
    # 0.24 m are whole rows of each rate and speed: the corners are rows.
    rows = 0.24 / speed / tick
    assert rows == pytest.approx(round(rows), abs=1e-9)
    reference = written(tmp_path / "command.csv", along(corners, 0.1, rest=0.2))
    values = along(corners, speed, rest=0.2, tick=tick) + UP
    done = [
        written(tmp_path / f"{k}.csv", values, tick * np.arange(len(values))) for k in range(2)
    ]  # a cycle alone tells no spread
    test = told(reference, done, planes=30)
    path = path_of(test)
    np.testing.assert_allclose(path.crossed[0], path.command + UP, atol=EXACT)
    values_of = overall(test)
    assert values_of["AT"] == pytest.approx(1e-3, abs=EXACT)
    assert values_of["RT"] == pytest.approx(0.0, abs=EXACT)
    # Differences of times near 20 s, known to 1 ns and taken over 1.2 s.
    assert values_of["AV"] == pytest.approx(speed / 0.1 - 1.0, abs=1e-8)


def bent(degrees: float) -> FloatArray:
    """A path of two legs with a turn at a row, shape (n, 3)."""
    turn = np.radians(degrees)
    end = (0.2 + 0.2 * np.cos(turn), 0.2 * np.sin(turn), 0.0)
    return along(((0, 0, 0), (0.2, 0, 0), end), 0.1, rest=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(("degrees", "count"), [(29, 0), (31, 1), (90, 1), (150, 1), (180, 1)])
def test_a_corner_turns_by_30_degrees_or_more(degrees: float, count: int, tmp_path: Path) -> None:
    values = bent(degrees)
    reference = written(tmp_path / "command.csv", values)
    corners = path_of(told(reference, logs(tmp_path, [values] * 2))).corners
    assert len(corners) == count
    for one in corners:
        np.testing.assert_allclose(one.point, (0.2, 0, 0), atol=EXACT)
        assert one.rounding == pytest.approx(0.0, abs=EXACT)


def rounded(duration: float, tick: float) -> FloatArray:
    """A path at 0.1 m/s that turns by 90 deg, evenly within a time, sampled each tick, shape (n, 3)."""
    t = np.arange(0.0, 4.0 + duration + tick / 2.0, tick)
    share = np.clip((t - 2.0) / duration, 0.0, 1.0) * np.pi / 2.0
    radius = 0.1 * duration / (np.pi / 2.0)
    x = np.where(t < 2.0, 0.1 * t, 0.2 + radius * np.sin(share))
    y = radius * (1.0 - np.cos(share)) + np.maximum(t - 2.0 - duration, 0.0) * 0.1
    still_rows = round(0.2 / tick)
    path = np.column_stack((x, y, np.zeros_like(x)))
    return np.concatenate(
        (np.repeat(path[:1], still_rows, axis=0), path, np.repeat(path[-1:], still_rows, axis=0))
    )


@pytest.mark.slow
@pytest.mark.parametrize(("duration", "count"), [(0.002, 1), (0.004, 1), (0.02, 0), (0.05, 0)])
def test_a_turn_within_4_ms_is_one_corner_over_20_ms_none(
    duration: float, count: int, tmp_path: Path
) -> None:
    tick = 0.001
    values = rounded(duration, tick)
    t = tick * np.arange(len(values))
    reference = written(tmp_path / "command.csv", values, t)
    done = [written(tmp_path / f"{k}.csv", values, t) for k in range(2)]
    corners = path_of(told(reference, done)).corners
    assert len(corners) == count
    for one in corners:  # where the straight legs meet: r beyond the end of the first
        radius = 0.1 * duration / (np.pi / 2.0)
        np.testing.assert_allclose(one.point, (0.2 + radius, 0.0, 0.0), atol=1e-9)


ZONED = ((0, 0, 0), (0.2, 0, 0), (0.2, 0.3, 0), (0.1, 0.3, 0))
"""Legs of 0.2, 0.3 and 0.1 m: zones of 0.02 m about 0.2, of 0.01 m about 0.5, 0.54 m are free."""


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 7, 50, 500])
def test_planes_lie_even_in_all_that_is_in_no_zone(count: int, tmp_path: Path) -> None:
    values = along(ZONED, 0.1, rest=0.2)
    reference = written(tmp_path / "command.csv", values)
    path = path_of(told(reference, logs(tmp_path, [values] * 2), planes=count))
    assert len(path.s) == count and path.total == pytest.approx(0.6, abs=EXACT)
    free = (np.arange(count) + 0.5) / count * 0.54
    wanted = np.where(free < 0.18, free, np.where(free < 0.45, free + 0.04, free + 0.06))
    np.testing.assert_allclose(path.s, wanted, atol=EXACT)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.1, 1.0])
def test_no_plane_lies_in_a_zone(speed: float, tmp_path: Path) -> None:
    values = along(ZONED, speed, rest=0.2)
    reference = written(tmp_path / "command.csv", values)
    s = path_of(told(reference, logs(tmp_path, [values] * 2), planes=500)).s
    # Even in 0.54 m: 1.08 mm apart, so that each zone is left out to that.
    for corner, zone in ((0.2, 0.02), (0.5, 0.01)):
        assert np.abs(s - corner).min() >= zone - EXACT
        assert np.abs(s - corner).min() <= zone + 1.08e-3
    assert (np.diff(s) > 0.0).all() and s[0] > 0.0 and s[-1] < 0.6


def test_a_stop_is_no_corner(tmp_path: Path) -> None:
    values = along(ZONED, 0.1, rest=0.2, rests=[1, 2])
    reference = written(tmp_path / "command.csv", values)
    path = path_of(told(reference, logs(tmp_path, [values] * 2), planes=6))
    assert not path.corners
    np.testing.assert_allclose(path.s, (np.arange(6) + 0.5) * 0.1, atol=EXACT)


@pytest.mark.parametrize(
    ("corners", "count", "s"),  # of even planes one is at a corner with a rest, at 0.5 m and 0.2 m
    [(ZONED, 3, (0.1, 0.3, 0.4)), (((0, 0, 0), (0.2, 0, 0), (0, 0, 0)), 1, (0.1,))],
)
def test_a_plane_at_a_stop_where_the_path_turns_off_moves_back(
    corners: Sequence[Sequence[float]], count: int, s: tuple[float, ...], tmp_path: Path
) -> None:
    values = along(corners, 0.1, rest=0.2, rests=range(1, len(corners) - 1))
    reference = written(tmp_path / "command.csv", values)
    cycles = [values + offset * np.array([1.0, 1.0, 0.0]) for offset in (-1e-3, 1e-3)]
    test = told(reference, logs(tmp_path, cycles), planes=count)
    assert not test.failed_cycles
    np.testing.assert_allclose(path_of(test).s, s, atol=EXACT)


def test_a_cycle_that_turns_back_before_a_plane_is_left_out(tmp_path: Path) -> None:
    wanted = along(((0, 0, 0), (0.3, 0, 0)), 0.1, rest=0.2)
    short = along(((0, 0, 0), (0.28, 0, 0)), 0.1, rest=0.2)
    reference = written(tmp_path / "command.csv", wanted)
    test = told(reference, logs(tmp_path, [wanted, short, wanted]), planes=50)
    assert [one.name for one in test.cycles] == ["cycle1", "cycle3"]


def test_a_cycle_that_comes_back_a_little_is_taken_where_it_is_nearest(tmp_path: Path) -> None:
    # The plane at 0.15 m is crossed twice, at y = 2 mm first, at y = 0 after coming back by 10 mm.
    wanted = along(((0, 0, 0), (0.3, 0, 0)), 0.1, rest=0.2)
    done = Drawn(0, 0, 0).stay(40).to(300, 0.145, 0.002, 0).to(20, 0.155, 0.002, 0)
    done.to(20, 0.145, 0, 0).to(300, 0.3, 0, 0).stay(40)
    reference = written(tmp_path / "command.csv", wanted)
    path = path_of(told(reference, logs(tmp_path, [done.values] * 2), planes=1))
    np.testing.assert_allclose(path.crossed[0, 0], (0.15, 0, 0), atol=EXACT)
    assert path.s[0] == pytest.approx(0.15, abs=EXACT)


SQUARE = ((0, 0, 0.4), (0.2, 0, 0.4), (0.2, 0.2, 0.4), (0, 0.2, 0.4), (0, 0, 0.4))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("noise", [1e-6, 1e-5, 5e-5])
def test_a_reference_with_noise_keeps_its_corners_legs_and_poses(
    noise: float, seed: int, tmp_path: Path
) -> None:
    wanted = along(SQUARE, 0.1)
    noisy = wanted + np.random.default_rng(seed + 2).normal(0.0, noise, wanted.shape)
    reference = written(tmp_path / "command.csv", noisy)
    test = told(reference, logs(tmp_path, [wanted] * 2))
    assert len(path_of(test).corners) == 3
    assert len(path_of(test).legs) == 4
    assert test.to_dict()["poses"] == 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_noise_of_a_reference_tells_no_other_speed(seed: int, tmp_path: Path) -> None:
    wanted = along(SQUARE, 0.2)
    noisy = wanted + np.random.default_rng(seed).normal(0.0, 1e-4, wanted.shape)
    reference = written(tmp_path / "command.csv", noisy)
    test = told(reference, logs(tmp_path, [wanted] * 2))
    # Both ends of a middle half of 0.1 m are off by 0.1 mm: 0.14 % of it, four times that is chance of 1e-4.
    assert abs(value(test, "AV")) < 0.006
