"""Wrong use of the command line, told as everything else that is wrong: found, allowed, and the next step."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from urmpipe.headings import HeadedCommand

if TYPE_CHECKING:
    from urmpipe_models.errors import Finding
    from urmpipe_pipeline.joint_log import LogWarning


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

    def lines(self) -> Iterator[str]:
        """Yield a line for each file: its name, and its values as TOML has them, without quotes."""
        for path, values in self.by_file.items():
            yield f"defaults of {path}: {', '.join(f'{k}={_shown(v)}' for k, v in values.items())}"

    def origins(self, options: Collection[str]) -> Iterator[str]:
        """Yield which of some options each file sets: "sync=auto from ../urmpipe.toml"."""
        for path, values in self.by_file.items():
            if own := [f"{name}={_shown(value)}" for name, value in values.items() if name in options]:
                yield f"{', '.join(own)} from {Path(relpath(path)).as_posix()}"

    def file_of(self, option: str) -> Path:
        """Return the file that sets an option."""
        return next(path for path, values in self.by_file.items() if option in values)


def _shown(value: Any) -> str:
    """Return a default as TOML would have it, without quotes."""
    if isinstance(value, bool):
        return str(value).lower()
    return ",".join(value) if isinstance(value, list) else str(value)


class Group(click.Group):
    """A group of commands that knows what a wrong name may have meant."""

    command_class = HeadedCommand

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command that is named; click tells of an option without its value by no command."""
        try:
            return super().invoke(ctx)
        except click.BadOptionUsage as error:
            command = self.get_command(ctx, ctx.invoked_subcommand or "")
            if error.ctx is None and command is not None:
                error.ctx = click.Context(command, ctx, command.name)
            raise

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the first word names.

        Raises:
            UsageError: If there is none of that name, with the name that may have been meant.
        """
        name = args[0]
        if name.startswith("-") or ctx.resilient_parsing or self.get_command(ctx, name):
            return super().resolve_command(ctx, args)
        from urmpipe_models.errors import format_unknown_name, format_value

        names = self.list_commands(ctx)
        deeper = next(self._deeper(ctx, name), None)
        meant = f"found {format_value(name)} (did you mean {deeper}?), allowed: {', '.join(names)}"
        raise click.UsageError(meant if deeper else format_unknown_name(name, names), ctx)

    def _deeper(self, ctx: click.Context, name: str) -> Iterator[str]:
        """Yield the commands of the groups in this group that have a name."""
        for own in self.list_commands(ctx):
            command = self.get_command(ctx, own)
            if isinstance(command, click.Group) and name in command.commands:
                yield f"{own} {name}"


def usage_finding(error: click.UsageError) -> Finding:
    """Return what is wrong with a line, or with the urmpipe.toml that speaks for it."""
    from urmpipe_models.errors import Finding, format_suggestion

    ctx = error.ctx
    match error:
        case click.NoSuchOption():
            options = [name for param in ctx.command.params for name in param.opts] if ctx else []
            said = f"{error.option_name}: no such option{format_suggestion(error.option_name, options)}"
        case click.BadOptionUsage(option_name=name):
            lacks = "requires" in error.message  # click tells the two apart by its words alone
            found, allowed = ("no value", _value(ctx, name)) if lacks else ("a value", "alone")
            said = f"{name}: found {found}, allowed: {name} {allowed}"
        case click.MissingParameter(param=click.Parameter() as param):
            said = f"found no {_told(param)}, allowed: {_usage(ctx)}"
        case click.BadParameter(param=click.Parameter() as param):
            return place_of(ctx, param, Finding(error.message))
        case click.UsageError() if ctx and "unexpected extra" in error.message:  # told by its words alone
            found = error.message.partition("(")[2].rstrip(")")
            robot = "; --robot sets a robot" if _takes(ctx, "--robot") else ""
            said = f"found {found} besides the rest, allowed: {_usage(ctx)}{robot}"
        case _:
            said = error.format_message()
    return Finding(said if ctx is None or "allowed: " in said else f"{said}; see {ctx.command_path} --help")


def place_of(ctx: click.Context | None, param: click.Parameter, found: Finding) -> Finding:
    """Return what is wrong with the value of a parameter: an option's, or a key's of urmpipe.toml."""
    by_file = ctx is not None and ctx.get_parameter_source(param.name or "") == ParameterSource.DEFAULT_MAP
    if ctx is not None and by_file and isinstance(ctx.obj, Defaults):
        said = ": ".join(filter(None, (f"key {_long(param)}", found.message)))
        return replace(found, message=said, file=str(ctx.obj.file_of(_long(param))), parameter=None)
    if isinstance(param, click.Option):
        return replace(found, parameter=param.name)
    return replace(found, message=": ".join(filter(None, (_told(param), found.message))), parameter=None)


def _long(param: click.Parameter) -> str:
    """Return the long name of an option without its dashes."""
    return max(param.opts, key=len).lstrip("-")


def _told(param: click.Parameter) -> str:
    """Return the name of a parameter as a person writes it."""
    return f"--{_long(param)}" if isinstance(param, click.Option) else str(param.human_readable_name)


def _value(ctx: click.Context | None, name: str) -> str:
    """Return what the help calls the value of an option."""
    params = ctx.command.params if ctx else []
    option = next((one for one in params if name in one.opts), None)
    told = option.make_metavar(ctx) if ctx and option else "VALUE"
    return told[1:-1] if told[0] == "[" and told[-1] == "]" else told  # of a choice


def _takes(ctx: click.Context, option: str) -> bool:
    """Return whether a command has an option."""
    return any(option in param.opts for param in ctx.command.params)


def _usage(ctx: click.Context | None) -> str:
    """Return the usage of a command in one line."""
    if ctx is None:
        return ""
    return " ".join([ctx.command_path, *ctx.command.collect_usage_pieces(ctx)])
