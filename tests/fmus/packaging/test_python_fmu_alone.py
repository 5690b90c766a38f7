"""Python FMUs stand alone: they run without urmpipe, and leave no memory behind."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.build.fmu import build_fmu
from urmpipe_fmus.instance import Instance
from urmpipe_models.robots.catalogue import load_robot
from written_units import NAMES, fmu_of, unit_of

HELPERS = str(Path(__file__).parents[1])


def printed(code: str, fmu: Path) -> str:
    """What a process prints that runs an FMU."""
    command = [sys.executable, "-c", code, HELPERS, str(fmu)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


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


@pytest.mark.slow
@pytest.mark.parametrize("name", [*NAMES, "kinematic_chain"])
def test_it_runs_where_there_is_no_urmpipe(name: str, tmp_path: Path) -> None:
    model = unit_of(name) if name in NAMES else make_block(name, robot=load_robot("urm6"), rates=True)
    path, instance = build_fmu(model, tmp_path, backend="python").path, Instance(model)
    instance.do_step(0.0, 0.01)
    values = [float(one) for one in instance.get(range(len(model.scalars)))]
    assert [float(one) for one in eval(printed(ALONE, path))] == values


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
def test_a_thousand_instances_leave_no_memory_behind_but_what_pythonfmu_loses() -> None:
    """pythonfmu 0.7 loses the strings and lists by which it finds the class: about 0.8 KB an instance."""
    grown, alive = map(int, printed(CYCLES, fmu_of("spring", "python")).split())
    assert alive == 0
    assert grown < 2_500_000  # twice what pythonfmu loses, and room for a heap that grows in steps of 0.5 MB
