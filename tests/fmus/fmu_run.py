"""An FMU of a unit run as a master runs it: set, get, step, on FMPy's low-level calls."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, Self

import numpy as np

from loaded_fmu import Loaded
from urmpipe_fmus.block import BlockModel, Variable
from urmpipe_models.elementwise import FloatArray


class FmuRun:
    """An instance of the FMU of a unit, whose variables are set and got by the unit's names.

    `start` is set before the first step; `time` is where it starts in [s].
    """

    def __init__(self, path: Path, model: BlockModel, start: Mapping[str, Any], time: float = 0.0) -> None:
        self.path, self.model, self.start, self.time = path, model, start, time
        self._index = {name: index for index, (name, _) in enumerate(model.scalars)}

    def __enter__(self) -> Self:
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self._loaded = Loaded(self.path, self.time, Path(self._folder.name), self._put_start)
        return self

    def _put_start(self, loaded: Loaded) -> None:
        """Set what is set before the initialization."""
        self.fmu = loaded.fmu
        self.put(self.start)

    def __exit__(self, *_: object) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        self._folder.cleanup()

    def put(self, values: Mapping[str, Any]) -> None:
        """Set variables by name."""
        for one in self.model.variables:
            if one.name in values:
                found = np.ravel(np.broadcast_to(values[one.name], (one.width,))).tolist()
                whole = [value if one.type == "Real" else int(value) for value in found]
                getattr(self.fmu, f"set{one.type}")(self._references(one), whole)

    def get(self, variables: Sequence[Variable]) -> list[float]:
        """Return the scalars of some variables."""
        found: list[float] = []
        for kind, some in groupby(variables, key=lambda one: one.type):
            references = [reference for one in some for reference in self._references(one)]
            found += [float(value) for value in getattr(self.fmu, f"get{kind}")(references)]
        return found

    def over(self, t: FloatArray, columns: Mapping[str, Any]) -> FloatArray:
        """Return what it shows at every sample for the inputs of that sample, a column a scalar."""
        shown = [one for one in self.model.variables if one.causality == "output"]
        rows = []
        for k, time in enumerate(t.tolist()):
            self.put({name: column[k] for name, column in columns.items()})
            rows.append(self.get(shown))
            if k + 1 < len(t):
                self.fmu.doStep(time, float(t[k + 1]) - time)
        return np.array(rows, dtype=np.float64)

    def _references(self, one: Variable) -> list[int]:
        """Return the value references of a variable's elements."""
        return [self._index[name] for name in one.names]
