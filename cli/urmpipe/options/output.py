"""Options of what a command prints: --json, -q; and --debug, --version."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from urmpipe import __version__
from urmpipe.headings import HeadedOption, Heading, option
from urmpipe.options.grouped import Command, grouped, with_options
from urmpipe.options.types import FileType

if TYPE_CHECKING:
    from urmpipe_pipeline.joint_log import LogWarning
    from urmpipe_pipeline.presentation.result import Result


@dataclass(frozen=True, slots=True)
class Terminal:
    """What a command prints: one JSON object, text, or nothing but errors.

    Attributes:
        as_json: Whether the result is one JSON object on standard output.
        quiet: Whether nothing but errors, and JSON if it is asked for, is printed.
    """

    as_json: bool
    quiet: bool

    def answer(self, result: Callable[[], Any], text: Callable[[], None]) -> None:
        """Print the result of a command; a reader that leaves early changes nothing.

        Args:
            result: Makes the object for --json.
            text: Prints the result for people.
        """
        from urmpipe.error_boundary import leave_output
        from urmpipe.printing.terminal import print_json

        try:
            if self.as_json:
                print_json(result())
            elif not self.quiet:
                text()
        except BrokenPipeError:  # the reader left, as head does: the exit code is what it is all the same
            leave_output()

    def warn(self, warnings: Sequence[LogWarning], log: str = "") -> None:
        """Print warnings on standard error, behind the name of their log if given."""
        if not self.quiet:
            from urmpipe.printing.terminal import print_warnings

            print_warnings(warnings, log)

    def tell_failure(self, result: Result) -> None:
        """Print the verdict alone on standard error, of a job that fails quietly: it says why."""
        if self.quiet:
            from urmpipe.printing.results import print_verdict
            from urmpipe_pipeline.results import present

            shown = present(result)
            if shown.verdict == "fail":
                print_verdict(shown, err=True)

    def note(self, line: str) -> None:
        """Print what is no warning and yet good to know, on standard error."""
        if not self.quiet:
            from urmpipe.printing.terminal import say

            say(f"note: {line}", err=True)

    def progress(
        self, title: str, *, shown: bool = True
    ) -> AbstractContextManager[Callable[[float], None] | None]:
        """Show a bar on standard error while work goes on, on a terminal only."""
        from urmpipe.printing.terminal import progress_bar

        return progress_bar(title, quiet=self.quiet or not shown)

    def working(self, title: str) -> AbstractContextManager[None]:
        """Show on standard error for how long work of unknown length goes on, on a terminal only."""
        from urmpipe.printing.terminal import clock

        return clock(title, quiet=self.quiet)


def output_option(metavar: str, help: str) -> Callable[[Command], Command]:
    """Return the option -o, which names the file that a command writes.

    Args:
        metavar: What the file is called in the help; the shell completes the suffixes in it.
        help: The help.
    """
    suffixes = re.findall(r"\.[a-z]+", metavar)
    return option(Heading.OUTPUT, "-o", "--output", metavar=metavar, type=FileType(*suffixes), help=help)


def debug_option(command: Command) -> Command:
    """Add --debug, which the error boundary looks for."""
    return option(
        Heading.GENERAL, "--debug", is_flag=True, expose_value=False, help="Show the traceback of an error."
    )(command)


def version_option(command: Command) -> Command:
    """Add --version."""
    return click.version_option(__version__, prog_name="urmpipe", cls=HeadedOption, heading=Heading.GENERAL)(
        command
    )


def output_options(command: Command) -> Command:
    """Add --json, -q, --debug and --version; the command takes them as `terminal`."""
    return with_options(
        grouped(Terminal, "terminal")(command),
        option(
            Heading.OUTPUT,
            "--json",
            "as_json",
            is_flag=True,
            help="Print one JSON object on standard output.",
        ),
        option(
            Heading.OUTPUT,
            "-q",
            "--quiet",
            is_flag=True,
            is_eager=True,
            callback=_tell_defaults,
            help="Print errors only.",
        ),
        debug_option,
        version_option,
    )


def _tell_defaults(ctx: click.Context, param: click.Parameter, quiet: bool) -> bool:
    """Tell what urmpipe.toml says for the command, before anything in it can be found to be wrong."""
    if ctx.obj and not quiet:
        from urmpipe.printing.terminal import say

        for line in ctx.obj.lines():
            say(f"note: {line}", err=True)
        Terminal(as_json=False, quiet=quiet).warn(ctx.obj.warnings)
    return quiet
