"""`urmpipe.toml`: what a lab or a repository says once for all commands.

    robot = "ur5e"          # at the top: for every command that has the option
    tool = [0, 0, 0.15]

    [compare]               # for one command
    tolerance = {axis = 0.002, angle = "0.5deg"}

A key is the name of an option without its dashes. The file is looked for in the working folder and those
above it; options on the command line come first. Files named in it are seen from its own folder.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

NAME = "urmpipe.toml"

EACH_TIME = (
    "--output", "--audit", "--write-map", "--explain", "--json", "--junit", "--csv", "--baseline", "--draw",
    "--list",
)  # fmt: skip
"""Options of what one call is to give: no file says them for all."""

FILES = ("robot", "map")
"""Options whose value may be a file."""

TABLES = ("tolerance", "noise")
"""Options whose value may be a table: what the command line has as KIND=VALUE,..."""


def find_defaults() -> Path | None:
    """Return the nearest `urmpipe.toml` in the working folder or above it."""
    folder = Path.cwd()
    return next((one / NAME for one in (folder, *folder.parents) if (one / NAME).is_file()), None)


def defaults_for(command: click.Command, path: Path, commands: Mapping[str, click.Command]) -> dict[str, Any]:
    """Return the values of a command's options, by the names of its parameters.

    Args:
        command: The command.
        path: The file.
        commands: All commands: every key must be an option of one of them.

    Raises:
        OptionError: With everything that is wrong with the file.
    """
    from difflib import get_close_matches

    from urmpipe_models.errors import Finding, OptionError
    from urmpipe_models.files.toml_text import parse_toml

    data = parse_toml(path, OptionError)
    every = sorted({name for one in commands.values() for name in _options(one)})
    faults = []
    for key, value in data.items():
        own = _options(commands[key]) if key in commands and isinstance(value, Mapping) else None
        values = {key: value} if own is None else value
        place, allowed = ("", every) if own is None else (f"{key}.", sorted(own))
        for name, inner in values.items():
            if isinstance(inner, Mapping) and name in allowed and name not in TABLES:
                faults.append(Finding(f"key {place}{name}: found a table, allowed: a value", str(path)))
            if name not in allowed:
                near = get_close_matches(name, allowed, 1)
                hint = f" (did you mean {near[0]}?)" if near else ""
                message = f"key {place}{name}: unknown{hint}; allowed: {', '.join(allowed)}"
                faults.append(Finding(message, str(path)))
    if faults:
        raise OptionError(*faults)
    own = _options(command)
    given = {
        key: value
        for key, value in data.items()
        if key in own and (key in TABLES or not isinstance(value, Mapping))
    }
    given |= data.get(command.name or "", {})
    return {own[key].name or key: _text(key, value, own[key], path.parent) for key, value in given.items()}


def _options(command: click.Command) -> dict[str, click.Option]:
    """Return the options of a command that a file may set, by their long names without dashes."""
    found = {}
    for param in command.params:
        if isinstance(param, click.Option) and param.expose_value:
            for name in (*param.opts, *param.secondary_opts):
                if name.startswith("--") and name not in EACH_TIME:
                    found[name.removeprefix("--")] = param
    return found


def _text(key: str, value: Any, option: click.Option, folder: Path) -> Any:
    """Return a value as the command line would give it."""
    if key in FILES and isinstance(value, str) and Path(value).suffix:
        return str(folder / value)
    if option.multiple:
        return [str(one) for one in value] if isinstance(value, list) else [str(value)]
    if isinstance(value, list):
        return ",".join(map(str, value))
    if isinstance(value, Mapping):
        return ",".join(f"{name}={inner}" for name, inner in value.items())
    return value if option.is_flag else str(value)
