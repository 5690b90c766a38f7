"""TOML as text: files read with their errors in place, and plain values written."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from urmpipe_models.errors import Finding, UrmpipeError
from urmpipe_models.files.missing import meant_by


def parse_toml(path: Path, error: type[UrmpipeError]) -> dict[str, Any]:
    """Return what a TOML file holds.

    Args:
        path: The file.
        error: What to raise.

    Raises:
        UrmpipeError: `error`, if it cannot be read, is no UTF-8 or no TOML, with the line.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as fault:
        raise error(Finding(f"byte {fault.start} is no UTF-8; allowed: TOML in UTF-8", str(path))) from fault
    except OSError as fault:
        meant = meant_by(path, (".toml",)) if isinstance(fault, FileNotFoundError) else ""
        raise error(Finding(f"cannot be read: {fault.strerror}{meant}", str(path))) from fault
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as fault:
        place = re.search(r"\(at line (\d+), column (\d+)\)", str(fault))
        line = int(place[1]) if place else None
        hint = _unquoted(text.split("\n")[line - 1]) if line else ""
        raise error(Finding(f"not valid TOML: {fault}{hint}", str(path), line=line)) from fault
    except ValueError as fault:  # an integer of more digits than Python reads
        raise error(Finding(f"not valid TOML: {fault}", str(path))) from fault


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
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


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
