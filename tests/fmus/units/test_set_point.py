"""The set point as a unit: the model's closed forms, at all times at once and at one."""

from __future__ import annotations

import numpy as np
import pytest

from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.dependencies import TIME, Dependencies
from urmpipe_fmus.run import Instance, run
from urmpipe_models.drives import ramp, step, trapezoid
from urmpipe_models.errors import UnitError

T = np.linspace(0.0, 2.0, 81)
MOVE = {"begin": 0.25, "initial": 0.5, "target": -1.0, "speed": 1.5, "acceleration": 6.0}


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (0, step(T, 0.25, 0.5, -1.0)),
        (1, ramp(T, 0.25, 0.5, -1.0, 1.5)),
        (2, trapezoid(T, 0.25, 0.5, -1.0, 1.5, 6.0)),
    ],
)
def test_each_kind_is_its_form_for_a_log_and_for_an_instance(
    kind: int, expected: tuple[np.ndarray, ...]
) -> None:
    found = run(make_block("set_point"), T, start=MOVE | {"kind": kind})
    instance = Instance(make_block("set_point"))
    names = ("theta", "omega", "alpha")
    instance.set([instance.reference(name) for name in (*MOVE, "kind")], [*MOVE.values(), float(kind)])
    for name, column in zip(names, expected, strict=True):
        np.testing.assert_array_equal(found[name], column)
    for k in range(3):
        got = instance.get([instance.reference(name) for name in names])
        assert got == [column[k] for column in expected]
        instance.do_step(float(T[k]), float(T[k + 1] - T[k]))


def test_it_is_a_function_of_time_and_parameters_alone() -> None:
    parameters = {"kind", "begin", "initial", "target", "speed", "acceleration"}
    assert Dependencies(make_block("set_point")).outputs["theta"] == parameters | {TIME}


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("kind", 3.0, "found 3, allowed: 0 to 2"),
        ("kind", 1.5, "found 1.5, allowed: an integer of 32 bits"),
        ("speed", 0.0, "found 0, allowed: 1e-09 to inf"),
        ("acceleration", -1.0, "found -1, allowed: 1e-09 to inf"),
    ],
)
def test_what_makes_no_move_is_refused(name: str, value: float, said: str) -> None:
    instance = Instance(make_block("set_point"))
    with pytest.raises(UnitError) as error:
        instance.set([instance.reference(name)], [value])
    assert str(error.value) == f"unit set_point: {name}: {said}"
