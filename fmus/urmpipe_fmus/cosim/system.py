"""Systems of blocks: which FMUs run together, how they are connected, and for how long.

`read_system` reads a system's TOML file in four steps; every error is collected with its table or key, from
which `add_line_numbers` finds the line.

1. Texts that name a file in the folder of the system file become its path (`_resolve_paths`).
2. The arguments get their values: defaults from `[arguments]`, replaced by those of the caller
   (`_merge_arguments`).
3. Each text `$name` is replaced by the argument of that name (`_substitute_arguments`).
4. The tables `system`, `blocks`, `connections`, `inputs` and `loops` are read (`_SystemReader`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
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
from urmpipe_models.toml_tables import CheckedTable, is_number, read_toml

SYSTEMS_FOLDER = Path(__file__).parents[1] / "systems"  # the systems that are shipped
DEFAULT_STEP = 0.005  # s; communication step of a system that states none and plays no log
DEFAULT_TOLERANCE = 1e-9  # residual of an algebraic loop, relative to nominal + |value|


class Port(NamedTuple):
    """A variable of a block, or an array of variables.

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
    """A block: a named FMU of a system.

    Attributes:
        name: Its name in the system.
        unit: Name of a block model of urmpipe; empty if it is a file.
        file: A user's Python file with a block model.
        fmu: An FMU of any origin.
        options: Options of the block model: text, numbers, booleans, lists of them.
        start: Start values of parameters, inputs and states, by name.
    """

    name: str
    unit: str = ""
    file: Path | None = None
    fmu: Path | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    start: Mapping[str, Any] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """Name of the block model or of the file, for display."""
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
        log: The file; empty if the system file describes the input wrongly.
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
        description: One line of text.
        step: Communication step in [s]; None: the period of the logs that it plays, else `DEFAULT_STEP`.
        duration: In [s]; None: that of the longest log that it reads.
        record_every: Number of communication points per recorded one.
        arguments: The values that replaced `$name`.
        blocks: In the order of the file.
        connections: In the order of the file.
        inputs: Inputs from logs.
        iterate: Whether algebraic loops are iterated; else they are errors.
        tolerance: Residual of an iterated loop, relative to nominal + |value|.
        faults: Errors of the file; `prepare` reports them together with all others.
        unusable_blocks: Names of the blocks that were not read as the file means them, because of errors.
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
    tolerance: float = DEFAULT_TOLERANCE
    faults: tuple[Finding, ...] = ()
    unusable_blocks: frozenset[str] = frozenset()


def system_names() -> tuple[str, ...]:
    """Return the names of the shipped systems."""
    return tuple(sorted(path.stem for path in SYSTEMS_FOLDER.glob("*.toml")))


def system_name(name: str) -> str:
    """Return the name of a shipped system whose words are joined by - or _; any other name as it is."""
    joined = name.replace("_", "-")
    return joined if joined in system_names() else name


def system_text(name: str) -> str:
    """Return the file of a shipped system as text, with its comments, to be changed.

    Raises:
        CosimulationError: If there is no such system.
    """
    if system_name(name) not in system_names():
        unknown = f"{format_value(name)}{format_suggestion(name, system_names())}"
        raise CosimulationError(f"system: found {unknown}, allowed: one of {', '.join(system_names())}")
    return _system_path(name).read_text(encoding="utf-8")


def load_system(name_or_path: str | Path, arguments: Mapping[str, str] | None = None) -> System:
    """Return the system of a file without errors; see `read_system`.

    Raises:
        CosimulationError: With all errors: no such file, no TOML, unknown keys, values of another type or
            out of range, names of no block, arguments that the file does not have.
    """
    system = read_system(name_or_path, arguments)
    if system.faults:
        raise CosimulationError(*system.faults)
    return system


def read_system(name_or_path: str | Path, arguments: Mapping[str, str] | None = None) -> System:
    """Read a system file; its errors are in `faults`, to be reported with those found later.

    Paths in the file are relative to its folder; those in `arguments` to the working folder.

    Args:
        name_or_path: Name of a shipped system, or a TOML file.
        arguments: Values for the file's `$name`s instead of its defaults.

    Raises:
        CosimulationError: If there is no such file, or it is no TOML.
    """
    path = _system_path(name_or_path)
    if path.suffix.lower() == ".fmu":
        allowed = f"a TOML file in which it is a block, [blocks.NAME] fmu = {path.name!r}"
        raise CosimulationError(Finding(f"found an FMU, allowed: {allowed}", file=str(path)))
    tables = read_toml(path, CosimulationError)
    faults: list[Finding] = []
    CheckedTable(tables, faults, None, key_in_about=True).table("arguments")  # reports what is no table
    resolved = {key: _resolve_paths(path.parent, tables.get(key, {})) for key in _WITH_PATHS}
    defaults = resolved["arguments"] if isinstance(resolved["arguments"], Mapping) else {}
    values = _merge_arguments(defaults, arguments or {}, faults, shipped=path.parent == SYSTEMS_FOLDER)
    tables = {key: value for key, value in {**tables, **resolved}.items() if key != "arguments"}
    system = _SystemReader(path, _substitute_arguments(tables, values, faults), faults).read()
    unusable = (block.name for block in system.blocks if _has_fault(f"blocks.{block.name}", faults))
    placed_faults = add_line_numbers(path, str(name_or_path), faults) if faults else ()
    return replace(system, arguments=values, faults=placed_faults, unusable_blocks=frozenset(unusable))


def _system_path(name_or_path: str | Path) -> Path:
    if isinstance(name_or_path, str) and (name := system_name(name_or_path)) in system_names():
        return SYSTEMS_FOLDER / f"{name}.toml"
    path = Path(name_or_path)
    if path.is_file():
        return path
    hint = format_suggestion(str(name_or_path), system_names()) or suggest_path(path, (".toml",))
    allowed = f"a TOML file, or one of {', '.join(system_names())}"
    raise CosimulationError(f"system: found {format_value(str(name_or_path))}{hint}, allowed: {allowed}")


def _has_fault(table: str, faults: list[Finding]) -> bool:
    """Return whether a fault is one of a table, such as `blocks.drive`, or of a key in it."""
    return any(f"{fault.about}.".startswith(f"{table}.") for fault in faults)


_WITH_PATHS = ("arguments", "blocks", "inputs")  # tables whose texts may name files
_NAME_KEYS = {"unit", "column"}  # keys whose texts are names, also if a file has the same name


def _resolve_paths(folder: Path, tables: Any) -> Any:
    """Return tables in which each text that names a file of a folder is that file's path."""

    def resolve(text: str, keys: tuple[str, ...]) -> str:
        if not text or text.startswith("$") or not _NAME_KEYS.isdisjoint(keys):
            return text
        return str(folder / text) if is_existing_file(folder / text) else text

    return _map_texts(resolve, tables)


def _substitute_arguments(tables: Any, arguments: Mapping[str, Any], faults: list[Finding]) -> Any:
    """Return tables in which each text `$name` is the argument of that name; unknown names are reported."""

    def substitute(text: str, keys: tuple[str, ...]) -> Any:
        if text.startswith("$") and text[1:] in arguments:
            return arguments[text[1:]]
        if text.startswith("$"):
            unknown = format_unknown_name(text, (f"${name}" for name in arguments))
            faults.append(Finding(f"{unknown} ([arguments] names them)", about=".".join(keys)))
        return text

    return _map_texts(substitute, tables)


def _map_texts(function: Callable[[str, tuple[str, ...]], Any], value: Any, *keys: str) -> Any:
    """Return tables and lists in which each text is replaced by a function of it and its keys."""
    if isinstance(value, Mapping):
        return {key: _map_texts(function, item, *keys, key) for key, item in value.items()}
    if isinstance(value, list):
        return [_map_texts(function, item, *keys) for item in value]
    return function(value, keys) if isinstance(value, str) else value


def _merge_arguments(
    defaults: Mapping[str, Any], arguments: Mapping[str, str], faults: list[Finding], shipped: bool = False
) -> dict[str, Any]:
    """Return the defaults, with the caller's texts as values of their types instead; errors are added."""
    values = dict(defaults)
    for name, text in arguments.items():
        if name not in defaults:
            message = f"{format_unknown_name(name, defaults)}; all else is changed in the system's file"
            hints = (Hint("write_system", None, "makes a copy of it"),) if shipped else ()
            faults.append(Finding(message, about=f"argument {name}", hints=hints))
            continue
        try:
            values[name] = _parse_like(defaults[name], text)
        except ValueError:
            allowed = "true, false" if isinstance(defaults[name], bool) else "a number"
            message = f"found {format_value(text)}, allowed: {allowed}, like {format_value(defaults[name])}"
            faults.append(Finding(message, about=f"argument {name}"))
    return values


_WITH_UNIT = [{unit: factor for unit, factor in units.items() if unit} for units in WRITTEN.values()]


def _parse_like(default: Any, text: str) -> Any:
    """Return a text as a value of a default's type; ValueError if it has another."""
    if isinstance(default, bool):
        if text not in ("true", "false"):
            raise ValueError(text)
        return text == "true"
    if isinstance(default, str) or any(math.isfinite(quantity_to_si(text, units)) for units in _WITH_UNIT):
        return text
    return int(text) if isinstance(default, int) and text.lstrip("+-").isdigit() else float(text)


NO_PORT = Port("", "")  # end of a connection that the file describes wrongly
BLOCK_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
BLOCK_KINDS = ("unit", "file", "fmu")


class _SystemReader:
    """Reads the tables of a system file whose arguments are replaced; errors are added to `faults`."""

    def __init__(self, path: Path, tables: Mapping[str, Any], faults: list[Finding]) -> None:
        self.path, self.tables, self.faults = path, tables, faults
        self.table = CheckedTable(tables, faults, None, key_in_about=True)

    def read(self) -> System:
        """Return the system."""
        head = self.table.table("system")
        name, description = head.text("name", self.path.stem), head.text("description", "")
        allowed = 'a time above 0 in s, or with its unit as in "1ms"'
        step, duration = (_positive(head, key, allowed, WRITTEN["s"]) for key in ("step", "duration"))
        record_every = head.value("record_every") if head.has("record_every") else 1
        if isinstance(record_every, bool) or not isinstance(record_every, int) or record_every < 1:
            head.add_error("record_every", f"found {format_value(record_every)}, allowed: an integer from 1")
            record_every = 1
        head.report_unknown_keys()
        self.table.has("arguments")  # an allowed key
        rows = self.table.named_tables("blocks")
        blocks = tuple(
            self._block(name, table, self.tables["blocks"][name])
            for name, table in rows.items()
            if isinstance(self.tables["blocks"][name], Mapping)
        )
        if not blocks:
            self.table.add_error("blocks", "found none, allowed: at least one [blocks.NAME]")
        self.names = [block.name for block in blocks]
        connections = tuple(self._connection(*row) for row in self._leaves("connections", str))
        inputs = tuple(self._input(*row) for row in self._leaves("inputs", dict))
        loops = self.table.table("loops")
        iterate = loops.flag("iterate")
        tolerance = _positive(loops, "tolerance", "a number above 0")
        loops.report_unknown_keys()
        self.table.report_unknown_keys()
        return System(
            name=name,
            path=self.path,
            description=description,
            step=step,
            duration=duration,
            record_every=record_every,
            blocks=blocks,
            connections=connections,
            inputs=inputs,
            iterate=iterate,
            tolerance=tolerance or DEFAULT_TOLERANCE,
        )

    def _block(self, name: str, table: CheckedTable, values: Mapping[str, Any]) -> Block:
        where = f"blocks.{name}"
        if not BLOCK_NAME.fullmatch(name):
            allowed = "a letter, then letters, digits, _, -"
            self.table.add_error(where, f"found {format_value(name)} as a name, allowed: {allowed}")
        kinds = [key for key in BLOCK_KINDS if key in values]
        if len(kinds) != 1:
            stated = " and ".join(kinds) or "none of them"
            self.table.add_error(where, f"found {stated}, allowed: one of {', '.join(BLOCK_KINDS)}")
        texts = {key: table.text(key) for key in kinds}
        for key in ("file", "fmu"):
            if texts.get(key) and not is_existing_file(Path(texts[key])):
                table.add_error(key, f"found {format_value(texts[key])}, allowed: a file that is there")
        table.table("start")
        if "fmu" in kinds:  # has no options: all keys are known
            table.report_unknown_keys()
        start = values.get("start", {})
        return Block(
            name=name,
            unit=normalise_block_name(texts.get("unit", "")),
            file=Path(texts["file"]) if texts.get("file") else None,
            fmu=Path(texts["fmu"]) if texts.get("fmu") else None,
            options={key: value for key, value in values.items() if key not in (*BLOCK_KINDS, "start")},
            start=start if isinstance(start, Mapping) else {},
        )

    def _connection(self, destination: str, source: Any) -> Connection:
        where = f"connections.{destination}"
        if isinstance(source, str):
            return Connection(self._port(where, destination), self._port(where, source))
        self.table.add_error(where, f"found {format_value(source)}, allowed: its source as 'block.variable'")
        return Connection(self._port(where, destination), NO_PORT)

    def _input(self, destination: str, values: Any) -> LogInput:
        where = f"inputs.{destination}"
        port = self._port(where, destination)
        if not isinstance(values, Mapping):
            self.table.add_error(
                where, f"found {format_value(values)}, allowed: {{ log = FILE, column = NAME }}"
            )
            return LogInput(destination=port, log="", column="")
        table = CheckedTable(values, self.faults, None, f"{where}.", key_in_about=True)
        log, column = table.text("log"), table.text("column")
        for key in ("log", "column"):
            if values.get(key) == "":
                table.add_error(key, "found '', allowed: a text that is not empty")
        interpolate = table.flag("interpolate")
        table.report_unknown_keys()
        log = "" if _has_fault(where, self.faults) else log
        return LogInput(destination=port, log=log, column=column, interpolate=interpolate)

    def _port(self, where: str, text: str) -> Port:
        """Return the port that a text `block.variable` names; `NO_PORT` if there is no such block."""
        block, dot, variable = text.partition(".")
        if not (block and dot and variable):
            self.table.add_error(where, f"found {format_value(text)}, allowed: block.variable")
        elif block not in self.names:
            self.table.add_error(where, f"block {format_unknown_name(block, self.names)}")
        else:
            return Port(block, variable)
        return NO_PORT

    def _leaves(self, key: str, leaf: type) -> Iterator[tuple[str, Any]]:
        """Yield the rows of a table; TOML nests its keys, `drive.u`, if they are not in quotes."""
        self.table.table(key)  # reports what is no table
        rows = self.tables.get(key)
        yield from _flatten(rows, leaf) if isinstance(rows, Mapping) else ()


def _flatten(table: Mapping[str, Any], leaf: type, name: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        path = f"{name}.{key}" if name else key
        nested = isinstance(value, dict) and (
            leaf is not dict or (value and all(isinstance(item, dict) for item in value.values()))
        )
        if nested:
            yield from _flatten(value, leaf, path)
        else:
            yield path, value


def _positive(
    table: CheckedTable, key: str, allowed: str, units: Mapping[str, Any] | None = None
) -> float | None:
    """Return a number above 0, also from a text with one of some units; None if it is missing or wrong."""
    value = table.value(key)
    number = quantity_to_si(value, units or {}) if isinstance(value, str) else value
    if value is None:
        return None
    if is_number(number) and number > 0.0:
        return float(number)
    table.add_error(key, f"found {format_value(value)}, allowed: {allowed}")
    return None
