"""Processes that read inputs, and what is done when one of them ends or does not return."""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import signal
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection, wait
from pathlib import Path
from random import Random
from typing import Any

from tests.fuzz.corpus import Specimen
from tests.fuzz.examine import ABORT, SLOW, Outcome, examine, specimen_of
from tests.fuzz.kinds import BY_NAME, Kind

FORK = multiprocessing.get_context("fork")

ADDRESSES = 6 * 2**30
"""Bytes that a worker may map: an input that asks for all there is ends before the machine does."""

TOLD = "printed.txt"
"""What a worker printed, in its folder: where it stood when a signal ended it, or asked for that."""

RENEWED = 1500
"""Inputs after which a worker is replaced: what a library keeps for good is no memory of an input."""


@dataclass(frozen=True)
class Batch:
    """Inputs of a kind by their numbers: of a seed, or of files that were kept.

    Attributes:
        kind: The name of the kind.
        first: The first number.
        end: The number after the last.
        kept: What is read instead, by its number.
    """

    kind: str
    first: int
    end: int
    kept: tuple[Specimen, ...] = ()


@dataclass(eq=False)
class Worker:
    """A process, what it does now, and since when."""

    folder: Path
    made: Path
    seed: int
    process: Any = None
    pipe: Connection | None = None
    batch: Batch | None = None
    number: int = -1
    name: str = ""
    since: float = 0.0
    count: int = 0

    def start(self) -> None:
        """Start the process."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self.pipe, end = FORK.Pipe()
        self.process = FORK.Process(target=work, args=(end, self.folder, self.made, self.seed), daemon=True)
        self.process.start()
        end.close()
        self.count = 0

    def stop(self) -> int:
        """End the process and return its exit code."""
        self.process.kill()
        self.process.join()
        if self.pipe is not None:
            self.pipe.close()
        self.pipe = None
        return int(self.process.exitcode)

    def give(self, batch: Batch) -> None:
        """Let it read some inputs."""
        if self.pipe is None or self.count > RENEWED:
            if self.pipe is not None:
                self.stop()
            self.start()
        assert self.pipe is not None
        self.batch, self.number, self.since = batch, batch.first, time.monotonic()
        self.count += batch.end - batch.first
        self.pipe.send(batch)


def work(pipe: Connection, folder: Path, made: Path, seed: int) -> None:
    """Read inputs until no more is asked for: what a worker does."""
    settle(folder)
    known: dict[str, list[Specimen]] = {}
    parent = os.getppid()
    while True:
        while not pipe.poll(1.0):
            if os.getppid() != parent:  # whoever asked is no more
                os._exit(0)
        batch: Batch = pipe.recv()
        kind = BY_NAME[batch.kind]
        if kind.name not in known:
            known[kind.name] = list(kind.specimens(made))
        for number in range(batch.first, batch.end):
            given = batch.kept[number] if batch.kept else specimen_of(kind, known[kind.name], seed, number)
            answer(pipe, kind, given, number, folder, made)
        pipe.send(None)


def answer(pipe: Connection, kind: Kind, given: Specimen, number: int, folder: Path, made: Path) -> None:
    """Read an input, and say so before and after: what ends this process is known by what was said before.

    How it is read depends on what stands in it alone: a file that was kept is read again as it was.
    """
    path = folder / given.name
    path.unlink(missing_ok=True)
    path.write_bytes(given.data)
    pipe.send((number, given.name, None))
    found = examine(kind, path, made, Random(zlib.crc32(given.data)))
    pipe.send((number, given.name, found))


def last_words(folder: Path) -> str:
    """Return the end of what the worker of a folder printed."""
    return (folder / TOLD).read_bytes()[-20_000:].decode("utf-8", "replace")


def settle(folder: Path) -> None:
    """Let this process stand in a folder of its own, print into a file, and have so much memory."""
    import resource

    os.chdir(folder)
    silent = os.open(os.devnull, os.O_RDONLY)
    told = os.open(folder / TOLD, os.O_CREAT | os.O_WRONLY | os.O_TRUNC)
    for stream, into in enumerate((silent, told, told)):
        os.dup2(into, stream)
    faulthandler.enable(2, all_threads=False)
    faulthandler.register(signal.SIGUSR1, 2, all_threads=False)
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, resource.getrlimit(resource.RLIMIT_AS)[1]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


Keep = Callable[[str, int, Path, Outcome], None]
"""Told of the kind, the number and the file of an input, and of what came of it."""


def run(workers: list[Worker], batches: Iterator[Batch], limit: float, keep: Keep) -> None:
    """Let workers read all batches.

    Args:
        workers: They.
        batches: What they read.
        limit: Time in [s] after which an input that has not returned is stopped.
        keep: Told of each input.
    """
    idle = list(workers)
    while True:
        while idle and (batch := next(batches, None)):
            idle.pop().give(batch)
        busy = [one for one in workers if one not in idle]
        if not busy:
            break
        ready = wait([one.pipe for one in busy if one.pipe is not None], timeout=0.5)
        for one in busy:
            if one.pipe in ready:
                _hear(one, keep)
            elif time.monotonic() - one.since > limit:
                _end(one, SLOW, f"did not return within {limit:g} s", keep)
            if one.batch is None:
                idle.append(one)
    for one in workers:
        if one.pipe is not None:
            one.stop()


def _hear(worker: Worker, keep: Keep) -> None:
    """Take what a worker sends."""
    assert worker.pipe is not None and worker.batch is not None
    try:
        told = worker.pipe.recv()
    except (EOFError, OSError):
        worker.process.join()
        _end(worker, ABORT, f"ended the process: {worker.process.exitcode}", keep)
        return
    if told is None:
        worker.batch = None
        return
    worker.number, worker.name, outcome = told
    if outcome is None:
        worker.since = time.monotonic()
    else:
        keep(worker.batch.kind, worker.number, worker.folder / worker.name, outcome)


def _end(worker: Worker, problem: str, text: str, keep: Keep) -> None:
    """End a worker, tell of its input, and let another read the rest of its batch."""
    batch = worker.batch
    assert batch is not None
    if problem == SLOW:
        os.kill(worker.process.pid, signal.SIGUSR1)
        time.sleep(0.5)
    code = worker.stop()
    spent = time.monotonic() - worker.since
    error = problem if problem == SLOW else f"exit code {code}"
    outcome = Outcome(spent, 0, problem, error, "", f"{last_words(worker.folder)}{text}")
    keep(batch.kind, worker.number, worker.folder / worker.name, outcome)
    worker.batch = None
    if worker.number + 1 < batch.end:
        worker.give(replace(batch, first=worker.number + 1))
