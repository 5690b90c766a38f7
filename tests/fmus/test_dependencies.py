"""What depends on what, and what a unit's function may not do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from random_units import PATIENT, random_units
from small_models import block, variable
from urmpipe_fmus.block import BlockModel, Input, Memory, Output, Parameter, State, Table, Variable
from urmpipe_fmus.dependencies import FUNCTIONS, TIME, Dependencies


def test_every_function_of_a_unit_has_its_own_dependencies() -> None:
    arrays = variable(Input, "u", size=2), variable(Output, "y", size=2)
    kinds: dict[str, type[Variable]] = {"k": Parameter, "x": State, "m": Memory, "c": Output}
    model = block(
        *(*arrays, *(variable(kind, name) for name, kind in kinds.items())),
        outputs=lambda v: {"y": (v.x + v.table.before[0], v.u[1] * v.m), "c": 4.0},
        derivatives=lambda v: {"x": v.k * v.u[0]},
        update=lambda v: {"m": v.m + v.time},
        table=Table(np.array([0]), np.array([[1.0]])),
    )
    found = Dependencies(model)
    assert found.outputs == {"y[1]": {"x", TIME}, "y[2]": {"u[2]", "m"}, "c": frozenset()}
    assert found.derivatives == {"x": {"k", "u[1]"}}
    assert found.update == {"m": {"m", TIME}}


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
    for kind in ("outputs", "derivatives", "update"):
        function, remembered = getattr(functions, kind), getattr(found, kind)
        arguments = function.sx_in()
        symbols = [(name, arguments[1][k]) for k, (name, _) in enumerate(model.scalars)]
        rows = casadi.vertcat(arguments[0], *arguments[2:])
        with exact_expressions():  # x - x stays an expression of x
            results = function.call(arguments)[0] if remembered else []
        for k, (name, goes_in) in enumerate(remembered.items()):
            traced_names = {scalar for scalar, one in symbols if casadi.depends_on(results[k], one)}
            if casadi.depends_on(results[k], rows):
                traced_names.add(TIME)
            assert traced_names == goes_in, name
