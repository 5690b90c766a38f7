"""An FMU on FMPy's low-level calls, which writes down its log.

It imports nothing of urmpipe: it also runs where there is none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from fmpy import calloc, extract, fmi2, free, read_model_description
from fmpy.fmi1 import FMICallException


class Loaded:
    """An instance that is initialized; its variables by name.

    Args:
        path: The FMU.
        start: Where it starts in [s]; None if it is not begun yet.
        folder: Where it is unpacked; by default in a folder of FMPy's choice.
        before: Called with this before the initialization, to set start values.
        guid: By default that of its description.

    Attributes:
        blocks: Addresses of its memory that is allocated and not freed.
        most_blocks: The number of blocks from which on there is no memory left.
    """

    def __init__(
        self,
        path: Path,
        start: float | None = 0.0,
        folder: Path | None = None,
        before: Callable[[Loaded], None] = lambda _: None,
        guid: str | None = None,
    ) -> None:
        self.described = read_model_description(str(path))
        self.references = {one.name: one.valueReference for one in self.described.modelVariables}
        self.types = {one.name: one.type for one in self.described.modelVariables}
        self.log: list[tuple[int, str, str]] = []
        self.callbacks = fmi2.fmi2CallbackFunctions()
        self.callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._take)
        self.blocks: set[int] = set()
        self.most_blocks = 1_000_000
        self.callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(self._allocate)
        self.callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(self._free)
        self._before = before
        self.fmu: Any = fmi2.FMU2Slave(
            guid=self.described.guid if guid is None else guid,
            unzipDirectory=extract(str(path), unzipdir=None if folder is None else str(folder)),
            modelIdentifier=self.described.coSimulation.modelIdentifier,
            instanceName="one",
        )
        if start is not None:
            self.begin(start)

    def begin(self, start: float) -> None:
        """Make an instance, and initialize it."""
        self.fmu.instantiate(callbacks=self.callbacks, loggingOn=True)
        self.initialize(start)

    def initialize(self, start: float) -> None:
        """Go from a new or reset instance to its first step."""
        self.fmu.setupExperiment(startTime=start)
        self._before(self)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def _take(self, _: Any, __: Any, status: int, category: bytes | None, text: bytes) -> None:
        """Take a message of the FMU."""
        self.log.append((status, (category or b"").decode(), text.decode()))

    def _allocate(self, count: int, size: int) -> int | None:
        if len(self.blocks) >= self.most_blocks:
            return None
        block = int(calloc(count, size))
        self.blocks.add(block)
        return block

    def _free(self, block: int) -> None:
        self.blocks.remove(block)
        free(block)

    def get(self, names: Sequence[str]) -> list[Any]:
        """Return the values of scalars, one call each."""
        return [getattr(self.fmu, f"get{self.types[one]}")([self.references[one]])[0] for one in names]

    def set(self, name: str, value: Any) -> None:
        """Set a scalar."""
        getattr(self.fmu, f"set{self.types[name]}")([self.references[name]], [value])

    def do_step(self, time: float, step: float) -> None:
        """Take a step from a time, both in [s]."""
        self.fmu.doStep(time, step)

    def status_of(self, function: str, *arguments: Any, **options: Any) -> int:
        """Return the status that a call returns."""
        try:
            getattr(self.fmu, function)(*arguments, **options)
        except FMICallException as error:
            return int(error.status)
        return 0

    def free(self) -> None:
        """Free the instance; the library stays, for another."""
        self.fmu.terminate()
        self.fmu.fmi2FreeInstance(self.fmu.component)
