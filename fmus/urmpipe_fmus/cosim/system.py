"""A system of blocks: what is run together, how it is connected, and for how long.

The arguments of a system file: `$name` in it, replaced before anything else is read.

A system's TOML file: read, its arguments replaced, and all that is wrong with it told at once.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from urmpipe_fmus.blocks import normalise_block_name
from urmpipe_models.errors import (
    CosimulationError,
    Finding,
    Hint,
    format_suggestion,
    format_unknown_name,
    format_value,
)
from urmpipe_models.files import add_line_numbers, is_existing_file, suggest_path
from urmpipe_models.measure_units import WRITTEN, quantity_to_si
from urmpipe_models.toml_tables import read_toml

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


NAMES = ("unit", "column")
"""Keys whose texts are names, also where a file beside is called so."""


def beside(folder: Path, value: Any) -> Any:
    """Return a value in which each text that names a file of a folder is that file's path."""
    if isinstance(value, str) and value and not value.startswith("$"):
        path = folder / value
        return str(path) if is_existing_file(path) else value
    if isinstance(value, Mapping):
        return {key: one if key in NAMES else beside(folder, one) for key, one in value.items()}
    return _mapped(lambda one: beside(folder, one), value)


def replaced(value: Any, arguments: Mapping[str, Any]) -> Any:
    """Return a value in which each text `$name` is the argument of that name."""
    if isinstance(value, str) and value[:1] == "$" and value[1:] in arguments:
        return arguments[value[1:]]
    return _mapped(lambda one: replaced(one, arguments), value)


def unknown(value: Any, arguments: Mapping[str, Any], where: str = "") -> Iterator[Finding]:
    """Yield what is wrong with the `$name`s of a value: no such argument."""
    if isinstance(value, str) and value[:1] == "$" and value[1:] not in arguments:
        yield Finding(
            f"{format_unknown_name(value, (f'${name}' for name in arguments))} ([arguments] names them)",
            about=where,
        )
    elif isinstance(value, Mapping):
        for key, one in value.items():
            yield from unknown(one, arguments, f"{where}.{key}" if where else str(key))
    elif isinstance(value, list):
        for one in value:
            yield from unknown(one, arguments, where)


def given(
    defaults: Mapping[str, Any], arguments: Mapping[str, str], faults: list[Finding], shipped: bool = False
) -> dict[str, Any]:
    """Return the arguments of a system: those given, each of its default's type, and the other defaults.

    Args:
        defaults: What the file's `[arguments]` says.
        arguments: What is given instead, as texts.
        faults: What is wrong is noted here.
        shipped: Whether the system came along.
    """
    values = dict(defaults)
    for name, text in arguments.items():
        if name not in defaults:
            said = f"{format_unknown_name(name, defaults)}; all else is changed in the system's file"
            hints = (Hint("write_system", None, "makes a copy of it"),) if shipped else ()
            faults.append(Finding(said, about=f"argument {name}", hints=hints))
            continue
        try:
            values[name] = _like(defaults[name], text)
        except ValueError:
            allowed = "true, false" if isinstance(defaults[name], bool) else "a number"
            faults.append(
                Finding(
                    f"found {format_value(text)}, allowed: {allowed}, like {format_value(defaults[name])}",
                    about=f"argument {name}",
                )
            )
    return values


def _like(default: Any, text: str) -> Any:
    """Return a text as a value of a default's type; ValueError if it is none."""
    if isinstance(default, bool):
        if text not in ("true", "false"):
            raise ValueError(text)
        return text == "true"
    if isinstance(default, str) or any(math.isfinite(quantity_to_si(text, units)) for units in _WITH_UNIT):
        return text
    return int(text) if isinstance(default, int) and text.lstrip("+-").isdigit() else float(text)


_WITH_UNIT = [{unit: one for unit, one in units.items() if unit} for units in WRITTEN.values()]


def _mapped(function: Callable[[Any], Any], value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: function(one) for key, one in value.items()}
    if isinstance(value, list):
        return [function(one) for one in value]
    return value


NOWHERE = Port("", "")
"""Stands for an end of a connection that the file does not tell rightly."""

BLOCK_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")

TABLES: dict[str, tuple[str, ...] | None] = {
    "system": ("name", "description", "step", "duration", "record_every"),
    "arguments": None,
    "blocks": None,
    "connections": None,
    "inputs": None,
    "loops": ("iterate", "tolerance"),
}
"""The tables of a file and their keys; None where the user names the keys."""


def system_name(name: str) -> str:
    """Return the name of a shipped system whose words are joined by - or _; any other name as it is."""
    joined = name.replace("_", "-")
    return joined if joined in system_names() else name


def system_names() -> tuple[str, ...]:
    """Return the names of the shipped systems."""
    return tuple(sorted(path.stem for path in SYSTEMS.glob("*.toml")))


def system_text(name: str) -> str:
    """Return the file of a shipped system as it is written, to be changed.

    Raises:
        CosimulationError: If there is no such system.
    """
    if system_name(name) not in system_names():
        found = f"found {format_value(name)}{format_suggestion(name, system_names())}"
        raise CosimulationError(f"system: {found}, allowed: one of {', '.join(system_names())}")
    return _path_of(name).read_text(encoding="utf-8")


def load_system(name_or_path: str | Path, arguments: Mapping[str, str] | None = None) -> System:
    """Return the system of a file with which nothing is wrong; see `read_system`.

    Raises:
        CosimulationError: With all that is wrong: no such file, no TOML, unknown keys, values of another
            type or out of range, names of no block, arguments that the file does not have.
    """
    system = read_system(name_or_path, arguments)
    if system.faults:
        raise CosimulationError(*system.faults)
    return system


def read_system(name_or_path: str | Path, arguments: Mapping[str, str] | None = None) -> System:
    """Read a system file; what is wrong with it stands in `faults`, to be told with what is found later.

    Paths in the file are relative to its folder; those in `arguments` to the working folder.

    Args:
        name_or_path: Name of a shipped system, or a TOML file.
        arguments: Values for the file's `$name`s instead of its defaults.

    Raises:
        CosimulationError: If there is no such file, or it is no TOML.
    """
    path = _path_of(name_or_path)
    table = _parsed(path)
    faults: list[Finding] = []
    defaults = _table(table, "arguments", faults)
    here = {key: beside(path.parent, table.get(key, {})) for key in ("arguments", "blocks", "inputs")}
    values = given(
        here["arguments"] if defaults else {}, arguments or {}, faults, shipped=path.parent == SYSTEMS
    )
    rest = {key: value for key, value in {**table, **here}.items() if key != "arguments"}
    faults += unknown(rest, values)
    system = _System(path, replaced(rest, values), values, faults).read()
    unread = {name for name in system.by_name if any(_is_of(f"blocks.{name}", fault) for fault in faults)}
    found = add_line_numbers(path, str(name_or_path), faults) if faults else ()
    return replace(system, faults=found, unread=frozenset(unread))


def _is_of(table: str, fault: Finding) -> bool:
    """Return whether a fault is one of a table, such as `blocks.drive`, or of a key in it."""
    return f"{fault.about}.".startswith(f"{table}.")


def _path_of(name_or_path: str | Path) -> Path:
    """Return the path of a system file."""
    if isinstance(name_or_path, str) and (name := system_name(name_or_path)) in system_names():
        return SYSTEMS / f"{name}.toml"
    path = Path(name_or_path)
    if path.is_file():
        return path
    meant = format_suggestion(str(name_or_path), system_names()) or suggest_path(path, (".toml",))
    allowed = f"a TOML file, or one of {', '.join(system_names())}"
    raise CosimulationError(f"system: found {format_value(str(name_or_path))}{meant}, allowed: {allowed}")


def _parsed(path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file."""
    if path.suffix.lower() == ".fmu":
        said = f"found an FMU, allowed: a TOML file in which it is a block, [blocks.NAME] fmu = {path.name!r}"
        raise CosimulationError(Finding(said, file=str(path)))
    return read_toml(path, CosimulationError)


def _table(table: Mapping[str, Any], key: str, faults: list[Finding]) -> dict[str, Any]:
    """Return a table of a table; an empty one where it is none."""
    value = table.get(key, {})
    if isinstance(value, dict):
        return value
    faults.append(Finding(f"found {format_value(value)}, allowed: a table", about=key))
    return {}


class _System:
    """A system file whose arguments are replaced, on its way to a System."""

    def __init__(
        self, path: Path, table: Mapping[str, Any], arguments: Mapping[str, Any], faults: list[Finding]
    ) -> None:
        self.path, self.table, self.arguments, self.faults = path, table, arguments, faults

    def _fault(self, where: str, said: str) -> None:
        """Note what is wrong with a table or key."""
        self.faults.append(Finding(said, about=where))

    def read(self) -> System:
        """Return the system; what is wrong is in `faults`."""
        self.faults += [
            Finding(format_unknown_name(key, TABLES), about=key) for key in self.table if key not in TABLES
        ]
        head, loops = self._keys("system"), self._keys("loops")
        blocks = tuple(self._block(name, value) for name, value in self._rows("blocks"))
        if not blocks:
            self._fault("blocks", "found none, allowed: at least one [blocks.NAME]")
        self.names = [block.name for block in blocks]
        connections = (self._connection(*row) for row in _leaves(self._dict("connections"), str))
        inputs = (self._input(*row) for row in _leaves(self._dict("inputs"), dict))
        return System(
            path=self.path,
            name=self._text(head, "system", "name", self.path.stem),
            description=self._text(head, "system", "description", ""),
            step=self._time(head, "step"),
            duration=self._time(head, "duration"),
            record_every=self._count(head, "record_every"),
            arguments=self.arguments,
            blocks=blocks,
            connections=tuple(connections),
            inputs=tuple(inputs),
            iterate=self._flag(loops, "loops", "iterate"),
            tolerance=self._positive(loops, "loops", "tolerance", TOLERANCE),
        )

    def _dict(self, key: str) -> dict[str, Any]:
        return _table(self.table, key, self.faults)

    def _keys(self, name: str) -> dict[str, Any]:
        """Return a table whose keys are known."""
        table, allowed = self._dict(name), TABLES[name] or ()
        self.faults += [
            Finding(format_unknown_name(key, allowed), about=f"{name}.{key}")
            for key in table
            if key not in allowed
        ]
        return table

    def _rows(self, name: str) -> Iterator[tuple[str, dict[str, Any]]]:
        table = self._dict(name)
        for key, value in table.items():
            if isinstance(value, dict):
                yield key, value
            else:
                self._fault(f"{name}.{key}", f"found {format_value(value)}, allowed: a table [{name}.{key}]")

    def _block(self, name: str, table: dict[str, Any]) -> Block:
        """Return a block."""
        where = f"blocks.{name}"
        if not BLOCK_NAME.fullmatch(name):
            self._fault(
                where, f"found {format_value(name)} as a name, allowed: a letter, then letters, digits, _, -"
            )
        kinds = [key for key in ("unit", "file", "fmu") if key in table]
        if len(kinds) != 1:
            found = " and ".join(kinds) or "none of them"
            self._fault(where, f"found {found}, allowed: one of unit, file, fmu")
        options = {k: v for k, v in table.items() if k not in ("unit", "file", "fmu", "start")}
        if "fmu" in kinds:
            self.faults += [
                Finding(format_unknown_name(key, ("fmu", "start")), about=f"{where}.{key}") for key in options
            ]
        start = table.get("start", {})
        if not isinstance(start, dict):
            self._fault(
                f"{where}.start", f"found {format_value(start)}, allowed: a table of names and values"
            )
            start = {}
        return Block(
            name=name,
            unit=normalise_block_name(self._text(table, where, "unit", "")),
            file=self._file(table, where, "file"),
            fmu=self._file(table, where, "fmu"),
            options=options,
            start=start,
        )

    def _connection(self, destination: str, source: Any) -> Connection:
        """Return a connection."""
        where = f"connections.{destination}"
        if isinstance(source, str):
            return Connection(self._port(where, destination), self._port(where, source))
        self._fault(where, f"found {format_value(source)}, allowed: its source as 'block.variable'")
        return Connection(self._port(where, destination), NOWHERE)

    def _input(self, destination: str, table: Any) -> LogInput:
        """Return an input from a log."""
        where = f"inputs.{destination}"
        if not isinstance(table, dict):
            self._fault(where, f"found {format_value(table)}, allowed: {{ log = FILE, column = NAME }}")
            return LogInput(destination=self._port(where, destination), log="", column="")
        allowed = ("log", "column", "interpolate")
        self.faults += [
            Finding(format_unknown_name(key, allowed), about=f"{where}.{key}")
            for key in table
            if key not in allowed
        ]
        port = self._port(where, destination)
        for key in ("log", "column"):
            if not table.get(key):
                self._fault(f"{where}.{key}", "not found, allowed: a text")
        log, column = self._text(table, where, "log", ""), self._text(table, where, "column", "")
        interpolate = self._flag(table, where, "interpolate")
        wrong = any(_is_of(where, fault) for fault in self.faults)
        return LogInput(destination=port, log="" if wrong else log, column=column, interpolate=interpolate)

    def _port(self, where: str, text: str) -> Port:
        """Return the port that a text `block.variable` names, `NOWHERE` if there is no such block."""
        block, dot, variable = text.partition(".")
        if not (block and dot and variable):
            self._fault(where, f"found {format_value(text)}, allowed: block.variable")
            return NOWHERE
        if block not in self.names:
            self._fault(where, f"block {format_unknown_name(block, self.names)}")
            return NOWHERE
        return Port(block, variable)

    def _text(self, table: Mapping[str, Any], where: str, key: str, default: str) -> str:
        value = table.get(key, default)
        if isinstance(value, str):
            return value
        self._fault(f"{where}.{key}", f"found {format_value(value)}, allowed: a text")
        return default

    def _file(self, table: Mapping[str, Any], where: str, key: str) -> Path | None:
        """Return the path of a file that is there."""
        text = self._text(table, where, key, "")
        if not text:
            return None
        if not is_existing_file(Path(text)):
            self._fault(f"{where}.{key}", f"found {format_value(text)}, allowed: a file that is there")
        return Path(text)

    def _flag(self, table: Mapping[str, Any], where: str, key: str) -> bool:
        value = table.get(key, False)
        if not isinstance(value, bool):
            self._fault(f"{where}.{key}", f"found {format_value(value)}, allowed: true, false")
        return value is True

    def _positive(self, table: Mapping[str, Any], where: str, key: str, default: float) -> float:
        value = table.get(key, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < math.inf:
            self._fault(f"{where}.{key}", f"found {format_value(value)}, allowed: a number above 0")
            return default
        return float(value)

    def _time(self, head: Mapping[str, Any], key: str) -> float | None:
        """Return a time of the system in [s]: a number, or a text with its unit; None if there is none."""
        found = head.get(key)
        if found is None:
            return None
        value = quantity_to_si(found, WRITTEN["s"]) if isinstance(found, str) else found
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < math.inf:
            allowed = 'a time above 0 in s, or with its unit as in "1ms"'
            self._fault(f"system.{key}", f"found {format_value(found)}, allowed: {allowed}")
            return None
        return float(value)

    def _count(self, table: Mapping[str, Any], key: str) -> int:
        value = table.get(key, 1)
        if isinstance(value, bool) or not isinstance(value, int) or value < 1:
            self._fault(f"system.{key}", f"found {format_value(value)}, allowed: an integer from 1")
            return 1
        return value


def _leaves(table: Mapping[str, Any], leaf: type, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the rows of a table; TOML nests its keys, `drive.u`, where they stand without quotes."""
    for key, value in table.items():
        path = f"{name}.{key}" if name else key
        nested = isinstance(value, dict) and (
            leaf is not dict or (value and all(isinstance(one, dict) for one in value.values()))
        )
        if nested:
            yield from _leaves(value, leaf, path)
        else:
            yield path, value
