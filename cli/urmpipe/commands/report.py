"""`urmpipe report`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

import urmpipe
from urmpipe.options import output_options
from urmpipe.process import tune_pyarrow

if TYPE_CHECKING:
    from urmpipe_pipeline.report.headless import FigureFormat

FORMATS: dict[str, tuple[FigureFormat, ...]] = {
    "svg": ("svg",),
    "png": ("png",),
    "both": ("svg", "png"),
}


@click.command(short_help="Write the HTML report of recordings.")
@click.argument("recordings", metavar="RUN.rrd...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), help="The report [default: RUN.html here].")
@click.option(
    "--figures",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="Write every figure as a file into this folder, too.",
)
@click.option(
    "--format",
    "figure_format",
    type=click.Choice(list(FORMATS)),
    default="both",
    show_default=True,
    help="What the files of figures are.",
)
@output_options
@click.pass_context
def report(
    ctx: click.Context,
    /,
    recordings: tuple[Path, ...],
    output: Path | None,
    figures: Path | None,
    figure_format: str,
    as_json: bool,
    quiet: bool,
) -> int:
    """Write one self-contained HTML file about recordings that ingest, compare or simulate wrote.

    It needs no network: verdicts, figures, statistics, the audit of repolarizations, the drawing of a
    simulated system, warnings and provenance are inside. --figures needs Chromium and: pip install
    'urmpipe[figures]'.

    \b
    Examples:
      urmpipe report log-against-path.rrd
      urmpipe report monday.rrd tuesday.rrd -o week.html
      urmpipe report log-against-path.rrd --figures figures --format svg
    """
    source = ctx.get_parameter_source("figure_format")
    if figures is None and source == ParameterSource.COMMANDLINE:
        raise click.UsageError("--format: found without --figures, allowed: with --figures DIR")
    tune_pyarrow()
    from urmpipe.printing.terminal import print_json, progress_bar, say

    target = output or Path(f"{recordings[0].stem}.html")
    with progress_bar(f"Writing {target}", quiet=quiet) as progress:
        result = urmpipe.report(
            recordings, target, figures=figures, formats=FORMATS[figure_format], progress=progress
        )
    if as_json:
        print_json(result.to_dict())
    elif not quiet:
        say(f"Report: {result.path}  (open it in any browser)")
        if figures:
            say(f"Figures: {len(result.figures)} files in {figures}")
    return 0
