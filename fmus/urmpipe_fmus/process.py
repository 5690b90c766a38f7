"""The process in which FMUs run: an FMU may crash, hang or print without end, and must not harm its caller.

`check_fmu` runs one FMU in such a process (`check_run`), `simulate` all FMUs of a system (`cosim.worker`).
The parent process and the process of the FMUs share a temporary folder:

1. The parent starts the process (`FmuProcess`), which loads its libraries while the parent writes the job.
2. The process waits for the line "begin" (`await_job`). It exits when its parent does, before and after it.
3. The parent polls the process (`FmuProcess.run`): it limits what is printed, and ends a process whose call
   does not return (`CallWatchdog`). Each call is noted in shared memory before it is made, with a number.
4. The end is reported as text: the call that did not return, a signal, or an exit code.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Any

from urmpipe_models.processes import describe_exit, end_group, module_command, module_environment

DEFAULT_TIMEOUT = 60.0  # s; a call of an FMU that takes longer has hung
POLL_PERIOD = 0.02  # s
MAX_COUNTED_PAUSE = 1.0  # s between two polls; a longer pause means that the processes were suspended
OUTPUT = "output.txt"  # file of the shared folder: what the FMUs print
TAIL_BYTES = 65_536  # of the output, of which the last lines are taken

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)  # fmi2Status (FMI 2.0.4, section 2.1.3)
STATUS_NAMES = ("fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal", "fmi2Pending")
LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3  # fmi2StatusKind (FMI 2.0.4, section 4.2.3)
C_TYPES: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int,
    "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
}


class FmuProcess:
    """A process that runs FMUs, as a context; at its end the process and all that it started are killed.

    Args:
        module: Module to run, with the folder as its only argument; it begins with `await_job`.
        prefix: Prefix of the folder's name.
        keep_stdout: Whether standard output is kept as standard error is.
        max_output: Size in bytes from which printed output is discarded, to protect the disk.

    Attributes:
        folder: Temporary folder shared with the process: its job and its results.
        process: The process.
        exit_code: Its exit code, or the negative number of a signal; 0 if the parent ended it.
    """

    def __init__(self, module: str, *, prefix: str, keep_stdout: bool, max_output: int) -> None:
        self._module, self._prefix = module, prefix
        self._keep_stdout, self._max_output = keep_stdout, max_output
        self.exit_code = 0

    def __enter__(self) -> FmuProcess:
        self._temporary = tempfile.TemporaryDirectory(prefix=self._prefix, ignore_cleanup_errors=True)
        self.folder = Path(self._temporary.name)
        try:
            with (self.folder / OUTPUT).open("ab") as output:
                self.process = subprocess.Popen(
                    module_command(self._module, str(self.folder)),
                    env=module_environment(),
                    stdin=subprocess.PIPE,  # closed when this process ends, however it ends
                    stdout=output if self._keep_stdout else subprocess.DEVNULL,
                    stderr=output,
                    start_new_session=True,
                    bufsize=0,  # so that closing its input writes nothing to a process that has ended
                )
        except BaseException:
            self._temporary.cleanup()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        end_group(self.process)
        with self.process:  # closes its input, and waits for its end
            pass
        self._temporary.cleanup()

    def run(self, watch: Callable[[], str]) -> str:
        """Start the job that is in the folder, and wait until the process ends.

        Args:
            watch: Called at each poll; if it returns a text, the process is killed.

        Returns:
            How the process ended: the text of `watch`, or signal or exit code; empty after exit code 0.
        """
        assert self.process.stdin is not None
        with suppress(OSError):  # if it has already ended, the exit code shows why
            self.process.stdin.write(b"begin\n")
        output = self.folder / OUTPUT
        while True:
            with suppress(subprocess.TimeoutExpired):
                self.exit_code = self.process.wait(POLL_PERIOD)
                return describe_exit(self.exit_code) if self.exit_code else ""
            if output.stat().st_size > self._max_output:
                os.truncate(output, 0)  # the process appends: it continues at the new end
            if reason := watch():
                end_group(self.process)
                self.process.wait()
                return reason

    def last_lines(self, count: int) -> list[str]:
        """Return the last lines that the process printed, without empty ones."""
        with (self.folder / OUTPUT).open("rb") as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - TAIL_BYTES))
            text = file.read().decode("utf-8", errors="replace")
        return [line.strip() for line in text.splitlines() if line.strip()][-count:]


class CallWatchdog:
    """Measures how long a call has been running; pauses of both processes do not count."""

    def __init__(self) -> None:
        self._call, self._elapsed, self._polled = -1, 0.0, monotonic()

    def overdue(self, call: int, timeout: float) -> str:
        """Return the message that a call did not return in time, or an empty string.

        Args:
            call: Number of the current call; each call has another.
            timeout: Maximum duration in [s] of this call; inf for no limit.
        """
        now = monotonic()
        passed, self._polled = min(now - self._polled, MAX_COUNTED_PAUSE), now
        self._elapsed = self._elapsed + passed if call == self._call else 0.0
        self._call = call
        return f"did not return within {timeout:g} s" if self._elapsed > timeout else ""


def await_job(folder: Path) -> None:
    """Wait in the process of the FMUs until its folder holds the job.

    When the parent exits, which closes the standard input, this process exits too, and removes the folder.
    Standard input is replaced by an empty one, so that an FMU that reads does not wait.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent is interrupted too, and ends this process
    if not sys.stdin.buffer.readline():
        shutil.rmtree(folder, ignore_errors=True)
        os._exit(0)
    parent_pipe = os.dup(0)
    empty = os.open(os.devnull, os.O_RDONLY)
    os.dup2(empty, 0)
    os.close(empty)

    def watch_parent() -> None:
        while os.read(parent_pipe, 1024):
            pass
        shutil.rmtree(folder, ignore_errors=True)
        with suppress(AttributeError, OSError):  # Windows has no groups
            if os.getpgrp() == os.getpid():  # processes that the FMU started end, too
                os.killpg(os.getpid(), signal.SIGKILL)
        os._exit(1)

    threading.Thread(target=watch_parent, daemon=True).start()


def callbacks_with(log: Callable[..., None]) -> Any:
    """Return FMPy's callbacks: memory for an FMU, and a function for its log messages.

    Args:
        log: Called with environment, instance, status, category and text; FMPy has formatted its %s and %d.
    """
    from fmpy import calloc, fmi2, free
    from fmpy.logging import addLoggerProxy

    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(log)
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
    addLoggerProxy(ctypes.byref(callbacks))
    return callbacks
