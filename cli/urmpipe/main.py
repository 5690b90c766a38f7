"""The command line: a group that loads only the command it runs, and the one error boundary.

Exit codes: 0 within tolerance, 1 out of tolerance or otherwise failed its check (each command says what it
checks), 2 bad input or usage.
"""

from __future__ import annotations

import gc
import io
import os
import signal
import sys
import time
import warnings
from _thread import interrupt_main, start_new_thread
from collections.abc import Mapping, Sequence
from importlib import import_module
from itertools import takewhile
from pathlib import Path
from types import FrameType
from typing import Any

import click

import urmpipe
from urmpipe import __version__, commands
from urmpipe.command_line import Group, long_name
from urmpipe.defaults import Defaults, deciding_defaults, find_defaults, shared_files

ORDER = (  # of the data; other commands follow by their names
    "demo", "ingest", "compare", "iso", "diagnose", "report", "view", "export", "robot", "ik", "plan",
    "accuracy", "network", "fmu", "simulate",
)  # fmt: skip

GARBAGE_THRESHOLD = (
    100_000  # objects between two searches for cycles; with Python's 700 imports take 10 % longer
)


def find_commands() -> dict[str, str]:
    """Return the commands with their short help: the modules of `commands`, and the first line of each.

    `urmpipe --help` needs them without importing the modules.
    """
    modules = {path.stem: path for folder in commands.__path__ for path in Path(folder).glob("[!_]*.py")}
    order = {name: place for place, name in enumerate(ORDER)}
    names = sorted(modules, key=lambda name: (order.get(name, len(order)), name))
    return {name: _read_short_help(modules[name]) for name in names}


def _read_short_help(module: Path) -> str:
    with module.open(encoding="utf-8") as file:
        return file.readline().strip().strip('"')


def _is_command(name: str) -> bool:
    is_name = name.isidentifier() and not name.startswith("_")
    return is_name and any((Path(folder) / f"{name}.py").is_file() for folder in commands.__path__)


class LazyGroup(Group):
    """A group whose commands are modules, loaded when they are run."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands, in the order of the data."""
        return list(find_commands())

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Load one command."""
        if not _is_command(cmd_name):
            return None
        command = self._load(cmd_name)
        takes_defaults = not isinstance(command, click.Group) and not ctx.resilient_parsing
        files = find_defaults() if takes_defaults else []
        if files:
            ctx.default_map = {cmd_name: self._read_defaults(ctx, command, files)}
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the first word names; of a file, suggest the commands that take it."""
        if not ctx.resilient_parsing and (suggestion := _suggest_command(args)):
            raise click.UsageError(suggestion, ctx)
        return super().resolve_command(ctx, args)

    def _load(self, name: str) -> click.Command:
        """Import the module of a command."""
        command = getattr(import_module(f"urmpipe.commands.{name}"), name)
        if not isinstance(command, click.Command):
            raise TypeError(f"urmpipe.commands.{name} defines no command of its name")
        return command

    def _read_defaults(
        self, ctx: click.Context, command: click.Command, files: Sequence[Path]
    ) -> dict[str, Any]:
        """Return the defaults in files, the nearest first, and leave their origin in the context."""
        all_commands = {name: self._load(name) for name in find_commands()}
        by_file = deciding_defaults(command, files, all_commands)
        names = {param.name: long_name(param) for param in command.params}
        ctx.obj = Defaults(
            {
                path: {names[name]: value for name, value in values.items()}
                for path, values in by_file.items()
            },
            tuple(shared_files(by_file)),
        )
        return {name: value for values in by_file.values() for name, value in values.items()}

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands with their short help, without loading them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(find_commands().items()))


def _suggest_command(words: Sequence[str]) -> str:
    """Return the message about files in the place of a command, or an empty string."""
    files = list(takewhile(lambda word: "\0" not in word and Path(word).exists(), words))
    if not files or _is_command(files[0]):
        return ""
    from urmpipe_models.errors import format_value, shell_quote

    several = ("logs", "compare") if len(files) > 1 else ("a log", "ingest")
    kind, *names = {
        ".rrd": ("a recording", "view", "report"),
        ".toml": ("a TOML file", "simulate", "network check", "robot show"),
        ".urdf": ("a robot", "robot show"),
        ".fmu": ("an FMU", "fmu check"),
    }.get(Path(files[0]).suffix.lower(), several)
    quoted = " ".join(map(shell_quote, files if several[0] in ("logs", kind) else files[:1]))
    calls = " or ".join(f"urmpipe {name} {quoted}" for name in names)
    return f"found {format_value(files[0])}, {kind}, allowed: a command before it, such as {calls}"


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="urmpipe")
def cli() -> None:
    """Compare the motion of a robot arm with the commanded motion.

    urmpipe reads joint logs of any program as CSV. It gives a verdict, a recording (.rrd, for Rerun's
    offline viewer) and an HTML report.

    \b
    Examples:
      urmpipe demo
      urmpipe ingest log.csv --robot urm6
      urmpipe compare path.csv log.csv --robot urm6 --tolerance 0.0035
      urmpipe diagnose path.csv log.csv --robot urm6
      urmpipe report log-against-path.rrd
      urmpipe view log-against-path.rrd
      urmpipe ik path.csv --robot urm6 -o joints.csv
      urmpipe plan contour.csv --robot ur5e -o plan.csv
      urmpipe accuracy --robot irb60 --path contour.csv --limit 0.4mm
      urmpipe network check four-bar

    Exit codes: 0 within tolerance, 1 out of tolerance (ik: a target not reached, a jump, or a joint too
    fast; plan: the arm cannot follow the path; accuracy: an error above the limit; network: a loop does not
    close; fmu check: a problem), 2 bad input or usage.
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: errors become lines on standard error and the exit code 2."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        urmpipe.is_command_process = True
        gc.set_threshold(GARBAGE_THRESHOLD)
        open_streams()
        for number in (signal.SIGINT, signal.SIGTERM):  # a request to end stops as Ctrl-C does
            signal.signal(number, _stop)
        sys.unraisablehook = _stop_again
        code = run(words)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done: there is nothing left to stop
    except KeyboardInterrupt as stop:  # just before or after `run`
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        from urmpipe.answers import error_to_findings, print_errors

        print_errors(error_to_findings(stop), as_json=False)
        code = 2
    close_streams()
    gc.freeze()  # else Python looks for cycles among all modules before it exits
    sys.exit(code)


def open_streams() -> None:
    """Make both outputs accept any name of a file, even if the caller has closed them."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 - to the end
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def close_streams() -> None:
    """Write the rest of both outputs; Python would report a full disk again, and exit with its own code."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            from urmpipe.answers import discard_stream

            discard_stream(stream)


_stopped: list[int] = []  # signals that asked this process to stop


def _stop(number: int, frame: FrameType | None) -> None:
    """Stop the current work."""
    _stopped.append(number)
    raise KeyboardInterrupt


def _stop_again(dropped: sys.UnraisableHookArgs) -> None:
    """Stop where Python dropped the error: in one of its callbacks, such as of an import.

    From another thread and a little later: an interrupt before this function returns would be dropped, too.
    """
    if isinstance(dropped.exc_value, KeyboardInterrupt):
        start_new_thread(_interrupt_soon, ())
    else:
        sys.__unraisablehook__(dropped)


def _interrupt_soon() -> None:
    time.sleep(0.05)
    interrupt_main()


def run(arguments: Sequence[str]) -> int:
    """Run the command line and return the exit code."""
    if "_URMPIPE_COMPLETE" in os.environ:
        from urmpipe.bash import add_bash

        add_bash()
    options: Mapping[str, Any] = {}
    operands: Sequence[str] = ()
    try:
        options, operands = _parse_leniently(arguments)
        with warnings.catch_warnings():
            warnings.filterwarnings(
                "ignore", module=r"urmpipe\.commands"
            )  # a command prints those of results
            if not options.get("debug"):  # after all other filters: -W error still makes an error of it
                warnings.simplefilter("ignore", RuntimeWarning, append=True)
            return int(cli.main(list(arguments), prog_name="urmpipe", standalone_mode=False) or 0)
    except BrokenPipeError:  # the reader of a help text left, as head does; results are printed to the end
        from urmpipe.answers import discard_output

        discard_output()
        return 0
    except click.exceptions.NoArgsIsHelpError as error:  # a group alone, which is answered by its help
        error.show()
    except (Exception, KeyboardInterrupt) as raised:
        reason = KeyboardInterrupt() if _stopped else raised  # an import may have made another error of it
        if options.get("debug"):
            import traceback

            traceback.print_exception(raised)
        from urmpipe.answers import error_to_findings, print_errors, write_junit_errors

        findings = error_to_findings(reason)
        print_errors(findings, as_json=bool(options.get("json")))
        if not isinstance(reason, (KeyboardInterrupt, click.Abort)):  # Ctrl-C: all files stay as they were
            write_junit_errors(options, operands, findings)
    return 2  # bad input or usage, as `answers.ERROR`; `urmpipe --help` need not import that module


def _parse_leniently(arguments: Sequence[str]) -> tuple[Mapping[str, Any], Sequence[str]]:
    """Return the options of a line as texts and its other words, also of a faulty one.

    --json and --debug count, too, where no command is named, or one that does not have them: a program that
    asks for JSON gets an error as JSON.
    """
    settings: Mapping[str, Any] = {
        "resilient_parsing": True,
        "ignore_unknown_options": True,
        "allow_extra_args": True,
    }
    flags: list[click.Parameter] = [click.Option([flag], is_flag=True) for flag in ("--json", "--debug")]
    words = list(arguments)
    options = click.Command("urmpipe", params=flags).make_context("urmpipe", words.copy(), **settings).params
    command: click.Command = cli
    ctx = click.Context(cli, resilient_parsing=True, **cli.context_settings)
    while isinstance(command, click.Group) and words:
        name = words.pop(0)
        subcommand = command.get_command(ctx, name)
        if subcommand is None:
            return options, arguments
        command = subcommand
    ctx = command.make_context(command.name, words, ctx, **settings)
    operands = [
        ctx.params.get(param.name or "") for param in command.params if isinstance(param, click.Argument)
    ]
    listed = [value if isinstance(value, tuple) else (value,) for value in operands]
    return options | ctx.params, [*(str(word) for value in listed for word in value if word), *ctx.args]
