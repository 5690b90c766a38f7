"""The variables of a unit: what FMI knows of a quantity, and what the unit does with it.

A table over time inside a unit: the rows about an instant, found the same way in Python and in C.

What the functions of a unit are given: the values of its variables, by name.

The unit: a model with FMI variables, written once in elementwise NumPy.

From a unit come a vectorised run over a log (`run`), a Python FMU, a native FMU and its documentation.
Its functions take the values of the variables (`v.phi`, `v.time`) and return new ones by name. Each value
is an element: a float, an array, or a symbol of a trace; so the functions use `+ - * /` and NumPy's
elementwise functions (`dependencies.FUNCTIONS`), `np.where` instead of `if`, and no `np.linalg`.

A table as a file in an FMU's resources, which the native runtime reads as well (native/runtime/table.c).

All of it little-endian: 8 bytes "URMTABLE", then as 64-bit integers the version of the layout, the number of
rows n and of columns; the n times in [ns] as int64; n rows of float64.
"""

from __future__ import annotations

import math
import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.si_units import coherent_unit, display_conversion, is_same_unit
from urmpipe_models.elementwise import Element, FloatArray
from urmpipe_models.errors import Finding, FmuError, UnitError, format_value

Causality = Literal["parameter", "input", "output", "local"]
Variability = Literal["fixed", "tunable", "discrete", "continuous"]
ValueType = Literal["Real", "Integer", "Boolean"]

MAX_INTEGER = 2**31 - 1
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

    def scalar_start(self, scalar: str) -> float:
        """Return the start value of one of its scalars, by the name of that."""
        index = 0 if self.size is None else int(scalar[len(self.name) + 1 : -1]) - 1
        return self.starts[index]

    def faults(self) -> Iterator[str]:
        """Yield what is wrong with the variable."""
        if not (self.name.isidentifier() and self.name.isascii()) or self.name.startswith("_"):
            yield f"{format_value(self.name)}: found as a name, allowed: a letter, then letters, digits and _"
        starts = self.start if isinstance(self.start, tuple) else (self.start,)
        if not all(isinstance(one, Real) for one in starts):
            found = format_value(self.start)
            yield f"{self.name}: start value {found}, allowed: a number, or a tuple of numbers"
            return
        if self.size is not None and self.size < 1:
            yield f"{self.name}: size {self.size}, allowed: 1 or more"
        elif len(self.starts) != self.width:
            yield f"{self.name}: found {len(self.starts)} start values, allowed: {self.width}"
        if not self.minimum <= self.maximum:
            yield f"{self.name}: min {self.minimum:g} above max {self.maximum:g}"
        yield from (f"{self.name}: {fault}" for fault in self._unit_faults())
        for name, start in zip(self.names, self.starts, strict=False):
            yield from (f"{name}: start value {fault}" for fault in self.rejection_reasons(start))

    def _unit_faults(self) -> Iterator[str]:
        if self.type != "Real" and (self.unit or self.display_unit):
            yield f"found {self.type} with a unit, allowed: a unit of a Real"
            return
        if self.display_unit and not self.unit:
            found = format_value(self.display_unit)
            yield f"found display unit {found} without a unit, allowed: both or none"
        try:
            if self.unit:
                display_conversion(self.unit, self.display_unit or self.unit)
                yield from self._factor_faults()
        except UnitError as error:
            yield str(error)

    def _factor_faults(self) -> Iterator[str]:
        """Yield why a unit is none that a model's equations can be written in: 1 deg/s is not 1 rad/s."""
        in_si = coherent_unit(self.unit)
        if not is_same_unit(self.unit, in_si):
            as_well = f", with display_unit={self.unit!r} to show it so" if not self.display_unit else ""
            yield f"found unit {self.unit!r}, allowed: values in SI, unit={in_si!r}{as_well}"

    def rejection_reasons(self, value: float) -> Iterator[str]:
        """Yield why one of its scalars cannot take a value: not finite, out of range, no integer."""
        if not math.isfinite(value):
            yield f"found {value:g}, allowed: a finite number"
        elif not self.minimum <= value <= self.maximum:
            yield f"found {value:.17g}, allowed: {self.minimum:.15g} to {self.maximum:.15g}"
        elif self.type == "Integer" and (value != round(value) or abs(value) > MAX_INTEGER):
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
class StateVariable(Variable):
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
class State(StateVariable):
    """A continuous state: the unit's `derivatives` gives its derivative in [unit/s]."""

    def scalar_start(self, scalar: str) -> float:
        """Return the start value of one of its scalars, by the name of that."""
        index = 0 if self.size is None else int(scalar[len(self.name) + 1 : -1]) - 1
        return self.starts[index]

    def faults(self) -> Iterator[str]:
        """Yield what is wrong with the variable."""
        if self.type != "Real":
            yield f"{self.name}: found {self.type} as a state, allowed: Real (a Memory may be {self.type})"
        yield from super(State, self).faults()


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory(StateVariable):
    """A discrete state: it keeps its value between communication points, where `update` gives the next."""

    @property
    def variability(self) -> Variability:
        """Discrete."""
        return "discrete"


LAST_NS = 2**63 - 1
"""The last time that 64 bits hold."""


class Rows(NamedTuple):
    """The rows of a table about an instant.

    Attributes:
        before: Values of the last row at or before it, one element a column; before the first, the first.
        after: Values of the row after that; beyond the last, the last.
        fraction: How far the instant is from one to the other, 0 at a row and outside the table, below 1.
    """

    before: tuple[Element, ...]
    after: tuple[Element, ...]
    fraction: Element


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Values over time.

    Times are integer nanoseconds, so that t = k h meets the row that is meant and not its neighbour.

    Attributes:
        t_ns: Times in [ns], strictly rising, shape (n,), n >= 1.
        values: Finite, in SI, shape (n, columns).
    """

    t_ns: NDArray[np.int64]
    values: FloatArray
    _times: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        given = np.asarray(self.t_ns)
        if given.dtype.kind not in "iu":
            raise UnitError(f"table: found times of type {given.dtype}, allowed: integers, in ns")
        if given.size and given.max() > LAST_NS:
            raise UnitError(f"table: found a time of {given.max()} ns, allowed: {LAST_NS} ns")
        for name, value in (
            ("t_ns", np.array(given, dtype=np.int64)),
            ("values", np.array(self.values, dtype=np.float64, order="C")),
            ("_times", np.array(given, dtype=np.float64)),
        ):
            value.flags.writeable = False  # a copy of its own: nobody changes what a unit holds
            object.__setattr__(self, name, value)
        faults = list(self._faults())
        if faults:
            raise UnitError(*faults)

    def _faults(self) -> Iterator[str]:
        if self.values.ndim != 2 or self.t_ns.shape != self.values.shape[:1] or not self.values.size:
            yield (
                f"table: found {self.t_ns.shape} times and {self.values.shape} values, allowed: (n,) and"
                " (n, columns), at least one of each"
            )
            return
        if len(self.t_ns) > MAX_INTEGER:
            yield f"table: found {len(self.t_ns)} rows, allowed: {MAX_INTEGER}"
        falls = self.t_ns[1:] <= self.t_ns[:-1]  # their differences may have more than 64 bits
        if falls.any():
            row = int(np.argmax(falls)) + 2
            yield f"table: the time of row {row} is not after the one before; allowed: rising times"
        if not np.isfinite(self.values).all():
            row, column = (int(i) + 1 for i in np.argwhere(~np.isfinite(self.values))[0])
            yield f"table: row {row}, column {column} is not finite; allowed: finite values"

    @property
    def columns(self) -> int:
        """How many values a row has."""
        return int(self.values.shape[1])

    def rows_at(self, time: Element) -> Rows:
        """Return the rows about a time in [s], a float or an array of shape (n,).

        The time is rounded to whole nanoseconds, halves away from zero as C's `round` does.
        """
        scaled = np.asarray(time, dtype=np.float64) * 1e9
        whole = np.trunc(scaled)  # adding 0.5 first would round once more where half a ns is an ulp
        instant = whole + np.where(np.abs(scaled - whole) >= 0.5, np.copysign(1.0, scaled), 0.0)
        times = self._times
        last = len(times) - 1
        before = np.clip(np.searchsorted(times, instant, side="right") - 1, 0, last)
        after = np.minimum(before + 1, last)
        span = np.where(after > before, times[after] - times[before], 1.0)
        fraction = np.where(instant <= times[before], 0.0, (instant - times[before]) / span)
        fraction = np.where(after > before, fraction, 0.0)
        return Rows(tuple(self.values[before].T), tuple(self.values[after].T), fraction)


class UnknownVariableError(UnitError, AttributeError):
    """A unit's function reads a variable that the unit has not; also what `hasattr` and `copy` expect."""


class Values:
    """The values at an instant: `v.u` is an element, `v.phi` of a variable with a size a tuple of elements.

    Attributes:
        time: The instant in [s].
        table: The rows of the unit's table about the instant; None if the unit has none.
    """

    time: Element
    table: Any

    def __init__(
        self, time: Element, named: Mapping[str, Element | tuple[Element, ...]], table: Rows | None = None
    ) -> None:
        self.__dict__.update(named, time=time, table=table)

    def __getattr__(self, name: str) -> Any:
        allowed = ", ".join(sorted(self.__dict__))
        raise UnknownVariableError(f"v.{name}: found in a unit's function, allowed: {allowed}")


Function = Callable[[Values], Mapping[str, Element | Sequence[Element]]]

INTERNAL_STEP = "internal_step"
"""The parameter that every unit with continuous states gets: the largest step of its integrator in [s]."""


@dataclass(frozen=True, slots=True)
class Recipe:
    """How to make a unit again, where its FMU is run by Python.

    Attributes:
        module: Import name of the module that makes it; of a user's file the name of the file.
        function: The module's function that returns the unit; empty if the module holds it as a variable.
        arguments: What the function is called with: strings, numbers, lists and mappings of them. A table
            is not among them: a unit that has one takes it as the argument `table`.
        source: The text of a user's file; empty for a module of an installed package.
    """

    module: str = ""
    function: str = ""
    arguments: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockModel:
    """A model with FMI variables.

    At a communication point t_k the inputs are set and the outputs are those of these inputs at once:
    `outputs` is a function of time, parameters, inputs and states. A step from t_k to t_k+1 first takes the
    sample, `update` giving the next values of the memories from those of t_k, then integrates the states
    with RK4 in steps of at most `internal_step`, the inputs held.

    Attributes:
        name: An identifier: the name of the block, of the FMU's file and of its binaries.
        description: One line for people.
        variables: In the order in which importers show them.
        outputs: The values of all `Output`s; None if there are none.
        derivatives: The derivatives of all `State`s, in [unit/s]; None if there are none.
        update: The next values of all `Memory`s; None if there are none.
        internal_step: Largest step of the integrator in [s], the start value of a parameter of that name.
        table: Rows over time, to be read as `v.table`; None for most units.
        equations: The model as people write it, a line an equation or remark.
        source: Where the equations come from.
        recipe: How to make the unit again.
    """

    name: str
    description: str
    variables: tuple[Variable, ...]
    outputs: Function | None = None
    derivatives: Function | None = None
    update: Function | None = None
    internal_step: float = 1e-3
    table: Table | None = None
    equations: tuple[str, ...] = ()
    source: str = ""
    recipe: Recipe = field(default_factory=Recipe)

    def __post_init__(self) -> None:
        if self.states and not any(one.name == INTERNAL_STEP for one in self.variables):
            step = Parameter(
                name=INTERNAL_STEP,
                description="Largest step of the integrator (RK4)",
                unit="s",
                start=self.internal_step,
                minimum=1e-9,
                tunable=False,
            )
            object.__setattr__(self, "variables", (*self.variables, step))
        faults = [f"unit {self.name}: {fault}" for fault in self._faults()]
        if faults:
            raise UnitError(*faults)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its parameters, in order."""
        return tuple(one for one in self.variables if isinstance(one, Parameter))

    @cached_property
    def inputs(self) -> tuple[Input, ...]:
        """Its inputs, in order."""
        return tuple(one for one in self.variables if isinstance(one, Input))

    @cached_property
    def states(self) -> tuple[State, ...]:
        """Its continuous states, in order."""
        return tuple(one for one in self.variables if isinstance(one, State))

    @cached_property
    def memories(self) -> tuple[Memory, ...]:
        """Its discrete states, in order."""
        return tuple(one for one in self.variables if isinstance(one, Memory))

    @cached_property
    def computed(self) -> tuple[Output, ...]:
        """The outputs that `outputs` computes, in order."""
        return tuple(one for one in self.variables if isinstance(one, Output))

    @cached_property
    def arguments(self) -> tuple[Variable, ...]:
        """All that the functions are given, by kind: parameters, inputs, states, memories."""
        return (*self.parameters, *self.inputs, *self.states, *self.memories)

    @cached_property
    def scalars(self) -> tuple[tuple[str, Variable], ...]:
        """Name and variable of every scalar, in order: the index is FMI's value reference."""
        return tuple((name, one) for one in self.variables for name in one.names)

    def _wrong_kinds(self) -> Iterator[str]:
        """Yield what is of a kind that Python takes and FMI does not know."""
        for one in self.variables:
            if not isinstance(one, (Parameter, Input, Output, State, Memory)):
                allowed = "a Parameter, Input, Output, State or Memory"
                yield f"found {format_value(one)} as a variable, allowed: {allowed}"
                continue
            for key in ("name", "description", "unit", "display_unit"):
                yield from _no_text(f"{one.name}: {key}", getattr(one, key))
            if one.type not in get_args(ValueType):
                allowed = ", ".join(get_args(ValueType))
                yield f"{one.name}: found type {format_value(one.type)}, allowed: {allowed}"
            if one.size is not None and type(one.size) is not int:
                size = format_value(one.size)
                yield f"{one.name}: found size {size}, allowed: an integer; None for a scalar"
        for key in ("name", "description", "source"):
            yield from _no_text(key, getattr(self, key))
        if isinstance(self.equations, str):
            yield f"equations: found {format_value(self.equations)}, allowed: a tuple of texts, a line each"

    def _faults(self) -> Iterator[str]:
        wrong = list(self._wrong_kinds())
        if wrong:
            yield from wrong
            return
        if not self.name.isidentifier() or not self.name.isascii():
            name = format_value(self.name)
            yield f"found {name} as its name, allowed: a letter, then letters, digits and _"
        if not self.variables:
            yield "found no variables, allowed: one or more (FMI has no FMU without them)"
        names = [one.name for one in self.variables]
        for name in sorted({name for name in names if names.count(name) > 1}):
            yield f"{name}: found twice, allowed: each name once"
        for name in {"time", "table"} & set(names):
            yield f"{name}: found as a variable, allowed: another name (v.{name} is given to all units)"
        for one in self.variables:
            yield from one.faults()
            if one.name == INTERNAL_STEP and not _is_internal_step(one):
                yield f"{one.name}: found as a variable, allowed: one Real parameter with a min above 0"
        yield from self._missing()

    def _missing(self) -> Iterator[str]:
        """Yield the functions that lack variables, and the variables that lack a function."""
        for kind, variables, function, name in (
            ("output", self.computed, self.outputs, "outputs"),
            ("state", self.states, self.derivatives, "derivatives"),
            ("memory", self.memories, self.update, "update"),
        ):
            if variables and function is None:
                yield f"{kind} {variables[0].name} is declared, but `{name}` is not set"
            elif function is not None and not variables:
                yield f"`{name}` is set, but no {kind} is declared"


def _is_internal_step(one: Variable) -> bool:
    return isinstance(one, Parameter) and one.type == "Real" and one.size is None and one.minimum > 0.0


def _no_text(what: str, value: Any) -> Iterator[str]:
    if not isinstance(value, str):
        yield f"{what}: found {format_value(value)}, allowed: a text"


TABLE_FILE = "resources/table.bin"
"""Where the file belongs in an FMU."""

_HEADER = struct.Struct("<8sQQQ")
_MAGIC = b"URMTABLE"
_VERSION = 1


def table_bytes(table: Table) -> bytes:
    """Return the content of a table's file."""
    header = _HEADER.pack(_MAGIC, _VERSION, *table.values.shape)
    return header + table.t_ns.astype("<i8").tobytes() + table.values.astype("<f8").tobytes()


def read_table(path: Path) -> Table:
    """Read a table's file.

    Raises:
        FmuError: If it cannot be read, or is another kind of file.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FmuError(Finding(f"cannot be read: {error.strerror}", file=str(path))) from error
    if len(content) < _HEADER.size or not content.startswith(_MAGIC):
        raise FmuError(Finding("found another kind of file, allowed: a table of urmpipe", file=str(path)))
    _, version, rows, columns = _HEADER.unpack_from(content)
    length = _HEADER.size + 8 * rows * (columns + 1)
    if version != _VERSION or len(content) != length:
        raise FmuError(
            Finding(
                f"found version {version}, {len(content)} bytes, allowed: version {_VERSION}, {length} bytes",
                file=str(path),
            )
        )
    times = np.frombuffer(content, "<i8", rows, _HEADER.size)
    values = np.frombuffer(content, "<f8", rows * columns, _HEADER.size + 8 * rows)
    try:
        return Table(times.astype(np.int64), values.reshape(rows, columns).astype(np.float64))
    except UnitError as error:
        raise FmuError(*(replace(one, file=str(path)) for one in error.findings)) from error
