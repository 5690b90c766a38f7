"""FMUs called bare: FMPy loads them, then nothing stands between the loop and the C functions."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class BareFmu:
    """An FMU that was initialized, with buffers for its Real variables by name.

    Attributes:
        references: Value reference of each variable, by name.
    """

    def __init__(self, fmu: Path) -> None:
        from fmpy import extract, read_model_description
        from fmpy.fmi2 import FMU2Slave

        folder = extract(str(fmu))
        model = read_model_description(folder)
        identifier = model.coSimulation.modelIdentifier
        self.references = {one.name: one.valueReference for one in model.modelVariables}
        self.slave = FMU2Slave(
            guid=model.guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName=identifier
        )
        self.slave.instantiate()
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        self._step = self._function("fmi2DoStep", ctypes.c_double, ctypes.c_double, ctypes.c_int)

    def _function(self, name: str, *types: Any) -> Any:
        """Return a C function of the FMU that takes the instance first."""
        function = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, *types)
        return function((name, self.slave.dll))

    def reals(self, kind: str, names: Sequence[str], buffer: FloatArray) -> Callable[[], int]:
        """Return a call that sets or gets variables from or to a buffer, shape (len(names),).

        Args:
            kind: `Set` or `Get`.
            names: The variables.
            buffer: Contiguous; kept alive by the caller.
        """
        count = len(names)
        references = (ctypes.c_uint32 * count)(*(self.references[name] for name in names))
        function = self._function(f"fmi2{kind}Real", ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
        component, address = self.slave.component, buffer.ctypes.data
        return lambda: int(function(component, references, count, address))

    def do_step(self, time: float, step: float) -> int:
        """Call fmi2DoStep."""
        return int(self._step(self.slave.component, time, step, 1))

    def close(self) -> None:
        """End the instance and remove what was unpacked."""
        self.slave.terminate()
        self.slave.freeInstance()
