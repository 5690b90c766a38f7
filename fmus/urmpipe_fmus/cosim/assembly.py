"""A plan turned into a job: every scalar gets its place in the vector of its type."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from urmpipe_fmus.cosim.job import TYPES, BlockJob, ExchangeJob, Job, LoopJob, Transfer
from urmpipe_fmus.cosim.order import Exchange, Loop
from urmpipe_fmus.cosim.plan import Plan
from urmpipe_fmus.cosim.system import Port

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
