"""What errors become at the edge of the command line: lines on standard error, or one JSON object."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise, takewhile
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import click

from urmpipe.usage import usage_finding

if TYPE_CHECKING:
    from urmpipe_models.errors import Finding

SHOWN_FINDINGS = 20
"""Errors printed line by line; the others are counted."""

OWN_ERROR = "(an error in urmpipe;"
"""How a line marks an error that nobody raised on purpose."""


def open_streams() -> None:
    """Make both outputs take whatever a name of a file holds, also where the caller has closed them."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 - to the end
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def close_streams() -> None:
    """Write what is left of both outputs; Python would tell a full disk again, and exit with its own code."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            _leave(stream)


def leave_output() -> None:
    """Let nothing more go to standard output, which took no more."""
    _leave(sys.stdout)


def _leave(stream: TextIO) -> None:
    """Let nothing more go to a stream."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def findings_of(error: BaseException) -> Sequence[Finding]:
    """Return what to tell the user about an error, whoever raised it."""
    from urmpipe_models.errors import Finding, UrmpipeError

    match error:
        case UrmpipeError():
            return error.findings
        case OSError():
            return [Finding(error.strerror or str(error), file=error.filename and str(error.filename))]
        case click.UsageError():
            return [usage_finding(error)]
        case click.ClickException():
            said = error.format_message()
        case click.Abort() | KeyboardInterrupt():
            said = "stopped; no file is left incomplete"
        case MemoryError():
            said = "out of memory"
        case ValueError() if str(error).startswith("embedded null "):  # what a path cannot hold
            said = "found a null character, allowed: none in the name of a file"
        case _:
            said = f"{type(error).__name__}: {error} {OWN_ERROR} --debug shows the traceback)"
    return [Finding(said)]


def print_findings(findings: Sequence[Finding], as_json: bool) -> None:
    """Print errors on standard error, a line each, and as one JSON object if it is asked for."""
    lines = [f"error: {finding}" for finding in findings[:SHOWN_FINDINGS]]
    if len(findings) > SHOWN_FINDINGS:
        lines.append(f"error: and {len(findings) - SHOWN_FINDINGS} more")
    with suppress(OSError):  # where standard error takes no more, the exit code tells it all the same
        click.echo("\n".join(lines), err=True)
    if as_json:
        from urmpipe.printing.terminal import echo_json

        with suppress(OSError):  # where standard output takes no more, that is told already
            echo_json({"schema": 1, "errors": [one.to_dict() for one in findings]})


def tell_junit_of(arguments: Sequence[str], findings: Sequence[Finding]) -> None:
    """Write errors to the JUnit file that `compare` was to write, whatever went wrong: also its own options.

    Args:
        arguments: The words of the command line.
        findings: What went wrong, at least one.
    """
    options = [*takewhile(lambda word: word != "--", arguments), ""]
    equal = "--junit="
    named = [after for word, after in pairwise(options) if word == "--junit"]
    named += [word.removeprefix(equal) for word in options if word.startswith(equal)]
    if (
        "compare" not in arguments[:1]
        or len(set(named)) != 1
        or not named[0]
        or arguments.count(named[0]) > 1
    ):
        return  # none, two, or one that is an operand, too
    from urmpipe_pipeline.tables.junit import write_errors

    others = [Path(word) for word in arguments if word != named[0]]
    write_errors(Path(named[0]), others, findings)
