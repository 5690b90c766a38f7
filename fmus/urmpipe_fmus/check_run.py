"""The process in which `check_fmu` runs an FMU: `python -m urmpipe_fmus.check_run JOB.json`.

An FMU may end its process, so it has one of its own. What it says and which function is called is written
line by line, so that it can be read after any end.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from urmpipe_fmus.fmu_process import callbacks_with
from urmpipe_fmus.platforms import binary_in

CALL = "call "
"""Begins the line of a call; other lines are what the FMU logged."""

HELD: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int,
    "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
}
"""What a value of each type is held in."""

FATAL = 4
"""fmi2Fatal: nothing may be called any more."""


class Stopped(Exception):  # noqa: N818 - the end of a run, told as its result
    """A call failed."""


class Checked:
    """An instance of an FMU whose calls are written down.

    Attributes:
        before: Values by reference and type after the initialization; None for one that it does not give.
        after: The same after the last step.
    """

    def __init__(self, job: dict[str, Any], log: Callable[[str], None]) -> None:
        self._job, self._log = job, log
        self.before: list[Any] = []
        self.after: list[Any] = []

    def run(self) -> None:
        """Load, initialize, step and free the FMU.

        Raises:
            Stopped: If a call fails.
        """
        fmu = self._loaded()
        start, step = self._job["start"], self._job["step"]
        self._called("fmi2Instantiate", lambda: fmu.instantiate(callbacks=self._callbacks, loggingOn=True))
        self._called("fmi2SetupExperiment", lambda: fmu.setupExperiment(startTime=start))
        self._called("fmi2EnterInitializationMode", fmu.enterInitializationMode)
        self._called("fmi2ExitInitializationMode", fmu.exitInitializationMode)
        self.before = self.after = self._values(fmu)
        for k in range(self._job["steps"]):
            time = start + k * step
            self._called(f"fmi2DoStep at {time:.9g} s", partial(fmu.doStep, time, step))
        self.after = self._values(fmu)
        self._called("fmi2Terminate", fmu.terminate)
        self._called("fmi2FreeInstance", lambda: fmu.fmi2FreeInstance(fmu.component))

    def _loaded(self) -> Any:
        """Load the library."""
        from fmpy.fmi2 import FMU2Slave

        self._callbacks = callbacks_with(self._take)
        return self._called(
            "loading",
            lambda: FMU2Slave(
                guid=self._job["guid"],
                unzipDirectory=self._job["folder"],
                modelIdentifier=self._job["identifier"],
                libraryPath=str(binary_in(Path(self._job["folder"]), self._job["identifier"])),
                instanceName=self._job["identifier"],
            ),
        )

    def _take(self, _: Any, __: Any, status: int, ___: Any, text: bytes | None) -> None:
        """Take a message of the FMU."""
        self._log(" ".join((text or b"").decode("utf-8", "replace").split()))

    def _called(self, what: str, call: Callable[[], Any]) -> Any:
        """Call a function, and say so before."""
        self._log(CALL + what)
        try:
            return call()
        except Exception as error:  # FMPy raises Exception itself, ctypes OSError and AttributeError
            raise Stopped(f"{what}: {error}") from error

    def _values(self, fmu: Any) -> list[Any]:
        """Return the values of all variables, one call each: one that is refused hides no other."""
        return [self._value(fmu, kind, reference) for kind, reference in self._job["variables"]]

    def _value(self, fmu: Any, kind: str, reference: int) -> Any:
        value = (HELD[kind] * 1)()
        get = getattr(fmu, f"fmi2Get{kind}")
        try:
            self._called(
                f"fmi2Get{kind} of value reference {reference}",
                lambda: get(fmu.component, (ctypes.c_uint * 1)(reference), 1, value),
            )
        except Stopped as stopped:
            if getattr(stopped.__cause__, "status", None) == FATAL:
                raise
            return None
        found = value[0]
        if kind == "Boolean":
            return bool(found)
        return found.decode("utf-8", "replace") if isinstance(found, bytes) else found


def main(path: Path) -> None:
    """Run the FMU of a job, and write beside the job how it ended."""
    job = json.loads(path.read_text(encoding="utf-8"))
    log = os.open(path.with_name("log"), os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)

    def write(line: str) -> None:
        """Write a line of the log at once: the FMU may end this process next."""
        os.write(log, line.encode("utf-8", "replace") + b"\n")

    checked = Checked(job, write)
    failed = ""
    try:
        checked.run()
    except Stopped as error:
        failed = str(error)
    result = {"failed": failed, "before": checked.before, "after": checked.after}
    partial = path.with_name("result.part")
    partial.write_text(json.dumps(result), encoding="utf-8")
    partial.replace(path.with_name("result.json"))  # whole, whatever a thread of the FMU does meanwhile


if __name__ == "__main__":
    main(Path(sys.argv[1]))
    os._exit(0)  # what the library does when it is unloaded can no longer spoil the result
