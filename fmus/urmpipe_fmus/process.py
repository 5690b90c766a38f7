"""What the processes share in which FMUs run: what an FMU is given, and how long its calls may take.

How a process in which an FMU runs ends with the one that started it, however that ended.

The process in which `check_fmu` runs an FMU, from the parent's side: started, watched, ended.
"""

from __future__ import annotations

import ctypes
import json
import mmap
import os
import shutil
import signal
import subprocess
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any

from urmpipe_models.processes import describe_exit, end_group, module_command, module_environment

TIMEOUT = 60.0
"""Seconds that a call of an FMU may take; one that takes longer has hung."""


def callbacks_with(take: Callable[..., None]) -> Any:
    """Return FMPy's callbacks that give an FMU memory, and what it logs to a function.

    Args:
        take: Called with environment, instance, status, category and the text, in which FMPy has put the
            values for its %s and %d.
    """
    from fmpy import calloc, fmi2, free
    from fmpy.logging import addLoggerProxy

    made = fmi2.fmi2CallbackFunctions()
    made.logger = fmi2.fmi2CallbackLoggerTYPE(take)
    made.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
    made.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
    addLoggerProxy(ctypes.byref(made))
    return made


def end_with_parent(folder: Path) -> None:
    """End this process when the one that started it does: its end of the standard input is closed then.

    The input is taken away from the standard one, so that an FMU that reads waits for nothing.

    Args:
        folder: The folder of the run, of no use to anybody then.
    """
    watched = os.dup(0)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)

    def watch() -> None:
        """Wait until the input is closed, then leave nothing behind."""
        while os.read(watched, 1024):
            pass
        shutil.rmtree(folder, ignore_errors=True)
        with suppress(AttributeError, OSError):  # Windows has no groups
            if os.getpgrp() == os.getpid():  # what the FMU started ends, too
                os.killpg(os.getpid(), signal.SIGKILL)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


STARTING = 60.0
"""Seconds that the process may take until it calls the FMU."""

POLL = 0.02
"""How often it is looked at, in [s]."""

CALL_BYTES = 256
"""Bytes of the file that holds the number of the call, in eight bytes, and its name."""

LOG_BYTES = 1_000_000
"""What an FMU logs or prints is forgotten when it is longer."""


@dataclass(slots=True)
class Run:
    """What is known of a run.

    Attributes:
        ended: Which call the process did not come back from, and how it ended; empty if it came to its end.
        log: The lines that the FMU logged.
        failed: Which call failed, and how; empty if none did.
        before: Values by variable after the initialization; empty if it did not come so far.
        after: The same after the last step.
        odd: Time in [s], number of the variable and value where an output is not finite first.
        warned: Each call that returned fmi2Warning, and what the FMU logged meanwhile.
    """

    ended: str = ""
    log: list[str] = field(default_factory=list)
    failed: str = ""
    before: list[Any] = field(default_factory=list)
    after: list[Any] = field(default_factory=list)
    odd: list[tuple[float, int, float]] = field(default_factory=list)
    warned: list[tuple[str, str]] = field(default_factory=list)


def run_job(folder: Path, job: Mapping[str, Any], timeout: float) -> Run:
    """Run an FMU in a process of its own.

    Args:
        folder: Where the two processes meet.
        job: What to run, as `check_run` takes it.
        timeout: Seconds that a call may take.
    """
    (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
    (folder / "call").write_bytes(bytes(CALL_BYTES))
    (folder / "log").touch()
    with (folder / "call").open("r+b") as file, mmap.mmap(file.fileno(), CALL_BYTES) as call:
        ended = _watched(folder, call, timeout)
        name = bytes(call[8:]).rstrip(b"\0").decode("utf-8", "replace") or "loading"
    run = Run(log=(folder / "log").read_text("utf-8", "replace").splitlines())
    whole = _fill(run, folder / "found")
    if ended or not whole:
        run.ended = f"{name} {ended or describe_exit(0)}"
    return run


def _fill(run: Run, found: Path) -> bool:
    """Take what the process found; return whether it said that this is all."""
    whole = False
    for line in found.read_text("utf-8").splitlines() if found.exists() else ():
        kind, value = json.loads(line)
        if kind == "whole":
            whole = True
        elif kind in ("odd", "warned"):
            getattr(run, kind).append(tuple(value))
        else:
            setattr(run, kind, value)
    return whole


def _watched(folder: Path, call: mmap.mmap, timeout: float) -> str:
    """Run the job of a folder; return how its process ended, empty if well."""
    printed = folder / "printed"
    with _started(folder, printed) as process:
        number, since = bytes(8), monotonic()
        while True:
            with suppress(subprocess.TimeoutExpired):
                code = process.wait(POLL)
                break
            if call[:8] != number:
                number, since = call[:8], monotonic()
            if monotonic() - since > (timeout if any(number) else STARTING):
                return f"did not return within {timeout if any(number) else STARTING:g} s"
            if printed.stat().st_size > LOG_BYTES:
                os.truncate(printed, 0)
    said = printed.read_text("utf-8", "replace").strip().splitlines() if code > 0 else []
    return ": ".join((describe_exit(code), *said[-1:])) if code else ""


@contextmanager
def _started(folder: Path, printed: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Start the process of a job; it ends with the context, and so does what the FMU started in it."""
    with printed.open("ab") as file:
        process = subprocess.Popen(
            module_command("urmpipe_fmus.check_run", str(folder)),
            env=module_environment(),
            stdin=subprocess.PIPE,  # closed when this process ends, whatever ends it
            stdout=subprocess.DEVNULL,
            stderr=file,
            start_new_session=True,
        )
    with process:
        try:
            yield process
        finally:
            end_group(process)
