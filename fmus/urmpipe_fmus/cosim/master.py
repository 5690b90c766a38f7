"""The loop of a co-simulation: at t_k = k h inputs are set and outputs read in order, then all do a step.

Every call is prepared once: its arguments stand, and what they point to changes. What is called is noted
before each call, in memory that outlives the process.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.cosim.job import ELSEWHERE, TYPES, ExchangeJob, Job, LoopJob, Progress, called
from urmpipe_fmus.cosim.loops import LoopSolver, NoConvergence
from urmpipe_fmus.cosim.rollback import Exchange, Member, Moved
from urmpipe_fmus.cosim.slave import (
    DISCARD,
    OK,
    PENDING,
    WARNING,
    Call,
    FmuFailed,
    Slave,
    status_name,
)

Prepared = tuple[int, Call]
"""Block and function, and the call itself."""


class Ended(Exception):  # noqa: N818 - no error: an FMU may end the simulation
    """A block ended the simulation."""


class Master:
    """Blocks that are run together.

    Args:
        job: What is run.
        progress: How far it is, shared with the parent.
        recorded: Where it is recorded, each column in its own unit, shape (rows, columns).
        not_finite: Where values are noted that are not finite, zeros as yet, see `NOT_FINITE`, shape (3,
            recorded Reals).
        callbacks: What the FMUs are given: logger and memory.

    Attributes:
        warnings: How often each block's function returned fmi2Warning, by code.
    """

    def __init__(
        self,
        job: Job,
        progress: Progress,
        recorded: NDArray[np.float64],
        not_finite: NDArray[np.float64],
        callbacks: Any,
    ) -> None:
        self._job, self._progress, self._recorded, self._callbacks = job, progress, recorded, callbacks
        self._values = {kind: job.start[kind].copy() for kind in TYPES}
        self._time, self._step, self._exact = (ctypes.c_double(one) for one in (0.0, job.step, job.step))
        self._slaves: list[Slave] = []
        self._members: dict[int, Member] = {}
        self._looped: list[tuple[str, str, Exchange]] = []
        self.warnings: dict[int, int] = {}
        self._columns = self._shares(job)
        self._reals = self._values["Real"][: job.recorded["Real"]]
        self._not_finite = not_finite

    def run(self) -> None:
        """Run the whole job.

        Raises:
            FmuFailed: If an FMU did not do what it was asked.
            NoConvergence: If a loop was not solved.
            Ended: If a block ended the simulation.
        """
        try:
            self._start()
            self._loop()
        except (FmuFailed, NoConvergence):  # what is not finite may be why
            self._look(0)
            raise

    def end(self) -> None:
        """Terminate and free the blocks, as far as their status lets them.

        After fmi2Fatal no instance of that FMU may be called (FMI 2.0.4, section 2.1.3).
        """
        corrupted = {slave.block.folder for slave in self._slaves if slave.fatal}
        for slave in self._slaves:
            if slave.block.folder not in corrupted:
                slave.end()
        self._progress.call = ELSEWHERE

    @property
    def notes(self) -> list[str]:
        """What should be seen of a run: outputs in loops that may be a step late."""
        return [
            f"algebraic loop: {ring}: the outputs of block {name} never followed its inputs: they do not"
            " depend on them, or are those of the step before"
            for name, ring, exchange in self._looped
            if not exchange.followed
        ]

    def _start(self) -> None:
        """Instantiate the blocks, set their start values, and exchange what they start with."""
        for number, block in enumerate(self._job.blocks):
            self._slaves.append(Slave(number, block, self._progress))
        for slave in self._slaves:
            slave.instantiate(self._callbacks)
        for slave in self._slaves:
            self._once(slave, "fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
            if slave.set_start() == WARNING:
                self._warned(self._progress.call)
        for slave in self._slaves:
            self._once(slave, "fmi2EnterInitializationMode")
        self._prepare()
        self._log(0)
        self._run(self._point)
        self._look(0)
        for slave in self._slaves:
            self._once(slave, "fmi2ExitInitializationMode")
            slave.running = True

    def _once(self, slave: Slave, function: str, *arguments: Any) -> None:
        if slave.once(function, *arguments) == WARNING:
            self._warned(self._progress.call)

    def _prepare(self) -> None:
        """Prepare the calls of a communication point and those of a step."""
        in_loops = {e.block for one in self._job.order if isinstance(one, LoopJob) for e in one.exchanges}
        for number in sorted(in_loops):
            if self._slaves[number].block.can_save:
                slave = self._slaves[number]
                self._members[number] = Member(slave, self._time, self._length(slave), self._check)
        self._point: list[Prepared] = []
        for one in self._job.order:
            if isinstance(one, LoopJob):
                self._point.append((ELSEWHERE, self._solver(one).solve))
            else:
                self._point += self._sets(one) + self._gets(one)
        self._steps = [
            slave.stepper(self._time, self._length(slave))
            for slave in self._slaves
            if slave.number not in self._members
        ]

    def _length(self, slave: Slave) -> ctypes.c_double:
        """Return the step of a block: t_k+1 - t_k, which adds up exactly, or one that never changes."""
        return self._exact if slave.block.variable_step else self._step

    def _sets(self, one: ExchangeJob) -> list[Prepared]:
        return [self._slaves[one.block].setter(transfer, self._values) for transfer in one.sets]

    def _gets(self, one: ExchangeJob) -> list[Prepared]:
        return [self._slaves[one.block].getter(transfer, self._values) for transfer in one.gets]

    def _solver(self, loop: LoopJob) -> LoopSolver:
        """Return what solves a loop at a communication point."""
        reals = self._values["Real"]
        read = [t for one in loop.exchanges for t in one.gets if t.type == "Real"]
        moving = {*loop.torn, *(place for t in read for place in t.places)}
        sweeps: list[Callable[[], None]] = []
        for one in loop.exchanges:
            sets, gets = partial(self._run, self._sets(one)), partial(self._run, self._gets(one))
            at = sorted(p for t in one.sets if t.type == "Real" for p in t.places if p in moving)
            places = np.array(at, dtype=np.intp)
            shown = [self._values[t.type][t.places[0] : t.places[-1] + 1] for t in one.gets]
            moved = Moved(reals, places, loop.minimum[places], loop.maximum[places], shown)
            exchange = Exchange(self._members.get(one.block), sets, gets, moved)
            sweeps.append(exchange)
            self._looped.append((self._job.blocks[one.block].name, loop.ring, exchange))
        return LoopSolver(loop, reals, sweeps, self._job.tolerance)

    def _loop(self) -> None:
        """Go through the communication points."""
        job, progress, time, exact = self._job, self._progress, self._time, self._exact
        log = self._log if job.logged else None
        for k in range(job.count + 1):
            progress.k = k
            here = time.value
            if log is not None:
                log(k)
            self._run(self._point)
            self._look(1)
            if k % job.record_every == 0:
                self._record(k // job.record_every)
            if k == job.count:
                break
            if k == 0:
                for _, _, exchange in self._looped:
                    exchange.begin()
            following = (k + 1) * job.step
            exact.value = following - here
            for member in self._members.values():
                member.step()
            self._run(self._steps)
            time.value = following

    def _run(self, calls: Sequence[Prepared]) -> None:
        """Make some calls."""
        progress = self._progress
        for code, call in calls:
            progress.call = code
            status = call()
            if status:
                self._check(code, status)

    def _check(self, code: int, status: int) -> None:
        """Note a warning, and stop at what is worse."""
        if status == WARNING:
            self._warned(code)
            return
        if status == OK:
            return
        block, function = called(code)
        slave = self._slaves[block]
        slave.blame(status)
        if status == DISCARD and function == "fmi2DoStep" and slave.terminated():
            raise Ended(f"block {slave.block.name} ended the simulation at t = {self._time.value:.9g} s")
        said = f"returned {status_name(status)}"
        if status == DISCARD and function == "fmi2DoStep":
            said += f", it cannot step by {self._job.step:g} s from there: a smaller system.step may help"
        if status == PENDING:
            said += ", allowed: steps that are done when the call returns"
        raise FmuFailed(code, said, status)

    def _warned(self, code: int) -> None:
        self.warnings[code] = self.warnings.get(code, 0) + 1

    def _log(self, k: int) -> None:
        """Put the values of logs at a communication point into their places."""
        for kind, values in self._job.logged.items():
            self._values[kind][: values.shape[1]] = values[k]

    def _look(self, points: int) -> None:
        """Note values that are not finite.

        Args:
            points: So many communication points this counts for: none where it is no whole one.
        """
        finite = np.isfinite(self._reals)
        if finite.all():
            return
        value, k, count = self._not_finite
        places = np.flatnonzero(~finite)
        new = places[np.isfinite(value[places])]
        value[new], k[new] = self._reals[new], self._progress.k
        count[places] += points

    @staticmethod
    def _shares(job: Job) -> list[tuple[slice, str]]:
        """Return the columns of each type that has some."""
        shares, first = [], 0
        for kind in TYPES:
            count = job.recorded[kind]
            if count:
                shares.append((slice(first, first + count), kind))
            first += count
        return shares

    def _record(self, row: int) -> None:
        """Record the values as they are."""
        for columns, kind in self._columns:
            self._recorded[row, columns] = self._values[kind][: columns.stop - columns.start]
        self._progress.rows = row + 1
