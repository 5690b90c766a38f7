"""`urmpipe report`."""

from __future__ import annotations

from pathlib import Path

import click

from urmpipe.options import output_options
from urmpipe.process import tune_pyarrow


@click.command(short_help="Write the HTML report of recordings.")
@click.argument("recordings", metavar="RUN.rrd...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), help="The report [default: RUN.html here].")
@output_options
def report(recordings: tuple[Path, ...], output: Path | None, as_json: bool, quiet: bool) -> int:
    """Write one self-contained HTML file about recordings that ingest or compare wrote.

    It needs no network: verdicts, figures, statistics, the audit of repolarizations, warnings and
    provenance are inside.

    \b
    Examples:
      urmpipe report log-against-path.rrd
      urmpipe report monday.rrd tuesday.rrd -o week.html
    """
    tune_pyarrow()
    from urmpipe import api
    from urmpipe.printing import print_json

    result = api.report(recordings, output or Path(f"{recordings[0].stem}.html"))
    if as_json:
        print_json(result.to_dict())
    elif not quiet:
        click.echo(f"Report: {result.path}  (open it in any browser)")
    return 0
