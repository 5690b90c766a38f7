"""What the Linux binaries ask of the machine they come to, and what they show of themselves."""

from __future__ import annotations

import re
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from peers import need_builds_for, python
from shipped_units import CROSS_BUILT
from urmpipe_fmus.blocks import block_names
from urmpipe_fmus.blocks.user import load_block_file
from urmpipe_fmus.build.description import Backend
from urmpipe_fmus.build.fmu import build_fmu
from urmpipe_fmus.native import this_platform


def readelf(option: str, path: Path) -> str:
    """Return what readelf says of a binary."""
    if not shutil.which("readelf"):
        pytest.skip("needs readelf (Debian: binutils)")
    return subprocess.run(
        ["readelf", "--wide", option, str(path)], capture_output=True, text=True, check=True
    ).stdout


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
def test_a_binary_needs_only_the_c_library_and_shows_only_the_functions_of_fmi(
    name: str, fmu_of: Callable[..., Path], tmp_path: Path
) -> None:
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
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

def opened(path):
    folder = extract(path)
    model = read_model_description(folder)
    file = Path(folder) / "binaries" / "linux64" / (model.coSimulation.modelIdentifier + ".so")
    ctypes.CDLL(str(file), mode=ctypes.RTLD_GLOBAL)
    made = FMU2Slave(guid=model.guid, unzipDirectory=folder, instanceName=model.modelName,
                     modelIdentifier=model.coSimulation.modelIdentifier)
    made.instantiate(); made.setupExperiment(); made.enterInitializationMode(); made.exitInitializationMode()
    return made

one, two = (opened(path) for path in sys.argv[1:])
for fmu, u in ((one, 3.0), (two, 5.0)):
    fmu.setReal([0], [u])
for k in range(2):
    for fmu in (one, two):
        fmu.doStep(currentCommunicationPoint=k * 0.5, communicationStepSize=0.5)
print([[round(value, 9) for value in fmu.getReal([1, 2])] for fmu in (one, two)])
"""

USER_UNIT = """
from urmpipe_fmus.block import BlockModel, Input, Output, State

unit = BlockModel(
    name="same",
    description="A factor, and its integral",
    variables=(
        Input(name="u", description="input"),
        Output(name="y", description="u times a factor"),
        State(name="x", description="integral of y", output=True),
    ),
    outputs=lambda v: {{"y": {factor} * v.u}},
    derivatives=lambda v: {{"x": {factor} * v.u}},
)
"""


@pytest.mark.parametrize("backend", ["native", pytest.param("python", marks=pytest.mark.slow)])
def test_two_fmus_with_equal_inner_names_compute_their_own_in_one_process(
    backend: Backend, tmp_path: Path
) -> None:
    if backend == "native":
        need_builds_for(this_platform())
    paths = []
    for folder, factor in (("one", 2.0), ("two", -7.0)):
        (tmp_path / folder).mkdir()
        source = tmp_path / folder / "same.py"
        source.write_text(USER_UNIT.format(factor=factor), encoding="utf-8")
        built = build_fmu(load_block_file(source), source.with_suffix(".fmu"), backend=backend)
        paths.append(str(built.path))
    output = python("-c", SIDE_BY_SIDE, *paths).stdout
    assert output.strip() == "[[6.0, 6.0], [-35.0, -35.0]]", output
