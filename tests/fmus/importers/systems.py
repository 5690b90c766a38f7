"""Systems of FMUs as the tests of this folder describe them to other people's masters.

Those masters set what is to be set right before a step, and pass outputs on to connected inputs after it: a
connection is one step late. What is read after the step from t_k to t_k+1 is the output at t_k+1 for the
inputs that were set at t_k.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from urmpipe_fmus.block import BlockModel, Variable
from urmpipe_models.elementwise import FloatArray

Number = float | int | bool
PYTHON = {"Real": float, "Integer": int, "Boolean": bool}  # the type of a variable's values
Trace = dict[str, dict[str, FloatArray]]
"""Of every block, its outputs before the first step and after each, by scalar name: shape (steps + 1,)."""


@dataclass(frozen=True, slots=True)
class Scalar:
    """A scalar variable of a block, with FMI's value reference and the variable that it belongs to."""

    block: str
    name: str
    reference: int
    variable: Variable

    @property
    def path(self) -> str:
        """The name in the whole system, as Ecos writes it."""
        return f"{self.block}::{self.name}"


@dataclass(frozen=True, slots=True)
class Block:
    """An FMU in a system, and the block model that it was made of: it has the references and types.

    `inputs` are columns of what is set before each step, `start` is set before the start; by scalar name.
    """

    fmu: Path
    unit: BlockModel
    inputs: Mapping[str, FloatArray] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class System:
    """FMUs by name, and connections: source and target, each a name of a block and one of a scalar."""

    blocks: Mapping[str, Block]
    connections: Sequence[tuple[tuple[str, str], tuple[str, str]]] = ()

    def scalar(self, block: str, name: str) -> Scalar:
        """Return a scalar of a block by name."""
        names = [known for known, _ in self.blocks[block].unit.scalars]
        reference = names.index(name)
        return Scalar(block, name, reference, self.blocks[block].unit.scalars[reference][1])

    def connected(self) -> Iterator[tuple[Scalar, Scalar]]:
        """Yield source and target of every connection."""
        for source, target in self.connections:
            yield self.scalar(*source), self.scalar(*target)

    def starts(self) -> Iterator[tuple[Scalar, Number]]:
        """Yield what is set before the start."""
        return self._typed({name: block.start for name, block in self.blocks.items()})

    def inputs(self, step: int) -> Iterator[tuple[Scalar, Number]]:
        """Yield what is set before a step."""
        rows = {name: block.inputs for name, block in self.blocks.items()}
        return self._typed({name: {u: x[step] for u, x in row.items()} for name, row in rows.items()})

    def _typed(self, values: Mapping[str, Mapping[str, float]]) -> Iterator[tuple[Scalar, Number]]:
        for block, row in values.items():
            for name, value in row.items():
                scalar = self.scalar(block, name)
                yield scalar, PYTHON[scalar.variable.type](value)

    def outputs(self) -> Iterator[Scalar]:
        """Yield all outputs."""
        for block, model in self.blocks.items():
            for reference, (name, variable) in enumerate(model.unit.scalars):
                if variable.causality == "output":
                    yield Scalar(block, name, reference, variable)


def alone(fmu: Path, unit: BlockModel, inputs: Mapping[str, FloatArray] | None = None) -> System:
    """Return a system of one FMU, the block `it`."""
    return System({"it": Block(fmu, unit, inputs or {})})


def empty_trace(system: System, steps: int) -> Trace:
    """Return a trace with room for all steps, not numbers yet."""
    trace: Trace = {name: {} for name in system.blocks}
    for scalar in system.outputs():
        trace[scalar.block][scalar.name] = np.full(steps + 1, np.nan)
    return trace
