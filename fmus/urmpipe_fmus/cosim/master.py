"""Algebraic loops at a communication point: the torn inputs are found by Newton's method.

A sweep gives g(x), what the sources of the torn inputs are if these are x. x is sought with r = g(x) - x = 0.
The Jacobian of r is found by differences and kept, from iteration to iteration and from point to point, with
Broyden's update; it is found anew where it no longer serves.

Source: [Broyden1965]_.

The loop of a co-simulation: at t_k = k h inputs are set and outputs read in order, then all do a step.

Every call is prepared once: its arguments stand, and what they point to changes. What is called is noted
before each call, in memory that outlives the process.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Collection, Sequence
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.cosim.job import (
    ELSEWHERE,
    TYPES,
    ExchangeJob,
    Job,
    LoopJob,
    Progress,
    call_code,
    called,
    next_call,
)
from urmpipe_fmus.cosim.slave import (
    DISCARD,
    OK,
    PENDING,
    WARNING,
    Call,
    Exchange,
    FmuFailed,
    Member,
    Moved,
    Slave,
    status_name,
)
from urmpipe_models.elementwise import FloatArray

ITERATIONS = 50
"""Newton's method needs a handful; what is not solved by then does not converge."""

DIFFERENCE = 1e-7
"""Relative step of the differences: about the root of the precision of a double."""

SHRINKS = 6
"""A step that makes the residual larger is halved so often at most."""

DEEPEST = 40
"""A step to where the values are not finite is halved until they are, but not more often."""

USEFUL = 0.25
"""A step that leaves more of the residual than this is a reason to find the Jacobian anew."""


class NoConvergence(Exception):  # noqa: N818 - it ends the run, and is told as a result
    """A loop was not solved."""


class LoopSolver:
    """Solves a loop.

    Args:
        loop: The loop.
        values: The vector of the Reals, each in its own unit, shape (reals,).
        sweeps: The exchanges of a sweep.
        tolerance: What may be left of the residual, relative to nominal + |x|.
    """

    def __init__(
        self, loop: LoopJob, values: FloatArray, sweeps: Sequence[Callable[[], None]], tolerance: float
    ) -> None:
        self._loop, self._values, self._sweeps, self._tolerance = loop, values, sweeps, tolerance
        self._torn, self._sources = np.array(loop.torn, np.intp), np.array(loop.sources, np.intp)
        read = [p for one in loop.exchanges for t in one.gets if t.type == "Real" for p in t.places]
        self._read = np.array(read, np.intp)
        self._minimum, self._maximum = loop.minimum[self._torn], loop.maximum[self._torn]
        self._jacobian: FloatArray | None = None

    def solve(self) -> int:
        """Solve the loop: afterwards all its exchanges are those of the solution. Returns FMI's status OK.

        Raises:
            NoConvergence: If it cannot.
        """
        x = self._values[self._torn].copy()
        r = self._residual(x)
        for _ in range(ITERATIONS):
            if self._solved(x, r):
                return 0
            fresh = self._jacobian is None
            if self._jacobian is None:
                self._jacobian = self._differences(x, r)
            if not (np.isfinite(r).all() and np.isfinite(self._jacobian).all()):
                raise NoConvergence(
                    f"algebraic loop: {self._loop.ring}: found values that are not finite; start values of"
                    " its inputs, nearer to the solution, may help"
                )
            newton = -np.linalg.lstsq(self._jacobian, r, rcond=None)[0].astype(np.float64)
            following, left = self._line(x, r, newton)
            step = following - x
            if _size(left) > USEFUL * _size(r) and not (fresh and _size(left) < _size(r)):
                self._jacobian = None
            elif step.any():
                self._jacobian = self._jacobian + np.outer(left - r - self._jacobian @ step, step) / (
                    step @ step
                )
            x, r = following, left
        if self._solved(x, r):
            return 0
        raise NoConvergence(
            f"algebraic loop: {self._loop.ring}: not solved after {ITERATIONS} iterations, found a residual"
            f" of {np.max(np.abs(r)):.3g}, allowed: {self._tolerance:.3g} relative to its values"
        )

    def _residual(self, x: FloatArray) -> FloatArray:
        """Return g(x) - x."""
        self._values[self._torn] = x
        for sweep in self._sweeps:
            sweep()
            if not np.isfinite(self._values[self._read]).all():
                self._values[self._read] = 0.0  # all are read again by the next sweep
                return np.full_like(x, np.nan)  # no block of the sweep is given what is not finite
        return self._values[self._sources] - x

    def _solved(self, x: FloatArray, r: FloatArray) -> bool:
        return bool(np.all(np.abs(r) <= self._tolerance * (self._loop.nominal + np.abs(x))))

    def _differences(self, x: FloatArray, r: FloatArray) -> FloatArray:
        """Return the Jacobian of the residual by differences, to the side where the inputs may be."""
        return np.column_stack([self._column(i, x, r) for i in range(len(x))])

    def _column(self, i: int, x: FloatArray, r: FloatArray) -> FloatArray:
        """Return a column of the Jacobian; not finite if it is on neither side."""
        column = np.full_like(r, np.nan)
        h = DIFFERENCE * (self._loop.nominal[i] + abs(x[i]))
        for each in (x[i] + h, x[i] - h):
            moved = x.copy()
            moved[i] = each
            if self._minimum[i] <= each <= self._maximum[i] and not np.isfinite(column).all():
                column = (self._residual(moved) - r) / (moved[i] - x[i])
        return column

    def _line(self, x: FloatArray, r: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return a point along a step, in the range of the inputs, that leaves less, and what it leaves."""
        for halved in range(DEEPEST):
            following = np.clip(x + step, self._minimum, self._maximum)
            left = self._residual(following)
            if np.isfinite(left).all() and (_size(left) < _size(r) or halved >= SHRINKS - 1):
                break
            step = 0.5 * step
        return following, left


def _size(r: FloatArray) -> float:
    return float(np.linalg.norm(r))


Prepared = tuple[int, Call]
"""Block and function, and the call itself."""

NANOSECOND = 1e-9
"""Times in [s] that differ by no more are one: rows are recorded by whole nanoseconds."""


class Ended(Exception):  # noqa: N818 - no error: an FMU may end the simulation
    """A block ended the simulation.

    Attributes:
        block: Its number.
        t: How far it came in [s]; nan if it does not tell.
    """

    def __init__(self, block: int, t: float) -> None:
        super().__init__(block, t)
        self.block, self.t = block, t


class Master:
    """Blocks that are run together.

    Args:
        job: What is run.
        progress: How far it is, shared with the parent.
        recorded: Where it is recorded, each column in its own unit, shape (rows, columns).
        not_finite: Where values are noted that are not finite, zeros as yet, see `NOT_FINITE`, shape (3,
            recorded Reals).
        warned: Where each fmi2Warning is noted, zeros as yet, see `WARNED`, shape (2, codes of calls).
        callbacks: What the FMUs are given: logger and memory.
    """

    def __init__(
        self,
        job: Job,
        progress: Progress,
        recorded: NDArray[np.float64],
        not_finite: NDArray[np.float64],
        warned: NDArray[np.float64],
        callbacks: Any,
    ) -> None:
        self._job, self._progress, self._recorded, self._callbacks = job, progress, recorded, callbacks
        self._ends: list[str] = []
        self._values = {kind: job.start[kind].copy() for kind in TYPES}
        self._time, self._step, self._exact = (ctypes.c_double(one) for one in (0.0, job.step, job.step))
        self._slaves: list[Slave] = []
        self._members: dict[int, Member] = {}
        self._looped: list[tuple[str, str, Exchange]] = []
        self._columns = self._shares(job)
        self._reals = self._values["Real"][: job.recorded["Real"]]
        self._not_finite, self._warnings = not_finite, warned

    def run(self) -> None:
        """Run the whole job.

        Raises:
            FmuFailed: If an FMU did not do what it was asked.
            NoConvergence: If a loop was not solved.
        """
        try:
            self._start()
            started = perf_counter()
            try:
                self._loop()
            finally:
                self._progress.loop_seconds = perf_counter() - started
        except Ended as ended:  # while a step of a loop is done again
            self._note_end(ended, self._time.value, self._time.value)
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
        self._progress.begin(ELSEWHERE)

    @property
    def notes(self) -> list[str]:
        """What should be seen of a run: that a block ended it, outputs in loops that may be a step late."""
        return self._ends + [
            f"algebraic loop: {ring}: the outputs of block {name} never followed its inputs: they do not"
            " depend on them, or are those of the step before"
            for name, ring, exchange in self._looped
            if not exchange.followed
        ]

    def _start(self) -> None:
        """Instantiate the blocks, set their start values, and exchange what they start with."""
        for number, block in enumerate(self._job.blocks):
            self._slaves.append(Slave(number, block, self._progress, self._warned))
        for slave in self._slaves:
            slave.instantiate(self._callbacks)
        for slave in self._slaves:
            slave.once("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
            slave.set_start()
        for slave in self._slaves:
            slave.once("fmi2EnterInitializationMode")
        self._prepare()
        self._log(0)
        self._run(self._point)
        self._look(0)
        for slave in self._slaves:
            slave.once("fmi2ExitInitializationMode")
            slave.running = True

    def _prepare(self) -> None:
        """Prepare the calls of a communication point and those of a step."""
        for number in sorted(self._in_loops()):
            if self._slaves[number].block.can_save:
                slave = self._slaves[number]
                self._members[number] = Member(slave, self._time, self._length(slave), self._check)
        self._point: list[Prepared] = []
        for one in self._job.order:
            if isinstance(one, LoopJob):
                self._point.append((ELSEWHERE, self._solver(one).solve))
            else:
                self._point += self._sets(one) + self._gets(one)
        self._steps = [(call_code(n, "fmi2DoStep"), one.step) for n, one in self._members.items()] + [
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
            ended = self._step_all(following)
            if ended:
                self._finish(ended, here, following)
                break
            time.value = following

    def _step_all(self, following: float) -> list[Ended]:
        """Do the step of all blocks; return which of them ended the simulation.

        Once one did, the others step only where it came to the next communication point, at a time in [s].
        """
        ended: list[Ended] = []
        left = self._steps
        while left:
            try:
                self._run(left)
                break
            except Ended as one:
                ended.append(one)
                if not _same(one.t, following):
                    break
                left = left[1 + next(i for i, (code, _) in enumerate(left) if called(code)[0] == one.block) :]
        return ended

    def _finish(self, ended: Sequence[Ended], here: float, following: float) -> None:
        """Record once more where blocks ended the simulation, in a step from and to times in [s].

        At the next communication point all blocks exchange their values, but nothing is set in those that
        ended: after a discarded step that is not allowed (FMI 2.0.4, section 4.2.4). At a time before, and
        for a block in a loop, which would have to be set, the outputs of the block alone are read.
        """
        for one in ended:
            self._note_end(one, here, following)
        over, last = {one.block for one in ended}, ended[-1].t
        if not here + NANOSECOND < last <= following + NANOSECOND:
            return
        if all(_same(one.t, following) for one in ended) and not over & self._in_loops():
            last = self._time.value = following
            self._progress.k += 1
            self._log(self._progress.k)
            self._run([one for one in self._point if not _sets(one, over)])
            self._look(1)
        else:
            self._run(self._reads(ended[-1].block))
            self._look(0)
            if len(self._slaves) > 1:
                self._ends.append(
                    f"at t = {last:.9g} s the other blocks have their values of t = {here:.9g} s"
                )
        self._progress.ended = last
        self._record(self._progress.rows)

    def _note_end(self, ended: Ended, here: float, following: float) -> None:
        """Note that a block ended the simulation, in a step from and to times in [s]."""
        t = ended.t if here <= ended.t <= following + NANOSECOND else here
        name = self._slaves[ended.block].block.name
        self._ends.append(f"block {name} ended the simulation at t = {t:.9g} s")

    def _in_loops(self) -> set[int]:
        """Return the blocks in algebraic loops."""
        return {e.block for one in self._job.order if isinstance(one, LoopJob) for e in one.exchanges}

    def _reads(self, block: int) -> list[Prepared]:
        """Return the calls that read all outputs of a block."""
        exchanges = [e for o in self._job.order for e in (o.exchanges if isinstance(o, LoopJob) else (o,))]
        return [call for one in exchanges if one.block == block for call in self._gets(one)]

    def _run(self, calls: Sequence[Prepared]) -> None:
        """Make some calls."""
        progress = self._progress
        for code, call in calls:
            progress.call = code + next_call()
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
            raise Ended(block, slave.last_successful_time())
        said = f"returned {status_name(status)}"
        if status == DISCARD and function == "fmi2DoStep":
            said += f", it cannot step by {self._job.step:g} s from there: a smaller system.step may help"
        if status == PENDING:
            said += ", allowed: steps that are done when the call returns"
        raise FmuFailed(code, said, status)

    def _warned(self, code: int) -> None:
        """Note that a call returned fmi2Warning."""
        count, first = self._warnings
        if not count[code]:
            first[code] = self._progress.k
        count[code] += 1

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


def _same(one: float, other: float) -> bool:
    """Return whether two times in [s] are one."""
    return abs(one - other) <= NANOSECOND


def _sets(prepared: Prepared, blocks: Collection[int]) -> bool:
    """Return whether a call sets a value of some blocks."""
    code, _ = prepared
    block, function = called(code)
    return block in blocks and function.startswith("fmi2Set")
