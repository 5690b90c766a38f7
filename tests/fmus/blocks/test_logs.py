"""The blocks of logs: log source, repolarizer and delta meter."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asserting import refusal
from random_units import PATIENT
from urmpipe_fmus.block import Table
from urmpipe_fmus.blocks.logs import Column, delta_meter, log_source, repolarizer
from urmpipe_fmus.dependencies import TIME, Dependencies
from urmpipe_fmus.instance import Instance
from urmpipe_fmus.run import run
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import UnitError
from urmpipe_models.wraps import repolarize

LOG = Table(
    np.array([0, 5_000_000, 20_000_000]), np.array([[1.0, -1.0, 10.0], [3.0, -2.0, 20.0], [0.0, 4.0, 50.0]])
)
COLUMNS = (Column("q", "rad", 2, "Angles"), Column("d", "m"))


def test_a_held_log_shows_each_row_until_the_next_and_its_ends_beyond_them() -> None:
    t = np.array([-1.0, 0.0, 0.0049, 0.005, 0.0199, 0.02, 7.0])
    found = run(log_source(LOG, COLUMNS), t)
    assert found["d"].tolist() == [10.0, 10.0, 10.0, 20.0, 20.0, 50.0, 50.0]
    assert found["q"].tolist() == [[1.0, -1.0]] * 3 + [[3.0, -2.0]] * 2 + [[0.0, 4.0]] * 2


def test_an_interpolated_log_goes_straight_from_row_to_row_and_meets_each_bit_by_bit() -> None:
    model = log_source(LOG, COLUMNS, interpolate=True)
    found = run(model, np.array([-1.0, 0.0, 0.0025, 0.005, 0.01, 0.02, 7.0]))
    assert found["d"].tolist() == [10.0, 10.0, 15.0, 20.0, 20.0 + (5e6 / 15e6) * 30.0, 50.0, 50.0]
    t = LOG.t_ns / 1e9
    assert np.array_equal(run(model, t)["q"], LOG.values[:, :2])
    inside = np.linspace(0.0, 0.02, 101, dtype=np.float64)
    straight = np.interp(inside, t, LOG.values[:, 2])
    np.testing.assert_allclose(run(model, inside)["d"], straight, rtol=0.0, atol=1e-13)  # rounding of 50


def test_the_columns_are_outputs_by_the_callers_names_that_depend_on_time() -> None:
    model = log_source(LOG, [["q", "rad", 2, "Angles"], ["d", "m"]])
    assert [(one.name, one.unit, one.display_unit, one.size, one.description) for one in model.computed] == [
        ("q", "rad", "deg", 2, "Angles"),
        ("d", "m", "", None, "Column d of the log"),
    ]
    assert Dependencies(model).outputs == {"q[1]": {TIME}, "q[2]": {TIME}, "d": {TIME}}
    assert model.description == "A log of 3 rows, held"


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ([["q", "rad", 0]], "option columns: q: size: found 0, allowed: an integer, 1 or more"),
        ([["q", "rad", 2]], "option columns: found 2 columns, allowed: 3 of the table"),
        (
            [["q", "rad", 3, "Angles", 5]],
            "option columns: found ['q', 'rad', 3, 'Angles', 5], allowed: name, unit, size and description",
        ),
        ([["q", 2]], "option columns: found ['q', 2], allowed: name, unit, size and description"),
        ([7], "option columns: found 7, allowed: name, unit, size and description"),
        ("qd", "found no table and columns, allowed: a Table, a list of columns"),
        ([["q", "rad", 2], ["q", "m"]], "q: found twice, allowed: each name once"),
    ],
)
def test_columns_that_do_not_fit_are_refused(columns: Any, said: str) -> None:
    assert refusal(UnitError, log_source, LOG, columns) == f"unit log_source: {said}"


def test_the_deviation_is_reference_less_actual_and_its_flag_is_of_each_axis() -> None:
    reference = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.003, 0.003, -0.003]])
    actual = np.array([[0.5, 3.0, 3.0], [0.0, 0.0035, 0.0], [0.0, 0.0036, 0.0], [0.0, 0.0, 0.0]])
    t = np.linspace(0.0, 1.0, 4, dtype=np.float64)
    found = run(delta_meter(), t, {"reference": reference, "actual": actual})
    assert np.array_equal(found["delta"], reference - actual)
    # two ways to add up three squares: the rounding of the last place
    np.testing.assert_allclose(found["norm"], np.linalg.norm(reference - actual, axis=1), rtol=1e-15)
    assert found["out_of_tolerance"].tolist() == [
        1.0,
        0.0,
        1.0,
        0.0,
    ]  # 3.5 mm is allowed; the norm is not asked
    wide = run(delta_meter(), t, {"reference": reference, "actual": actual}, {"tolerance": 1.0})
    assert wide["out_of_tolerance"].tolist() == [0.0] * 4


def test_a_negative_tolerance_is_refused() -> None:
    with pytest.raises(UnitError, match=r"^unit delta_meter: tolerance: found -0.001, allowed: 0 to inf$"):
        run(delta_meter(), np.array([0.0]), {}, {"tolerance": -0.001})


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
