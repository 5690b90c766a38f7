"""`urmpipe accuracy`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.headings import HeadedCommand, Heading, option
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.planning import law_options, path_completion, start_option
from urmpipe.options.reading import path_options
from urmpipe.options.types import DEVIATION, OneOf, quantity_type

if TYPE_CHECKING:
    from urmpipe_pipeline.accuracy.result import AccuracyResult


@click.command(cls=HeadedCommand, short_help="Measure the path error of an arm with drives.")
@option(
    Heading.PLANNING,
    "--path",
    required=True,
    metavar="PATH.csv|cube:...",
    shell_complete=path_completion,
    help="Path of lines and arcs, or a test cube, as for plan.",
)
@option(
    Heading.PLANNING,
    "--velocities",
    type=quantity_type("m/s", "V1,V2,...", positive=False),
    default="0.1,0.2,0.3,0.4,0.5,0.6,0.7,0.8,0.9,1.0",
    show_default=True,
    help="Speeds along the path to run, such as 100mm/s,0.2m/s; numbers alone are in m/s.",
)
@law_options
@option(
    Heading.JUDGING,
    "--limit",
    type=DEVIATION,
    help="Largest allowed error, such as 0.4mm: judge each velocity, and find the largest within it.",
)
@option(
    Heading.JUDGING,
    "--error",
    type=OneOf(["time", "path"]),
    default="time",
    show_default=True,
    help="Judged error: distance from the set point at the same time, or from the path.",
)
@option(
    Heading.RUNNING,
    "--force",
    type=quantity_type("N", "FX,FY,FZ", positive=False),
    help="External force on the tool in N, in the world frame [default: none].",
)
@start_option
@option(
    Heading.RUNNING,
    "--backend",
    type=OneOf(["native", "python"]),
    help="Run the arm as compiled C or in Python [default: native if a compiler is found].",
)
@output_option("RUN.rrd", "Recording to write.")
@path_options
@output_options
def accuracy(path: str, output: Path | None, terminal: Terminal, **options: Any) -> int:
    """Run an arm with drives along a path at several velocities, and measure its path error.

    The path is planned at each velocity; its set points are the inputs of the arm's controllers. With
    --limit, the command gives a verdict and finds the running speed: the largest velocity within the limit,
    to 1 %. The robot needs masses, and a drive or a spring for every joint.

    \b
    Examples:
      urmpipe accuracy --robot irb60 --path cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1
      urmpipe accuracy --robot irb60 --path contour.csv --limit 0.4mm -o run.rrd
      urmpipe accuracy --robot my-arm.toml --path contour.csv --error path --json
      urmpipe accuracy --robot my-arm.toml --path contour.csv --force 0,0,-50N

    Exit codes: 0 done, and with --limit every velocity within it, 1 a velocity above the limit, 2 bad input
    or usage.
    """
    from urmpipe.systems.blocks import ON_PYTHON

    replaces = output is not None and output.exists()
    with terminal.progress(f"Running along {path}") as progress:
        result = urmpipe.accuracy(path, output=output, told=terminal.note, progress=progress, **options)
    terminal.warn([one for one in result.warnings if one.kind != ON_PYTHON])  # that is told already
    terminal.answer(result.to_dict, lambda: _print(result, replaces))
    return 1 if result.verdict == "fail" else 0


def _print(result: AccuracyResult, replaces: bool) -> None:
    """Print what the runs came to, and what was written."""
    from urmpipe.printing.results import print_presentation
    from urmpipe.printing.terminal import print_recording
    from urmpipe_pipeline.results import present

    print_presentation(present(result))
    if result.recording is not None:
        print_recording(result.recording, replaced=replaces)
