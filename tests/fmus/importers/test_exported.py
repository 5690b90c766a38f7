"""Exported FMUs as others check them, unpack them in any folder, compile, load, and instantiate them."""

from __future__ import annotations

import re
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from loaded_fmu import Loaded
from masters import run_fmpy
from peers import fmu_of, fmutool, python
from systems import CROSS_BUILT, STEP, alone, columns, drawn_inputs, sample_times, shipped_unit
from urmpipe_fmus.blocks import block_names
from urmpipe_fmus.blocks.user import load_block_file
from urmpipe_fmus.build.description import Backend
from urmpipe_fmus.run import run

# Both backends describe a unit by the same template, and package Python alike for every unit.
CHECKED: list[tuple[str, Backend]] = [
    *((name, "native") for name in block_names()),
    *((name, "python") for name in ("repolarizer", "log_source")),
]


@pytest.mark.slow
@pytest.mark.parametrize("name", block_names())
def test_fmpy_validate_finds_nothing(name: str) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(fmu_of(name))) == []  # of Python FMUs: packaging/test_build.py


@pytest.mark.slow
@pytest.mark.parametrize(("name", "backend"), CHECKED)
def test_the_fmu_manipulation_toolbox_finds_nothing(name: str, backend: Backend) -> None:
    output = fmutool("-input", str(fmu_of(name, backend)), "-check").stdout
    assert "This FMU seems to be compliant with FMI-2.0." in output
    assert "No semantic error against the FMI-2 standard." in output
    assert not [line for line in output.splitlines() if line.startswith(("ERROR", "WARNING", "CRITICAL"))]


FOLDERS = ("plain", "with a space", "Größe ü 角度", "100% sure", "a%20b", "a#b?c=d&e", "quote'and+plus")
# pythonfmu's binary undoes the %20 of an address and no other sign: elsewhere it ends the process.
UNPACKED = [(folder, "native") for folder in FOLDERS] + [(folder, "python") for folder in FOLDERS[:2]]


@pytest.mark.slow
@pytest.mark.parametrize(("folder", "backend"), UNPACKED)
def test_a_log_is_found_in_any_folder(folder: str, backend: Backend, tmp_path: Path) -> None:
    place = tmp_path / folder
    place.mkdir()
    fmu = Loaded(fmu_of("log_source", backend), folder=place)
    shown = [variable.name for variable in fmu.described.modelVariables if variable.causality == "output"]
    found = []
    for k in range(10):
        found.append(fmu.get(shown))
        fmu.do_step(k * STEP, STEP)
    fmu.free()
    expected = run(shipped_unit("log_source"), sample_times(10))  # rows of the table: no arithmetic
    np.testing.assert_array_equal(found, np.column_stack(list(expected.values())))


@pytest.mark.slow
# They have memories, states and a table; of the sources only the model's differ.
@pytest.mark.parametrize(
    ("compiler", "name"), [("fmutool", "repolarizer"), ("fmutool", "dc_drive"), ("fmpy", "log_source")]
)
def test_an_fmu_compiled_again_gives_the_same_numbers(compiler: str, name: str, tmp_path: Path) -> None:
    original, unit = fmu_of(name), shipped_unit(name)
    again = tmp_path / f"{name}.fmu"
    with zipfile.ZipFile(original) as complete, zipfile.ZipFile(again, "w") as without_binaries:
        for entry in complete.infolist():
            if not entry.filename.startswith("binaries/"):
                without_binaries.writestr(entry, complete.read(entry))
    if compiler == "fmutool":  # it takes `cc`, the files that the description lists, and its own headers
        source, again = again, tmp_path / "again.fmu"
        compiling = fmutool("-input", str(source), "-output", str(again), "-compile-sources")
    else:  # it takes CMake, and its own headers
        if not (shutil.which("cmake") and shutil.which("make")):
            pytest.skip("needs cmake and make")
        compiling = python("-m", "fmpy", "compile", str(again))
    assert compiling.returncode == 0, compiling.stdout
    assert [entry for entry in zipfile.ZipFile(again).namelist() if entry.startswith("binaries/")]
    inputs = columns(unit, drawn_inputs(unit, 21))
    traces = [run_fmpy(alone(fmu, unit, inputs), STEP, 20)["it"] for fmu in (original, again)]
    for shown, values in traces[0].items():
        # Other optimisation, and a compiler that may contract a * b + c: the last digits may differ.
        np.testing.assert_allclose(traces[1][shown], values, 1e-12, 1e-12, err_msg=shown)


CYCLES = """
import gc, os, sys
from pathlib import Path
from loaded_fmu import Loaded

# One library for all cycles: FMPy itself keeps 300 bytes of each that it has opened, of whatever FMU.
loaded = Loaded(Path(sys.argv[1]), start=None)
fmu, variables = loaded.fmu, loaded.described.modelVariables
real = [one.valueReference for one in variables if (one.causality, one.type) == ("output", "Real")]

def resident():
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

def cycle():
    fmu.instantiate()
    loaded.initialize(0.0)
    for k in range(3):
        fmu.doStep(currentCommunicationPoint=k * 0.005, communicationStepSize=0.005)
        fmu.getReal(real)
    state = fmu.getFMUstate()
    again = fmu.deSerializeFMUstate(fmu.serializeFMUstate(state))
    fmu.setFMUstate(again)
    fmu.freeFMUstate(again)
    fmu.freeFMUstate(state)
    loaded.free()

for _ in range(2000): cycle()  # the heap of a large unit takes some hundred to find its form
before = resident()
for _ in range(5000): cycle()
print(resident() - before)
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["repolarizer", "log_source", "dc_drive"])  # memories, a table, states
def test_thousands_of_instances_leave_resident_memory_flat(name: str) -> None:
    output = python("-c", CYCLES, str(fmu_of(name))).stdout
    assert output.strip().lstrip("-").isdecimal(), output
    # 13 bytes a cycle: any instance or saved state is larger. What the heap had free before can hide a block
    # as small as a name: the native backend's test of its callbacks counts each.
    assert int(output) < 64 * 1024, f"{int(output)} bytes more after 5000 instances"


def readelf(option: str, path: Path) -> str:
    """Return what readelf says of a binary."""
    if not shutil.which("readelf"):
        pytest.skip("needs readelf (Debian: binutils)")
    command = ["readelf", "--wide", option, str(path)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def checked_binary(fmu: Path, folder: Path) -> Path:
    """Return the Linux binary of an FMU, which needs only the C library and shows only functions of FMI."""
    with zipfile.ZipFile(fmu) as file:
        path = Path(file.extract(f"binaries/linux64/{fmu.stem}.so", folder))
    needed = set(re.findall(r"\(NEEDED\).*\[(.*)\]", readelf("--dynamic", path)))
    assert needed <= {"libc.so.6", "libm.so.6"}
    rows = [line.split() for line in readelf("--dyn-syms", path).splitlines()]
    shown = {row[7] for row in rows if len(row) == 8 and row[4] != "LOCAL" and row[6].isdigit()}
    assert {symbol for symbol in shown if not symbol.startswith("fmi2")} == set()
    assert {"fmi2Instantiate", "fmi2DoStep", "fmi2GetReal", "fmi2SerializeFMUstate"} <= shown
    return path


@pytest.mark.slow
@pytest.mark.parametrize("name", block_names())
def test_a_binary_needs_only_the_c_library_and_shows_only_fmi(name: str, tmp_path: Path) -> None:
    checked_binary(fmu_of(name), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", CROSS_BUILT)
def test_a_cross_built_binary_loads_where_the_c_library_is_of_2012(
    name: str, cross_built: Callable[[str], Path], tmp_path: Path
) -> None:
    path = checked_binary(cross_built(name), tmp_path)
    versions = re.findall(r"GLIBC_([0-9.]+)", readelf("--version-info", path))
    assert max(tuple(map(int, version.split("."))) for version in versions) <= (2, 17)


SIDE_BY_SIDE = """
import ctypes, os, sys
import numpy as np
from pathlib import Path
sys.setdlopenflags(os.RTLD_NOW | os.RTLD_GLOBAL)  # the worst that a master can do: all symbols in one pot
from loaded_fmu import Loaded

def opened(path):
    fmu = Loaded(Path(path), start=None)
    (library,) = Path(fmu.fmu.unzipDirectory).glob("binaries/linux64/*.so")
    ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    fmu.begin(0.0)
    return fmu

one, two = (opened(path) for path in sys.argv[1:])
for fmu, u in ((one, 3.0), (two, 5.0)):
    fmu.set("u", u)
for k in range(2):
    for fmu in (one, two):
        fmu.do_step(k * 0.5, 0.5)
print([[round(value, 9) for value in fmu.get(["y", "x"])] for fmu in (one, two)])
"""

USER_UNIT = """
from urmpipe_fmus.block import BlockModel, Input, Output, State
variables = [Input(name="u", description=""), Output(name="y", description="")]
unit = BlockModel(name="same", description="A factor, and its integral",
    variables=(*variables, State(name="x", description="", output=True)),
    outputs=lambda v: {{"y": {factor} * v.u}}, derivatives=lambda v: {{"x": {factor} * v.u}})
"""


@pytest.mark.parametrize("backend", ["native", pytest.param("python", marks=pytest.mark.slow)])
def test_two_fmus_with_equal_inner_names_share_a_process(backend: Backend, tmp_path: Path) -> None:
    paths = []
    for folder, factor in (("one", 2.0), ("two", -7.0)):
        (tmp_path / folder).mkdir()
        source = tmp_path / folder / "same.py"
        source.write_text(USER_UNIT.format(factor=factor), encoding="utf-8")
        paths.append(str(fmu_of(load_block_file(source), backend)))
    output = python("-c", SIDE_BY_SIDE, *paths).stdout
    assert output.strip() == "[[6.0, 6.0], [-35.0, -35.0]]", output
