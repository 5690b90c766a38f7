"""Open recordings in the viewer."""

from __future__ import annotations

from pathlib import Path

import click

import urmpipe
from urmpipe.answers import Answer, Call, command
from urmpipe.command_line import operand
from urmpipe.parameters import kinds


@command(prints=False)
@operand("recordings", kinds.RECORDING, metavar="RUN.rrd...", nargs=-1, required=True)
def view(call: Call, recordings: tuple[Path, ...]) -> Answer:
    """Open recordings in Rerun's viewer, each paused at the sample that decided its verdict.

    Each recording opens in its own window. The command ends when all windows are closed; Ctrl-C closes
    them. The viewer is installed with urmpipe; it needs no network and listens on 127.0.0.1 only. Without a
    display, the command explains how to view a recording from another computer.

    \b
    Examples:
      urmpipe view log-against-path.rrd
      urmpipe view monday.rrd tuesday.rrd
    """
    try:
        urmpipe.view(recordings)
    except KeyboardInterrupt:
        click.echo("Closed.", err=True)
    return Answer()
