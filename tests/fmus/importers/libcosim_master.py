"""Systems run by libcosim, the Open Simulation Platform's master (libcosimpy)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from systems import Scalar, System, Trace, empty_trace


def typed(owner: object, method: str, scalar: Scalar) -> Callable[..., Any]:
    """Return the method for the type of a scalar: `real_initial_value` of `{}_initial_value`."""
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
    for scalar, value in system.starts():
        assert typed(execution, "{}_initial_value", scalar)(index[scalar.block], scalar.reference, value)
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
