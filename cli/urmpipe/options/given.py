"""What was given on the command line itself, not by urmpipe.toml, and is refused where it means nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

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


DECIDING = ("tolerance", "align", "sync", "skip_bad")
"""Options that may turn a verdict: its line names the file that sets them."""


def deciding_defaults(ctx: click.Context, options: Mapping[str, Any]) -> tuple[str, ...]:
    """Return which of a command's options decide a verdict and come from a file: "sync=auto from FILE".

    Args:
        ctx: The command's context.
        options: The options as they are used, by their keywords.
    """
    used = {
        max(param.opts, key=len).removeprefix("--")
        for param in ctx.command.params
        if param.name in DECIDING
        and options.get(param.name) not in (None, False)
        and ctx.get_parameter_source(param.name) == ParameterSource.DEFAULT_MAP
    }
    return tuple(ctx.obj.origins(used)) if used else ()


def for_logs(
    ctx: click.Context, operands: Sequence[Path], options: Mapping[str, Any]
) -> tuple[dict[str, Any], str | None]:
    """Return options without those of logs where none is among the operands, and what is to be said of them.

    Args:
        ctx: The command's context.
        operands: Recordings, logs and folders of them.
        options: The options by their keywords.

    Raises:
        UsageError: If such an option stands on the command line, and no operand is a log.
    """
    from urmpipe_pipeline.operands import is_log

    given = options_given(ctx, OF_LOGS.__contains__)
    recordings = [str(path) for path in operands if not is_log(path)]
    files = ", ".join(recordings)
    if len(recordings) == len(operands):
        if given:
            found = f"{', '.join(given)}: found with recordings only ({files})"
            allowed = "with at least one log; recordings are used as ingested"
            raise click.UsageError(f"{found}, allowed: {allowed}")
        return {name: value for name, value in options.items() if name not in OF_LOGS}, None
    note = (
        f"{', '.join(given)} applied to the logs only: {files} used as ingested"
        if given and recordings
        else None
    )
    return dict(options), note
