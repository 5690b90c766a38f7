"""The repolarizer as a unit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from random_units import PATIENT
from urmpipe_fmus.blocks.logs import repolarizer
from urmpipe_fmus.run import Instance, run
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.wraps import repolarize


def over(raw: FloatArray, **start: float) -> dict[str, FloatArray]:
    t = np.linspace(0.0, 1.0, len(raw), dtype=np.float64)
    return run(repolarizer(raw.shape[1]), t, {"raw": raw}, start)


values = (
    st.floats(-10.0, 10.0)
    | st.sampled_from([math.pi, -math.pi, 0.0, -0.0, 2 * math.pi, math.pi / 2, 1e-300])
    | st.floats(-1e100, 1e100)  # from 1e300 on a value counts as missing
)


@settings(max_examples=60, **PATIENT)
@given(
    st.integers(1, 3).flatmap(
        lambda n: st.lists(st.lists(values, min_size=n, max_size=n), min_size=1, max_size=20)
    ),
    st.sampled_from([2 * math.pi, math.pi, 360.0, 1.0]),
    st.floats(1e-9, 10.0),
)
def test_it_gives_what_the_repolarizer_gives_over_a_regular_log_bit_by_bit(
    rows: list[list[float]], period: float, max_step: float
) -> None:
    raw = np.array(rows)
    expected = repolarize(raw, np.ones(len(raw)), period=period, max_speed=max_step)
    assert over(raw, period=period, max_step=max_step)["q"].tobytes() == expected.q.tobytes()


@pytest.mark.slow
@settings(max_examples=10, **PATIENT)
@given(st.integers(0, 10_000), st.floats(0.001, 1.5), st.floats(-3.0, 3.0))
def test_a_joint_that_goes_round_and_round_goes_on_where_it_was(
    seed: int, speed: float, first: float
) -> None:
    steps = np.random.default_rng(seed).uniform(-speed, speed, (200, 2))
    joint = first + np.cumsum(steps, axis=0)
    raw = np.mod(joint + math.pi, 2 * math.pi) - math.pi
    found = over(raw)
    turns = np.round((joint - raw) / (2 * math.pi))
    assert np.array_equal(found["turns"], turns - turns[0])
    # whole turns taken off and put on again, of up to 300 rad: 6e-14 each
    np.testing.assert_allclose(found["q"] - found["q"][0], joint - joint[0], rtol=0.0, atol=1e-12)


def test_before_the_first_turn_the_output_is_the_input_bit_by_bit_and_without_delay() -> None:
    raw = np.array([[3.0], [3.1], [-3.1], [-3.0], [3.1]])
    found = over(raw)
    assert found["q"][:2].tolist() == raw[:2].tolist()
    assert found["turns"].tolist() == [[0.0], [0.0], [1.0], [1.0], [0.0]]
    assert found["q"][2, 0] == -3.1 + 2 * math.pi


def test_inputs_that_are_set_again_at_a_point_change_the_output_and_not_what_is_remembered() -> None:
    model = repolarizer(1)
    instance = Instance(model)
    raw, q, turns = (instance.reference(f"{name}[1]") for name in ("raw", "q", "turns"))
    instance.set([raw], [3.1])
    instance.do_step(0.0, 0.005)
    for value, expected in (
        (-3.1, [-3.1 + 2 * math.pi, 1.0]),
        (3.05, [3.05, 0.0]),
        (-3.1, [-3.1 + 2 * math.pi, 1.0]),
    ):
        instance.set([raw], [value])
        assert instance.get([q, turns]) == expected


@pytest.mark.parametrize(("max_step", "turns"), [(0.1, 1.0), (0.08, 0.0)])
def test_a_jump_that_misses_a_period_by_more_than_a_joint_can_move_is_none(
    max_step: float, turns: float
) -> None:
    raw = np.array([[math.pi - 0.04], [-math.pi + 0.05]])  # a whole turn but for 0.09 rad
    assert over(raw, max_step=max_step)["turns"][1, 0] == turns
