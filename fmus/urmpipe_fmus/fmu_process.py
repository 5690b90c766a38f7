"""What the processes share in which FMUs run: what an FMU is given, and how long its calls may take."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

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
