"""What was given on the command line itself, not by urmpipe.toml, and is refused where it means nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import click
from click.core import ParameterSource

from urmpipe.options.reading import OF_LOGS


def options_given(ctx: click.Context, asked: Callable[[str], bool]) -> list[str]:
    """Return the options of some parameters that stand on the command line, by their long names.

    Args:
        ctx: The command's context.
        asked: Whether the parameter of a name is asked for.
    """
    return [
        max(param.opts, key=len)
        for param in ctx.command.params
        if isinstance(param, click.Option)
        and asked(param.name or "")
        and ctx.get_parameter_source(param.name or "") == ParameterSource.COMMANDLINE
    ]


def about_recordings(ctx: click.Context, operands: Sequence[Path]) -> str | None:
    """Return what is to be said of options that say how a log is read, and of recordings among the operands.

    Args:
        ctx: The command's context.
        operands: Recordings, logs and folders of them.

    Raises:
        UsageError: If no operand is a log.
    """
    from urmpipe_pipeline.recording import is_recording

    given = options_given(ctx, OF_LOGS.__contains__)
    recordings = [str(path) for path in operands if path.is_file() and is_recording(path)]
    if not given or not recordings:
        return None
    options, files = ", ".join(given), ", ".join(recordings)
    if len(recordings) == len(operands):
        allowed = "with a log among them; a recording stands as it was ingested"
        raise click.UsageError(f"{options}: found with recordings alone ({files}), allowed: {allowed}")
    return f"{options} of the logs alone: {files} as ingested"
