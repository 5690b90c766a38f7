"""The process in which `check_fmu` runs an FMU: `python -m urmpipe_fmus.check_run FOLDER`.

An FMU may end its process, so it has one of its own. Which function is called, what the FMU logs and what is
found is written at once, so that it can be read after any end.
"""

from __future__ import annotations

import ctypes
import json
import math
import mmap
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from urmpipe_fmus.fmu_file import find_binary
from urmpipe_fmus.process import CALL_BYTES, LOG_BYTES, callbacks_with, end_with_parent
from urmpipe_models.processes import limit_memory

MEMORY = 8 * 2**30
"""Bytes that an FMU may ask for, with what it only reserves, as runtimes do."""

HELD: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int,
    "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
}
"""What a value of each type is held in."""

WARNING, DISCARD, FATAL = 1, 2, 4
"""Of fmi2Status (FMI 2.0.4, section 2.1.3): after the last nothing may be called any more."""

TERMINATED = 3
"""Of fmi2StatusKind (FMI 2.0.4, section 4.2.3)."""


class Stopped(Exception):  # noqa: N818 - the end of a run, told as its result
    """A call failed.

    Attributes:
        status: FMI's status; None where the call gave none.
    """

    def __init__(self, said: str, status: int | None = None) -> None:
        super().__init__(said)
        self.status = status


class Notes:
    """What this process leaves in its folder, written at once."""

    def __init__(self, folder: Path) -> None:
        with (folder / "call").open("r+b") as file:
            self._call = mmap.mmap(file.fileno(), CALL_BYTES)
        self._calls = 0
        flags = os.O_RDWR | os.O_CREAT | os.O_APPEND
        self._log, self._found = (os.open(folder / name, flags, 0o600) for name in ("log", "found"))
        self.logged = ""

    def call(self, what: str) -> None:
        """Note what is called next."""
        self._calls += 1
        self.logged = ""
        self._call[8:] = what.encode("utf-8", "replace")[: CALL_BYTES - 8].ljust(CALL_BYTES - 8, b"\0")
        self._call[:8] = self._calls.to_bytes(8, "little")

    def take(self, _: Any, __: Any, ___: int, ____: Any, text: bytes | None) -> None:
        """Take a message of the FMU."""
        self.logged = " ".join((text or b"").decode("utf-8", "replace").split())
        if os.fstat(self._log).st_size > LOG_BYTES:
            os.ftruncate(self._log, 0)
        os.write(self._log, self.logged.encode("utf-8", "replace") + b"\n")

    def found(self, kind: str, value: Any) -> None:
        """Note what was found, under a name of `check_process.Run`."""
        os.write(self._found, json.dumps((kind, value)).encode() + b"\n")


class Checked:
    """An instance of an FMU whose calls are noted."""

    def __init__(self, folder: Path, job: dict[str, Any], notes: Notes) -> None:
        self._folder, self._job, self._notes = folder / "fmu", job, notes
        self._odd: set[int] = set()

    def run(self) -> None:
        """Load, initialize, step and free the FMU.

        Raises:
            Stopped: If a call fails.
        """
        fmu = self._loaded()
        self._called("fmi2Instantiate", lambda: fmu.instantiate(callbacks=self._callbacks, loggingOn=True))
        self._called("fmi2SetupExperiment", lambda: fmu.setupExperiment(startTime=self._job["start"]))
        self._called("fmi2EnterInitializationMode", fmu.enterInitializationMode)
        self._called("fmi2ExitInitializationMode", fmu.exitInitializationMode)
        self._notes.found("before", self._values(fmu))
        self._look(fmu, self._job["start"])
        self._steps(fmu)
        self._notes.found("after", self._values(fmu))
        self._called("fmi2Terminate", fmu.terminate)
        self._called("fmi2FreeInstance", lambda: fmu.fmi2FreeInstance(fmu.component))

    def _steps(self, fmu: Any) -> None:
        """Do the steps, unless the FMU ends the run before."""
        start, step, steps = (self._job[name] for name in ("start", "step", "steps"))
        for k in range(steps):
            time = start + k * step
            what = f"fmi2DoStep at {time:.9g} s"
            try:
                self._called(what, partial(fmu.fmi2DoStep, fmu.component, time, step, 1))
            except Stopped as stopped:
                if stopped.status != DISCARD or not self._terminated(fmu):
                    raise
                said = f"ended the run (fmi2Discard, terminated) after {k} of {steps} steps"
                self._notes.found("failed", f"{what} {said}")
                return
            self._look(fmu, start + (k + 1) * step)

    def _terminated(self, fmu: Any) -> bool:
        """Return whether a discarded step means that the FMU ends the run."""
        ended = ctypes.c_int(0)
        try:
            self._called(
                "fmi2GetBooleanStatus",
                lambda: fmu.fmi2GetBooleanStatus(fmu.component, TERMINATED, ctypes.byref(ended)),
            )
        except Stopped:
            return False
        return bool(ended.value)

    def _loaded(self) -> Any:
        """Load the library."""
        from fmpy.fmi2 import FMU2Slave

        self._callbacks = callbacks_with(self._notes.take)
        identifier = self._job["identifier"]
        return self._called(
            "loading",
            lambda: FMU2Slave(
                guid=self._job["guid"],
                unzipDirectory=str(self._folder),
                modelIdentifier=identifier,
                libraryPath=str(find_binary(self._folder, identifier)),
                instanceName=identifier,
            ),
        )

    def _called(self, what: str, call: Callable[[], Any]) -> Any:
        """Call a function, and note so before."""
        self._notes.call(what)
        try:
            status = call()
        except Exception as error:  # FMPy raises Exception itself, ctypes OSError and AttributeError
            raise Stopped(f"{what}: {error}", getattr(error, "status", None)) from error
        if status == WARNING:
            self._notes.found("warned", (what, self._notes.logged))
        return status

    def _look(self, fmu: Any, time: float) -> None:
        """Note which outputs are not finite for the first time, at a time in [s]."""
        watched = [(i, reference) for i, reference in self._job["watched"] if i not in self._odd]
        if not watched:
            return
        count = len(watched)
        values = (ctypes.c_double * count)()
        references = (ctypes.c_uint * count)(*(reference for _, reference in watched))
        self._got(
            f"fmi2GetReal at {time:.9g} s", partial(fmu.fmi2GetReal, fmu.component, references, count, values)
        )
        for (i, _), value in zip(watched, values, strict=True):
            if not math.isfinite(value):
                self._odd.add(i)
                self._notes.found("odd", (time, i, value))

    def _got(self, what: str, call: Callable[[], Any]) -> bool:
        """Get values; return whether the FMU gave them."""
        try:
            self._called(what, call)
        except Stopped as stopped:
            if stopped.status == FATAL:
                raise
            return False
        return True

    def _values(self, fmu: Any) -> list[Any]:
        """Return the values of all variables, one call each: one that is refused hides no other."""
        return [self._value(fmu, kind, reference) for kind, reference in self._job["variables"]]

    def _value(self, fmu: Any, kind: str, reference: int) -> Any:
        value = (HELD[kind] * 1)()
        get = getattr(fmu, f"fmi2Get{kind}")
        what = f"fmi2Get{kind} of value reference {reference}"
        if not self._got(what, lambda: get(fmu.component, (ctypes.c_uint * 1)(reference), 1, value)):
            return None
        found = value[0]
        if kind == "Boolean":
            return bool(found)
        return found.decode("utf-8", "replace") if isinstance(found, bytes) else found


def main(folder: Path) -> None:
    """Run the FMU of a job, and leave in its folder what was found."""
    end_with_parent(folder)
    job = json.loads((folder / "job.json").read_text(encoding="utf-8"))
    notes = Notes(folder)
    limit_memory(MEMORY)
    try:
        Checked(folder, job, notes).run()
    except Stopped as error:
        notes.found("failed", str(error))
    notes.found("whole", True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
    os._exit(0)  # what the library does when it is unloaded can no longer spoil the result
