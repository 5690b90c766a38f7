"""A unit over a log."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asserting import refusal
from random_units import PATIENT, random_columns, random_starts, random_units
from urmpipe_fmus.block import BlockModel, Input, Memory, Output, Parameter
from urmpipe_fmus.run import Instance, run
from urmpipe_models.errors import UnitError


def gain(**more: Any) -> BlockModel:
    return BlockModel(
        name="gain",
        description="",
        variables=(
            Parameter(name="k", description="", start=2.0, minimum=0.0),
            Input(name="u", description="", size=2, start=(1.0, 3.0)),
            Output(name="y", description="", size=2),
            Output(name="t", description=""),
            Output(name="one", description=""),
        ),
        outputs=lambda v: {"y": tuple(v.k * u for u in v.u), "t": v.time, "one": 1.0},
        **more,
    )


def test_outputs_are_columns_and_inputs_that_are_not_given_stay_at_their_start() -> None:
    t = np.array([0.0, 0.1, 0.3])
    found = run(gain(), t)
    assert {name: value.tolist() for name, value in found.items()} == {
        "y": [[2.0, 6.0]] * 3,
        "t": [0.0, 0.1, 0.3],
        "one": [1.0] * 3,
    }
    u = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    assert run(gain(), t, {"u": u}, {"k": 0.5})["y"].tolist() == (0.5 * u).tolist()
    assert run(gain(), t[:0], {"u": u[:0]})["y"].shape == (0, 2)


@pytest.mark.parametrize(
    ("t", "inputs", "start", "said"),
    [
        ([0.0, 0.0], {}, {}, "found times of shape (2,), allowed: rising times, shape (n,)"),
        ([0.0, np.inf], {}, {}, "found times of shape (2,), allowed: rising times, shape (n,)"),
        ([[0.0]], {}, {}, "found times of shape (1, 1), allowed: rising times, shape (n,)"),
        ([0.0], {"w": [1.0]}, {}, "no variable w; allowed: k, u, y, t, one"),
        (
            [0.0],
            {"k": [1.0]},
            {},
            "k: found parameter with values of shape (1,), allowed: an input, shape (1,)",
        ),
        (
            [0.0],
            {"u": [1.0]},
            {},
            "u: found input with values of shape (1,), allowed: an input, shape (1, 2)",
        ),
        ([0.0], {}, {"w": 1.0}, "no variable w; allowed: k, u, y, t, one"),
        ([0.0], {}, {"u": [1.0, 2.0, 3.0]}, "u: found 3 values, allowed: 1 or 2"),
        ([0.0], {}, {"k": [1.0, 2.0]}, "k: found 2 values, allowed: 1"),
        ([0.0], {}, {"k": -1.0}, "k: found -1, allowed: 0 to inf"),
        ([0.0], {"u": [[1.0, np.nan]]}, {}, "u[2]: found nan, allowed: a finite number"),
        ([0.0, 0.5], {"u": [[1.0, 0.0], [1.0, 1e10]]}, {"k": 1e300}, "output y[2] is not finite at 0.5 s"),
    ],
)
def test_what_does_not_fit_is_refused(t: Any, inputs: Any, start: Any, said: str) -> None:
    assert refusal(UnitError, run, gain(), np.array(t), inputs, start) == f"unit gain: {said}"


def test_a_memory_makes_each_sample_wait_for_the_one_before() -> None:
    model = BlockModel(
        name="sum",
        description="",
        variables=(
            Input(name="u", description=""),
            Memory(name="m", description="", output=True),
            Output(name="y", description=""),
        ),
        outputs=lambda v: {"y": v.m + v.u},
        update=lambda v: {"m": v.m + v.u},
    )
    u = np.array([1.0, 2.0, 4.0, 8.0])
    found = run(model, np.array([0.0, 0.1, 0.5, 0.6]), {"u": u}, {"m": 10.0})
    assert found["y"].tolist() == [11.0, 13.0, 17.0, 25.0]
    assert found["m"].tolist() == [10.0, 11.0, 13.0, 17.0]


@pytest.mark.slow
@settings(max_examples=40, **PATIENT)
@given(
    random_units(remembers=False).flatmap(
        lambda model: st.tuples(st.just(model), random_starts(model), random_columns(model, 5))
    )
)
def test_a_unit_without_memory_gives_at_once_what_it_gives_step_by_step(
    case: tuple[BlockModel, dict[str, Any], dict[str, Any]],
) -> None:
    model, start, columns = case
    t = np.array([0.0, 0.125, 0.25, 0.375, 0.5])  # t + h is exact
    found, instance = run(model, t, columns, start), Instance(model)
    for one in model.arguments:
        if one.name in start:
            instance.set([instance.reference(name) for name in one.names], np.ravel(start[one.name]).tolist())
    for k, time in enumerate(t):
        for one in model.inputs:
            places = [instance.reference(name) for name in one.names]
            instance.set(places, np.ravel(columns[one.name][k]).tolist())
        for one in model.computed:
            seen = instance.get([instance.reference(name) for name in one.names])
            # NumPy computes a column's sine with other instructions than a number's: last places differ
            np.testing.assert_allclose(np.ravel(found[one.name][k]), seen, rtol=0.0, atol=1e-13)
        instance.do_step(float(time), 0.125)
