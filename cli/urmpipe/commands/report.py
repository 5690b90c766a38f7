"""`urmpipe report`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.options.completion import folders, one_of_each, words
from urmpipe.options.given import options_given
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.types import RECORDING, NamesType, WholeType, quantity_type
from urmpipe_models.errors import Finding, Hint, OptionError

if TYPE_CHECKING:
    from urmpipe.api.report import Report

OF_FIGURES = ("formats", "figure_names", "figure_width", "figure_font", "figure_dpi")
"""Options that mean nothing without the folder of figures."""


@click.command(short_help="Write the HTML report of recordings.")
@click.argument("recordings", metavar="RUN.rrd...", nargs=-1, required=True, type=RECORDING)
@output_option("FILE.html", "Report to write [default: RUN.html].")
@click.option(
    "--figures",
    metavar="DIR",
    type=click.Path(path_type=Path),
    shell_complete=folders,
    help="Write the figures as files into this folder, too.",
)
@click.option(
    "--formats",
    "--format",
    metavar="FORMATS",
    type=NamesType(),
    shell_complete=one_of_each("pdf", "svg", "png"),
    default="pdf,png",
    show_default=True,
    help="Formats of figures: pdf, svg, png.",
)
@click.option(
    "--figure-names",
    metavar="TITLE",
    multiple=True,
    help="Write only figures of this title or pattern (repeatable).",
)
@click.option(
    "--figure-width",
    metavar="WIDTH",
    shell_complete=words("column", "page"),
    default="page",
    show_default=True,
    help="column (88 mm), page (180 mm), or a length such as 85mm or 3.5in.",
)
@click.option(
    "--figure-font",
    type=quantity_type("pt"),
    default=8.0,
    show_default=True,
    help="Size of the text in figures, such as 8pt.",
)
@click.option(
    "--figure-dpi",
    type=WholeType(),
    default=300,
    show_default=True,
    help="Resolution of PNG files in dots per inch.",
)
@output_options
@click.pass_context
def report(
    ctx: click.Context,
    /,
    recordings: tuple[Path, ...],
    output: Path | None,
    figures: Path | None,
    terminal: Terminal,
    **of_figures: Any,
) -> int:
    """Write one self-contained HTML report of recordings that ingest, compare or simulate wrote.

    It needs no network. It contains verdicts, figures, statistics, the audit of repolarizations (phase
    unwrapping that keeps real jumps), the drawing of a simulated system, warnings and provenance. --figures
    needs: pip install 'urmpipe[figures]'. Drawings such as that of a system are always SVG files.

    \b
    Examples:
      urmpipe report log-against-path.rrd
      urmpipe report monday.rrd tuesday.rrd -o week.html
      urmpipe report log-against-path.rrd --figures figures --formats pdf,svg
      urmpipe report compared.rrd --figures DIR --figure-names "Deviation*"
    """
    without = [one for one in OF_FIGURES if options_given(ctx, one.__eq__)] if figures is None else []
    if without:
        hint = Hint("figures", None, "names their folder")
        raise OptionError(
            *(Finding("found without figures", parameter=one, hints=(hint,)) for one in without)
        )
    target = output or Path(f"{recordings[0].stem}.html")
    replaces = target.is_file()
    with terminal.progress(f"Writing {target}") as progress:
        result = urmpipe.report(recordings, target, figures=figures, **of_figures, progress=progress)
    terminal.answer(result.to_dict, lambda: _print(result, figures, replaces))
    return 0


def _print(result: Report, figures: Path | None, replaces: bool) -> None:
    """Print what was written."""
    from urmpipe.printing.terminal import say

    earlier = "; it replaced an earlier one" if replaces else ""
    say(f"Report: {result.path}  (open it in any browser{earlier})")
    if figures:
        say(f"Figures: {len(result.figures)} files in {figures}")
