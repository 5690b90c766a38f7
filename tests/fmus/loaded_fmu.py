"""An FMU on FMPy's low-level calls, which writes down its log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fmpy import calloc, extract, free, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)


class Loaded:
    """An instance that is initialized; its variables by name."""

    def __init__(self, path: Path, start: float = 0.0, folder: Path | None = None) -> None:
        self.described = read_model_description(str(path))
        self.references = {one.name: one.valueReference for one in self.described.modelVariables}
        self.types = {one.name: one.type for one in self.described.modelVariables}
        self.log: list[tuple[int, str, str]] = []
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(self._take)
        self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        self.fmu: Any = FMU2Slave(
            guid=self.described.guid,
            unzipDirectory=extract(str(path), unzipdir=None if folder is None else str(folder)),
            modelIdentifier=self.described.coSimulation.modelIdentifier,
            instanceName="one",
        )
        self.begin(start)

    def begin(self, start: float) -> None:
        self.fmu.instantiate(callbacks=self.callbacks, loggingOn=True)
        self.initialize(start)

    def initialize(self, start: float) -> None:
        self.fmu.setupExperiment(startTime=start)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def _take(self, _: Any, __: Any, status: int, category: bytes | None, text: bytes) -> None:
        self.log.append((status, (category or b"").decode(), text.decode()))

    def get(self, names: Sequence[str]) -> list[Any]:
        return [getattr(self.fmu, f"get{self.types[one]}")([self.references[one]])[0] for one in names]

    def set(self, name: str, value: Any) -> None:
        getattr(self.fmu, f"set{self.types[name]}")([self.references[name]], [value])

    def do_step(self, time: float, step: float) -> None:
        self.fmu.doStep(time, step)

    def status_of(self, function: str, *arguments: Any) -> int:
        """The status that a call returns."""
        try:
            getattr(self.fmu, function)(*arguments)
        except FMICallException as error:
            return int(error.status)
        return 0

    def free(self) -> None:
        self.fmu.terminate()
        self.fmu.fmi2FreeInstance(self.fmu.component)
