"""What the processes share in which FMUs run: how one is started, what it is told with, how it ended."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Callable
from typing import Any


def command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module of ours, and nothing of the working folder."""
    return [sys.executable, "-P", "-m", module, *arguments]


def environment() -> dict[str, str]:
    """Return the environment in which such a module finds what this process does."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(one for one in sys.path if one)}


def ending(exit_code: int) -> str:
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
