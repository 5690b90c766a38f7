"""Where in a TOML file a table or key stands: `blocks.load.file` in line 12."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from urmpipe_models.errors import Finding

HEADER = re.compile(r"\s*\[([^\[\]]+)\]")
KEY = re.compile(r"\s*((?:\"[^\"]*\"|'[^']*'|[\w-]+)(?:\s*\.\s*(?:\"[^\"]*\"|'[^']*'|[\w-]+))*)\s*=")


def placed(path: Path, name: str, faults: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return faults with file and line, each once.

    Args:
        path: The file.
        name: What the user called it.
        faults: Those without a file are about a table or key of this one, such as `blocks.load`.
    """
    lines: dict[str, int] = {}
    for full, number in _named_lines(path.read_text(encoding="utf-8-sig").split("\n")):
        lines.setdefault(full, number)
    return tuple(
        one if one.file else replace(one, file=name, line=_line_of(lines, one.about or ""))
        for one in dict.fromkeys(faults)
    )


def _named_lines(text: Iterable[str]) -> Iterator[tuple[str, int]]:
    """Yield the full name and the line of each table and key."""
    table = ""
    for number, line in enumerate(text, 1):
        if header := HEADER.match(line):
            table = _plain(header[1])
            yield table, number
        elif key := KEY.match(line):
            name = table
            for part in _plain(key[1]).split("."):  # a key `drive.start.C` is a table `drive`, too
                name = f"{name}.{part}" if name else part
                yield name, number


def _plain(name: str) -> str:
    """Return a name of TOML without quotes and spaces."""
    return ".".join(part.strip().strip("\"'") for part in name.split("."))


def _line_of(lines: dict[str, int], name: str) -> int | None:
    """Return the line of a table or key, of an item that of its list; else that of the table around."""
    while name not in lines and ("." in name or name.endswith("]")):
        name = name.rpartition("[" if name.endswith("]") else ".")[0]
    return lines.get(name)
