"""Processes of our own, for what may end the process it runs in: their start, their bounds and their end."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from subprocess import Popen
from typing import Any

MAX_MEMORY = 4 * 2**30
"""Bytes that such a process may ask for: far more than any file in use needs, less than a machine has."""


def module_command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module of ours, and nothing of the working folder."""
    return [sys.executable, "-P", "-m", module, *arguments]


def module_environment() -> dict[str, str]:
    """Return the environment in which such a module finds what this process does."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(one for one in sys.path if one)}


def limit_memory(size: int = MAX_MEMORY) -> None:
    """Let this process have no more than some bytes of memory, where the system knows such a limit."""
    with suppress(ImportError):  # Windows has none
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
    """Return how a process ended, for people.

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
