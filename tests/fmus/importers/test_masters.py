"""Every shipped unit, run native by masters that nobody here wrote: libcosim, Ecos and FMPy."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from ecos_master import run_ecos
from fmpy_master import run_fmpy
from libcosim_master import run_libcosim
from peers import need
from shipped_units import STEP, columns, drawn_inputs, sample_times, shipped_unit
from systems import alone
from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.blocks import block_names
from urmpipe_fmus.run import run
from urmpipe_models.elementwise import FloatArray

STEPS, FEW = 61, 9  # FEW are those of an arm with masses, which takes Python some tenths of a second each
MASTERS = {"libcosimpy": run_libcosim, "ecospy": run_ecos, "fmpy": run_fmpy}


@cache
def inputs_and_run(name: str) -> tuple[BlockModel, int, dict[str, FloatArray], dict[str, FloatArray]]:
    """Return a shipped unit, its number of steps, its inputs and its run over a log: it may take seconds."""
    unit, steps = shipped_unit(name), FEW if name in ("chain_dynamics", "driven_arm") else STEPS
    inputs = drawn_inputs(unit, steps + 1)
    return unit, steps, columns(unit, inputs), columns(unit, run(unit, sample_times(steps + 1), inputs))


@pytest.mark.slow
@pytest.mark.parametrize("name", block_names())
@pytest.mark.parametrize("master", MASTERS)
def test_a_native_unit_gives_the_numbers_of_its_run_over_a_log(
    master: str, name: str, fmu_of: Callable[..., Path]
) -> None:
    need(master)
    unit, steps, inputs, expected = inputs_and_run(name)
    trace = MASTERS[master](alone(fmu_of(name), unit, inputs), STEP, steps)["it"]
    assert expected.keys() == trace.keys()
    # The inputs change every second sample: what is read after a step with the inputs of its beginning is at
    # every odd sample what the log's run gives there, for the inputs of that sample.
    # The masters' clocks add up, so that their times and steps differ from k h in the last digits: with
    # values up to 1e4 (torques of a drawn motion) and stiff shafts that is 1e-10 of a value, not 1e-12.
    for output, values in trace.items():
        np.testing.assert_allclose(values[1::2], expected[output][1::2], 1e-10, 1e-10, err_msg=output)
