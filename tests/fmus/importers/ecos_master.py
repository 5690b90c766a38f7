"""Systems run by Ecos (ecospy), and on Windows by its program."""

from __future__ import annotations

from typing import Any

from systems import System, Trace, empty_trace

TYPES = {"Real": "real", "Integer": "integer", "Boolean": "bool"}  # in the names of Ecos's functions


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
        assert structure.add_parameter_set("start", {scalar.path: value for scalar, value in system.starts()})
        with EcosSimulation(structure=structure, step_size=step) as simulation:
            assert simulation.init(parameter_set="start"), EcosLib.get_last_error()
            read(simulation, 0)
            for k in range(steps):
                for scalar, value in system.inputs(k):
                    getattr(simulation, f"set_{TYPES[scalar.variable.type]}")(scalar.path, value)
                simulation.step()
                read(simulation, k + 1)
            simulation.terminate()
    return trace
