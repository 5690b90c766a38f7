"""What an FMU shows of itself: its variables, what they depend on, and what it can do.

What goes where in a system, by scalars, and all that is wrong with it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from urmpipe_fmus.cosim.system import Block, Connection, Port, System
from urmpipe_fmus.fmu_file import host_binaries, open_fmu
from urmpipe_fmus.si_units import BASE_NAMES, BaseUnit, is_same_unit, parse_unit
from urmpipe_models.errors import CosimulationError, Finding, UnitError, format_unknown_name
from urmpipe_models.measure_units import NAMES, WRITTEN, quantity_to_si

ELEMENT = re.compile(r"(.+)\[(\d+(?:,\s*\d+)*)\]")
"""The name of an array's element: `phi[1]`, `M[1,2]`."""

NUMBERS = ("Real", "Integer", "Boolean")
"""The types that are exchanged and recorded."""


@dataclass(frozen=True, slots=True)
class Variable:
    """A scalar of an FMU.

    Attributes:
        name: Its name.
        reference: Its value reference.
        type: Real, Integer, Boolean or String; an Enumeration is exchanged as an Integer.
        enumeration: Name of the enumeration, if it is one.
        causality: As FMI spells it.
        variability: As FMI spells it.
        initial: As FMI spells it; empty if there is none.
        unit: Its unit as the FMU spells it; empty if it has none.
        base: The unit in the base units of SI, if the FMU tells; else what its spelling says, if it is one.
        minimum: The least value allowed.
        maximum: The largest value allowed.
        nominal: The size of its values; 0 if the FMU does not tell.
        start: Its value at the start, as the FMU spells it; None if it has none.
        description: One line for people; empty for none.
        display_unit: The unit that people like to see, such as deg; empty for the unit itself.
    """

    name: str
    reference: int
    type: str
    enumeration: str
    causality: str
    variability: str
    initial: str
    unit: str
    base: BaseUnit | None
    minimum: float
    maximum: float
    nominal: float
    start: str | None
    description: str = ""
    display_unit: str = ""

    @property
    def settable(self) -> bool:
        """Whether it takes a start value: no constant, initial exact or approx (FMI 2.0.4, section 4.2.4)."""
        return self.variability != "constant" and self.initial in ("exact", "approx")

    def refusal(self, value: float) -> str:
        """Return why it cannot take a value; empty if it can."""
        if not math.isfinite(value):
            return f"found {value:g}, allowed: a finite number"
        if not self.minimum <= value <= self.maximum:
            return f"found {value:.12g}, allowed: {self.minimum:.12g} to {self.maximum:.12g}"
        if self.type == "Integer" and not (value == round(value) and abs(value) < 2.0**31):
            return f"found {value:.12g}, allowed: an integer of 32 bits"
        if self.type == "Boolean" and value not in (0.0, 1.0):
            return f"found {value:.12g}, allowed: true, false"
        return ""


@dataclass(frozen=True, eq=False)
class Interface:
    """What an FMU shows of itself.

    Attributes:
        path: The FMU.
        identifier: Name of its binaries.
        guid: What binds description and binaries.
        variables: All of them by name, in order.
        dependencies: Of each output, the inputs that its value depends on at once.
        silent: Outputs that do not tell what they depend on: on all inputs, as far as one knows.
        can_save: Whether its state can be saved and restored.
        variable_step: Whether its communication step may change.
        alone: Whether it can be instantiated only once per process.
        description: One line for people; empty for none.
    """

    path: Path
    identifier: str
    guid: str
    variables: Mapping[str, Variable]
    dependencies: Mapping[str, frozenset[str]]
    silent: frozenset[str]
    can_save: bool
    variable_step: bool
    alone: bool
    description: str = ""

    @cached_property
    def inputs(self) -> tuple[Variable, ...]:
        """Its inputs, in order."""
        return tuple(one for one in self.variables.values() if one.causality == "input")

    @cached_property
    def outputs(self) -> tuple[Variable, ...]:
        """Its outputs that are numbers, in order."""
        return tuple(v for v in self.variables.values() if v.causality == "output" and v.type in NUMBERS)

    @cached_property
    def arrays(self) -> Mapping[str, tuple[Variable, ...]]:
        """The elements of its arrays by the array's name, in the order of their indices."""
        found: dict[str, list[tuple[tuple[int, ...], Variable]]] = {}
        for name, one in self.variables.items():
            match = ELEMENT.fullmatch(name)
            if match and match[1] not in self.variables:
                index = tuple(int(i) for i in match[2].split(","))
                found.setdefault(match[1], []).append((index, one))
        return {
            name: tuple(v for _, v in sorted(rows, key=lambda row: row[0])) for name, rows in found.items()
        }

    def elements(self, name: str) -> tuple[Variable, ...]:
        """Return the scalar of a name, or all elements of an array; none if there is neither."""
        one = self.variables.get(name)
        return (one,) if one else self.arrays.get(name, ())

    def names(self, causality: str) -> list[str]:
        """Return the names of the variables of a causality, arrays as one."""
        names: dict[str, None] = {}
        for name, one in self.variables.items():
            if one.causality == causality:
                match = ELEMENT.fullmatch(name)
                names[match[1] if match and match[1] in self.arrays else name] = None
        return list(names)


def read_interface(path: Path) -> Interface:
    """Read the description of an FMU.

    It is not held to the standard's schema, as `check_fmu` does: many an FMU that is not quite valid runs.

    Raises:
        FmuError: If its archive or its description cannot be read.
        CosimulationError: If its variables cannot be read, it is no FMU for co-simulation by FMI 2.0, or it
            has no binaries for this platform.
    """
    file = open_fmu(path)
    described = file.read_description()
    try:
        shown = _interface(path, described)
    except Exception as error:  # what a description can be wrong by is much
        said = " ".join(str(error).split())
        raise CosimulationError(f"{path}: cannot be read as an FMU: {said}") from error
    if shown is None:
        kinds = [kind for kind in ("coSimulation", "modelExchange") if getattr(described, kind)]
        found = f"FMI {described.fmiVersion} for {' and '.join(kinds) or 'nothing'}"
        raise CosimulationError(f"{path}: found {found}, allowed: FMI 2.0 for coSimulation")
    binaries = host_binaries(shown.identifier)
    if not set(file.names) & set(binaries):
        platforms = sorted({name.split("/")[1] for name in file.names if re.match(r"binaries/[^/]+/.", name)})
        raise CosimulationError(
            f"{path}: found binaries for {', '.join(platforms) or 'no platform'},"
            f" allowed: {' or '.join(binaries)}"
        )
    return shown


def _interface(path: Path, described: Any) -> Interface | None:
    """Return what FMPy's description shows; None if it is not for co-simulation by FMI 2.0."""
    can = described.coSimulation
    if described.fmiVersion != "2.0" or can is None:
        return None
    told = {one.variable.name for one in described.outputs if one.dependencies is not None}
    return Interface(
        path=path,
        identifier=can.modelIdentifier,
        guid=described.guid,
        variables={one.name: one for one in _variables(described)},
        dependencies=_dependencies(described),
        silent=frozenset(v.name for v in described.modelVariables if v.causality == "output") - told,
        can_save=can.canGetAndSetFMUstate,
        variable_step=can.canHandleVariableCommunicationStepSize,
        alone=can.canBeInstantiatedOnlyOncePerProcess,
        description=described.description or "",
    )


def unit_fault(unit: str, base: BaseUnit | None, destination: Variable) -> str | None:
    """Return how the unit of a source differs from an input's; empty if one has none, None if it does not.

    Args:
        unit: The source's unit; empty if it has none.
        base: The same in the base units of SI, if that is known.
        destination: The input.
    """
    if destination.type != "Real" or unit == destination.unit:
        return None
    if not unit or not destination.unit:
        return ""
    if base and destination.base and is_same_unit(base, destination.base):
        return None
    return f"found the unit {unit}, allowed: that of the input, {destination.unit}"


def _variables(described: Any) -> Iterator[Variable]:
    """Yield the variables of FMPy's description; what one does not say, its declared type may."""
    bases = {unit.name: unit.baseUnit for unit in described.unitDefinitions}
    for one in described.modelVariables:
        kind = one.declaredType
        unit = one.unit or (kind and kind.unit) or ""
        low, high = one.min or (kind and kind.min), one.max or (kind and kind.max)
        yield Variable(
            name=one.name,
            reference=one.valueReference,
            type="Integer" if one.type == "Enumeration" else one.type,
            enumeration=kind.name if kind and one.type == "Enumeration" else "",
            causality=one.causality,
            variability=one.variability,
            initial=one.initial or "",
            unit=unit,
            base=si_base(unit, bases.get(unit)),
            minimum=float(low) if low else -math.inf,
            maximum=float(high) if high else math.inf,
            nominal=abs(float(one.nominal or (kind and kind.nominal) or 0.0)),
            start=one.start,
            description=one.description or "",
            display_unit=one.displayUnit or (kind and kind.displayUnit) or "",
        )


def si_base(unit: str, told: Any = None) -> BaseUnit | None:
    """Return a unit in the base units of SI, as FMPy read it or else by its spelling; None if unknown."""
    if told is not None:
        exponents = {name: getattr(told, name) for name in BASE_NAMES}
        return BaseUnit(**exponents, factor=told.factor, offset=told.offset)
    try:
        return parse_unit(unit) if unit else None
    except UnitError:
        return None


def _dependencies(described: Any) -> dict[str, frozenset[str]]:
    """Return what the outputs depend on; on all inputs where an FMU does not say."""
    inputs = frozenset(v.name for v in described.modelVariables if v.causality == "input")
    told = {
        one.variable.name: inputs & {v.name for v in one.dependencies}
        for one in described.outputs
        if one.dependencies is not None
    }
    return {v.name: told.get(v.name, inputs) for v in described.modelVariables if v.causality == "output"}


@dataclass(frozen=True, slots=True)
class Link:
    """A connection, by scalars.

    Attributes:
        connection: As the system names it.
        scalars: Each input with its source.
        unit: The unit of what goes through; empty if it has none.
    """

    connection: Connection
    scalars: tuple[tuple[Port, Port], ...]
    unit: str


@dataclass(frozen=True, slots=True)
class Start:
    """A scalar that is set before the first step.

    Attributes:
        variable: The scalar.
        value: A number (yes is 1, no is 0), or a text.
    """

    variable: Variable
    value: float | str


class Wiring:
    """The connections and start values of a system.

    What hangs on a block or a column that could not be read is taken as right: that is told already.

    Args:
        system: The system.
        interfaces: What the FMU of each block shows, of those that could be read.
        units: Unit of the column that each input from a log follows, of those that could be read; empty if it
            is not known.

    Attributes:
        links: The connections.
        logged: The inputs from logs.
        starts: The start values, by block.
        faults: All that is wrong.
        notes: What is allowed but should be seen.
    """

    def __init__(
        self, system: System, interfaces: Mapping[str, Interface], units: Mapping[Port, str]
    ) -> None:
        self.system, self.interfaces = system, interfaces
        self.faults: list[Finding] = []
        self.notes: list[str] = []
        self._fed: dict[Port, str] = {}
        self._named: set[Port] = set()  # inputs that are told a source, if only a wrong one
        links = (self._link(one) for one in system.connections)
        self.links = tuple(one for one in links if one)
        ports = [one.destination for one in system.inputs]
        self.logged = tuple(port for port in ports if self._from_log(port, units.get(port)))
        known = (block for block in system.blocks if block.name in interfaces)
        self.starts = {block.name: tuple(self._starts(block)) for block in known}
        self._unconnected()

    def _fault(self, where: str, said: str) -> None:
        """Note what is wrong with a table or key of the system's file."""
        self.faults.append(Finding(said, about=where))

    def _link(self, connection: Connection) -> Link | None:
        """Return a connection by scalars, if both ends are there and fit."""
        where = f"connections.{connection.destination}"
        inputs = self._found(where, connection.destination, "input")
        outputs = self._found(where, connection.source, "output")
        self._named |= {Port(connection.destination.block, one.name) for one in inputs}
        if not inputs or not outputs:
            return None
        if len(inputs) != len(outputs):
            found = f"found {connection.source} of size {len(outputs)}, allowed: {len(inputs)}"
            self._fault(where, f"{found}, as many as {connection.destination}")
            return None
        pairs = list(zip(inputs, outputs, strict=True))
        self._compare(where, connection.source, pairs)
        scalars = tuple(
            (Port(connection.destination.block, one.name), Port(connection.source.block, source.name))
            for one, source in pairs
        )
        for port, source_port in scalars:
            self._feed(port, str(source_port))
        return Link(connection, scalars, outputs[0].unit or inputs[0].unit)

    def _found(self, where: str, port: Port, causality: str) -> Sequence[Variable]:
        """Return the scalars at a port, if they are there and of a causality."""
        if port.block not in self.interfaces:
            return ()
        shown = self.interfaces[port.block]
        found = shown.elements(port.variable)
        if not found:
            allowed = format_unknown_name(port.variable, shown.names(causality))
            self._fault(where, f"{causality} of {port.block}: {allowed}")
        for one in found:
            if one.causality != causality:
                allowed = ", ".join(shown.names(causality)) or "none"
                self._fault(
                    where,
                    f"found {port.block}.{one.name}, causality {one.causality}, allowed: an"
                    f" {causality} of {port.block}: {allowed}",
                )
                return ()
        return found

    def _compare(self, where: str, source: Port, pairs: Sequence[tuple[Variable, Variable]]) -> None:
        """Tell types and units that differ, and texts; once for an array."""
        for one, output in pairs:
            kinds = (_kind(output), _kind(one))
            if "String" in (one.type, output.type):
                found = f"found {source}, {kinds[0]}, for {one.name}, {kinds[1]}"
                allowed = "numbers: texts are not exchanged, start sets one for the whole run"
                self._fault(where, f"{found}; allowed: {allowed}")
                return
            if kinds[0] != kinds[1]:
                self._fault(where, f"found {source}, {kinds[0]}, allowed: {kinds[1]}")
                return
            fault = unit_fault(output.unit, output.base, one)
            if fault:
                self._fault(where, f"{source}: {fault}")
                return
            if fault is not None:
                note = f"{where}: {source} has {_unit(output)}, the input {_unit(one)}: not compared"
                self.notes.append(note)

    def _feed(self, port: Port, source: str) -> None:
        """Note where an input comes from; tell if it already came from elsewhere."""
        if port in self._fed:
            self._fault(str(port), f"found two sources, {self._fed[port]} and {source}, allowed: one")
        self._fed[port] = source

    def _from_log(self, port: Port, unit: str | None) -> bool:
        """Return whether an input from a log, None for one not read, is there, a number and of its unit."""
        where = f"inputs.{port}"
        found = self._found(where, port, "input")
        if not found:
            return False
        one = found[0]
        if one.name != port.variable:
            self._fault(where, f"found an array, allowed: one of {', '.join(v.name for v in found)}")
            return False
        if one.type == "String":
            self._fault(where, "found a String, allowed: a number")
            return False
        self._named.add(port)
        if unit is None:
            return False
        fault = unit_fault(unit, si_base(unit), one)
        if fault:
            self._fault(where, fault)
        elif fault is not None:
            self.notes.append(
                f"{where}: the log has {unit or 'no unit'}, the input {_unit(one)}: not compared"
            )
        self._feed(port, "the log")
        return True

    def _starts(self, block: Block) -> Iterator[Start]:
        """Yield the start values of a block, by scalars."""
        shown = self.interfaces[block.name]
        seen: set[str] = set()
        for name, value in block.start.items():
            where = f"blocks.{block.name}.start.{name}"
            found = shown.elements(name)
            if not found:
                names = [n for kind in ("parameter", "input", "output", "local") for n in shown.names(kind)]
                self._fault(where, format_unknown_name(name, names))
                continue
            values = value if isinstance(value, list) else [value] * len(found)
            if len(values) != len(found):
                self._fault(where, f"found {len(values)} values, allowed: {len(found)}, or one for all")
                continue
            for one, each in zip(found, map(_in_si, found, values), strict=True):
                fault = _start_fault(one, each) or ("set twice" if one.name in seen else "")
                seen.add(one.name)
                if fault:
                    self._fault(where, fault)
                    break
                yield Start(one, each if isinstance(each, str) else float(each))

    def _unconnected(self) -> None:
        """Tell the inputs that nothing gives a value to."""
        for name, shown in self.interfaces.items():
            given = {start.variable.name for start in self.starts[name]}
            left = [
                v.name for v in shown.inputs if Port(name, v.name) not in self._named and v.name not in given
            ]
            if left:
                self._fault(
                    f"blocks.{name}",
                    f"found inputs without a source: {', '.join(left)}; allowed: each in"
                    " [connections], in [inputs], or with a value in start",
                )


def _kind(one: Variable) -> str:
    """Return the type of a variable for people."""
    return f"Enumeration {one.enumeration}" if one.enumeration else one.type


def _unit(one: Variable) -> str:
    return one.unit or "no unit"


def _in_si(one: Variable, value: Any) -> Any:
    """Return a start value; a text with its unit as a number, where the variable is in SI."""
    number = quantity_to_si(value, WRITTEN.get(one.unit or "", {})) if isinstance(value, str) else math.nan
    return number if one.type == "Real" and math.isfinite(number) else value


def _start_fault(one: Variable, value: Any) -> str:
    """Return why a scalar cannot start with a value; empty if it can."""
    if not one.settable:
        return f"found {one.name}, {one.variability} {one.causality}, allowed: a parameter, input or state"
    types: dict[str, tuple[type | tuple[type, ...], str]] = {
        "String": (str, "a text"),
        "Boolean": (bool, "true, false"),
    }
    right, allowed = types.get(one.type, ((int, float), NAMES.get(one.unit or "", "a number")))
    if not isinstance(value, right) or (isinstance(value, bool) and one.type != "Boolean"):
        found = str(value).lower() if isinstance(value, bool) else repr(value)
        return f"found {found}, allowed: {allowed}"
    return one.refusal(float(value)) if isinstance(value, (bool, int, float)) else ""
