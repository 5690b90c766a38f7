"""The process that runs the FMUs, from the parent's side: started early, given one job, waited for.

A plan run in a process of its own, and what it recorded.
"""

from __future__ import annotations

import ctypes
import json
import math
import mmap
import os
import pickle
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.cosim.job import (
    ELSEWHERE,
    JOB,
    LOG,
    NOT_FINITE,
    PROGRESS,
    RECORDED,
    RESULT,
    SAID,
    WARNED,
    Job,
    Progress,
    called,
)
from urmpipe_fmus.cosim.plan import Assembly, Plan
from urmpipe_fmus.cosim.system import Port
from urmpipe_fmus.fmu_file import open_fmu
from urmpipe_fmus.process import TIMEOUT
from urmpipe_fmus.python_fmu.place import why_not_in
from urmpipe_models.errors import CosimulationError, escape_line
from urmpipe_models.processes import describe_exit, end_group, module_command, module_environment

POLL = 0.02
"""How often it is looked at, in [s]."""

BETWEEN_LOOKS = 1.0
"""So many seconds count at most between two looks at a call: the processes may have been stopped."""

SAID_BYTES = 16_000_000
"""A process that printed more has it forgotten, as its disk is not for that."""


class Worker:
    """A process that loads what it needs while its job is prepared; use it as a context.

    It ends with the context, and with the process that started it, and so does what the FMUs started.

    Attributes:
        folder: Where its job is put, and what it leaves; it goes with the context.
    """

    folder: Path

    def __enter__(self) -> Worker:
        self._folder = tempfile.TemporaryDirectory(prefix="urmpipe-", ignore_cleanup_errors=True)
        self.folder = Path(self._folder.name)
        with (self.folder / SAID).open("ab") as said:
            self._process = subprocess.Popen(
                module_command("urmpipe_fmus.cosim.worker", str(self.folder)),
                stdin=subprocess.PIPE,
                stdout=said,
                stderr=subprocess.STDOUT,
                env=module_environment(),
                start_new_session=True,
                bufsize=0,  # so that closing its input writes nothing to a process that has ended
            )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        end_group(self._process)
        with self._process:  # closes its input, and waits for its end
            pass
        self._folder.cleanup()

    def work(self, watch: Callable[[], str]) -> str:
        """Let it do the job that is in its folder.

        Args:
            watch: Called now and then: tells why it is to be ended, empty if it is not.

        Returns:
            How it ended; empty if by itself, and with the exit code 0.
        """
        self._begin()
        while True:
            with suppress(subprocess.TimeoutExpired):
                code = self._process.wait(POLL)
                return describe_exit(code) if code else ""
            if (self.folder / SAID).stat().st_size > SAID_BYTES:
                os.truncate(self.folder / SAID, 0)  # what is appended from then on begins there
            why = watch()
            if why:
                end_group(self._process)
                self._process.wait()
                return why

    def _begin(self) -> None:
        """Tell it that the job is there."""
        assert self._process.stdin is not None
        with suppress(OSError):  # if it ended already, its exit code tells
            self._process.stdin.write(b"begin\n")


class CallWatch:
    """Sees whether a call returns.

    Args:
        timeout: How long a call may take, in [s].
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._call, self._taken, self._looked = ELSEWHERE, 0.0, monotonic()

    def overdue(self, state: Progress) -> str:
        """Return that the call at which a run is does not return; empty as long as it may."""
        now = monotonic()
        passed, self._looked = min(now - self._looked, BETWEEN_LOOKS), now
        if state.call != self._call or state.code == ELSEWHERE:
            self._call, self._taken = state.call, 0.0
            return ""
        self._taken += passed
        return f"did not return within {self._timeout:g} s" if self._taken > self._timeout else ""


LAST_LINES = 5
"""So many of a block's last log lines are told with an error."""


TAIL = 65_536
"""So many of the last bytes that a process printed are looked at."""


@dataclass(frozen=True, slots=True)
class NotFinite:
    """Values of a scalar that are not finite.

    Attributes:
        value: The first of them: nan, inf or -inf.
        t: When it stood there in [s].
        count: So many there are at communication points, recorded or not.
    """

    value: float
    t: float
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """What a co-simulation recorded, until its end or until it failed.

    Attributes:
        t_ns: The recorded communication points in [ns], shape (n,).
        names: Block and variable of each column: every output, every input from a log.
        units: Of each column as the FMU spells it; empty if it has none.
        types: Of each column: Real, Integer or Boolean.
        values: In `units`, shape (n, columns); Integers as they are, Booleans 0 or 1.
        failed: Why it ended before its time, one line; None if it did not fail.
        notes: What is allowed but should be seen.
        not_finite: The scalars that had values which are not finite.
        loop_seconds: How long the steps took in [s], without what is prepared before the first; 0 after a
            crash.
    """

    t_ns: NDArray[np.int64]
    names: tuple[Port, ...]
    units: tuple[str, ...]
    types: tuple[str, ...]
    values: NDArray[np.float64]
    failed: str | None
    notes: tuple[str, ...]
    not_finite: Mapping[Port, NotFinite] = field(default_factory=dict)
    loop_seconds: float = 0.0

    def column(self, block: str, variable: str) -> NDArray[np.float64]:
        """Return the values of a scalar in its own unit, shape (n,).

        Raises:
            CosimulationError: If it was not recorded.
        """
        port = Port(block, variable)
        if port not in self.names:
            allowed = ", ".join(str(one) for one in self.names)
            raise CosimulationError(f"{port}: not recorded; allowed: {allowed}")
        return self.values[:, self.names.index(port)]


def simulate(
    plan: Plan,
    *,
    timeout: float = TIMEOUT,
    progress: Callable[[float], None] | None = None,
    worker: Worker | None = None,
) -> Recorded:
    """Run a system in a process of its own: an FMU that crashes does not take this one with it.

    Args:
        plan: The system.
        timeout: How long a call of an FMU may take, in [s]: one that does not return fails.
        progress: Called now and then with the share that is done, 0 to 1.
        worker: The process, started before the plan was made; by default one that is started now. It does
            one job.

    Returns:
        What was recorded, and why it failed if it did.

    Raises:
        CosimulationError: If there is no room to record, or the run could not be started.
    """
    if worker is None:
        with Worker() as started:
            return simulate(plan, timeout=timeout, progress=progress, worker=started)
    folder = worker.folder
    assembly = Assembly(plan)
    job = assembly.job(_unpacked(plan, folder))
    _lay_out(job, folder)
    with (folder / PROGRESS).open("r+b") as file:
        shared = mmap.mmap(file.fileno(), ctypes.sizeof(Progress))

    calls = CallWatch(timeout)

    def watch() -> str:
        """Tell the share that is done; return that a call does not return."""
        state = Progress.from_buffer_copy(shared)
        if progress is not None:
            progress(state.k / job.count)
        return calls.overdue(state)

    try:
        ended = worker.work(watch)
        state = Progress.from_buffer_copy(shared)
    finally:
        shared.close()
    return _recorded(plan, assembly, job, folder, state, ended)


def _unpacked(plan: Plan, folder: Path) -> dict[str, Path]:
    """Unpack every FMU once; return where that of each block is."""
    places: dict[Path, Path] = {}
    for shown in plan.interfaces.values():
        if shown.path not in places:
            places[shown.path] = folder / f"fmu{len(places)}"
            open_fmu(shown.path).unpack(places[shown.path], skip="sources/")
            misplaced = why_not_in(places[shown.path])
            if misplaced:
                raise CosimulationError(f"{shown.path}: {misplaced}")
            (places[shown.path] / "resources").mkdir(exist_ok=True)
    return {name: places[shown.path] for name, shown in plan.interfaces.items()}


def _lay_out(job: Job, folder: Path) -> None:
    """Write the job, and make room for what it records.

    Room is taken at once: a disk that runs full under a memory map would end the process.
    """
    (folder / JOB).write_bytes(pickle.dumps(job))
    (folder / PROGRESS).write_bytes(bytes(Progress(call=ELSEWHERE)))
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


def _recorded(
    plan: Plan, assembly: Assembly, job: Job, folder: Path, state: Progress, ended: str
) -> Recorded:
    """Return what a run left in its folder."""
    ports = assembly.ports
    values = np.fromfile(folder / RECORDED, np.float64, state.rows * job.columns)
    values = values.reshape(state.rows, job.columns)
    shown = {port: i for i, port in enumerate(ports)}
    names = tuple(
        Port(block, one.name)
        for block, interface in plan.interfaces.items()
        for one in interface.variables.values()
        if Port(block, one.name) in shown
    )
    result = _result(folder)
    failed = _failure(job, folder, state, result) if result else None
    if failed is None and (ended or not state.done):
        failed = _crash(job, folder, state, ended or describe_exit(0))
    times = np.arange(state.rows) * job.record_every * job.step
    if state.ended:
        times[-1] = state.ended
    return Recorded(
        t_ns=np.round(times * 1e9).astype(np.int64),
        names=names,
        units=tuple(plan.variable(port).unit for port in names),
        types=tuple(plan.variable(port).type for port in names),
        values=values[:, [shown[port] for port in names]],
        failed=failed,
        notes=(*plan.notes, *(result["notes"] if result else ()), *_warnings(job, folder)),
        not_finite=_not_finite(assembly.recorded["Real"], job, folder),
        loop_seconds=state.loop_seconds,
    )


def _not_finite(ports: Sequence[Port], job: Job, folder: Path) -> dict[Port, NotFinite]:
    """Return which of some scalars had values that are not finite."""
    found = np.fromfile(folder / NOT_FINITE, np.float64, 3 * len(ports)).reshape(3, -1)
    return {
        port: NotFinite(float(value), float(k) * job.step, max(int(count), 1))
        for port, (value, k, count) in zip(ports, found.T, strict=True)
        if not math.isfinite(value)
    }


def _result(folder: Path) -> dict[str, Any] | None:
    """Return how a run said it ended; None if it could not say."""
    path = folder / RESULT
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else None


def _failure(job: Job, folder: Path, state: Progress, result: dict[str, Any]) -> str | None:
    """Return how a run failed by its own words; None if it did not."""
    if result["failed"] is None:
        return None
    if result["code"] == ELSEWHERE:
        return escape_line(f"{result['failed']}, at t = {state.k * job.step:.9g} s")
    return _told(job, folder, state, result["code"], result["failed"])


def _crash(job: Job, folder: Path, state: Progress, ended: str) -> str:
    """Return how a run failed whose process ended in some way before all was done."""
    if state.code == ELSEWHERE:
        return escape_line(f"the process of the co-simulation {ended}" + _quoted(_said(folder)[-LAST_LINES:]))
    return _told(job, folder, state, state.code, ended)


def _told(job: Job, folder: Path, state: Progress, code: int, what: str) -> str:
    """Return a failure of a block: where, when, what, and its last words."""
    number, function = called(code)
    name = job.blocks[number].name
    lines = [f"{status}: {text}" for block, status, text in _log(folder) if block == name]
    words = _quoted([*lines[-LAST_LINES:], *_said(folder)[-LAST_LINES:]])
    return escape_line(f"block {name}: {function} at t = {state.k * job.step:.9g} s: {what}{words}")


def _quoted(lines: list[str]) -> str:
    return f"; its last lines: {' | '.join(lines)}" if lines else "; it logged nothing"


def _log(folder: Path) -> list[tuple[str, str, str]]:
    """Return block, status and text of what the FMUs logged last."""
    path = folder / LOG
    texts = [one.read_text(encoding="utf-8") for one in (path.with_suffix(".before"), path) if one.exists()]
    rows = (line.split("\t", 2) for line in "".join(texts).splitlines())
    return [(row[0], row[1], row[2]) for row in rows if len(row) == 3]


def _said(folder: Path) -> list[str]:
    """Return what the process printed last."""
    with (folder / SAID).open("rb") as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - TAIL))
        text = file.read().decode("utf-8", errors="replace")
    return [line.strip() for line in text.splitlines() if line.strip()]


def _warnings(job: Job, folder: Path) -> Iterator[str]:
    """Yield which calls returned fmi2Warning."""
    counts, first = np.fromfile(folder / WARNED, np.float64).reshape(2, -1)
    for code in np.flatnonzero(counts).tolist():
        number, function = called(code)
        name = job.blocks[number].name
        lines = [text for block, status, text in _log(folder) if block == name and status == "fmi2Warning"]
        last = f", the last: {lines[-1]}" if lines else ""
        times = f"{counts[code]:.0f} times, first" if counts[code] > 1 else "once,"
        when = f"at t = {first[code] * job.step:.9g} s"
        yield escape_line(f"block {name}: {function} returned fmi2Warning {times} {when}{last}")
