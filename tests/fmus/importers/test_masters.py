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
from shipped_units import STEP, columns, drawn_inputs, sample_times, shipped, shipped_unit
from systems import System, Trace, alone
from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.run import run
from urmpipe_models.elementwise import FloatArray

STEPS, FEW = 61, 9
"""Steps, and those of an arm with masses, which takes Python some tenths of a second each."""

MASTERS: dict[str, tuple[str, Callable[[System, float, int], Trace]]] = {
    "libcosimpy": ("libcosimpy", run_libcosim),
    "ecospy": ("ecospy", run_ecos),
    "fmpy": ("fmpy", run_fmpy),
}


def steps_of(name: str) -> int:
    return FEW if name in ("chain_dynamics", "driven_arm") else STEPS


@cache
def inputs_and_run(name: str) -> tuple[BlockModel, dict[str, FloatArray], dict[str, FloatArray]]:
    """Return a shipped unit, its inputs and its run over a log: seconds of Python for an arm with masses."""
    unit, rows = shipped_unit(name), steps_of(name) + 1
    held = drawn_inputs(unit, rows)
    return unit, columns(unit, held), columns(unit, run(unit, sample_times(rows), held))


def assert_is_the_run_over_a_log(trace: Trace, expected: dict[str, FloatArray], rtol: float) -> None:
    """The inputs change every second sample: what is read after a step with the inputs of its beginning is at
    every odd sample what the log's run gives there, for the inputs of that sample.
    """
    assert expected.keys() == trace["it"].keys()
    for name, values in trace["it"].items():
        np.testing.assert_allclose(values[1::2], expected[name][1::2], rtol, rtol, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped())
@pytest.mark.parametrize("master", MASTERS)
def test_a_native_unit_gives_the_numbers_of_its_run_over_a_log(
    master: str, name: str, fmu_of: Callable[..., Path]
) -> None:
    module, run_master = MASTERS[master]
    need(module)
    unit, inputs, expected = inputs_and_run(name)
    trace = run_master(alone(fmu_of(name), unit, inputs), STEP, steps_of(name))
    # The masters' clocks add up, so that their times and steps differ from k h in the last digits: with
    # values up to 1e4 (torques of a drawn motion) and stiff shafts that is 1e-10 of a value, not 1e-12.
    assert_is_the_run_over_a_log(trace, expected, rtol=1e-10)
