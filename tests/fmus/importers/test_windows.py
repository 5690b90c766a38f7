"""The Windows binaries in a Windows program that nobody here wrote: Ecos's own, under wine.

That program comes with the package of ecospy for all platforms. It prints its values with six decimals; that
the bits are those of Linux, the tests of the native backend show with a host of their own.
"""

from __future__ import annotations

import csv
import shutil
import subprocess
import zipfile
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from systems import CROSS_BUILT, PYTHON, STEP, columns, drawn_inputs, sample_times, shipped_unit
from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.run import run
from urmpipe_models.elementwise import FloatArray

STEPS = 41
DECIMALS = 6
SCENARIO = "http://github.com/Ecos-platform/libecos/resources/schema/ScenarioConfig"
TAR = "@xcopy /E /I /Y /Q unpacked %4\r\n"
"""Ecos unpacks by Windows' own tar, which wine has not: this one copies what Python has unpacked."""


def scenario(unit: BlockModel, inputs: Mapping[str, FloatArray]) -> str:
    """Return Ecos's description of inputs: each is set before the step whose time is its own within eps."""
    types = {name: variable.type for name, variable in unit.scalars}
    lines = [f'<ecos:Scenario xmlns:ecos="{SCENARIO}" eps="1e-6">']
    for name, values in inputs.items():
        for k in range(STEPS):
            value = str(PYTHON[types[name]](values[k])).lower()
            lines.append(
                f'<ecos:action t="{k * STEP:.17g}"><ecos:variable id="instance::{name}">'
                f'<ecos:{types[name].lower()} value="{value}"/></ecos:variable></ecos:action>'
            )
    return "\n".join([*lines, "</ecos:Scenario>\n"])


def simulated(
    fmu: Path, unit: BlockModel, inputs: Mapping[str, FloatArray], wine: Mapping[str, str]
) -> dict[str, FloatArray]:
    """Return what Ecos writes of an FMU, a column a scalar: from the start, then after each step."""
    found = find_spec("ecospy")
    if found is None or found.origin is None:
        pytest.skip("needs ecospy")
    folder, program = fmu.parent, Path(found.origin).parent / "binaries" / "ecos.exe"
    (folder / "tar.bat").write_text(TAR, encoding="ascii", newline="")
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder / "unpacked")
    (folder / "inputs.xml").write_text(scenario(unit, inputs), encoding="utf-8")
    command = ["simulate", "--path", fmu.name, "--stopTime", str(STEPS * STEP), "--stepSize", str(STEP)]
    if inputs:
        command += ["--scenarioConfig", "inputs.xml"]
    ecos = subprocess.run(
        ["wine", str(program), *command],
        cwd=folder, env=dict(wine), capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    results = list(folder.glob("*.csv"))
    assert ecos.returncode == 0 and len(results) == 1, ecos.stdout + ecos.stderr
    with results[0].open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file, skipinitialspace=True)
    names = [cell.removeprefix("instance::").rsplit("[", 1)[0] for cell in header]
    booleans = {"true": "1", "false": "0"}
    values = np.array([[float(booleans.get(cell, cell)) for cell in row] for row in rows])
    return dict(zip(names, values.T, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", CROSS_BUILT)
def test_a_windows_binary_gives_the_numbers_of_its_run_over_a_log(
    name: str, cross_built: Callable[[str], Path], wine: Mapping[str, str], tmp_path: Path
) -> None:
    unit = shipped_unit(name)
    inputs = drawn_inputs(unit, STEPS + 1)
    fmu = Path(shutil.copy(cross_built(name), tmp_path / "it.fmu"))
    found = simulated(fmu, unit, columns(unit, inputs), wine)
    expected = columns(unit, run(unit, sample_times(STEPS + 1), inputs))
    for shown, values in expected.items():
        # Inputs change every second sample; see test_masters.py.
        np.testing.assert_allclose(
            found[shown][1:STEPS:2], values[1:STEPS:2], 1e-10, 0.51 * 10.0**-DECIMALS, err_msg=shown
        )
