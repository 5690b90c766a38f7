"""A system made ready to run: its FMUs read, all of it checked, the order of its exchanges found.

A plan turned into a job: every scalar gets its place in the vector of its type.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.block import BlockModel, Table
from urmpipe_fmus.cosim.checks import Interface, Link, Start, Variable, Wiring, read_interface
from urmpipe_fmus.cosim.job import TYPES, BlockJob, ExchangeJob, Job, LoopJob, Transfer
from urmpipe_fmus.cosim.order import Exchange, Loop, Order
from urmpipe_fmus.cosim.system import STEP, SYSTEMS, Block, LogInput, Port, System
from urmpipe_models.errors import CosimulationError, Finding, Hint, UrmpipeError
from urmpipe_models.files import add_line_numbers

Make = Callable[[Block], BlockModel | Path]

NANOSECOND = 1e-9
"""So much may be missing from a duration's last step: a log's times are rounded to nanoseconds."""


MOST_STEPS = 10**8
"""Most communication steps: a day of a millisecond each, which takes hours and 0.8 GB for the times alone."""


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


@dataclass(frozen=True, slots=True, eq=False)
class Logged:
    """An input that follows a log.

    Attributes:
        destination: The input.
        values: Its value at every communication point, in the input's own unit, shape (points,).
    """

    destination: Port
    values: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Plan:
    """A system that is ready to run.

    Attributes:
        system: The system.
        interfaces: What the FMU of each block shows, in the order of the blocks.
        links: What goes where, a line a connection.
        starts: What is set before the first step, by block.
        logged: The inputs from logs.
        order: The exchanges of a communication point.
        count: Number of communication steps: t_k = k step, k = 0 .. count.
        notes: What is allowed but should be seen.
    """

    system: System
    interfaces: Mapping[str, Interface]
    links: tuple[Link, ...]
    starts: Mapping[str, tuple[Start, ...]]
    logged: tuple[Logged, ...]
    order: tuple[Exchange | Loop, ...]
    count: int
    notes: tuple[str, ...]

    @property
    def sources(self) -> dict[Port, Port]:
        """The source of each connected input, by scalars."""
        return {one: source for link in self.links for one, source in link.scalars}

    @property
    def step(self) -> float:
        """Communication step in [s]."""
        return self.system.step or STEP

    @property
    def loops(self) -> tuple[Loop, ...]:
        """Its algebraic loops."""
        return tuple(one for one in self.order if isinstance(one, Loop))

    def variable(self, port: Port) -> Variable:
        """Return the scalar at a port."""
        return self.interfaces[port.block].variables[port.variable]


def prepare(
    system: System,
    make: Make,
    *,
    column: Callable[[LogInput], LogColumn] | None = None,
    duration: float | None = None,
    period: float | None = None,
) -> Plan:
    """Make a system ready to run: everything that can be wrong with it is found here.

    Args:
        system: The system.
        make: Gives a block's unit, whose FMU is taken from the cache or built, or an FMU.
        column: Gives the column of a log that an input follows.
        duration: In [s], of a system that names none and reads no log by which to tell.
        period: Communication step in [s], of a system that names none: that of the logs that it plays.

    Raises:
        CosimulationError: With all that is wrong: the faults of the file, FMUs that cannot be read, unknown
            variables, a destination that is no input, a source that is no output, sizes, types and units
            that differ, inputs without a source, start values that are refused, algebraic loops that may not
            be iterated.
    """
    faults: list[Finding] = [*system.faults]
    step = system.step or period or STEP
    system = replace(system, step=step)
    columns: dict[Port, LogColumn] = {}
    interfaces, ends = _interfaces(system, make, faults)
    for one in (each for each in system.inputs if each.log):
        try:
            columns[one.destination] = _column(one, column)
        except UrmpipeError as error:
            faults += _quoted(f"inputs.{one.destination}", error)
    complete = not faults
    wiring = Wiring(system, interfaces, {port: one.unit for port, one in columns.items()})
    ends += [float(one.t_ns[-1]) * 1e-9 for one in columns.values() if len(one.t_ns)]
    faults += wiring.faults
    length = system.duration or duration or max(ends, default=0.0)
    count = _count(step, length, faults) if length or complete else 0
    wiring.notes += _cut_short(system.duration, step, count)
    times = np.arange(count + 1, dtype=np.float64) * step
    logged = tuple(_logged(system, one, columns, wiring, times, faults) for one in wiring.logged)
    order = _order(system, interfaces, wiring, faults)
    _refuse(system, faults)
    notes = tuple(dict.fromkeys(wiring.notes))
    return Plan(system, interfaces, wiring.links, wiring.starts, logged, order, count, notes)


def _refuse(system: System, faults: list[Finding]) -> None:
    """Raise a `CosimulationError` if there are faults, by line if the system has a file."""
    if faults and system.path.is_file():
        shipped = system.path.parent == SYSTEMS
        found = add_line_numbers(system.path, system.path.name if shipped else str(system.path), faults)
        raise CosimulationError(*sorted(found, key=lambda one: one.line or 0))
    if faults:
        raise CosimulationError(*dict.fromkeys(faults))


def _interfaces(
    system: System, make: Make, faults: list[Finding]
) -> tuple[dict[str, Interface], list[float]]:
    """Return what each block's FMU shows, and where the tables of units end in [s]."""
    interfaces: dict[str, Interface] = {}
    ends: list[float] = []
    read: dict[Path, Interface] = {}
    for block in (one for one in system.blocks if one.name not in system.unread):
        try:
            made = make(block)
            if isinstance(made, BlockModel):
                ends += [float(made.table.t_ns[-1]) * 1e-9] if made.table is not None else []
                made = _fmu_of(made)
            if made not in read:
                read[made] = read_interface(made)
            elif read[made].alone:
                faults.append(
                    Finding(f"{made} can be instantiated only once in a system", about=f"blocks.{block.name}")
                )
            interfaces[block.name] = read[made]
        except UrmpipeError as error:
            faults += _quoted(f"blocks.{block.name}", error)
    return interfaces, ends


def _quoted(where: str, error: UrmpipeError) -> list[Finding]:
    """Return what is wrong with what a table or key of the system's file asks for."""
    return [Finding(one.format("system file"), about=where) for one in error.findings]


def _fmu_of(unit: BlockModel) -> Path:
    from urmpipe_fmus.build.fmu import cached_fmu

    return cached_fmu(unit)


def _column(one: LogInput, column: Callable[[LogInput], LogColumn] | None) -> LogColumn:
    if column is None:
        raise CosimulationError(f"found the log {one.log}, but nothing to read it with")
    return column(one)


def _count(step: float, length: float, faults: list[Finding]) -> int:
    """Return the number of communication steps of a length in [s]."""
    if not (length > 0.0 and math.isfinite(length)):
        faults.append(
            Finding(
                "not found, and no log tells it, allowed: a number above 0, in s",
                about="system.duration",
                hints=(Hint("duration", None, "sets it"),),
            )
        )
        return 0
    if step < NANOSECOND:
        faults.append(
            Finding(f"found {step:g} s, allowed: from 1e-09 s, as times are in ns", about="system.step")
        )
        return 0
    if length / step > MOST_STEPS:
        found = f"found {length:g} s in steps of {step:g} s, allowed: {MOST_STEPS:.0e} steps at most"
        hints = tuple(Hint(name, None, "sets another") for name in ("duration", "step"))
        faults.append(Finding(found, about="system.duration", hints=hints))
        return 0
    count = math.floor((length + NANOSECOND) / step)
    if count < 1:
        faults.append(
            Finding(
                f"found {step:g} s, allowed: no more than the duration, {length:g} s", about="system.step"
            )
        )
    return count


def _cut_short(duration: float | None, step: float, count: int) -> Iterator[str]:
    """Yield what should be seen of a duration that is no whole number of steps."""
    end = count * step
    if duration and duration - end > NANOSECOND:
        yield (
            f"system.duration: found {duration:.9g} s, no multiple of the step, {step:.9g} s:"
            f" it ends at {end:.9g} s"
        )


def _logged(
    system: System,
    port: Port,
    columns: Mapping[Port, LogColumn],
    wiring: Wiring,
    times: NDArray[np.float64],
    faults: list[Finding],
) -> Logged:
    """Return the values of a log at the communication points, at times in [s]."""
    variable = wiring.interfaces[port.block].variables[port.variable]
    asked = next(one for one in system.inputs if one.destination == port)
    if asked.interpolate and variable.type != "Real":
        faults.append(
            Finding(f"interpolate: found for an {variable.type}, allowed: for a Real", about=f"inputs.{port}")
        )
    try:
        table = Table(columns[port].t_ns, np.asarray(columns[port].values)[:, None])
    except UrmpipeError as error:
        faults += _quoted(f"inputs.{port}", error)
        return Logged(port, np.zeros(len(times)))
    refused = map(variable.refusal, np.unique(table.values).tolist())
    if fault := next(filter(None, refused), ""):
        faults.append(Finding(f"{asked.log}, column {asked.column}: {fault}", about=f"inputs.{port}"))
    before, after, fraction = table.rows_at(times)
    values = before[0] + fraction * (after[0] - before[0]) if asked.interpolate else before[0]
    return Logged(port, np.ascontiguousarray(values))


def _order(
    system: System, interfaces: Mapping[str, Interface], wiring: Wiring, faults: list[Finding]
) -> tuple[Exchange | Loop, ...]:
    """Return the order of the exchanges, and tell the loops that may not be."""
    outputs = [Port(name, one.name) for name, shown in interfaces.items() for one in shown.outputs]
    depends = {
        port: [Port(port.block, name) for name in sorted(interfaces[port.block].dependencies[port.variable])]
        for port in outputs
    }
    sources = {one: source for link in wiring.links for one, source in link.scalars}
    found = Order(outputs, depends, sources, wiring.logged).steps()
    for loop in found:
        if not isinstance(loop, Loop):
            continue
        if not system.iterate:
            faults.append(
                Finding(
                    f"{loop.ring}: each depends on the one before at the same instant"
                    f"{_assumed(loop, interfaces)}; allowed: none, or [loops] iterate = true",
                    about="algebraic loop",
                )
            )
        for port in loop.torn:
            kind = interfaces[port.block].variables[port.variable].type
            if kind != "Real":
                faults.append(
                    Finding(
                        f"{loop.ring}: found {port}, an {kind}; allowed: Reals alone", about="algebraic loop"
                    )
                )
    return tuple(found)


def _assumed(loop: Loop, interfaces: Mapping[str, Interface]) -> str:
    """Return which outputs of a loop are only assumed to depend on its inputs; empty if none."""
    outputs = [Port(one.block, name) for one in loop.exchanges for name in one.outputs]
    silent = [str(port) for port in outputs if port.variable in interfaces[port.block].silent]
    return f" ({', '.join(silent)}: on all inputs, as the FMU does not tell on which)" if silent else ""


DTYPES = {"Real": np.float64, "Integer": np.int32, "Boolean": np.int32}
"""FMI 2.0's fmi2Real, fmi2Integer and fmi2Boolean."""


class Assembly:
    """The places of a plan's scalars.

    Attributes:
        recorded: The recorded scalars of each type, in the order of their places.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._sources = plan.sources
        self._block = {name: i for i, name in enumerate(plan.interfaces)}
        self.recorded: dict[str, list[Port]] = {one: [] for one in TYPES}
        self._torn = [port for loop in plan.loops for port in loop.torn]
        for port in (*(one.destination for one in plan.logged), *self._read()):
            self.recorded[plan.variable(port).type].append(port)
        known = {port: i for ports in self.recorded.values() for i, port in enumerate(ports)}
        guessed = {port: len(self.recorded["Real"]) + i for i, port in enumerate(self._torn)}
        self._places = {**known, **{i: known[source] for i, source in self._sources.items()}, **guessed}

    @property
    def ports(self) -> list[Port]:
        """The recorded scalars in the order of the columns."""
        return [port for ports in self.recorded.values() for port in ports]

    def job(self, folders: Mapping[str, Path]) -> Job:
        """Return the job.

        Args:
            folders: Where the FMU of each block is unpacked.
        """
        plan = self._plan
        return Job(
            step=plan.step,
            count=plan.count,
            record_every=plan.system.record_every,
            tolerance=plan.system.tolerance,
            blocks=tuple(self._of_block(name, folders[name]) for name in plan.interfaces),
            order=tuple(
                self._loop(one) if isinstance(one, Loop) else self._exchange(one) for one in plan.order
            ),
            logged={kind: np.column_stack(values) for kind, values in self._logged().items()},
            recorded={kind: len(ports) for kind, ports in self.recorded.items()},
            start=self._start(),
        )

    def _read(self) -> Iterable[Port]:
        """Return the outputs in the order in which they are read; each block's by type."""
        for one in self._plan.order:
            for exchange in one.exchanges if isinstance(one, Loop) else (one,):
                yield from (Port(exchange.block, name) for name in exchange.outputs)

    def _exchange(self, one: Exchange) -> ExchangeJob:
        return ExchangeJob(
            self._block[one.block],
            self._transfers(one.block, one.inputs),
            self._transfers(one.block, one.outputs),
        )

    def _transfers(self, block: str, names: Iterable[str]) -> tuple[Transfer, ...]:
        """Return one transfer a type, in the order of the places: neighbours need not be gathered then."""
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
        minimum, maximum = self._limits(loop)
        return LoopJob(
            exchanges=tuple(self._exchange(one) for one in loop.exchanges),
            torn=tuple(self._places[port] for port in loop.torn),
            sources=tuple(self._places[self._sources[port]] for port in loop.torn),
            minimum=minimum,
            maximum=maximum,
            nominal=np.array([self._nominal(port) for port in loop.torn]),
            ring=loop.ring,
        )

    def _nominal(self, port: Port) -> float:
        """Return the size of an input's values: as it tells, or else its source; 1 if neither does."""
        told = (self._plan.variable(one).nominal for one in (port, self._sources[port]))
        return next(filter(None, told), 1.0)

    def _limits(self, loop: Loop) -> tuple[np.ndarray, np.ndarray]:
        """Return the least and the largest value that each place may have for the loop's inputs."""
        size = len(self.recorded["Real"]) + len(self._torn)
        minimum, maximum = np.full(size, -np.inf), np.full(size, np.inf)
        for one in loop.exchanges:
            for port in (Port(one.block, name) for name in one.inputs):
                variable, place = self._plan.variable(port), self._places[port]
                if variable.type == "Real":
                    minimum[place] = max(minimum[place], variable.minimum)
                    maximum[place] = min(maximum[place], variable.maximum)
        return minimum, maximum

    def _of_block(self, name: str, folder: Path) -> BlockJob:
        shown = self._plan.interfaces[name]
        return BlockJob(
            name=name,
            folder=folder,
            identifier=shown.identifier,
            guid=shown.guid,
            variable_step=shown.variable_step,
            can_save=shown.can_save,
            starts=tuple((s.variable.type, s.variable.reference, s.value) for s in self._plan.starts[name]),
        )

    def _logged(self) -> dict[str, list[np.ndarray]]:
        """Return the columns from logs by type."""
        columns: dict[str, list[np.ndarray]] = {}
        for one in self._plan.logged:
            kind = self._plan.variable(one.destination).type
            columns.setdefault(kind, []).append(one.values.astype(DTYPES[kind]))
        return columns

    def _start(self) -> dict[str, np.ndarray]:
        """Return the vectors at the start: torn inputs begin where their blocks do."""
        start = {kind: np.zeros(len(ports), DTYPES[kind]) for kind, ports in self.recorded.items()}
        set_at = {
            Port(b, s.variable.name): s.value for b, all_of in self._plan.starts.items() for s in all_of
        }
        guesses = [float(set_at.get(port, self._plan.variable(port).start or 0.0)) for port in self._torn]
        return start | {"Real": np.concatenate([start["Real"], np.array(guesses, np.float64)])}
