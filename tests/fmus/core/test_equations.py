"""What a unit's functions may return, and what is told if they fail."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from urmpipe_fmus.block import BlockModel, Input, Memory, Output, Parameter, State
from urmpipe_fmus.run import Equations
from urmpipe_models.errors import UnitError


def unit_of(outputs: Any) -> BlockModel:
    return BlockModel(
        name="u",
        description="",
        variables=(
            Input(name="x", description=""),
            Output(name="y", description=""),
            Output(name="p", description="", size=2),
        ),
        outputs=outputs,
    )


def test_elements_go_in_by_kind_and_come_out_in_order() -> None:
    model = BlockModel(
        name="u",
        description="",
        variables=(
            Output(name="y", description=""),
            Memory(name="m", description="", size=2),
            State(name="s", description=""),
            Input(name="i", description=""),
            Parameter(name="p", description=""),
            Output(name="w", description="", size=2),
        ),
        outputs=lambda v: {"w": (v.s, v.m[1]), "y": v.p + 10.0 * v.i},
        derivatives=lambda v: {"s": v.time},
        update=lambda v: {"m": [v.m[1], v.m[0]]},
    )
    given = [1.0, 0.25, 2.0, 3.0, 4.0, 5.0]  # p, internal_step, i, s, m[1], m[2]
    equations = Equations(model)
    assert equations.outputs(0.0, given) == [21.0, 3.0, 5.0]
    assert equations.derivatives(7.0, given) == [7.0]
    assert equations.update(0.0, given) == [5.0, 4.0]


@pytest.mark.parametrize(
    ("returned", "said"),
    [
        (None, ["returns nothing (None), allowed: a dict of y, p"]),
        ((1.0, 2.0), ["returns tuple, allowed: a dict of y, p"]),
        (
            {"y": 1.0, "z": 2.0},
            [
                "z: found in what it returns, allowed: y, p",
                "p: not found in what it returns, allowed: all of y, p",
            ],
        ),
        (
            {"y": "1.0", "p": (1j, None), 3: 4.0},
            [
                "3: found in what it returns, allowed: y, p",
                "y: found str, allowed: one element",
                "p[1]: found complex, allowed: one element",
                "p[2]: found nothing (None), allowed: one element",
            ],
        ),
        (
            {"y": (1.0,), "p": (1.0, 2.0, 3.0)},
            ["y: found tuple, allowed: one element", "p: found 3 elements, allowed: 2"],
        ),
        (
            {"y": None, "p": np.array([1.0, 2.0])},
            [
                "y: found nothing (None), allowed: one element",
                "p: found ndarray, allowed: a tuple of 2 elements",
            ],
        ),
    ],
)
def test_what_a_function_may_not_return_is_told(returned: Any, said: list[str]) -> None:
    def give(v: Any) -> Any:
        return returned

    with pytest.raises(UnitError) as error:
        Equations(unit_of(give)).outputs(0.0, [0.0])
    place = f"{__file__}:{give.__code__.co_firstlineno}"
    assert str(error.value).splitlines() == [f"{place}: unit u: outputs: {one}" for one in said]


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
