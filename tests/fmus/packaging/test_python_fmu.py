"""Python FMUs: what they compute, how they refuse, how they stay apart, under FMPy."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from loaded_fmu import Loaded
from urmpipe_fmus.build import build_fmu
from urmpipe_fmus.instance import Instance
from urmpipe_fmus.unit import Recipe, Unit
from urmpipe_fmus.units import make_unit
from urmpipe_fmus.user_unit import load_unit_file, unit_of_source
from urmpipe_fmus.variable import Input, Parameter
from urmpipe_models.errors import FmuError, UnitError
from urmpipe_models.robots.catalogue import load_robot

Make = Callable[..., Unit]
HELPERS = str(Path(__file__).parents[1])
DISCARD, FATAL = 2, 4
REFUSED = "Fatal py exception encountered: [{}] PyObject_CallMethod\n{}"
"""How pythonfmu's binary logs the message of a refused call."""


def built(unit: Unit, folder: Path) -> Path:
    return build_fmu(unit, folder, backend="python").path


def random_value(one: Input | Parameter, random: np.random.Generator) -> float:
    """A value that the variable takes, near its start or in its range."""
    if one.type == "Boolean":
        return float(random.integers(2))
    low, high = max(one.minimum, 0.05), min(one.maximum, 8.0)
    value = float(random.uniform(low, high))
    return float(round(value)) if one.type == "Integer" else value


def test_fmpy_finds_nothing_wrong(unit: Unit, tmp_path: Path) -> None:
    assert validate_fmu(str(built(unit, tmp_path))) == []


def test_the_same_unit_is_the_same_bytes(unit: Unit, tmp_path: Path) -> None:
    first = built(unit, tmp_path).read_bytes()
    assert built(unit, tmp_path).read_bytes() == first


def test_it_computes_what_an_instance_does_bit_by_bit(unit: Unit, tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    fmu, instance = Loaded(built(unit, tmp_path), start=0.02), Instance(unit)
    instance.begin(0.02)
    names = [name for name, _ in unit.scalars]
    everything = range(len(names))
    for k in range(40):
        for reference, (name, one) in enumerate(unit.scalars):
            if isinstance(one, Input) or (isinstance(one, Parameter) and one.tunable and k % 10 == 0):
                value = random_value(one, random)
                fmu.set(name, int(value) if one.type != "Real" else value)
                instance.set([reference], [value])
        assert fmu.get(names) == [float(one) for one in instance.get(everything)]
        fmu.do_step(0.02 + k * 0.0073, 0.0073)
        instance.do_step(0.02 + k * 0.0073, 0.0073)
    assert fmu.get(names) == [float(one) for one in instance.get(everything)]
    fmu.free()


def test_outputs_are_fresh_after_set_without_a_step(make: Make, tmp_path: Path) -> None:
    fmu = Loaded(built(make("arm"), tmp_path))
    for angle in (0.0, 1.0, -2.5):
        fmu.set("phi[1]", angle)
        assert fmu.get(["first"]) == [0.5 * np.cos(angle)]
    fmu.free()


@pytest.mark.parametrize("serialized", [False, True])
def test_a_state_that_is_restored_goes_on_bit_by_bit(unit: Unit, tmp_path: Path, serialized: bool) -> None:
    names = [name for name, _ in unit.scalars]
    path = built(unit, tmp_path)
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


def test_no_step_goes_past_the_stop_time(make: Make, tmp_path: Path) -> None:
    fmu = Loaded(built(make("counter"), tmp_path))
    fmu.fmu.reset()
    fmu.fmu.setupExperiment(startTime=0.0, stopTime=0.5)
    fmu.fmu.enterInitializationMode()
    fmu.fmu.exitInitializationMode()
    fmu.do_step(0.0, 0.5)
    assert fmu.status_of("doStep", 0.5, 0.5) == DISCARD
    assert fmu.log[-1][2] == "unit counter: found a step to 1 s, allowed: to the stop time, 0.5 s"
    fmu.free()


@pytest.mark.parametrize("serialized", [False, True])
def test_a_restored_state_knows_that_it_runs(make: Make, tmp_path: Path, serialized: bool) -> None:
    fmu = Loaded(built(make("spring"), tmp_path))
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


def test_bytes_that_are_no_state_are_refused(make: Make, tmp_path: Path) -> None:
    fmu = Loaded(built(make("spring"), tmp_path))
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
    ("setReal", [0], [-1.0], "m: found -1, allowed: 9.9999999999999995e-07 to inf"),
    ("setReal", [3], [2e3], "F: found 2000, allowed: -1000 to 1000"),
    ("setReal", [6], [0.0], "a: set, allowed: an output is computed, not set"),
    ("setReal", [9], [0.0], "value reference 9: found, allowed: 0 to 8"),
    ("setReal", [2**32 - 1], [0.0], "value reference 4294967295: found, allowed: 0 to 8"),
    ("setInteger", [0], [1], "m: found fmi2SetInteger, allowed: fmi2SetReal"),
    ("setBoolean", [4], [True], "x: found fmi2SetBoolean, allowed: fmi2SetReal"),
    ("getReal", [77], None, "value reference 77: found, allowed: 0 to 8"),
    ("getInteger", [4], None, "x: found fmi2GetInteger, allowed: fmi2GetReal"),
]


@pytest.mark.parametrize(("function", "references", "values", "said"), REFUSALS)
def test_what_is_refused_is_told_and_changes_nothing(
    make: Make, tmp_path: Path, function: str, references: list[int], values: Any, said: str
) -> None:
    fmu = Loaded(built(make("spring"), tmp_path))
    names = list(fmu.references)
    before = fmu.get(names)
    arguments = (references,) if values is None else (references, values)
    assert fmu.status_of(function, *arguments) == FATAL
    assert fmu.log == [(FATAL, "", REFUSED.format(function, f"unit spring: {said}"))]
    assert fmu.get(names) == before
    fmu.do_step(0.0, 0.01)
    fmu.free()


def test_refused_values_leave_all_of_a_call_unset(make: Make, tmp_path: Path) -> None:
    fmu = Loaded(built(make("spring"), tmp_path))
    assert fmu.status_of("setReal", [1, 0], [60.0, -1.0]) == FATAL
    assert fmu.get(["c", "m"]) == [50.0, 2.0]
    fmu.free()


def test_an_instance_lives_on_after_many_refused_calls(make: Make, tmp_path: Path) -> None:
    fmu, instance = Loaded(built(make("spring"), tmp_path)), Instance(make("spring"))
    for _ in range(2000):
        assert fmu.status_of("setReal", [0], [float("nan")]) == FATAL
        assert fmu.status_of("getReal", [77]) == FATAL
        assert fmu.status_of("doStep", 0.0, -1.0) == DISCARD
    fmu.do_step(0.0, 0.01)
    instance.do_step(0.0, 0.01)
    assert fmu.get(["x", "v"]) == instance.get([4, 5])
    fmu.free()


def test_a_step_that_fails_is_undone_and_told(make: Make, tmp_path: Path) -> None:
    fmu = Loaded(built(make("spring"), tmp_path))
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
from urmpipe_fmus.unit import Unit
from urmpipe_fmus.variable import Input, Memory, Output
unit = Unit(name="raising", description="", variables=(
    Input(name="u", description="", start=1.0), Memory(name="n", description=""),
    Output(name="y", description="")),
    outputs=lambda v: {"y": {1.0: 5.0, 2.0: 6.0}[float(v.u)] if isinstance(v.u, float) else v.u},
    update=lambda v: {"n": wrong() if isinstance(v.u, float) and v.u == 0.5 else v.n + (1.0 / (v.u - 2.0))})

def wrong():
    raise ArithmeticError("100% wrong")
'''


def from_text(source: str, file: str) -> Unit:
    made = unit_of_source(source, file)
    return replace(made, recipe=Recipe(file, source=source))


def test_exceptions_of_a_users_functions_are_told_with_their_type(tmp_path: Path) -> None:
    fmu = Loaded(built(from_text(RAISING, "raising.py"), tmp_path))
    fmu.set("u", 3.0)
    assert fmu.status_of("getReal", [2]) == FATAL
    assert fmu.log[-1][2] == REFUSED.format("getReal", "raising.py:7: unit raising: outputs: KeyError: 3.0")
    fmu.set("u", 2.0)
    assert fmu.status_of("doStep", 0.0, 0.1) == DISCARD
    assert fmu.log[-1] == (3, "logStatusError", "unit raising: next value n is not finite at 0 s")
    assert fmu.get(["n", "y"]) == [0.0, 6.0]
    fmu.set("u", 0.5)
    assert fmu.status_of("doStep", 0.0, 0.1) == DISCARD
    assert fmu.log[-1] == (
        3,
        "logStatusError",
        "raising.py:11: unit raising: update: ArithmeticError: 100%% wrong",
    )
    assert fmu.get(["n"]) == [0.0]
    fmu.free()


def test_reset_is_the_start_again(make: Make, tmp_path: Path) -> None:
    fmu = Loaded(built(make("spring"), tmp_path))
    names = list(fmu.references)
    before = fmu.get(names)
    fmu.set("F", 4.0)
    fmu.do_step(0.0, 0.1)
    fmu.fmu.reset()
    fmu.initialize(0.0)
    assert fmu.get(names) == before
    fmu.set("d", 0.1)  # fixed, and free to be set again
    fmu.free()


HELPED = '''"""A gain, with a helper of its own."""
from urmpipe_fmus.unit import Unit
from urmpipe_fmus.variable import Input, Output

class Helper:
    gain = {gain}

def helped(v):
    return {{"y": Helper.gain * v.u}}

unit = Unit(name="helped", description="", outputs=helped,
    variables=(Input(name="u", description=""), Output(name="y", description="")))
'''


def test_two_fmus_of_files_and_helpers_of_one_name_compute_their_own(tmp_path: Path) -> None:
    """In one process, beside the urmpipe that this test runs on."""
    fmus = {}
    for gain in (2.0, 3.0):
        (tmp_path / str(gain)).mkdir()
        fmus[gain] = Loaded(built(from_text(HELPED.format(gain=gain), "helped.py"), tmp_path / str(gain)))
    for gain, fmu in fmus.items():
        fmu.set("u", 1.5)
        assert fmu.get(["y"]) == [gain * 1.5]
    other = Loaded(tmp_path / "2.0" / "helped.fmu")  # once more, from another folder
    other.set("u", 1.0)
    assert other.get(["y"]) == [2.0]
    for one in (*fmus.values(), other):
        one.free()


ALONE = """
import os, sys
blocked = {"urmpipe", "urmpipe_models", "urmpipe_fmus", "urmpipe_datasets", "urmpipe_pipeline", "pythonfmu"}
blocked |= {"scipy", "pandas", "casadi", "jinja2"}
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in blocked:
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Blocked())
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from loaded_fmu import Loaded
path = list(sys.path)
fmu = Loaded(Path(sys.argv[2]))
fmu.do_step(0.0, 0.01)
print(fmu.get(list(fmu.references)))
fmu.free()
assert sys.path == path, sys.path
sys.stdout.flush()
os._exit(0)  # pythonfmu 0.7 touches freed memory when its library is unloaded at the end of a process
"""


def assert_runs_alone(unit: Unit, tmp_path: Path) -> None:
    path, instance = built(unit, tmp_path), Instance(unit)
    instance.do_step(0.0, 0.01)
    said = subprocess.run(
        [sys.executable, "-c", ALONE, HELPERS, str(path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert said.returncode == 0, said.stderr
    values = [float(one) for one in instance.get(range(len(unit.scalars)))]
    assert [float(one) for one in eval(said.stdout)] == values


def test_it_runs_where_there_is_no_urmpipe(unit: Unit, tmp_path: Path) -> None:
    assert_runs_alone(unit, tmp_path)


def test_a_robots_chain_runs_where_there_is_no_urmpipe(tmp_path: Path) -> None:
    assert_runs_alone(make_unit("kinematic_chain", robot=load_robot("urm6"), rates=True), tmp_path)


CYCLES = """
import gc, os, sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from loaded_fmu import Loaded
fmu = Loaded(Path(sys.argv[2]))
def cycle():
    fmu.begin(0.0)
    fmu.do_step(0.0, 0.01)
    fmu.get(list(fmu.references))
    fmu.free()
def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
fmu.free()
for _ in range(200): cycle()
before = resident()
for _ in range(1000): cycle()
print(resident() - before)
gc.collect()
print(sum(type(one).__name__ in ("Slave", "Instance") for one in gc.get_objects()))
sys.stdout.flush()
os._exit(0)  # as above
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux's /proc")
def test_a_thousand_instances_leave_no_memory_behind_but_what_pythonfmu_loses(
    make: Make, tmp_path: Path
) -> None:
    """pythonfmu 0.7 loses the strings and lists by which it finds the class: about 0.8 KB an instance."""
    path = built(make("spring"), tmp_path)
    said = subprocess.run(
        [sys.executable, "-c", CYCLES, HELPERS, str(path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert said.returncode == 0, said.stderr
    grown, alive = map(int, said.stdout.split())
    assert alive == 0
    assert grown < 2_500_000  # twice what pythonfmu loses, and room for a heap that grows in steps of 0.5 MB


def test_a_unit_without_a_recipe_is_refused(make: Make, tmp_path: Path) -> None:
    with pytest.raises(UnitError) as caught:
        built(replace(make("spring"), recipe=Recipe()), tmp_path)
    assert str(caught.value) == (
        "unit spring: found no recipe to make it again, allowed for a Python FMU: a unit of urmpipe's or of a"
        " file of its own; a native FMU needs none"
    )


def test_a_recipe_that_makes_another_unit_is_refused(make: Make, tmp_path: Path) -> None:
    spring = make("spring")
    with pytest.raises(UnitError, match=r"^unit spring: found other variables when made again"):
        built(replace(spring, variables=spring.variables[::-1]), tmp_path)
    with pytest.raises(UnitError, match=r"^unit renamed: found no unit of that name in spring\.py"):
        built(replace(spring, name="renamed"), tmp_path)


def test_a_file_that_imports_what_an_fmu_does_not_bring_is_refused(make: Make, tmp_path: Path) -> None:
    unit = make("spring")
    source = f"import scipy.signal\nfrom helper import x\n{unit.recipe.source}"
    with pytest.raises(UnitError) as caught:
        built(replace(unit, recipe=replace(unit.recipe, source=source)), tmp_path)
    assert str(caught.value) == (
        "unit spring: found imports of helper, helper.x, scipy.signal in spring.py, allowed in a Python FMU:"
        " the standard library, numpy, urmpipe_datasets, urmpipe_fmus, urmpipe_models"
    )


def test_a_file_that_reads_another_beside_it_is_refused(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unit = make("spring")
    text = f"from pathlib import Path\nPath(__file__).with_name('gain.txt').read_text()\n{unit.recipe.source}"
    (tmp_path / "gain.txt").write_text("2.0", encoding="ascii")
    (tmp_path / "spring.py").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UnitError) as caught:
        built(load_unit_file("spring.py"), tmp_path)
    assert str(caught.value) == (
        "unit spring: found FileNotFoundError: [Errno 2] No such file or directory: '<FMU>/gain.txt' when"
        " made again from its recipe, allowed in a Python FMU: a recipe that needs nothing else; a native FMU"
        " holds what was read"
    )


def test_platforms_that_pythonfmu_has_no_binary_for_are_refused(make: Make, tmp_path: Path) -> None:
    with pytest.raises(FmuError) as caught:
        build_fmu(make("spring"), tmp_path, backend="python", platforms=["linux64", "darwin64"])
    assert str(caught.value) == (
        "unit spring: found platform darwin64, allowed in a Python FMU: linux64, win64"
    )
