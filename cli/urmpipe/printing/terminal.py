"""Text in a terminal: results on standard output, warnings and progress on standard error."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from urmpipe_models.errors import escape_json, escape_line, shell_quote

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, ProgressColumn
    from rich.table import Table
    from rich.text import Text

    from urmpipe_pipeline.joint_log import LogWarning

LISTED = 30  # rows of a list that are printed; the others are counted (the recording and --json have all)
PIPE_WIDTH = 120  # characters of a line in a pipe, which has no width


def print_json(value: Any) -> None:
    """Print one JSON object, NaN as null."""
    from urmpipe_pipeline.text import to_json_value

    echo_json(to_json_value(value), indent=2)


def echo_json(value: Any, indent: int | None = None) -> None:
    """Print a JSON value with its letters, or in ASCII if the output cannot encode them.

    Invisible characters become escapes of JSON, which read back the same.
    """
    text = escape_json(json.dumps(value, ensure_ascii=False, indent=indent))
    try:
        text.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:  # such as the bytes of a file name that are no text
        text = json.dumps(value, indent=indent)
    click.echo(text)


def print_line(line: str, *, err: bool = False) -> None:
    """Print one line, on standard output or standard error, with unprintable characters as escapes."""
    click.echo(escape_line(line), err=err)


def recording_line(recording: Path | None, is_replaced: bool = False) -> str:
    """Return the path of a recording and the command that opens it with the running urmpipe."""
    program = "urmpipe"
    if shutil.which(program) is None:  # not on the path, as in an environment that was not activated
        installed, folder = Path(sys.executable).parent / program, Path.cwd()
        program = str(installed.relative_to(folder) if installed.is_relative_to(folder) else installed)
    command = shell_quote(program)
    if sys.platform == "win32" and command != program:
        command = f"& {command}"  # PowerShell's call of a quoted name
    earlier = "; it replaced an earlier one" if is_replaced else ""
    return f"Recording: {recording}  (open it: {command} view {shell_quote(recording)}{earlier})"


def print_warnings(warnings: Sequence[LogWarning], log: str = "") -> None:
    """Print warnings on standard error, one unwrapped line each, with the name of their log if given."""
    prefix = f"warning: {log}: " if log else "warning: "
    for warning in warnings[:LISTED]:
        print_line(f"{prefix}{warning}", err=True)
    if len(warnings) > LISTED:
        print_line(f"{prefix}and {len(warnings) - LISTED} more", err=True)


@contextmanager
def progress_bar(title: str, *, quiet: bool = False) -> Iterator[Callable[[float], None] | None]:
    """Show a bar on standard error during work; yield None and show nothing if it is not a terminal."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn

    name = TextColumn("{task.description}", markup=False)  # a title contains names of files
    with _new_progress(name, BarColumn(), TaskProgressColumn(), TimeRemainingColumn()) as progress:
        task = progress.add_task(escape_line(title), total=1.0)
        yield lambda share: progress.update(task, completed=share)


@contextmanager
def elapsed_time(title: str, *, quiet: bool = False) -> Iterator[None]:
    """Show the elapsed time on standard error during work of unknown length, if it is a terminal."""
    if quiet or not sys.stderr.isatty():
        yield
        return
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    name = TextColumn("{task.description}", markup=False)  # a title contains names of files
    with _new_progress(SpinnerColumn(), name, TimeElapsedColumn()) as progress:
        progress.add_task(escape_line(title), total=None)
        yield


def _new_progress(*columns: ProgressColumn) -> Progress:
    from rich.console import Console
    from rich.progress import Progress

    return Progress(*columns, console=Console(stderr=True), transient=True)


@contextmanager
def redirect_prints() -> Iterator[None]:
    """Redirect what a user's unit prints to standard error: standard output is for results, such as JSON."""
    with redirect_stdout(sys.stderr):
        yield


def format_verdict(verdict: str | None, headline: str = "") -> Text:
    """Return a verdict as a word, with a colour on a terminal, and its headline if given."""
    from rich.text import Text

    from urmpipe_pipeline.text import NOTHING

    styles = {"pass": "bold green", "fail": "bold red"}
    word = Text(NOTHING) if verdict is None else Text(verdict.upper(), style=styles[verdict])
    return word.append(f"  {escape_line(headline)}", style="not bold default") if headline else word


def new_console() -> Console:
    """Return a console without markup: names from files may contain brackets."""
    from rich.console import Console

    class PlainConsole(Console):
        """A console in which no text acts on the terminal."""

        def on_broken_pipe(self) -> None:
            """Raise a closed pipe to the error boundary: rich itself exits with 1, which is a verdict."""
            raise BrokenPipeError

        def render_str(self, text: str, **options: Any) -> Text:
            """Return a string or the text of a cell on one line, with unprintable characters as escapes."""
            return super().render_str(escape_line(text), **options)

    width = None if sys.stdout.isatty() else PIPE_WIDTH
    return PlainConsole(width=width, markup=False, emoji=False, highlight=False)


def join_lines(lines: Iterable[str]) -> Text:
    """Return the lines of a cell or head as one text, with unprintable characters as escapes."""
    from rich.text import Text

    return Text("\n".join(map(escape_line, lines)))


def new_table(*columns: str, title: str) -> Table:
    """Return an empty table with the given column heads."""
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for column in columns:
        table.add_column(column, overflow="fold")
    return table
