"""A system ready to run, and its job.

`prepare` collects all errors of a system, with table and line of its file, before the first step:

1. The FMU of each block is built or read, and the columns of logs are read.
2. Connections and start values are checked (`checks.Wiring`).
3. The number of steps follows from the duration: t_k = k step, k = 0 .. count.
4. The values of logs are evaluated at the communication points: held, or linearly interpolated.
5. The exchanges are ordered (`order`); loops are errors unless they may be iterated.

`JobBuilder` turns the plan into a `Job`: every scalar gets its place in the vector of its type.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.block import BlockModel, Table
from urmpipe_fmus.cosim.checks import Interface, Link, StartValue, Variable, Wiring, read_interface
from urmpipe_fmus.cosim.job import TYPES, BlockJob, ExchangeJob, Job, LoopJob, Transfer
from urmpipe_fmus.cosim.order import Exchange, ExchangeOrder, Loop
from urmpipe_fmus.cosim.system import DEFAULT_STEP, SYSTEMS_FOLDER, Block, LogInput, Port, System
from urmpipe_models.errors import CosimulationError, Finding, Hint, UrmpipeError
from urmpipe_models.files import add_line_numbers

ModelOrFmu = Callable[[Block], BlockModel | Path]

NANOSECOND = 1e-9  # s; may be missing from the duration's last step: times of logs are rounded to ns
MAX_STEPS = 10**8  # a day of steps of 1 ms, which takes hours and 0.8 GB for the times alone
DTYPES = {"Real": np.float64, "Integer": np.int32, "Boolean": np.int32}  # fmi2Real, fmi2Integer, fmi2Boolean


@dataclass(frozen=True, slots=True, eq=False)
class LogColumn:
    """A column of a log that an input follows.

    Attributes:
        t_ns: Times from the log's start in [ns], strictly rising, shape (n,).
        values: In `unit`, finite, shape (n,).
        unit: Spelled as FMI does; empty if it is not known.
    """

    t_ns: NDArray[np.int64]
    values: NDArray[np.float64]
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Plan:
    """A system that is ready to run.

    Attributes:
        system: The system.
        interfaces: The interface of each block's FMU, in the order of the blocks.
        links: The connections by scalars.
        starts: The start values, by block.
        logged: Values of the inputs from logs at the communication points, in their units, shape (points,).
        order: The exchanges of a communication point.
        count: Number of communication steps: t_k = k step, k = 0 .. count.
        notes: Allowed, but worth a look.
    """

    system: System
    interfaces: Mapping[str, Interface]
    links: tuple[Link, ...]
    starts: Mapping[str, tuple[StartValue, ...]]
    logged: Mapping[Port, NDArray[np.float64]]
    order: tuple[Exchange | Loop, ...]
    count: int
    notes: tuple[str, ...]

    @property
    def sources(self) -> dict[Port, Port]:
        """The source of each connected input, by scalars."""
        return {port: source for link in self.links for port, source in link.scalars}

    @property
    def step(self) -> float:
        """Communication step in [s]."""
        return self.system.step or DEFAULT_STEP

    @property
    def loops(self) -> tuple[Loop, ...]:
        """Its algebraic loops."""
        return tuple(item for item in self.order if isinstance(item, Loop))

    def variable(self, port: Port) -> Variable:
        """Return the scalar at a port."""
        return self.interfaces[port.block].variables[port.variable]


def prepare(
    system: System,
    make: ModelOrFmu,
    *,
    column: Callable[[LogInput], LogColumn] | None = None,
    duration: float | None = None,
    period: float | None = None,
) -> Plan:
    """Prepare a system to run; all its errors are found here.

    Args:
        system: The system.
        make: Returns a block's model, whose FMU is taken from the cache or built, or an FMU.
        column: Returns the column of a log that an input follows.
        duration: In [s], of a system that states none and reads no log that determines it.
        period: Communication step in [s], of a system that states none: that of the logs that it plays.

    Raises:
        CosimulationError: With all errors: those of the file, FMUs that cannot be read, unknown variables, a
            destination that is no input, a source that is no output, sizes, types and units that differ,
            inputs without a source, start values that are rejected, algebraic loops that may not be iterated.
    """
    faults: list[Finding] = [*system.faults]
    step = system.step or period or DEFAULT_STEP
    system = replace(system, step=step)
    columns: dict[Port, LogColumn] = {}
    interfaces, ends = _interfaces(system, make, faults)
    for log_input in system.inputs:
        if not log_input.log:
            continue
        try:
            if column is None:
                raise CosimulationError(f"found the log {log_input.log}, but nothing to read it with")
            columns[log_input.destination] = column(log_input)
        except UrmpipeError as error:
            faults += _findings(f"inputs.{log_input.destination}", error)
    is_complete = not faults
    wiring = Wiring(system, interfaces, {port: read.unit for port, read in columns.items()})
    ends += [float(read.t_ns[-1]) * 1e-9 for read in columns.values() if len(read.t_ns)]
    faults += wiring.faults
    length = system.duration or duration or max(ends, default=0.0)
    count = _count(step, length, faults) if length or is_complete else 0
    notes = [*wiring.notes]
    if system.duration and system.duration - count * step > NANOSECOND:
        notes.append(
            f"system.duration: found {system.duration:.9g} s, no multiple of the step, {step:.9g} s:"
            f" it ends at {count * step:.9g} s"
        )
    times = np.arange(count + 1, dtype=np.float64) * step
    inputs = {log_input.destination: log_input for log_input in system.inputs}
    logged = {
        port: _values(inputs[port], columns[port], _variable(interfaces, port), times, faults)
        for port in wiring.logged
    }
    order = _order(system, interfaces, wiring, faults)
    if faults and system.path.is_file():
        shipped = system.path.parent == SYSTEMS_FOLDER
        name = system.path.name if shipped else str(system.path)
        with_lines = add_line_numbers(system.path, name, faults)
        raise CosimulationError(*sorted(with_lines, key=lambda fault: fault.line or 0))
    if faults:
        raise CosimulationError(*dict.fromkeys(faults))
    return Plan(
        system, interfaces, wiring.links, wiring.starts, logged, order, count, tuple(dict.fromkeys(notes))
    )


def _interfaces(
    system: System, make: ModelOrFmu, faults: list[Finding]
) -> tuple[dict[str, Interface], list[float]]:
    """Return the interface of each block's FMU, and the ends of the tables of block models in [s]."""
    interfaces: dict[str, Interface] = {}
    ends: list[float] = []
    by_path: dict[Path, Interface] = {}
    for block in system.blocks:
        if block.name in system.unusable_blocks:
            continue
        try:
            fmu = make(block)
            if isinstance(fmu, BlockModel):
                from urmpipe_fmus.build.fmu import cached_fmu

                ends += [float(fmu.table.t_ns[-1]) * 1e-9] if fmu.table is not None else []
                fmu = cached_fmu(fmu)
            if fmu not in by_path:
                by_path[fmu] = read_interface(fmu)
            elif by_path[fmu].single_instance:
                message = f"{fmu} can be instantiated only once in a system"
                faults.append(Finding(message, about=f"blocks.{block.name}"))
            interfaces[block.name] = by_path[fmu]
        except UrmpipeError as error:
            faults += _findings(f"blocks.{block.name}", error)
    return interfaces, ends


def _findings(table: str, error: UrmpipeError) -> list[Finding]:
    """Return an error as findings about a table or key of the system's file."""
    return [Finding(str(finding), about=table) for finding in error.findings]


def _variable(interfaces: Mapping[str, Interface], port: Port) -> Variable:
    return interfaces[port.block].variables[port.variable]


def _count(step: float, length: float, faults: list[Finding]) -> int:
    """Return the number of communication steps of a length in [s]."""
    key, hints = "system.duration", tuple(Hint(name, None, "sets another") for name in ("duration", "step"))
    if not (length > 0.0 and math.isfinite(length)):
        message = "not found, and no log tells it, allowed: a number above 0, in s"  # plain: ok
        hints = (Hint("duration", None, "sets it"),)
    elif step < NANOSECOND:
        message = f"found {step:g} s, allowed: from 1e-09 s, as times are in ns"
        key, hints = "system.step", ()
    elif length / step > MAX_STEPS:
        message = f"found {length:g} s in steps of {step:g} s, allowed: {MAX_STEPS:.0e} steps at most"
    else:
        count = math.floor((length + NANOSECOND) / step)
        if count >= 1:
            return count
        message = f"found {step:g} s, allowed: no more than the duration, {length:g} s"
        key, hints = "system.step", ()
    faults.append(Finding(message, about=key, hints=hints))
    return 0


def _values(
    log_input: LogInput,
    column: LogColumn,
    variable: Variable,
    times: NDArray[np.float64],
    faults: list[Finding],
) -> NDArray[np.float64]:
    """Return the values of a log at the communication points, at times in [s]."""
    table = f"inputs.{log_input.destination}"
    if log_input.interpolate and variable.type != "Real":
        message = f"interpolate: found for an {variable.type}, allowed: for a Real"
        faults.append(Finding(message, about=table))
    try:
        rows = Table(column.t_ns, np.asarray(column.values)[:, None])
    except UrmpipeError as error:
        faults += _findings(table, error)
        return np.zeros(len(times))
    reasons = map(variable.rejection_reason, np.unique(rows.values).tolist())
    if reason := next(filter(None, reasons), ""):
        faults.append(Finding(f"{log_input.log}, column {log_input.column}: {reason}", about=table))
    before, after, fraction = rows.rows_at(times)
    values = before[0] + fraction * (after[0] - before[0]) if log_input.interpolate else before[0]
    return np.ascontiguousarray(values)


def _order(
    system: System, interfaces: Mapping[str, Interface], wiring: Wiring, faults: list[Finding]
) -> tuple[Exchange | Loop, ...]:
    """Return the order of the exchanges; loops that are not allowed are reported."""
    outputs = [Port(name, output.name) for name, shown in interfaces.items() for output in shown.outputs]
    depends = {
        port: [Port(port.block, name) for name in sorted(interfaces[port.block].dependencies[port.variable])]
        for port in outputs
    }
    sources = {port: source for link in wiring.links for port, source in link.scalars}
    order = ExchangeOrder(outputs, depends, sources, wiring.logged).steps()
    for loop in (item for item in order if isinstance(item, Loop)):
        if not system.iterate:
            loop_outputs = [
                Port(exchange.block, name) for exchange in loop.exchanges for name in exchange.outputs
            ]
            assumed = ", ".join(
                str(port)
                for port in loop_outputs
                if port.variable in interfaces[port.block].missing_dependencies
            )
            reason = ""
            if assumed:
                reason = f" ({assumed}: on all inputs, as the FMU does not tell on which)"  # plain: ok
            message = f"{loop.ring}: each depends on the one before at the same instant{reason}"
            faults.append(
                Finding(f"{message}; allowed: none, or [loops] iterate = true", about="algebraic loop")
            )
        for port in loop.torn:
            kind = _variable(interfaces, port).type
            if kind != "Real":
                message = f"{loop.ring}: found {port}, an {kind}; allowed: Reals alone"
                faults.append(Finding(message, about="algebraic loop"))
    return tuple(order)


class JobBuilder:
    """The places of a plan's scalars, and the job with them.

    Attributes:
        recorded: The recorded scalars of each type, in the order of their places.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._sources = plan.sources
        self._numbers = {name: i for i, name in enumerate(plan.interfaces)}
        self.recorded: dict[str, list[Port]] = {kind: [] for kind in TYPES}
        self._torn = [port for loop in plan.loops for port in loop.torn]
        for port in (*plan.logged, *self._outputs()):
            self.recorded[plan.variable(port).type].append(port)
        recorded = {port: i for ports in self.recorded.values() for i, port in enumerate(ports)}
        connected = {port: recorded[source] for port, source in self._sources.items()}
        torn = {port: len(self.recorded["Real"]) + i for i, port in enumerate(self._torn)}
        self._places = {**recorded, **connected, **torn}

    @property
    def ports(self) -> list[Port]:
        """The recorded scalars in the order of the columns."""
        return [port for ports in self.recorded.values() for port in ports]

    def job(self, folders: Mapping[str, Path]) -> Job:
        """Return the job.

        Args:
            folders: Folder of each block's unpacked FMU.
        """
        plan = self._plan
        return Job(
            step=plan.step,
            count=plan.count,
            record_every=plan.system.record_every,
            tolerance=plan.system.tolerance,
            blocks=tuple(self._block(name, folders[name]) for name in plan.interfaces),
            order=tuple(
                self._loop(item) if isinstance(item, Loop) else self._exchange(item) for item in plan.order
            ),
            logged=self._logged(),
            recorded={kind: len(ports) for kind, ports in self.recorded.items()},
            start=self._start(),
        )

    def _outputs(self) -> Iterator[Port]:
        """Yield the outputs in the order in which they are read."""
        for item in self._plan.order:
            for exchange in item.exchanges if isinstance(item, Loop) else (item,):
                yield from (Port(exchange.block, name) for name in exchange.outputs)

    def _block(self, name: str, folder: Path) -> BlockJob:
        interface, starts = self._plan.interfaces[name], self._plan.starts[name]
        return BlockJob(
            name=name,
            folder=folder,
            identifier=interface.identifier,
            guid=interface.guid,
            variable_step=interface.variable_step,
            can_save=interface.can_save,
            starts=tuple((start.variable.type, start.variable.reference, start.value) for start in starts),
        )

    def _exchange(self, exchange: Exchange) -> ExchangeJob:
        return ExchangeJob(
            self._numbers[exchange.block],
            self._transfers(exchange.block, exchange.inputs),
            self._transfers(exchange.block, exchange.outputs),
        )

    def _transfers(self, block: str, names: Iterable[str]) -> tuple[Transfer, ...]:
        """Return one transfer per type, in the order of the places: neighbours need not be gathered."""
        by_type: dict[str, list[tuple[int, int]]] = {}
        for name in names:
            variable = self._plan.interfaces[block].variables[name]
            place = self._places[Port(block, name)]
            by_type.setdefault(variable.type, []).append((place, variable.reference))
        return tuple(
            Transfer(kind, tuple(r for _, r in sorted(pairs)), tuple(p for p, _ in sorted(pairs)))
            for kind, pairs in by_type.items()
        )

    def _loop(self, loop: Loop) -> LoopJob:
        size = len(self.recorded["Real"]) + len(self._torn)
        minimum, maximum = np.full(size, -np.inf), np.full(size, np.inf)
        for exchange in loop.exchanges:
            for port in (Port(exchange.block, name) for name in exchange.inputs):
                variable, place = self._plan.variable(port), self._places[port]
                if variable.type == "Real":
                    minimum[place] = max(minimum[place], variable.minimum)
                    maximum[place] = min(maximum[place], variable.maximum)
        return LoopJob(
            exchanges=tuple(self._exchange(exchange) for exchange in loop.exchanges),
            torn=tuple(self._places[port] for port in loop.torn),
            sources=tuple(self._places[self._sources[port]] for port in loop.torn),
            minimum=minimum,
            maximum=maximum,
            nominal=np.array([self._nominal(port) for port in loop.torn]),
            ring=loop.ring,
        )

    def _nominal(self, port: Port) -> float:
        """Return the magnitude of an input: as it states, or else its source; 1 if neither does."""
        nominals = (self._plan.variable(either).nominal for either in (port, self._sources[port]))
        return next(filter(None, nominals), 1.0)

    def _logged(self) -> dict[str, NDArray[np.float64] | NDArray[np.int32]]:
        """Return the values from logs by type, shape (points, inputs)."""
        columns: dict[str, list[np.ndarray]] = {}
        for port, values in self._plan.logged.items():
            kind = self._plan.variable(port).type
            columns.setdefault(kind, []).append(values.astype(DTYPES[kind]))
        return {kind: np.column_stack(arrays) for kind, arrays in columns.items()}

    def _start(self) -> dict[str, np.ndarray]:
        """Return the vectors at the start: torn inputs have the start values of their blocks."""
        vectors = {kind: np.zeros(len(ports), DTYPES[kind]) for kind, ports in self.recorded.items()}
        values = {
            Port(block, start.variable.name): start.value
            for block, starts in self._plan.starts.items()
            for start in starts
        }
        torn = [float(values.get(port, self._plan.variable(port).start or 0.0)) for port in self._torn]
        return vectors | {"Real": np.concatenate([vectors["Real"], np.array(torn, np.float64)])}
