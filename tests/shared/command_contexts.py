"""Every command of the command line."""

from __future__ import annotations

from collections.abc import Iterator

import click

from urmpipe.main import cli, find_commands


def contexts() -> Iterator[click.Context]:
    """The context of each command, those in groups, too, as `main` makes it."""
    top = click.Context(cli, info_name="urmpipe", **cli.context_settings)
    for name in find_commands():
        command = cli.get_command(top, name)
        assert command is not None
        context = click.Context(command, top, name)
        yield context
        if isinstance(command, click.Group):
            yield from (click.Context(one, context, sub) for sub, one in command.commands.items())


EVERY = list(contexts())
NAMES = [one.command_path for one in EVERY]
