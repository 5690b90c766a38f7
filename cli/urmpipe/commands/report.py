"""Write the HTML report of recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import urmpipe
from urmpipe.answers import Answer, Call, command
from urmpipe.command_line import operand
from urmpipe.parameters import kinds
from urmpipe.parameters.outputs import Report, file_output
from urmpipe_models.errors import Finding, Hint, OptionError

OF_FIGURES = ("formats", "figure_names", "figure_width", "figure_font", "figure_dpi")  # need --figures


@command(Report, output=file_output("FILE.html", "Report to write [default: RUN.html].", ".html"))
@operand("recordings", kinds.RECORDING, metavar="RUN.rrd...", nargs=-1, required=True)
def report(call: Call, recordings: tuple[Path, ...], output: Path | None, **options: Any) -> Answer:
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
    figures = options["figures"]
    without = [] if figures else [name for name in OF_FIGURES if call.explicit_options(name.__eq__)]
    if without:
        hint = Hint("figures", None, "names their folder")
        raise OptionError(
            *(Finding("found without figures", parameter=name, hints=(hint,)) for name in without)
        )
    target = output or Path(f"{recordings[0].stem}.html")
    replaced = "; it replaced an earlier one" if target.is_file() else ""
    with call.progress(f"Writing {target}") as progress:
        result = urmpipe.report(recordings, target, progress=progress, **options)
    lines = [f"Report: {result.path}  (open it in any browser{replaced})"]
    lines += [f"Figures: {len(result.figures)} files in {figures}"] if figures else []
    return Answer(result, lines, to_dict=result.to_dict)
