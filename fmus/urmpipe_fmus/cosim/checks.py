"""The interface of an FMU (variables, dependencies, abilities), and the checks of a system's connections.

1. `read_interface` reads an FMU's description. It does not validate it, unlike `check_fmu`: many FMUs that
   are not quite valid run.
2. `Wiring` resolves the connections, inputs from logs and start values of a system to scalars. It checks
   names, causality, sizes, types, units (by their dimensions in SI), ranges, that no input has two sources,
   and that each has one. What depends on a block or column that could not be read counts as right.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from urmpipe_fmus.cosim.job import TYPES
from urmpipe_fmus.cosim.system import Block, Connection, Port, System
from urmpipe_fmus.fmu_file import host_binaries, open_fmu
from urmpipe_fmus.si_units import BASE_NAMES, BaseUnit, is_same_unit, parse_unit
from urmpipe_models.display import format_count
from urmpipe_models.errors import CosimulationError, Finding, UnitError, format_unknown_name
from urmpipe_models.measure_units import NAMES, WRITTEN, quantity_to_si

ELEMENT = re.compile(r"(.+)\[(\d+(?:,\s*\d+)*)\]")  # name of an array's element: `phi[1]`, `M[1,2]`


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
        base: The unit in the base units of SI, if the FMU states it; else from its spelling, if it is a unit.
        minimum: The minimum, in `unit`.
        maximum: The maximum, in `unit`.
        nominal: The magnitude of its values, in `unit`; 0 if the FMU does not state it.
        start: Its start value, as the FMU spells it; None if it has none.
        description: One line of text; empty if there is none.
        display_unit: The preferred unit for display, such as deg; empty for the unit itself.
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
    def is_settable(self) -> bool:
        """Whether it takes a start value: no constant, initial exact or approx (FMI 2.0.4, section 4.2.4)."""
        return self.variability != "constant" and self.initial in ("exact", "approx")

    def rejection_reason(self, value: float) -> str:
        """Return why it cannot have a value; empty if it can."""
        if not math.isfinite(value):
            return f"found {value:g}, allowed: a finite number"
        if not self.minimum <= value <= self.maximum:
            return f"found {value:.12g}, allowed: {self.minimum:.12g} to {self.maximum:.12g}"
        if self.type == "Integer" and not (value == round(value) and abs(value) < 2.0**31):
            return f"found {value:.12g}, allowed: an integer of 32 bits"
        if self.type == "Boolean" and value not in (0.0, 1.0):
            return f"found {value:.12g}, allowed: true, false"
        return ""

    def start_rejection_reason(self, value: Any) -> str:
        """Return why a value of a system file cannot be its start value; empty if it can."""
        if not self.is_settable:
            kind = f"{self.variability} {self.causality}"
            return f"found {self.name}, {kind}, allowed: a parameter, input or state"
        types: dict[str, tuple[type | tuple[type, ...], str]] = {
            "String": (str, "a text"),
            "Boolean": (bool, "true, false"),
        }
        python_type, allowed = types.get(self.type, ((int, float), NAMES.get(self.unit or "", "a number")))
        if not isinstance(value, python_type) or (isinstance(value, bool) and self.type != "Boolean"):
            spelled = str(value).lower() if isinstance(value, bool) else repr(value)
            return f"found {spelled}, allowed: {allowed}"
        return self.rejection_reason(float(value)) if isinstance(value, (bool, int, float)) else ""

    @property
    def kind(self) -> str:
        """Its type as text, with the name of an enumeration."""
        return f"Enumeration {self.enumeration}" if self.enumeration else self.type


@dataclass(frozen=True, eq=False)
class Interface:
    """The interface of an FMU.

    Attributes:
        path: The FMU.
        identifier: Name of its binaries.
        guid: Identifies the description that belongs to the binaries.
        variables: All variables by name, in order.
        dependencies: For each output, the inputs that its value depends on at once.
        missing_dependencies: Outputs without stated dependencies: assumed to depend on all inputs.
        can_save: Whether its state can be saved and restored.
        variable_step: Whether its communication step may change.
        single_instance: Whether it can be instantiated only once per process.
        description: One line of text; empty if there is none.
    """

    path: Path
    identifier: str
    guid: str
    variables: Mapping[str, Variable]
    dependencies: Mapping[str, frozenset[str]]
    missing_dependencies: frozenset[str]
    can_save: bool
    variable_step: bool
    single_instance: bool
    description: str = ""

    @cached_property
    def inputs(self) -> tuple[Variable, ...]:
        """Its inputs, in order."""
        return tuple(variable for variable in self.variables.values() if variable.causality == "input")

    @cached_property
    def outputs(self) -> tuple[Variable, ...]:
        """Its outputs that are numbers, in order."""
        return tuple(v for v in self.variables.values() if v.causality == "output" and v.type in TYPES)

    @cached_property
    def arrays(self) -> Mapping[str, tuple[Variable, ...]]:
        """The elements of its arrays by the array's name, in the order of their indices."""
        arrays: dict[str, list[tuple[tuple[int, ...], Variable]]] = {}
        for name, variable in self.variables.items():
            match = ELEMENT.fullmatch(name)
            if match and match[1] not in self.variables:
                index = tuple(int(i) for i in match[2].split(","))
                arrays.setdefault(match[1], []).append((index, variable))
        return {
            name: tuple(variable for _, variable in sorted(rows, key=lambda row: row[0]))
            for name, rows in arrays.items()
        }

    def elements(self, name: str) -> tuple[Variable, ...]:
        """Return the scalar of a name, or all elements of an array; empty if there is neither."""
        variable = self.variables.get(name)
        return (variable,) if variable else self.arrays.get(name, ())

    def names(self, causality: str) -> list[str]:
        """Return the names of the variables of a causality, one name per array."""
        names: dict[str, None] = {}
        for name, variable in self.variables.items():
            if variable.causality == causality:
                match = ELEMENT.fullmatch(name)
                names[match[1] if match and match[1] in self.arrays else name] = None
        return list(names)


def read_interface(path: Path) -> Interface:
    """Read the interface of an FMU, without the validation that `check_fmu` does.

    Raises:
        FmuError: If its archive or its description cannot be read.
        CosimulationError: If its variables cannot be read, it is no FMU for co-simulation by FMI 2.0, or it
            has no binaries for this platform.
    """
    file = open_fmu(path)
    description = file.read_description()
    try:
        interface = _interface(path, description)
    except Exception as error:  # a description can be wrong in many ways
        message = " ".join(str(error).split())
        raise CosimulationError(f"{path}: cannot be read as an FMU: {message}") from error
    if interface is None:
        kinds = [kind for kind in ("coSimulation", "modelExchange") if getattr(description, kind)]
        version = f"FMI {description.fmiVersion} for {' and '.join(kinds) or 'nothing'}"
        raise CosimulationError(f"{path}: found {version}, allowed: FMI 2.0 for coSimulation")
    binaries = host_binaries(interface.identifier)
    if not set(file.names) & set(binaries):
        platforms = sorted({name.split("/")[1] for name in file.names if re.match(r"binaries/[^/]+/.", name)})
        raise CosimulationError(
            f"{path}: found binaries for {', '.join(platforms) or 'no platform'},"
            f" allowed: {' or '.join(binaries)}"
        )
    return interface


def _interface(path: Path, description: Any) -> Interface | None:
    """Return the interface in FMPy's description; None if it is not for co-simulation by FMI 2.0."""
    abilities = description.coSimulation
    if description.fmiVersion != "2.0" or abilities is None:
        return None
    inputs = frozenset(v.name for v in description.modelVariables if v.causality == "input")
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    stated = {
        output.variable.name: inputs & {v.name for v in output.dependencies}
        for output in description.outputs
        if output.dependencies is not None
    }
    return Interface(
        path=path,
        identifier=abilities.modelIdentifier,
        guid=description.guid,
        variables={variable.name: variable for variable in _variables(description)},
        dependencies={name: stated.get(name, inputs) for name in outputs},
        missing_dependencies=frozenset(outputs) - stated.keys(),
        can_save=abilities.canGetAndSetFMUstate,
        variable_step=abilities.canHandleVariableCommunicationStepSize,
        single_instance=abilities.canBeInstantiatedOnlyOncePerProcess,
        description=description.description or "",
    )


def _variables(description: Any) -> Iterator[Variable]:
    """Yield the variables of FMPy's description; the declared type fills what a variable does not state."""
    bases = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    for variable in description.modelVariables:
        declared = variable.declaredType
        unit = variable.unit or (declared and declared.unit) or ""
        low, high = (
            getattr(variable, key) or (declared and getattr(declared, key)) for key in ("min", "max")
        )
        is_enumeration = variable.type == "Enumeration"
        yield Variable(
            name=variable.name,
            reference=variable.valueReference,
            type="Integer" if is_enumeration else variable.type,
            enumeration=declared.name if declared and is_enumeration else "",
            causality=variable.causality,
            variability=variable.variability,
            initial=variable.initial or "",
            unit=unit,
            base=_to_si_base(unit, bases.get(unit)),
            minimum=float(low) if low else -math.inf,
            maximum=float(high) if high else math.inf,
            nominal=abs(float(variable.nominal or (declared and declared.nominal) or 0.0)),
            start=variable.start,
            description=variable.description or "",
            display_unit=variable.displayUnit or (declared and declared.displayUnit) or "",
        )


def _to_si_base(unit: str, stated: Any = None) -> BaseUnit | None:
    """Return a unit in the base units of SI, as FMPy read it or else from its spelling; None if unknown."""
    if stated is not None:
        exponents = {name: getattr(stated, name) for name in BASE_NAMES}
        return BaseUnit(**exponents, factor=stated.factor, offset=stated.offset)
    try:
        return parse_unit(unit) if unit else None
    except UnitError:
        return None


def _unit_mismatch(unit: str, base: BaseUnit | None, destination: Variable) -> str | None:
    """Return how the unit of a source differs from an input's; None if it does not, empty if one has none."""
    if destination.type != "Real" or unit == destination.unit:
        return None
    if not unit or not destination.unit:
        return ""
    if base and destination.base and is_same_unit(base, destination.base):
        return None
    return f"found the unit {unit}, allowed: that of the input, {destination.unit}"


@dataclass(frozen=True, slots=True)
class Link:
    """A connection, by scalars.

    Attributes:
        connection: The connection of the system.
        scalars: Each input with its source.
    """

    connection: Connection
    scalars: tuple[tuple[Port, Port], ...]


@dataclass(frozen=True, slots=True)
class StartValue:
    """A scalar that is set before the first step.

    Attributes:
        variable: The scalar.
        value: A number (true is 1, false is 0), or a text.
    """

    variable: Variable
    value: float | str


class Wiring:
    """The connections and start values of a system, checked.

    Args:
        system: The system.
        interfaces: The interface of each block's FMU that could be read.
        units: Unit of the column that each input from a log follows, of those that could be read; empty if it
            is not known.

    Attributes:
        links: The connections.
        logged: The inputs from logs.
        starts: The start values, by block.
        faults: The errors.
        notes: Allowed, but worth a look.
    """

    def __init__(
        self, system: System, interfaces: Mapping[str, Interface], units: Mapping[Port, str]
    ) -> None:
        self.interfaces = interfaces
        self.faults: list[Finding] = []
        self.notes: list[str] = []
        self._sources: dict[Port, str] = {}
        self._mentioned: set[Port] = set()  # inputs with a source in the file, even if a wrong one
        links = [self._link(connection) for connection in system.connections]
        self.links = tuple(link for link in links if link)
        ports = [log_input.destination for log_input in system.inputs]
        self.logged = tuple(port for port in ports if self._check_log_input(port, units.get(port)))
        blocks = [block for block in system.blocks if block.name in interfaces]
        self.starts = {block.name: tuple(self._start_values(block)) for block in blocks}
        for name, interface in interfaces.items():
            self._check_all_fed(name, interface)

    def _fault(self, table: str, message: str) -> None:
        self.faults.append(Finding(message, about=table))

    def _link(self, connection: Connection) -> Link | None:
        """Return a connection by scalars, if both ends exist and have the same size."""
        table = f"connections.{connection.destination}"
        inputs = self._elements(table, connection.destination, "input")
        outputs = self._elements(table, connection.source, "output")
        input_ports = [Port(connection.destination.block, variable.name) for variable in inputs]
        self._mentioned |= {*input_ports}
        if not inputs or not outputs:
            return None
        if len(inputs) != len(outputs):
            size = f"found {connection.source} of size {len(outputs)}, allowed: {len(inputs)}"
            self._fault(table, f"{size}, as many as {connection.destination}")
            return None
        self._compare(table, connection.source, inputs, outputs)
        output_ports = [Port(connection.source.block, variable.name) for variable in outputs]
        scalars = tuple(zip(input_ports, output_ports, strict=True))
        for port, source in scalars:
            self._feed(port, str(source))
        return Link(connection, scalars)

    def _elements(self, table: str, port: Port, causality: str) -> Sequence[Variable]:
        """Return the scalars at a port, if they exist and have a causality."""
        if port.block not in self.interfaces:
            return ()
        interface = self.interfaces[port.block]
        elements = interface.elements(port.variable)
        if not elements:
            unknown = format_unknown_name(port.variable, interface.names(causality))
            self._fault(table, f"{causality} of {port.block}: {unknown}")
        for element in elements:
            if element.causality != causality:
                allowed = ", ".join(interface.names(causality)) or "none"
                self._fault(
                    table,
                    f"found {port.block}.{element.name}, causality {element.causality}, allowed: an"
                    f" {causality} of {port.block}: {allowed}",
                )
                return ()
        return elements

    def _compare(
        self, table: str, source: Port, inputs: Sequence[Variable], outputs: Sequence[Variable]
    ) -> None:
        """Report types and units that differ, and texts; once for an array."""
        for variable, output in zip(inputs, outputs, strict=True):
            if "String" in (variable.type, output.type):
                connected = f"found {source}, {output.kind}, for {variable.name}, {variable.kind}"
                allowed = "numbers: texts are not exchanged, start sets one for the whole run"
                self._fault(table, f"{connected}; allowed: {allowed}")
                return
            if output.kind != variable.kind:
                self._fault(table, f"found {source}, {output.kind}, allowed: {variable.kind}")
                return
            mismatch = _unit_mismatch(output.unit, output.base, variable)
            if mismatch:
                self._fault(table, f"{source}: {mismatch}")
                return
            if mismatch is not None:
                units = f"{output.unit or 'no unit'}, the input {variable.unit or 'no unit'}"
                self.notes.append(f"{table}: {source} has {units}: not compared")

    def _feed(self, port: Port, source: str) -> None:
        """Note the source of an input; report a second one."""
        if port in self._sources:
            self._fault(str(port), f"found two sources, {self._sources[port]} and {source}, allowed: one")
        self._sources[port] = source

    def _check_log_input(self, port: Port, unit: str | None) -> bool:
        """Return whether a log can feed an input; its unit is compared, None if the log was not read."""
        table = f"inputs.{port}"
        elements = self._elements(table, port, "input")
        if not elements:
            return False
        variable = elements[0]
        if variable.name != port.variable:
            names = ", ".join(element.name for element in elements)
            self._fault(table, f"found an array, allowed: one of {names}")
            return False
        if variable.type == "String":
            self._fault(table, "found a String, allowed: a number")
            return False
        self._mentioned.add(port)
        if unit is None:
            return False
        mismatch = _unit_mismatch(unit, _to_si_base(unit), variable)
        if mismatch:
            self._fault(table, mismatch)
        elif mismatch is not None:
            units = f"{unit or 'no unit'}, the input {variable.unit or 'no unit'}"
            self.notes.append(f"{table}: the log has {units}: not compared")
        self._feed(port, "the log")
        return True

    def _start_values(self, block: Block) -> Iterator[StartValue]:
        """Yield the start values of a block, by scalars."""
        interface = self.interfaces[block.name]
        seen: set[str] = set()
        for name, value in block.start.items():
            table = f"blocks.{block.name}.start.{name}"
            elements = interface.elements(name)
            if not elements:
                kinds = ("parameter", "input", "output", "local")
                self._fault(
                    table, format_unknown_name(name, (n for kind in kinds for n in interface.names(kind)))
                )
                continue
            values = value if isinstance(value, list) else [value] * len(elements)
            if len(values) != len(elements):
                self._fault(
                    table,
                    f"found {format_count(len(values), 'value')}, allowed: {len(elements)}, or one for all",
                )
                continue
            for variable, text_or_number in zip(elements, values, strict=True):
                start = _in_si(variable, text_or_number)
                reason = variable.start_rejection_reason(start)
                reason = reason or ("set twice" if variable.name in seen else "")
                seen.add(variable.name)
                if reason:
                    self._fault(table, reason)
                    break
                yield StartValue(variable, start if isinstance(start, str) else float(start))

    def _check_all_fed(self, block: str, interface: Interface) -> None:
        """Report the inputs of a block that have neither source nor start value."""
        fed = {start.variable.name for start in self.starts[block]}
        fed |= {port.variable for port in self._mentioned if port.block == block}
        missing = [variable.name for variable in interface.inputs if variable.name not in fed]
        if missing:
            self._fault(
                f"blocks.{block}",
                f"found inputs without a source: {', '.join(missing)}; allowed: each in"
                " [connections], in [inputs], or with a value in start",
            )


def _in_si(variable: Variable, value: Any) -> Any:
    """Return a start value; a text with its unit as a number, where the variable is in SI."""
    number = (
        quantity_to_si(value, WRITTEN.get(variable.unit or "", {})) if isinstance(value, str) else math.nan
    )
    return number if variable.type == "Real" and math.isfinite(number) else value
