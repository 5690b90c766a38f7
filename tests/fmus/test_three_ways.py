"""A unit gives the same as columns of NumPy, stepped in Python, as a Python FMU and as a native one."""

from __future__ import annotations

from ctypes import c_double, c_void_p
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from hypothesis import given, settings

from fmu_run import FmuRun
from loaded_fmu import Loaded
from random_units import PATIENT, UnitCase, random_cases
from shipped_units import UNITS
from stepped_unit import SteppedUnit, needs_native
from urmpipe_fmus.block import INTERNAL_STEP, BlockModel, Variable
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.blocks.user import load_block_file
from urmpipe_fmus.build.description import Backend
from urmpipe_fmus.build.fmu import build_fmu, cached_fmu
from urmpipe_fmus.instance import Instance
from urmpipe_fmus.run import run
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import UnitError
from urmpipe_models.robots.catalogue import load_robot

SAME = 1e-12  # of the size of the values; sines of other libraries differ in the last place

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"

both_backends = pytest.mark.parametrize("backend", [pytest.param("native", marks=needs_native), "python"])


@cache
def unit_of(what: str) -> BlockModel:
    name, options = UNITS[what]
    return make_block(name, **options)


def near(rng: np.random.Generator, variable: Variable) -> Any:
    """Values about a variable's start, within its range and of its type."""
    starts = np.array(variable.starts)
    if variable.type == "Real":
        size = np.abs(starts)
        found = starts + np.where(size > 0.0, 0.1 * size, 0.1) * rng.uniform(-1, 1, size.shape)
    else:
        low, high = max(variable.minimum, -3), min(variable.maximum, 3)
        low, high = (0, 1) if variable.type == "Boolean" else (low, high)
        found = rng.integers(int(low), int(high), starts.shape, endpoint=True).astype(np.float64)
    found = np.clip(found, variable.minimum, variable.maximum)
    return found if variable.size else float(found[0])


def random_case(model: BlockModel, seed: int, count: int) -> UnitCase:
    """Parameters, and inputs over some samples: what the unit meets, and steps of more than a turn."""
    rng = np.random.default_rng(seed)
    start = {one.name: near(rng, one) for one in model.parameters if one.name != INTERNAL_STEP}
    columns = {}
    for one in model.inputs:
        flat = np.cumsum(rng.uniform(-1.0, 1.0, (count, one.width)), axis=0)
        if one.name == "raw":
            flat = np.mod(flat * 2.0 + np.pi, 2.0 * np.pi) - np.pi
        columns[one.name] = flat[:, 0] if one.size is None else flat
    return model, start, columns


def output_names(model: BlockModel) -> list[str]:
    return [one.name for one in model.variables if one.causality == "output"]


def given_by_run(case: UnitCase, t: FloatArray) -> FloatArray:
    model, start, columns = case
    found = run(model, t, columns, start)
    return np.column_stack([found[name] for name in output_names(model)])


def given_by_steps(case: UnitCase, t: FloatArray) -> FloatArray:
    model, start, columns = case
    unit, rows = SteppedUnit(model, start), []
    for k, time in enumerate(t.tolist()):
        unit.put(**{name: column[k] for name, column in columns.items()})
        rows.append(unit.read(*output_names(model)))
        if k + 1 < len(t):
            unit.do_step(time, float(t[k + 1]) - time)
    return np.array(rows)


@cache
def case_and_run(what: str) -> tuple[UnitCase, FloatArray, FloatArray]:
    """Return a case of a unit, times, and what a run gives; masses take Python ms an internal step."""
    model = unit_of(what)
    t = 0.005 * np.arange(3.0 if model.name in ("chain_dynamics", "driven_arm") else 41.0)
    case = random_case(model, 0, len(t))
    return case, t, given_by_run(case, t)


def assert_same(got: FloatArray, expected: FloatArray) -> None:
    size = np.maximum(1.0, np.abs(expected).max(axis=0))
    worst = np.abs(got - expected) / size
    assert (worst <= SAME).all(), f"{worst.max()} at {np.unravel_index(worst.argmax(), worst.shape)}"


def assert_fmu_gives(case: UnitCase, path: Path, t: FloatArray) -> None:
    model, start, columns = case
    with FmuRun(path, model, start) as fmu:
        assert_same(fmu.over(t, columns), given_by_run(case, t))


@pytest.mark.slow
@pytest.mark.parametrize("what", UNITS)
def test_a_run_gives_what_steps_give(what: str) -> None:
    case, t, expected = case_and_run(what)
    assert_same(given_by_steps(case, t), expected)


@pytest.mark.slow
@both_backends
@pytest.mark.parametrize("what", UNITS)
def test_an_fmu_gives_what_a_run_gives_and_goes_on_from_a_saved_state(what: str, backend: Backend) -> None:
    (model, start, columns), t, expected = case_and_run(what)
    half = len(t) // 2
    before, after = (  # the sample in the middle is set and read twice
        (t[part], {name: rows[part] for name, rows in columns.items()})
        for part in (slice(half + 1), slice(half, None))
    )
    with FmuRun(cached_fmu(model, backend), model, start) as fmu:
        early = fmu.over(*before)
        state = fmu.fmu.getFMUstate()
        kept = fmu.fmu.serializeFMUstate(state)
        late = fmu.over(*after)
        fmu.fmu.setFMUstate(state)
        again = fmu.over(*after)
        fmu.over(before[0] + t[-1], before[1])  # somewhere else
        fmu.fmu.setFMUstate(fmu.fmu.deSerializeFMUstate(kept))
        last = fmu.over(*after)
    assert_same(np.concatenate((early, late[1:])), expected)
    np.testing.assert_array_equal(late[0], early[-1])
    np.testing.assert_array_equal(again, late)
    np.testing.assert_array_equal(last, late)
    assert (np.ptp(late, axis=0) > 0.0).any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("backend", "status"), [("instance", None), pytest.param("native", 3, marks=needs_native), ("python", 2)]
)
def test_a_step_begins_where_the_unit_stands(backend: Any, status: int | None) -> None:
    """To 1e-6 of it; else fmi2Error, and of pythonfmu's binary fmi2Discard, which is all that it has."""
    for start, step in ((0.0, 0.25), (100.0, 1e-3)):
        model = unit_of("a load")
        one: Any = Loaded(cached_fmu(model, backend), start) if status else Instance(model, start)
        one.do_step(start + 0.9e-6 * step, step)
        one.do_step(start + step, step)
        own = start + 2.0 * step
        for time in (start, start + step, own + 1.1e-6 * step, own - 1.1e-6 * step):
            with pytest.raises((UnitError, FMICallException)) as error:
                one.do_step(time, step)
            assert getattr(error.value, "status", None) == status
            assert (one.log[-1][2] if status else str(error.value)) == (
                f"unit inertia: found a step from {time:.15g} s, allowed: from where it stands, {own:.15g} s"
            )
        one.do_step(own, step)


@pytest.mark.slow
@needs_native
@pytest.mark.parametrize(("start", "step"), [(0.0, 1e-3), (1.7e9, 1e-3), (0.1, 1.0 / 3.0)])
def test_sums_and_multiples_of_steps_stay_where_the_unit_stands(start: float, step: float) -> None:
    fmu = Loaded(cached_fmu(unit_of("six joints"), "native"), start)
    time, count = start, 100_000  # a million in C: native/test_runtime.py
    state, call = fmu.fmu.getFMUstate(), partial(fmu.fmu.dll.fmi2DoStep, c_void_p(fmu.fmu.component))
    for _ in range(count):
        assert call(c_double(time), c_double(step), 1) == 0
        time += step
    fmu.fmu.setFMUstate(state)
    for k in range(count):
        assert call(c_double(start + k * step), c_double(step), 1) == 0


@pytest.mark.slow
@needs_native
@pytest.mark.parametrize("robot", ["urm6", "ur5e"])
def test_at_the_calibration_pose_half_turns_of_either_sign_are_equal(robot: str) -> None:
    model = make_block("kinematic_chain", robot=load_robot(robot), rates=True)
    expected = np.concatenate([np.ravel(one) for one in run(model, np.zeros(1)).values()])
    with FmuRun(cached_fmu(model, "native"), model, {}) as fmu:
        got = np.array(fmu.get(model.computed))
    angle = np.array([name[0] == "r" for one in model.computed for name in one.names])
    assert_same(got[~angle], expected[~angle])
    turned = np.exp(1j * got[angle]) - np.exp(1j * expected[angle])
    assert (np.abs(turned) <= SAME).all()


@pytest.mark.slow
@both_backends
@pytest.mark.parametrize("example", ["backlash.py", "low_pass.py"])
def test_a_documented_unit_gives_as_an_fmu_what_a_run_gives(example: str, backend: Backend) -> None:
    model, t = load_block_file(EXAMPLES / example), np.linspace(0.0, 0.2, 41, dtype=np.float64)
    assert_fmu_gives(random_case(model, 5, len(t)), cached_fmu(model, backend), t)


T = np.array([0.0, 0.01, 0.02, 0.05, 0.2])


@pytest.mark.slow
@settings(max_examples=25, **PATIENT)  # most of the time goes into drawing a unit; those of core/ draw more
@given(random_cases(5))
def test_a_random_unit_gives_stepped_what_a_run_gives(case: UnitCase) -> None:
    assert_same(given_by_steps(case, T), given_by_run(case, T))


@pytest.mark.slow
@both_backends
@settings(max_examples=4, **PATIENT)  # of functions one by one: native/test_functions.py
@given(case=random_cases(5))
def test_a_random_unit_exported_is_valid_and_gives_what_a_run_gives(
    case: UnitCase, backend: Backend, tmp_path_factory: pytest.TempPathFactory
) -> None:
    from fmpy.validation import validate_fmu

    path = build_fmu(case[0], tmp_path_factory.mktemp("fmu"), backend=backend).path
    assert validate_fmu(str(path)) == []
    assert_fmu_gives(case, path, T)
