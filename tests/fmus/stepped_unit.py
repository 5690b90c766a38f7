"""A unit that is stepped, with its variables by name, and systems of units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.cosim import Block, CosimulationRecord, System, load_system, prepare, simulate
from urmpipe_fmus.instance import Instance
from urmpipe_fmus.native import native_unavailable_reason
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.robots.catalogue import load_robot

needs_native = pytest.mark.skipif(
    bool(native_unavailable_reason(())), reason=f"builds native FMUs: {native_unavailable_reason(())}"
)


class SteppedUnit(Instance):
    """An instance of a unit, or of the shipped unit of a name with options; values are set before it runs."""

    def __init__(self, model: BlockModel | str, values: Mapping[str, Any] | None = None, **more: Any) -> None:
        super().__init__(make_block(model, **more) if isinstance(model, str) else model)
        self.put(**values or {})

    def put(self, **values: Any) -> None:
        """Set variables, an array by one value or by one per element."""
        for one in self.model.variables:
            if one.name in values:
                flat = np.ravel(np.broadcast_to(values[one.name], (one.width,))).tolist()
                self.set([self.reference(name) for name in one.names], flat)

    def read(self, *names: str) -> FloatArray:
        """Return variables, one after the other."""
        references = [self.reference(scalar) for scalar in self.scalars(*names)]
        return np.array(self.get(references), dtype=np.float64)

    def scalars(self, *names: str) -> list[str]:
        """Return the names of the scalars of variables."""
        variables = {one.name: one.names for one in self.model.variables}
        return [scalar for name in names for scalar in variables[name]]

    def steps(self, count: int, step: float) -> None:
        """Take steps from the time 0 on."""
        for k in range(count):
            self.do_step(k * step, step)


def make_unit(block: Block) -> BlockModel:
    """Return the unit of a block of a system."""
    options = dict(block.options)
    if "robot" in options:
        options["robot"] = load_robot(options["robot"])
    return make_block(block.unit, **options)


def run_system(system: System | str | Path, **changes: Any) -> CosimulationRecord:
    """Run a system with some fields changed and every communication point recorded."""
    loaded = system if isinstance(system, System) else load_system(system)
    return simulate(prepare(replace(loaded, record_every=1, **changes), make_unit))
