"""FMUs called bare: FMPy loads them, then nothing stands between the loop and the C functions."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.cosim.job import ExchangeJob, Job, Transfer

FloatArray = NDArray[np.float64]
Call = Callable[[], object]


class BareFmu:
    """An FMU that was unpacked and is initialized here; no status is looked at.

    Args:
        folder: Where it is unpacked.
        identifier: Its model identifier.
        guid: Its GUID.
        starts: Reals that are set before, by value reference.
    """

    def __init__(
        self, folder: Path, identifier: str, guid: str, starts: Mapping[int, float] | None = None
    ) -> None:
        from fmpy.fmi2 import FMU2Slave

        self._slave = FMU2Slave(
            guid=guid, unzipDirectory=str(folder), modelIdentifier=identifier, instanceName=identifier
        )
        self._slave.instantiate()
        self._slave.setupExperiment(startTime=0.0)
        if starts:
            self._slave.setReal(list(starts), list(starts.values()))
        self._slave.enterInitializationMode()
        self._slave.exitInitializationMode()
        self.do_step = partial(
            self._function("fmi2DoStep", ctypes.c_double, ctypes.c_double, ctypes.c_int),
            self._slave.component,
        )

    def _function(self, name: str, *types: Any) -> Any:
        """Return a C function of the FMU that takes the instance first."""
        function = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, *types)
        return function((name, self._slave.dll))

    def exchange(self, name: str, references: Sequence[int], buffer: NDArray[Any]) -> Call:
        """Return the call of fmi2SetReal and its like between the FMU and a buffer that the caller keeps."""
        held = (ctypes.c_uint32 * len(references))(*references)
        function = self._function(name, ctypes.c_uint32 * len(references), ctypes.c_size_t, ctypes.c_void_p)
        count, address = ctypes.c_size_t(len(references)), ctypes.c_void_p(buffer.ctypes.data)
        return partial(function, ctypes.c_void_p(self._slave.component), held, count, address)

    def close(self) -> None:
        """End the instance."""
        self._slave.terminate()
        self._slave.freeInstance()


def opened(fmu: Path) -> tuple[BareFmu, dict[str, int]]:
    """Unpack and initialize an FMU; return it, and the value references by name."""
    from fmpy import extract, read_model_description

    folder = extract(str(fmu))
    model = read_model_description(folder)
    references = {one.name: one.valueReference for one in model.modelVariables}
    return BareFmu(Path(folder), model.coSimulation.modelIdentifier, model.guid), references


def run_bare(job: Job, recorded: FloatArray) -> None:
    """Run the job of a co-simulation as barely as Python can: the same calls, in one loop.

    Args:
        job: A system without loops and without inputs from logs.
        recorded: Where its outputs go, shape (rows, columns).
    """
    blocks = [BareFmu(one.folder, one.identifier, one.guid) for one in job.blocks]
    values = {kind: start.copy() for kind, start in job.start.items()}
    calls: list[Call] = []
    for one in job.order:
        assert isinstance(one, ExchangeJob)
        for kind, transfers in (("Set", one.sets), ("Get", one.gets)):
            for transfer in transfers:
                calls += between(blocks[one.block], f"fmi2{kind}{transfer.type}", transfer, values)
    shares, first = [], 0
    for kind, count in job.recorded.items():
        shares.append((slice(first, first + count), values[kind][:count]))
        first += count
    for k in range(job.count + 1):
        for call in calls:
            call()
        for columns, share in shares:
            recorded[k, columns] = share
        for block in blocks:
            block.do_step(k * job.step, job.step, 1)
    for block in blocks:
        block.close()


def between(block: BareFmu, name: str, transfer: Transfer, values: dict[str, NDArray[Any]]) -> list[Call]:
    """Return the calls that move values between a block and their places."""
    vector, places = values[transfer.type], np.array(transfer.places)
    if (np.diff(places) == 1).all():
        return [block.exchange(name, transfer.references, vector[places[0] : places[-1] + 1])]
    gathered = vector[places]
    return [
        partial(vector.take, places, None, gathered, "clip"),
        block.exchange(name, transfer.references, gathered),
    ]
