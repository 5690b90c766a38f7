"""Checked reading of a table of keys and values, such as TOML or JSON gives: all faults at once.

TOML as text: files read with their errors in place, and plain values written.
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

MAX_SUGGESTED_KEYS = 100
"""So many unknown keys of a table ask whether another may be meant."""


class CheckedTable:
    """One table, read key by key.

    A getter returns what the key holds. Where that is missing or not allowed, the fault is noted and
    a stand-in comes back, so that reading goes on and every fault is found. Then `report_unknown_keys`
    reports the keys that no getter asked for.

    Attributes:
        faults: What was found to be wrong, shared with all tables within.
        place: Where the table stands, such as `joints[2].` (empty for the outermost one).
        key_in_about: Whether a fault has its key in `about`, where `add_line_numbers` finds it, instead of in
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
        """Note that something is wrong with a key."""
        where = f"{self.place}{key}"
        if self.key_in_about:
            self.faults.append(Finding(message, self._file, about=where))
        else:
            self.faults.append(Finding(f"key {where}: {message}", self._file))

    def has(self, key: str) -> bool:
        """Tell whether the key is there and not null."""
        self._known.append(key)
        return self._data.get(key) is not None

    def value(self, key: str) -> Any:
        """Return whatever the key holds, None where it is missing: the caller checks it."""
        return self._data[key] if self.has(key) else None

    def text(self, key: str, default: str | None = None) -> str:
        """Return a string; without a default the key is required."""
        value = self._get(key, default)
        if isinstance(value, str):
            return value
        self._refuse(key, value, "a text")
        return ""

    def choice(self, key: str, allowed: Sequence[str], default: str | None = None) -> str:
        """Return one of the allowed strings; without a default the key is required."""
        value = self._get(key, default)
        if value in allowed:
            return str(value)
        self._refuse(key, value, _one_of(allowed) + format_suggestion(str(value), allowed))
        return allowed[0]

    def number(
        self, key: str, default: float | None = None, *, infinite: bool = False, si: str = ""
    ) -> float:
        """Return a number; without a default the key is required; infinities only where `infinite`.

        A text with a unit is one, too, where `si` says what is measured.
        """
        if default is not None and not self.has(key):
            return default
        allowed = NAMES.get(si, "a number" if infinite else "a finite number")
        given = self._get(key)
        value = _in_si(given, si)
        if is_number(value, infinite):
            return float(value)
        self._refuse(key, given, allowed)
        return default if default is not None else 0.0

    def numbers(
        self, key: str, count: int | None, default: Sequence[float] | None = None, si: Sequence[str] = ()
    ) -> tuple[float, ...]:
        """Return finite numbers, `count` of them (or any); without a default the key is required.

        Texts with units are such, too, where `si` says what each measures.
        """
        allowed = "a list of finite numbers" if count is None else f"{count} finite numbers"
        value = self._get(key, default)
        if isinstance(value, (list, tuple)) and count in {None, len(value)}:
            value = [_in_si(item, unit) for item, unit in zip_longest(value, si[: len(value)], fillvalue="")]
            if all(is_number(item) for item in value):
                return tuple(float(item) for item in value)
            for index, item in enumerate(value):
                if not is_number(item):
                    self._refuse(f"{key}[{index}]", item, "a finite number")
        else:
            self._refuse(key, value, allowed)
        return (0.0,) * (count or 0)

    def flag(self, key: str) -> bool:
        """Return true or false; false where the key is missing."""
        value = self._get(key, default=False)
        if not isinstance(value, bool):
            self._refuse(key, value, "true or false")
        return value is True

    def texts(self, key: str) -> tuple[str, ...]:
        """Return a list of strings; the key is required."""
        value = self._get(key)
        if isinstance(value, (list, tuple)) and all(isinstance(item, str) for item in value):
            return tuple(value)
        self._refuse(key, value, "a list of texts")
        return ()

    def mapping(self, key: str) -> dict[str, str]:
        """Return a table of strings under any keys, an empty one where it is missing."""
        value = self._get(key, {})
        if isinstance(value, Mapping) and all(isinstance(item, str) for item in value.values()):
            return dict(value)
        self._refuse(key, value, "a table of texts")
        return {}

    def spread(self, key: str, count: int, default: float) -> tuple[float, ...]:
        """Return `count` numbers, infinities included; one number in the file stands for all of them."""
        value = self._get(key, default)
        if is_number(value, infinite=True):
            return (float(value),) * count
        if is_number_list(value, count, infinite=True):
            return tuple(float(item) for item in value)
        self._refuse(key, value, f"a number, or {count} numbers, one per joint")
        return (default,) * count

    def rows(self, key: str) -> Rows3:
        """Return the three rows of a 3x3 matrix; the key is required."""
        value = self._get(key)
        rows = value if isinstance(value, (list, tuple)) else ()
        if len(rows) == 3 and all(is_number_list(row, 3) for row in rows):
            return tuple(tuple(float(item) for item in row) for row in rows)
        self._refuse(key, value, "three rows of three finite numbers")
        return ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    def table(self, key: str) -> CheckedTable:
        """Return the table under a key, an empty one where it is missing."""
        value = self._get(key, {})
        if not isinstance(value, Mapping):
            self._refuse(key, value, "a table")
            value = {}
        return self._within(value, f"{self.place}{key}.")

    def named_tables(self, key: str) -> dict[str, CheckedTable]:
        """Return the tables in the table under a key, by their names; none where it is missing."""
        outer = self.table(key)
        named = {name: outer.table(name) for name in outer._data}
        outer.report_unknown_keys()
        return named

    def tables(self, key: str) -> list[CheckedTable]:
        """Return the tables of a list; the key is required."""
        value = self._get(key)
        if not isinstance(value, (list, tuple)) or not all(isinstance(item, Mapping) for item in value):
            self._refuse(key, value, "a list of tables")
            return []
        places = (f"{self.place}{key}[{index}]." for index in range(len(value)))
        return [self._within(item, place) for item, place in zip(value, places, strict=True)]

    def report_unknown_keys(self) -> None:
        """Note every key that was not asked for, with the nearest one that was."""
        allowed = list(dict.fromkeys(self._known))
        for number, key in enumerate(key for key in self._data if key not in self._known):
            hint = format_suggestion(key, allowed) if number < MAX_SUGGESTED_KEYS else ""
            self.add_error(key, f"unknown{hint}; allowed: {', '.join(allowed)}")

    def _within(self, data: Mapping[str, Any], place: str) -> CheckedTable:
        """Return a table within this one, whose faults are noted in the same way."""
        return CheckedTable(data, self.faults, self._file, place, key_in_about=self.key_in_about)

    def _get(self, key: str, default: Any = None) -> Any:
        """Return what a key holds, its default, or that it is missing."""
        self._known.append(key)
        if key in self._data:
            return self._data[key]
        return _Missing if default is None else default

    def _refuse(self, key: str, value: Any, allowed: str) -> None:
        """Note that the value of a key is not allowed."""
        found = "nothing" if value is _Missing else format_value(value)
        self.add_error(key, f"found {found}, allowed: {allowed}")


def _in_si(value: Any, si: str) -> Any:
    """Return a text with a unit as a number in SI, where that is a quantity; else the value as it is."""
    number = quantity_to_si(value, WRITTEN[si]) if si and isinstance(value, str) else math.nan
    return value if math.isnan(number) else number


class _Missing:
    """Stands for a required key that is not there."""


def is_number(value: Any, infinite: bool = False) -> bool:
    """Tell whether a value is a number that a float holds."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return not math.isnan(value) if infinite else math.isfinite(value)
    except OverflowError:  # an integer beyond what a float holds
        return False


def is_number_list(value: Any, count: int, infinite: bool = False) -> bool:
    """Tell whether a value is a list of so many numbers."""
    given = isinstance(value, (list, tuple)) and len(value) == count
    return given and all(is_number(item, infinite) for item in value)


def _one_of(allowed: Sequence[str]) -> str:
    """Say that one of some texts is allowed."""
    return f"one of {', '.join(allowed)}"


MAX_DEPTH = 50
"""So many tables and lists stand in each other at most: a description of anything needs six."""

MAX_KEY_LENGTH = 1000
"""Letters of a key at most."""

MAX_KEYS = 20_000
"""Keys of a file at most."""

INTEGERS = "64 bits at most"

_TOKEN = re.compile(
    r'''"""(?:\\.|[^\\])*?(?:"""|\Z)|'{3}.*?(?:'{3}|\Z)'''
    r"""|"(?:\\.|[^"\\\n])*"?|'[^'\n]*'?|\#[^\n]*|[][{}.,\n]""",
    re.DOTALL,
)
"""Texts and remarks, whose letters mean nothing, and what nests or ends what nests."""


def read_toml(path: Path, error: type[UrmpipeError]) -> dict[str, Any]:
    """Return what a TOML file holds.

    Args:
        path: The file.
        error: What to raise.

    Raises:
        UrmpipeError: `error`, if it cannot be read, is no UTF-8 or no TOML, or is larger or nested deeper
            than what people write, with the line.
    """
    content = read_contents(path, error, (".toml",))
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        line, said = content.count(b"\n", 0, fault.start) + 1, f"byte {fault.start} is not UTF-8"
        raise error(Finding(f"{said}; allowed: TOML in UTF-8", str(path), line=line)) from fault
    try:
        table = parse_toml_text(text)
    except TomlError as fault:
        raise error(Finding(str(fault), str(path), line=fault.line)) from fault
    if faults := [*_oversized(table)]:
        raise error(*add_line_numbers(path, str(path), faults))
    return table


class TomlError(ValueError):
    """A text is no TOML.

    Attributes:
        line: Where, from 1.
    """

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


def parse_toml_text(text: str) -> dict[str, Any]:
    """Return what a text of TOML holds.

    Raises:
        TomlError: If it is no TOML, or nested deeper than `MAX_DEPTH`.
    """
    if (deep := _too_deep(text)) is not None:
        raise TomlError(
            f"found tables or lists nested more than {MAX_DEPTH} deep, allowed: {MAX_DEPTH}", deep
        )
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as fault:
        lines = text.replace("\r\n", "\n").split("\n")
        place = re.search(r"\(at line (\d+), column (\d+)\)", str(fault))
        line = int(place[1]) if place else text.rstrip().count("\n") + 1
        hint = _unquoted(lines[line - 1]) if place else ""
        raise TomlError(f"not valid TOML: {fault}{hint}", line) from fault
    except ValueError as fault:  # an integer of more digits than Python reads
        digits = re.search(r"\d[\d_]{4000,}", text)
        line = text.count("\n", 0, digits.start() if digits else 0) + 1
        raise TomlError(f"found an integer of too many digits, allowed: {INTEGERS}", line) from fault


def _too_deep(text: str) -> int | None:
    """Return the line in which brackets and dotted keys nest deeper than `MAX_DEPTH`, or None."""
    around, dots = [0], 0
    for token in _TOKEN.finditer(text):
        match token[0]:
            case "[" | "{":
                around.append(around[-1] + dots + 1)
                dots = 0
            case "]" | "}":
                dots = 0
                around = around[:-1] or [0]
            case ".":
                dots += 1
            case "," | "\n":
                dots = 0
        if around[-1] + dots > MAX_DEPTH:
            return text.count("\n", 0, token.start()) + 1
    return None


def _oversized(table: Mapping[str, Any]) -> Iterator[Finding]:
    """Yield errors of too large integers, too long keys, and more keys than `MAX_KEYS`."""
    keys, waiting = 0, [("", table)]
    while waiting:
        place, value = waiting.pop()
        if isinstance(value, dict):
            keys += len(value)
            for key, one in value.items():
                where = f"{place}.{key}" if place else key
                if len(key) > MAX_KEY_LENGTH:
                    said = f"found a key of {len(key)} letters, allowed: {MAX_KEY_LENGTH} at most"
                    yield Finding(f"{format_value(key)}: {said}", about=place)
                else:
                    waiting.append((where, one))
        elif isinstance(value, list):
            waiting += [(f"{place}[{k}]", one) for k, one in enumerate(value)]
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:
            yield Finding(f"found an integer of {value.bit_length()} bits, allowed: {INTEGERS}", about=place)
    if keys > MAX_KEYS:
        yield Finding(f"found {keys} keys, allowed: {MAX_KEYS} at most")


def _unquoted(written: str) -> str:
    """Return what to write for a text without quotes or a True; nothing where that is not a line's fault."""
    bare = re.fullmatch(r"\s*([\w.-]+)\s*=\s*([^\s\"'\[{#][^\"'\[{#]*?)\s*(#.*)?", written)
    if bare is None or not re.search(r"[A-Za-z]", bare[2]):  # 1,5 or .5: a number that is none in TOML
        return ""
    if bare[2] in {"True", "False"}:
        return f"; allowed: {bare[1]} = {bare[2].lower()}"
    return f"; a text needs quotes: {bare[1]} = {quote_toml(bare[2])}"


def format_toml(table: Mapping[str, Any]) -> list[str]:
    """Return a line `key = value` for each key that has a value."""
    return [f"{key} = {_toml_value(value)}" for key, value in table.items() if value is not None]


def quote_toml(text: str) -> str:
    """Return any text as a quoted key or string."""
    return escape_json(json.dumps(text, ensure_ascii=False))


def _toml_value(value: Any) -> str:
    """Return a value as TOML writes it."""
    if isinstance(value, str):
        return quote_toml(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(format_toml(value))} }}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_toml_value(item) for item in value)}]"
    return repr(value)
