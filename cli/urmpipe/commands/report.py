"""`urmpipe report`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

import urmpipe
from urmpipe.options.given import options_given
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.types import OneOf
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.messages import Hint

if TYPE_CHECKING:
    from urmpipe.api.report import Report
    from urmpipe_pipeline.report.headless import FigureFormat

FORMATS: dict[str, tuple[FigureFormat, ...]] = {
    "svg": ("svg",),
    "png": ("png",),
    "both": ("svg", "png"),
}


@click.command(short_help="Write the HTML report of recordings.")
@click.argument("recordings", metavar="RUN.rrd...", nargs=-1, required=True, type=click.Path(path_type=Path))
@output_option("FILE.html", "The report [default: RUN.html here].")
@click.option(
    "--figures",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="Write every figure as a file into this folder, too.",
)
@click.option(
    "--formats",
    "--format",
    type=OneOf(list(FORMATS)),
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
    formats: str,
    terminal: Terminal,
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
    if figures is None and options_given(ctx, "formats".__eq__):
        hint = Hint("figures", None, "names their folder")
        raise OptionError(Finding("found without figures", parameter="formats", hints=(hint,)))
    target = output or Path(f"{recordings[0].stem}.html")
    replaces = target.is_file()
    with terminal.progress(f"Writing {target}") as progress:
        result = urmpipe.report(
            recordings, target, figures=figures, formats=FORMATS[formats], progress=progress
        )
    terminal.answer(result.to_dict, lambda: _print(result, figures, replaces))
    return 0


def _print(result: Report, figures: Path | None, replaces: bool) -> None:
    """Print what was written."""
    from urmpipe.printing.terminal import say

    earlier = "; it replaced an earlier one" if replaces else ""
    say(f"Report: {result.path}  (open it in any browser{earlier})")
    if figures:
        say(f"Figures: {len(result.figures)} files in {figures}")
