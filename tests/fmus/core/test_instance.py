"""The rules of a step."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asserting import refusal
from random_units import PATIENT, random_columns, random_starts, random_units
from urmpipe_fmus.block import INTERNAL_STEP, BlockModel, Input, Memory, Output, Parameter, State
from urmpipe_fmus.run import Instance
from urmpipe_models.errors import UnitError


def mixed() -> BlockModel:
    """A unit of every kind: y is fresh, m is the input of the point before, x the input's integral."""
    return BlockModel(
        name="mixed",
        description="",
        variables=(
            Parameter(name="k", description="", start=2.0, minimum=0.0, maximum=10.0),
            Parameter(name="fixed", description="", tunable=False),
            Input(name="u", description="", minimum=-100.0, maximum=100.0),
            Input(name="n", description="", type="Integer"),
            State(name="x", description="", output=True),
            Memory(name="m", description="", output=True),
            Output(name="y", description=""),
        ),
        outputs=lambda v: {"y": v.k * v.u + v.x + 100.0 * v.m},
        derivatives=lambda v: {"x": v.u / (v.fixed - 1.0)},
        update=lambda v: {"m": v.u},
        internal_step=0.25,
    )


def put(instance: Instance, **values: float) -> None:
    instance.set([instance.reference(name) for name in values], list(values.values()))


def shown(instance: Instance, *names: str) -> list[float]:
    return [float(one) for one in instance.get([instance.reference(name) for name in names])]


def everything(instance: Instance) -> tuple[Any, ...]:
    return (instance.time, *instance.get(range(len(instance.model.scalars))))


def test_an_output_is_that_of_the_inputs_as_they_stand_without_a_step() -> None:
    instance = Instance(mixed())
    for u in (3.0, -1.0):
        put(instance, u=u)
        assert shown(instance, "y") == [2.0 * u]
    put(instance, k=5.0)
    assert shown(instance, "y") == [-5.0]


def test_a_step_takes_the_sample_first_and_integrates_with_the_inputs_held() -> None:
    instance = Instance(mixed())
    put(instance, u=3.0)
    instance.do_step(0.0, 0.5)
    assert shown(instance, "m", "x", "y") == [3.0, -1.5, 6.0 - 1.5 + 300.0]
    put(instance, u=1.0)
    assert shown(instance, "m", "y") == [3.0, 2.0 - 1.5 + 300.0]  # m is still the sample of the point before
    instance.do_step(0.5, 0.5)
    assert shown(instance, "m", "x") == [1.0, -2.0]


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"u": math.nan}, ["u: found nan, allowed: a finite number"]),
        ({"k": 2.0, "u": 101.0}, ["u: found 101, allowed: -100 to 100"]),
        ({"y": 1.0}, ["y: set, allowed: an output is computed, not set"]),
        (
            {"u": math.inf, "n": 0.5, "k": -1.0},
            [
                "u: found inf, allowed: a finite number",
                "n: found 0.5, allowed: an integer of 32 bits",
                "k: found -1, allowed: 0 to 10",
            ],
        ),
    ],
)
def test_all_is_set_or_nothing(values: dict[str, float], said: list[str]) -> None:
    instance = Instance(mixed())
    put(instance, u=4.0, n=2.0)
    before = everything(instance)
    with pytest.raises(UnitError) as error:
        put(instance, **{"fixed": 5.0} | values)
    assert str(error.value).splitlines() == [f"unit mixed: {one}" for one in said]
    assert everything(instance) == before


def test_a_reference_that_there_is_not_is_refused() -> None:
    instance = Instance(mixed())
    for ask in (lambda: instance.set([8], [1.0]), lambda: instance.get([8]), lambda: instance.get([-1])):
        with pytest.raises(UnitError, match=r"^unit mixed: value reference (8|-1): found, allowed: 0 to 7$"):
            ask()
    with pytest.raises(UnitError) as error:
        instance.reference("w")
    assert str(error.value) == "unit mixed: no variable w; allowed: k, fixed, u, n, x, m, y, internal_step"


def test_fixed_parameters_states_and_memories_are_set_before_the_first_step_only() -> None:
    instance = Instance(mixed())
    put(instance, fixed=3.0, x=4.0, m=5.0, internal_step=0.1)
    assert shown(instance, "fixed", "x", "m", INTERNAL_STEP) == [3.0, 4.0, 5.0, 0.1]
    instance.do_step(0.0, 1.0)
    put(instance, k=1.0, u=2.0)  # tunable, and an input
    for name, allowed in (
        ("fixed", "a fixed parameter before the first step"),
        (INTERNAL_STEP, "a fixed parameter before the first step"),
        ("x", "a state before the first step"),
        ("m", "a state before the first step"),
    ):
        with pytest.raises(UnitError) as error:
            put(instance, **{name: 1.0})
        assert str(error.value) == f"unit mixed: {name}: set while it runs, allowed: {allowed}"


def test_a_step_that_fails_leaves_all_as_it_was() -> None:
    instance = Instance(mixed())
    put(instance, u=1.0)
    instance.do_step(0.0, 0.5)
    put(instance, u=2.0, k=3.0)
    before = everything(instance)
    broken = Instance(mixed())
    put(broken, fixed=1.0, u=2.0)
    for failing, time, step, said in (
        (instance, 0.5, 0.0, "found a step of 0 s at 0.5 s, allowed: finite, above 0"),
        (instance, 0.5, -1.0, "found a step of -1 s at 0.5 s, allowed: finite, above 0"),
        (instance, math.nan, 1.0, "found a step of 1 s at nan s, allowed: finite, above 0"),
        (instance, 1e308, 1e308, "found a step of 1e+308 s at 1e+308 s, allowed: finite, above 0"),
        (
            instance,
            0.5,
            1e300,
            "found a step of 1e+300 s in internal steps of 0.25 s, allowed: 2147483647 internal steps",
        ),
        (broken, 0.0, 1.0, "state x is not finite at 0 s"),
    ):
        saved = everything(failing)
        assert refusal(UnitError, failing.do_step, time, step) == f"unit mixed: {said}"
        assert everything(failing) == saved
    assert everything(instance) == before
    assert shown(broken, "m") == [0.0]  # the sample that was taken before the states failed is undone
    instance.do_step(0.5, 0.5)
    assert shown(instance, "m", "x") == [2.0, -1.5]


def test_a_step_past_the_stop_time_is_refused() -> None:
    instance = Instance(mixed())
    instance.setup_experiment(0.0, 0.5)
    instance.do_step(0.0, 0.4)
    instance.do_step(0.4, 0.1001)  # what rounding may add
    before = everything(instance)
    with pytest.raises(UnitError) as error:
        instance.do_step(0.5001, 0.25)
    assert str(error.value) == "unit mixed: found a step to 0.7501 s, allowed: to the stop time, 0.5 s"
    assert everything(instance) == before
    instance.setup_experiment(0.5)
    instance.do_step(0.5, 0.25)
    with pytest.raises(UnitError) as error:
        instance.setup_experiment(1.0, 0.5)
    assert str(error.value) == "unit mixed: stopTime: found 0.5, allowed: from the start time 1 on"


def test_an_error_of_the_functions_undoes_the_step_too() -> None:
    def rates(v: Any) -> dict[str, Any]:
        return {"x": {0.0: 1.0}[float(v.x)]}  # fails once x has moved

    model = BlockModel(
        name="u",
        description="",
        variables=(State(name="x", description=""), Memory(name="m", description="")),
        derivatives=rates,
        update=lambda v: {"m": v.m + 1.0},
    )
    instance = Instance(model)
    with pytest.raises(UnitError, match="unit u: derivatives: KeyError"):
        instance.do_step(0.0, 1.0)
    assert everything(instance)[:3] == (0.0, 0.0, 0.0)


def test_an_output_that_is_not_finite_is_an_error_until_its_inputs_are_mended() -> None:
    model = BlockModel(
        name="u",
        description="",
        variables=(Input(name="u", description=""), Output(name="y", description="")),
        outputs=lambda v: {"y": 1.0 / v.u},
    )
    instance = Instance(model, 2.5)
    for _ in range(2):
        with pytest.raises(UnitError, match=r"^unit u: output y is not finite at 2.5 s$"):
            shown(instance, "y")
        assert shown(instance, "u") == [0.0]
    put(instance, u=4.0)
    assert shown(instance, "y") == [0.25]


def error_at(step: float) -> float:
    """The error at t = 2 of x' = -2 t x^2, x(0) = 1, of which x = 1 / (1 + t^2)."""
    model = BlockModel(
        name="ode",
        description="",
        variables=(State(name="x", description="", start=1.0),),
        derivatives=lambda v: {"x": -2.0 * v.time * v.x * v.x},
        internal_step=step,
    )
    instance = Instance(model)
    for k in range(4):
        instance.do_step(0.5 * k, 0.5)
    return abs(shown(instance, "x")[0] - 0.2)


def test_the_error_falls_with_the_fourth_power_of_the_internal_step() -> None:
    errors = [error_at(step) for step in (0.05, 0.025, 0.0125)]
    ratios = np.array(errors[:-1]) / errors[1:]
    assert (np.abs(np.log2(ratios) - 4.0) < 0.1).all(), (
        ratios
    )  # the fifth power's share is below a tenth here


def test_a_step_is_divided_into_equal_internal_steps() -> None:
    times: list[float] = []
    model = BlockModel(
        name="u",
        description="",
        variables=(State(name="x", description=""),),
        derivatives=lambda v: times.append(float(v.time)) or {"x": 0.0},  # type: ignore[func-returns-value]
        internal_step=0.1,
    )
    for time, step, count in (
        (0.0, 0.3, 3),
        (0.3, 0.6 - 0.3, 3),
        (0.0, 0.05, 1),
        (0.0, 0.1001, 2),
        (1.0, 0.35, 4),
    ):
        times.clear()
        Instance(model, time).do_step(time, step)
        h = step / count
        assert times == [
            t for k in range(count) for t in (time + k * h, *2 * (time + k * h + 0.5 * h,), time + k * h + h)
        ]


@pytest.mark.slow
@settings(max_examples=40, **PATIENT)
@given(
    random_units().flatmap(
        lambda model: st.tuples(st.just(model), random_starts(model), random_columns(model, 6))
    )
)
def test_a_restored_instance_goes_on_bit_by_bit(
    case: tuple[BlockModel, dict[str, Any], dict[str, Any]],
) -> None:
    model, start, columns = case
    instance = Instance(model)
    for one in model.arguments:
        if one.name in start:
            instance.set([instance.reference(name) for name in one.names], np.ravel(start[one.name]).tolist())

    def go(first: int, last: int) -> list[Any]:
        seen = []
        for k in range(first, last):
            for one in model.inputs:
                places = [instance.reference(name) for name in one.names]
                instance.set(places, np.ravel(columns[one.name][k]).tolist())
            seen.append(everything(instance))
            instance.do_step(0.01 * k, 0.01)
        return [*seen, everything(instance)]

    go(0, 3)
    saved = instance.save()
    kept = pickle.dumps(saved)
    expected = go(3, 6)
    instance.restore(saved)
    assert go(3, 6) == expected
    assert pickle.dumps(saved) == kept  # going on has not changed what was saved
    other = Instance(model)
    other.restore(pickle.loads(kept))
    instance = other
    assert go(3, 6) == expected


def test_saving_keeps_whether_it_runs() -> None:
    instance = Instance(mixed())
    saved = instance.save()
    instance.do_step(0.0, 1.0)
    instance.restore(saved)
    put(instance, fixed=3.0)
    assert shown(instance, "fixed") == [3.0]


def test_runs_side_by_side_are_the_single_runs() -> None:
    k = np.array([1.0, 2.0, 5.0])
    together = Instance(mixed())
    together.set([together.reference("k"), together.reference("u")], [k, np.array([3.0, -1.0, 0.5])])
    together.do_step(0.0, 0.5)
    [y, x] = together.get([together.reference("y"), together.reference("x")])
    for index, u in enumerate((3.0, -1.0, 0.5)):
        single = Instance(mixed())
        put(single, k=float(k[index]), u=u)
        single.do_step(0.0, 0.5)
        assert [y[index], x[index]] == shown(single, "y", "x")


def test_a_column_is_refused_for_any_row_and_kept_as_it_was() -> None:
    instance, column = Instance(mixed()), np.array([1.0, 101.0, 3.0])
    for wrong, said in ((101.0, "found 101"), (math.nan, "found nan"), (-math.inf, "found -inf")):
        column[1] = wrong
        with pytest.raises(UnitError, match=f"^unit mixed: u: {said}, allowed"):
            instance.set([instance.reference("u")], [column])
    column[1] = 2.0
    instance.set([instance.reference("u")], [column])
    column[1] = 50.0
    assert instance.get([instance.reference("u")])[0].tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(UnitError, match=r"^unit mixed: n: found 0.5, allowed: an integer of 32 bits$"):
        instance.set([instance.reference("n")], [np.array([1.0, 0.5])])
