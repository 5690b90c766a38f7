"""Wraps: the repolarizer, in-between samples, and continuous orientations."""

from __future__ import annotations

import math
from pathlib import Path

import casadi
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_np
from numpy.typing import NDArray

from judged_wraps import TSP, find_in_between, judge, wrap
from urmpipe_models import wraps
from urmpipe_models.elementwise import BLOCK, FloatArray
from urmpipe_models.math3d import FORMS, RotationForm, from_rpy, to_quaternions
from urmpipe_models.wraps import FULL_TURN, WrapState, repolarize, repolarize_sample

shapes = st.tuples(st.integers(2, 200), st.integers(1, 4))
motions = st_np.arrays(float, shapes, elements=st.floats(-1.5, 1.5))  # below a quarter turn, 1.57, a step


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
logs = st_np.arrays(float, st.tuples(st.integers(1, 120), st.integers(1, 3)), elements=values)
gaps = st_np.arrays(bool, (120, 3), elements=st.sampled_from([False, False, False, True]))


@pytest.mark.slow
@given(logs, gaps, st.sampled_from([math.inf, 3.0, 300.0]), st.floats(0.001, 0.1))
@settings(max_examples=50, deadline=None)
def test_batch_is_the_steps(q: FloatArray, missing: NDArray[np.bool_], max_speed: float, step: float) -> None:
    q = np.where(missing[: len(q), : q.shape[1]], np.nan, q)
    dt = step * (1.0 + np.arange(len(q), dtype=np.float64) % 3)
    periods = np.array([FULL_TURN, 4.0, 2.0 * FULL_TURN])[: q.shape[1]]
    judge(q, dt, periods, max_speed)


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


def test_real_jumps_of_a_real_log_stay(shared: Path) -> None:
    """fake_joints.csv: -3.99 rad and 11.9 rad (and back) are no wraps; numpy.unwrap moves them."""
    path = shared / "logs" / "plotjuggler" / "fake_joints.csv"
    header = path.read_text().splitlines()[0].split(",")
    columns = [header.index(f"field.position{i}") for i in range(6)]
    q = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=columns)
    result = repolarize(q, np.full(len(q), 0.001))
    assert result.q.tobytes() == q.tobytes()
    assert result.unexplained.tolist() == [[1, 0], [1411, 3], [1412, 3]]
    assert not np.array_equal(np.unwrap(q[:, 0]), q[:, 0])


MOVE = 0.01  # rad a sample, 2 rad/s
FRACTIONS = np.arange(0.002, 1.0, 0.004)


def with_in_between(direction: float) -> tuple[FloatArray, FloatArray]:
    """Return a motion over +-pi, and its samples in the file, one column per fraction; 10 is on the jump."""
    x = np.tile(direction * (np.pi + MOVE * (np.arange(20) - 9.5)), (len(FRACTIONS), 1)).T
    q = wrap(x)
    q[10] = q[9] + FRACTIONS * (q[11] - q[9])
    return x, q


@pytest.mark.slow
@pytest.mark.parametrize("max_speed", [math.inf, 4.0])
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("missing", [(), (9,), (11,), (7, 9, 11, 13), (8, 9), (11, 12)])
def test_k_is_right_at_any_fraction(max_speed: float, direction: float, missing: tuple[int, ...]) -> None:
    x, q = with_in_between(direction)
    q[list(missing)] = np.nan
    result = repolarize(q, np.full(len(q), TSP), max_speed=max_speed)
    rest = np.setdiff1d(np.arange(len(q)), [10, *missing])
    # wrapping and adding P once: a few units in the last place of 3
    np.testing.assert_allclose(result.q[rest], x[rest], rtol=0, atol=2e-15)
    assert result.unexplained.tolist() == []
    assert all(find_in_between(column, max_speed).in_between in ([], [10]) for column in q[:, ::20].T)


@pytest.mark.parametrize("max_speed", [math.inf, 4.0])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_an_in_between_sample_is_found_where_it_is_off_the_motion(max_speed: float, direction: float) -> None:
    """By `MIN_DISTANCE_RATIO`, from either end of the jump: 4 x 0.01 rad of 6.28, 0.7 % of it."""
    _, q = with_in_between(direction)
    samples = [find_in_between(column, max_speed).in_between for column in q.T]
    share = wraps.MIN_DISTANCE_RATIO * MOVE / FULL_TURN
    clear = np.minimum(FRACTIONS, 1.0 - FRACTIONS) > share + 0.002
    assert all(rows == [10] for rows, is_clear in zip(samples, clear, strict=True) if is_clear)
    assert sum(not rows for rows in samples) <= 2 * round(len(FRACTIONS) * share + 2)


def test_the_repolarized_in_between_sample_stays_until_it_is_repaired() -> None:
    s = 10
    t = np.cumsum(np.r_[0.0, TSP * (1.0 + np.arange(19) % 3)])  # uneven: the line is one in time
    x = np.pi + 2.0 * (t - t[s])
    q = wrap(x)
    q[s] = q[s - 1] + 0.4 * (q[s + 1] - q[s - 1])
    result = repolarize(q[:, np.newaxis], np.diff(t, prepend=0.0))
    assert result.q[s, 0] == q[s]
    assert result.in_between.tolist() == [[s, 0]]
    repaired = wraps.reinterpolate(result.q, t, result.in_between)
    np.testing.assert_allclose(repaired[:, 0], x, rtol=0, atol=3e-15)  # values of 3: units in the last place
    others = np.delete(np.arange(20), s)
    assert repaired[others].tobytes() == result.q[others].tobytes()


@given(st.floats(1e-6, 0.3), st.floats(0.0, 1.0), st.sampled_from([1.0, -1.0]), st.integers(0, 10**6))
def test_clean_wraps_and_noise_are_explained(move: float, offset: float, direction: float, seed: int) -> None:
    """Even motion at any speed; and noise about +-pi of any size below P / 4 a step."""
    x = np.asarray(direction * (np.pi + move * (np.arange(30) - 14.5 + offset)), dtype=np.float64)
    assert find_in_between(wrap(x))[1:] == ([], [])
    noise = np.random.default_rng(seed).uniform(np.pi - move, np.pi + move, 30)
    assert find_in_between(wrap(noise)).unexplained == []


def test_noise_about_the_limit_is_rarely_taken_for_in_between_samples() -> None:
    """Of 5e4 wraps of pure noise, which is no motion, a handful looks like an in-between sample."""
    rng = np.random.default_rng(5)
    for spread in (1e-4, 0.01, 0.3):
        found = find_in_between(wrap(rng.normal(np.pi, spread, 100_000)))
        count = np.count_nonzero(np.diff(found.turns))
        assert count > 45_000
        assert len(found.in_between) < 1e-3 * count, (spread, len(found.in_between))


SIZE = 1e-13  # angles to 20 rad are wrapped and back, two roundings of 4e-15, then sine and cosine

steps = st.lists(st.tuples(*[st.floats(-0.3, 0.3)] * 3), min_size=1, max_size=60)
switches = st.lists(st.booleans(), min_size=60, max_size=60)
starts = st.tuples(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0))


def rotation_matrices(angles: FloatArray) -> FloatArray:
    return np.array([np.array(from_rpy(rx, ry, rz).rotation, dtype=float) for rz, ry, rx in angles])


@settings(max_examples=40, deadline=None)
@given(steps, switches)
def test_quaternions_of_any_sign_become_continuous(moves: list[tuple[float, ...]], flips: list[bool]) -> None:
    true = np.cumsum(np.array([[0.0, 0.0, 0.0, 5.0], *([*move, 0.0] for move in moves)]), axis=0)
    true /= np.linalg.norm(true, axis=1)[:, np.newaxis]
    signs = np.where([False, *flips[: len(moves)]], -1.0, 1.0)
    np.testing.assert_array_equal(wraps.unwrap_quaternions(true * signs[:, np.newaxis]), true)


@given(st.lists(st.floats(-0.9, 0.9), min_size=1, max_size=60), st.floats(0.0, 0.02), st.floats(0.3, 3.0))
def test_a_turn_about_a_drifting_axis_goes_on_past_pi(turns: list[float], drift: float, start: float) -> None:
    """The angle stays away from whole turns, about which no vector is continuous."""
    angle = np.clip(start + np.cumsum([0.0, *turns]), 0.3, 5.9)
    lean = drift * np.arange(len(angle))
    axis = np.column_stack((np.sin(lean), np.zeros(len(angle)), np.cos(lean)))
    true = axis * angle[:, np.newaxis]
    recorded = axis * wrap(angle)[:, np.newaxis]  # of a length up to pi, as a controller writes it
    np.testing.assert_allclose(wraps.unwrap_rotation_vectors(recorded), true, rtol=0, atol=SIZE)


@given(st.lists(st.tuples(*[st.floats(-6.0, 6.0)] * 3), min_size=1, max_size=40))
@example([(0.0, 0.0, 4.0), (0.0, 0.0, 1.6e-160)])
@example([(0.0, 0.0, 4.0), (0.0, 5e-324, 0.0)])
def test_continuous_vectors_are_the_same_rotations(vectors: list[tuple[float, ...]]) -> None:
    v = np.array(vectors)
    found = wraps.unwrap_rotation_vectors(v)
    np.testing.assert_array_equal(found[0], v[0])
    before, after = (to_quaternions(one, "vector") for one in (v, found))
    same = np.abs(np.einsum("ij,ij->i", before, after))
    # 40 samples may add up to 40 turns: the half angles, to 125 rad, round at 3e-14
    np.testing.assert_allclose(same, 1.0, rtol=0, atol=1e-12)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(steps, switches, st.integers(0, 59), starts)
def test_euler_angles_of_either_family_become_continuous(
    moves: list[tuple[float, ...]], swaps: list[bool], missing: int, start: tuple[float, float, float]
) -> None:
    true = np.cumsum(np.array([start, *moves]), axis=0)
    true[:, 1] = np.clip(true[:, 1], -1.2, 1.2)  # at +-pi/2 the two families meet
    swapped = np.array([False, *swaps[: len(moves)]])[:, np.newaxis]
    recorded = wrap(np.where(swapped, true * [1.0, -1.0, 1.0] + np.pi, true))
    recorded[0] = true[0]
    np.testing.assert_allclose(rotation_matrices(recorded), rotation_matrices(true), rtol=0, atol=SIZE)
    np.testing.assert_allclose(wraps.unwrap_euler(recorded), true, rtol=0, atol=SIZE)
    if 0 < missing < len(true):  # steps of up to 0.6 then, still below the quarter turn between the families
        recorded[missing] = true[missing] = np.nan
        np.testing.assert_allclose(wraps.unwrap_euler(recorded), true, rtol=0, atol=SIZE)


def test_euler_angles_go_straight_through_the_vertical() -> None:
    """ry from 80 to 100 deg: atan2 names it 80 with rz and rx half a turn off."""
    ry = np.radians(np.arange(80.0, 101.0, 3.0))
    true = np.column_stack((np.full_like(ry, 0.3), ry, np.full_like(ry, -0.2)))
    beyond = (ry > np.pi / 2)[:, np.newaxis]
    recorded = np.where(beyond, wrap(true * [1.0, -1.0, 1.0] + np.pi), true)
    np.testing.assert_allclose(wraps.unwrap_euler(recorded), true, rtol=0, atol=1e-14)


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
    found = wraps.unwrap_orientations(recorded, form)
    # pi is added and taken away: a few roundings of 4e-16
    np.testing.assert_allclose(found, recorded[[0, 0]], rtol=0, atol=3e-15)
