"""Running block models: what functions may return, the rules of a step, and a model over a log."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

from asserting import refusal
from random_units import PATIENT, UnitCase, random_cases
from small_models import block, mixed, variable
from stepped_unit import SteppedUnit
from urmpipe_fmus.block import INTERNAL_STEP, BlockModel, Input, Memory, Output, Parameter, State
from urmpipe_fmus.instance import Equations, Instance
from urmpipe_fmus.run import run
from urmpipe_models.errors import UnitError


def unit_of(outputs: Any) -> BlockModel:
    return block(variable(Input, "x"), variable(Output, "y"), variable(Output, "p", size=2), outputs=outputs)


def test_elements_go_in_by_kind_and_come_out_in_order() -> None:
    model = block(
        variable(Output, "y"),
        variable(Memory, "m", size=2),
        variable(State, "s"),
        variable(Input, "i"),
        variable(Parameter, "p"),
        variable(Output, "w", size=2),
        outputs=lambda v: {"w": (v.s, v.m[1]), "y": v.p + 10.0 * v.i},
        derivatives=lambda v: {"s": v.time},
        update=lambda v: {"m": [v.m[1], v.m[0]]},
    )
    given = [1.0, 0.25, 2.0, 3.0, 4.0, 5.0]  # p, internal_step, i, s, m[1], m[2]
    equations = Equations(model)
    assert equations.outputs(0.0, given) == [21.0, 3.0, 5.0]
    assert equations.derivatives(7.0, given) == [7.0]
    assert equations.update(0.0, given) == [5.0, 4.0]


def fails(v: Any) -> dict[str, Any]:
    names = {"y": v.x}
    return {"y": names["z"], "p": (v.x, v.x)}


def test_a_failing_function_is_told_with_its_line() -> None:
    with pytest.raises(UnitError) as error:
        Equations(unit_of(fails)).outputs(0.0, [0.0])
    [finding] = error.value.findings
    assert finding.message == "unit u: outputs: KeyError: 'z'"
    assert (finding.file, finding.line) == (__file__, fails.__code__.co_firstlineno + 2)
    assert isinstance(error.value.__cause__, KeyError)


def test_a_division_by_zero_is_infinite_as_in_c_and_warns_nobody(recwarn: pytest.WarningsRecorder) -> None:
    model = unit_of(lambda v: {"y": 1.0 / v.x, "p": (np.log(v.x), np.where(v.x == 0.0, 5.0, 1.0 / v.x))})
    assert Equations(model).outputs(0.0, [np.float64(0.0)]) == [np.inf, -np.inf, 5.0]
    assert not recwarn.list


def everything(instance: Instance) -> tuple[Any, ...]:
    return (instance.time, *instance.get(range(len(instance.model.scalars))))


def test_an_output_is_that_of_the_inputs_as_they_stand_without_a_step() -> None:
    instance = SteppedUnit(mixed())
    for u in (3.0, -1.0):
        instance.put(u=u)
        assert instance.read("y").tolist() == [2.0 * u]
    instance.put(k=5.0)
    assert instance.read("y").tolist() == [-5.0]


def test_a_step_takes_the_sample_first_and_integrates_with_the_inputs_held() -> None:
    instance = SteppedUnit(mixed(), {"u": 3.0})
    instance.do_step(0.0, 0.5)
    assert instance.read("m", "x", "y").tolist() == [3.0, -1.5, 6.0 - 1.5 + 300.0]
    instance.put(u=1.0)
    # m is still the sample of the point before
    assert instance.read("m", "y").tolist() == [3.0, 2.0 - 1.5 + 300.0]
    instance.do_step(0.5, 0.5)
    assert instance.read("m", "x").tolist() == [1.0, -2.0]


def test_fixed_parameters_states_and_memories_are_set_before_the_first_step_only() -> None:
    instance = SteppedUnit(mixed())
    instance.put(fixed=3.0, x=4.0, m=5.0, internal_step=0.1)
    assert instance.read("fixed", "x", "m", INTERNAL_STEP).tolist() == [3.0, 4.0, 5.0, 0.1]
    instance.do_step(0.0, 1.0)
    instance.put(k=1.0, u=2.0)  # tunable, and an input


def test_a_step_whose_states_fail_leaves_all_as_it_was() -> None:
    instance = SteppedUnit(mixed(), {"fixed": 1.0, "u": 2.0})
    before = everything(instance)
    assert refusal(UnitError, instance.do_step, 0.0, 1.0) == "unit mixed: state x is not finite at 0 s"
    assert everything(instance) == before  # also the sample that was taken before the states failed


def test_a_step_may_pass_the_stop_time_by_what_rounding_adds() -> None:
    instance = SteppedUnit(mixed())
    instance.setup_experiment(0.0, 0.5)
    instance.do_step(0.0, 0.4)
    instance.do_step(0.4, 0.1001)
    assert instance.time == pytest.approx(0.5001, abs=1e-15)
    instance.setup_experiment(0.5)
    instance.do_step(0.5, 0.25)
    assert instance.time == 0.75


def test_an_error_of_the_functions_undoes_the_step_too() -> None:
    def rates(v: Any) -> dict[str, Any]:
        return {"x": {0.0: 1.0}[float(v.x)]}  # fails once x has moved

    variables = variable(State, "x"), variable(Memory, "m")
    instance = SteppedUnit(block(*variables, derivatives=rates, update=lambda v: {"m": v.m + 1.0}))
    with pytest.raises(UnitError, match="unit u: derivatives: KeyError"):
        instance.do_step(0.0, 1.0)
    assert everything(instance)[:3] == (0.0, 0.0, 0.0)


def test_an_output_that_is_not_finite_is_an_error_until_its_inputs_are_mended() -> None:
    model = block(variable(Input, "u"), variable(Output, "y"), outputs=lambda v: {"y": 1.0 / v.u})
    instance = SteppedUnit(model)
    instance.setup_experiment(2.5)
    for _ in range(2):
        with pytest.raises(UnitError, match=r"^unit u: output y is not finite at 2.5 s$"):
            instance.read("y")
        assert instance.read("u").tolist() == [0.0]
    instance.put(u=4.0)
    assert instance.read("y").tolist() == [0.25]


def error_at(step: float) -> float:
    """The error at t = 2 of x' = -2 t x^2, x(0) = 1, of which x = 1 / (1 + t^2)."""
    model = block(
        variable(State, "x", start=1.0),
        derivatives=lambda v: {"x": -2.0 * v.time * v.x * v.x},
        internal_step=step,
        name="ode",
    )
    instance = SteppedUnit(model)
    instance.steps(4, 0.5)
    return abs(float(instance.read("x")[0]) - 0.2)


def test_the_error_falls_with_the_fourth_power_of_the_internal_step() -> None:
    errors = [error_at(step) for step in (0.05, 0.025, 0.0125)]
    ratios = np.array(errors[:-1]) / errors[1:]
    assert (np.abs(np.log2(ratios) - 4.0) < 0.1).all(), ratios  # the fifth power's share is below a tenth


def test_a_step_is_divided_into_equal_internal_steps() -> None:
    times: list[float] = []

    def rates(v: Any) -> dict[str, Any]:
        times.append(float(v.time))
        return {"x": 0.0}

    model = block(variable(State, "x"), derivatives=rates, internal_step=0.1)
    steps = ((0.0, 0.3, 3), (0.3, 0.6 - 0.3, 3), (0.0, 0.05, 1), (0.0, 0.1001, 2), (1.0, 0.35, 4))
    for time, step, count in steps:
        times.clear()
        Instance(model, time).do_step(time, step)
        h = step / count
        assert times == [
            t for k in range(count) for t in (time + k * h, *2 * (time + k * h + 0.5 * h,), time + k * h + h)
        ]


@pytest.mark.slow
@settings(max_examples=40, **PATIENT)
@given(random_cases(6))
def test_a_restored_instance_goes_on_bit_by_bit(case: UnitCase) -> None:
    model, start, columns = case
    instance = SteppedUnit(model, start)

    def go(first: int, last: int) -> list[Any]:
        seen = []
        for k in range(first, last):
            instance.put(**{name: column[k] for name, column in columns.items()})
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
    instance = SteppedUnit(model)
    instance.restore(pickle.loads(kept))
    assert go(3, 6) == expected


def test_saving_keeps_whether_it_runs() -> None:
    instance = SteppedUnit(mixed())
    saved = instance.save()
    instance.do_step(0.0, 1.0)
    instance.restore(saved)
    instance.put(fixed=3.0)
    assert instance.read("fixed").tolist() == [3.0]


def test_runs_side_by_side_are_the_single_runs() -> None:
    k = np.array([1.0, 2.0, 5.0])
    together = SteppedUnit(mixed())
    together.set([together.reference("k"), together.reference("u")], [k, np.array([3.0, -1.0, 0.5])])
    together.do_step(0.0, 0.5)
    [y, x] = together.get([together.reference("y"), together.reference("x")])
    for index, u in enumerate((3.0, -1.0, 0.5)):
        single = SteppedUnit(mixed(), {"k": float(k[index]), "u": u})
        single.do_step(0.0, 0.5)
        assert [y[index], x[index]] == single.read("y", "x").tolist()


def test_a_column_is_refused_for_any_row_and_kept_as_it_was() -> None:
    instance, column = SteppedUnit(mixed()), np.array([1.0, 101.0, 3.0])
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


def gain(**more: Any) -> BlockModel:
    return block(
        variable(Parameter, "k", start=2.0, minimum=0.0),
        variable(Input, "u", size=2, start=(1.0, 3.0)),
        variable(Output, "y", size=2),
        variable(Output, "t"),
        variable(Output, "one"),
        outputs=lambda v: {"y": tuple(v.k * u for u in v.u), "t": v.time, "one": 1.0},
        **more,
        name="gain",
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


def test_a_memory_makes_each_sample_wait_for_the_one_before() -> None:
    model = block(
        variable(Input, "u"),
        variable(Memory, "m", output=True),
        variable(Output, "y"),
        outputs=lambda v: {"y": v.m + v.u},
        update=lambda v: {"m": v.m + v.u},
        name="sum",
    )
    u = np.array([1.0, 2.0, 4.0, 8.0])
    found = run(model, np.array([0.0, 0.1, 0.5, 0.6]), {"u": u}, {"m": 10.0})
    assert found["y"].tolist() == [11.0, 13.0, 17.0, 25.0]
    assert found["m"].tolist() == [10.0, 11.0, 13.0, 17.0]


@pytest.mark.slow
@settings(max_examples=40, **PATIENT)
@given(random_cases(5, remembers=False))
def test_a_unit_without_memory_gives_at_once_what_it_gives_step_by_step(case: UnitCase) -> None:
    model, start, columns = case
    t = np.array([0.0, 0.125, 0.25, 0.375, 0.5])  # t + h is exact
    found, instance = run(model, t, columns, start), SteppedUnit(model, start)
    for k, time in enumerate(t):
        instance.put(**{name: column[k] for name, column in columns.items()})
        for one in model.computed:
            seen = instance.get([instance.reference(name) for name in one.names])
            # NumPy computes a column's sine with other instructions than a number's: last places differ
            np.testing.assert_allclose(np.ravel(found[one.name][k]), seen, rtol=0.0, atol=1e-13)
        instance.do_step(float(time), 0.125)
