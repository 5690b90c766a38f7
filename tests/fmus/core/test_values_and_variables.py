"""What a unit's functions read, and what its variables allow."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import pytest

from urmpipe_fmus.block import (
    INTERNAL_STEP,
    BlockModel,
    Input,
    Memory,
    Output,
    Parameter,
    State,
    Values,
    Variable,
)
from urmpipe_models.errors import UnitError


def test_values_are_copied_pickled_and_asked_as_any_object_is() -> None:
    values = Values(0.5, {"x": 1.0, "phi": (2.0, 3.0)})
    for again in (copy.copy(values), copy.deepcopy(values), pickle.loads(pickle.dumps(values))):
        assert (again.time, again.x, again.phi, again.table) == (0.5, 1.0, (2.0, 3.0), None)
    assert not hasattr(values, "y")
    assert getattr(values, "y", 7.0) == 7.0
    with pytest.raises(UnitError) as error:
        _ = values.y
    assert str(error.value) == "v.y: found in a unit's function, allowed: phi, table, time, x"


def test_an_array_has_a_scalar_an_element_counted_from_one() -> None:
    phi = Input(name="phi", description="", size=3, start=(1.0, 2.0, 3.0))
    assert (phi.width, phi.names, phi.starts) == (3, ("phi[1]", "phi[2]", "phi[3]"), (1.0, 2.0, 3.0))
    u = Input(name="u", description="", start=2)
    assert (u.width, u.names, u.starts) == (1, ("u",), (2.0,))


@pytest.mark.parametrize(
    ("variable", "value", "said"),
    [
        (Input(name="x", description=""), math.nan, "found nan, allowed: a finite number"),
        (Input(name="x", description=""), -math.inf, "found -inf, allowed: a finite number"),
        (Input(name="x", description="", minimum=-1.0, maximum=0.5), 0.5000000000000001,
         "found 0.50000000000000011, allowed: -1 to 0.5"),
        (Input(name="n", description="", type="Integer"), 0.5, "found 0.5, allowed: an integer of 32 bits"),
        (Input(name="n", description="", type="Integer"), 2.0**31,
         "found 2147483648, allowed: an integer of 32 bits"),
        (Input(name="b", description="", type="Boolean"), 2.0, "found 2, allowed: 0 or 1"),
    ],
)  # fmt: skip
def test_a_value_that_is_not_allowed_is_refused(variable: Variable, value: float, said: str) -> None:
    assert list(variable.rejection_reasons(value)) == [said]


def test_a_value_at_a_bound_is_allowed() -> None:
    x = Input(name="x", description="", minimum=-1.0, maximum=0.5)
    assert not [fault for value in (-1.0, 0.5, 0.0) for fault in x.rejection_reasons(value)]
    n = Input(name="n", description="", type="Integer")
    assert not [fault for value in (-(2.0**31) + 1, 2.0**31 - 1) for fault in n.rejection_reasons(value)]


def test_all_that_is_wrong_with_a_unit_is_told_at_once() -> None:
    with pytest.raises(UnitError) as error:
        BlockModel(
            name="größe",
            description="",
            variables=(
                Input(name="x", description="", minimum=2.0, maximum=1.0, start=1.5),
                Input(name="x", description="", size=2, start=(1.0,)),
                Input(name="φ", description=""),
                Input(name="_p", description="", size=0),
                Input(name="time", description="", start=math.nan),
                Output(name="y", description=""),
                Memory(name=INTERNAL_STEP, description=""),
            ),
            derivatives=lambda v: {},
        )
    name = "allowed: a letter, then letters, digits and _"
    assert [line.removeprefix("unit größe: ") for line in str(error.value).splitlines()] == [
        f"found 'größe' as its name, {name}",
        "x: found twice, allowed: each name once",
        "time: found as a variable, allowed: another name (v.time is given to all units)",
        "x: min 2 above max 1",
        "x: start value found 1.5, allowed: 2 to 1",
        "x: found 1 start values, allowed: 2",
        f"'φ': found as a name, {name}",
        f"'_p': found as a name, {name}",
        "_p: size 0, allowed: 1 or more",
        "time: start value found nan, allowed: a finite number",
        "internal_step: found as a variable, allowed: one Real parameter with a min above 0",
        "output y is declared, but `outputs` is not set",
        "`derivatives` is set, but no state is declared",
        "memory internal_step is declared, but `update` is not set",
    ]


def test_a_unit_that_no_fmu_can_be_of_is_refused() -> None:
    with pytest.raises(UnitError) as error:
        BlockModel(name="u", description="", variables=())
    assert str(error.value) == (
        "unit u: found no variables, allowed: one or more (FMI has no FMU without them)"
    )
    step: dict[str, Any] = {"name": INTERNAL_STEP, "description": "", "start": 1.0, "minimum": 0.5}
    for wrong in (Parameter(**step, size=2), Parameter(**step, type="Integer"), Input(**step)):
        with pytest.raises(UnitError) as error:
            BlockModel(
                name="u",
                description="",
                variables=(State(name="x", description=""), wrong),
                derivatives=lambda v: {"x": 1.0},
            )
        assert str(error.value) == (
            "unit u: internal_step: found as a variable, allowed: one Real parameter with a min above 0"
        )


@pytest.mark.parametrize(
    ("variable", "said"),
    [
        (Input(name="x", description="", start=[1.0, 2.0], size=2),  # type: ignore[arg-type]
         "x: start value [1.0, 2.0], allowed: a number, or a tuple of numbers"),
        (Input(name="x", description="", start="3"),  # type: ignore[arg-type]
         "x: start value '3', allowed: a number, or a tuple of numbers"),
        (Input(name="x", description="", start=(1.0, None), size=2),  # type: ignore[arg-type]
         "x: start value (1.0, None), allowed: a number, or a tuple of numbers"),
        (State(name="x", description="", type="Integer"),
         "x: found Integer as a state, allowed: Real (a Memory may be Integer)"),
    ],
)  # fmt: skip
def test_what_cannot_be_a_variable_is_told(variable: Variable, said: str) -> None:
    assert list(variable.faults()) == [said]


def test_what_is_of_a_wrong_kind_is_told() -> None:
    with pytest.raises(UnitError) as error:
        BlockModel(
            name="u",
            description=None,  # type: ignore[arg-type]
            variables=(
                Input(name="x", description="", type="String", size=2.0),  # type: ignore[arg-type]
                Input(name="y", description=5, unit=None),  # type: ignore[arg-type]
                "z",
            ),
            equations="y = x",  # type: ignore[arg-type]
        )
    assert str(error.value).splitlines() == [
        "unit u: x: found type 'String', allowed: Real, Integer, Boolean",
        "unit u: x: found size 2.0, allowed: an integer; None for a scalar",
        "unit u: y: description: found 5, allowed: a text",
        "unit u: y: unit: found None, allowed: a text",
        "unit u: found 'z' as a variable, allowed: a Parameter, Input, Output, State or Memory",
        "unit u: description: found None, allowed: a text",
        "unit u: equations: found 'y = x', allowed: a tuple of texts, a line each",
    ]


def test_a_unit_with_states_has_the_integrators_step_as_a_fixed_parameter() -> None:
    model = BlockModel(
        name="u",
        description="",
        variables=(State(name="x", description=""), Parameter(name="k", description="")),
        derivatives=lambda v: {"x": v.k},
        internal_step=2e-3,
    )
    assert [name for name, _ in model.scalars] == ["x", "k", INTERNAL_STEP]
    step = model.parameters[-1]
    assert (step.start, step.unit, step.minimum, step.variability) == (2e-3, "s", 1e-9, "fixed")
    assert [one.name for one in model.arguments] == ["k", INTERNAL_STEP, "x"]
