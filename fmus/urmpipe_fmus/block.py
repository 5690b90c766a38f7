"""Block models: FMI variables and the elementwise functions between them.

A block model is written once; a run over a log (`run.run`), a Python FMU, a native FMU and its documentation
are made from it. With parameters p, inputs u, continuous states x and memories m (discrete states), at the
communication point t_k and over the step to t_k+1:

    y = outputs(t_k, p, u, x_k, m_k)
    m_k+1 = update(t_k, p, u, x_k, m_k)
    x' = derivatives(t, p, u, x, m_k+1)    from t_k to t_k+1, by RK4 with u held

The functions take the values of the variables (`v.phi`, `v.time`) and return new ones by name. Each value is
an element: a float, an array, or a symbol of a trace. So they use `+ - * /` and NumPy's elementwise functions
(`dependencies.FUNCTIONS`), `np.where` instead of `if`, and no `np.linalg`.

1. Variables: `Parameter`, `Input`, `Output`, `State`, `Memory`.
2. `Table`: values over time that a model plays; the rows at an instant are the same in Python and in C.
3. `Values`: what a function is called with.
4. `BlockModel`, and the `Recipe` from which a Python FMU makes it again.
5. The file of a table in an FMU, which native/runtime/table.c reads too.
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
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.si_units import coherent_unit, display_conversion, is_same_unit
from urmpipe_models.display import format_count
from urmpipe_models.elementwise import Element, FloatArray
from urmpipe_models.errors import Finding, FmuError, UnitError, format_value

Causality = Literal["parameter", "input", "output", "local"]
Variability = Literal["fixed", "tunable", "discrete", "continuous"]
ValueType = Literal["Real", "Integer", "Boolean"]

MAX_INTEGER = 2**31 - 1  # integers of FMI 2.0 have 32 bits
MAX_TIME_NS = 2**63 - 1  # times of a table have 64 bits
INTERNAL_STEP = "internal_step"  # parameter of every model with states: largest step of its integrator [s]


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable(ABC):
    """A quantity of a block model; with a size an array of scalars, `name[1]` .. `name[size]`.

    Attributes:
        name: An identifier; the functions read it as `v.name`.
        description: One line of text.
        unit: Unit in FMI's spelling: rad, m/s, N.m, kg.m2; empty for a number without a unit.
        display_unit: The unit that tools display, such as deg; empty for `unit`.
        start: Start value, one for all scalars or one per scalar.
        minimum: Smallest allowed value.
        maximum: Largest allowed value.
        size: Number of scalars of an array; None for a scalar.
        type: Real, or Integer or Boolean for numbers that represent one; the functions see numbers (0, 1).
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
        """FMI's causality."""

    @property
    def variability(self) -> Variability:
        """FMI's variability."""
        return "continuous" if self.type == "Real" else "discrete"

    @property
    def width(self) -> int:
        """Number of its scalars."""
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
        """Return the start value of a scalar by its name."""
        index = 0 if self.size is None else int(scalar[len(self.name) + 1 : -1]) - 1
        return self.starts[index]

    def faults(self) -> Iterator[str]:
        """Yield the errors of the description."""
        if not (self.name.isidentifier() and self.name.isascii()) or self.name.startswith("_"):
            yield f"{format_value(self.name)}: found as a name, allowed: a letter, then letters, digits and _"
        starts = self.start if isinstance(self.start, tuple) else (self.start,)
        if not all(isinstance(start, Real) for start in starts):
            allowed = "a number, or a tuple of numbers"
            yield f"{self.name}: start value {format_value(self.start)}, allowed: {allowed}"
            return
        if self.size is not None and self.size < 1:
            yield f"{self.name}: size {self.size}, allowed: 1 or more"
        elif len(self.starts) != self.width:
            yield f"{self.name}: found {format_count(len(self.starts), 'start value')}, allowed: {self.width}"
        if not self.minimum <= self.maximum:
            yield f"{self.name}: min {self.minimum:g} above max {self.maximum:g}"
        yield from (f"{self.name}: {fault}" for fault in self._unit_faults())
        for name, start in zip(self.names, self.starts, strict=False):
            yield from (f"{name}: start value {reason}" for reason in self.rejection_reasons(start))

    def _unit_faults(self) -> Iterator[str]:
        if self.type != "Real" and (self.unit or self.display_unit):
            yield f"found {self.type} with a unit, allowed: a unit of a Real"
            return
        if self.display_unit and not self.unit:
            display = format_value(self.display_unit)
            yield f"found display unit {display} without a unit, allowed: both or none"
        if not self.unit:
            return
        try:
            display_conversion(self.unit, self.display_unit or self.unit)
            in_si = coherent_unit(self.unit)
        except UnitError as error:
            yield str(error)
            return
        if not is_same_unit(self.unit, in_si):  # equations need SI: 1 deg/s is not 1 rad/s
            as_well = f", with display_unit={self.unit!r} to show it so" if not self.display_unit else ""
            yield f"found unit {self.unit!r}, allowed: values in SI, unit={in_si!r}{as_well}"

    def rejection_reasons(self, value: float) -> Iterator[str]:
        """Yield why a scalar cannot take a value: not finite, out of range, no integer."""
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
    """A constant of the model.

    Attributes:
        tunable: Whether it may change between steps; else it is fixed from the first step on.
    """

    causality: ClassVar[Causality] = "parameter"
    tunable: bool = True

    @property
    def variability(self) -> Variability:
        """Tunable or fixed."""
        return "tunable" if self.tunable else "fixed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Input(Variable):
    """A quantity that is set at every communication point."""

    causality: ClassVar[Causality] = "input"


@dataclass(frozen=True, slots=True, kw_only=True)
class Output(Variable):
    """A quantity that `outputs` computes from time, parameters, inputs, states and memories.

    Its start value is not used, as the first output is computed.
    """

    causality: ClassVar[Causality] = "output"


@dataclass(frozen=True, slots=True, kw_only=True)
class StateVariable(Variable):
    """A quantity that is kept from step to step: a `State` or a `Memory`.

    Attributes:
        output: Whether it is an output; else it is a local variable.
    """

    output: bool = False

    @property
    def causality(self) -> Causality:
        """Output or local."""
        return "output" if self.output else "local"


@dataclass(frozen=True, slots=True, kw_only=True)
class State(StateVariable):
    """A continuous state: `derivatives` returns its derivative in [unit/s]."""

    def faults(self) -> Iterator[str]:
        """Yield the errors of the description."""
        if self.type != "Real":
            yield f"{self.name}: found {self.type} as a state, allowed: Real (a Memory may be {self.type})"
        yield from super(State, self).faults()


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory(StateVariable):
    """A discrete state, constant between communication points: `update` returns its next value."""

    variability: ClassVar[Variability] = "discrete"


class Rows(NamedTuple):
    """The two rows of a table around an instant.

    Attributes:
        before: Values of the last row at or before it, one per column; the first row before the table.
        after: Values of the next row; the last row after the table.
        fraction: Position of the instant between them, from 0 to below 1; 0 at a row and outside the table.
    """

    before: tuple[Element, ...]
    after: tuple[Element, ...]
    fraction: Element


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Values over time.

    Times are integer nanoseconds, so that t = k h selects the intended row and not its neighbour.

    Attributes:
        t_ns: Times in [ns], strictly rising, shape (n,), n >= 1.
        values: Finite, in SI, shape (n, columns).
    """

    t_ns: NDArray[np.int64]
    values: FloatArray
    _times: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        times = np.asarray(self.t_ns)
        if times.dtype.kind not in "iu":
            raise UnitError(f"table: found times of type {times.dtype}, allowed: integers, in ns")
        if times.size and times.max() > MAX_TIME_NS:
            raise UnitError(f"table: found a time of {times.max()} ns, allowed: {MAX_TIME_NS} ns")
        for name, value in (
            ("t_ns", np.array(times, dtype=np.int64)),
            ("values", np.array(self.values, dtype=np.float64, order="C")),
            ("_times", np.array(times, dtype=np.float64)),
        ):
            value.flags.writeable = False  # a copy, so that callers cannot change the model
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
        falls = self.t_ns[1:] <= self.t_ns[:-1]  # no differences: they may exceed 64 bits
        if falls.any():
            row = int(np.argmax(falls)) + 2
            yield f"table: the time of row {row} is not after the one before; allowed: rising times"
        if not np.isfinite(self.values).all():
            row, column = (int(i) + 1 for i in np.argwhere(~np.isfinite(self.values))[0])
            yield f"table: row {row}, column {column} is not finite; allowed: finite values"

    @property
    def columns(self) -> int:
        """Number of values per row."""
        return int(self.values.shape[1])

    def rows_at(self, time: Element) -> Rows:
        """Return the rows around a time in [s], a float or an array of shape (n,).

        The time is rounded to whole nanoseconds, halves away from zero as C's `round` does.
        """
        scaled = np.asarray(time, dtype=np.float64) * 1e9
        truncated = np.trunc(scaled)  # adding 0.5 first would round once more where half a ns is an ulp
        instant = truncated + np.where(np.abs(scaled - truncated) >= 0.5, np.copysign(1.0, scaled), 0.0)
        times = self._times
        last = len(times) - 1
        before = np.clip(np.searchsorted(times, instant, side="right") - 1, 0, last)
        after = np.minimum(before + 1, last)
        span = np.where(after > before, times[after] - times[before], 1.0)
        fraction = np.where(instant <= times[before], 0.0, (instant - times[before]) / span)
        fraction = np.where(after > before, fraction, 0.0)
        return Rows(tuple(self.values[before].T), tuple(self.values[after].T), fraction)


class UnknownVariableError(UnitError, AttributeError):
    """A function reads a variable that its model does not have; an AttributeError, as `hasattr` expects."""


class Values:
    """Values at an instant: `v.u` is an element, `v.phi` of a variable with a size a tuple of elements.

    Attributes:
        time: The instant in [s].
        table: The rows of the model's table around the instant; None without a table.
    """

    time: Element
    table: Any

    def __init__(
        self, time: Element, elements: Mapping[str, Element | tuple[Element, ...]], table: Rows | None = None
    ) -> None:
        self.__dict__.update(elements, time=time, table=table)

    def __getattr__(self, name: str) -> Any:
        allowed = ", ".join(sorted(self.__dict__))
        raise UnknownVariableError(f"v.{name}: found in a unit's function, allowed: {allowed}")


Function = Callable[[Values], Mapping[str, Element | Sequence[Element]]]


@dataclass(frozen=True, slots=True)
class Recipe:
    """How a Python FMU makes its block model again.

    Attributes:
        module: Import name of the module that makes it; for a user's file the name of the file.
        function: The module's function that returns the model; empty if the module has it as a variable.
        arguments: Arguments of the function: strings, numbers, lists and mappings of them. A table is not
            stored among them: the model's table is passed as the argument `table`.
        source: The text of a user's file; empty for a module of an installed package.
    """

    module: str = ""
    function: str = ""
    arguments: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockModel:
    """A model with FMI variables.

    At a communication point t_k the inputs are set and the outputs follow them without delay. A step from
    t_k to t_k+1 first samples: `update` returns the next values of the memories from the values at t_k. Then
    the states are integrated by RK4 in steps of at most `internal_step`, with the inputs held.

    Attributes:
        name: An identifier: the name of the block, of the FMU's file and of its binaries.
        description: One line of text.
        variables: In the order in which importers show them.
        outputs: The values of all `Output`s; None without outputs.
        derivatives: The derivatives of all `State`s, in [unit/s]; None without states.
        update: The next values of all `Memory`s; None without memories.
        internal_step: Largest step of the integrator in [s], the start value of a parameter of that name.
        table: Rows over time, available as `v.table`; None for most models.
        equations: The model in readable form, one line per equation or remark.
        source: The source of the equations.
        recipe: How to make the model again.
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
        if self.states and not any(variable.name == INTERNAL_STEP for variable in self.variables):
            step = Parameter(
                name=INTERNAL_STEP,
                description="Largest step of the integrator (RK4)",
                unit="s",
                start=self.internal_step,
                minimum=1e-9,
                tunable=False,
            )
            object.__setattr__(self, "variables", (*self.variables, step))
        faults = [f"unit {self.name}: {fault}" for fault in [*self._type_faults()] or [*self._faults()]]
        if faults:
            raise UnitError(*faults)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its parameters, in order."""
        return tuple(variable for variable in self.variables if isinstance(variable, Parameter))

    @cached_property
    def inputs(self) -> tuple[Input, ...]:
        """Its inputs, in order."""
        return tuple(variable for variable in self.variables if isinstance(variable, Input))

    @cached_property
    def states(self) -> tuple[State, ...]:
        """Its continuous states, in order."""
        return tuple(variable for variable in self.variables if isinstance(variable, State))

    @cached_property
    def memories(self) -> tuple[Memory, ...]:
        """Its discrete states, in order."""
        return tuple(variable for variable in self.variables if isinstance(variable, Memory))

    @cached_property
    def computed(self) -> tuple[Output, ...]:
        """The outputs that `outputs` computes, in order."""
        return tuple(variable for variable in self.variables if isinstance(variable, Output))

    @cached_property
    def arguments(self) -> tuple[Variable, ...]:
        """The variables that the functions read, by kind: parameters, inputs, states, memories."""
        return (*self.parameters, *self.inputs, *self.states, *self.memories)

    @cached_property
    def scalars(self) -> tuple[tuple[str, Variable], ...]:
        """Name and variable of every scalar, in order: the index is FMI's value reference."""
        return tuple((name, variable) for variable in self.variables for name in variable.names)

    def _type_faults(self) -> Iterator[str]:
        """Yield the fields whose types Python accepts, but FMI does not know."""
        for variable in self.variables:
            if not isinstance(variable, (Parameter, Input, Output, State, Memory)):
                allowed = "a Parameter, Input, Output, State or Memory"
                yield f"found {format_value(variable)} as a variable, allowed: {allowed}"
                continue
            for key in ("name", "description", "unit", "display_unit"):
                yield from _text_fault(f"{variable.name}: {key}", getattr(variable, key))
            if variable.type not in (types := get_args(ValueType)):
                kind = format_value(variable.type)
                yield f"{variable.name}: found type {kind}, allowed: {', '.join(types)}"
            if variable.size is not None and type(variable.size) is not int:
                size = format_value(variable.size)
                yield f"{variable.name}: found size {size}, allowed: an integer; None for a scalar"
        for key in ("name", "description", "source"):
            yield from _text_fault(key, getattr(self, key))
        if isinstance(self.equations, str):
            yield f"equations: found {format_value(self.equations)}, allowed: a tuple of texts, a line each"

    def _faults(self) -> Iterator[str]:
        if not self.name.isidentifier() or not self.name.isascii():
            name = format_value(self.name)
            yield f"found {name} as its name, allowed: a letter, then letters, digits and _"
        if not self.variables:
            yield "found no variables, allowed: one or more (FMI has no FMU without them)"
        names = [variable.name for variable in self.variables]
        for name in sorted({name for name in names if names.count(name) > 1}):
            yield f"{name}: found twice, allowed: each name once"
        for name in {"time", "table"} & set(names):
            yield f"{name}: found as a variable, allowed: another name (v.{name} is given to all units)"
        for variable in self.variables:
            yield from variable.faults()
            if variable.name == INTERNAL_STEP and not (
                isinstance(variable, Parameter)
                and variable.type == "Real"
                and variable.size is None
                and variable.minimum > 0.0
            ):
                yield f"{variable.name}: found as a variable, allowed: one Real parameter with a min above 0"
        for kind, variables, function, name in (
            ("output", self.computed, self.outputs, "outputs"),
            ("state", self.states, self.derivatives, "derivatives"),
            ("memory", self.memories, self.update, "update"),
        ):
            if variables and function is None:
                yield f"{kind} {variables[0].name} is declared, but `{name}` is not set"
            elif function is not None and not variables:
                yield f"`{name}` is set, but no {kind} is declared"


def _text_fault(what: str, value: Any) -> Iterator[str]:
    if not isinstance(value, str):
        yield f"{what}: found {format_value(value)}, allowed: a text"


TABLE_FILE = "resources/table.bin"  # path in an FMU

# Little-endian: "URMTABLE", then as 64-bit integers the version of the layout, the numbers of rows n and of
# columns; the n times in [ns] as int64; n rows of float64.
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
        layout = f"found version {version}, {len(content)} bytes"
        raise FmuError(Finding(f"{layout}, allowed: version {_VERSION}, {length} bytes", file=str(path)))
    times = np.frombuffer(content, "<i8", rows, _HEADER.size)
    values = np.frombuffer(content, "<f8", rows * columns, _HEADER.size + 8 * rows)
    try:
        return Table(times.astype(np.int64), values.reshape(rows, columns).astype(np.float64))
    except UnitError as error:
        raise FmuError(*(replace(finding, file=str(path)) for finding in error.findings)) from error
