"""The ranges that stand in remarks behind the assumed numbers of a robot's file."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

TABLE = re.compile(r"^\[+(.+?)\]+$")
LINE = re.compile(r"^(\w+) = ([^#]+?) *# *(.+)$")
RANGE = re.compile(r"(-?[\d.e]+)\.\.(-?[\d.e]+)")
NAMED = ("x", "y", "z"), ("xx", "yy", "zz")
"""Elements of a list that a remark names, of centres and of inertias."""

Place = tuple[str, str, int | None]
"""A number: its table (drives.theta1, or inertials.theta4), its key, and which element of a list it is."""


def assumed(file: Path) -> dict[Place, tuple[float, float, float]]:
    """Return value, least and largest of every number with a range behind it."""
    found: dict[Place, tuple[float, float, float]] = {}
    table = joint = ""
    for line in file.read_text(encoding="utf-8").splitlines():
        if head := TABLE.match(line):
            table, joint = head[1], ""
        elif line.startswith("joint = "):
            joint = f".{tomllib.loads(line)['joint']}"
        elif (match := LINE.match(line)) and RANGE.search(match[3]):
            key, value = match[1], tomllib.loads(f"value = {match[2]}")["value"]
            if isinstance(value, (int, float)):
                low, high = RANGE.findall(match[3])[0]
                found[table + joint, key, None] = float(value), float(low), float(high)
            elif key not in {"origin", "steps"}:
                for names in NAMED:
                    for k, name in enumerate(names):
                        if one := re.search(rf"\b{name} {RANGE.pattern}", match[3]):
                            found[table + joint, key, k] = float(value[k]), float(one[1]), float(one[2])
            else:
                step = (value["steps"] if key == "origin" else value)[0]
                low, high = RANGE.findall(match[3])[0]
                found[step["name"], "value", None] = float(step["value"]), float(low), float(high)
    return found
