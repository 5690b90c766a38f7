"""Where an FMU is unpacked is not its business: it finds its resources in any folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from loaded_fmu import Loaded
from shipped_units import STEP, sample_times, shipped_unit
from urmpipe_fmus.run import run

FOLDERS = ("plain", "with a space", "Größe ü 角度", "100% sure", "a%20b", "a#b?c=d&e", "quote'and+plus")
CASES = [(folder, "native") for folder in FOLDERS] + [
    # pythonfmu's binary undoes the %20 of an address and no other sign: elsewhere it ends the process.
    pytest.param(folder, "python", marks=pytest.mark.slow)
    for folder in FOLDERS[:2]
]


@pytest.mark.slow
@pytest.mark.parametrize(("folder", "backend"), CASES)
def test_a_log_is_found_in_any_folder(
    folder: str, backend: str, fmu_of: Callable[..., Path], tmp_path: Path
) -> None:
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
