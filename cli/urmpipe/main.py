"""The command line: a group that loads only the command it runs, and the one error boundary.

Exit codes: 0 within tolerance, 1 out of tolerance or otherwise failed its check (each command says what it
checks), 2 bad input or usage.
"""

from __future__ import annotations

import gc
import io
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from urmpipe import __version__
from urmpipe.defaults import defaults_for, find_defaults
from urmpipe.process import tune_python

if TYPE_CHECKING:
    from urmpipe_models.errors import Finding

COMMANDS = {
    "demo": "Run the whole way on bundled logs.",
    "ingest": "Turn one log into a recording.",
    "compare": "Hold logs against a reference and give a verdict.",
    "report": "Write the HTML report of recordings.",
    "view": "Open recordings in the viewer.",
    "export": "Write a recording as CSV, Parquet, MAT or TUM.",
    "robot": "List, show and export robots.",
    "ik": "Find joint values for poses of the tool.",
    "fmu": "List units, build and check FMUs.",
    "simulate": "Run a system of blocks.",
}
"""Each command and its short help: --help must not import them all (a test holds both together)."""

SHOWN_FINDINGS = 20
"""Errors printed line by line; the others are counted."""


class LazyGroup(click.Group):
    """A group whose commands are modules, loaded when they are run."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names, in the order of the way of the data."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Load one command."""
        if cmd_name not in COMMANDS:
            return None
        command = self._load(cmd_name)
        path = None if isinstance(command, click.Group) else find_defaults()
        if path is not None:
            ctx.default_map = {cmd_name: self._defaults(ctx, command, path)}
        return command

    def _load(self, name: str) -> click.Command:
        """Import the module of a command."""
        command = getattr(import_module(f"urmpipe.commands.{name}"), name)
        if not isinstance(command, click.Command):
            raise TypeError(f"urmpipe.commands.{name} defines no command of its name")
        return command

    def _defaults(self, ctx: click.Context, command: click.Command, path: Path) -> dict[str, Any]:
        """Return what urmpipe.toml says for a command, and leave what -q does not suppress in the context."""
        values = defaults_for(command, path, {name: self._load(name) for name in COMMANDS})
        if values:
            options = {param.name: max(param.opts, key=len).lstrip("-") for param in command.params}
            shown = ", ".join(f"{options[name]}={_shown(value)}" for name, value in values.items())
            ctx.obj = f"defaults of {path}: {shown}"
        return values

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands with their short help, without loading them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


def _shown(value: Any) -> str:
    """Return a default as TOML would have it, without quotes."""
    if isinstance(value, bool):
        return str(value).lower()
    return ",".join(value) if isinstance(value, list) else str(value)


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="urmpipe")
def cli() -> None:
    """Hold the motion of a robot arm against the motion that was asked for.

    Joint logs of any environment go in as CSV; a verdict, a recording (.rrd, viewed offline in Rerun)
    and an HTML report come out.

    \b
    Examples:
      urmpipe demo
      urmpipe ingest log.csv --robot urm6
      urmpipe compare path.csv log.csv --robot urm6 --tolerance 0.0035
      urmpipe report log-against-path.rrd
      urmpipe view log-against-path.rrd
      urmpipe ik path.csv --robot urm6 -o log.csv

    Exit codes: 0 within tolerance, 1 out of tolerance (ik: a target not reached, a jump, or a joint too
    fast; fmu check: a problem), 2 bad input or usage.
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: errors become lines on standard error and the exit code 2."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    tune_python()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names of files and signs that it cannot take
    code = run(given)
    gc.freeze()  # else Python looks for cycles among all modules before it exits
    sys.exit(code)


def run(arguments: Sequence[str]) -> int:
    """Run the command line and return the exit code."""
    as_json = "--json" in arguments
    try:
        return int(cli.main(list(arguments), prog_name="urmpipe", standalone_mode=False) or 0)
    except BrokenPipeError:  # the reader of our output left, as head does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (Exception, KeyboardInterrupt) as error:
        if "--debug" in arguments:
            import traceback

            traceback.print_exception(error)
        if isinstance(error, click.UsageError) and not as_json:
            error.show()
        else:
            _print_findings(_findings(error), as_json)
    return 2


def _findings(error: BaseException) -> Sequence[Finding]:
    """Return what to tell the user about an error, whoever raised it."""
    from urmpipe_models.errors import Finding, UrmpipeError

    match error:
        case UrmpipeError():
            return error.findings
        case click.ClickException():
            return [Finding(error.format_message())]
        case click.Abort() | KeyboardInterrupt():
            return [Finding("stopped before it was done; nothing was written")]
        case OSError():
            return [Finding(error.strerror or str(error), file=error.filename and str(error.filename))]
        case MemoryError():
            return [Finding("out of memory")]
    fault = f"{type(error).__name__}: {error}"
    return [Finding(f"{fault} (a fault of urmpipe itself; --debug shows where)")]


def _print_findings(findings: Sequence[Finding], as_json: bool) -> None:
    for finding in findings[:SHOWN_FINDINGS]:
        click.echo(f"error: {finding}", err=True)
    if len(findings) > SHOWN_FINDINGS:
        click.echo(f"error: and {len(findings) - SHOWN_FINDINGS} more", err=True)
    if as_json:
        from urmpipe.printing.terminal import echo_json

        errors = [
            {name: getattr(one, name) for name in ("file", "line", "row", "column", "message")}
            for one in findings
        ]
        echo_json({"schema": 1, "errors": errors})
