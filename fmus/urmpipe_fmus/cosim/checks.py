"""What goes where in a system, by scalars, and all that is wrong with it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from urmpipe_fmus.cosim.interface import Interface, Variable, si_base, unit_fault
from urmpipe_fmus.cosim.system import Block, Connection, Port, System
from urmpipe_models.errors import Finding, not_among
from urmpipe_models.measure_units import NAMES, WRITTEN, quantity


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
            allowed = not_among(port.variable, shown.names(causality))
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
                self._fault(where, not_among(name, names))
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
    number = quantity(value, WRITTEN.get(one.unit or "", {})) if isinstance(value, str) else math.nan
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
