"""The job of the process that runs the FMUs of a system: numbers, places and paths, without names to resolve.

The values of a system are one vector per type. Its places are, in this order: inputs from logs, outputs in
the order in which they are read, and torn inputs of algebraic loops. Values read together are neighbours.
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

TYPES = ("Real", "Integer", "Boolean")  # numeric types, in the order of the recorded columns

# Files in the folder of a run. NOT_FINITE has three rows of doubles with a column per recorded Real: the
# first value that is not finite, its communication point, and the number of such values. WARNED has two rows
# with a column per call code: the number of times that the call returned fmi2Warning, and the communication
# point of the first.
JOB = "job.pickle"
RECORDED = "recorded.bin"
NOT_FINITE = "not_finite.bin"
WARNED = "warned.bin"
PROGRESS = "progress.bin"
RESULT = "result.json"
LOG = "log.txt"  # messages that the FMUs log

FUNCTIONS = (  # calls of an FMU
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
CODES = 2**24  # more than there are codes; code and number of a call are one integer, number * CODES + code
NO_CALL = CODES - 1  # the code while no block is called
next_call = count(0, CODES).__next__  # returns the number of the next call, times CODES


def encode_call(block: int, function: str) -> int:
    """Return a block and a function as one number."""
    return block * len(FUNCTIONS) + FUNCTIONS.index(function)


def decode_call(code: int) -> tuple[int, str]:
    """Return the block and the function of a code."""
    block, function = divmod(code, len(FUNCTIONS))
    return block, FUNCTIONS[function]


class Progress(ctypes.Structure):
    """Progress of a run, in memory shared with the parent, which outlives the process.

    Attributes:
        rows: Number of recorded rows.
        k: The communication point.
        call: The current call: its code, see `encode_call`, plus `next_call()`, so that no two are equal.
        done: Whether the job is complete: an FMU can end the process before, with any exit code.
        ended: Time of the last row in [s] if it was read once more as an FMU ended the run; else 0.
        loop_seconds: Duration of the loop over the communication points in [s]; 0 until it ends.
    """

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("rows", "k", "call", "done")),
        *((name, ctypes.c_double) for name in ("ended", "loop_seconds")),
    )

    def begin(self, code: int) -> None:
        """Note the code of the next call."""
        self.call = code + next_call()

    @property
    def code(self) -> int:
        """Code of the current call."""
        return int(self.call % CODES)


@dataclass(frozen=True, slots=True)
class Transfer:
    """Values that are set or read by one call.

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
    """An exchange: number of its block, what is set, what is read."""

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
        minimum: The minimum of the loop's inputs that follow each place, in their unit, shape (places,).
        maximum: The maximum, in their unit, shape (places,).
        nominal: The magnitude of each torn input, in its unit, shape (torn,).
        ring: The loop as text.
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
        folder: Folder of its unpacked FMU.
        identifier: Name of its binary.
        guid: Of its FMU.
        variable_step: Whether its steps may differ in the last bit.
        can_save: Whether its state can be saved.
        starts: Type, value reference and value of each start value.
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
        record_every: Number of communication points per recorded one.
        tolerance: Of iterated loops, relative to nominal + |value|.
        blocks: The blocks.
        order: The exchanges of a communication point.
        logged: Values from logs at the points by type, each in its own unit, shape (count + 1,
            inputs of the type).
        recorded: Number of recorded places of each type, from the first.
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
        """Maximum number of recorded rows: those of a full run, and one more where an FMU ends it."""
        return self.count // self.record_every + 2

    @property
    def calls(self) -> int:
        """Number of call codes."""
        return len(self.blocks) * len(FUNCTIONS)

    @property
    def columns(self) -> int:
        """Number of recorded columns."""
        return sum(self.recorded.values())
