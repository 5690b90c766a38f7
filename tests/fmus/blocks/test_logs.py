"""The blocks of logs: log source, repolarizer and delta meter."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from random_units import PATIENT
from urmpipe_fmus.block import Table
from urmpipe_fmus.blocks.logs import Column, delta_meter, log_source, repolarizer
from urmpipe_fmus.run import run
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.wraps import repolarize

LOG = Table(np.array([0, 5_000_000, 20_000_000]), np.array([[1.0, -1.0], [3.0, -2.0], [0.0, 4.0]]))


def test_an_interpolated_log_meets_each_row_bit_by_bit_and_is_linear_between_them() -> None:
    model = log_source(LOG, [Column("q", "rad", 2)], interpolate=True)
    t = LOG.t_ns / 1e9
    assert np.array_equal(run(model, t)["q"], LOG.values)
    inside = np.linspace(0.0, 0.02, 101, dtype=np.float64)
    linear = np.column_stack([np.interp(inside, t, column) for column in LOG.values.T])
    np.testing.assert_allclose(run(model, inside)["q"], linear, rtol=0.0, atol=1e-14)  # rounding of 4


def test_the_norm_of_a_deviation_is_that_of_numpy() -> None:
    reference, actual = np.random.default_rng(1).uniform(-3.0, 3.0, (2, 20, 3))
    found = run(delta_meter(), np.arange(20.0), {"reference": reference, "actual": actual})
    assert np.array_equal(found["delta"], reference - actual)
    # two ways to add up three squares: the rounding of the last place
    np.testing.assert_allclose(found["norm"], np.linalg.norm(reference - actual, axis=1), rtol=1e-15)


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
def test_it_gives_what_repolarize_gives(rows: list[list[float]], period: float, max_step: float) -> None:
    raw = np.array(rows)
    expected = repolarize(raw, np.ones(len(raw)), period=period, max_speed=max_step)
    assert over(raw, period=period, max_step=max_step)["q"].tobytes() == expected.q.tobytes()


@pytest.mark.slow
@settings(max_examples=10, **PATIENT)
@given(st.integers(0, 10_000), st.floats(0.001, 1.5), st.floats(-3.0, 3.0))
def test_a_joint_that_goes_round_goes_on_where_it_was(seed: int, speed: float, first: float) -> None:
    steps = np.random.default_rng(seed).uniform(-speed, speed, (200, 2))
    joint = first + np.cumsum(steps, axis=0)
    raw = np.mod(joint + math.pi, 2 * math.pi) - math.pi
    found = over(raw)
    turns = np.round((joint - raw) / (2 * math.pi))
    assert np.array_equal(found["turns"], turns - turns[0])
    # whole turns taken off and put on again, of up to 300 rad: 6e-14 each
    np.testing.assert_allclose(found["q"] - found["q"][0], joint - joint[0], rtol=0.0, atol=1e-12)
