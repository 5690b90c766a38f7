"""Masters that nobody here wrote: libcosim (Open Simulation Platform), Ecos, and FMPy for one FMU."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from systems import Scalar, System, Trace, empty_trace, sample_times

TYPES = {"Real": "real", "Integer": "integer", "Boolean": "bool"}  # in the names of Ecos's functions


def typed(owner: object, method: str, scalar: Scalar) -> Callable[..., Any]:
    """Return the method for the type of a scalar: `last_real_values` of `last_{}_values`."""
    found: Callable[..., Any] = getattr(owner, method.format(scalar.variable.type.lower()))
    return found


def run_libcosim(system: System, step: float, steps: int) -> Trace:
    """Run a system with libcosim. Sample 0 stays NaN: its observers see nothing before the first step."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_step_size(round(step * 1e9))
    slaves = {name: CosimLocalSlave(str(block.fmu), name) for name, block in system.blocks.items()}
    index = {name: execution.add_local_slave(slave) for name, slave in slaves.items()}
    assert min(index.values()) >= 0, f"libcosim cannot add one of {index}"
    observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
    assert execution.add_observer(observer)
    assert execution.add_manipulator(manipulator)
    for source, target in system.connected():
        ends = (index[source.block], source.reference, index[target.block], target.reference)
        assert typed(execution, "connect_{}_variables", source)(*ends) == 0
    trace = empty_trace(system, steps)
    for k in range(steps):
        for scalar, value in system.inputs(k):
            set_values = typed(manipulator, "slave_{}_values", scalar)
            assert set_values(index[scalar.block], [scalar.reference], [value])
        assert execution.step(), f"libcosim: {execution.status()}"
        for scalar in system.outputs():
            values = typed(observer, "last_{}_values", scalar)(index[scalar.block], [scalar.reference])
            trace[scalar.block][scalar.name][k + 1] = values[0]
    return trace


def run_ecos(system: System, step: float, steps: int) -> Trace:
    """Run a system with Ecos; sample 0 is what it reads after the initialization."""
    from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure

    EcosLib.set_log_level("warn")
    trace = empty_trace(system, steps)

    def read(simulation: Any, sample: int) -> None:
        for scalar in system.outputs():
            value = getattr(simulation, f"get_{TYPES[scalar.variable.type]}")(scalar.path)
            trace[scalar.block][scalar.name][sample] = value

    with EcosSimulationStructure() as structure:
        for name, block in system.blocks.items():
            structure.add_model(name, str(block.fmu))
        for source, target in system.connected():
            kind = "int" if source.variable.type == "Integer" else TYPES[source.variable.type]
            getattr(structure, f"make_{kind}_connection")(source.path, target.path)
        with EcosSimulation(structure=structure, step_size=step) as simulation:
            assert simulation.init(), EcosLib.get_last_error()
            read(simulation, 0)
            for k in range(steps):
                for scalar, value in system.inputs(k):
                    getattr(simulation, f"set_{TYPES[scalar.variable.type]}")(scalar.path, value)
                simulation.step()
                read(simulation, k + 1)
            simulation.terminate()
    return trace


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
    options = {"stop_time": float(t[-1]), "output_interval": step, "fmi_type": "CoSimulation"}
    found = simulate_fmu(str(block.fmu), input=rows if inputs else None, output=shown, **options)
    assert len(found) == len(t)
    return {name: {output: np.asarray(found[output], dtype=np.float64) for output in shown}}


MASTERS = {"libcosimpy": run_libcosim, "ecospy": run_ecos, "fmpy": run_fmpy}
