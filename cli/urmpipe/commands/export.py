"""Write a recording as CSV, Parquet, MAT or TUM."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import urmpipe
from urmpipe.answers import Answer, Call, command
from urmpipe.command_line import operand
from urmpipe.parameters import kinds
from urmpipe.parameters.outputs import Export, file_output


@command(Export, output=file_output("FILE", "File to write [default: RUN-ROWS.FORMAT]."))
@operand("recording", kinds.RECORDING, metavar="RUN.rrd")
def export(call: Call, recording: Path, output: Path | None, **options: Any) -> Answer:
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
    columns = len(result.columns)
    return Answer(
        result, [f"Export: {file.path}  ({file.rows} rows, {columns} columns)" for file in result.files]
    )
