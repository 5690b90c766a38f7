"""What depends on what, and what a unit's function may not do."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

from random_units import PATIENT, random_units
from urmpipe_fmus.block import BlockModel, Input, Memory, Output, Parameter, State, Table
from urmpipe_fmus.dependencies import FUNCTIONS, TIME, Dependencies
from urmpipe_models.errors import UnitError


def of(function: Callable[[Any], Any]) -> Dependencies:
    return Dependencies(
        BlockModel(
            name="u",
            description="",
            variables=(
                Input(name="x", description=""),
                Input(name="y", description=""),
                Input(name="a", description="", size=3),
                Output(name="o", description=""),
            ),
            outputs=lambda v: {"o": function(v)},
        )
    )


def test_every_function_of_a_unit_has_its_own_dependencies() -> None:
    model = BlockModel(
        name="u",
        description="",
        variables=(
            Parameter(name="k", description=""),
            Input(name="u", description="", size=2),
            State(name="x", description=""),
            Memory(name="m", description=""),
            Output(name="y", description="", size=2),
            Output(name="c", description=""),
        ),
        outputs=lambda v: {"y": (v.x + v.table.before[0], v.u[1] * v.m), "c": 4.0},
        derivatives=lambda v: {"x": v.k * v.u[0]},
        update=lambda v: {"m": v.m + v.time},
        table=Table(np.array([0]), np.array([[1.0]])),
    )
    found = Dependencies(model)
    assert found.outputs == {"y[1]": {"x", TIME}, "y[2]": {"u[2]", "m"}, "c": frozenset()}
    assert found.derivatives == {"x": {"k", "u[1]"}}
    assert found.update == {"m": {"m", TIME}}


@pytest.mark.parametrize(
    ("function", "names"),
    [
        (lambda v: v.x * 0.0, {"x"}),
        (lambda v: abs(v.x) ** 2 % v.y // 2.0, {"x", "y"}),
        (lambda v: sum(v.a), {"a[1]", "a[2]", "a[3]"}),
        (lambda v: np.where(v.x > 0.0, v.y, 1.0), {"x", "y"}),
        (lambda v: np.where(np.logical_and(v.x > 0.0, v.y != v.x), 1.0, 0.0), {"x", "y"}),
        (lambda v: np.where((v.x > 0.0) & ~(v.y > 0.0), 1.0, 0.0), {"x", "y"}),
        (lambda v: np.clip(v.x, -1.0, v.y), {"x", "y"}),
        (lambda v: np.clip(v.x, min=v.y, max=2.0), {"x", "y"}),
        (lambda v: np.round(v.x, decimals=2) + np.hypot(v.y, 3.0), {"x", "y"}),
        (lambda v: np.float64(2.0) * v.x - np.array(3.0), {"x"}),
        (lambda v: np.where(np.isnan(v.x), 0.0, v.x), {"x"}),
    ],
)
def test_elementwise_functions_remember_what_goes_in(function: Callable[[Any], Any], names: set[str]) -> None:
    assert of(function).outputs == {"o": names}


BRANCH = (
    "a branch on x: found in a unit's function (if, and, or, not, min, max, in), allowed: np.where,"
    " np.logical_and, np.minimum and their like"
)
NUMBER = (
    "float(), int(), round(), an index or a function of the math module on x: found in a unit's function,"
    " allowed: NumPy's elementwise functions"
)
ARRAY = (
    "an array of values (np.array, np.sum, np.dot, np.linalg, a function of a whole tuple): found in a unit's"
    " function, allowed: one element after the other, sum(...), np.hypot"
)
ALLOWED = f"found in a unit's function, allowed: np.{', np.'.join(FUNCTIONS)}"
TUPLE = "of an array or a tuple: found in a unit's function, allowed: one element after the other"
TRUTH = "of truth values: found in a unit's function, allowed: np.where(condition, 1.0, 0.0)"


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda v: 1.0 if v.x > 0.0 else 0.0, BRANCH),
        (lambda v: v.x > 0.0 and v.y, BRANCH),
        (lambda v: v.x or v.y, BRANCH),
        (lambda v: not v.x, BRANCH),
        (lambda v: v.x in (1.0, 2.0), BRANCH),
        (lambda v: max(v.x, 0.0), BRANCH),
        (lambda v: min(0.0, v.x), BRANCH),
        (lambda v: float(v.x), NUMBER),
        (lambda v: int(v.x), NUMBER),
        (lambda v: round(v.x), NUMBER),
        (lambda v: math.sin(v.x), NUMBER),
        (lambda v: math.floor(v.x), NUMBER),
        (lambda v: math.ceil(v.x), NUMBER),
        (lambda v: math.trunc(v.x), NUMBER),
        (lambda v: (1.0, 2.0)[v.x], NUMBER),
        (lambda v: sum(range(v.x)), NUMBER),
        (lambda v: np.sum(v.a), ARRAY),
        (lambda v: np.array(v.a)[0], ARRAY),
        (lambda v: np.dot(v.a, v.a), ARRAY),
        (lambda v: np.linalg.norm(v.a), ARRAY),
        (lambda v: np.sqrt(v.a)[0], ARRAY),
        (lambda v: np.add.reduce([v.x, v.y]), ARRAY),
        (lambda v: np.float64(v.x), ARRAY),
        (lambda v: np.unwrap(v.x), f"np.unwrap: {ALLOWED}"),
        (lambda v: np.interp(v.x, [0.0, 1.0], [0.0, 1.0]), f"np.interp: {ALLOWED}"),
        (lambda v: np.matmul(v.x, v.y), f"np.matmul: {ALLOWED}"),
        (lambda v: np.cbrt(v.x), f"np.cbrt: {ALLOWED}"),
        (lambda v: np.where(v.x > 0.0), f"np.where with other arguments: {ALLOWED}"),
        (lambda v: np.add(v.x, v.y, dtype=float), f"np.add with dtype: {ALLOWED}"),
        (lambda v: np.maximum(v.x, np.ones(3))[0], f"np.maximum {TUPLE}"),
        (lambda v: np.where(v.x > 0.0, (1.0, 2.0), 0.0)[0], f"np.where {TUPLE}"),
        (lambda v: (v.x > 0.0) + (v.y > 0.0), f"np.add {TRUTH}"),
        (lambda v: -(v.x > 0.0), f"np.negative {TRUTH}"),
    ],
)
def test_what_c_could_not_do_is_told_by_what_to_write_instead(
    function: Callable[[Any], Any], said: str
) -> None:
    with pytest.raises(UnitError) as error:
        of(function)
    [finding] = error.value.findings
    assert finding.message == f"unit u: outputs: {said}"
    assert (finding.file, finding.line) == (__file__, function.__code__.co_firstlineno)


def test_the_functions_that_are_allowed_are_those_that_become_c() -> None:
    pytest.importorskip("casadi")
    from urmpipe_fmus.native.symbols import traceable

    assert sorted(FUNCTIONS) == sorted(traceable())


@pytest.mark.slow
@settings(max_examples=40, **PATIENT)
@given(random_units())
def test_what_an_expression_of_casadi_depends_on_is_remembered_and_nothing_else(model: BlockModel) -> None:
    casadi = pytest.importorskip("casadi")
    from urmpipe_fmus.native.symbols import exact_expressions
    from urmpipe_fmus.native.trace import traced

    functions, found = traced(model), Dependencies(model)
    names = [name for name, _ in model.scalars]
    for function, remembered in (
        (functions.outputs, found.outputs),
        (functions.derivatives, found.derivatives),
        (functions.update, found.update),
    ):
        arguments = function.sx_in()
        values = [arguments[1][k] for k in range(len(names))] if names else []
        rows = casadi.vertcat(arguments[0], *arguments[2:])
        with exact_expressions():  # x - x stays an expression of x
            results = function.call(arguments)[0] if remembered else []
        for k, (name, goes_in) in enumerate(remembered.items()):
            one = results[k]
            traced_names = {
                n for n, symbol in zip(names, values, strict=True) if casadi.depends_on(one, symbol)
            }
            if casadi.depends_on(one, rows):
                traced_names.add(TIME)
            assert traced_names == goes_in, name
