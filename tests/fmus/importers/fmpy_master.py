"""One FMU run by FMPy's simulate_fmu."""

from __future__ import annotations

import numpy as np

from shipped_units import sample_times
from systems import System, Trace


def run_fmpy(system: System, step: float, steps: int) -> Trace:
    """Run a system of one FMU with FMPy; inputs change at the samples."""
    from fmpy import simulate_fmu

    ((name, block),) = system.blocks.items()
    t = sample_times(steps + 1, step)
    kinds = {"Real": np.float64, "Integer": np.int32, "Boolean": np.bool_}
    inputs = [scalar for scalar, _ in system.inputs(0)]
    fields = [(scalar.name, kinds[scalar.variable.type]) for scalar in inputs]
    rows = np.zeros(len(t), dtype=np.dtype([("time", np.float64), *fields]))
    rows["time"] = t
    for scalar in inputs:
        rows[scalar.name] = block.inputs[scalar.name][: len(t)]
    shown = [scalar.name for scalar in system.outputs()]
    found = simulate_fmu(
        str(block.fmu),
        stop_time=float(t[-1]),
        output_interval=step,
        input=rows if inputs else None,
        output=shown,
        start_values=dict(block.start),
        fmi_type="CoSimulation",
    )
    assert len(found) == len(t)
    return {name: {output: np.asarray(found[output], dtype=np.float64) for output in shown}}
