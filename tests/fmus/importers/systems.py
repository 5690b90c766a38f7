"""Shipped units, inputs for them, and systems of FMUs as the tests describe them to other people's masters.

Those masters set what is to be set right before a step, and pass outputs on to connected inputs after it: a
connection is one step late. What is read after the step from t_k to t_k+1 is the output at t_k+1 for the
inputs that were set at t_k.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from shipped_units import UNITS, URM6
from urmpipe_fmus.block import BlockModel, Input, Table, Variable
from urmpipe_fmus.blocks import make_block
from urmpipe_models.elementwise import FloatArray

STEP = 0.005  # s; communication step
MAX_INPUT = 2.0  # of inputs without bounds: angles, rates and volts for a small drive
CROSS_BUILT = ("delta_meter", "repolarizer", "log_source")  # booleans, integers, a table; states: native/


def shipped_unit(name: str) -> BlockModel:
    """Return a shipped unit by name, of six joints where it has some."""
    t, joints = sample_times(400), np.arange(6)
    swings = Table(np.rint(t * 1e9).astype(np.int64), np.sin(3.0 * t[:, None] + joints) + 0.1 * joints)
    options: dict[str, dict[str, Any]] = {
        "kinematic_chain": UNITS["a URM arm with rates"][1],
        "log_source": {"table": swings, "columns": [("q", "rad", 6)], "interpolate": True},
        "repolarizer": {"joints": 6},
        "network_motion": {"network": "four-bar"},
        **{arm: {"robot": URM6} for arm in ("chain_dynamics", "driven_arm")},
    }
    return make_block(name, **options.get(name, {}))


def sample_times(count: int, step: float = STEP) -> FloatArray:
    """Return the communication points in [s]."""
    return step * np.arange(count, dtype=np.float64)


def drawn(variable: Input, rng: np.random.Generator) -> FloatArray:
    """Return a value that an input may take, shape (width,)."""
    if variable.type == "Boolean":
        return rng.integers(0, 2, variable.width).astype(np.float64)
    low, high = max(variable.minimum, -MAX_INPUT), min(variable.maximum, MAX_INPUT)
    values = rng.uniform(low, high, variable.width)
    return np.round(values) if variable.type == "Integer" else values


def drawn_inputs(unit: BlockModel, rows: int, seed: int = 5) -> dict[str, FloatArray]:
    """Return values of all inputs that change every second row: shape (rows,), or (rows, size)."""
    rng = np.random.default_rng(seed)
    inputs: dict[str, FloatArray] = {}
    for variable in unit.inputs:
        values = np.array([drawn(variable, rng) for _ in range((rows + 1) // 2)])
        values = np.repeat(values, 2, axis=0)[:rows]
        inputs[variable.name] = values[:, 0] if variable.size is None else values
    return inputs


def columns(unit: BlockModel, values: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return values by variable as one column a scalar, by the scalar's name: shape (rows,)."""
    found: dict[str, FloatArray] = {}
    for variable in unit.variables:
        if variable.name in values:
            rows = np.asarray(values[variable.name], dtype=np.float64)
            found |= zip(variable.names, rows.reshape(len(rows), -1).T, strict=True)
    return found


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
    """An FMU in a system, its block model, and columns of input values by the names of scalars."""

    fmu: Path
    unit: BlockModel
    inputs: Mapping[str, FloatArray] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class System:
    """FMUs by name, and connections: source and target, each a name of a block and one of a scalar."""

    blocks: Mapping[str, Block]
    connections: Sequence[tuple[tuple[str, str], tuple[str, str]]] = ()

    def scalars(self, block: str) -> dict[str, Scalar]:
        """Return the scalars of a block by name."""
        scalars = enumerate(self.blocks[block].unit.scalars)
        return {name: Scalar(block, name, k, variable) for k, (name, variable) in scalars}

    def connected(self) -> Iterator[tuple[Scalar, Scalar]]:
        """Yield source and target of every connection."""
        for (source, output), (target, name) in self.connections:
            yield self.scalars(source)[output], self.scalars(target)[name]

    def inputs(self, step: int) -> Iterator[tuple[Scalar, float | int | bool]]:
        """Yield what is set before a step."""
        for block, model in self.blocks.items():
            scalars = self.scalars(block)
            for name, values in model.inputs.items():
                yield scalars[name], PYTHON[scalars[name].variable.type](values[step])

    def outputs(self) -> list[Scalar]:
        """Return all outputs."""
        scalars = [scalar for block in self.blocks for scalar in self.scalars(block).values()]
        return [scalar for scalar in scalars if scalar.variable.causality == "output"]


def alone(fmu: Path, unit: BlockModel, inputs: Mapping[str, FloatArray] | None = None) -> System:
    """Return a system of one FMU, the block `it`."""
    return System({"it": Block(fmu, unit, inputs or {})})


def empty_trace(system: System, steps: int) -> Trace:
    """Return a trace with room for all steps, not numbers yet."""
    trace: Trace = {name: {} for name in system.blocks}
    for scalar in system.outputs():
        trace[scalar.block][scalar.name] = np.full(steps + 1, np.nan)
    return trace
