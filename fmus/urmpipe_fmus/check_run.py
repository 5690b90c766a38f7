"""The process in which `check_fmu` runs an FMU: `python -m urmpipe_fmus.check_run FOLDER`.

The FMU may end this process at any time. So the current call (file `call`), what the FMU logs (`log`) and the
results (`results`, one line of JSON per result, fields of `check.RunReport`) are written at once.
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
from urmpipe_fmus.process import (
    C_TYPES,
    DISCARD,
    FATAL,
    TERMINATED,
    WARNING,
    await_job,
    callbacks_with,
)
from urmpipe_models.processes import limit_memory

CALL_BYTES = 256  # of the file `call`: eight bytes with the number of the call, then its name
LOG_BYTES = 1_000_000  # of the log, and of the printed output; a longer one is discarded
MEMORY_BYTES = 8 * 2**30  # for the FMU, with what is only reserved, as runtimes do


class CallFailedError(Exception):
    """A call failed.

    Attributes:
        status: FMI's status; None where the call gave none.
    """

    def __init__(self, message: str, status: int | None = None) -> None:
        super().__init__(message)
        self.status = status


class RunJournal:
    """The files that this process leaves in its folder, written at once."""

    def __init__(self, folder: Path) -> None:
        with (folder / "call").open("r+b") as file:
            self._call = mmap.mmap(file.fileno(), CALL_BYTES)
        self._calls = 0
        flags = os.O_RDWR | os.O_CREAT | os.O_APPEND
        self._log, self._results = (os.open(folder / name, flags, 0o600) for name in ("log", "results"))
        self.logged = ""  # last message of the FMU in the current call

    def call(self, name: str) -> None:
        """Note the next call."""
        self._calls += 1
        self.logged = ""
        self._call[8:] = name.encode("utf-8", "replace")[: CALL_BYTES - 8].ljust(CALL_BYTES - 8, b"\0")
        self._call[:8] = self._calls.to_bytes(8, "little")

    def log(self, _: Any, __: Any, ___: int, ____: Any, text: bytes | None) -> None:
        """Write a message of the FMU."""
        self.logged = " ".join((text or b"").decode("utf-8", "replace").split())
        if os.fstat(self._log).st_size > LOG_BYTES:
            os.ftruncate(self._log, 0)
        os.write(self._log, self.logged.encode("utf-8", "replace") + b"\n")

    def result(self, kind: str, value: Any) -> None:
        """Write a result: a field of `check.RunReport` and its value."""
        os.write(self._results, json.dumps((kind, value)).encode() + b"\n")


class CheckedInstance:
    """An instance of an FMU whose calls are noted."""

    def __init__(self, folder: Path, job: dict[str, Any], journal: RunJournal) -> None:
        self._folder, self._job, self._journal = folder / "fmu", job, journal
        self._non_finite: set[int] = set()  # outputs that are already reported

    def run(self) -> None:
        """Load, initialize, step and free the FMU.

        Raises:
            CallFailedError: If a call fails.
        """
        fmu, start = self._load(), self._job["start"]
        self._call("fmi2Instantiate", lambda: fmu.instantiate(callbacks=self._callbacks, loggingOn=True))
        self._call("fmi2SetupExperiment", lambda: fmu.setupExperiment(startTime=start))
        self._call("fmi2EnterInitializationMode", fmu.enterInitializationMode)
        self._call("fmi2ExitInitializationMode", fmu.exitInitializationMode)
        self._journal.result("before", self._values(fmu))
        self._check_finite(fmu, start)
        self._do_steps(fmu)
        self._journal.result("after", self._values(fmu))
        self._call("fmi2Terminate", fmu.terminate)
        self._call("fmi2FreeInstance", lambda: fmu.fmi2FreeInstance(fmu.component))

    def _load(self) -> Any:
        from fmpy.fmi2 import FMU2Slave

        self._callbacks = callbacks_with(self._journal.log)
        identifier = self._job["identifier"]
        return self._call(
            "loading",
            lambda: FMU2Slave(
                guid=self._job["guid"],
                unzipDirectory=str(self._folder),
                modelIdentifier=identifier,
                libraryPath=str(find_binary(self._folder, identifier)),
                instanceName=identifier,
            ),
        )

    def _do_steps(self, fmu: Any) -> None:
        """Do the steps, until the FMU ends the run."""
        start, step, steps = (self._job[name] for name in ("start", "step", "steps"))
        for k in range(steps):
            time = start + k * step
            name = f"fmi2DoStep at {time:.9g} s"
            try:
                self._call(name, partial(fmu.fmi2DoStep, fmu.component, time, step, 1))
            except CallFailedError as error:
                if error.status != DISCARD or not self._is_terminated(fmu):
                    raise
                ended = f"ended the run (fmi2Discard, terminated) after {k} of {steps} steps"
                self._journal.result("failed", f"{name} {ended}")
                return
            self._check_finite(fmu, start + (k + 1) * step)

    def _is_terminated(self, fmu: Any) -> bool:
        """Return whether the FMU discarded a step to end the run."""
        terminated = ctypes.c_int(0)
        try:
            self._call(
                "fmi2GetBooleanStatus",
                lambda: fmu.fmi2GetBooleanStatus(fmu.component, TERMINATED, ctypes.byref(terminated)),
            )
        except CallFailedError:
            return False
        return bool(terminated.value)

    def _check_finite(self, fmu: Any, time: float) -> None:
        """Report outputs that are not finite for the first time, at a time in [s]."""
        watched = [(i, reference) for i, reference in self._job["watched"] if i not in self._non_finite]
        if not watched:
            return
        count = len(watched)
        values = (ctypes.c_double * count)()
        references = (ctypes.c_uint * count)(*(reference for _, reference in watched))
        self._get(
            f"fmi2GetReal at {time:.9g} s", partial(fmu.fmi2GetReal, fmu.component, references, count, values)
        )
        for (i, _), value in zip(watched, values, strict=True):
            if not math.isfinite(value):
                self._non_finite.add(i)
                self._journal.result("first_non_finite", (time, i, value))

    def _values(self, fmu: Any) -> list[Any]:
        """Return the values of all variables, one call each: a rejected call hides no other value."""
        return [self._value(fmu, kind, reference) for kind, reference in self._job["variables"]]

    def _value(self, fmu: Any, kind: str, reference: int) -> Any:
        values = (C_TYPES[kind] * 1)()
        get = getattr(fmu, f"fmi2Get{kind}")
        name = f"fmi2Get{kind} of value reference {reference}"
        if not self._get(name, lambda: get(fmu.component, (ctypes.c_uint * 1)(reference), 1, values)):
            return None
        value = values[0]
        if kind == "Boolean":
            return bool(value)
        return value.decode("utf-8", "replace") if isinstance(value, bytes) else value

    def _get(self, name: str, call: Callable[[], Any]) -> bool:
        """Get values; return whether the call succeeded."""
        try:
            self._call(name, call)
        except CallFailedError as error:
            if error.status == FATAL:  # no further call is allowed
                raise
            return False
        return True

    def _call(self, name: str, call: Callable[[], Any]) -> Any:
        """Note a call, then make it."""
        self._journal.call(name)
        try:
            status = call()
        except Exception as error:  # FMPy raises Exception itself, ctypes OSError and AttributeError
            raise CallFailedError(f"{name}: {error}", getattr(error, "status", None)) from error
        if status == WARNING:
            self._journal.result("warned", (name, self._journal.logged))
        return status


def main(folder: Path) -> None:
    """Run the FMU of the job in a folder, and write the results there."""
    import fmpy.fmi2  # noqa: F401 - loaded while the job is prepared

    await_job(folder)
    job = json.loads((folder / "job.json").read_text(encoding="utf-8"))
    journal = RunJournal(folder)
    limit_memory(MEMORY_BYTES)
    try:
        CheckedInstance(folder, job, journal).run()
    except CallFailedError as error:
        journal.result("failed", str(error))
    journal.result("complete", True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
    os._exit(0)  # without unloading the library, which could still crash
