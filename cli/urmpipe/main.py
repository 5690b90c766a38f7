"""The command line: a group that loads only the command it runs, and the one error boundary.

Exit codes: 0 within tolerance, 1 out of tolerance or otherwise failed its check (each command says what it
checks), 2 bad input or usage.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import time
import warnings
from _thread import interrupt_main, start_new_thread
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any

import click

from urmpipe import __version__
from urmpipe.defaults import deciding_defaults, find_defaults, shared_files
from urmpipe.error_boundary import (
    close_streams,
    findings_of,
    leave_output,
    open_streams,
    print_findings,
    tell_junit_of,
)
from urmpipe.usage import Defaults, Group

COMMANDS = {
    "demo": "Run the whole workflow on example logs.",
    "ingest": "Turn one log into a recording.",
    "compare": "Compare logs with a reference and give a verdict.",
    "diagnose": "Find out why a log deviates from its reference.",
    "report": "Write the HTML report of recordings.",
    "view": "Open recordings in the viewer.",
    "export": "Write a recording as CSV, Parquet, MAT or TUM.",
    "robot": "List, show and export robots.",
    "ik": "Find joint values for poses of the tool.",
    "plan": "Plan a path of lines and arcs, and its timing.",
    "accuracy": "Measure the path error of an arm with drives.",
    "network": "Assemble kinematic networks and compute their mobility.",
    "fmu": "List units, build and check FMUs.",
    "simulate": "Run a system of blocks.",
}
"""Each command and its short help: --help must not import them all (a test holds both together)."""

COLLECT_AT = 100_000
"""Objects made before Python looks for cycles among them. Python's own 700 cost a command, which first of
all imports thousands of them, a tenth of a second."""


class LazyGroup(Group):
    """A group whose commands are modules, loaded when they are run."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names, in the order of the way of the data."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Load one command."""
        if cmd_name not in COMMANDS:
            return None
        command = self._load(cmd_name)
        asked = not isinstance(command, click.Group) and not ctx.resilient_parsing  # a shell that completes
        files = find_defaults() if asked else []
        if files:
            ctx.default_map = {cmd_name: self._defaults(ctx, command, files)}
        return command

    def _load(self, name: str) -> click.Command:
        """Import the module of a command."""
        command = getattr(import_module(f"urmpipe.commands.{name}"), name)
        if not isinstance(command, click.Command):
            raise TypeError(f"urmpipe.commands.{name} defines no command of its name")
        return command

    def _defaults(self, ctx: click.Context, command: click.Command, files: Sequence[Path]) -> dict[str, Any]:
        """Return the defaults in files, the nearest first, and leave their origin in the context."""
        by_file = deciding_defaults(command, files, {name: self._load(name) for name in COMMANDS})
        options = {param.name: max(param.opts, key=len).lstrip("-") for param in command.params}
        ctx.obj = Defaults(
            {path: {options[name]: value for name, value in own.items()} for path, own in by_file.items()},
            tuple(shared_files(by_file)),
        )
        return {name: value for own in by_file.values() for name, value in own.items()}

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands with their short help, without loading them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


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
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        gc.set_threshold(COLLECT_AT)
        open_streams()
        for number in (signal.SIGINT, signal.SIGTERM):  # what ends us asks for order, as Ctrl-C does
            signal.signal(number, _stop)
        sys.unraisablehook = _stop_again
        code = run(given)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done: there is nothing left to stop
    except KeyboardInterrupt as stop:  # just before or after what `run` answers for
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        print_findings(findings_of(stop), "--json" in given)
        code = 2
    close_streams()
    gc.freeze()  # else Python looks for cycles among all modules before it exits
    sys.exit(code)


_stopped: list[int] = []
"""The signals that asked this process to stop."""


def _stop(number: int, frame: FrameType | None) -> None:
    """Stop what is done now."""
    _stopped.append(number)
    raise KeyboardInterrupt


def _stop_again(dropped: sys.UnraisableHookArgs) -> None:
    """Stop after all, where Python dropped the error: in a callback of its own, such as of an import.

    From another thread and a little later: an interrupt that came before this function returns would be
    dropped like the first.
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
    as_json = "--json" in arguments
    if "_URMPIPE_COMPLETE" in os.environ:
        from urmpipe.options.bash import add_bash

        add_bash()
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings(
                "ignore", module=r"urmpipe\.commands"
            )  # a command prints those of results
            if "--debug" not in arguments:  # behind all other filters: -W error still makes an error of it
                warnings.simplefilter("ignore", RuntimeWarning, append=True)
            return int(cli.main(list(arguments), prog_name="urmpipe", standalone_mode=False) or 0)
    except BrokenPipeError:  # the reader of a help text left, as head does; results are told to the end
        leave_output()
        return 0
    except click.exceptions.NoArgsIsHelpError as error:  # a group alone, which is answered by its help
        error.show()
    except (Exception, KeyboardInterrupt) as raised:
        why = KeyboardInterrupt() if _stopped else raised  # an import may have made another error of it
        if "--debug" in arguments:
            import traceback

            traceback.print_exception(raised)
        findings = findings_of(why)
        print_findings(findings, as_json)
        if not isinstance(why, (KeyboardInterrupt, click.Abort)):  # Ctrl-C: all files stay as they were
            tell_junit_of(arguments, findings)
    return 2
