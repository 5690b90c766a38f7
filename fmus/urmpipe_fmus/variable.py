"""The variables of a unit: what FMI knows of a quantity, and what the unit does with it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from numbers import Real
from typing import Literal

from urmpipe_fmus.si_units import coherent, display_conversion, same_unit
from urmpipe_models.errors import UnitError, shown

Causality = Literal["parameter", "input", "output", "local"]
Variability = Literal["fixed", "tunable", "discrete", "continuous"]
ValueType = Literal["Real", "Integer", "Boolean"]

LARGEST_INTEGER = 2**31 - 1
"""FMI 2.0's integers have 32 bits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable(ABC):
    """A quantity of a unit; an array of them, `name[1]` .. `name[size]`, if it has a size.

    Attributes:
        name: An identifier; the unit's functions read it as `v.name`.
        description: One line for people.
        unit: Spelled as FMI does: rad, m/s, N.m, kg.m2; empty for a number without a unit.
        display_unit: The unit that people like to see, such as deg; empty for the unit itself.
        start: Its value at the start, one for all or one an element.
        minimum: The least value allowed.
        maximum: The largest value allowed.
        size: Number of elements; None for a scalar.
        type: Real, or Integer or Boolean for numbers that stand for one; the functions see numbers (0, 1).
    """

    name: str
    description: str
    unit: str = ""
    display_unit: str = ""
    start: float | tuple[float, ...] = 0.0
    minimum: float = -math.inf
    maximum: float = math.inf
    size: int | None = None
    type: ValueType = "Real"

    @property
    @abstractmethod
    def causality(self) -> Causality:
        """What FMI calls the variable's part."""

    @property
    def variability(self) -> Variability:
        """When the variable may change."""
        return "continuous" if self.type == "Real" else "discrete"

    @property
    def width(self) -> int:
        """How many scalars it is."""
        return 1 if self.size is None else self.size

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its scalars: `name`, or `name[1]`, `name[2]`, ..."""
        if self.size is None:
            return (self.name,)
        return tuple(f"{self.name}[{i}]" for i in range(1, self.size + 1))

    @property
    def starts(self) -> tuple[float, ...]:
        """The start value of each scalar."""
        if isinstance(self.start, tuple):
            return self.start
        return (float(self.start),) * self.width

    def start_of(self, scalar: str) -> float:
        """Return the start value of one of its scalars, by the name of that."""
        index = 0 if self.size is None else int(scalar[len(self.name) + 1 : -1]) - 1
        return self.starts[index]

    def faults(self) -> Iterator[str]:
        """Yield what is wrong with the variable."""
        if not (self.name.isidentifier() and self.name.isascii()) or self.name.startswith("_"):
            yield f"{shown(self.name)}: found as a name, allowed: a letter, then letters, digits and _"
        starts = self.start if isinstance(self.start, tuple) else (self.start,)
        if not all(isinstance(one, Real) for one in starts):
            yield f"{self.name}: start value {shown(self.start)}, allowed: a number, or a tuple of numbers"
            return
        if self.size is not None and self.size < 1:
            yield f"{self.name}: size {self.size}, allowed: 1 or more"
        elif len(self.starts) != self.width:
            yield f"{self.name}: found {len(self.starts)} start values, allowed: {self.width}"
        if not self.minimum <= self.maximum:
            yield f"{self.name}: min {self.minimum:g} above max {self.maximum:g}"
        yield from (f"{self.name}: {fault}" for fault in self._unit_faults())
        for name, start in zip(self.names, self.starts, strict=False):
            yield from (f"{name}: start value {fault}" for fault in self.refusals(start))

    def _unit_faults(self) -> Iterator[str]:
        if self.type != "Real" and (self.unit or self.display_unit):
            yield f"found {self.type} with a unit, allowed: a unit of a Real"
            return
        if self.display_unit and not self.unit:
            yield f"found display unit {shown(self.display_unit)} without a unit, allowed: both or none"
        try:
            if self.unit:
                display_conversion(self.unit, self.display_unit or self.unit)
                yield from self._factor_faults()
        except UnitError as error:
            yield str(error)

    def _factor_faults(self) -> Iterator[str]:
        """Yield why a unit is none that a model's equations can be written in: 1 deg/s is not 1 rad/s."""
        in_si = coherent(self.unit)
        if not same_unit(self.unit, in_si):
            as_well = f", with display_unit={self.unit!r} to show it so" if not self.display_unit else ""
            yield f"found unit {self.unit!r}, allowed: values in SI, unit={in_si!r}{as_well}"

    def refusals(self, value: float) -> Iterator[str]:
        """Yield why one of its scalars cannot take a value: not finite, out of range, no integer."""
        if not math.isfinite(value):
            yield f"found {value:g}, allowed: a finite number"
        elif not self.minimum <= value <= self.maximum:
            yield f"found {value:.17g}, allowed: {self.minimum:.15g} to {self.maximum:.15g}"
        elif self.type == "Integer" and (value != round(value) or abs(value) > LARGEST_INTEGER):
            yield f"found {value:.17g}, allowed: an integer of 32 bits"
        elif self.type == "Boolean" and value not in (0.0, 1.0):
            yield f"found {value:.17g}, allowed: 0 or 1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter(Variable):
    """A constant of the model: tunable (may change between steps), or fixed once the simulation runs.

    Attributes:
        tunable: Whether it may change while the simulation runs.
    """

    tunable: bool = True

    @property
    def causality(self) -> Causality:
        """Parameter."""
        return "parameter"

    @property
    def variability(self) -> Variability:
        """Tunable or fixed."""
        return "tunable" if self.tunable else "fixed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Input(Variable):
    """A quantity that the unit is given at every communication point."""

    @property
    def causality(self) -> Causality:
        """Input."""
        return "input"


@dataclass(frozen=True, slots=True, kw_only=True)
class Output(Variable):
    """A quantity that the unit's `outputs` computes from time, parameters, inputs and states.

    Its start value is not used: what it starts with is computed.
    """

    @property
    def causality(self) -> Causality:
        """Output."""
        return "output"


@dataclass(frozen=True, slots=True, kw_only=True)
class Remembered(Variable):
    """A quantity that the unit remembers from step to step: a `State` or a `Memory`.

    Attributes:
        output: Whether it is an output itself; else it is local, to be looked at.
    """

    output: bool = False

    @property
    def causality(self) -> Causality:
        """Output or local."""
        return "output" if self.output else "local"


@dataclass(frozen=True, slots=True, kw_only=True)
class State(Remembered):
    """A continuous state: the unit's `derivatives` gives its derivative in [unit/s]."""

    def start_of(self, scalar: str) -> float:
        """Return the start value of one of its scalars, by the name of that."""
        index = 0 if self.size is None else int(scalar[len(self.name) + 1 : -1]) - 1
        return self.starts[index]

    def faults(self) -> Iterator[str]:
        """Yield what is wrong with the variable."""
        if self.type != "Real":
            yield f"{self.name}: found {self.type} as a state, allowed: Real (a Memory may be {self.type})"
        yield from super(State, self).faults()


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory(Remembered):
    """A discrete state: it keeps its value between communication points, where `update` gives the next."""

    @property
    def variability(self) -> Variability:
        """Discrete."""
        return "discrete"
