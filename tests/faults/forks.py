"""Command lines in forks of a process that has loaded all: limited, interrupted or killed at any moment.

A fork starts at once, so that moments fall into the work of a command and not into Python's imports.
"""

from __future__ import annotations

import gc
import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any

import urmpipe
import urmpipe_datasets
import urmpipe_fmus
import urmpipe_models
import urmpipe_pipeline

HANGS = 100.0
"""Time in [s] after which a command hangs: each takes a second or two."""

LEAVING = 10.0
"""Time in [s] that processes which a command has started have to end after it."""


@dataclass(frozen=True)
class Ended:
    """How a command line ended.

    Attributes:
        code: Its exit code, or the negative number of the signal that ended it.
        out: What it wrote to standard output.
        err: What it wrote to standard error.
        seconds: How long it took in [s].
        hung: Whether it had to be killed.
        left: The commands of processes that outlived it.
    """

    code: int
    out: str
    err: str
    seconds: float
    hung: bool
    left: list[str]


class Forks:
    """The process that is forked.

    Attributes:
        written: What commands wrote undisturbed, by the command's name and the output's.
        seconds: How long they took in [s], by the command's name.
    """

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self.written: dict[str, dict[str, bytes]] = {}
        self.seconds: dict[str, float] = {}

    def run(
        self,
        arguments: Sequence[str],
        folder: Path,
        number: int = 0,
        after: float = 0.0,
        limit: int | None = None,
    ) -> Ended:
        """Run a command line.

        Args:
            arguments: What follows `urmpipe`.
            folder: The working folder.
            number: A signal to send; 0 for none.
            after: When to send it, in [s] from the start.
            limit: Bytes that a file may have.
        """
        order = {
            "arguments": [*arguments], "folder": str(folder), "number": number, "after": after, "limit": limit
        }  # fmt: skip
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        return Ended(**json.loads(self._process.stdout.readline()))


@contextmanager
def forks() -> Iterator[Forks]:
    """Start the process that is forked, and end it."""
    # The processes that a command starts get its Python path: so has this one, and finds what pytest finds.
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(one for one in sys.path if one)}
    process = subprocess.Popen(
        [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    )
    try:
        yield Forks(process)
    finally:
        process.communicate()


def _answer_orders() -> None:
    """Read orders, a line each, and tell how each ended."""
    libraries = ("fmpy", "pandas", "plotly.graph_objects", "pyarrow.parquet", "rerun.blueprint", "scipy.io")
    for name in (*libraries, *_modules()):
        import_module(name)
    gc.freeze()  # the collector of a fork would copy all the pages that it looks at
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # of a fork that is not the command yet
    while line := sys.stdin.readline():
        print(json.dumps(asdict(_ended(json.loads(line)))), flush=True)


def _modules() -> Iterator[str]:
    """Yield the modules of urmpipe, most of which a command imports where it needs them."""
    for package in (urmpipe, urmpipe_pipeline, urmpipe_fmus, urmpipe_models, urmpipe_datasets):
        for one in walk_packages(package.__path__, f"{package.__name__}."):
            if not one.name.endswith("__main__"):
                yield one.name


def _ended(order: dict[str, Any]) -> Ended:
    """Run one command line in a fork, and tell how it ended."""
    start = time.monotonic()
    (out, into_out), (err, into_err) = os.pipe(), os.pipe()
    child = os.fork()
    if child == 0:
        _be_the_command(order, into_out, into_err)
    os.close(into_out)
    os.close(into_err)
    with ThreadPoolExecutor() as pool:
        said = [pool.submit(_read, source) for source in (out, err)]  # not into files, which may be limited
        if order["number"]:
            time.sleep(order["after"])
            os.kill(child, order["number"])
        code = _code(child, start + HANGS)
        seconds = time.monotonic() - start
        if hung := code is None:
            os.killpg(child, signal.SIGKILL)
            code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        left = _left(child)
        out_text, err_text = (one.result() for one in said)
        return Ended(code or 0, out_text, err_text, seconds, hung, left)


def _read(source: int) -> str:
    """Return all that is written to a pipe."""
    with open(source, encoding="utf-8", errors="replace") as pipe:
        return pipe.read()


def _be_the_command(order: dict[str, Any], out: int, err: int) -> None:
    """Run the command line in this process, to its very end."""
    from urmpipe.__main__ import main

    os.setsid()
    os.chdir(order["folder"])
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(out, 1)
    os.dup2(err, 2)
    sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115 - to the end
    if order["limit"] is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (order["limit"], resource.RLIM_INFINITY))
    sys.argv = ["urmpipe", *order["arguments"]]
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    except KeyboardInterrupt:  # it came before the command began
        os._exit(1)
    main()


def _code(child: int, end: float) -> int | None:
    """Return the exit code of a process; None if it does not end in time."""
    while time.monotonic() < end:
        found, status = os.waitpid(child, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.002)
    return None


def _left(session: int) -> list[str]:
    """Return the commands of processes that a command has started and that do not end, and end them."""
    end = time.monotonic() + LEAVING
    while (found := _of_session(session)) and time.monotonic() < end:
        time.sleep(0.02)
    for process in found:
        os.kill(process, signal.SIGKILL)
    return list(found.values())


def _of_session(session: int) -> dict[int, str]:
    """Return the commands of the processes of a session."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            state, *fields = (folder / "stat").read_text().rpartition(")")[2].split()
            if int(fields[2]) == session and state != "Z":
                found[int(folder.name)] = (folder / "cmdline").read_text().replace("\0", " ")
        except OSError:  # it has just ended
            continue
    return found


if __name__ == "__main__":
    _answer_orders()
