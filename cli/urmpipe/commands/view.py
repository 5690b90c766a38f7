"""`urmpipe view`."""

from __future__ import annotations

from pathlib import Path

import click

import urmpipe
from urmpipe.options.output import debug_option, version_option


@click.command(short_help="Open recordings in the viewer.")
@click.argument("recordings", metavar="RUN.rrd...", nargs=-1, required=True, type=click.Path(path_type=Path))
@debug_option
@version_option
def view(recordings: tuple[Path, ...]) -> int:
    """Open recordings that urmpipe wrote in Rerun's viewer, each paused where its verdict was decided.

    Each opens in a window of its own; the command ends when all are closed, and Ctrl-C closes them. The
    viewer is the one that was installed with urmpipe; it needs no network and listens on 127.0.0.1 only.
    Where there is no display, the command says how to look at a recording from another computer.

    \b
    Examples:
      urmpipe view log-against-path.rrd
      urmpipe view monday.rrd tuesday.rrd
    """
    try:
        urmpipe.view(recordings)
    except KeyboardInterrupt:
        click.echo("Closed.", err=True)
    return 0
