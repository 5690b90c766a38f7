"""The C sources inside an FMU are all that is needed to build it again, by whoever."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fmpy_master import run_fmpy
from peers import fmutool, python
from shipped_units import STEP, columns, drawn_inputs, shipped_unit
from systems import alone

STEPS = 20


def without_binaries(fmu: Path, target: Path) -> Path:
    """Write an FMU again with all but its binaries."""
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(target, "w") as kept:
        for entry in source.infolist():
            if not entry.filename.startswith("binaries/"):
                kept.writestr(entry, source.read(entry))
    return target


@pytest.mark.slow
# They have memories, states and a table; of the sources only the model's differ.
@pytest.mark.parametrize(
    ("compiler", "name"), [("fmutool", "repolarizer"), ("fmutool", "dc_drive"), ("fmpy", "log_source")]
)
def test_an_fmu_compiled_again_from_its_own_sources_gives_the_same_numbers(
    compiler: str, name: str, fmu_of: Callable[..., Path], tmp_path: Path
) -> None:
    original, unit = fmu_of(name), shipped_unit(name)
    again = without_binaries(original, tmp_path / f"{name}.fmu")
    if compiler == "fmutool":  # it takes `cc`, the files that the description lists, and its own headers
        source, again = again, tmp_path / "again.fmu"
        compiling = fmutool("-input", str(source), "-output", str(again), "-compile-sources")
    else:  # it takes CMake, and its own headers
        if not (shutil.which("cmake") and shutil.which("make")):
            pytest.skip("needs cmake and make")
        compiling = python("-m", "fmpy", "compile", str(again))
    assert compiling.returncode == 0, compiling.stdout
    assert [entry for entry in zipfile.ZipFile(again).namelist() if entry.startswith("binaries/")]
    inputs = columns(unit, drawn_inputs(unit, STEPS + 1))
    traces = [run_fmpy(alone(fmu, unit, inputs), STEP, STEPS)["it"] for fmu in (original, again)]
    for shown, values in traces[0].items():
        # Other optimisation, and a compiler that may contract a * b + c: the last digits may differ.
        np.testing.assert_allclose(traces[1][shown], values, 1e-12, 1e-12, err_msg=shown)
