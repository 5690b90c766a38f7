"""In-between samples: k is right whatever their fraction, they are told, and repaired on the line."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.wraps import (
    FULL_TURN,
    MIN_DISTANCE,
    MIN_DISTANCE_RATIO,
    STEPS_AROUND,
    find_interpolated_samples,
    reinterpolate,
    repolarize,
)

TSP = 0.005
MOVE = 0.01  # rad a sample, 2 rad/s
FRACTIONS = np.arange(0.002, 1.0, 0.004)


def wrap(x: FloatArray) -> FloatArray:
    return np.asarray(x - FULL_TURN * np.floor((x + np.pi) / FULL_TURN), dtype=np.float64)


def with_in_between(fraction: FloatArray | float, direction: float) -> tuple[FloatArray, FloatArray, int]:
    """A motion over +-pi, its samples in the file, a column a fraction, and the sample on the jump."""
    x = np.tile(direction * (np.pi + MOVE * (np.arange(20) - 9.5)), (np.size(fraction), 1)).T
    q = wrap(x)
    q[10] = q[9] + fraction * (q[11] - q[9])
    return x, q, 10


def found_in_each(
    q: FloatArray, max_speed: float = math.inf
) -> tuple[FloatArray, list[list[int]], list[list[int]]]:
    """Repolarized values, in-between samples of each column by both passes, and unexplained steps."""
    t = TSP * np.arange(len(q), dtype=np.float64)
    result = repolarize(q, np.full(len(q), TSP), max_speed=max_speed)
    told = []
    for j, column in enumerate(q.T):
        here = np.flatnonzero(~np.isnan(column))
        wraps = np.searchsorted(here, result.rows[result.joints == j])
        beside = here[
            find_interpolated_samples(column[here], result.q[here, j], t[here], wraps, FULL_TURN)
        ].tolist()
        told.append(sorted({*result.in_between[result.in_between[:, 1] == j, 0].tolist(), *beside}))
    return result.q, told, result.unexplained.tolist()


def found_by_all(q: FloatArray, max_speed: float = math.inf) -> tuple[FloatArray, list[int], list[list[int]]]:
    """The same of one column."""
    out, told, unexplained = found_in_each(q[:, np.newaxis], max_speed)
    return out[:, 0], told[0], unexplained


@pytest.mark.slow
@pytest.mark.parametrize("max_speed", [math.inf, 4.0])
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("missing", [(), (9,), (11,), (7, 9, 11, 13), (8, 9), (11, 12)])
def test_k_is_right_after_the_pair_whatever_the_fraction(
    max_speed: float, direction: float, missing: tuple[int, ...]
) -> None:
    x, q, s = with_in_between(FRACTIONS, direction)
    q[list(missing)] = np.nan
    result = repolarize(q, np.full(len(q), TSP), max_speed=max_speed)
    rest = np.setdiff1d(np.arange(len(q)), [s, *missing])
    # wrapping and adding P once: a few units in the last place of 3
    np.testing.assert_allclose(result.q[rest], x[rest], rtol=0, atol=2e-15)
    assert result.unexplained.tolist() == []
    assert all(rows in ([], [s]) for rows in found_in_each(q[:, ::20], max_speed)[1])


@pytest.mark.parametrize("max_speed", [math.inf, 4.0])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_an_in_between_sample_is_told_where_it_stands_out_of_the_motion(
    max_speed: float, direction: float
) -> None:
    """By `MIN_DISTANCE_RATIO`, from either end of the jump: 4 x 0.01 rad of 6.28, 0.7 % of it."""
    seen = found_in_each(with_in_between(FRACTIONS, direction)[1], max_speed)[1]
    share = MIN_DISTANCE_RATIO * MOVE / FULL_TURN
    clear = np.minimum(FRACTIONS, 1.0 - FRACTIONS) > share + 0.002
    assert all(told == [10] for told, is_clear in zip(seen, clear, strict=True) if is_clear)
    assert sum(not told for told in seen) <= 2 * round(len(FRACTIONS) * share + 2)


def test_the_repolarized_in_between_sample_stays_until_it_is_repaired() -> None:
    s = 10
    t = np.cumsum(np.r_[0.0, TSP * (1.0 + np.arange(19) % 3)])  # uneven: the line is one in time
    x = np.pi + 2.0 * (t - t[s])
    q = wrap(x)
    q[s] = q[s - 1] + 0.4 * (q[s + 1] - q[s - 1])
    result = repolarize(q[:, np.newaxis], np.diff(t, prepend=0.0))
    assert result.q[s, 0] == q[s]
    assert result.in_between.tolist() == [[s, 0]]
    repaired = reinterpolate(result.q, t, result.in_between)
    np.testing.assert_allclose(repaired[:, 0], x, rtol=0, atol=3e-15)  # values of 3: units in the last place
    others = np.delete(np.arange(20), s)
    assert repaired[others].tobytes() == result.q[others].tobytes()


def test_repair_goes_past_missing_and_other_in_between_samples() -> None:
    x = np.array([[0.0], [9.0], [np.nan], [9.0], [4.0], [5.0]])
    repaired = reinterpolate(x, np.arange(6.0), np.array([[1, 0], [3, 0]]))
    np.testing.assert_array_equal(repaired[:, 0], [0.0, 1.0, np.nan, 3.0, 4.0, 5.0])


def test_a_wrap_followed_by_a_small_step_counts_once() -> None:
    q = np.array([3.1, -3.1, -3.0, -2.9, -2.9])
    out, told, unexplained = found_by_all(q)
    np.testing.assert_array_equal(out[1:], q[1:] + FULL_TURN)
    assert (told, unexplained) == ([], [])


def test_a_resampled_chatter_leaves_no_net_turn() -> None:
    q = np.array([3.1, 3.1, 0.0, -3.1, 0.1, 3.1, 0.2, -3.1, -3.1, 0.3, 3.1, 3.1])
    out, told, unexplained = found_by_all(q)
    assert out[-1] == 3.1
    assert told == [2, 4, 6, 9]
    assert unexplained == []


clean = st.tuples(
    st.floats(1e-6, 0.3), st.floats(0.0, 1.0), st.sampled_from([1.0, -1.0]), st.integers(0, 10**6)
)


@given(clean)
def test_clean_wraps_and_noise_are_not_told(motion: tuple[float, float, float, int]) -> None:
    """Even motion at any speed; and noise about +-pi of any size below P / 4 a step."""
    move, offset, direction, seed = motion
    x = np.asarray(direction * (np.pi + move * (np.arange(30) - 14.5 + offset)), dtype=np.float64)
    assert found_by_all(wrap(x))[1:] == ([], [])
    noise = np.random.default_rng(seed).uniform(np.pi - move, np.pi + move, 30)
    assert found_by_all(wrap(noise))[2] == []


def test_noise_about_the_limit_is_hardly_ever_told() -> None:
    """Noise is no motion: of 5e4 wraps of pure noise a handful looks like an in-between sample."""
    rng = np.random.default_rng(5)
    for spread in (1e-4, 0.01, 0.3):
        q = wrap(rng.normal(np.pi, spread, 100_000))
        wraps = len(repolarize(q[:, np.newaxis], np.full(len(q), TSP)).rows)
        told = found_by_all(q)[1]
        assert wraps > 45_000
        assert len(told) < 1e-3 * wraps, (spread, len(told))


def test_a_deviation_too_small_to_matter_is_not_told() -> None:
    q = np.full(20, np.pi - 1e-9)
    q[10:] = -np.pi + 1e-9
    q[10] += 0.9 * MIN_DISTANCE * FULL_TURN  # lies between, and nothing moves around it
    assert found_by_all(q)[1] == []
    q[10] += 0.2 * MIN_DISTANCE * FULL_TURN
    assert found_by_all(q)[1] == [10]


STILL = 12


def beside_a_wrap(deviation: float, t: FloatArray, moves: dict[int, float] | None = None) -> list[int]:
    """Judge a sample beside a wrap of a joint that stands still but for 8 over it and some steps around.

    The sample lies off the line of its neighbours, which is 4 above the one before, by a deviation.
    """
    period = 1024.0
    x = np.where(np.arange(2 * STILL) > STILL, 516.0, 508.0)
    for to, move in (moves or {}).items():
        x[to:] += move
        x -= x[STILL - 1] - 508.0  # the wrap stays where it is
    x[STILL] = 512.0 - deviation
    q = x - np.where(np.arange(2 * STILL) > STILL, period, 0.0)
    return [int(at) for at in find_interpolated_samples(q, x, t, indices(STILL + 1), period)]


def test_a_sample_is_off_the_line_beyond_four_times_half_the_way_of_its_neighbours() -> None:
    even = np.ldexp(np.arange(2.0 * STILL), -8)
    assert beside_a_wrap(MIN_DISTANCE_RATIO * 8.0 / 2.0, even) == []
    assert beside_a_wrap(MIN_DISTANCE_RATIO * 8.0 / 2.0 + 2.0**-40, even) == [STILL]


@pytest.mark.parametrize("offset", [*range(-6, 0), *range(2, 8)])
def test_four_steps_on_either_side_tell_how_fast_the_joint_moves(offset: int) -> None:
    """A step of 32 is eight times the speed over the wrap, where it counts; each takes its own time."""
    even = np.ldexp(np.arange(2.0 * STILL), -8)
    counts = offset in STEPS_AROUND
    assert counts == (-4 <= offset <= 5)
    for deviation, told in (
        (MIN_DISTANCE_RATIO * 8.0 / 2.0 + 1.0, not counts),
        (MIN_DISTANCE_RATIO * 32.0, not counts),
        (MIN_DISTANCE_RATIO * 32.0 + 1.0, True),
    ):
        assert beside_a_wrap(deviation, even, {STILL + offset: 32.0}) == [STILL] * told
    slower = even.copy()
    slower[STILL + offset :] += 2.0**-8  # twice the time for that step
    assert beside_a_wrap(MIN_DISTANCE_RATIO * 16.0 + 1.0, slower, {STILL + offset: 32.0}) == [STILL]
    assert beside_a_wrap(MIN_DISTANCE_RATIO * 16.0, slower, {STILL + offset: 32.0}) == [STILL] * (not counts)


def test_a_sample_is_told_though_a_wrap_leads_to_its_neighbour() -> None:
    q = np.array([-508.0, -508.0, -508.0, 508.0, 512.0 - 33.0, -508.0, -508.0, -508.0])
    x = q + 1024.0 * np.array([1, 1, 1, 0, 0, 1, 1, 1])
    # the joint goes 8 a sample there: 33 is more than four times that
    t = TSP * np.arange(8.0)
    assert find_interpolated_samples(q, x, t, indices(3, 5), 1024.0).tolist() == [4]


def test_a_sample_with_a_wrap_on_either_side_is_none() -> None:
    """It goes over the limit and comes back, or goes two turns on."""
    t = TSP * np.arange(5.0)
    for after, turns in ((16.0, 0), (2048.0, -2)):  # between its neighbours, and far off their line
        q = np.array([0.0, 0.0, after / 2.0 - 200.0 * (turns != 0), after, after])
        x = q + 1024.0 * np.array([0, 0, -1, turns, turns])
        assert find_interpolated_samples(q, x, t, indices(2, 3), 1024.0).tolist() == []
    q = np.array([-508.0, -508.0, 300.0, 508.0, 508.0])
    x = q + 1024.0 * np.array([0, 0, 0, -1, -1])
    assert find_interpolated_samples(q, x, t, indices(3), 1024.0).tolist() == [2]


def test_a_wrap_that_comes_late_is_clean() -> None:
    """A file of a little more than a period: it goes back by more than one, and noise brings it on again."""
    q = np.array([520.0, 520.0, 520.0, -516.0, -504.0, -504.0, -504.0])
    x = q + 1024.0 * np.array([0, 0, 0, 1, 1, 1, 1])
    assert find_interpolated_samples(q, x, TSP * np.arange(7.0), indices(3), 1024.0).tolist() == []


def test_the_second_sample_is_told_by_the_first() -> None:
    """It stands 100 off the line; the first step is the motion around the next one, 100 a sample."""
    q = np.array([508.0, 408.0, -516.0, -516.0, -516.0])
    x = q + 1024.0 * np.array([0, 0, 1, 1, 1])
    t = TSP * np.arange(5.0)
    assert find_interpolated_samples(q, x, t, indices(2), 1024.0).tolist() == [1]
    q = np.array([8.0, 508.0, 508.0, 408.0, -516.0, -516.0, -516.0, -516.0])
    x = q + 1024.0 * np.array([0, 0, 0, 0, 1, 1, 1, 1])
    t = TSP * np.arange(8.0)
    assert find_interpolated_samples(q, x, t, indices(4), 1024.0).tolist() == []
    assert find_interpolated_samples(q[1:], x[1:], t[1:], indices(3), 1024.0).tolist() == [2]


def test_the_first_and_the_last_sample_have_no_neighbours_at_the_other_end() -> None:
    """Between the last sample and the second stands the first; the last but one is told by the last."""
    q = np.array([300.0, -516.0, -516.0, -516.0, -516.0, -516.0, -516.0, 508.0])
    x = np.r_[300.0, np.full(7, 508.0)]
    assert find_interpolated_samples(q, x, TSP * np.arange(8.0), indices(1, 7), 1024.0).tolist() == []
    q = np.r_[np.full(6, 508.0), 300.0, -516.0]
    x = np.r_[np.full(6, 508.0), 300.0, 508.0]
    assert find_interpolated_samples(q, x, TSP * np.arange(8.0), indices(7), 1024.0).tolist() == [6]


def test_what_can_be_perceived_is_more_than_a_share_of_the_period() -> None:
    period = 1.0 / MIN_DISTANCE  # 2000, of which the share is 1
    for off, told in ((1.0, []), (1.0 + 2.0**-40, [3])):
        q = np.array([1000.0, 1000.0, 1000.0, 1000.0 - off, -1000.0, -1000.0, -1000.0])
        x = q + period * np.array([0, 0, 0, 0, 1, 1, 1])
        assert find_interpolated_samples(q, x, TSP * np.arange(7.0), indices(4), period).tolist() == told


def test_beyond_the_ends_of_a_log_nothing_moves() -> None:
    """The joint stands still, so that whatever can be perceived is off the line: 0.01 rad is."""
    q = np.full(7, np.pi - 1e-9)
    q[3:] = -np.pi + 1e-9
    q[3] += 0.01
    assert found_by_all(q)[1] == [3]


def indices(*values: int) -> IntArray:
    return np.array(values, dtype=np.int64)


def test_the_ends_of_a_log_have_no_neighbours_to_judge_by() -> None:
    q = np.array([3.1, -3.1])
    assert (
        find_interpolated_samples(
            q, np.array([3.1, 3.18]), np.array([0.0, TSP]), indices(1), FULL_TURN
        ).tolist()
        == []
    )
