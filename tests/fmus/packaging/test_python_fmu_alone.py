"""Python FMUs stand alone: apart from each other and from urmpipe, and refused where they could not."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from asserting import refusal
from loaded_fmu import Loaded
from urmpipe_fmus.block import BlockModel, Recipe
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.blocks.user import block_from_source, load_block_file
from urmpipe_fmus.build.fmu import build_fmu
from urmpipe_fmus.instance import Instance
from urmpipe_models.errors import FmuError, UnitError
from urmpipe_models.robots.catalogue import load_robot

Make = Callable[..., BlockModel]
HELPERS = str(Path(__file__).parents[1])


def built(model: BlockModel, folder: Path) -> Path:
    """Return the Python FMU of a unit."""
    return build_fmu(model, folder, backend="python").path


def from_text(source: str, file: str) -> BlockModel:
    made = block_from_source(source, file)
    return replace(made, recipe=Recipe(file, source=source))


HELPED = '''"""A gain, with a helper of its own."""
from urmpipe_fmus.block import BlockModel, Input, Output

class Helper:
    gain = {gain}

def helped(v):
    return {{"y": Helper.gain * v.u}}

unit = BlockModel(name="helped", description="", outputs=helped,
    variables=(Input(name="u", description=""), Output(name="y", description="")))
'''


@pytest.mark.slow
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


def assert_runs_alone(model: BlockModel, tmp_path: Path) -> None:
    path, instance = built(model, tmp_path), Instance(model)
    instance.do_step(0.0, 0.01)
    said = subprocess.run(
        [sys.executable, "-c", ALONE, HELPERS, str(path)], capture_output=True, text=True, check=False
    )
    assert said.returncode == 0, said.stderr
    values = [float(one) for one in instance.get(range(len(model.scalars)))]
    assert [float(one) for one in eval(said.stdout)] == values


@pytest.mark.slow
def test_it_runs_where_there_is_no_urmpipe(model: BlockModel, tmp_path: Path) -> None:
    assert_runs_alone(model, tmp_path)


@pytest.mark.slow
def test_a_robots_chain_runs_where_there_is_no_urmpipe(tmp_path: Path) -> None:
    assert_runs_alone(make_block("kinematic_chain", robot=load_robot("urm6"), rates=True), tmp_path)


CYCLES = """
import gc, os, sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from loaded_fmu import Loaded
fmu = Loaded(Path(sys.argv[2]))
def cycle():
    fmu.begin(0.0)
    fmu.do_step(0.0, 0.001)
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


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux's /proc")
def test_a_thousand_instances_leave_no_memory_behind_but_what_pythonfmu_loses(
    make: Make, tmp_path: Path
) -> None:
    """pythonfmu 0.7 loses the strings and lists by which it finds the class: about 0.8 KB an instance."""
    path = built(make("spring"), tmp_path)
    said = subprocess.run(
        [sys.executable, "-c", CYCLES, HELPERS, str(path)], capture_output=True, text=True, check=False
    )
    assert said.returncode == 0, said.stderr
    grown, alive = map(int, said.stdout.split())
    assert alive == 0
    assert grown < 2_500_000  # twice what pythonfmu loses, and room for a heap that grows in steps of 0.5 MB


def test_a_unit_without_a_recipe_is_refused(make: Make, tmp_path: Path) -> None:
    assert refusal(UnitError, built, replace(make("spring"), recipe=Recipe()), tmp_path) == (
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
    model = make("spring")
    source = f"import scipy.signal\nfrom helper import x\n{model.recipe.source}"
    assert refusal(
        UnitError, built, replace(model, recipe=replace(model.recipe, source=source)), tmp_path
    ) == (
        "unit spring: found imports of helper, helper.x, scipy.signal in spring.py, allowed in a Python FMU:"
        " the standard library, numpy, urmpipe_datasets, urmpipe_fmus, urmpipe_models"
    )


def test_a_file_that_reads_another_beside_it_is_refused(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = make("spring")
    text = (
        f"from pathlib import Path\nPath(__file__).with_name('gain.txt').read_text()\n{model.recipe.source}"
    )
    (tmp_path / "gain.txt").write_text("2.0", encoding="ascii")
    (tmp_path / "spring.py").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert refusal(UnitError, built, load_block_file("spring.py"), tmp_path) == (
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
