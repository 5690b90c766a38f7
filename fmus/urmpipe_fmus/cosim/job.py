"""What the process that runs the FMUs is told: numbers, places and paths, nothing to be looked up.

Values live in one vector a type. Its places are, in this order: inputs from logs, outputs in the order in
which they are read, and torn inputs of algebraic loops. What is read together stands together.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

TYPES = ("Real", "Integer", "Boolean")
"""The types of numbers, in the order of the recorded columns."""

JOB, RECORDED, NOT_FINITE, WARNED, PROGRESS, RESULT, LOG, SAID = (
    "job.pickle",
    "recorded.bin",
    "not_finite.bin",
    "warned.bin",
    "progress.bin",
    "result.json",
    "log.txt",
    "said.txt",
)
"""Files in the folder of a run; LOG holds what the FMUs log, SAID what they print.

NOT_FINITE has three rows of doubles with a column for each recorded Real: of its values that are not finite
the first, the communication point of that, and how many there were. WARNED has two rows with a column for
each `call_code`: how often it returned fmi2Warning, and the communication point of the first.
"""

FUNCTIONS = (
    "loading",
    "fmi2Instantiate",
    "fmi2SetupExperiment",
    "fmi2SetReal",
    "fmi2SetInteger",
    "fmi2SetBoolean",
    "fmi2SetString",
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2GetReal",
    "fmi2GetInteger",
    "fmi2GetBoolean",
    "fmi2DoStep",
    "fmi2GetBooleanStatus",
    "fmi2GetRealStatus",
    "fmi2GetFMUstate",
    "fmi2SetFMUstate",
    "fmi2FreeFMUstate",
    "fmi2Terminate",
    "fmi2FreeInstance",
)
"""What a block can be doing."""

CALLS = 2**24
"""More than there are codes of calls: what a call is and its number are kept in one integer."""

ELSEWHERE = CALLS - 1
"""The call while no block is called."""

next_call = count(0, CALLS).__next__
"""Gives the number of a call, times `CALLS`."""


class Progress(ctypes.Structure):
    """How far a run is: shared with the parent, and still there when the process is not.

    Attributes:
        rows: Rows recorded.
        k: The communication point.
        call: Block and function being called, see `call_code`, plus `next_call()`: each call has another.
        done: Whether all is done that the process was for: an FMU can end it before, with any exit code.
        ended: Where the last row stands in [s] if it was read once more as an FMU ended the run; else 0.
        loop_seconds: How long the loop over the communication points took in [s]; 0 until it ends.
    """

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("rows", "k", "call", "done")),
        *((name, ctypes.c_double) for name in ("ended", "loop_seconds")),
    )

    def begin(self, code: int) -> None:
        """Note what is called next, see `call_code`."""
        self.call = code + next_call()

    @property
    def code(self) -> int:
        """Block and function being called, see `call_code`."""
        return int(self.call % CALLS)


def call_code(block: int, function: str) -> int:
    """Return a block and a function as one number."""
    return block * len(FUNCTIONS) + FUNCTIONS.index(function)


def called(code: int) -> tuple[int, str]:
    """Return the block and the function of a `call_code`."""
    block, function = divmod(code, len(FUNCTIONS))
    return block, FUNCTIONS[function]


@dataclass(frozen=True, slots=True)
class Transfer:
    """Values that go into a block or come out of it in one call.

    Attributes:
        type: Real, Integer or Boolean.
        references: Value references.
        places: Their places in the vector of the type.
    """

    type: str
    references: tuple[int, ...]
    places: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class ExchangeJob:
    """An exchange: its block by number, what is set, what is read."""

    block: int
    sets: tuple[Transfer, ...]
    gets: tuple[Transfer, ...]


@dataclass(frozen=True, slots=True)
class LoopJob:
    """An algebraic loop.

    Attributes:
        exchanges: One sweep.
        torn: Places of the torn inputs.
        sources: Places of their sources.
        minimum: The least value that an input of the loop may have, in its own unit, at the place that it
            follows, shape (places,).
        maximum: The largest, likewise.
        nominal: The size of the values of each torn input, in its unit, shape (torn,).
        ring: The loop, for people.
    """

    exchanges: tuple[ExchangeJob, ...]
    torn: tuple[int, ...]
    sources: tuple[int, ...]
    minimum: NDArray[np.float64]
    maximum: NDArray[np.float64]
    nominal: NDArray[np.float64]
    ring: str


@dataclass(frozen=True, slots=True)
class BlockJob:
    """A block.

    Attributes:
        name: Its name.
        folder: Where its FMU is unpacked.
        identifier: Name of its binary.
        guid: Of its FMU.
        variable_step: Whether its steps may differ in the last bit.
        can_save: Whether its state can be saved.
        starts: Type, value reference and value of what is set before the first step.
    """

    name: str
    folder: Path
    identifier: str
    guid: str
    variable_step: bool
    can_save: bool
    starts: tuple[tuple[str, int, Any], ...]


@dataclass(frozen=True, slots=True)
class Job:
    """A run.

    Attributes:
        step: Communication step in [s].
        count: Number of steps.
        record_every: Every so many points are recorded.
        tolerance: Of iterated loops.
        blocks: The blocks.
        order: The exchanges of a communication point.
        logged: Values from logs at the points by type, each in its own unit, shape (count + 1,
            inputs of the type).
        recorded: How many places of each type are recorded, from the first.
        start: The values at the start by type, each in its own unit, shape (places,).
    """

    step: float
    count: int
    record_every: int
    tolerance: float
    blocks: tuple[BlockJob, ...]
    order: tuple[ExchangeJob | LoopJob, ...]
    logged: Mapping[str, NDArray[Any]]
    recorded: Mapping[str, int]
    start: Mapping[str, NDArray[Any]]

    @property
    def rows(self) -> int:
        """How many rows a run may record: those of a whole run, and where an FMU ends it one more."""
        return self.count // self.record_every + 2

    @property
    def calls(self) -> int:
        """How many codes of calls there are."""
        return len(self.blocks) * len(FUNCTIONS)

    @property
    def columns(self) -> int:
        """How many columns are recorded."""
        return sum(self.recorded.values())
