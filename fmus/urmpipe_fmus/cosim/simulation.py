"""Run of a plan in a separate process (`worker`), and what it recorded.

1. The FMUs are unpacked, and the job is written to the folder of the process, with room for the recording.
2. The process runs; each poll reports the progress and checks that the current call returns (`process`).
3. The recording, the failure and the warnings are read from the folder, also after a crash.
"""

from __future__ import annotations

import ctypes
import json
import math
import mmap
import os
import pickle
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.cosim.job import (
    JOB,
    LOG,
    NO_CALL,
    NOT_FINITE,
    PROGRESS,
    RECORDED,
    RESULT,
    WARNED,
    Job,
    Progress,
    decode_call,
)
from urmpipe_fmus.cosim.plan import JobBuilder, Plan
from urmpipe_fmus.cosim.system import Port
from urmpipe_fmus.fmu_file import open_fmu
from urmpipe_fmus.process import DEFAULT_TIMEOUT, CallWatchdog, FmuProcess
from urmpipe_fmus.python_fmu.place import why_not_in
from urmpipe_models.errors import CosimulationError, escape_line
from urmpipe_models.processes import describe_exit

MAX_OUTPUT_BYTES = 16_000_000  # printed by the FMUs; more is discarded, to protect the disk
MAX_LAST_LINES = 5  # of a block's log, and of the output, in the message of a failure


@dataclass(frozen=True, slots=True)
class NonFiniteValues:
    """Values of a scalar that are not finite.

    Attributes:
        value: The first of them: nan, inf or -inf.
        t: Time of the first in [s].
        count: Number of communication points with such a value, recorded or not.
    """

    value: float
    t: float
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class CosimulationRecord:
    """The result of a co-simulation, until its end or until it failed.

    Attributes:
        t_ns: The recorded communication points in [ns], shape (n,).
        names: Block and variable of each column: every output, every input from a log.
        units: Unit of each column as the FMU spells it; empty if it has none.
        types: Type of each column: Real, Integer or Boolean.
        values: In `units`, shape (n, columns); Integers as they are, Booleans 0 or 1.
        failed: Why it ended early, one line; None if it did not fail.
        notes: Allowed, but worth a look: assumptions, warnings, early ends.
        not_finite: The scalars that had values which are not finite.
        loop_seconds: Duration of the steps in [s], without the preparation before the first; 0 after a crash.
    """

    t_ns: NDArray[np.int64]
    names: tuple[Port, ...]
    units: tuple[str, ...]
    types: tuple[str, ...]
    values: NDArray[np.float64]
    failed: str | None
    notes: tuple[str, ...]
    not_finite: Mapping[Port, NonFiniteValues] = field(default_factory=dict)
    loop_seconds: float = 0.0

    def column(self, block: str, variable: str) -> NDArray[np.float64]:
        """Return the values of a scalar in its unit, shape (n,).

        Raises:
            CosimulationError: If it was not recorded.
        """
        port = Port(block, variable)
        if port not in self.names:
            raise CosimulationError(f"{port}: not recorded; allowed: {', '.join(map(str, self.names))}")
        return self.values[:, self.names.index(port)]


def start_worker() -> FmuProcess:
    """Return the process for one co-simulation, as a context: started early, it loads libraries meanwhile."""
    return FmuProcess(
        "urmpipe_fmus.cosim.worker", prefix="urmpipe-", keep_stdout=True, max_output=MAX_OUTPUT_BYTES
    )


def simulate(
    plan: Plan,
    *,
    timeout: float = DEFAULT_TIMEOUT,
    progress: Callable[[float], None] | None = None,
    worker: FmuProcess | None = None,
) -> CosimulationRecord:
    """Run a system in a separate process, so that an FMU that crashes does not end this one.

    Args:
        plan: The system.
        timeout: Maximum duration of a call of an FMU in [s]: a call that does not return fails.
        progress: Called at each poll with the completed share, 0 to 1.
        worker: The process, if it was started before (`start_worker`). It does one job.

    Returns:
        The recorded values, and the reason if it failed.

    Raises:
        CosimulationError: If there is no room to record, or the run could not be started.
    """
    if worker is None:
        with start_worker() as started:
            return simulate(plan, timeout=timeout, progress=progress, worker=started)
    folder = worker.folder
    builder = JobBuilder(plan)
    job = builder.job(_unpack(plan, folder))
    _write_job(job, folder)
    with (folder / PROGRESS).open("r+b") as file:
        shared = mmap.mmap(file.fileno(), ctypes.sizeof(Progress))
    watchdog = CallWatchdog()

    def watch() -> str:
        state = Progress.from_buffer_copy(shared)
        if progress is not None:
            progress(state.k / job.count)
        return watchdog.overdue(state.call, math.inf if state.code == NO_CALL else timeout)

    try:
        ended = worker.run(watch)
        state = Progress.from_buffer_copy(shared)
    finally:
        shared.close()
    return _Results(job, worker, state).record(plan, builder, ended)


def _unpack(plan: Plan, folder: Path) -> dict[str, Path]:
    """Unpack every FMU once; return the folder of each block's FMU."""
    folders: dict[Path, Path] = {}
    for interface in plan.interfaces.values():
        path = interface.path
        if path not in folders:
            folders[path] = folder / f"fmu{len(folders)}"
            open_fmu(path).unpack(folders[path], skip="sources/")
            if reason := why_not_in(folders[path]):
                raise CosimulationError(f"{path}: {reason}")
            (folders[path] / "resources").mkdir(exist_ok=True)
    return {name: folders[interface.path] for name, interface in plan.interfaces.items()}


def _write_job(job: Job, folder: Path) -> None:
    """Write the job, and allocate the files for its results.

    The recording is allocated in full: a full disk under a memory map would end the process.
    """
    (folder / JOB).write_bytes(pickle.dumps(job))
    (folder / PROGRESS).write_bytes(bytes(Progress(call=NO_CALL)))
    (folder / NOT_FINITE).write_bytes(bytes(8 * 3 * max(job.recorded["Real"], 1)))
    (folder / WARNED).write_bytes(bytes(8 * 2 * job.calls))
    size = 8 * job.rows * max(job.columns, 1)
    try:
        with (folder / RECORDED).open("wb") as file:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, size)
            else:
                file.truncate(size)
    except OSError as error:
        raise CosimulationError(
            f"found no room for {size / 1e6:.0f} MB of {job.rows} samples in {folder.parent}; a larger"
            " system.record_every records fewer"
        ) from error


class _Results:
    """The files that a run left in the folder of its process."""

    def __init__(self, job: Job, worker: FmuProcess, state: Progress) -> None:
        self._job, self._worker, self._folder, self._state = job, worker, worker.folder, state
        logs = (self._folder / LOG).with_suffix(".before"), self._folder / LOG
        lines = "".join(log.read_text(encoding="utf-8") for log in logs if log.exists()).splitlines()
        rows = (line.split("\t", 2) for line in lines)
        self._log = [(row[0], row[1], row[2]) for row in rows if len(row) == 3]  # block, status, text

    def record(self, plan: Plan, builder: JobBuilder, ended: str) -> CosimulationRecord:
        """Return the record of a run whose process ended in some way."""
        job, state = self._job, self._state
        values = np.fromfile(self._folder / RECORDED, np.float64, state.rows * job.columns)
        values = values.reshape(state.rows, job.columns)
        columns = {port: i for i, port in enumerate(builder.ports)}
        ports = (Port(block, name) for block, shown in plan.interfaces.items() for name in shown.variables)
        names = tuple(port for port in ports if port in columns)
        path = self._folder / RESULT
        result = json.loads(path.read_text(encoding="utf-8")) if path.exists() else None
        failed = self._failure(result) if result else None
        if failed is None and (ended or not state.done):
            failed = self._crash(ended or describe_exit(0))
        times = np.arange(state.rows) * job.record_every * job.step
        if state.ended:
            times[-1] = state.ended
        return CosimulationRecord(
            t_ns=np.round(times * 1e9).astype(np.int64),
            names=names,
            units=tuple(plan.variable(port).unit for port in names),
            types=tuple(plan.variable(port).type for port in names),
            values=values[:, [columns[port] for port in names]],
            failed=failed,
            notes=(*plan.notes, *(result["notes"] if result else ()), *self._warnings()),
            not_finite=self._not_finite(builder.recorded["Real"]),
            loop_seconds=state.loop_seconds,
        )

    def _not_finite(self, ports: Sequence[Port]) -> dict[Port, NonFiniteValues]:
        table = np.fromfile(self._folder / NOT_FINITE, np.float64, 3 * len(ports)).reshape(3, -1)
        return {
            port: NonFiniteValues(float(value), float(k) * self._job.step, max(int(count), 1))
            for port, (value, k, count) in zip(ports, table.T, strict=True)
            if not math.isfinite(value)
        }

    def _failure(self, result: Mapping[str, Any]) -> str | None:
        """Return the failure that the worker reported; None if it reported none."""
        if result["failed"] is None:
            return None
        if result["code"] == NO_CALL:
            return escape_line(f"{result['failed']}, at t = {self._state.k * self._job.step:.9g} s")
        return self._block_failure(result["code"], result["failed"])

    def _crash(self, ended: str) -> str:
        """Return the failure of a process that ended before its job was done."""
        if self._state.code == NO_CALL:
            lines = self._worker.last_lines(MAX_LAST_LINES)
            return escape_line(f"the process of the co-simulation {ended}{_quote(lines)}")
        return self._block_failure(self._state.code, ended)

    def _block_failure(self, code: int, failure: str) -> str:
        """Return a failure of a block: block, call, time, failure, and its last lines."""
        number, function = decode_call(code)
        name = self._job.blocks[number].name
        lines = [f"{status}: {text}" for block, status, text in self._log if block == name]
        words = _quote([*lines[-MAX_LAST_LINES:], *self._worker.last_lines(MAX_LAST_LINES)])
        t = self._state.k * self._job.step
        return escape_line(f"block {name}: {function} at t = {t:.9g} s: {failure}{words}")

    def _warnings(self) -> Iterator[str]:
        """Yield the calls that returned fmi2Warning."""
        counts, first = np.fromfile(self._folder / WARNED, np.float64).reshape(2, -1)
        for code in np.flatnonzero(counts).tolist():
            number, function = decode_call(code)
            name = self._job.blocks[number].name
            lines = [text for block, status, text in self._log if block == name and status == "fmi2Warning"]
            last = f", the last: {lines[-1]}" if lines else ""
            times = f"{counts[code]:.0f} times, first" if counts[code] > 1 else "once,"
            when = f"at t = {first[code] * self._job.step:.9g} s"
            yield escape_line(f"block {name}: {function} returned fmi2Warning {times} {when}{last}")


def _quote(lines: list[str]) -> str:
    return f"; its last lines: {' | '.join(lines)}" if lines else "; it logged nothing"
