"""TOML as text: files read with their errors in place, and plain values written."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from urmpipe_models.errors import Finding, UrmpipeError, shown
from urmpipe_models.files.contents import read_contents
from urmpipe_models.files.places import placed
from urmpipe_models.messages import shown_json

DEEPEST = 50
"""So many tables and lists stand in each other at most: a description of anything needs six."""

LONGEST = 1000
"""Letters of a key at most."""

MOST = 20_000
"""Keys of a file at most."""

INTEGERS = "64 bits at most"

_TOKEN = re.compile(
    r'''"""(?:\\.|[^\\])*?(?:"""|\Z)|'{3}.*?(?:'{3}|\Z)'''
    r"""|"(?:\\.|[^"\\\n])*"?|'[^'\n]*'?|\#[^\n]*|[][{}.,\n]""",
    re.DOTALL,
)
"""Texts and remarks, whose letters mean nothing, and what nests or ends what nests."""


def parse_toml(path: Path, error: type[UrmpipeError]) -> dict[str, Any]:
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
        table = toml_values(text)
    except TomlError as fault:
        raise error(Finding(str(fault), str(path), line=fault.line)) from fault
    if faults := [*_oversized(table)]:
        raise error(*placed(path, str(path), faults))
    return table


class TomlError(ValueError):
    """A text is no TOML.

    Attributes:
        line: Where, from 1.
    """

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


def toml_values(text: str) -> dict[str, Any]:
    """Return what a text of TOML holds.

    Raises:
        TomlError: If it is no TOML, or nested deeper than `DEEPEST`.
    """
    if (deep := _too_deep(text)) is not None:
        raise TomlError(f"found tables or lists nested more than {DEEPEST} deep, allowed: {DEEPEST}", deep)
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
    """Return the line in which brackets and dotted keys nest more than `DEEPEST` deep; None if none does."""
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
        if around[-1] + dots > DEEPEST:
            return text.count("\n", 0, token.start()) + 1
    return None


def _oversized(table: Mapping[str, Any]) -> Iterator[Finding]:
    """Yield the integers that TOML cannot hold and keys that are too long; more keys than `MOST` as well."""
    keys, waiting = 0, [("", table)]
    while waiting:
        place, value = waiting.pop()
        if isinstance(value, dict):
            keys += len(value)
            for key, one in value.items():
                where = f"{place}.{key}" if place else key
                if len(key) > LONGEST:
                    said = f"found a key of {len(key)} letters, allowed: {LONGEST} at most"
                    yield Finding(f"{shown(key)}: {said}", about=place)
                else:
                    waiting.append((where, one))
        elif isinstance(value, list):
            waiting += [(f"{place}[{k}]", one) for k, one in enumerate(value)]
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:
            yield Finding(f"found an integer of {value.bit_length()} bits, allowed: {INTEGERS}", about=place)
    if keys > MOST:
        yield Finding(f"found {keys} keys, allowed: {MOST} at most")


def _unquoted(written: str) -> str:
    """Return what to write for a text without quotes or a True; nothing where that is not a line's fault."""
    bare = re.fullmatch(r"\s*([\w.-]+)\s*=\s*([^\s\"'\[{#][^\"'\[{#]*?)\s*(#.*)?", written)
    if bare is None or not re.search(r"[A-Za-z]", bare[2]):  # 1,5 or .5: a number that is none in TOML
        return ""
    if bare[2] in {"True", "False"}:
        return f"; allowed: {bare[1]} = {bare[2].lower()}"
    return f"; a text needs quotes: {bare[1]} = {toml_text(bare[2])}"


def toml_lines(table: Mapping[str, Any]) -> list[str]:
    """Return a line `key = value` for each key that has a value."""
    return [f"{key} = {_toml_value(value)}" for key, value in table.items() if value is not None]


def toml_text(text: str) -> str:
    """Return any text as a quoted key or string."""
    return shown_json(json.dumps(text, ensure_ascii=False))


def _toml_value(value: Any) -> str:
    """Return a value as TOML writes it."""
    if isinstance(value, str):
        return toml_text(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(toml_lines(value))} }}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_toml_value(item) for item in value)}]"
    return repr(value)
