"""Wraps: the repolarizer, in-between samples, and continuous orientations."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import casadi
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_np
from numpy.typing import NDArray

from urmpipe_models.elementwise import BLOCK, FloatArray
from urmpipe_models.math3d import FORMS, RotationForm, from_rpy, to_quaternions
from urmpipe_models.wraps import (
    FULL_TURN,
    MIN_DISTANCE,
    MIN_DISTANCE_RATIO,
    STEPS_AROUND,
    WrapState,
    find_interpolated_samples,
    max_step,
    reinterpolate,
    repolarize,
    repolarize_sample,
    unwrap_euler,
    unwrap_orientations,
    unwrap_quaternions,
    unwrap_rotation_vectors,
)

SHARED = Path(__file__).resolve().parents[2].parent / "shared"
TSP = 0.005


def wrap(x: FloatArray, period: float = FULL_TURN) -> FloatArray:
    """Limit to +-period/2, as an environment with limited joints does."""
    return x - period * np.floor((x + period / 2.0) / period)


class Stepped(NamedTuple):
    """Results of `repolarize_sample`; `unexplained` without steps to what are in-between samples later."""

    out: FloatArray
    changes: FloatArray
    unexplained: NDArray[np.bool_]
    in_between: list[int]
    state: WrapState


def run_steps(q: Iterable[float], dt: Iterable[float], **options: float) -> Stepped:
    """Run `repolarize_sample` over a log of one joint."""
    state, rows, unexplained, in_between, last = WrapState(), [], [], [], -1
    for i, (value, elapsed) in enumerate(zip(q, dt, strict=True)):
        state, result, flags = repolarize_sample(state, value, elapsed, **options)
        rows.append((result, flags.change))
        unexplained.append(bool(flags.unexplained))
        if flags.in_between:
            in_between.append(last)
            unexplained[last] = False
        last = last if math.isnan(value) else i
    out, changes = np.array(rows, dtype=float).T.copy()
    return Stepped(out, changes, np.array(unexplained), in_between, state)


motions = st_np.arrays(
    float, st.tuples(st.integers(2, 200), st.integers(1, 4)), elements=st.floats(-1.5, 1.5)
)  # each step below a quarter turn, pi / 2 = 1.57


@settings(max_examples=50, deadline=None)
@given(motions, st.sampled_from([FULL_TURN, 360.0]))
def test_unwrapping_a_wrapped_motion_gives_it_back(steps: FloatArray, period: float) -> None:
    x = np.cumsum(steps, axis=0) * (period / FULL_TURN)
    x -= period * np.round(x[0] / period)  # the turns before the log began cannot be known
    result = repolarize(wrap(x, period), np.full(len(x), TSP), period=period)
    # wrapping and adding P k each round once; values reach 300 rad (17 200 deg): one unit in the last place
    np.testing.assert_allclose(result.q, x, rtol=0, atol=4e-14 * period * 50)
    assert len(result.unexplained) == 0


values = st.one_of(st.floats(-7, 7), st.sampled_from([-3.14, -1.57, 0.0, 1.57, 3.14]))  # halves and quarters


@pytest.mark.slow
@given(
    st_np.arrays(float, st.tuples(st.integers(1, 120), st.integers(1, 3)), elements=values),
    st_np.arrays(bool, (120, 3), elements=st.sampled_from([False, False, False, True])),
    st.sampled_from([math.inf, 3.0, 300.0]),
    st.floats(0.001, 0.1),
)
@settings(max_examples=50, deadline=None)
def test_the_batch_is_the_steps_bit_for_bit(
    q: FloatArray, missing: NDArray[np.bool_], max_speed: float, period_of_samples: float
) -> None:
    q = np.where(missing[: len(q), : q.shape[1]], np.nan, q)
    dt = period_of_samples * (1.0 + np.arange(len(q), dtype=np.float64) % 3)
    periods = np.array([FULL_TURN, 4.0, 2.0 * FULL_TURN])[: q.shape[1]]
    assert_batch_is_the_steps(q, dt, periods, max_speed)


def assert_batch_is_the_steps(q: FloatArray, dt: FloatArray, periods: FloatArray, max_speed: float) -> None:
    """Compare `repolarize` with `repolarize_sample` by joint; its lists are sorted by row and joint."""
    batch = repolarize(q, dt, period=periods, max_speed=max_speed)
    assert batch.change.dtype == np.int64
    for rows in (np.column_stack((batch.rows, batch.joints)), batch.unexplained, batch.in_between):
        assert rows.tolist() == sorted(rows.tolist())
    for j in range(q.shape[1]):
        single = run_steps(q[:, j], dt, period=float(periods[j]), max_speed=max_speed)
        assert single.out.tobytes() == np.ascontiguousarray(batch.q[:, j]).tobytes()
        of_joint = batch.joints == j
        assert np.array_equal(np.flatnonzero(single.changes), batch.rows[of_joint])
        assert np.array_equal(single.changes[single.changes != 0], batch.change[of_joint])
        assert np.array_equal(
            np.flatnonzero(single.unexplained), batch.unexplained[batch.unexplained[:, 1] == j, 0]
        )
        assert single.in_between == batch.in_between[batch.in_between[:, 1] == j, 0].tolist()


NAN, TURNS = math.nan, FULL_TURN * np.arange(9.0)


@pytest.mark.parametrize(
    "q",
    [
        [3.0 - TURNS / 2],  # half a turn a sample: each second sample is in between, and no step counts twice
        [3.0 + TURNS / 2, 3.0 - np.insert(TURNS, 0, 0.0)[:9] / 2],
        [3.0 - TURNS * 0.4, -3.0 + TURNS * 0.6],
        # the last step judged of one joint and the first of the next both end a pair, a row apart
        [3.0 - FULL_TURN * np.array([0.0, 0.8, 1.0, 1.0]), 3.0 - FULL_TURN * np.array([0.0, 0.0, 0.2, 1.0])],
        [3.0 - FULL_TURN * np.array([0.0, 0.0, 0.8, 1.0])],  # the small half comes last in the log
        [
            3.0 - FULL_TURN * np.array([0.0, 0.2, 1.0, 1.2, 1.2])
        ],  # a large step ends one pair and begins no other
        [[0.0, FULL_TURN - 1.0, FULL_TURN - 1.0]],  # nothing stands before the first step
        # two pairs share the large half, which is the first step judged of all
        [3.0 - FULL_TURN * np.array([0.0, 0.24, 0.98, 1.22])],
        [[3.0, NAN, 3.0 - FULL_TURN / 2, NAN, NAN, 3.0 - FULL_TURN, 3.0]],
        [
            [NAN, 3.0, NAN, 3.0 - FULL_TURN, NAN, NAN, 3.0, NAN, NAN, NAN, 3.0 - FULL_TURN],
            [0.0, 4.0, 8.0] * 3 + [4.0] * 2,
        ],
    ],
)
@pytest.mark.parametrize("max_speed", [math.inf, 1.0])
def test_pairs_of_steps_and_gaps_are_the_same_in_the_batch(q: list[FloatArray], max_speed: float) -> None:
    values = np.array(q).T
    dt = 0.01 * (1.0 + np.arange(len(values), dtype=np.float64) % 3)
    dt[0] = NAN  # is not used
    assert_batch_is_the_steps(values, dt, np.array([FULL_TURN, FULL_TURN])[: len(q)], max_speed)


def test_nothing_stands_before_the_first_step_whatever_time_the_first_row_gives() -> None:
    """The step misses a whole turn by 1.7 rad, more than P / 4; one of 1 rad before it would make it up."""
    q = np.array([[0.0], [FULL_TURN - 1.7], [FULL_TURN - 1.7]])
    result = repolarize(q, np.full(3, TSP))
    assert result.q.tobytes() == q.tobytes()
    assert result.unexplained.tolist() == [[1, 0]]
    assert result.in_between.tolist() == []


@pytest.mark.parametrize("gap", [0, 1, 2, 3, 4])
def test_all_the_time_of_a_gap_counts_for_what_a_joint_can_have_moved(gap: int) -> None:
    """Over the gap the joint moves 0.5 rad beyond a whole turn, and has just time for that at its speed."""
    q = np.array([[2.0], [2.0], *[[NAN]] * gap, [2.0 - FULL_TURN + 0.5], [2.0 - FULL_TURN + 0.5]])
    dt = np.ldexp(0.01, np.arange(len(q)))  # each row's time is told apart from all others'
    just = 0.5 / dt[2 : 3 + gap].sum()
    assert repolarize(q, dt, max_speed=just * (1.0 + 1e-9)).rows.tolist() == [2 + gap]
    assert repolarize(q, dt, max_speed=just * (1.0 - 1e-9)).rows.tolist() == []


def test_a_log_of_many_blocks_is_judged_across_their_edges() -> None:
    """Wraps on both sides of each edge of a block, and far from any."""
    x = np.zeros((3 * BLOCK + 100, 2))
    for edge in (BLOCK, 2 * BLOCK, 3 * BLOCK):
        x[edge - 1 :, 0] += 1.0
        x[edge:, 1] += 1.0
        x[edge + 1 :, 0] += 1.0
        x[edge + 50 :] += 1.0
    x = 2.9 + np.where(x % 2 == 1.0, 0.5, 0.0)  # 2.9 and 3.4 in turn: each step crosses pi
    result = repolarize(wrap(x), np.full(len(x), TSP))
    # wrapping and adding P k each round once, of 3.4: a unit in the last place is 4.4e-16
    np.testing.assert_allclose(result.q, x, rtol=0, atol=1e-15)
    at, joints = np.nonzero(np.diff(x, axis=0))
    assert result.rows.tolist() == (at + 1).tolist()
    assert result.joints.tolist() == joints.tolist()


def test_a_step_of_just_a_quarter_of_the_period_needs_no_explanation() -> None:
    q, above = np.array([[0.0], [1.0], [0.0]]), np.nextafter(1.0, 2.0)
    assert repolarize(q, np.full(3, TSP), period=4.0).unexplained.tolist() == []
    assert repolarize(q * above, np.full(3, TSP), period=4.0).unexplained.tolist() == [[1, 0], [2, 0]]
    assert not repolarize_sample(WrapState(0.0, seen=1.0), 1.0, TSP, period=4.0)[2].unexplained
    assert repolarize_sample(WrapState(0.0, seen=1.0), above, TSP, period=4.0)[2].unexplained


def test_values_that_are_no_joint_values_are_missing_and_warn_of_nothing() -> None:
    q = np.array([[3.0, 3.0, 3.0], [1e308, np.inf, np.nan], [1e308, -np.inf, np.nan], [-3.0, -3.0, -3.0]])
    with np.errstate(all="raise"):
        result = repolarize(q, np.full(4, TSP))
    assert result.rows.tolist() == [3, 3, 3]
    assert len(result.unexplained) == 0
    assert repolarize_sample(WrapState(), 1e300, TSP)[0].seen == 0.0  # at the bound already


@pytest.mark.parametrize("value", [1e300, -1e300, 1e301, np.nextafter(1e300, 0.0), -np.nextafter(1e300, 0.0)])
def test_a_value_is_missing_from_the_bound_on_in_the_batch_as_in_the_steps(value: float) -> None:
    """Though the column beside it misses none: over a missing value a step is a wrap."""
    q = np.array([[3.0, value, -3.0, -3.0], [3.0, 3.0, 3.0, 3.0]]).T
    with np.errstate(over="ignore"):  # a product of steps of almost 1e300
        assert_batch_is_the_steps(q, np.full(4, TSP), np.full(2, FULL_TURN), math.inf)
        wraps = repolarize(q, np.full(4, TSP)).rows.tolist()
    assert wraps == ([2] if abs(value) >= 1e300 else [])


def test_before_the_first_repolarization_nothing_changes_by_a_bit() -> None:
    q = np.array([[-0.0], [1.0], [2.5], [3.1], [-3.1], [-3.0]])
    result = repolarize(q, np.full(6, TSP))
    assert result.q[:4].tobytes() == q[:4].tobytes()
    assert result.rows.tolist() == [4]
    assert result.change.tolist() == [1]
    assert result.q[4, 0] == -3.1 + FULL_TURN


def test_many_turns_in_both_directions_come_back() -> None:
    x = np.concatenate([np.linspace(0, 40, 400), np.linspace(40, -40, 800)])
    result = repolarize(wrap(x)[:, np.newaxis], np.full(len(x), TSP))
    np.testing.assert_allclose(result.q[:, 0], x, rtol=0, atol=3e-14)  # 40 rad: a few units in the last place
    assert result.change.sum() == -6  # from turn 0 to turn -6 (40 / 2 pi = 6.37)
    assert len(result.rows) == 6 + 6 + 6


def test_a_step_larger_than_pi_that_is_no_wrap_stays_and_is_flagged() -> None:
    q = np.array([[5.0], [1.0], [1.1], [-10.8], [-10.7]])
    result = repolarize(q, np.full(5, TSP))
    assert result.q.tobytes() == q.tobytes()
    assert result.unexplained.tolist() == [[1, 0], [3, 0]]


def test_a_speed_limit_narrows_what_counts_as_a_wrap() -> None:
    q = np.array([[3.0], [3.0 - FULL_TURN + 0.5]])
    dt = np.full(2, 0.1)
    assert repolarize(q, dt).change.tolist() == [1]
    assert repolarize(q, dt, max_speed=4.0).change.tolist() == []  # 0.5 rad in 0.1 s is 5 rad/s
    assert max_step(0.1, FULL_TURN, 4.0) == 0.4
    assert max_step(10.0, FULL_TURN, 4.0) == FULL_TURN / 4


def test_missing_samples_keep_the_turns_and_give_more_time() -> None:
    q = np.array([[3.1], [-3.1], [np.nan], [np.nan], [-3.13], [2.6]])
    result = repolarize(q, np.full(6, 0.1), max_speed=2.0)
    assert np.isnan(result.q[2:4]).all()
    np.testing.assert_array_equal(result.q[4], -3.13 + FULL_TURN)
    assert result.change.tolist() == [1]  # back from -3.13 to 2.6 would take 5.5 rad/s: not explained
    assert result.unexplained.tolist() == [[5, 0]]


def test_chatter_on_the_limit_leaves_no_net_turn() -> None:
    q = np.array([[3.14], [-3.14], [3.14], [-3.14], [3.14]])
    result = repolarize(q, np.full(5, TSP))
    assert result.change.tolist() == [1, -1, 1, -1]
    assert result.q[-1, 0] == 3.14


def test_the_step_remembers_the_last_step_in_the_turns_of_now() -> None:
    state = run_steps([3.0, math.nan, -3.0, math.nan], [TSP] * 4).state
    assert state == WrapState(-3.0, -6.0 + FULL_TURN, 2 * TSP, 1.0, TSP, 1.0)


@pytest.mark.parametrize("shape", [(0, 3), (1, 3), (5, 0)])
def test_empty_logs_pass_through(shape: tuple[int, int]) -> None:
    assert repolarize(np.zeros(shape), np.zeros(shape[0])).q.shape == shape


def test_the_step_traces_with_casadi() -> None:
    casadi.GlobalOptions.setNumpyMode(-1)
    state = WrapState(*casadi.SX.sym("state", 6).elements())
    inputs = casadi.SX.sym("input", 4)
    q, dt, period, speed = inputs.elements()
    following, out, flags = repolarize_sample(state, q, dt, period=period, max_speed=speed)
    traced = casadi.Function("step", [casadi.vertcat(*state), inputs],
                             [casadi.vertcat(*following), casadi.vertcat(out, *flags)])  # fmt: skip
    rng = np.random.default_rng(7)
    memory = WrapState()
    on_the_jump = [3.1, 0.2, -3.1, math.nan, 0.1, 3.1]
    for value in [*wrap(np.cumsum(rng.uniform(-1.5, 1.5, 300))), math.nan, 1.0, 5.0, 2.0, *on_the_jump]:
        expected_state, expected, expected_flags = repolarize_sample(memory, value, TSP, max_speed=1e4)
        got_state, got = traced([float(x) for x in memory], [value, TSP, FULL_TURN, 1e4])
        np.testing.assert_array_equal(np.ravel(got_state), np.array(expected_state, dtype=float))
        np.testing.assert_array_equal(np.ravel(got), np.array([expected, *expected_flags], dtype=float))
        memory = WrapState(*(float(x) for x in expected_state))


@pytest.mark.skipif(not SHARED.is_dir(), reason="the real logs of ../shared are not there")
def test_real_jumps_of_a_real_log_stay() -> None:
    """fake_joints.csv: -3.99 rad and 11.9 rad (and back) are no wraps; numpy.unwrap moves them."""
    path = SHARED / "logs" / "plotjuggler" / "fake_joints.csv"
    header = path.read_text().splitlines()[0].split(",")
    columns = [header.index(f"field.position{i}") for i in range(6)]
    q = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=columns)
    result = repolarize(q, np.full(len(q), 0.001))
    assert result.q.tobytes() == q.tobytes()
    assert result.unexplained.tolist() == [[1, 0], [1411, 3], [1412, 3]]
    assert not np.array_equal(np.unwrap(q[:, 0]), q[:, 0])


MOVE = 0.01  # rad a sample, 2 rad/s
FRACTIONS = np.arange(0.002, 1.0, 0.004)


def with_in_between(fraction: FloatArray | float, direction: float) -> tuple[FloatArray, FloatArray, int]:
    """A motion over +-pi, its samples in the file, a column a fraction, and the sample on the jump."""
    x = np.tile(direction * (np.pi + MOVE * (np.arange(20) - 9.5)), (np.size(fraction), 1)).T
    q = wrap(x)
    q[10] = q[9] + fraction * (q[11] - q[9])
    return x, q, 10


def find(q: Any, x: Any, t: Any, *wraps: int, period: float = 1024.0) -> list[int]:
    """Return the in-between samples of a joint, by default of period 1024 in steps of `TSP`."""
    times: FloatArray = TSP * np.arange(float(len(q))) if t is None else t
    indices = np.array(wraps, dtype=np.int64)
    return [*map(int, find_interpolated_samples(np.array(q), np.array(x), times, indices, period))]


def found_in_each(
    q: FloatArray, max_speed: float = math.inf
) -> tuple[FloatArray, list[list[int]], list[list[int]]]:
    """Return repolarized values, in-between samples of each column by both passes, and unexplained steps."""
    t = TSP * np.arange(len(q), dtype=np.float64)
    result = repolarize(q, np.full(len(q), TSP), max_speed=max_speed)
    samples = []
    for j, column in enumerate(q.T):
        here = np.flatnonzero(~np.isnan(column))
        wraps = np.searchsorted(here, result.rows[result.joints == j])
        found = here[find(column[here], result.q[here, j], t[here], *wraps, period=FULL_TURN)].tolist()
        samples.append(sorted({*result.in_between[result.in_between[:, 1] == j, 0].tolist(), *found}))
    return result.q, samples, result.unexplained.tolist()


def found_by_all(q: FloatArray, max_speed: float = math.inf) -> tuple[FloatArray, list[int], list[list[int]]]:
    """Return the same of one column."""
    out, samples, unexplained = found_in_each(q[:, np.newaxis], max_speed)
    return out[:, 0], samples[0], unexplained


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
    return find(q, x, t, STILL + 1, period=period)


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


@pytest.mark.parametrize(
    ("q", "turns", "wraps", "samples"),
    [
        # a wrap leads to its neighbour: the joint moves 8 per sample there, 33 is more than four times that
        ([-508, -508, -508, 508, 512 - 33, -508, -508, -508], [1, 1, 1, 0, 0, 1, 1, 1], [3, 5], [4]),
        # a wrap on either side: over the limit and back, or two turns; then one wrap alone
        ([0, 0, 8, 16, 16], [0, 0, -1, 0, 0], [2, 3], []),
        ([0, 0, 824, 2048, 2048], [0, 0, -1, -2, -2], [2, 3], []),
        ([-508, -508, 300, 508, 508], [0, 0, 0, -1, -1], [3], [2]),
        # a late wrap is clean: the log covers a little more than a period, and noise continues it
        ([520, 520, 520, -516, -504, -504, -504], [0, 0, 0, 1, 1, 1, 1], [3], []),
        # the second sample is 100 off the line; so is the first step, if there is a step before
        ([508, 408, -516, -516, -516], [0, 0, 1, 1, 1], [2], [1]),
        ([8, 508, 508, 408, -516, -516, -516, -516], [0, 0, 0, 0, 1, 1, 1, 1], [4], []),
        ([508, 508, 408, -516, -516, -516, -516], [0, 0, 0, 1, 1, 1, 1], [3], [2]),
        # first and last sample have no neighbour; the last but one is judged by the last
        ([300, -516, -516, -516, -516, -516, -516, 508], [0, 1, 1, 1, 1, 1, 1, 0], [1, 7], []),
        ([508, 508, 508, 508, 508, 508, 300, -516], [0, 0, 0, 0, 0, 0, 0, 1], [7], [6]),
    ],
)
def test_only_a_sample_between_neighbours_and_far_off_their_line_is_found(
    q: list[float], turns: list[int], wraps: list[int], samples: list[int]
) -> None:
    assert find(q, np.array(q) + 1024.0 * np.array(turns), None, *wraps) == samples


def test_what_can_be_perceived_is_more_than_a_share_of_the_period() -> None:
    period = 1.0 / MIN_DISTANCE  # 2000, of which the share is 1
    for off, told in ((1.0, []), (1.0 + 2.0**-40, [3])):
        q = np.array([1000.0, 1000.0, 1000.0, 1000.0 - off, -1000.0, -1000.0, -1000.0])
        x = q + period * np.array([0, 0, 0, 0, 1, 1, 1])
        assert find(q, x, None, 4, period=period) == told


def test_beyond_the_ends_of_a_log_nothing_moves() -> None:
    """The joint stands still, so that whatever can be perceived is off the line: 0.01 rad is."""
    q = np.full(7, np.pi - 1e-9)
    q[3:] = -np.pi + 1e-9
    q[3] += 0.01
    assert found_by_all(q)[1] == [3]


def test_the_ends_of_a_log_have_no_neighbours() -> None:
    assert find([3.1, -3.1], [3.1, 3.18], None, 1, period=FULL_TURN) == []


SIZE = 1e-13  # angles to 20 rad are wrapped and back, two roundings of 4e-15, then sine and cosine

steps = st.lists(st.tuples(*[st.floats(-0.3, 0.3)] * 3), min_size=1, max_size=60)


def rotation_matrices(angles: FloatArray) -> FloatArray:
    return np.array([np.array(from_rpy(rx, ry, rz).rotation, dtype=float) for rz, ry, rx in angles])


@settings(max_examples=40, deadline=None)
@given(steps, st.lists(st.booleans(), min_size=60, max_size=60))
def test_quaternions_of_any_sign_become_continuous(moves: list[tuple[float, ...]], flips: list[bool]) -> None:
    true = np.cumsum(np.array([[0.0, 0.0, 0.0, 5.0], *([*move, 0.0] for move in moves)]), axis=0)
    true /= np.linalg.norm(true, axis=1)[:, np.newaxis]
    signs = np.where([False, *flips[: len(moves)]], -1.0, 1.0)
    np.testing.assert_array_equal(unwrap_quaternions(true * signs[:, np.newaxis]), true)


@given(st.lists(st.floats(-0.9, 0.9), min_size=1, max_size=60), st.floats(0.0, 0.02), st.floats(0.3, 3.0))
def test_a_turn_about_a_drifting_axis_goes_on_past_pi(turns: list[float], drift: float, start: float) -> None:
    """The angle stays away from whole turns, about which no vector is continuous."""
    angle = np.clip(start + np.cumsum([0.0, *turns]), 0.3, 5.9)
    lean = drift * np.arange(len(angle))
    axis = np.column_stack((np.sin(lean), np.zeros(len(angle)), np.cos(lean)))
    true = axis * angle[:, np.newaxis]
    recorded = axis * wrap(angle)[:, np.newaxis]  # of a length up to pi, as a controller writes it
    np.testing.assert_allclose(unwrap_rotation_vectors(recorded), true, rtol=0, atol=SIZE)


@given(st.lists(st.tuples(*[st.floats(-6.0, 6.0)] * 3), min_size=1, max_size=40))
@example([(0.0, 0.0, 4.0), (0.0, 0.0, 1.6e-160)])
@example([(0.0, 0.0, 4.0), (0.0, 5e-324, 0.0)])
def test_continuous_vectors_are_the_same_rotations(vectors: list[tuple[float, ...]]) -> None:
    v = np.array(vectors)
    found = unwrap_rotation_vectors(v)
    np.testing.assert_array_equal(found[0], v[0])
    before, after = (to_quaternions(one, "vector") for one in (v, found))
    same = np.abs(np.einsum("ij,ij->i", before, after))
    # 40 samples may add up to 40 turns: the half angles, to 125 rad, round at 3e-14
    np.testing.assert_allclose(same, 1.0, rtol=0, atol=1e-12)


FULL = 2 * np.pi


@pytest.mark.parametrize(
    ("recorded", "expected"),
    [
        # a flip at pi, a missing sample, and a rest, which keeps its axis
        ([[0, 0, 3.1], [0, 0, -3.1], [np.nan] * 3, [0, 0, -0.1], [0, 0, 0]],
         [[0, 0, 3.1], [0, 0, FULL - 3.1], [np.nan] * 3, [0, 0, FULL - 0.1], [0, 0, FULL]]),
        # a log that begins with rests: the first axis counts
        ([[0] * 3, [0] * 3, [0, 3, 0], [0, 3 - FULL, 0], [0] * 3],
         [[0] * 3, [0] * 3, [0, 3, 0], [0, 3, 0], [0] * 3]),
        # none of its components is large: two square roots of 3 back, or a turn less that
        ([[1.0] * 3, [-1.0] * 3], [[1.0] * 3, [FULL / np.sqrt(3.0) - 1.0] * 3]),
    ],
)  # fmt: skip
def test_vectors_continue_by_whole_turns(recorded: list[list[float]], expected: list[list[float]]) -> None:
    v = np.array(recorded, dtype=float)
    np.testing.assert_allclose(unwrap_rotation_vectors(v), expected, rtol=0, atol=1e-15)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    steps,
    st.lists(st.booleans(), min_size=60, max_size=60),
    st.integers(0, 59),
    st.tuples(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0)),
)
def test_euler_angles_of_either_family_become_continuous(
    moves: list[tuple[float, ...]], swaps: list[bool], missing: int, start: tuple[float, float, float]
) -> None:
    true = np.cumsum(np.array([start, *moves]), axis=0)
    true[:, 1] = np.clip(true[:, 1], -1.2, 1.2)  # at +-pi/2 the two families meet
    swapped = np.array([False, *swaps[: len(moves)]])[:, np.newaxis]
    recorded = wrap(np.where(swapped, true * [1.0, -1.0, 1.0] + np.pi, true))
    recorded[0] = true[0]
    np.testing.assert_allclose(rotation_matrices(recorded), rotation_matrices(true), rtol=0, atol=SIZE)
    np.testing.assert_allclose(unwrap_euler(recorded), true, rtol=0, atol=SIZE)
    if 0 < missing < len(true):  # steps of up to 0.6 then, still below the quarter turn between the families
        recorded[missing] = true[missing] = np.nan
        np.testing.assert_allclose(unwrap_euler(recorded), true, rtol=0, atol=SIZE)


def test_euler_angles_go_straight_through_the_vertical() -> None:
    """ry from 80 to 100 deg: atan2 names it 80 with rz and rx half a turn off."""
    ry = np.radians(np.arange(80.0, 101.0, 3.0))
    true = np.column_stack((np.full_like(ry, 0.3), ry, np.full_like(ry, -0.2)))
    beyond = (ry > np.pi / 2)[:, np.newaxis]
    recorded = np.where(beyond, wrap(true * [1.0, -1.0, 1.0] + np.pi), true)
    np.testing.assert_allclose(unwrap_euler(recorded), true, rtol=0, atol=1e-14)


def test_of_two_names_that_are_equally_near_the_recorded_one_stays() -> None:
    """A quarter turn of two axes: the other family, half a turn off, is a quarter turn away as well."""
    recorded = np.array([[0.0, 0.0, 0.0], [-np.pi / 2, 0.0, -np.pi / 2]])
    np.testing.assert_array_equal(unwrap_euler(recorded, proper=True), recorded)
    half_a_turn = np.array([[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -1.0]])
    np.testing.assert_array_equal(unwrap_quaternions(half_a_turn), half_a_turn)


@pytest.mark.parametrize(
    ("unwrap", "width"), [(unwrap_quaternions, 4), (unwrap_rotation_vectors, 3), (unwrap_euler, 3)]
)
def test_records_without_samples_pass_through(unwrap: Callable[[FloatArray], FloatArray], width: int) -> None:
    assert unwrap(np.empty((0, width))).shape == (0, width)
    assert np.isnan(unwrap(np.full((3, width), np.nan))).all()
    assert unwrap(np.zeros((2, width))).tolist() == np.zeros((2, width)).tolist()


# Two representations of one rotation in each form.
FLIPPED: dict[RotationForm, list[list[float]]] = {
    "vector": [[0.6 * 3.1, 0.0, 0.8 * 3.1], [0.6 * (3.1 - 2 * np.pi), 0.0, 0.8 * (3.1 - 2 * np.pi)]],
    "rpy": [[0.1, 0.2, 0.3], [0.1 - np.pi, np.pi - 0.2, 0.3 - np.pi]],
    "zyx": [[0.1, 1.5, 0.3], [0.1 + np.pi, np.pi - 1.5, 0.3 - np.pi]],
    "xyz": [[0.1, -1.5, 0.3], [0.1 + np.pi, np.pi + 1.5, 0.3 + np.pi]],
    "zyz": [[0.1, 0.2, 0.3], [0.1 + np.pi, -0.2, 0.3 - np.pi]],
    "zxz": [[0.1, -0.2, 0.3], [0.1 - np.pi, 0.2, 0.3 + np.pi]],
    "quat_xyzw": [[0.5, -0.5, 0.5, -0.5], [-0.5, 0.5, -0.5, 0.5]],
    "quat_wxyz": [[0.6, 0.0, 0.8, 0.0], [-0.6, 0.0, -0.8, 0.0]],
    "matrix": [[0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]] * 2,
}


@pytest.mark.parametrize("form", FORMS)
def test_two_names_of_one_rotation_become_one_in_every_form(form: RotationForm) -> None:
    recorded = np.array(FLIPPED[form])
    before = to_quaternions(recorded, form)
    # what stands in the table are two names of one rotation: the quaternions agree but for their sign
    np.testing.assert_allclose(np.abs(before[0] @ before[1]), 1.0, rtol=0, atol=1e-15)
    found = unwrap_orientations(recorded, form)
    # pi is added and taken away: a few roundings of 4e-16
    np.testing.assert_allclose(found, recorded[[0, 0]], rtol=0, atol=3e-15)
