"""Write docs/commands.md: the `--help` of every command on one page.

    python docs/write_commands.py

A test holds the page and the commands together: after a change of a command, run this again.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click

from urmpipe.main import cli, find_commands

PAGE = Path(__file__).resolve().parent / "commands.md"
WIDTH = 80

PAGES = {
    "ingest": "[logs.md](logs.md), [recording-logs.md](recording-logs.md)",
    "compare": "[compare.md](compare.md), [ci.md](ci.md)",
    "iso": "[iso.md](iso.md)",
    "diagnose": "[diagnose.md](diagnose.md)",
    "robot": "[robots.md](robots.md), [dynamics.md](dynamics.md)",
    "ik": "[ik.md](ik.md), [targets.md](targets.md)",
    "network": "[networks.md](networks.md)",
    "fmu": "[fmu.md](fmu.md), [units.md](units.md)",
    "simulate": "[simulate.md](simulate.md), [drives.md](drives.md), [dynamics.md](dynamics.md)",
}
"""Pages that explain what a command does."""

INTRODUCTION = """\
# Commands

The output of `urmpipe COMMAND --help`, written by `docs/write_commands.py`. The same in Python:
[python.md](python.md); the output of `--json`: [json.md](json.md).

| command | what it does | more |
|---|---|---|
"""

SHARED = """
**Values.** A number may have its unit behind it: `5ms`, `3.5mm`, `0.5deg`, `250mm/s`, `500mm/s2`, `5%`. Alone
it is in SI. Tolerances, limits, noise and bands are refused without a unit where another may be meant: a
length of 0.02 or more, an angle above 0.2, a share above 1. `NUMBER[s|ms|us]` names the units of an option.
The shell completes options, names, files of the right kind, columns of the log and kinds of tolerance.

**Exit codes.** 0 within tolerance (done, reached, no problems), 1 otherwise, 2 bad input or usage. An error
names what was found, what is allowed, and the next step; with `--json` it is also an object on standard
output. Closing a pipe early, as `head` does, does not change the exit code.

**Defaults.** `urmpipe.toml` sets options for all commands, or for one command in its table. The files in the
working folder and in the folders above it are merged: if several set an option, the nearest file decides.
The search ends at the folder of a repository (with `.git`), at the home folder, and below a folder of another
user. A file that others may write is a warning (`defaults-writable`).
Options on the command line override them all. A command prints the defaults that it uses, and their file.
The line of a verdict of `compare` and `diagnose` names the file that sets `tolerance`, `align`, `sync` or
`skip-bad`.
Options for a single call (`output`, `json`, `junit`, `csv`, `baseline`, `audit`, `write-map`, `explain`,
`draw`, `picture`, `list`, `write-system`, `debug`) have no default. An upper file's `tool` also applies to
the `robot` of a nearer file, unless that file sets `tool`, too.

    robot = "ur5e"
    tool = [0, 0, 0.15]

    [compare]
    tolerance = {axis = "2mm", angle = "0.5deg"}
"""


def commands() -> Iterator[tuple[str, click.Context]]:
    """Yield the words of each command and its context; groups before the commands in them."""
    for name in find_commands():
        command = cli.get_command(click.Context(cli), name)
        if command is None:
            raise KeyError(name)
        context = _context(command, f"urmpipe {name}")
        yield name, context
        if isinstance(command, click.Group):
            for sub, inner in command.commands.items():
                yield f"{name} {sub}", _context(inner, f"urmpipe {name} {sub}")


def page() -> str:
    """Return the page."""
    rows = [
        f"| [`{name}`](#urmpipe-{name}) | {short} | {PAGES.get(name, '')} |"
        for name, short in find_commands().items()
    ]
    sections = [f"\n## urmpipe {words}\n\n```text\n{_help(context)}\n```\n" for words, context in commands()]
    return INTRODUCTION + "\n".join(rows) + "\n" + SHARED + "".join(sections)


def _context(command: click.Command, path: str) -> click.Context:
    """Return a context in which the help of a command has one width on every terminal."""
    settings = {"help_option_names": ["-h", "--help"], "terminal_width": WIDTH, "max_content_width": WIDTH}
    return click.Context(command, info_name=path, **settings)  # type: ignore[arg-type]


def _help(context: click.Context) -> str:
    """Return the help of a command, without blanks at the ends of lines."""
    return "\n".join(line.rstrip() for line in context.command.get_help(context).splitlines())


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
