"""Systems run by Ecos (ecospy), and on Windows by its program."""

from __future__ import annotations

from typing import Any

from systems import System, Trace, empty_trace


def run_ecos(system: System, step: float, steps: int) -> Trace:
    """Run a system with Ecos; sample 0 is what it reads after the initialization."""
    from ecospy import EcosLib, EcosSimulation

    EcosLib.set_log_level("warn")
    trace = empty_trace(system, steps)
    with structure_of(system) as structure, EcosSimulation(structure=structure, step_size=step) as simulation:
        assert simulation.init(parameter_set="start"), EcosLib.get_last_error()
        read(simulation, system, trace, 0)
        for k in range(steps):
            set_inputs(simulation, system, k)
            simulation.step()
            read(simulation, system, trace, k + 1)
        simulation.terminate()
    return trace


def structure_of(system: System) -> Any:
    """Return the system as Ecos describes it."""
    from ecospy import EcosSimulationStructure

    structure = EcosSimulationStructure()
    for name, block in system.blocks.items():
        structure.add_model(name, str(block.fmu))
    connects = {
        "Real": structure.make_real_connection,
        "Integer": structure.make_int_connection,
        "Boolean": structure.make_bool_connection,
    }
    for source, target in system.connected():
        connects[source.variable.type](source.path, target.path)
    assert structure.add_parameter_set("start", {one.path: value for one, value in system.starts()})
    return structure


def set_inputs(simulation: Any, system: System, k: int) -> None:
    """Set the inputs of step k."""
    setters = {"Real": simulation.set_real, "Integer": simulation.set_integer, "Boolean": simulation.set_bool}
    for one, value in system.inputs(k):
        setters[one.variable.type](one.path, value)


def read(simulation: Any, system: System, trace: Trace, sample: int) -> None:
    """Read the outputs of all blocks into a sample of the trace."""
    getters = {"Real": simulation.get_real, "Integer": simulation.get_integer, "Boolean": simulation.get_bool}
    for one in system.outputs():
        trace[one.block][one.name][sample] = getters[one.variable.type](one.path)
