"""A system of blocks: what is run together, how it is connected, and for how long."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from urmpipe_models.errors import Finding

SYSTEMS = Path(__file__).parents[1] / "systems"
"""Where the shipped systems are."""

STEP = 0.005
"""Communication step in [s] of a system that names none and plays no log."""

TOLERANCE = 1e-9
"""What is left of an algebraic loop, relative to nominal + |value|, unless the system says otherwise."""


class Port(NamedTuple):
    """A variable of a block, or an array of them.

    Attributes:
        block: Name of the block.
        variable: Name of a scalar (`tau`, `phi[2]`), or of an array (`phi`: all its elements).
    """

    block: str
    variable: str

    def __str__(self) -> str:
        return f"{self.block}.{self.variable}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A block: an FMU under a name of its own.

    Attributes:
        name: Its name in the system.
        unit: Name of a unit of urmpipe; empty if it is a file.
        file: A user's Python file with a unit in it.
        fmu: An FMU of any origin.
        options: Options of the unit: text, numbers, yes or no, lists of them.
        start: Values of parameters, inputs and states at the start, by name.
    """

    name: str
    unit: str = ""
    file: Path | None = None
    fmu: Path | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    start: Mapping[str, Any] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """What it is, for people: the name of the unit or of the file."""
        path = self.file or self.fmu
        return path.name if path else self.unit


@dataclass(frozen=True, slots=True)
class Connection:
    """A destination, an input, that follows a source, an output."""

    destination: Port
    source: Port


@dataclass(frozen=True, slots=True, kw_only=True)
class LogInput:
    """An input that follows a column of a log.

    Attributes:
        destination: The input.
        log: The file; empty where the system file tells the input wrongly.
        column: Name of the column.
        interpolate: Linearly between rows; else each row is held until the next.
    """

    destination: Port
    log: str
    column: str
    interpolate: bool = False


@dataclass(frozen=True, kw_only=True)
class System:
    """Blocks that run together.

    Attributes:
        name: Its name.
        path: The file that describes it.
        description: One line for people.
        step: Communication step in [s]; None: the period of the logs that it plays, else `STEP`.
        duration: In [s]; None: as long as the longest log that it reads.
        record_every: Every so many communication points are recorded.
        arguments: The values that `$name` stood for.
        blocks: In the order of the file.
        connections: In the order of the file.
        inputs: Inputs from logs.
        iterate: Whether algebraic loops are iterated; else they are errors.
        tolerance: What may be left of an iterated loop, relative to nominal + |value|.
        faults: What is wrong with the file; `prepare` tells it with all else.
        unread: Names of the blocks that are not what the file means, as something in them is wrong.
    """

    name: str
    path: Path
    description: str = ""
    step: float | None = None
    duration: float | None = None
    record_every: int = 1
    arguments: Mapping[str, Any] = field(default_factory=dict)
    blocks: tuple[Block, ...] = ()
    connections: tuple[Connection, ...] = ()
    inputs: tuple[LogInput, ...] = ()
    iterate: bool = False
    tolerance: float = TOLERANCE
    faults: tuple[Finding, ...] = ()
    unread: frozenset[str] = frozenset()

    @cached_property
    def by_name(self) -> dict[str, Block]:
        """The blocks by name."""
        return {block.name: block for block in self.blocks}
