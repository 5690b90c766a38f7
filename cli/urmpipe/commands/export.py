"""`urmpipe export`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.types import OneOf

if TYPE_CHECKING:
    from urmpipe_pipeline.tables import Exported


@click.command(short_help="Write a recording as CSV, Parquet, MAT or TUM.")
@click.argument("recording", metavar="RUN.rrd", type=click.Path(path_type=Path))
@click.option(
    "--to",
    type=OneOf(["csv", "parquet", "mat", "tum"]),
    help="The format [default: by the suffix of the output, else csv].",
)
@output_option("FILE", "The file [default: RUN-ROWS.FORMAT here].")
@click.option(
    "--rows",
    type=OneOf(["grid", "file", "velocities", "samples", "criteria"]),
    help="The run on its grid in SI, or the file's own rows, names and units [default: grid]; of an accuracy"
    " its velocities or all samples [default: velocities]; of a test (compare --iso) its criteria.",
)
@click.option(
    "--tcp",
    type=OneOf(["fk", "recorded"]),
    help="Poses for --to tum: by the joints, or as the log recorded them [default: fk].",
)
@output_options
def export(recording: Path, output: Path | None, terminal: Terminal, **options: Any) -> int:
    """Write what a recording holds, for other tools.

    --rows grid is what urmpipe made of a log: t, the repolarized joints, their rates, their torques where
    the robot has masses, and the motion of the tool centre point, in SI. --rows file is what the log said:
    its columns under their own names, in their own units, with its own clock; nothing is repolarized or
    resampled. Columns that ingest did not use are not in a recording.

    A comparison leaves as its deviations; as TUM, reference and actual become two trajectories for evo. A
    simulation leaves as its signals, each under BLOCK.VARIABLE with its unit; as TUM, the tip of each arm. A
    CSV carries no mark of whose it is, so an existing one is never replaced.

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
    terminal.answer(lambda: result.to_dict("command line"), lambda: _print(result))
    return 0


def _print(result: Exported) -> None:
    """Print what was written."""
    from urmpipe.printing.terminal import say

    for one in result.files:
        say(f"Export: {one.path}  ({one.rows} rows, {len(result.columns)} columns)")
