"""Where an FMU is unpacked is not its business: it finds its resources in any folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from shipped_units import STEP, sample_times, shipped_unit
from urmpipe_fmus.run import run

FOLDERS = ("plain", "with a space", "Größe ü 角度", "100% sure", "a%20b", "a#b?c=d&e", "quote'and+plus")


CASES = [(folder, "native") for folder in FOLDERS] + [
    # pythonfmu's binary undoes the %20 of an address and no other sign: elsewhere it ends the process.
    pytest.param(folder, "python", marks=pytest.mark.slow)
    for folder in FOLDERS[:2]
]


@pytest.mark.parametrize(("folder", "backend"), CASES)
def test_a_log_is_found_in_any_folder(
    folder: str, backend: str, fmu_of: Callable[..., Path], tmp_path: Path
) -> None:
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave

    place = tmp_path / folder
    place.mkdir()
    unzipped = extract(str(fmu_of("log_source", backend)), unzipdir=str(place))
    model = read_model_description(unzipped)
    slave = FMU2Slave(
        guid=model.guid, unzipDirectory=unzipped, instanceName="it",
        modelIdentifier=model.coSimulation.modelIdentifier,
    )  # fmt: skip
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    references = [one.valueReference for one in model.modelVariables if one.causality == "output"]
    found = []
    for k in range(10):
        found.append(list(slave.getReal(references)))
        slave.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)
    slave.terminate()
    slave.freeInstance()
    expected = run(shipped_unit("log_source"), sample_times(10))
    # The rows of the table are what is read: no arithmetic.
    np.testing.assert_array_equal(found, np.column_stack(list(expected.values())))
