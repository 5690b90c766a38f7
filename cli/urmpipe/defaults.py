"""`urmpipe.toml`: what a lab or a repository says once for all commands.

    robot = "ur5e"          # at the top: for every command that has the option
    tool = [0, 0, 0.15]

    [compare]               # for one command
    tolerance = {axis = 0.002, angle = "0.5deg"}

A key is the name of an option without its dashes. The files in the working folder and in those above it
are merged: of an option that several set, the nearest file decides. The search ends at the folder of a
repository, at the home folder, and where the folders belong to another user. Options on the command line come
first. Files named in a file are seen from its own folder.
"""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from urmpipe_models.errors import Finding
    from urmpipe_pipeline.joint_log import LogWarning

NAME = "urmpipe.toml"

EACH_TIME = (
    "--output", "--audit", "--write-map", "--explain", "--json", "--junit", "--csv", "--baseline", "--draw",
    "--list",
)  # fmt: skip
"""Options of what one call is to give: no file says them for all."""

FILES = ("robot", "map", "log-map")
"""Options whose value may be a file."""

TABLES = ("tolerance", "noise")
"""Options whose value may be a table: what the command line has as KIND=VALUE,..."""


def find_defaults() -> list[Path]:
    """Return each `urmpipe.toml` in the working folder and above it, the nearest first.

    Folders above the one with `.git`, above the home folder, and those of another user have no say.
    """
    working = Path.cwd()
    try:
        home = Path.home().resolve()
    except RuntimeError:  # a user without one
        home = Path(working.anchor)
    files, owner = [], working.stat().st_uid
    for folder in (working, *working.parents):
        if folder.stat().st_uid != owner:
            break
        if (folder / NAME).is_file():
            files.append(folder / NAME)
        if folder == home or (folder / ".git").exists():
            break
    return files


def shared_files(files: Iterable[Path]) -> Iterator[LogWarning]:
    """Yield a warning for each file that users other than this one and root may write."""
    from urmpipe_pipeline.joint_log import LogWarning

    for path in files if os.name == "posix" else ():
        status = path.stat()
        group = 0 if _is_own_group(status) else stat.S_IWGRP
        whose = {group: "its group", stat.S_IWOTH: "all users"}
        writers = [who for bit, who in whose.items() if status.st_mode & bit]
        writers += [f"its owner (user {status.st_uid})"] if status.st_uid not in (0, os.getuid()) else []
        if writers:
            message = f"{' and '.join(writers)} may write it: the defaults in it may be those of others"
            yield LogWarning("defaults-writable", message, about=str(path))


def _is_own_group(status: os.stat_result) -> bool:
    """Return whether a file's group is its owner's alone: users with such a group write files as 664."""
    import grp
    import pwd

    try:
        group, owner = grp.getgrgid(status.st_gid), pwd.getpwuid(status.st_uid)
    except KeyError:  # names that this machine does not know
        return False
    return group.gr_name == owner.pw_name and not {*group.gr_mem} - {owner.pw_name}


def deciding_defaults(
    command: click.Command, files: Sequence[Path], commands: Mapping[str, click.Command]
) -> dict[Path, dict[str, Any]]:
    """Return the values of a command's options by the file that decides each, without files that decide none.

    Args:
        command: The command.
        files: The files, the nearest first.
        commands: All commands: every key must be an option of one of them.

    Raises:
        OptionError: With everything that is wrong with any of the files.
    """
    from urmpipe_models.errors import map_collecting_errors

    decided: set[str] = set()
    by_file = {}
    each = map_collecting_errors(lambda path: defaults_for(command, path, commands), files)
    for path, values in zip(files, each, strict=True):
        if own := {name: value for name, value in values.items() if name not in decided}:
            by_file[path] = own
        decided |= own.keys()
    return by_file


def defaults_for(command: click.Command, path: Path, commands: Mapping[str, click.Command]) -> dict[str, Any]:
    """Return the values of a command's options in one file, by the names of its parameters.

    Args:
        command: The command.
        path: The file.
        commands: All commands: every key must be an option of one of them.

    Raises:
        OptionError: With everything that is wrong with the file.
    """
    from urmpipe_models.errors import OptionError
    from urmpipe_models.toml_tables import read_toml

    data = read_toml(path, OptionError)
    faults = list(_faults(data, path, commands))
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


def _faults(data: Mapping[str, Any], path: Path, commands: Mapping[str, click.Command]) -> Iterator[Finding]:
    """Yield what is wrong with the keys of a file."""
    from urmpipe_models.errors import Finding, format_unknown_name

    every = {name: option for one in commands.values() for name, option in _options(one).items()}
    for key, value in data.items():
        place = ""
        if isinstance(value, Mapping) and key in commands:
            own, place = _options(commands[key]), f"{key}."
            faults = [_fault(name, inner, own) for name, inner in value.items()]
        elif isinstance(value, Mapping) and key not in every:
            faults = [f"{key}: {format_unknown_name(key, commands)}"]
        else:
            faults = [_fault(key, value, every)]
        yield from (Finding(f"key {place}{fault}", str(path)) for fault in faults if fault)


def _fault(name: str, value: Any, allowed: Mapping[str, click.Option]) -> str | None:
    """Return what is wrong with one key and its value; None if nothing is."""
    from urmpipe_models.errors import format_names, format_suggestion

    if f"--{name}" in EACH_TIME:
        return f"{name}: found an option of a single call, allowed: --{name} on the command line"
    if name not in allowed:
        hint = format_suggestion(name, allowed)
        return f"{name}: unknown{hint}; allowed: {format_names(name, sorted(allowed))}"
    if isinstance(value, Mapping) and name not in TABLES:
        return f"{name}: found a table, allowed: a value"
    if allowed[name].is_flag != isinstance(value, bool):
        kinds = "true or false" if allowed[name].is_flag else "a text, a number, or a list of them"
        return f"{name}: found {json.dumps(value, default=str)}, allowed: {kinds}"
    return None


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
    if isinstance(value, Mapping):
        value = ",".join(f"{name}={inner}" for name, inner in value.items())
    if option.multiple:
        return [str(one) for one in value] if isinstance(value, list) else [str(value)]
    if isinstance(value, list):
        return ",".join(map(str, value))
    return value if option.is_flag else str(value)
