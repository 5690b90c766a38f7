"""`urmpipe compare`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from urmpipe.options import about_recordings, log_options, output_options, take_log_options
from urmpipe.process import tune_pyarrow

TOLERANCE = 0.0035


def _sync(ctx: click.Context, param: click.Parameter, value: str) -> str | float:
    """Return how the clocks are put together: start, auto, or an offset in [s]."""
    if value in ("start", "auto"):
        return value
    try:
        return float(value)
    except ValueError:
        raise click.BadParameter(f"found {value!r}, allowed: start, auto, or a time in s") from None


def _tolerance(ctx: click.Context, param: click.Parameter, value: str | float) -> dict[str, float]:
    """Return what is allowed, by kind."""
    from urmpipe_pipeline.tolerance import parse_tolerance

    return parse_tolerance(str(value))


@click.command(short_help="Hold logs against a reference and give a verdict.")
@click.argument("reference", type=click.Path(path_type=Path))
@click.argument("logs", metavar="[LOG...]", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="The recording [default: LOG-against-REFERENCE.rrd here].",
)
@click.option(
    "--tolerance",
    default=str(TOLERANCE),
    show_default=True,
    callback=_tolerance,
    metavar="M|KIND=VALUE,...",
    help="Largest deviation allowed: on an axis in m, or of kinds: axis, norm, path, angle, joint, x, y, z.",
)
@click.option(
    "--tcp",
    type=click.Choice(["fk", "recorded"]),
    default="fk",
    show_default=True,
    help="Where a log was: by its joints, or as it recorded itself.",
)
@click.option(
    "--sync",
    default="start",
    show_default=True,
    callback=_sync,
    metavar="start|auto|SECONDS",
    help="Start both together, find the offset by the motion, or t_reference = t_log + SECONDS.",
)
@click.option(
    "--align",
    type=click.Choice(["none", "start", "rigid", "tool"]),
    default="none",
    show_default=True,
    help="Move the log first: to the same start pose, by the best rigid motion, by the best tool offset.",
)
@log_options
@output_options
@click.pass_context
def compare(
    ctx: click.Context,
    /,
    reference: Path,
    logs: tuple[Path, ...],
    output: Path | None,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> int:
    """Hold logs against a reference: deviation, statistics, verdict.

    REFERENCE is a path (t, x, y, z), a log, or a recording; so is each LOG. With REFERENCE alone, the
    forward kinematics of that log are held against the tool centre point that it recorded itself. A
    folder stands for the files of one log.

    \b
    Examples:
      urmpipe compare path.csv log.csv --robot urm6
      urmpipe compare path.csv coppelia.csv matlab.csv solidworks/ --robot urm6 --json
      urmpipe compare robot_data.csv --robot ur5e --tolerance 0.002

    Exit codes: 0 within tolerance, 1 out of tolerance, 2 bad input or usage.
    """
    tune_pyarrow()
    from urmpipe import api
    from urmpipe.printing import print_comparison, print_json, print_recording, print_warnings, progress_bar

    said = about_recordings(ctx, (reference, *logs))
    if said and not quiet:
        click.echo(f"note: {said}", err=True)
    robot, read = take_log_options(options)
    names = ("tsp", "derivative", "strict", "tolerance", "tcp", "sync", "align")
    shared = {name: options.pop(name) for name in names}
    target = output or Path(default_name(reference, logs))
    with progress_bar(f"Writing {target}", quiet=quiet) as progress:
        result = api.compare(
            reference,
            logs,
            robot=robot,
            read=read,
            output=target,
            progress=progress,
            **shared,
        )
    if not quiet:
        for one in result.runs:
            print_warnings(one.run.warnings, one.name)
        print_warnings(result.warnings)
    if as_json:
        print_json(result.to_dict())
    elif not quiet:
        print_comparison(result)
        print_recording(result.recording)
    return 0 if result.verdict == "pass" else 1


def default_name(reference: Path, logs: tuple[Path, ...]) -> str:
    """Return LOG-against-REFERENCE.rrd; of several logs the first names it."""
    against = reference.resolve().stem
    if not logs:
        return f"{against}-against-itself.rrd"
    more = f"-and-{len(logs) - 1}-more" if len(logs) > 1 else ""
    return f"{logs[0].resolve().stem}{more}-against-{against}.rrd"
