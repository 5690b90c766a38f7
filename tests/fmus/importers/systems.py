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


@dataclass(frozen=True, slots=True)
class Scalar:
    """A scalar variable of a block.

    Attributes:
        block: Name of the block.
        name: As FMI has it: `phi[1]`.
        reference: FMI's value reference.
        variable: The unit's variable that it belongs to.
    """

    block: str
    name: str
    reference: int
    variable: Variable

    @property
    def path(self) -> str:
        """The name in the whole system, as Ecos writes it."""
        return f"{self.block}::{self.name}"

    def python(self, value: float) -> float | int | bool:
        """Return a value as Python's kind for the variable's type."""
        kind = {"Real": float, "Integer": int, "Boolean": bool}[self.variable.type]
        return kind(value)  # type: ignore[no-any-return]


@dataclass(frozen=True, slots=True)
class Block:
    """An FMU in a system.

    Attributes:
        fmu: Its file.
        unit: The unit that it was made of: it knows the variables' references and types.
        inputs: Columns of what is set before each step, by scalar name, shape (steps,) or longer.
        start: What is set before the start, by scalar name.
    """

    fmu: Path
    unit: BlockModel
    inputs: Mapping[str, FloatArray] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)


Trace = dict[str, dict[str, FloatArray]]
"""Of every block, its outputs before the first step and after each, by scalar name: shape (steps + 1,)."""


@dataclass(frozen=True, slots=True)
class System:
    """FMUs and their connections.

    Attributes:
        blocks: By name.
        connections: Source and target, each a name of a block and one of a scalar.
    """

    blocks: Mapping[str, Block]
    connections: Sequence[tuple[tuple[str, str], tuple[str, str]]] = ()

    def scalar(self, block: str, name: str) -> Scalar:
        """Return a scalar of a block by name."""
        for reference, (known, variable) in enumerate(self.blocks[block].unit.scalars):
            if known == name:
                return Scalar(block, name, reference, variable)
        raise KeyError(f"{block}: no {name}")

    def connected(self) -> Iterator[tuple[Scalar, Scalar]]:
        """Yield source and target of every connection."""
        for source, target in self.connections:
            yield self.scalar(*source), self.scalar(*target)

    def starts(self) -> Iterator[tuple[Scalar, float | int | bool]]:
        """Yield what is set before the start."""
        for name, block in self.blocks.items():
            for one, value in block.start.items():
                scalar = self.scalar(name, one)
                yield scalar, scalar.python(value)

    def inputs(self, step: int) -> Iterator[tuple[Scalar, float | int | bool]]:
        """Yield what is set before a step."""
        for name, block in self.blocks.items():
            for one, values in block.inputs.items():
                scalar = self.scalar(name, one)
                yield scalar, scalar.python(values[step])

    def outputs(self) -> Iterator[Scalar]:
        """Yield all outputs."""
        for name, block in self.blocks.items():
            for one, variable in block.unit.scalars:
                if variable.causality == "output":
                    yield self.scalar(name, one)


def alone(fmu: Path, unit: BlockModel, inputs: Mapping[str, FloatArray] | None = None) -> System:
    """Return a system of one FMU, the block `it`."""
    return System({"it": Block(fmu, unit, inputs or {})})


def empty_trace(system: System, steps: int) -> Trace:
    """Return a trace with room for all steps, not numbers yet."""
    trace: Trace = {name: {} for name in system.blocks}
    for scalar in system.outputs():
        trace[scalar.block][scalar.name] = np.full(steps + 1, np.nan)
    return trace
