"""The loop of a co-simulation over its communication points, and the solution of algebraic loops.

**Master.** At t_k = k h, k = 0 .. count, inputs are set and outputs are read in the order of the plan
(`order`); then all blocks step to t_k+1. Every call is prepared once (`slave`) and noted before it is made,
in memory that outlives the process. A block may end the simulation in a step: what it reached is recorded.

**Algebraic loops.** A sweep through a loop gives g(x), the sources of the torn inputs if these are x.
Newton's method solves r(x) = g(x) - x = 0. The Jacobian of r is found by differences and kept, from
iteration to iteration and from point to point, with Broyden's update

    J <- J + (r_new - r - J s) s^T / (s^T s)    for a step s,

and found again if the residual falls too slowly. Steps are clipped to the range of the inputs, and halved
if the residual rises or is not finite.

Source: [Broyden1965]_.
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
    NO_CALL,
    TYPES,
    ExchangeJob,
    Job,
    LoopJob,
    Progress,
    decode_call,
    encode_call,
    next_call,
)
from urmpipe_fmus.cosim.slave import (
    Call,
    FmuCallError,
    LoopExchange,
    LoopMember,
    LoopVariables,
    Slave,
    status_name,
)
from urmpipe_fmus.process import DISCARD, OK, PENDING, WARNING
from urmpipe_models.elementwise import FloatArray

MAX_ITERATIONS = 50  # Newton's method needs a handful
DIFFERENCE = 1e-7  # relative step of the differences: about the root of the precision of a double
MAX_STEP_HALVINGS = 6  # of a step that makes the residual larger
MAX_FINITE_HALVINGS = 40  # of a step to where values are not finite
MAX_RESIDUAL_RATIO = 0.25  # residual after / before a step; above it the Jacobian is found again
TIME_TOLERANCE = 1e-9  # s; times that differ by no more are equal: rows are recorded in whole ns

PreparedCall = tuple[int, Call]  # code of the call, and the call


class ConvergenceError(Exception):
    """An algebraic loop was not solved."""


class SimulationTerminated(Exception):  # noqa: N818 - no error: an FMU may end the simulation
    """A block ended the simulation.

    Attributes:
        block: Its number.
        t: The time in [s] that it reached; nan if it does not state it.
    """

    def __init__(self, block: int, t: float) -> None:
        super().__init__(block, t)
        self.block, self.t = block, t


class Master:
    """Blocks that run together.

    Args:
        job: The run.
        progress: Its progress, shared with the parent.
        recorded: Recorded values, each column in its own unit, shape (rows, columns).
        not_finite: Values that are not finite, initially zeros, see `job.NOT_FINITE`, shape (3, recorded
            Reals).
        warned: Calls that returned fmi2Warning, initially zeros, see `job.WARNED`, shape (2, codes of calls).
        callbacks: Logger and memory for the FMUs.
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
        self._end_notes: list[str] = []
        self._values = {kind: job.start[kind].copy() for kind in TYPES}
        self._time, self._step, self._exact_step = map(ctypes.c_double, (0.0, job.step, job.step))
        self._slaves: list[Slave] = []
        self._members: dict[int, LoopMember] = {}
        self._loop_exchanges: list[tuple[str, str, LoopExchange]] = []  # block, ring, exchange
        loops = [item for item in job.order if isinstance(item, LoopJob)]
        self._loop_blocks = {exchange.block for loop in loops for exchange in loop.exchanges}
        ends = np.cumsum([job.recorded[kind] for kind in TYPES]).tolist()
        self._columns = [
            (slice(end - job.recorded[kind], end), kind)
            for kind, end in zip(TYPES, ends, strict=True)
            if job.recorded[kind]
        ]
        self._reals = self._values["Real"][: job.recorded["Real"]]
        self._not_finite, self._warnings = not_finite, warned

    def run(self) -> None:
        """Run the job.

        Raises:
            FmuCallError: If a call of an FMU failed.
            ConvergenceError: If a loop was not solved.
        """
        try:
            self._start()
            started = perf_counter()
            try:
                self._loop()
            finally:
                self._progress.loop_seconds = perf_counter() - started
        except SimulationTerminated as end:  # while a step of a loop is repeated
            self._note_end(end, self._time.value, self._time.value)
        except (FmuCallError, ConvergenceError):  # values that are not finite may be the reason
            self._check_finite(0)
            raise

    def end(self) -> None:
        """Terminate and free the blocks whose status allows it.

        After fmi2Fatal no instance of that FMU may be called (FMI 2.0.4, section 2.1.3).
        """
        fatal = {slave.block.folder for slave in self._slaves if slave.fatal}
        for slave in self._slaves:
            if slave.block.folder not in fatal:
                slave.end()
        self._progress.begin(NO_CALL)

    @property
    def notes(self) -> list[str]:
        """Which blocks ended the run, and outputs in loops that may be those of the step before."""
        return self._end_notes + [
            f"algebraic loop: {ring}: the outputs of block {name} never followed its inputs: they do not"
            " depend on them, or are those of the step before"
            for name, ring, exchange in self._loop_exchanges
            if not exchange.followed
        ]

    def _start(self) -> None:
        """Instantiate the blocks, set their start values, and exchange the initial values."""
        for number, block in enumerate(self._job.blocks):
            self._slaves.append(Slave(number, block, self._progress, self._note_warning))
        for slave in self._slaves:
            slave.instantiate(self._callbacks)
        for slave in self._slaves:
            slave.once("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
            slave.set_start()
        for slave in self._slaves:
            slave.once("fmi2EnterInitializationMode")
        self._prepare()
        self._set_logged(0)
        self._run(self._point)
        self._check_finite(0)
        for slave in self._slaves:
            slave.once("fmi2ExitInitializationMode")
            slave.running = True

    def _prepare(self) -> None:
        """Prepare the calls of a communication point and those of a step."""
        for number in sorted(self._loop_blocks):
            if self._slaves[number].block.can_save:
                slave = self._slaves[number]
                self._members[number] = LoopMember(slave, self._time, self._step_of(slave), self._check)
        self._point: list[PreparedCall] = []
        for item in self._job.order:
            if isinstance(item, LoopJob):
                self._point.append((NO_CALL, self._solver(item).solve))
            else:
                self._point += self._sets(item) + self._gets(item)
        self._steps = [
            (encode_call(number, "fmi2DoStep"), member.step) for number, member in self._members.items()
        ] + [
            slave.stepper(self._time, self._step_of(slave))
            for slave in self._slaves
            if slave.number not in self._members
        ]

    def _step_of(self, slave: Slave) -> ctypes.c_double:
        """Return the step of a block: t_k+1 - t_k, which adds up exactly, or a constant."""
        return self._exact_step if slave.block.variable_step else self._step

    def _sets(self, exchange: ExchangeJob) -> list[PreparedCall]:
        return [self._slaves[exchange.block].setter(transfer, self._values) for transfer in exchange.sets]

    def _gets(self, exchange: ExchangeJob) -> list[PreparedCall]:
        return [self._slaves[exchange.block].getter(transfer, self._values) for transfer in exchange.gets]

    def _solver(self, loop: LoopJob) -> LoopSolver:
        """Return the solver of a loop at a communication point."""
        reals = self._values["Real"]
        loop_places = {*loop.torn, *_real_outputs(loop)}
        sweep: list[Callable[[], None]] = []
        for job in loop.exchanges:
            sets, gets = partial(self._run, self._sets(job)), partial(self._run, self._gets(job))
            set_places = (place for t in job.sets if t.type == "Real" for place in t.places)
            places = np.array(sorted(place for place in set_places if place in loop_places), dtype=np.intp)
            outputs = [self._values[t.type][t.places[0] : t.places[-1] + 1] for t in job.gets]
            variables = LoopVariables(reals, places, loop.minimum[places], loop.maximum[places], outputs)
            exchange = LoopExchange(self._members.get(job.block), sets, gets, variables)
            sweep.append(exchange)
            self._loop_exchanges.append((self._job.blocks[job.block].name, loop.ring, exchange))
        return LoopSolver(loop, reals, sweep, self._job.tolerance)

    def _loop(self) -> None:
        """Loop over the communication points."""
        job, progress, time, exact_step = self._job, self._progress, self._time, self._exact_step
        set_logged = self._set_logged if job.logged else None
        for k in range(job.count + 1):
            progress.k = k
            now = time.value
            if set_logged is not None:
                set_logged(k)
            self._run(self._point)
            self._check_finite(1)
            if k % job.record_every == 0:
                self._record(k // job.record_every)
            if k == job.count:
                break
            if k == 0:
                for _, _, exchange in self._loop_exchanges:
                    exchange.reset()
            following = (k + 1) * job.step
            exact_step.value = following - now
            ends = self._step_all(following)
            if ends:
                self._finish(ends, now, following)
                break
            time.value = following

    def _step_all(self, following: float) -> list[SimulationTerminated]:
        """Do the step of all blocks to a time in [s]; return which of them ended the simulation.

        After the first, the other blocks step only if it reached that time.
        """
        ends: list[SimulationTerminated] = []
        steps = self._steps
        while steps:
            try:
                self._run(steps)
                break
            except SimulationTerminated as end:
                ends.append(end)
                if not _same_time(end.t, following):
                    break
                stopped = next(i for i, (code, _) in enumerate(steps) if decode_call(code)[0] == end.block)
                steps = steps[stopped + 1 :]
        return ends

    def _finish(self, ends: Sequence[SimulationTerminated], now: float, following: float) -> None:
        """Record once more after blocks ended the simulation, in a step from and to times in [s].

        At the next communication point all blocks exchange their values, but nothing is set in those that
        ended: after a discarded step that is not allowed (FMI 2.0.4, section 4.2.4). At an earlier time, and
        for a block in a loop, whose inputs would have to be set, only the outputs of the block are read.
        """
        for end in ends:
            self._note_end(end, now, following)
        ended_blocks, last = {end.block for end in ends}, ends[-1].t
        if not now + TIME_TOLERANCE < last <= following + TIME_TOLERANCE:
            return
        if all(_same_time(end.t, following) for end in ends) and not ended_blocks & self._loop_blocks:
            last = self._time.value = following
            self._progress.k += 1
            self._set_logged(self._progress.k)
            self._run([call for call in self._point if not _is_set_call(call, ended_blocks)])
            self._check_finite(1)
        else:
            self._run(self._read_calls(ends[-1].block))
            self._check_finite(0)
            if len(self._slaves) > 1:
                self._end_notes.append(
                    f"at t = {last:.9g} s the other blocks have their values of t = {now:.9g} s"
                )
        self._progress.ended = last
        self._record(self._progress.rows)

    def _note_end(self, end: SimulationTerminated, now: float, following: float) -> None:
        """Note that a block ended the simulation, in a step from and to times in [s]."""
        t = end.t if now <= end.t <= following + TIME_TOLERANCE else now
        name = self._slaves[end.block].block.name
        self._end_notes.append(f"block {name} ended the simulation at t = {t:.9g} s")

    def _read_calls(self, block: int) -> list[PreparedCall]:
        """Return the calls that read all outputs of a block."""
        items = (item.exchanges if isinstance(item, LoopJob) else (item,) for item in self._job.order)
        return [
            call
            for exchanges in items
            for exchange in exchanges
            if exchange.block == block
            for call in self._gets(exchange)
        ]

    def _run(self, calls: Sequence[PreparedCall]) -> None:
        """Make calls in order."""
        progress = self._progress
        for code, call in calls:
            progress.call = code + next_call()
            status = call()
            if status:
                self._check(code, status)

    def _check(self, code: int, status: int) -> None:
        """Note a warning; raise an error for a worse status."""
        if status == WARNING:
            self._note_warning(code)
            return
        if status == OK:
            return
        block, function = decode_call(code)
        slave = self._slaves[block]
        slave.update_allowed_calls(status)
        if status == DISCARD and function == "fmi2DoStep" and slave.is_terminated():
            raise SimulationTerminated(block, slave.last_successful_time())
        message = f"returned {status_name(status)}"
        if status == DISCARD and function == "fmi2DoStep":
            message += f", it cannot step by {self._job.step:g} s from there: a smaller system.step may help"
        if status == PENDING:
            message += ", allowed: steps that are done when the call returns"
        raise FmuCallError(code, message, status)

    def _note_warning(self, code: int) -> None:
        """Note that a call returned fmi2Warning."""
        count, first = self._warnings
        if not count[code]:
            first[code] = self._progress.k
        count[code] += 1

    def _set_logged(self, k: int) -> None:
        """Set the values of logs at a communication point."""
        for kind, values in self._job.logged.items():
            self._values[kind][: values.shape[1]] = values[k]

    def _check_finite(self, points: int) -> None:
        """Note values that are not finite.

        Args:
            points: Number of communication points that this counts for; 0 between two of them.
        """
        finite = np.isfinite(self._reals)
        if finite.all():
            return
        value, k, count = self._not_finite
        places = np.flatnonzero(~finite)
        new = places[np.isfinite(value[places])]
        value[new], k[new] = self._reals[new], self._progress.k
        count[places] += points

    def _record(self, row: int) -> None:
        """Record the current values."""
        for columns, kind in self._columns:
            self._recorded[row, columns] = self._values[kind][: columns.stop - columns.start]
        self._progress.rows = row + 1


def _same_time(t: float, other: float) -> bool:
    return abs(t - other) <= TIME_TOLERANCE


def _is_set_call(prepared: PreparedCall, blocks: Collection[int]) -> bool:
    """Return whether a call sets a value of one of some blocks."""
    block, function = decode_call(prepared[0])
    return block in blocks and function.startswith("fmi2Set")


def _real_outputs(loop: LoopJob) -> list[int]:
    """Return the places of the Reals that a sweep reads, in order."""
    transfers = (transfer for exchange in loop.exchanges for transfer in exchange.gets)
    return [place for transfer in transfers if transfer.type == "Real" for place in transfer.places]


class LoopSolver:
    """Solver of an algebraic loop.

    Args:
        loop: The loop.
        values: The vector of the Reals, each in its own unit, shape (reals,).
        sweep: The exchanges of a sweep.
        tolerance: Allowed residual, relative to nominal + |x|.
    """

    def __init__(
        self, loop: LoopJob, values: FloatArray, sweep: Sequence[Callable[[], None]], tolerance: float
    ) -> None:
        self._loop, self._values, self._sweep, self._tolerance = loop, values, sweep, tolerance
        self._torn, self._sources = np.array(loop.torn, np.intp), np.array(loop.sources, np.intp)
        self._outputs = np.array(_real_outputs(loop), np.intp)
        self._minimum, self._maximum = loop.minimum[self._torn], loop.maximum[self._torn]
        self._jacobian: FloatArray | None = None

    def solve(self) -> int:
        """Solve the loop, so that its values are those of the solution; return FMI's status OK.

        Raises:
            ConvergenceError: If it is not solved.
        """
        x = self._values[self._torn].copy()
        r = self._residual(x)
        for _ in range(MAX_ITERATIONS):
            if self._is_solved(x, r):
                return OK
            fresh = self._jacobian is None
            if self._jacobian is None:
                self._jacobian = self._differences(x, r)
            if not (np.isfinite(r).all() and np.isfinite(self._jacobian).all()):
                raise ConvergenceError(
                    f"algebraic loop: {self._loop.ring}: found values that are not finite; start values of"
                    " its inputs, nearer to the solution, may help"
                )
            newton = -np.linalg.lstsq(self._jacobian, r, rcond=None)[0].astype(np.float64)
            x_new, r_new = self._line_search(x, r, newton)
            step = x_new - x
            if _norm(r_new) > MAX_RESIDUAL_RATIO * _norm(r) and not (fresh and _norm(r_new) < _norm(r)):
                self._jacobian = None
            elif step.any():
                self._jacobian = self._jacobian + np.outer(r_new - r - self._jacobian @ step, step) / (
                    step @ step
                )
            x, r = x_new, r_new
        if self._is_solved(x, r):
            return OK
        raise ConvergenceError(
            f"algebraic loop: {self._loop.ring}: not solved after {MAX_ITERATIONS} iterations, found a"
            f" residual of {np.max(np.abs(r)):.3g}, allowed: {self._tolerance:.3g} relative to its values"
        )

    def _residual(self, x: FloatArray) -> FloatArray:
        """Return g(x) - x; nan if a value of the sweep is not finite."""
        self._values[self._torn] = x
        for exchange in self._sweep:
            exchange()
            if not np.isfinite(self._values[self._outputs]).all():
                self._values[self._outputs] = 0.0  # all are read again by the next sweep
                return np.full_like(x, np.nan)  # no block is given a value that is not finite
        return self._values[self._sources] - x

    def _is_solved(self, x: FloatArray, r: FloatArray) -> bool:
        return bool(np.all(np.abs(r) <= self._tolerance * (self._loop.nominal + np.abs(x))))

    def _differences(self, x: FloatArray, r: FloatArray) -> FloatArray:
        """Return the Jacobian of the residual by differences within the range of the inputs.

        A column is not finite if the residual is finite on neither side.
        """
        columns = []
        for i in range(len(x)):
            column = np.full_like(r, np.nan)
            h = DIFFERENCE * (self._loop.nominal[i] + abs(x[i]))
            for x_i in (x[i] + h, x[i] - h):
                if self._minimum[i] <= x_i <= self._maximum[i] and not np.isfinite(column).all():
                    moved = x.copy()
                    moved[i] = x_i
                    column = (self._residual(moved) - r) / (moved[i] - x[i])
            columns.append(column)
        return np.column_stack(columns)

    def _line_search(self, x: FloatArray, r: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return a point along a step within the range of the inputs, and its residual."""
        for halvings in range(MAX_FINITE_HALVINGS):
            x_new = np.clip(x + step, self._minimum, self._maximum)
            r_new = self._residual(x_new)
            if np.isfinite(r_new).all() and (_norm(r_new) < _norm(r) or halvings >= MAX_STEP_HALVINGS - 1):
                break
            step = 0.5 * step
        return x_new, r_new


def _norm(r: FloatArray) -> float:
    return float(np.linalg.norm(r))
