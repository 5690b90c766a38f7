"""Systems run by libcosim, the Open Simulation Platform's master (libcosimpy)."""

from __future__ import annotations

from systems import System, Trace, empty_trace


class LibcosimMaster:
    """A system in libcosim.

    Attributes:
        system: The system.
    """

    def __init__(self, system: System, step: float) -> None:
        from libcosimpy.CosimExecution import CosimExecution
        from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
        from libcosimpy.CosimManipulator import CosimManipulator
        from libcosimpy.CosimObserver import CosimObserver
        from libcosimpy.CosimSlave import CosimLocalSlave

        log_output_level(CosimLogLevel.ERROR)
        self.system = system
        self._execution = execution = CosimExecution.from_step_size(round(step * 1e9))
        self._slaves = {name: CosimLocalSlave(str(one.fmu), name) for name, one in system.blocks.items()}
        self._index = {name: execution.add_local_slave(slave) for name, slave in self._slaves.items()}
        assert min(self._index.values()) >= 0, f"libcosim cannot add one of {self._index}"
        self._observer, self._manipulator = (
            CosimObserver.create_last_value(),
            CosimManipulator.create_override(),
        )
        assert execution.add_observer(self._observer)
        assert execution.add_manipulator(self._manipulator)
        self._start()
        self._connect()

    def _start(self) -> None:
        setters = {
            "Real": self._execution.real_initial_value,
            "Integer": self._execution.integer_initial_value,
            "Boolean": self._execution.boolean_initial_value,
        }
        for one, value in self.system.starts():
            assert setters[one.variable.type](self._index[one.block], one.reference, value)

    def _connect(self) -> None:
        connects = {
            "Real": self._execution.connect_real_variables,
            "Integer": self._execution.connect_integer_variables,
            "Boolean": self._execution.connect_boolean_variables,
        }
        for source, target in self.system.connected():
            ends = (self._index[source.block], source.reference, self._index[target.block], target.reference)
            assert connects[source.variable.type](*ends) == 0

    def set(self, k: int) -> None:
        """Set the inputs of step k."""
        setters = {
            "Real": self._manipulator.slave_real_values,
            "Integer": self._manipulator.slave_integer_values,
            "Boolean": self._manipulator.slave_boolean_values,
        }
        for one, value in self.system.inputs(k):
            assert setters[one.variable.type](self._index[one.block], [one.reference], [value])

    def step(self) -> None:
        """Take a step."""
        assert self._execution.step(), f"libcosim: {self._execution.status()}"

    def read(self, trace: Trace, sample: int) -> None:
        """Read all outputs into a sample of a trace."""
        getters = {
            "Real": self._observer.last_real_values,
            "Integer": self._observer.last_integer_values,
            "Boolean": self._observer.last_boolean_values,
        }
        for one in self.system.outputs():
            value = getters[one.variable.type](self._index[one.block], [one.reference])[0]
            trace[one.block][one.name][sample] = value


def run_libcosim(system: System, step: float, steps: int) -> Trace:
    """Run a system with libcosim. Sample 0 stays NaN: its observers see nothing before the first step."""
    master = LibcosimMaster(system, step)
    trace = empty_trace(system, steps)
    for k in range(steps):
        master.set(k)
        master.step()
        master.read(trace, k + 1)
    return trace
