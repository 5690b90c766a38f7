"""One FMU run by FMPy's simulate_fmu."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shipped_units import sample_times
from systems import System, Trace
from urmpipe_models.elementwise import FloatArray


def run_fmpy(system: System, step: float, steps: int) -> Trace:
    """Run a system of one FMU with FMPy; inputs change at the samples."""
    from fmpy import simulate_fmu

    ((name, block),) = system.blocks.items()
    t = sample_times(steps + 1, step)
    shown = [one.name for one in system.outputs()]
    found = simulate_fmu(
        str(block.fmu),
        stop_time=float(t[-1]),
        output_interval=step,
        input=_inputs(system, t) if block.inputs else None,
        output=shown,
        start_values=dict(block.start),
        fmi_type="CoSimulation",
    )
    assert len(found) == len(t)
    return {name: {one: np.asarray(found[one], dtype=np.float64) for one in shown}}


def _inputs(system: System, t: FloatArray) -> NDArray[np.void]:
    """Return the inputs as FMPy takes them: a structured array with a row a sample."""
    kinds = {"Real": np.float64, "Integer": np.int32, "Boolean": np.bool_}
    names = [one for one, _ in system.inputs(0)]
    fields = [("time", np.float64), *((one.name, kinds[one.variable.type]) for one in names)]
    rows = np.zeros(len(t), dtype=np.dtype(fields))
    rows["time"] = t
    for one in names:
        rows[one.name] = system.blocks[one.block].inputs[one.name][: len(t)]
    return rows
