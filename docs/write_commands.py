"""Write docs/commands.md: what `--help` of every command says, on one page.

    python docs/write_commands.py

A test holds the page and the commands together: after a change of a command, run this again.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click

from urmpipe.main import COMMANDS, cli

PAGE = Path(__file__).resolve().parent / "commands.md"
WIDTH = 100

PAGES = {
    "ingest": "[logs.md](logs.md), [recording-logs.md](recording-logs.md)",
    "compare": "[compare.md](compare.md), [iso.md](iso.md), [ci.md](ci.md)",
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

What `urmpipe COMMAND --help` says, written by `docs/write_commands.py`. The same in Python:
[python.md](python.md); what `--json` prints: [json.md](json.md).

| command | what it does | more |
|---|---|---|
"""

SHARED = """
**Values.** A time is in s or has its unit (`5ms`), lengths of `--tool`, `--base` and `--tolerance` are in m
or have theirs (`3.5mm`), angles are in rad or have theirs (`0.5deg`). Names of robots, units and systems
complete in the shell.

**Exit codes.** 0 within tolerance (done, reached, nothing found), 1 not so, 2 bad input or usage. An error
says what was found, what is allowed, and the next step; with `--json` it is an object on standard output,
too. A reader that leaves a pipe early, as `head` does, does not change the exit code.

**Defaults.** `urmpipe.toml`, in the working folder or above it, says options once for all commands, or for
one in its table. Each command names what it took from there; options on the command line come first. What
one call is to give (`output`, `json`, `junit`, `csv`, `baseline`, `audit`, `write-map`, `explain`, `draw`,
`list`) has no default.

    robot = "ur5e"
    tool = [0, 0, 0.15]

    [compare]
    tolerance = {axis = "2mm", angle = "0.5deg"}
"""


def commands() -> Iterator[tuple[str, click.Context]]:
    """Yield the words of each command and its context; groups before the commands in them."""
    for name in COMMANDS:
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
        for name, short in COMMANDS.items()
    ]
    sections = [f"\n## urmpipe {words}\n\n```text\n{_help(context)}\n```\n" for words, context in commands()]
    return INTRODUCTION + "\n".join(rows) + "\n" + SHARED + "".join(sections)


def _context(command: click.Command, path: str) -> click.Context:
    """Return a context in which the help of a command is as wide on every terminal."""
    settings = {"help_option_names": ["-h", "--help"], "terminal_width": WIDTH, "max_content_width": WIDTH}
    return click.Context(command, info_name=path, **settings)  # type: ignore[arg-type]


def _help(context: click.Context) -> str:
    """Return the help of a command, without blanks at the ends of lines."""
    return "\n".join(line.rstrip() for line in context.command.get_help(context).splitlines())


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
