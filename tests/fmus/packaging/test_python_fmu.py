"""Python FMUs: what they compute, how they refuse, how they stay apart, under FMPy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from loaded_fmu import Loaded
from urmpipe_fmus.block import BlockModel, Input, Parameter, Recipe
from urmpipe_fmus.blocks.user import block_from_source
from urmpipe_fmus.build.fmu import build_fmu, cached_fmu
from urmpipe_fmus.instance import Instance

Make = Callable[..., BlockModel]
HELPERS = str(Path(__file__).parents[1])
DISCARD, FATAL = 2, 4
REFUSED = "Fatal py exception encountered: [{}] PyObject_CallMethod\n{}"
"""How pythonfmu's binary logs the message of a refused call."""


def random_value(one: Input | Parameter, random: np.random.Generator) -> float:
    """A value that the variable takes, near its start or in its range."""
    if one.type == "Boolean":
        return float(random.integers(2))
    low, high = max(one.minimum, 0.05), min(one.maximum, 8.0)
    value = float(random.uniform(low, high))
    return float(round(value)) if one.type == "Integer" else value


@pytest.mark.slow
def test_fmpy_finds_nothing_wrong(model: BlockModel) -> None:
    assert validate_fmu(str(cached_fmu(model, "python"))) == []


@pytest.mark.slow
def test_the_same_unit_is_the_same_bytes(model: BlockModel, tmp_path: Path) -> None:
    first = build_fmu(model, tmp_path, backend="python").path.read_bytes()
    assert build_fmu(model, tmp_path, backend="python").path.read_bytes() == first


@pytest.mark.slow
def test_it_computes_what_an_instance_does_bit_by_bit(model: BlockModel) -> None:
    random = np.random.default_rng(5)
    fmu, instance = Loaded(cached_fmu(model, "python"), start=0.02), Instance(model)
    instance.setup_experiment(0.02)
    names = [name for name, _ in model.scalars]
    everything = range(len(names))
    for k in range(40):
        for reference, (name, one) in enumerate(model.scalars):
            if isinstance(one, Input) or (isinstance(one, Parameter) and one.tunable and k % 10 == 0):
                value = random_value(one, random)
                fmu.set(name, int(value) if one.type != "Real" else value)
                instance.set([reference], [value])
        assert fmu.get(names) == [float(one) for one in instance.get(everything)]
        fmu.do_step(0.02 + k * 0.0073, 0.0073)
        instance.do_step(0.02 + k * 0.0073, 0.0073)
    assert fmu.get(names) == [float(one) for one in instance.get(everything)]
    fmu.free()


def test_outputs_are_fresh_after_set_without_a_step(make: Make) -> None:
    fmu = Loaded(cached_fmu(make("arm"), "python"))
    for angle in (0.0, 1.0, -2.5):
        fmu.set("phi[1]", angle)
        assert fmu.get(["first"]) == [0.5 * np.cos(angle)]
    fmu.free()


@pytest.mark.slow
@pytest.mark.parametrize("serialized", [False, True])
def test_a_state_that_is_restored_goes_on_bit_by_bit(model: BlockModel, serialized: bool) -> None:
    names = [name for name, _ in model.scalars]
    path = cached_fmu(model, "python")
    fmu = Loaded(path)
    for k in range(5):
        fmu.do_step(k * 0.011, 0.011)
    state = fmu.fmu.getFMUstate()
    content = fmu.fmu.serializeFMUstate(state)

    def go_on(one: Loaded) -> list[list[Any]]:
        found = [one.get(names)]
        for k in range(5, 12):
            one.do_step(k * 0.011, 0.011)
            found.append(one.get(names))
        return found

    expected = go_on(fmu)
    if serialized:
        fmu.free()
        fmu = Loaded(path)
        state = fmu.fmu.deSerializeFMUstate(content)
    fmu.fmu.setFMUstate(state)
    assert go_on(fmu) == expected
    fmu.fmu.setFMUstate(state)
    assert go_on(fmu) == expected
    fmu.fmu.freeFMUstate(state)
    fmu.free()


def test_no_step_goes_past_the_stop_time(make: Make) -> None:
    fmu = Loaded(cached_fmu(make("counter"), "python"))
    fmu.fmu.reset()
    fmu.fmu.setupExperiment(startTime=0.0, stopTime=0.5)
    fmu.fmu.enterInitializationMode()
    fmu.fmu.exitInitializationMode()
    fmu.do_step(0.0, 0.5)
    assert fmu.status_of("doStep", 0.5, 0.5) == DISCARD
    assert fmu.log[-1][2] == "unit counter: found a step to 1 s, allowed: to the stop time, 0.5 s"
    fmu.free()


@pytest.mark.slow
@pytest.mark.parametrize("serialized", [False, True])
def test_a_restored_state_knows_that_it_runs(make: Make, serialized: bool) -> None:
    fmu = Loaded(cached_fmu(make("spring"), "python"))
    fmu.do_step(0.0, 0.01)
    state = fmu.fmu.getFMUstate()
    if serialized:
        state = fmu.fmu.deSerializeFMUstate(fmu.fmu.serializeFMUstate(state))
    fmu.fmu.reset()
    fmu.initialize(0.0)
    fmu.set("d", 0.75)
    fmu.fmu.setFMUstate(state)
    assert fmu.status_of("setReal", [fmu.references["d"]], [1.0]) == FATAL
    assert fmu.log[-1][2] == REFUSED.format(
        "setReal", "unit spring: d: set while it runs, allowed: a fixed parameter before the first step"
    )
    assert fmu.get(["d"]) == [0.5]
    fmu.free()


def test_bytes_that_are_no_state_are_refused(make: Make) -> None:
    fmu = Loaded(cached_fmu(make("spring"), "python"))
    said = "unit spring: serializedState: found other bytes, allowed: those of a state of this FMU"
    for content in (b"", b"nonsense", b'["arm", true, [1.0]]', b'["spring", true, [NaN]]', b"[]", b"1"):
        state = fmu.fmu.deSerializeFMUstate(content)
        assert fmu.status_of("setFMUstate", state) == FATAL
        assert fmu.log.pop()[2] == REFUSED.format("_set_fmu_state", said)
        fmu.fmu.freeFMUstate(state)
    assert fmu.get(["x"]) == [0.01]
    fmu.free()


REFUSALS = [
    ("setReal", [0], [float("nan")], "m: found nan, allowed: a finite number"),
    ("setReal", [0], [float("inf")], "m: found inf, allowed: a finite number"),
    ("setReal", [0], [-1.0], "m: found -1, allowed: 1e-06 to inf"),
    ("setReal", [3], [2e3], "F: found 2000, allowed: -1000 to 1000"),
    ("setReal", [6], [0.0], "a: set, allowed: an output is computed, not set"),
    ("setReal", [9], [0.0], "value reference 9: found, allowed: 0 to 8"),
    ("setReal", [2**32 - 1], [0.0], "value reference 4294967295: found, allowed: 0 to 8"),
    ("setInteger", [0], [1], "m: found fmi2SetInteger, allowed: fmi2SetReal"),
    ("setBoolean", [4], [True], "x: found fmi2SetBoolean, allowed: fmi2SetReal"),
    ("getReal", [77], None, "value reference 77: found, allowed: 0 to 8"),
    ("getInteger", [4], None, "x: found fmi2GetInteger, allowed: fmi2GetReal"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("function", "references", "values", "said"), REFUSALS)
def test_what_is_refused_is_told_and_changes_nothing(
    make: Make, function: str, references: list[int], values: Any, said: str
) -> None:
    fmu = Loaded(cached_fmu(make("spring"), "python"))
    names = list(fmu.references)
    before = fmu.get(names)
    arguments = (references,) if values is None else (references, values)
    assert fmu.status_of(function, *arguments) == FATAL
    assert fmu.log == [(FATAL, "", REFUSED.format(function, f"unit spring: {said}"))]
    assert fmu.get(names) == before
    fmu.do_step(0.0, 0.01)
    fmu.free()


def test_refused_values_leave_all_of_a_call_unset(make: Make) -> None:
    fmu = Loaded(cached_fmu(make("spring"), "python"))
    assert fmu.status_of("setReal", [1, 0], [60.0, -1.0]) == FATAL
    assert fmu.get(["c", "m"]) == [50.0, 2.0]
    fmu.free()


@pytest.mark.slow
def test_an_instance_lives_on_after_many_refused_calls(make: Make) -> None:
    fmu, instance = Loaded(cached_fmu(make("spring"), "python")), Instance(make("spring"))
    for _ in range(2000):
        assert fmu.status_of("setReal", [0], [float("nan")]) == FATAL
        assert fmu.status_of("getReal", [77]) == FATAL
        assert fmu.status_of("doStep", 0.0, -1.0) == DISCARD
    fmu.do_step(0.0, 0.01)
    instance.do_step(0.0, 0.01)
    assert fmu.get(["x", "v"]) == instance.get([4, 5])
    fmu.free()


def test_a_step_that_fails_is_undone_and_told(make: Make) -> None:
    fmu = Loaded(cached_fmu(make("spring"), "python"))
    fmu.set("m", 1e-6)
    fmu.set("c", 1e300)
    names = list(fmu.references)
    before = fmu.get(["x", "v", "c"])
    assert fmu.status_of("doStep", 0.0, 1.0) == DISCARD
    assert fmu.log[-1][:2] == (3, "logStatusError")
    assert fmu.log[-1][2].startswith("unit spring: state x is not finite at 0 s")
    assert fmu.get(["x", "v", "c"]) == before
    fmu.set("m", 2.0)
    fmu.set("c", 50.0)
    fmu.do_step(0.0, 0.01)
    assert np.isfinite(fmu.get(names)).all()
    fmu.free()


RAISING = '''"""A unit that fails."""
from urmpipe_fmus.block import BlockModel, Input, Memory, Output
unit = BlockModel(name="raising", description="", variables=(
    Input(name="u", description="", start=1.0), Memory(name="n", description=""),
    Output(name="y", description="")),
    outputs=lambda v: {"y": {1.0: 5.0, 2.0: 6.0}[float(v.u)] if isinstance(v.u, float) else v.u},
    update=lambda v: {"n": wrong() if isinstance(v.u, float) and v.u == 0.5 else v.n + (1.0 / (v.u - 2.0))})

def wrong():
    raise ArithmeticError("100% wrong")
'''


def from_text(source: str, file: str) -> BlockModel:
    made = block_from_source(source, file)
    return replace(made, recipe=Recipe(file, source=source))


def test_exceptions_of_a_users_functions_are_told_with_their_type() -> None:
    fmu = Loaded(cached_fmu(from_text(RAISING, "raising.py"), "python"))
    fmu.set("u", 3.0)
    assert fmu.status_of("getReal", [2]) == FATAL
    assert fmu.log[-1][2] == REFUSED.format("getReal", "raising.py:6: unit raising: outputs: KeyError: 3.0")
    fmu.set("u", 2.0)
    assert fmu.status_of("doStep", 0.0, 0.1) == DISCARD
    assert fmu.log[-1] == (3, "logStatusError", "unit raising: next value n is not finite at 0 s")
    assert fmu.get(["n", "y"]) == [0.0, 6.0]
    fmu.set("u", 0.5)
    assert fmu.status_of("doStep", 0.0, 0.1) == DISCARD
    assert fmu.log[-1] == (
        3,
        "logStatusError",
        "raising.py:10: unit raising: update: ArithmeticError: 100%% wrong",
    )
    assert fmu.get(["n"]) == [0.0]
    fmu.free()


def test_reset_is_the_start_again(make: Make) -> None:
    fmu = Loaded(cached_fmu(make("spring"), "python"))
    names = list(fmu.references)
    before = fmu.get(names)
    fmu.set("F", 4.0)
    fmu.do_step(0.0, 0.1)
    fmu.fmu.reset()
    fmu.initialize(0.0)
    assert fmu.get(names) == before
    fmu.set("d", 0.1)  # fixed, and free to be set again
    fmu.free()
