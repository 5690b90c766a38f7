"""From the function of a command to what is printed and to the exit code; the only place that decides either.

1. `Call`: what a command's function gets: notes, progress, and which options are on the line.
2. `Answer`: what it returns, and `give_answer`: warnings, then one JSON object or text, with --quiet the
   verdict alone if it is fail, errors of logs that could not be judged, and the exit code.
3. `command`: a function that returns an `Answer` as a command with declared options.
4. Errors: as findings, on standard error, as JSON, and in the JUnit file that the command was to write.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO

import click
from click.core import ParameterSource

from urmpipe import __version__
from urmpipe.command_line import (
    HeadedCommand,
    HeadedOption,
    ParamOption,
    is_from_file,
    long_name,
    usage_finding,
)
from urmpipe.parameters.param import Heading, Param, params_of
from urmpipe.parameters.shared import Debugging, Printing
from urmpipe_models.errors import Finding, UrmpipeError

if TYPE_CHECKING:
    from urmpipe_pipeline.joint_log import LogWarning

PASS = 0  # within tolerance, or done
FAIL = 1  # out of tolerance, or another failed check
ERROR = 2  # bad input or usage, or a log without a verdict

MAX_ERRORS = 20  # printed line by line; the others are counted
OWN_ERROR = "(an error in urmpipe;"  # mark of an error that was not raised on purpose


class Call:
    """The call of a command.

    Args:
        ctx: Its context.
        json: Whether the answer is one JSON object on standard output.
        quiet: Whether only errors, and JSON if requested, are printed.
    """

    def __init__(self, ctx: click.Context, json: bool = False, quiet: bool = False) -> None:
        self.ctx, self.json, self.quiet = ctx, json, quiet

    def note(self, line: str) -> None:
        """Print a line that is not a warning on standard error."""
        if not self.quiet:
            from urmpipe.printing.terminal import print_line

            print_line(f"note: {line}", err=True)

    def progress(
        self, title: str, *, shown: bool = True
    ) -> AbstractContextManager[Callable[[float], None] | None]:
        """Show a bar on standard error during work, on a terminal only."""
        from urmpipe.printing.terminal import progress_bar

        return progress_bar(title, quiet=self.quiet or not shown)

    def working(self, title: str) -> AbstractContextManager[None]:
        """Show the elapsed time of work of unknown length on standard error, on a terminal only."""
        from urmpipe.printing.terminal import elapsed_time

        return elapsed_time(title, quiet=self.quiet)

    def explicit_options(self, is_counted: Callable[[str], bool]) -> list[str]:
        """Return the options on the command line, by their long names.

        Args:
            is_counted: Whether the parameter of a name counts.
        """
        return [
            max(param.opts, key=len)
            for param in self.ctx.command.params
            if isinstance(param, click.Option)
            and is_counted(param.name or "")
            and self.ctx.get_parameter_source(param.name or "") == ParameterSource.COMMANDLINE
        ]

    def without_log_options(self, operands: Sequence[Path], options: Mapping[str, Any]) -> dict[str, Any]:
        """Return options without those of logs if no operand is a log; note it if some operands are not logs.

        Args:
            operands: Recordings, logs and folders of them.
            options: The options by name.

        Raises:
            UsageError: If such an option is on the command line, and no operand is a log.
        """
        from urmpipe.parameters.comparing import LOG_PARAMETERS
        from urmpipe_pipeline.operands import is_log

        log_options = ", ".join(self.explicit_options(LOG_PARAMETERS.__contains__))
        recordings = [str(path) for path in operands if not is_log(path)]
        files = ", ".join(recordings)
        if len(recordings) < len(operands):
            if log_options and recordings:
                self.note(f"{log_options} applied to the logs only: {files} used as ingested")
            return dict(options)
        if log_options:
            fault = f"{log_options}: found with recordings only ({files})"
            allowed = "with at least one log; recordings are used as ingested"
            raise click.UsageError(f"{fault}, allowed: {allowed}")
        return {name: value for name, value in options.items() if name not in LOG_PARAMETERS}

    def deciding_defaults(self, options: Mapping[str, Any]) -> tuple[str, ...]:
        """Return the options that may change a verdict and come from a file: "sync=auto from FILE"."""
        deciding = {
            long_name(param)
            for param in self.ctx.command.params
            if isinstance(param, ParamOption)
            and param.param.decides
            and options.get(param.name or "") not in (None, False)
            and is_from_file(self.ctx, param)
        }
        return tuple(self.ctx.obj.origins(deciding)) if deciding else ()


class Answer(NamedTuple):
    """The answer of a command.

    Attributes:
        result: The result; its verdict decides the exit code.
        lines: Lines that name the files written, after the result.
        warnings: Warnings; None for those of the result and of its logs.
        errors: Why parts of it have no verdict.
        is_incomplete: Whether whole logs have none, or a run ended early: a "fail" of the others is not all.
        to_dict: Returns the JSON object; None for that of the result.
        print_text: Prints the answer; None for the presentation of the result.
        verdict: "pass" or "fail" where the result has none.
    """

    result: Any = None
    lines: Iterable[str] = ()
    warnings: Sequence[LogWarning] | None = None
    errors: Sequence[Finding] = ()
    is_incomplete: bool = False
    to_dict: Callable[[], Any] | None = None
    print_text: Callable[[], None] | None = None
    verdict: str | None = None


def exit_code(answer: Answer) -> int:
    """Return the exit code of an answer."""
    if _verdict(answer) == "fail" and not answer.is_incomplete:
        return FAIL
    return ERROR if answer.errors else PASS


def _verdict(answer: Answer) -> str | None:
    return answer.verdict or getattr(answer.result, "verdict", None)


def give_answer(call: Call, answer: Answer) -> int:
    """Print an answer, and return the exit code."""
    from urmpipe.printing.terminal import print_json, print_warnings

    result = answer.result
    for log, warnings in () if call.quiet else _iter_warnings(answer):
        print_warnings(warnings, log)
    try:
        if call.json:
            print_json(answer.to_dict() if answer.to_dict else result.to_dict())
        elif not call.quiet:
            _print_text(answer)
    except BrokenPipeError:  # the reader left, as head does: the exit code stays
        discard_output()
    if call.quiet and result is not None and _verdict(answer) == "fail":
        from urmpipe.printing.results import print_verdict
        from urmpipe_pipeline.results import present

        print_verdict(present(result), err=True)
    if answer.errors:
        print_errors(answer.errors, as_json=False)
    return exit_code(answer)


def _iter_warnings(answer: Answer) -> Iterator[tuple[str, Sequence[LogWarning]]]:
    """Yield the warnings of an answer, those of a log with its name."""
    if answer.warnings is not None:
        yield "", answer.warnings
        return
    for deviation in getattr(answer.result, "runs", ()):
        yield deviation.name, deviation.run.warnings
    yield "", getattr(answer.result, "warnings", ())


def _print_text(answer: Answer) -> None:
    from urmpipe.printing.terminal import print_line

    if answer.print_text is not None:
        answer.print_text()
    elif answer.result is not None:
        from urmpipe.printing.results import print_presentation
        from urmpipe_pipeline.results import is_result, present

        if is_result(answer.result):
            print_presentation(present(answer.result))
    for line in answer.lines:
        print_line(line)


def command(
    *groups: type, name: str = "", short_help: str = "", prints: bool = True, **params: Param
) -> Callable[[Callable[..., Answer]], HeadedCommand]:
    """Return a decorator: a function that takes a `Call` and values becomes a command with declared options.

    Args:
        groups: Typed dictionaries of parameters.
        name: The command; by default as the function.
        short_help: Its help in the list of commands; by default the first line of the function's module.
        prints: Whether it has --json and --quiet.
        params: Further parameters, before those of the groups.
    """
    declared = params | params_of(*groups, *((Printing, Debugging) if prints else (Debugging,)))

    def decorate(function: Callable[..., Answer]) -> HeadedCommand:
        @click.pass_context
        @wraps(function)
        def run(
            ctx: click.Context, /, debug: bool, json: bool = False, quiet: bool = False, **values: Any
        ) -> int:
            call = Call(ctx, json, quiet)
            return give_answer(call, function(call, **values))

        options = [ParamOption(option, param) for option, param in declared.items() if param.shell]
        operands = reversed(run.__dict__.pop("__click_params__", []))
        version = click.version_option(
            __version__, prog_name="urmpipe", cls=HeadedOption, heading=Heading.GENERAL
        )
        version(run)
        help_line = short_help or (sys.modules[function.__module__].__doc__ or "").partition("\n")[0]
        return HeadedCommand(
            name or function.__name__,
            callback=run,
            params=[*operands, *options, *run.__dict__.pop("__click_params__")],
            help=function.__doc__,
            short_help=help_line,
        )

    return decorate


def default_output(name: str) -> Path:
    """Return the recording NAME.rrd; bytes that are not text are replaced, as Rerun opens no such name."""
    return Path(click.format_filename(f"{name}.rrd"))


def discard_output() -> None:
    """Discard all further standard output, whose reader left."""
    discard_stream(sys.stdout)


def discard_stream(stream: TextIO) -> None:
    """Discard all further output of a stream."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def error_to_findings(error: BaseException) -> Sequence[Finding]:
    """Return an error as findings, whatever raised it."""
    match error:
        case UrmpipeError():
            return error.findings
        case OSError():
            return [Finding(error.strerror or str(error), file=error.filename and str(error.filename))]
        case click.UsageError():
            return [usage_finding(error)]
        case click.ClickException():
            text = error.format_message()
        case click.Abort() | KeyboardInterrupt():
            text = "stopped; no file is left incomplete"
        case MemoryError():
            text = "out of memory"
        case ValueError() if str(error).startswith("embedded null "):  # not possible in a path
            text = "found a null character, allowed: none in the name of a file"
        case _:
            text = f"{type(error).__name__}: {error} {OWN_ERROR} --debug shows the traceback)"
    return [Finding(text)]


def print_errors(findings: Sequence[Finding], as_json: bool) -> None:
    """Print errors on standard error, a line each, and as one JSON object on standard output if requested."""
    lines = [f"error: {finding}" for finding in findings[:MAX_ERRORS]]
    if len(findings) > MAX_ERRORS:
        lines.append(f"error: and {len(findings) - MAX_ERRORS} more")
    with suppress(OSError):  # if standard error is full, the exit code still reports it
        click.echo("\n".join(lines), err=True)
    if as_json:
        from urmpipe.printing.terminal import echo_json

        with suppress(OSError):  # if standard output is full, the error is already printed
            echo_json({"schema": 1, "errors": [finding.to_dict() for finding in findings]})


def write_junit_errors(
    options: Mapping[str, Any], operands: Sequence[str], findings: Sequence[Finding]
) -> None:
    """Write errors to the JUnit file that a command was to write, even if its own options are wrong.

    Args:
        options: The options as they are on the line.
        operands: The other words of the line: a file among them is not replaced.
        findings: The errors, at least one.
    """
    junit = options.get("junit")
    if not junit or junit in operands:
        return
    from urmpipe_pipeline.tables.junit import write_errors

    write_errors(Path(junit), [Path(word) for word in operands], findings)
