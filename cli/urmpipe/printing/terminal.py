"""What people read in a terminal: tables on standard output, warnings and progress on standard error."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from urmpipe_models.errors import escape_json, escape_line

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from urmpipe_pipeline.joint_log import LogWarning

LISTED = 30
"""Rows of a list that are printed; the others are counted (the recording and --json have them all)."""

PIPE_WIDTH = 120
"""Columns of a table that goes into a pipe, where no terminal tells."""


def print_json(value: Any) -> None:
    """Print one JSON object, NaN as null."""
    from urmpipe_pipeline.text import to_json_value

    echo_json(to_json_value(value), indent=2)


def echo_json(value: Any, indent: int | None = None) -> None:
    """Print a JSON value in the letters that it holds, or in ASCII where the output cannot take them all.

    What is no visible letter stands there as an escape of JSON, which reads back as it is.
    """
    written = escape_json(json.dumps(value, ensure_ascii=False, indent=indent))
    try:
        written.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:  # such as the bytes of a file name that are no text
        written = json.dumps(value, indent=indent)
    click.echo(written)


def say(line: str, *, err: bool = False) -> None:
    """Print one line, on standard output or standard error; what is not printable in names as escapes."""
    click.echo(escape_line(line), err=err)


def print_recording(recording: Path | None, *, replaced: bool = False) -> None:
    """Print where a recording is, and how to open it with the urmpipe that is running."""
    from urmpipe_models.errors import shell_quote

    command = "urmpipe"
    if shutil.which(command) is None:  # not on the path, as in an environment that was not activated
        installed, here = Path(sys.executable).parent / command, Path.cwd()
        command = str(installed.relative_to(here) if installed.is_relative_to(here) else installed)
    earlier = "; it replaced an earlier one" if replaced else ""
    called = shell_quote(command)
    called = f"& {called}" if sys.platform == "win32" and called != command else called  # PowerShell's call
    say(f"Recording: {recording}  (open it: {called} view {shell_quote(recording)}{earlier})")


def print_warnings(warnings: Sequence[LogWarning], log: str = "") -> None:
    """Print warnings on standard error, one unwrapped line each, behind the name of their log if given."""
    named = f"{log}: " if log else ""
    for warning in warnings[:LISTED]:
        say(f"warning: {named}{warning}", err=True)
    if len(warnings) > LISTED:
        say(f"warning: {named}and {len(warnings) - LISTED} more", err=True)


@contextmanager
def progress_bar(title: str, *, quiet: bool = False) -> Iterator[Callable[[float], None] | None]:
    """Show a bar on standard error while work goes on; on a terminal only, never in a pipe."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    name = TextColumn("{task.description}", markup=False)  # a title holds names of files
    columns = (name, BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(escape_line(title), total=1.0)
        yield lambda share: bar.update(task, completed=share)


@contextmanager
def clock(title: str, *, quiet: bool = False) -> Iterator[None]:
    """Show on standard error for how long work goes on whose end nobody knows; on a terminal only."""
    if quiet or not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    name = TextColumn("{task.description}", markup=False)  # a title holds names of files
    columns = (SpinnerColumn(), name, TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        shown.add_task(escape_line(title), total=None)
        yield


@contextmanager
def prints_apart() -> Iterator[None]:
    """Have what a user's unit prints on standard error: standard output is for results, such as JSON."""
    with redirect_stdout(sys.stderr):
        yield


def judged(verdict: str | None) -> Text:
    """Return a verdict as a word, with a colour on a terminal."""
    from rich.text import Text

    from urmpipe_pipeline.text import NOTHING

    style = {"pass": "bold green", "fail": "bold red"}
    return Text(NOTHING) if verdict is None else Text(verdict.upper(), style=style[verdict])


def judged_line(verdict: str | None, said: str) -> Text:
    """Return a verdict and what is said to it, in one line."""
    return judged(verdict).append(f"  {escape_line(said)}", style="not bold default")


def new_console() -> Console:
    """Return a console that takes text as it is: names from files may hold brackets."""
    from rich.console import Console

    class PlainConsole(Console):
        """Shows text as it is, and lets nothing in it act on the terminal."""

        def on_broken_pipe(self) -> None:
            """Leave a closed pipe to the error boundary: rich itself exits with 1, which is a verdict."""
            raise BrokenPipeError

        def render_str(self, text: str, **options: Any) -> Text:
            """Return a string or the text of a cell on one line, without what is not printable."""
            return super().render_str(escape_line(text), **options)

    width = None if sys.stdout.isatty() else PIPE_WIDTH
    return PlainConsole(width=width, markup=False, emoji=False, highlight=False)


def lines_of(lines: Iterable[str]) -> Text:
    """Return lines that a cell or a head has, each without what is not printable."""
    from rich.text import Text

    return Text("\n".join(map(escape_line, lines)))


def new_table(*columns: str, title: str) -> Table:
    """Return an empty table with these column heads."""
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for column in columns:
        table.add_column(column, overflow="fold")
    return table
