"""Child processes for what may end the process it runs in: their start, their limits and their end."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from subprocess import Popen
from typing import Any

MAX_MEMORY = 4 * 2**30  # bytes: far more than any file in use needs, less than a machine has


def module_command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module of urmpipe, without the working folder in its import path."""
    return [sys.executable, "-P", "-m", module, *arguments]


def module_environment() -> dict[str, str]:
    """Return the environment in which such a module imports the same packages as this process."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}


def limit_memory(size: int = MAX_MEMORY) -> None:
    """Limit the memory of this process to a number of bytes, where the system supports it."""
    with suppress(ImportError):  # Windows has no such limit
        import resource

        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (size if hard < 0 else min(size, hard), hard))


def end_group(process: Popen[Any]) -> None:
    """Kill a process that was started with `start_new_session`, and all processes that it started."""
    if sys.platform == "win32":
        process.kill()
    else:
        with suppress(ProcessLookupError, PermissionError):  # macOS: of a group that has just ended
            os.killpg(process.pid, signal.SIGKILL)


def describe_exit(exit_code: int) -> str:
    """Return a text for the end of a process.

    Args:
        exit_code: Its exit code, or the negative number of the signal that ended it.
    """
    if exit_code < 0:
        try:
            number = signal.Signals(-exit_code)
        except ValueError:
            return f"ended the process by signal {-exit_code}"
        return f"ended the process: {signal.strsignal(number)} ({number.name})"
    return f"ended the process with the exit code {exit_code if exit_code < 2**16 else hex(exit_code)}"
