"""`urmpipe export`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.types import RECORDING, OneOf

if TYPE_CHECKING:
    from urmpipe_pipeline.tables import Exported


@click.command(short_help="Write a recording as CSV, Parquet, MAT or TUM.")
@click.argument("recording", metavar="RUN.rrd", type=RECORDING)
@click.option(
    "--to",
    type=OneOf(["csv", "parquet", "mat", "tum"]),
    help="Format [default: by the suffix of the output, else csv].",
)
@output_option("FILE", "File to write [default: RUN-ROWS.FORMAT].")
@click.option(
    "--rows",
    type=OneOf(["grid", "file", "velocities", "samples", "criteria"]),
    help="Rows of a log: grid, in SI on the time grid, or file, with the file's own names and units [default:"
    " grid]; of accuracy: velocities or samples [default: velocities]; of compare --iso: criteria.",
)
@click.option(
    "--tcp",
    type=OneOf(["fk", "recorded"]),
    help="Source of the tool poses for --to tum: fk, from the joint values; recorded, from the log"
    " [default: fk].",
)
@output_options
def export(recording: Path, output: Path | None, terminal: Terminal, **options: Any) -> int:
    """Export the data of a recording for other tools.

    --rows grid has the processed log in SI: t, repolarized joint values (phase unwrapping that keeps real
    jumps), rates, torques where the robot has masses, and the motion of the tool centre point (TCP). --rows
    file has the log as it was: its own columns, names, units and clock, not repolarized or resampled.
    Columns that ingest did not use are not in a recording.

    A comparison is exported as its deviations, in TUM as two trajectories for evo, reference and log. A
    simulation is exported as its signals BLOCK.VARIABLE with their units, in TUM as the tip of each arm. An
    existing CSV file is never replaced.

    \b
    Examples:
      urmpipe export log.rrd --to csv
      urmpipe export log.rrd --rows file -o log-again.csv
      urmpipe export log.rrd -o log.mat
      urmpipe export log.rrd --to tum --tcp recorded
      urmpipe export log-against-path.rrd -o deviations.parquet --json
      urmpipe export one-drive.rrd -o one-drive.csv
    """
    result = urmpipe.export(recording, output, **options)
    terminal.warn(result.warnings)
    terminal.answer(result.to_dict, lambda: _print(result))
    return 0


def _print(result: Exported) -> None:
    """Print what was written."""
    from urmpipe.printing.terminal import say

    for one in result.files:
        say(f"Export: {one.path}  ({one.rows} rows, {len(result.columns)} columns)")
