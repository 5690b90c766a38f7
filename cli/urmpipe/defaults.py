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

import os
import stat
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from urmpipe_models.errors import Finding
    from urmpipe_pipeline.joint_log import LogWarning

NAME = "urmpipe.toml"


@dataclass(frozen=True, slots=True)
class Defaults:
    """The defaults of a command.

    Attributes:
        by_file: The values that each urmpipe.toml sets, the nearest file first, by the long names of options
            without dashes.
        warnings: About files among them that other users may write.
    """

    by_file: dict[Path, dict[str, Any]]
    warnings: tuple[LogWarning, ...] = ()

    def report(self, *, quiet: bool) -> None:
        """Print the defaults of each file and the warnings about files on standard error, unless quiet."""
        if quiet:
            return
        from urmpipe.printing.terminal import print_line, print_warnings

        for path, values in self.by_file.items():
            settings = (f"{name}={_format_value(value)}" for name, value in values.items())
            print_line(f"note: defaults of {path}: {', '.join(settings)}", err=True)
        print_warnings(self.warnings)

    def origins(self, options: Collection[str]) -> Iterator[str]:
        """Yield the settings of some options by file: "sync=auto from ../urmpipe.toml"."""
        for path, values in self.by_file.items():
            settings = [f"{name}={_format_value(value)}" for name, value in values.items() if name in options]
            if settings:
                yield f"{', '.join(settings)} from {Path(relpath(path)).as_posix()}"

    def file_of(self, option: str) -> Path:
        """Return the file that sets an option."""
        return next(path for path, values in self.by_file.items() if option in values)


def _format_value(value: Any) -> str:
    """Return a default as TOML has it, without quotes; a table as KIND=VALUE,..."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        return ",".join(f"{name}={_format_value(item)}" for name, item in value.items())
    return ",".join(map(_format_value, value)) if isinstance(value, list) else str(value)


def find_defaults() -> list[Path]:
    """Return each `urmpipe.toml` in the working folder and above it, the nearest first.

    The search ends at a folder with `.git`, at the home folder, and at a folder of another user.
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
        if deciding := {name: value for name, value in values.items() if name not in decided}:
            by_file[path] = deciding
        decided |= deciding.keys()
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
    if faults := list(_faults(data, path, commands)):
        raise OptionError(*faults)
    options = _options(command)
    is_table = {key: isinstance(value, Mapping) and key in commands for key, value in data.items()}
    values = {key: value for key, value in data.items() if key in options and not is_table[key]}
    values |= data.get(command.name or "", {})
    return {
        options[key].name or key: _to_option_value(value, options[key], path.parent)
        for key, value in values.items()
    }


def _faults(data: Mapping[str, Any], path: Path, commands: Mapping[str, click.Command]) -> Iterator[Finding]:
    """Yield the faults of the keys of a file."""
    from urmpipe_models.errors import Finding, format_unknown_name

    all_options = {
        name: option for command in commands.values() for name, option in _options(command).items()
    }
    for key, value in data.items():
        table = ""
        if isinstance(value, Mapping) and key in commands:
            options, table = _options(commands[key]), f"{key}."
            faults = [_key_fault(name, options, all_options) for name in value]
        elif isinstance(value, Mapping) and key not in all_options:
            faults = [f"{key}: {format_unknown_name(key, commands)}"]
        else:
            faults = [_key_fault(key, all_options, all_options)]
        yield from (Finding(f"key {table}{fault}", str(path)) for fault in faults if fault)


def _key_fault(name: str, options: Mapping[str, Any], all_options: Mapping[str, Any]) -> str | None:
    """Return the fault of a key, or None; its value is read as that of an option."""
    from urmpipe_models.errors import format_names, format_suggestion

    allowed = [key for key, option in options.items() if not option.param.each_call]
    if name in allowed:
        return None
    if name in all_options and all_options[name].param.each_call:
        return f"{name}: found an option that cannot be a default, allowed: --{name} on the command line"
    return (
        f"{name}: unknown{format_suggestion(name, allowed)}; allowed: {format_names(name, sorted(allowed))}"
    )


def _options(command: click.Command) -> dict[str, Any]:
    """Return the options of a command by their long names without dashes."""
    return {
        name.removeprefix("--"): option
        for option in command.params
        if hasattr(option, "param")
        for name in option.opts
        if name.startswith("--")
    }


def _to_option_value(value: Any, option: Any, folder: Path) -> Any:
    """Return a value as click passes it to its option: numbers as texts, files from its folder."""
    if option.is_flag:
        return value
    if option.param.kind.is_file and isinstance(value, str) and Path(value).suffix:
        value = str(folder / value)
    value = _to_text(value)
    return [value] if option.multiple else value


def _to_text(value: Any) -> Any:
    """Return a value with its numbers as texts, which need a unit where a text does."""
    if isinstance(value, Mapping):
        return {name: _to_text(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_to_text(item) for item in value]
    return value if isinstance(value, bool) else str(value)
