"""Commands and options of the command line, made from the declared parameters.

1. `ParamOption` and `operand`: an option or an argument that its kind reads. Faults of options are
   collected, and reported together before the command runs.
2. `HeadedCommand` lists many options under headings, and few in one list. `Group` suggests similar commands.
3. Wrong usage as findings: found, allowed, and the next step.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from urmpipe.defaults import Defaults
from urmpipe.parameters.param import Heading, Kind, Param
from urmpipe_models.errors import (
    Finding,
    OptionError,
    format_suggestion,
    format_unknown_name,
    format_value,
    to_option,
)

Function = TypeVar("Function", bound=Callable[..., Any])

MAX_FLAT_OPTIONS = 12  # in one list; more of them are listed under headings
FAULTS = "urmpipe.faults"  # key of the context under which it keeps the faults of its options


class HeadedOption(click.Option):
    """An option with its heading.

    Args:
        heading: The heading.
        declarations: The names of the option.
        settings: Other settings of `click.Option`.
    """

    def __init__(self, *declarations: Any, heading: Heading, **settings: Any) -> None:
        super().__init__(*declarations, **settings)
        self.heading = heading


class ParamOption(HeadedOption):
    """The option of a parameter."""

    def __init__(self, name: str, param: Param) -> None:
        kind, names = param.kind, sorted(param.names, key=lambda option: option.startswith("--"))
        short = [option for option in names if not option.startswith("--")]
        is_unset = param.default is None or param.default is False or param.default == ()
        default = "" if is_unset else f" [default: {param.default}]"
        value: dict[str, Any] = {"type": click.UNPROCESSED}
        value |= {"required": True} if param.required else {"default": None}
        value |= {"metavar": kind.metavar, "multiple": kind.repeats} if kind.metavar else {"is_flag": True}
        super().__init__(
            [*short, to_option(name), *names[len(short) :], name],
            heading=param.heading,
            help=f"{param.help.removesuffix('.')}{default}." if default else param.help,
            shell_complete=kind.complete,
            callback=_read_option,
            is_eager=name in ("json", "quiet", "debug"),
            **value,
        )
        self.param = param


def _read_option(ctx: click.Context, option: click.Parameter, value: Any) -> Any:
    """Return the value of an option as its kind reads it; keep its faults until the command runs."""
    assert isinstance(option, ParamOption)
    param, name = option.param, option.name or ""
    if ctx.resilient_parsing:  # a shell completes, or an error is reported
        return value
    if value is None or value == ():
        return None if param.default is None else param.kind.read(param.default)
    if option.multiple:
        value = value[0] if len(value) == 1 else list(value)
    try:
        return param.kind.read(value)
    except (ValueError, TypeError, OptionError) as error:
        for fault in param.kind.find_faults(name, value, error, typed=True):
            text = json.dumps(value) if isinstance(value, bool) else fault.found  # a bool is of urmpipe.toml
            fault_at = locate_fault(ctx, option, replace(fault, found=text))
            ctx.meta.setdefault(FAULTS, []).append(fault_at)
        return None


def operand(name: str, kind: Kind, **settings: Any) -> Callable[[Function], Function]:
    """Return a decorator that adds an argument, which its kind reads.

    Args:
        name: The argument.
        kind: Its kind; with `nargs=-1` that of each word.
        settings: Settings of `click.Argument`.
    """

    def read(ctx: click.Context, param: click.Parameter, value: Any) -> Any:
        if ctx.resilient_parsing or value is None:
            return value
        many = isinstance(value, tuple) and not kind.repeats
        try:
            return tuple(map(kind.read, value)) if many else kind.read(list(value) if kind.repeats else value)
        except (ValueError, TypeError, OptionError) as error:
            raise OptionError(
                *(
                    locate_fault(ctx, param, fault)
                    for fault in kind.find_faults(name, value, error, typed=True)
                )
            ) from None

    settings = {"shell_complete": kind.complete, "callback": read, "type": click.UNPROCESSED} | settings
    return click.argument(name, **settings)


class HeadedCommand(click.Command):
    """A command whose help lists many options under their headings, and few in one list."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command, after the defaults are reported and all options were read without a fault."""
        if isinstance(ctx.obj, Defaults):
            ctx.obj.report(quiet=ctx.params.get("quiet", False))
        if faults := ctx.meta.get(FAULTS):
            raise OptionError(*faults)
        if isinstance(ctx.obj, Defaults) and ctx.obj.warnings and ctx.params.get("strict"):
            from urmpipe.public_functions import raise_warnings

            raise_warnings(True, ctx.obj.warnings)
        return super().invoke(ctx)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, those of a heading in the order of the command."""
        records: dict[Heading, list[tuple[str, str]]] = {heading: [] for heading in Heading}
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx) if isinstance(param, click.Option) else None
            if record is not None:
                records[getattr(param, "heading", Heading.GENERAL)].append(record)
        if sum(map(len, records.values())) <= MAX_FLAT_OPTIONS:
            super().format_options(ctx, formatter)
            return
        for heading, rows in records.items():
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows)


class Group(click.Group):
    """A group of commands that suggests similar names for a wrong one."""

    command_class = HeadedCommand

    def invoke(self, ctx: click.Context) -> Any:
        """Run the named command; click reports an option without its value without a command."""
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
            UsageError: If there is none of that name, with the most similar name.
        """
        name = args[0]
        if name.startswith("-") or ctx.resilient_parsing or self.get_command(ctx, name):
            return super().resolve_command(ctx, args)
        names = self.list_commands(ctx)
        deeper = next(self._iter_subcommands(ctx, name), None)
        similar = f"found {format_value(name)} (did you mean {deeper}?), allowed: {', '.join(names)}"
        raise click.UsageError(similar if deeper else format_unknown_name(name, names), ctx)

    def _iter_subcommands(self, ctx: click.Context, name: str) -> Iterator[str]:
        """Yield the commands of that name in the groups of this group."""
        for group in self.list_commands(ctx):
            command = self.get_command(ctx, group)
            if isinstance(command, click.Group) and name in command.commands:
                yield f"{group} {name}"


def usage_finding(error: click.UsageError) -> Finding:
    """Return the fault of a line, or of the urmpipe.toml that sets its options."""
    ctx = error.ctx
    match error:
        case click.NoSuchOption():
            options = [name for param in ctx.command.params for name in param.opts] if ctx else []
            text = f"{error.option_name}: no such option{format_suggestion(error.option_name, options)}"
        case click.BadOptionUsage(option_name=name):
            needs_value = "requires" in error.message  # the message alone distinguishes the two
            fault, allowed = ("no value", _metavar(ctx, name)) if needs_value else ("a value", "alone")
            text = f"{name}: found {fault}, allowed: {name} {allowed}"
        case click.MissingParameter(param=click.Option() as param):
            name = f"--{long_name(param)}"
            text = f"found no {name}, allowed: {name} {_metavar(ctx, name)}"
        case click.MissingParameter(param=click.Parameter() as param):
            text = f"found no {param.human_readable_name}, allowed: {_usage(ctx)}"
        case click.BadParameter(param=click.Parameter() as param):
            return locate_fault(ctx, param, Finding(error.message))
        case click.UsageError() if ctx and "unexpected extra" in error.message:  # it has no separate class
            extra = error.message.partition("(")[2].rstrip(")")
            noun = "extra arguments" if "arguments" in error.message else "an extra argument"
            text = f"found {noun}, {extra}, allowed: {_usage(ctx)}{_robot_hint(ctx, extra)}"
        case _:
            text = error.format_message()
    return Finding(text if ctx is None or "allowed: " in text else f"{text}; see {ctx.command_path} --help")


def locate_fault(ctx: click.Context | None, param: click.Parameter, fault: Finding) -> Finding:
    """Return a fault of a value at its place: an option, an argument, or a key of urmpipe.toml."""
    if ctx is not None and isinstance(ctx.obj, Defaults) and is_from_file(ctx, param):
        message = ": ".join(filter(None, (f"key {long_name(param)}", fault.message)))
        return replace(fault, message=message, file=str(ctx.obj.file_of(long_name(param))), parameter=None)
    if isinstance(param, click.Option):
        return replace(fault, parameter=param.name)
    return replace(fault, message=": ".join(filter(None, (param.name, fault.message))), parameter=None)


def is_from_file(ctx: click.Context, param: click.Parameter) -> bool:
    """Return whether an urmpipe.toml sets a parameter."""
    return ctx.get_parameter_source(param.name or "") == ParameterSource.DEFAULT_MAP


def long_name(param: click.Parameter) -> str:
    """Return the long name of an option without its dashes: its key in urmpipe.toml."""
    return to_option(param.name or "").lstrip("-")


def _robot_hint(ctx: click.Context, extra: str) -> str:
    """Return the hint to --robot, if a command has this option and the first of the words is a robot."""
    from urmpipe_models.robots.catalogue import robot_names

    name = extra.partition(" ")[0]
    takes_robot = any("--robot" in param.opts for param in ctx.command.params)
    return f"; --robot {name} sets the robot" if takes_robot and name in robot_names() else ""


def _metavar(ctx: click.Context | None, name: str) -> str:
    """Return the value of an option as in the help, that of a choice without its brackets."""
    params = ctx.command.params if ctx else []
    option = next((param for param in params if name in param.opts), None)
    metavar = option.make_metavar(ctx) if ctx and option else "VALUE"
    is_choice = metavar[0] == "[" and metavar[-1] == "]" and "|" in metavar
    return metavar[1:-1] if is_choice else metavar


def _usage(ctx: click.Context | None) -> str:
    """Return the usage of a command in one line."""
    return "" if ctx is None else " ".join([ctx.command_path, *ctx.command.collect_usage_pieces(ctx)])
