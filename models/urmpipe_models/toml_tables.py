"""TOML and other tables of keys and values: checked reading with all errors at once, and writing.

1. `CheckedTable`: reads a table of TOML or JSON key by key, and collects the errors.
2. `read_toml`: a TOML file within limits of size and depth, with the line of each error.
3. `format_toml`: plain values as lines of TOML.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any, TypeAlias

from urmpipe_models.errors import Finding, UrmpipeError, escape_json, format_suggestion, format_value
from urmpipe_models.files import add_line_numbers, read_contents
from urmpipe_models.measure_units import NAMES, WRITTEN, quantity_to_si

Rows3: TypeAlias = tuple[tuple[float, ...], ...]

MAX_SUGGESTED_KEYS = 100  # unknown keys of one table with a suggestion
MAX_DEPTH = 50  # of nested tables and lists; descriptions need six
MAX_KEY_LENGTH = 1000  # characters
MAX_KEYS = 20_000  # in a file
INTEGER_RANGE = "64 bits at most"


class CheckedTable:
    """One table, read key by key.

    A getter returns the value of a key. If it is missing or not allowed, the error is added and a substitute
    is returned, so that reading continues and all errors are found. Then `report_unknown_keys` adds the keys
    that no getter read.

    Attributes:
        faults: The errors found, shared with all tables within.
        place: Place of the table, such as `joints[2].` (empty for the outermost one).
        key_in_about: Whether an error has its key in `about`, where `add_line_numbers` finds it, and not in
            its message.
    """

    def __init__(
        self,
        data: Mapping[str, Any],
        faults: list[Finding],
        file: str | None,
        place: str = "",
        *,
        key_in_about: bool = False,
    ) -> None:
        self.faults = faults
        self.place = place
        self.key_in_about = key_in_about
        self._data = data
        self._file = file
        self._known: list[str] = []

    def add_error(self, key: str, message: str) -> None:
        """Add an error of a key."""
        where = f"{self.place}{key}"
        if self.key_in_about:
            self.faults.append(Finding(message, self._file, about=where))
        else:
            self.faults.append(Finding(f"key {where}: {message}", self._file))

    def has(self, key: str) -> bool:
        """Return whether the key exists and is not null."""
        self._known.append(key)
        return self._data.get(key) is not None

    def value(self, key: str) -> Any:
        """Return the unchecked value of a key, or None if it is missing."""
        return self._data[key] if self.has(key) else None

    def text(self, key: str, default: str | None = None) -> str:
        """Return a string; without a default the key is required."""
        value = self._get(key, default)
        if isinstance(value, str):
            return value
        self._reject(key, value, "a text")
        return ""

    def choice(self, key: str, allowed: Sequence[str], default: str | None = None) -> str:
        """Return one of the allowed strings; without a default the key is required."""
        value = self._get(key, default)
        if value in allowed:
            return str(value)
        suggestion = format_suggestion(str(value), allowed)
        self._reject(key, value, f"one of {', '.join(allowed)}{suggestion}")
        return allowed[0]

    def number(
        self, key: str, default: float | None = None, *, infinite: bool = False, si: str = ""
    ) -> float:
        """Return a number; without a default the key is required.

        Args:
            key: The key.
            default: The number if the key is missing.
            infinite: Whether infinities are allowed.
            si: SI unit of the quantity: then a text with a unit is allowed as well.
        """
        if default is not None and not self.has(key):
            return default
        allowed = NAMES.get(si, "a number" if infinite else "a finite number")
        raw = self._get(key)
        value = _to_si(raw, si)
        if is_number(value, infinite):
            return float(value)
        self._reject(key, raw, allowed)
        return default if default is not None else 0.0

    def numbers(
        self, key: str, count: int | None, default: Sequence[float] | None = None, si: Sequence[str] = ()
    ) -> tuple[float, ...]:
        """Return `count` finite numbers (None: any number of them); without a default the key is required.

        Texts with units are allowed as well for the quantities whose SI units are in `si`.
        """
        allowed = "a list of finite numbers" if count is None else f"{count} finite numbers"
        value = self._get(key, default)
        if isinstance(value, (list, tuple)) and count in {None, len(value)}:
            value = [_to_si(item, unit) for item, unit in zip_longest(value, si[: len(value)], fillvalue="")]
            if all(is_number(item) for item in value):
                return tuple(float(item) for item in value)
            for index, item in enumerate(value):
                if not is_number(item):
                    self._reject(f"{key}[{index}]", item, "a finite number")
        else:
            self._reject(key, value, allowed)
        return (0.0,) * (count or 0)

    def flag(self, key: str) -> bool:
        """Return true or false; false if the key is missing."""
        value = self._get(key, default=False)
        if not isinstance(value, bool):
            self._reject(key, value, "true or false")
        return value is True

    def texts(self, key: str) -> tuple[str, ...]:
        """Return a list of strings; the key is required."""
        value = self._get(key)
        if isinstance(value, (list, tuple)) and all(isinstance(item, str) for item in value):
            return tuple(value)
        self._reject(key, value, "a list of texts")
        return ()

    def mapping(self, key: str) -> dict[str, str]:
        """Return a table of strings under any keys; empty if it is missing."""
        value = self._get(key, {})
        if isinstance(value, Mapping) and all(isinstance(item, str) for item in value.values()):
            return dict(value)
        self._reject(key, value, "a table of texts")
        return {}

    def spread(self, key: str, count: int, default: float) -> tuple[float, ...]:
        """Return `count` numbers, which may be infinite; a single number in the file counts for all."""
        value = self._get(key, default)
        if is_number(value, infinite=True):
            return (float(value),) * count
        if is_number_list(value, count, infinite=True):
            return tuple(float(item) for item in value)
        self._reject(key, value, f"a number, or {count} numbers, one per joint")
        return (default,) * count

    def rows(self, key: str) -> Rows3:
        """Return the three rows of a 3x3 matrix; the key is required."""
        value = self._get(key)
        rows = value if isinstance(value, (list, tuple)) else ()
        if len(rows) == 3 and all(is_number_list(row, 3) for row in rows):
            return tuple(tuple(float(item) for item in row) for row in rows)
        self._reject(key, value, "three rows of three finite numbers")
        return ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    def table(self, key: str) -> CheckedTable:
        """Return the table under a key; empty if it is missing."""
        value = self._get(key, {})
        if not isinstance(value, Mapping):
            self._reject(key, value, "a table")
            value = {}
        return self._within(value, f"{self.place}{key}.")

    def named_tables(self, key: str) -> dict[str, CheckedTable]:
        """Return the tables in the table under a key, by their names; empty if it is missing."""
        outer = self.table(key)
        named = {name: outer.table(name) for name in outer._data}
        outer.report_unknown_keys()
        return named

    def tables(self, key: str) -> list[CheckedTable]:
        """Return the tables of a list; the key is required."""
        value = self._get(key)
        if not isinstance(value, (list, tuple)) or not all(isinstance(item, Mapping) for item in value):
            self._reject(key, value, "a list of tables")
            return []
        places = (f"{self.place}{key}[{index}]." for index in range(len(value)))
        return [self._within(item, place) for item, place in zip(value, places, strict=True)]

    def report_unknown_keys(self) -> None:
        """Add an error for each key that no getter read, with a suggestion."""
        allowed = list(dict.fromkeys(self._known))
        for number, key in enumerate(key for key in self._data if key not in self._known):
            hint = format_suggestion(key, allowed) if number < MAX_SUGGESTED_KEYS else ""
            self.add_error(key, f"unknown{hint}; allowed: {', '.join(allowed)}")

    def _within(self, data: Mapping[str, Any], place: str) -> CheckedTable:
        return CheckedTable(data, self.faults, self._file, place, key_in_about=self.key_in_about)

    def _get(self, key: str, default: Any = None) -> Any:
        self._known.append(key)
        if key in self._data:
            return self._data[key]
        return _Missing if default is None else default

    def _reject(self, key: str, value: Any, allowed: str) -> None:
        text = "nothing" if value is _Missing else format_value(value)
        self.add_error(key, f"found {text}, allowed: {allowed}")


def _to_si(value: Any, si: str) -> Any:
    """Return a text with a unit as a number in SI, and any other value unchanged."""
    number = quantity_to_si(value, WRITTEN[si]) if si and isinstance(value, str) else math.nan
    return value if math.isnan(number) else number


class _Missing:
    """Value of a required key that does not exist."""


def is_number(value: Any, infinite: bool = False) -> bool:
    """Return whether a value is a number in the range of a float."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return not math.isnan(value) if infinite else math.isfinite(value)
    except OverflowError:  # an integer beyond the range of a float
        return False


def is_number_list(value: Any, count: int, infinite: bool = False) -> bool:
    """Return whether a value is a list of `count` numbers."""
    is_list = isinstance(value, (list, tuple)) and len(value) == count
    return is_list and all(is_number(item, infinite) for item in value)


_TOKEN = re.compile(  # strings and comments, whose content is skipped, and what opens or closes a level
    r'''"""(?:\\.|[^\\])*?(?:"""|\Z)|'{3}.*?(?:'{3}|\Z)'''
    r"""|"(?:\\.|[^"\\\n])*"?|'[^'\n]*'?|\#[^\n]*|[][{}.,\n]""",
    re.DOTALL,
)


def read_toml(path: Path, error: type[UrmpipeError]) -> dict[str, Any]:
    """Return the content of a TOML file.

    Args:
        path: The file.
        error: Class of the error to raise.

    Raises:
        UrmpipeError: `error`, with the line, if it cannot be read, is not UTF-8 or TOML, or exceeds a limit
            of size or depth.
    """
    content = read_contents(path, error, (".toml",))
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        line = content.count(b"\n", 0, fault.start) + 1
        message = f"byte {fault.start} is not UTF-8; allowed: TOML in UTF-8"
        raise error(Finding(message, str(path), line=line)) from fault
    try:
        table = parse_toml_text(text)
    except TomlError as fault:
        raise error(Finding(str(fault), str(path), line=fault.line)) from fault
    if findings := [*_check_sizes(table)]:
        raise error(*add_line_numbers(path, str(path), findings))
    return table


class TomlError(ValueError):
    """A text is not TOML.

    Attributes:
        line: Line of the error, from 1.
    """

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


def parse_toml_text(text: str) -> dict[str, Any]:
    """Return the content of a text of TOML.

    Raises:
        TomlError: If it is not TOML, or nested deeper than `MAX_DEPTH`.
    """
    if (line := _find_too_deep(text)) is not None:
        raise TomlError(
            f"found tables or lists nested more than {MAX_DEPTH} deep, allowed: {MAX_DEPTH}", line
        )
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as fault:
        lines = text.replace("\r\n", "\n").split("\n")
        place = re.search(r"\(at line (\d+), column (\d+)\)", str(fault))
        line = int(place[1]) if place else text.rstrip().count("\n") + 1
        hint = _value_hint(lines[line - 1]) if place else ""
        raise TomlError(f"not valid TOML: {fault}{hint}", line) from fault
    except ValueError as fault:  # an integer of more digits than Python reads
        digits = re.search(r"\d[\d_]{4000,}", text)
        line = text.count("\n", 0, digits.start() if digits else 0) + 1
        raise TomlError(f"found an integer of too many digits, allowed: {INTEGER_RANGE}", line) from fault


def _find_too_deep(text: str) -> int | None:
    """Return the line in which brackets and dotted keys nest deeper than `MAX_DEPTH`, or None."""
    depths, dots = [0], 0
    for token in _TOKEN.finditer(text):
        match token[0]:
            case "[" | "{":
                depths.append(depths[-1] + dots + 1)
                dots = 0
            case "]" | "}":
                dots = 0
                depths = depths[:-1] or [0]
            case ".":
                dots += 1
            case "," | "\n":
                dots = 0
        if depths[-1] + dots > MAX_DEPTH:
            return text.count("\n", 0, token.start()) + 1
    return None


def _check_sizes(table: Mapping[str, Any]) -> Iterator[Finding]:
    """Yield errors of too large integers, too long keys, and more keys than `MAX_KEYS`."""
    keys, pending = 0, [("", table)]
    while pending:
        place, value = pending.pop()
        if isinstance(value, dict):
            keys += len(value)
            for key, item in value.items():
                path = f"{place}.{key}" if place else key
                if len(key) > MAX_KEY_LENGTH:
                    message = f"found a key of {len(key)} letters, allowed: {MAX_KEY_LENGTH} at most"
                    yield Finding(f"{format_value(key)}: {message}", about=place)
                else:
                    pending.append((path, item))
        elif isinstance(value, list):
            pending += [(f"{place}[{k}]", item) for k, item in enumerate(value)]
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:
            yield Finding(
                f"found an integer of {value.bit_length()} bits, allowed: {INTEGER_RANGE}", about=place
            )
    if keys > MAX_KEYS:
        yield Finding(f"found {keys} keys, allowed: {MAX_KEYS} at most")


def _value_hint(line: str) -> str:
    """Return the correction of a line with an unquoted text or a True, or an empty string."""
    bare = re.fullmatch(r"\s*([\w.-]+)\s*=\s*([^\s\"'\[{#][^\"'\[{#]*?)\s*(#.*)?", line)
    if bare is None or not re.search(r"[A-Za-z]", bare[2]):  # 1,5 or .5: invalid numbers of TOML
        return ""
    if bare[2] in {"True", "False"}:
        return f"; allowed: {bare[1]} = {bare[2].lower()}"
    return f"; a text needs quotes: {bare[1]} = {quote_toml(bare[2])}"


def format_toml(table: Mapping[str, Any]) -> list[str]:
    """Return a line `key = value` for each key whose value is not None."""
    return [f"{key} = {_toml_value(value)}" for key, value in table.items() if value is not None]


def quote_toml(text: str) -> str:
    """Return any text as a quoted key or string."""
    return escape_json(json.dumps(text, ensure_ascii=False))


def _toml_value(value: Any) -> str:
    if isinstance(value, str):
        return quote_toml(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(format_toml(value))} }}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_toml_value(item) for item in value)}]"
    return repr(value)
