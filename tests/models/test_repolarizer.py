"""The repolarizer: its laws, sample by sample and over a whole log."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import casadi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_np
from numpy.typing import NDArray

from urmpipe_models.elementwise import BLOCK, FloatArray
from urmpipe_models.wraps import FULL_TURN, State, max_step, repolarize, step

SHARED = Path(__file__).resolve().parents[2].parent / "shared"
TSP = 0.005


def wrap(x: FloatArray, period: float = FULL_TURN) -> FloatArray:
    """Limit to +-period/2, as an environment with limited joints does."""
    return x - period * np.floor((x + period / 2.0) / period)


class Stepped(NamedTuple):
    """What `step` gave, sample by sample; `odd` without the steps to samples told as in-between later."""

    out: FloatArray
    changes: FloatArray
    odd: NDArray[np.bool_]
    in_between: list[int]
    state: State


def run_steps(q: Iterable[float], dt: Iterable[float], **options: float) -> Stepped:
    """Feed a log of one joint to `step`, sample by sample."""
    state, out, changes, odd, in_between, last = State(), [], [], [], [], -1
    for i, (value, elapsed) in enumerate(zip(q, dt, strict=True)):
        state, result, flags = step(state, value, elapsed, **options)
        out.append(result)
        changes.append(flags.change)
        odd.append(bool(flags.unexplained))
        if flags.in_between:
            in_between.append(last)
            odd[last] = False
        last = last if math.isnan(value) else i
    return Stepped(
        np.array(out, dtype=float), np.array(changes, dtype=float), np.array(odd), in_between, state
    )


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
    """Hold `repolarize` against `step`, joint by joint; what it tells comes by row and then by joint."""
    batch = repolarize(q, dt, period=periods, max_speed=max_speed)
    assert batch.change.dtype == np.int64
    for told in (np.column_stack((batch.rows, batch.joints)), batch.unexplained, batch.in_between):
        assert told.tolist() == sorted(told.tolist())
    for j in range(q.shape[1]):
        single = run_steps(q[:, j], dt, period=float(periods[j]), max_speed=max_speed)
        assert single.out.tobytes() == np.ascontiguousarray(batch.q[:, j]).tobytes()
        mine = batch.joints == j
        assert np.array_equal(np.flatnonzero(single.changes), batch.rows[mine])
        assert np.array_equal(single.changes[single.changes != 0], batch.change[mine])
        assert np.array_equal(np.flatnonzero(single.odd), batch.unexplained[batch.unexplained[:, 1] == j, 0])
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
    assert not step(State(0.0, seen=1.0), 1.0, TSP, period=4.0)[2].unexplained
    assert step(State(0.0, seen=1.0), above, TSP, period=4.0)[2].unexplained


def test_values_that_are_no_joint_values_are_missing_and_warn_of_nothing() -> None:
    q = np.array([[3.0, 3.0, 3.0], [1e308, np.inf, np.nan], [1e308, -np.inf, np.nan], [-3.0, -3.0, -3.0]])
    with np.errstate(all="raise"):
        result = repolarize(q, np.full(4, TSP))
    assert result.rows.tolist() == [3, 3, 3]
    assert len(result.unexplained) == 0
    assert step(State(), 1e300, TSP)[0].seen == 0.0  # at the bound already


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
    assert state == State(-3.0, -6.0 + FULL_TURN, 2 * TSP, 1.0, TSP, 1.0)


@pytest.mark.parametrize("shape", [(0, 3), (1, 3), (5, 0)])
def test_empty_logs_pass_through(shape: tuple[int, int]) -> None:
    assert repolarize(np.zeros(shape), np.zeros(shape[0])).q.shape == shape


def test_the_step_traces_with_casadi() -> None:
    casadi.GlobalOptions.setNumpyMode(-1)
    state = State(*casadi.SX.sym("state", 6).elements())
    inputs = casadi.SX.sym("input", 4)
    q, dt, period, speed = inputs.elements()
    following, out, flags = step(state, q, dt, period=period, max_speed=speed)
    traced = casadi.Function("step", [casadi.vertcat(*state), inputs],
                             [casadi.vertcat(*following), casadi.vertcat(out, *flags)])  # fmt: skip
    rng = np.random.default_rng(7)
    memory = State()
    on_the_jump = [3.1, 0.2, -3.1, math.nan, 0.1, 3.1]
    for value in [*wrap(np.cumsum(rng.uniform(-1.5, 1.5, 300))), math.nan, 1.0, 5.0, 2.0, *on_the_jump]:
        expected_state, expected, expected_flags = step(memory, value, TSP, max_speed=1e4)
        got_state, got = traced([float(x) for x in memory], [value, TSP, FULL_TURN, 1e4])
        np.testing.assert_array_equal(np.ravel(got_state), np.array(expected_state, dtype=float))
        np.testing.assert_array_equal(np.ravel(got), np.array([expected, *expected_flags], dtype=float))
        memory = State(*(float(x) for x in expected_state))


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
